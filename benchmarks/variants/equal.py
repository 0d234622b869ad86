"""Compare the variants of a batch with single builds of the same settings:
`python benchmarks/variants/equal.py [KIND ...] [--count N] [--layout L]`.

A batch builds N random variants of each kind. Then the command in the table of the batch builds each variant again, in a separate process.
The folders of both builds must be equal, byte by byte. If the batch rejected a variant, the single build must reject it with the same
diagnostic code.

The kinds differ in the settings that vary. In the kind `dimension`, the lengths of legs and body and the wall thickness of MInchW vary, so
that every variant has different parts. In the kind `numbers`, numbers of the arm vary on which parts do not depend. In the kind `mesh`, the
pen of the arm and the mass of a board vary. There are sixteen pens, whose parts are modelled once. In the kind `structure`, contacts,
collision shapes, a material, an integrator, and the roots and poses of modes of the arm vary.

To test interrupted batches, use `make kills` (`tests/conformance/kills.py`).
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import shlex
import shutil
import subprocess
import sys
import tempfile
import textwrap
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from thingc.batch import load

ROOT = Path(__file__).resolve().parents[2]
KINDS = {
    "dimension": """
        assembly: assemblies/minchw/minchw.yaml
        sample:
          method: sobol
          count: {count}
          seed: {seed}
          ranges: {{leg_length: [64 mm, 140 mm], body_length: [92 mm, 220 mm], wall: [2.5 mm, 4 mm]}}
        modes: [front_foot, crawl, bridge]
    """,
    "numbers": """
        assembly: assemblies/arm.yaml
        sample:
          method: sobol
          count: {count}
          seed: {seed}
          ranges:
            components.bus_board.mass: [5 g, 40 g]
            joints.elbow.limit.upper: [126 deg, 150 deg]
            joints.yaw.dynamics.damping: [0.005 N*m*s/rad, 0.1 N*m*s/rad]
            poses.home.wrist: [-60 deg, 0 deg]
    """,
    "mesh": """
        assembly: assemblies/arm.yaml
        sample: {{method: sobol, count: {count}, seed: {seed}, ranges: {{components.bus_board.mass: [5 g, 40 g]}}}}
        parameters: {{pen_diameter: {{from: 8 mm, to: 15.5 mm, count: 16}}}}
    """,
    "structure": """
        assembly: assemblies/arm.yaml
        sample: {{method: sobol, count: {count}, seed: {seed}, ranges: {{components.bus_board.mass: [5 g, 40 g]}}}}
        parameters:
          components.forearm.collision: [part, hull, box, mesh, none]
          modes.adrift.root: [bracket, plate, hand.tip]
          modes.bench.pose: [home, folded, stretched]
          simulation.integrator: [implicitfast, euler]
        choices:
          components.humerus.material: [petg, petg_red]
    """,
}
"""The text of the variants document of each kind."""


def main() -> int:
    """Build and compare the variants of each kind. Return 1 if a variant differs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kinds", nargs="*", metavar="KIND", help=f"{', '.join(KINDS)} (default: all)")
    parser.add_argument("--count", type=int, default=300, help="number of variants of each kind (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=11, help="random seed of the samples (default: %(default)s)")
    parser.add_argument("--layout", choices=("folders", "packed"), default="folders", help="layout of the batch")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="number of parallel single builds")
    parser.add_argument("--store", help="cache of built parts (default: an empty one)")
    arguments = parser.parse_args()
    if unknown := [kind for kind in arguments.kinds if kind not in KINDS]:
        parser.error(f"no kind is called {', '.join(unknown)}")
    differ = 0
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(os.path.realpath(scratch)) / "workspace"
        for name in ("assemblies", "parts"):
            shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
        shutil.copy(ROOT / "thingc.toml", folder)
        environment = {**os.environ, "THINGC_STORE": arguments.store or str(folder.parent / "store")}
        for kind in arguments.kinds or KINDS:
            differ += study(kind, folder, environment, arguments)
    return 1 if differ else 0


def study(kind: str, folder: Path, environment: dict[str, str], arguments: argparse.Namespace) -> int:
    """Build the variants of one kind in a workspace, and compare them with single builds. Return the number of variants that differ."""
    write_document(kind, folder, arguments.count, arguments.seed)
    begun = time.monotonic()
    batch = thingc(["batch", f"{kind}.yaml", "--pictures", "none", "--layout", arguments.layout], folder, environment)
    took = time.monotonic() - begun
    out = folder / "build" / kind
    if not out.is_dir():
        raise SystemExit(batch.stdout + batch.stderr)
    with (out / "results.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    if len(rows) != arguments.count:
        raise SystemExit(f"{len(rows)} of {arguments.count} variants are in the table:\n{batch.stderr}")
    begun = time.monotonic()
    places = {variant.id: Path(variant.unpack()) for variant in load(out)}
    with ThreadPoolExecutor(arguments.jobs) as pool:
        found = list(pool.map(lambda row: compared(row, places.get(row["id"]), folder, environment), rows))
    singles = time.monotonic() - begun
    for outcome, words in found:
        if outcome == "differs":
            print(words)
    tally = Counter(outcome for outcome, _ in found)
    print(f"{kind}, {arguments.layout}: {', '.join(f'{count} {outcome}' for outcome, count in sorted(tally.items()))} "
          f"(batch {took:.0f} s, single builds {singles:.0f} s, {arguments.jobs} at once)", flush=True)
    shutil.rmtree(out)
    return tally["differs"]


def write_document(kind: str, folder: Path, count: int, seed: int) -> Path:
    """Write the variants document of one kind, and return its path."""
    document = folder / f"{kind}.yaml"
    settings = textwrap.dedent(KINDS[kind].format(count=count, seed=seed)).lstrip()
    document.write_text(f"thingc: variants/1\nname: {kind}\n{settings}emit: [mjcf, bom]\n")
    return document


def compared(row: dict[str, str], place: Path | None, folder: Path, environment: dict[str, str]) -> tuple[str, str]:
    """Compare a variant with a single build, and return the outcome and a description of the difference. The outcome is
    `equal, byte for byte`, `refused alike` or `differs`. `place` is the folder of the variant, or None if it was not built.
    """
    words = shlex.split(row["command"])[1:]
    alone = folder / "alone" / row["id"]
    done = thingc([*words, "-o", str(alone), "--format", "json"], folder, environment)
    if row["status"] != "built":
        codes = {one["code"] for one in json.loads(done.stdout)["diagnostics"]}
        return ("refused alike", "") if done.returncode == 1 and row["code"] in codes else ("differs", f"{row['id']}: {row['message']}")
    (single,) = alone.iterdir()
    assert place is not None
    variant, other = files(place), files(single)
    shutil.rmtree(alone)
    different = sorted(name for name in variant.keys() | other.keys() if variant.get(name) != other.get(name))
    if not any(name.endswith(".xml") for name in variant):
        return "differs", f"{row['id']}: no model was written"
    return ("differs", f"{row['id']}: {', '.join(different)}") if different else ("equal, byte for byte", "")


def files(folder: Path) -> dict[str, bytes]:
    """Return the content of every file below a folder, by relative path."""
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def thingc(words: list[str], folder: Path, environment: dict[str, str]) -> subprocess.CompletedProcess[str]:
    """Run one command of thingc, and return its result."""
    return subprocess.run([sys.executable, "-m", "thingc", *words], cwd=folder, env=environment, capture_output=True, text=True)


if __name__ == "__main__":
    sys.exit(main())
