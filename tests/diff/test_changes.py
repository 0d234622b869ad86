"""Direct changes are reported exactly, and consequences are reported with their causes, in both directions."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest
from msgspec.structs import replace

from diff.cranes import CRANE, drawn, made, sound, write
from thingc.tools.diff.comparison import Comparison, compare
from thingc.tools.diff.snapshot import Change, Snapshot
from thingc.tools.diff.text_report import consequences_of

Made = set[tuple[str, str, str, str | None]]


@pytest.fixture(scope="module")
def crane(tmp_path_factory: pytest.TempPathFactory, shared_store: str) -> Snapshot:
    return drawn(write(tmp_path_factory.mktemp("crane")), shared_store)


EDITS: dict[str, tuple[list[tuple[str, str]], Made]] = {
    "a limit": ([("upper: 20 deg", "upper: 25 deg")], {("joint", "changed", "luff", "limit.upper")}),
    "an effort, which its drive has, too": ([("effort: 9 N*m", "effort: 8 N*m")], {("joint", "changed", "luff", "limit.effort")}),
    "an axis": ([("child: boom.heel", "child: boom.heel\n    axis: [0, 1, 0]")], {("joint", "changed", "luff", "axis")}),
    "a gain": ([("kp: 20", "kp: 30")], {("joint", "changed", "luff", "drive.kp")}),
    "a parameter, and what it is used for": ([("value: 400 mm", "value: 450 mm")], {("parameter", "changed", "reach", "value")}),
    "another expression": ([("half: =reach / 2", "half: =reach / 4")], {("parameter", "changed", "half", "value")}),
    "a parameter of another name": (
        [("  reach: {", "  length: {"), ("half: =reach", "half: =length"), ("[=reach,", "[=length,"),
         ("[0, 0, =reach]", "[0, 0, =length]")],
        {("parameter", "renamed", "reach", None)},
    ),
    "a mass": ([("value: 120 g", "value: 130 g")], {("component", "changed", "hook", "mass.value")}),
    "a mount": ([("xyz: 0 0 500 mm", "xyz: 0 0 600 mm")], {("mount", "changed", "mast/head", "xyz")}),
    "a part less": ([("count: 3", "count: 2")], {("component", "removed", "lamp_2", None)}),
    "a part of another name": ([("  hook: {", "  grab: {")], {("component", "renamed", "hook", None)}),
    "a part of another name and mass": (
        [("  hook: {", "  grab: {"), ("value: 120 g", "value: 130 g")],
        {("component", "renamed", "hook", None), ("component", "changed", "hook", "mass.value")},
    ),
    "an assembly of another name, in which nothing else is": (
        [("  cabin: {assembly", "  hut: {assembly")], {("component", "renamed", "cabin", None)},
    ),
    "a joint of another name": (
        [("  luff:\n", "  raise:\n"), ("{luff: -45", "{raise: -45"), ("drive: luff", "drive: raise")], {("joint", "renamed", "luff", None)},
    ),
    "a mate": ([("attach: {origin: boom.tip}", "attach: {mount: origin, to: boom.tip, gap: 5 mm}")], {("mate", "changed", "hook", "gap")}),
    "another mount to meet": ([("attach: {origin: boom.tip}", "attach: {origin: mast.foot}")], {("mate", "changed", "hook", "to")}),
    "a pose": ([("luff: -45 deg", "luff: -50 deg")], {("pose", "changed", "up", "luff")}),
    "a root": ([("{root: mast,", "{root: boom,")], {("mode", "changed", "stand", "root")}),
    "a mount that is shown": ([("mounts: {tip: boom.tip}", "mounts: {tip: boom.heel}")], {("mount", "changed", "tip", "of")}),
    "a sensor less": ([("sensors: {tilt: {type: imu, at: tip}}\n", "")], {("sensor", "removed", "tilt", None)}),
    "a test": ([("max: 2.6 kg", "max: 2.7 kg")], {("test", "changed", "light", "mass.max")}),
    "the name": ([("name: crane", "name: derrick")], {("component", "changed", "", "name")}),
}


@pytest.mark.parametrize("name", EDITS)
def test_edit_is_reported_exactly(name: str, crane: Snapshot, tmp_path: Path, shared_store: str) -> None:
    edits, expected = EDITS[name]
    assert made(sound(crane, drawn(write(tmp_path, *edits), shared_store))) == expected


def test_edit_of_a_nested_document_has_its_path(crane: Snapshot, tmp_path: Path, shared_store: str) -> None:
    new = drawn(write(tmp_path, cabin=(("value: 200 mm", "value: 220 mm"),)), shared_store)
    comparison = sound(crane, new)
    assert made(comparison) == {("parameter", "changed", "cabin/width", "value")}
    assert {(c.what, c.path, c.because) for c in comparison.changes if c.caused and c.what in ("mount", "component")} == {
        ("mount", "cabin/box/wall", ("cabin/width",)), ("component", "cabin/seat", ("cabin/width",)),
    }


def test_consequences_have_their_cause(crane: Snapshot, tmp_path: Path, shared_store: str) -> None:
    comparison = sound(crane, drawn(write(tmp_path, ("value: 120 g", "value: 150 g"), ("value: 400 mm", "value: 450 mm")), shared_store))
    follows = {(c.what, c.path, c.field): c for c in comparison.changes if c.caused}
    assert set(follows[("mass", "", "robot.mass")].because) == {"hook", "reach"}
    assert follows[("mass", "hook", "mass")].because == ("hook",)
    place = follows[("component", "hook", "place")]
    assert place.change == "moved" and place.because == ("reach",)
    assert place.old == pytest.approx((0.0, 0.0, 0.1)) and place.new == pytest.approx((0.0, 0.0, 0.05))  # the boom hangs at q = 0
    assert follows[("parameter", "half", "value")].because == ("reach",)
    assert [follows[("mode", mode, "at.xyz")].because for mode in ("hung", "moon")] == [("reach",), ("reach",)]
    assert follows[("mount", "boom/tip", "xyz")].because == ("reach",)


def test_changed_reach_has_its_cause(crane: Snapshot, tmp_path: Path, shared_store: str) -> None:
    """The head of the mast is the farthest point, because the boom hangs down at q = 0."""
    comparison = sound(crane, drawn(write(tmp_path, ("0 0 500 mm", "0 0 560 mm")), shared_store))
    (reach,) = [c for c in comparison.changes if c.field == "robot.reach"]
    assert (reach.old, reach.new, reach.because) == (pytest.approx(0.5), pytest.approx(0.56), ("mast/head",))


@pytest.mark.parametrize(("kind", "at", "words"), [
    ("cylindrical", "[=1 rad * lean, 0]", ("30 deg", "45 deg")), ("cylindrical", "[0, =9 mm * lean]", ("4.71239 mm", "7.06858 mm")),
    ("planar", "[=9 mm * lean, 0, 0]", ("4.71239 mm", "7.06858 mm")), ("screw, lead: 9 mm", "=1 rad * lean", ("30 deg", "45 deg")),
])
def test_computed_values_use_the_unit_of_the_coordinate(
    tmp_path: Path, shared_store: str, kind: str, at: str, words: tuple[str, str],
) -> None:
    text = """\
thingc: assembly/1
name: rod
parameters: {lean: 30 deg / 1 rad}
components:
  rod: {link: true, shapes: [{box: 20 20 20 mm}], mass: 1 kg, mounts: {end: {xyz: 0 0 10 mm}}}
  sleeve: {link: true, shapes: [{box: 20 20 20 mm}], mass: 1 kg, mounts: {end: {xyz: 0 0 10 mm}}}
joints: {fit: {type: KIND, parent: rod.end, child: sleeve.end}}
poses: {out: {fit: AT}}
"""
    robots: list[Snapshot] = []
    for name, lean in (("before", math.pi / 6.0), ("after", math.pi / 4.0)):
        (tmp_path / name).mkdir()
        document = tmp_path / name / "rod.yaml"
        document.write_text(text.replace("KIND", kind).replace("AT", at).replace("30 deg / 1 rad", repr(lean)))
        robots.append(drawn(document, shared_store))
    assert [change.words for change in compare(*robots).changes if change.what == "pose"] == [words]


def test_quaternions_are_shown_as_written(crane: Snapshot, tmp_path: Path, shared_store: str) -> None:
    """Compared with another quaternion, both are shown; compared with angles or no value, angles are shown. The same rotation in another
    notation is not a change."""
    yard = "stand: {root: mast, base: fixed, pose: up"
    turns = ("", ", at: {rpy: 0 0 90 deg}", ", at: {quat: [0.5, 0.5, 0.5, 0.5]}", ", at: {quat: [0.6, 0, 0.8, 0]}")
    none, angles, one, other = (drawn(write(tmp_path / str(k), (yard, yard + at)), shared_store) for k, at in enumerate(turns))
    (change,) = [c for c in compare(one, other).changes if c.path == "stand" and not c.caused]
    assert (change.field, change.words) == ("at.rpy", ("quat [0.5, 0.5, 0.5, 0.5]", "quat [0.6, 0, 0.8, 0]"))
    assert change.span is not None and change.span.line == 1 + CRANE[: CRANE.index("  stand:")].count("\n")
    for plain in (none, angles):
        assert [c.words for c in compare(plain, other).changes if c.path == "stand"] == [None]
    same = drawn(write(tmp_path / "same", (yard, f"{yard}, at: {{quat: [{math.sqrt(0.5)!r}, 0, 0, {math.sqrt(0.5)!r}]}}")), shared_store)
    assert compare(angles, same).changes == ()


def test_renamed_components_have_a_reason(crane: Snapshot, tmp_path: Path, shared_store: str) -> None:
    """A unique match has a reason. Three similar lamps are matched by position and marked as uncertain."""
    comparison = compare(crane, drawn(write(tmp_path, ("  hook: {", "  grab: {"), ("  lamp:\n", "  light:\n")), shared_store))
    assert {(c.path, c.new_path, c.reason, c.because) for c in comparison.changes if c.path == "hook"} == {
        ("hook", "grab", "the same definition, attached to `boom` as before", ()),
    }
    # three lamps meet the boom in the same way: their places tell them apart, which is said with doubt
    lamps = [c for c in comparison.changes if c.path.startswith("lamp")]
    assert [(c.path, c.new_path, c.because) for c in lamps] == [(f"lamp_{i}", f"light_{i}", ("perhaps",)) for i in range(3)]
    assert [c for c in comparison.changes if c.caused] == []


REWRITES = {
    "comments and empty lines": lambda text: re.sub(r"\n(?=[a-z]+:)", "\n# a remark\n\n", text),
    "other units": lambda text: text.replace("400 mm", "0.4 m").replace("500 mm", "50 cm").replace("120 g", "0.12 kg"),
    "other layout": lambda text: text.replace("{luff: -45 deg}, out: {}}", "\n    luff: -45 deg\n  out: {}\n").replace("{up: ", "\n  up: "),
    "an anchor": lambda text: text.replace("{value: 2 kg, source: measured}", "&m {value: 2 kg, source: measured}"),
    "a value worked out": lambda text: text.replace("max: 800 mm", "max: 0.8 m").replace("upper: 20 deg", "upper: =40 deg / 2"),
    "keys in another order": lambda text: text.replace(
        "upper: 20 deg, effort: 9 N*m", "effort: 9 N*m, upper: 20 deg").replace("lower: -60 deg, ", "lower: -60 deg, "),
    "sections in another order": lambda text: "\n".join([
        text.partition("\nmodes:")[0].rstrip("\n"), "tests:" + text.partition("\ntests:")[2].rstrip("\n"),
        "modes:" + text.partition("\nmodes:")[2].partition("\ntests:")[0],
    ]),
    "poses and tests in another order": lambda text: text.replace("{up: {luff: -45 deg}, out: {}}", "{out: {}, up: {luff: -45 deg}}"),
    "a mount by its other name": lambda text: text.replace("at: tip}", "at: boom.tip}"),
}


@pytest.mark.parametrize("name", REWRITES)
def test_equivalent_documents_have_no_changes(name: str, crane: Snapshot, tmp_path: Path, shared_store: str) -> None:
    text = REWRITES[name](CRANE)
    assert text != CRANE
    document = write(tmp_path)
    document.write_text(text)
    assert compare(crane, drawn(document, shared_store)).changes == ()


def test_test_measurements_have_units_and_are_merged() -> None:
    """Equal values of several poses are one line. Outcomes are listed for each pose, before everything else."""
    def change(field: str, old: object, new: object) -> Change:
        return Change(what="test", change="changed", path="stays", field=field, old=old, new=new, because=("boom",))  # type: ignore[arg-type]

    found = (
        change("measured.mass [stand, up]", 2.0, 2.5), change("measured.mass [stand, out]", 2.0, 2.5), change("reach.min", 0.3, 0.4),
        change("measured.rest [stand, up]", 0.5, 0.25), change("measured.moved [stand, up]", 0.002, None),
        change("passed [stand, up]", True, False), change("measured.margin", 2.0, 3.0),
        change("measured.distance", 0.002, 0.001), change("measured.gap", 0.002, 0.001),
    )
    assert [line.words for line in consequences_of(Comparison(name="crane", changes=found))] == [
        " [stand, up]: FAILS now", ": measured.mass 2 kg -> 2.5 kg (+25 %)", ": reach.min 300 mm -> 400 mm (+33.3 %)",
        ": measured.rest [stand, up] 0.5 s -> 0.25 s (-50 %)", ": measured.moved [stand, up] 2 mm -> nothing",
        ": measured.margin 2 -> 3 (+50 %)", ": measured.distance 2 mm -> 1 mm (-50 %)", ": measured.gap 2 mm -> 1 mm (-50 %)",
    ]


def test_rotation_in_place_is_reported_as_a_turn(crane: Snapshot, tmp_path: Path, shared_store: str) -> None:
    """The head of the mast is rotated by 52 deg. The boom rotates about its heel, and the hook, 400 mm away, also moves."""
    comparison = sound(crane, drawn(write(tmp_path, ("xyz: 0 0 500 mm, rpy: 90", "xyz: 0 0 500 mm, rpy: 142")), shared_store))
    moved = {(c.path, c.field) for c in comparison.changes if c.what == "component" and c.change == "moved"}
    assert {("boom", "turn"), ("hook", "turn"), ("hook", "place")} <= moved and ("boom", "place") not in moved
    (sentence,) = [one for one in consequences_of(comparison) if one.what == "component"]
    assert "boom" in sentence.paths and "hook" in sentence.paths
    assert sentence.words == f": moved by up to {800 * math.sin(math.radians(26)):.0f} mm and turned by up to 52 deg"
    (boom,) = [c for c in comparison.changes if (c.path, c.field) == ("boom", "turn")]
    alone = replace(comparison, changes=(boom,))
    assert [one.words for one in consequences_of(alone)] == [": turned by up to 52 deg"]
