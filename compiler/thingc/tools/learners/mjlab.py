"""Write `mjlab/NAME_MODE.py`, which configures the robot for mjlab: an `EntityCfg` that refers to the MuJoCo model of the mode.

mjlab adds the actuators of the configuration to the model. Therefore, the module removes the corresponding actuators of the file.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from thingc.model.robot.types import Robot
from thingc.targets import Artifacts, EmitRequest, Loss
from thingc.targets.mjcf.compat.pymjcf import SEPARATOR
from thingc.targets.mjcf.drives import delay_steps, time_step
from thingc.targets.mjcf.emit import model_trees
from thingc.targets.mjcf.lowering import mujoco_joints
from thingc.targets.xml_writer import Element
from thingc.tools.learners.driven_joints import DrivenJoint, by_pattern, driven_joints, losses, moving, start
from thingc.tools.learners.python_text import PythonCall, PythonExpression, assignment, constant, file_name, import_line, module

MOTIONS = frozenset({"single", "several", "universal", "screw"})
"""The types of motion of joints that mjlab supports. mjlab requires one position for each MuJoCo joint, and a ball joint has four."""

UNLIMITED = 'float("inf")'

CLASSES = {"position": "BuiltinPositionActuatorCfg", "velocity": "BuiltinVelocityActuatorCfg", "motor": "BuiltinMotorActuatorCfg"}

GET_SPEC = '''
def get_spec() -> mujoco.MjSpec:
    """Return the model without keyframes and the drives of `ACTUATORS`.

    mjlab adds these drives with the names of their joints. In names, `.` replaces
    `/`, because mjlab ignores the part of a name before the last `/`.
    """
    root = ElementTree.parse(XML).getroot()
    for element in root.iter():
        for name, value in element.attrib.items():
            if name not in ("file", "meshdir"):
                element.set(name, value.replace("/", "."))
    spec = mujoco.MjSpec.from_string(ElementTree.tostring(root, encoding="unicode"))
    spec.meshdir = str(XML.parent / "assets")
    for sensor in spec.sensors:
        if sensor.objtype == mujoco.mjtObj.mjOBJ_ACTUATOR:
            sensor.objname = DRIVES.get(sensor.objname, sensor.objname)
    for actuator in [one for one in spec.actuators if one.name in DRIVES]:
        spec.delete(actuator)
    for key in list(spec.keys):
        spec.delete(key)
    return spec
'''


def emit(request: EmitRequest) -> Artifacts:
    """Write a module for each chosen mode."""
    robots = [*zip(request.robots, model_trees(request), strict=True)]
    lost = (loss for robot, root in robots for loss in (*losses(robot, "mjlab", "mjlab", MOTIONS, delays=True), *_lost_values(robot, root)))
    return Artifacts(files={f"mjlab/{file_name(robot)}.py": _module(robot) for robot, _ in robots}, losses=tuple(dict.fromkeys(lost)))


def mjlab_name(path: str) -> str:
    """Return the name of an element in mjlab, in which `.` replaces `/`. Names in documents do not contain this character."""
    return path.replace("/", SEPARATOR)


def _lost_values(robot: Robot, root: Element) -> Iterator[Loss]:
    """Yield an export loss for each raw attribute of a drive or a driven joint in the model `root` that the configuration replaces. Also
    yield a loss for each sensor of a drive, if mjlab attaches the model to a body that places its base.
    """
    drives = driven_joints(robot, lambda joint: mjlab_name(joint.path), MOTIONS)
    names = {("joint", one.name) for one in drives} | {(one.drive.kind, mjlab_name(one.drive.name or one.joint.path)) for one in drives}
    for element in (*root.find_or_empty("worldbody").walk(), *root.find_or_empty("actuator").children):
        name = element.get("name")
        for key, raw in element.raw.items() if (element.tag, mjlab_name(name)) in names else ():
            if element.tag != "joint" or key in ("armature", "frictionloss"):
                yield Loss("mjlab", None, name, f"the raw attribute `{key}`: mjlab adds the drive later", "omitted", raw.attribute.origin)
    for sensor in robot.assembly.sensors:
        if sensor.kind == "drive" and sensor.joint in robot.present and robot.base not in ("free", "held"):
            yield Loss("mjlab", robot.mode.name, sensor.path, "the sensor: mjlab adds the drive later", "omitted", sensor.origin)


def _module(robot: Robot) -> bytes:
    drives = driven_joints(robot, lambda joint: mjlab_name(joint.path), MOTIONS)
    positions = {mjlab_name(one.name): one.ratio * start(robot, joint) for joint in moving(robot, MOTIONS) for one in mujoco_joints(joint)}
    complete = not robot.moves and len(moving(robot, MOTIONS)) == sum(len(body.joints) for body in robot.bodies)
    classes = sorted({CLASSES[drive.drive.kind] for drive in drives})
    imports = [
        "import mujoco", *([import_line("mjlab.actuator", classes)] if classes else []),
        import_line("mjlab.entity", ["EntityArticulationInfoCfg", "EntityCfg"]),
    ]
    config = PythonCall("EntityCfg", {
        "init_state": PythonCall("EntityCfg.InitialStateCfg", {
            **_base(robot), "joint_pos": by_pattern(positions, complete=complete), "joint_vel": {".*": 0.0},
        }),
        "spec_fn": PythonExpression("get_spec"),
        "articulation": PythonCall("EntityArticulationInfoCfg", {"actuators": PythonExpression("ACTUATORS")}),
    })
    file = f'Path(__file__).resolve().parents[1] / "mjcf" / "{robot.assembly.name}_{robot.mode.name}.xml"'
    names = {mjlab_name(one.drive.name or one.joint.path): one.name for one in drives}
    return module(
        robot, "mjlab", ["from pathlib import Path\nfrom xml.etree import ElementTree", "\n".join(imports)],
        [
            f"{assignment('XML', PythonExpression(file))}\n{assignment('DRIVES', names)}", GET_SPEC,
            assignment("ACTUATORS", tuple(_actuators(drives, time_step(robot)))), assignment(constant(robot), config),
        ],
    )


def _base(robot: Robot) -> Mapping[str, object]:
    """Return the initial pose of a base that mjlab places, with the quaternion w, x, y, z. Any other base has the pose of the model."""
    if robot.base not in ("free", "held"):
        return {}
    pose = robot.start.base or robot.bodies[0].X_PL
    return {"pos": pose.translation, "rot": pose.quaternion()}


def _actuators(drives: list[DrivenJoint], step: float) -> Iterator[PythonCall]:
    """Yield the configurations of the drives. Drives with equal values have one configuration. Delays are multiples of the time step."""
    groups: dict[tuple[str, tuple[tuple[str, object], ...]], list[str]] = {}
    for one in drives:
        kp, kv, dynamics = one.drive.kp, one.drive.kv, one.joint.dynamics
        gains: dict[str, dict[str, object]] = {  # MuJoCo's default is 1 for the gain of the control, and 0 for the other gain
            "position": {"stiffness": 1.0 if kp is None else kp, "damping": kv or 0.0}, "velocity": {"damping": 1.0 if kv is None else kv},
        }
        unlimited = PythonExpression(UNLIMITED) if one.drive.kind == "motor" else None
        own = {**gains.get(one.drive.kind, {}), "effort_limit": unlimited if one.effort is None else one.effort}
        own |= {"armature": dynamics.armature or 0.0, "frictionloss": dynamics.friction or 0.0}
        if one.drive.delay:
            own |= dict.fromkeys(("delay_min_lag", "delay_max_lag"), delay_steps(one.drive.delay, step))
        groups.setdefault((CLASSES[one.drive.kind], tuple(own.items())), []).append(re.escape(one.name))
    for (function, values), names in groups.items():
        yield PythonCall(function, {"target_names_expr": tuple(names), **dict(values)})
