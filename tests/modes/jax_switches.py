"""Mode switches in JAX equal those in numpy, which other tests compare with MuJoCo."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from loops.robots import compiled
from modes.switching_robots import random_robot
from modes.test_held_twice import chain, four_bar
from modes.test_part_bases import PUCK
from modes.test_random_trees import random_tree
from thingc.modes import Mode, Modes, ModesError
from thingc.modes.frames import RANK, back_substitute, half_solve, pose, rotation_of, smallest_solution
from thingc.modes.jax import State, switch

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("in_double_precision")]
WORLDS = 6


@pytest.fixture(scope="module")
def robots(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Modes]:
    def made(name: str) -> Modes:
        if name in DOCUMENTS:
            return Modes.parse(compiled(tmp_path_factory.mktemp(name), DOCUMENTS[name]).text("modes.json"))
        return {"mimics": lambda: random_robot(5, mimics=True), "chain": chain, "bars": lambda: four_bar("revolute")}[name]().modes

    return lru_cache(made)


DOCUMENTS = {"balls": random_tree(1)[0], "puck": PUCK}


def states(mode: Mode, seed: int = 1) -> State:
    """Random states of several worlds in the mode. The base moves only if it can. If loops are cut, they are nearly closed."""
    rng, count = np.random.default_rng(seed), len(mode.coordinates)
    start = mode.arrays(mode.state(next(iter(mode.named), None)))
    poses = np.array([pose(rotation_of(rng.normal(size=4)), rng.normal(size=3)) for _ in range(WORLDS)])
    if mode.part is not None:
        poses = np.array([mode.part.nearest(X) for X in poses])
    twists = np.array([
        mode.part.twist(X, rng.normal(size=3)) if mode.part else rng.normal(size=6) * (mode.base == "free") for X in poses
    ])
    q = start.q + rng.uniform(-1, 1, (WORLDS, count)) * (1e-3 if mode.cuts else 0.7)
    return State(poses, twists, q, rng.normal(size=(WORLDS, count)))


CASES = [
    ("mimics", "free_0", "held_5", "impact"), ("chain", "float", "bridge", "impact"), ("chain", "near", "pinned", "impact"),
    ("bars", "ground_free", "crank_held", "impact"), ("balls", "loose", "last", "impact"), ("balls", "first", "loose", "drop"),
    ("puck", "loose", "sled", "impact"), ("puck", "gimbal", "loose", "drop"),
]


@pytest.mark.parametrize(("robot", "old", "new", "on_motion"), CASES)
def test_vectorized_switch_equals_single_switches(
    robots: Callable[[str], Modes], robot: str, old: str, new: str, on_motion: str,
) -> None:
    modes = robots(robot)
    one, other, given = modes[old], modes[new], states(modes[old])
    together = jax.jit(jax.vmap(lambda state: switch(state, one, other, on_motion, tolerance=9.0)))  # type: ignore[arg-type]
    found, removed, impulses = together(given)
    rows = np.array([other.coordinates.index(joint.name) for joint in other.joints])
    for world in range(WORLDS):
        state = one.robot_state(State(*(values[world] for values in given)))
        expected = modes.switch(state, new, on_motion=on_motion, tolerance=9.0)  # type: ignore[arg-type]
        own = other.arrays(expected.state)
        scale = np.linalg.cond(other.mass_matrix(expected.state)) if on_motion == "impact" else 1.0
        np.testing.assert_allclose(found.base[world], own.base, rtol=0, atol=1e-13 * 10)
        np.testing.assert_allclose(found.q[world][rows], own.q[rows], rtol=0, atol=1e-13)
        np.testing.assert_allclose(found.twist[world], own.twist, rtol=0, atol=1e-13 * scale)
        np.testing.assert_allclose(found.v[world][rows], own.v[rows], rtol=0, atol=1e-13 * scale)
        cut = np.setdiff1d(np.arange(len(own.q)), rows)
        for values, before in ((found.q, given.q), (found.v, given.v)):
            assert (np.asarray(values[world])[cut] == before[world][cut]).all()
        np.testing.assert_allclose(removed[world], expected.removed, rtol=0, atol=1e-13 * 10)
        np.testing.assert_allclose(impulses[world], expected.impulse, rtol=0, atol=1e-13 * scale)
    moved = impulses if on_motion == "impact" else removed if modes[new].base != "free" else found.twist
    assert np.abs(moved).max() > 1e-3


def equations(rows: int, columns: int, dtype: str = "float64") -> tuple[np.ndarray, np.ndarray]:
    """Consistent equations A x = b with a well-conditioned matrix of every rank, and with equations that are 0, repeated or scaled."""
    rng = np.random.default_rng(rows + 100 * columns)
    matrices = []
    for rank in range(min(rows, columns) + 1):
        bases = [np.linalg.qr(rng.normal(size=(size, size)))[0][:, :rank] for size in (rank, columns)]
        independent = bases[0] * rng.uniform(1.0, 3.0, rank) @ bases[1].T
        for first in range(2):  # the first equations are dependent, or the last ones
            others = np.resize(0.5 * independent, (rows - rank, columns)) if rank else np.zeros((rows, columns))
            others[:1] = 0.0
            matrices.append(np.concatenate([others, independent][:: -1 if first else 1]))
    A = np.array(matrices, dtype)
    return A, (A @ rng.normal(size=(len(A), columns, 1)))[:, :, 0].astype(dtype)


@pytest.mark.parametrize(("rows", "columns"), [(3, 5), (6, 4)])
def test_smallest_solution_for_every_rank(rows: int, columns: int) -> None:
    """The solutions equal those of numpy's `lstsq`. Derivatives along matrices of the same rank equal finite differences."""
    A, b = equations(rows, columns)
    solve = jax.jit(jax.vmap(lambda A, b: smallest_solution(A, b, jnp)))
    expected = np.array([np.linalg.lstsq(*pair, rcond=RANK)[0] for pair in zip(A, b, strict=True)])
    assert np.abs(solve(A, b) - expected).max() <= 1e-13 * np.abs(expected).max()
    change, x = np.random.default_rng(1).normal(size=(2, columns, columns)) * [[[0.1]], [[1.0]]]

    def moved(t: object) -> object:
        turned = A @ (jnp.eye(columns) + t * jnp.asarray(change))
        return solve(turned, turned @ x[0])

    ahead, behind = (
        np.array([np.linalg.lstsq(one, one @ x[0], rcond=RANK)[0] for one in A @ (np.eye(columns) + t * change)]) for t in (1e-5, -1e-5)
    )
    np.testing.assert_allclose(jax.jit(jax.jacfwd(moved))(0.0), (ahead - behind) / 2e-5, rtol=0, atol=1e-8)
    slope = jax.jit(jax.grad(lambda t: moved(t).sum()))(0.0)
    assert slope == pytest.approx((ahead - behind).sum() / 2e-5, abs=1e-7)


def test_smallest_solution_in_single_precision() -> None:
    """Rounding errors are not mistaken for independent equations."""
    jax.config.update("jax_enable_x64", False)
    A, b = equations(6, 4, "float32")
    found = jax.jit(jax.vmap(lambda A, b: smallest_solution(A, b, jnp)))(A, b)
    expected = [np.linalg.lstsq(*pair, rcond=1e-4)[0] for pair in zip(A, b, strict=True)]
    assert found.dtype == "float32" and np.abs(found - np.array(expected)).max() < 1e-4


def test_nearly_dependent_equations_are_satisfied() -> None:
    """The residuals stay small although the coordinates along the last equation are computed with an error of 1e-8."""
    A = np.random.default_rng(1).normal(size=(3, 6))
    A[2] = A[0] - A[1] + 1e-8 * A[2]
    b = A @ np.ones(6)
    x = jax.jit(lambda A, b: smallest_solution(A, b, jnp))(A, b)
    assert np.abs(A @ np.asarray(x) - b).max() < 1e-14


def test_positive_definite_system_is_solved_in_two_halves() -> None:
    root, right = np.split(np.random.default_rng(1).normal(size=(7, 10)), [7], axis=1)
    A = root @ root.T + np.eye(7)

    @jax.jit
    def solve(A: object, right: object) -> object:
        U, Y = half_solve(A, right, jnp)  # type: ignore[arg-type]
        return U, back_substitute(U, Y[:, 1], jnp)

    U, x = solve(A, right)
    np.testing.assert_allclose(U, np.linalg.cholesky(A).T, rtol=0, atol=1e-13)
    np.testing.assert_allclose(x, np.linalg.solve(A, right[:, 1]), rtol=0, atol=1e-13)


def test_switch_is_differentiable() -> None:
    """The derivative of the velocity after an impact by a joint equals a finite difference, also with joints at 0."""
    modes = random_robot(3, mimics=True).modes
    one, other = modes["free_0"], modes["held_0"]
    state = one.arrays(one.state(base_twist=[0.3, -0.2, 0.5, 0.4, 0.1, -0.7]))

    def speed(x: object) -> object:
        return switch(state._replace(q=jnp.asarray(state.q).at[0].add(x)), one, other, "impact")[0].v

    slope = jax.jit(jax.jacfwd(speed))(0.0)
    compiled_speed = jax.jit(speed)
    difference = np.asarray(compiled_speed(1e-5) - compiled_speed(-1e-5)) / 2e-5  # type: ignore[operator]
    assert np.asarray(slope) == pytest.approx(difference, abs=1e-7) and np.abs(difference).max() > 1e-3


def test_switch_with_displaced_base_is_nan() -> None:
    modes = chain().modes
    near, bolted = modes["near"], modes["bolted"]
    bent = modes.switch(modes["bolted"].state("bent"), "near").state
    switched = jax.jit(lambda state: switch(state, near, bolted)[0])
    there = switched(near.arrays(bent))
    assert not np.isnan(np.concatenate([np.ravel(one) for one in there])).any()
    assert np.asarray(there.q) == pytest.approx(near.arrays(bent).q)
    away = near.arrays(bent)
    for elsewhere in (away._replace(base=pose(away.base[:3, :3], away.base[:3, 3] + 1e-3)), away._replace(q=away.q + 0.01)):
        assert all(np.isnan(one).all() for one in switched(elsewhere))


def test_single_precision_is_kept() -> None:
    jax.config.update("jax_enable_x64", False)
    modes = random_robot(3).modes
    free, held = modes["free_0"], modes["held_0"]
    state = free.arrays(free.state(base_twist=[0.3, -0.2, 0.5, 0.4, 0.1, -0.7]))
    found = jax.jit(lambda given: switch(given, free, held, "impact")[0])(state)
    assert {str(one.dtype) for one in found} == {"float32"}
    expected = held.arrays(modes.switch(free.robot_state(state), "held_0", on_motion="impact").state)
    assert np.asarray(found.v) == pytest.approx(expected.v, abs=1e-4)


def test_unknown_on_motion_is_rejected() -> None:
    modes = random_robot(3).modes
    free = modes["free_0"]
    with pytest.raises(ModesError, match='expected on_motion "drop" or "impact", found `raise`'):
        jax.eval_shape(lambda state: switch(state, free, free, "raise"), free.arrays(free.state()))  # type: ignore[arg-type]
