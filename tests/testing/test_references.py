"""`certify: references`: a pin that turns and slides between two walls, with first contacts from formulas."""

from __future__ import annotations

import re
from math import asin, atan2, degrees, hypot
from typing import Any

import pytest

from testing.rig import HEAD, Workspace
from thingc.model.solids.contact_cells import JointSide

PARTS = '''
from build123d import Box, Location, Pos

from thingc import MATE, Length, MountPoint, Thing

UNIT = 3.90625  # 1/256 m, so that all corners are exact in meshes
ALONG = Location((0, 0, 0), (-90, 0, 0))


class Pin(Thing):
    """A pin at a radius of 7 to 9 units, which turns about z and slides along y."""

    def __init__(self, width: Length = UNIT):
        super().__init__(material="stuff")
        self.body = Pos(8 * UNIT, 0, UNIT) * Box(2 * UNIT, width, 2 * UNIT)
        self.hub = MountPoint(MATE)
        self.foot = MountPoint(ALONG * MATE)
        self.end = MountPoint(Location((9 * UNIT, 0, UNIT), (0, 90, 0)))

    def result(self):
        return self.body


class Bolt(Thing):
    """A bolt on the end of the pin."""

    def __init__(self, length: Length = UNIT):
        super().__init__(material="stuff")
        self.body = Pos(0, 0, length / 2) * Box(UNIT, UNIT, length)
        self.seat = MountPoint(MATE)

    def result(self):
        return self.body


class Plain(Thing):
    """Two walls, at y = 5 units and y = -6 units."""

    def __init__(self):
        super().__init__(material="stuff")
        wall = Box(16 * UNIT, 2 * UNIT, 2 * UNIT)
        self.walls = [Pos(8 * UNIT, 6 * UNIT, UNIT) * wall, Pos(8 * UNIT, -7 * UNIT, UNIT) * wall]
        self.hinge = MountPoint(Location())
        self.slide = MountPoint(ALONG)

    def result(self):
        return self.walls


class Side(Plain):
    """Walls that are designed for a pin at another mount."""

    def __init__(self):
        super().__init__()
        self.slide.align(Pin().foot)


class Slot(Plain):
    """Walls that are designed for the pin."""

    def __init__(self):
        super().__init__()
        self.hinge.align(Pin().hub)
        self.slide.align(Pin().foot)
'''

TEXT = HEAD + "components:\n  slot: {part: slots:Slot}\n  plain: {part: slots:Side, at: {in: slot.origin, xyz: 0 0 -90 mm}}\n" + "".join(
    f"  slot_{name}: {{part: slots:Slot, at: {{in: slot.origin, xyz: 0 0 {90 * (1 + number)} mm}}}}\n"
    for number, name in enumerate(["wide", "slide", "full", "both"])
) + """\
  pin: {part: slots:Pin}
  pin_plain: {part: slots:Pin}
  pin_wide: {part: slots:Pin, params: {width: 7.8125 mm}}
  pin_bolt: {part: slots:Pin, at: {in: slot.origin, xyz: 0 0 -180 mm}}
  slot_bolt: {part: slots:Slot}
  bolt: {part: slots:Bolt, params: {length: 7.8125 mm}, attach: {seat: pin_bolt.end}}
  pin_slide: {part: slots:Pin}
  stop: {part: slots:Bolt, at: {in: slot_slide.origin, xyz: 31.25 -19.53125 1.953125 mm}}
  pin_full: {part: slots:Pin, params: {width: 50 mm}}
  pin_both: {part: slots:Pin}
joints:
  turn: {type: revolute, parent: slot.hinge, child: pin.hub, limit: {lower: -68 deg, upper: 55 deg}}
  plain: {type: revolute, parent: plain.hinge, child: pin_plain.hub, limit: {lower: -68 deg, upper: 55 deg}}
  wide: {type: revolute, parent: slot_wide.hinge, child: pin_wide.hub, limit: {lower: 10.05 deg, upper: 60 deg}}
  bolt: {type: revolute, parent: pin_bolt.hub, child: slot_bolt.hinge, limit: {lower: -68 deg, upper: 55 deg}}
  slide: {type: prismatic, parent: slot_slide.slide, child: pin_slide.foot, limit: {lower: -40 mm, upper: 15.05 mm}}
  full: {type: revolute, parent: slot_full.hinge, child: pin_full.hub, limit: {lower: -10 deg, upper: 10 deg}}
  both: {type: cylindrical, parent: slot_both.slide, child: pin_both.foot}
modes: {bench: {root: slot}}
"""


def contact(radius: float, half: float, wall: float) -> float:
    """Return the angle [deg] at which the corner (radius, half) of the pin reaches a wall. The lengths have the same unit."""
    return degrees(asin(wall / hypot(radius, half)) - atan2(half, radius))


@pytest.fixture(scope="module")
def answer(tmp_path_factory: pytest.TempPathFactory, shared_store: str) -> Any:
    """Return the results of all tests of one document."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("THINGC_STORE", shared_store)
        rig = Workspace(tmp_path_factory.mktemp("references"))
        (rig.folder / "parts" / "slots.py").write_text(PARTS)
        wanted: dict[str, Any] = {name: f"[{name}]" for name in ("turn", "plain", "wide", "bolt", "slide", "full")}
        upper, lower = (contact(9.0, 0.5, wall) - 0.01 for wall in (5.0, 6.0))
        wanted |= {"inside": f"{{turn: [{-lower} deg, {upper} deg]}}", "both": "{'both[0]': [0 deg, 5 deg], 'both[1]': [0 mm, 30 mm]}"}
        wanted["two"] = "{turn: all, wide: [30 deg, 30.5 deg]}"
        cuts, cut = [], JointSide.cut
        patch.setattr(JointSide, "cut", lambda side, cell: cuts.append(cell) or cut(side, cell))
        found = rig.test(TEXT, "".join(
            f"  {name}: {{no_collision: {{joints: {joints}, certify: references}}}}\n" for name, joints in wanted.items()
        ))
        return {**found, "cuts": len(cuts)}


def finding(answer: Any, name: str) -> Any:
    (one,) = [one for one in answer["diagnostics"] if one["code"] == "TC655" and one["message"].startswith(f"test `{name}`")]
    return one


def check_positions(one: Any, expected: list[float], unit: str = "deg") -> None:
    """Compare the first positions with first contacts, which are at most 0.1 deg or mm and the path of 0.1 mm earlier, and the limits."""
    first = [float(number) for number in re.findall(rf"(\S+) {unit}", one["notes"][0]["message"].partition("overlaps begin at ")[2])]
    late = [abs(found) - abs(contact) for found, contact in zip(first, expected, strict=True)]
    assert all(found * contact > 0.0 for found, contact in zip(first, expected, strict=True)) and -1e-9 < min(late) <= max(late) < 0.3, one
    limits = [float(number) for number in re.findall(rf"(\S+) {unit}", one["help"].partition(";")[0])]
    for found in first:
        assert min(abs(abs(limit - found) - 0.1) for limit in limits) < 1e-6, one


def test_parts_that_stay_apart_are_proved(answer: Any) -> None:
    assert answer["by_name"]["inside"]["passed"]
    assert "slot and pin" in answer["by_name"]["inside"]["measured"]["certificate"]["proved"]


def test_finding_names_reference_joint_first_angles_and_limits(answer: Any) -> None:
    one = finding(answer, "turn")
    assert "`slot` and `pin` overlap by" in one["message"] and "mm^3) at turn = " in one["message"]
    check_positions(one, [-contact(9.0, 0.5, 6.0), contact(9.0, 0.5, 5.0)])
    assert "` in joint `turn`, or cut" in one["help"]
    assert [note["message"] for note in one["notes"][1:]] == [
        "`slot.hinge` was designed for `slots:Pin`", "joint `turn` connects the two parts",
    ]
    lines = TEXT.splitlines()
    assert [lines[note["line"] - 1].split(":")[0].strip() for note in one["notes"][1:]] == ["slot", "turn"]
    assert answer["by_name"]["turn"]["measured"]["certificate"]["touches"] == ["slot and pin"]


def test_parts_are_cut_once_in_a_search(answer: Any) -> None:
    """The search for first positions compares the same parts in a hundred ranges. The cells around a joint do not depend on the range."""
    assert 50 < answer["cuts"] < 500


def test_pairs_at_other_joints_do_not_change_the_limits(answer: Any) -> None:
    assert "`slot_wide` and `pin_wide`" in finding(answer, "two")["notes"][3]["message"]
    helps = [finding(answer, name)["help"].partition(";")[0] for name in ("two", "turn")]
    assert helps[0] == helps[1]


def test_mounts_that_are_not_designed_for_a_part_are_not_compared(answer: Any) -> None:
    assert answer["by_name"]["plain"]["passed"] and answer["by_name"]["plain"]["measured"]["pairs"] == 0
    (one,) = [one for one in answer["diagnostics"] if one["code"] == "TC669"]
    assert one["severity"] == "warning" and "`plain`" in one["message"] and "certify: true" in one["help"]
    assert (TEXT + "tests:\n").count("\n") + 1 <= one["line"] <= TEXT.count("\n") + 12


def test_other_part_is_compared_from_the_nearest_limit(answer: Any) -> None:
    """The pin is wider than the pin that the slot is designed for. The range begins at 10.05 deg."""
    check_positions(finding(answer, "wide"), [contact(9.0, 1.0, 5.0)])
    assert "lower: 10.05 deg" in finding(answer, "wide")["help"]


def test_component_on_the_link_of_the_part_is_found(answer: Any) -> None:
    """The bolt is 2 units long, at the end of the pin. Here, the pin is the parent of the slot."""
    one = finding(answer, "bolt")
    assert "`pin_bolt` and `slot_bolt` overlap" in one["message"] and "slot_bolt.hinge" in one["notes"][1]["message"]
    assert "also `slot_bolt` and `bolt` overlap" in one["notes"][3]["message"]
    check_positions(one, [-contact(11.0, 0.5, 6.0), contact(11.0, 0.5, 5.0)])


def test_slides_are_compared_in_millimetres(answer: Any) -> None:
    """A stop that is fixed to the slot is at y = -5 units, with a width of 1 unit, as the pin."""
    assert "`pin_slide` and `stop` overlap" in str(finding(answer, "slide"))
    check_positions(finding(answer, "slide"), [-4.0 * 3.90625], "mm")
    assert "upper: 15.05 mm" in finding(answer, "slide")["help"]


def test_parts_that_overlap_at_zero_have_no_limits(answer: Any) -> None:
    one = finding(answer, "full")
    assert one["notes"][0]["message"] == "overlaps begin at 0 deg"
    assert one["help"].startswith("attach the part that the mount was designed for")


def test_first_position_is_omitted_for_several_joints(answer: Any) -> None:
    one = finding(answer, "both")
    assert "begin at" not in str(one) and "both[1]" in one["message"] and "slot_both.slide" in one["notes"][0]["message"]
