"""Every mode of MInchW in MuJoCo: poses of the soles compared with planar kinematics, overlaps of parts, and physics."""

from __future__ import annotations

import io
from itertools import combinations
from math import cos, radians, sin
from pathlib import Path
from typing import Any

import manifold3d
import mujoco
import numpy as np
import pytest
import trimesh

import thingc
from conformance import simulation as sim
from conformance.harness import ROOT
from thingc.geometry.store.local import Store

from .conftest import AXIS, DOCUMENT, MODES, POSES, pose_of, sole

TOUCH = 1e-9
"""The smallest volume [m^3] of an overlap of two parts, 1 mm^3. The meshes are accurate to 0.1 mm."""

FAMILY = {"": (0.0, 0.0, -9.81), "_wall": (-9.81, 0.0, 0.0), "_ceiling": (0.0, 0.0, 9.81)}


def joints() -> list[str]:
    return [f"{leg}/{joint}" for leg in ("front", "rear") for joint in ("ankle", "knee", "yaw")]


@pytest.mark.parametrize("mode", MODES)
def test_modes_step_without_warnings(models: dict[str, mujoco.MjModel], mode: str, tmp_path: Path) -> None:
    model = models[mode]
    assert sim.joints(model) == joints()
    where = mode.removeprefix("front_foot").removeprefix("rear_foot").removeprefix("crawl")
    assert tuple(model.opt.gravity) == FAMILY[where]
    with sim.no_warning(tmp_path):
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, 0)
        for _ in range(250):
            mujoco.mj_step(model, data)
    assert all(warning.number == 0 for warning in data.warning)
    assert np.isfinite(data.qpos).all() and np.abs(data.qvel).max() < 0.5


def test_variants_of_a_mode_differ_only_in_gravity(models: dict[str, mujoco.MjModel]) -> None:
    for mode in ("front_foot", "rear_foot", "crawl"):
        for where in ("_wall", "_ceiling"):
            one, other = models[mode], models[mode + where]
            assert sim.links(one) == sim.links(other)
            for field in (
                "body_parentid", "body_mass", "body_pos", "body_quat", "body_inertia", "jnt_axis", "jnt_range", "qpos0",
                "geom_pos", "geom_quat", "geom_size",
            ):
                assert np.array_equal(getattr(one, field), getattr(other, field)), field


def test_keyframes_of_a_mode(models: dict[str, mujoco.MjModel]) -> None:
    keys = {mode: [models[mode].key(k).name for k in range(models[mode].nkey)] for mode in MODES}
    for where in FAMILY:
        assert keys[f"front_foot{where}"] == ["stretched", "arched", "step_rear"]
        assert keys[f"rear_foot{where}"] == ["stretched", "arched", "step_front"]
        assert keys[f"crawl{where}"] == ["lying"]
    for mode, names in keys.items():
        model = models[mode]
        for name in names:
            for joint in joints():
                q = model.key(name).qpos[model.joint(joint).qposadr[0]]
                assert q == pytest.approx(radians(POSES[name].get(joint, 0.0)), abs=1e-12)


@pytest.mark.parametrize("pose", POSES)
def test_soles_agree_with_planar_kinematics_in_every_mode(models: dict[str, mujoco.MjModel], pose: str) -> None:
    for mode, model in models.items():
        data = pose_of(model, pose)
        body = np.linalg.inv(sim.parts(model, data)["body"])
        for leg in ("front", "rear"):
            found = body @ sim.pose(data.site(f"{leg}/sole").xpos, data.site(f"{leg}/sole").xmat)
            x, z, up = sole(leg, POSES[pose])
            assert found[:3, 3] * 1000 == pytest.approx([x, 0.0, z], abs=1e-6), (mode, leg)
            side = 1.0 if leg == "front" else -1.0
            assert found[:3, 2] == pytest.approx([side * sin(radians(up)), 0.0, -cos(radians(up))], abs=1e-9)


@pytest.mark.parametrize("pose", ["stretched", "arched", "lying"])
def test_both_soles_are_flat_on_one_plane(models: dict[str, mujoco.MjModel], pose: str) -> None:
    for mode in ("front_foot", "rear_foot"):
        model = models[mode]
        data = pose_of(model, pose)
        for leg in ("front", "rear"):
            site = data.site(f"{leg}/sole")
            assert site.xpos[2] == pytest.approx(0.0, abs=1e-9)
            assert site.xmat.reshape(3, 3)[:, 2] == pytest.approx([0, 0, -1], abs=1e-9)
        assert data.site("belly").xpos[2] > (0.0 if pose == "lying" else 0.04)
        # The robot looks along the world's x, whichever foot holds it.
        assert data.site("front/sole").xpos[0] - data.site("rear/sole").xpos[0] > 0.25


def test_stepping_foot_is_level_and_above_the_plane(models: dict[str, mujoco.MjModel]) -> None:
    for held, lifted, pose, height in (("rear", "front", "step_front", 0.0312), ("front", "rear", "step_rear", 0.0240)):
        data = pose_of(models[f"{held}_foot"], pose)
        assert data.site(f"{held}/sole").xpos == pytest.approx([0, 0, 0], abs=1e-12)
        assert data.site(f"{lifted}/sole").xpos[2] == pytest.approx(height, abs=1e-4)
        assert data.site(f"{lifted}/sole").xmat.reshape(3, 3)[:, 2] == pytest.approx([0, 0, -1], abs=1e-9)


def test_signs_of_yaw_and_knee_joints(models: dict[str, mujoco.MjModel]) -> None:
    model = models["crawl"]
    rest = sim.at(model, {})
    for leg, side in (("front", 1.0), ("rear", -1.0)):
        there = rest.site(f"{leg}/sole").xpos
        assert side * (sim.at(model, {f"{leg}/yaw": 0.1}).site(f"{leg}/sole").xpos - there)[1] > 0.01
        assert (sim.at(model, {f"{leg}/knee": 0.1}).site(f"{leg}/sole").xpos - there)[2] < -0.005
        turned = sim.at(model, {f"{leg}/yaw": 0.3}).joint(f"{leg}/yaw").xaxis
        assert turned == pytest.approx([0, 0, 1], abs=1e-12)


@pytest.mark.parametrize("pose", POSES)
def test_no_self_contact_in_document_poses(models: dict[str, mujoco.MjModel], pose: str) -> None:
    for mode, model in models.items():
        data = pose_of(model, pose)
        for contact in data.contact:
            names = {model.geom(int(geom)).name for geom in contact.geom}
            assert "floor" in names, (mode, names)


@pytest.fixture(scope="module")
def solids(shared_store: str) -> dict[str, manifold3d.Manifold]:
    """The fine mesh of every part except screws, in the frame of the part [m]. The meshes for display are coarser, so that the corners
    of a cell overlap the facets of its tray."""
    store = Store(shared_store)
    by_mesh: dict[str, manifold3d.Manifold] = {}
    found = {}
    for occurrence in thingc.compile(str(ROOT / DOCUMENT), store=shared_store).assembly.occurrences:
        if occurrence.record is None or "screw" in occurrence.path:
            continue
        name = occurrence.record.meshes["mesh"].sha256
        if name not in by_mesh:
            mesh = trimesh.load(io.BytesIO(store.read(name)), file_type="obj")
            raw = manifold3d.Mesh(np.asarray(mesh.vertices, np.float32), np.asarray(mesh.faces, np.uint32))
            raw.merge()
            by_mesh[name] = manifold3d.Manifold(raw)
            assert by_mesh[name].status() == manifold3d.Error.NoError and by_mesh[name].volume() > 0.0, name
        found[occurrence.path] = by_mesh[name]
    assert len(found) == 26
    return found


def nearby(one: tuple[float, ...], other: tuple[float, ...]) -> bool:
    """Return whether two boxes (smallest x, y, z, largest x, y, z [m]) are within a millimetre of each other."""
    return all(one[axis] < other[axis + 3] + 1e-3 and other[axis] < one[axis + 3] + 1e-3 for axis in range(3))


@pytest.mark.parametrize("pose", ["arched", "step_front"])
def test_parts_do_not_overlap(models: dict[str, mujoco.MjModel], solids: dict[str, manifold3d.Manifold], pose: str) -> None:
    placed = sim.parts(models["crawl"], pose_of(models["crawl"], pose))
    there = {part: solid.transform(placed[part][:3]) for part, solid in solids.items()}
    shared = {
        (one, other): (there[one] ^ there[other]).volume() for one, other in combinations(there, 2)
        if nearby(there[one].bounding_box(), there[other].bounding_box()) and there[one].min_gap(there[other], 1e-3) < 1e-3
    }
    assert {pair: volume for pair, volume in shared.items() if volume > TOUCH} == {}
    assert ("front/foot", "front/magnet") in shared  # what is screwed to each other does touch


@pytest.mark.parametrize("joint", ["yaw", "knee", "ankle"])
def test_neighbours_do_not_overlap_in_the_range_of_their_joint(
    models: dict[str, mujoco.MjModel], solids: dict[str, manifold3d.Manifold], joint: str
) -> None:
    """MuJoCo excludes contacts of links that a joint connects, so their exact meshes are compared here."""
    model = models["crawl"]
    link = {part: model.body(int(model.geom(part).bodyid[0])).name for part in solids}
    joined = {"yaw": ("body", "front/hip"), "knee": ("front/hip", "front/thigh"), "ankle": ("front/thigh", "front/foot")}
    parent, child = joined[joint]
    low, high = model.joint(f"front/{joint}").range
    for q in np.linspace(low, high, 9):
        placed = sim.parts(model, sim.at(model, {f"front/{joint}": float(q)}))
        there = {part: solid.transform(placed[part][:3]) for part, solid in solids.items()}
        for one, other in ((a, b) for a in there for b in there if link[a] == parent and link[b] == child):
            assert (there[one] ^ there[other]).volume() < TOUCH, (np.degrees(q), one, other)


def test_collision_pieces_contain_the_parts(minchw: Path, models: dict[str, mujoco.MjModel], solids: dict[str, Any]) -> None:
    """All points that can be touched from outside are inside the collision geometry, to 0.1 mm."""
    model = models["crawl"]
    data = pose_of(model, "stretched")
    placed = sim.parts(model, data)
    touched = {model.geom(g).name.partition(":")[0] for g in range(model.ngeom) if ":collision" in model.geom(g).name}
    inside = {part for part in solids if "cell" in part or "tray" in part}
    assert touched == set(solids) - inside
    lowest = min(float((placed[part] @ np.append(corner, 1))[2]) for part in inside for corner in corners(solids[part]))
    assert lowest * 1000 >= 3.0 - 1e-6  # what does not collide is within the case


def corners(solid: manifold3d.Manifold) -> np.ndarray:
    low, high = np.array(solid.bounding_box()).reshape(2, 3)
    return np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])


def test_crawl_mode_rests_on_the_belly(models: dict[str, mujoco.MjModel]) -> None:
    model = models["crawl"]
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("lying").id)
    mujoco.mj_forward(model, data)
    assert data.site("belly").xpos == pytest.approx([0, 0, 0], abs=1e-12)
    for _ in range(500):
        mujoco.mj_step(model, data)
    assert data.site("belly").xpos == pytest.approx([0, 0, 0], abs=1e-3)
    assert np.abs(data.qvel).max() < 0.02
    assert any("body:collision" in {model.geom(int(g)).name for g in contact.geom} for contact in data.contact)


@pytest.mark.parametrize("where", ["_wall", "_ceiling"])
def test_magnets_hold_the_robot_on_wall_and_ceiling(models: dict[str, mujoco.MjModel], where: str) -> None:
    """In the mode `crawl`, only the two magnets hold the robot. Without them it falls."""
    model = models[f"crawl{where}"]
    for magnets, holds in ((True, True), (False, False)):
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, 0)
        if not magnets:
            for foot in ("front", "rear"):
                data.ctrl[model.actuator(f"{foot}/sole").id] = 0.0
        for _ in range(500):
            mujoco.mj_step(model, data)
        assert (np.linalg.norm(data.site("belly").xpos) < 0.01) == holds, (where, magnets)


@pytest.mark.parametrize("mode", [mode for mode in MODES if "foot" in mode])
def test_one_foot_can_carry_the_stretched_robot(models: dict[str, mujoco.MjModel], mode: str) -> None:
    """The holding torques in the worst pose are below three quarters of the stall torques of the servos, on the floor, the wall and the
    ceiling."""
    model = models[mode]
    data = pose_of(model, "stretched")
    mujoco.mj_inverse(model, data)
    for joint in joints():
        limit = model.actuator(joint).forcerange[1]
        assert abs(data.qfrc_inverse[model.joint(joint).dofadr[0]]) < 0.75 * limit, joint


def test_height_of_the_knees_matches_the_drawing(models: dict[str, mujoco.MjModel]) -> None:
    data = pose_of(models["crawl"], "stretched")
    for leg in ("front", "rear"):
        assert data.joint(f"{leg}/knee").xanchor[2] * 1000 == pytest.approx(AXIS, abs=1e-9)
