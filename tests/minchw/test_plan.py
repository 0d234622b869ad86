"""`examples/plan_climb.py`: a plan from the floor to the ceiling, its margins compared with MuJoCo, the plan in physics, and reported
failures."""

from __future__ import annotations

import importlib
import sys
from functools import cache
from math import degrees, pi
from pathlib import Path
from types import ModuleType

import mujoco
import numpy as np
import pytest

from conformance.harness import ROOT

from .conftest import sole

pytestmark = pytest.mark.slow

JOINTS = ("front/yaw", "front/knee", "front/ankle", "rear/yaw", "rear/knee", "rear/ankle")
PLACES = {"floor": "", "wall": "_wall", "ceiling": "_ceiling"}


@pytest.fixture(scope="module")
def planning() -> ModuleType:
    """The example, imported as a module."""
    folder = str(ROOT / "examples")
    sys.path.insert(0, folder)
    try:
        return importlib.import_module("plan_climb")
    finally:
        sys.path.remove(folder)


@pytest.fixture(scope="module")
def planner(planning: ModuleType, minchw: Path, shared_store: str) -> tuple:
    """The robot in the tunnel, and the planner."""
    tunnel = planning.TUNNEL
    robot = planning.Climb(minchw, "", tunnel.faces)
    return robot, tunnel, seeded(planning, planning.modes(robot, shared_store)), minchw


@pytest.fixture(scope="module")
def plan(planning: ModuleType, planner: tuple) -> list:
    """The plan from the floor over the wall to the ceiling."""
    robot, tunnel, each, _ = planner
    return each.plan(planning.start(robot, tunnel), planning.goal(tunnel))


def seeded(planning: ModuleType, modes: dict) -> object:
    """Return a planner with the seed of the example."""
    return planning.Planner(modes=modes, surfaces=planning.surfaces(planning.TUNNEL), rng=np.random.default_rng(planning.SEED))


@cache
def without_contacts(path: Path) -> mujoco.MjModel:
    """Return a model of the build without contacts."""
    model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    return model


def by_mujoco(minchw: Path, foot: str, face: str, q: np.ndarray) -> tuple[float, float]:
    """Return the smallest ratio of limit to torque by `mj_inverse`, and the unused pull [N] from the weight at the centre of mass."""
    model = without_contacts(minchw / "mjcf" / f"minchw_{foot}_foot{PLACES[face]}.xml")
    data = mujoco.MjData(model)
    for name, value in zip(JOINTS, q, strict=True):
        data.joint(name).qpos = value
    mujoco.mj_inverse(model, data)
    torques = {name: abs(float(data.qfrc_inverse[model.joint(name).dofadr[0]])) for name in JOINTS}
    torque = min(float(model.actuator(name).forcerange[1]) / max(torques[name], 1e-9) for name in JOINTS)
    weight = float(model.body_mass[1:].sum()) * model.opt.gravity
    lever = data.subtree_com[0] - data.site(f"{foot}/sole").xpos
    tipping = np.hypot(*np.cross(lever, weight)[:2])
    return torque, 300.0 - (tipping / 0.025 + float(weight[2]))


@pytest.mark.parametrize("face", PLACES)
@pytest.mark.parametrize("foot", ["front", "rear"])
def test_margins_equal_those_of_mujoco(planning: ModuleType, planner: tuple, minchw: Path, foot: str, face: str) -> None:
    _, tunnel, each, _ = planner
    mode = each.modes[foot]
    mode.hold(planning.Foothold(face=tunnel.faces[list(PLACES).index(face)], distance=0.2))
    for q in np.random.default_rng(3).uniform(-0.7, 1.5, (5, 6)) * [0, 1, 1, 0, 1, 1]:
        found = mode.margins(q)
        torque, pull = by_mujoco(minchw, foot, face, q)
        assert found.torque == pytest.approx(torque, rel=1e-6)
        assert found.magnet == pytest.approx(pull, abs=1e-6)


@pytest.mark.parametrize(("limit", "name"), [("TORQUE", "torque"), ("MAGNET", "magnet")])
def test_pose_below_a_limit_is_rejected(
    planning: ModuleType, planner: tuple, monkeypatch: pytest.MonkeyPatch, limit: str, name: str,
) -> None:
    robot, tunnel, each, _ = planner
    begin, mode = planning.start(robot, tunnel), each.modes["rear"]
    mode.hold(begin.feet["rear"])
    margin = getattr(mode.margins(begin.q), name)
    for factor, why in ((0.99, ""), (1.01, f"{name} margin")):
        monkeypatch.setattr(sys.modules["inchworm_modes"], limit, factor * margin)
        assert mode.refusal(begin.q, [begin.feet["front"]]) == why


def test_poses_of_the_plan_have_their_margins(plan: list, minchw: Path) -> None:
    """The limits of the planner: a torque margin of 2, and 100 N of pull."""
    for state in plan[1:]:
        for foot, seat in state.feet.items():  # each foot could hold alone
            torque, pull = by_mujoco(minchw, foot, seat.face.name, state.q)
            assert torque > 2.0 and pull > 100.0
        holds = state.before.holds
        for now in state.swing.instants(0.25):
            torque, pull = by_mujoco(minchw, holds, state.feet[holds].face.name, now.q)
            assert torque > 1.98 and pull > 99.0


def test_pull_of_a_swing_equals_the_rate_of_momentum(planner: tuple, plan: list) -> None:
    """Differences of momenta over time are compared with the inverse dynamics that determine the time of a swing."""
    mode, swing = planner[2].modes["rear"], plan[1].swing
    mode.hold(plan[1].feet["rear"])
    gravity = np.array([0.0, 0.0, -9.81])
    nows = [now for now in swing.instants(1e-3) if now.phase == "swing"]
    for k in (len(nows) // 4, len(nows) // 2, 3 * len(nows) // 4):
        model = without_contacts(planner[3] / "mjcf" / "minchw_rear_foot.xml")
        momenta = []
        for now in (nows[k - 1], nows[k + 1]):
            data = mujoco.MjData(model)
            for name, q, v in zip(JOINTS, now.q, now.v, strict=True):
                data.joint(name).qpos, data.joint(name).qvel = q, v
            mujoco.mj_forward(model, data)
            mujoco.mj_subtreeVel(model, data)
            mass, lever = model.body_mass[1:].sum(), data.subtree_com[0] - data.site("rear/sole").xpos
            linear = mass * data.subtree_linvel[0]
            momenta.append((linear, data.subtree_angmom[0] + np.cross(lever, linear), mass, lever))
        (p0, l0, mass, c0), (p1, l1, _, c1) = momenta
        force = (p1 - p0) / 2e-3 - mass * gravity
        moment = (l1 - l0) / 2e-3 - np.cross((c0 + c1) / 2, mass * gravity)
        needed = np.hypot(moment[0], moment[1]) / 0.025 - force[2]
        assert mode.dynamics.load(nows[k], gravity)[1] == pytest.approx(needed, abs=0.05)
        assert needed <= 300.0 - mode.loads(swing)[1] + 0.5


def test_swing_beyond_a_limit_is_too_fast(planner: tuple, plan: list, monkeypatch: pytest.MonkeyPatch) -> None:
    mode, swing = planner[2].modes["rear"], plan[1].swing
    mode.hold(plan[1].feet["rear"])
    load, margin = mode.loads(swing)
    for name, tight in (("LOAD", 0.99 * load), ("MOVED", 1.01 * margin)):
        assert mode._slow_enough(swing)
        with monkeypatch.context() as limits:
            limits.setattr(sys.modules["inchworm_modes"], name, tight)
            assert not mode._slow_enough(swing)


def test_pull_of_a_landing(planning: ModuleType, planner: tuple, plan: list) -> None:
    """Springs in series: the sole is displaced by 0.1 mm without a tilt. Derivatives are differences of planar kinematics."""
    mode, state = planner[2].modes["rear"], plan[1]
    mode.hold(state.feet["rear"])
    degrees_of = dict(zip(JOINTS, np.degrees(state.q).tolist(), strict=True))

    def front_from_rear(q: dict) -> np.ndarray:
        """x, z [m] and tilt [rad] of the front sole in the frame of the rear sole, which is level."""
        (xf, zf, upf), (xr, zr, upr) = sole("front", q), sole("rear", q)
        x, z, turn = (xf - xr) / 1e3, (zf - zr) / 1e3, np.radians(upr)
        return np.array([x * np.cos(turn) - z * np.sin(turn), x * np.sin(turn) + z * np.cos(turn), -np.radians(upf + upr)])

    moving = [name for name in JOINTS if not name.endswith("yaw")]
    step = 1e-3
    columns = [
        (front_from_rear({**degrees_of, name: degrees_of[name] + step}) - front_from_rear({**degrees_of, name: degrees_of[name] - step}))
        / np.radians(2 * step)
        for name in moving
    ]
    jacobian = np.array(columns).T
    soft = np.diag([1.0 / planner[0].models["rear"].actuator(name).gainprm[0] for name in moving])
    fx, fz, my = np.linalg.solve(jacobian @ soft @ jacobian.T, [0.0, 1e-4, 0.0])  # up from the floor
    x, z, _ = front_from_rear(degrees_of)
    assert mode.press(state.q, state.feet["front"]) == pytest.approx(abs(my + z * fx - x * fz) / 0.025, rel=1e-3)


def test_dragging_foot_and_body_on_the_wall_collide(planning: ModuleType, planner: tuple, plan: list) -> None:
    _, tunnel, each, _ = planner
    mode, begin = each.modes["rear"], plan[0]
    mode.hold(begin.feet["rear"])
    assert not mode.collides(begin.q, [begin.feet["front"]])
    assert mode.collides(begin.q, [])  # no foothold there
    assert mode.collides(begin.q, [planning.Foothold(face=tunnel.faces[0], distance=0.33)])  # 10 mm beside it
    mode.hold(planning.Foothold(face=tunnel.faces[0], distance=tunnel.length - 0.3))
    assert mode.collides(begin.q, [planning.Foothold(face=tunnel.faces[0], distance=tunnel.length + 0.02)])  # the front foot is in the wall


def test_feet_are_flat_on_their_footholds(plan: list) -> None:
    for state in plan[1:]:
        q = {name: degrees(value) for name, value in zip(JOINTS, state.q, strict=True)}
        (xf, zf, upf), (xr, zr, upr) = sole("front", q), sole("rear", q)
        front, rear = state.feet["front"].above(), state.feet["rear"].above()
        assert (upf + upr - degrees(front.turn - rear.turn) + 180.0) % 360.0 == pytest.approx(180.0, abs=0.05)
        assert np.hypot(xf - xr, zf - zr) == pytest.approx(1e3 * np.hypot(front.x - rear.x, front.z - rear.z), abs=0.15)


def test_plan_leads_over_the_wall_to_the_ceiling(planning: ModuleType, planner: tuple, plan: list) -> None:
    """The feet move in turn, each swing begins at the end of the last one, and no pose comes from the scripted climb."""
    robot, tunnel, each, _ = planner
    assert [state.holds for state in plan] == ["rear" if k % 2 == 0 else "front" for k in range(len(plan))]
    assert {seat.face.name for state in plan for seat in state.feet.values()} == {"floor", "wall", "ceiling"}
    assert all(seat.face.name == "ceiling" for seat in plan[-1].feet.values()) and each.progress(plan[-1]) >= planning.goal(tunnel)
    for before, state in zip(plan, plan[1:], strict=False):
        np.testing.assert_allclose(state.swing.begin.q, before.q, atol=1e-6)
        np.testing.assert_allclose(state.swing.end, state.q, atol=1e-6)
    by_hand = [swing.end for swing in tunnel.plan(robot.models)]
    assert min(np.abs(state.q - q).max() for state in plan[1:] for q in by_hand) > 0.1


def test_step_onto_the_wall_in_physics(planning: ModuleType, planner: tuple, plan: list) -> None:
    robot, tunnel, *_ = planner
    steps, footholds = planning.swings(plan)
    count = next(k for k, state in enumerate(plan) if any(seat.face.name == "wall" for seat in state.feet.values()))
    seen = robot.rooted(steps[:count], None, footholds)
    assert seen.slips["standing"] < 1e-9 and seen.slips["landing"] < 1e-4
    assert 300.0 - seen.pull > 50.0 and seen.speed < 0.9 and planning.failed(seen) is None
    world, foot = robot.held[plan[count].holds], plan[count].holds
    x, _, z = world.sole(foot)
    assert x == pytest.approx(tunnel.length, abs=3e-4) and z == pytest.approx(plan[count].feet[foot].distance, abs=3e-4)
    assert world.turn(foot) == pytest.approx(pi / 2, abs=2e-3)
    seen.pull = 301.0
    assert "a magnet comes off" in planning.failed(seen)


def test_the_same_seed_gives_the_same_transitions(planning: ModuleType, planner: tuple) -> None:
    robot, tunnel, each, _ = planner
    one, two = (seeded(planning, each.modes).transitions(planning.start(robot, tunnel)) for _ in range(2))
    assert len(one) == len(two) > 5
    for a, b in zip(one, two, strict=True):
        np.testing.assert_array_equal(a.q, b.q)


def test_failure_reports_progress_and_reason(planning: ModuleType, planner: tuple, monkeypatch: pytest.MonkeyPatch) -> None:
    robot, tunnel, each, _ = planner
    monkeypatch.setattr(sys.modules["inchworm_planner"], "VISITS", 2)
    again = seeded(planning, each.modes)
    with pytest.raises(planning.NoPlan, match=r"no plan after 2 states: the furthest is \d+ mm short \(.* foot on the .*Refused: \d+ x "):
        again.plan(planning.start(robot, tunnel), 9.0)


def test_invalid_start_is_reported(planning: ModuleType, planner: tuple) -> None:
    robot, tunnel, each, _ = planner
    again = seeded(planning, each.modes)
    begin = planning.start(robot, tunnel)
    bent = planning.State(q=begin.q + np.array([0, 0.8, 0, 0, 0, 0]), feet=begin.feet, holds="rear")
    with pytest.raises(planning.NoPlan, match=r"no plan: the start is not allowed \(joint limit\)"):
        again.plan(bent, 1.0)


def test_footholds_near_an_edge_are_reported(planning: ModuleType, planner: tuple, plan: list) -> None:
    _, tunnel, each, _ = planner
    shown = planning.report_steps(plan, each.surfaces)
    assert len(shown.splitlines()) == len(plan) + 3
    floor = tunnel.faces[0]
    edge = {"front": planning.Foothold(face=floor, distance=tunnel.length - 0.04), "rear": planning.Foothold(face=floor, distance=0.0)}
    near = planning.report_steps([planning.State(q=plan[0].q, feet=edge, holds="rear")], each.surfaces)
    assert near.endswith("nearer than 20 mm to an edge: step 0")


def test_docs_show_the_plan(planning: ModuleType, planner: tuple, plan: list) -> None:
    page = (ROOT / "docs" / "studies" / "planning.md").read_text()
    shown = page.partition("<!-- plan -->\n```text\n")[2].partition("\n```")[0]
    assert [line.split()[:3] for line in shown.splitlines()] == [
        line.split()[:3] for line in planning.report_steps(plan, planner[2].surfaces).splitlines()
    ]
    comparison = page.partition("<!-- comparison -->\n```text\n")[2].partition("\n```")[0]
    cells = {line[:40].strip(): line[40:].split() for line in comparison.splitlines()[1:]}
    assert cells["steps of a foot"] == [f"{len(plan) - 1}"] * 2 + [f"{len(planning.TUNNEL.footholds())}"] * 2
    assert all(float(cell) > planning.LOW for cell in cells["smallest pull margin [N]"])
    assert cells["contacts besides soles"] == ["nothing"] * 4


def test_rrt_connect_finds_a_way_around_a_wall(planning: ModuleType) -> None:
    rrt = importlib.import_module("rrt_connect")
    begin, end, corner = np.array([-0.9, -0.9]), np.array([0.9, -0.9]), np.array([1.0, 1.0])

    def clear(a: np.ndarray, b: np.ndarray) -> bool:
        at = a + np.linspace(0.0, 1.0, 50)[:, None] * (b - a)
        return not bool(((np.abs(at[:, 0]) < 0.1) & (at[:, 1] < 0.5)).any())

    path = rrt.shorten(rrt.connect(begin, end, -corner, corner, clear, np.random.default_rng(0), 500), clear)
    assert np.array_equal(path[0], begin) and np.array_equal(path[-1], end) and 3 <= len(path) <= 6
    assert all(clear(a, b) for a, b in zip(path, path[1:], strict=False)) and max(point[1] for point in path) > 0.5
    assert rrt.connect(begin, end, -corner, corner, lambda a, b: False, np.random.default_rng(0), 20) is None
