"""Modules for learning frameworks: their configuration is compared with MuJoCo models, using stand-ins with the recorded parameters of
the frameworks, and mjlab itself if it is installed."""

from __future__ import annotations

import importlib.util
import json
import math
import os
import re
import subprocess
import sys
import tomllib
import types
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from pxr import Usd, UsdPhysics

from emit.test_called import ARM, PAIR, PULLEY
from emit.test_joint_order import plain_document
from emit.test_sdf import EVERY
from thingc.driver import pipeline
from thingc.driver.environment import Environment, Options
from thingc.modes import Modes
from thingc.targets.artifact import Artifacts
from thingc.targets.custom_names import apply_custom_names
from thingc.targets.registry import emitter, parse_targets, targets
from thingc.tools import learners
from thingc.tools.learners import isaaclab, mjlab, playground

ROOT = Path(__file__).resolve().parents[2]
SIGNATURES = json.loads(Path(__file__).with_name("signatures.json").read_text())
TARGETS = {"isaaclab": isaaclab, "mjlab": mjlab, "playground": playground}
DOG = """thingc: assembly/1
name: dog
components:
  trunk:
    frame: true
    mass: 5 kg
    inertia: {ixx: 0.1 kg*m^2, iyy: 0.1 kg*m^2, izz: 0.1 kg*m^2}
    mounts: {l: {xyz: 0 90 0 mm}, r: {xyz: 0 -90 0 mm}}
  left: {frame: true, mass: 1 kg, inertia: {ixx: 0.01 kg*m^2, iyy: 0.01 kg*m^2, izz: 0.01 kg*m^2}, mounts: {foot: {xyz: 0 0 -200 mm}}}
  right: {frame: true, mass: 1 kg, inertia: {ixx: 0.01 kg*m^2, iyy: 0.01 kg*m^2, izz: 0.01 kg*m^2}, mounts: {foot: {xyz: 0 0 -200 mm}}}
joints:
  hip_l:
    type: revolute
    parent: trunk.l
    child: left.origin
    axis: [0, 1, 0]
    limit: {lower: -60 deg, upper: 60 deg, effort: 20 N*m, velocity: 15 rad/s}
    dynamics: {armature: 0.02 kg*m^2, friction: 0.3 N*m, damping: 0.05 N*m*s/rad}
    drive: {kind: position, kp: 40 N*m/rad, kv: 1.5 N*m*s/rad}
  hip_r:
    type: revolute
    parent: trunk.r
    child: right.origin
    axis: [0, 1, 0]
    limit: {lower: -60 deg, upper: 60 deg, effort: 20 N*m, velocity: 15 rad/s}
    dynamics: {armature: 0.02 kg*m^2, friction: 0.3 N*m, damping: 0.05 N*m*s/rad}
    drive: {kind: position, kp: 40 N*m/rad, kv: 1.5 N*m*s/rad}
poses: {stand: {hip_l: 20 deg, hip_r: 20 deg}}
sensors: {imu: {type: imu, at: trunk.l}, torque: {type: drive, joint: hip_r}}
names: {actuators: {hip_r: right motor}}
modes:
  walk: {root: trunk, base: free, at: {xyz: 0.1 0.2 0.5 m, rpy: 0 0 90 deg}, pose: stand}
  rig: {root: trunk, base: held, at: {xyz: 0 0 1 m}}
  stuck: {root: left.foot, base: fixed, at: {xyz: 0 0 0.3 m}}
"""

GRIP = """thingc: assembly/1
name: grip
components:
  base: {frame: true, mass: 1 kg, inertia: {ixx: 0.01 kg*m^2, iyy: 0.01 kg*m^2, izz: 0.01 kg*m^2}}
  fore: {frame: true, mass: 1 kg, inertia: {ixx: 0.01 kg*m^2, iyy: 0.01 kg*m^2, izz: 0.01 kg*m^2}, mounts: {tip: {xyz: 200 0 0 mm}}}
  finger: {frame: true, mass: 1 kg, inertia: {ixx: 0.01 kg*m^2, iyy: 0.01 kg*m^2, izz: 0.01 kg*m^2}}
joints:
  elbow:
    type: revolute
    parent: base.origin
    child: fore.origin
    limit: {lower: -60 deg, upper: 60 deg, effort: 20 N*m, velocity: 15 rad/s}
    drive: {kind: position, kp: 40 N*m/rad, kv: 1.5 N*m*s/rad}
  grip:
    type: revolute
    parent: fore.tip
    child: finger.origin
    limit: {lower: -100 deg, upper: 100 deg}
    mimic: {joint: elbow, multiplier: 0.5, offset: 10 deg}
poses: {bent: {elbow: 40 deg}}
modes: {bench: {root: base, base: fixed}, loose: {root: finger, base: free}, posed: {root: base, base: fixed, pose: bent}}
"""


class Written:
    """The files of all targets for a document, in a build folder."""

    def __init__(self, folder: Path, store: str, files: dict[str, str], compat: tuple[str, ...] = ()) -> None:
        for name, text in {"thingc.toml": 'thingc = "workspace/1"\n', **files}.items():
            (folder / name).write_text(text)
        with Environment(str(folder / list(files)[-1]), Options(store=store, compat=compat)) as environment:
            compilation = pipeline.compile(environment)
            assert [d.message for d in compilation.report.diagnostics if d.severity == "error"] == []
            models = pipeline.build(environment, compilation, ["mjcf", "usd"])
            request = apply_custom_names(pipeline.request_of(environment, compilation))
            self.made: dict[str, Artifacts] = {name: target.emit(request) for name, target in TARGETS.items()}
            ours = re.compile("|".join(pattern.replace("*", "[^/]+") for pattern in learners.WRITES))
            assert all(ours.fullmatch(path) for made in self.made.values() for path in made.files)
            assert not compilation.report.failed
            self.name, self.folder = request.assembly.name, folder / "out"
            self.modes = {robot.mode.name: robot.start.name or None for robot in request.robots}
            for made in (*models.values(), *self.made.values()):
                for path, content in made.contents(environment.store).items():
                    (self.folder / path).parent.mkdir(parents=True, exist_ok=True)
                    (self.folder / path).write_bytes(content)

    def mujoco(self, mode: str) -> Any:
        return mujoco.MjModel.from_xml_path(str(self.folder / "mjcf" / f"{self.name}_{mode}.xml"))

    def started(self, mode: str) -> tuple[Any, Any]:
        """Return the MuJoCo state in the start pose of the mode."""
        model, pose = self.mujoco(mode), self.modes[mode]
        data = mujoco.MjData(model)
        if pose is not None:
            mujoco.mj_resetDataKeyframe(model, data, model.key(pose).id)
        return model, data

    def module(self, target: str, mode: str) -> Any:
        path = self.folder / target / f"{self.name}_{mode}{'_constants' if target == 'playground' else ''}.py"
        spec = importlib.util.spec_from_file_location(f"{target}_{mode}", path)
        assert spec is not None and spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return module

    def usd(self, mode: str) -> dict[str, Any]:
        """Return the joints of the articulation."""
        stage = Usd.Stage.Open(str(self.folder / "usd" / f"{self.name}_{mode}.usda"))
        self.stage = stage
        return {
            prim.GetName(): prim for prim in stage.Traverse()
            if prim.IsA(UsdPhysics.RevoluteJoint) or prim.IsA(UsdPhysics.PrismaticJoint)
        }

    def losses(self, target: str) -> set[tuple[str, str]]:
        return {(loss.path, loss.what) for loss in self.made[target].losses}


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory, shared_store: str) -> dict[str, Written]:
    documents = {"dog": {"robot.yaml": DOG}, "grip": {"robot.yaml": GRIP}, "every": {"robot.yaml": EVERY}}
    documents |= {f"plain_{seed}": {"robot.yaml": plain_document(seed)} for seed in range(6)}
    documents["pair"] = {"arm.yaml": ARM.replace("joints:\n", PULLEY + "joints:\n", 1), "robot.yaml": PAIR}
    return {name: Written(tmp_path_factory.mktemp(name), shared_store, files) for name, files in documents.items()}


class Configured:
    """A configuration: an object with the arguments of the call of a class."""

    def __init__(self, path: str, arguments: dict[str, Any]) -> None:
        allowed = next(one["classes"][path] for one in SIGNATURES.values() if path in one["classes"])
        assert set(arguments) <= set(allowed), (path, set(arguments) - set(allowed))
        self.path = path
        self.__dict__.update(arguments)


@pytest.fixture
def stand_ins(monkeypatch: pytest.MonkeyPatch) -> None:
    """Modules with the classes of the frameworks, which accept exactly the recorded parameters."""
    made: dict[str, Any] = {}
    for package in SIGNATURES.values():
        for path in package["classes"]:
            words = path.split(".")
            depth = next(index for index, word in enumerate(words) if word[:1].isupper())
            for end in range(1, depth + 1):
                name = ".".join(words[:end])
                if name not in made:
                    made[name] = types.ModuleType(name)
                    monkeypatch.setitem(sys.modules, name, made[name])
                    if end > 1:
                        setattr(made[".".join(words[: end - 1])], words[end - 1], made[name])
            call = type(words[-1], (), {"__new__": lambda cls, _path=path, **arguments: Configured(_path, arguments)})
            setattr(made[".".join(words[:depth])] if len(words) == depth + 1 else made[path.rpartition(".")[0]], words[-1], call)
            made[path] = call


def found(values: Any, name: str, missing: float) -> float:
    """Look up the value of a joint like Isaac Lab and mjlab: a number, or the value of a pattern that matches the whole name."""
    if not isinstance(values, dict):
        return float(values)
    hits = [value for pattern, value in values.items() if re.fullmatch(pattern, name)]
    assert len(hits) <= 1, (values, name)
    return float(hits[0]) if hits else missing


def matched(patterns: Any, names: list[str]) -> list[str]:
    hits = [[name for name in names if re.fullmatch(pattern, name)] for pattern in patterns]
    assert all(hits), (patterns, names)
    return [name for some in hits for name in some]


def drive_of(model: Any, joint: int) -> Any:
    """Return the only actuator of a joint."""
    (drive,) = (model.actuator(k) for k in range(model.nu) if model.actuator_trnid[k, 0] == joint and model.actuator_trntype[k] == 0)
    return drive


def test_models_loaded_by_modules_are_written() -> None:
    assert parse_targets(["isaaclab"]) == ("usd", "isaaclab") and parse_targets(["mjlab,playground"]) == ("mjcf", "mjlab", "playground")
    assert parse_targets(["urdf"]) == ("urdf",)


@pytest.mark.parametrize(("mode", "elbow"), [("bench", 0.0), ("loose", 0.0), ("posed", math.radians(40.0))])
def test_joints_that_mimic_others_start_where_these_put_them(written: dict[str, Written], mode: str, elbow: float) -> None:
    robot = written["grip"]
    model, data = robot.started(mode)
    mujoco.mj_forward(model, data)
    assert [data.joint(name).qpos[0] for name in ("elbow", "grip")] == pytest.approx([elbow, 0.5 * elbow + math.radians(10.0)])
    assert data.ne == 1 and abs(data.efc_pos[0]) < 1e-15
    states = Modes.load(robot.folder)[mode]
    assert states.state().q == pytest.approx({"elbow": 0.0, "grip": math.radians(10.0)})
    assert states.state(q={"elbow": -0.4}).q == pytest.approx({"elbow": -0.4, "grip": math.radians(10.0) - 0.2})
    assert states.state("bent", q={"grip": 0.1}).q == pytest.approx({"elbow": math.radians(40.0), "grip": 0.1})


def test_isaac_lab_has_the_values_of_mujoco(written: dict[str, Written], stand_ins: None) -> None:
    for robot in written.values():
        for mode in robot.modes:
            config = getattr(robot.module("isaaclab", mode), f"{robot.name.upper()}_CFG")
            joints, (model, data) = robot.usd(mode), robot.started(mode)
            assert Path(config.spawn.usd_path).is_file()
            tree = {name for name, prim in joints.items() if not UsdPhysics.Joint(prim).GetExcludeFromArticulationAttr().Get()}
            order = json.loads((robot.folder / "joint_order.json").read_text())[mode]
            # the name in the document ties a joint of USD to one of MuJoCo, also where files have other names
            of_mujoco = {}
            if "isaac" in order["joints"]:
                pairs = zip(order["joints"]["isaac"], order["indices"]["mujoco"]["isaac"], strict=True)
                of_mujoco = {name: model.joint(order["joints"]["mujoco"][index]) for name, index in pairs if index is not None}
            seen: list[str] = []
            for group in config.actuators.values():
                for name in matched(group.joint_names_expr, sorted(tree)):
                    seen.append(name)
                    if name not in of_mujoco:
                        continue
                    joint = of_mujoco[name]
                    drive = drive_of(model, joint.id)
                    if drive.forcelimited[0] or drive.ctrllimited[0] and group.stiffness == group.damping == 0.0:
                        effort = drive.forcerange[1] if drive.forcelimited[0] else drive.ctrlrange[1]
                        assert found(group.effort_limit_sim, name, math.nan) == pytest.approx(effort)
                    assert found(group.stiffness, name, math.nan) == pytest.approx(-drive.biasprm[1])
                    assert found(group.damping, name, math.nan) == pytest.approx(-drive.biasprm[2])
                    if joint.armature[0]:
                        assert found(group.armature, name, math.nan) == pytest.approx(joint.armature[0])
            assert sorted(seen) == sorted({*seen})
            for name, joint in of_mujoco.items():
                if name in tree:
                    assert found(config.init_state.joint_pos, name, 0.0) == pytest.approx(data.joint(joint.name).qpos[0])
            if robot.name == "dog":
                assert set(seen) == tree == {"hip_l", "hip_r"} and set(config.actuators) == {"position"}
                assert config.actuators["position"].joint_names_expr == [".*"]
                assert config.actuators["position"].velocity_limit_sim == 15.0
            if hasattr(config.init_state, "pos"):
                x, y, z, w = config.init_state.rot
                assert [*config.init_state.pos, w, x, y, z] == pytest.approx(data.qpos[:7].tolist())


SCENE = DOG.replace("joints:\n", "joints:\n  loose: {type: free, parent: ball.origin, child: trunk.origin}\n", 1).replace(
    "components:\n", "components:\n  ball: {frame: true, mass: 1 kg, inertia: {ixx: 0.1 kg*m^2, iyy: 0.1 kg*m^2, izz: 0.1 kg*m^2}}\n",
).replace("poses: {", "poses: {jump: {loose: {xyz: 300 0 50 mm, rpy: 0 90 0 deg}, hip_l: 20 deg}, ").partition("modes:")[0] + """modes:
  thrown: {root: ball, base: free, at: {xyz: 1 2 0.5 m, rpy: 0 0 90 deg}, pose: jump}
  laid: {root: ball, base: fixed, at: {xyz: 1 2 0.5 m}, pose: jump}
  caught: {root: trunk, base: fixed, at: {xyz: 0 0 1 m}}
"""


def test_isaac_lab_places_the_articulation_if_the_root_is_an_object(tmp_path: Path, shared_store: str, stand_ins: None) -> None:
    robot = Written(tmp_path, shared_store, {"robot.yaml": SCENE})
    for mode in ("thrown", "laid"):
        state = robot.module("isaaclab", mode).DOG_CFG.init_state
        model, data = robot.started(mode)
        mujoco.mj_forward(model, data)
        x, y, z, w = state.rot
        assert state.pos == pytest.approx(data.body("trunk").xpos.tolist())
        assert [w, x, y, z] == pytest.approx(data.body("trunk").xquat.tolist())
        robot.usd(mode)
        roots = [prim.GetName() for prim in robot.stage.Traverse() if prim.HasAPI(UsdPhysics.ArticulationRootAPI)]
        assert roots == ["trunk"]
    assert not hasattr(robot.module("isaaclab", "caught").DOG_CFG.init_state, "pos")


def test_mjlab_has_the_values_of_mujoco(written: dict[str, Written], stand_ins: None) -> None:
    for robot in written.values():
        for mode in robot.modes:
            module, (model, data) = robot.module("mjlab", mode), robot.started(mode)
            config = getattr(module, f"{robot.name.upper()}_CFG")
            joints = [model.joint(k) for k in range(model.njnt) if model.jnt_type[k] != mujoco.mjtJoint.mjJNT_FREE]
            if any(int(joint.type[0]) == int(mujoco.mjtJoint.mjJNT_BALL) for joint in joints):
                continue
            own = [model.actuator(k) for k in range(model.nu)]
            plain = {joint.name.replace("/", "."): joint for joint in joints}
            left = config.spec_fn()
            assert {one.name for one in left.actuators} == {one.name.replace("/", ".") for one in own} - {*module.DRIVES} and not left.keys
            for name in module.DRIVES.values():  # as mjlab does
                left.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
            assert left.compile().sensor_dim.tolist() == model.sensor_dim.tolist()
            seen = []
            for group in config.articulation.actuators:
                for name in matched(group.target_names_expr, [*plain]):
                    seen.append(name)
                    joint, motor = plain[name], "Motor" in group.path
                    drive = drive_of(model, joint.id)
                    assert getattr(group, "stiffness", 0.0) == pytest.approx(-drive.biasprm[1])
                    assert getattr(group, "damping", 0.0) == pytest.approx(-drive.biasprm[2])
                    limit = drive.forcerange[1] if drive.forcelimited[0] else None
                    if motor:
                        limit = drive.ctrlrange[1] if drive.ctrllimited[0] else math.inf
                    assert getattr(group, "effort_limit", None) == limit
                    assert (group.armature, group.frictionloss) == pytest.approx((joint.armature[0], joint.frictionloss[0]))
            assert len(seen) == len({*seen}) == len(module.DRIVES)
            for name, joint in plain.items():
                assert found(config.init_state.joint_pos, name, 0.0) == pytest.approx(data.joint(joint.name).qpos[0])


def test_playground_has_the_names_of_the_model(written: dict[str, Written]) -> None:
    for robot in written.values():
        for mode in robot.modes:
            module, model = robot.module("playground", mode), robot.mujoco(mode)
            assert module.ROBOT_XML.is_file() and module.SCENE_XML.is_file()
            assert [model.joint(k).name for k in range(model.njnt) if model.jnt_type[k] != mujoco.mjtJoint.mjJNT_FREE] == module.JOINT_NAMES
            assert [model.actuator(k).name for k in range(model.nu)] == module.ACTUATOR_NAMES
            assert [model.sensor(k).name for k in range(model.nsensor)] == module.SENSOR_NAMES
            assert [model.site(k).name for k in range(model.nsite)] == module.SITE_NAMES
            assert model.body(1).name == module.ROOT_BODY
            if model.nkey:
                assert model.key(0).name == module.HOME_KEYFRAME
                np.testing.assert_allclose(module.HOME_QPOS, model.key_qpos[0])
                np.testing.assert_allclose(module.HOME_CTRL, model.key_ctrl[0])


def test_unsupported_features_are_losses(written: dict[str, Written]) -> None:
    assert written["dog"].losses("isaaclab") == set()
    assert written["dog"].losses("mjlab") == {("torque", "the sensor: mjlab adds the drive later")}
    lost = dict(written["every"].losses("isaaclab"))
    assert {"spindle", "sleeve", "fork", "hip", "rolling", "swinging"} == set(lost)
    assert lost["hip"] == "the configuration of the ball joint: not supported by Isaac Lab"
    assert {path for path, _ in written["every"].losses("mjlab")} == {"hip"}
    assert {path for path, _ in written["pair"].losses("mjlab")} == {"bow string", "left/elbow motor"}


def test_imperfect_drives_are_losses_except_for_delays_in_mjlab(tmp_path: Path, shared_store: str, stand_ins: None) -> None:
    """15 ms are 8 steps of 2 ms."""
    effects = "kv: 1.5 N*m*s/rad, stall: 30 N*m, delay: 15 ms, deadband: 0.2 deg, noise: 0.1 deg}"
    robot = Written(tmp_path, shared_store, {"robot.yaml": DOG.replace("kv: 1.5 N*m*s/rad}", effects)})
    (mode,) = list(robot.modes)[:1]
    lags = {(one.delay_min_lag, one.delay_max_lag) for one in robot.module("mjlab", mode).ACTUATORS if hasattr(one, "delay_min_lag")}
    assert lags == {(8, 8)}
    others = {("hip_l", f"{what} of the drive") for what in ("the torque-speed line", "the deadband", "the noise")}
    assert {one for one in robot.losses("mjlab") if one[0] == "hip_l"} == others
    assert {one for one in robot.losses("isaaclab") if one[0] == "hip_l"} == {*others, ("hip_l", "the delay of the drive")}


def test_raw_attributes_that_mjlab_replaces_are_losses(tmp_path: Path, shared_store: str) -> None:
    raw = "actuator: {hip_r: {gear: 3}}, joint: {hip_l: {armature: 0.4, frictionloss: 0.7, solreflimit: 0.01 1}}"
    robot = Written(tmp_path, shared_store, {"robot.yaml": f"{DOG}raw: {{mjcf: {{{raw}}}}}\n"})
    lost = {path: what for path, what in robot.losses("mjlab") if what.startswith("the raw attribute")}
    assert {*lost} == {"hip_l", "right motor"} and lost["right motor"].startswith("the raw attribute `gear`:")
    assert sum(path == "hip_l" for path, _ in robot.losses("mjlab")) == 2 and not robot.losses("isaaclab")


def test_names_in_mjlab_are_those_of_pymjcf(tmp_path: Path, shared_store: str, written: dict[str, Written]) -> None:
    files = {"arm.yaml": ARM.replace("joints:\n", PULLEY + "joints:\n", 1), "robot.yaml": PAIR}
    robot = Written(tmp_path, shared_store, files, ("pymjcf",))
    texts = [(one.folder / "mjlab" / "pair_stand.py").read_text() for one in (robot, written["pair"])]
    assert texts[0] == texts[1] and r'"right\\.2": ' in texts[0]


def test_modules_are_formatted(written: dict[str, Written]) -> None:
    folders = [str(robot.folder / target) for robot in written.values() for target in TARGETS]
    ruff = [sys.executable, "-m", "ruff"]
    subprocess.run([*ruff, "format", "--isolated", "--check", *folders], check=True)
    subprocess.run([*ruff, "check", "--isolated", "--select", "E,F,I,UP,B", "--ignore", "E501", *folders], check=True)


def test_targets_are_entry_points(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    every = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["entry-points"]["thingc.emitters"]
    declared = {name: value for name, value in every.items() if value.startswith("thingc.tools.learners:")}
    assert set(declared) == set(TARGETS)
    info = tmp_path / "learners-1.0.dist-info"
    info.mkdir()
    lines = [f"{name} = {value}" for name, value in declared.items()]
    info.joinpath("entry_points.txt").write_text("\n".join(["[thingc.emitters]", *lines, ""]))
    monkeypatch.syspath_prepend(tmp_path)
    assert set(TARGETS) <= {*targets()} and not set(TARGETS) & {*parse_targets([])} and set(TARGETS) <= {*parse_targets(["all"])}
    for name in TARGETS:
        assert emitter(name) is getattr(learners, f"emit_{name}")
    names = "{'pydantic', 'numpy', 'mujoco'} & {*sys.modules}"
    loaded = f"import sys, thingc.targets.registry as r; r.parse_targets([]); print(*({names}))"
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    said = subprocess.run([sys.executable, "-c", loaded], env=environment, check=True, capture_output=True, text=True).stdout
    assert said.strip() == "", "a build that changes nothing imports these packages"


@pytest.mark.parametrize("package", SIGNATURES)
def test_recorded_signatures_are_those_of_the_package(package: str) -> None:
    pytest.importorskip(package, reason=f"{package} is not installed: pip install {package}=={SIGNATURES[package]['version']}")
    import dataclasses

    for path, recorded in SIGNATURES[package]["classes"].items():
        words = path.split(".")
        depth = next(index for index, word in enumerate(words) if word[:1].isupper())
        one = importlib.import_module(".".join(words[:depth]))
        for word in words[depth:]:
            one = getattr(one, word)
        assert {field.name for field in dataclasses.fields(one)} >= set(recorded)


def test_isaac_lab_reads_the_configuration(written: dict[str, Written]) -> None:
    pytest.importorskip("isaaclab.assets", reason="isaaclab is not installed: pip install isaaclab")
    for robot in written.values():
        for mode in robot.modes:
            config = getattr(robot.module("isaaclab", mode), f"{robot.name.upper()}_CFG")
            config.replace(prim_path="/World/Robot").validate()
            assert config.init_state.joint_vel == {".*": 0.0}


@pytest.mark.parametrize(("name", "mode"), [("dog", "walk"), ("dog", "rig"), ("dog", "stuck"), ("pair", "stand"), ("pair", "hang")])
def test_mjlab_builds_the_entity(written: dict[str, Written], name: str, mode: str) -> None:
    pytest.importorskip("mjlab", reason="mjlab is not installed: pip install mjlab")
    robot = written[name]
    config, (model, started) = getattr(robot.module("mjlab", mode), f"{name.upper()}_CFG"), robot.started(mode)
    entity = config.build()
    names = [model.joint(k).name for k in range(model.njnt) if model.jnt_type[k] != mujoco.mjtJoint.mjJNT_FREE]
    assert list(entity.joint_names) == [name.replace("/", ".") for name in names]
    made = entity.compile()
    lost = {loss.path for loss in robot.made["mjlab"].losses if loss.mode == mode}
    sensors = [model.sensor(k).name.replace("/", ".") for k in range(model.nsensor)]
    assert [made.sensor(k).name for k in range(made.nsensor)] == [name for name in sensors if name.partition(":")[0] not in lost]
    for name in names:
        one, other = made.joint(name.replace("/", ".")), model.joint(name)
        for field in ("range", "armature", "frictionloss", "damping"):
            np.testing.assert_allclose(getattr(one, field), getattr(other, field))
        pairs = [
            [k for k in range(m.nu) if m.actuator_trnid[k, 0] == joint.id and m.actuator_trntype[k] == 0]
            for m, joint in ((made, one), (model, other))
        ]
        assert len(pairs[0]) == len(pairs[1])
        for left, right in zip(*pairs, strict=True):
            for field in ("gainprm", "biasprm", "forcerange", "gear"):
                np.testing.assert_allclose(getattr(made.actuator(left), field), getattr(model.actuator(right), field))
    np.testing.assert_allclose(made.key("init_state").qpos, started.qpos, atol=1e-12)
