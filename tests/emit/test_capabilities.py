"""Capability tables of formats and the export losses derived from them: a robot with every feature loses all of them in a format that
supports none."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any, get_args, get_type_hints

import pytest

import thingc
from loops.robots import compiled
from thingc.base.diagnostics import Report
from thingc.targets.capabilities import COMPANION, FULL, OMITTED, Capabilities, Cell, Supported, losses
from thingc.targets.geometry import collect_geometry
from thingc.targets.mjcf import body_tree as mjcf
from thingc.targets.mjcf.capabilities import CAPABILITIES as MJCF
from thingc.targets.registry import TARGETS
from thingc.targets.sdf import model_element as sdf
from thingc.targets.sdf.capabilities import CAPABILITIES as SDF
from thingc.targets.sdf.chain import zero_state
from thingc.targets.urdf import links as urdf
from thingc.targets.urdf.capabilities import CAPABILITIES as URDF
from thingc.targets.usd import stage as usd
from thingc.targets.usd.capabilities import CAPABILITIES as USD
from thingc.targets.usd.usda import format_prim
from thingc.targets.xml_writer import write

MASS = "mass: 1 kg, inertia: {ixx: 1 kg*mm^2, iyy: 1 kg*mm^2, izz: 1 kg*mm^2}"

ROBOT = f"""\
thingc: assembly/1
name: all
simulation: {{timestep: 1 ms, integrator: rk4}}
components:
  base: {{frame: true, {MASS}, mounts: {{a: {{}}}}}}
  c1: {{frame: true, {MASS}, mounts: {{a: {{}}}}}}
  c2: {{frame: true, {MASS}}}
  c3: {{frame: true, {MASS}}}
  c4: {{frame: true, {MASS}}}
  c5: {{frame: true, {MASS}}}
  c6: {{frame: true, {MASS}}}
  c7: {{frame: true, {MASS}}}
  c8: {{frame: true, {MASS}}}
  c9: {{frame: true, {MASS}, mounts: {{b: {{rpy: [180 deg, 0, 0]}}}}}}
joints:
  j1:
    type: revolute
    parent: base.a
    child: c1.origin
    limit: {{lower: -1 rad, upper: 1 rad, velocity: 2 rad/s, effort: 1 N*m}}
    drive: {{kind: motor}}
  j2:
    type: continuous
    parent: c1.a
    child: c2.origin
    dynamics: {{damping: 0.1 N*m*s/rad, friction: 0.2 N*m, armature: 1 kg*mm^2, stiffness: 3 N*m/rad}}
    drive: {{kind: position, kp: 4 N*m/rad, kv: 0.0005 N*m*s/rad}}
  j3: {{type: prismatic, parent: base.a, child: c3.origin, limit: {{lower: -1 m, upper: 1 m}}, drive: {{kind: velocity, kv: 3 N*s/m}}}}
  j4: {{type: cylindrical, parent: base.a, child: c4.origin}}
  j5: {{type: universal, parent: base.a, child: c5.origin}}
  j6: {{type: planar, parent: base.a, child: c6.origin}}
  j7: {{type: screw, parent: base.a, child: c7.origin, lead: 8 mm}}
  j8: {{type: ball, parent: base.a, child: c8.origin, limit: {{cone: 0.5 rad}}}}
  j9: {{type: revolute, parent: base.a, child: c9.origin, limit: {{lower: -1 rad, upper: 1 rad}},
    mimic: {{joint: j1, polynomial: [0, 1, 0.1 rad^-1]}}}}
  close: {{type: continuous, parent: c9.b, child: c1.a, loop: true}}
sensors:
  tilt: {{type: imu, at: c1.a}}
  push: {{type: force, at: c1.a}}
  turn: {{type: joint, joint: j1}}
  eye: {{type: camera, at: c1.a, fovy: 60 deg}}
poses:
  home: {{j1: 0.1 rad}}
modes:
  still: {{root: base, base: fixed, gravity: wall, hold: {{c1.a: here}}, contacts: {{adhesion: {{c1.a: 300 N}}, exclude: [[c3, c4]]}}}}
  carried: {{root: base, base: held}}
  afloat: {{root: base, base: free, at: {{xyz: [0, 0, 1 m]}}}}
  gliding: {{root: base, base: planar}}
  turning: {{root: base, base: ball}}
"""


def every(cell: Cell[None]) -> Any:
    """Capabilities of a format in which every cell has this value."""
    return {group: dict.fromkeys(cells, cell) for group, cells in MJCF.items()}


@pytest.mark.parametrize("name", [name for name, target in TARGETS.items() if target.capabilities is not None])
def test_capability_tables_are_complete(name: str) -> None:
    """The table of each target has exactly the features of `Capabilities`."""
    table = import_module(str(TARGETS[name].capabilities)).CAPABILITIES
    features = {group: set(get_args(get_args(hint)[0])) for group, hint in get_type_hints(Capabilities).items()}
    assert {group: set(cells) for group, cells in table.items()} == features
    assert {"ball", "hold"} <= features["loops"] and {"box", "hull"} <= features["shapes"]  # literals within literals are resolved


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Any:
    built = compiled(tmp_path_factory.mktemp("all"), ROBOT)
    assert built.said == []
    return built.compilation


def lost(robot: Any, says: Any) -> list[tuple[str | None, str, str]]:
    return [(loss.mode, loss.path, loss.what) for loss in losses("toy", says, robot.assembly, robot.robots)]


def test_format_without_features_loses_everything(robot: Any) -> None:
    """A format that supports nothing reports every feature of the robot as an export loss."""
    drive = "the drive: position, kp 4, kv 0.0005"
    assert lost(robot, every(OMITTED)) == [
        (None, "c1/a", "the adhesion of 300 N"), (None, "tilt", "the sensor"), (None, "push", "the sensor"),
        (None, "turn", "the sensor"),
        (None, "eye", "the sensor"), (None, "home", "the pose"), (None, "all", "the time step"),
        (None, "all", "the `simulation` settings"),
        (None, "j1", "the motion"), (None, "j1", "the velocity limit of 2 rad/s"), (None, "j1", "the drive: motor"),
        (None, "j2", "the motion"), (None, "j2", "the damping of 0.1 N m s/rad"), (None, "j2", "the dry friction of 0.2 N m"),
        (None, "j2", "the armature of 1e-06 kg m^2"), (None, "j2", "the stiffness of 3 N m/rad"), (None, "j2", drive),
        (None, "j3", "the motion"), (None, "j3", "the drive: velocity, kv 3"), (None, "j4", "the motion"), (None, "j5", "the motion"),
        (None, "j6", "the motion"), (None, "j7", "the thread"), (None, "j8", "the motion"), (None, "j8", "the cone of 0.5 rad"),
        (None, "j9", "the motion"), (None, "j9", "the mimic of `j1`"),
        (None, "j9", "the polynomial in the mimic of `j1`"),
        ("still", "c1/a", "the hold of the mount"), ("still", "close", "the loop through the joint"), ("still", "still", "the gravity"),
        ("still", "still", "excluded contacts of links without a common joint"),
        ("carried", "close", "the loop through the joint"),
        ("carried", "carried", "the motion of the held base"), ("afloat", "close", "the loop through the joint"),
        ("afloat", "afloat", "the free base"), ("afloat", "afloat", "the start pose"), ("gliding", "close", "the loop through the joint"),
        ("gliding", "gliding", "the motion of the base"), ("turning", "close", "the loop through the joint"),
        ("turning", "turning", "the motion of the base"),
    ]


def test_supported_features_are_not_losses(robot: Any) -> None:
    """A format in which every cell is `SAYS` or `BESIDE` has no export losses."""
    assert lost(robot, every(FULL)) == lost(robot, every(COMPANION)) == []


def test_collision_shapes_and_friction_can_be_lost(root: Path, shared_store: str) -> None:
    """Export losses include collision shapes and friction of the arm."""
    assembly = thingc.compile(str(root / "assemblies" / "arm.yaml"), store=shared_store).assembly
    said = {(one.path, one.what) for one in losses("toy", every(OMITTED), assembly, ())}
    touched = {("yaw_servo", "the collision cylinder"), ("hand/pen", "the convex collision mesh")}
    assert said > touched | {("petg", "the friction")} and ("hand/pen", "the collision cylinder") not in said


POINT = f"""\
thingc: assembly/1
name: points
components:
  post: {{frame: true, mass: 1 kg}}
  vane: {{frame: true, {MASS}}}
joints:
  turn: {{type: continuous, parent: post.origin, child: vane.origin}}
"""

LINE = POINT.replace("  vane:", "  top: {frame: true, mass: 2 kg, at: {in: post.origin, xyz: 0 0 1 m}}\n  vane:")


def test_point_masses_are_approximated_by_format(tmp_path: Path) -> None:
    """A link that never moves may have a zero inertia, as for a point mass. MJCF and URDF write it unchanged; SDF and USD require a
    positive inertia."""
    turn = (None, "turn", "the motion")
    none, least = ": the inertia is 0 in the file, as for a point mass", ": the moments of inertia are 1e-12 kg m^2 in the file"
    for name, document, what, in_xml in (
        ("point", POINT, "the zero inertia of a point mass", None),
        ("line", LINE, "the inertia of point masses in a line", none),
    ):
        (tmp_path / name).mkdir()
        built = compiled(tmp_path / name, document)
        assert built.said == [] and lost(built.compilation, every(OMITTED)) == [turn, ("default", "post", what)]
        for says, words in ((MJCF, in_xml), (URDF, in_xml), (SDF, least), (USD, least)):
            assert lost(built.compilation, says) == ([] if words is None else [("default", "post", what + words)])


HAND = f"""\
thingc: assembly/1
name: hand
components: {{palm: {{frame: true, {MASS}}}, tip: {{frame: true, {MASS}}}}}
joints: {{knuckle: {{type: continuous, parent: palm.origin, child: tip.origin}}}}
tendons:
  pull: {{joints: {{knuckle: 1}}}}
"""


def test_loss_in_nested_document_shows_both_documents(tmp_path: Path) -> None:
    """The origin of a loss in a nested document includes the nested document and the component that includes it."""
    robot = "thingc: assembly/1\nname: robot\ncomponents:\n  left: {assembly: hand.yaml}\n"
    assembly = compiled(tmp_path, {"robot.yaml": robot, "hand.yaml": HAND}).compilation.assembly
    assert assembly is not None
    (loss,) = (one for one in losses("toy", every(OMITTED), assembly, ()) if one.path == "left/pull")
    assert [(Path(span.file).name, span.line) for span in loss.origin] == [("hand.yaml", 6), ("robot.yaml", 4)]


def text_of(robot: Any, target: str) -> str:
    """Text that a target writes for the mode `still`."""
    still, report = robot.robots[0], Report()
    geometry, _ = collect_geometry(robot.assembly, target, "meshes", report)
    match target:
        case "mjcf":
            return write(mjcf.model(still, geometry), "").text
        case "urdf":
            return write(urdf.model(still, geometry, report), "").text
        case "sdf":
            return write(sdf.model(still, geometry, zero_state(still), report, []), "").text
        case _:
            return format_prim(usd.model(still, geometry, {}, report))


@pytest.mark.parametrize(("target", "says", "group", "kind", "word"), [
    ("mjcf", MJCF, "drives", "motor", "<motor"), ("mjcf", MJCF, "loops", "hinge", "close:loop"),
    ("mjcf", MJCF, "loops", "hold", "c1/a:hold"),
    ("mjcf", MJCF, "sensors", "imu", "<gyro"), ("mjcf", MJCF, "sensors", "camera", "<camera"),
    ("urdf", URDF, "drives", "motor", "EffortJointInterface"), ("sdf", SDF, "drives", "velocity", "JointController"),
    ("sdf", SDF, "loops", "hinge", 'name="close"'), ("sdf", SDF, "loops", "hold", "c1_a_hold"),
    ("sdf", SDF, "sensors", "imu", 'type="imu"'),
    ("sdf", SDF, "sensors", "force", "force_torque"), ("usd", USD, "drives", "motor", "drive:angular:physics:maxForce = 1"),
    ("usd", USD, "loops", "hinge", '"close"'),
])
def test_omitted_features_are_not_written(
    robot: Any, monkeypatch: pytest.MonkeyPatch, target: str, says: Any, group: str, kind: str, word: str,
) -> None:
    """An emitter writes a feature if and only if the capability table of its target includes it."""
    assert word in text_of(robot, target)
    monkeypatch.setitem(says[group], kind, OMITTED)
    assert word not in text_of(robot, target)


@pytest.mark.parametrize(("target", "says", "kind", "form", "word"), [
    ("urdf", URDF, "screw", "each", "j7_slide"), ("sdf", SDF, "universal", "each", 'type="universal"'),
    ("usd", USD, "several", "single", "limit:transX"), ("mjcf", MJCF, "screw", "each", "j7:slide"),
])
def test_joint_form_follows_the_capability_table(
    robot: Any, monkeypatch: pytest.MonkeyPatch, target: str, says: Any, kind: str, form: str, word: str,
) -> None:
    """Changing the form of a joint kind in the table changes the written elements."""
    before = text_of(robot, target)
    monkeypatch.setitem(says["joints"], kind, Supported(form))
    assert word in before and before.count(word) > text_of(robot, target).count(word)
