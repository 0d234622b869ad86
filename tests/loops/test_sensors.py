"""`sensors`: from the document into MuJoCo, with readings compared with written-out mechanics."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from loops.robots import BALL, Built, compiled, placed, pose_of

G = 9.81
LEG = f"""\
thingc: assembly/1
name: leg
components:
  shin:
    frame: true
    mass: 0.5 kg
    {BALL}
    com: [0, 0, 100 mm]
    mounts: {{top: {{xyz: 0 0 200 mm}}, low: {{rpy: 180 0 0 deg}}}}
  foot:
    frame: true
    mass: 0.2 kg
    {BALL}
    com: [0, 0, 20 mm]
    mounts: {{ankle: {{rpy: 180 0 0 deg}}, sole: {{xyz: 10 0 40 mm, rpy: 0 20 0 deg}}}}
joints:
  ankle: {{type: revolute, parent: shin.top, child: foot.ankle, limit: {{lower: -90 deg, upper: 90 deg}}}}
mounts: {{hip: shin.low, sole: foot.sole}}
sensors:
  sole: {{type: force, at: sole}}
  load: {{type: force, at: foot.ankle}}
  ankle: {{type: joint}}
"""
BODY = f"""\
thingc: assembly/1
name: walker
components:
  body: {{frame: true, mass: 2 kg, {BALL}, mounts: {{hip: {{rpy: 0 90 0 deg}}, imu: {{xyz: 0 0 50 mm, rpy: 0 0 30 deg}}}}}}
  leg: {{assembly: leg.yaml}}
  head:
    frame: true
    mass: 0.1 kg
    {BALL}
    mounts: {{lens: {{xyz: 30 0 0 mm, rpy: 0 90 0 deg}}}}
    at: {{in: body.origin, xyz: 0 0 100 mm}}
joints:
  hip:
    type: revolute
    parent: body.hip
    child: leg.hip
    limit: {{lower: -90 deg, upper: 90 deg}}
    drive: {{kind: motor, effort: 10 N*m}}
sensors:
  imu: {{type: imu, at: body.imu}}
  swing: {{type: joint, joint: hip}}
  eye: {{type: camera, at: head.lens, fovy: 60 deg}}
  hip: {{type: force, at: body.hip}}
poses:
  some: {{hip: 30 deg, leg.ankle: -20 deg}}
modes:
  bench: {{root: body, pose: some, at: {{xyz: 0 0 1 m, rpy: 10 20 30 deg}}}}
  adrift: {{root: body, base: free, pose: some}}
  stand: {{root: leg.sole, base: held, pose: some}}
  shin: {{root: leg.hip, base: fixed, pose: some}}
"""


@pytest.fixture(scope="module")
def walker(tmp_path_factory: pytest.TempPathFactory) -> Built:
    found = compiled(tmp_path_factory.mktemp("walker"), {"walker.yaml": BODY, "leg.yaml": LEG})
    assert found.said == []
    return found


def data_at_rest(model: mujoco.MjModel) -> mujoco.MjData:
    """The first keyframe with bias forces compensated, so all accelerations are 0."""
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    data.qfrc_applied[:] = data.qfrc_bias
    mujoco.mj_forward(model, data)
    assert np.abs(data.qacc).max(initial=0.0) < 1e-9
    return data


def supporting_wrench(data: mujoco.MjData, bodies: list[str], about: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Force and moment about a point that carry these bodies, in the world."""
    force, moment = np.zeros(3), np.zeros(3)
    for name in bodies:
        body = data.body(name)
        up = np.array([0.0, 0.0, data.model.body_mass[body.id] * G])
        force += up
        moment += np.cross(body.xipos - about, up)
    return force, moment


def expect_wrench(data: mujoco.MjData, sensor: str, site: str, bodies: list[str]) -> None:
    """Assert that a force sensor reads the wrench that carries `bodies` through the site, in the axes of the site."""
    r, about = data.site(site).xmat.reshape(3, 3), data.site(site).xpos
    force, moment = supporting_wrench(data, bodies, about)
    assert data.sensor(f"{sensor}:force").data == pytest.approx(r.T @ force, abs=1e-9)
    assert data.sensor(f"{sensor}:torque").data == pytest.approx(r.T @ moment, abs=1e-9)


def test_sensor_names_and_order(walker: Built) -> None:
    names = [
        "imu:accelerometer", "imu:gyro", "imu:quat", "swing:position", "swing:velocity", "swing:effort",
        "hip:force", "hip:torque",
        "leg/sole:force", "leg/sole:torque", "leg/load:force", "leg/load:torque", "leg/ankle:position", "leg/ankle:velocity",
        "leg/ankle:effort",
    ]
    for mode in ("bench", "stand", "shin"):
        model = walker.model(mode)
        assert [model.sensor(k).name for k in range(model.nsensor)] == names
        assert [model.camera(k).name for k in range(model.ncam)] == ["eye"]
        sites = {model.site(k).name for k in range(model.nsite)}
        assert sites >= {"body/imu", "body/hip", "head/lens", "leg/foot/sole", "leg/foot/ankle"}
    # Nothing carries the body there.
    adrift = walker.model("adrift")
    assert [adrift.sensor(k).name for k in range(adrift.nsensor)] == [name for name in names if not name.startswith("hip:")]


@pytest.mark.parametrize("mode", ["bench", "adrift", "stand", "shin"])
def test_imu_reads_in_mount_axes(walker: Built, mode: str) -> None:
    """At rest, the accelerometer reads 1 g upwards. On the root, MuJoCo reports no acceleration, which is a loss."""
    model = walker.model(mode)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    data.qvel[:] = np.linspace(0.3, -0.4, model.nv)
    mujoco.mj_forward(model, data)
    r = pose_of(data.body("body"))[:3, :3] @ placed((0, 0, 0), (0, 0, np.pi / 6))[:3, :3]
    linear, angular = np.zeros((3, model.nv)), np.zeros((3, model.nv))
    mujoco.mj_jacBody(model, data, linear, angular, model.body("body").id)
    assert data.sensor("imu:gyro").data == pytest.approx(r.T @ angular @ data.qvel, abs=1e-12)
    found = np.zeros(9)
    mujoco.mju_quat2Mat(found, data.sensor("imu:quat").data)
    assert found.reshape(3, 3) == pytest.approx(r, abs=1e-12)
    if mode == "bench":
        assert data_at_rest(model).sensor("imu:accelerometer").data.tolist() == [0.0, 0.0, 0.0]
    elif mode != "adrift":
        still = data_at_rest(model)
        r = pose_of(still.body("body"))[:3, :3] @ placed((0, 0, 0), (0, 0, np.pi / 6))[:3, :3]
        assert still.sensor("imu:accelerometer").data == pytest.approx(r.T @ [0, 0, G], abs=1e-9)


def test_joint_sensors_read_document_coordinates(walker: Built) -> None:
    for mode in ("bench", "adrift", "stand", "shin"):
        model = walker.model(mode)
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, 0)
        data.joint("hip").qvel = 0.7
        data.ctrl[0] = 2.5
        mujoco.mj_forward(model, data)
        readings = [float(data.sensor(f"swing:{what}").data[0]) for what in ("position", "velocity", "effort")]
        assert readings == pytest.approx([np.pi / 6, 0.7, 2.5], abs=1e-12)
        assert float(data.sensor("leg/ankle:position").data[0]) == pytest.approx(-np.pi / 9, abs=1e-12)


def test_force_sensors_measure_the_carried_weight(walker: Built) -> None:
    bench = data_at_rest(walker.model("bench"))
    expect_wrench(bench, "leg/load", "leg/foot/ankle", ["leg/foot"])
    expect_wrench(bench, "leg/sole", "leg/foot/sole", ["leg/foot"])
    # On the sole stands everything.
    stand = data_at_rest(walker.model("stand"))
    expect_wrench(stand, "leg/sole", "leg/foot/sole", ["leg/foot", "leg/shin", "body"])
    # The hip carries the body where the leg carries the hip.
    expect_wrench(stand, "hip", "body/hip", ["body"])
    expect_wrench(data_at_rest(walker.model("shin")), "hip", "body/hip", ["body"])


def test_displaced_force_sensors_are_losses(walker: Built) -> None:
    def lost(mode: str) -> list[tuple[str, str, str]]:
        return [(loss.path, loss.what, loss.how) for loss in walker.losses(mode)]

    assert lost("bench") == [
        ("imu", "gravity in the accelerometer: MuJoCo reports no acceleration for a body at rest", "approximated"),
        ("hip", "the force at the mount: the sensor measures the force between its link and the world at `body/origin`", "approximated"),
    ]
    assert lost("adrift") == [("hip", "the sensor: the root of a free base has no parent link", "omitted")]
    assert lost("stand") == [
        (
            "leg/load", "the force at the mount: the sensor measures the force between its link and the world at `leg/sole`",
            "approximated",
        ),
    ]
    assert lost("shin") == []


def test_force_sensor_on_an_inner_link_is_a_loss(tmp_path: Path) -> None:
    """The mount is on a middle link and no joint uses it. MuJoCo measures the force through the joint below."""
    text = LEG.replace("sole: {type: force, at: sole}", "skin: {type: force, at: shin.skin}")
    text = text.replace("low: {rpy", "skin: {xyz: 20 0 0 mm}, low: {rpy")
    found = compiled(tmp_path, {
        "walker.yaml": BODY.replace("root: leg.sole", "root: leg.foot.sole"), "leg.yaml": text,
    })
    assert found.said == []
    assert [(loss.path, loss.what) for loss in found.losses("bench") if loss.path == "leg/skin"] == [
        ("leg/skin", "the force at the mount: the sensor measures the force through joint `hip`")
    ]


@pytest.mark.parametrize("mode", ["bench", "stand"])
def test_camera_looks_along_mount_z_with_y_up(walker: Built, mode: str) -> None:
    model = walker.model(mode)
    data = data_at_rest(model)
    assert model.camera("eye").fovy == pytest.approx(60.0)
    lens = pose_of(data.body("body")) @ placed((0, 0, 0.1)) @ placed((0.03, 0, 0), (0, np.pi / 2, 0))
    camera = data.camera("eye")
    r = camera.xmat.reshape(3, 3)
    assert camera.xpos == pytest.approx(lens[:3, 3], abs=1e-12)
    assert -r[:, 2] == pytest.approx(lens[:3, 2], abs=1e-12)  # MuJoCo's looks along -z
    assert r[:, 1] == pytest.approx(lens[:3, 1], abs=1e-12)


def test_raw_attributes_apply_to_sensors_and_cameras(tmp_path: Path) -> None:
    raw = "raw:\n  mjcf:\n    sensor: {'imu:gyro': {noise: 0.01}}\n    camera: {eye: {resolution: 320 240}}\n"
    found = compiled(tmp_path, {"walker.yaml": BODY + raw, "leg.yaml": LEG})
    assert found.said == []
    assert found.model("bench").sensor("imu:gyro").noise == pytest.approx(0.01)
    assert found.model("bench").cam_resolution[0].tolist() == [320, 240]


SENSORS = BODY.partition("sensors:")[0] + "sensors:\n"


@pytest.mark.parametrize(
    ("sensor", "code", "message", "help"),
    [
        ("a: {type: imu, at: body.imo}", "TC303", "frame `body` has no mount `imo`", "did you mean `imu`?"),
        ("a: {type: imu, at: bady.imu}", "TC302", "this document has no component `bady`", "did you mean `body`?"),
        ("a: {type: imu, at: body}", "TC310", "expected a mount, found the component `body`",
         "use a mount of the component, for example `body.origin`"),
        ("a: {type: imu}", "TC212", "a sensor of type `imu` requires `at`, found none", "write, for example, `at: body.top`"),
        ("a: {type: joint, joint: leg.ankel}", "TC304", "there is no joint `leg.ankel`", "did you mean `leg.ankle`?"),
        ("hop: {type: joint}", "TC304", "there is no joint `hop`", "set `joint`; did you mean `hip`?"),
        ("a: {type: clock, volume: {sphere: {radius: 9 mm}}}", "TC212", "a sensor of type `clock` cannot have `volume`",
         "remove `volume`, or choose another `type`: `touch`"),
        ("a: {type: force, at: body.imu, joint: hip}", "TC212", "a sensor of type `force` cannot have `joint`",
         "remove `joint`, or choose another `type`: `joint` or `drive`"),
        ("a: {type: force, at: body.imu, fovy: 40 deg}", "TC212", "a sensor of type `force` cannot have `fovy`",
         "remove `fovy`, or choose another `type`: `camera`"),
        ("a: {type: drive}", "TC212", "a sensor of type `drive` requires `joint` or `tendon`, found none",
         "write, for example, `joint: knee`"),
        ("a: {type: drive, joint: leg.ankle}", "TC338", "joint `leg.ankle` has no drive to measure",
         "add a `drive` to the joint, or measure the joint itself"),
        ("a: {type: tendon, tendon: cord}", "TC363", "this document has no tendon `cord`", "no tendons are available"),
        ("a: {type: contact, of: leg}", "TC310", "the touch sensor `a` cannot be on the assembly `leg`",
         "use a component of the assembly, for example `hand.finger`"),
        ("a: {type: imu, at: body.imu, noise: 0.1 rad/s}", "TC212",
         "`noise` of a sensor of type `imu` must be a mapping",
         "write, for example, `noise: {accelerometer: ...}`"),
        ("a: {type: pose, at: body.imu, noise: {quat: 1 deg}}", "TC212",
         "a sensor of type `pose` does not measure `quat`",
         "known readings: `position`"),
        ("a: {type: gyro, at: body.imu, cutoff: 3 mm}", "TC314",
         "`cutoff` of sensor `a` must be an angular velocity (such as 46 rpm), found a length (`3 mm`)", None),
        ("a: {type: rangefinder, at: body.imu, range: 0}", "TC315", "`range` of sensor `a` must be above 0, found `0`", None),
        ("a: {type: camera, at: body.imu, fovy: 180 deg}", "TC315",
         "`fovy` of camera `a` must be below 180 deg, found `180 deg`", None),
        ("a: {type: camera, at: body.imu, fovy: 0}", "TC315", "`fovy` of camera `a` must be above 0, found `0`", None),
        ("a: {type: camera, at: body.imu, fovy: 40 mm}", "TC207",
         "expected an angle (such as 30 deg), found a length (`40 mm`)", None),
        ("a: {type: sonar, at: body.imu}", "TC204",
         "expected `imu`, `force`, `joint`, `camera`, `accelerometer`, `gyro`, `magnetometer`, `velocimeter`, `rangefinder`, `touch`, "
         "`contact`, `pose`, `twist`, `centre`, `tendon`, `drive`, `clock` or `energy`, found the string `sonar`", None),
    ],
)
def test_invalid_sensors_are_reported(tmp_path: Path, sensor: str, code: str, message: str, help: str | None) -> None:
    text = SENSORS + f"  {sensor}\nmodes:\n  bench: {{root: body}}\n"
    found = compiled(tmp_path, {"walker.yaml": text, "leg.yaml": LEG})
    line = next(number for number, words in enumerate(text.splitlines(), 1) if words == f"  {sensor}")
    assert found.said == [(code, message, help, line)]


def test_sensor_of_a_fixed_joint_is_reported(tmp_path: Path) -> None:
    text = BODY.replace("swing: {type: joint, joint: hip}", "swing: {type: joint, joint: neck}").replace(
        "    at: {in: body.origin, xyz: 0 0 100 mm}\n", "",
    ).replace("joints:\n", "joints:\n  neck: {type: fixed, parent: body.imu, child: head.origin}\n")
    found = compiled(tmp_path, {"walker.yaml": text, "leg.yaml": LEG})
    assert [line[:3] for line in found.said] == [(
        "TC338", "a sensor cannot measure joint `neck`, which is fixed",
        "use a moving joint, or a `force` sensor at one of its mounts",
    )]
