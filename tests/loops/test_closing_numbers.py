"""Numerics of closing loops: least squares, rotation vectors, and random robots that must return to a known pose."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from graph.builder import as_matrix, as_pose, assembly, box, component, joint, linked, mimic, mode, rx, t, whole
from robot.test_spanning_tree_properties import Tree, build, robots
from thingc.model.assembly.kinematics import joints_of
from thingc.model.robot.kinematics import body_poses
from thingc.model.robot.least_squares import solve
from thingc.model.robot.loop_solver import Loops, SolverState, orthonormal, rotation_vector
from thingc.model.robot.types import Closure, Robot

numbers = st.floats(-3.0, 3.0, allow_nan=False)


@settings(max_examples=30)
@given(st.integers(1, 8), st.integers(1, 8), st.integers(0, 2**32 - 1))
def test_steps_match_damped_least_squares(n: int, m: int, seed: int) -> None:
    """The oracle is numpy on the stacked system [J; sqrt(lambda) I] x = [-e; 0]."""
    source = np.random.default_rng(seed)
    J, e = source.normal(size=(m, n)), source.normal(size=m)
    damping = 1e-3
    weight = damping * (J**2).sum() / min(n, m)
    stacked = np.vstack([J, math.sqrt(weight) * np.eye(n)])
    expected = np.linalg.lstsq(stacked, np.concatenate([-e, np.zeros(n)]), rcond=None)[0]
    assert solve(J.T.tolist(), e.tolist(), damping) == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_underdetermined_step_has_minimum_norm() -> None:
    source = np.random.default_rng(3)
    J, e = source.normal(size=(3, 7)), source.normal(size=3)
    assert solve(J.T.tolist(), e.tolist(), 1e-14) == pytest.approx(-np.linalg.pinv(J) @ e, rel=1e-9)


def test_redundant_equations_are_solved() -> None:
    """A planar loop has six equations of rank 3."""
    J = np.zeros((6, 4))
    J[[0, 1, 5]] = np.random.default_rng(4).normal(size=(3, 4))
    e = J @ np.array([0.1, -0.2, 0.3, 0.05])
    found = solve(J.T.tolist(), e.tolist(), 1e-12)
    assert found is not None
    assert J @ found == pytest.approx(-e, abs=1e-9)


@settings(max_examples=100)
@given(st.tuples(numbers, numbers, numbers))
def test_rotation_vectors_match_scipy(v: tuple[float, float, float]) -> None:
    r = Rotation.from_rotvec(v)
    rows: Any = tuple(map(tuple, r.as_matrix().tolist()))
    found = rotation_vector(rows)
    assert np.linalg.norm(found) <= math.pi + 1e-12
    assert Rotation.from_rotvec(found).as_matrix() == pytest.approx(r.as_matrix(), abs=1e-12)
    assert np.array(orthonormal(rows)) == pytest.approx(r.as_matrix(), abs=1e-14)


@pytest.mark.parametrize("angle", [1e-300, 1e-12, 1e-6, math.pi - 1e-9, math.pi])
def test_rotation_vectors_near_zero_and_pi(angle: float) -> None:
    axis = np.array([1.0, -2.0, 2.0]) / 3.0
    found = np.array(rotation_vector(tuple(map(tuple, Rotation.from_rotvec(angle * axis).as_matrix().tolist()))))  # type: ignore[arg-type]
    assert np.linalg.norm(found) == pytest.approx(angle, rel=1e-6, abs=1e-15)
    if angle > 1e-300:
        assert abs(found @ axis) == pytest.approx(angle, rel=1e-6)


# --- random trees ----------------------------------------------------------------------------------------------------


def held(robot: Robot, body: int, X_WM: np.ndarray, X_LM: np.ndarray) -> Loops:
    closure = Closure(
        path="mount", hold=True, parent=None, child=body, X_PA=as_pose(X_WM), X_CB=as_pose(X_LM), joints=(), twists=(),
        origin=(),
    )
    return Loops(robot.bodies, (closure,), joints_of(robot.assembly), robot.bodies[0].X_PL)


def state(robot: Robot, q: dict[str, float]) -> SolverState:
    return SolverState(q=q, base=robot.bodies[0].X_PL)


SINGLE = ("revolute", "continuous", "prismatic")
trees = st.builds(build, st.integers(0, 2**32 - 1), st.integers(3, 7), st.just(SINGLE))


@settings(max_examples=20)
@given(trees, st.integers(0, 2**32 - 1))
def test_loop_closes_from_a_nearby_state(tree: Tree, seed: int) -> None:
    """The last body is held at its pose at q. Starting near q (0.1 rad, 10 mm), the loop closes again for any tree."""
    source = np.random.default_rng(seed)
    for robot in list(robots(tree.assembly).values())[:3]:
        body = len(robot.bodies) - 1
        X_LM = np.eye(4)
        X_LM[:3, :3], X_LM[:3, 3] = Rotation.from_rotvec(source.normal(size=3)).as_matrix(), source.normal(size=3) * 0.1
        joints = {joint.path: joint for joint in joints_of(robot.assembly)}
        q = {path: float(np.clip(tree.q.get(path, 0.0), j.limit.lower or -9, j.limit.upper or 9)) for path, j in joints.items()}
        X_WM = as_matrix(body_poses(robot, q)[body]) @ X_LM
        loops = held(robot, body, X_WM, X_LM)
        steps = {path: 0.01 if joint.kind == "prismatic" else 0.1 for path, joint in joints.items()}
        near = {path: value + float(source.uniform(-1.0, 1.0)) * steps[path] for path, value in q.items()}
        solution = loops.close(state(robot, near), None, base_moves=False)
        assert solution.closed, solution.residuals
        reached = as_matrix(body_poses(robot, solution.state.q)[body]) @ X_LM
        assert reached == pytest.approx(X_WM, abs=1e-9)


@pytest.mark.parametrize("multiplier", [-0.5, 2.0])
def test_mimic_is_kept_when_closing(multiplier: float) -> None:
    """Two hinges in a row, the second a mimic of the first: the pose at known angles is found."""
    arm = box("p:Arm", mounts={"near": np.eye(4), "far": t(0.2, 0.0, 0.0) @ rx(0.4)})
    model = assembly(
        "row", [component(name, "p:Arm") for name in ("base", "upper", "lower")],
        [
            joint("lead", "base.far", "upper.near"),
            joint("led", "upper.far", "lower.near", mimic=mimic("lead", multiplier, 0.1)),
        ],
        modes=[mode("m", whole("base"))],
    )
    [robot] = robots(linked(model, arm)).values()
    q = {"lead": 0.6, "led": multiplier * 0.6 + 0.1}
    loops = held(robot, 2, as_matrix(body_poses(robot, q)[2]), np.eye(4))
    solution = loops.close(state(robot, {"lead": 0.0, "led": 0.1}), None, base_moves=False)
    assert solution.closed, solution.residuals
    assert solution.state.q == pytest.approx(q, abs=1e-9)


def test_step_blocked_by_limits_is_damped() -> None:
    """Two slides at their upper limits, 154 degrees apart. Without limits both would exceed them; the best solution moves one back."""
    arm = box("p:Arm", mounts={"near": np.eye(4), "far": rx(0.45)})
    slides = [joint(name, *ends, "prismatic", lower=-0.2, upper=0.0) for name, ends in (
        ("one", ("base.far", "upper.near")), ("other", ("upper.far", "lower.near")),
    )]
    model = assembly("row", [component(name, "p:Arm") for name in ("base", "upper", "lower")], slides, modes=[mode("m", whole("base"))])
    [robot] = robots(linked(model, arm)).values()
    start = {"one": 0.0, "other": 0.0}
    X_WL = as_matrix(body_poses(robot, start)[2])
    directions = np.array([as_matrix(body_poses(robot, start | {name: 1.0})[2])[:3, 3] - X_WL[:3, 3] for name in start]).T
    assert directions.T @ directions == pytest.approx(np.array([[1.0, -np.cos(0.45)], [-np.cos(0.45), 1.0]]))
    # From the target, the body is 20 mm along the first slide and -100 mm along the second.
    target = X_WL.copy()
    target[:3, 3] -= directions @ np.linalg.solve(directions.T @ directions, [0.02, -0.1])
    assert (np.linalg.lstsq(directions, target[:3, 3] - X_WL[:3, 3])[0] > 0.0).all()
    solution = held(robot, 2, target, np.eye(4)).close(state(robot, start), None, base_moves=False)
    assert solution.state.q == pytest.approx({"one": -0.02, "other": 0.0}, abs=1e-6)


@settings(max_examples=13)
@given(trees, st.integers(0, 2**32 - 1))
def test_residual_derivatives_match_finite_differences(tree: Tree, seed: int) -> None:
    """Central differences of the residuals if the loop is closed, and of half their squares if it is open."""
    source = np.random.default_rng(seed)
    robot = next(iter(robots(tree.assembly).values()))
    body = len(robot.bodies) - 1
    X_LM = np.eye(4)
    X_LM[:3, :3], X_LM[:3, 3] = Rotation.from_rotvec(source.normal(size=3)).as_matrix(), source.normal(size=3) * 0.1
    start = {joint.path: 0.0 for joint in joints_of(robot.assembly)}
    loops = held(robot, body, as_matrix(body_poses(robot, start)[body]) @ X_LM, X_LM)
    for q, closed in ((start, True), ({path: float(source.uniform(-0.3, 0.3)) for path in start}, False)):
        error, columns = loops.linearize(state(robot, q))
        p, w = loops.residuals(state(robot, q))[0]
        assert (np.linalg.norm(error[:3]), np.linalg.norm(error[3:])) == pytest.approx((p, w), abs=1e-12)
        assert len(columns) == len(loops.coordinates)
        for coordinate, column in zip(loops.coordinates, columns, strict=True):
            ends = []
            for step in (-1e-6, 1e-6):
                there = {**q, **{path: q[path] + share * step for path, share in coordinate.moves}}
                ends.append(np.array(loops.linearize(state(robot, there))[0]))
            if closed:
                assert (ends[1] - ends[0]) / 2e-6 == pytest.approx(column, abs=1e-6)
            assert (ends[1] @ ends[1] - ends[0] @ ends[0]) / 4e-6 == pytest.approx(np.dot(error, column), abs=1e-6)


@settings(max_examples=13)
@given(trees, st.integers(0, 2**32 - 1))
def test_unreachable_target_matches_scipy_optimum(tree: Tree, seed: int) -> None:
    """The target is about half a metre away. The remaining sum of squares, within limits, is compared with
    `scipy.optimize.least_squares`."""
    source = np.random.default_rng(seed)
    robot = next(iter(robots(tree.assembly).values()))
    body = len(robot.bodies) - 1
    paths = [joint.path for joint in joints_of(robot.assembly)]
    start = dict.fromkeys(paths, 0.0)
    X_WM = as_matrix(body_poses(robot, start)[body])
    X_WM[:3, 3] += source.normal(size=3) * 0.3
    X_WM[:3, :3] = Rotation.from_rotvec(source.normal(size=3) * 0.3).as_matrix() @ X_WM[:3, :3]
    loops = held(robot, body, X_WM, np.eye(4))
    bounds = {c.path: (c.lower, c.upper) for c in loops.coordinates}

    def left(values: np.ndarray) -> np.ndarray:
        at = as_matrix(body_poses(robot, dict(zip(paths, values.tolist())))[body])
        w = Rotation.from_matrix(X_WM[:3, :3].T @ at[:3, :3]).as_rotvec()
        return np.concatenate([at[:3, 3] - X_WM[:3, 3], loops.length * w])

    inside = {path: min(max(0.0, bounds[path][0]), bounds[path][1]) for path in paths}
    solution = loops.close(state(robot, inside), None, base_moves=False)
    ours = sum(p**2 + (loops.length * w) ** 2 for p, w in solution.residuals)
    assert ours == pytest.approx(float((left(np.array([solution.state.q[p] for p in paths])) ** 2).sum()), rel=1e-6, abs=1e-15)
    assert all(bounds[p][0] - 1e-12 <= solution.state.q[p] <= bounds[p][1] + 1e-12 for p in paths)
    polished = least_squares(
        left, [min(max(solution.state.q[p], bounds[p][0] + 1e-9), bounds[p][1] - 1e-9) for p in paths],
        bounds=([bounds[p][0] for p in paths], [bounds[p][1] for p in paths]), xtol=1e-12, ftol=1e-12, gtol=1e-12,
    )
    # Whatever minimum it is, scipy, started there, gains nothing to speak of.
    assert ours <= 2 * polished.cost * 1.001 + 1e-12
