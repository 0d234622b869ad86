"""Results compared with MuJoCo, on the models of the same compilation."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import mujoco
import numpy
import pytest

import thingc
from thingc.batch.measurements import UnknownMount, lengths, measure
from thingc.driver import pipeline
from thingc.driver.environment import Environment, Options
from thingc.driver.pipeline import Compilation
from thingc.model.robot.tree import in_link
from thingc.model.robot.types import Robot
from variants.robots import workspace

CASES = [
    ("assemblies/arm.yaml", "bench", "home"), ("assemblies/arm.yaml", "drawing", None), ("assemblies/arm.yaml", "adrift", None),
    ("assemblies/minchw/minchw.yaml", "front_foot", None), ("assemblies/minchw/minchw.yaml", "rear_foot_wall", "arched"),
    ("assemblies/minchw/minchw.yaml", "front_foot_ceiling", "arched"), ("assemblies/minchw/minchw.yaml", "crawl", None),
]


@pytest.fixture(scope="module")
def compiled(root: Path, shared_store: str) -> dict[str, tuple[Compilation, thingc.Compiled]]:
    found = {}
    for document in sorted({case[0] for case in CASES}):
        with Environment(str(root / document), Options(store=shared_store)) as environment:
            found[document] = (pipeline.compile(environment), thingc.compile(str(root / document), store=shared_store))
    return found


def posed(model: Any, robot: Robot, pose: str | None) -> Any:
    """Return the state of a keyframe at rest. For None, return the pose of the mode, or q = 0 without a pose."""
    data = mujoco.MjData(model)
    name = pose or robot.mode.pose
    if name is not None:
        mujoco.mj_resetDataKeyframe(model, data, mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_KEY, name))
    mujoco.mj_forward(model, data)
    return data


def robot_of(compilation: Compilation, mode: str) -> Robot:
    return next(robot for robot in compilation.robots if robot.mode.name == mode)


@pytest.mark.parametrize(("document", "mode", "pose"), CASES)
def test_torque_margin_equals_inverse_dynamics(compiled: Any, document: str, mode: str, pose: str | None) -> None:
    compilation, written = compiled[document]
    model = written.modes[mode].model()
    data = posed(model, robot_of(compilation, mode), pose)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    data.qacc[:] = 0.0
    mujoco.mj_inverse(model, data)
    ratios = []
    for k in range(model.nu):
        if model.actuator_trntype[k] == mujoco.mjtTrn.mjTRN_JOINT:
            torque = data.qfrc_inverse[model.jnt_dofadr[model.actuator_trnid[k, 0]]]
            ratios.append(model.actuator_forcerange[k, 1] / abs(torque) if abs(torque) > 1e-12 else math.inf)
    found = measure(robot_of(compilation, mode), pose, None)["torque_margin"]
    assert ratios and found == pytest.approx(min(ratios), rel=1e-9)


@pytest.mark.parametrize(("document", "mode", "pose"), CASES)
def test_mass_properties_equal_those_of_the_model(compiled: Any, document: str, mode: str, pose: str | None) -> None:
    """At q = 0, in the frame of the base component. The bodies of the model are moved there by its kinematics."""
    compilation, written = compiled[document]
    robot = robot_of(compilation, mode)
    assembly = robot.assembly
    model = written.modes[mode].model()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    base = assembly.links[assembly.link_of[assembly.base]]
    body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, base.name)
    inner = base.poses[base.members.index(assembly.base)]
    rotation = data.xmat[body].reshape(3, 3) @ numpy.array(inner.rotation)
    origin = data.xpos[body] + data.xmat[body].reshape(3, 3) @ numpy.array(inner.translation)
    mass = model.body_mass[1:].sum()
    centre = (model.body_mass[1:, None] * data.xipos[1:]).sum(axis=0) / mass
    inertia = numpy.zeros((3, 3))
    for k in range(1, model.nbody):
        turn = data.ximat[k].reshape(3, 3)
        arm = data.xipos[k] - centre
        inertia += turn @ numpy.diag(model.body_inertia[k]) @ turn.T
        inertia += model.body_mass[k] * (arm @ arm * numpy.eye(3) - numpy.outer(arm, arm))
    centre, inertia = rotation.T @ (centre - origin), rotation.T @ inertia @ rotation
    found = measure(robot, pose, None)
    assert found["mass"] == pytest.approx(mass, rel=1e-12)
    assert [found[f"centre.{axis}"] for axis in "xyz"] == pytest.approx(list(centre), abs=1e-9)
    named = [found[f"inertia.{ab}"] for ab in ("xx", "yy", "zz", "xy", "xz", "yz")]
    assert named == pytest.approx([inertia[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))], abs=1e-9)


@pytest.mark.parametrize(("document", "mode", "pose"), CASES)
def test_reach_is_the_distance_of_two_sites(compiled: Any, document: str, mode: str, pose: str | None) -> None:
    compilation, written = compiled[document]
    ends = ("tip", "base") if "arm" in document else ("rear.sole", "front_sole")
    sites = ("tip", "base") if "arm" in document else ("rear/sole", "front_sole")
    model = written.modes[mode].model()
    data = posed(model, robot_of(compilation, mode), pose)
    a, b = (data.site_xpos[mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, site)] for site in sites)
    found = measure(robot_of(compilation, mode), pose, ends)
    assert found["reach"] == pytest.approx(float(numpy.linalg.norm(a - b)), abs=1e-12)


@pytest.mark.parametrize(("document", "mode", "pose"), CASES)
def test_box_contains_every_vertex_and_is_tight(compiled: Any, document: str, mode: str, pose: str | None) -> None:
    """The box contains the boxes of all parts, so it contains the vertices of all meshes. At right angles, vertices touch it."""
    compilation, written = compiled[document]
    model = written.modes[mode].model()
    data = posed(model, robot_of(compilation, mode), pose)
    vertices = []
    for geom in range(model.ngeom):
        if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_MESH and model.geom_group[geom] == 2:
            mesh = model.geom_dataid[geom]
            first = model.mesh_vertadr[mesh]
            own = model.mesh_vert[first : first + model.mesh_vertnum[mesh]]
            vertices.append(own @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom])
    cloud = numpy.vstack(vertices)
    sides = cloud.max(axis=0) - cloud.min(axis=0)
    found = measure(robot_of(compilation, mode), pose, None)
    box = numpy.array([found[f"box.{axis}"] for axis in "xyz"])
    assert (box >= sides - 2e-4).all() and (box <= 1.5 * sides + 1e-3).all(), (box, sides)


@pytest.mark.parametrize(("document", "mode"), [("assemblies/arm.yaml", "bench"), ("assemblies/minchw/minchw.yaml", "crawl")])
def test_lengths_are_distances_of_anchors(compiled: Any, document: str, mode: str) -> None:
    """In a mode whose root is the base component, the joints of the model are in the order of the document."""
    compilation, written = compiled[document]
    model = written.modes[mode].model()
    data = posed(model, robot_of(compilation, mode), None)  # distances between joints of one link do not depend on the pose
    found = lengths(compilation.assembly, in_link(compilation.assembly))
    names = [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, k) for k in range(model.njnt)]
    expected = {}
    for k in range(model.njnt):
        parent = model.body_parentid[model.jnt_bodyid[k]]
        before = model.body_jntadr[parent]
        if parent and before >= 0 and model.jnt_type[before] != mujoco.mjtJoint.mjJNT_FREE:
            expected["length." + names[k].replace("/", ".")] = float(numpy.linalg.norm(data.xanchor[k] - data.xanchor[before]))
    assert expected and found == pytest.approx(expected, abs=1e-12)


def test_pendulum_in_closed_form(tmp_path: Path, shared_store: str) -> None:
    """0.5 kg at 0.3 m and 0.1 kg at 0.15 m, 20 deg from the vertical: tau = g sin(20 deg) (0.5 0.3 + 0.1 0.15)."""
    workspace(tmp_path)
    with Environment(str(tmp_path / "pendulum.yaml"), Options(store=shared_store)) as environment:
        compilation = pipeline.compile(environment)
        found = measure(robot_of(compilation, "hanging"), None, ("bob", "top"))
        torque = 9.81 * math.sin(math.radians(20.0)) * (0.5 * 0.3 + 0.1 * 0.15)
        assert found["torque_margin"] == pytest.approx(6.0 / torque, rel=1e-12)
        assert found["reach"] == pytest.approx(0.3, rel=1e-12)
        assert found["length.twist"] == pytest.approx(0.3, rel=1e-12)
        assert found["mass"] == pytest.approx(2.6, rel=1e-15)
        assert "box.x" not in found  # frames have no geometry
        upright = measure(robot_of(compilation, "flying"), None, None)
        assert upright["torque_margin"] is not None
        with pytest.raises(UnknownMount):
            measure(robot_of(compilation, "hanging"), None, ("bob", "weight.nose"))


def test_loops_have_no_torque_margin(root: Path, shared_store: str) -> None:
    with Environment(str(root / "assemblies/minchw/minchw.yaml"), Options(store=shared_store)) as environment:
        compilation = pipeline.compile(environment, ["bridge"])
        found = measure(compilation.robots[0], None, ("front.sole", "rear.sole"))
        assert found.get("torque_margin") is None and found["reach"] is not None
