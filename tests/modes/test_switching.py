"""Random robots switched from any mode to any other: MuJoCo reports equal poses and velocities of all bodies."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from modes.switching_robots import Made, bodies, jacobian, joints_of, mass_matrix, random_robot, same_motion, stir
from thingc.modes import BaseElsewhere, BaseMoves

pytestmark = pytest.mark.slow

seeds = st.integers(0, 2**32 - 1)
few = settings(max_examples=5)


def of(made: Made, base: str) -> list[str]:
    return [name for name, mode in made.modes.items() if mode.base == base]


def assert_close(one: object, other: object) -> None:
    np.testing.assert_allclose(one, other, rtol=0, atol=1e-12)


@few
@given(seeds)
def test_link_kinematics_match_mujoco(seed: int) -> None:
    made, rng = random_robot(seed), np.random.default_rng(seed)
    for name, mode in made.modes.items():
        data = stir(rng, made.data(name))
        state = made.modes.read(name, data)
        seen, poses, twists = bodies(data), mode.poses(state), mode.twists(state)
        assert list(poses) == list(twists) == [data.model.body(k).name for k in range(1, data.model.nbody)]
        for link, (X, velocity) in seen.items():
            assert_close(poses[link], X)
            assert_close(twists[link], np.concatenate([velocity[:3], X[:3, :3].T @ velocity[3:]]))
        expected = data.qpos.copy()
        if mode.base == "free":  # any length and either sign is the same turn
            expected[3:7] *= np.sign(expected[3:7] @ mode.qpos(state)[3:7]) / np.linalg.norm(expected[3:7])
        assert_close(mode.qpos(state), expected)
        assert (mode.qvel(state) == data.qvel).all()


@few
@given(seeds)
def test_mass_matrix_matches_mujoco(seed: int) -> None:
    made, rng = random_robot(seed), np.random.default_rng(seed)
    for name, mode in made.modes.items():
        data = stir(rng, made.data(name))
        state = made.modes.read(name, data)
        expected = mass_matrix(data)
        for inertias in (None, made.modes.inertias(name, data)):
            found = mode.mass_matrix(state, inertias)
            own = slice(0 if mode.base == "free" else 6, None)
            assert np.allclose(found[own, own], expected, rtol=1e-9, atol=1e-12)


@few
@given(seeds)
def test_switch_to_free_base_keeps_the_motion(seed: int) -> None:
    made, rng = random_robot(seed), np.random.default_rng(seed)
    for source in made.modes:
        for target in of(made, "free"):
            one, other = stir(rng, made.data(source)), stir(rng, made.data(target))
            one.time, one.ctrl[:] = 1.25, 0.5
            switched = made.modes.switch((source, one), (target, other))
            same_motion(one, other)
            assert other.time == 1.25
            assert not switched.removed.any() and not switched.impulse.any()


@few
@given(seeds)
def test_round_trip_restores_the_state(seed: int) -> None:
    """From a held, free or fixed base with moving joints into a free base at another link, and back: the old base is at rest."""
    made, rng = random_robot(seed), np.random.default_rng(seed)
    for source in [*of(made, "held"), *of(made, "free"), *of(made, "fixed")]:
        for target in of(made, "free"):
            one, other, back = stir(rng, made.data(source)), made.data(target), made.data(source)
            made.modes.switch((source, one), (target, other))
            switched = made.modes.switch((target, other), (source, back))
            if made.modes[source].base != "free":
                assert np.abs(switched.removed).max() < 1e-12, "what the base could not keep is rounding"
            same_motion(one, back)
            assert np.array_equal(one.qvel[-len(switched.state.v) :], back.qvel[-len(switched.state.v) :])


@few
@given(seeds)
def test_held_bases_can_be_entered_at_rest(seed: int) -> None:
    made, rng = random_robot(seed), np.random.default_rng(seed)
    for source in made.modes:
        for target in of(made, "held"):
            one, other = stir(rng, made.data(source), moving=False), stir(rng, made.data(target))
            made.modes.switch((source, one), (target, other))
            same_motion(one, other)


@few
@given(seeds)
def test_fixed_base_requires_its_place(seed: int) -> None:
    made, rng = random_robot(seed), np.random.default_rng(seed)
    for target in of(made, "fixed"):
        standing = stir(rng, made.data(target))
        for source in of(made, "free"):
            one, other = made.data(source), stir(rng, made.data(target))
            made.modes.switch((target, standing), (source, one))
            made.modes.switch((source, one), (target, other))
            same_motion(standing, other)
            one.qpos[:3] += [0.3, 0.0, -0.4]
            before = other.qpos.copy(), other.qvel.copy()
            with pytest.raises(BaseElsewhere) as refused:
                made.modes.switch((source, one), (target, other))
            assert refused.value.distance == pytest.approx(0.5, abs=1e-9) and refused.value.angle < 1e-7
            assert (other.qpos == before[0]).all() and (other.qvel == before[1]).all(), "nothing is written"
            made.modes.switch((source, one), (target, other), tolerance=0.51)
            assert joints_of(other) == joints_of(one)


@few
@given(seeds)
def test_switch_to_a_moving_held_base(seed: int) -> None:
    """By default it is an error. `drop` keeps the joint velocities. `impact` projects the velocity with MuJoCo's mass matrix."""
    made, rng = random_robot(seed), np.random.default_rng(seed)
    for source in of(made, "free"):
        for target in of(made, "held"):
            one, other = stir(rng, made.data(source)), stir(rng, made.data(target))
            link = made.modes[target].root_link
            X, velocity = bodies(one)[link]
            twist = np.concatenate([velocity[:3], X[:3, :3].T @ velocity[3:]])
            before = other.qpos.copy(), other.mocap_pos.copy()
            with pytest.raises(BaseMoves) as refused:
                made.modes.switch((source, one), (target, other))
            assert_close(refused.value.twist, twist)
            assert (other.qpos == before[0]).all() and (other.mocap_pos == before[1]).all(), "nothing is written"

            dropped = made.modes.switch((source, one), (target, other), on_motion="drop")
            assert_close(dropped.removed, twist)
            assert not dropped.impulse.any() and not dropped.state.base_twist.any()
            assert joints_of(other) == joints_of(one)
            assert_close(bodies(other)[link][0], X)

            caught = made.modes.switch((source, one), (target, other), on_motion="impact")
            assert_close(caught.removed, twist)
            M, J = mass_matrix(one), jacobian(one, link)
            taken = np.linalg.solve(J @ np.linalg.solve(M, J.T), -J @ one.qvel)
            after = one.qvel + np.linalg.solve(M, J.T @ taken)
            names = {one.model.joint(k).name: one.model.jnt_dofadr[k] for k in range(1, one.model.njnt)}
            scale = np.abs(one.qvel).max() * np.linalg.cond(M)
            for name, (q, v) in joints_of(other).items():
                assert q == joints_of(one)[name][0]
                assert v == pytest.approx(after[names[name]], abs=1e-13 * scale)
            impulse = np.concatenate([caught.impulse[:3], X[:3, :3] @ caught.impulse[3:]])
            assert impulse == pytest.approx(taken, rel=1e-9, abs=1e-13 * scale)
            assert np.abs(bodies(other)[link][1]).max() == 0.0


@few
@given(seeds)
def test_impact_conserves_momentum(seed: int) -> None:
    """For all bodies together, without rotors behind gears: the lost linear and angular momentum is the impulse on the root link, and
    the lost energy is that of the lost velocity (Carnot)."""
    made, rng = random_robot(seed), np.random.default_rng(seed)
    for model in made.models.values():
        model.dof_armature[:] = 0.0
    source, target = of(made, "free")[0], of(made, "held")[-1]
    one, other, free = stir(rng, made.data(source)), made.data(target), of(made, "free")[-1]
    switched = made.modes.switch((source, one), (target, other), on_motion="impact")
    after, difference = made.data(free), made.data(free)
    made.modes.switch(switched.state, (free, after))
    before = made.modes.read(free, _switch_into(made, (source, one), free))
    made.modes.write(made.modes[free].state(
        q=before.q, base_pose=before.base_pose, base_twist=before.base_twist - switched.state.base_twist,
        v={name: before.v[name] - switched.state.v[name] for name in before.v},
    ), difference)
    linear, angular, energy = _momenta(one)
    linear_after, angular_after, energy_after = _momenta(after)
    X = switched.state.base_pose
    impulse, moment = switched.impulse[:3], X[:3, :3] @ switched.impulse[3:]
    scale = 1 + np.abs(one.qvel).max() * float(one.model.body_mass.sum())
    assert linear + impulse == pytest.approx(linear_after, abs=1e-11 * scale)
    assert angular + moment + np.cross(X[:3, 3], impulse) == pytest.approx(angular_after, abs=1e-11 * scale)
    assert energy - energy_after == pytest.approx(_momenta(difference)[2], rel=1e-9, abs=1e-11 * scale**2)
    assert energy > energy_after


def _switch_into(made: Made, source: tuple[str, mujoco.MjData], target: str) -> mujoco.MjData:
    data = made.data(target)
    made.modes.switch(source, (target, data))
    return data


def _momenta(data: mujoco.MjData) -> tuple[np.ndarray, np.ndarray, float]:
    """Linear and angular momentum (about the world's origin) and kinetic energy, summed over bodies."""
    model = data.model
    mujoco.mj_forward(model, data)
    linear, angular, energy = np.zeros(3), np.zeros(3), 0.0
    for body in range(1, model.nbody):
        velocity = np.zeros(6)
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_BODY, body, velocity, 0)
        w, v = velocity[:3], velocity[3:]
        R = data.ximat[body].reshape(3, 3)
        spin = R @ np.diag(model.body_inertia[body]) @ R.T @ w
        linear += model.body_mass[body] * v
        angular += spin + np.cross(data.xipos[body], model.body_mass[body] * v)
        energy += (model.body_mass[body] * v @ v + w @ spin) / 2
    return linear, angular, energy


@few
@given(seeds)
def test_impact_keeps_mimic_constraints(seed: int) -> None:
    """The same projection with one constraint per mimic: v - k v_leader = 0, where k is the slope of the polynomial at the leader's
    position."""
    made, rng = random_robot(seed, mimics=True), np.random.default_rng(seed)
    source, target = of(made, "free")[0], of(made, "held")[-1]
    one, other = stir(rng, made.data(source)), made.data(target)
    model = one.model
    dof = {model.joint(k).name: int(model.jnt_dofadr[k]) for k in range(1, model.njnt)}
    rows: list[np.ndarray] = []
    slope: dict[str, float] = {}
    for joint in made.modes[source].joints:
        if joint.mimic is not None:
            square, cube = joint.mimic.higher
            x = float(one.joint(joint.mimic.joint).qpos[0])
            slope[joint.name] = joint.mimic.multiplier + 2.0 * square * x + 3.0 * cube * x**2
            one.qvel[dof[joint.name]] = slope[joint.name] * one.qvel[dof[joint.mimic.joint]]
            row = np.zeros(model.nv)
            row[dof[joint.name]], row[dof[joint.mimic.joint]] = 1.0, -slope[joint.name]
            rows.append(row)
    made.modes.switch((source, one), (target, other), on_motion="impact")
    M = mass_matrix(one)
    C = np.vstack([jacobian(one, made.modes[target].root_link), *rows])
    after = one.qvel - np.linalg.solve(M, C.T @ np.linalg.solve(C @ np.linalg.solve(M, C.T), C @ one.qvel))
    for name, (_, v) in joints_of(other).items():
        assert v == pytest.approx(after[dof[name]], abs=1e-13 * np.abs(one.qvel).max() * np.linalg.cond(M))
    for joint in made.modes[target].joints:
        if joint.mimic is not None:
            found = joints_of(other)
            assert found[joint.name][1] == pytest.approx(slope[joint.name] * found[joint.mimic.joint][1], abs=1e-11)


@few
@given(seeds)
def test_joint_accelerations_are_equal_after_a_switch(seed: int) -> None:
    """In another mode with a free base, equal gravity and torques give equal qacc of the joints."""
    made, rng = random_robot(seed), np.random.default_rng(seed)
    free = of(made, "free")
    one, other = stir(rng, made.data(free[0])), made.data(free[-1])
    torque = {name: float(rng.normal()) for name in joints_of(one)}
    made.modes.switch((free[0], one), (free[-1], other))
    for data in (one, other):
        data.model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_LIMIT)
        for name, value in torque.items():
            data.joint(name).qfrc_applied = value
        mujoco.mj_forward(data.model, data)
    scale = np.abs(one.qacc).max() * np.linalg.cond(mass_matrix(one))
    for name in torque:
        assert one.joint(name).qacc[0] == pytest.approx(other.joint(name).qacc[0], abs=1e-13 * scale)
