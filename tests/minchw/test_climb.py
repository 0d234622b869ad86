"""`examples/climb.py`: the corner of floor and wall in planar kinematics and in physics, the switch of the root to the wall, and the
results in docs/studies/walking.md."""

from __future__ import annotations

import importlib
import re
import sys
from math import cos, degrees, pi, radians, sin
from pathlib import Path
from types import ModuleType

import mujoco
import numpy as np
import pytest

from conformance.harness import ROOT

from .conftest import sole

pytestmark = pytest.mark.slow

DOCS = ROOT / "docs" / "studies" / "walking.md"
ONTO_WALL = 3
"""The number of swings after which the front foot is on the wall."""


@pytest.fixture(scope="module")
def climbing() -> ModuleType:
    """The example, imported as a module."""
    folder = str(ROOT / "examples")
    sys.path.insert(0, folder)
    try:
        return importlib.import_module("climb")
    finally:
        sys.path.remove(folder)


@pytest.fixture(scope="module")
def climbed(climbing: ModuleType, minchw: Path) -> tuple:
    """A step on the floor, then the front foot on the wall: the robot, the recorded states, and the margins by stage."""
    tunnel = climbing.Tunnel()
    robot = climbing.Climb(minchw, "", tunnel.faces)
    plan = tunnel.plan(robot.models)
    watch = climbing.Stages(until=climbing.stages(tunnel, plan))
    seen = robot.rooted(plan[:ONTO_WALL], watch, tunnel.footholds())
    return robot, tunnel, seen, watch


def test_corner_in_planar_kinematics(climbing: ModuleType, climbed: tuple) -> None:
    """The position of each foot relative to the other one after each step. Joints stay away from their limits."""
    tunnel, gait = importlib.import_module("inchworm_tunnel"), importlib.import_module("inchworm_gait")
    robot = climbed[0]
    beyond, at = {"front": False, "rear": False}, {"front": 0.07, "rear": 0.39}
    limits = [robot.models["rear"].joint(name).range for name in gait.JOINTS]
    for step, swing in zip(tunnel.CORNER, tunnel.corner(robot.models), strict=True):
        beyond[step.moves], at[step.moves] = step.beyond, step.to
        q = {name: degrees(value) for name, value in zip(gait.JOINTS, swing.end, strict=True)}
        (xf, zf, upf), (xr, zr, upr) = sole("front", q), sole("rear", q)
        turn = radians(90.0 * beyond["rear"] + upr)  # of the body from the floor: the rear toe looks back
        assert degrees(turn) == pytest.approx(step.pitch, abs=1e-4)
        assert upf + degrees(turn) == pytest.approx(90.0 * beyond["front"], abs=1e-4)
        here = [(0.0, at[foot]) if beyond[foot] else (-at[foot], 0.0) for foot in ("front", "rear")]
        x, z = (xf - xr) / 1000, (zf - zr) / 1000
        assert x * cos(turn) - z * sin(turn) == pytest.approx(here[0][0] - here[1][0], abs=1.1e-4)  # the foot is pressed on by 0.1 mm
        assert x * sin(turn) + z * cos(turn) == pytest.approx(here[0][1] - here[1][1], abs=1.1e-4)
        for now in swing.instants(0.05):
            for value, (low, high) in zip(now.q, limits, strict=True):
                assert low + radians(15) < value < high - radians(15)


def test_step_onto_the_wall(climbing: ModuleType, climbed: tuple) -> None:
    robot, tunnel, seen, watch = climbed
    assert seen.touches == set()
    assert 50.0 < watch.least["floor"] < 200.0 and 50.0 < watch.least["floor to wall"] < 200.0
    assert watch.least["wall"] == np.inf
    assert seen.slips["standing"] < 1e-9 and seen.slips["landing"] < 1e-4
    assert seen.speed < 0.9 and seen.removed < 1e-4
    x, _, z = robot.held["front"].sole("front")
    assert x == pytest.approx(tunnel.length, abs=1e-4) and z == pytest.approx(0.34, abs=5e-4)
    assert degrees(robot.held["front"].turn("front")) == pytest.approx(90.0, abs=0.1)


def test_root_switches_to_the_wall_without_moving_links(climbed: tuple) -> None:
    before, after = (climbed[0].held[foot] for foot in ("rear", "front"))
    for world in (before, after):
        mujoco.mj_kinematics(world.model, world.data)
    assert after.data.time == before.data.time
    for body in range(1, before.model.nbody):
        name = before.model.body(body).name
        np.testing.assert_allclose(after.data.body(name).xpos, before.data.body(name).xpos, atol=1e-9)
        np.testing.assert_allclose(after.data.body(name).xmat, before.data.body(name).xmat, atol=1e-9)


def test_wall_contact_equals_the_wall_mode(climbed: tuple, minchw: Path) -> None:
    """`front_foot` with its foot on the wall is compared with `front_foot_wall`, whose gravity is rotated. The gravity torques of all
    joints are equal."""
    world = climbed[0].held["front"]
    wall = mujoco.MjModel.from_xml_path(str(minchw / "mjcf" / "minchw_front_foot_wall.xml"))
    np.testing.assert_allclose(world.gravity("front"), wall.opt.gravity, atol=1e-12)
    here, there = mujoco.MjData(world.model), mujoco.MjData(wall)
    here.mocap_pos[:], here.mocap_quat[:] = world.data.mocap_pos, world.data.mocap_quat
    here.qpos[:] = there.qpos[:] = world.data.qpos
    for model, data in ((world.model, here), (wall, there)):
        mujoco.mj_forward(model, data)
    np.testing.assert_allclose(here.qfrc_bias, there.qfrc_bias, atol=5e-3)  # of 2 N m: the foot stands half a milliradian askew
    assert np.abs(here.qfrc_bias).max() > 0.5


def test_swing_starts_from_the_actual_pose_of_the_root(climbing: ModuleType, minchw: Path) -> None:
    """The rear foot, which is the root, is displaced by a millimetre and half a degree. The front foot lands at its planned position."""
    tunnel = climbing.Tunnel()
    robot = climbing.Climb(minchw, "", tunnel.faces)
    swing, foothold, world = tunnel.plan(robot.models)[2], tunnel.footholds()[2], robot.held["rear"]
    world.data.mocap_pos[0] += [0.091, 0.0, 0.0]
    tilt = np.array([cos(radians(0.25)), 0.0, -sin(radians(0.25)), 0.0])
    mujoco.mju_mulQuat(world.data.mocap_quat[0], tilt, world.data.mocap_quat[0].copy())
    landed = []
    mujoco.mj_kinematics(world.model, world.data)
    for each in (robot._aimed(world, swing, swing.begin.q, foothold), swing):
        np.testing.assert_allclose(each.begin.q, swing.begin.q, atol=1e-9)
        world.data.qpos[world.qpos] = each.end
        mujoco.mj_kinematics(world.model, world.data)
        x, _, z = world.sole("front")
        landed.append((x - foothold.x, z - foothold.z, world.turn("front") - foothold.turn))
    np.testing.assert_allclose(landed[0], 0.0, atol=1e-7)
    assert np.abs(landed[1]).max() > 1e-3  # and would not have


def test_every_step_has_a_foothold(climbing: ModuleType, climbed: tuple) -> None:
    robot, tunnel = climbed[:2]
    footholds, plan = tunnel.footholds(), tunnel.plan(robot.models)
    assert len(footholds) == len(plan) == 2 * (1 + 1 + 2) + 2 * 4
    for last, foot in ((footholds[-2], "front"), (footholds[-1], "rear")):
        assert plan[footholds.index(last)].moves == foot
        assert (last.turn, last.z) == (pytest.approx(pi), pytest.approx(0.56 + 1e-4))
    assert footholds[-1].x - footholds[-2].x == pytest.approx(0.32)


def table(marker: str) -> dict[str, list[str]]:
    """Return the cells of a report on the page, by the name of the row."""
    shown = re.search(rf"<!-- {marker} -->\n```text\n(.*?)\n```", DOCS.read_text(), re.DOTALL)
    assert shown is not None
    return {cells[0]: cells[1:] for cells in (re.split(r" {2,}", line.rstrip()) for line in shown[1].split("\n"))}


def test_docs_show_the_margin_on_the_floor(climbing: ModuleType, climbed: tuple) -> None:
    shown = table("report of the climb")
    assert float(shown["smallest pull margin, floor [N]"][0]) == pytest.approx(climbed[3].least["floor"], rel=0.02)
    assert all(float(shown[f"smallest pull margin, {stage} [N]"][0]) > 0.0 for stage in climbing.STAGES)
    assert shown["contacts besides soles"] == ["nothing", "nothing"]


def test_docs_show_the_speed_at_which_feet_detach(climbing: ModuleType, minchw: Path) -> None:
    shown = table("report of speeds")
    for pace in (4.0, 6.0):
        column = climbing.PACES.index(pace)
        speed, seen = climbing.paced(minchw, "ceiling", pace)
        assert shown["speed [mm/s]"][column] == f"{1e3 * speed:.1f}"
        cell = shown["pull margin, ceiling, rooted [N]"][column]
        assert (cell == "off") == (not np.isfinite(seen["rooted"].pull)) == (pace == 6.0)
        assert (shown["pull margin, ceiling, free [N]"][column] == "falls") == climbing.fallen(seen["free"]) == (pace == 6.0)
        assert cell == "off" or float(cell) == pytest.approx(climbing.PULL - seen["rooted"].pull, rel=0.05, abs=0.5)
