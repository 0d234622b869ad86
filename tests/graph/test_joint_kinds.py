"""Kinds of joints: motions and velocities, compared with matrices, matrix exponentials and finite differences."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import expm

from graph.builder import LEAD, Array, as_matrix, as_pose, inv, motion, rx, ry, rz, t
from thingc.base.joints.kinds import KINDS, JointKind
from thingc.base.joints.twist import Twist, pose_after, velocities

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


def test_only_fixed_joints_do_not_move() -> None:
    """Coordinates and limits of each kind are in the table of `docs/language/joints.md`, which `tests/docs` compares with the code."""
    assert [name for name, kind in KINDS.items() if not kind.moves] == ["fixed"]


@pytest.mark.parametrize("kind", [kind for kind in KINDS.values() if not kind.at_once], ids=lambda kind: kind.name)
@pytest.mark.parametrize("q", [-2.5, 0.0, 0.3, math.pi / 2])
def test_motion_matches_matrices(kind: JointKind, q: float) -> None:
    """The oracle is `motion` of the builder."""
    values = (q, 0.1, -0.3)[: len(kind.twists)]
    twists = kind.with_lead(LEAD) if kind.leads else kind.twists
    assert as_matrix(pose_after(twists, values)) == pytest.approx(motion(kind.name, *values))


def test_coordinates_are_shown_in_common_units() -> None:
    assert KINDS["revolute"].twists[0].format(math.radians(-150)) == "-150 deg"
    assert KINDS["prismatic"].twists[0].format(0.0205) == "20.5 mm"


def twists() -> list[Twist]:
    """Rotations, translations and screws about the coordinate axes and about general lines."""
    rng = np.random.default_rng(5)
    unit = rng.normal(size=3)
    unit /= np.linalg.norm(unit)
    wx, wy, wz = map(float, unit)
    px, py, pz = map(float, rng.uniform(-1, 1, 3))
    axis, point = (wx, wy, wz), (px, py, pz)
    return [
        Twist(angular=X), Twist(angular=Y), Twist(angular=Z), Twist(linear=Z), Twist(linear=axis), Twist(angular=axis),
        Twist(angular=axis, anchor=point), Twist(angular=axis, anchor=point, linear=(0.3 * wx, 0.3 * wy, 0.3 * wz)),
        Twist(angular=Z, linear=(0.0, 0.0, -0.0013)),
    ]


def hat(twist: Twist) -> Array:
    """The 4 x 4 matrix of a twist. Its linear part is the velocity of the frame's origin."""
    w, v, p = (np.array(part) for part in (twist.angular, twist.linear, twist.anchor))
    found = np.zeros((4, 4))
    found[:3, :3] = [[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]]
    found[:3, 3] = v - np.cross(w, p)
    return found


@pytest.mark.parametrize("q", [-2.5, 1e-9, 0.3, math.pi / 2, 3.1])
def test_twist_exponential_matches_scipy(q: float) -> None:
    """The oracle is `scipy.linalg.expm`."""
    for twist in twists():
        assert np.abs(as_matrix(twist.exponential(q)) - expm(hat(twist) * q)).max() < 4e-15


def test_axis_rotations_are_exact() -> None:
    """Rotations about x, y and z equal the plain rotation matrix bit by bit."""
    for q in np.random.default_rng(1).uniform(-7, 7, 200):
        c, s = math.cos(q), math.sin(q)
        assert Twist(angular=Z).exponential(q).rotation == ((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0))
        assert Twist(angular=X).exponential(q).rotation == ((1.0, 0.0, 0.0), (0.0, c, -s), (0.0, s, c))
        assert Twist(angular=Y).exponential(q).rotation == ((c, 0.0, s), (0.0, 1.0, 0.0), (-s, 0.0, c))


def test_twist_velocity_reversal_and_frame_change() -> None:
    X_AB = t(0.2, -0.7, 0.4) @ rz(0.3) @ ry(-1.2) @ rx(2.0)
    point = np.array([0.4, 0.1, -0.3, 1.0])
    for twist in twists():
        linear, angular = twist.velocity((0.4, 0.1, -0.3))
        assert np.array(linear) == pytest.approx((hat(twist) @ point)[:3], abs=1e-15)
        assert angular == twist.angular
        assert hat(twist.seen_from(as_pose(X_AB))) == pytest.approx(X_AB @ hat(twist) @ inv(X_AB), abs=1e-15)
        back = twist.exponential(0.8) @ twist.inverse().exponential(0.8)
        assert as_matrix(back) == pytest.approx(np.eye(4), abs=1e-15)


@pytest.mark.parametrize("size", [0.0, 1e-9, 1e-3, 0.009999, 0.010001, 0.4, math.pi, 5.0])
def test_ball_uses_a_rotation_vector(size: float) -> None:
    """The pose of a ball is the exponential of its rotation vector, and the velocities equal finite differences."""
    twists, r = KINDS["ball"].twists, size * np.array([0.48, -0.6, 0.64])
    w = np.cross(np.eye(3), r)  # [r]x
    turn = np.eye(4)
    turn[:3, :3] = expm(w)
    pose = pose_after(twists, (r[0], r[1], r[2]), at_once=True)
    assert as_matrix(pose) == pytest.approx(turn, abs=1e-14)
    for number, twist in velocities(twists, (r[0], r[1], r[2]), pose, at_once=True):
        step = np.zeros(3)
        step[number] = 1e-6
        ahead, behind = (as_matrix(pose_after(twists, (q[0], q[1], q[2]), at_once=True)) for q in (r + step, r - step))
        spin = ((ahead - behind) / 2e-6 @ inv(turn))[:3, :3]
        assert twist.angular == pytest.approx((spin[2, 1], spin[0, 2], spin[1, 0]), abs=1e-9)
        assert twist.velocity((0.1, 0.2, 0.3))[0] == pytest.approx(spin @ (0.1, 0.2, 0.3), abs=1e-9)


@pytest.mark.parametrize("back", [False, True])
@pytest.mark.parametrize("size", [0.0, 1e-3, 0.4, 3.0])
def test_free_joint_translates_before_rotating(size: float, back: bool) -> None:
    """In a tree that traverses the joint from child to parent, the motion is the inverse."""
    r = size * np.array([0.3, 0.2, -0.7, 0.48, -0.6, 0.64])
    turn, slide = np.eye(4), np.eye(4)
    turn[:3, :3], slide[:3, 3] = expm(np.cross(np.eye(3), r[3:])), r[:3]
    twists = KINDS["free"].twists
    twists = tuple(twist.inverse() for twist in twists[::-1]) if back else twists

    def at(q: Array) -> Array:
        return as_matrix(pose_after(twists, tuple(map(float, q[::-1] if back else q)), at_once=True))

    assert at(r) == pytest.approx(inv(slide @ turn) if back else slide @ turn, abs=1e-14)
    order = range(5, -1, -1) if back else range(6)
    values = tuple(float(r[k]) for k in order)
    for number, twist in velocities(twists, values, as_pose(at(r)), at_once=True):
        step = np.eye(6)[order[number]] * 1e-6
        rate = (at(r + step) - at(r - step)) / 2e-6 @ inv(at(r))
        assert hat(twist) == pytest.approx(rate, abs=1e-8)
