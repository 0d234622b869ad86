"""Write `modes.json`, which contains the kinematic trees of all modes. Programs use this file to switch between modes at run time.

The file is sufficient to compute the forward kinematics of any mode at any q without MuJoCo. Let P be the parent link of a joint in the
document, C its child link, and J the frame of the parent mount. The pose of C in P depends on the coordinates q of the joint:

    X_PC(q) = X_PJ @ exp(twist_0 (q_0 + offset_0)) @ exp(twist_1 (q_1 + offset_1)) ... @ inv(X_CJ)

A twist describes the motion per unit of q. The twist rotates about the vector `angular` through the origin of J, and moves along the vector
`linear`. A ball joint has exponential coordinates: its factor is `exp(twist_0 q_0 + twist_1 q_1 + twist_2 q_2)`, and its q is a rotation
vector. A free joint has three translations, and then the factor of a ball joint. If C is the parent in the tree of the mode (`reversed`),
use the inverse of this pose. These values do not depend on the root of the mode.
"""

from __future__ import annotations

from collections.abc import Sequence

from thingc.base.inertia import MassProperties
from thingc.base.joints.twist import Twist
from thingc.base.memo import Memo
from thingc.base.pose import NO_POSE, Pose
from thingc.model.assembly.types import Mate
from thingc.model.resolve.coordinates import Mimic
from thingc.model.robot.tree import in_link
from thingc.model.robot.types import Closure, Robot, TreeJoint
from thingc.targets import json_writer
from thingc.targets.artifact import Artifacts
from thingc.targets.custom_names import apply_custom_names
from thingc.targets.json_writer import JsonFragment, fragment
from thingc.targets.mjcf import tendons
from thingc.targets.mjcf.closures import anchor_name
from thingc.targets.mjcf.compat import separator
from thingc.targets.mjcf.lowering import mujoco_joints, sizes
from thingc.targets.request import EmitRequest

VERSION = 2
"""Version of the format of a mode in the file. Readers reject a file with any other version."""

LISTED = 3
"""Nesting depth of a link or a joint in the JSON file. Links and joints are items of lists in the object of a mode."""

FREE = (7, 6)
"""Number of entries of a free base in `qpos` (position and quaternion) and in `qvel` (linear and angular velocity)."""


def emit(request: EmitRequest) -> Artifacts:
    """Write `modes.json`, which describes the chosen modes in the order of the document.

    The file contains the addresses of joint values in the MJCF models.
    """
    path_separator = separator(request.compat)
    described = {robot.mode.name: describe(robot, request.memo, path_separator) for robot in request.robots}
    return Artifacts(files={"modes.json": json_writer.encode(described)})


def emit_alone(request: EmitRequest, targets: Sequence[str]) -> dict[str, Artifacts]:
    """Write `modes.json` for a build without MJCF models. The file is returned as an artifact of the first target."""
    return {targets[0]: emit(apply_custom_names(request))}


def describe(robot: Robot, memo: Memo | None = None, separator: str = "/") -> dict[str, object]:
    """Return the data of one mode for JSON, with lengths in metres and angles in radians.

    Names of links and of MuJoCo joints have the path separator `separator`, as in the model.

    The key `root` contains the path of the site at which the mode is rooted, and `base` is `fixed | held | free | planar | ball`. The key
    `gravity` contains the gravity vector in the world frame [m/s^2]. `X_world_root` is the pose of the root link in this mode (4 x 4, by
    rows). `X_world_at` exists only for a `planar` or `ball` base. A planar base moves in the x-y plane of this frame, and a ball base
    rotates about its origin.

    The key `links` lists the links in the order of the bodies of the model, with the root link first. `X_root_link` is the pose of a link
    in the frame of the root link at q = 0. `fixed_to` is the parent link of a link without joints. The mass properties `mass` [kg],
    `centre` [m] and `inertia` [kg m^2, about the centre] are expressed in the frame of the link.

    The key `joints` lists the joints in the order of the model. `parent` and `child` are the links in the tree of this mode. If `reversed`
    is true, parent and child are swapped in the document. `coordinates` are in the order of the document. `in_model` contains the names of
    the MuJoCo joints of a coordinate, each with its motion per unit of q. `qpos` and `dof` are the addresses of these joints in
    `MjData.qpos` and `MjData.qvel`. The entries of a free base come first: 7 in `qpos` and 6 in `qvel`. Each coordinate of a ball joint has
    the addresses of the whole joint, which are a quaternion and an angular velocity. Each coordinate of a free joint has the addresses of
    the pose and the twist of the child in the world.

    The key `holds` contains additional mounts that are held to the world, by path. `link` is the link of the mount, and `anchor` is the
    mocap body that holds the mount. `carries` is `force` if only the origin of the mount is held, so that the mount can rotate. If the
    mount cannot rotate, `carries` is `force and torque`. `X_LM` is the pose of the mount in the link, and `X_WM` is the pose of the mount
    in the world.

    The key `poses` contains the joint values of each pose, by joint path. The pose of the mode itself comes first. `bases` contains
    `X_world_root` for each pose in which the pose of a free base is different. `standing_on` contains the mounts on which the robot stands
    in this mode.

    The key `cuts` lists the joints at which the mode cuts loops. These joints do not exist in the MuJoCo model. `X_PA` is the frame A on
    the parent. The frame A moves with the `coordinates` of the joint, including their offsets. `X_CB` is the frame B on the child, which
    must coincide with A. `residuals` contains the error [m, rad] of the worst loop in each pose.
    """
    names = [robot.assembly.links[body.link].name.replace("/", separator) for body in robot.bodies]
    memo = memo or Memo()
    order = [joint.path for body in robot.bodies if body.parent is not None for joint in body.joints]
    order += [joint.path for closure in robot.closures for joint in closure.joints]
    moves = {tendon.path: tendon.moves for tendon in tendons.present(robot) if tendon.moves}
    armatures = {tendon.path: tendon.dynamics.armature for tendon in tendons.present(robot) if tendon.moves and tendon.dynamics.armature}
    start = robot.bodies[0].X_PL
    bases = {frame.name: frame.base.rows() for frame in robot.keyframes if frame.base is not None and frame.base != start}
    return {
        "version": VERSION,
        "root": robot.mode.root.path,
        "base": robot.base,
        "gravity": robot.gravity,
        "X_world_root": start.rows(),
        **({"X_world_at": robot.mode.at.rows()} if robot.moves else {}),
        "links": _links(robot, names, memo),
        "joints": _joints(robot, names, memo, separator),
        **({"tendons": moves} if moves else {}),
        **({"tendon_armature": armatures} if armatures else {}),
        "holds": {closure.path: _hold(closure, names, separator) for closure in robot.closures if closure.hold},
        "poses": {frame.name: {name: frame.q[name] for name in order} for frame in robot.keyframes},
        **({"bases": bases} if bases else {}),
        **({"standing_on": [foot.mount.path for foot in robot.mode.feet]} if robot.mode.feet else {}),
        **(_loops(robot, names) if robot.closures else {}),
    }


def _hold(closure: Closure, names: Sequence[str], separator: str) -> dict[str, object]:
    return {
        "link": names[closure.child], "anchor": anchor_name(closure).replace("/", separator),
        "carries": "force" if closure.kind == "ball" else "force and torque",
        "X_LM": closure.X_CB.rows(), "X_WM": closure.X_PA.rows(),
    }


def _links(robot: Robot, names: Sequence[str], memo: Memo) -> list[JsonFragment]:
    """Return the JSON objects of the links of a mode, in the order of the bodies. `names` contains the names of the bodies."""
    links: list[JsonFragment] = []
    at_zero: list[Pose] = []
    for name, body in zip(names, robot.bodies, strict=True):
        at_zero.append(NO_POSE if body.parent is None else at_zero[body.parent] @ body.X_PL)
        properties = robot.assembly.links[body.link].properties
        fixed_to = None if body.parent is None or body.joints else names[body.parent]
        links.append(memo(("modes.json", robot.mode.name, "link", name), _link, name, at_zero[-1], properties, fixed_to))
    return links


def _joints(robot: Robot, names: Sequence[str], memo: Memo, separator: str) -> list[JsonFragment]:
    """Return the JSON objects of the joints of a mode, in the order of the MJCF model. `names` contains the names of the bodies."""
    joints: list[JsonFragment] = []
    poses_in_link = in_link(robot.assembly)
    qpos, dof = FREE if robot.base == "free" else sizes(robot.moves)
    for name, body in zip(names, robot.bodies, strict=True):
        if not body.joints or body.parent is None:
            continue
        mate = robot.assembly.mates[body.joints[0].mate]
        joints.append(memo(
            ("modes.json", robot.mode.name, "joint", mate.name), _joint_json, mate, (poses_in_link[mate.parent], poses_in_link[mate.child]),
            (names[body.parent], name), body.joints, (qpos, dof), separator,
        ))
        count, speeds = sizes(body.joints)
        qpos, dof = qpos + count, dof + speeds
    return joints


def _link(name: str, pose: Pose, properties: MassProperties, fixed_to: str | None) -> JsonFragment:
    fixed = {} if fixed_to is None else {"fixed_to": fixed_to}
    mass = {"mass": properties.mass, "centre": properties.centre, "inertia": properties.inertia}
    return fragment({"name": name, "X_root_link": pose.rows(), **fixed, **mass}, LISTED)


def _joint_json(
    mate: Mate, parts: tuple[Pose, Pose], links: tuple[str, str], joints: tuple[TreeJoint, ...], addresses: tuple[int, int],
    separator: str,
) -> JsonFragment:
    """Return the JSON object of a joint of the tree.

    `parts` contains the poses of the document's parent and child in their links. `links` contains the names of the parent and the child in
    this mode. `addresses` contains the first addresses of the joint in `qpos` and `qvel`.
    """
    (parent_part, child_part), (parent, child), (qpos, dof) = parts, links, addresses
    in_model: dict[str, tuple[dict[str, float], list[int], list[int]]] = {}
    for joint in joints:
        if joint.kind.at_once:
            name, (count, speeds) = (mate.name or joint.path).replace("/", separator), sizes(joints)
            in_model[joint.path] = {name: 1.0}, list(range(qpos, qpos + count)), list(range(dof, dof + speeds))
            continue
        names = {mujoco_joint.name.replace("/", separator): mujoco_joint.ratio for mujoco_joint in mujoco_joints(joint)}
        in_model[joint.path] = names, list(range(qpos, qpos + len(names))), list(range(dof, dof + len(names)))
        qpos, dof = qpos + len(names), dof + len(names)
    return fragment({
        "name": mate.name,
        "kind": mate.joints[0].kind.name,
        "parent": parent,
        "child": child,
        "reversed": joints[0].reversed,
        "X_PJ": (parent_part @ mate.X_PJ).rows(),
        "X_CJ": (child_part @ mate.X_JC.inverse()).rows(),
        "coordinates": [
            {
                **_coordinate(joint.path, joint.twist),
                "offset": joint.offset,
                "armature": joint.dynamics.armature or 0.0,
                "mimic": _mimic(joint.mimic),
                **dict(zip(("in_model", "qpos", "dof"), in_model[joint.path], strict=True)),
            }
            for joint in mate.joints
        ],
    }, LISTED)


def _coordinate(path: str, twist: Twist) -> dict[str, object]:
    """Return the JSON object of a joint coordinate with its twist. The axis of the twist passes through the origin."""
    linear, angular = twist.velocity((0.0, 0.0, 0.0))
    return {"name": path, "angular": angular, "linear": linear}


def _loops(robot: Robot, names: list[str]) -> dict[str, object]:
    return {
        "cuts": [
            {
                "name": closure.path,
                "kind": closure.joints[0].kind.name if closure.joints else "fixed",
                "parent": names[closure.parent],
                "child": names[closure.child],
                "X_PA": closure.X_PA.rows(),
                "X_CB": closure.X_CB.rows(),
                "coordinates": [_coordinate(joint.path, twist) for joint, twist in zip(closure.joints, closure.twists, strict=True)],
            }
            for closure in robot.closures
            if closure.parent is not None
        ],
        "residuals": {frame.name: frame.residual for frame in robot.keyframes},
    }


def _mimic(mimic: Mimic | None) -> dict[str, object] | None:
    if mimic is None:
        return None
    higher = {"higher": mimic.higher} if mimic.higher else {}
    return {"joint": mimic.joint.path, "multiplier": mimic.multiplier, "offset": mimic.offset, **higher}
