"""Completion, hover and diagnostics of a real yaml-language-server with the schemas that `thingc schema` writes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from editor.language_server import LanguageServer
from editor.running import ROOT, schemas_of, thingc

ARM = "assemblies/arm.yaml"
HORN = "x430-horn, 8 x M2 on 16 mm, boss 8 mm"
"""The interface of the horn mount of an XM430."""


@pytest.fixture(scope="module")
def arm(workspace: Path) -> str:
    return (workspace / ARM).read_text()


def edited(text: str, old: str, new: str) -> str:
    """Return the document with one place replaced."""
    assert text.count(old) >= 1, old
    return text.replace(old, new, 1)


def said(item: dict[str, Any]) -> str:
    """Return the documentation of a completion item."""
    documentation = item.get("documentation") or ""
    return str(documentation["value"] if isinstance(documentation, dict) else documentation)


def blamed(text: str, diagnostics: list[dict[str, Any]]) -> list[str]:
    """Return the text under every diagnostic."""
    lines = text.split("\n")
    places = [(d["range"]["start"], d["range"]["end"]) for d in diagnostics]
    assert all(start["line"] == end["line"] for start, end in places), diagnostics
    return [lines[start["line"]][start["character"]:end["character"]] for start, end in places]


DOCUMENTS = sorted(path.relative_to(ROOT / "assemblies").as_posix() for path in (ROOT / "assemblies").rglob("*.yaml"))


@pytest.mark.parametrize("name", DOCUMENTS)
def test_valid_documents_have_no_diagnostics(server: LanguageServer, workspace: Path, name: str) -> None:
    assert server.show(f"assemblies/{name}", (workspace / "assemblies" / name).read_text()) == []


# --- completion ---------------------------------------------------------------------------------------------------


def test_part_completion_shows_docstrings(server: LanguageServer, arm: str) -> None:
    offered = server.complete(ARM, edited(arm, "  bracket: {part: arm:YawPitchBracket}", "  bracket:\n    part: |"))
    assert said(offered["arm:BasePlate"]).startswith("A square plate with two walls that hold the yaw servo by its sides")
    assert "e-Manual (emanual.robotis.com" in said(offered["thingc_stock.dynamixel:XM430"])
    assert "use it in `drive` of a joint" in said(offered["thingc_stock.dynamixel:XM430"])
    assert "minchw.leg:Foot" in offered
    assert not any("XSeries" in name for name in offered), "a base class is no part"


@pytest.mark.parametrize("component", ["bracket", "something_new"])
def test_params_completion_lists_parameters_of_the_part(server: LanguageServer, arm: str, component: str) -> None:
    old = "  bracket: {part: arm:YawPitchBracket}"
    offered = server.complete(ARM, edited(arm, old, f"  {component}:\n    part: arm:RotorBrace\n    params:\n      |"))
    assert sorted(offered) == ["length", "thickness"]
    assert said(offered["length"]) == "Distance between the axes. A length such as `120 mm`, 60 mm to 200 mm; `100 mm` by default."


def test_parameter_completion_offers_default_and_expressions(server: LanguageServer, arm: str) -> None:
    offered = server.complete(ARM, edited(
        arm, "  bracket: {part: arm:YawPitchBracket}", "  bracket:\n    part: arm:RotorBrace\n    params:\n      length: |",
    ))
    assert {"100 mm", "=reach"} <= offered.keys()


def test_choice_parameter_completion(server: LanguageServer, arm: str) -> None:
    offered = server.complete(ARM, edited(
        arm, "  bracket: {part: arm:YawPitchBracket}", "  bolt:\n    part: thingc_stock.fasteners:Screw\n    params:\n      size: |",
    ))
    assert {"M1.6", "M2", "M2.5", "M3", "M4", "M5", "M6", "M8"} <= offered.keys()


@pytest.mark.parametrize("component", ["yaw_servo", "something_new"])
def test_attach_completion_offers_mounts_of_the_part(server: LanguageServer, arm: str, component: str) -> None:
    old = "  yaw_servo:\n    part: thingc_stock.dynamixel:XM430\n    attach: {back: plate.servo_seat}"
    offered = server.complete(ARM, edited(arm, old, f"  {component}:\n    part: thingc_stock.dynamixel:XM430\n    attach:\n      |"))
    assert {"back", "bottom", "horn", "idler", "rotor"} <= offered.keys()
    assert f"interface `{HORN}`" in said(offered["horn"])
    assert not {"servo_seat", "rotor_seat"} & offered.keys()


def test_attach_completion_offers_mounts_of_other_parts(server: LanguageServer, arm: str) -> None:
    offered = server.complete(ARM, edited(arm, "    attach: {back: plate.servo_seat}", "    attach:\n      back: |"))
    assert {"plate.servo_seat", "plate.servo_screw_7", "hand.tip"} <= offered.keys()


def test_joint_parent_completion(server: LanguageServer, arm: str) -> None:
    offered = server.complete(ARM, edited(arm, "    parent: yaw_servo.rotor", "    parent: |"))
    assert {"yaw_servo.rotor", "hand.seat", "hand.cap.pen", "plate_screw_3.seat", "bus_board.origin"} <= offered.keys()
    assert said(offered["yaw_servo.rotor"]) == f"A mount of `thingc_stock.dynamixel:XM430`, interface `{HORN}`."


def test_drive_completion_offers_actuators(server: LanguageServer, arm: str) -> None:
    offered = server.complete(ARM, edited(arm, "    drive: yaw_servo", "    drive: |"))
    assert [name for name in offered if "_" in name] == ["yaw_servo", "shoulder_servo", "elbow_servo", "wrist_servo"]


def test_pose_completion_offers_joints(server: LanguageServer, arm: str) -> None:
    old = "  home: {yaw: 30 deg, shoulder: -60 deg, elbow: 120 deg, wrist: -30 deg}"
    offered = server.complete(ARM, edited(arm, old, "  home:\n    |"))
    assert list(offered) == ["yaw", "shoulder", "elbow", "wrist"]
    assert said(offered["yaw"]) == "Revolute, from `yaw_servo.rotor` to `bracket.yaw_seat`; -150 deg to 150 deg."


MODE = "  bench: {root: plate, base: fixed, pose: home}"


@pytest.mark.parametrize(
    ("key", "some"),
    [
        ("root: |", {"plate", "hand", "hand.cap", "plate.bottom", "hand.tip", "tip"}),
        ("pose: |", {"home", "stretched", "folded", "writing"}),
        ("extends: |", {"drawing", "adrift"}),
        ("actuators:\n      - |", {"yaw", "shoulder", "elbow", "wrist"}),
        ("cut:\n      - |", {"yaw", "wrist"}),
        ("poses:\n      - |", {"home", "folded"}),
        ("hold:\n      |", {"tip", "plate.bottom"}),
        ("contacts:\n      exclude:\n        - [pl|]", {"plate", "hand.cap", "humerus"}),
        ("contacts:\n      adhesion:\n        |", {"tip", "plate.bottom"}),
    ],
)
def test_mode_completion_offers_names(server: LanguageServer, arm: str, key: str, some: set[str]) -> None:
    before = "" if key.startswith("root") else "root: plate\n    "
    offered = server.complete(ARM, edited(arm, MODE, f"  bench:\n    {before}{key}"))
    assert some <= offered.keys()


@pytest.mark.parametrize(
    ("old", "new", "some"),
    [
        ("links: {base_link: plate, hand_link: hand.fixture}", "links:\n  base_link: |", {"plate", "hand.fixture"}),
        ("  tip: hand.tip", "  tip: |", {"hand.tip", "wrist_servo.horn"}),
        ("    at: {in: bracket.board, xyz: 0 0 4 mm}", "    at:\n      in: |", {"bracket.board", "plate.bottom"}),
        ("materials: [materials.yaml]", "materials:\n  - |", {"materials.yaml", "minchw/materials.yaml"}),
        ("    allow: {TC407: its rotor_seat turns on the idler}", "    material: |", {"petg", "steel"}),
        ("simulation: {timestep", "sensors:\n  eye:\n    type: camera\n    at: |\nsimulation: {timestep", {"tip", "hand.tip"}),
        ("simulation: {timestep", "sensors:\n  turned:\n    type: joint\n    joint: |\nsimulation: {timestep", {"yaw", "wrist"}),
        ("    drive: wrist_servo", "    mimic:\n      joint: |", {"yaw", "elbow"}),
    ],
)
def test_completion_of_other_references(server: LanguageServer, arm: str, old: str, new: str, some: set[str]) -> None:
    assert some <= server.complete(ARM, edited(arm, old, new)).keys()


HAND = "  hand: {assembly: end_effector.yaml, parameters: {pen_diameter: =pen_diameter}}"


@pytest.mark.parametrize(
    ("test", "some"),
    [
        ("mass: {max: 3 kg, of: pl|}", {"plate", "hand"}),
        ("reach: {min: 1 mm, of: tip, from: pl|}", {"plate.bottom", "hand.tip", "base"}),
        ("no_collision: {pose: ho|}", {"home", "folded"}),
        ("no_collision:\n      joints:\n        |", {"yaw", "elbow"}),
        ("torque_margin: {min: 2, drive: sh|}", {"shoulder", "wrist"}),
    ],
)
def test_completion_in_tests(server: LanguageServer, arm: str, test: str, some: set[str]) -> None:
    assert some <= server.complete(ARM, edited(arm, "\ntests: ", f"\ntests:\n  fresh:\n    {test}\n#")).keys()


def test_completion_of_nested_documents_and_parameters(server: LanguageServer, arm: str) -> None:
    offered = server.complete(ARM, edited(arm, HAND, "  hand:\n    assembly: |"))
    assert said(offered["minchw/leg.yaml"]) == "One leg of MInchW (yaw, pitch, pitch) with its magnet."
    offered = server.complete(ARM, edited(arm, HAND, "  hand:\n    assembly: minchw/leg.yaml\n    parameters:\n      |"))
    assert {"leg_length", "wall"} <= offered.keys()
    assert said(offered["leg_length"]) == "Axis of the knee to axis of the ankle. A length, 64 mm to 140 mm; `64 mm` by default."


def test_completion_with_hundreds_of_mounts(node_modules: Path, tmp_path: Path, shared_store: str) -> None:
    (tmp_path / "thingc.toml").write_text('thingc = "workspace/1"\nparts = []\n')
    text = """\
thingc: assembly/1
name: many
components:
  first: {part: thingc_stock.fasteners:Screw}
  screw: {part: thingc_stock.fasteners:Screw, repeat: {count: 200}, attach: {seat: first.seat}}
mounts:
  last: screw_199.seat
"""
    (tmp_path / "many.yaml").write_text(text)
    thingc(tmp_path, shared_store, "schema")
    program = node_modules / "yaml-language-server" / "bin" / "yaml-language-server"
    server = LanguageServer(program, tmp_path, schemas_of(tmp_path))
    try:
        assert server.show("many.yaml", text) == []
        assert {"screw_0.seat", "screw_199.seat"} <= server.complete("many.yaml", edited(text, "screw_199.seat", "|")).keys()
        wrong = edited(text, "screw_199.seat", "screw_199.seet")
        assert blamed(wrong, server.show("many.yaml", wrong)) == ["screw_199.seet"]
    finally:
        server.close()


# --- hover --------------------------------------------------------------------------------------------------------


def test_hover_shows_unit_range_and_default(server: LanguageServer, arm: str) -> None:
    shown = server.hover(ARM, edited(arm, "params: {length: =reach, thickness", "params: {len|gth: =reach, thickness")).replace("\\", "")
    assert "Distance between the axes. A length such as `120 mm`, 60 mm to 200 mm; `100 mm` by default." in shown


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("plate: {part: arm:BasePlate", "plate: {part: arm:Base|Plate", "A square plate with two walls that hold the yaw servo"),
        ("  plate: {part", "  pl|ate: {part", "Mounts: `bottom`, `servo_screw_0`"),
        ("parent: yaw_servo.rotor", "parent: yaw_ser|vo.rotor", f"A mount of `thingc_stock.dynamixel:XM430`, interface `{HORN}`."),
        ("home: {yaw: 30", "home: {ya|w: 30", "from `yaw_servo.rotor` to `bracket.yaw_seat`; -150 deg to 150 deg."),
        ("pose: home}", "pose: ho|me}", "yaw: 30 deg, shoulder: -60 deg"),
    ],
)
def test_hover_explains_names(server: LanguageServer, arm: str, old: str, new: str, expected: str) -> None:
    assert expected in server.hover(ARM, edited(arm, old, new)).replace("\\", "")


# --- diagnostics --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "place", "words"),
    [
        ("params: {length: =reach", "params: {lenth: =reach", "lenth", "lenth is not allowed"),
        ("params: {length: =reach", "params: {length: 3 kg", "3 kg", "expected a length such as `120 mm`"),
        ("params: {size: M2.5", "params: {size: M2.6", "M2.6", '"M2.5"'),
        ("attach: {back: plate", "attach: {bak: plate", "bak", "bak is not allowed"),
        ("{back: plate.servo_seat}", "{back: plate.servo_sea}", "plate.servo_sea",
         "unknown mount of `plate` (arm:BasePlate); available mounts: `bottom`"),
        ("parent: yaw_servo.rotor", "parent: yaw_servo.rotr", "yaw_servo.rotr", "available mounts: `back`, `bottom`"),
        ("child: hand.seat", "child: hand.seet", "hand.seet",
         "unknown mount of `hand` (end_effector.yaml); available mounts: `origin`, `seat`"),
        ("pen_diameter: =pen_diameter}", "pn: =pen_diameter}", "pn", "pn is not allowed"),
        ("{mount: servo_seat, to: elbow", "{mount: servo_set, to: elbow", "servo_set", "unknown mount; available mounts: `origin`"),
        ("    allow: {TC407: its rotor_seat turns on the idler}", "    material: petgg", "petgg", "materials: `aluminium`, `petg`"),
        ("  home: {yaw: 30 deg", "  home: {yaw: 30 mm", "30 mm", "expected an angle"),
    ],
)
def test_errors_are_underlined_at_their_place(
    server: LanguageServer, arm: str, old: str, new: str, place: str, words: str,
) -> None:
    text = edited(arm, old, new)
    diagnostics = server.show(ARM, text)
    assert blamed(text, diagnostics) == [place]
    assert words in diagnostics[0]["message"]


@pytest.mark.parametrize(
    ("old", "new"),
    [
        # tests, with patterns
        ("\ntests: ", "\ntests:\n  bare: {mass: {max: 3 kg, of: 'plate*'}}\n  free: {no_collision: {pose: all, joints: {yaw: all}}}\n#"),
        # a component that the schema has not seen yet, with references to it
        ("joints:\n  yaw:", "  twin: {part: arm:RotorBrace, params: {length: 80 mm}, attach: {servo_seat: novel.seat}}\njoints:\n  yaw:"),
        ("    parent: yaw_servo.rotor", "    parent: novel.rotor"),
        ("  home: {yaw: 30 deg", "  home: {new_joint: 3 mm, 'sh*': 2 deg, yaw: 30 deg"),
        # another part under an old name
        ("  bracket: {part: arm:YawPitchBracket}", "  bracket: {part: arm:RotorBrace, params: {length: 80 mm}, attach: {rotor_seat: a.b}}"),
        # a part that is not in reach of the catalogue
        ("  bracket: {part: arm:YawPitchBracket}", "  bracket: {part: bd_warehouse.bearing:Ball, params: {size: M3-10-4}}"),
        # patterns, indices, expressions, other units, a bare zero
        ("  bench: {root: plate,", "  bench: {root: plate, actuators: ['*'], contacts: {exclude: [['plate*', hand]]},"),
        ("attach: {seat: plate.servo_screw_$i}", "attach: {seat: 'plate.servo_screw_${i}'}"),
        ("params: {length: =reach,", "params: {length: 0.1 m,"),
        ("params: {length: =reach,", "params: {length: 2 N*mm/N,"),
        ("  home: {yaw: 30 deg", "  home: {yaw: 0"),
        ("{mount: servo_seat, to: elbow_servo.bottom, turn: 180 deg}", "{mount: servo_seat, to: elbow_servo.bottom, gap: 0}"),
    ],
)
def test_valid_syntax_is_accepted(server: LanguageServer, arm: str, old: str, new: str) -> None:
    assert server.show(ARM, edited(arm, old, new)) == []
