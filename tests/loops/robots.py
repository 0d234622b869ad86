"""Robots with loops as documents (frames with masses, so nothing is modelled), and helpers for their MuJoCo models.

`Inchworm` is a chain of six joints between two soles. Its forward kinematics are written out in numpy from the numbers of the document
and the formulas of the semantics, as the oracle for the compiler."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from thingc.driver import pipeline
from thingc.driver.environment import Environment, Options
from thingc.driver.pipeline import Compilation
from thingc.model.robot.types import Robot
from thingc.targets.artifact import Artifacts, Loss

Array = Any
BALL = "inertia: {ixx: 1e-4 kg*m^2, iyy: 2e-4 kg*m^2, izz: 1.5e-4 kg*m^2}"
MATE = np.array([[0, -1, 0, 0], [-1, 0, 0, 0], [0, 0, -1, 0], [0, 0, 0, 1]], dtype=float)


@dataclass(frozen=True)
class Built:
    """A compiled document and its artifacts."""

    compilation: Compilation
    artifacts: Artifacts | None

    @property
    def said(self) -> list[tuple[str, str, str | None, int | None]]:
        """Code, message, help and line of every diagnostic."""
        return [
            (d.code.code, d.message, d.help, d.span.line if d.span else None) for d in self.compilation.report.sorted_diagnostics()
        ]

    def robot(self, mode: str) -> Robot:
        return next(robot for robot in self.compilation.robots if robot.mode.name == mode)

    def text(self, path: str) -> str:
        assert self.artifacts is not None, self.said
        content = self.artifacts.files[path]
        assert isinstance(content, bytes)
        return content.decode()

    def model(self, mode: str) -> mujoco.MjModel:
        assert self.compilation.assembly is not None
        return mujoco.MjModel.from_xml_string(self.text(f"mjcf/{self.compilation.assembly.name}_{mode}.xml"))

    def scene(self, mode: str) -> mujoco.MjModel:
        """The model with its floor."""
        assert self.compilation.assembly is not None
        name = f"{self.compilation.assembly.name}_{mode}.xml"
        return mujoco.MjModel.from_xml_string(self.text(f"mjcf/scene_{mode}.xml"), {name: self.text(f"mjcf/{name}").encode()})

    @property
    def modes(self) -> dict[str, Any]:
        found: dict[str, Any] = json.loads(self.text("modes.json"))
        return found

    def losses(self, mode: str | None) -> list[Loss]:
        assert self.artifacts is not None, self.said
        return [loss for loss in self.artifacts.losses if loss.mode == mode]


def compiled(folder: Path, documents: dict[str, str] | str) -> Built:
    """Run every pass on the first of the documents."""
    files = {"robot.yaml": documents} if isinstance(documents, str) else documents
    folder.joinpath("thingc.toml").write_text('thingc = "workspace/1"\n')
    for name, text in files.items():
        folder.joinpath(name).write_text(text)
    with Environment(str(folder / next(iter(files))), Options(store=str(folder / "store"))) as environment:
        compilation = pipeline.compile(environment)
        return Built(compilation, None if compilation.report.failed else pipeline.build(environment, compilation, ["mjcf"])["mjcf"])


def at_key(model: mujoco.MjModel, name: str) -> mujoco.MjData:
    """The state of a keyframe after `mj_forward`."""
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key(name).id)
    mujoco.mj_forward(model, data)
    return data


def equality_residual(data: mujoco.MjData) -> float:
    """Largest violation [m or rad] of MuJoCo's equalities."""
    rows = data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
    return float(np.abs(data.efc_pos[rows]).max(initial=0.0))


def pose_of(thing: Any) -> Array:
    """Pose of a body or site of `MjData` as a matrix."""
    found = np.eye(4)
    found[:3, :3], found[:3, 3] = thing.xmat.reshape(3, 3), thing.xpos
    return found


# --- matrices --------------------------------------------------------------------------------------------------------


def shift(x: float, y: float, z: float) -> Array:
    found = np.eye(4)
    found[:3, 3] = (x, y, z)
    return found


def turn(axis: str, angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    rows = {
        "x": [[1, 0, 0], [0, c, -s], [0, s, c]],
        "y": [[c, 0, s], [0, 1, 0], [-s, 0, c]],
        "z": [[c, -s, 0], [s, c, 0], [0, 0, 1]],
    }
    found = np.eye(4)
    found[:3, :3] = rows[axis]
    return found


def placed(xyz: tuple[float, float, float], rpy: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Array:
    """Extrinsic roll, pitch, yaw."""
    return shift(*xyz) @ turn("z", rpy[2]) @ turn("y", rpy[1]) @ turn("x", rpy[0])


def mated(X_PA: Array, X_CB: Array, q: float) -> Array:
    """X_PC of a revolute joint: X_PA Rz(q) M inv(X_CB)."""
    return X_PA @ turn("z", q) @ MATE @ np.linalg.inv(X_CB)


def apart(one: Array, other: Array) -> tuple[float, float]:
    """Distance [m] and angle [rad] between two frames. The angle is computed from the sine, which is accurate near 0."""
    r = one[:3, :3].T @ other[:3, :3]
    sine = np.linalg.norm([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]]) / 2.0
    return float(np.linalg.norm(one[:3, 3] - other[:3, 3])), float(np.arctan2(sine, (np.trace(r) - 1.0) / 2.0))


# --- the inchworm ----------------------------------------------------------------------------------------------------

NAMES = ("front", "shin_f", "thigh_f", "body", "thigh_r", "shin_r", "rear")
JOINTS = ("ankle_f", "knee_f", "hip_f", "hip_r", "knee_r", "ankle_r")
LENGTHS = (0.03, 0.06, 0.09, 0.12, 0.09, 0.06, 0.03)
AXES = ("x", "y", "y", "z", "y", "x")
"""Link axis about which each joint turns. The z axes of its mounts are along it."""
LIMIT = np.radians(110.0)
HOME = dict(zip(JOINTS, np.radians([5.0, 75.0, -60.0, 20.0, 55.0, -8.0]).tolist()))
"""An arch in which both soles face down."""


def _face(axis: str, *, out: bool) -> tuple[str, Array]:
    """Roll, pitch and yaw of a mount whose z is along an axis of its link, or against it for the child."""
    r, p, y = {
        ("x", True): (0, 90, 0), ("x", False): (0, -90, 0), ("y", True): (-90, 0, 0), ("y", False): (90, 0, 0),
        ("z", True): (0, 0, 0), ("z", False): (180, 0, 0),
    }[axis, out]
    return f"{r} {p} {y} deg", placed((0, 0, 0), (np.radians(r), np.radians(p), np.radians(y)))


def inchworm(*, modes: str, poses: str = "", more: str = "", limits: str = "-110 deg, upper: 110 deg") -> str:
    """The document. Links are along x; each has `low` at its origin and `high` at its far end, with z along the joint axis."""
    lines = ["thingc: assembly/1", "name: worm", "components:"]
    for k, (name, length) in enumerate(zip(NAMES, LENGTHS)):
        mounts = []
        if k > 0:
            mounts.append(f"low: {{rpy: {_face(AXES[k - 1], out=False)[0]}}}")
        if k < len(JOINTS):
            mounts.append(f"high: {{xyz: {length} 0 0 m, rpy: {_face(AXES[k], out=True)[0]}}}")
        if name == "front":
            mounts.append("sole: {rpy: 0 -90 0 deg}")
        if name == "rear":
            mounts.append(f"sole: {{xyz: {length} 0 0 m, rpy: 0 90 0 deg}}")
        centre = f"com: [{length / 2} m, 2 mm, -1 mm]"
        lines.append(f"  {name}: {{frame: true, mass: {0.1 + 0.02 * k} kg, {centre}, {BALL}, mounts: {{{', '.join(mounts)}}}}}")
    lines.append("joints:")
    for k, joint in enumerate(JOINTS):
        drive = "" if joint == "hip_r" else ", drive: {kind: position, kp: 50 N*m/rad, effort: 20 N*m}"
        lines.append(
            f"  {joint}: {{type: revolute, parent: {NAMES[k]}.high, child: {NAMES[k + 1]}.low, "
            f"limit: {{lower: {limits}}}, dynamics: {{damping: 0.05 N*m*s/rad}}{drive}}}"
        )
    home = ", ".join(f"{joint}: {q!r} rad" for joint, q in HOME.items())
    lines += ["poses:", f"  arched: {{{home}}}"]
    return "\n".join(lines) + "\n" + poses + "modes:\n" + modes + more


def worm_links(q: dict[str, float], X_front: Array) -> dict[str, Array]:
    """Poses of all links with `front` at `X_front`, by a chain of matrices."""
    found = {"front": X_front}
    for k, joint in enumerate(JOINTS):
        A = shift(LENGTHS[k], 0, 0) @ _face(AXES[k], out=True)[1]
        B = _face(AXES[k], out=False)[1]
        found[NAMES[k + 1]] = found[NAMES[k]] @ mated(A, B, q[joint])
    return found


FRONT_SOLE = placed((0, 0, 0), (0, -np.pi / 2, 0))
REAR_SOLE = placed((LENGTHS[-1], 0, 0), (0, np.pi / 2, 0))
X_FRONT = MATE @ np.linalg.inv(FRONT_SOLE)
"""Pose of the front link in the world with its sole on the world frame."""


def rear_sole(q: dict[str, float]) -> Array:
    """Pose of the rear sole in the world with the robot standing on the front one."""
    return worm_links(q, X_FRONT)["rear"] @ REAR_SOLE
