"""The page in a real browser: link poses equal those of MuJoCo and of matrices; buttons, sliders, links and keys work."""

from __future__ import annotations

import base64
import io
import json
import math
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from PIL import Image

from conformance.simulation import links as bodies_of_links
from emit import small_robot
from graph.builder import link_names
from loops.robots import compiled
from mjcf.test_joined import LEGS, MODES
from robot.test_spanning_tree_properties import build, robots
from thingc.geometry.store.local import Store
from thingc.model.assembly.kinematics import coordinates, joints_of
from thingc.model.robot.kinematics import body_poses
from thingc.model.statics.efforts import loads
from thingc.targets.html.emit import Page
from thingc.targets.html.mesh_packing import PackedMeshes
from thingc.targets.html.viewer_data import describe
from viewer.browser import address, drawn, links, needed, opened, spot, until
from viewer.conftest import Pages
from viewer.test_page import element

pytestmark = [needed, pytest.mark.slow]

NEAR = 1e-5
"""Allowed deviation [m] of the pose of a link in the page."""


def model_of(folder: Path, robot: str, mode: str) -> tuple[Any, Any]:
    model = mujoco.MjModel.from_xml_path(str(folder / f"mjcf/{robot}_{mode}.xml"))
    return model, mujoco.MjData(model)


def assert_as_in_mujoco(found: dict[str, list[float]], model: Any, data: Any) -> None:
    """Assert that every link of the page has the pose of MuJoCo's body with its name."""
    assert sorted(found) == bodies_of_links(model)
    for name, numbers in found.items():
        pose, body = np.array(numbers).reshape(4, 4), data.body(name)
        assert np.abs(pose[:3, 3] - body.xpos).max() < NEAR and np.abs(pose[:3, :3] - body.xmat.reshape(3, 3)).max() < NEAR, name


@pytest.fixture(scope="module")
def undrawn_pages(browser: Any, pages: Pages) -> Iterator[dict[str, Any]]:
    """Yield the page of each robot for tests of numbers. Opening takes a second, so the pages are shared; each test sets the mode and
    the configuration."""
    with ExitStack() as stack:
        found = {}
        for robot in ("arm", "minchw"):
            found[robot] = stack.enter_context(opened(browser, address(getattr(pages, robot) / f"html/{robot}.html")))
        yield found


@pytest.mark.parametrize("robot", ["arm", "minchw"])
def test_poses_of_every_mode_match_mujoco(undrawn_pages: dict[str, Any], pages: Pages, robot: str) -> None:
    folder, page = getattr(pages, robot), undrawn_pages[robot]
    modes = json.loads((folder / "modes.json").read_text())
    for mode, told in modes.items():
        page.get_by_role("radiogroup", name="mode").get_by_role("radio", name=mode, exact=True).click()
        model, data = model_of(folder, robot, mode)
        for pose in told["poses"]:
            page.get_by_role("radiogroup", name="pose").get_by_role("radio", name=pose, exact=True).click()
            mujoco.mj_resetDataKeyframe(model, data, model.key(pose).id)
            mujoco.mj_forward(model, data)
            assert_as_in_mujoco(links(page), model, data)


def test_random_trees_with_every_joint_type(browser: Any, pages: Pages, tmp_path: Path) -> None:
    """Link poses and joint loads in the page equal those of the compiler, at random q, in modes that traverse joints backwards, and with
    several joints on one body."""
    rng = np.random.default_rng(7)
    joined = compiled(tmp_path, LEGS + MODES).compilation.assembly
    assert joined is not None and len(joined.between) == 4
    with opened(browser, address(pages.arm / "html/arm.html")) as page:
        for assembly, far in ((joined, 0.5), *((build(seed, 6).assembly, 2.0) for seed in range(4))):
            made = robots(assembly)
            told = describe(assembly, list(made.values()), small_robot.WORKSPACE, PackedMeshes(Store(str(tmp_path))))
            for one in told["occurrences"]:  # type: ignore[attr-defined]
                one["visual"], one["collision"] = [], []
            page.evaluate("(told) => thingc.viewer.load(told, [])", json.loads(json.dumps(told)))
            for name, robot in made.items():
                q = coordinates(joints_of(assembly), {joint.path: float(rng.uniform(-far, far)) for joint in joints_of(assembly)})
                there = """([mode, q]) => { thingc.viewer.setMode(mode); thingc.viewer.restore(q);
                  return [thingc.viewer.links(), thingc.viewer.loads()]; }"""
                found, borne = page.evaluate(there, [name, q])
                assert borne == pytest.approx(loads(robot, q, body_poses(robot, q)), rel=1e-9, abs=1e-9)
                for link, pose in zip(link_names(robot), body_poses(robot, q), strict=True):
                    assert np.abs(np.array(found[link]).reshape(4, 4) - np.array(pose.rows())).max() < 1e-9


def test_normals_are_averaged_over_faces_of_the_same_vertex(undrawn_pages: dict[str, Any]) -> None:
    """The normal of a corner is the mean of the unit normals of all faces at its vertex that deviate by less than 0.55 rad, and of no other
    faces, however near."""
    meshes = undrawn_pages["arm"].evaluate("""() => {
      const smallest = thingc.viewer.geometries.toSorted((a, b) => a.attributes.position.count - b.attributes.position.count).slice(0, 4);
      return smallest.map(({ attributes }) => [[...attributes.position.array], [...attributes.normal.array]]); }""")
    rounded = 0
    for numbers, told in meshes:
        corners = np.array(numbers).reshape(-1, 3)
        faces = np.repeat(np.cross(corners[1::3] - corners[::3], corners[2::3] - corners[::3]), 3, axis=0)
        faces /= np.linalg.norm(faces, axis=1, keepdims=True)
        same = (corners[:, None] == corners).all(axis=2) & (faces @ faces.T > math.cos(0.55))
        means = same @ faces
        means /= np.linalg.norm(means, axis=1, keepdims=True)
        assert np.abs(np.array(told).reshape(-1, 3) - means).max() < 1e-3  # of float32 triangles
        rounded += (np.abs(means - faces).max(axis=1) > 0.01).sum()
    assert rounded > 20


FOOT = """\
thingc: assembly/1
name: foot
components:
  foot:
    link: true
    mass: 1 kg
    shapes: [{box: 40 20 10 mm}]
    collision: {modes: {ball: {shapes: [{sphere: {radius: 6 mm}}]}, ghost: none}}
modes: {plain: {root: foot}, ball: {root: foot, gravity: wall}, ghost: {root: foot, gravity: ceiling}}
"""


def test_modes_show_their_own_collision_shapes(browser: Any, pages: Pages, tmp_path: Path) -> None:
    made = compiled(tmp_path, FOOT).compilation
    assert made.assembly is not None
    told = describe(made.assembly, made.robots, small_robot.WORKSPACE, PackedMeshes(Store(str(tmp_path))))
    there = """(mode) => { const { viewer } = thingc; viewer.setMode(mode);
      return viewer.stage.batches.filter((one) => one.collides).map((one) => one.mesh.geometry.type); }"""
    with opened(browser, address(pages.arm / "html/arm.html")) as page:
        page.evaluate("(told) => thingc.viewer.load(told, [])", json.loads(json.dumps(told)))
        shown = {mode: page.evaluate(there, mode) for mode in ("ball", "plain", "ghost")}
        page.evaluate("() => { thingc.viewer.setMode('ball'); thingc.viewer.setVisibility([], [0]); }")
        assert page.evaluate(there, "ball") == shown["ball"]
    assert shown == {"ball": ["SphereGeometry"], "plain": ["BoxGeometry"], "ghost": []}


@pytest.mark.parametrize("robot", ["arm", "minchw"])
def test_margins_of_any_configuration(undrawn_pages: dict[str, Any], pages: Pages, robot: str) -> None:
    """Torque margins of the drives: in poses they equal those of the compiler, elsewhere those of MuJoCo's inverse dynamics at rest, if
    the loads are those of a tree. Load sharing of loops and feet is known only in poses, and the page reports this."""
    folder, page, rng = getattr(pages, robot), undrawn_pages[robot], np.random.default_rng(3)
    told = json.loads(element((folder / f"html/{robot}.html").read_text(), "thingc-robot"))
    limits = {joint["path"]: joint["effort"] for joint in told["joints"]}
    there = "([mode, q]) => { const { viewer } = thingc; viewer.setMode(mode); viewer.restore(q); return viewer.held(); }"
    trees = 0
    for mode in told["modes"]:
        for pose in mode["poses"]:
            posed = "(at) => { thingc.viewer.setMode(at[0]); thingc.viewer.setPose(at[1]); return thingc.viewer.held().margins; }"
            assert page.evaluate(posed, [mode["name"], pose["name"]]) == pytest.approx(pose["margins"], rel=1e-6), pose["name"]
        paths = [joint["path"] for body in mode["bodies"] for joint in body["joints"]]
        model, data = model_of(folder, robot, mode["name"])
        for _ in range(3):
            q = {path: float(rng.uniform(*np.clip(model.joint(path).range, -3, 3))) for path in paths}
            held = page.evaluate(there, [mode["name"], q])
            if mode["loops"] or mode["base"] == "free":
                assert held["margins"] == {} and ("known only for named poses" in held["note"] or "free base" in held["note"])
                continue
            trees += 1
            for path, value in q.items():
                data.joint(path).qpos = value
            mujoco.mj_forward(model, data)
            dof = {path: model.joint(path).dofadr[0] for path in mode["driven"]}
            borne = {path: data.qfrc_bias[at] - data.qfrc_spring[at] for path, at in dof.items()}
            margins = {path: limits[path] / abs(effort) for path, effort in borne.items() if abs(effort) > 1e-12}
            # where a joint bears next to nothing (1e-6 of its limit) a margin is the rounding of two programs
            assert {path: min(margin, 1e6) for path, margin in held["margins"].items()} == pytest.approx(
                {path: min(margin, 1e6) for path, margin in margins.items()}, rel=1e-6)
    assert trees >= 6


def test_margins_follow_a_slider(browser: Any, pages: Pages) -> None:
    """The colours of the picture and the legend are updated for the current configuration."""
    with opened(browser, address(pages.arm / "html/arm.html", "#mode=bench&pose=home&colour=torque+margin")) as page:
        seen = []
        for angle in (0, 60):
            page.get_by_role("spinbutton", name="shoulder value").fill(str(angle))
            page.get_by_role("spinbutton", name="shoulder value").press("Enter")
            drawn(page)
            seen.append((page.locator("#legend").inner_text(), picture(page)))
            margin = page.evaluate("thingc.viewer.held().margins.shoulder")
            assert f"\nshoulder: {margin:.2f}\n" in seen[-1][0]
        assert seen[0][0] != seen[1][0] and "effort limit of the drive / effort required" in seen[0][0]


def test_slider_moves_its_joint_within_limits(browser: Any, pages: Pages) -> None:
    with opened(browser, address(pages.arm / "html/arm.html")) as page:
        page.get_by_role("spinbutton", name="shoulder").fill("-20")
        page.get_by_role("spinbutton", name="shoulder").press("Enter")
        assert page.evaluate("thingc.viewer.q.shoulder") == pytest.approx(math.radians(-20), abs=1e-12)
        page.get_by_role("slider", name="elbow").focus()
        page.keyboard.press("End")
        assert page.evaluate("thingc.viewer.q.elbow") == pytest.approx(math.radians(130), abs=1e-3)
        page.get_by_role("spinbutton", name="wrist").fill("500")
        page.get_by_role("spinbutton", name="wrist").press("Enter")
        assert page.evaluate("thingc.viewer.q.wrist") == pytest.approx(math.radians(90), abs=1e-12)
        model, data = model_of(pages.arm, "arm", "bench")
        for joint in ("yaw", "shoulder", "elbow", "wrist"):
            data.joint(joint).qpos = page.evaluate(f"thingc.viewer.q.{joint}")
        mujoco.mj_forward(model, data)
        assert_as_in_mujoco(links(page), model, data)
        # no pose has these coordinates any more
        assert page.locator(".poses [aria-checked=true]").count() == 0


def test_loops_stay_closed_while_a_joint_is_moved(undrawn_pages: dict[str, Any], pages: Pages) -> None:
    """MInchW's bridge is held at both feet. A joint moved by a slider moves other joints, and both soles stay in place, by MuJoCo's own
    equality residuals."""
    page = undrawn_pages["minchw"]
    page.evaluate("() => { thingc.viewer.setMode('bridge'); thingc.viewer.setPose('arched'); }")
    page.get_by_role("tab", name="Joints").click()
    before = links(page)
    start = page.evaluate("({...thingc.viewer.q})")
    page.get_by_role("spinbutton", name="front/knee").fill(str(math.degrees(start["front/knee"]) - 4))
    page.get_by_role("spinbutton", name="front/knee").press("Enter")
    q, after = page.evaluate("({...thingc.viewer.q})"), links(page)
    assert q["front/knee"] == pytest.approx(start["front/knee"] - math.radians(4), abs=1e-12)
    assert max(abs(q[name] - start[name]) for name in q if name != "front/knee") > 0.01
    for foot in ("front/foot", "rear/foot"):
        assert np.abs(np.array(before[foot]) - np.array(after[foot])).max() < 1e-6
    model, data = model_of(pages.minchw, "minchw", "bridge")
    mujoco.mj_resetDataKeyframe(model, data, model.key("arched").id)
    for name, value in q.items():
        data.joint(name).qpos = value
    mujoco.mj_forward(model, data)
    assert_as_in_mujoco(after, model, data)
    # far out there is no way to keep both: the page says so, and stays closed
    page.get_by_role("spinbutton", name="front/knee").fill("-115")
    page.get_by_role("spinbutton", name="front/knee").press("Enter")
    assert "cannot be closed there" in page.locator("#message").inner_text()
    assert np.abs(np.array(links(page)["front/foot"]) - np.array(after["front/foot"])).max() < 1e-6


def test_link_is_dragged_to_the_pointer(browser: Any, pages: Pages) -> None:
    with opened(browser, address(pages.arm / "html/arm.html", "#mode=bench&pose=home")) as page:
        drawn(page)
        x, y = spot(page, "hand/pen")
        target = (x - 60, y - 50)
        start = links(page)["hand_link"]
        page.keyboard.down("Shift")
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(*target, steps=6)
        page.mouse.up()
        page.keyboard.up("Shift")
        drawn(page)
        assert np.abs(np.array(links(page)["hand_link"]) - np.array(start)).max() > 0.01
        # what was under the pointer is under it now
        under = page.evaluate("([x, y]) => thingc.viewer.robot.occurrences[thingc.viewer.hit(x, y).occurrence].link", list(target))
        assert page.evaluate(f"thingc.viewer.robot.links[{under}].name") == "hand_link"
        for name, joint in (("yaw", 150), ("shoulder", 170), ("elbow", 130), ("wrist", 90)):
            assert abs(page.evaluate(f"thingc.viewer.q.{name}")) <= math.radians(joint) + 1e-12


def test_supports_of_a_mode_stay_fixed(undrawn_pages: dict[str, Any]) -> None:
    page = undrawn_pages["minchw"]
    page.evaluate("() => { thingc.viewer.setMode('bridge'); thingc.viewer.setPose('arched'); }")
    names = page.evaluate("thingc.viewer.robot.links.map((link) => link.name)")
    for foot in ("front/foot", "rear/foot"):
        assert f"{foot} " in page.evaluate(f"thingc.viewer.whyFixed({names.index(foot)})")
    assert page.evaluate(f"thingc.viewer.whyFixed({names.index('body')})") is None


def test_click_shows_details_of_a_part(browser: Any, pages: Pages) -> None:
    with opened(browser, address(pages.arm / "html/arm.html", "#mode=bench&pose=home")) as page:
        drawn(page)
        page.mouse.click(*spot(page, "hand/pen"))
        card = page.get_by_role("region", name="Selection")
        text = card.inner_text()
        for words in ("hand/pen", "arm:PenDummy", "21.19 g, derived", "hand_link", "end_effector.yaml:", "parts/arm.py:"):
            assert words in text, (words, text)
        page.get_by_role("tab", name="Parts").click()
        assert page.locator("#panel-tree [aria-pressed=true]").first.inner_text().startswith("pen")
        page.keyboard.press("Escape")
        assert card.is_hidden()


def test_link_tree_follows_the_mode(browser: Any, pages: Pages) -> None:
    """Links are in the order of MuJoCo's bodies and select their parts. A joint shows its type and coordinate, and selects the parts
    that it moves."""
    with opened(browser, address(pages.arm / "html/arm.html", "#mode=bench&pose=home")) as page:
        page.get_by_role("tab", name="Parts").click()
        page.get_by_role("radio", name="Links and joints").click()
        rows = page.locator("#panel-tree li button:visible")
        for mode in ("drawing", "bench"):
            page.evaluate(f"thingc.viewer.setMode('{mode}')")
            model, _ = model_of(pages.arm, "arm", mode)
            bodies = [model.body(number).name for number in range(1, model.nbody)]
            labels = rows.evaluate_all("(rows) => rows.map((row) => row.firstChild.data)")
            assert [name for name in labels if name in bodies] == [name for name in bodies if name in labels] == [*links(page)]
        chosen = """(({ robot, choice }) =>
          [...new Set([...choice].map((one) => robot.links[robot.occurrences[one].link].name))])(thingc.viewer)"""
        rows.filter(has_text="hand_link").focus()
        page.keyboard.press("Enter")
        assert page.evaluate(chosen) == ["hand_link"]
        page.evaluate("thingc.viewer.setCoordinate('wrist', -0.5)")
        wrist = rows.filter(has_text="wrist")
        assert "revolute, -28.6 deg" in wrist.inner_text()
        wrist.focus()
        assert page.evaluate("thingc.viewer.hovered") == "wrist"
        wrist.click()
        assert page.evaluate(chosen) == ["hand_link"]
        page.get_by_role("searchbox").fill("elbow")
        assert "elbow" in " ".join(rows.all_inner_texts()) and rows.filter(has_text="shoulder").count() < 2
        page.get_by_role("searchbox").fill("nothing of this name")
        assert page.get_by_text("No results").is_visible() and rows.count() == 0


def test_bom_row_highlights_all_its_pieces(undrawn_pages: dict[str, Any]) -> None:
    page = undrawn_pages["arm"]
    page.get_by_role("tab", name="BOM").click()
    page.locator("#panel-bom tr", has_text="XM430").click()
    chosen = page.evaluate("[...thingc.viewer.choice].map((one) => thingc.viewer.robot.occurrences[one].path)")
    assert chosen == ["yaw_servo", "shoulder_servo", "elbow_servo", "wrist_servo"]
    assert "4 components" in page.locator("#card").inner_text() and "328.00 g" in page.locator("#card").inner_text()


def test_url_restores_the_view(browser: Any, pages: Pages) -> None:
    with opened(browser, address(pages.minchw / "html/minchw.html")) as page:
        page.evaluate("""() => {
          const { viewer } = thingc;
          viewer.setMode("crawl_wall");
          viewer.setCoordinate("front/knee", 0.4);
          viewer.setOptions({ shown: "both", marks: new Set(["frames", "names"]), colouring: "link", theme: "dark" });
          viewer.setOptions({ explode: 0.3, section: { axis: "y", part: 0.4, flip: true } });
          viewer.choose([3, 5]);
          viewer.stage.camera.position.set(0.5, 0.4, 0.6);
          viewer.stage.controls.update();
        }""")
        drawn(page)
        until(page, "() => location.hash.includes('explode') && location.hash.includes('0.6%2C')")
        fragment = page.evaluate("location.hash")
        state = """(() => { const { mode, options, choice, stage } = thingc.viewer;
          const camera = stage.camera.position.toArray().map((x) => x.toFixed(4));
          return JSON.stringify([mode.name, { ...options, marks: [...options.marks].sort() }, [...choice], camera]); })()"""
        before, placed = page.evaluate(state), links(page)
    with opened(browser, address(pages.minchw / "html/minchw.html", fragment)) as page:
        assert page.evaluate(state) == before
        again = links(page)
        assert max(np.abs(np.array(again[name]) - np.array(placed[name])).max() for name in placed) < 1e-8


def test_distance_between_two_mounts(undrawn_pages: dict[str, Any], pages: Pages) -> None:
    """The distance in the panel equals that of MuJoCo's sites."""
    page = undrawn_pages["minchw"]
    page.evaluate("() => { thingc.viewer.setMode('front_foot'); thingc.viewer.setPose('arched'); }")
    page.get_by_role("tab", name="Measure").click()
    page.get_by_label("from mount").select_option("front_sole")
    page.get_by_label("to mount").select_option("rear_sole")
    shown = page.locator("#panel-measure").inner_text()
    model, data = model_of(pages.minchw, "minchw", "front_foot")
    mujoco.mj_resetDataKeyframe(model, data, model.key("arched").id)
    mujoco.mj_forward(model, data)
    away = 1000 * np.linalg.norm(data.site("front_sole").xpos - data.site("rear_sole").xpos)
    assert f"{away:.3f} mm" in shown


def picture(page: Any) -> np.ndarray[Any, Any]:
    """Return the rendered picture without overlays."""
    return np.asarray(Image.open(io.BytesIO(page.locator("#canvas").screenshot())).convert("RGB"), dtype=np.int16)


def test_every_display_option_changes_the_picture(browser: Any, pages: Pages) -> None:
    """Pixels differ for every option, and equal the first picture after all options are reset."""
    with opened(browser, address(pages.arm / "html/arm.html", "#mode=bench&pose=home&theme=light"), (420, 320)) as page:
        drawn(page)
        plain = picture(page)
        assert len(np.unique(plain.reshape(-1, 3), axis=0)) > 100  # there is a robot
        marks = ("frames", "joint axes", "mounts", "centres of mass", "inertia", "names")
        ways = [
            "{ shown: 'collision' }", "{ shown: 'both' }", "{ explode: 0.6 }", "{ section: { axis: 'x', part: 0.5 } }", "{ theme: 'dark' }",
            *(f"{{ colouring: '{by}' }}" for by in ("link", "material", "mass source", "definition", "torque margin")),
            *(f"{{ marks: new Set(['floor', '{mark}']) }}" for mark in marks),
        ]
        seen = [plain]
        page.evaluate("() => { globalThis.before = { ...thingc.viewer.options }; }")
        for way in ways:
            page.evaluate(f"thingc.viewer.setOptions({{ ...before, ...{way} }})")
            drawn(page)
            seen.append(picture(page))
            assert all(np.abs(seen[-1] - other).max() > 30 for other in seen[:-1]), way
        page.evaluate("thingc.viewer.setOptions(before)")
        drawn(page)
        assert np.abs(picture(page) - plain).max() <= 2  # the background is dithered


def test_section_shows_solids(browser: Any, pages: Pages) -> None:
    """A cube of 100 mm is cut in the middle and seen from above: exactly the pixels of the cut have its colour, hatched; the other half
    is invisible. One more draw call draws the cut, and one for each solid computes it."""
    told = json.loads(element((pages.arm / "html/arm.html").read_text(), "thingc-robot"))
    for one in told["occurrences"]:
        one |= {"visual": [], "collision": []}
    box = {"shape": "box", "size": [0.05, 0.05, 0.05], "pose": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0]}
    told["occurrences"][0] |= {"collision": [box], "color": "#cc3333", "pose": box["pose"]}
    grid = [(x, y) for x in np.linspace(-0.06, 0.06, 25) for y in np.linspace(-0.06, 0.06, 25)]
    within = np.array([max(abs(x), abs(y)) < 0.047 for x, y in grid])
    beside = np.array([max(abs(x), abs(y)) > 0.053 for x, y in grid])
    with opened(browser, address(pages.arm / "html/arm.html", "#mode=bench&theme=light")) as page:
        page.evaluate("""(told) => { const { viewer } = thingc; viewer.load(told, []);
          viewer.setOptions({ shown: "collision", marks: new Set() }); viewer.reset([0.3, -0.2, 1]); }""", told)
        drawn(page)
        before, whole = page.evaluate("thingc.viewer.stage.calls"), picture(page)
        page.evaluate("thingc.viewer.cut('z')")
        drawn(page)
        assert page.evaluate("thingc.viewer.stage.calls") == before + 2
        middle = np.array(page.evaluate("thingc.viewer.links()")["base_link"]).reshape(4, 4)[:3, 3]
        spots = page.evaluate("""(grid) => { const { stage } = thingc.viewer, one = stage.camera.position;
          return stage.project(grid.map((at) => one.clone().set(...at))).map(({ x, y }) => [Math.floor(y), Math.floor(x)]); }""",
          [[*(middle + [x, y, 0.0]).tolist()] for x, y in grid])  # fmt: skip
        rows, columns = np.array(spots).T
        cut = picture(page)
        seen = cut[rows, columns]
        face = 255 * np.where((flat := 0.7 * linear("#cc3333") + 0.09) > 0.0031308, 1.055 * flat ** (1 / 2.4) - 0.055, 12.92 * flat)
        plain = np.abs(seen - face).max(axis=1) < 4
        assert 0.6 < plain[within].mean() < 0.95 and not plain[beside].any()
        lines = (seen[within & ~plain] < face + 4).all(axis=1)  # they are darker; what is left is the ring around the root
        assert lines.mean() > 0.8 and seen[within & ~plain][lines][:, 0].min() < face[0] - 20
        page.get_by_role("tab", name="Display").click()
        page.get_by_role("button", name="Flip").click()
        drawn(page)
        assert page.evaluate("thingc.viewer.stage.calls") == before
        assert not (np.abs(picture(page)[rows, columns] - face).max(axis=1) < 4).any() and np.abs(whole - cut).max() > 30


def linear(color: str) -> np.ndarray[Any, Any]:
    """Return the three components of an sRGB colour as linear light (IEC 61966-2-1)."""
    parts = np.array([int(color[k : k + 2], 16) for k in (1, 3, 5)]) / 255
    return np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)


def test_exploded_view_stays_in_the_picture(browser: Any, pages: Pages) -> None:
    with opened(browser, address(pages.arm / "html/arm.html", "#mode=bench&pose=home")) as page:
        page.get_by_role("tab", name="Display").click()
        camera = "[...thingc.viewer.stage.camera.position.toArray(), ...thingc.viewer.stage.controls.target.toArray()]"
        before = page.evaluate(camera)
        slider = page.get_by_role("slider", name="explode")
        slider.fill("0.4")
        slider.fill("1")
        drawn(page)
        width, height = page.evaluate("[thingc.viewer.stage.canvas.clientWidth, thingc.viewer.stage.canvas.clientHeight]")
        for spot in page.evaluate("""thingc.viewer.stage.project(thingc.viewer.robot.occurrences.map((one, index) =>
          thingc.viewer.stage.camera.position.clone().fromArray(one.centre).applyMatrix4(thingc.viewer.drawn[index])))"""):
            assert 0 < spot["x"] < width and 0 < spot["y"] < height
        exploded = page.evaluate(camera)
        slider.fill("0")
        assert page.evaluate(camera) == pytest.approx(before, abs=1e-9)
        # a link that says nothing of the camera shows all of it, too, and cuts it at the same place as the page that it came from
        page.evaluate("location.hash = '#mode=bench&pose=home&explode=1&section=x:0.4'")
        until(page, "thingc.viewer.options.explode === 1")
        assert page.evaluate(camera) == pytest.approx(exploded, abs=1e-9)
        framed = "[...thingc.viewer.stage.framed.min.toArray(), ...thingc.viewer.stage.framed.max.toArray()]"
        box = page.evaluate(framed)
    with opened(browser, address(pages.arm / "html/arm.html", "#mode=bench&pose=home&explode=1&camera=9,9,9,0,0,0")) as page:
        assert page.evaluate(framed) == pytest.approx(box, abs=1e-9)


@pytest.mark.parametrize("size", [(1300, 420), (460, 900)])
def test_robot_fills_a_wide_or_narrow_window(browser: Any, pages: Pages, size: tuple[int, int]) -> None:
    """From every side all corners of the robot's box are in the picture, and one of them is near the border."""
    corners = """() => { const { stage } = thingc.viewer, { min, max } = stage.bounds(); stage.camera.updateMatrixWorld();
      return [0, 1, 2, 3, 4, 5, 6, 7].map((k) => stage.world.localToWorld(min.clone().set(
        (k & 1 ? min : max).x, (k & 2 ? min : max).y, (k & 4 ? min : max).z)).project(stage.camera).toArray().slice(0, 2)); }"""
    with opened(browser, address(pages.minchw / "html/minchw.html", "#mode=front_foot&pose=arched&panels=none"), size) as page:
        for view in ("undefined", "[1, 0, 0]", "[0, -1, 0]", "[0, -1e-4, 1]"):
            page.evaluate(f"thingc.viewer.reset({view})")
            assert 0.89 < np.abs(page.evaluate(corners)).max() < 0.92, view


def test_robot_stays_visible_in_a_narrower_window(browser: Any, pages: Pages) -> None:
    """As on a phone that is rotated, or whose panels are hidden."""
    with opened(browser, address(pages.arm / "html/arm.html"), (800, 400)) as page:
        shown = "(({ stage }) => [stage.shows(stage.bounds()), stage.camera.aspect < 0.9])(thingc.viewer)"
        assert page.evaluate(shown) == [True, False]
        page.set_viewport_size({"width": 400, "height": 800})
        page.get_by_role("button", name="Show or hide the panels").click()
        until(page, "() => thingc.viewer.stage.camera.aspect < 0.9")
        assert page.evaluate(shown) == [True, True]


def test_number_of_draw_calls_is_limited(browser: Any, pages: Pages) -> None:
    """There are at most definitions x materials + 20 draw calls. A section draws every definition once more. Script time per frame is
    measured in the benchmarks."""
    for robot in ("arm", "minchw"):
        with opened(browser, address(getattr(pages, robot) / f"html/{robot}.html"), (420, 320)) as page:
            page.evaluate("['frames', 'mounts', 'joint axes', 'inertia', 'centres of mass'].forEach((mark) => thingc.viewer.toggle(mark))")
            drawn(page)
            calls = page.evaluate("thingc.viewer.stage.calls")
            kinds = page.evaluate("new Set(thingc.viewer.robot.occurrences.map((one) => one.definition + ' ' + one.material)).size")
            assert 0 < calls <= kinds + 20
            page.evaluate("thingc.viewer.cut('x')")
            drawn(page)
            assert calls < page.evaluate("thingc.viewer.stage.calls") <= 2 * kinds + 20


def test_keyboard_shortcuts(browser: Any, pages: Pages) -> None:
    with opened(browser, address(pages.arm / "html/arm.html", "#mode=bench&pose=home")) as page:
        page.locator("#canvas").focus()
        page.keyboard.press("m")
        assert page.evaluate("thingc.viewer.mode.name") == "drawing"
        page.keyboard.press("Shift+M")
        assert page.evaluate("thingc.viewer.mode.name") == "bench"
        page.keyboard.press("p")
        assert page.evaluate("thingc.viewer.pose.name") == "stretched"
        page.keyboard.press("v")
        assert page.evaluate("thingc.viewer.options.shown") == "collision"
        page.keyboard.press("j")
        assert page.evaluate("thingc.viewer.options.marks.has('joint axes')")
        page.keyboard.press("?")
        assert page.get_by_role("dialog").is_visible()
        page.keyboard.press("Escape")
        page.keyboard.press("/")
        page.keyboard.type("pen")
        assert page.locator("#panel-tree li:visible").count() in range(1, 6)


def test_picture_can_be_saved(browser: Any, pages: Pages) -> None:
    with opened(browser, address(pages.arm / "html/arm.html", "#mode=bench&pose=home")) as page:
        drawn(page)
        with page.expect_download() as waiting:
            page.get_by_role("button", name="Save the view as a PNG image").click()
        assert waiting.value.suggested_filename == "arm_bench.png"
        kept = Image.open(waiting.value.path())
        assert kept.size[0] > 300 and len(kept.getcolors(1 << 24) or []) > 100


BEYOND = "(one) => document.querySelector(one).scrollWidth - document.querySelector(one).clientWidth"
"""Return how much of an element is beyond its right edge [px]."""


@pytest.mark.parametrize("size", [(400, 800), (720, 600), (1280, 720)])
def test_controls_are_reachable_on_a_small_screen(browser: Any, pages: Pages, size: tuple[int, int]) -> None:
    """No element is wider than the window, and all controls can be clicked."""
    with opened(browser, address(pages.minchw / "html/minchw.html"), size) as page:
        assert page.evaluate("document.documentElement.scrollWidth") <= size[0]
        box = page.locator("#canvas").bounding_box()
        assert box["height"] > 200 and box["width"] > 300
        for tab in ("Parts", "Display", "Measure", "Joints", "BOM"):
            page.get_by_role("tab", name=tab).click()
            assert page.locator("#panels section:visible").count() == 1
            assert [page.evaluate(BEYOND, one) for one in ("#tabs", "#panels section:not([hidden])")] == [0, 0]
        # with any font: narrow, wide, and wider than any that is installed
        for style in ("", "font-family: 'Liberation Serif'", "font-family: 'DejaVu Sans Mono'", "letter-spacing: .12em"):
            page.add_style_tag(content=f"* {{ {style} }}")
            cells = page.evaluate("[...document.querySelectorAll('#panel-bom td')].map((cell) => cell.getBoundingClientRect().height)")
            assert 0 < max(cells) < 120, "words are not broken into columns of letters"
            assert [page.evaluate(BEYOND, one) for one in ("#tabs", "#panels section:not([hidden])")] == [0, 0]
        modes = page.locator("#modes")
        fades = size[0] < 820  # a row that has more than is seen says so at that end
        assert (modes.get_attribute("class") or "").split() == ["chips", *(["after"] if fades else [])]
        page.get_by_role("radio", name="crawl_ceiling").click()
        assert page.evaluate("thingc.viewer.mode.name") == "crawl_ceiling"
        page.evaluate("thingc.viewer.setMode(thingc.viewer.robot.modes.at(-1).name)")
        drawn(page)
        assert (modes.get_attribute("class") or "").split() == ["chips", *(["before"] if fades else [])]


def test_gravity_points_down_in_every_mode(undrawn_pages: dict[str, Any]) -> None:
    """A robot on the wall is shown on a wall: the world is rotated so that gravity points down in the picture."""
    page = undrawn_pages["minchw"]
    page.evaluate("thingc.viewer.reset()")
    for mode in ("crawl", "crawl_wall", "crawl_ceiling"):
        down = page.evaluate("""(mode) => { const { viewer } = thingc; viewer.setMode(mode);
          const down = viewer.stage.camera.position.clone().fromArray(viewer.mode.gravity);
          return down.applyQuaternion(viewer.stage.world.quaternion).toArray(); }""", mode)
        assert np.allclose(down, [0, 0, -9.81], atol=1e-9)
        # the camera is where the robot is, and not behind the wall, nor above the ceiling
        assert page.evaluate("(({ world, camera }) => world.worldToLocal(camera.position.clone()).z)(thingc.viewer.stage)") > 0.05


def test_gravity_and_root_labels_do_not_cover_the_robot(browser: Any, pages: Pages) -> None:
    """In a narrow window, in modes on the floor and on the ceiling: the labels are in the view, and no part is below them."""
    covered = """(id) => { const { left, top, right, bottom } = document.getElementById(id).getBoundingClientRect(), found = [];
      for (let x = left; x <= right; x += 5) for (let y = top; y <= bottom; y += 5)
        if (thingc.viewer.hit(x, y) !== null) found.push([x, y]);
      return found; }"""
    with opened(browser, address(pages.minchw / "html/minchw.html"), (400, 800)) as page:
        view = page.locator("#canvas").bounding_box()
        for mode, root in (("front_foot", "front.sole"), ("rear_foot_ceiling", "rear.sole"), ("crawl", "body")):
            page.evaluate(f"thingc.viewer.setMode('{mode}'); thingc.viewer.reset()")
            drawn(page)
            for name, text in (("gravity", "gravity"), ("root", f"root: {root}")):
                assert page.locator(f"#{name}").inner_text() == text and page.evaluate(covered, name) == []
                box = page.locator(f"#{name}").bounding_box()
                assert view["x"] <= box["x"] and box["x"] + box["width"] <= view["x"] + view["width"]
                assert view["y"] <= box["y"] and box["y"] + box["height"] <= view["y"] + view["height"]


def test_camera_follows_a_robot_out_of_the_picture(browser: Any, pages: Pages) -> None:
    """The camera moves by as much as the robot moves into a pose, unless the robot stays in the picture or the camera showed a detail."""
    with opened(browser, address(pages.minchw / "html/minchw.html", "#mode=front_foot&pose=stretched")) as page:
        there = """({ stage }) => { const middle = stage.world.localToWorld(stage.bounds().min.clone().lerp(stage.bounds().max, 0.5));
          return [middle, stage.controls.target].map((point) => point.toArray()); }"""
        def pose(name: str, aside: float, zoom: float) -> tuple[Any, Any]:
            """How far its middle and what is looked at go, from looking that far [m] aside, that much nearer."""
            page.evaluate("""([aside, zoom]) => { const { viewer } = thingc, { stage } = viewer;
              viewer.setPose("stretched"); viewer.reset(); stage.camera.position.lerp(stage.controls.target, zoom);
              stage.shift(stage.camera.up.clone().cross(stage.controls.target.clone().sub(stage.camera.position))
                .normalize().multiplyScalar(aside)); }""", [aside, zoom])
            before = np.array(page.evaluate(f"({there})(thingc.viewer)"))
            page.evaluate("(name) => thingc.viewer.setPose(name)", name)
            moved = np.array(page.evaluate(f"({there})(thingc.viewer)")) - before
            return moved[0], moved[1]

        middle, looked = pose("arched", 0.0, 0.0)
        assert np.linalg.norm(middle) > 0.01 and np.allclose(looked, 0.0)
        found = [pose("arched", aside, 0.0) for aside in np.arange(-0.3, 0.3, 0.02)]
        followed = [moved for moved in found if np.linalg.norm(moved[1]) > 1e-9]
        assert followed and all(np.allclose(*moved, atol=1e-9) for moved in followed)
        assert np.allclose(pose("arched", 0.0, 0.8)[1], 0.0)


def test_grown_robot_stays_in_the_picture(browser: Any, pages: Pages) -> None:
    """A robot is loaded again, but larger: it is shown completely from the same direction. If the picture showed a detail, the camera
    stays."""
    with opened(browser, address(pages.arm / "html/arm.html", "#mode=bench&pose=home")) as page:
        grown = """([scale, zoom]) => { const { viewer } = thingc, { stage } = viewer, told = structuredClone(viewer.robot);
          viewer.load(viewer.robot, []); stage.frame([1, -1, 0.5]); stage.camera.position.lerp(stage.controls.target, zoom);
          const before = stage.from();
          for (const one of told.occurrences) for (const box of one.collision) box.size = box.size?.map((side) => scale * side);
          viewer.load(told, []);
          return [before, stage.from(), stage.shows(stage.bounds())]; }"""
        page.evaluate("""() => { const { viewer } = thingc, told = structuredClone(viewer.robot);
          for (const one of told.occurrences) Object.assign(one, { visual: [], collision: [] });
          told.occurrences[0].collision = [{ shape: "box", size: [0.05, 0.05, 0.05], pose: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0] }];
          viewer.load(told, []); viewer.setOptions({ shown: "collision" }); }""")
        for scale, zoom, stays, whole in ((1, 0.0, True, True), (4, 0.0, False, True), (4, 0.9, True, False)):
            before, after, shown = page.evaluate(grown, [scale, zoom])
            assert shown == whole and np.allclose(before, after) == stays, (scale, zoom)
            assert np.allclose(np.cross(before, after), 0.0, atol=1e-9)
            page.evaluate("(scale) => { for (const one of thingc.viewer.robot.occurrences) for (const box of one.collision) "
                          "box.size = box.size.map((side) => side / scale); }", scale)


def test_mode_change_keeps_the_robot_in_the_picture(browser: Any, pages: Pages) -> None:
    """The whole robot is shown, as before. If the picture showed a detail, the camera distance stays."""
    with opened(browser, address(pages.minchw / "html/minchw.html"), (1280, 800)) as page:
        shown = """(zoom) => { const { viewer } = thingc, { stage } = viewer, found = {};
          for (const mode of viewer.robot.modes) { viewer.setMode("front_foot"); viewer.reset();
            stage.camera.position.lerp(stage.controls.target, zoom);
            const before = stage.camera.position.distanceTo(stage.controls.target);
            viewer.setMode(mode.name); viewer.links();
            found[mode.name] = [stage.shows(stage.bounds()), stage.camera.position.distanceTo(stage.controls.target) / before]; }
          return found; }"""
        whole, detail = page.evaluate(shown, 0.0), page.evaluate(shown, 0.8)
        assert all(seen for seen, _ in whole.values()) and max(times for _, times in whole.values()) > 1.05
        assert all(abs(times - 1.0) < 1e-6 for _, times in detail.values())


def test_comparison_shows_both_robots(browser: Any, pages: Pages, tmp_path: Path) -> None:
    """A page with `against` shows the other robot in the pose of the same name, if any, and both are in the picture."""
    def page_of(name: str) -> Page:
        text = (getattr(pages, name) / f"html/{name}.html").read_text()
        return Page(name=name, data=element(text, "thingc-robot"), glb=base64.b64decode(element(text, "thingc-geometry")))

    own, other = page_of("arm"), page_of("minchw")
    (tmp_path / "alone.html").write_bytes(own.html())
    (tmp_path / "both.html").write_bytes(own.html(against=other))
    seen = []
    for name in ("alone", "both"):
        with opened(browser, address(tmp_path / f"{name}.html", "#mode=bench&pose=home&camera=0.9,-0.9,0.7,0,0,0&theme=light")) as page:
            drawn(page)
            seen.append(picture(page))
            assert page.evaluate("thingc.viewer.robot.name") == "arm"
    assert (np.abs(seen[0] - seen[1]).max(axis=2) > 30).mean() > 0.002
