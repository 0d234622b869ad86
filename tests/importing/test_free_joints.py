"""Free joints of documents that are built and imported again from MJCF and URDF: MuJoCo simulates the same motions."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from importing.imports import import_cleanly
from loops.robots import Built, compiled, pose_of
from robot.test_free_joints import GRIPPER
from thingc.driver import pipeline
from thingc.driver.environment import Environment, Options
from thingc.tools.importing.import_request import ImportRequest

PLAIN = {"TC517", "TC522", "TC610", "TC792"}


def imported(file: Path, folder: Path, *, keep: bool = False) -> Built:
    found = import_cleanly(file, ImportRequest(keep=keep))
    folder.mkdir()
    made = compiled(folder, {found.document: found.files[found.document].decode()})
    assert {code for code, *_ in made.said} <= PLAIN, made.said
    return made


@pytest.mark.parametrize("mode", ["bench", "by_ball"])
def test_mjcf_round_trip_gives_the_same_motion(tmp_path: Path, mode: str) -> None:
    tmp_path.joinpath("one").mkdir()
    original = compiled(tmp_path / "one", GRIPPER)
    file = tmp_path / "model.xml"
    file.write_text(original.text(f"mjcf/gripper_{mode}.xml"))
    again = imported(file, tmp_path / "two")
    theirs, ours = mujoco.MjModel.from_xml_path(str(file)), again.model("source")
    assert [theirs.joint(k).name for k in range(theirs.njnt)] == [ours.joint(k).name for k in range(ours.njnt)]
    bodies = [theirs.body(k).name for k in range(1, theirs.nbody)]
    for key in range(theirs.nkey):
        one, other = mujoco.MjData(theirs), mujoco.MjData(ours)
        mujoco.mj_resetDataKeyframe(theirs, one, key)
        mujoco.mj_resetDataKeyframe(ours, other, ours.key(theirs.key(key).name).id)
        for model, data in ((theirs, one), (ours, other)):
            data.qvel[:] = np.linspace(-1, 1, model.nv)
            mujoco.mj_step(model, data, 20)
        for body in bodies:
            assert pose_of(other.body(body)) == pytest.approx(pose_of(one.body(body)), abs=1e-9), (theirs.key(key).name, body)


def test_urdf_round_trip_gives_the_same_motion(tmp_path: Path) -> None:
    tmp_path.joinpath("one").mkdir()
    original = compiled(tmp_path / "one", GRIPPER)
    with Environment(str(tmp_path / "one" / "robot.yaml"), Options(store=str(tmp_path / "store"))) as environment:
        compilation = pipeline.compile(environment)
        files = pipeline.build(environment, compilation, ["urdf"])["urdf"].files
    for path, content in files.items():
        if isinstance(content, bytes):
            tmp_path.joinpath(path).parent.mkdir(parents=True, exist_ok=True)
            tmp_path.joinpath(path).write_bytes(content)
    again = imported(tmp_path / "urdf" / "gripper_bench.urdf", tmp_path / "two")
    theirs, ours = original.model("bench"), again.model("source")
    one, other = mujoco.MjData(theirs), mujoco.MjData(ours)
    for model, data in ((theirs, one), (ours, other)):
        data.joint("close").qpos[:], data.joint("spin").qpos[:] = 0.3, -1.2
        mujoco.mj_forward(model, data)
    here, there = (np.linalg.inv(pose_of(data.body("palm"))) @ pose_of(data.body("ball")) for data in (one, other))
    assert there[:3, 3] == pytest.approx(here[:3, 3], abs=1e-9)
    assert {ours.joint(k).name for k in range(ours.njnt)} == {"close", "grasp", "spin"}
    assert ours.body_mass.sum() == pytest.approx(theirs.body_mass.sum())


def test_keep_preserves_fixed_links(tmp_path: Path) -> None:
    """With `keep`, links that are fixed to another link become separate bodies again."""
    tmp_path.joinpath("one").mkdir()
    pad = "  pad: {frame: true, mass: 1 g, at: {in: finger.origin}, keep: true}\n"
    original = compiled(tmp_path / "one", GRIPPER.replace("  flag: {frame", f"{pad}  flag: {{frame"))
    file = tmp_path / "model.xml"
    file.write_text(original.text("mjcf/gripper_bench.xml"))
    theirs = mujoco.MjModel.from_xml_path(str(file))
    without, ours = (imported(file, tmp_path / str(keep), keep=keep).model("source") for keep in (False, True))
    assert ours.nbody == theirs.nbody == without.nbody + 1
    assert ours.body("pad").mass == theirs.body("pad").mass
    assert ours.body(ours.body("pad").parentid[0]).name == "finger"


SCENE = """\
<mujoco model="desk">
  <worldbody>
    <geom type="plane" size="1 1 0.1"/>
    <body name="base"><geom type="box" size=".1 .1 .1" mass="1"/>
      <body name="arm" pos="0 0 0.2"><joint name="turn"/><geom type="capsule" size=".02 .1" mass=".5"/></body>
    </body>
    <body name="cube" pos="0.3 0 0.05" euler="0 0 30"><freejoint/><geom type="box" size=".05 .05 .05" mass=".1"/></body>
    <body name="ball" pos="0.3 0.4 0.05"><freejoint name="rolls"/><geom size=".05" mass=".1"/></body>
  </worldbody>
</mujoco>
"""


def test_scene_objects_move_freely(tmp_path: Path) -> None:
    """A MuJoCo scene becomes a robot with objects that move freely."""
    file = tmp_path / "scene.xml"
    file.write_text(SCENE)
    again = imported(file, tmp_path / "two")
    theirs, ours = mujoco.MjModel.from_xml_path(str(file)), again.model("source")
    assert (ours.nq, ours.nv) == (theirs.nq, theirs.nv)
    one, other = mujoco.MjData(theirs), mujoco.MjData(ours)
    for model, data in ((theirs, one), (ours, other)):
        mujoco.mj_forward(model, data)
    for body in ("base", "arm", "cube", "ball"):
        assert pose_of(other.body(body)) == pytest.approx(pose_of(one.body(body)), abs=1e-9), body
