"""A perfectly inelastic catch of two bodies, compared with textbook formulas."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pytest

from graph.builder import Array, assembly, box, component, joint, linked, mode, whole
from modes.switching_robots import Made, bodies, emitted
from thingc.base.diagnostics import Code
from thingc.modes import Inertias

SIZES = ((0.3, 0.1, 0.05), (0.2, 0.08, 0.06))
MASSES = tuple(1000.0 * math.prod(size) for size in SIZES)
ARM = 0.15
"""Distance from the joint to the centre of the other body [m]."""


def pair(kind: str, armature: float = 0.0) -> Made:
    """Two boxes: `one`, with its origin on the joint, and `two`, with its centre at `ARM` along its x.

    The joint axis is z of `one`, and at q = 0 the two frames are parallel. Either can be held."""
    mounts_one: dict[str, Array] = {"a": np.eye(4)}
    # the mate turns z over: with its own z down and its x and y so that the frames come out parallel
    mate = np.array([[0.0, -1, 0, 0], [-1, 0, 0, 0], [0, 0, -1, 0], [0, 0, 0, 1]])
    modes = [mode(f"{base}_{name}", whole(name), base) for name in ("one", "two") for base in ("free", "held")]
    return emitted(linked(
        assembly(
            "pair", [component("one", "p:One"), component("two", "p:Two")],
            [joint("j", "one.a", "two.b", kind, lower=-9, upper=9, armature=armature)], modes=modes,
        ),
        box("p:One", SIZES[0], centre=(0.02, -0.01, 0.03), mounts=mounts_one),
        box("p:Two", SIZES[1], centre=(ARM, 0.0, 0.0), mounts={"b": mate}),
        but={Code.FAR},  # the joint is not to meet its stops
    ))


def about_z(k: int) -> float:
    """Moment of inertia about z: m (a^2 + b^2) / 12."""
    return MASSES[k] * (SIZES[k][0] ** 2 + SIZES[k][1] ** 2) / 12


@pytest.mark.parametrize("armature", [0.0, 0.02])
@pytest.mark.parametrize("q", [0.0, 0.7, -2.0])
def test_pendulum_caught_at_its_pivot(armature: float, q: float) -> None:
    """`one` moves in the plane with velocity V of the joint and angular velocity w; `two` has w + v. The catch stops `one`. No moment
    about the joint acts on `two`, so its angular momentum about the joint is conserved: (I + m l^2 + A) v' = I (w + v) + m l x (V +
    (w + v) x l) + A v, where A is the rotor behind the gears, which turns only with v."""
    made = pair("revolute", armature)
    V, w, v = np.array([0.4, -1.1, 0.0]), 2.5, -0.8
    state = made.modes["free_one"].state(q={"j": q}, v={"j": v}, base_twist=[*V, 0, 0, w])
    data = made.data("held_one")
    switched = made.modes.switch(state, ("held_one", data), on_motion="impact")
    lever = ARM * np.array([math.cos(q), math.sin(q), 0.0])
    before = V + np.cross([0, 0, w + v], lever)
    swing = about_z(1) * (w + v) + MASSES[1] * np.cross(lever, before)[2]
    expected = (swing + armature * v) / (about_z(1) + MASSES[1] * ARM**2 + armature)
    assert data.qvel[0] == pytest.approx(expected, rel=1e-12)
    assert switched.removed == pytest.approx([*V, 0, 0, w], abs=1e-15)
    # Newton: what both together had, less what `two` keeps
    centre = np.array([0.02, -0.01, 0.03])
    had = MASSES[0] * (V + np.cross([0, 0, w], centre)) + MASSES[1] * before
    kept = MASSES[1] * np.cross([0, 0, expected], lever)
    assert switched.impulse[:3] == pytest.approx(kept - had, abs=1e-12)


@pytest.mark.parametrize("armature", [0.0, 0.7])
def test_sledge_caught_by_its_rail(armature: float) -> None:
    """The momentum of `two` along the rail is conserved: (m + A) v' = m (V_z + v) + A v. The rail absorbs everything across it."""
    made = pair("prismatic", armature)
    V, v = np.array([0.3, 0.2, -0.9]), 0.4
    state = made.modes["free_one"].state(q={"j": 0.05}, v={"j": v}, base_twist=[*V, 0, 0, 0])
    switched = made.modes.switch(state, "held_one", on_motion="impact")
    m = MASSES[1]
    assert switched.state.v["j"] == pytest.approx((m * (V[2] + v) + armature * v) / (m + armature), rel=1e-12)
    assert switched.impulse[:2] == pytest.approx(-(MASSES[0] + m) * V[:2], rel=1e-12)


def test_catch_at_the_other_body() -> None:
    """With exchanged roles, `two` stops and `one` swings about the joint. q is still `two` relative to `one`."""
    made = pair("revolute")
    V, w = np.array([0.4, -1.1, 0.0]), 2.5
    state = made.modes["free_one"].state(base_twist=[*V, 0, 0, w], v={"j": -w})
    switched = made.modes.switch(state, "held_two", on_motion="impact")
    assert switched.removed == pytest.approx([*V, 0, 0, 0], abs=1e-15), "`two` does not turn: its origin moves as the joint does"
    lever = np.array([0.02, -0.01, 0.0])
    swing = about_z(0) * w + MASSES[0] * np.cross(lever, V + np.cross([0, 0, w], lever))[2]
    expected = swing / (about_z(0) + MASSES[0] * (lever @ lever))
    assert switched.state.v["j"] == pytest.approx(-expected, rel=1e-12)


def test_catch_is_the_limit_of_a_stiff_weld() -> None:
    """MuJoCo's soft weld to the world converges to the same joint velocity with increasing stiffness."""
    made = pair("revolute", 0.002)
    start = made.modes["free_one"].state(q={"j": 0.7}, v={"j": -0.8}, base_twist=[0.4, -1.1, 0.2, 0.5, -0.3, 2.5])
    caught = made.modes.switch(start, "held_one", on_motion="impact").state.v["j"]
    errors = []
    for timestep in (1e-4, 1e-5):
        spec = mujoco.MjSpec.from_string(made.xml["free_one"])
        weld = spec.add_equality(name="grip", type=mujoco.mjtEq.mjEQ_WELD, objtype=mujoco.mjtObj.mjOBJ_BODY, name1="one")
        weld.data[10] = 1.0
        weld.solref[:], weld.solimp[:] = [2 * timestep, 1], [0.9999, 0.9999, 0.001, 0.5, 2]
        spec.option.timestep, spec.option.gravity = timestep, [0, 0, 0]
        model = spec.compile()
        data = mujoco.MjData(model)
        made.modes.write(start, data)
        for _ in range(60):
            mujoco.mj_step(model, data)
        assert np.abs(bodies(data)["one"][1]).max() < 0.05
        errors.append(abs(data.joint("j").qvel[0] - caught))
    assert errors[1] < 0.02 * abs(caught) and errors[1] < 0.3 * errors[0]


def test_masses_come_from_model_or_argument() -> None:
    """A payload added to the model at run time counts, and so do given masses. A state without a model uses the masses of the build."""
    made = pair("revolute")
    state = made.modes["free_one"].state(base_twist=[0.4, -1.1, 0, 0, 0, 2.5])

    def expected(m: float, inertia: float) -> float:
        return (inertia * 2.5 + m * (ARM * -1.1 + ARM**2 * 2.5)) / (inertia + m * ARM**2)

    plain = made.modes.switch(state, "held_one", on_motion="impact").state.v["j"]
    assert plain == pytest.approx(expected(MASSES[1], about_z(1)), rel=1e-12)
    data = made.data("held_one")
    data.model.body("two").mass = 5.0
    loaded = made.modes.switch(state, ("held_one", data), on_motion="impact").state.v["j"]
    assert loaded == pytest.approx(expected(5.0, about_z(1)), rel=1e-9)
    source = made.data("free_one")
    source.model.body("two").mass = 5.0
    made.modes.write(state, source)
    again = made.modes.switch(("free_one", source), "held_one", on_motion="impact").state.v["j"]
    assert again == pytest.approx(loaded, rel=1e-12)
    own = made.modes["held_one"].inertias
    given = Inertias(mass=np.array([1.0, 5.0]), centre=own.centre, inertia=own.inertia, armature=own.armature)
    other = made.modes.switch(state, ("held_one", made.data("held_one")), on_motion="impact", inertias=given).state.v["j"]
    assert other == pytest.approx(loaded, rel=1e-9)
