"""Write `joint_order.json`, which lists the joints, actuators and sensors of each mode in the order of each format.

A simulator or a controller passes positions and commands as arrays. The file contains the order of the arrays in the document, in MuJoCo,
in Isaac Sim (PhysX) and in ROS, and the indices that convert arrays from one order to another.

    MuJoCo          depth-first, as in the model; a free base is a joint
    Isaac           Isaac Sim visits links breadth-first, and the children of a link in the order of the joints in the USD file. The base is
                    not part of the order. A joint with several rotations has the entries `NAME:0` (about x), `NAME:1` and `NAME:2`
    URDF            the order in the file, where mimic joints come last
    joint_states    `joint_state_broadcaster` sorts the joints of the URDF by name
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import accumulate
from operator import itemgetter

from thingc.model.assembly.kinematics import joints_of
from thingc.model.assembly.types import JointEdge
from thingc.model.resolve.coordinates import CoordinateName
from thingc.model.robot.types import Robot, TreeJoint
from thingc.targets import json_writer
from thingc.targets.connections import connections
from thingc.targets.custom_names import apply_custom_names
from thingc.targets.mjcf.compat import separator
from thingc.targets.mjcf.emit import model_trees
from thingc.targets.mjcf.lowering import mujoco_joints
from thingc.targets.name_mangling import safe
from thingc.targets.request import EmitRequest
from thingc.targets.ros.control import Controller, controllers
from thingc.targets.ros.joints import joints as urdf_joints
from thingc.targets.usd.capabilities import CAPABILITIES
from thingc.targets.usd.chain import UsdJoint, chain
from thingc.targets.xml_writer import Element

Order = Sequence[tuple[str, str | None]]
"""The entries of an array: the name in the format, and the coordinate in the document whose q is the value of the entry.

The coordinate is None if no q is equal to the value, such as for the quaternion of a ball joint.
"""

WIDTHS = {"freejoint": (7, 6), "free": (7, 6), "ball": (4, 3)}
"""Number of entries of a MuJoCo joint in `qpos` and `qvel`, by type. Any other joint has one entry in both."""

SENSOR_SIZES: Mapping[str, int] = {
    **dict.fromkeys((
        "touch", "rangefinder", "jointpos", "jointvel", "tendonpos", "tendonvel", "actuatorpos", "actuatorvel", "actuatorfrc",
        "jointactuatorfrc", "tendonactuatorfrc", "jointlimitpos", "jointlimitvel", "jointlimitfrc", "tendonlimitpos", "tendonlimitvel",
        "tendonlimitfrc", "insidesite", "clock", "e_potential", "e_kinetic", "distance",
    ), 1),
    **dict.fromkeys((
        "accelerometer", "velocimeter", "gyro", "force", "torque", "magnetometer", "ballangvel", "framepos", "framexaxis", "frameyaxis",
        "framezaxis", "framelinvel", "frameangvel", "framelinacc", "frameangacc", "subtreecom", "subtreelinvel", "subtreeangmom", "normal",
    ), 3),
    "camprojection": 2, "ballquat": 4, "framequat": 4, "fromto": 6,
}
"""Number of entries of a MuJoCo sensor in `sensordata`, by element, for elements without settings that change this number."""

CONTACT_SIZE = 4
"""Number of entries of the contact sensors of documents: whether there is contact, and the force."""


def emit(request: EmitRequest) -> bytes:
    """Return the content of `joint_order.json`, for the chosen modes in the order of the document."""
    named = apply_custom_names(request)
    commands = controllers(named.robots)
    return json_writer.encode({
        robot.mode.name: describe(robot, root, separator(request.compat), commands[robot.mode.name])
        for robot, root in zip(named.robots, model_trees(named), strict=True)
    })


def describe(robot: Robot, root: Element, separator: str, commands: Sequence[Controller]) -> dict[str, object]:
    """Return the orders of one mode for JSON.

    `root` is the MJCF tree of the mode, whose names have the path separator `separator`. `commands` contains the ROS 2 controllers.
    """
    joints = [element for element in root.find_or_empty("worldbody").walk() if element.tag in ("joint", "freejoint")]
    widths = [WIDTHS.get(element.get("type", element.tag), (1, 1)) for element in joints]
    urdf, isaac = _urdf(robot), _isaac(robot)
    orders: dict[str, Order] = {
        "document": [(str(joint.name), str(joint.name)) for joint in joints_of(robot.assembly)],
        "mujoco": list(_mujoco(robot, joints, separator)),
        **({} if isaac is None else {"isaac": isaac}),
        "urdf": urdf,
        "joint_states": sorted(urdf, key=itemgetter(0)),
    }
    return {
        "joints": {name: [entry for entry, _ in order] for name, order in orders.items()},
        "indices": {
            name: {other: _indices(source, order) for other, order in orders.items() if other != name} for name, source in orders.items()
        },
        "addresses": {
            name: list(accumulate((width[column] for width in widths[:-1]), initial=0))[: len(widths)]
            for column, name in enumerate(("qpos", "qvel"))
        },
        "actuators": _actuators(root, joints, orders, commands),
        "sensors": _sensors(root.find_or_empty("sensor").children),
    }


def _key(joint: JointEdge) -> str:
    """Return the name of a coordinate in the document. A coordinate of a moving base, which is not in the document, has another key."""
    return f"base:{joint.path}" if isinstance(joint, TreeJoint) and joint.mate < 0 else str(joint.name)


def _indices(source: Order, order: Order) -> list[int | None]:
    """For each entry of `order`, return the index of the same coordinate in `source`, or None."""
    index_of = {key: index for index, (_, key) in enumerate(source) if key is not None}
    return [None if key is None else index_of.get(key) for _, key in order]


def _mujoco(robot: Robot, joints: Sequence[Element], separator: str) -> Iterator[tuple[str, str | None]]:
    """Yield the joints of a MuJoCo model. The slide of a screw and a ball joint do not have the value of a coordinate."""
    moving = [*robot.moves, *(joint for body in robot.bodies for joint in body.joints)]
    keys = {mujoco_joint.name.replace("/", separator): _key(joint) for joint in moving for mujoco_joint in mujoco_joints(joint)[:1]}
    for element in joints:
        yield element.get("name"), keys.get(element.get("name"))


def _isaac(robot: Robot) -> list[tuple[str, str | None]] | None:
    """Return the degrees of freedom of the articulation in PhysX.

    The positions of a joint with several rotations are not those of the document. Return None if a joint combines a translation with other
    coordinates, which PhysX does not support in an articulation. Custom names of the document do not apply to USD files.
    """
    children: dict[int | str, list[tuple[UsdJoint, int | str]]] = {}
    for connection in connections(robot, CAPABILITIES["loops"], closed=False):
        if connection.parent is not None:
            *intermediate, last = chain(connection)
            parent: int | str = connection.parent
            for step in intermediate:
                children.setdefault(parent, []).append((step, step.path))
                parent = step.path
            children.setdefault(parent, []).append((last, connection.child))
    order: list[tuple[str, str | None]] = []
    links: list[int | str] = [*sorted(link for link in children if isinstance(link, int))[:1]]  # a free object has no joints
    for link in links:
        for joint, child in children.get(link, ()):
            links.append(child)
            if joint.type == "Fixed":
                continue
            name = _usd_name(joint)
            if joint.single is not None:
                order.append((name, _key(joint.single)))
            elif joint.type == "Spherical":
                order += [(f"{name}:{axis}", None) for axis in range(3)]
            elif all(freedom.turns for freedom in joint.freedoms):
                order += [(f"{name}:{'XYZ'.index(freedom.name[-1])}", None) for freedom in joint.freedoms]
            else:
                return None
    return order


def _usd_name(joint: UsdJoint) -> str:
    """Return the name of a joint in USD files, from its name in the document."""
    name = CoordinateName(joint.freedoms[0].joint.name)
    return safe(name.path if joint.single is not None else name.joint.replace(".", "/"))


def _urdf(robot: Robot) -> list[tuple[str, str | None]]:
    """Return the movable joints of a URDF file. The slide of a screw and the rotations of a ball do not have the value of a coordinate."""
    moving = sorted(urdf_joints(robot), key=lambda joint: joint.follows)
    exact = [urdf_joint.move.thread is None and not urdf_joint.move.joint.kind.at_once for urdf_joint in moving]
    return [(joint.name, _key(joint.move.joint) if is_exact else None) for joint, is_exact in zip(moving, exact, strict=True)]


def _actuators(root: Element, joints: Sequence[Element], orders: Mapping[str, Order], commands: Sequence[Controller]) -> dict[str, object]:
    """Return the actuators of a MuJoCo model, which are the entries of `ctrl`, and the commands of the ROS 2 controllers.

    The key `joints` contains the index of the joint that an actuator moves. The index is None for a ball joint, a tendon or a magnet. For
    each command of a controller, `ctrl` contains the index of the actuator.
    """
    actuators = root.find_or_empty("actuator").children
    index_of = {element.get("name"): index for index, element in enumerate(joints) if element.get("type") != "ball"}
    moved_joints = [index_of.get(element.get("joint", element.get("jointinparent"))) for element in actuators]
    joint_of = dict(zip((name for name, _ in orders["urdf"]), _indices(orders["mujoco"], orders["urdf"]), strict=True))
    first: dict[int | None, int] = {joint: index for index, joint in reversed([*enumerate(moved_joints)]) if joint is not None}
    return {
        "mujoco": [element.get("name") for element in actuators],
        "joints": moved_joints,
        "ros": {c.name: {"joints": list(c.drives), "ctrl": [first.get(joint_of.get(name)) for name in c.drives]} for c in commands},
    }


def _sensors(sensors: Sequence[Element]) -> dict[str, object]:
    """Return the sensors of a MuJoCo model, with the first entry of each sensor in `sensordata` and the number of its entries.

    The number is None if a setting of a raw element determines it. The addresses of the following sensors are then also None.
    """
    sizes = [_size(sensor) for sensor in sensors]
    addresses: list[int | None] = [0]
    for size in sizes:
        addresses.append(None if size is None or addresses[-1] is None else addresses[-1] + size)
    return {"mujoco": [sensor.get("name") for sensor in sensors], "addresses": addresses[:-1], "sizes": sizes}


def _size(sensor: Element) -> int | None:
    if sensor.tag == "contact":
        return CONTACT_SIZE if (sensor.get("data"), sensor.get("num", "1")) == ("found force", "1") else None
    return None if "data" in sensor.attributes else SENSOR_SIZES.get(sensor.tag)
