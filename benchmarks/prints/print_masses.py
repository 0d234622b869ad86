"""`make print-masses`: compare the masses of printed parts that thingc estimates with PrusaSlicer. The command prints the tables and writes
them to `docs/studies/prints.md`.

Requires `prusa-slicer` (Debian: `apt install prusa-slicer`). The exit status is 1 if a bound is exceeded. The study contains the ten
printed parts of both robots and twelve reference solids. Each part is sliced with four infills, three shells, and in two orientations.
"""

from __future__ import annotations

import argparse
import math
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(ROOT / "compiler")]

import prusa  # noqa: E402
from prusa import NotSliced, Printed, printed, program, version  # noqa: E402

from thingc.base.inertia import MassProperties  # noqa: E402
from thingc.driver.environment import Options  # noqa: E402
from thingc.driver.session import Session  # noqa: E402
from thingc.model.resolve.resolver import Settings  # noqa: E402

PAGE = ROOT / "docs" / "studies" / "prints.md"
KEPT = ROOT / "build" / "prints"
DENSITY = 1270.0

ROBOTS = {
    "arm:BasePlate": "BasePlate", "arm:YawPitchBracket": "YawPitchBracket", "arm:RotorBrace": "RotorBrace", "arm:Hand": "Hand",
    "arm:OmegaCap": "OmegaCap", "minchw.body:Chassis": "Chassis", "minchw.body:Cover": "Cover", "minchw.leg:HipBracket": "HipBracket",
    "minchw.leg:ThighBrace": "ThighBrace", "minchw.leg:Foot": "Foot",
}
SOLIDS = {
    f"solids:{name}": name
    for name in ("Block", "Plate", "Rod", "Frustum", "Funnel", "Ball", "Ring", "Tube", "Tray", "Table", "Wedge", "Comb")
}
INFILLS = (0.1, 0.15, 0.25, 0.5)
SHELLS = ((2, 3), (3, 4), (4, 6))
"""Number of lines in the walls, and number of solid layers at the top and at the bottom."""
UPS = {"as modelled": (0.0, 0.0, 1.0), "on its side": (1.0, 0.0, 0.0)}

MASS = (0.04, 0.07, 0.03)
"""Bounds of the relative error of the mass: for 90 % of all cases, for all cases, and for the root mean square."""
CENTRE, MOMENTS = 0.01, 0.04
"""Bounds for 90 % of all cases: the error of the centre relative to the extent of the part, and the relative error of the principal
moments.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One print of a part (`module:Class`), in an orientation and with settings. Each print has the mass from thingc and from PrusaSlicer,
    and the relative errors of the mass and of the principal moments. The error of the centre is relative to the extent of the part along
    each axis.
    """

    part: str
    up: str
    settings: prusa.Settings
    ours: float
    theirs: float
    mass: float
    centre: float
    moments: tuple[float, ...]


@contextmanager
def session(folder: Path, store: str) -> Iterator[Session]:
    """Create a temporary workspace with the parts of both robots, the reference solids and a document `print.yaml`, and return a context
    manager with a session.
    """
    shutil.copytree(ROOT / "parts", folder / "parts")
    shutil.copy(HERE / "solids.py", folder / "parts")
    shutil.copy(HERE / "print.yaml", folder)
    (folder / "thingc.toml").write_text('thingc = "workspace/1"\n')
    with Session(str(folder / "print.yaml"), Options(store=store)) as opened:
        yield opened


def said(opened: Session, part: str, up: Sequence[float], settings: prusa.Settings) -> tuple[MassProperties, bytes]:
    """Return the mass properties and the print file (STL) that thingc computes for a part. Raises `RuntimeError` with the error message if
    thingc rejects the part.
    """
    parameters = {"infill": f"{100 * settings.infill:g} %", "walls": str(settings.walls), "lids": str(settings.lids)}
    parameters |= {axis: f"{value:g}" for axis, value in zip("xyz", up, strict=True)}
    found = opened.compile(Settings(parameters=parameters, choices={"components.part.part": part}))
    if found.assembly is None or found.report.diagnostics:
        raise RuntimeError("\n".join(diagnostic.message for diagnostic in found.report.diagnostics))
    (occurrence,) = found.assembly.occurrences
    if occurrence.record is None or occurrence.estimate != "layers":
        raise RuntimeError(f"{part} was not estimated by its layers")
    return occurrence.properties, opened.environment.store.read(occurrence.record.meshes["print"].sha256)


def turned(stl: bytes, turn: np.ndarray[Any, np.dtype[np.float64]]) -> bytes:
    """Return a binary STL file whose vertices are rotated by the matrix `turn`."""
    kind = np.dtype([("n", "<f4", 3), ("p", "<f4", (3, 3)), ("a", "<u2")])
    triangles = np.frombuffer(stl, offset=84, dtype=kind).copy()
    triangles["p"] = (triangles["p"].astype(float) @ turn.T).astype(np.float32)
    triangles["n"] = 0.0
    return stl[:84] + triangles.tobytes()


def case(opened: Session, part: str, name: str, settings: prusa.Settings, kept: Path | None) -> Case:
    """Slice a part with thingc and with PrusaSlicer, and compare the results in the frame of the printer."""
    up = UPS[name]
    ours, stl = said(opened, part, up, settings)
    # a rotation by 90 degrees about y, which moves x to z
    turn = np.eye(3) if up == (0.0, 0.0, 1.0) else np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
    lying = turned(stl, turn)
    theirs = printed(lying, settings, kept)
    return compared(part, name, settings, ours, theirs, turn, lying)


def compared(
    part: str, up: str, settings: prusa.Settings, ours: MassProperties, theirs: Printed,
    turn: np.ndarray[Any, np.dtype[np.float64]], stl: bytes,
) -> Case:
    """Return the errors of thingc's mass properties relative to PrusaSlicer's. Values of thingc are in SI units and in the frame of the
    part. Values of PrusaSlicer are in mm and in the frame of the printer.
    """
    corners = np.frombuffer(stl, offset=84, dtype=np.dtype([("n", "<f4", 3), ("p", "<f4", (3, 3)), ("a", "<u2")]))["p"].reshape(-1, 3)
    extent = corners.max(axis=0).astype(float) - corners.min(axis=0)
    centre = turn @ np.array(ours.centre) * 1e3
    mass = theirs.volume * 1e-9 * DENSITY
    own = np.linalg.eigvalsh(np.array(ours.inertia))
    their = np.linalg.eigvalsh(np.array(theirs.inertia)) * 1e-15 * DENSITY
    return Case(
        part=part, up=up, settings=settings, ours=ours.mass, theirs=mass, mass=ours.mass / mass - 1.0,
        centre=float(np.abs((centre - theirs.centre) / extent).max()), moments=tuple((own / their - 1.0).tolist()),
    )


def cases(parts: Iterable[str], kept: Path | None, progress: Callable[[str], None], unsliced: list[str]) -> Iterator[Case]:
    """Yield the result of each part with each infill and shell, in each orientation. Prints that PrusaSlicer rejects are added to the list
    `unsliced`.
    """
    with tempfile.TemporaryDirectory() as folder, session(Path(folder), str(KEPT / "store")) as opened:
        for part in parts:
            for up, (walls, lids), infill in product(UPS, SHELLS, INFILLS):
                settings = prusa.Settings(walls=walls, lids=lids, infill=infill)
                name = f"{part} {up}, {walls} walls, {lids} lids, {infill:.0%}"
                try:
                    found = case(opened, part, up, settings, kept)
                except NotSliced as fault:
                    unsliced.append(f"{name}: {str(fault).splitlines()[0]}")
                    progress(unsliced[-1])
                    continue
                progress(f"{name}: {found.mass:+.1%}")
                yield found


# --- the page -----------------------------------------------------------------------------------------------------------


def rms(values: Iterable[float]) -> float:
    """Return the root mean square of values."""
    held = list(values)
    return math.sqrt(sum(value * value for value in held) / len(held))


def ninth(values: Iterable[float]) -> float:
    """Return the value that 90 % of the values do not exceed."""
    held = sorted(values)
    return held[math.ceil(0.9 * len(held)) - 1]


def kept_bounds(found: Sequence[Case]) -> bool:
    """Return whether the results satisfy all bounds."""
    masses = [abs(one.mass) for one in found]
    return (
        ninth(masses) <= MASS[0] and max(masses) <= MASS[1] and rms(masses) <= MASS[2]
        and ninth(one.centre for one in found) <= CENTRE and ninth(max(map(abs, one.moments)) for one in found) <= MOMENTS
    )


def summary(found: Sequence[Case]) -> list[str]:
    """Format a table of the errors of mass, centre and moments. The columns are the mean, the root mean square, the value that 90 % do not
    exceed, the largest value, and the number of values within the bound.
    """
    rows = {
        "mass": ([one.mass for one in found], MASS[0]), "centre, of the extent": ([one.centre for one in found], CENTRE),
        "principal moments": ([moment for one in found for moment in one.moments], MOMENTS),
    }
    lines = ["| | mean | RMS | nine of ten below | worst | within the bound |", "|---|---|---|---|---|---|"]
    for name, (values, bound) in rows.items():
        sizes = [abs(value) for value in values]
        worst, within = max(values, key=abs), sum(size <= bound for size in sizes)
        lines.append(
            f"| {name} | {_percent(float(np.mean(values)))} | {rms(values):.1%} | {ninth(sizes):.1%} | {_percent(worst)} "
            f"| {within} of {len(sizes)} within {bound:.0%} |"
        )
    return lines


def by_part(found: Sequence[Case]) -> list[str]:
    """Format a table with one row per part. A row contains the masses at 15 % infill with three walls and four solid layers, and the errors
    over all settings.
    """
    lines = [
        "| part | as modelled | sliced | on its side | sliced | mass: mean | RMS | worst | centre: worst | moments: RMS | worst |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for part, name in {**ROBOTS, **SOLIDS}.items():
        own = [one for one in found if one.part == part]
        if not own:
            continue
        usual = {one.up: one for one in own if (one.settings.walls, one.settings.lids, one.settings.infill) == (3, 4, 0.15)}
        masses = [f"{1e3 * mass:.2f} g" for up in UPS for mass in ((usual[up].ours, usual[up].theirs) if up in usual else ())]
        masses += ["-"] * (2 * len(UPS) - len(masses))  # PrusaSlicer rejects the part on its side
        errors, moments = [one.mass for one in own], [moment for one in own for moment in one.moments]
        worst, worst_moment = _percent(max(errors, key=abs)), _percent(max(moments, key=abs))
        lines.append(
            f"| {name} | {' | '.join(masses)} | {_percent(float(np.mean(errors)))} | {rms(errors):.1%} | {worst} | "
            f"{max(one.centre for one in own):.1%} | {rms(moments):.1%} | {worst_moment} |"
        )
    return lines


def by_setting(found: Sequence[Case]) -> list[str]:
    """Format a table of the errors of the mass, grouped by infill, by shell and by orientation."""
    groups: list[tuple[str, Callable[[Case], bool]]] = [
        *((f"infill {infill:.0%}", lambda one, i=infill: one.settings.infill == i) for infill in INFILLS),
        *((f"{walls} walls, {lids} solid layers", lambda one, w=walls: one.settings.walls == w) for walls, lids in SHELLS),
        *((up, lambda one, u=up: one.up == u) for up in UPS),
        ("parts of the robots", lambda one: one.part in ROBOTS), ("reference solids", lambda one: one.part in SOLIDS),
    ]
    lines = ["| | prints | mean | RMS | worst |", "|---|---|---|---|---|"]
    for name, belongs in groups:
        masses = [one.mass for one in found if belongs(one)]
        if masses:
            lines.append(
                f"| {name} | {len(masses)} | {_percent(float(np.mean(masses)))} | {rms(masses):.1%} | {_percent(max(masses, key=abs))} |"
            )
    return lines


def _percent(value: float) -> str:
    return f"{value:+.1%}".replace("-", "\N{MINUS SIGN}")


def tables(found: Sequence[Case], unsliced: Sequence[str]) -> str:
    """Format the generated section of the page."""
    refused = {(name.partition(",")[0], words) for name, _, words in (line.partition(": ") for line in unsliced)}
    lines = [f"- {name}: `{words}`" for name, words in sorted(refused)]
    return "\n".join([
        f"{version()} sliced {len(found)} prints"
        + (f". PrusaSlicer rejected {len(unsliced)} other prints, which are not included in the results:" if unsliced else "."),
        *lines, "", *summary(found), "", *by_part(found), "", *by_setting(found),
    ])


BEGIN, END = "<!-- print-masses -->\n", "\n<!-- end of print-masses -->"


def main() -> int:
    """Slice all parts, compare the results and write the tables. Return 1 if a bound is exceeded, and 2 if PrusaSlicer is not installed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--print", action="store_true", help="print the results without updating the page")
    parser.add_argument("--keep", action="store_true", help="cache sliced prints in build/prints")
    parser.add_argument("parts", nargs="*", help="measure only these parts (`arm:Hand`), without updating the page")
    arguments = parser.parse_args()
    if program() is None:
        print("prusa-slicer is not installed: apt install prusa-slicer", file=sys.stderr)
        return 2
    wanted = arguments.parts or [*ROBOTS, *SOLIDS]
    unsliced: list[str] = []
    found = list(cases(wanted, KEPT if arguments.keep else None, lambda line: print(line, file=sys.stderr), unsliced))
    text = tables(found, unsliced)
    print(text)
    if not arguments.print and not arguments.parts:
        before, _, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
        PAGE.write_text(before + BEGIN + text + END + rest.partition(END)[2], encoding="utf-8")
    return 0 if kept_bounds(found) else 1


if __name__ == "__main__":
    sys.exit(main())
