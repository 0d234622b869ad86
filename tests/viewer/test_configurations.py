"""How the page moves robots that consist only of frames: loops, limits of coupled joints, cones, bases, and URLs that restore the state.

The page reports link poses; the expected values come from trigonometry or MuJoCo."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from loops.robots import Built, compiled, pose_of
from thingc.tools.cli.main import main
from viewer.browser import address, drawn, needed, opened, until

pytestmark = [needed, pytest.mark.slow]

MASS = "frame: true, mass: 0.1 kg, inertia: {ixx: 1e-4 kg*m^2, iyy: 2e-4 kg*m^2, izz: 1.5e-4 kg*m^2}"
CRANK, COUPLER, ROCKER, GROUND = 60.0, 180.0, 120.0, 200.0
FOUR_BAR = f"""
thingc: assembly/1
name: fourbar
components:
  ground: {{{MASS}, mounts: {{a: {{}}, d: {{xyz: {GROUND:g} 0 0 mm}}}}}}
  crank: {{{MASS}, mounts: {{low: {{rpy: 180 0 -90 deg}}, high: {{xyz: {CRANK:g} 0 0 mm}}}}}}
  coupler: {{{MASS}, mounts: {{low: {{rpy: 180 0 -90 deg}}, high: {{xyz: {COUPLER:g} 0 0 mm}}}}}}
  rocker: {{{MASS}, mounts: {{low: {{rpy: 180 0 -90 deg}}, high: {{xyz: {ROCKER:g} 0 0 mm, rpy: 180 0 -90 deg}}}}}}
joints:
  drive: {{type: continuous, parent: ground.a, child: crank.low, drive: {{kind: position, kp: 5 N*m/rad, kv: 0.05 N*m*s/rad}}}}
  elbow: {{type: continuous, parent: crank.high, child: coupler.low}}
  pivot: {{type: revolute, parent: ground.d, child: rocker.low, limit: {{lower: 5 deg, upper: 175 deg}}}}
  wrist: {{type: continuous, parent: coupler.high, child: rocker.high, loop: true}}
poses:
  at_20: {{drive: 20 deg}}
  at_200: {{drive: 200 deg}}
modes:
  bench: {{root: ground, pose: at_20}}
  unposed: {{root: ground}}
"""
FINGER = f"""
thingc: assembly/1
name: finger
components:
  palm: {{{MASS}, mounts: {{a: {{}}}}}}
  one: {{{MASS}, mounts: {{low: {{}}, high: {{xyz: 50 0 0 mm}}}}}}
  two: {{{MASS}, mounts: {{low: {{}}, high: {{xyz: 50 0 0 mm}}}}}}
  eye: {{{MASS}, mounts: {{low: {{}}, high: {{}}}}}}
joints:
  lead: {{type: revolute, parent: palm.a, child: one.low, limit: {{lower: -90 deg, upper: 90 deg}}}}
  follow:
    type: revolute
    parent: one.high
    child: two.low
    limit: {{lower: -40 deg, upper: 40 deg}}
    mimic: {{joint: lead, multiplier: -0.8, offset: 4 deg}}
  gaze: {{type: ball, parent: two.high, child: eye.low, limit: {{cone: 30 deg}}}}
  spin: {{type: continuous, parent: eye.high, child: tip.low}}
modes:
  still: {{root: palm}}
  adrift: {{root: one, base: free, at: {{xyz: 0 0 200 mm}}}}
  rolling: {{root: palm.a, base: planar, at: {{xyz: 30 20 10 mm, rpy: 20 -30 40 deg}}}}
  turning: {{root: palm, base: ball, at: {{xyz: 30 20 10 mm, rpy: 20 -30 40 deg}}}}
""".replace("joints:", f"  tip: {{{MASS}, mounts: {{low: {{}}}}}}\njoints:", 1)

REACHER = f"""
thingc: assembly/1
name: reacher
components:
  palm: {{{MASS}, mounts: {{a: {{}}}}}}
  one: {{{MASS}, mounts: {{low: {{rpy: 180 0 0 deg}}, high: {{xyz: 50 0 0 mm}}}}}}
  two: {{{MASS}, mounts: {{low: {{rpy: 180 0 0 deg}}, high: {{xyz: 50 0 0 mm}}}}}}
  three: {{{MASS}, mounts: {{low: {{rpy: 180 0 0 deg}}, tip: {{xyz: 20 0 0 mm}}}}}}
joints:
  first: {{type: continuous, parent: palm.a, child: one.low}}
  second: {{type: continuous, parent: one.high, child: two.low}}
  third: {{type: continuous, parent: two.high, child: three.low}}
poses:
  bent: {{first: 40 deg, second: -90 deg, third: 30 deg}}
modes:
  pinned: {{root: palm.a, base: planar, pose: bent, hold: {{three.tip: here}}}}
"""


@contextmanager
def page_of(browser: Any, folder: Path, text: str, fragment: str = "") -> Iterator[Any]:
    name = text.partition("name: ")[2].partition("\n")[0]
    if not (folder / "out" / name).exists():
        (folder / "thingc.toml").write_text('thingc = "workspace/1"\n')
        (folder / f"{name}.yaml").write_text(text)
        code = main(["build", str(folder / f"{name}.yaml"), "-o", str(folder / "out"), "--emit", "html", "--store", str(folder / "store")])
        assert code == 0
    with opened(browser, address(folder / f"out/{name}/html/{name}.html", fragment)) as page:
        yield page


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder in which each robot is built once."""
    return tmp_path_factory.mktemp("robots")


@pytest.fixture
def four_bar(tmp_path: Path) -> Built:
    """Return the compiled four-bar for MuJoCo."""
    folder = tmp_path / "compiled"
    folder.mkdir()
    return compiled(folder, FOUR_BAR)


def q_of(page: Any) -> dict[str, float]:
    found: dict[str, float] = page.evaluate("({...thingc.viewer.q})")
    return found


def gap(page: Any) -> float:
    """Return the distance [mm] between the ends of coupler and rocker, from the poses of their links."""
    links = {name: np.array(numbers).reshape(4, 4) for name, numbers in page.evaluate("thingc.viewer.links()").items()}
    ends = [1000.0 * links[name][:3, 3] + length * links[name][:3, 0] for name, length in (("coupler", COUPLER), ("rocker", ROCKER))]
    return float(np.linalg.norm(ends[0] - ends[1]))


def opposite(drive: float) -> float:
    """Return the distance [mm] between the end of the crank and the bearing of the rocker."""
    return math.hypot(CRANK * math.cos(drive) - GROUND, CRANK * math.sin(drive))


@pytest.mark.parametrize("mode", ["bench", "unposed"])
def test_crank_turns_fully_with_a_closed_loop(browser: Any, folder: Path, mode: str) -> None:
    """The shortest link turns fully (Grashof), however far a slider moves at once. The angle between coupler and rocker follows the law
    of cosines."""
    with page_of(browser, folder, FOUR_BAR, f"#mode={mode}") as page:
        assert gap(page) < 1e-3
        for drive in (-170.0, 179.0, -60.0, 120.0, 20.0):
            page.evaluate(f"thingc.viewer.setCoordinate('drive', {math.radians(drive)})")
            q = q_of(page)
            assert math.degrees(q["drive"]) == pytest.approx(drive, abs=1e-9) and gap(page) < 1e-3
            assert page.evaluate("thingc.viewer.message") == ""
            assert math.radians(5.0) <= q["pivot"] <= math.radians(175.0) and abs(q["elbow"]) <= math.pi
            inner = math.acos((COUPLER**2 + ROCKER**2 - opposite(math.radians(drive)) ** 2) / (2 * COUPLER * ROCKER))
            links = {name: np.array(numbers).reshape(4, 4)[:3, 0] for name, numbers in page.evaluate("thingc.viewer.links()").items()}
            assert math.acos(float(links["coupler"] @ links["rocker"])) == pytest.approx(inner, abs=1e-6)


def test_loop_stays_closed_between_poses(browser: Any, folder: Path) -> None:
    with page_of(browser, folder, FOUR_BAR, "#mode=bench&pose=at_20") as page:
        between = """(part) => { const { configuration: here, mode } = thingc.viewer, [from, to] = mode.poses;
          here.between({ q: from.q, base: here.tree.home }, { q: to.q, base: here.tree.home }, part); return { ...here.q }; }"""
        parts = [page.evaluate(between, part / 12) for part in range(1, 12)]
        assert gap(page) < 1e-3
        for before, after in itertools.pairwise(parts):
            assert max(abs(after[name] - before[name]) for name in ("drive", "elbow", "pivot")) < 0.5
        assert math.degrees(parts[5]["drive"]) == pytest.approx(110.0, abs=1e-6)


def test_link_poses_match_the_mujoco_loop(browser: Any, folder: Path, four_bar: Built) -> None:
    model = four_bar.model("bench")
    with page_of(browser, folder, FOUR_BAR, "#mode=bench&pose=at_20") as page:
        page.evaluate("thingc.viewer.setCoordinate('drive', 1.7)")
        data = mujoco.MjData(model)
        for name in ("drive", "elbow", "pivot"):
            data.joint(name).qpos = q_of(page)[name]
        mujoco.mj_forward(model, data)
        rows = data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
        assert rows.any() and np.abs(data.efc_pos[rows]).max() < 1e-6
        for name, numbers in page.evaluate("thingc.viewer.links()").items():
            assert np.abs(np.array(numbers).reshape(4, 4) - pose_of(data.body(name))).max() < 1e-9


def test_coupled_joints_stay_within_all_limits(browser: Any, folder: Path) -> None:
    """The leader stops when its follower reaches a limit: -0.8 q + 4 deg within 40 deg restricts the leader's limits of 90 deg to -45 to
    55 deg."""
    with page_of(browser, folder, FINGER, "#mode=still") as page:
        number = page.get_by_role("spinbutton", name="lead value")
        for typed, leads, follows in ((90, 55, -40), (-90, -45, 40)):
            number.fill(str(typed))
            number.press("Enter")
            q = q_of(page)
            assert (math.degrees(q["lead"]), math.degrees(q["follow"])) == pytest.approx((leads, follows), abs=1e-9)
            assert float(number.input_value()) == pytest.approx(leads)  # what was typed is not left standing
        page.evaluate("thingc.viewer.setCoordinate('follow', 0.1)")
        assert q_of(page)["follow"] == pytest.approx(0.1) and q_of(page)["lead"] == pytest.approx((math.radians(4) - 0.1) / 0.8)


def test_ball_joint_stays_in_its_cone(browser: Any, folder: Path) -> None:
    with page_of(browser, folder, FINGER, "#mode=still") as page:
        page.evaluate("thingc.viewer.setCoordinate('gaze_0', 2.0); thingc.viewer.setCoordinate('gaze_1', 2.0)")
        q = q_of(page)
        assert math.degrees(math.hypot(*(q[f"gaze_{k}"] for k in range(3)))) == pytest.approx(30.0, abs=1e-9)


def test_singular_and_plural_in_the_subtitle(browser: Any, folder: Path) -> None:
    text = f"thingc: assembly/1\nname: alone\ncomponents:\n  palm: {{{MASS}}}\nmodes: {{still: {{root: palm}}}}\n"
    with page_of(browser, folder, text) as page:
        assert page.locator("#subtitle").text_content() == "100.00 g, 1 link, 0 joints"


def test_robot_without_geometry_is_shown_by_its_frames(browser: Any, folder: Path) -> None:
    with page_of(browser, folder, FINGER) as page:
        page.evaluate("thingc.viewer.toggle('frames'); thingc.viewer.toggle('names')")
        drawn(page)
        assert page.locator("#labels span").all_inner_texts() == ["palm", "one", "two", "eye", "tip"]
        assert 0.05 < page.evaluate("thingc.viewer.stage.size") < 0.5  # 100 mm long


@pytest.mark.parametrize("fragment", [
    "q=lead:9,spin:1e300,toString:1,:,lead", "camera=0,0,0,0,0,0", "camera=1e308,0,0,0,0,0", "section=x", "%%%=&q=&mode=no",
])
def test_invalid_url_fragments_are_ignored(browser: Any, folder: Path, fragment: str) -> None:
    with page_of(browser, folder, FINGER, f"#{fragment}") as page:
        drawn(page)
        assert -1.0 < q_of(page)["lead"] <= math.radians(55) + 1e-12
        away = page.evaluate("thingc.viewer.stage.camera.position.distanceTo(thingc.viewer.stage.controls.target)")
        assert 0.01 < away < 10.0
        assert page.evaluate("thingc.viewer.options.section.part") == 0.5


def test_floating_base_can_be_moved_and_is_in_the_url(browser: Any, folder: Path) -> None:
    with page_of(browser, folder, FINGER, "#mode=adrift") as page:
        moved = """() => { const { viewer } = thingc, link = viewer.robot.links.findIndex(({ name }) => name === "one");
          const zero = viewer.stage.camera.position.clone().set(0, 0, 0);
          viewer.pull(link, zero, zero.clone().set(0.1, 0.2, 0.3)); return viewer.links(); }"""
        before = page.evaluate(moved)
        assert np.allclose(np.array(before["one"]).reshape(4, 4)[:3, 3], [0.1, 0.2, 0.3])
        drawn(page)
        until(page, "() => location.hash.includes('base=')")
        fragment = page.evaluate("location.hash")
    with page_of(browser, folder, FINGER, fragment) as page:
        after = page.evaluate("thingc.viewer.links()")
        assert max(np.abs(np.array(after[name]) - np.array(before[name])).max() for name in before) < 1e-9
    with page_of(browser, folder, FINGER, "#mode=still") as page:
        assert "cannot move" in page.evaluate("thingc.viewer.whyFixed(0)")


def test_base_moves_as_its_mode_allows(browser: Any, folder: Path, tmp_path: Path) -> None:
    """Sliders of a planar base against MuJoCo's joints, those of a ball and a floating base against matrices: rotations are rotation
    vectors in the axes of `at`, about its origin."""
    compiled_there = compiled(tmp_path, FINGER)
    at = np.eye(4)
    at[:3, :3], at[:3, 3] = Rotation.from_euler("xyz", [20, -30, 40], degrees=True).as_matrix(), [0.03, 0.02, 0.01]
    with page_of(browser, folder, FINGER, "#mode=rolling") as page:
        slide(page, {"base x": 25, "base y": -40, "base about z": 70})
        assert "\njoint root_2 in exported models" in str(page.locator(".joint", has_text="base about z").get_attribute("title"))
        model = compiled_there.model("rolling")
        data = mujoco.MjData(model)
        for name, value in (("root_0", 0.025), ("root_1", -0.04), ("root_2", math.radians(70))):
            data.joint(name).qpos = data.joint(name).qpos + value
        data.joint("follow").qpos = q_of(page)["follow"]
        mujoco.mj_forward(model, data)
        placed = page.evaluate("thingc.viewer.links()")
        for name, numbers in placed.items():
            assert np.abs(np.array(numbers).reshape(4, 4) - pose_of(data.body(name))).max() < 1e-9, name
        page.get_by_role("button", name="Copy a link to this view").click()
        fragment = page.evaluate("location.hash")
        # what is drawn by a pointer goes along the plane alone
        page.evaluate("""() => { const zero = thingc.viewer.stage.camera.position.clone().set(0, 0, 0);
          thingc.viewer.pull(0, zero, zero.clone().set(0.3, 0.3, 0.3)); }""")
        before, after = (np.array(found["palm"]).reshape(4, 4) for found in (placed, page.evaluate("thingc.viewer.links()")))
        moved = np.linalg.inv(at)[:3, :3] @ (after - before)[:3, 3]
        assert abs(moved[2]) < 1e-9 < 0.1 < np.linalg.norm(moved) and np.allclose(after[:3, :3], before[:3, :3], atol=1e-9)
        page.evaluate("thingc.viewer.setMode('turning')")
        home = np.array(page.evaluate("thingc.viewer.links()")["palm"]).reshape(4, 4)
        slide(page, dict(zip(TURNS, (30, -50, 80), strict=True)))
        turn = np.eye(4)
        turn[:3, :3] = Rotation.from_rotvec(np.radians([30, -50, 80])).as_matrix()
        found = np.array(page.evaluate("thingc.viewer.links()")["palm"]).reshape(4, 4)
        assert np.abs(found - at @ turn @ np.linalg.inv(at) @ home).max() < 1e-9
        assert [page.get_by_role("spinbutton", name=f"{turn} value").input_value() for turn in TURNS] == ["30.0", "-50.0", "80.0"]
        page.evaluate("thingc.viewer.setMode('adrift')")
        home = np.array(page.evaluate("thingc.viewer.links()")["one"]).reshape(4, 4)
        slide(page, {"base z": -50, "base about y": 90})
        turn[:3, :3], turn[:3, 3] = Rotation.from_rotvec([0, math.pi / 2, 0]).as_matrix(), [0, 0, -0.05]
        at[:3, :3], at[:3, 3] = np.eye(3), [0, 0, 0.2]
        found = np.array(page.evaluate("thingc.viewer.links()")["one"]).reshape(4, 4)
        assert np.abs(found - at @ turn @ np.linalg.inv(at) @ home).max() < 1e-9
    with page_of(browser, folder, FINGER, fragment) as page:
        again = page.evaluate("thingc.viewer.links()")
        assert max(np.abs(np.array(again[name]) - np.array(placed[name])).max() for name in placed) < 1e-8


TURNS = ("base about x", "base about y", "base about z")


def slide(page: Any, values: Mapping[str, float]) -> None:
    """Type values [deg or mm] of coordinates into the number fields."""
    for name, value in values.items():
        page.get_by_role("spinbutton", name=f"{name} value").fill(str(value))
        page.get_by_role("spinbutton", name=f"{name} value").press("Enter")


def test_base_stops_where_a_hold_would_open(browser: Any, folder: Path) -> None:
    """A planar base whose other end is held: joints follow its motion, and beyond their reach it stops with the hold still closed."""
    with page_of(browser, folder, REACHER, "#mode=pinned") as page:
        held, q = np.array(page.evaluate("thingc.viewer.links()")["three"]), q_of(page)
        slide(page, {"base x": 5})
        assert page.evaluate("thingc.viewer.message") == "" and abs(q_of(page)["second"] - q["second"]) > 1e-2
        slide(page, {"base x": -500})
        assert "The base cannot move further" in page.locator("#message").inner_text()
        assert -0.15 < page.evaluate("thingc.viewer.configuration.moves.read(thingc.viewer.configuration.base)[0]") < -0.01
        assert np.abs(np.array(page.evaluate("thingc.viewer.links()")["three"]) - held).max() < 1e-6


def test_fixed_base_is_not_moved_by_a_url(browser: Any, folder: Path) -> None:
    with page_of(browser, folder, FINGER, "#mode=still&q=lead:0.1&base=1,0,0,0.5,0,1,0,0,0,0,1,0") as page:
        assert page.evaluate("thingc.viewer.configuration.atHome") and q_of(page)["lead"] == pytest.approx(0.1)
        assert page.locator("h2", has_text="Base").count() == 0
