"""The naming study detects moved names, missing features, and picks that select another feature."""

from __future__ import annotations

import runpy
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:  # every process of a run imports this file, and build123d takes two seconds
    from build123d import Solid

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module", autouse=True)
def on_path():
    folders = [str(ROOT / "benchmarks" / "naming"), str(ROOT / "parts")]
    sys.path[:0] = folders
    yield
    for folder in folders:
        sys.path.remove(folder)


@pytest.fixture(scope="module")
def block() -> Solid:
    """A block of 40 x 20 x 10 with its middle at the origin, an M3 clearance hole along z at (12, 0), and a shaft upwards at (-12, 0)."""
    from build123d import Plane, Solid

    box = Solid.make_box(40, 20, 10, Plane((-20, -10, -5)))
    return (
        box.fuse(Solid.make_cylinder(3, 8, Plane((-12, 0, 5)))).cut(Solid.make_cylinder(1.7, 20, Plane((12, 0, -10)))).solid()
    )


def found(block: Solid, feature: object) -> int:
    from features import is_feature

    return sum(is_feature(face, feature) for face in block.faces())


def test_plane_is_found_by_height_normal_and_extent(block):
    from features import Feature

    def plane(on, axis):
        return found(block, Feature(kind="plane", on=on, axis=axis))

    assert plane((0, 0, 5), (0, 0, 1)) == 1
    assert plane((0, 0, 5), (0, 0, -1)) == 0, "a normal into the material"
    assert plane((0, 0, 5 + 2e-6), (0, 0, 1)) == 0
    assert plane((0, 0, 5 + 5e-7), (0, 0, 1)) == 1
    assert plane((30, 0, 5), (0, 0, 1)) == 0, "beyond the face"
    assert plane((12, 0, 5), (0, 0, 1)) == 0, "in the hole"
    assert plane((-12, 0, 13), (0, 0, 1)) == 1, "the end of the shaft"
    assert plane((0, 0, -5), (0, 0, -1)) == 1


def test_holes_and_shafts_are_distinguished(block):
    from features import Feature

    def cylinder(kind, on, diameter, axis=(0, 0, 1)):
        return found(block, Feature(kind=kind, on=on, axis=axis, diameter=diameter))

    assert cylinder("hole", (12, 0, 0), 3.4) == 1
    assert cylinder("hole", (12, 0, 0), 3.4, (0, 0, -1)) == 1
    assert cylinder("shaft", (12, 0, 0), 3.4) == 0
    assert cylinder("hole", (12, 0, 0), 3.2) == 0
    assert cylinder("hole", (12, 2e-6, 0), 3.4) == 0
    assert cylinder("hole", (12, 0, 6), 3.4) == 0, "above the block"
    assert cylinder("hole", (12, 0, 0), 3.4, (1, 0, 0)) == 0
    assert cylinder("shaft", (-12, 0, 9), 6) == 1
    assert cylinder("hole", (-12, 0, 9), 6) == 0


def test_moved_mounts_and_solids_are_detected():
    from build123d import Location, Pos
    from intents_arm import rotor_brace
    from sweep import fault

    from arm import RotorBrace

    brace = RotorBrace(length=120)
    rows = {row.name: row for row in rotor_brace(120, 3)}
    for name, row in rows.items():
        frame = row.frame(brace)
        assert fault(frame, row, brace.result()) is None, name
        assert "meant in" in fault(Pos(0, 0, 1e-5) * frame, row, brace.result())
        assert "meant along" in fault(frame * Location((0, 0, 0), (0.001, 0, 0)), row, brace.result())
        assert "the solid has no" in fault(frame, row, Pos(0.7, 0.7, 0.7) * brace.result())
    longer = RotorBrace(length=121)
    assert "meant in" in fault(rows["servo_seat"].frame(longer), rows["servo_seat"], longer.result())


def test_names_are_stable_and_some_picks_are_not():
    import intents_arm
    import intents_stock
    from picks import EDGES, FACES
    from sweep import sweep

    import arm
    from thingc_stock.cells import CellTray

    brackets = sweep(arm.YawPitchBracket, intents_arm.yaw_pitch_bracket, 2)
    trays = sweep(CellTray, intents_stock.cell_tray, 2)
    for result in (brackets, trays):
        assert result.wrong == [] and result.refused == []
        assert result.checks >= result.names * 4
        # Picks are made of every other member, in every way.
        for selector in FACES:
            count = sum(number for (s, _, _), number in result.picks.items() if s == selector)
            assert count + result.gone[selector, "another"] + result.gone[selector, "fails"] == result.names * (result.members - 1)
    assert brackets.members == 5
    assert trays.members == 7
    assert any(number for (s, _, o), number in brackets.picks.items() if s == EDGES[0] and o == "another")
    assert any(number for (s, _, o), number in trays.picks.items() if s == FACES[0] and o == "another")
    # A tray for two cells has no third bay: the name says so, an index gives something else.
    assert trays.gone["name", "fails"] == 1 and trays.gone["name", "another"] == 0
    assert trays.gone[FACES[0], "another"] == 1


def test_pick_selects_its_feature_in_the_original_part(block):
    from features import Feature, is_feature, is_rim
    from picks import EDGES, FACES, Lists, chosen

    lists = Lists(block)
    hole = Feature(kind="hole", on=(12, 0, 0), axis=(0, 0, 1), diameter=3.4, rim=(12, 0, 5))
    top = Feature(kind="plane", on=(-12, 0, 13), axis=(0, 0, 1))
    for selector in FACES:
        for feature in (hole, top):
            assert is_feature(chosen(selector, lists, feature, lambda face, f=feature: is_feature(face, f)).of(lists), feature)
    for selector in EDGES:
        assert is_rim(chosen(selector, lists, hole, lambda edge: is_rim(edge, hole)).of(lists), hole)
    assert chosen(FACES[0], lists, top, lambda face: False) is None
    # The end of the shaft is the highest face by 4 mm or more.
    assert (pick := chosen(FACES[1], lists, top, lambda face: is_feature(face, top))) and (pick.axis, pick.index) == ("Z", -1)


def test_mount_without_intent_is_an_error():
    import intents_arm
    from sweep import sweep

    import arm

    with pytest.raises(ValueError, match=r"no intent is written for \['tip'\] of PenDummy"):
        sweep(arm.PenDummy, lambda **given: intents_arm.pen_dummy(**given)[:1], 2)


def test_page_equals_the_output():
    from intents_stock import cell
    from sweep import sweep

    from thingc_stock.cells import Cell18650

    study = runpy.run_path(str(ROOT / "benchmarks" / "naming" / "study.py"))
    page = study["PAGE"].read_text(encoding="utf-8")
    head, _, tables = page.partition("## Names\n")
    assert study["written"]({}, study["STEPS"]).startswith(head) and "study.py" in head
    assert "The number of wrong results is 0." in tables
    for parts in study["PARTS"].values():
        assert all(f" {part.__name__} |" in tables for part, _ in parts)
    # Two ends of two ranges, and the default: five members with three names.
    small = study["written"]({"bought": [sweep(Cell18650, cell, 2)]}, 2)
    assert "\n| bought | Cell18650 | 5 | 0 | 3 | 15 | 15 | 0 |\n" in small
    assert "\n| bought | Cell18650 | 12 | 100.0 / 0.0 / 0.0 |" in small
