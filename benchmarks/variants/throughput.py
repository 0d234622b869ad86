"""Measure how many variants per second one process writes: `python benchmarks/variants/throughput.py [--count N] [--scale N]`.

The robot is the arm with three modes. In a temporary copy of its document, a mass, a damping, a limit and a pose are parameters, too. Each
lane has its own session with one process, and all parts except those of `modelled` are in the store. In the lane `plain`, the four numbers
differ in each variant, so no part is modelled. The MJCF of the three modes, `modes.json` and the manifest are written to disk, as by
`thingc batch` and `family.write`. All these files are computed by a plan, and every 64th variant is also compiled for comparison. The lane
`passed` compiles every variant instead, and MuJoCo compiles every model, as with `--verify all`. Meshes that MuJoCo has accepted before are
replaced by tetrahedra.

The lane `loaded` writes the same files as `plain`. After each round, it reads every model as a new `mujoco.MjModel` with all meshes, as
`models` of `thingc.batch.load` does. If texts differ only in numbers, the numbers are written into arrays. In the lane `compiled`, MuJoCo
compiles every model instead, without threads. The lane `unseen` is the same as `compiled`, but without visual geometry. The lane `by hand`
is a script that replaces a mass in the text of each model and writes the same files. MuJoCo compiles the three models with all meshes. In
the lane `modelled`, the reach differs in each variant, so one part is modelled for each variant, and the same files are written.

The lanes run in turn, for several rounds, because the speed of a machine varies. The table contains the median, the smallest and the
largest rate per second of CPU time. The time of the process that models parts is included. The rates of `loaded` and `compiled` are also
given relative to `by hand`. `--scale N` runs the lane `plain` for 10, 100, ... N variants, and prints the growth of time and memory.
`--refused N` only compares the times for N valid and N invalid settings, by plans and by compilations. `--refused` uses an arm and a
gripper with loops, and checks that diagnostics and results are equal.
"""

from __future__ import annotations

import argparse
import contextlib
import math
import os
import re
import shutil
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

from thingc.batch.batch import SHARE
from thingc.batch.families import RobotFamily
from thingc.batch.mujoco_arrays.text_models import ModelText, TextModels
from thingc.batch.plans.build_templates import Builds
from thingc.driver.environment import Options
from thingc.driver.session import Session
from thingc.driver.settings import SettingsReader
from thingc.model.resolve.resolver import Settings
from thingc.targets.artifact import StoredArtifact

ROOT = Path(__file__).resolve().parents[2]
ADDED = """
  board_mass: {value: 12 g, min: 1 g}
  damping: 0.02 N*m*s/rad
  bend: {value: 130 deg, min: 100 deg}
  lift: 0 deg
"""
EDITS = {
    "\nparameters:": "\nparameters:" + ADDED.rstrip(),
    "mass: {value: 12 g, source: measured}": "mass: {value: =board_mass, source: measured}",
    "damping: 0.02 N*m*s/rad, friction": "damping: =damping, friction",
    "limit: {lower: -130 deg, upper: 130 deg}": "limit: {lower: -130 deg, upper: =bend}",
    "wrist: -30 deg}": "wrist: =lift - 30 deg}",
}


def workspace(folder: Path) -> Path:
    """Create a temporary copy of the workspace, and return the path of the document."""
    for name in ("assemblies", "parts"):
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "thingc.toml", folder)
    document = folder / "assemblies" / "arm.yaml"
    text = document.read_text()
    for old, new in EDITS.items():
        if text.count(old) != 1:
            raise SystemExit(f"{old!r} stands {text.count(old)} times in arm.yaml; the benchmark expects one place")
        text = text.replace(old, new)
    document.write_text(text)
    return document


def plain(index: int) -> Settings:
    """Return settings with numbers on which parts do not depend. The numbers differ for each index."""
    part = (index * 0.6180339887498949) % 1.0
    return Settings(parameters={
        "board_mass": f"{10 + 10 * part} g", "damping": f"{0.01 + 0.02 * part} N*m*s/rad", "bend": f"{125 + 15 * part} deg",
        "lift": f"{10 * part} deg",
    })


def modelled(index: int) -> Settings:
    """Return the settings for a reach that has not been modelled before, on any machine."""
    return Settings(parameters={"reach": f"{70 + 45 * ((index + FRESH) * 0.6180339887498949 % 1.0)} mm"})


FRESH = int.from_bytes(os.urandom(3), "big") / 2**24


def builds(session: Session) -> Builds:
    """Return the `Builds` object of a session, which batches use to build variants."""
    assert session.sources is not None
    return Builds(session, SettingsReader(session.sources), modes=(), targets=("mjcf",), verify=SHARE)


def build(made: Builds, settings: Settings, folder: Path, *, plans: bool = True) -> None:
    """Build one variant and write its files. If `plans` is False, the variant is compiled without a plan. Raises `SystemExit` if a
    diagnostic is reported.
    """
    built = made.build_by_plan(settings) if plans else None
    if built is None:
        built, problems = made.compile_build(settings)
        if built is None:
            raise SystemExit(f"{settings}: {problems}")
    if built.problems:
        raise SystemExit(f"{settings}: {built.problems}")
    os.makedirs(folder / "mjcf", exist_ok=True)
    for path, content in built.files().items():
        if not isinstance(content, StoredArtifact):  # meshes are shared by all variants
            with open(f"{folder}/{path}", "wb") as stream:
                stream.write(content)


class Models:
    """Creates MuJoCo models from the files of variants. The meshes are loaded only once, because all variants have the same meshes."""

    def __init__(self, session: Session, *, visual: bool, compiled: bool) -> None:
        import mujoco

        self.visual = visual
        self.compiled = compiled
        self.texts = TextModels()
        self.files = mujoco.MjVfs()
        self.meshes: dict[str, bytes] = {}
        for name, held in session.emit(session.compile(plain(0)), ["mjcf"])["mjcf"].files.items():
            if isinstance(held, StoredArtifact):
                file = name.removeprefix("mjcf/assets/")
                self.files[file] = self.meshes[file] = session.environment.store.read(held.sha256)

    def load(self, folders: Iterable[Path]) -> None:
        """Create the models of variants, and discard the models."""
        texts = (path.read_text(encoding="utf-8") for folder in folders for path in sorted((folder / "mjcf").glob("arm_*.xml")))
        if self.compiled:
            for text in texts:
                self.compile(text)
        else:
            for _ in self.texts.each(map(self.source, texts), share=False):
                pass

    def source(self, text: str) -> ModelText:
        """Return a `ModelText` of an MJCF text, as `thingc.batch.load` creates it."""
        return ModelText(text=text, meshes=(), assets=lambda: self.meshes, compiled=lambda: self.compile(text))

    def compile(self, text: str) -> Any:
        """Compile an MJCF text with MuJoCo."""
        import mujoco

        asked = 'usethread="false"' if self.visual else 'usethread="false" discardvisual="true"'
        text = text.replace("<compiler ", f"<compiler {asked} ", 1)
        return mujoco.MjModel.from_xml_string(text, vfs=self.files)


class Lane:
    """A lane of the benchmark: one way to create variants."""

    def __init__(self, made: Builds, folder: Path, settings: Callable[[int], Settings], *, plans: bool, models: Models | None) -> None:
        self.made = made
        self.folder = folder
        self.settings = settings
        self.plans = plans
        self.models = models

    def make(self, indices: range) -> None:
        """Create the variants with the given indices."""
        for index in indices:
            build(self.made, self.settings(index), self.folder / str(index), plans=self.plans)
        if self.models is not None:
            self.models.load(self.folder / str(index) for index in indices)


class ByHand(Lane):
    """A lane that edits the files of one variant with a script, without thingc."""

    def make(self, indices: range) -> None:
        """Create the variants with the given indices. In each variant, the second link has a different mass."""
        import mujoco

        texts = {path.name: path.read_text(encoding="utf-8") for path in (self.folder / "first" / "mjcf").iterdir()}
        modes = (self.folder / "first" / "modes.json").read_bytes()
        for index in indices:
            target = self.folder / str(index)
            os.makedirs(target / "mjcf", exist_ok=True)
            for name, text in texts.items():
                edited = re.sub(r' mass="[^"]*"', f' mass="{0.05 + 1e-6 * index}"', text, count=1)
                (target / "mjcf" / name).write_text(edited, encoding="utf-8")
            (target / "modes.json").write_bytes(modes)
            assert self.models is not None
            for path in sorted((target / "mjcf").glob("arm_*.xml")):
                mujoco.MjModel.from_xml_string(path.read_text(encoding="utf-8"), vfs=self.models.files)


def children(process: int | str) -> list[str]:
    """Return the process ids of the running children of a process."""
    with open(f"/proc/{process}/task/{process}/children", encoding="ascii") as stream:
        return stream.read().split()


def processor() -> float:
    """Return the CPU time [s] of this process, its worker, and the worker's children.

    A child counts only after it has ended, so the function waits until all children have ended.
    """
    workers, ticks = children(os.getpid()), 0
    while any(map(children, workers)):
        time.sleep(0.01)
    for process in ("self", *workers):
        with open(f"/proc/{process}/stat", encoding="ascii") as stream:
            ticks += sum(map(int, stream.read().rpartition(")")[2].split()[11:15]))
    return ticks / os.sysconf("SC_CLK_TCK")


def resident() -> float:
    """Return the resident memory [MB] of this process."""
    with open("/proc/self/statm", encoding="ascii") as stream:
        return int(stream.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


def grown(document: Path, store: str | None, folder: Path, count: int) -> tuple[float, float, float]:
    """Create `count` variants of the lane `plain` in one session. Return the wall time [s], the CPU time [s], and the memory growth [MB]
    after the first ten variants.
    """
    with Session(str(document), Options(store=store, jobs=1)) as session:
        made = builds(session)
        for index in range(3):
            build(made, plain(-1 - index), folder / "warm")
        before, wall, cpu = 0.0, time.perf_counter(), processor()
        for index in range(count):
            build(made, plain(index), folder / str(index))
            if index == min(10, count - 1):
                before = resident()
        return time.perf_counter() - wall, processor() - cpu, resident() - before


def lanes(document: Path, store: str | None, folder: Path, stack: contextlib.ExitStack) -> Iterator[tuple[str, Lane]]:
    """Yield the label and the object of every lane, after a warm-up."""
    for label, settings, plans, load, visual in (
        ("plain", plain, True, False, False), ("passed", plain, False, False, False), ("loaded", plain, True, True, True),
        ("compiled", plain, True, True, True), ("unseen", plain, True, True, False), ("by hand", plain, True, True, True),
        ("modelled", modelled, True, False, False),
    ):
        session = stack.enter_context(Session(str(document), Options(store=store, jobs=1)))
        models = Models(session, visual=visual, compiled=label != "loaded") if load else None
        made = builds(session)
        build(made, settings(-1), folder / label / "first")
        lane = (ByHand if label == "by hand" else Lane)(made, folder / label, settings, plans=plans, models=models)
        lane.make(range(-3, -1))
        yield label, lane


FAMILIES: dict[str, tuple[str, Callable[[float], dict[str, Any]], Callable[[float], dict[str, Any]]]] = {
    "arm": (
        "assemblies/arm.yaml", lambda part: {"joints.elbow.limit.upper": 2.2 + 0.3 * part, "components.bus_board.mass": 0.01 + 0.01 * part},
        lambda part: {"joints.elbow.limit.upper": 1.2 + 0.3 * part, "components.bus_board.mass": 0.01 + 0.01 * part},
    ),
    "gripper": (
        "gallery/gripper/gripper.yaml", lambda part: {"poses.half.open": 0.4 + 0.2 * part, "joints.open.limit.upper": 0.95 + 0.04 * part},
        lambda part: {"poses.half.open": 0.4 + 0.2 * part, "joints.open.limit.upper": 0.2 + 0.15 * part},
    ),
}
"""For each robot: its document, and functions that return valid and invalid settings for a number between 0 and 1."""


def refusals(count: int, store: str | None) -> None:
    """Measure valid and invalid settings, by plans and by compilations, and print the ratios."""
    for name, (document, good, bad) in FAMILIES.items():
        with RobotFamily(ROOT / document, store=store, verify=0) as made:
            compiled, times = made._evaluation_of(made.mode), {}
            for kind, draw in (("good", good), ("refused", bad)):
                many = [draw(index * 0.6180339887498949 % 1.0) for index in range(count + 40)]
                made.evaluate(many[:40]), [made.model(one) for one in many[:40]]
                begun = time.process_time()
                found = [made.evaluate(one) for one in many[40:]]
                evaluated = time.process_time()
                models = [made.model(one) for one in many[40:]]
                modelled = time.process_time()
                whole = [compiled._compile(made._reader.read(one)) for one in many[40:]]
                times[kind] = [1e3 * time / count for time in (evaluated - begun, modelled - evaluated, time.process_time() - modelled)]
                if [(one.results, list(one.problems)) for one in found] != [(one[0], one[1].sorted_diagnostics()) for one in whole]:
                    raise SystemExit(f"{name}: plans and compilations differ for {kind} settings")
                if any(bool(one) is (kind == "refused") for one in models):
                    raise SystemExit(f"{name}: not all settings are {kind}")
                evaluate, model, passes = times[kind]
                print(f"{name}, {kind}: evaluate {evaluate:.3f} ms, model {model:.3f} ms, compilation {passes:.3f} ms")
            ratios = [refused / accepted for refused, accepted in zip(times["refused"], times["good"], strict=True)]
            print(f"{name}, refused by good: evaluate {ratios[0]:.2f}, model {ratios[1]:.2f}; compiled by good evaluate "
                  f"{times['refused'][2] / times['good'][0]:.1f}, by good model {times['refused'][2] / times['good'][1]:.1f}")


def scales(largest: int) -> Iterator[int]:
    """Yield 10, 100, ... up to `largest`."""
    count = 10
    while count <= largest:
        yield count
        count *= 10


def main() -> None:
    """Measure all lanes, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=400, help="number of variants without new parts (default: %(default)s)")
    parser.add_argument("--models", type=int, default=40, help="number of variants with a new part each (default: %(default)s)")
    parser.add_argument("--rounds", type=int, default=5, help="number of rounds, in which the ways alternate (default: %(default)s)")
    parser.add_argument("--scale", type=int, default=0, help="largest number of variants for growth (default: not measured)")
    parser.add_argument("--refused", type=int, default=0, metavar="N", help="compare only N valid and invalid settings")
    parser.add_argument("--store", help="cache of built parts")
    arguments = parser.parse_args()
    if sys.platform == "win32":
        raise SystemExit("this benchmark reads /proc")
    if arguments.refused:
        refusals(arguments.refused, arguments.store)
        return
    with tempfile.TemporaryDirectory(prefix="thingc-throughput-") as name:
        folder = Path(name)
        document = workspace(folder)
        with contextlib.ExitStack() as stack:
            made = dict(lanes(document, arguments.store, folder, stack))
            sizes = {label: -(-(arguments.models if label == "modelled" else arguments.count) // arguments.rounds) for label in made}
            rates: dict[str, list[float]] = {label: [] for label in made}
            for turn in range(arguments.rounds):
                for label, lane in made.items():
                    begun = processor()
                    lane.make(range(turn * sizes[label], (turn + 1) * sizes[label]))
                    rates[label].append(sizes[label] / max(processor() - begun, 0.01))
            for label, found in rates.items():
                print(f"{label:9}{arguments.rounds * sizes[label]:6} variants {statistics.median(found):8.1f}/s of processor time "
                      f"(median of {arguments.rounds} rounds; {min(found):.1f} to {max(found):.1f})")
            for label in ("loaded", "compiled"):
                ratios = [ours / theirs for ours, theirs in zip(rates[label], rates["by hand"], strict=True)]
                print(f"{label}, of by hand: {statistics.median(ratios):.2f} ({min(ratios):.2f} to {max(ratios):.2f})")
        points = []
        for count in scales(arguments.scale):
            wall, cpu, growth = grown(document, arguments.store, folder / f"scale{count}", count)
            shutil.rmtree(folder / f"scale{count}")
            points.append((math.log(count), math.log(cpu)))
            print(f"{count:6} variants: {wall:.2f} s of the clock, {cpu:.2f} s of processor time, {growth:+.1f} MB")
        if len(points) > 1:
            (x0, y0), (x1, y1) = points[0], points[-1]
            print(f"time grows with the power {(y1 - y0) / (x1 - x0):.3f} of the number of variants")


if __name__ == "__main__":
    main()
