"""USD files, read by the rules of UsdPhysics (`read_usd`), compared with chains of matrices and with MuJoCo models of the same robot."""

from __future__ import annotations

import math
import re
from functools import cache
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from msgspec.structs import replace
from pxr import Usd, UsdGeom, UsdPhysics, UsdShade
from scipy.spatial.transform import Rotation

from emit import small_robot
from emit.read_usd import Model, matrix
from emit.test_sdf import EVERY, Compiled, emitted, mujoco_pose, posed, text_of
from graph.builder import as_matrix
from loops.robots import inchworm
from loops.test_holds import MODES as HOLDS, POSES
from loops.test_loop_joints import FOURBAR
from robot.test_spanning_tree_properties import COUNTS, Tree, build, world_of
from thingc.base.inertia import MassProperties, principal_axes
from thingc.base.pose import Pose
from thingc.base.primitives import Primitive
from thingc.geometry.record import Mesh
from thingc.geometry.store.local import Store
from thingc.model.robot.tree import in_link
from thingc.model.robot.types import Robot
from thingc.targets.usd.emit import build_date, emit
from thingc.targets.usd.stage import moments_of

FLOAT = 3e-6
"""Tolerance [m and 1] of chains of UsdPhysics frames, which are stored as 32-bit floats."""

trees = st.builds(build, st.integers(0, 2**32 - 1), st.integers(2, 5), st.just(tuple(COUNTS)))


def values(robot: Robot, model: Model, q: dict[str, Any]) -> dict[str, Any]:
    """Convert q by path to joint values of a file: a ball as a rotation in its child's axes, a base as `root_0` ..."""
    found: dict[str, Any] = {}
    for body in robot.bodies:
        joints = body.joints or (robot.moves if body.parent is None else ())
        name = robot.assembly.mates[joints[0].mate].name if body.joints else "root"
        if not joints or name is None:
            continue
        paths, usd = [joint.path for joint in joints], name.replace("/", "_")
        match joints[0].kind.name:
            case "ball":
                found[usd] = q[name]
            case "screw":
                found[usd] = {"rotZ": q[name], "transZ": q[name] * joints[0].twist.pitch}
            case "cylindrical":
                found[usd] = {"rotZ": q[f"{name}_0"], "transZ": q[f"{name}_1"]}
            case "universal":
                found[usd] = {"rotX": q[paths[0]], "rotY": q[paths[1]]}
            case "planar" if joints[0].reversed:
                found[f"{usd}_2"] = q[f"{name}_2"]
                found[usd] = {"transX": q[f"{name}_1"], "transY": q[f"{name}_0"]}
            case "planar":
                found[usd] = {"transX": q[f"{name}_0"], "transY": q[f"{name}_1"], "rotZ": q[f"{name}_2"]}
            case _:
                found[usd] = q[name]
    assert set(found) <= set(model.joints)
    return found


@settings(max_examples=5)
@given(trees)
def test_poses_of_random_trees_match_matrices(tree: Tree) -> None:
    """Poses of all occurrences and frames in random trees equal chains of matrices."""
    chosen, made = emitted(tree, emit)
    inside = in_link(tree.assembly)
    for name, robot in chosen.items():
        model = Model(text_of(made, f"usd/tree_{name}.usda"))
        poses, _ = model.placed(values(robot, model, tree.q))
        expected = world_of(tree, name)
        frames = {frame: poses[link] @ pose for link in model.links for frame, pose in model.frames(link).items()}
        for position, k in enumerate(tree.order):
            link = tree.assembly.links[tree.assembly.link_of[position]].name
            assert poses[link] @ as_matrix(inside[position]) == pytest.approx(expected[k], abs=FLOAT)
            assert frames.get(f"c{k}_origin", expected[k]) == pytest.approx(expected[k], abs=FLOAT)


# --- a document with all of it ------------------------------------------------------------------------------------------

MODES = ("first", "last", "fork", "rolling", "swinging")


@pytest.fixture(scope="module")
def every(tmp_path_factory: pytest.TempPathFactory) -> Compiled:
    return Compiled(tmp_path_factory.mktemp("every"), EVERY, "usd")


@cache
def read(compiled: Compiled, mode: str) -> Model:
    return Model(text_of(compiled.made, f"usd/{compiled.name}_{mode}.usda"))


@pytest.mark.parametrize("mode", MODES)
def test_all_joint_kinds_match_mujoco(every: Compiled, mode: str) -> None:
    """Links, frames and inertias equal those of the MJCF model at random configurations, with joints in both directions and every kind
    of base."""
    model, reference, robot = read(every, mode), every.reference(mode), every.robots[mode]
    rng = np.random.default_rng(5)
    for _ in range(5):
        data, q = posed(reference, rng)
        poses, apart = model.placed(values(robot, model, q))
        assert apart == {}
        for k in range(1, reference.nbody):
            assert poses[reference.body(k).name] == pytest.approx(mujoco_pose(data, reference.body(k).name), abs=FLOAT)
        frames = {frame: poses[link] @ pose for link in model.links for frame, pose in model.frames(link).items()}
        bodies = {reference.body(k).name for k in range(reference.nbody)}
        for k in range(reference.nsite):
            name = reference.site(k).name
            if name not in bodies:
                assert frames[name.replace("/", "_")] == pytest.approx(mujoco_pose(data, name), abs=FLOAT)
    for k in range(1, reference.nbody):
        mass, centre, inertia = model.inertia(reference.body(k).name)
        spin = Rotation.from_quat(reference.body_iquat[k][[1, 2, 3, 0]]).as_matrix()
        assert mass == pytest.approx(reference.body_mass[k], rel=1e-7)
        assert centre == pytest.approx(reference.body_ipos[k], abs=1e-8)
        assert inertia == pytest.approx(spin @ np.diag(reference.body_inertia[k]) @ spin.T, abs=1e-9)
    between = sorted(set(model.links) - {reference.body(k).name for k in range(reference.nbody)})
    assert between == [] and all(model.links[name].GetParent() == model.root for name in model.links)


@pytest.mark.parametrize("mode", MODES)
def test_stage_follows_usd_physics_rules(every: Compiled, mode: str) -> None:
    """The stage passes USD's validators, has units of metres and kilograms with z up, and one articulation at the base link. Joints go
    from parent to child."""
    model, robot = read(every, mode), every.robots[mode]
    assert model.faults() == []
    stage = model.stage
    assert (UsdGeom.GetStageMetersPerUnit(stage), UsdPhysics.GetStageKilogramsPerUnit(stage), UsdGeom.GetStageUpAxis(stage)) == (1, 1, "Z")
    roots = [prim.GetName() for prim in stage.Traverse() if prim.HasAPI(UsdPhysics.ArticulationRootAPI)]
    assert roots == [every.robots[mode].assembly.links[robot.bodies[0].link].name]
    carried = [(joint.name, joint.prim.GetTypeName(), joint.child) for joint in model.joints.values() if joint.parent == "world"]
    kinds = {"fork": None, "rolling": "PhysicsJoint", "swinging": "PhysicsSphericalJoint"}
    kind = kinds.get(mode, "PhysicsFixedJoint")
    assert carried == ([] if kind is None else [("root", kind, roots[0])])
    names = [robot.assembly.links[body.link].name for body in robot.bodies]
    crossed = {(names[body.parent], names[k]) for k, body in enumerate(robot.bodies) if body.parent is not None}
    assert crossed == {(joint.parent, joint.child) for joint in model.joints.values() if joint.parent != "world"}
    apart = {
        frozenset((name, other.name)) for name, prim in model.links.items()
        for other in UsdPhysics.FilteredPairsAPI(prim).GetFilteredPairsRel().GetTargets()
    }
    assert apart == {frozenset(names[k] for k in pair) for pair in robot.excluded}
    scene = UsdPhysics.Scene(model.at("scene"))
    pull = np.array(scene.GetGravityDirectionAttr().Get()) * scene.GetGravityMagnitudeAttr().Get()
    assert pull == pytest.approx(robot.gravity, rel=1e-6)


def authored_attributes(prim: Any, *names: str) -> dict[str, Any]:
    """Authored attributes of a prim with these name prefixes; floats compare approximately."""
    found = {attribute.GetName(): attribute.Get() for attribute in prim.GetAuthoredAttributes() if attribute.GetName().startswith(names)}
    return {name: pytest.approx(value, rel=1e-6) if isinstance(value, float) else value for name, value in found.items()}


def test_limits_are_in_degrees_and_gains_per_degree(every: Compiled) -> None:
    joints, degree = read(every, "first").joints, math.radians(1)
    assert authored_attributes(joints["turn"].prim, "physics:lower", "physics:upper", "drive:", "newton:") == {
        "physics:lowerLimit": -1 / degree, "physics:upperLimit": 2 / degree,
        "drive:angular:physics:type": "force", "drive:angular:physics:maxForce": 3.0, "drive:angular:physics:stiffness": 5 * degree,
        "drive:angular:physics:damping": 0.5 * degree, "drive:angular:physics:targetPosition": 0.0,
        "newton:armature": 0.3, "newton:damping": 0.1 * degree, "newton:friction": 0.2, "newton:velocityLimit": 4 / degree,
    }
    assert authored_attributes(joints["wheel"].prim, "physics:lower", "physics:upper", "drive:") == {
        "physics:lowerLimit": -math.inf, "physics:upperLimit": math.inf,
        "drive:angular:physics:type": "force", "drive:angular:physics:stiffness": 0.0, "drive:angular:physics:damping": 2 * degree,
        "drive:angular:physics:targetVelocity": 0.0,
    }
    assert authored_attributes(joints["rail"].prim, "physics:lower", "physics:upper", "drive:") == {
        "physics:lowerLimit": -0.02, "physics:upperLimit": 0.02,
        "drive:linear:physics:type": "force", "drive:linear:physics:stiffness": 0.0, "drive:linear:physics:damping": 0.0,
    }
    assert authored_attributes(joints["hip"].prim, "physics:cone") == {"physics:coneAngle0Limit": 60.0, "physics:coneAngle1Limit": 60.0}
    driven = {joint.name for joint in read(every, "fork").joints.values() if UsdPhysics.DriveAPI.GetAll(joint.prim)}
    assert driven == {"rail"}


@pytest.mark.parametrize("lead", [5.0, -5.0])
def test_screw_slide_has_limits_from_its_rotation(lead: float, tmp_path: Path) -> None:
    """From -90 to 180 degrees, the slide moves a quarter of the lead one way and half of it the other way."""
    screw = f"joints: {{s: {{type: screw, parent: c0.a, child: c1.b, lead: {lead} mm, limit: {{lower: -90 deg, upper: 180 deg}}}}}}\n"
    made = Compiled(tmp_path, MIMICS.partition("  c2:")[0] + screw + "modes: {m: {root: c0}}\n", "usd")
    prim = read(made, "m").joints["s"].prim
    limits = {name: UsdPhysics.LimitAPI(prim, name) for name in ("rotZ", "transZ")}
    ends = {name: (limit.GetLowAttr().Get(), limit.GetHighAttr().Get()) for name, limit in limits.items()}
    slide = sorted((-0.25e-3 * lead, 0.5e-3 * lead))
    assert ends == {"rotZ": (-90.0, 180.0), "transZ": pytest.approx(slide, rel=1e-6)}


MIMIC = ": read by Newton and partly by PhysX"


def applied_schemas(prim: Any) -> set[str]:
    """Names of applied API applied_schemas, including those that usd-core does not know."""
    return set(prim.GetPrimTypeInfo().GetAppliedAPISchemas())


def test_physx_attributes_are_written(every: Compiled) -> None:
    """PhysX attributes of hinges and slides in the articulation are in degrees. Static and dynamic friction both equal the dry friction."""
    first, degree = read(every, "first"), math.radians(1)
    turn, values = first.joints["turn"].prim, {"armature": 0.3, "maxJointVelocity": 4 / degree}
    assert {"PhysxJointAPI", "PhysxJointAxisAPI:angular"} <= applied_schemas(turn)
    assert authored_attributes(turn, "physx") == {
        **{f"physxJoint:{name}": value for name, value in values.items()},
        **{f"physxJointAxis:angular:{name}": value for name, value in values.items()},
        "physxJointAxis:angular:viscousFrictionCoefficient": 0.1 * degree,
        "physxJointAxis:angular:staticFrictionEffort": 0.2, "physxJointAxis:angular:dynamicFrictionEffort": 0.2,
    }
    of = {joint.name: {one for one in applied_schemas(joint.prim) if one.startswith("Physx")} for joint in first.joints.values()}
    assert of["rail"] == set() and of["hip"] == set() and applied_schemas(first.joints["hip"].prim) >= {"NewtonJointAPI"}
    roots = [prim for prim in first.stage.Traverse() if "PhysxArticulationAPI" in applied_schemas(prim)]
    assert len(roots) == 1 and roots[0].HasAPI(UsdPhysics.ArticulationRootAPI)
    assert authored_attributes(roots[0], "physxArticulation") == {"physxArticulation:enabledSelfCollisions": True}


def test_mimic_has_newton_and_physx_schemas(every: Compiled) -> None:
    """A mimic joint has the mimic applied_schemas of Newton and PhysX, with their sign conventions."""
    prim = read(every, "last").joints["push"].prim
    assert "NewtonMimicAPI" in prim.GetPrimTypeInfo().GetAppliedAPISchemas() or "NewtonMimicAPI" in str(prim.GetMetadata("apiSchemas"))
    assert authored_attributes(prim, "newton:mimic") == {"newton:mimicCoef0": 0.003, "newton:mimicCoef1": -2.0}
    for name in ("newton:mimicJoint", "physxMimicJoint:rotZ:referenceJoint"):
        assert [str(path) for path in prim.GetRelationship(name).GetTargets()] == ["/every/joints/rail"]
    assert "PhysxMimicJointAPI:rotZ" in applied_schemas(prim) and authored_attributes(prim, "physxMimic") == {
        "physxMimicJoint:rotZ:referenceJointAxis": "rotZ", "physxMimicJoint:rotZ:gearing": 2.0, "physxMimicJoint:rotZ:offset": -0.003,
    }


def test_mimic_without_limits_has_no_physx_schema(tmp_path: Path) -> None:
    """PhysX rejects mimic hinges without limits, so only Newton's schema is applied."""
    bounded = "revolute, parent: c0.a, child: c1.b, limit: {lower: 10 deg, upper: 90 deg}"
    document = MIMICS.replace(bounded, "continuous, parent: c0.a, child: c1.b")
    made = Compiled(tmp_path, document.replace("  joints:", "  rest:").replace("joints.b", "rest.b"), "usd")
    prim = read(made, "m").joints["b"].prim
    assert authored_attributes(prim, "physxMimic", "physics:lower") == {"physics:lowerLimit": -math.inf}
    assert {one for one in applied_schemas(prim) if "Mimic" in one} == {"NewtonMimicAPI"}


def test_values_beyond_float_range_are_losses(tmp_path: Path) -> None:
    """A value above 3.4e+38 is infinite in the file, which is an export loss."""
    document = MIMICS.replace("  joints:", "  rest:").replace("joints.b", "rest.b").replace("effort: 7 N*m}", "velocity: 1e38 rad/s}")
    document = document.replace("kp: 1 N*m/rad", "kp: 1 N*m/rad, kv: 1e39 N*m*s/rad")
    made = Compiled(tmp_path, document, "usd")
    infinite = [loss[:3] for loss in made.losses(None) if "infinite" in loss[1]]
    end = "infinite in the file (above 3.4e+38)"
    assert infinite == [
        ("a", f"the kv of 1e+39 N m s/rad: {end}", "approximated"), ("d", f"the velocity limit of 1e+38 rad/s: {end}", "approximated"),
    ]


MIMICS = """\
thingc: assembly/1
name: follow
components:
""" + EVERY.partition("components:\n")[2].partition("  c4:")[0] + """\
  joints: {frame: true, mass: 1 kg, inertia: {ixx: 1 kg*m^2, iyy: 1 kg*m^2, izz: 1 kg*m^2}, mounts: {b: {xyz: 1 2 3 mm}}}
joints:
  a: {type: revolute, parent: c0.a, child: c1.b, limit: {lower: 10 deg, upper: 90 deg}, drive: {kind: position, kp: 1 N*m/rad}}
  b: {type: revolute, parent: c1.a, child: c2.b, mimic: {joint: a, multiplier: 2, offset: 30 deg}}
  c: {type: prismatic, parent: c2.a, child: c3.b, limit: {lower: -1 m, upper: 1 m}, mimic: {joint: a, multiplier: 3 mm/rad}}
  d: {type: revolute, parent: c3.a, child: joints.b, limit: {lower: -1 rad, upper: 1 rad, effort: 7 N*m}}
modes: {m: {root: c0, gravity: [0, 0, 0]}}
"""


def test_mimics_between_joint_kinds_are_losses(tmp_path: Path) -> None:
    """A hinge that mimics a slide, or the reverse, is an export loss. Other mimics have coefficients in degrees."""
    document = MIMICS.replace("  joints:", "  rest:").replace("joints.b", "rest.b")
    made = Compiled(tmp_path / "good", document, "usd")
    joints = read(made, "m").joints
    assert authored_attributes(joints["b"].prim, "newton:mimic") == {"newton:mimicCoef0": 30.0, "newton:mimicCoef1": 2.0}
    assert authored_attributes(joints["c"].prim, "newton:mimic") == authored_attributes(joints["c"].prim, "physxMimic") == {}
    assert authored_attributes(joints["b"].prim, "physics:lower", "physics:upper", "physxMimic") == {  # where the limits of `a` take it
        "physics:lowerLimit": 50.0, "physics:upperLimit": 210.0, "physxMimicJoint:rotZ:referenceJointAxis": "rotZ",
        "physxMimicJoint:rotZ:gearing": -2.0, "physxMimicJoint:rotZ:offset": -30.0,
    }
    assert UsdPhysics.Scene(read(made, "m").at("scene")).GetGravityMagnitudeAttr().Get() == 0.0
    assert authored_attributes(joints["a"].prim, "drive:angular:physics:target") == {"drive:angular:physics:targetPosition": 10.0}
    assert [loss[:3] for loss in made.losses(None)] == [
        ("b", f"the mimic of `a`{MIMIC}", "carried as custom data"),
        ("c", f"the mimic of `a`{MIMIC}", "carried as custom data"),
        ("d", "the effort limit of 7 N m: only drives have an effort limit", "omitted"),
        ("c", "the mimic of `a`: a hinge cannot mimic a slide, nor a slide a hinge", "omitted"),
    ]


FREE = """\
thingc: assembly/1
name: hands
components:
  palm: {frame: true, MASS, mounts: {slide: {}, grasp: {xyz: 0 0 50 mm}, side: {xyz: 1 0 0 m}}}
  jaw: {frame: true, MASS}
  ball: {frame: true, MASS}
  other: {frame: true, MASS, mounts: {slide: {}}}
  finger: {frame: true, MASS}
joints:
  open: {type: prismatic, parent: palm.slide, child: jaw.origin, limit: {lower: 0 mm, upper: 10 mm}}
  grasp: {type: free, parent: palm.grasp, child: ball.origin}
  away: {type: free, parent: palm.side, child: other.origin}
  close: {type: prismatic, parent: other.slide, child: finger.origin, limit: {lower: 0 mm, upper: 10 mm}}
modes: {palm: {root: palm}, jaw: {root: jaw, base: free}, ball: {root: ball}, finger: {root: finger}}
""".replace("MASS", "mass: 1 kg, inertia: {ixx: 0.01 kg*m^2, iyy: 0.01 kg*m^2, izz: 0.01 kg*m^2}")


@pytest.mark.parametrize(("mode", "bases"), [
    ("palm", {"palm", "other"}), ("jaw", {"jaw", "other"}), ("ball", {"palm", "other"}), ("finger", {"finger", "palm"}),
])
def test_free_joints_separate_articulations(tmp_path: Path, mode: str, bases: set[str]) -> None:
    """Each group of links with joints is an articulation, and a free object is not part of one."""
    model = read(Compiled(tmp_path, FREE, "usd"), mode)
    assert {prim.GetName() for prim in model.stage.Traverse() if prim.HasAPI(UsdPhysics.ArticulationRootAPI)} == bases
    assert {joint.name for joint in model.joints.values() if joint.parent != "world"} == {"open", "close"}


def test_reversed_planar_joint_is_two_joints(tmp_path: Path) -> None:
    """Forwards, it slides and then rotates, like a generic joint. Backwards, it rotates first, so two joints are needed."""
    document = MIMICS.partition("joints:\n  a:")[0].partition("  joints:")[0] + (
        "joints: {p: {type: planar, parent: c0.a, child: c1.b}, q: {type: revolute, parent: c1.a, child: c2.b, "
        "limit: {lower: -1 rad, upper: 1 rad}}, r: {type: fixed, parent: c2.a, child: c3.b}}\n"
        "modes: {there: {root: c0}, back: {root: c2}}\n"
    )
    made = Compiled(tmp_path, document, "usd")
    there, back = read(made, "there"), read(made, "back")
    assert there.joints["p"].free == ["transX", "transY", "rotZ"] and "p_2" not in there.joints
    turn, slides = back.joints["p_2"], back.joints["p"]
    assert (turn.parent, turn.child, turn.free) == ("c1", "p_2_link", ["rotZ"])
    assert (slides.parent, slides.child, slides.free) == ("p_2_link", "c0", ["transX", "transY"])
    assert back.inertia("p_2_link")[0] == pytest.approx(1e-9) and back.faults() == []
    what = "the motion: written as 2 joints, with links of 1e-9 kg between the joints"
    assert made.losses("there") == [] and [loss[:3] for loss in made.losses("back")] == [("p", what, "approximated")]


def test_losses_have_the_line_of_their_cause(every: Compiled) -> None:
    """Every export loss of the document has the line of its element in the document."""
    def lost(mode: str | None) -> list[tuple[str, str, str, str]]:
        lines = ["", *(line.strip() for line in EVERY.split("\n"))]
        return [(path, what, how, re.split(r"[:{]", lines[line])[0]) for path, what, how, line in every.losses(mode)]

    newton, alone = "carried as custom data", ": read by Newton and partly by PhysX"
    cone = "the cone of 1.0472 rad: the rotation about the axis is not limited in the file"
    assert lost(None) == [
        ("eye", "the sensor: not supported by UsdPhysics", "omitted", "eye"),
        ("imu", "the sensor: not supported by UsdPhysics", "omitted", "imu"),
        ("wrist", "the sensor: not supported by UsdPhysics", "omitted", "wrist"),
        ("wheel", "the sensor: not supported by UsdPhysics", "omitted", "wheel"),
        ("home", "the pose: not supported by UsdPhysics", "omitted", "home"),
        ("every", "the time step", "omitted", "simulation"),
        ("every", "the `simulation` settings", "omitted", "simulation"),
        ("turn", f"the damping of 0.1 N m s/rad{alone}", newton, "turn"),
        ("turn", f"the dry friction of 0.2 N m{alone}", newton, "turn"),
        ("turn", f"the armature of 0.3 kg m^2{alone}", newton, "turn"),
        ("turn", "the stiffness of 0.4 N m/rad", "omitted", "turn"),
        ("turn", f"the velocity limit of 4 rad/s{alone}", newton, "turn"),
        ("push", f"the mimic of `rail`{MIMIC}", newton, "mimic"),
        ("hip", f"the damping of 0.1 N m s/rad{alone}", newton, "hip"),
        ("hip", cone, "approximated", "hip"),
        ("hip_0", "the drive: motor about 0, 0, 1", "omitted", "drive"),
        ("spindle", "the thread: rotation and translation are independent", "approximated", "spindle"),
        ("fork", "the motion: the order of the rotations is not defined by UsdPhysics", "approximated", "fork"),
    ]
    assert lost("first") == lost("fork") == lost("rolling") == lost("swinging") == []
    assert lost("last") == [
        ("last", "the motion of the held base: the base is fixed in the file", "approximated", "last"),
    ]


# --- loops and holds ----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def fourbar(tmp_path_factory: pytest.TempPathFactory) -> Compiled:
    return Compiled(tmp_path_factory.mktemp("fourbar"), FOURBAR, "usd")


@pytest.mark.parametrize("mode", ["bench", "by_coupler", "other", "third"])
def test_loops_are_joints_outside_the_articulation(fourbar: Compiled, mode: str) -> None:
    """The loop is closed in every keyframe of MuJoCo, except for the coordinate that it leaves free."""
    model, robot, reference = read(fourbar, mode), fourbar.robots[mode], fourbar.reference(mode)
    assert model.faults() == []
    excluded = [joint.name for joint in model.joints.values() if joint.excluded]
    assert excluded == [closure.path for closure in robot.closures] and len(excluded) == 1
    assert robot.keyframes
    for frame in robot.keyframes:
        poses, apart = model.placed(values(robot, model, dict(frame.q)))
        (gap,) = apart.values()
        loop = model.joints[excluded[0]]
        assert gap == pytest.approx(loop.motion(frame.q[loop.name]), abs=FLOAT)
        data = mujoco.MjData(reference)
        mujoco.mj_resetDataKeyframe(reference, data, reference.key(frame.name).id)
        mujoco.mj_forward(reference, data)
        root = robot.assembly.links[robot.bodies[0].link].name
        for link in model.links:
            found = np.linalg.inv(poses[root]) @ poses[link]
            assert found == pytest.approx(np.linalg.inv(mujoco_pose(data, root)) @ mujoco_pose(data, link), abs=FLOAT)
    what = "the start pose: the file has q = 0, where loops and holds are open"
    assert (mode, what, "approximated") in [loss[:3] for loss in fourbar.losses(mode)]


@pytest.fixture(scope="module")
def worm(tmp_path_factory: pytest.TempPathFactory) -> Compiled:
    return Compiled(tmp_path_factory.mktemp("worm"), inchworm(modes=HOLDS, poses=POSES), "usd")


@pytest.mark.parametrize(("mode", "held", "kind"), [
    ("hanging", "front_sole", "Fixed"), ("dangling", "front_sole", "Spherical"), ("stay", "rear_sole", "Fixed"),
    ("pinned", "rear_sole", "Spherical"),
])
def test_holds_are_excluded_joints_to_the_world(worm: Compiled, mode: str, held: str, kind: str) -> None:
    """The hold is at the pose of the mount in MuJoCo's keyframe."""
    model, reference = read(worm, mode), worm.reference(mode)
    joint = model.joints[f"{held}_hold"]
    assert (joint.parent, joint.excluded, joint.prim.GetTypeName()) == ("world", True, f"Physics{kind}Joint")
    data = mujoco.MjData(reference)
    mujoco.mj_resetDataKeyframe(reference, data, 0)
    mujoco.mj_forward(reference, data)
    mount = mujoco_pose(data, held.replace("_", "/", 1))
    assert joint.frames[0][:3, 3] == pytest.approx(mount[:3, 3], abs=FLOAT)
    if kind == "Fixed":
        assert joint.frames[0] == pytest.approx(mount, abs=FLOAT)
    assert model.frames(joint.child)[held] == pytest.approx(joint.frames[1], abs=FLOAT)


# --- shapes, masses, names ----------------------------------------------------------------------------------------------


def test_visuals_are_instances_of_shared_meshes(tmp_path: Path) -> None:
    """Each drawn occurrence is an instance of the mesh of its definition. Points equal those in the store, and colours are linear."""
    store = Store(str(tmp_path))
    whole = small_robot.assembly(store)
    bare = tuple(replace(one, overrides=replace(one.overrides, collision="none")) for one in whole.occurrences)
    request = small_robot.request(replace(whole, occurrences=bare), store)
    made = emit(request)
    assert request.report.diagnostics == [] and emit(request).files == made.files
    model = Model(text_of(made, "usd/arm_bench.usda"))
    assert model.faults() == []
    instances = {prim.GetName(): prim for prim in model.stage.Traverse() if prim.IsInstance()}
    drawn = {one.path.replace("/", "_"): one for one in request.assembly.occurrences if one.drawn}
    assert drawn and set(instances) == set(drawn)
    prototypes = {drawn[name].definition.text: prim.GetPrototype() for name, prim in instances.items()}
    assert len(set(prototypes.values())) == len(prototypes) == len(model.stage.GetPrototypes())
    for name, one in drawn.items():
        (surface,) = one.drawn
        assert isinstance(surface.solid, Mesh)
        rows = [line.split() for line in store.read(surface.solid.sha256).decode().splitlines()]
        mesh = UsdGeom.Mesh(instances[name].GetPrototype().GetChild("mesh"))
        points = np.array([[float(x) for x in row[1:]] for row in rows if row[0] == "v"])
        assert np.array(mesh.GetPointsAttr().Get()) == pytest.approx(points, abs=1e-8)
        corners = [int(x) - 1 for row in rows if row[0] == "f" for x in row[1:]]
        assert list(mesh.GetFaceVertexIndicesAttr().Get()) == corners and set(mesh.GetFaceVertexCountsAttr().Get()) == {3}
        assert np.array(mesh.GetExtentAttr().Get()) == pytest.approx(np.array([points.min(0), points.max(0)]), abs=1e-8)
        assert mesh.GetSubdivisionSchemeAttr().Get() == "none"
        material, _ = UsdShade.MaterialBindingAPI(instances[name]).ComputeBoundMaterial()
        color = material.ComputeSurfaceSource()[0].GetInput("diffuseColor").Get()
        srgb = np.array([int((one.color or "#bfbfbf")[k : k + 2], 16) for k in (1, 3, 5)]) / 255
        light = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
        assert np.array(color) == pytest.approx(light, abs=1e-6)


def test_collision_shapes_are_guides_with_friction(tmp_path: Path) -> None:
    """Collision shapes are guides with the right kind, size and pose. Friction comes from the material, with Newton's torsional and
    rolling friction."""
    store = Store(str(tmp_path))
    whole = small_robot.assembly(store)
    at = Pose(translation=(0.01, 0.02, 0.03))
    first = next(one for one in whole.occurrences if one.record is not None and one.record.meshes and one.material is not None)
    assert first.record is not None and first.material is not None and len(first.drawn) == 1
    pieces = tuple(
        Primitive(shape=shape, size=size, pose=at)  # type: ignore[arg-type]
        for shape, size in (("box", (0.01, 0.02, 0.03)), ("sphere", (0.04,)), ("cylinder", (0.05, 0.06)), ("capsule", (0.07, 0.08)))
    )
    changed = replace(
        first, record=replace(first.record, pieces=(*pieces, first.record.meshes["visual"])),
        overrides=replace(first.overrides, collision="part"),
        material=replace(first.material, slide=0.7, torsion=0.01, roll=0.001),
    )
    others = tuple(replace(one, overrides=replace(one.overrides, collision="none")) for one in whole.occurrences)
    occurrences = tuple(changed if one.path == first.path else one for one in others)
    made = emit(small_robot.request(replace(whole, occurrences=occurrences), store))
    model = Model(text_of(made, "usd/arm_bench.usda"))
    assert model.faults() == []
    shapes = [prim for prim in model.stage.Traverse() if prim.HasAPI(UsdPhysics.CollisionAPI)]
    assert [prim.GetTypeName() for prim in shapes] == ["Cube", "Sphere", "Cylinder", "Capsule", "Mesh"]
    boxes = UsdGeom.BBoxCache(Usd.TimeCode.Default(), ["guide"])
    bounds = [boxes.ComputeWorldBound(prim) for prim in shapes[:4]]
    sizes = [np.array(one.GetRange().GetSize()) * np.linalg.norm(matrix(one.GetMatrix())[:3, :3], axis=0) for one in bounds]
    assert np.array(sizes) == pytest.approx(
        np.array([(0.02, 0.04, 0.06), (0.08,) * 3, (0.1, 0.1, 0.12), (0.14, 0.14, 0.30)]), abs=1e-6,
    )
    assert UsdGeom.Capsule(shapes[3]).GetHeightAttr().Get() == 0.16
    for prim in shapes[:4]:
        assert matrix(UsdGeom.Xformable(prim).GetLocalTransformation())[:3, 3] == pytest.approx(
            (as_matrix(in_link(whole)[first.index]) @ as_matrix(at))[:3, 3], abs=1e-12,
        )
    assert UsdPhysics.MeshCollisionAPI(shapes[4]).GetApproximationAttr().Get() == "convexHull"
    assert {UsdGeom.Imageable(prim).GetPurposeAttr().Get() for prim in shapes} == {"guide"}
    material, _ = UsdShade.MaterialBindingAPI(shapes[0]).ComputeBoundMaterial("physics")
    rubs = UsdPhysics.MaterialAPI(material.GetPrim())
    assert (rubs.GetStaticFrictionAttr().Get(), rubs.GetDynamicFrictionAttr().Get()) == pytest.approx((0.7, 0.7))
    assert rubs.GetRestitutionAttr().Get() == 0.0
    assert authored_attributes(material.GetPrim(), "newton:") == {"newton:torsionalFriction": 0.01, "newton:rollingFriction": 0.001}
    said_of = {(one.path, one.what, one.how) for one in made.losses}
    for kind in ("torsional", "rolling"):
        assert (first.material.name, f"the {kind} friction: only read by Newton", "carried as custom data") in said_of


def test_default_friction_is_that_of_mujoco(tmp_path: Path) -> None:
    """UsdPhysics reads a missing friction as 0, so MuJoCo's default of 1.0 is written."""
    foot = "  foot: {link: true, mass: 1 g, shapes: [{sphere: {radius: 10 mm}, for: collision}], attach: {origin: c0.origin}}\n"
    document = MIMICS.replace("  joints:", "  rest:").replace("joints.b", "rest.b").replace("components:\n", f"components:\n{foot}")
    stage = read(Compiled(tmp_path, document, "usd"), "m").stage
    (shape,) = (prim for prim in stage.Traverse() if prim.HasAPI(UsdPhysics.CollisionAPI))
    material, _ = UsdShade.MaterialBindingAPI(shape).ComputeBoundMaterial("physics")
    rubs = UsdPhysics.MaterialAPI(material.GetPrim())
    assert {rubs.GetStaticFrictionAttr().Get(), rubs.GetDynamicFrictionAttr().Get()} == {mujoco_default("friction")[0]} == {1.0}


def mujoco_default(name: str) -> Any:
    return getattr(mujoco.MjSpec().worldbody.add_geom(), name)


def test_mesh_normals_are_unit_and_outward(tmp_path: Path) -> None:
    """Each triangle has a unit normal that points outwards; the boxes of the small robot are closed."""
    model = Model(text_of(emit(small_robot.request(small_robot.assembly(store := Store(str(tmp_path))), store)), "usd/arm_bench.usda"))
    prims = [prim for prim in model.stage.TraverseAll() if prim.IsA(UsdGeom.Mesh)]
    assert prims and store
    for prim in prims:
        mesh, primvar = UsdGeom.Mesh(prim), UsdGeom.PrimvarsAPI(prim).GetPrimvar("normals")
        triangles = np.array(mesh.GetPointsAttr().Get(), float)[np.array(mesh.GetFaceVertexIndicesAttr().Get())].reshape(-1, 3, 3)
        normals = np.array(primvar.Get(), float)
        assert primvar.GetInterpolation() == "uniform" and normals.shape == (len(triangles), 3)
        assert np.linalg.norm(normals, axis=1) == pytest.approx(np.ones(len(normals)), abs=2e-6)
        assert np.einsum("ijk,ik->ij", triangles - triangles[:, :1], normals) == pytest.approx(0.0, abs=1e-6)
        assert (np.einsum("ik,ik->i", triangles.mean(1) - triangles.mean((0, 1)), normals) > 0.0).all()


def test_asset_metadata_is_written(every: Compiled, monkeypatch: pytest.MonkeyPatch) -> None:
    """The stage has the metadata that SimReady and REP 158 require in addition to UsdPhysics."""
    model, reference = read(every, "rolling"), every.reference("rolling")
    assert model.stage.GetTimeCodesPerSecond() == 1.0
    assert {name: type(value).__name__ for name, value in model.root.GetAssetInfo().items()} == {
        "identifier": "AssetPath", "name": "str", "version": "str",
    }
    found = model.stage.GetRootLayer().customLayerData["SimReady_Metadata"]
    assert found.pop("mass") == pytest.approx(reference.body_mass.sum()) and found.pop("rigid_body_count") == len(model.links)
    assert all(size >= 0.0 for size in found.pop("asset_extents")) and found.pop("source_file").endswith(".yaml")
    assert found == {
        "asset_license": "TODO: License declaration", "asset_name": "every", "asset_type": "robot", "author": "TODO", "category": "robot",
        "qcode": "Q11012", "usd_date_generated": "1970-01-01",
    }
    for epoch, date in (("1700000000", "2023-11-14"), ("", "1970-01-01"), ("-1", "1970-01-01"), ("9" * 20, "1970-01-01")):
        monkeypatch.setenv("SOURCE_DATE_EPOCH", epoch)
        assert build_date() == date
    assert {(joint.name, joint.prim.GetAttribute("ros:joint:name").Get()) for joint in model.joints.values()} == {
        (name, name) for name in model.joints
    }
    steps = {tuple(op.GetOpType() for op in UsdGeom.Xformable(link).GetOrderedXformOps()) for link in model.links.values()}
    assert steps == {(UsdGeom.XformOp.TypeTranslate, UsdGeom.XformOp.TypeOrient)}


def test_flat_body_inertia_is_valid_in_single_precision() -> None:
    """A rotated plate without thickness: readers reject A + B < C, so rounding to floats must keep the triangle inequality."""
    properties = MassProperties(mass=2.0, inertia=((0.12, 0.0, 0.0), (0.0, 0.31, 0.0), (0.0, 0.0, 0.43)))
    for seed in range(20):
        turn = Rotation.random(random_state=seed).as_matrix()
        turned = properties.seen_from(Pose(rotation=tuple(tuple(float(x) for x in row) for row in turn)))  # type: ignore[arg-type]
        low, middle, high = sorted(float(np.float32(x)) for x in moments_of(turned)[0])
        assert low + middle >= high and (low, middle, high) == pytest.approx((0.12, 0.31, 0.43), rel=3e-6)


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1), st.sampled_from([(1.0, 2.0, 2.5), (1.0, 1.0, 1.0), (2.0, 2.0, 1.0), (1.0, 1.0 + 1e-9, 2.0)]))
def test_principal_axes_reproduce_the_inertia(seed: int, moments: tuple[float, float, float]) -> None:
    """The axes are a proper rotation that, with the moments, reproduces the inertia. Diagonal inertias are kept unchanged."""
    turn = Rotation.random(random_state=seed).as_matrix()
    inertia = turn @ np.diag(moments) @ turn.T
    found, axes = principal_axes(tuple(tuple(float(x) for x in row) for row in (inertia + inertia.T) / 2))  # type: ignore[arg-type]
    rotation = np.array(axes)
    assert np.linalg.det(rotation) == pytest.approx(1.0) and rotation @ rotation.T == pytest.approx(np.eye(3), abs=1e-14)
    assert rotation @ np.diag(found) @ rotation.T == pytest.approx(inertia, abs=1e-13)
    assert sorted(found) == pytest.approx(sorted(moments), abs=1e-13)
    assert principal_axes(((3.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 2.0))) == ((3.0, 1.0, 2.0), Pose().rotation)
