"""The interfaces of the stock parts, the arm and MInchW: the robots have no findings, and other servos and longer screws do."""

from __future__ import annotations

import pytest

from thingc.driver import pipeline
from thingc.driver.environment import Environment, Options

from .conftest import ROOT

ARM, MINCHW = (str(ROOT / "assemblies" / name) for name in ("arm.yaml", "minchw/minchw.yaml"))
HAND, LEG = (str(ROOT / "assemblies" / name) for name in ("end_effector.yaml", "minchw/leg.yaml"))
CODES = ("TC425", "TC534", "TC535")


def found(document, store, texts=(), **choices):
    """Return the findings about interfaces: code and message. `texts` replaces texts in documents: file, old text, new text."""
    replaced = {}
    for file, old, new in texts:
        with open(file) as stream:
            text = stream.read()
        assert text.count(old) == 1, old
        replaced[file] = text.replace(old, new).encode()
    with Environment(document, Options(store=store, jobs=2, texts=replaced, choices=choices)) as environment:
        report = pipeline.check(environment).report
    return [(one.code.code, one.message) for one in report.sorted_diagnostics() if one.code.code in CODES]


@pytest.mark.parametrize("document", [ARM, MINCHW])
def test_robots_have_no_findings(shared_store, document):
    assert found(document, shared_store) == []


@pytest.mark.parametrize(("joint", "servo", "parent"), [
    ("yaw", "yaw_servo", "bracket.yaw_seat"), ("shoulder", "shoulder_servo", "humerus.rotor_seat"),
    ("elbow", "elbow_servo", "forearm.rotor_seat"), ("wrist", "wrist_servo", "hand.fixture.rotor_seat"),
])
def test_another_servo_of_the_arm(shared_store, joint, servo, parent):
    """XM540: 8 x M2.5 on 22 mm and a boss of 10 mm. The parts of the arm: 8 x M2 on 16 mm and a bore of 8.6 mm (8 + 6 x 0.1)."""
    said = found(ARM, shared_store, **{f"components.{servo}.part": "thingc_stock.dynamixel:XM540"})
    messages = [message for code, message in said if code == "TC534" and f"`{parent}`" in message]
    assert len(messages) == 1, said
    for words in (
        f"thread M2.5 on `{servo}.rotor`, thread M2 on `{parent}`",
        f"bolt circle 22 mm on `{servo}.rotor`, bolt circle 16 mm on `{parent}`",
        f"boss 10 mm on `{servo}.rotor`, bore 8.6 mm on `{parent}` (clearance -1.4 mm, expected at least 0)",
    ):
        assert words in messages[0]


def test_another_servo_on_a_brace(shared_store):
    """The bottom of an XM540 has its holes on 20 x 16 mm, and a brace has two holes on 16 x 12 mm."""
    said = found(ARM, shared_store, **{"components.elbow_servo.part": "thingc_stock.dynamixel:XM540"})
    assert any(code == "TC534" and "`elbow_servo.bottom` does not fit `humerus.servo_seat`" in message for code, message in said)


@pytest.mark.parametrize(("document", "text", "words"), [
    # the wall of 5 mm, 0.1 mm of play, and 3 mm of thread in the case of the XM430
    (ARM, (ARM, "{size: M2.5, length: 8 mm}", "{size: M2.5, length: 10 mm}"),
     "`plate_screw_0` on `plate.servo_screw_0` (10 mm) is too long for the hole at `yaw_servo.left` (at most 8.1 mm)"),
    (ARM, (ARM, "{size: M2.5, length: 8 mm}", "{size: M2.5, length: 6 mm}"),
     "`plate_screw_0` on `plate.servo_screw_0` engages only 0.9 mm of the thread at `yaw_servo.left` (at least 2 mm required)"),
    # a flange of 3 mm, and 5 mm of the hand
    (ARM, (HAND, "{size: M3, length: 8 mm}", "{size: M3, length: 12 mm}"),
     "`hand.cap_screw_0` on `hand.cap.screw_0` (12 mm) is too long for the hole at `hand.fixture.cap_seat` (at most 8 mm)"),
    # a cover of 3 mm, and holes of 8 mm
    (MINCHW, (MINCHW, "{size: M2.5, length: 10 mm}", "{size: M2.5, length: 12 mm}"),
     "`cover_screw_0` on `cover.screw_0` (12 mm) is too long for the hole at `body.rim` (at most 11 mm)"),
    # a disc of 5 mm, and holes of 6 mm
    (MINCHW, (LEG, "{size: M3, length: 10 mm}", "{size: M3, length: 16 mm}"),
     "(16 mm) is too long for the hole at `front.magnet.back` (at most 11 mm)"),
])
def test_screw_of_another_length(shared_store, document, text, words):
    said = found(document, shared_store, [text])
    assert [code for code, _ in said] == ["TC535"], said
    assert words in said[0][1]


def test_screws_of_the_thigh(shared_store):
    """12 mm: 6 mm in each web. Both screws of each leg are reported, at the same line."""
    with open(LEG) as stream:
        text = stream.read()
    with Environment(MINCHW, Options(store=shared_store, jobs=2, texts={
        LEG: text.replace("{size: M2.5, length: 12 mm}", "{size: M2.5, length: 14 mm}").encode(),
    })) as environment:
        said = [one.message for one in pipeline.check(environment).report.sorted_diagnostics() if one.code.code in CODES]
    assert len(said) == 2
    assert "`front.thigh_screw` on `front.thigh.screw_0` (14 mm) is too long for the hole at `front.thigh_idler.web`" in said[0]


@pytest.mark.parametrize("servo", ["XM430", "XL430"])
def test_servo_and_horn_holes_match_the_drawing(servo):
    from thingc_stock import dynamixel

    made = getattr(dynamixel, servo)()
    bolts, boss = made.rotor.features
    assert (bolts.thread, bolts.count, bolts.circle, bolts.depth) == ("M2", 8, 16.0, 2.0)
    assert (boss.diameter, boss.length) == (8.0, 2.0)
    (bottom,) = made.bottom.features
    assert sorted(bottom.at) == [(-8.0, -6.0), (-8.0, 6.0), (8.0, -6.0), (8.0, 6.0)]


STOCK = """\
thingc: assembly/1
name: stock
materials: [thingc_stock.materials]
components:
  base: {frame: true}
"""


def test_stock_solids_match_their_declarations(shared_store, tmp_path):
    parts = [
        "dynamixel:XM430", "dynamixel:XL430", "dynamixel:XM540", "bus_servos:XL330", "bus_servos:STS3215", "magnets:HoldingMagnet",
        "motors:Nema17", "motors:ShaftHub", "bearings:Bearing", "fasteners:Screw",
    ]
    lines = [f"  p{k}: {{part: 'thingc_stock.{name}', at: {{in: base.origin, xyz: {100 * k} 0 0 mm}}}}\n" for k, name in enumerate(parts)]
    (tmp_path / "thingc.toml").write_text('thingc = "workspace/1"\nparts = []\npackages = ["thingc_stock"]\n')
    (tmp_path / "stock.yaml").write_text(STOCK + "".join(lines))
    with Environment(str(tmp_path / "stock.yaml"), Options(store=shared_store, jobs=2)) as environment:
        compilation = pipeline.check(environment)
    assert [one.message for one in compilation.report.sorted_diagnostics() if one.code.code in CODES] == []
    declared = [mount for record in compilation.records.values() for mount in record.mounts.values() if mount.features]
    assert len(declared) > 30
