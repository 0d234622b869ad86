"""`make print-masses` on a few prints, and the parser of G-code."""

from __future__ import annotations

import math
import struct
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "benchmarks" / "prints"))

import joined
import print_masses as study
import prusa

from thingc.base.inertia import MassProperties
from thingc.geometry.worker.kernel.slicing import JOINED

sliced = pytest.mark.skipif(prusa.program() is None, reason="PrusaSlicer is not installed (Debian, Ubuntu: apt install prusa-slicer)")


@sliced
def test_masses_of_prints_equal_those_of_prusaslicer(shared_store: str, tmp_path: Path) -> None:
    """A part of a robot, a bridge and a slope, which are a small part of the study."""
    with study.session(tmp_path, shared_store) as opened:
        for part, up, settings in (
            ("arm:OmegaCap", "as modelled", prusa.Settings(walls=3, lids=4, infill=0.15)),
            ("solids:Table", "as modelled", prusa.Settings(walls=4, lids=6, infill=0.25)),
            ("solids:Wedge", "on its side", prusa.Settings(walls=2, lids=3, infill=0.5)),
        ):
            found = study.case(opened, part, up, settings, None)
            assert abs(found.mass) < 0.02, part
            assert found.centre < 0.01, part
            assert max(map(abs, found.moments)) < 0.04, part


def test_extrusions_are_read_from_g_code() -> None:
    """Two lines of 10 mm of different kinds. Travels, retractions and moves of the filament alone add no material."""
    gcode = """\
        G1 Z0.2 F720
        G1 X10 Y20
        ;TYPE:Perimeter
        G1 X20 Y20 E1.5 ; along x
        G1 E-2
        G1 X50 Y50
        G1 E2
        ;TYPE:Bridge infill
        G1 X50 Y60 E.5
        G1 Z0.4"""
    lines = [line.strip() for line in gcode.splitlines()]
    section = math.pi / 4 * 1.75**2
    assert list(prusa.extrusions(lines)) == [
        (10.0, 20.0, 20.0, 20.0, 0.2, 1.5 * section, "Perimeter"), (50.0, 50.0, 50.0, 60.0, 0.2, 0.5 * section, "Bridge infill"),
    ]
    found = prusa._integrated("\n".join(lines), 0.2, np.zeros(3))
    assert found.volume == pytest.approx(2 * section)
    assert found.centre == pytest.approx(((1.5 * 15 + 0.5 * 50) / 2, (1.5 * 20 + 0.5 * 55) / 2, 0.1))
    assert found.kinds == pytest.approx({"Perimeter": 1.5 * section, "Bridge infill": 0.5 * section})
    x, y, _ = found.centre
    about_x = 1.5 * (20 - y) ** 2 + 0.5 * ((55 - y) ** 2 + 100 / 12)
    about_y = 1.5 * ((15 - x) ** 2 + 100 / 12) + 0.5 * (50 - x) ** 2
    assert found.inertia[0][0] == pytest.approx(section * about_x)
    assert found.inertia[2][2] == pytest.approx(section * (about_x + about_y))


def stl(*triangles: tuple[tuple[float, float, float], ...]) -> bytes:
    body = b"".join(struct.pack("<12fH", 0, 0, 0, *(x for corner in one for x in corner), 0) for one in triangles)
    return bytes(80) + struct.pack("<I", len(triangles)) + body


def test_errors_are_relative_to_prusaslicer() -> None:
    """A part that is 2 % too heavy, whose centre is 1 mm too high with an extent of 50 mm, and whose inertia is 4 % too large."""
    mesh = stl(((0, 0, 0), (20, 0, 0), (0, 40, 0)), ((0, 0, 50), (20, 0, 50), (0, 40, 50)))
    theirs = prusa.Printed(volume=1000.0, centre=(5.0, 5.0, 20.0), inertia=((2e5, 0, 0), (0, 3e5, 0), (0, 0, 4e5)), kinds={})
    own = np.diag([2e5, 3e5, 4e5]) * 1e-15 * study.DENSITY * 1.04
    ours = MassProperties(mass=1.02e-6 * study.DENSITY, centre=(0.005, 0.005, 0.021), inertia=tuple(map(tuple, own.tolist())))
    found = study.compared("p:Box", "as modelled", prusa.Settings(walls=3, lids=4, infill=0.15), ours, theirs, np.eye(3), mesh)
    assert (found.mass, found.centre, found.moments) == (pytest.approx(0.02), pytest.approx(0.02), pytest.approx((0.04,) * 3))


def test_share_of_joins_follows_from_the_rule() -> None:
    assert joined.share(joined.FAMILIES["stars"], 360, 1000, seed=1) == pytest.approx(JOINED, abs=0.01)
    even = np.arange(0.0, 101.0)  # ends as far from each other: every second gap, but for one at the end
    assert joined.joined(even) == pytest.approx(0.5, abs=0.011)


def test_page_contains_all_parts_within_bounds() -> None:
    """docs/studies/prints.md as written by the command: every part is in it, and the errors are within the bounds."""
    text = study.PAGE.read_text(encoding="utf-8").partition(study.BEGIN)[2].partition(study.END)[0].replace("\N{MINUS SIGN}", "-")
    rows = {cells[0]: cells[1:] for line in text.splitlines() if (cells := [cell.strip() for cell in line.strip("| ").split("|")])}
    for name in (*study.ROBOTS.values(), *study.SOLIDS.values()):
        assert len(rows[name]) == 10, name
    _, rms, ninth, worst = (abs(float(cell.rstrip("%"))) / 100 for cell in rows["mass"][:4])
    assert all(error <= bound for error, bound in zip((ninth, worst, rms), study.MASS, strict=True))
    assert float(rows["centre, of the extent"][2].rstrip("%")) / 100 <= study.CENTRE
    assert float(rows["principal moments"][2].rstrip("%")) / 100 <= study.MOMENTS
