"""`modes.json`: forward kinematics computed from the file alone, compared with the mate graph and with MuJoCo."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm

from emit.small_robot import LIFT, YAW, assembly, request
from thingc.geometry.store.local import Store
from thingc.model.assembly.types import Assembly
from thingc.targets.modes_json import emit

Matrix = NDArray[np.float64]
MODES = ("bench", "drawing", "adrift")


@pytest.fixture
def whole(tmp_path: Path) -> Assembly:
    return assembly(Store(str(tmp_path)))


@pytest.fixture
def modes(whole: Assembly, tmp_path: Path) -> dict[str, Any]:
    files = emit(request(whole, Store(str(tmp_path)))).files
    assert list(files) == ["modes.json"]
    data = files["modes.json"]
    assert isinstance(data, bytes)
    found: dict[str, Any] = json.loads(data)
    return found


def turn(axis: Matrix, angle: float) -> Matrix:
    """Rotation about an axis by Rodrigues' formula."""
    x, y, z = axis
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    X = np.eye(4)
    X[:3, :3] = np.eye(3) + math.sin(angle) * K + (1 - math.cos(angle)) * K @ K
    return X


def shift(along: Matrix) -> Matrix:
    X = np.eye(4)
    X[:3, 3] = along
    return X


def poses_from_mates(whole: Assembly, q: dict[str, float]) -> dict[int, Matrix]:
    """Poses of occurrences in the base, computed from the mate graph."""
    poses = {0: np.eye(4)}
    for mate in whole.mates:
        X = np.array(mate.X_PJ.rows())
        for joint in mate.joints:
            value = q[joint.path] + joint.offset
            z = np.array([0.0, 0.0, 1.0])
            X = X @ (turn(z, value) if joint.kind.name == "revolute" else shift(value * z))
        poses[mate.child] = poses[mate.parent] @ X @ np.array(mate.X_JC.rows())
    return poses


def poses_from_json(mode: dict[str, Any], q: dict[str, float]) -> dict[str, Matrix]:
    """Poses of links in the root link, computed as a reader of the file does."""
    poses = {mode["links"][0]["name"]: np.eye(4)}
    for joint in mode["joints"]:
        X = joint_pose(joint, q)
        poses[joint["child"]] = poses[joint["parent"]] @ (np.linalg.inv(X) if joint["reversed"] else X)
    return poses


def joint_pose(joint: dict[str, Any], q: dict[str, float]) -> Matrix:
    """Pose of the joint's child in its parent, as in the document."""
    X = np.array(joint["X_PJ"])
    for one in joint["coordinates"]:
        hat = np.zeros((4, 4))
        x, y, z = one["angular"]
        hat[:3] = [[0, -z, y, one["linear"][0]], [z, 0, -x, one["linear"][1]], [-y, x, 0, one["linear"][2]]]
        X = X @ expm(hat * (q[one["name"]] + one["offset"]))
    return X @ np.linalg.inv(np.array(joint["X_CJ"]))


@pytest.mark.parametrize("name", MODES)
def test_kinematics_agree_with_the_mate_graph(whole: Assembly, modes: dict[str, Any], name: str) -> None:
    random = np.random.default_rng(3)
    for _ in range(20):
        q = {"yaw": random.uniform(-3, 3), "hand/lift": random.uniform(-0.1, 0.1)}
        mates, links = poses_from_mates(whole, q), poses_from_json(modes[name], q)
        frames = {link.name: mates[link.frame] for link in whole.links}
        assert set(links) == set(frames)
        first = modes[name]["links"][0]["name"]
        for link, found in links.items():
            np.testing.assert_allclose(found, np.linalg.inv(frames[first]) @ frames[link], atol=1e-12)


def mjcf_of(mode: dict[str, Any]) -> mujoco.MjModel:
    """A MuJoCo model built from the file alone: bodies at q = 0 and joints at the given frames."""
    at_zero = {link["name"]: np.array(link["X_root_link"]) for link in mode["links"]}
    by_child = {joint["child"]: joint for joint in mode["joints"]}
    spec = mujoco.MjSpec()
    bodies: dict[str, Any] = {}
    for link in mode["links"]:
        name = link["name"]
        joint = by_child.get(name)
        above = bodies[joint["parent"]] if joint else spec.worldbody
        X = np.linalg.inv(at_zero[joint["parent"]]) @ at_zero[name] if joint else np.eye(4)
        quat = np.empty(4)
        mujoco.mju_mat2Quat(quat, X[:3, :3].flatten())
        body = above.add_body(name=name, pos=X[:3, 3], quat=quat, mass=1.0, inertia=[1, 1, 1], explicitinertial=True)
        bodies[name] = body
        if joint is None:
            if mode["base"] == "free":
                body.add_freejoint(name="root")
            continue
        (one,) = joint["coordinates"]
        kind = {"revolute": mujoco.mjtJoint.mjJNT_HINGE, "prismatic": mujoco.mjtJoint.mjJNT_SLIDE}[joint["kind"]]
        frame = np.array(joint["X_PJ" if joint["reversed"] else "X_CJ"])  # in the tree's child
        axis = frame[:3, :3] @ (np.array(one["angular"]) + one["linear"]) * (-1.0 if joint["reversed"] else 1.0)
        body.add_joint(name=one["name"], type=kind, axis=axis, pos=frame[:3, 3])
    return spec.compile()


@pytest.mark.parametrize("name", MODES)
def test_addresses_and_poses_match_mujoco(whole: Assembly, modes: dict[str, Any], name: str) -> None:
    """A MuJoCo model built from the file has the listed `qpos` and `dof` addresses, and its poses match the mate graph."""
    mode = modes[name]
    model = mjcf_of(mode)
    data = mujoco.MjData(model)
    q = {"yaw": 0.7, "hand/lift": -0.03}
    for joint in mode["joints"]:
        for one in joint["coordinates"]:
            assert one["in_model"] == {one["name"]: 1.0}
            assert one["qpos"] == [model.joint(one["name"]).qposadr[0]]
            assert one["dof"] == [model.joint(one["name"]).dofadr[0]]
            data.qpos[one["qpos"]] = q[one["name"]]
    assert [model.body(k + 1).name for k in range(model.nbody - 1)] == [link["name"] for link in mode["links"]]
    mujoco.mj_kinematics(model, data)
    mates = poses_from_mates(whole, q)
    frames = {link.name: mates[link.frame] for link in whole.links}
    first = mode["links"][0]["name"]
    for link in frames:
        expected = np.linalg.inv(frames[first]) @ frames[link]
        np.testing.assert_allclose(data.body(link).xpos, expected[:3, 3], atol=1e-12)
        np.testing.assert_allclose(data.body(link).xmat.reshape(3, 3), expected[:3, :3], atol=1e-12)


def test_mode_entries_are_complete(modes: dict[str, Any]) -> None:
    """Every mode has the expected keys, root, base, poses and joint directions."""
    assert list(modes) == ["bench", "drawing", "adrift"]
    assert {name: (mode["root"], mode["base"], mode["links"][0]["name"]) for name, mode in modes.items()} == {
        "bench": ("plate/origin", "fixed", "base"), "drawing": ("hand/palm/origin", "held", "palm"),
        "adrift": ("servo_a/origin", "free", "servo_a"),
    }
    for mode in modes.values():
        assert list(mode) == ["version", "root", "base", "gravity", "X_world_root", "links", "joints", "holds", "poses"]
        assert mode["gravity"] == [0.0, 0.0, -9.81]
        assert mode["holds"] == {}
        assert list(mode["poses"].items()) == [
            ("start", {"yaw": -0.5, "hand/lift": 0.02}), ("home", {"yaw": 1.0, "hand/lift": 0.0}),
        ]
        for joint in mode["joints"]:
            assert list(joint) == ["name", "kind", "parent", "child", "reversed", "X_PJ", "X_CJ", "coordinates"]
            (one,) = joint["coordinates"]
            assert list(one) == ["name", "angular", "linear", "offset", "armature", "mimic", "in_model", "qpos", "dof"]
            assert one["offset"] == {"yaw": YAW.offset, "hand/lift": LIFT.offset}[one["name"]]
    reversed_ = {name: {joint["name"]: joint["reversed"] for joint in mode["joints"]} for name, mode in modes.items()}
    assert reversed_ == {
        "bench": {"yaw": False, "hand/lift": False}, "drawing": {"yaw": True, "hand/lift": True},
        "adrift": {"yaw": True, "hand/lift": False},
    }
