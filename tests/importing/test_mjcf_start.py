"""The start position of an imported robot and the dynamics of its free joint equal those of the MJCF file."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy
import pytest

import thingc
from importing.test_mjcf_names import imported_from
from thingc.modes import Modes

LIFT = """\
<mujoco model="lift">
  <worldbody>
    <body name="post"><geom type="box" size="0.1 0.1 0.05" mass="3"/>
      <body name="sled"><joint name="up" type="slide" axis="0 0 1" ref="0.5" range="0 1"/><geom size="0.05" mass="1"/>
        <body name="arm"><joint name="turn" axis="0 1 0" ref="-50" range="-120 -20"/><geom size="0.04" mass="1"/>
          <body name="hand"><joint name="bent" axis="0 1 0" range="10 40"/><geom pos="0.2 0 0" size="0.03" mass="1"/></body>
        </body>
      </body>
    </body>
  </worldbody>
  KEYS
</mujoco>
"""


@pytest.mark.parametrize(("keys", "name", "wanted"), [
    ("", "start", [0.5, -50.0, 10.0]),
    ('<keyframe><key name="home" qpos="0.2 -1 0.3"/><key name="up" qpos="0.9 -1 0.3"/></keyframe>', "home", None),
])
def test_source_mode_starts_where_the_file_starts(keys: str, name: str, wanted: list[float] | None, tmp_path: Path) -> None:
    """The start is `ref`, or the limit closest to it. Keyframes of the source stay first."""
    text = LIFT.replace("KEYS", keys)
    imported, theirs = imported_from(text, tmp_path), mujoco.MjModel.from_xml_string(text)
    assert [one.what for one in imported.losses if one.what.startswith("the start")] == (
        ["the start position of joint `bent`, 0"] if wanted else []
    )
    mode = thingc.compile(tmp_path / imported.document).modes["source"]
    ours = mode.model()
    expected = theirs.key_qpos[0] if wanted is None else numpy.array([wanted[0], *numpy.radians(wanted[1:])])
    assert ours.key(0).name == name
    numpy.testing.assert_allclose(ours.key_qpos[0], expected, atol=1e-6)
    one, other = mujoco.MjData(theirs), mujoco.MjData(ours)
    one.qpos[:], other.qpos[:] = expected, ours.key_qpos[0]
    mujoco.mj_kinematics(theirs, one)
    mujoco.mj_kinematics(ours, other)
    numpy.testing.assert_allclose(other.body("hand").xpos, one.body("hand").xpos, atol=1e-6)


TONGS = """\
<mujoco model="tongs">
  <worldbody>
    <body name="post"><geom type="box" size="0.1 0.1 0.05" mass="3"/>
      <body name="left"><joint name="left" axis="0 1 0" ref="-20"/><geom pos="0.2 0 0" size="0.03" mass="1"/></body>
      <body name="right"><joint name="right" axis="0 1 0" ref="5"/><geom pos="0.2 0 0" size="0.03" mass="1"/></body>
    </body>
  </worldbody>
  <equality><joint joint1="right" joint2="left" polycoef="0.2 -1 0 0 0"/></equality>
  KEYS
</mujoco>
"""


@pytest.mark.parametrize(("angle", "keys"), [
    ("-20", ""), ("0", ""), ("0", '<keyframe><key name="home" qpos="0.3 0.1"/></keyframe>'),
    ("0", '<keyframe><key name="start" qpos="0.3 -0.1"/><key name="up" qpos="0.9 -0.61273354"/></keyframe>'),
])
def test_violated_mimic_of_the_source_is_closed_at_the_start(angle: str, keys: str, tmp_path: Path) -> None:
    """The leading joint starts where the file or its first keyframe starts it. The start that the other joint cannot have is a loss. An
    import of the written model starts in the same keyframe."""
    text = TONGS.replace("KEYS", keys).replace("-20", angle)
    imported, theirs = imported_from(text, tmp_path), mujoco.MjModel.from_xml_string(text)
    left, right = theirs.key_qpos[0] if keys else theirs.qpos0
    closed = theirs.qpos0[1] + 0.2 - (left - theirs.qpos0[0])
    lost = [(one.what, one.why) for one in imported.losses if "joint `right` at" in one.what or one.what.startswith("the start position")]
    assert abs(closed - right) > 1e-3 and len(lost) == 1 and "the joint mimics `left`" in lost[0][1]
    assert keys or lost[0] == (f"the start position of joint `right`, {right:g}", f"the joint mimics `left` ({closed:g} is used)")
    mode = thingc.compile(tmp_path / imported.document).modes["source"]
    ours = mode.model()
    name = "home" if "home" in keys else "start"
    assert [ours.key(k).name for k in range(ours.nkey)] == [name, *(["up"] if "up" in keys else [])]
    again = tmp_path / "again"
    again.mkdir()
    second = imported_from(mode.mjcf(), again)
    third = thingc.compile(again / second.document).modes["source"].model()
    assert [third.key(k).name for k in range(third.nkey)] == [ours.key(k).name for k in range(ours.nkey)]
    for model in (ours, third):
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, 0)
        mujoco.mj_forward(model, data)
        assert [data.joint(name).qpos[0] for name in ("left", "right")] == pytest.approx([left, closed], abs=1e-6)
        assert abs(data.efc_pos[0]) < 1e-6


def test_keyframe_with_a_mimic_outside_its_limits_is_lost(tmp_path: Path) -> None:
    keys = '<keyframe><key name="far" qpos="1 0"/><key name="near" qpos="0.1 0.1"/></keyframe>'
    text = TONGS.replace("KEYS", keys).replace('name="right" axis', 'name="right" range="-30 30" axis')
    imported = imported_from(text, tmp_path)
    why = "joint `right`, which mimics another joint, would be outside its limits"
    assert [(one.what, one.why) for one in imported.losses if one.what.startswith("keyframe")] == [("keyframe `far`", why)]
    model = thingc.compile(tmp_path / imported.document).modes["source"].model()
    assert [model.key(k).name for k in range(model.nkey)] == ["near"]


FLOATING = """\
<mujoco model="dog">
  <default><joint armature="0.3" damping="0.2" frictionloss="0.1"/></default>
  <worldbody>
    <body name="ball" pos="2 0 1">
      <freejoint/><geom size="0.1"/>
      <body><joint name="spin"/><geom size="0.01"/></body>
    </body>
    <body name="trunk" pos="0 0 1">
      <joint name="floating_base_joint" type="free"/>
      <geom size="0.1"/>
      <body name="leg">
        <joint name="knee" axis="0 1 0"/><joint name="twist"/>
        <geom size="0.05" pos="0 0 -0.2"/>
        <body name="tip" pos="0 0 -0.1"><inertial mass="-1" pos="0 0 0" diaginertia="0 0 0"/></body>
      </body>
    </body>
  </worldbody>
  <contact><exclude name="apart" body1="trunk" body2="leg"/></contact>
  <actuator><motor name="roll" joint="spin"/><motor name="bend" joint="knee"/></actuator>
  <keyframe><key name="home" qpos="2 0 1 1 0 0 0 0 0.1 0.2 0.4 0.6 0.8 0 0 0.1 0.2"/></keyframe>
</mujoco>
"""


def test_free_base_keeps_name_dynamics_and_keyframes(tmp_path: Path) -> None:
    imported, theirs = imported_from(FLOATING, tmp_path), mujoco.MjModel.from_xml_string(FLOATING)
    compiled = thingc.compile(tmp_path / imported.document)
    ours = compiled.modes["source"].model()
    one, other = theirs.joint("floating_base_joint"), ours.joint("floating_base_joint")
    for field in ("armature", "damping", "frictionloss"):
        numpy.testing.assert_array_equal(getattr(other, field), getattr(one, field))
    here = theirs.key("home").qpos
    numpy.testing.assert_allclose(ours.key("home").qpos, [*here[8:], *here[:8]], atol=1e-12)  # the ball is released by the trunk
    data = mujoco.MjData(ours)
    mujoco.mj_resetDataKeyframe(ours, data, 0)
    state = Modes.parse(compiled.modes["source"].files["modes.json"]).read("source", data)
    numpy.testing.assert_allclose(state.base_pose[:3, 3], [0.1, 0.2, 0.4])


def test_changed_indices_are_losses_with_their_mapping(tmp_path: Path) -> None:
    imported = imported_from(FLOATING, tmp_path)
    said = {loss.what: loss.why.partition(": ")[2] for loss in imported.losses}
    assert said["the indices of `data.qpos`"] == "[8:17] is [0:9], [0:8] is [9:17]"
    assert said["the indices of `data.qvel`"] == "[7:15] is [0:8], [0:7] is [8:15]"
    assert "a mass of -1" in said and "the name of exclude `apart`" in said and "the indices of `data.sensordata`" not in said
