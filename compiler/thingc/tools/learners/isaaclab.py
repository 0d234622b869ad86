"""Write `isaaclab/NAME_MODE.py`, which configures the robot for Isaac Lab: an `ArticulationCfg` that refers to the USD file of the mode.

Gains, limits and armatures are in SI units, which Isaac Lab requires. In the USD file, gains are per degree.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from thingc.model.resolve.coordinates import CoordinateName
from thingc.model.robot.kinematics import body_poses
from thingc.model.robot.types import Robot, TreeJoint
from thingc.targets import Artifacts, EmitRequest, Loss
from thingc.targets.name_mangling import safe
from thingc.targets.usd.stage import articulation_roots
from thingc.tools.learners.driven_joints import DrivenJoint, by_pattern, driven_joints, losses, moving, start
from thingc.tools.learners.python_text import PythonCall, PythonExpression, assignment, constant, file_name, module

MOTIONS = frozenset({"single"})
"""The types of motion of joints that Isaac Lab supports: hinges and slides."""


def emit(request: EmitRequest) -> Artifacts:
    """Write a module for each chosen mode."""
    found_losses: dict[Loss, None] = {}
    for robot in request.robots:
        found_losses |= dict.fromkeys(losses(robot, "isaaclab", "Isaac Lab", MOTIONS))
        if robot.base in ("planar", "ball"):
            what = f"the {robot.base} base: not part of the articulation"
            found_losses[Loss("isaaclab", robot.mode.name, robot.mode.name, what, "omitted", robot.mode.origin)] = None
    return Artifacts(files={f"isaaclab/{file_name(robot)}.py": _module(robot) for robot in request.robots}, losses=tuple(found_losses))


def usd_name(joint: TreeJoint) -> str:
    """Return the name of a joint with one coordinate in the USD file. Custom names of the document do not apply to USD files."""
    return safe(CoordinateName(joint.name).path)


def _module(robot: Robot) -> bytes:
    drives = driven_joints(robot, usd_name, MOTIONS)
    positions = {usd_name(joint): start(robot, joint) for joint in moving(robot, MOTIONS)}
    complete = len(positions) == sum(len(body.joints) for body in robot.bodies)
    actuators = {
        kind: _actuator([drive for drive in drives if drive.drive.kind == kind], len(positions) if complete else None)
        for kind in dict.fromkeys(drive.drive.kind for drive in drives)
    }
    config = PythonCall("ArticulationCfg", {
        "spawn": PythonCall("sim_utils.UsdFileCfg", {"usd_path": PythonExpression("str(USD)")}),
        "init_state": PythonCall("ArticulationCfg.InitialStateCfg", {
            **_base(robot), "joint_pos": by_pattern(positions, complete=complete), "joint_vel": {".*": 0.0},
        }),
        "actuators": actuators,
    })
    file = f'Path(__file__).resolve().parents[1] / "usd" / "{robot.assembly.name}_{robot.mode.name}.usda"'
    imports = [
        "import isaaclab.sim as sim_utils", *(["from isaaclab.actuators import ImplicitActuatorCfg"] if drives else []),
        "from isaaclab.assets import ArticulationCfg",
    ]
    return module(
        robot, "Isaac Lab", ["from pathlib import Path", "\n".join(imports)],
        [assignment("USD", PythonExpression(file)), assignment(constant(robot), config)],
    )


def _base(robot: Robot) -> Mapping[str, object]:
    """Return the initial pose of the articulation if its root floats, with the quaternion x, y, z, w of Isaac Lab 3.

    The root of the articulation differs from the root of the mode if the latter is an object without joints. The USD file places a root
    that does not float.
    """
    root = articulation_roots(robot)[0]
    if robot.bodies[root].parent is None and robot.base != "free":
        return {}
    pose = body_poses(robot, robot.start.q, robot.start.base)[root]
    w, x, y, z = pose.quaternion()
    return {"pos": pose.translation, "rot": (x, y, z, w)}


def _actuator(drives: Sequence[DrivenJoint], joints: int | None) -> PythonCall:
    """Return the configuration of the drives of one kind. A value that differs between joints is a dictionary.

    If there are drives for all `joints`, a pattern takes the place of their names. Values that are missing are those of the USD file.
    """
    names = [re.escape(drive.name) for drive in drives]
    position, motor = drives[0].drive.kind == "position", drives[0].drive.kind == "motor"
    columns: dict[str, list[float | None]] = {
        "effort_limit_sim": [drive.effort for drive in drives], "velocity_limit_sim": [drive.velocity for drive in drives],
        "stiffness": [drive.drive.kp or 0.0 if position else 0.0 for drive in drives],
        "damping": [0.0 if motor else drive.drive.kv or 0.0 for drive in drives],
        "armature": [drive.joint.dynamics.armature for drive in drives],
    }
    values = {key: _value(dict(zip(names, column, strict=True))) for key, column in columns.items()}
    return PythonCall("ImplicitActuatorCfg", {"joint_names_expr": [".*"] if len(names) == joints else names, **values})


def _value(values: Mapping[str, float | None]) -> object:
    """Return one number if all joints have it, a dictionary if numbers differ, or None if there are no numbers."""
    return next(iter(values.values())) if len({*values.values()}) == 1 else {name: one for name, one in values.items() if one is not None}
