"""How many variants a second one process compiles: `python benchmarks/variants/throughput.py [--count N] [--scale N]`.

The arm, with its three modes, from a scratch copy of its documents and parts in which a mass, a damping, a limit and a pose are
parameters, too. One session, store warm. A rate is given per second of the clock: over the whole run, and of the best of its twenty
blocks, which is what a machine does that nobody else uses at that moment; and per second of processor time of this process and its
children.

- `plain`: those four numbers differ in each variant, so that no part is modelled; the MJCF of three modes and `modes.json` are
  written to the disk;
- `verified`: the same, and MuJoCo compiles every model, as a batch lets it do unless told otherwise: with a tetrahedron in the place
  of a mesh that it has taken before;
- `loaded`: the same as `plain`, and every model becomes a `mujoco.MjModel` with all of its meshes;
- `unseen`: the same without what is only drawn (`model(visual=False)` of `thingc.variants.load`);
- `modelled`: the reach differs in each variant, so that one part is modelled for each, and the same files are written.

`--scale N` runs `plain` for 10, 100, ... N variants, and says how time and memory grow with their number.
"""

from __future__ import annotations

import argparse
import math
import os
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from thingc.emit.artifact import Artifacts, Stored
from thingc.pipeline import Options
from thingc.realize.store import Store
from thingc.session import Session, Settings

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
    """The scratch copy; the path of its document."""
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
    """Numbers that model no part, never the same twice."""
    part = (index * 0.6180339887498949) % 1.0
    return Settings(parameters={
        "board_mass": f"{10 + 10 * part} g", "damping": f"{0.01 + 0.02 * part} N*m*s/rad", "bend": f"{125 + 15 * part} deg",
        "lift": f"{10 * part} deg",
    })


def modelled(index: int) -> Settings:
    """A reach that was never modelled before, on any machine."""
    return Settings(parameters={"reach": f"{70 + 45 * ((index + FRESH) * 0.6180339887498949 % 1.0)} mm"})


BLOCKS = 20
"""Into how many blocks a run is divided."""
FRESH = int.from_bytes(os.urandom(3), "big") / 2**24


def build(session: Session, settings: Settings, folder: Path, *, verify: bool = False, models: Models | None = None) -> None:
    """One variant, from its settings to its files on the disk. Raises where anything was said."""
    compilation = session.compile(settings)
    artifacts = compilation.emit(["mjcf"], verify=verify)["mjcf"]
    if compilation.report.diagnostics:
        raise SystemExit(f"{settings}: {compilation.report.diagnostics}")
    os.makedirs(folder / "mjcf", exist_ok=True)
    for path, content in artifacts.files.items():
        if not isinstance(content, Stored):  # the meshes are shared by all variants
            with open(f"{folder}/{path}", "wb") as stream:
                stream.write(content)
    if models is not None:
        models.compiled(artifacts, [f"mjcf/arm_{robot.mode.name}.xml" for robot in compilation.robots])


class Models:
    """MuJoCo's models of what was written; its meshes are handed over once as long as they are the same."""

    def __init__(self, store: Store, *, visual: bool) -> None:
        self.store = store
        self.visual = visual
        self.assets: dict[str, Stored] = {}
        self.files: Any = None

    def compiled(self, artifacts: Artifacts, paths: list[str]) -> list[object]:
        """The compiled models of files, with their meshes."""
        import mujoco

        assets = {name.removeprefix("mjcf/assets/"): held for name, held in artifacts.files.items() if isinstance(held, Stored)}
        if assets != self.assets:
            self.assets, self.files = assets, mujoco.MjVfs()
            for name, stored in assets.items():
                self.files[name] = self.store.read(stored.sha256)
        found = []
        for path in paths:
            text = artifacts.files[path]
            assert isinstance(text, bytes)
            if not self.visual:
                text = text.replace(b"<compiler ", b'<compiler discardvisual="true" ', 1)
            found.append(mujoco.MjModel.from_xml_string(text.decode(), vfs=self.files))
        return found


def processor() -> float:
    """Seconds of processor time of this process, of the worker under it, and of the worker's children that have ended."""
    ticks = 0
    with open(f"/proc/{os.getpid()}/task/{os.getpid()}/children", encoding="ascii") as stream:
        running = stream.read().split()
    for process in ("self", *running):
        with open(f"/proc/{process}/stat", encoding="ascii") as stream:
            ticks += sum(map(int, stream.read().rpartition(")")[2].split()[11:15]))
    return ticks / os.sysconf("SC_CLK_TCK")


def resident() -> float:
    """Megabytes of memory that this process holds."""
    with open("/proc/self/statm", encoding="ascii") as stream:
        return int(stream.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


def measure(
    document: Path, store: str | None, folder: Path, settings: Callable[[int], Settings], count: int, *, verify: bool = False,
    load: bool = False, visual: bool = True,
) -> tuple[float, float, float, float]:
    """`count` variants in one session: seconds of the clock, as many as they would be at the pace of the best block, seconds of
    processor time, and megabytes grown after the first ten."""
    with Session(str(document), Options(store=store, jobs=1)) as session:
        models = Models(session.front.store, visual=visual) if load else None
        for index in range(3):
            build(session, settings(-1 - index), folder / "warm", verify=verify, models=models)
        before, wall, cpu = 0.0, time.perf_counter(), processor()
        size, begun, best = max(1, count // BLOCKS), wall, math.inf
        for index in range(count):
            if index and index % size == 0:
                now = time.perf_counter()
                best, begun = min(best, (now - begun) / size), now
            build(session, settings(index), folder / str(index), verify=verify, models=models)
            if index == min(10, count - 1):
                before = resident()
        return time.perf_counter() - wall, best * count, processor() - cpu, resident() - before


def scales(largest: int) -> Iterator[int]:
    """10, 100, ... up to `largest`."""
    count = 10
    while count <= largest:
        yield count
        count *= 10


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=200, help="variants that model nothing (default: %(default)s)")
    parser.add_argument("--models", type=int, default=20, help="variants that model a part each (default: %(default)s)")
    parser.add_argument("--scale", type=int, default=0, help="largest number of variants for growth (default: not measured)")
    parser.add_argument("--store", help="where modelled parts are kept")
    arguments = parser.parse_args()
    if sys.platform == "win32":
        raise SystemExit("this benchmark reads /proc")
    with tempfile.TemporaryDirectory(prefix="thingc-throughput-") as name:
        folder = Path(name)
        document = workspace(folder)
        runs: list[tuple[str, Callable[[int], Settings], int, dict[str, bool]]] = [
            ("plain", plain, arguments.count, {}), ("verified", plain, arguments.count, {"verify": True}),
            ("loaded", plain, arguments.count, {"load": True}), ("unseen", plain, arguments.count, {"load": True, "visual": False}),
            ("modelled", modelled, arguments.models, {}),
        ]
        for label, settings, count, options in runs:
            if count:
                wall, best, cpu, grown = measure(document, arguments.store, folder / label, settings, count, **options)
                print(f"{label:9}{count:6} variants {count / wall:8.1f}/s of the clock (best block {count / best:.1f}) "
                      f"{count / cpu:8.1f}/s of processor time "
                      f"{1e3 * cpu / count:8.2f} ms each, {grown:+.1f} MB")
        points = []
        for count in scales(arguments.scale):
            wall, _, cpu, grown = measure(document, arguments.store, folder / f"scale{count}", plain, count)
            shutil.rmtree(folder / f"scale{count}")
            points.append((math.log(count), math.log(cpu)))
            print(f"{count:6} variants: {wall:.2f} s of the clock, {cpu:.2f} s of processor time, {grown:+.1f} MB")
        if len(points) > 1:
            (x0, y0), (x1, y1) = points[0], points[-1]
            print(f"time grows with the power {(y1 - y0) / (x1 - x0):.3f} of the number of variants")


if __name__ == "__main__":
    main()
