"""Joints, mimics, poses and modes: compared with manually computed values."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from resolve.resolving import run
from thingc.model.resolve.coordinates import Dynamics, Limit
from thingc.model.resolve.types import Drive

ROBOT = """
thingc: assembly/1
name: robot
parameters: {stop: 30 deg}
defaults:
  joint:
    dynamics: {damping: 0.02 N*m*s/rad, friction: 0.05 N*m}
    limit: {lower: -90 deg, upper: 90 deg, velocity: 60 rpm}
    gap: 2 mm
components:
  body: {part: "arm:Plate"}
  servo: {part: "arm:Servo", attach: {back: body.seat}}
  upper: {part: "arm:Brace"}
  lower: {part: "arm:Brace"}
  wheel: {part: "arm:Plate"}
  carriage: {part: "arm:Plate"}
  rod: {part: "arm:Plate"}
  hand: {assembly: hand.yaml, attach: {tip: lower.end}}
joints:
  shoulder:
    {type: revolute, parent: servo.rotor, child: upper.hub, limit: {upper: =stop * 2}, drive: servo, turn: 90 deg, offset: =stop}
  elbow:
    type: revolute
    parent: upper.end
    child: lower.hub
    limit: {lower: -1 rad, upper: 1 rad, effort: 4.1 N*m, velocity: 46 rpm}
    dynamics: {friction: 0, armature: 0.01 kg*m^2, stiffness: 2 N*m/rad}
    gap: 0
    drive: {kind: position, kp: 20 N*m/rad, kv: =2 * 0.5 N*m*s/rad, effort: 3 N*m, velocity: 1 rad/s, armature: 0.5 kg*m^2}
  roll: {type: continuous, parent: body.axle, child: wheel.hub, mimic: {joint: elbow, offset: 10 deg}}
  slide: {type: prismatic, parent: body.rail, child: carriage.foot,
          limit: {lower: 0, upper: 20 mm, effort: 5 N, velocity: 0.1 m/s},
          mimic: {joint: shoulder, multiplier: 10 mm/rad, offset: 1 mm}}
  weld: {type: fixed, parent: carriage.top, child: rod.end, gap: 3 mm}
mounts: {palm: hand.tip}
links: {base_link: body, tip_link: hand.cap}
poses:
  home: {shoulder: 30 deg, elbow: =-stop, hand.finger: 5 mm}
  shut: {hand: open, "hand.*": 2 mm}
  rest: {"*": 0}
modes:
  first: {root: body}
  second:
    extends: first
    base: free
    at: {xyz: 0 0 300 mm, rpy: 0 0 90 deg}
    gravity: wall
    pose: shut
    poses: [home, shut]
    actuators: [shoulder]
    contacts: {exclude: [[body, hand]], adhesion: {hand.tip: 300 N, body.sole: 1 N}}
    simulation: {timestep: 1 ms, cone: elliptic}
  third:
    extends: second
    root: hand.tip
    at: {xyz: [0, 0, 1 m]}
    gravity: [0, 1 m/s^2, -9 m/s^2]
    contacts: {adhesion: {hand.tip: 200 N}}
    simulation: {timestep: 5 ms, impratio: 10}
  fourth: {root: palm, base: held, gravity: ceiling, pose: home, actuators: []}
  fifth: {root: hand.cap.origin}
simulation: {timestep: 2 ms, integrator: implicitfast}
raw:
  mjcf:
    joint: {elbow: {solreflimit: 0.01 1, frictionloss: 1e-3, group: 3, actuatorfrclimited: true}}
    option: {cone: elliptic}
"""
HAND = """
thingc: assembly/1
name: hand
components:
  cap: {part: "arm:Plate"}
  jaw: {part: "arm:Plate"}
  motor: {part: "arm:Servo", attach: {a: cap.b}}
joints: {finger: {type: prismatic, parent: cap.x, child: jaw.y, limit: {lower: 0, upper: 20 mm}, drive: motor}}
mounts: {tip: cap.tip}
poses: {open: {finger: 15 mm}}
modes: {broken: {root: nowhere}}
simulation: {timestep: 3 ms}
raw: {mjcf: {joint: {finger: {group: 1}}}}
"""


def line_of(start: str) -> int:
    return next(number for number, line in enumerate(ROBOT.lstrip("\n").splitlines(), 1) if line.startswith(start))


FILES = {"robot.yaml": ROBOT, "hand.yaml": HAND}


def test_joints_are_resolved(tmp_path: Path) -> None:
    outcome = run(tmp_path, FILES)
    assert outcome.said == []
    shoulder, elbow, roll, slide, weld = (outcome.joint(n) for n in ("shoulder", "elbow", "roll", "slide", "weld"))
    rpm = 2 * math.pi / 60

    assert shoulder.limit.lower == -math.pi / 2 and shoulder.limit.upper == pytest.approx(math.pi / 3, rel=1e-15)
    assert shoulder.limit.velocity == pytest.approx(60 * rpm, rel=1e-15) and shoulder.limit.effort is None
    assert shoulder.dynamics == Dynamics(damping=0.02, friction=0.05)
    assert (shoulder.turn, shoulder.gap, shoulder.offset) == (math.pi / 2, 0.002, pytest.approx(math.pi / 6))
    assert shoulder.drive is not None and shoulder.drive.component is not None and shoulder.drive.component.text == "servo"

    assert elbow.limit == Limit(lower=-1.0, upper=1.0, effort=4.1, velocity=elbow.limit.velocity)
    assert elbow.limit.velocity == pytest.approx(46 * rpm, rel=1e-15)
    assert elbow.dynamics == Dynamics(damping=0.02, friction=0.0, armature=0.01, stiffness=2.0)
    assert elbow.gap == 0.0
    assert elbow.drive == Drive(
        component=None, kind="position", kp=20.0, kv=1.0, effort=3.0, velocity=1.0, armature=0.5, origin=elbow.drive.origin,
        spans=elbow.drive.spans,
    )

    assert roll.limit.lower is None and roll.limit.upper is None
    assert roll.mimic is not None and (roll.mimic.joint, roll.mimic.multiplier) == ("elbow", 1.0)
    assert roll.mimic.offset == pytest.approx(math.radians(10))
    assert slide.mimic is not None
    assert (slide.mimic.joint, slide.mimic.multiplier, slide.mimic.offset) == ("shoulder", 0.01, 0.001)
    assert slide.limit == Limit(lower=0.0, upper=0.02, effort=5.0, velocity=0.1)
    assert slide.dynamics == Dynamics()  # the document's defaults are for turns
    assert (weld.kind.name, weld.gap, weld.limit, weld.dynamics) == ("fixed", 0.003, Limit(), Dynamics())


def test_default_drive_for_turns_does_not_apply_to_slides(tmp_path: Path) -> None:
    drive = "{kind: position, kp: 20 N*m/rad, kv: 0.5 N*m*s/rad}"
    text = ROBOT.replace("    gap: 2 mm\n", f"    gap: 2 mm\n    drive: {drive}\n", 1)
    outcome = run(tmp_path, {"robot.yaml": text, "hand.yaml": HAND})
    assert outcome.said == []
    roll, slide, elbow = (outcome.joint(name) for name in ("roll", "slide", "elbow"))
    assert roll.drive is not None and (roll.drive.kp, roll.drive.kv) == (20.0, 0.5)
    assert slide.drive is None
    assert elbow.drive is not None and elbow.drive.kv == 1.0  # its own


def test_source_locations_within_a_joint(tmp_path: Path) -> None:
    outcome = run(tmp_path, FILES)
    lines = ROBOT.lstrip("\n").splitlines()
    spans = outcome.joint("shoulder").spans
    for key, text in (("limit.upper", "=stop * 2"), ("drive", "servo"), ("limit.lower", "-90 deg"), ("gap", "2 mm")):
        span = spans[key]
        assert lines[span.line - 1][span.column - 1 : span.end_column - 1] == text, key
    assert spans["limit.lower"].line < spans["limit.upper"].line  # the first is written among the defaults


def test_poses_are_resolved(tmp_path: Path) -> None:
    outcome = run(tmp_path, FILES)
    assert outcome.pose("home").values == pytest.approx({"shoulder": math.pi / 6, "elbow": -math.pi / 6, "hand/finger": 0.005})
    assert outcome.pose("shut").values == {"hand/finger": 0.002}  # a pattern wins over a nested pose
    assert outcome.pose("rest").values == {"shoulder": 0.0, "elbow": 0.0, "hand/finger": 0.0}  # none that mimics or is fixed
    assert list(outcome.pose("home").values) == ["shoulder", "elbow", "hand/finger"]
    assert [span.line for span in outcome.pose("home").origins["elbow"]] == [line_of("  home:")]


def test_value_of_a_nested_pose_has_both_locations(tmp_path: Path) -> None:
    outcome = run(tmp_path, {"robot.yaml": ROBOT.replace(', "hand.*": 2 mm', ""), "hand.yaml": HAND})
    shut = outcome.pose("shut")
    assert shut.values == {"hand/finger": 0.015}
    places = [(Path(span.file).name, span.line) for span in shut.origins["hand/finger"]]
    assert places == [("hand.yaml", 9), ("robot.yaml", line_of("  shut:"))]


def test_modes_are_resolved(tmp_path: Path) -> None:
    outcome = run(tmp_path, FILES)
    first, second, third, fourth, fifth = (outcome.mode(n) for n in ("first", "second", "third", "fourth", "fifth"))

    assert (first.root.text, first.root.mount, first.base, first.gravity) == ("body", None, "fixed", (0.0, 0.0, -9.81))
    assert first.at.translation == (0.0, 0.0, 0.0)
    assert (first.pose, first.poses, first.actuators) == (None, ("home", "shut", "rest"), None)
    assert (first.exclude, first.adhesion, first.simulation) == ((), (), {})

    assert (second.root.text, second.base, second.gravity) == ("body", "free", (-9.81, 0.0, 0.0))
    assert second.at.translation == (0.0, 0.0, 0.3)
    assert second.at.rotation == ((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    assert (second.pose, second.poses, second.actuators) == ("shut", ("shut", "home"), ("shoulder",))
    assert [(a.text, b.text) for a, b in second.exclude] == [("body", "hand")]
    assert [(r.text, force) for r, force in second.adhesion] == [("hand.tip", 300.0), ("body.sole", 1.0)]
    assert second.simulation == {"timestep": 0.001, "cone": "elliptic"}

    assert (third.root.path, third.root.mount, third.base) == (("hand",), "tip", "free")
    assert third.gravity == (0.0, 1.0, -9.0)
    assert third.at.translation == (0.0, 0.0, 1.0) and third.at.rotation == second.at.rotation
    assert [(a.text, b.text) for a, b in third.exclude] == [("body", "hand")]
    assert [(r.text, force) for r, force in third.adhesion] == [("hand.tip", 200.0), ("body.sole", 1.0)]
    assert third.simulation == {"timestep": 0.005, "cone": "elliptic", "impratio": 10.0}

    assert (fourth.root.text, fourth.base, fourth.gravity) == ("hand.tip", "held", (0.0, 0.0, 9.81))
    assert (fourth.poses, fourth.actuators) == (("home", "shut", "rest"), ())
    assert (fifth.root.path, fifth.root.mount) == (("hand", "cap"), None)
    assert outcome.good.simulation == {"timestep": 0.002, "integrator": "implicitfast"}


@pytest.mark.parametrize(("friction", "value"), [("0", 0.0), ("0.6", 0.6), ("-0.1", None)])
def test_friction_of_feet(friction: str, value: float | None, tmp_path: Path) -> None:
    where = f"standing_on: {{mounts: [body.sole], friction: {friction}}}"
    outcome = run(tmp_path, {"robot.yaml": ROBOT.replace("base: free\n", f"base: free\n    {where}\n", 1), "hand.yaml": HAND})
    said = [one for one in outcome.said if f"robot.yaml:{line_of('    at: {xyz: 0 0 300 mm')}:" in one]
    if value is None:
        assert len(said) == 1 and "the friction" in said[0]
    else:
        feet = outcome.mode("second").standing
        assert said == [] and feet is not None and (feet.friction, [foot.text for foot in feet.mounts]) == (value, ["body.sole"])


def test_document_without_modes_has_a_default_mode(tmp_path: Path) -> None:
    outcome = run(tmp_path, {"hand.yaml": HAND.replace("modes: {broken: {root: nowhere}}\nsimulation: {timestep: 3 ms}\n", "")})
    (mode,) = outcome.good.modes
    assert (mode.name, mode.root.text, mode.base, mode.poses, mode.actuators) == ("default", "cap", "fixed", ("open",), None)
    assert mode.gravity == (0.0, 0.0, -9.81)


def test_modes_of_nested_documents_are_not_resolved(tmp_path: Path) -> None:
    """Their simulation options are resolved, but do not apply to the whole robot: see `test_modes_are_resolved`."""
    hand = run(tmp_path, FILES).component("hand").definition
    assert hand is not None and hand.modes == () and hand.simulation == {"timestep": 0.003}
    wrong = run(tmp_path, {**FILES, "hand.yaml": HAND.replace("timestep: 3 ms", "timestep: 0")})
    assert wrong.said == ["TC315 hand.yaml:11:24 `timestep` must be above 0, found `0`"]


def test_raw_attributes_links_and_exported_mounts(tmp_path: Path) -> None:
    model = run(tmp_path, FILES).good
    assert [(r.target, r.path, r.value) for r in model.raw] == [
        ("mjcf", ("joint", "elbow", "solreflimit"), "0.01 1"), ("mjcf", ("joint", "elbow", "frictionloss"), "0.001"),
        ("mjcf", ("joint", "elbow", "group"), "3"), ("mjcf", ("joint", "elbow", "actuatorfrclimited"), "true"),
        ("mjcf", ("option", "cone"), "elliptic"),
    ]
    line = ROBOT.lstrip("\n").splitlines()[model.raw[0].origin[0].line - 1]
    assert line[model.raw[0].origin[0].column - 1 :].startswith("0.01 1")
    assert [(link.name, link.component.text) for link in model.links] == [("base_link", "body"), ("tip_link", "hand.cap")]
    assert {name: mount.text for name, mount in model.mounts.items()} == {"palm": "hand.tip"}


def test_invalid_pose_value_causes_no_limit_errors(tmp_path: Path) -> None:
    """Joints without a value are clamped to their limits. Otherwise `link` would report that 0 is outside the limits, although the
    document does not contain this value."""
    outcome = run(tmp_path, """
        thingc: assembly/1
        name: arm
        components:
          a: {part: "arm:Plate"}
          b: {part: "arm:Plate"}
          c: {part: "arm:Plate"}
        joints:
          up: {type: prismatic, parent: a.x, child: b.y, limit: {lower: 5 mm, upper: 20 mm}}
          down: {type: revolute, parent: a.x, child: c.y, limit: {lower: -20 deg, upper: -10 deg}}
        poses:
          typo: {upp: 7 mm, down: -15 deg}
          other: {upp: 7 mm}
          fine: {up: 6 mm}
        """)
    assert len(outcome.said) == 2
    assert outcome.pose("typo").values == pytest.approx({"up": 0.005, "down": math.radians(-15)})
    assert outcome.pose("other").values == pytest.approx({"up": 0.005, "down": math.radians(-10)})
    assert outcome.pose("fine").values == {"up": 0.006}


def test_root_is_a_component_or_mount_at_any_depth(tmp_path: Path) -> None:
    arm, hand = (
        f"thingc: assembly/1\nname: {name}\ncomponents:\n  plate: {{part: 'arm:Plate'}}\n"
        f"  {inner}: {{assembly: {inner}.yaml, attach: {{grip: plate.top}}}}\nmounts: {{grip: plate.x}}\n"
        for name, inner in (("arm", "hand"), ("hand", "finger"))
    )
    finger = "thingc: assembly/1\nname: finger\ncomponents: {bone: {part: 'arm:Plate'}}\nmounts: {grip: bone.x}\n"
    roots = {
        "plate": (("plate",), None), "grip": (("plate",), "x"), "plate.y": (("plate",), "y"), "plate.hand": (("plate",), "hand"),
        "hand.plate": (("hand", "plate"), None), "hand.grip": (("hand",), "grip"), "hand.plate.y": (("hand", "plate"), "y"),
        "hand.finger.bone": (("hand", "finger", "bone"), None), "hand.finger.bone.y": (("hand", "finger", "bone"), "y"),
        "hand.finger.bone.origin": (("hand", "finger", "bone"), None),
    }
    modes = "".join(f"  m{number}: {{root: {text}}}\n" for number, text in enumerate(roots))
    model = run(tmp_path, {"arm.yaml": f"{arm}modes:\n{modes}", "hand.yaml": hand, "finger.yaml": finger}).good
    assert [(mode.root.path, mode.root.mount) for mode in model.modes] == list(roots.values())
