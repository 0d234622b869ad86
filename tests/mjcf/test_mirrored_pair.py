"""A pair of legs in which the left one has mirrored parts, or is mirrored as a whole: its bodies in MuJoCo are mirror images of the
right ones."""

from __future__ import annotations

import textwrap
from pathlib import Path

import mujoco
import numpy as np
import pytest

import thingc
from thingc.targets.hag.emit import text as hag_text

PART = """
    from build123d import *
    from thingc import MountPoint, Thing

    class Bone(Thing):
        '''Unlike its mirror image, and its mounts stand askew.'''

        def __init__(self):
            super().__init__(material="petg")
            self.body = Box(60, 12, 8) + Pos(20, 8, 3) * Box(10, 8, 4) - Pos(-10, 2, 4) * Box(14, 3, 4)
            self.top = MountPoint(Location((-30, 1, 2), (10, -90, 20)))
            self.end = MountPoint(Location((34, -2, 1), (-15, 80, 30)))

        def result(self):
            return self.body

    class Pin(Thing):
        '''Its own mirror image along y; but its mount is turned, and so is that of the image, the other way.'''

        def __init__(self):
            super().__init__(material="petg")
            self.bom = {"make": "buy", "number": "P-1"}
            self.foot = MountPoint(Location((0, 0, -4), (180, 0, 30)))

        def result(self):
            return Box(10, 6, 4)
"""

DOCUMENT = """
    thingc: assembly/1
    name: pair
    materials: {petg: {density: 1270 kg/m^3}}
    components:
      torso: {frame: true, mounts: {right: {xyz: 10 -40 5 mm, rpy: 90 0 0 deg}, left: {xyz: 10 40 5 mm, rpy: -90 0 0 deg}}}
      thigh_r: {part: bones:Bone, attach: {mount: top, to: torso.right, turn: 25 deg, gap: 3 mm}}
      thigh_l: {part: bones:Bone, mirror: y, attach: {mount: top, to: torso.left, turn: 155 deg, gap: 3 mm}}
      shin_r: {part: bones:Bone}
      shin_l: {part: bones:Bone, mirror: z}
      toe_r: {part: bones:Bone}
      toe_l: {part: bones:Bone, mirror: y}
    joints:
      knee_r: {type: revolute, parent: thigh_r.end, child: shin_r.top, turn: 10 deg, limit: {lower: -1 rad, upper: 2 rad}}
      knee_l: {type: revolute, parent: thigh_l.end, child: shin_l.top, turn: 170 deg, limit: {lower: -2 rad, upper: 1 rad}}
      toes_r: {type: prismatic, parent: shin_r.end, child: toe_r.top, limit: {lower: 0 mm, upper: 9 mm}}
      toes_l: {type: prismatic, parent: shin_l.end, child: toe_l.top, turn: 180 deg, limit: {lower: 0 mm, upper: 9 mm}}
    poses: {bent: {knee_r: 40 deg, knee_l: -40 deg, toes_r: 5 mm, toes_l: 5 mm}}
    modes: {stand: {root: torso, base: fixed, at: {xyz: 0 0 300 mm}, pose: bent}}
"""


def test_mirrored_parts_mirror_the_leg(tmp_path: Path, shared_store: str) -> None:
    """`turn` is 180 deg minus that of the right leg, and a rotation about a mirrored axis has the opposite sign. The mirror axis of a
    part does not change where it is placed."""
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts/bones.py").write_text(textwrap.dedent(PART))
    (tmp_path / "pair.yaml").write_text(textwrap.dedent(DOCUMENT))
    compiled = thingc.compile(str(tmp_path / "pair.yaml"), store=shared_store)
    assert [str(one) for one in compiled.diagnostics] == []
    model = compiled.modes["stand"].model()
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    across = np.diag([1.0, -1.0, 1.0])
    for name in ("shin", "toe"):
        right, left = (model.body(f"{name}_{side}").id for side in "rl")
        assert model.body_mass[left] == pytest.approx(model.body_mass[right], rel=1e-9)
        np.testing.assert_allclose(data.xipos[left], across @ data.xipos[right], atol=1e-9)
        turned = [axes @ np.diag(model.body_inertia[body]) @ axes.T for body in (right, left) for axes in (data.ximat[body].reshape(3, 3),)]
        np.testing.assert_allclose(turned[1], across @ turned[0] @ across, atol=1e-9 * model.body_inertia[right].max())
    assert [(one.text, one.plain and one.plain.text) for one in compiled.assembly.hag.definitions if one.mirror is not None] == [
        ("bones:Bone(mirror=y)", "bones:Bone"), ("bones:Bone(mirror=z)", "bones:Bone"),
    ]


WHOLE = {
    "pair.yaml": """
        thingc: assembly/1
        name: pair
        materials: {petg: {density: 1270 kg/m^3}}
        components:
          torso: {frame: true, mass: 1 g, mounts: {right: {xyz: 10 -40 5 mm, rpy: 90 0 0 deg}, left: {xyz: 10 40 5 mm, rpy: -90 0 0 deg}}}
          right: {assembly: leg.yaml, attach: {mount: top, to: torso.right, turn: 25 deg}}
          left: {assembly: leg.yaml, mirror: y, attach: {mount: top, to: torso.left, turn: 155 deg}}
        poses: {bent: {"*.knee": 40 deg}}
        modes: {stand: {root: torso, base: fixed, at: {xyz: 0 0 300 mm}, pose: bent}}
    """,
    "leg.yaml": """
        thingc: assembly/1
        name: leg
        materials: {petg: {density: 1270 kg/m^3}}
        components:
          thigh: {part: bones:Bone}
          shin: {part: bones:Bone, mirror: y}
          pin: {part: bones:Pin, attach: {foot: shin.end}}
        joints: {knee: {type: revolute, parent: thigh.end, child: shin.top, turn: 10 deg, limit: {lower: -1 rad, upper: 2 rad}}}
        mounts: {top: thigh.top}
    """,
}


def test_mirrored_leg_mirrors_its_parts(tmp_path: Path, shared_store: str) -> None:
    """Mirrored parts of a mirrored leg are the original parts. A pin that equals its mirror image keeps its BOM number."""
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts/bones.py").write_text(textwrap.dedent(PART))
    for name, text in WHOLE.items():
        (tmp_path / name).write_text(textwrap.dedent(text))
    compiled = thingc.compile(str(tmp_path / "pair.yaml"), store=shared_store)
    assert [str(one) for one in compiled.diagnostics] == []
    model = compiled.modes["stand"].model()
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    across = np.diag([1.0, -1.0, 1.0])
    right, left = (model.body(f"{side}/shin").id for side in ("right", "left"))
    assert data.qpos.tolist() == pytest.approx([np.radians(40)] * 2)
    assert model.body_mass[left] == pytest.approx(model.body_mass[right], rel=1e-9)
    np.testing.assert_allclose(data.xipos[left], across @ data.xipos[right], atol=1e-9)
    turned = [axes @ np.diag(model.body_inertia[body]) @ axes.T for body in (right, left) for axes in (data.ximat[body].reshape(3, 3),)]
    np.testing.assert_allclose(turned[1], across @ turned[0] @ across, atol=1e-9 * model.body_inertia[right].max())
    rest = {one.path: np.array(pose.rows()) for one, pose in zip(compiled.assembly.occurrences, compiled.assembly.rest, strict=True)}
    mirror = np.diag([1.0, -1.0, 1.0, 1.0])
    np.testing.assert_allclose(rest["left/pin"], mirror @ rest["right/pin"] @ mirror, atol=1e-12)
    assert hag_text(compiled.assembly.hag).split("\n\n")[1].splitlines()[1:] == [
        "  1 x frame (frame)", "  1 x leg (assembly)", "  2 x bones:Bone", "  2 x bones:Bone(mirror=y) mirrors bones:Bone",
        "  2 x bones:Pin", "  1 x leg(mirror=y) (assembly) mirrors leg",
    ]
    assert {one.path: one.bom.number for one in compiled.assembly.occurrences if one.path.endswith("pin")} == {
        "right/pin": "P-1", "left/pin": "P-1",
    }
