"""Interfaces of mated mounts: pairs with a known result. Components are frames, so no CAD kernel is needed."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

from thingc.base.diagnostics import Diagnostic
from thingc.driver import pipeline
from thingc.driver.environment import Environment, Options
from thingc.tools.cli.main import main

M3 = "bolts: {thread: M3, count: 4, circle: 16 mm}"

# the parent's interface, the child's, `turn`, and what is said of both (None: they fit)
PAIRS = {
    "equal": (M3, M3, "0", None),
    "circle": ("bolts: {thread: M3, count: 4, circle: 14 mm}", M3, "0", "bolt circle 14 mm on `a.m`, bolt circle 16 mm on `b.n`"),
    "a micrometre": ("bolts: {thread: M3, count: 4, circle: 16.001 mm}", M3, "0", None),
    "two micrometres": (
        "bolts: {thread: M3, count: 4, circle: 16.002 mm}", M3, "0", "bolt circle 16.002 mm on `a.m`, bolt circle 16 mm on `b.n`",
    ),
    "inches": ("bolts: {thread: M3, count: 4, circle: 1 in}", "bolts: {thread: M3, count: 4, circle: 25.4 mm}", "0", None),
    "thread": ("bolts: {thread: M2.5, count: 4, circle: 16 mm}", M3, "0", "thread M2.5 on `a.m`, thread M3 on `b.n`"),
    "thread in lower case": ("bolts: {thread: m3, count: 4, circle: 16 mm}", M3, "0", None),
    "every second hole": ("bolts: {thread: M3, count: 8, circle: 16 mm}", M3, "0", None),
    "every second hole, turned by one": ("bolts: {thread: M3, count: 8, circle: 16 mm}", M3, "45 deg", None),
    "count": ("bolts: {thread: M3, count: 3, circle: 16 mm}", M3, "0", "3 bolts on `a.m`, 4 bolts on `b.n`"),
    # a mate maps an angle u of the child to turn - 90 deg - u: 4 holes coincide at 0, 90 ...
    "four, turned by 45": (M3, M3, "45 deg", "(distance 6.12293 mm, in the frame of the first mount)"),
    "four, turned by -90": (M3, M3, "-90 deg", None),
    "three": (  # 0 against -90 deg: -90 + 120 = 30 deg off
        "bolts: {thread: M3, count: 3, circle: 16 mm}", "bolts: {thread: M3, count: 3, circle: 16 mm}", "0",
        "bolt at 0 deg, 8 mm on `a.m`, bolt at 30 deg, 8 mm on `b.n` (distance 4.1411 mm, in the frame of the first mount)",
    ),
    "three, turned by 90": ("bolts: {thread: M3, count: 3, circle: 16 mm}", "bolts: {thread: M3, count: 3, circle: 16 mm}", "90 deg", None),
    "three, started at -90": (
        "bolts: {thread: M3, count: 3, circle: 16 mm}", "bolts: {thread: M3, count: 3, circle: 16 mm, start: -90 deg}", "0", None,
    ),
    "two, side by side": (
        "bolts: {thread: M3, at: [[8 mm, 0], [-8 mm, 0]]}", "bolts: {thread: M3, at: [[0, 8 mm], [0, -8 mm]]}", "0", None,
    ),
    "two, across": (
        "bolts: {thread: M3, at: [[8 mm, 0], [-8 mm, 0]]}", "bolts: {thread: M3, at: [[8 mm, 0], [-8 mm, 0]]}", "0",
        "bolt at 0 deg, 8 mm on `a.m`, bolt at 90 deg, 8 mm on `b.n` (distance 11.3137 mm",
    ),
    "a list and a circle": ("bolts: {thread: M3, at: [[8 mm, 0], [-8 mm, 0]]}", M3, "0", None),
    "one hole": ("bolts: {thread: M3}", "bolts: {thread: M3}", "17 deg", None),
    "boss in bore": ("bore: {diameter: 6.1 mm, clearance: [0.05 mm, 0.2 mm]}", "boss: {diameter: 6 mm}", "0", None),
    "boss too large": (
        "bore: {diameter: 6.1 mm}", "boss: {diameter: 6.2 mm}", "0",
        "bore 6.1 mm on `a.m`, boss 6.2 mm on `b.n` (clearance -0.1 mm, expected at least 0)",
    ),
    "boss too loose": (
        "bore: {diameter: 6.3 mm, clearance: [0.05 mm, 0.2 mm]}", "boss: {diameter: 6 mm}", "0",
        "clearance 0.3 mm, expected 0.05 to 0.2 mm",
    ),
    "press fit": ("bore: {diameter: 5.98 mm, clearance: [-0.03 mm, 0]}", "boss: {diameter: 6 mm}", "0", None),
    "boss too long": (
        "bore: {diameter: 6 mm, depth: 5 mm}", "boss: {diameter: 6 mm, length: 8 mm}", "0",
        "bore 5 mm deep on `a.m`, boss 8 mm long on `b.n`",
    ),
    "two bosses": ("boss: {diameter: 6 mm}", "boss: {diameter: 6 mm}", "0", "boss 6 mm on `a.m`, boss 6 mm on `b.n`"),
    "two bores": ("bore: {diameter: 6 mm}", "bore: {diameter: 6 mm}", "0", None),
    "plug in socket": ("connector: JST-PH-2, side: plug", "connector: JST-PH-2, side: socket", "0", None),
    "two plugs": ("connector: JST-PH-2, side: plug", "connector: JST-PH-2, side: plug", "0", "plug JST-PH-2 on `a.m`, plug JST-PH-2 on"),
    "other connector": ("connector: JST-PH-2", "connector: JST-XH-2", "0", "connector JST-PH-2 on `a.m`, connector JST-XH-2 on `b.n`"),
    "counterpart": ("connector: PHR-2, side: plug, counterpart: B2B-PH-K", "connector: B2B-PH-K, side: socket", "0", None),
    "other counterpart": ("connector: PHR-2, counterpart: B2B-PH-K", "connector: B3B-PH-K", "0", "connector PHR-2 on `a.m`"),
    "bolts on a connector": (M3, "connector: JST-PH-2", "0", "4 x M3 on 16 mm on `a.m`, connector JST-PH-2 on `b.n`"),
    "screw": ("bolts: {thread: M3}", "shank: {thread: M3, length: 8 mm}", "0", None),
    "thick screw": ("bore: {diameter: 3.2 mm}", "shank: {thread: M4, length: 8 mm}", "0", "bore 3.2 mm on `a.m`, thread M4 on `b.n`"),
    "several": (f"{M3}, boss: {{diameter: 8 mm}}", f"bore: {{diameter: 8.6 mm}}, {M3}", "0", None),
    "one of several": (f"{M3}, boss: {{diameter: 8 mm}}", M3, "0", None),
    "name": ("name: x430-horn", "name: x540-horn", "0", None),
}


def check(folder: Path, text: str) -> list[Diagnostic]:
    """Diagnostics of a document."""
    document = folder / "robot.yaml"
    document.write_text(text)
    with Environment(str(document), Options(store=str(folder / "store"))) as environment:
        return pipeline.check(environment).report.diagnostics


MASS = "mass: 10 g, inertia: {ixx: 1e-6 kg*m^2, iyy: 1e-6 kg*m^2, izz: 1e-6 kg*m^2}"


def two(parent: str, child: str, placement: str, more: str = "") -> str:
    return (
        "thingc: assembly/1\nname: two\ncomponents:\n"
        f"  a: {{frame: true, {MASS}, mounts: {{m: {{xyz: 10 2 -7 mm, rpy: 30 10 70 deg, interface: {parent}}}}}}}\n"
        f"  b: {{frame: true, {MASS}, mounts: {{n: {{rpy: 5 60 20 deg, interface: {child}}}}}{placement}}}\n{more}"
    )


@pytest.mark.parametrize("name", PAIRS)
def test_attached_interfaces_are_compared(tmp_path: Path, name: str) -> None:
    """Incompatible interfaces of attached mounts are reported once as TC534."""
    parent, child, turn, expected = PAIRS[name]
    found = check(tmp_path, two(f"{{{parent}}}", f"{{{child}}}", f", attach: {{mount: n, to: a.m, turn: {turn}}}"))
    assert [one.code.code for one in found] == ([] if expected is None else ["TC534"])
    assert expected is None or expected in found[0].message, found[0].message


@pytest.mark.parametrize("name", PAIRS)
def test_compatibility_does_not_depend_on_the_parent(tmp_path: Path, name: str) -> None:
    """Exchanging parent and child does not change whether the interfaces fit."""
    parent, child, turn, expected = PAIRS[name]
    found = check(tmp_path, two(f"{{{child}}}", f"{{{parent}}}", f", attach: {{mount: n, to: a.m, turn: {turn}}}"))
    assert bool(found) == (expected is not None)


@pytest.mark.parametrize("name", PAIRS)
def test_mirrored_interfaces_are_compared(tmp_path: Path, name: str) -> None:
    """The pair in a mirrored nested assembly has the same result."""
    parent, child, turn, expected = PAIRS[name]
    check(tmp_path, two(f"{{{parent}}}", f"{{{child}}}", f", attach: {{mount: n, to: a.m, turn: {turn}}}"))
    (tmp_path / "inner.yaml").write_text((tmp_path / "robot.yaml").read_text())
    found = check(tmp_path, "thingc: assembly/1\nname: outer\ncomponents: {left: {assembly: inner.yaml, mirror: y}}\n")
    assert [one.code.code for one in found] == ([] if expected is None else ["TC534"])


JOINT = "joints: {{j: {{type: {kind}, parent: a.m, child: b.n, turn: {turn}{more}}}}}\n"
LIMIT = ", limit: {lower: -10 deg, upper: 10 deg}"


@pytest.mark.parametrize(("kind", "turn", "more", "fits"), [
    ("fixed", "0", "", True), ("fixed", "45 deg", "", False),
    ("revolute", "45 deg", LIMIT, True),  # the holes turn
    ("prismatic", "45 deg", ", limit: {lower: 0, upper: 10 mm}", False),
])
def test_joint_angle_matters_unless_the_holes_rotate(tmp_path: Path, kind: str, turn: str, more: str, fits: bool) -> None:
    """For a revolute joint, the orientation of bolt holes is not compared. For fixed and prismatic joints it is."""
    found = check(tmp_path, two(f"{{{M3}}}", f"{{{M3}}}", "", JOINT.format(kind=kind, turn=turn, more=more)))
    assert [one.code.code for one in found] == ([] if fits else ["TC534"])


def test_revolute_joint_compares_bolt_circles(tmp_path: Path) -> None:
    """The diagnostic is at the joint, with notes at both mounts."""
    other = "{bolts: {thread: M3, count: 4, circle: 22 mm}}"
    found = check(tmp_path, two(f"{{{M3}}}", other, "", JOINT.format(kind="revolute", turn="0", more=LIMIT)))
    assert [one.message for one in found] == ["mount `b.n` does not fit `a.m`: bolt circle 16 mm on `a.m`, bolt circle 22 mm on `b.n`"]
    assert found[0].span is not None
    assert found[0].span.line == 6
    assert [note.span.line for note in found[0].notes if note.span is not None] == [4, 5]


def test_gap_reduces_boss_engagement(tmp_path: Path) -> None:
    """A boss 8 mm long fits a bore 5 mm deep only with a gap of 3 mm."""
    bore, boss = "{bore: {diameter: 6 mm, depth: 5 mm}}", "{boss: {diameter: 6 mm, length: 8 mm}}"
    assert check(tmp_path, two(bore, boss, ", attach: {mount: n, to: a.m, gap: 3 mm}")) == []
    assert len(check(tmp_path, two(bore, boss, ", attach: {mount: n, to: a.m, gap: 2.9 mm}"))) == 1


def test_interface_names_are_not_compared(tmp_path: Path) -> None:
    """Interfaces given as text are names and are never reported as incompatible."""
    assert check(tmp_path, two("x430-horn", "x540-horn", ", attach: {n: a.m}")) == []
    assert check(tmp_path, two("x430-horn", f"{{{M3}}}", ", attach: {n: a.m}")) == []


def test_repeated_mismatch_is_reported_once(tmp_path: Path) -> None:
    text = two(f"{{{M3}}}", "{connector: USB-C}", ", repeat: {count: 3}, attach: {n: a.m}")
    assert [one.code.code for one in check(tmp_path, text)] == ["TC534"]


def test_interface_values_may_be_expressions(tmp_path: Path) -> None:
    text = two(f"{{{M3}}}", "{bolts: {thread: M3, count: =2 * pair, circle: =size}}", ", attach: {n: a.m}")
    parameters = "parameters: {pair: 2, size: 16 mm}\n"
    assert check(tmp_path, text.replace("components:", f"{parameters}components:")) == []
    assert len(check(tmp_path, text.replace("components:", f"{parameters}components:".replace("16", "18")))) == 1


@pytest.mark.parametrize(("interface", "code", "words"), [
    ("{}", "TC212", "at least one feature"),
    ("{bolts: {}}", "TC202", "thread"),
    ("{bolts: {thread: M3, count: 4}}", "TC315", "circle"),
    ("{bolts: {thread: M3, count: 0, circle: 5 mm}}", "TC315", "count"),
    ("{bolts: {thread: M3, count: 2.5, circle: 5 mm}}", "TC208", "whole number"),
    ("{bolts: {thread: M3, circle: -5 mm}}", "TC315", "circle"),
    ("{bolts: {thread: M3, at: [[1 mm, 2 mm]], circle: 5 mm}}", "TC315", "at"),
    ("{bolts: {thread: M3, at: [[1 mm]]}}", "TC214", ""),
    ("{bolts: {thread: M3, circle: 5}}", "TC206", "unit"),
    ("{bolts: {thread: M3, circle: 5 deg}}", "TC207", "length"),
    ("{bolts: {thread: 3}}", "TC203", "expected the name of a thread"),
    ("{bore: {diameter: 0}}", "TC315", "diameter"),
    ("{bore: {diameter: 6 mm, clearance: [0.2 mm, 0.1 mm]}}", "TC315", "clearance"),
    ("{boss: {diameter: 6 mm, depth: 3 mm}}", "TC201", "depth"),
    ("{side: plug}", "TC212", "connector"),
    ("{connector: USB-C, side: male}", "TC204", "plug"),
    ("5", "TC203", ""),
    ("[x430-horn]", "TC203", ""),
])
def test_invalid_interfaces_are_reported(tmp_path: Path, interface: str, code: str, words: str) -> None:
    """Each invalid interface is one error at its line."""
    found = check(tmp_path, two(interface, f"{{{M3}}}", ", attach: {n: a.m}"))
    assert [one.code.code for one in found] == [code], [one.message for one in found]
    assert words in found[0].message
    assert found[0].span is not None
    assert found[0].span.line == 4


SCREW = """\
thingc: assembly/1
name: stack
components:
  base: {{frame: true, mass: 1 g, mounts: {{top: {{interface: {{bolts: {{thread: M3, count: 2, circle: 20 mm, depth: 6 mm}}}}}}}}}}
  lid:
    frame: true
    mass: 1 g
    mounts: {{under: {{rpy: 180 0 90 deg}}, head: {{xyz: {x} 0 3 mm}}}}
    attach: {{under: base.top}}
  screw:
    frame: true
    mass: 1 g
    mounts: {{seat: {{rpy: 180 0 0 deg, interface: {{shank: {{thread: {thread}, length: {length}}}}}}}}}
    attach: {{seat: lid.head}}
"""


@pytest.mark.parametrize(("length", "thread", "x", "said"), [
    ("8 mm", "M3", 10, None), ("9 mm", "M3", 10, None),  # 3 mm of the lid, and 6 mm of thread
    ("9.01 mm", "M3", 10, "(9.01 mm) is too long for the hole at `base.top` (at most 9 mm)"),
    ("12 mm", "M3", -10, "(12 mm) is too long for the hole at `base.top` (at most 9 mm)"),
    ("5.4 mm", "M3", 10, None), ("5 mm", "M3", 10, "engages only 2 mm of the thread at `base.top` (at least 2.4 mm required)"),
    ("2 mm", "M3", 10, "(2 mm) is too short to reach `base.top` (3 mm)"),
    ("8 mm", "M2.5", 10, "has the thread M2.5, expected M3 at `base.top`"),
    ("12 mm", "M3", 9, None),  # beside the hole
])
def test_screw_length_and_thread_are_checked(tmp_path: Path, length: str, thread: str, x: int, said: str | None) -> None:
    """A screw through a 3 mm lid into a threaded hole 6 mm deep. Too long, too short and wrong threads are reported."""
    found = check(tmp_path, SCREW.format(length=length, thread=thread, x=x))
    assert [(one.code.code, one.message) for one in found] == ([] if said is None else [("TC535", f"screw `screw` on `lid.head` {said}")])


def test_interfaces_are_checked_for_every_variant(tmp_path: Path) -> None:
    """Interface values are part of the plan of a batch: bores of 5.5 mm to 6.5 mm around a boss of 6 mm."""
    (tmp_path / "robot.yaml").write_text(
        two("{bore: {diameter: =d}}", "{boss: {diameter: 6 mm}}", ", attach: {n: a.m}")
        .replace("components:", "parameters: {d: 6 mm}\ncomponents:")
    )
    (tmp_path / "sizes.yaml").write_text(
        "thingc: variants/1\nassembly: robot.yaml\nname: sizes\nparameters: {d: [5.5 mm, 5.998 mm, 5.9995 mm, 6 mm, 6.1 mm, 6.5 mm]}\n"
    )
    main(["batch", str(tmp_path / "sizes.yaml"), "--store", str(tmp_path / "store"), "-o", str(tmp_path / "out"), "--emit", "mjcf"])
    with open(tmp_path / "out" / "sizes" / "results.csv") as stream:
        assert [row["code"] for row in csv.DictReader(stream)] == ["TC534", "TC534", "", "", "", ""]
