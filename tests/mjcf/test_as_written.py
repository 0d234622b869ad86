"""Features that MJCF supports directly (polynomial mimics, springs, tendons, raw elements), compared with MJCF models written for the
test."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from loops.robots import BALL, Built, at_key, compiled, equality_residual
from loops.test_loop_joints import FOURBAR
from statics.test_statics import at_rest
from thingc.model.assembly.kinematics import joints_of
from thingc.model.robot.kinematics import body_poses
from thingc.model.robot.loop_solver import Loops
from thingc.model.statics.efforts import problem, static_efforts
from thingc.tools.cli.main import main

MATE = "quat: [0, 0.7071067811865476, -0.7071067811865476, 0]"
"""Orientation of a mount with which mated frames coincide."""

LINKS = f"""\
thingc: assembly/1
name: chain
components:
  base: {{frame: true, mass: 3 kg, {BALL}, mounts: {{end: {{xyz: 0 0 200 mm, rpy: 90 0 0 deg}}}}}}
  upper: {{frame: true, mass: 1 kg, {BALL}, com: [100 mm, 10 mm, 0],
    mounts: {{start: {{{MATE}}}, end: {{xyz: 300 0 0 mm, rpy: 0 90 0 deg}}}}}}
  lower: {{frame: true, mass: 0.5 kg, {BALL}, com: [0, 50 mm, 20 mm], mounts: {{start: {{{MATE}}}, end: {{xyz: 0 100 50 mm}}}}}}
  slider: {{frame: true, mass: 0.2 kg, {BALL}, mounts: {{start: {{{MATE}}}}}}}
simulation: {{integrator: euler}}
modes:
  m: {{root: base}}
  n: {{root: slider, base: free}}
"""
"""A shoulder and an elbow that rotate about z of their mounts, and a slide along z."""

BODIES = """\
<mujoco>
  <compiler angle="radian" autolimits="true"/>
  <option integrator="Euler"/>
  <worldbody>
    <body name="base">
      <inertial pos="0 0 0" mass="3" diaginertia="1e-4 2e-4 1.5e-4"/>
      <body name="upper" pos="0 0 0.2" euler="1.5707963267948966 0 0">
        <inertial pos="0.1 0.01 0" mass="1" diaginertia="1e-4 2e-4 1.5e-4"/>
        <joint name="shoulder" axis="0 0 1" {shoulder}/>
        <body name="lower" pos="0.3 0 0" euler="0 1.5707963267948966 0">
          <inertial pos="0 0.05 0.02" mass="0.5" diaginertia="1e-4 2e-4 1.5e-4"/>
          <joint name="elbow" axis="0 0 1" {elbow}/>
          <body name="slider" pos="0 0.1 0.05">
            <inertial pos="0 0 0" mass="0.2" diaginertia="1e-4 2e-4 1.5e-4"/>
            <joint name="slide" type="slide" axis="0 0 1" {slide}/>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
  {rest}
</mujoco>
"""


def assert_equal_dynamics(built: Built, written: str) -> None:
    """Assert that mode `m` and a written-out model have equal dynamics.

    Mass matrix, bias and passive forces are compared at random states, and the motion over 200 steps with random controls."""
    one, other = built.model("m"), mujoco.MjModel.from_xml_string(written)
    assert (one.nq, one.nv, one.nu, one.neq, one.ntendon) == (other.nq, other.nv, other.nu, other.neq, other.ntendon)
    states, random = (mujoco.MjData(one), mujoco.MjData(other)), np.random.default_rng(1)
    for _ in range(10):
        q, v = random.uniform(-0.3, 0.3, one.nq), random.uniform(-1.0, 1.0, one.nv)
        forces = []
        for model, data in zip((one, other), states, strict=True):
            data.qpos[:], data.qvel[:] = q, v
            mujoco.mj_forward(model, data)
            full = np.zeros((model.nv, model.nv))
            mujoco.mj_fullM(model, data, full)
            forces.append(np.concatenate([full.ravel(), data.qfrc_bias, data.qfrc_passive, data.ten_length]))
        assert forces[0] == pytest.approx(forces[1], rel=1e-9, abs=1e-12)
    for model, data in zip((one, other), states, strict=True):
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = 0.0, 0.1
    for _ in range(200):
        control = random.uniform(-1.0, 1.0, one.nu)
        for model, data in zip((one, other), states, strict=True):
            data.ctrl[:] = control
            mujoco.mj_step(model, data)
    assert states[0].qpos == pytest.approx(states[1].qpos, rel=1e-9, abs=1e-9)
    assert states[0].qvel == pytest.approx(states[1].qvel, rel=1e-9, abs=1e-9)
    assert np.abs(states[0].qpos).max() > 0.01


def test_polynomial_mimics_match_written_model(tmp_path: Path) -> None:
    """The equality is as stiff as that of any mimic. Keyframes follow the polynomial, in a mode with another root too."""
    built = compiled(tmp_path, LINKS + """\
joints:
  shoulder: {type: revolute, parent: base.end, child: upper.start, limit: {lower: -3 rad, upper: 3 rad}, drive: {kind: motor}}
  elbow: {type: revolute, parent: upper.end, child: lower.start, mimic: {joint: shoulder, polynomial: [0, 0.5, 30 %/rad, 0, -0.02 rad^-3]}}
  slide: {type: prismatic, parent: lower.end, child: slider.start, limit: {lower: -1 m, upper: 1 m},
    mimic: {joint: elbow, polynomial: [0, 40 mm/rad, -8 mm/rad^2]}}
poses: {bent: {shoulder: 0.8 rad}}
""")
    assert not built.compilation.report.failed, built.said
    equality = '<joint joint1="{}" joint2="{}" polycoef="{}" solimp="0.9999 0.9999 0.001 0.5 2"/>'
    assert_equal_dynamics(built, BODIES.format(
        shoulder='range="-3 3"', elbow="", slide='range="-1 1"', rest='<actuator><motor joint="shoulder"/></actuator><equality>'
        + equality.format("elbow", "shoulder", "0 0.5 0.3 0 -0.02") + equality.format("slide", "elbow", "0 0.04 -0.008 0 0")
        + "</equality>",
    ))
    elbow = 0.5 * 0.8 + 0.3 * 0.8**2 - 0.02 * 0.8**4
    for mode in ("m", "n"):
        frame = built.robot(mode).keyframes[0]
        assert frame.q == pytest.approx({"shoulder": 0.8, "elbow": elbow, "slide": 0.04 * elbow - 0.008 * elbow**2}, rel=1e-12)
        assert equality_residual(at_key(built.model(mode), "bent")) < 1e-12
    mimics = {one["name"]: one["mimic"] for joint in built.modes["m"]["joints"] for one in joint["coordinates"]}
    assert mimics["elbow"] == {"joint": "shoulder", "multiplier": 0.5, "offset": 0.0, "higher": [0.3, 0.0, -0.02]}


def test_loop_with_polynomial_mimic_is_closed(tmp_path: Path) -> None:
    """The crank of a four-bar mimics a dial. The pose sets the rocker, so the solver must turn the dial, within the limits of the crank."""
    document = FOURBAR.partition("poses:")[0].replace("child: crank.low, drive: {kind: position, kp: 5 N*m/rad, kv: 0.05 N*m*s/rad}}", """\
child: crank.low, mimic: {joint: dial, polynomial: [60 deg, 0.5, 0.4 rad^-1]}, limit: {lower: 0, upper: 115 deg}}""").replace(
        "  drive: {type: continuous", "  drive: {type: revolute").replace("joints:\n", f"""\
  dial: {{frame: true, mass: 0.1 kg, {BALL}}}
joints:
  dial: {{type: revolute, parent: ground.d, child: dial.origin, limit: {{lower: -1 rad, upper: 3 rad}}, drive: {{kind: motor}}}}
""")
    poses = "poses: {there: {pivot: 96 deg}}\nmodes: {m: {root: ground}, n: {root: rocker, base: held}}\n"
    built = compiled(tmp_path, document + poses)
    assert not built.compilation.report.failed, built.said
    for mode in ("m", "n"):
        robot = built.robot(mode)
        (q,) = (frame.q for frame in robot.keyframes)
        assert q["pivot"] == pytest.approx(np.radians(96)) and abs(q["dial"]) > 0.01
        assert q["drive"] == pytest.approx(np.radians(60) + 0.5 * q["dial"] + 0.4 * q["dial"]**2, abs=1e-12)
        assert equality_residual(at_key(built.model(mode), "there")) < 1e-9
        loops = Loops(robot.bodies, robot.closures, joints_of(robot.assembly), robot.bodies[0].X_PL)
        dial = next(one for one in loops.coordinates if one.path == "dial")
        assert dial.lower == -1.0 and np.polyval([0.4, 0.5, np.radians(60)], dial.upper) == pytest.approx(np.radians(115), abs=1e-12)


def test_spring_rest_and_offset_become_springref_and_ref(tmp_path: Path) -> None:
    """`rest` is `springref`, and `offset` is `ref` with the opposite sign, so q equals `qpos`: in the written-out model, a body at qpos
    0 is rotated back by its `ref`. No limit is active, because the softness of MuJoCo's constraints depends on qpos0."""
    built = compiled(tmp_path, LINKS + """\
joints:
  shoulder: {type: revolute, parent: base.end, child: upper.start, offset: -30 deg, limit: {lower: -3 rad, upper: 3 rad},
    dynamics: {stiffness: 3 N*m/rad, rest: 20 deg, damping: 0.05 N*m*s/rad}}
  elbow: {type: continuous, parent: upper.end, child: lower.start, dynamics: {stiffness: 0.5 N*m/rad}}
  slide: {type: prismatic, parent: lower.end, child: slider.start, offset: 10 mm, limit: {lower: -1 m, upper: 1 m},
    dynamics: {stiffness: 40 N/m, rest: -20 mm}}
""")
    assert not built.compilation.report.failed, built.said
    assert_equal_dynamics(built, BODIES.format(
        shoulder='ref="0.5235987755982988" range="-3 3" stiffness="3" springref="0.3490658503988659" damping="0.05"',
        elbow='stiffness="0.5"', slide='ref="-0.01" range="-1 1" stiffness="40" springref="-0.02"', rest="",
    ))
    turned = built.model("n")
    assert {turned.joint(k).name: float(turned.qpos_spring[turned.jnt_qposadr[k]]) for k in range(1, turned.njnt)} == {
        "slide": -0.02, "elbow": 0.0, "shoulder": pytest.approx(np.radians(20)),
    }


STRAIGHT = ": linearized at position 0 of the followed joint (approximated)"


def test_unsupported_features_are_losses_of_other_formats(tmp_path: Path, shared_store: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Polynomial mimics, springs and tendons are export losses of URDF, SDF and USD."""
    document = tmp_path / "chain.yaml"
    document.write_text(LINKS.replace("  n: {root: slider, base: free}\n", "") + """\
joints:
  shoulder: {type: revolute, parent: base.end, child: upper.start, limit: {lower: -3 rad, upper: 3 rad}}
  elbow: {type: revolute, parent: upper.end, child: lower.start, mimic: {joint: shoulder, polynomial: [0, 0.5, 0.3 rad^-1]}}
  slide: {type: prismatic, parent: lower.end, child: slider.start, limit: {lower: -1 m, upper: 1 m},
    dynamics: {stiffness: 1 N/m, rest: 1 mm}}
tendons: {grip: {joints: {shoulder: 20 mm/rad}}}
""")
    assert main(["why", "--losses", str(document), "--emit", "urdf", "--emit", "sdf", "--emit", "usd", "--store", shared_store]) == 0
    said = [line.partition("chain.yaml:")[2] for line in capsys.readouterr().out.splitlines()]
    bent = "the polynomial in the mimic of `shoulder`"
    assert {line.partition(": ")[2] for line in said if "polynomial" in line or "stiffness" in line or "tendon" in line} == {
        *(f"{target}: grip: the tendon and its dynamics (omitted)" for target in ("urdf", "sdf", "usd")),
        *(f"{target}: elbow: {bent}{STRAIGHT}" for target in ("urdf", "sdf", "usd")),
        *(f"{target}: slide: the stiffness of 1 N/m (omitted)" for target in ("urdf", "usd")),
    }


ADDED = LINKS + """\
joints:
  shoulder: {type: revolute, parent: base.end, child: upper.start, limit: {lower: -3 rad, upper: 3 rad}, drive: {kind: motor}}
  elbow: {type: continuous, parent: upper.end, child: lower.start}
  slide: {type: prismatic, parent: lower.end, child: slider.start, limit: {lower: -1 m, upper: 1 m}}
sensors: {turned: {type: joint, joint: elbow}}
poses: {bent: {shoulder: 0.3 rad}}
raw:
  mjcf:
    add:
      sensor:
        - tendonpos: {name: length, tendon: grip}
        - framepos: {objtype: body, objname: lower, reftype: site, refname: upper.end}
      actuator:
        - general: {name: pull, tendon: grip, dyntype: filterexact, dynprm: 0.05, gainprm: 3, biastype: affine, biasprm: 0 -1 -0.1}
        - muscle: {name: flexor, tendon: cable, ctrlrange: 0 1, lengthrange: 0.1 1}
      tendon:
        - fixed: {name: grip, stiffness: 2, in: [{joint: {joint: shoulder, coef: 1}}, {joint: {joint: elbow, coef: -0.5}}]}
        - spatial:
            name: cable
            damping: 0.3
            in: [{site: {site: base.end}}, {site: {site: lower.end}}, {pulley: {divisor: 2}},
              {site: {site: upper.end}}, {site: {site: slider.origin}}]
"""


def test_raw_elements_are_added(tmp_path: Path) -> None:
    """Raw tendons, actuators and sensors refer to joints, components and mounts by their document names. Keyframes have 0 for the added
    actuators."""
    built = compiled(tmp_path, ADDED)
    assert not built.compilation.report.failed, built.said
    body = BODIES.format(shoulder='range="-3 3"', elbow="", slide='range="-1 1"', rest="""
  <tendon>
    <fixed name="grip" stiffness="2"><joint joint="shoulder" coef="1"/><joint joint="elbow" coef="-0.5"/></fixed>
    <spatial name="cable" damping="0.3">
      <site site="b"/><site site="l"/><pulley divisor="2"/><site site="u"/><site site="s"/>
    </spatial>
  </tendon>
  <actuator>
    <motor joint="shoulder"/>
    <general tendon="grip" dyntype="filterexact" dynprm="0.05" gainprm="3" biastype="affine" biasprm="0 -1 -0.1"/>
    <muscle tendon="cable" ctrlrange="0 1" lengthrange="0.1 1"/>
  </actuator>""")
    for mark, place in (("base", '<site name="b" pos="0 0 0.2"/>'), ("upper", '<site name="u" pos="0.3 0 0"/>'),
                        ("lower", '<site name="l" pos="0 0.1 0.05"/>'), ("slider", '<site name="s"/>')):
        head, _, tail = body.partition(f'<body name="{mark}"')
        inside, _, rest = tail.partition("<inertial")
        body = f'{head}<body name="{mark}"{inside}{place}<inertial{rest}'
    assert_equal_dynamics(built, body)
    for mode in ("m", "n"):
        model = built.model(mode)
        data = at_key(model, "bent")
        assert data.sensor("length").data[0] == pytest.approx(0.3) and data.ctrl.tolist() == [0.0, 0.0, 0.0]
        assert model.nsensor == 5 and model.site("upper/end").bodyid[0] == model.body("upper").id


def test_raw_elements_of_nested_documents_are_prefixed(tmp_path: Path) -> None:
    """Each occurrence of the nested document adds the elements with its path as prefix. An element that refers to a drive missing in a
    mode is omitted there and listed as a loss."""
    hand = f"""\
thingc: assembly/1
name: hand
components:
  palm: {{frame: true, mass: 0.2 kg, {BALL}}}
  finger: {{frame: true, mass: 0.1 kg, {BALL}}}
joints: {{bend: {{type: universal, parent: palm.origin, child: finger.origin, drive: {{1: {{kind: motor}}}}}}}}
raw:
  mjcf:
    add:
      tendon: [{{fixed: {{name: pull, in: [{{joint: {{joint: "bend[0]", coef: 2}}}}]}}}}]
      sensor: [{{tendonvel: {{tendon: pull}}}}, {{actuatorfrc: {{name: effort, actuator: bend_1}}}}]
"""
    robot = f"""\
thingc: assembly/1
name: two
components:
  base: {{frame: true, mass: 1 kg, {BALL}}}
  left: {{assembly: hand.yaml, at: {{in: base.origin}}}}
  right: {{assembly: hand.yaml, at: {{in: base.origin, xyz: 100 0 0 mm}}}}
modes: {{all: {{root: base}}, none: {{root: right.finger, actuators: []}}}}
"""
    built = compiled(tmp_path, {"robot.yaml": robot, "hand.yaml": hand})
    assert not built.compilation.report.failed, built.said
    for mode, sensors in (("all", 4), ("none", 2)):
        model, data = built.model(mode), mujoco.MjData(built.model(mode))
        data.joint("right/bend_0").qpos[0] = 0.2
        mujoco.mj_forward(model, data)
        assert [float(data.tendon(name).length[0]) for name in ("left/pull", "right/pull")] == pytest.approx([0.0, 0.4])
        assert model.nsensor == sensors
    assert [(loss.path, loss.what) for loss in built.losses("none")] == [
        (f"raw.mjcf.add.sensor.{hand}/effort", f"the element: the mode has no actuator `{hand}/bend_1`") for hand in ("left", "right")
    ]


TENDON = LINKS + """\
joints:
  shoulder: {type: revolute, parent: base.end, child: upper.start, limit: {lower: -3 rad, upper: 3 rad}, drive: {kind: motor}}
  elbow: {type: continuous, parent: upper.end, child: lower.start}
  slide: {type: prismatic, parent: lower.end, child: slider.start, limit: {lower: -1 m, upper: 1 m}}
tendons:
  grip:
    joints: {shoulder: 20 mm/rad, elbow: -10 mm/rad, slide: 0.5}
    limit: {lower: -30 mm, upper: 40 mm}
    dynamics: {stiffness: 200 N/m, rest: 5 mm, damping: 3 N*s/m, friction: 0.2 N, armature: 10 g}
    drive: {kind: position, kp: 60 N/m, kv: 2 N*s/m, effort: 9 N}
  both: {joints: {shoulder: 1, elbow: 50 %}, drive: {kind: motor, effort: 3 N*m}}
poses: {bent: {shoulder: 0.3 rad, slide: 10 mm}}
"""


def test_fixed_tendons_match_written_model(tmp_path: Path) -> None:
    """Springs, limits and drives of fixed tendons equal those of a written-out model. With another root, lengths at the same q are
    equal; drive efforts and spring loads equal MuJoCo's inverse dynamics at rest."""
    built = compiled(tmp_path, TENDON.replace("  m: {root: base}\n", "  m: {root: base}\n  still: {root: base, actuators: [shoulder]}\n"))
    assert not built.compilation.report.failed, built.said
    assert_equal_dynamics(built, BODIES.format(shoulder='range="-3 3"', elbow="", slide='range="-1 1"', rest="""
  <tendon>
    <fixed name="grip" range="-0.03 0.04" stiffness="200" springlength="0.005" damping="3" frictionloss="0.2" armature="0.01">
      <joint joint="shoulder" coef="0.02"/><joint joint="elbow" coef="-0.01"/><joint joint="slide" coef="0.5"/>
    </fixed>
    <fixed name="both"><joint joint="shoulder" coef="1"/><joint joint="elbow" coef="0.5"/></fixed>
  </tendon>
  <actuator>
    <motor joint="shoulder"/>
    <position tendon="grip" kp="60" kv="2" forcerange="-9 9" ctrlrange="-0.03 0.04"/><motor tendon="both" ctrlrange="-3 3"/>
  </actuator>"""))
    for mode in ("m", "n"):
        data = at_key(built.model(mode), "bent")
        assert data.tendon("grip").length[0] == pytest.approx(0.3 * 0.02 + 0.005) and data.actuator("grip").ctrl[0] == pytest.approx(0.011)
    assert built.model("still").nu == 1
    robot, model = built.robot("m"), built.model("m")
    data, q = mujoco.MjData(model), {"shoulder": 0.4, "elbow": -0.7, "slide": 0.02}
    for path, value in q.items():
        data.joint(path).qpos[0] = value
    needed = at_rest(model, data)
    load, drives = problem(robot, q, body_poses(robot, q))
    assert [load[path] for path in q] == pytest.approx([-needed[model.joint(path).dofadr[0]] for path in q], rel=1e-9)
    assert {one.path: dict(one.moves) for one in drives} == {
        "shoulder": {"shoulder": 1.0}, "grip": {"shoulder": 0.02, "elbow": -0.01, "slide": 0.5}, "both": {"shoulder": 1.0, "elbow": 0.5},
    }
    efforts = static_efforts(robot, q, body_poses(robot, q)).by_joint
    held = [sum(dict(one.moves).get(path, 0.0) * efforts[one.path] for one in drives) for path in q]
    assert held == pytest.approx([-load[path] for path in q], rel=1e-9)
