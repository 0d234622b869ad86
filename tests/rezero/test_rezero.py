"""Moving the zero of a joint, or reversing it, changes no pose of the robot. Poses are compared in MuJoCo at corresponding joint angles."""

from __future__ import annotations

import json
import random
import re
import shutil
from pathlib import Path

import mujoco
import numpy as np
import pytest

import thingc
from thingc.base.diagnostics import Report
from thingc.tools.cli.main import main
from thingc.tools.importing.importing import import_robot

ROOT = Path(__file__).resolve().parents[2]
ROBOTS = ROOT / "tests/importing/robots"
HINGES = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
DEG = np.pi / 180.0
BODY = "frame: true, mass: 300 g, com: 20 10 5 mm, inertia: {ixx: 1e-4 kg*m^2, iyy: 2e-4 kg*m^2, izz: 2.5e-4 kg*m^2}"
RIG = f"""\
thingc: assembly/1
name: rig
parameters: {{top: 40 deg}}
defaults: {{joint: {{limit: {{lower: -60 deg, upper: 100 deg}}, dynamics: {{stiffness: 2 N*m/rad, rest: 10 deg}}}}}}
components:
  base: {{frame: true, mass: 2 kg, inertia: {{ixx: 1e-2 kg*m^2, iyy: 1e-2 kg*m^2, izz: 1e-2 kg*m^2}}, mounts: {{m: {{xyz: 0 0 50 mm}}}}}}
  a: {{{BODY}, mounts: {{m: {{xyz: 50 20 0 mm, rpy: 20 30 40 deg}}}}}}
  b: {{{BODY}, mounts: {{m: {{xyz: 0 60 10 mm, rpy: 90 0 0 deg}}}}}}
  c: {{{BODY}, mounts: {{m: {{xyz: 30 0 30 mm, rpy: 0 -90 0 deg}}}}}}
  d: {{{BODY}, mounts: {{m: {{xyz: 10 0 20 mm}}}}}}
  e: {{{BODY}}}
joints:
  turn: {{type: revolute, parent: base.m, child: a.origin, turn: 15 deg, gap: 3 mm, offset: 5 deg}}   # with default limits and spring
  slide:
    type: prismatic
    parent: a.m
    child: b.origin
    axis: [1, 2, 0]
    turn: 20 deg
    gap: 4 mm
    limit: {{lower: -20 mm, upper: 3 cm}}   # of the rail
    dynamics: {{stiffness: 300 N/m}}
    drive: {{kind: position, kp: 50 N/m}}
  wind: {{type: screw, parent: b.m, child: c.origin, lead: 8 mm, dynamics: {{stiffness: 1 N*m/rad, rest: =top / 2}}}}
  lead: {{type: continuous, parent: c.m, child: d.origin}}
  bend: {{type: revolute, parent: d.m, child: e.origin, mimic: {{joint: lead, polynomial: [5 deg, 0.5, "0.2 rad^-1", 0.1 rad^-2]}}}}
tendons:
  both: {{joints: {{slide: -0.5, wind: 12 mm/rad}}, limit: {{lower: -10 mm, upper: 40 mm}}, dynamics: {{stiffness: 200 N/m, rest: 5 mm}}}}
poses:
  up: {{turn: =top, "w*": 20 deg, slide: 0.5 cm}}
  down: {{"*in*": -10 deg}}
  each: {{"*n*": 7 deg}}
  flat: {{}}
modes:
  stand: {{root: base, pose: up}}
  free: {{root: base, base: free, at: {{xyz: 0 0 1 m}}}}
  other: {{extends: free, base: held}}
tests:
  clear: {{no_collision: {{joints: {{turn: [-10 deg, =top], slide: all}}}}}}
"""
Moves = dict[str, tuple[int, float]]
"""The sign, and the new coordinate of the old zero [rad or m], of each joint."""

CASES: dict[str, tuple[str, str, list[str], Moves]] = {
    "arm": ("assemblies", "arm.yaml", ["elbow=90 deg", "yaw=-0.25 rad", "--flip", "elbow"], {"elbow": (-1, 90 * DEG), "yaw": (1, -0.25)}),
    "minchw": ("assemblies", "minchw/leg.yaml", ["knee=20 deg", "--flip", "ankle"],
               {f"{leg}/{name}": move for leg in ("front", "rear") for name, move in (("knee", (1, 20 * DEG)), ("ankle", (-1, 0.0)))}),
    "gripper": ("gallery/gripper", "gripper.yaml", ["open=10deg", "--flip", "open", "--flip", "geared"],
                {"open": (-1, 10 * DEG), "geared": (-1, 0.0)}),
    "hand": ("gallery/hand", "hand.yaml", ["pull=15 deg", "thumb_curl=-20 deg", "--flip", "thumb_curl", "--flip", "turn"],
             {"pull": (1, 15 * DEG), "thumb_curl": (-1, -20 * DEG), "turn": (-1, 0.0)}),
    "constructs.urdf": ("", "constructs.urdf", ["elbow=1.5 rad", "shoulder=30 deg", "slide=5 mm", "--flip", "elbow", "--flip", "slide"],
                        {"elbow": (-1, 1.5), "shoulder": (1, 30 * DEG), "slide": (-1, 0.005)}),
    "hexapod": ("gallery/hexapod", "leg.yaml", ["lift=30 deg", "--flip", "knee"], {}),
    "rig": ("", "", ["slide=5 mm", "turn=-0.5 rad", "wind=90 deg", "lead=20 deg", "bend=12 deg",
                     *(word for name in ("slide", "turn", "lead", "bend") for word in ("--flip", name))],
            {"slide": (-1, 0.005), "turn": (-1, -0.5), "wind": (1, 90 * DEG), "wind:slide": (1, 0.002), "lead": (-1, 20 * DEG),
             "bend": (-1, 12 * DEG)}),
}


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, shared_store: str) -> Path:
    monkeypatch.setenv("THINGC_STORE", shared_store)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def laid(folder: Path, of: str, name: str) -> Path:
    """Copy or import the document of a case to a folder."""
    if not name:
        (folder / "rig.yaml").write_text(RIG)
        (folder / "thingc.toml").write_text('thingc = "workspace/1"\n')
        return folder / "rig.yaml"
    if not of:
        imported = import_robot(str(ROBOTS / name), Report())
        assert imported is not None
        for file, content in imported.files.items():
            (folder / file).parent.mkdir(parents=True, exist_ok=True)
            (folder / file).write_bytes(content)
        (folder / "thingc.toml").write_text('thingc = "workspace/1"\n')
        return folder / imported.document
    for part in (of, *(["parts", "thingc.toml"] if of == "assemblies" else [])):
        target = folder / (Path(part).name if of != "assemblies" else part)
        (shutil.copytree if (ROOT / part).is_dir() else shutil.copy)(ROOT / part, target)
    return folder / (of if of == "assemblies" else Path(of).name) / name


def models(document: Path) -> dict[str, mujoco.MjModel]:
    compiled = thingc.compile(str(document))
    return {name: mode.model() for name, mode in compiled.modes.items()}


def following(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Set the coordinates of joints that mimic others, from the polynomials of the model."""
    for _ in range(3):
        for k in range(model.neq):
            if model.eq_type[k] == mujoco.mjtEq.mjEQ_JOINT and model.eq_obj2id[k] >= 0:
                follower, leader = (model.jnt_qposadr[i] for i in (model.eq_obj1id[k], model.eq_obj2id[k]))
                away = data.qpos[leader] - model.qpos0[leader]
                data.qpos[follower] = model.qpos0[follower] + sum(c * away**n for n, c in enumerate(model.eq_data[k][:5]))


def apart(one: tuple[mujoco.MjModel, mujoco.MjData], other: tuple[mujoco.MjModel, mujoco.MjData]) -> float:
    for model, data in (one, other):
        mujoco.mj_kinematics(model, data)
    names = [one[0].body(i).name for i in range(one[0].nbody)]
    assert names == [other[0].body(i).name for i in range(other[0].nbody)]
    return max(float(np.abs(getattr(one[1], key) - getattr(other[1], key)).max()) for key in ("xpos", "xmat"))


def assert_moved(old: dict[str, mujoco.MjModel], new: dict[str, mujoco.MjModel], moves: Moves) -> None:
    assert old.keys() == new.keys()
    draw = random.Random(4)
    for mode, model in old.items():
        other = new[mode]
        was, now = mujoco.MjData(model), mujoco.MjData(other)
        for _ in range(4):
            for i in range(model.njnt):
                if model.jnt_type[i] in HINGES:
                    name, q = model.joint(i).name, draw.uniform(-2.0, 2.0) * (0.01 if model.jnt_type[i] == HINGES[1] else 1.0)
                    sign, zero = moves.get(name, (1, 0.0))
                    was.joint(name).qpos[0], now.joint(name).qpos[0] = q, sign * q + zero
            following(model, was)
            following(other, now)
            assert apart((model, was), (other, now)) < 1e-12
        for i in range(model.njnt):
            sign, zero = moves.get(model.joint(i).name, (1, 0.0))
            if model.jnt_limited[i]:
                assert other.jnt_range[other.joint(model.joint(i).name).id] == pytest.approx(
                    sorted(sign * end + zero for end in model.jnt_range[i]), abs=1e-12,
                )
        loops = any(kind != mujoco.mjtEq.mjEQ_JOINT for kind in model.eq_type)
        for k in range(model.nkey):
            mujoco.mj_resetDataKeyframe(model, was, k)
            mujoco.mj_resetDataKeyframe(other, now, other.key(model.key(k).name).id)
            assert apart((model, was), (other, now)) < (1e-6 if loops else 1e-12), model.key(k).name
            if not loops:
                assert apart_at_rest(model, was, other, now) < 1e-9


def apart_at_rest(model: mujoco.MjModel, was: mujoco.MjData, other: mujoco.MjModel, now: mujoco.MjData) -> float:
    """Return the difference of the forces of springs and tendons, as the acceleration of the bodies without controls."""
    for a, b in ((model, was), (other, now)):
        b.ctrl[:] = 0.0
        mujoco.mj_forward(a, b)
    return float(np.abs(np.linalg.norm(was.qfrc_passive) - np.linalg.norm(now.qfrc_passive)))


@pytest.mark.parametrize("case", CASES)
def test_no_pose_changes(here: Path, case: str, capsys: pytest.CaptureFixture[str]) -> None:
    of, name, words, moves = CASES[case]
    document = laid(here, of, name)
    robot = document.parent / f"{case.partition('.')[0]}.yaml"
    if case == "hexapod":
        moves = {f"leg_{k}/{joint}": move for k in range(6) for joint, move in (("lift", (1, 30 * DEG)), ("knee", (-1, 0.0)))}
    old = models(robot)
    before = document.read_text()
    assert main(["rezero", str(document), *words]) == 0, capsys.readouterr().out
    after = document.read_text()
    assert re.findall(r"#.*", before) == re.findall(r"#.*", after)
    assert_moved(old, models(robot), moves)


CHAIN = """\
thingc: assembly/1
name: chain
parameters: {ratio: 2}
components:
  a: {frame: true, mass: 1 kg, inertia: {ixx: 1e-3 kg*m^2, iyy: 1e-3 kg*m^2, izz: 1e-3 kg*m^2}}
  b: {frame: true, mass: 1 kg, inertia: {ixx: 1e-3 kg*m^2, iyy: 1e-3 kg*m^2, izz: 1e-3 kg*m^2}}
  c: {frame: true, mass: 1 kg, inertia: {ixx: 1e-3 kg*m^2, iyy: 1e-3 kg*m^2, izz: 1e-3 kg*m^2}}
  d: {frame: true, mass: 1 kg, inertia: {ixx: 1e-3 kg*m^2, iyy: 1e-3 kg*m^2, izz: 1e-3 kg*m^2}, repeat: {count: 2}}
  e: {frame: true}
  f: {frame: true, mass: 1 kg, inertia: {ixx: 1e-3 kg*m^2, iyy: 1e-3 kg*m^2, izz: 1e-3 kg*m^2}}
joints:
  first: {type: continuous, parent: a.origin, child: b.origin, drive: {kind: motor, effort: 1 N*m}}
  second: {type: continuous, parent: b.origin, child: c.origin, mimic: {joint: first, multiplier: =ratio}}
  third: {type: continuous, parent: c.origin, child: d_$i.origin, repeat: {count: 2}}
  stuck: {type: fixed, parent: a.origin, child: e.origin}
  cross: {type: universal, parent: a.origin, child: f.origin}
raw: {mjcf: {actuator: {first: {ctrlrange: -1 1}}}}
"""


@pytest.mark.parametrize(("words", "said", "line"), [
    (["first=30 deg"], "the raw attribute `ctrlrange` may depend on the coordinate of joint `first`", "raw:"),
    (["second=30 deg"], "the expression `=ratio` depends on the coordinate of joint `second`", "  second:"),
    (["third=30 deg"], "`third` is repeated or has several coordinates", "  third:"),
    (["third_0=30 deg"], "`third_0` is repeated or has several coordinates", "joints:"),
    (["stuck=30 deg"], "joint `stuck` does not move (fixed)", "  stuck:"),
    (["cross=30 deg"], "`cross` is repeated or has several coordinates", "  cross:"),
    (["second=30"], "the zero of joint `second` must be an angle", "  second:"),
    (["second=3 mm"], "the zero of joint `second` must be an angle", "  second:"),
    (["fourth=3 deg"], "there is no joint `fourth`", ""),
    (["first=1024 ticks"], "unknown unit `ticks`", ""),
    (["first=1e400 deg"], "expected a number with a unit, at most", ""),
    (["first=nan deg"], "expected a number with a unit", ""),
    (["first==ratio"], "expected a number with a unit", ""),
    (["first=1 deg", "first=2 deg"], "joint `first` is set twice", ""),
    (["--flip", "first", "--flip", "first"], "joint `first` is reversed twice", ""),
    ([], "expected a joint", ""),
])
def test_errors(here: Path, words: list[str], said: str, line: str, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "thingc.toml").write_text('thingc = "workspace/1"\n')
    (here / "chain.yaml").write_text(CHAIN)
    assert main(["rezero", "chain.yaml", *words]) == 2
    out = "".join(capsys.readouterr())
    number = next((k for k, text in enumerate(CHAIN.splitlines(), 1) if line and text.startswith(line)), None)
    assert said in out and (number is None or f"--> chain.yaml:{number}:" in out), out
    assert (here / "chain.yaml").read_text() == CHAIN


def test_limit_repeated_by_an_alias_is_an_error(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "thingc.toml").write_text('thingc = "workspace/1"\n')
    body = "frame: true, mass: 1 kg, inertia: {ixx: 1e-3 kg*m^2, iyy: 1e-3 kg*m^2, izz: 1e-3 kg*m^2}"
    text = (
        f"thingc: assembly/1\nname: arm\ncomponents:\n  a: {{{body}}}\n  b: {{{body}}}\n  c: {{{body}}}\njoints:\n"
        "  one: {type: revolute, parent: a.origin, child: b.origin, limit: &same {lower: -1 rad, upper: 1 rad}}\n"
        "  two: {type: revolute, parent: b.origin, child: c.origin, limit: *same}\n"
    )
    (here / "arm.yaml").write_text(text)
    assert main(["rezero", "arm.yaml", "one=0.5 rad"]) == 2
    out = capsys.readouterr().out
    assert "`joints.one.limit.lower` cannot be set separately (repeated by an alias" in out and "--> arm.yaml:8:" in out, out
    assert (here / "arm.yaml").read_text() == text


@pytest.mark.parametrize("words", [["first=30 deg"], ["second=-10 deg"], ["first=20 deg", "--flip", "second"]])
@pytest.mark.parametrize("modes", ["modes: {go: {root: a}, held: {root: c, base: held}}\n", ""])
def test_start_of_a_mimic_with_an_offset_stays(here: Path, words: list[str], modes: str) -> None:
    """`second` starts at 10 deg in modes without a pose, also if this position becomes its zero. A document without modes gets no pose."""
    (here / "thingc.toml").write_text('thingc = "workspace/1"\n')
    text = re.sub(r"^(raw|  (third|stuck|cross)).*\n|^  [def]: .*\n", "", CHAIN, flags=re.MULTILINE)
    text = text.replace("multiplier: =ratio", "multiplier: 2, offset: 10 deg")
    (here / "chain.yaml").write_text(text + modes)
    old = models(here / "chain.yaml")
    assert main(["rezero", "chain.yaml", *words]) == 0
    new = models(here / "chain.yaml")
    assert ("poses:" in (here / "chain.yaml").read_text()) == ("first" in words[0] and bool(modes))
    for mode, model in old.items() if modes else ():
        was, now = mujoco.MjData(model), mujoco.MjData(new[mode])
        mujoco.mj_resetDataKeyframe(model, was, 0)
        mujoco.mj_resetDataKeyframe(new[mode], now, 0 if new[mode].nkey else -1)
        assert abs(was.joint("second").qpos[0] - 10 * DEG) < 1e-15 and apart((model, was), (new[mode], now)) < 1e-12


def test_joint_of_a_nested_document(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "thingc.toml").write_text('thingc = "workspace/1"\n')
    body = "frame: true, mass: 1 kg, inertia: {ixx: 1e-3 kg*m^2, iyy: 1e-3 kg*m^2, izz: 1e-3 kg*m^2}"
    (here / "leg.yaml").write_text(
        f"thingc: assembly/1\nname: leg\ncomponents:\n  a: {{{body}}}\n  b: {{{body}, mounts: {{m: {{xyz: 0 0 1 m}}}}}}\n"
        "joints: {knee: {type: continuous, parent: a.origin, child: b.m}}\nposes: {bent: {knee: 20 deg}, flat: {}}\n"
    )
    walker = (
        f"thingc: assembly/1\nname: walker\ncomponents:\n  body: {{{body}}}\n"
        "  left: {assembly: leg.yaml, at: {in: body.origin, xyz: 0 100 0 mm}}\n"
        "  right: {assembly: leg.yaml, mirror: y, at: {in: body.origin, xyz: 0 -100 0 mm}}\n"
        "poses:\n  up: {left: bent, right.knee: 0.5 rad}\n  on: {'*': bent}\n  off: {}\nmodes: {go: {root: body, base: free}}\n"
    )
    (here / "walker.yaml").write_text(walker)
    old = models(here / "walker.yaml")
    assert main(["rezero", "walker.yaml", "left.knee=30 deg"]) == 2
    out = capsys.readouterr().out
    assert "joint `knee` is defined in the nested document `leg.yaml`" in out
    assert "--> walker.yaml:5:" in out and "`thingc rezero leg.yaml knee=...`" in out
    (here / "sub").mkdir()
    (here / "sub/other.yaml").write_text(walker.replace("leg.yaml", "../leg.yaml"))
    assert main(["rezero", "sub/other.yaml", "left.knee=30 deg"]) == 2
    assert "use `thingc rezero leg.yaml knee=...`" in capsys.readouterr().out
    (here / "sub/other.yaml").write_text(walker.replace("leg.yaml", "../leg.yaml").replace("poses:", "<<<<<<< HEAD\nposes:"))
    (here / "unrelated.yaml").write_text("<<<<<<< HEAD\n")
    before = (here / "leg.yaml").read_text()
    assert main(["rezero", "leg.yaml", "knee=30 deg"]) == 2 and "`sub/other.yaml` may use `leg.yaml`" in capsys.readouterr().out
    assert (here / "leg.yaml").read_text() == before
    (here / "sub/other.yaml").unlink()
    assert main(["rezero", "leg.yaml", "knee=30 deg", "--flip", "knee", "--diff"]) == 0
    out = capsys.readouterr().out
    assert "+++ leg.yaml" in out and "+++ walker.yaml" in out and (here / "walker.yaml").read_text() == walker
    assert main(["rezero", "leg.yaml", "knee=30 deg", "--flip", "knee"]) == 0
    assert_moved(old, models(here / "walker.yaml"), {f"{leg}/knee": (-1, 30 * DEG) for leg in ("left", "right")})
    text = (here / "walker.yaml").read_text()
    assert "{left: bent, right.knee:" in text and "on: {'*': bent}" in text and "start: {left.knee: 30 deg, right.knee: 30 deg}" in text
    for value in ("components.left.joints.knee.dynamics.damping: [0, 1 N*m*s/rad]", "poses.up.right.knee: [0.5 rad, 0.6 rad]"):
        (here / "sizes.yaml").write_text(f"thingc: variants/1\nassembly: walker.yaml\nname: sizes\nparameters: {{{value}}}\n")
        assert main(["rezero", "leg.yaml", "knee=30 deg"]) == 2
        assert "`sizes.yaml` may set values of the changed joints" in capsys.readouterr().out


def test_moving_back_restores_the_values(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    document = laid(here, "", "")
    assert main(["rezero", "rig.yaml", "slide=5 mm", "wind=90 deg", "--flip", "slide"]) == 0
    assert main(["rezero", "rig.yaml", "slide=5 mm", "wind=-90 deg", "--flip", "slide"]) == 0
    after = document.read_text()
    assert "limit: {lower: -20 mm, upper: 3 cm}" in after
    assert "slide: 0.5 cm" in after and "w*\": 20 deg" in after and "rest: =top / 2 + 90 deg - 90 deg" in after
    capsys.readouterr()
    assert main(["rezero", "rig.yaml", "slide=0 mm"]) == 0
    assert capsys.readouterr().out == "nothing changes: all zeros and directions stay the same\n" and document.read_text() == after
    assert main(["set", "rig.yaml", "joints.slide.zero=5 mm"]) == 2
    assert "use `thingc rezero rig.yaml 'slide=5 mm'`" in capsys.readouterr().out


def test_same_and_diff_name_exactly_these_zeros(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    document = laid(here, "", "constructs.urdf")
    shutil.copy(document, here / "old.yaml")
    assert main(["rezero", str(document), "shoulder=30 deg", "slide=4 mm", "--flip", "slide"]) == 0
    capsys.readouterr()
    assert main(["same", "old.yaml", str(document)]) == 0
    assert "the same mechanism; zeros: shoulder +30 deg, slide +4 mm; reversed: slide\n" in capsys.readouterr().out
    main(["same", "old.yaml", "constructs.yaml", "--format", "json"])
    found = json.loads(capsys.readouterr().out)["comparisons"][0]
    assert {one["one"]: (one["sign"], round(one["zero"], 9)) for one in found["joints"] if abs(one["zero"]) > 1e-12 or one["sign"] < 0} == {
        "shoulder": (1, round(30 * DEG, 9)), "slide": (-1, 0.004),
    }
    assert found["limits"] == [] and found["differences"] == []
    assert main(["diff", "old.yaml", "constructs.yaml"]) == 0
    edits = [line.split() for line in capsys.readouterr().out.partition("  effects:")[0].splitlines()[1:]]
    assert [words[:3] for words in edits] == [["the", "same", "mechanism;"], ["+", "pose", "start"], ["mode", "source:", "pose"]], edits
    assert main(["rezero", str(document), "shoulder=-30 deg", "slide=4 mm", "--flip", "slide"]) == 0
    capsys.readouterr()
    assert main(["same", "old.yaml", str(document)]) == 0
    assert "the same mechanism\n" in capsys.readouterr().out


def test_toml(here: Path) -> None:
    (here / "thingc.toml").write_text('thingc = "workspace/1"\n')
    body = 'frame = true\nmass = "1 kg"\ninertia = {ixx = "1e-3 kg*m^2", iyy = "1e-3 kg*m^2", izz = "1e-3 kg*m^2"}\n'
    (here / "arm.toml").write_text(
        f'thingc = "assembly/1"\nname = "arm"\n\n[components.a]\n{body}\n[components.b]\n{body}\n[joints.turn]  # the only one\n'
        'type = "revolute"\nparent = "a.origin"\nchild = "b.origin"\nlimit = {lower = "-90 deg", upper = "20 deg"}\n\n'
        '[poses.up]\nturn = "10 deg"\n\n[modes.go]\nroot = "a"\npose = "up"\n'
    )
    old = models(here / "arm.toml")
    assert main(["rezero", "arm.toml", "turn=45 deg", "--flip", "turn"]) == 0
    assert_moved(old, models(here / "arm.toml"), {"turn": (-1, 45 * DEG)})
    assert 'limit = {lower = "25 deg", upper = "135 deg"}' in (here / "arm.toml").read_text()


def test_reverse_needs_one_axis(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "thingc.toml").write_text('thingc = "workspace/1"\n')
    (here / "chain.yaml").write_text(CHAIN.replace("type: universal,", "type: universal, reverse: true,"))
    assert main(["check", "chain.yaml"]) == 1
    assert "error[TC338]: joint `cross` is universal and cannot have `reverse`" in capsys.readouterr().out


def test_ranges_of_tests_follow(here: Path) -> None:
    document = laid(here, "", "")
    assert main(["rezero", "rig.yaml", "turn=15 deg", "--flip", "turn"]) == 0
    assert 'joints: {turn: ["=-(top) + 15 deg", 25 deg], slide: all}' in document.read_text().replace("'", '"').replace(
        "[=-(top) + 15 deg, 25 deg]", '["=-(top) + 15 deg", 25 deg]',
    )


def test_pose_with_another_loop_closure_is_an_error(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    document = laid(here, *CASES["gripper"][:2])
    before = document.read_text()
    assert main(["rezero", str(document), "left_close=5 deg"]) == 2
    out = capsys.readouterr().out
    line = before[: before.index("  half:")].count("\n") + 1
    assert "the links would move by" in out and f"gripper.yaml:{line}:" in out and document.read_text() == before


def test_reversed_joint_is_a_difference(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "thingc.toml").write_text('thingc = "workspace/1"\n')
    text = re.sub(r"^(raw|  (second|third|cross)).*\n", "", CHAIN, flags=re.MULTILINE)
    text = re.sub(r"^  [cdf]: .*\n", "", text, flags=re.MULTILINE)
    for name in ("old.yaml", "new.yaml"):
        (here / name).write_text(text)
    assert main(["rezero", "new.yaml", "--flip", "first"]) == 0
    capsys.readouterr()
    assert main(["diff", "old.yaml", "new.yaml"]) == 0
    assert "joint first: reverse false -> true" in capsys.readouterr().out


def test_calibrations_of_so101_become_equal(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The zeros in the output of `thingc same`, with its rounding, convert the old calibration to the new one."""
    for name in ("old", "new"):
        assert main(["import", str(ROOT / f"gallery/so101/source/so101_{name}_calib.urdf"), "-o", name, "--no-meshes"]) == 0
    old, new = "old/so101_old_calib.yaml", "new/so101_new_calib.yaml"
    capsys.readouterr()
    assert main(["same", old, new]) == 0
    head = capsys.readouterr().out.splitlines()[0]
    zeros = re.findall(r"(\w+) ([+-][\d.]+ deg)", head.partition("zeros: ")[2])
    assert {name for name, _ in zeros} == {"shoulder_lift", "elbow_flex", "wrist_roll"}
    assert main(["rezero", old, *(f"{name}={zero}" for name, zero in zeros)]) == 0
    capsys.readouterr()
    assert main(["same", old, new, "--format", "json"]) == 0
    found = json.loads(capsys.readouterr().out)["comparisons"][0]
    assert found["same"] and all(one["sign"] == 1 and abs(one["zero"]) < 1e-5 for one in found["joints"])
    assert main(["diff", old, new]) == 0
    assert "zeros:" not in capsys.readouterr().out


def test_error_caused_by_new_limits_is_shown(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A document that nests the joint has an error after a warning. The error is reported, and no file changes."""
    (here / "thingc.toml").write_text('thingc = "workspace/1"\n')
    body = "frame: true, mass: 1 kg, inertia: {ixx: 1e-3 kg*m^2, iyy: 1e-3 kg*m^2, izz: 1e-3 kg*m^2}"
    leg = (
        f"thingc: assembly/1\nname: leg\ncomponents: {{a: {{{body}}}, b: {{{body}}}}}\n"
        "joints: {knee: {type: revolute, parent: a.origin, child: b.origin, limit: {lower: -9000 deg, upper: 20 deg}}}\n"
    )
    (here / "leg.yaml").write_text(leg)
    (here / "walker.yaml").write_text(
        "thingc: assembly/1\nname: walker\ncomponents: {left: {assembly: leg.yaml}}\nmodes: {go: {root: left.nothing}}\n"
    )
    assert main(["rezero", "leg.yaml", "knee=30 deg"]) == 2
    out = capsys.readouterr().out
    assert "error in `walker.yaml`: " in out and "nothing" in out and (here / "leg.yaml").read_text() == leg


def test_actuators_keep_their_direction_if_a_joint_is_reversed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The ratio of the transmission, or the column of the differential, changes its sign."""
    motor = "{kind: motor}"
    (tmp_path / "thingc.toml").write_text('thingc = "workspace/1"\n')
    (tmp_path / "geared.yaml").write_text(f"""\
thingc: assembly/1
name: geared
parameters: {{teeth: 30}}
components: {{a: {{{BODY}}}, b: {{{BODY}}}, c: {{{BODY}}}, d: {{{BODY}}}}}
joints:
  one: {{type: continuous, parent: a.origin, child: b.origin}}
  two: {{type: continuous, parent: b.origin, child: c.origin}}
  three: {{type: continuous, parent: c.origin, child: d.origin}}
transmissions:
  belt: {{actuator: {motor}, joint: one, ratio: =teeth / 10}}
  both: {{differential: {{actuators: [{motor}, {motor}], joints: [two, three], matrix: [[1, 2], [3, -4]]}}}}
""")
    assert main(["rezero", str(tmp_path / "geared.yaml"), "--flip", "one", "--flip", "three"]) == 0
    text = (tmp_path / "geared.yaml").read_text()
    assert "ratio: =-(teeth / 10)" in text and "matrix: [[1, -2], [3, 4]]" in text
    values = "name: sizes\nassembly: geared.yaml\nparameters: {transmissions.belt.ratio: [3, 4]}\n"
    (tmp_path / "sizes.yaml").write_text(f"thingc: variants/1\n{values}")
    assert main(["rezero", str(tmp_path / "geared.yaml"), "--flip", "one"]) == 2
    assert "may set values of the changed joints" in capsys.readouterr().out
    assert main(["rezero", str(tmp_path / "geared.yaml"), "one=3 deg"]) == 0  # the ratio stays


def test_repeated_transmission_of_a_reversed_joint_is_an_error(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The copies have one matrix, so the copy of one joint cannot change."""
    motor, path = "{kind: motor}", tmp_path / "geared.yaml"
    (tmp_path / "thingc.toml").write_text('thingc = "workspace/1"\n')
    path.write_text(f"""\
thingc: assembly/1
name: geared
components: {{a: {{{BODY}}}, b: {{{BODY}}}, c: {{{BODY}}}}}
joints: {{k_0: {{type: continuous, parent: a.origin, child: b.origin}}, two: {{type: continuous, parent: b.origin, child: c.origin}}}}
transmissions:
  both: {{repeat: {{count: 1}}, differential: {{actuators: [{motor}, {motor}], joints: [k_$i, two], matrix: [[1, 2], [3, -4]]}}}}
""")
    assert main(["rezero", str(path), "--flip", "k_0"]) == 2
    assert "the transmission of joint `k_$i` is repeated" in capsys.readouterr().out
    assert main(["rezero", str(path), "--flip", "two"]) == 0 and "matrix: [[1, -2], [3, 4]]" in path.read_text()
