"""Measure batches with many variants on disk: `python benchmarks/variants/packed.py [--count N] [--arm N]`.

First, a batch of the arm of `throughput.py` is built in each layout. The arm has three modes, and only numbers vary. The program prints the
disk usage per variant, in inodes and in bytes of disk blocks. Tables and pages are not included in this number, but printed separately.
Some packed variants are unpacked, and must equal the folders of the other layout, byte by byte.

Then the program builds `--count` pendulums with different masses in the packed layout. The pendulum has no parts. The program prints the
time and the peak memory of the driver, and the time of `--resume` for the finished batch. It also prints the time to read the batch, and
the time to create models of random variants.
"""

from __future__ import annotations

import argparse
import os
import random
import resource
import subprocess
import sys
import tempfile
import textwrap
import time
from pathlib import Path

from throughput import workspace

from thingc.batch import load

ARM = """
    thingc: variants/1
    assembly: assemblies/arm.yaml
    name: numbers
    sample:
      method: sobol
      count: {count}
      seed: 3
      ranges:
        board_mass: [10 g, 20 g]
        damping: [0.01 N*m*s/rad, 0.03 N*m*s/rad]
        bend: [125 deg, 140 deg]
        lift: [0 deg, 10 deg]
"""
PENDULUM = """
    thingc: assembly/1
    name: pendulum
    parameters: {bob: {value: 500 g, min: 1 g, max: 20 kg}, rod: {value: 100 g, min: 1 g, max: 20 kg}}
    components:
      stand: {frame: true, mass: 2 kg, inertia: {ixx: 0.01 kg*m^2, iyy: 0.01 kg*m^2, izz: 0.01 kg*m^2}}
      rod:
        frame: true
        mass: =rod
        com: 150 0 0 mm
        inertia: {ixx: 0.001 kg*m^2, iyy: 0.002 kg*m^2, izz: 0.002 kg*m^2}
        mounts: {end: {xyz: 300 0 0 mm}}
      weight: {frame: true, mass: =bob, at: {in: rod.end}}
    joints:
      swing:
        type: revolute
        parent: stand.origin
        child: rod.origin
        limit: {lower: -90 deg, upper: 90 deg}
        drive: {kind: position, kp: 20 N*m/rad, effort: 6 N*m}
    modes: {hanging: {root: stand, base: fixed, at: {rpy: 90 0 0 deg}}}
"""
MASSES = """
    thingc: variants/1
    assembly: pendulum.yaml
    name: masses
    sample: {{method: sobol, count: {count}, seed: 3, ranges: {{bob: [1 g, 2 kg], rod: [10 g, 1 kg]}}}}
"""
DRAWN = 500
"""Number of random variants whose models are created."""


def thingc(folder: Path, *words: str) -> float:
    """Run a command of thingc, and return its wall time [s]."""
    begun = time.perf_counter()
    done = subprocess.run([sys.executable, "-m", "thingc", *words], cwd=folder, capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(done.stderr)
    return time.perf_counter() - begun


def occupied(folder: Path, *names: str) -> tuple[int, int]:
    """Return the number of inodes and the number of bytes on disk below folders of a batch. A file with several names counts once."""
    seen: dict[int, int] = {}
    for name in names:
        for path in (folder / name).rglob("*"):
            state = path.lstat()
            seen[state.st_ino] = 512 * state.st_blocks
    return len(seen), sum(seen.values())


def contents(folder: Path) -> dict[str, bytes]:
    """Return the content of every file below a folder, by relative path."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def arm(folder: Path, count: int) -> None:
    """Build the batch of the arm in both layouts, and print the disk usage."""
    workspace(folder)
    (folder / "numbers.yaml").write_text(textwrap.dedent(ARM.format(count=count)).lstrip())
    thingc(folder, "build", "assemblies/arm.yaml")  # adds the parts to the store
    for layout, inner in (("folders", "variants"), ("packed", "chunks")):
        seconds = thingc(folder, "batch", "numbers.yaml", "--layout", layout, "-o", layout)
        inodes, size = occupied(folder / layout / "numbers", inner)
        once, assets = occupied(folder / layout / "numbers", "assets")
        print(f"arm, {layout:7} {inodes / count:7.3f} inodes and {size / count / 1e3:7.2f} kB a variant ({count} in {seconds:.0f} s); "
              f"meshes of all: {once} inodes, {assets / 1e6:.1f} MB")
    ours, theirs = (load(folder / layout / "numbers") for layout in ("packed", "folders"))
    for one in random.Random(7).sample(list(ours), min(count, 50)):
        if contents(Path(one.unpack())) != contents(Path(theirs[one.id].folder)):
            raise SystemExit(f"{one.id} differs from the folder that a batch writes")


def masses(folder: Path, count: int) -> None:
    """Build the batch of pendulums in the packed layout, and print the results."""
    (folder / "pendulum.yaml").write_text(textwrap.dedent(PENDULUM).lstrip())
    (folder / "masses.yaml").write_text(textwrap.dedent(MASSES.format(count=count)).lstrip())
    seconds = thingc(folder, "batch", "masses.yaml", "--layout", "packed")
    peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1e3
    out = folder / "build" / "masses"
    inodes, size = occupied(out, "chunks")
    table = sum((out / name).stat().st_size for name in ("results.csv", "results.parquet"))
    page = (out / "index.html").stat().st_size
    print(f"{count} masses, packed: {seconds:.0f} s, {count / seconds:.0f} a second on {os.cpu_count()} cores, {peak:.0f} MB of memory")
    print(f"{inodes} inodes, {size / count:.0f} bytes a variant, {table / count:.0f} more in the tables; a page of {page / 1e6:.1f} MB")
    print(f"--resume of all of them: {thingc(folder, 'batch', 'masses.yaml', '--resume'):.1f} s")
    begun = time.perf_counter()
    family = load(out)
    print(f"load: {time.perf_counter() - begun:.2f} s")
    source = random.Random(7)
    drawn = [family[source.randrange(len(family))].id for _ in range(DRAWN)]
    begun = time.perf_counter()
    for id in drawn:
        family[id].model()
    print(f"a model by id, drawn from all: {1e3 * (time.perf_counter() - begun) / DRAWN:.2f} ms")


def main() -> None:
    """Measure all lanes, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=100_000, help="number of masses (default: %(default)s)")
    parser.add_argument("--arm", type=int, default=1024, help="number of arms (default: %(default)s)")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="thingc-packed-") as name:
        folder = Path(os.path.realpath(name))
        arm(folder, arguments.arm)
        masses(folder, arguments.count)


if __name__ == "__main__":
    main()
