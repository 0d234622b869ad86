"""`thingc render`: the whole robot is in the picture with its colours, and errors if rendering is not possible."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from PIL import Image

import thingc
from cli.drawn_positions import record_positions
from conformance.harness import thingc as command, thingc_here
from loops.robots import compiled
from modes.test_several_coordinates import GANTRY
from thingc.base.pose import NO_POSE
from thingc.targets.render import studio
from thingc.targets.render.frames import BLUE, GREEN, JOINT, RED, arrows_of, draw_marks as painted, frame_mark, joint_mark
from thingc.targets.render.picture import Shot, camera_of, points_of, pose_model
from thingc.tools.cli import render, render_overlay
from thingc.tools.cli.main import main

pytestmark = pytest.mark.slow

HERE = Path(__file__).resolve().parent
ARM = "assemblies/arm.yaml"

PRIMITIVES = """
<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <body name="a" pos="0.2 0 0.4">
      <geom name="a" type="capsule" size="0.05 0.2" rgba="0.1 0.6 0.2 1" group="2"/>
      <body name="b" pos="0 0 0.3"><joint name="j" axis="0 1 0"/>
        <geom name="b" type="box" size="0.3 0.02 0.05" pos="0.3 0 0" rgba="0.9 0.5 0.1 1" group="2"/>
        <geom name="hidden" type="sphere" size="3" group="3"/>
      </body>
    </body>
  </worldbody>
  <keyframe><key name="down" qpos="1.2"/></keyframe>
</mujoco>
"""

FLOOR, WALL, CEILING = (0.0, 0.0, -9.81), (-9.81, 0.0, 0.0), (0.0, 0.0, 9.81)

JOBS: dict[str, dict[str, Any]] = {
    "home": {"mode": "bench", "pose": "home", "size": [320, 240], "gravity": FLOOR, "lamps": 3},
    "tall": {"pose": "down", "size": [150, 400], "gravity": FLOOR, "azimuth": 200.0, "elevation": -40.0},
    "wide": {"mode": "drawing", "pose": "writing", "size": [500, 120], "gravity": FLOOR, "azimuth": 90.0, "elevation": 0.0},
    "below": {"mode": "drawing", "pose": "stretched", "size": [320, 240], "gravity": FLOOR},
    "top": {"mode": "adrift", "pose": "folded", "size": [240, 240], "gravity": FLOOR, "elevation": -90.0},
    "wall": {"mode": "adrift", "pose": "home", "size": [320, 240], "gravity": WALL},
    "ceiling": {"pose": "down", "size": [320, 240], "gravity": CEILING},
    "primitives": {"pose": "down", "size": [320, 240], "gravity": FLOOR},
}


@pytest.fixture(scope="module")
def drawn(root: Path, shared_store: str, tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return picture (height, width, 3) and mask (height, width) of every job."""
    folder = tmp_path_factory.mktemp("drawn")
    arm = thingc.compile(str(root / ARM), store=shared_store)
    (folder / "assets").mkdir()
    for name, data in next(iter(arm.modes.values())).assets().items():
        (folder / "assets" / name).write_bytes(data)
    for name, mode in arm.modes.items():
        (folder / f"{name}.xml").write_text(mode.mjcf())
    (folder / "primitives.xml").write_text(PRIMITIVES)
    jobs = [
        {**job, "name": name, "xml": str(folder / f"{job.get('mode', 'primitives')}.xml"), "assets": str(folder / "assets")}
        for name, job in JOBS.items()
    ]
    (folder / "jobs.json").write_text(json.dumps(jobs))
    environment = {key: value for key, value in os.environ.items() if key != "MUJOCO_GL"}
    done = subprocess.run(
        [sys.executable, str(HERE / "drawing.py"), str(folder / "jobs.json")], env=environment, capture_output=True, text=True, check=False,
    )
    assert done.returncode == 0, done.stderr
    return {name: (np.array(Image.open(folder / f"{name}.png")), np.load(folder / f"{name}.npy")) for name in JOBS}


def around(mask: np.ndarray, far: int) -> np.ndarray:
    """Return a mask grown by some pixels in each direction."""
    grown = mask.copy()
    for _ in range(far):
        wide = np.pad(grown, 1)
        grown = wide[1:-1, 1:-1] | wide[:-2, 1:-1] | wide[2:, 1:-1] | wide[1:-1, :-2] | wide[1:-1, 2:]
    return grown


@pytest.mark.parametrize("name", JOBS)
def test_whole_robot_fills_the_picture(drawn: dict[str, tuple[np.ndarray, np.ndarray]], name: str) -> None:
    """By MuJoCo's segmentation with a fixed camera: the robot is within the margin, touches it in one direction, and is centred in the
    other."""
    image, mask = drawn[name]
    width, height = JOBS[name]["size"]
    assert image.shape == (height, width, 3) and image.dtype == np.uint8 and mask.shape == (height, width)
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    filled = []
    for found, count in ((rows, height), (columns, width)):
        before, after = int(found[0]), count - 1 - int(found[-1])
        assert before > 0 and after > 0, "not cut"
        assert before >= 0.06 * count - 1.5 and after >= 0.06 * count - 1.5, "as much is left free as was meant"
        filled.append((before, after, count))
    assert any(max(before, after) <= 0.06 * count + 2.5 for before, after, count in filled), "as near as can be"


@pytest.mark.parametrize("name", JOBS)
def test_only_the_robot_is_coloured(drawn: dict[str, tuple[np.ndarray, np.ndarray]], name: str) -> None:
    """Pixels outside the segmented robot are grey: the robot is exactly at the place of the segmentation."""
    image, mask = drawn[name]
    spread = np.ptp(image.astype(int), axis=2)
    assert spread[~around(mask, 2)].max() <= 3
    assert mask.mean() > 0.02
    border = np.concatenate([image[0], image[-1], image[:, 0], image[:, -1]]).astype(int)
    assert np.median(border) > 190, "bright"
    inside = mask & ~around(~mask, 1)
    assert np.abs(image[inside].astype(int) - int(np.median(border))).max(axis=1).mean() > 20, "the robot stands out"


def hues(image: np.ndarray, mask: np.ndarray) -> dict[str, float]:
    """Return the fractions of the robot's pixels that are clearly red, blue, green or orange, nearly black, or pale."""
    r, g, b = (image[mask].astype(int)[:, k] for k in range(3))
    return {
        "crimson": float(np.mean((r > 1.8 * g) & (r > 1.8 * b) & (r > 60))),
        "blue": float(np.mean((b > 1.5 * r) & (b > 1.2 * g) & (b > 60))),
        "green": float(np.mean((g > 1.5 * r) & (g > 1.3 * b))), "orange": float(np.mean((r > 1.1 * g) & (g > 1.5 * b) & (r > 90))),
        "black": float(np.mean(np.maximum(np.maximum(r, g), b) < 60)), "pale": float(np.mean((b >= r) & (r > 110) & (b - r < 60))),
    }


def test_materials_have_their_colours(drawn: dict[str, tuple[np.ndarray, np.ndarray]]) -> None:
    """The pen is royal blue, its cap crimson, printed parts are lavender, and servos are nearly black."""
    found = hues(*drawn["home"])
    assert found["blue"] > 0.05 and found["crimson"] > 0.005 and found["pale"] > 0.2 and found["black"] > 0.1, found
    found = hues(*drawn["primitives"])
    assert found["green"] > 0.1 and found["orange"] > 0.1 and found["black"] < 0.01, found


def test_robot_casts_a_shadow(drawn: dict[str, tuple[np.ndarray, np.ndarray]]) -> None:
    image, mask = drawn["home"]
    ground = image[~around(mask, 2)].astype(int).max(axis=1)
    assert np.mean(ground < 0.85 * np.median(ground)) > 0.01


@pytest.mark.parametrize(("lowest", "opaque"), [(0.3, True), (0.0, True), (-1e-6, True), (-0.02, False)])
def test_floor_is_at_zero_height(lowest: float, opaque: bool) -> None:
    """The floor is at z = 0, wherever the robot is. If the robot extends below it, the floor is transparent."""
    model = studio.model_of(PRIMITIVES, {}, (64, 48), lowest, studio.COARSE)
    floor = model.geom(studio.BACKDROP)
    assert floor.type[0] == mujoco.mjtGeom.mjGEOM_PLANE and floor.pos.tolist() == [0.0, 0.0, 0.0]
    alpha = float(model.mat_rgba[model.material(studio.BACKDROP).id][3])
    assert alpha == 1.0 if opaque else 0.2 < alpha < 0.8


# --- the command -----------------------------------------------------------------------------------------------------


MARKS = ("--mounts", "--mounts-of", "hand.cap", "--joints", "--root")

LAMP = """\
thingc: assembly/1
name: lamp
components:
  lamp:
    link: true
    mass: 1 kg
    shapes: [{box: 100 100 20 mm, color: red}, {cylinder: {radius: 10 mm, length: 200 mm}, at: {xyz: 0 0 100 mm}, color: blue}]
"""
"""A robot whose parts need no modelling."""


@pytest.fixture
def lamp(tmp_path: Path) -> Path:
    (tmp_path / "here").mkdir()
    (tmp_path / "lamp.yaml").write_text(LAMP)
    return tmp_path / "here"


def test_render_command_writes_one_file(root: Path, shared_store: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It uses the default name and pose, and selects EGL itself, also with overlays."""
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    more = {"DISPLAY": "", "WAYLAND_DISPLAY": ""}
    ran = command("render", root / ARM, "--mode", "drawing", "--size", "96x64", *MARKS, store=shared_store, cwd=tmp_path, more=more)
    assert ran.code == 0 and ran.out == "", ran.err
    assert ran.err.endswith("arm_drawing_writing.png: mode drawing, pose writing\n")
    assert [path.name for path in tmp_path.iterdir()] == ["arm_drawing_writing.png"]
    with Image.open(tmp_path / "arm_drawing_writing.png") as image:
        assert image.size == (96, 64) and image.format == "PNG" and image.mode == "RGB"


def no_egl(folder: Path) -> dict[str, str]:
    """Return an environment without EGL: an invalid library file shadows it."""
    for name in ("libEGL.so", "libEGL.so.1"):
        (folder / name).write_bytes(b"")
    return {"LD_LIBRARY_PATH": str(folder), "MUJOCO_GL": "egl"}


def no_screen(folder: Path) -> dict[str, str]:
    return {"MUJOCO_GL": "glfw", "DISPLAY": "", "WAYLAND_DISPLAY": ""}


@pytest.mark.parametrize(("without", "said"), [
    (no_egl, "error[TC808]: cannot render with MUJOCO_GL=egl: the library is missing\n"
     "  help: install EGL (Debian, Ubuntu: apt install libegl1)\n"),
    (no_screen, "error[TC808]: cannot render with MUJOCO_GL=glfw: GLFW requires a screen\n"
     "  help: set MUJOCO_GL=egl before MuJoCo is imported\n"),
    (lambda _: {"MUJOCO_GL": "pencil"}, "error[TC808]: cannot render with MUJOCO_GL=pencil: invalid value for environment "
     "variable MUJOCO_GL: pencil\n  help: set MUJOCO_GL=egl before MuJoCo is imported\n"),
], ids=["no EGL", "no screen", "no such thing"])
def test_machine_without_rendering_support(lamp: Path, tmp_path: Path, without: Callable[[Path], dict[str, str]], said: str) -> None:
    more = without(tmp_path)
    ran = command("render", "../lamp.yaml", store=tmp_path / "store", cwd=lamp, more=more)
    assert ran.code == 2 and ran.out == ""
    assert ran.err == said + "\n1 error\n"
    assert list(lamp.iterdir()) == []


def test_graphics_fail_if_mujoco_was_imported_without_a_screen(tmp_path: Path) -> None:
    """In a process that has loaded an OpenGL library, as the CAD kernel does, MuJoCo would abort the process."""
    code = "import OCP.gp, mujoco\nfrom thingc.targets.render.picture import NoGraphics, ready\n"
    code += "try: ready()\nexcept NoGraphics as fault: print(fault)"
    env = {name: value for name, value in os.environ.items() if name not in ("MUJOCO_GL", "DISPLAY", "WAYLAND_DISPLAY")}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=env, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (0, "cannot render with MUJOCO_GL=glfw: GLFW requires a screen\n"), done.stderr


WRONG = {
    "--mode benc": "`assemblies/arm.yaml` has no mode `benc`\n  help: did you mean `bench`?",
    "--pose hom": "mode `bench` of `assemblies/arm.yaml` has no pose `hom`\n  help: did you mean `home`?",
    "--mode adrift --pose x": "mode `adrift` of `assemblies/arm.yaml` has no pose `x`\n"
    "  help: known poses: `folded`, `home`, `stretched`, `writing`",
    "--mounts-of hnd.cap": "there is no component `hnd.cap`\n  help: did you mean `hand/cap`?",
    "--position elbw=1deg": "`arm` has no joint `elbw`\n  help: did you mean `elbow`?",
    "--position elbow=1mm": "--position: expected an angle (such as 30 deg), found a length (`1mm`)\n"
    "  help: write, for example, 'elbow=90 deg'",
    "--position elbow": "expected --position JOINT=POSITION, found `elbow`\n  help: write, for example, --position 'elbow=90 deg'",
    "--size 640": "--size: expected WIDTHxHEIGHT from 16x16 to 8192x8192, found `640`\n  help: run `thingc render --help` for usage",
    "--size 8x8": "--size: expected WIDTHxHEIGHT from 16x16 to 8192x8192, found `8x8`\n  help: run `thingc render --help` for usage",
    "--azimuth north": "--azimuth: expected degrees from -360 to 360, found `north`\n  help: run `thingc render --help` for usage",
    "--elevation 91": "--elevation: expected degrees from -90 to 90, found `91`\n  help: run `thingc render --help` for usage",
    "--elevation nan": "--elevation: expected degrees from -90 to 90, found `nan`\n  help: run `thingc render --help` for usage",
    "-o arm.jpg": "-o: expected a .png file, found `arm.jpg`\n  help: write, for example, -o arm.png",
    "-o nowhere/arm.png": "-o: there is no folder `nowhere`\n  help: create the folder, or choose another folder",
}


@pytest.mark.parametrize("words", WRONG)
def test_invalid_command_lines(
    root: Path, shared_store: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], words: str
) -> None:
    monkeypatch.chdir(root)
    monkeypatch.setenv("THINGC_STORE", shared_store)
    code = "TC805" if "nowhere" in words else "TC801"
    assert main(["render", ARM, *words.split()]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert re.sub(r"^\w+ parts: .*\n", "", said.err, flags=re.MULTILINE) == f"error[{code}]: {WRONG[words]}\n\n1 error\n"


FINGERS = """\
thingc: assembly/1
name: fingers
components:
  base: {link: true, shapes: [{box: 100 100 20 mm}], mounts: {hinge: {xyz: 0 0 10 mm, rpy: -90 0 0 deg}}}
  upper: {link: true, mass: 1 kg, shapes: [{box: 10 10 80 mm}], mounts: {hinge: {xyz: 0 0 40 mm, rpy: -90 0 0 deg}}}
  lower: {link: true, mass: 1 kg, shapes: [{box: 10 10 60 mm}]}
joints:
  shoulder: {type: continuous, parent: base.hinge, child: upper.origin}
  elbow: {type: continuous, parent: upper.hinge, child: lower.origin, MIMIC}
POSES
"""


@pytest.mark.parametrize(("mimic", "poses", "words", "expected"), [
    ("", "", ["elbow=-20 deg"], [0.0, -20.0]),
    ("", "poses: {bent: {shoulder: 10 deg, elbow: 40 deg}, other: {}}", ["elbow=-20deg"], [10.0, -20.0]),
    ("mimic: {joint: shoulder, multiplier: 2}", "poses: {bent: {shoulder: 10 deg}}", ["shoulder=0.5 rad"], [28.64789, 57.29578]),
])
def test_positions_replace_those_of_the_pose(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, mimic: str, poses: str, words: list[str], expected: list[float],
) -> None:
    """Read with MuJoCo."""
    (tmp_path / "fingers.yaml").write_text(FINGERS.replace(", MIMIC", f", {mimic}" if mimic else "").replace("POSES", poses))
    drawn = record_positions(monkeypatch)
    options = [word for setting in words for word in ("--position", setting)]
    assert main(["render", str(tmp_path / "fingers.yaml"), *options, "-o", str(tmp_path / "fingers.png")]) == 0
    assert np.degrees(drawn[0]) == pytest.approx(expected, abs=1e-4)
    if mimic:
        ran = thingc_here("render", str(tmp_path / "fingers.yaml"), "--position", "elbow=1 deg", store=tmp_path, cwd=tmp_path)
        assert ran.code == 2 and "joint `elbow` mimics `shoulder`\n  help: set `shoulder`" in ran.err


def test_position_outside_the_limits_is_a_warning(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:
    """Joints that mimic another joint are checked, too."""
    text = FINGERS.replace("shoulder: {type: continuous", "shoulder: {type: revolute, limit: {lower: 0, upper: 90 deg}")
    text = text.replace("elbow: {type: continuous", "elbow: {type: revolute, limit: {lower: 0, upper: 150 deg}")
    (tmp_path / "fingers.yaml").write_text(text.replace("MIMIC", "mimic: {joint: shoulder, multiplier: 2}").replace("POSES", ""))
    record_positions(monkeypatch)
    for position, outside in (("70 deg", []), ("80 deg", ["elbow` in the picture (160"]), ("-9 deg", ["shoulder` in the picture (-9"] * 2)):
        assert main(["render", str(tmp_path / "fingers.yaml"), "--position", f"shoulder={position}", "-o", str(tmp_path / "a.png")]) == 0
        warnings = re.findall(r"warning\[TC601\]: (.*)", capsys.readouterr().err)
        assert len(warnings) == len(outside), warnings
        assert all(part in warnings[0] for part in outside)
    assert warnings == [
        "the position of joint `shoulder` in the picture (-9 deg) is outside its limits (0 deg to 90 deg)",
        "the position of joint `elbow` in the picture (-18 deg) is outside its limits (0 deg to 150 deg)",
    ]


def test_rendering_is_deterministic_and_checks_its_target(
    lamp: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    (lamp / "folder.png").mkdir()
    for name in ("one.png", "other.png"):
        ran = command("render", "../lamp.yaml", "-o", name, "--size", "48x48", store=tmp_path / "store", cwd=lamp)
        assert ran.code == 0 and ran.out == "", ran.err
    monkeypatch.setattr(render, "ready", lambda: None)
    monkeypatch.setattr(render, "picture", lambda *_, **__: (lamp / "one.png").read_bytes())
    ran = thingc_here("render", "../lamp.yaml", "-o", "folder.png", store=tmp_path / "store", cwd=lamp)
    assert ran.code == 2 and ran.out == "", ran.err
    assert ran.err == "error[TC805]: cannot write `folder.png`: is a directory\n  help: choose another file with -o\n\n1 error\n"
    assert sorted(path.name for path in lamp.rglob("*")) == ["folder.png", "one.png", "other.png"]
    assert (lamp / "one.png").read_bytes() == (lamp / "other.png").read_bytes()


def test_invalid_document_is_reported_as_by_build(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("THINGC_STORE", str(tmp_path / "store"))
    (tmp_path / "r.yaml").write_text("thingc: assembly/1\nname: r\ncomponents: {a: {frame: true}, b: {frame: true}}\n")
    assert main(["render", "r.yaml"]) == 1
    assert "error[TC322]" in capsys.readouterr().err and list(tmp_path.glob("*.png")) == []


# --- frames and axes -------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def posed_arm(root: Path, shared_store: str) -> Any:
    """Return the arm held by its pen in a writing pose: the robot, the MuJoCo model and its data."""
    arm = thingc.compile(str(root / ARM), store=shared_store)
    mode = arm.modes["drawing"]
    model = mujoco.MjModel.from_xml_string(mode.mjcf(), mode.assets())
    return mode.robot, model, pose_model(model, "writing")


def test_mount_marks_match_mujoco_sites(posed_arm: Any) -> None:
    """The document exports mounts of the arm as sites, which MuJoCo places independently."""
    robot, model, data = posed_arm
    drawn = {mark.label: arrows_of(mark, data, 0.1) for mark in render_overlay.mounts(robot, {})}
    assert {"plate.servo_seat", "hand.cap.pen", "hand.pen.tip", "bracket.board"} <= set(drawn)
    assert "elbow_servo.rotor" in drawn and "forearm.rotor_seat" not in drawn, "one frame for the two mounts of a mate"
    site = data.site("hand/tip")
    for k, line in enumerate(drawn["hand.pen.tip"]):
        np.testing.assert_allclose(line[0], site.xpos, atol=1e-9)
        np.testing.assert_allclose(line[-1] - line[0], 0.1 * site.xmat.reshape(3, 3)[:, k], atol=1e-9)
    (root_mark,) = render_overlay.root(robot)
    assert root_mark.label == "root hand.tip (held)"
    np.testing.assert_allclose(arrows_of(root_mark, data, 0.1)[0][0], site.xpos, atol=1e-9)


def test_joint_axis_marks_match_mujoco(posed_arm: Any) -> None:
    """`drawing` traverses every joint backwards. MuJoCo's axes are those about which the child in the tree turns, so they are the
    document's axes reversed: the same lines in the opposite direction."""
    robot, model, data = posed_arm
    drawn = {mark.label: arrows_of(mark, data, 0.1)[0] for mark in render_overlay.joints(robot, {})}
    assert list(drawn) == ["yaw", "shoulder", "elbow", "wrist"] and model.njnt == 4
    for name, line in drawn.items():
        joint = data.joint(name)
        along = (line[-1] - line[0]) / np.linalg.norm(line[-1] - line[0])
        np.testing.assert_allclose(along, -joint.xaxis, atol=1e-9)
        np.testing.assert_allclose(np.cross(line[0] - joint.xanchor, along), 0.0, atol=1e-9)


def test_every_joint_coordinate_has_an_axis_mark(tmp_path: Path) -> None:
    """In a pose: MuJoCo also rotates the second axis of a universal joint with the first."""
    gantry = compiled(tmp_path, GANTRY)
    robot, model = gantry.robot("stand"), gantry.model("stand")
    (frame,) = (frame for frame in robot.keyframes if frame.name == "home")
    data = pose_model(model, "home")
    drawn = {mark.label: arrows_of(mark, data, 0.1)[0] for mark in render_overlay.joints(robot, frame.q)}
    assert list(drawn) == ["table[0]", "table[1]", "table[2]", "wrist[0]", "wrist[1]", "ram[0]", "ram[1]"]
    for label, line in drawn.items():
        joint = data.joint(label.replace("[", "_").removesuffix("]"))
        np.testing.assert_allclose((line[-1] - line[0]) / np.linalg.norm(line[-1] - line[0]), joint.xaxis, atol=1e-9)
        if label not in ("table[0]", "table[1]", "ram[1]"):  # of a slide the place means nothing
            np.testing.assert_allclose(np.cross(line[0] - joint.xanchor, joint.xaxis), 0.0, atol=1e-9)


def test_all_mounts_of_a_component_are_marked(posed_arm: Any) -> None:
    robot, _, _ = posed_arm
    cap = [mark.label for mark in render_overlay.mounts_of(robot, {}, ["hand.cap"])]
    assert cap == [f"hand.cap.{name}" for name in next(o for o in robot.assembly.occurrences if o.path == "hand/cap").mounts]
    whole = {mark.label for mark in render_overlay.mounts_of(robot, {}, ["hand"])}
    assert set(cap) < whole and all(label.startswith("hand.") for label in whole)


def test_arrows_end_at_their_projected_points(posed_arm: Any) -> None:
    """On a white image: red, green and blue at the projected tips of a frame, and its name in a free place nearby."""
    _, model, data = posed_arm
    camera = camera_of(points_of(model, data), FLOOR, Shot(size=(640, 480)))
    frame = frame_mark(label="a name", body="world", pose=NO_POSE)
    axis = joint_mark(label="turns", body="base_link", pose=NO_POSE, slides=False)
    lines = [*arrows_of(frame, data, 0.05), *arrows_of(axis, data, 0.05)]
    image = painted(np.full((480, 640, 3), 255, np.uint8), [frame, axis], data, camera, 0.05)
    assert image.shape == (480, 640, 3) and image.dtype == np.uint8
    for line, colour in zip(lines, (RED, GREEN, BLUE, JOINT)):
        for share in (0.9, 0.97):
            x, y = camera.project((line[0] + share * (line[-1] - line[0]))[None])[0]
            column, row = round((x + 1.0) * 320.0), round((1.0 - y) * 240.0)
            near = image[row - 2 : row + 3, column - 2 : column + 3].reshape(-1, 3).astype(int)
            assert np.abs(near - colour).max(axis=1).min() < 12, (colour, near)
    dark = np.argwhere(image.max(axis=2) < 60)
    assert len(dark) > 20, "the name is there"
    blank = painted(np.full((480, 640, 3), 255, np.uint8), [], data, camera, 0.05)
    assert (blank == 255).all()
