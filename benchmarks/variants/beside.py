"""Compare `thingc.family` with other ways to create variants: `python benchmarks/variants/beside.py [--count N] [--rounds N]`.

The robot is a planar arm without parts. The link lengths and the drive gain of the arm differ in each variant, and masses and centres of
mass depend on the lengths. Each lane creates models one after the other, and the result is the number of models per second of CPU time. The
lane `own` uses `thingc.family(DOC).models(many)`, and the lane `lent` uses the same method with `share=True`. The lane `MjSpec` writes the
new values into one `MjSpec` of the built file and compiles it. The lane `PyMJCF` does the same with elements of dm_control in another
process (`edit_pymjcf.py`), in the environment that `make conformance` creates.

The lanes run in turn, for several rounds. The table contains the median, the smallest and the largest rate. Before the measurement, some
models of each lane are compared with the models of thingc, in all arrays of numbers. The program exits with 1 if a number differs by more
than 1e-12.
"""

from __future__ import annotations

import argparse
import contextlib
import itertools
import statistics
import subprocess
import sys
import tempfile
import textwrap
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

import thingc

ROOT = Path(__file__).resolve().parents[2]
PLANAR = """
    thingc: assembly/1
    name: planar
    parameters:
      upper: {value: 300 mm, min: 100 mm, max: 600 mm}
      fore: {value: 250 mm, min: 100 mm, max: 600 mm}
    defaults:
      joint:
        limit: {lower: -120 deg, upper: 120 deg}
        dynamics: {damping: 0.05 N*m*s/rad}
        drive: {kind: position, kp: 50 N*m/rad, effort: 10 N*m}
    components:
      base: {frame: true, mass: 2 kg, inertia: {ixx: 0.01 kg*m^2, iyy: 0.01 kg*m^2, izz: 0.01 kg*m^2}}
      upper_arm:
        frame: true
        mass: =100 g + 0.9 kg/m * upper
        com: [=upper / 2, 0, 0]
        inertia: {ixx: 0.001 kg*m^2, iyy: 0.004 kg*m^2, izz: 0.004 kg*m^2}
        mounts: {elbow: {xyz: [=upper, 0, 0]}}
      forearm:
        frame: true
        mass: =80 g + 0.7 kg/m * fore
        com: [=fore / 2, 0, 0]
        inertia: {ixx: 0.001 kg*m^2, iyy: 0.003 kg*m^2, izz: 0.003 kg*m^2}
        mounts: {tip: {xyz: [=fore, 0, 0]}}
    joints:
      shoulder: {type: revolute, parent: base.origin, child: upper_arm.origin}
      elbow: {type: revolute, parent: upper_arm.elbow, child: forearm.origin}
    mounts: {tip: forearm.tip}
    modes: {bench: {root: base, base: fixed, at: {rpy: 90 0 0 deg}}}
"""
GAIN = "defaults.joint.drive.kp"
BOUND = 1e-12
SLOW = {"own": 0.3, "MjSpec": 0.1, "PyMJCF": 0.01}
"""Fraction of the variants that each slow lane creates."""


def numbers(index: int) -> tuple[float, float, float]:
    """Return two lengths [m] and a gain [N m/rad] for an index. The numbers differ for each index."""
    part = (index * 0.6180339887498949) % 1.0
    return 0.2 + 0.3 * part, 0.5 - 0.3 * part, 40.0 + 20.0 * part


def settings(index: int) -> dict[str, float]:
    """Return the lengths and the gain for an index as settings of a robot family."""
    return dict(zip(("upper", "fore", GAIN), numbers(index)))


def edited(spec: mujoco.MjSpec, upper: float, fore: float, gain: float) -> mujoco.MjModel:
    """Write the numbers and the values that depend on them into an `MjSpec`, and return the compiled model."""
    for name, length, mass in (("upper_arm", upper, 0.1 + 0.9 * upper), ("forearm", fore, 0.08 + 0.7 * fore)):
        body = spec.body(name)
        body.mass = mass
        body.ipos = [length / 2, 0.0, 0.0]
    spec.body("forearm").pos = [upper, 0.0, 0.0]
    spec.site("tip").pos = [fore, 0.0, 0.0]
    for actuator in spec.actuators:
        actuator.gainprm[0], actuator.biasprm[1] = gain, -gain
    return spec.compile()


def apart(model: mujoco.MjModel, other: mujoco.MjModel) -> float:
    """Return the largest difference between two models in any array of floats. Return infinity if arrays have different shapes."""
    worst = 0.0
    for name in dir(model):
        ours, theirs = getattr(model, name, None), getattr(other, name, None)
        if isinstance(ours, np.ndarray) and isinstance(theirs, np.ndarray) and ours.dtype.kind == "f":
            if ours.shape != theirs.shape:
                return float("inf")
            worst = max(worst, float(np.abs(ours - theirs).max(initial=0.0)))
    return worst


class PyMJCF:
    """A client of the process `edit_pymjcf.py`, which creates models with PyMJCF."""

    def __init__(self, python: Path, model: Path) -> None:
        words = [str(python), str(Path(__file__).with_name("edit_pymjcf.py")), str(model)]
        self.process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)

    def ask(self, *words: object) -> str:
        """Send a line to the process, and return its answer."""
        assert self.process.stdin is not None and self.process.stdout is not None
        print(*words, file=self.process.stdin, flush=True)
        answer = self.process.stdout.readline()
        if not answer:
            raise SystemExit("edit_pymjcf.py has ended")
        return answer

    def model(self, index: int, scratch: Path) -> mujoco.MjModel:
        """Return the model with the numbers for an index."""
        self.ask("save", *numbers(index), scratch / "model.mjb")
        return mujoco.MjModel.from_binary_path(str(scratch / "model.mjb"))

    def seconds(self, indices: list[int]) -> float:
        """Create models for several indices, and return the CPU time [s] of the process."""
        return float(self.ask("time", *itertools.chain.from_iterable(map(numbers, indices))))


@contextlib.contextmanager
def pymjcf(model: Path) -> Iterator[PyMJCF]:
    """Return a context manager that starts the process `edit_pymjcf.py` with a model. Raises `SystemExit` if PyMJCF is not available."""
    sys.path.insert(0, str(ROOT / "benchmarks" / "conformance"))
    from study import READERS

    folder = ROOT / "build" / "conformance"
    folder.mkdir(parents=True, exist_ok=True)
    (reader,) = (one for one in READERS if one.name == "pymjcf")
    python = reader.environment(folder)
    if python is None:
        raise SystemExit(f"PyMJCF is not available here ({' '.join(reader.packages)})")
    made = PyMJCF(python, model)
    try:
        yield made
    finally:
        made.process.communicate()


def built(folder: Path, *words: str) -> Path:
    """Build the planar arm, and return the path of its MuJoCo model."""
    done = subprocess.run(
        [sys.executable, "-m", "thingc", "build", "planar.yaml", "--emit", "mjcf", *words], cwd=folder, capture_output=True, text=True,
    )
    if done.returncode:
        raise SystemExit(done.stderr)
    return folder / "build" / "planar" / "mjcf" / "planar_bench.xml"


def timed(make: Callable[[list[int]], Any], indices: list[int]) -> float:
    """Call a function with the indices of variants, and return the CPU time [s] of this process."""
    begun = time.process_time()
    make(indices)
    return time.process_time() - begun


def main() -> int:
    """Compare the models of all lanes and measure the rates. Return 1 if models differ."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=4000, help="number of variants per round for the fastest lane (default: %(default)s)")
    parser.add_argument("--rounds", type=int, default=5, help="measurements per lane, after one warm-up")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="thingc-beside-") as name:
        folder = Path(name)
        (folder / "thingc.toml").write_text('thingc = "workspace/1"\n')
        (folder / "planar.yaml").write_text(textwrap.dedent(PLANAR).lstrip())
        spec = mujoco.MjSpec.from_file(str(built(folder)))
        with thingc.family(folder / "planar.yaml") as family, pymjcf(built(folder, "--compat", "pymjcf")) as elsewhere:
            some = range(0, 200, 10)
            ours = list(family.models(map(settings, some)))
            assert all(ours), ours
            hands = {"MjSpec": lambda index: edited(spec, *numbers(index)), "PyMJCF": lambda index: elsewhere.model(index, folder)}
            worst = {label: max(apart(model, make(index)) for model, index in zip(ours, some)) for label, make in hands.items()}
            for label, found in worst.items():
                print(f"{label}: in {len(some)} models no number is further than {found:.1e} from thingc's")
            lanes: dict[str, Callable[[list[int]], float]] = {
                "own": lambda indices: timed(lambda some: [None for _ in family.models(map(settings, some))], indices),
                "lent": lambda indices: timed(lambda some: [None for _ in family.models(map(settings, some), share=True)], indices),
                "MjSpec": lambda indices: timed(lambda some: [edited(spec, *numbers(index)) for index in some] and None, indices),
                "PyMJCF": elsewhere.seconds,
            }
            fresh = itertools.count(1000)
            rates: dict[str, list[float]] = {label: [] for label in lanes}
            for turn in range(-1, arguments.rounds):
                for label, lane in lanes.items():
                    indices = list(itertools.islice(fresh, max(8, int(arguments.count * SLOW.get(label, 1.0)))))
                    rate = len(indices) / max(lane(indices), 1e-9)
                    if turn >= 0:
                        rates[label].append(rate)
    for label, found in rates.items():
        print(f"{label:7}{statistics.median(found):8.0f}/s of processor time ({min(found):.0f} to {max(found):.0f})")
    return 0 if max(worst.values()) <= BOUND else 1


if __name__ == "__main__":
    sys.exit(main())
