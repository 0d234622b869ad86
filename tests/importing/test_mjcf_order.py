"""Actuators and sensors of an imported MJCF file keep the indices of the source, in every mode and in nested documents."""

from __future__ import annotations

import re
from pathlib import Path

import mujoco
import numpy
import pytest

import thingc
from importing.imports import write_import
from importing.test_mjcf_names import imported_from
from thingc.base.diagnostics import Report
from thingc.tools.importing.import_request import ImportRequest
from thingc.tools.importing.importing import import_robot

SOURCE = """\
<mujoco model="robot">
  <worldbody>
    <body name="trunk" pos="0 0 0.5">
      <freejoint/>
      <geom name="belly" type="box" size="0.1 0.1 0.05" mass="2"/>
      <site name="imu"/>
      <body name="left" pos="0 0.1 0">
        <joint name="hip.L" axis="0 1 0"/>
        <geom name="thigh.L" type="capsule" fromto="0 0 0 0 0 -0.2" size="0.02" mass="0.1"/>
        <site name="end" pos="0.05 0 -0.1"/>
        <body name="shank" pos="0 0 -0.2">
          <joint name="knee" axis="0 1 0" range="-90 90"/>
          <geom name="sole" type="capsule" fromto="0 0 0 0 0 -0.2" size="0.02" mass="0.1"/>
        </body>
      </body>
      <body name="right" pos="0 -0.1 0">
        <joint name="hip.R" axis="0 1 0"/>
        <geom name="thigh.R" type="capsule" fromto="0 0 0 0 0 -0.2" size="0.02" mass="0.1"/>
      </body>
    </body>
  </worldbody>
  <contact><pair name="own" geom1="thigh.R" geom2="sole" condim="1" margin="0.5" solref="0.05 1"/></contact>
  <tendon>
    <spatial name="cord"><site site="imu"/><site site="end"/></spatial>
    <fixed name="sum"><joint joint="hip.L" coef="1"/><joint joint="hip.R" coef="-1"/></fixed>
  </tendon>
  <actuator>
    <muscle name="flex.or" tendon="cord" lengthrange="0 0.2"/>
    <motor name="right" joint="hip.R"/>
    <adhesion name="suck" body="shank" ctrlrange="0 1" gain="2"/>
    <position name="pull" tendon="sum" kp="3"/>
    <position name="knee" joint="knee" kp="5"/>
    <general name="hip_L" joint="hip.L" dyntype="filter" dynprm="0.1" gainprm="7"/>
    <motor name="again" joint="knee" gear="2"/>
    <motor name="left" joint="hip.L"/>
  </actuator>
  <sensor>
    <jointvel name="fast" joint="hip.R"/>
    <framelinvel name="moving" objtype="xbody" objname="shank"/>
    <jointpos joint="hip.R"/>
    <contact name="touch.L" geom1="thigh.R" geom2="sole" data="found dist" reduce="mindist"/>
    <jointpos joint="hip.L"/>
    <jointpos name="second" joint="hip.R"/>
    <actuatorfrc name="torn" actuator="again"/>
    <force name="base" site="imu"/>
    <gyro name="turning" site="imu"/>
    <jointlimitpos name="near" joint="knee"/>
    <subtreecom name="leg" body="left"/>
    <framequat name="turned" objtype="geom" objname="sole" reftype="site" refname="imu"/>
    <user name="own" dim="2"/>
    <clock/>
  </sensor>
  <keyframe><key name="home" qpos="0 0 0.5 1 0 0 0 0.1 0.2 0.3" ctrl="0.1 0.2 0.3 0.4 0.5 0.6 0.7 0.8"/></keyframe>
</mujoco>
"""


def names_of(model: mujoco.MjModel, kind: mujoco.mjtObj, count: int) -> list[str]:
    """Return the names of the elements of a kind, in model order."""
    return [mujoco.mj_id2name(model, kind, number) or "" for number in range(count)]


def forces(model: mujoco.MjModel, data: mujoco.MjData, control: int) -> numpy.ndarray:
    """Return the generalized forces before and after an increment of one control."""
    mujoco.mj_forward(model, data)
    before = data.qfrc_actuator.copy()
    data.ctrl[control] += 0.5
    mujoco.mj_forward(model, data)
    after = data.qfrc_actuator.copy()
    data.ctrl[control] -= 0.5
    return numpy.concatenate([before, after])


def test_controls_and_sensordata_have_the_source_order(tmp_path: Path) -> None:
    theirs = mujoco.MjModel.from_xml_string(SOURCE)
    imported = imported_from(SOURCE, tmp_path)
    ours = thingc.compile(tmp_path / imported.document).modes["source"].model()
    assert not [loss for loss in imported.losses if loss.what.startswith(("actuator", "sensor", "a contact pair"))]
    actuators, sensors = (mujoco.mjtObj.mjOBJ_ACTUATOR, mujoco.mjtObj.mjOBJ_SENSOR)
    assert ours.nu == theirs.nu and ours.na == theirs.na
    for number, name in enumerate(names_of(theirs, actuators, theirs.nu)):
        assert ours.actuator(number).name == ("shank/suck" if name == "suck" else "hip_L_2" if name == "hip_L" else name)
    for number, name in enumerate(names_of(theirs, sensors, theirs.nsensor)):
        assert not name or ours.sensor(number).name == name
    assert [*ours.sensor_type[: theirs.nsensor]] == [*theirs.sensor_type]
    assert [*ours.sensor_dim[: theirs.nsensor]] == [*theirs.sensor_dim]
    numpy.testing.assert_allclose(ours.key_ctrl, theirs.key_ctrl, atol=1e-12)
    (pair,) = range(ours.npair)
    for field in ("dim", "friction", "solref", "solimp", "margin", "gap"):
        numpy.testing.assert_array_equal(getattr(ours, f"pair_{field}")[pair], getattr(theirs, f"pair_{field}")[pair])
    random, (one, other) = numpy.random.default_rng(3), (mujoco.MjData(theirs), mujoco.MjData(ours))
    for _ in range(5):
        one.qpos[:] = numpy.concatenate([[0.0, 0.0, 0.5, 1.0, 0.0, 0.0, 0.0], random.uniform(-0.5, 0.5, 3)])
        one.qvel[:], one.act[:], one.ctrl[:] = random.uniform(-1, 1, 9), random.uniform(0, 1, 2), random.uniform(0, 1, 8)
        other.qpos[:], other.qvel[:], other.act[:], other.ctrl[:] = one.qpos, one.qvel, one.act, one.ctrl
        for control in range(theirs.nu):
            numpy.testing.assert_allclose(forces(ours, other, control), forces(theirs, one, control), atol=1e-9)
        numpy.testing.assert_allclose(other.sensordata[: theirs.nsensordata], one.sensordata, rtol=1e-7, atol=1e-9)


def test_a_single_sensor_precedes_the_other_readings_of_its_joint(tmp_path: Path) -> None:
    text = re.sub("(?s)<sensor>.*</sensor>", '<sensor><jointvel joint="hip.R"/></sensor>', SOURCE)
    model = thingc.compile(tmp_path / imported_from(text, tmp_path).document).modes["source"].model()
    assert model.nsensor == 3 and model.sensor_type[0] == mujoco.mjtSensor.mjSENS_JOINTVEL


def test_order_is_equal_for_every_root_and_nested_document(tmp_path: Path) -> None:
    (tmp_path / "source.xml").write_text(SOURCE)
    imported = import_robot(str(tmp_path / "source.xml"), Report(), ImportRequest(roots=["shank"]))
    assert imported is not None
    write_import(imported, tmp_path)
    (tmp_path / "both.yaml").write_text("""\
thingc: assembly/1
name: both
components:
  base: {frame: true, mass: 1 kg, inertia: {ixx: 0.01 kg*m^2, iyy: 0.01 kg*m^2, izz: 0.01 kg*m^2}}
  one: {assembly: robot.yaml, at: {in: base.origin}}
  two: {assembly: robot.yaml, at: {in: base.origin, xyz: 1 0 0 m}}
modes:
  stand: {root: base, base: free}
""")
    actuator, sensor = mujoco.mjtObj.mjOBJ_ACTUATOR, mujoco.mjtObj.mjOBJ_SENSOR
    modes = {name: mode.model() for name, mode in thingc.compile(tmp_path / "robot.yaml").modes.items()}
    source, turned = modes["source"], modes["shank"]
    assert names_of(turned, actuator, turned.nu) == names_of(source, actuator, source.nu)
    assert names_of(turned, sensor, 14) == names_of(source, sensor, 14)
    both = thingc.compile(tmp_path / "both.yaml").modes["stand"].model()
    own = [name for name in names_of(source, actuator, source.nu) if name != "shank/suck"]  # a mode states what adheres
    assert names_of(both, actuator, both.nu) == [f"{robot}/{name}" for robot in ("one", "two") for name in own]


ORDERED = """\
thingc: assembly/1
name: ordered
components:
  base: {frame: true, mass: 1 kg, inertia: {ixx: 0.01 kg*m^2, iyy: 0.01 kg*m^2, izz: 0.01 kg*m^2}}
  a: {frame: true, mass: 1 kg, inertia: {ixx: 0.01 kg*m^2, iyy: 0.01 kg*m^2, izz: 0.01 kg*m^2}}
  b: {frame: true, mass: 1 kg, inertia: {ixx: 0.01 kg*m^2, iyy: 0.01 kg*m^2, izz: 0.01 kg*m^2}}
joints:
  first: {type: continuous, parent: base.origin, child: a.origin, axis: [0, 0, 1], drive: {kind: position, kp: 1 N*m/rad}}
  second: {type: continuous, parent: base.origin, child: b.origin, axis: [0, 0, 1], drive: {kind: position, kp: 2 N*m/rad}}
poses:
  there: {first: 1 rad, second: 2 rad}
modes:
  all: {root: base}
  some: {root: base, actuators: [first]}
raw:
  mjcf:
    order: {actuator: [second]}
    key: {there: {ctrl: RAW}}
"""


@pytest.mark.parametrize(("raw", "controls"), [("", [2.0, 1.0]), ("5 6", [5.0, 6.0])])
def test_unlisted_actuators_come_last(raw: str, controls: list[float], tmp_path: Path) -> None:
    """Keyframe controls are in the order of the model. Raw controls already have this order."""
    text = ORDERED.replace("RAW", raw) if raw else ORDERED.replace("    key: {there: {ctrl: RAW}}\n", "")
    (tmp_path / "ordered.yaml").write_text(text.replace("  some: {root: base, actuators: [first]}\n", "") if raw else text)
    modes = thingc.compile(tmp_path / "ordered.yaml").modes
    model = modes["all"].model()
    assert names_of(model, mujoco.mjtObj.mjOBJ_ACTUATOR, model.nu) == ["second", "first"]
    assert [*model.key("there").ctrl] == controls
    if not raw:
        some = modes["some"].model()
        assert names_of(some, mujoco.mjtObj.mjOBJ_ACTUATOR, some.nu) == ["first"]


def test_sensors_on_one_site_are_combined_into_an_imu(tmp_path: Path) -> None:
    """An accelerometer, a gyro and an orientation on one site form an IMU. A single one, or one relative to another frame, stays a
    separate sensor. Indices and names equal those of the source."""
    inertial = """
    <framequat name="heading" objtype="site" objname="end"/>
    <accelerometer name="pull.1" site="end"/>
    <gyro name="rate" site="end"/>
  """
    source = SOURCE.replace("    <clock/>\n  ", f"    <clock/>{inertial}")
    theirs = mujoco.MjModel.from_xml_string(source)
    imported = imported_from(source, tmp_path)
    text = (tmp_path / imported.document).read_text()
    assert text.count("type: imu") == 1 and "type: gyro" in text and "type: accelerometer" not in text
    ours = thingc.compile(tmp_path / imported.document).modes["source"].model()
    for number, name in enumerate(names_of(theirs, mujoco.mjtObj.mjOBJ_SENSOR, theirs.nsensor)):
        assert ours.sensor_type[number] == theirs.sensor_type[number] and (not name or ours.sensor(number).name == name)
