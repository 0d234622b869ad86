"""MInchW climbs along a steel beam on the floor, on a wall and under a ceiling: `make walk`, or `python examples/walk.py BUILD`.

The walk is simulated in two ways: rooted at the holding foot, where `thingc.modes` moves the root from foot to foot, and with a free base.
The printed values are measured in the simulation.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

os.environ.setdefault("MUJOCO_GL", "egl")  # before mujoco is imported, which chooses its renderer then

from inchworm_gait import PULL, swings
from inchworm_physics import Climb, Seen
from inchworm_scenery import Film, save

ROOT = Path(__file__).resolve().parent.parent
SHORT, STRIDE, LIFT, SINK = 0.31, 0.09, 0.025, 0.0001
"""Parameters of the gait [m]: distance between the soles when they are close together, stride, lift, and depth of touchdown below the
steel.

A foot that has landed is tilted by a third of a milliradian. When this foot becomes the root, the tilt lifts the other foot by 0.13 mm.
"""

PLACES = {"floor": "", "wall": "_wall", "ceiling": "_ceiling"}
FILMED = ("floor", "wall")
FRAME = 0.15
"""Simulated time [s] between two frames of the film. The film plays at 4/3 of real speed."""


def walk(
    folder: Path, steps: int, film: Path | None = None, places: Sequence[str] = tuple(PLACES), sink: float = SINK,
) -> dict[tuple[str, str], Seen]:
    """Simulate the rooted and the free walk on every surface. Return the results by surface and kind of simulation. Each foot is lowered to
    `sink` [m] below the surface of the steel.
    """
    found, films = {}, []
    for place in places:
        climb = Climb(folder, PLACES[place])
        plan = swings(climb.models, steps, SHORT, STRIDE, LIFT, sink)
        watch = Film(place, FRAME) if film is not None and place in FILMED else None
        found[place, "rooted"] = climb.rooted(plan, watch)
        found[place, "free"] = climb.adhering(plan)
        if watch is not None:
            watch.close()
            films.append(watch)
    if film is not None:
        save(films, film, round(750 * FRAME))
    return found


def report(found: dict[tuple[str, str], Seen]) -> str:
    """Return the results as a text table with one column per walk."""
    worst = {key: max(seen.torque, key=seen.torque.__getitem__) for key, seen in found.items()}
    rows: list[tuple[str, list[str]]] = [
        ("", [f"{place}, {way}" for place, way in found]),
        ("steps", [f"{seen.steps}" for seen in found.values()]),
        ("distance [mm]", [f"{1e3 * seen.progress:.2f}" for seen in found.values()]),
        ("slip of the supporting foot [mm]", [f"{1e3 * seen.slips['standing']:.3f}" for seen in found.values()]),
        ("slip of the landed foot [mm]", [f"{1e3 * seen.slips['landing']:.3f}" for seen in found.values()]),
        ("smallest pull margin [N]", [f"{PULL - seen.pull:.1f}" for seen in found.values()]),
        ("  in", [seen.pulled for seen in found.values()]),
        ("smallest shear margin", [f"{100 * (1 - seen.shear):.1f} %" for seen in found.values()]),
        ("smallest torque margin", [f"{100 * (1 - max(seen.torque.values())):.1f} %" for seen in found.values()]),
        ("  at", [worst[key] for key in found]),
        ("smallest torque-speed margin", [f"{100 * (1 - seen.speed):.1f} %" for seen in found.values()]),
        ("largest tracking error [mrad]", [f"{1e3 * seen.tracking:.2f}" for seen in found.values()]),
        ("largest tilt of a landed sole [mrad]", [f"{1e3 * seen.tilt:.2f}" for seen in found.values()]),
        ("velocity removed at a switch [um/s]", [_only(way, 1e6 * seen.removed) for (_, way), seen in found.items()]),
        ("velocity removed at a switch [urad/s]", [_only(way, 1e6 * seen.removed_angular) for (_, way), seen in found.items()]),
        ("contacts besides soles", [", ".join(sorted(seen.touches)) or "nothing" for seen in found.values()]),
    ]
    return "\n".join(f"{name:38}" + "".join(f"{cell:>16}" for cell in cells) for name, cells in rows)


@contextmanager
def built(folder: Path | None) -> Iterator[Path]:
    """Return a context manager that provides a build folder of MInchW: `folder`, or else a temporary folder into which the robot is
    built.
    """
    if folder is not None:
        yield folder
        return
    with tempfile.TemporaryDirectory() as scratch:
        command = [sys.executable, "-m", "thingc", "build", "assemblies/minchw/minchw.yaml", "-o", scratch]
        subprocess.run(command, cwd=ROOT, check=True)
        yield Path(scratch) / "minchw"


def write(page: Path, marker: str, text: str) -> None:
    """Replace the block after a marker in a Markdown page by a report."""
    head, opening, rest = page.read_text().partition(f"<!-- {marker} -->\n```text\n")
    assert opening, f"{page} has no block <!-- {marker} -->"
    page.write_text(head + opening + text + "\n```" + rest.partition("\n```")[2])


def _only(way: str, value: float) -> str:
    return f"{value:.2f}" if way == "rooted" else "-"


def main() -> int:
    """Build the robot unless a build folder is specified, simulate the walks, and print the results."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("build", nargs="?", type=Path, help="build folder of MInchW (default: build it)")
    parser.add_argument("--steps", type=int, default=3)
    parser.add_argument("--on", nargs="+", choices=PLACES, default=tuple(PLACES), help="surfaces (default: all)")
    parser.add_argument("--sink", type=float, default=1e3 * SINK, help="depth of touchdown below the steel [mm]")
    parser.add_argument("--gif", type=Path, help="output file for the film of the rooted walks on the floor and the wall")
    parser.add_argument("--page", type=Path, help="page whose reports are replaced (docs/studies/walking.md)")
    given = parser.parse_args()
    with built(given.build) as folder:
        found = walk(folder, given.steps, given.gif, given.on, 1e-3 * given.sink)
        print(report(found))
        if given.page is not None:
            write(given.page, "report", report(found))
            snatched = walk(folder, given.steps, places=["ceiling"], sink=0.0)
            write(given.page, "report of feet put down at the steel", report(snatched))
    return 0


if __name__ == "__main__":
    sys.exit(main())
