"""Transmissions: dynamics compared with models in which rotors are separate bodies, and conversion of actuator values to the joint."""

from __future__ import annotations

import json
import re
from pathlib import Path

import mujoco
import numpy as np
import pytest

import thingc
from thingc.modes import Modes
from thingc.tools.cli.main import main

ARM = """\
thingc: assembly/1
name: arm
parameters: {{teeth: {{value: 90, min: 20, max: 400}}}}
components:
  base: {{frame: true, mass: 1 kg, inertia: {{ixx: 1 kg*m^2, iyy: 1 kg*m^2, izz: 1 kg*m^2}}}}
  upper: {{frame: true, mass: 0.7 kg, com: 120 0 0 mm, inertia: {{ixx: 1e-3 kg*m^2, iyy: 4e-3 kg*m^2, izz: 4e-3 kg*m^2}}}}
  lower: {{frame: true, mass: 0.4 kg, com: 90 20 0 mm, inertia: {{ixx: 5e-4 kg*m^2, iyy: 2e-3 kg*m^2, izz: 2e-3 kg*m^2}}}}
joints:
  shoulder: {{type: continuous, parent: base.origin, child: upper.origin, axis: [0, 1, 0]}}
  elbow: {{type: continuous, parent: upper.elbow, child: lower.origin, axis: [0, 0, 1]}}
transmissions:
{transmissions}
modes: {{bench: {{root: base, base: fixed}}}}
simulation: {{timestep: 0.1 ms, integrator: euler}}
"""
ARM = ARM.replace("com: 120 0 0 mm,", "com: 120 0 0 mm, mounts: {{elbow: {{xyz: 250 0 0 mm}}}},")

BY_HAND = """
<mujoco>
  <option timestep="1e-4" gravity="0 0 -9.81"><flag refsafe="disable"/></option>
  <worldbody>
    <body name="upper">
      <inertial pos="0.12 0 0" mass="0.7" diaginertia="1e-3 4e-3 4e-3"/>
      <joint name="shoulder" axis="0 1 0"/>
      <body name="lower" pos="0.25 0 0">
        <inertial pos="0.09 0.02 0" mass="0.4" diaginertia="5e-4 2e-3 2e-3"/>
        <joint name="elbow" axis="0 0 1"/>
      </body>
    </body>
    {rotors}
  </worldbody>
  <tendon>{couplings}</tendon>
  <equality>{equalities}</equality>
  <actuator>{motors}</actuator>
</mujoco>
"""
"""The same arm with rotors hinged to the world, so their energy is that of reflected inertia. An equality couples each rotor to the
joints."""


def compile_arm(folder: Path, transmissions: str, **settings: str) -> thingc.Compiled:
    text = ARM.format(transmissions="\n".join(f"  {line}" for line in transmissions.strip().splitlines()))
    (folder / "arm.yaml").write_text(text)
    return thingc.compile(folder / "arm.yaml", parameters=settings)


def model_with_rotors(matrix: list[list[float]], inertia: float) -> mujoco.MjModel:
    rotors, couplings, equalities, motors = "", "", "", ""
    for k, row in enumerate(matrix):
        rotors += f'<body name="r{k}"><inertial pos="0 0 0" mass="1" diaginertia="1 1 {inertia}"/><joint name="r{k}" axis="0 0 1"/></body>'
        named = zip(("shoulder", "elbow"), row, strict=True)
        terms = "".join(f'<joint joint="{joint}" coef="{value}"/>' for joint, value in named if value)
        couplings += f'<fixed name="t{k}">{terms}<joint joint="r{k}" coef="-1"/></fixed>'
        equalities += f'<tendon tendon1="t{k}" solref="-1e6 -2e3" solimp="0.9999 0.9999 0.001 0.5 2"/>'
        motors += f'<motor joint="r{k}"/>'
    return mujoco.MjModel.from_xml_string(BY_HAND.format(rotors=rotors, couplings=couplings, equalities=equalities, motors=motors))


def trajectory(model: mujoco.MjModel, torques: np.ndarray) -> np.ndarray:
    """Positions of shoulder and elbow over half a second with sinusoidal actuator torques [N m]."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    places = [model.joint(name).qposadr[0] for name in ("shoulder", "elbow")]
    rows = []
    while data.time < 0.5:
        data.ctrl[:] = torques * np.cos(8.0 * data.time)
        mujoco.mj_step(model, data)
        rows.append(data.qpos[places].copy())
    return np.array(rows)


MOTOR = "{kind: motor, effort: 4 N*m, armature: 2e-5 kg*m^2}"
SIMPLE = f"""
one: {{actuator: {MOTOR}, joint: shoulder, ratio: =teeth / 10, inertia: 1e-5 kg*m^2}}
two: {{actuator: {MOTOR}, joint: elbow, ratio: -6, inertia: 1e-5 kg*m^2}}
"""
WRIST = f"""
wrist:
  differential: {{actuators: [{MOTOR}, {MOTOR}], joints: [shoulder, elbow], matrix: [[9, =teeth / 30], [5, -6]]}}
  inertia: 1e-5 kg*m^2
"""


@pytest.mark.parametrize(("text", "matrix"), [(SIMPLE, [[9.0, 0.0], [0.0, -6.0]]), (WRIST, [[9.0, 3.0], [5.0, -6.0]])])
def test_motion_matches_model_with_separate_rotors(text: str, matrix: list[list[float]], tmp_path: Path) -> None:
    """The equality of MuJoCo is nearly rigid, so positions agree to 1e-6 rad. Without rotor inertia they differ by more than 0.05 rad."""
    model = compile_arm(tmp_path, text).modes["bench"].model()
    torques = np.array([0.08, 0.05])
    command = np.abs(np.diag(matrix)) * torques * (1.0, -1.0) if text is SIMPLE else torques  # torques of joints, or of actuators
    assert model.nu == 2
    ours, theirs = trajectory(model, command), trajectory(model_with_rotors(matrix, 3e-5), torques)
    assert np.ptp(ours, axis=0).min() > 0.1
    assert np.abs(ours - theirs).max() < 1e-6
    model.dof_armature[:] = 0.0
    model.tendon_armature[:] = 0.0
    assert np.abs(trajectory(model, command) - theirs).max() > 0.05


def test_rotor_inertia_is_added_to_the_mass_matrix(tmp_path: Path) -> None:
    """The difference is M' I M up to rounding."""
    matrices = []
    for text in (WRIST, WRIST.replace("2e-5", "0").replace("1e-5", "0")):
        model = compile_arm(tmp_path, text).modes["bench"].model()
        data = mujoco.MjData(model)
        data.qpos[:] = (0.3, -0.7)
        mujoco.mj_forward(model, data)
        full = np.zeros((2, 2))
        mujoco.mj_fullM(model, data, full)
        matrices.append(full)
    matrix = np.array([[9.0, 3.0], [5.0, -6.0]])
    assert matrices[0] - matrices[1] == pytest.approx(3e-5 * matrix.T @ matrix, abs=1e-15)


@pytest.mark.parametrize(("root", "coupled"), [("base", True), ("upper", False), ("lower", True)])
def test_rotor_inertia_that_mujoco_omits_is_a_loss(root: str, coupled: bool, tmp_path: Path) -> None:
    """With `upper` as the root, both joints of the differential begin at the root, and MuJoCo omits the coupling M' I M of the branches."""
    document = tmp_path / "arm.yaml"
    compile_arm(tmp_path, WRIST)
    document.write_text(document.read_text().replace("root: base", f"root: {root}"))
    model = thingc.compile(document).modes["bench"].model()
    coupling = []
    for inertia in (model.tendon_armature.copy(), 0.0):
        model.tendon_armature[:] = inertia
        data, full = mujoco.MjData(model), np.zeros((2, 2))
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, full)
        coupling.append(full[0, 1])
    assert coupling[0] - coupling[1] == pytest.approx(3e-5 * (9.0 * 3.0 - 5.0 * 6.0) if coupled else 0.0, abs=1e-15)
    assert main(["build", str(document), "--emit", "mjcf", "-o", str(tmp_path / "out")]) == 0
    manifest = json.loads((tmp_path / "out/arm/manifest.json").read_text())
    assert [one["path"] for one in manifest["losses"] if "branches" in one["what"]] == ([] if coupled else ["wrist_0", "wrist_1"])


def test_modes_api_includes_rotor_inertia(tmp_path: Path) -> None:
    """The mass matrix used for impacts equals MuJoCo's."""
    model = compile_arm(tmp_path, WRIST).modes["bench"].model()
    assert main(["build", str(tmp_path / "arm.yaml"), "--emit", "mjcf", "-o", str(tmp_path / "out")]) == 0
    mode = Modes.load(tmp_path / "out/arm/modes.json")["bench"]
    data, full = mujoco.MjData(model), np.zeros((2, 2))
    data.qpos[:] = (0.3, -0.7)
    mujoco.mj_forward(model, data)
    mujoco.mj_fullM(model, data, full)
    matrix = mode.mass_matrix(mode.state(q={"shoulder": 0.3, "elbow": -0.7}))
    assert matrix[-2:, -2:] == pytest.approx(full, rel=1e-12)


@pytest.mark.parametrize(("text", "matrix"), [(SIMPLE, [[9.0, 0.0], [0.0, -6.0]]), (WRIST, [[9.0, 3.0], [5.0, -6.0]])])
def test_accelerations_match_pinocchio(text: str, matrix: list[list[float]], tmp_path: Path) -> None:
    """pinocchio loads the URDF; the rotor inertia is added to its mass matrix."""
    pinocchio = pytest.importorskip("pinocchio")
    model = compile_arm(tmp_path, text).modes["bench"].model()
    assert main(["build", str(tmp_path / "arm.yaml"), "--emit", "urdf", "-o", str(tmp_path / "out")]) == 0
    theirs = pinocchio.buildModelFromUrdf(str(tmp_path / "out/arm/urdf/arm_bench.urdf"))
    assert list(theirs.names)[1:] == ["shoulder", "elbow"]
    ratios, rotors = np.array(matrix), 3e-5 * np.array(matrix).T @ np.array(matrix)
    data, other = mujoco.MjData(model), theirs.createData()
    random = np.random.default_rng(3)
    for _ in range(20):
        q, v, command = random.uniform(-1.0, 1.0, (3, 2))
        data.qpos[:], data.qvel[:], data.ctrl[:] = q, v, command
        mujoco.mj_forward(model, data)
        turned = pinocchio.integrate(theirs, pinocchio.neutral(theirs), q)  # a joint without limits has a cosine and a sine
        mass = np.triu(pinocchio.crba(theirs, other, turned))
        bias = pinocchio.nonLinearEffects(theirs, other, turned, v)
        torque = command if text is SIMPLE else ratios.T @ command
        expected = np.linalg.solve(mass + np.triu(mass, 1).T + rotors, torque - bias)
        assert data.qacc == pytest.approx(expected, rel=1e-12, abs=1e-12)


def test_actuator_values_are_converted_to_the_joint(tmp_path: Path) -> None:
    """Expected values are computed with r = 9 and e = 0.85."""
    actuator = "{kind: position, kp: 2 N*m/rad, kv: 0.1 N*m*s/rad, effort: 0.4 N*m, velocity: 300 rad/s, armature: 2e-5 kg*m^2}"
    text = f"one: {{actuator: {actuator}, joint: shoulder, ratio: -9, efficiency: 85 %, backlash: 0.3 deg, inertia: 1e-5 kg*m^2}}"
    mode = compile_arm(tmp_path, text).modes["bench"]
    model = mode.model()
    assert model.actuator_gainprm[0, 0] == pytest.approx(2.0 * 81.0 * 0.85)
    assert model.actuator_biasprm[0, 2] == pytest.approx(-0.1 * 81.0 * 0.85)
    assert model.actuator_forcerange[0, 1] == pytest.approx(0.4 * 9.0 * 0.85)
    assert model.dof_armature.tolist() == pytest.approx([3e-5 * 81.0, 0.0])
    assert model.numeric("shoulder:velocity").data[0] == pytest.approx(300.0 / 9.0)
    assert model.numeric("shoulder:backlash").data[0] == pytest.approx(np.radians(0.3))
    assert model.actuator("shoulder").trnid[0] == model.joint("shoulder").id and model.actuator_gear[0, 0] == 1.0


def test_joint_values_override_the_transmission(tmp_path: Path) -> None:
    text = f"one: {{actuator: {MOTOR}, joint: shoulder, ratio: 9}}"
    (tmp_path / "own").mkdir()
    whole = ARM.replace("axis: [0, 1, 0]}}", "axis: [0, 1, 0], limit: {{effort: 3 N*m}}, dynamics: {{armature: 1e-4 kg*m^2}}}}")
    (tmp_path / "arm.yaml").write_text(whole.format(transmissions=f"  {text}"))
    model = thingc.compile(tmp_path / "arm.yaml").modes["bench"].model()
    assert model.actuator_ctrlrange.tolist() == [[-3.0, 3.0]] and model.dof_armature[0] == 1e-4


def test_rack_converts_rotation_to_translation(tmp_path: Path) -> None:
    """With a pinion of 10 mm, 0.4 N m are 40 N, 300 rad/s are 3 m/s, and 2e-5 kg m^2 are 0.2 kg."""
    text = ARM.format(transmissions=(
        "  rack: {actuator: {kind: motor, effort: 0.4 N*m, velocity: 300 rad/s, armature: 2e-5 kg*m^2}, joint: rail, ratio: =1 rad / 10 mm}"
    )).replace("shoulder: {type: continuous", "rail: {type: prismatic, limit: {lower: 0, upper: 1 m}")
    (tmp_path / "arm.yaml").write_text(text)
    model = thingc.compile(tmp_path / "arm.yaml").modes["bench"].model()
    assert model.actuator_ctrlrange[0, 1] == pytest.approx(40.0) and model.dof_armature[0] == pytest.approx(0.2)
    assert model.numeric("rail:velocity").data[0] == pytest.approx(3.0)


def test_keyframe_commands_of_a_differential(tmp_path: Path) -> None:
    """Commands in a keyframe are actuator positions at its pose, within the range that the joint limits allow. They hold the pose."""
    drive = "{kind: position, kp: 400 N*m/rad, kv: 4 N*m*s/rad}"
    text = f"wrist: {{differential: {{actuators: [{drive}, {drive}], joints: [shoulder, elbow], matrix: [[1, 2], [1, -2]]}}}}"
    limited = re.sub(r"continuous(.*?), axis", r"revolute\1, limit: {{lower: -30 deg, upper: 60 deg}}, axis", ARM)
    limited += "poses: {{bent: {{shoulder: 20 deg, elbow: -10 deg}}}}\n"
    limited = limited.replace("base: fixed}}", "base: fixed, pose: bent}}")
    (tmp_path / "arm.yaml").write_text(limited.format(transmissions=f"  {text}"))
    model = thingc.compile(tmp_path / "arm.yaml").modes["bench"].model()
    assert np.degrees(model.key_ctrl[0]) == pytest.approx([0.0, 40.0])
    assert np.degrees(model.actuator_ctrlrange) == pytest.approx(np.array([[-90.0, 180.0], [-150.0, 120.0]]))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    for _ in range(4000):
        mujoco.mj_step(model, data)
    assert np.degrees(data.qpos) == pytest.approx([20.0, -10.0], abs=0.5)


def test_differential_efficiency_reduces_torques(tmp_path: Path) -> None:
    model = compile_arm(tmp_path, WRIST + "  efficiency: 50 %\n").modes["bench"].model()
    assert model.actuator_ctrlrange[:, 1] == pytest.approx([2.0, 2.0]) and model.tendon_armature == pytest.approx([3e-5, 3e-5])


@pytest.mark.parametrize("text", [SIMPLE, WRIST])
def test_family_values_equal_a_full_compilation(text: str, tmp_path: Path) -> None:
    """For other numbers of teeth, which change the ratio."""
    compile_arm(tmp_path, text)
    with thingc.family(tmp_path / "arm.yaml") as family:
        for teeth in (30.0, 45.0, 200.0):
            model = family.model({"teeth": teeth}, mode="bench")
            own = compile_arm(tmp_path, text, teeth=str(teeth)).modes["bench"].model()
            for field in ("dof_armature", "tendon_armature", "actuator_ctrlrange", "wrap_prm"):
                assert getattr(model, field).tolist() == getattr(own, field).tolist(), (teeth, field)
            assert own.dof_armature[0] == pytest.approx(3e-5 * (teeth / 10.0) ** 2) or text is WRIST


def test_nested_and_mirrored_transmissions(tmp_path: Path) -> None:
    """Actuators are named by their path. A mirror image has equal coefficients."""
    compile_arm(tmp_path, WRIST)
    (tmp_path / "two.yaml").write_text("""\
thingc: assembly/1
name: two
components:
  hub: {frame: true, mass: 1 kg, inertia: {ixx: 1 kg*m^2, iyy: 1 kg*m^2, izz: 1 kg*m^2}}
  left: {assembly: arm.yaml, at: {in: hub.origin}}
  right: {assembly: arm.yaml, mirror: y, at: {in: hub.origin}}
modes:
  all: {root: hub, base: fixed}
  one: {root: hub, base: fixed, actuators: [left.wrist_0, "right.*"]}
""")
    robot = thingc.compile(tmp_path / "two.yaml")
    names = {name: [mode.model().actuator(k).name for k in range(mode.model().nu)] for name, mode in robot.modes.items()}
    assert names["all"] == ["left/wrist_0", "left/wrist_1", "right/wrist_0", "right/wrist_1"]
    assert names["one"] == ["left/wrist_0", "right/wrist_0", "right/wrist_1"]
    model = robot.modes["all"].model()
    assert model.wrap_prm[:4].tolist() == model.wrap_prm[4:].tolist() == [9.0, 3.0, 5.0, -6.0]


def test_torque_margin_is_computed_at_the_joint(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """0.7 kg at 0.12 m and 0.4 kg at 0.25 + 0.09 m load the shoulder with 2.158 N m; its belt holds 36 N m."""
    compile_arm(tmp_path, SIMPLE)
    tests = "tests: {strong: {torque_margin: {drive: shoulder, min: 1}}}\n"
    (tmp_path / "arm.yaml").write_text((tmp_path / "arm.yaml").read_text() + tests)
    assert main(["test", str(tmp_path / "arm.yaml")]) == 0
    weight = 9.81 * (0.7 * 0.12 + 0.4 * 0.34)
    assert f"margin {36.0 / weight:.3g} at shoulder" in capsys.readouterr().out


def test_actuator_used_in_nested_document_is_an_error(tmp_path: Path) -> None:
    """In one document, the pass `resolve` reports it. Across documents, it is found in the linked robot."""
    body = "frame: true, mass: 1 kg, inertia: {ixx: 1 kg*m^2, iyy: 1 kg*m^2, izz: 1 kg*m^2}"
    (tmp_path / "inner.yaml").write_text(f"""\
thingc: assembly/1
name: inner
materials: [thingc_stock.materials]
components: {{servo: {{part: thingc_stock.dynamixel:XL430}}, arm: {{{body}}}}}
joints: {{turn: {{type: continuous, parent: servo.horn, child: arm.origin}}}}
transmissions: {{gear: {{actuator: servo, joint: turn, ratio: 2}}}}
""")
    (tmp_path / "outer.yaml").write_text(f"""\
thingc: assembly/1
name: outer
components: {{inner: {{assembly: inner.yaml}}, hand: {{{body}}}}}
joints: {{wrist: {{type: continuous, parent: inner.arm.origin, child: hand.origin, drive: inner.servo}}}}
""")
    with pytest.raises(thingc.CompileError) as caught:
        thingc.compile(tmp_path / "outer.yaml")
    found = [(one.code.code, one.message) for one in caught.value.diagnostics]
    assert found == [("TC365", "actuator `inner/servo` drives both `wrist` and `inner/turn`")]


def test_loops_are_not_cut_at_joints_of_a_differential(tmp_path: Path) -> None:
    """Four bars with equal joints: without the differential, the joint that closes the loop is cut."""
    body = "frame: true, mass: 1 kg, inertia: {ixx: 1 kg*m^2, iyy: 1 kg*m^2, izz: 1 kg*m^2}, mounts: {end: {xyz: 100 0 0 mm}}"
    bars = (("one", "a", "b", ""), ("two", "b", "c", ""), ("three", "c", "d", ""), ("four", "d", "a", ", loop: true"))
    hinges = "".join(
        f"  {name}: {{type: continuous, parent: {parent}.end, child: {child}.origin, axis: [0, 0, 1], offset: 90 deg{more}}}\n"
        for name, parent, child, more in bars
    )
    text = f"thingc: assembly/1\nname: bars\ncomponents: {{a: {{{body}}}, b: {{{body}}}, c: {{{body}}}, d: {{{body}}}}}\njoints:\n{hinges}"
    both = f"transmissions: {{x: {{differential: {{actuators: [{MOTOR}, {MOTOR}], joints: [one, four], matrix: [[1, 1], [1, -1]]}}}}}}\n"
    for more, cut in (("", "four"), (both, "three")):
        (tmp_path / "bars.yaml").write_text(text + more)
        (mode,) = thingc.compile(tmp_path / "bars.yaml").modes.values()
        assert [closure.path for closure in mode.robot.closures] == [cut]
