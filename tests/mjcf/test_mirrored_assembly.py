"""A mirrored nested assembly: it is the mirror image of the other one at equal q, and equals documents whose values were mirrored in the
test."""

from __future__ import annotations

import re
from pathlib import Path

import mujoco
import numpy as np
import pytest

from graph.builder import poses, rz, t
from loops.robots import Array, Built, compiled
from modes.switching_robots import assert_said, mass_matrix
from thingc.model.assembly.kinematics import joints_of
from thingc.model.assembly.types import Assembly
from thingc.modes import Modes

BODY = "mass: 0.4 kg, com: 5 14 3 mm, inertia: {ixx: 200 kg*mm^2, iyy: 300 kg*mm^2, izz: 350 kg*mm^2, ixy: 20 kg*mm^2, ixz: -30 kg*mm^2, "
BODY = f"frame: true, {BODY}iyz: 40 kg*mm^2}}"
A, B = "{xyz: 10 -7 30 mm, rpy: 30 40 50 deg}", "{xyz: -20 17 3 mm, rpy: 130 40 -50 deg}"

SHIN = f"""\
thingc: assembly/1
name: shin
components:
  base: {{{BODY}, mounts: {{a: {A}}}}}
  inner: {{{BODY}, mounts: {{end: {B}}}, at: {{in: base.origin, xyz: 3 4 5 mm, rpy: 1 2 30 deg}}}}
mounts: {{top: base.a, end: inner.end}}
"""
LEG = f"""\
thingc: assembly/1
name: leg
components:
  hip: {{{BODY}, mounts: {{a: {A}, b: {B}}}}}
  thigh: {{{BODY}, mounts: {{a: {A}, b: {B}}}}}
  chip: {{{BODY}, at: {{in: thigh.b, xyz: 5 9 2 mm, rpy: 20 30 10 deg}}}}
  plug: {{{BODY}, mounts: {{a: {A}}}, attach: {{mount: a, to: thigh.a, turn: 20 deg, gap: 2 mm}}}}
  cap: {{{BODY}, attach: {{mount: origin, to: shin.mark, turn: 50 deg, gap: 2 mm}}}}
  shin: {{assembly: shin.yaml, mounts: {{mark: {B}}}}}
  foot: {{assembly: shin.yaml}}
  toe: {{{BODY}, mounts: {{a: {A}}}}}
  sole: {{{BODY}, mounts: {{a: {A}}}}}
  tube: {{{BODY}}}
  bolt: {{{BODY}, mounts: {{a: {A}}}}}
  vane: {{{BODY}, mounts: {{a: {A}}}}}
joints:
  hip: {{type: universal, parent: hip.b, child: thigh.a, turn: 15 deg, gap: 3 mm, offset: [3 deg, 4 deg]}}
  knee: {{type: revolute, parent: thigh.b, child: shin.top, turn: -25 deg, limit: {{lower: -1 rad, upper: 2 rad}}, offset: 12 deg,
    drive: {{kind: motor, effort: 2 N*m}}}}
  ankle: {{type: ball, parent: shin.end, child: foot.top, turn: 33 deg, drive: [{{axis: [1, 2, 3], kind: motor, effort: 1 N*m}}]}}
  thread: {{type: screw, lead: 8 mm, parent: foot.end, child: toe.a}}
  flat: {{type: planar, parent: toe.origin, child: sole.a}}
  tube: {{type: cylindrical, parent: thigh.origin, child: tube.origin, turn: 11 deg}}
  slide: {{type: prismatic, parent: foot.inner.end, child: bolt.a, limit: {{lower: -20 mm, upper: 30 mm}},
    mimic: {{joint: knee, multiplier: 4 mm/rad, offset: 1 mm}}}}
  vane: {{type: cylindrical, parent: thigh.b, child: vane.a, axis: [1, 2, -2], turn: 0.2 rad, gap: 4 mm, offset: {{0: 0.1 rad}}}}
mounts: {{top: hip.a, tip: sole.a, mid: thigh.origin}}
poses: {{bent: {{knee: 40 deg, ankle: {{rpy: 10 20 30 deg}}, "flat[0]": 5 mm}}}}
"""
PAIR = f"""\
thingc: assembly/1
name: pair
components:
  torso: {{{BODY}, mounts: {{right: {{xyz: 10 -40 5 mm, rpy: 90 0 0 deg}}, left: {{xyz: 10 40 5 mm, rpy: -90 0 0 deg}}}}}}
  right: {{assembly: leg.yaml, attach: {{mount: top, to: torso.right, turn: 25 deg, gap: 3 mm}}}}
  left: {{assembly: leg.yaml, mirror: AXIS, attach: {{mount: top, to: torso.left, turn: 155 deg, gap: 3 mm}}}}
  laid: {{assembly: leg.yaml, mirror: AXIS, at: {{in: torso.origin, xyz: 0 0 90 mm, rpy: 0 0 90 deg}}}}
  hook: {{{BODY}, mounts: {{a: {A}}}, attach: {{a: left.mid}}}}
poses: {{bent: {{right: bent, left: bent}}}}
modes:
  stand: {{root: torso, base: free, pose: bent}}
  foot: {{root: left.tip, base: held, pose: bent}}
"""
SIGNS = {
    "hip_0": 1, "hip_1": -1, "knee": -1, "ankle_0": 1, "ankle_1": -1, "ankle_2": -1, "thread": -1, "flat_0": -1, "flat_1": 1, "flat_2": -1,
    "tube_0": -1, "tube_1": 1, "slide": 1, "vane_0": -1, "vane_1": 1,
}
"""Signs that convert q of the mirrored assembly to q of the manually mirrored documents, whose mount frames differ."""


def mirror_document(text: str) -> str:
    """Mirror a document at y by text replacement: components that change sign under the reflection, and joint values accordingly."""
    text = re.sub(r"xyz: (\S+) (\S+) (\S+) mm", lambda m: f"xyz: {m[1]} {-float(m[2]):g} {m[3]} mm", text)
    text = re.sub(r"com: (\S+) (\S+) (\S+) mm", lambda m: f"com: {m[1]} {-float(m[2]):g} {m[3]} mm", text)
    text = re.sub(r"rpy: (\S+) (\S+) (\S+) deg", lambda m: f"rpy: {-float(m[1]):g} {m[2]} {-float(m[3]):g} deg", text)
    text = text.replace("ixy: 20", "ixy: -20").replace("iyz: 40", "iyz: -40").replace("shin.yaml", "shin_l.yaml")
    text = re.sub(r"turn: (\S+) deg", lambda m: f"turn: {180 - float(m[1]):g} deg", text)
    text = re.sub(r"((?:parent: \S+, child: \S+|toe\.a|sole\.a|bolt\.a))\}\}?$", r"\1, turn: 180 deg}", text, flags=re.MULTILINE)
    text = text.replace("child: bolt.a,", "child: bolt.a, turn: 180 deg,").replace("lead: 8 mm", "lead: -8 mm")
    text = text.replace("offset: [3 deg, 4 deg]", "offset: [3 deg, -4 deg]").replace("offset: 12 deg", "offset: -12 deg")
    text = text.replace("lower: -1 rad, upper: 2 rad", "lower: -2 rad, upper: 1 rad").replace("axis: [1, 2, 3]", "axis: [1, -2, -3]")
    text = text.replace("axis: [1, 2, -2], turn: 0.2 rad", "axis: [1, -2, -2], turn: -0.2 rad").replace("{0: 0.1 rad}", "{0: -0.1 rad}")
    text = text.replace("ankle: {rpy: -10 20 -30 deg}", "ankle: {rpy: 10 -20 -30 deg}")
    return text.replace("4 mm/rad", "-4 mm/rad").replace("knee: 40", "knee: -40").replace("[0]\": 5 mm", "[0]\": -5 mm")


def pair(folder: Path, *, axis: str = "y", hand: bool = False) -> Built:
    """The two legs: the left one mirrored along `axis`, or from manually mirrored documents if `hand`."""
    text = PAIR.replace("AXIS", axis)
    if hand:
        text = text.replace("leg.yaml, mirror: y", "leg_l.yaml")
    folder.mkdir()
    documents = {"pair": text, "shin": SHIN, "leg": LEG, "shin_l": mirror_document(SHIN), "leg_l": mirror_document(LEG)}
    made = compiled(folder, {f"{name}.yaml": said for name, said in documents.items()})
    assert made.said == []
    return made


def assembly_of(made: Built) -> Assembly:
    assert made.compilation.assembly is not None
    return made.compilation.assembly


@pytest.fixture(scope="module")
def mirrored(tmp_path_factory: pytest.TempPathFactory) -> Built:
    return pair(tmp_path_factory.mktemp("pair") / "mirrored")


def random_positions(made: Built, rng: np.random.Generator) -> dict[str, float]:
    """Random q, equal for both legs."""
    one = {joint.path[6:]: rng.uniform(-1, 1) for joint in joints_of(assembly_of(made)) if joint.path.startswith("right/")}
    one["slide"] = 0.004 * one["knee"] + 0.001
    return {f"{side}/{name}": q for side in ("right", "left", "laid") for name, q in one.items()}


def poses_in_torso(made: Built, q: dict[str, float]) -> dict[str, Array]:
    """Poses of all occurrences in the torso."""
    found = zip(assembly_of(made).occurrences, poses(assembly_of(made), q), strict=True)
    return {occurrence.path: np.array(pose.rows()) for occurrence, pose in found}


@pytest.mark.parametrize("axis", "xyz")
def test_left_leg_mirrors_right_leg_at_equal_q(mirrored: Built, axis: str, tmp_path: Path) -> None:
    """The mirror axis does not change where a mount places the leg, but it changes a leg that is poses_in_torso by its pose."""
    across, own = np.diag([1.0, -1.0, 1.0, 1.0]), np.diag([*(-1.0 if axis == name else 1.0 for name in "xyz"), 1.0])
    made = mirrored if axis == "y" else pair(tmp_path / "pair", axis=axis)
    by_path = {one.path: one.properties for one in assembly_of(made).occurrences}
    right = [name.removeprefix("right/") for name in by_path if name.startswith("right/")]
    assert len(right) == 14
    rng, laid = np.random.default_rng(3), t(0, 0, 0.09) @ rz(np.pi / 2)
    for _ in range(5):
        at = poses_in_torso(made, random_positions(made, rng))
        for name in right:
            np.testing.assert_allclose(at[f"left/{name}"], across @ at[f"right/{name}"] @ own, atol=1e-12, err_msg=name)
            of_leg = np.linalg.inv(at["right/hip"]) @ at[f"right/{name}"]
            np.testing.assert_allclose(at[f"laid/{name}"], laid @ own @ of_leg @ own, atol=1e-12, err_msg=name)
        mounts = {}
        for one in assembly_of(made).exported:
            part = assembly_of(made).occurrences[one.occurrence]
            mounts[one.path] = at[part.path] @ np.array(one.pose.rows())
        for name in ("top", "tip", "mid"):  # the y axis of a mirrored mount is reversed, also of the origin `mid`
            np.testing.assert_allclose(mounts[f"left/{name}"], across @ mounts[f"right/{name}"] @ across, atol=1e-12, err_msg=name)
    S = own[:3, :3]
    for name in right:
        image, one = by_path[f"left/{name}"], by_path[f"right/{name}"]
        np.testing.assert_allclose(image.centre, S @ one.centre, atol=1e-15)
        np.testing.assert_allclose(image.inertia, S @ one.inertia @ S, atol=1e-15)


def test_mirror_equals_manually_mirrored_documents(mirrored: Built, tmp_path: Path) -> None:
    """The manually mirrored documents have other signs of q, because their frames differ. Poses and mass matrix are equal."""
    hand = pair(tmp_path / "hand", hand=True)
    q = random_positions(mirrored, np.random.default_rng(5))
    theirs = {name: value * sign_of(name) for name, value in q.items()}
    one, two = poses_in_torso(mirrored, q), poses_in_torso(hand, theirs)
    assert one.keys() == two.keys()
    for name, pose in one.items():
        np.testing.assert_allclose(pose, two[name], atol=1e-12, err_msg=name)
    for mode in ("stand", "foot"):
        data, other = (mujoco.MjData(made.model(mode)) for made in (mirrored, hand))
        for state in (data, other):
            mujoco.mj_resetDataKeyframe(state.model, state, 0)
        signs = np.array([sign_of(data.model.joint(number).name) for number in data.model.dof_jntid])
        np.testing.assert_allclose(mass_matrix(other) * np.outer(signs, signs), mass_matrix(data), rtol=0, atol=1e-12)
        np.testing.assert_allclose(other.xpos, data.xpos, rtol=0, atol=1e-12)
    assert [state.model.joint("left/knee").range.tolist() for state in (data, other)] == [[-1, 2], [-2, 1]], "as the one document says"


def sign_of(joint: str) -> int:
    """Sign of a coordinate, and of its MuJoCo velocity, in the manually mirrored robot. Ball velocities have the same sign, because both
    are in the axes of the body."""
    side, _, name = joint.removesuffix(":slide").partition("/")
    return SIGNS.get(name, 1) if side in ("left", "laid") else 1


def test_mode_switch_with_mirrored_joints(mirrored: Built) -> None:
    """Switching the root keeps the state, including a mirrored ball and mirrored joints that the other tree traverses backwards."""
    modes = Modes.parse(mirrored.text("modes.json"))
    rng = np.random.default_rng(7)
    q, v = ({name: float(value) for name, value in random_positions(mirrored, rng).items()} for _ in "qv")
    v = {name: 0.004 * v[f"{name[:-6]}/knee"] if name.endswith("slide") else value for name, value in v.items()}
    start = modes["stand"].state(q=q, v=v, base_twist=[0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    held = modes.switch(start, "foot", on_motion="drop").state
    for name, state in (("stand", start), ("foot", held)):
        data = mujoco.MjData(mirrored.model(name))
        modes.write(state, data)
        mujoco.mj_forward(data.model, data)
        assert modes.read(name, data).q == pytest.approx(state.q)
        assert_said(modes[name], state, data)
    one, other = modes["stand"].poses(start), modes["foot"].poses(held)
    at = poses_in_torso(mirrored, q)
    for link in one:
        np.testing.assert_allclose(np.linalg.inv(one["torso"]) @ one[link], np.linalg.inv(other["torso"]) @ other[link], atol=1e-12)
        np.testing.assert_allclose(np.linalg.inv(one["torso"]) @ one[link], np.linalg.inv(at["torso"]) @ at[link], atol=1e-12)
