"""Written models loaded by MuJoCo: every number is compared with a written-out value or one computed with numpy."""

from __future__ import annotations

import itertools
import math
import os
from collections.abc import Mapping

import msgspec
import mujoco
import numpy as np
import pytest

from graph.builder import kept
from mjcf.handmade import (
    Made,
    Piece,
    Segment,
    box_part,
    box_vertices,
    cylinder_part,
    drive,
    material,
    matrix,
    moved,
    obj,
    spin,
    total,
)
from thingc.base.diagnostic_output import as_json
from thingc.base.inertia import LEAST_MASS, LEAST_MOMENT, MassProperties
from thingc.base.pose import NO_POSE, Pose
from thingc.base.primitives import Primitive
from thingc.geometry.store.local import Store
from thingc.model.resolve.coordinates import CoordinateName, Dynamics, Limit, Mimic
from thingc.model.resolve.types import Overrides
from thingc.targets.mjcf.elements import inertial
from thingc.targets.mjcf.emit import emit
from thingc.targets.request import EmitRequest
from thingc.targets.xml_writer import XmlValue, format_value

NEAR = 1e-9


@pytest.fixture
def store(tmp_path: object) -> Store:
    return Store(f"{tmp_path}/store")


def load(request: EmitRequest, mode: str = "bench") -> mujoco.MjModel:
    """The model of a mode, loaded by MuJoCo. Asserts that neither thingc nor MuJoCo reports anything."""
    artifacts = emit(request)
    assert as_json(request.report.sorted_diagnostics()) == []
    return load_from(request, artifacts.files, mode)


def load_from(request: EmitRequest, files: dict, mode: str) -> mujoco.MjModel:
    assets = {p.removeprefix("mjcf/assets/"): request.store.read(c.sha256) for p, c in files.items() if "/assets/" in p}
    said: list[str] = []
    mujoco.set_mju_user_warning(said.append)
    try:
        model = mujoco.MjModel.from_xml_string(files[f"mjcf/{request.assembly.name}_{mode}.xml"].decode(), assets)
    finally:
        mujoco.set_mju_user_warning(None)
    assert said == []
    return model


def arm(store: Store) -> Made:
    """Plate, yaw, pitch with an off-centre anchor, and a slide; two pieces on one link; general orientations."""
    plate, rod = box_part(store, (-0.1, -0.08, 0.0), (0.1, 0.05, 0.02)), cylinder_part(store, 0.02, 0.1)
    brick = box_part(store, (0.0, 0.01, -0.02), (0.06, 0.05, 0.07))
    tilt = spin((1, 2, 3), 0.7)
    return Made(
        segments=[
            Segment("plate", [Piece("plate", plate, color="#e6e6fa", material=material())]),
            Segment(
                "bracket",
                [Piece("bracket", rod), Piece("hand/cap", brick, matrix((0.01, 0.02, 0.03), tilt))],
                parent=0,
                pose=matrix((0.02, 0.0, 0.07), spin((0, 0, 1), 0.4)),
                joint="yaw",
                limit=Limit(lower=-2.6, upper=2.6, effort=4.1, velocity=4.8),
                dynamics=Dynamics(damping=0.02, friction=0.05, armature=0.01),
                actuator=drive(kp=20.0, kv=0.5, effort=4.1, velocity=4.8),
            ),
            Segment(
                "forearm",
                [Piece("forearm", brick, matrix((0.0, 0.0, 0.1), spin((0, 1, 0), 1.1)))],
                parent=1,
                pose=matrix((0.0, 0.03, 0.08), spin((3, -1, 0.5), 2.0)),
                joint="hand/pitch",
                axis=np.array((1, -2, 0.5)) / np.sqrt(5.25),
                anchor=(0.01, -0.02, 0.03),
                limit=Limit(lower=-1.0, upper=2.0),
                actuator=drive("velocity", kv=1.0, effort=2.0, velocity=6.0),
            ),
            Segment(
                "tip",
                [Piece("tip", rod)],
                parent=2,
                pose=matrix((0.0, 0.0, 0.2), spin((0, 1, 1), -0.9)),
                joint="slider",
                kind="slide",
                axis=(0.6, 0.0, -0.8),
                limit=Limit(lower=0.0, upper=0.05),
                dynamics=Dynamics(stiffness=12.0),
                actuator=drive("motor", effort=7.0),
            ),
        ],
        sites=(("tip", 3, matrix((0, 0, 0.05), tilt)), ("plate/origin", 0, np.eye(4))),
        keyframes=(
            ("home", {"yaw": 0.5, "hand/pitch": -0.6, "slider": 0.02}),
            ("folded", {"yaw": 0.0, "hand/pitch": 1.9, "slider": 0.0}),
        ),
        excluded=((0, 1), (1, 2), (2, 3)),
    )


POSES = ({}, {"yaw": 0.5, "hand/pitch": -0.6, "slider": 0.02}, {"yaw": -2.1, "hand/pitch": 1.7, "slider": 0.05})


@pytest.mark.parametrize("base", ["fixed", "held", "free"])
@pytest.mark.parametrize("q", POSES)
def test_forward_kinematics_match_matrices(store: Store, base: str, q: dict[str, float]) -> None:
    """Poses of bodies and sites for each base equal chains of matrices."""
    made = arm(store)
    made.segments[0].pose = matrix((0.3, -0.2, 0.5), spin((1, 1, 0.2), 1.3))
    model = load(made.request(store, ("bench", base)))
    data = mujoco.MjData(model)
    for path, value in q.items():
        data.joint(path).qpos = value
    mujoco.mj_forward(model, data)
    placed = made.placed(q)
    for link, expected in zip(made.segments, placed, strict=True):
        body = data.body(link.name)
        np.testing.assert_allclose(body.xpos, expected[:3, 3], atol=NEAR)
        np.testing.assert_allclose(body.xmat.reshape(3, 3), expected[:3, :3], atol=NEAR)
    for path, link, local in made.sites:
        expected = placed[link] @ local
        np.testing.assert_allclose(data.site(path).xpos, expected[:3, 3], atol=NEAR)
        np.testing.assert_allclose(data.site(path).xmat.reshape(3, 3), expected[:3, :3], atol=NEAR)


@pytest.mark.parametrize("suffix", ["", ":collision"])
def test_mesh_vertices_are_at_the_part_pose(store: Store, suffix: str) -> None:
    """MuJoCo re-centres meshes and rotates them to their principal axes. World positions of the vertices must not change."""
    made = arm(store)
    q = POSES[1]
    model = load(made.request(store))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    low, high = np.array([0.0, 0.01, -0.02]), np.array([0.06, 0.05, 0.07])
    for path, link, local in (("hand/cap", 1, made.segments[1].pieces[1].pose), ("forearm", 2, made.segments[2].pieces[0].pose)):
        geom = model.geom(path + suffix)
        mesh = model.mesh(geom.dataid[0])
        raw = model.mesh_vert[mesh.vertadr[0] : mesh.vertadr[0] + mesh.vertnum[0]]
        found = raw @ data.geom(path + suffix).xmat.reshape(3, 3).T + data.geom(path + suffix).xpos
        world = made.placed(q)[link] @ local
        expected = box_vertices(low, high) @ world[:3, :3].T + world[:3, 3]
        # MuJoCo keeps vertices as 32-bit floats.
        distance = np.linalg.norm(found[:, None] - expected[None], axis=2)
        assert distance.min(axis=0).max() < 1e-7
        assert distance.min(axis=1).max() < 1e-7


@pytest.mark.parametrize("base", ["fixed", "held", "free"])
def test_masses_and_inertias_match_numpy(store: Store, base: str) -> None:
    made = arm(store)
    model = load(made.request(store, ("bench", base)))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    whole = []
    for segment, x in zip(made.segments, made.placed({}), strict=True):
        own = total([moved(p.part.properties, p.pose) for p in segment.pieces])
        whole.append(moved(own, x))
        body = model.body(segment.name)
        np.testing.assert_allclose(body.mass, own.mass, rtol=NEAR)
        np.testing.assert_allclose(body.ipos, own.centre, atol=NEAR)
        r = np.zeros(9)
        mujoco.mju_quat2Mat(r, body.iquat)
        r = r.reshape(3, 3)
        np.testing.assert_allclose(r @ np.diag(body.inertia) @ r.T, own.inertia, rtol=NEAR, atol=NEAR * np.max(own.inertia))
    robot = total(whole)
    np.testing.assert_allclose(model.body_mass.sum(), robot.mass, rtol=NEAR)
    np.testing.assert_allclose(data.subtree_com[0], robot.centre, atol=NEAR)


def test_mass_matrix_matches_kinetic_energy(store: Store) -> None:
    """The oracle is finite differences of the test's own matrices: T = sum of m v^2 / 2 + w I w / 2 over the links."""
    made = arm(store)
    model = load(made.request(store))
    data = mujoco.MjData(model)
    names = ["yaw", "hand/pitch", "slider"]
    q = dict(zip(names, (0.7, 1.2, 0.01), strict=True))
    data.qpos[:] = list(q.values())
    mujoco.mj_forward(model, data)
    found = np.zeros((3, 3))
    mujoco.mj_fullM(model, data, found)
    step = 1e-6
    jacobians = []
    for name in names:
        plus, minus = (made.placed({**q, name: q[name] + s}) for s in (step, -step))
        jacobians.append((plus, minus))
    expected = np.diag([0.01, 0.0, 0.0])
    for index, segment in enumerate(made.segments):
        own = total([moved(p.part.properties, p.pose) for p in segment.pieces])
        x = made.placed(q)[index]
        inertia = x[:3, :3] @ np.array(own.inertia) @ x[:3, :3].T
        v, w = [], []
        for plus, minus in jacobians:
            v.append(((plus[index] - minus[index]) @ [*own.centre, 1.0])[:3] / (2 * step))
            skew = (plus[index][:3, :3] - minus[index][:3, :3]) / (2 * step) @ x[:3, :3].T
            w.append(np.array([skew[2, 1], skew[0, 2], skew[1, 0]]))
        for i, j in itertools.product(range(3), repeat=2):
            expected[i, j] += own.mass * v[i] @ v[j] + w[i] @ inertia @ w[j]
    np.testing.assert_allclose(found, expected, rtol=1e-7, atol=1e-10)


def test_bases_have_expected_sizes_and_keyframes(store: Store) -> None:
    """Fixed, held and free bases have the expected degrees of freedom, mocap bodies and keyframes."""
    made = arm(store)
    made.segments[0].pose = matrix((0.1, 0.2, 0.3), spin((0, 1, 0), 0.5))
    request = made.request(store, ("bench", "fixed"), ("drawing", "held"), ("adrift", "free"))
    artifacts = emit(request)
    fixed, held, free = (load_from(request, artifacts.files, mode) for mode in ("bench", "drawing", "adrift"))
    assert (fixed.nq, fixed.nv, fixed.nmocap) == (3, 3, 0)
    assert (held.nq, held.nv, held.nmocap) == (3, 3, 1)
    assert (free.nq, free.nv, free.nmocap) == (10, 9, 0)
    assert held.body("plate").mocapid == 0
    assert free.joint("root").type == mujoco.mjtJoint.mjJNT_FREE
    assert fixed.body_mass.sum() == held.body_mass.sum() == free.body_mass.sum()
    half = 0.25
    quat = [np.cos(half), 0.0, np.sin(half), 0.0]
    np.testing.assert_allclose(free.key("home").qpos, [0.1, 0.2, 0.3, *quat, 0.5, -0.6, 0.02], atol=1e-15)
    np.testing.assert_allclose(held.key("home").mpos, [0.1, 0.2, 0.3], atol=1e-15)
    np.testing.assert_allclose(held.key("home").mquat, quat, atol=1e-15)
    np.testing.assert_allclose(free.qpos0, [0.1, 0.2, 0.3, *quat, 0.0, 0.0, 0.0], atol=1e-15)
    data = mujoco.MjData(held)
    mujoco.mj_resetDataKeyframe(held, data, 0)
    data.mocap_pos[0] = [1.0, 2.0, 3.0]
    mujoco.mj_forward(held, data)
    np.testing.assert_allclose(data.body("plate").xpos, [1.0, 2.0, 3.0])


@pytest.mark.parametrize("base", ["fixed", "held", "free"])
def test_simulation_runs_without_warnings(store: Store, base: str, tmp_path: object, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(str(tmp_path))
    model = load(arm(store).request(store, ("bench", base)))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    for _ in range(200):
        mujoco.mj_step(model, data)
    assert np.isfinite(data.qpos).all()
    assert not data.warning.number.any()
    assert "MUJOCO_LOG.TXT" not in os.listdir(str(tmp_path))


def test_joint_and_actuator_parameters(store: Store) -> None:
    model = load(arm(store).request(store))
    yaw, pitch, slider = (model.joint(n) for n in ("yaw", "hand/pitch", "slider"))
    assert yaw.type == mujoco.mjtJoint.mjJNT_HINGE and slider.type == mujoco.mjtJoint.mjJNT_SLIDE
    np.testing.assert_array_equal(yaw.range, [-2.6, 2.6])
    assert yaw.limited and (yaw.damping[0], yaw.frictionloss[0], yaw.armature[0]) == (0.02, 0.05, 0.01)
    assert slider.stiffness[0] == 12.0
    assert not model.jnt_actfrclimited.any()
    np.testing.assert_array_equal(model.actuator("yaw").ctrlrange, [-2.6, 2.6])
    np.testing.assert_array_equal(model.actuator("yaw").forcerange, [-4.1, 4.1])
    np.testing.assert_array_equal(model.actuator("yaw").gainprm[:1], [20.0])
    np.testing.assert_array_equal(model.actuator("yaw").biasprm[:3], [0.0, -20.0, -0.5])
    np.testing.assert_array_equal(model.actuator("hand/pitch").ctrlrange, [-6.0, 6.0])
    np.testing.assert_array_equal(model.actuator("hand/pitch").forcerange, [-2.0, 2.0])
    np.testing.assert_array_equal(model.actuator("slider").ctrlrange, [-7.0, 7.0])
    assert [model.actuator(i).name for i in range(model.nu)] == ["yaw", "hand/pitch", "slider"]
    # ctrl: the angle for a position drive, 0 for the others.
    np.testing.assert_array_equal(model.key("home").ctrl, [0.5, 0.0, 0.0])
    assert [model.key(i).name for i in range(model.nkey)] == ["home", "folded"]
    assert model.numeric("yaw:velocity").data == [4.8]


def test_joint_without_drive_or_limits(store: Store) -> None:
    """A joint without limits is unlimited. Without a drive, the effort limit is on the joint and `ctrl` has no entry. A single limit is
    kept."""
    made = arm(store)
    made.segments[1].limit = Limit(effort=1.5)
    made.segments[2].limit = Limit(lower=-0.5)
    made.present = ("slider",)
    model = load(made.request(store))
    assert not model.joint("yaw").limited
    np.testing.assert_array_equal(model.jnt_actfrcrange[model.joint("yaw").id], [-1.5, 1.5])
    np.testing.assert_array_equal(model.joint("hand/pitch").range, [-0.5, 1e6])
    assert model.nu == 1
    np.testing.assert_array_equal(model.key("home").ctrl, [0.0])


def test_zero_effort_is_a_limit(store: Store) -> None:
    """MuJoCo reads a range of `0 0` as no limit."""
    made = arm(store)
    made.segments[1].actuator = drive(effort=0.0)
    made.segments[1].limit = Limit(lower=-1.0, upper=1.0, effort=0.0)
    model = load(made.request(store))
    data = mujoco.MjData(model)
    data.ctrl[0] = 1.0
    mujoco.mj_forward(model, data)
    assert abs(data.actuator("yaw").force[0]) < 1e-9


def test_mimic_joint_follows_its_leader(store: Store) -> None:
    made = arm(store)
    made.segments[2].mimic = Mimic(joint=CoordinateName("yaw"), multiplier=-0.5, offset=0.3, origin=())
    made.segments[2].actuator = None
    made.segments[1].actuator = drive(kp=50.0, kv=5.0)
    made.gravity = (0.0, 0.0, 0.0)
    made.keyframes = (("home", {"yaw": 0.4, "hand/pitch": 0.1, "slider": 0.0}),)
    model = load(made.request(store))
    assert model.neq == 1 and model.eq(0).name == "hand/pitch:mimic"
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    for _ in range(3000):
        mujoco.mj_step(model, data)
    assert abs(data.joint("yaw").qpos[0]) > 0.1
    np.testing.assert_allclose(data.joint("hand/pitch").qpos, 0.3 - 0.5 * data.joint("yaw").qpos, atol=2e-3)


def test_geom_names_groups_and_materials(store: Store) -> None:
    made = arm(store)
    made.segments[0].pieces[0].material = material(slide=0.4)
    model = load(made.request(store))
    names = [model.geom(i).name for i in range(model.ngeom)]
    assert names == [n for p in ("plate", "bracket", "hand/cap", "forearm", "tip") for n in (p, f"{p}:collision")]
    for name in names:
        geom = model.geom(name)
        collides = name.endswith(":collision")
        assert (geom.group[0], bool(geom.contype[0]), bool(geom.conaffinity[0])) == (3 if collides else 2, collides, collides)
    np.testing.assert_allclose(model.geom("plate").matid, model.material("petg_e6e6fa").id)
    np.testing.assert_allclose(model.material("petg_e6e6fa").rgba, [230 / 255, 230 / 255, 250 / 255, 1.0], rtol=1e-6)
    np.testing.assert_allclose(model.geom("plate:collision").friction, [0.4, 0.005, 0.0001])
    assert model.nmesh == 6  # three definitions of parts, each drawn and touched, however often they are used


def test_document_friction_applies_on_the_floor(store: Store) -> None:
    """MuJoCo uses the larger friction of two geoms, and its floor has 1. The document's 0.1 must apply."""
    made = Made(
        segments=[
            Segment("sled", [Piece("sled", box_part(store, (-0.1, -0.1, -0.05), (0.1, 0.1, 0.05)), material=material(slide=0.1))])
        ]
    )
    request = made.request(store, ("bench", "free"))
    files = emit(request).files
    assets = {p.removeprefix("mjcf/assets/"): store.read(c.sha256) for p, c in files.items() if "/assets/" in p}
    assets["arm_bench.xml"] = files["mjcf/arm_bench.xml"]
    model = mujoco.MjModel.from_xml_string(files["mjcf/scene_bench.xml"].decode(), assets)
    data = mujoco.MjData(model)
    data.qpos[2] = 0.0499
    mujoco.mj_forward(model, data)
    assert data.ncon > 0
    np.testing.assert_allclose([c.friction[0] for c in data.contact], 0.1)


def test_torsional_and_rolling_friction_set_condim(store: Store) -> None:
    part = box_part(store, (0, 0, 0), (0.1, 0.1, 0.1))
    made = Made(
        segments=[
            Segment(
                "a",
                [
                    Piece("a", part, material=material(slide=0.4, torsion=0.02)),
                    Piece("b", part, material=material(roll=0.003)),
                ],
            )
        ]
    )
    model = load(made.request(store))
    np.testing.assert_allclose(model.geom("a:collision").friction, [0.4, 0.02, 0.0001])
    assert model.geom("a:collision").condim == 4
    np.testing.assert_allclose(model.geom("b:collision").friction, [1.0, 0.005, 0.003])
    assert model.geom("b:collision").condim == 6


def test_excluded_pairs_do_not_touch(store: Store) -> None:
    """Of four overlapping boxes, only pairs that are not excluded have contacts, equally in every mode."""
    part = box_part(store, (-0.1, -0.1, -0.1), (0.1, 0.1, 0.1))
    made = Made(
        segments=[
            Segment(n, [Piece(n, part)], parent=p, joint=j, pose=matrix((0.01, 0, 0)))
            for n, p, j in (("a", None, None), ("b", 0, "j1"), ("c", 1, "j2"), ("d", 2, "j3"))
        ],
        excluded=((0, 1), (1, 2), (2, 3), (0, 3)),
    )
    request = made.request(store, ("bench", "fixed"), ("adrift", "free"))
    files = emit(request).files
    for mode in ("bench", "adrift"):
        model = load_from(request, files, mode)
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        pairs = {tuple(sorted(model.body(model.geom_bodyid[g]).name for g in c.geom)) for c in data.contact}
        assert pairs == {("a", "c"), ("b", "d")}


def test_magnets_are_adhesion_actuators(store: Store) -> None:
    """Each magnet is one adhesion actuator in every mode, on the link that carries it. The mode sets its force."""
    made = arm(store)
    made.adhesions = (("forearm/sole", "hand/cap", 300.0), ("tip/sole", "tip", 0.0))
    made.control = {"forearm/sole": 120.0}
    model = load(made.request(store))
    magnet = model.actuator("forearm/sole")
    assert model.actuator_trntype[magnet.id] == mujoco.mjtTrn.mjTRN_BODY
    assert model.body(magnet.trnid[0]).name == "bracket"
    np.testing.assert_array_equal(magnet.ctrlrange, [0.0, 300.0])
    assert magnet.gainprm[0] == 1.0
    np.testing.assert_array_equal(model.key("home").ctrl, [0.5, 0.0, 0.0, 120.0, 0.0])


def test_magnet_named_like_a_joint_gets_a_suffix(store: Store) -> None:
    made = arm(store)
    made.adhesions = (("hand/pitch", "hand/cap", 300.0),)
    model = load(made.request(store))
    assert model.actuator("hand/pitch:adhesion").ctrlrange[1] == 300.0


def test_magnet_force_holds_a_block(store: Store) -> None:
    """A 1 kg block under a plate with a 20 N magnet: it hangs with the magnet on and falls with it off."""
    block = box_part(store, (-0.05, -0.05, -0.05), (0.05, 0.05, 0.05))
    plate = box_part(store, (-0.5, -0.5, 0.0), (0.5, 0.5, 0.02))
    made = Made(
        segments=[
            Segment("plate", [Piece("plate", plate, matrix((0, 0, 0.05)))]),
            Segment("block", [Piece("block", block)], parent=0, joint="drop", kind="slide", axis=(0, 0, 1)),
        ],
        adhesions=(("block/top", "block", 20.0),),
        keyframes=(("home", {"drop": 0.0}),),
    )
    height = {}
    for force in (0.0, 20.0):
        made.control = {"block/top": force}
        model = load(made.request(store))
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, 0)
        for _ in range(300):
            mujoco.mj_step(model, data)
        height[force] = float(data.qpos[0])
    assert height[0.0] < -0.3
    assert abs(height[20.0]) < 5e-3


def test_options_of_document_and_mode_are_merged(store: Store) -> None:
    made = arm(store)
    made.simulation = {"integrator": "rk4", "cone": "elliptic", "impratio": 10.0}
    made.gravity = (-9.81, 0.0, 0.0)
    model = load(made.request(store))
    assert model.opt.timestep == 0.001  # the document's, which the mode does not override
    assert model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4
    assert model.opt.cone == mujoco.mjtCone.mjCONE_ELLIPTIC
    assert model.opt.impratio == 10.0
    np.testing.assert_array_equal(model.opt.gravity, [-9.81, 0.0, 0.0])


def test_fitted_shapes_have_the_pose_of_the_part(store: Store) -> None:
    made = arm(store)
    brick = made.segments[2].pieces[0]
    brick.overrides = Overrides(collision="box")
    made.segments[3].pieces[0].overrides = Overrides(collision="cylinder")
    made.segments[0].pieces[0].overrides = Overrides(collision="none", visual=False)
    model = load(made.request(store))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    box = data.geom("forearm:collision")
    centre = made.placed({})[2] @ brick.pose @ [0.03, 0.03, 0.025, 1.0]
    np.testing.assert_allclose(box.xpos, centre[:3], atol=NEAR)
    np.testing.assert_allclose(box.xmat.reshape(3, 3), (made.placed({})[2] @ brick.pose)[:3, :3], atol=NEAR)
    np.testing.assert_allclose(model.geom("forearm:collision").size, [0.03, 0.02, 0.045])
    assert model.geom("tip:collision").type == mujoco.mjtGeom.mjGEOM_CYLINDER
    np.testing.assert_allclose(model.geom("tip:collision").size[:2], [0.02, 0.05])
    assert "plate" not in [model.geom(i).name for i in range(model.ngeom)]


def test_collision_pieces_are_separate_geoms(store: Store) -> None:
    """With `part` and `decompose`, each piece is a geom, numbered from the second. Primitives have no file, and meshes keep their
    number."""
    faces = ((0, 1, 2), (0, 3, 1), (1, 3, 2), (0, 2, 3))
    corners = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]])
    solids = tuple(kept(store, obj(corners + [k * 0.2, 0, 0], faces), 4, 4) for k in range(3))
    rod = Primitive(
        shape="cylinder", size=(0.02, 0.05),
        pose=Pose(rotation=((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0)), translation=(0.3, 0.1, 0.0)),
    )
    part = box_part(store, (0, 0, 0), (0.1, 0.1, 0.1), pieces=(solids[0], rod, solids[1]), convex={0: solids})
    turned = matrix((0.1, 0.2, 0.3), [[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    made = Made(
        segments=[
            Segment(
                "a",
                [
                    Piece("a", part, overrides=Overrides(collision="part")),
                    Piece("b", part, overrides=Overrides(collision="decompose")),
                    Piece("c", part, pose=turned, overrides=Overrides(collision="part")),
                ],
            )
        ]
    )
    request = made.request(store)
    artifacts = emit(request)
    assert sorted(name.rpartition("_part_")[2] for name in artifacts.files if "_part_" in name) == ["0.obj", "2.obj"]
    model = load_from(request, artifacts.files, "bench")
    names = [model.geom(i).name for i in range(model.ngeom)]
    assert names == [
        "a", "a:collision", "a:collision_1", "a:collision_2", "b", "b:collision", "b:collision_1", "b:collision_2",
        "c", "c:collision", "c:collision_1", "c:collision_2",
    ]
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    for name, placed in (("a:collision_1", np.eye(4)), ("c:collision_1", turned)):
        geom = model.geom(name)
        assert (geom.type, geom.group, geom.contype) == (mujoco.mjtGeom.mjGEOM_CYLINDER, 3, 1)
        np.testing.assert_array_equal(geom.size[:2], [0.02, 0.05])
        np.testing.assert_allclose(data.geom(name).xpos, (placed @ [0.3, 0.1, 0, 1])[:3], atol=NEAR)
        np.testing.assert_allclose(data.geom(name).xmat.reshape(3, 3)[:, 2], placed[:3, 0], atol=NEAR)


def test_flat_meshes_have_no_collision_geom(store: Store) -> None:
    """MuJoCo draws a decal but cannot collide with it; the export loss is listed."""
    decal = box_part(store, (0, 0, 0), (0.1, 0.1, 0.0))
    made = arm(store)
    made.segments[0].pieces.append(Piece("decal", decal))
    request = made.request(store)
    artifacts = emit(request)
    model = load_from(request, artifacts.files, "bench")
    names = [model.geom(i).name for i in range(model.ngeom)]
    assert "decal" in names and "decal:collision" not in names
    found = [(loss.path, loss.how, loss.what) for loss in artifacts.losses if loss.path == "decal"]
    assert found == [
        ("decal", "omitted", "the contacts: the collision mesh is flat")
    ]


def test_losses_have_the_line_of_their_cause(store: Store) -> None:
    made = arm(store)
    made.segments[2].pieces[0].overrides = Overrides(collision="mesh")
    artifacts = emit(made.request(store, ("bench", "fixed"), ("adrift", "free")))
    assert [(x.target, x.mode, x.path, x.what, x.how, x.span.line if x.span else None) for x in artifacts.losses] == [
        ("mjcf", None, "forearm", "the collision mesh: MuJoCo uses the convex hull of a mesh", "approximated", 23),
        ("mjcf", None, "yaw", "the velocity limit of 4.8 rad/s", "carried as custom data", 31),
    ]


def test_plate_without_thickness_is_accepted(store: Store) -> None:
    """The principal moments satisfy A + B = C exactly only in the plate's own frame. MuJoCo must accept it in any frame."""
    thin = box_part(store, (-0.1, -0.2, 0.0), (0.1, 0.2, 1e-9))
    for angle in np.linspace(0.1, 3.0, 7):
        made = Made(
            segments=[
                Segment("base", [Piece("base", cylinder_part(store, 0.1, 0.1))]),
                Segment(
                    "sheet",
                    [
                        Piece(
                            "sheet",
                            thin,
                            matrix((0, 0, 0.3), spin((1, angle, 0.3), angle)),
                            overrides=Overrides(collision="none", visual=False),
                        )
                    ],
                    parent=0,
                    joint="j",
                ),
            ]
        )
        heavy = made.request(store)
        link = heavy.assembly.links[1]
        msgspec.structs.force_setattr(link, "properties", moved(scale_mass(thin.properties, 1e6), made.segments[1].pieces[0].pose))
        model = load(heavy)
        r = np.zeros(9)
        mujoco.mju_quat2Mat(r, model.body("sheet").iquat)
        found = r.reshape(3, 3) @ np.diag(model.body("sheet").inertia) @ r.reshape(3, 3).T
        np.testing.assert_allclose(found, link.properties.inertia, atol=NEAR * np.max(link.properties.inertia))


def scale_mass(properties: object, by: float) -> object:
    return properties.with_mass(properties.mass * by)  # type: ignore[attr-defined]


def test_static_link_without_mass_is_accepted(store: Store) -> None:
    part = box_part(store, (0, 0, 0), (0.1, 0.1, 0.1))
    made = Made(
        segments=[
            Segment("stand", []),
            Segment("arm", [Piece("arm", part)], parent=0, joint="j"),
        ]
    )
    model = load(made.request(store))
    assert model.body("stand").mass == 0.0
    np.testing.assert_allclose(model.body_mass.sum(), 1.0)


def test_static_point_mass_is_accepted(store: Store) -> None:
    made = arm(store)
    request = made.request(store)
    link = request.assembly.links[0]
    msgspec.structs.force_setattr(link, "properties", type(link.properties)(mass=0.25, centre=(0.0, 0.0, 0.1)))
    assert load(request).body("plate").mass == 0.25


def is_accepted(attributes: Mapping[str, XmlValue], *, moves: bool) -> bool:
    """Whether MuJoCo accepts a body with this `<inertial>`."""
    words = " ".join(f'{key}="{format_value(value)}"' for key, value in attributes.items())
    hinge = "<joint/>" if moves else ""
    try:
        mujoco.MjModel.from_xml_string(f"<mujoco><worldbody><body>{hinge}<inertial {words}/></body></worldbody></mujoco>")
    except ValueError:
        return False
    return True


@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_mass_bounds_equal_those_of_mujoco(turn: float) -> None:
    """The smallest mass and moment of a moving body are MuJoCo's bounds. A static body may have any inertia."""
    c, s = math.cos(turn), math.sin(turn)
    about = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])

    def heavy(factor: float) -> MassProperties:
        inertia = about @ np.diag([1.0, 1.5, 2.0]) @ about.T * factor * LEAST_MOMENT
        return MassProperties(mass=1e-6, inertia=tuple(map(tuple, inertia.tolist())))

    (element,) = inertial(heavy(1.001), ())
    assert is_accepted(element.attributes, moves=True) and "fullinertia" in element.attributes
    for factor in (0.999, 0.1, 1e-6, 1e-20):
        small = heavy(factor)
        i = small.inertia
        full = " ".join(map(repr, (i[0][0], i[1][1], i[2][2], i[0][1], i[0][2], i[1][2])))
        assert not is_accepted({"pos": "0 0 0", "mass": "1e-6", "fullinertia": full}, moves=False), "MuJoCo's own bound"
        assert is_accepted(inertial(small, ())[0].attributes, moves=False)
    for mass, fine in ((LEAST_MASS * 1.001, True), (LEAST_MASS * 0.999, False)):
        assert is_accepted({"pos": "0 0 0", "mass": repr(mass), "diaginertia": "1 1 1"}, moves=True) == fine


@pytest.mark.parametrize("side", [3e-5, 1e-5, 2e-6])
def test_tiny_static_mesh_is_accepted(store: Store, side: float) -> None:
    """MuJoCo rejects solids under 1e-15 m^3, but a static crumb must still be drawn."""
    stand, crumb = (box_part(store, (0, 0, 0), (side,) * 3) for side in (0.1, side))
    made = Made(segments=[Segment("stand", [Piece("stand", stand), Piece("crumb", crumb)])])
    assert load(made.request(store)).geom("crumb").dataid[0] >= 0


@pytest.mark.parametrize("name", ["main", "visual", "collision", "arm"])
def test_robot_may_be_named_like_a_default_class(store: Store, name: str) -> None:
    made = arm(store)
    made.name = name
    assert load(made.request(store)).nbody == 5


def test_fitted_sphere_has_its_own_radius(store: Store) -> None:
    """A sphere whose centre is not the part's origin."""
    part = box_part(store, (0, 0, 0), (0.1, 0.1, 0.1), fits={"sphere": Primitive(shape="sphere", size=(0.09,), pose=NO_POSE)})
    made = Made(segments=[Segment("a", [Piece("a", part, overrides=Overrides(collision="sphere"))])])
    model = load(made.request(store))
    assert model.geom("a:collision").type == mujoco.mjtGeom.mjGEOM_SPHERE
    assert model.geom("a:collision").size[0] == 0.09
