"""Robots for tests of mode switches: random trees through `link`, `root` and the emitters, their MuJoCo models, and readings from
MuJoCo."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass

import mujoco
import numpy as np
import pytest
from msgspec.structs import replace

from graph.builder import (
    Array,
    assembly,
    attach,
    box,
    component,
    joint,
    linked,
    mimic,
    mode,
    ref,
    rx,
    ry,
    rz,
    t,
    whole,
)
from thingc.base.diagnostics import Code, Report
from thingc.geometry.store.local import Store
from thingc.model.assembly.types import Assembly
from thingc.model.robot.kinematic_tree import root
from thingc.modes import Modes
from thingc.modes.state import RobotState
from thingc.modes.tree import Mode
from thingc.targets import modes_json
from thingc.targets.mjcf import emit as mjcf
from thingc.targets.request import EmitRequest

BASES = ("free", "held", "fixed")


@dataclass
class Made:
    """A built robot: `modes.json` and one model per mode."""

    modes: Modes
    xml: dict[str, str]
    models: dict[str, mujoco.MjModel]
    described: bytes

    def data(self, name: str) -> mujoco.MjData:
        return mujoco.MjData(self.models[name])


def emitted(found: Assembly) -> Made:
    """Emit every mode of an assembly and load the MuJoCo models."""
    report = Report()
    robots = tuple(robot for m in found.modes if (robot := root(found, m, report)) is not None)
    with tempfile.TemporaryDirectory() as folder:
        request = EmitRequest(
            assembly=found, robots=robots, store=Store(folder), report=report, geometry=None, workspace=None,  # type: ignore[arg-type]
        )
        files = mjcf.emit(request).files
        described = modes_json.emit(request).files["modes.json"]
    assert [said.message for said in report.diagnostics] == [] and isinstance(described, bytes)
    xml = {robot.mode.name: files[f"mjcf/{found.name}_{robot.mode.name}.xml"].decode() for robot in robots}  # type: ignore[union-attr]
    models = {name: mujoco.MjModel.from_xml_string(text) for name, text in xml.items()}
    return Made(modes=Modes.parse(described), xml=xml, models=models, described=described)


def frame(rng: np.random.Generator) -> Array:
    """A random frame within 0.2 m with a random orientation."""
    roll, pitch, yaw = rng.uniform(-3, 3, 3)
    return t(*rng.uniform(-0.2, 0.2, 3)) @ rz(yaw) @ ry(pitch) @ rx(roll)


def random_robot(seed: int, *, mimics: bool = False) -> Made:
    """A tree of two to seven boxes on hinges, slides and rigid mates, rooted at up to three of them with every kind of base.

    Modes are named `free_0`, `held_0`, `fixed_0`, ... With `mimics`, some joints mimic others."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 8))
    records, components, joints = [], [], []
    for k in range(count):
        mounts = {"a": frame(rng), "b": frame(rng)}
        centre = tuple(rng.uniform(-0.05, 0.05, 3))
        records.append(box(f"p:B{k}", tuple(rng.uniform(0.02, 0.2, 3)), centre=centre, mounts=mounts))  # type: ignore[arg-type]
        kind = "revolute" if k == 1 else str(rng.choice(["revolute", "continuous", "prismatic", "attach"]))
        if k and kind != "attach":
            leaders = [j.name for j in joints if j.mimic is None]
            follows = mimics and leaders and rng.random() < 0.7
            higher = (float(rng.uniform(-0.5, 0.5)), 0.1)
            follow = mimic(str(rng.choice(leaders)), float(rng.uniform(-2, 2)), 0.1, higher) if follows else None
            joints.append(joint(
                f"j{k}", f"c{rng.integers(0, k)}.a", f"c{k}.b", kind, turn=float(rng.uniform(-1, 1)),
                gap=float(rng.uniform(-0.1, 0.1)), offset=float(rng.uniform(-0.5, 0.5)), lower=-12, upper=12, mimic=follow,
                armature=float(rng.choice([0.0, 0.01])),
            ))
        placement = attach(f"c{k}.b", f"c{rng.integers(0, k)}.a") if k and kind == "attach" else None
        components.append(component(f"c{k}", f"p:B{k}", placement))
    roots = sorted({0, count - 1, int(rng.integers(0, count))})
    where = {k: frame(rng) for k in roots}
    modes = [mode(f"{base}_{k}", whole(f"c{k}") if k % 2 else ref(f"c{k}.a"), base, at=where[k]) for k in roots for base in BASES]
    return emitted(linked(assembly("tree", components, joints, modes=modes), *records, but={Code.FAR}))  # no joint is to meet its stops


def driven(found: Assembly, **actuators: tuple[str, ...]) -> Assembly:
    """The same assembly with only these drives in the named modes."""
    return replace(found, modes=tuple(
        replace(m, actuators=actuators[m.name]) if m.name in actuators else m for m in found.modes
    ))


# --- MuJoCo asked ------------------------------------------------------------------------------------------------------


def stir(rng: np.random.Generator, data: mujoco.MjData, *, moving: bool = True) -> mujoco.MjData:
    """Set random positions and velocities of joints and base (a base that is not free does not move), and call `mj_forward`."""
    model = data.model
    data.qpos[:] = rng.uniform(-2, 2, model.nq)
    data.qvel[:] = rng.normal(size=model.nv) if moving else 0.0
    if model.nmocap:
        data.mocap_pos[:] = rng.normal(size=(1, 3))
        data.mocap_quat[:] = rng.normal(size=(1, 4))
    mujoco.mj_forward(model, data)
    return data


def bodies(data: mujoco.MjData) -> dict[str, tuple[Array, Array]]:
    """World pose (4, 4) and velocity (6,) of each link's frame by MuJoCo: linear, angular, in world axes. Anchors of holds are not
    links."""
    model = data.model
    mujoco.mj_forward(model, data)
    found = {}
    for number in range(1, model.nbody):
        if model.body(number).name.endswith(":held"):
            continue
        X = np.eye(4)
        X[:3, :3], X[:3, 3] = data.xmat[number].reshape(3, 3), data.xpos[number]
        velocity = np.zeros(6)
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, number, velocity, 0)
        found[model.body(number).name] = X, np.concatenate([velocity[3:], velocity[:3]])
    return found


def assert_said(mode: Mode, state: RobotState, data: mujoco.MjData) -> None:
    """Assert that poses and twists of `thingc.modes` equal those of MuJoCo.

    Twists are linear in world axes and angular in the link's own axes. Massless links between joints do not exist in MuJoCo."""
    twists, found = mode.twists(state), bodies(data)
    assert {link.name for link in mode.links if link.mass} <= found.keys()
    for link, X in mode.poses(state).items():
        if link not in found:
            continue
        own, velocity = found[link]
        assert np.abs(own - X).max() < 1e-12
        assert np.concatenate([velocity[:3], X[:3, :3].T @ velocity[3:]]) == pytest.approx(twists[link], abs=1e-12)


def joints_of(data: mujoco.MjData) -> dict[str, tuple[float, float]]:
    """(q, v) of every hinge and slide."""
    model = data.model
    return {
        model.joint(k).name: (data.qpos[model.jnt_qposadr[k]], data.qvel[model.jnt_dofadr[k]])
        for k in range(model.njnt) if model.jnt_type[k] != mujoco.mjtJoint.mjJNT_FREE
    }


def same_motion(one: mujoco.MjData, other: mujoco.MjData) -> None:
    """Assert that all bodies have equal poses and velocities, and that joint values are bit-identical."""
    before, after = bodies(one), bodies(other)
    assert before.keys() == after.keys()
    for name, (X, velocity) in before.items():
        np.testing.assert_allclose(after[name][0], X, rtol=0, atol=1e-12, err_msg=name)
        np.testing.assert_allclose(after[name][1], velocity, rtol=0, atol=1e-12, err_msg=name)
    assert joints_of(one) == joints_of(other)


def mass_matrix(data: mujoco.MjData) -> Array:
    """The mass matrix by MuJoCo."""
    model = data.model
    mujoco.mj_forward(model, data)
    found = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, found)
    return found


def jacobian(data: mujoco.MjData, body: str) -> Array:
    """Jacobian (6, nv) of a body's frame by MuJoCo: linear over angular, in world axes."""
    found = np.zeros((6, data.model.nv))
    mujoco.mj_jacBody(data.model, data, found[:3], found[3:], data.model.body(body).id)
    return found
