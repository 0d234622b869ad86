"""Small workspaces: a pendulum of frames without parts, a pendulum with a part, and an emitter that fails on request."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import textwrap
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, Future
from pathlib import Path
from typing import Any

import pytest

from conformance.harness import thingc_here
from thingc.batch import batch
from thingc.batch.job import Job
from thingc.batch.runner import Runner
from thingc.batch.variant import Variant

PENDULUM = """
    thingc: assembly/1
    name: pendulum
    parameters:
      length: {value: 300 mm, min: 100 mm, max: 900 mm}
      bob: {value: 500 g, min: 1 g, max: 20 kg}
      effort: 6 N*m
      tilt: 20 deg
      damped: true
      label: plain
      steps: 3
      double: "=2 * length"
      fault: none
    materials:
      light: {density: 500 kg/m^3}
      heavy: {density: 5000 kg/m^3}
    components:
      stand: {frame: true, mass: 2 kg, inertia: {ixx: 0.01 kg*m^2, iyy: 0.01 kg*m^2, izz: 0.01 kg*m^2}}
      rod:
        frame: true
        mass: 100 g
        com: ["=length / 2", 0, 0]      # hangs along its x
        inertia: {ixx: 0.001 kg*m^2, iyy: 0.002 kg*m^2, izz: 0.002 kg*m^2}
        mounts: {end: {xyz: ["=length", 0, 0]}}
      weight:
        frame: true
        mass: =bob
        inertia: {ixx: 0.001 kg*m^2, iyy: 0.001 kg*m^2, izz: 0.001 kg*m^2}
    joints:
      swing:
        type: revolute
        parent: stand.origin
        child: rod.origin
        limit: {lower: -90 deg, upper: 90 deg}
        drive: {kind: position, kp: 20 N*m/rad, effort: =effort}
      twist:
        type: revolute
        parent: rod.end
        child: weight.origin
        limit: {lower: -90 deg, upper: 90 deg}
    mounts: {top: stand.origin, bob: weight.origin}
    poses:
      tilted: {swing: =tilt}
    modes:
      hanging: {root: stand, base: fixed, pose: tilted, at: {rpy: 90 0 0 deg}}
      flying: {root: rod, base: free}
"""

SWEEP = """
    thingc: variants/1
    assembly: pendulum.yaml
    name: sweep
    parameters:
      length: [200 mm, 300 mm, 400 mm]
      bob: {from: 100 g, to: 400 g, count: 4}
    reach: {of: bob, from: top}
"""

PLATES = """
    from build123d import Box, Location

    from thingc import Length, MountPoint, Thing


    class Square(Thing):
        def __init__(self, side: Length = 40):
            super().__init__(material="light")
            self.body = Box(side, side, 10)
            self.top = MountPoint(Location((0, 0, 5)))

        def result(self):
            return self.body


    class Round(Thing):
        def __init__(self, side: Length = 40):
            from build123d import Cylinder

            super().__init__(material="light")
            self.body = Cylinder(side / 2, 10)
            self.top = MountPoint(Location((0, 0, 5)))

        def result(self):
            return self.body
"""

STAND = """
    thingc: assembly/1
    name: stand
    parameters:
      side: {value: 40 mm, min: 10 mm, max: 100 mm}
    materials:
      light: {density: 500 kg/m^3}
      heavy: {density: 5000 kg/m^3}
    components:
      plate: {part: plates:Square, params: {side: =side}}
      mast: {assembly: mast.yaml, attach: {foot: plate.top}}
    mounts: {base: plate.origin}
"""

MAST = """
    thingc: assembly/1
    name: mast
    materials:
      light: {density: 500 kg/m^3}
      heavy: {density: 5000 kg/m^3}
    components:
      lower: {part: plates:Square}
      upper: {part: plates:Round, attach: {origin: lower.top}}
    mounts: {foot: lower.origin, top: upper.top}
"""

TALL_MAST = """
    thingc: assembly/1
    name: tall_mast
    materials:
      light: {density: 500 kg/m^3}
    components:
      lower: {part: plates:Square}
      middle: {part: plates:Square, attach: {origin: lower.top}}
      upper: {part: plates:Round, attach: {origin: middle.top}}
    mounts: {foot: lower.origin, top: upper.top}
"""

EMITTER = '''
    """A target that does what the robot's parameter `fault` says: a process that dies, hangs or raises on the way."""

    import ctypes
    import os
    import signal
    import time

    from thingc.targets.artifact import Artifacts

    WRITES = ("fault.txt",)


    def emit(request):
        fault = dict(request.assembly.definition.parameters)["fault"]
        if fault == "kill":
            os.kill(os.getpid(), signal.SIGKILL)
        if fault == "segv":
            ctypes.string_at(0)
        if fault == "hang":
            time.sleep(3600)
        if fault == "raise":
            raise RuntimeError("the emitter has given up")
        if fault == "slow":
            time.sleep(0.3)
        return Artifacts(files={"fault.txt": fault.encode()})
'''


def workspace(folder: Path, **documents: str) -> Path:
    """Create a folder with the documents above and further documents (`name="text"` is `name.yaml`), and return it."""
    (folder / "parts").mkdir(parents=True, exist_ok=True)
    (folder / "thingc.toml").write_text('thingc = "workspace/1"\nparts = ["parts"]\n')
    (folder / "parts" / "plates.py").write_text(textwrap.dedent(PLATES))
    known = {"pendulum": PENDULUM, "sweep": SWEEP, "stand": STAND, "mast": MAST, "tall_mast": TALL_MAST}
    for name, text in {**known, **documents}.items():
        (folder / f"{name}.yaml").write_text(textwrap.dedent(text).lstrip())
    return folder


def with_emitter(folder: Path) -> str:
    """Install the emitter in a package beside the workspace, and return the PYTHONPATH with its entry point."""
    place = folder / "installed"
    info = place / "faulty-1.0.dist-info"
    info.mkdir(parents=True)
    (place / "faulty_target.py").write_text(textwrap.dedent(EMITTER))
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: faulty\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[thingc.emitters]\nfaulty = faulty_target:emit\n")
    return str(place)


def environment(store: str, path: str = "") -> dict[str, str]:
    """Return the environment variables of a command in a separate process."""
    found = {**os.environ, "THINGC_STORE": store, "NO_COLOR": "1"}
    if path:
        found["PYTHONPATH"] = os.pathsep.join(part for part in (path, os.environ.get("PYTHONPATH", "")) if part)
    return found


def thingc(*words: str, cwd: Path, env: dict[str, str]) -> subprocess.CompletedProcess[str]:
    """Run a command of thingc, and wait for its end."""
    return subprocess.run([sys.executable, "-m", "thingc", *words], cwd=cwd, env=env, capture_output=True, text=True, timeout=300)


class InThisProcess(Executor):
    """Builds variants like a runner, but without a process, whose start takes longer than a hundred pendulums."""

    def __init__(self, jobs: int = 1) -> None:
        """The arguments are those of `LocalExecutor`, which this class can replace."""

    def submit(
        self, evaluate: Callable[..., Any], /, job: str, tasks: Sequence[Variant], timeout: float,
        on_row: Callable[[Any], None] = lambda row: None,
    ) -> Future[Any]:
        """Return the rows of a chunk, as a runner writes them to its pipe."""
        done: Future[Any] = Future()
        with Runner(Job.decode(job)) as runner:
            rows = [{**json.loads(json.dumps(runner.build(task))), "pid": os.getpid()} for task in tasks]
        for row in rows:
            on_row(row)
        done.set_result(rows)
        return done


def batch_here(*words: str, cwd: Path, env: Mapping[str, str], runners: bool = False) -> subprocess.CompletedProcess[str]:
    """Run `thingc batch` in this process, for tests that do not depend on the process of the driver. Variants are built in this process
    too, unless `runners` build them."""
    with pytest.MonkeyPatch.context() as patch:
        for name, value in env.items():
            patch.setenv(name, value)
        for folder in filter(None, env.get("PYTHONPATH", "").split(os.pathsep)):
            patch.syspath_prepend(folder)
        if not runners:
            patch.setattr(batch, "LocalExecutor", InThisProcess)
        ran = thingc_here("batch", *words, cwd=cwd)
        sys.modules.pop("faulty_target", None)  # another test has another one
    return subprocess.CompletedProcess(words, ran.code, ran.out, ran.err)


def tree(folder: Path) -> dict[str, bytes]:
    """Return all files below a folder."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}
