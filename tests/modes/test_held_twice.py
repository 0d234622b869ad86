"""Modes with additional holds, and modes that cut the same loop at different joints."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from msgspec.structs import replace

from graph.builder import Array, as_pose, assembly, box, component, joint, linked, mode, pose, ref, rx, rz, t, where, whole
from modes.switching_robots import Made, bodies, emitted, frame, jacobian, joints_of, mass_matrix, same_motion, stir
from thingc.base.diagnostics import Code
from thingc.model.resolve.types import Cut, Hold
from thingc.modes import BaseElsewhere, BaseMoves, WrongData

COUNT = 9


def chain(count: int = COUNT, seed: int = 4) -> Made:
    """Links `c0` to `c8` on hinges with general axes. Held at both ends, the chain has two degrees of freedom left; `bridge` also holds
    `c8.tip`."""
    rng = np.random.default_rng(seed)
    parts = [
        box(f"p:B{k}", (0.1, 0.06, 0.04), centre=(0.01, 0.02, 0.0), mounts={"a": frame(rng), "b": frame(rng), "tip": frame(rng)})
        for k in range(count)
    ]
    joints = [joint(f"j{k}", f"c{k - 1}.a", f"c{k}.b", lower=-9, upper=9, armature=0.003) for k in range(1, count)]
    last = f"c{count - 1}"
    bent = pose("bent", **{f"j{k}": 0.2 * k for k in range(1, count)})
    held = (Hold(mount=ref(f"{last}.tip"), pose=None, origin=where(3)),)
    pinned = (replace(held[0], turns=True),)
    modes = [
        mode("float", whole("c3"), "free"), mode("near", whole("c0"), "held"), mode("far", ref(f"{last}.tip"), "held"),
        mode("bridge", whole("c0"), "held", pose="bent", poses=("bent",), holds=held),
        mode("bolted", whole("c0"), "fixed", pose="bent", poses=("bent",), holds=held),
        mode("hung", whole("c3"), "free", pose="bent", poses=("bent",), holds=held),
        mode("pinned", whole("c0"), "held", pose="bent", poses=("bent",), holds=pinned),
        mode("pinned_hung", whole("c3"), "free", pose="bent", poses=("bent",), holds=pinned),
        mode("tied", whole("c3"), "free", pose="bent", poses=("bent",), holds=(
            *pinned, Hold(mount=ref("c0.tip"), pose=None, origin=where(3)),
        )),
        mode("pinned_bolted", whole("c0"), "fixed", pose="bent", poses=("bent",), holds=pinned),
    ]
    components = [component(f"c{k}", f"p:B{k}") for k in range(count)]
    return emitted(linked(assembly("chain", components, joints, modes=modes, poses=[bent]), *parts))


@pytest.fixture(scope="module")
def made() -> Made:
    return chain()


def equality_violation(data: mujoco.MjData, rows_of: int = 6) -> float:
    """Largest violation of MuJoCo's equalities [m, rad]."""
    mujoco.mj_forward(data.model, data)
    rows = data.efc_type == int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)
    assert rows.sum() == rows_of
    return float(np.abs(data.efc_pos[rows]).max())


def test_hold_moves_to_the_mount_on_entry(made: Made) -> None:
    """For any place and posture at rest, the hold is moved to the mount."""
    rng = np.random.default_rng(8)
    for source in ("near", "far", "float"):
        one, other = stir(rng, made.data(source), moving=False), made.data("bridge")
        assert equality_violation(other) > 1e-3, "the postures differ"
        made.modes.switch((source, one), ("bridge", other))
        same_motion(one, other)
        assert equality_violation(other) < 1e-12


@pytest.mark.parametrize("target", ["bridge", "pinned", "hung", "pinned_hung"])
def test_switch_does_not_modify_the_model(made: Made, target: str) -> None:
    """Keyframe resets and simulations of other `MjData` equal those of a fresh model."""
    size = 3 if "pinned" in target else 6
    model, fresh = made.models[target], mujoco.MjModel.from_xml_string(made.xml[target])
    one, other = stir(np.random.default_rng(11), made.data("near"), moving=False), mujoco.MjData(model)
    made.modes.switch(("near", one), (target, other))
    assert np.abs(other.mocap_pos - mujoco.MjData(model).mocap_pos).max() > 1e-2, "something was moved"
    first = mujoco.MjData(fresh)
    for data in (first, other, mujoco.MjData(model)):
        mujoco.mj_resetDataKeyframe(data.model, data, 0)
        assert equality_violation(data, size) < 1e-9
        mujoco.mj_step(data.model, data, 50)
        assert (data.qpos == first.qpos).all() and np.isfinite(data.qpos).all()


def test_hung_mode_requires_only_its_hold_at_rest(made: Made) -> None:
    rng = np.random.default_rng(9)
    one, other = stir(rng, made.data("far")), made.data("hung")
    made.modes.switch(("far", one), ("hung", other))
    same_motion(one, other)
    assert equality_violation(other) < 1e-12


def test_moving_hold_is_an_error(made: Made) -> None:
    """The root is at rest, but the other foot is not."""
    one, other = stir(np.random.default_rng(3), made.data("near")), made.data("bridge")
    before = other.mocap_pos.copy()
    with pytest.raises(BaseMoves, match="^link `c8` must not move in mode `bridge`, found ") as refused:
        made.modes.switch(("near", one), ("bridge", other))
    assert (other.mocap_pos == before).all()
    dropped = made.modes.switch(("near", one), ("bridge", other), on_motion="drop")
    assert joints_of(other) == joints_of(one)
    X, velocity = bodies(one)["c8"]
    lost = dropped.holds["c8/tip"].removed
    np.testing.assert_allclose(lost, np.concatenate([velocity[:3], X[:3, :3].T @ velocity[3:]]), atol=1e-12)
    assert refused.value.twist.tolist() == lost.tolist()
    assert not dropped.removed.any() and not dropped.holds["c8/tip"].impulse.any()


def test_redundant_impulses_are_the_smallest() -> None:
    """Four joints cannot move between two held links. The oracle is the solution with the smallest norm for MuJoCo's Jacobians."""
    short = chain(5)
    one, other = stir(np.random.default_rng(6), short.data("float")), short.data("bridge")
    switched = short.modes.switch(("float", one), ("bridge", other), on_motion="impact")
    J = np.vstack([jacobian(one, link) for link in ("c0", "c4")])
    expected = np.linalg.lstsq(J.T, -mass_matrix(one) @ one.qvel, rcond=1e-10)[0]
    impulses = {"c0": switched.impulse, "c4": switched.holds["c4/tip"].impulse}
    turned = [np.concatenate([p[:3], bodies(one)[link][0][:3, :3] @ p[3:]]) for link, p in impulses.items()]
    assert np.concatenate(turned) == pytest.approx(expected, abs=1e-9) and np.abs(expected).max() > 1e-2


@pytest.mark.parametrize("target", ["bridge", "hung"])
def test_impact_at_two_links(made: Made, target: str) -> None:
    """The oracle is the projection with MuJoCo's mass matrix and Jacobians of the stopped links in the floating robot."""
    one, other = stir(np.random.default_rng(6), made.data("float")), made.data(target)
    switched = made.modes.switch(("float", one), (target, other), on_motion="impact")
    M = mass_matrix(one)
    stopped = ["c0", "c8"] if target == "bridge" else ["c8"]
    J = np.vstack([jacobian(one, link) for link in stopped])
    taken = np.linalg.solve(J @ np.linalg.solve(M, J.T), -J @ one.qvel)
    after = one.qvel + np.linalg.solve(M, J.T @ taken)
    for name, (q, v) in joints_of(other).items():
        assert q == joints_of(one)[name][0]
        assert v == pytest.approx(after[one.model.joint(name).dofadr[0]], abs=1e-9)
    seen = bodies(other)
    for link in stopped:
        assert np.abs(seen[link][1]).max() < 1e-11
    assert max(np.abs(velocity).max() for _, velocity in seen.values()) > 1e-2, "it goes on moving where it can"
    impulses = [switched.holds["c8/tip"].impulse]
    if target == "bridge":
        impulses.insert(0, switched.impulse)
    else:
        assert not switched.impulse.any() and not switched.removed.any()
    turned = [np.concatenate([p[:3], bodies(one)[link][0][:3, :3] @ p[3:]]) for link, p in zip(stopped, impulses, strict=True)]
    assert np.concatenate(turned) == pytest.approx(taken, abs=1e-9)
    assert equality_violation(other) < 1e-12


def test_impact_at_a_point_and_a_link(made: Made) -> None:
    """The base stays free. Each impulse is reported for its own hold."""
    one, other = stir(np.random.default_rng(7), made.data("float")), made.data("tied")
    switched = made.modes.switch(("float", one), ("tied", other), on_motion="impact")
    tip = np.zeros((3, one.model.nv))
    mujoco.mj_jacSite(one.model, one, tip, None, one.model.site("c8/tip").id)
    M, J = mass_matrix(one), np.vstack([tip, jacobian(one, "c0")])
    taken = np.linalg.solve(J @ np.linalg.solve(M, J.T), -J @ one.qvel)
    assert list(switched.holds) == ["c8/tip", "c0/tip"] and not switched.impulse.any()
    point, link = (switched.holds[path].impulse for path in switched.holds)
    assert point[:3] == pytest.approx(taken[:3], abs=1e-9)
    assert [*link[:3], *(bodies(one)["c0"][0][:3, :3] @ link[3:])] == pytest.approx(taken[3:], abs=1e-9)


def test_fixed_mode_requires_hold_at_its_place(made: Made) -> None:
    robot = made.modes
    bent = robot["bolted"].state("bent")
    source, other = made.data("near"), made.data("bolted")
    robot.write(robot.switch(bent, "near").state, source)
    robot.switch(("near", source), ("bolted", other))
    assert equality_violation(other) < 1e-9
    before = other.mocap_pos.copy()
    source.joint("j8").qpos += 0.25
    with pytest.raises(BaseElsewhere, match="^link `c8` is ") as refused:
        robot.switch(("near", source), ("bolted", other))
    assert refused.value.angle == pytest.approx(0.25, abs=1e-9)
    assert (other.mocap_pos == before).all()


# --- a model with other lengths ----------------------------------------------------------------------------------------


def turned(model: mujoco.MjModel) -> None:
    mujoco.mju_mulQuat(model.body_quat[3], model.body_quat[3].copy(), np.array([np.cos(5e-3), np.sin(5e-3), 0.0, 0.0]))


def shifted_joint(model: mujoco.MjModel) -> None:
    """Shift a joint across its axis; a shift along the axis would have no effect."""
    axis = model.jnt_axis[4]
    model.jnt_pos[4] += 5e-3 * np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])


def tilted_joint(model: mujoco.MjModel) -> None:
    model.jnt_axis[4] = rx(0.01)[:3, :3] @ rz(0.01)[:3, :3] @ model.jnt_axis[4]


ELSEWHERE = {
    "link c2": lambda model: model.body_pos.__setitem__(3, model.body_pos[3] + [0.0, 5e-3, 0.0]), "link c2 turned": turned,
    "joint j5": shifted_joint, "joint j5 tilted": tilted_joint,
    "mount c8/tip": lambda model: model.site("c8/tip").pos.__iadd__([5e-3, 0.0, 0.0]),
}


@pytest.mark.parametrize("name", ELSEWHERE)
def test_model_with_changed_geometry_is_rejected(made: Made, name: str) -> None:
    """Changed masses are accepted; changed poses of links, joints and mounts are rejected."""
    model = mujoco.MjModel.from_xml_string(made.xml["bridge"])
    data = mujoco.MjData(model)
    made.modes.read("bridge", data)
    model.body_mass[:] *= 2.0  # is no place
    made.modes.read("bridge", data)
    ELSEWHERE[name](model)
    kind, thing = name.split(" ")[:2]
    with pytest.raises(WrongData, match=f"{kind} `{thing}` differs by 0.0[01][0-9]*"):
        made.modes.read("bridge", data)
    start = made.data("near")
    with pytest.raises(WrongData, match="belongs to another variant"):
        made.modes.switch(("near", start), ("bridge", data))


def test_model_with_other_mounts_is_rejected(made: Made) -> None:
    other = chain(seed=5)
    for name in made.modes:
        with pytest.raises(WrongData):
            made.modes.read(name, other.data(name))
        other.modes.read(name, other.data(name))


# --- loops -------------------------------------------------------------------------------------------------------------

LENGTHS = (0.30, 0.12, 0.25, 0.20)
CUTS = {"ground": "j4", "crank": "j2", "rocker": "j3"}


def four_bar(last: str) -> Made:
    """Four bars in a plane, closed by a hinge or a transverse slide. There is no armature, because a cut joint would lose it."""
    parts, components = [], []
    for k, length in enumerate(LENGTHS):
        tail = t(-length / 2, 0, 0) @ rx(np.pi)
        head, end = t(length / 2, 0, 0), t(-length / 2, 0, 0)
        mounts: dict[str, Array] = {"head": head, "tail": tail, "end": end, "stop": head @ rx(np.pi)}
        parts.append(box(f"p:B{k}", (length, 0.02, 0.01), mounts=mounts))
        components.append(component(f"bar{k}", f"p:B{k}"))
    joints = [joint(f"j{k}", f"bar{k - 1}.head", f"bar{k}.tail", lower=-9, upper=9, turn=1.2) for k in (1, 2, 3)]
    if last == "prismatic":
        across = np.eye(4)
        across[:3, :3] = [[0, -1, 0], [0, 0, -1], [1, 0, 0]]  # x up, z against y: the bars stay in their plane
        stop = t(0.1, 0, 0) @ rz(0.3 + np.pi) @ across
        parts[3] = box("p:B3", (0.2, 0.02, 0.01), mounts={"tail": t(-0.1, 0, 0) @ rx(np.pi), "stop": stop})
        parts[0] = box("p:B0", (0.3, 0.02, 0.01), mounts={"head": t(0.15, 0, 0), "end": t(-0.15, 0, 0) @ rx(-np.pi / 2)})
    closing = joint("j4", "bar0.end", "bar3.stop", last, lower=-9, upper=9)
    joints.append(replace(closing, loop=True))
    start = pose("start", j1=0.3, j2=0.4, j3=0.5)
    modes = [
        mode(f"{name}_{base}", whole(root), base, pose="start", poses=("start",), cut=(Cut(joint=CUTS[name], origin=where(4)),))
        for name, root in (("ground", "bar0"), ("crank", "bar1"), ("rocker", "bar3")) for base in ("free", "held")
    ]
    return emitted(linked(assembly("bars", components, joints, modes=modes, poses=[start]), *parts, but={Code.FAR}))  # none meets its stops


def moving_loop(made: Made, name: str, rng: np.random.Generator) -> mujoco.MjData:
    """A closed posture with a velocity in the null space of MuJoCo's equalities, with any base."""
    mode, data = made.modes[name], made.data(name)
    made.modes.write(mode.state(next(iter(mode.named)), base_pose=frame(rng)), data)
    mujoco.mj_forward(data.model, data)
    rows = data.efc_type == int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)
    J = np.zeros((data.nefc, data.model.nv))
    for column in range(data.model.nv):
        unit, found = np.eye(data.model.nv)[column], np.zeros(data.nefc)
        mujoco.mj_mulJacVec(data.model, data, found, unit)
        J[:, column] = found
    _, values, Vt = np.linalg.svd(J[rows])
    free = Vt[int((values > 1e-9).sum()) :].T
    data.qvel[:] = free @ rng.normal(size=free.shape[1])
    return data


def test_cut_joint_q_follows_from_link_poses() -> None:
    """Each mode cuts another joint, whose value follows from the poses of its links."""
    made, rng = four_bar("revolute"), np.random.default_rng(2)
    assert {name: [cut.name for cut in mode.cuts] for name, mode in made.modes.items()} == {
        f"{name}_{base}": [cut] for name, cut in CUTS.items() for base in ("free", "held")
    }
    for source in made.modes:
        one = moving_loop(made, source, rng)
        for target in (name for name in made.modes if name.endswith("free")):
            other, back = made.data(target), made.data(source)
            made.modes.switch((source, one), (target, other))
            before, after = bodies(one), bodies(other)
            for link, (X, velocity) in before.items():
                np.testing.assert_allclose(after[link][0], X, atol=2e-9, err_msg="as far as the loop is closed")
                np.testing.assert_allclose(after[link][1], velocity, atol=2e-8)
            made.modes.switch((target, other), (source, back), at_rest=1e-6)
            for joint_name, (q, v) in joints_of(one).items():
                assert joints_of(back)[joint_name] == pytest.approx((q, v), abs=2e-8)


@pytest.mark.parametrize(("target", "bar"), [("rocker_held", "bar3"), ("crank_held", "bar1")])
def test_impact_keeps_the_loop_closed(target: str, bar: str) -> None:
    """One bar of the floating loop is caught. The oracle is the projection with MuJoCo's Jacobians of that bar and of the equalities."""
    made = four_bar("revolute")
    one, other = moving_loop(made, "ground_free", np.random.default_rng(5)), made.data(target)
    made.modes.switch(("ground_free", one), (target, other), on_motion="impact")
    mujoco.mj_forward(one.model, one)
    rows = np.flatnonzero(one.efc_type == int(mujoco.mjtConstraint.mjCNSTR_EQUALITY))
    J = np.zeros((one.nefc, one.model.nv))
    for column in range(one.model.nv):
        found = np.zeros(one.nefc)
        mujoco.mj_mulJacVec(one.model, one, found, np.eye(one.model.nv)[column])
        J[:, column] = found
    C = np.vstack([J[rows], jacobian(one, bar)])
    M = mass_matrix(one)
    inner = C @ np.linalg.solve(M, C.T)
    after = one.qvel - np.linalg.solve(M, C.T @ np.linalg.pinv(inner, rcond=1e-10) @ C @ one.qvel)
    expected = made.data("ground_free")
    expected.qpos[:], expected.qvel[:] = one.qpos, after
    for link, (X, velocity) in bodies(expected).items():
        found_X, found_velocity = bodies(other)[link]
        np.testing.assert_allclose(found_X, X, atol=2e-9)
        np.testing.assert_allclose(found_velocity, velocity, atol=1e-6)
    assert np.abs(other.qvel).max() > 1e-2


def test_cut_slide_position_is_recovered() -> None:
    """Switching from the mode with the slide to the mode that cuts it, and back, with kinematics only."""
    made = four_bar("prismatic")
    robot = made.modes
    has, cut = robot["crank_free"], robot["ground_free"]
    start = has.state("start", base_pose=frame(np.random.default_rng(1)))
    assert "j4" in start.q and [c.kind for c in cut.cuts] == ["prismatic"]
    other = robot.switch(start, "ground_free").state
    assert "j4" not in other.q
    back = robot.switch(other, "crank_free").state
    for name, q in start.q.items():
        assert back.q[name] == pytest.approx(q, abs=2e-9)
    np.testing.assert_allclose(back.base_pose, start.base_pose, atol=2e-9)
    assert as_pose(back.base_pose).translation != (0.0, 0.0, 0.0)


# --- a hold that carries force alone: a point stays, and the link may turn about it ------------------------------------------


def tip(data: mujoco.MjData) -> tuple[Array, Array]:
    """Position and velocity of the pinned point by MuJoCo."""
    linear = np.zeros((3, data.model.nv))
    mujoco.mj_jacSite(data.model, data, linear, None, data.model.site("c8/tip").id)
    return np.array(data.site("c8/tip").xpos), linear @ data.qvel


@pytest.mark.parametrize("target", ["pinned", "pinned_hung"])
def test_impact_at_a_point(made: Made, target: str) -> None:
    """The oracle is the projection with MuJoCo's mass matrix and the Jacobian of the site: the tip stops, and its link keeps rotating."""
    one, other = stir(np.random.default_rng(7), made.data("float")), made.data(target)
    with pytest.raises(BaseMoves):
        made.modes.switch(("float", one), (target, other))
    switched = made.modes.switch(("float", one), (target, other), on_motion="impact")
    point = np.zeros((3, one.model.nv))
    mujoco.mj_jacSite(one.model, one, point, None, one.model.site("c8/tip").id)
    J = np.vstack([jacobian(one, "c0"), point]) if target == "pinned" else point
    M = mass_matrix(one)
    taken = np.linalg.solve(J @ np.linalg.solve(M, J.T), -J @ one.qvel)
    after = one.qvel + np.linalg.solve(M, J.T @ taken)
    for name, (_, v) in joints_of(other).items():
        assert v == pytest.approx(after[one.model.joint(name).dofadr[0]], abs=1e-9)
    mujoco.mj_forward(other.model, other)
    place, velocity = tip(other)
    assert place == pytest.approx(tip(one)[0], abs=1e-12) and np.abs(velocity).max() < 1e-11
    assert np.linalg.norm(bodies(other)["c8"][1][3:]) > 1e-2, "it turns about its tip"
    caught = switched.holds["c8/tip"]
    assert caught.removed[:3] == pytest.approx(tip(one)[1], abs=1e-12) and not caught.removed[3:].any()
    assert caught.impulse[:3] == pytest.approx(taken[-3:], abs=1e-9)
    arm = tip(one)[0] - bodies(one)["c8"][0][:3, 3]
    assert bodies(one)["c8"][0][:3, :3] @ caught.impulse[3:] == pytest.approx(np.cross(arm, taken[-3:]), abs=1e-9)
    assert equality_violation(other, 3) < 1e-12


def test_rotation_about_a_pinned_point_is_allowed(made: Made) -> None:
    """Rotation about the point is kept, so `on_motion` is not needed."""
    robot = made.modes
    still = robot["float"].state()
    poses, link = robot["float"].poses(still), robot["float"].links[8]
    hold = robot["pinned_hung"].holds[0]
    assert hold.turns and not robot["hung"].holds[0].turns
    spin = np.array([0.3, -0.5, 0.7])
    base = poses["c3"]
    arm = base[:3, :3].T @ ((poses[link.name] @ hold.X_LM)[:3, 3] - base[:3, 3])
    about = np.concatenate([base[:3, :3] @ -np.cross(spin, arm), spin])  # the whole robot, stiff, about the tip
    moving = robot["float"].state(base_twist=about)
    switched = robot.switch(moving, "pinned_hung")
    assert np.abs(switched.removed).max() == 0.0 and np.abs(switched.holds["c8/tip"].removed).max() < 1e-12
    with pytest.raises(BaseMoves):
        robot.switch(moving, "hung")


def test_fixed_mode_requires_point_at_its_place(made: Made) -> None:
    """The orientation of the link is arbitrary. The changed joint axis does not pass through the tip, so the other posture moves the
    point."""
    robot = made.modes
    bent = robot["pinned_bolted"].state("bent")
    source, other = made.data("near"), made.data("pinned_bolted")
    robot.write(robot.switch(bent, "near").state, source)
    robot.switch(("near", source), ("pinned_bolted", other))
    assert equality_violation(other, 3) < 1e-9
    robot.write(robot.switch(robot["pinned_bolted"].state("bent", q={"j4": 0.0}), "near").state, source)
    with pytest.raises(BaseElsewhere):
        robot.switch(("near", source), ("pinned_bolted", other))
