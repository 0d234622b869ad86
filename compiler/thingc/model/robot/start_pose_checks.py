"""Check the state in which a mode starts: parts below the plane z = 0 of its scene, ground contact of its feet, and joint limits."""

from __future__ import annotations

import math
import shlex
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import TypeVar

from thingc.base.diagnostics import Code, Note, Report, shown_path
from thingc.base.memo import Memo
from thingc.base.numeric import hypot, maximum, minimum, radians, sum_of
from thingc.base.one_line_repr import format_count
from thingc.base.pose import Pose, Vector
from thingc.base.source import Origin
from thingc.base.units import LENGTH, Quantity
from thingc.model.assembly.kinematics import joints_of
from thingc.model.assembly.types import Assembly, Link, Occurrence
from thingc.model.robot.floor_height import MeshVertices, of_box, of_points, vertices_of
from thingc.model.robot.kinematics import body_poses
from thingc.model.robot.types import Keyframe, Robot, Unclosed

Box = tuple[Vector, Vector]
"""A box, given by two corners [m]: first the corner with the smallest coordinates."""

DEEP = 0.5e-3
"""Largest depth [m] below the plane at the start that is not reported. For example, soles of feet are often slightly below the plane."""

MOVED = {True: radians(0.5), False: 0.5e-3}
"""Largest change of a given joint value by loop closure for which there is no warning: [rad] for rotations, [m] for translations."""

Problem = TypeVar("Problem")


def check_starts(robots: Sequence[Robot], mesh_vertices: MeshVertices | None, report: Report, memo: Memo) -> None:
    """Check the state in which each mode starts, and report implausible states. Modes with the same problem share a warning.

    Warn of modes in which the robot should stand on the plane but starts with a part below the plane. The root of a `fixed` base may extend
    into the ground, unless the whole root is below the plane. If `mesh_vertices` is None, only bounding boxes are known. The computed depth
    is then a lower bound, because a part touches every side of its bounding box. Also warn of modes in which a part is lower than the feet,
    and of poses that loop closure changes. Another warning is for modes without a start pose if a joint starts outside its limits.
    """
    _check_feet(robots, report)
    _check_limits(robots, report)
    _check_poses(robots, report)
    spheres = [_sphere(link, robots[0].assembly) for link in robots[0].assembly.links] if robots else []
    for (number, depth), group in _group(robots, Code.START_BELOW, report, partial(_below_plane, spheres, mesh_vertices, memo)).items():
        _warn_below(group, group[0].assembly.occurrences[number], depth, mesh_vertices is None, report)


def _group(robots: Sequence[Robot], code: Code, report: Report, find: Callable[[Robot], Problem | None]) -> dict[Problem, list[Robot]]:
    """Return the problems that `find` finds, each with its modes. Modes that suppress the warning `code` are omitted."""
    alike: dict[Problem, list[Robot]] = {}
    for robot in robots:
        found = find(robot) if not report.allows(code, robot.mode.origin) else None
        if found is not None:
            alike.setdefault(found, []).append(robot)
    return alike


def _warn(
    group: Sequence[Robot], code: Code, message: str, path: str, origin: Origin, report: Report, *, help: str, more: Sequence[str] = (),
) -> None:
    """Warn of a problem of the first mode, caused by the element `path`. Notes list `more` elements, and the other modes."""
    mode, others = group[0].mode, ", ".join(f"`{robot.mode.name}`" for robot in group[1:])
    report.warn(code, f"mode `{mode.name}` {message}", mode.origin, path=mode.name, help=help, allow=True, notes=[
        *([Note(message=f"`{path}` is defined here", span=origin[0])] if origin else []),
        *(Note(message=f"also `{one}`") for one in more),
        *([Note(message=f"the same problem occurs in mode{'s' if len(group) > 2 else ''} {others}")] if others else []),
    ])


def _below_plane(spheres: Sequence[float], mesh_vertices: MeshVertices | None, memo: Memo, robot: Robot) -> tuple[int, float] | None:
    """Return the lowest part at the start of a mode, and its depth [m] below the plane, or None if it is not below the plane."""
    deepest = minimum(_lowest(robot, spheres, mesh_vertices, memo), default=None) if _is_meant_to_stand(robot) else None
    return (deepest[1], round(-deepest[0], 6)) if deepest is not None and deepest[0] < -DEEP else None


def _is_meant_to_stand(robot: Robot) -> bool:
    """Return whether the document places the robot on the plane, either by `at` or by feet.

    For a robot that is held, or whose root is at the origin by default (as in most imported files), any height is plausible. A robot in a
    mode with `on: floor` cannot be too low.
    """
    mode = robot.mode
    placed = mode.at.translation != (0.0, 0.0, 0.0) and (robot.base != "held" or mode.at.translation[2] < 0.0)
    return mode.stated and not mode.on_floor and (placed or bool(mode.feet))


def _warn_below(group: Sequence[Robot], part: Occurrence, depth: float, bound: bool, report: Report) -> None:
    robot, mode = group[0], group[0].mode
    height = mode.at.translation[2]
    depth_text = Quantity(float(f"{depth:.3g}"), LENGTH)
    raised = Quantity(float(f"{height + math.ceil(1e4 * depth) / 1e4:.6g}"), LENGTH)
    collides = any(one.collides for one in robot.assembly.occurrences)
    help = f"write, for example, `at: {{xyz: 0 0 {raised}}}`{', or `at: {on: floor}`' if collides else ''}"
    if height == 0.0 and mode.origin and collides:
        typed = shlex.join(["thingc", "set", shown_path(mode.origin[0].file), f"modes.{mode.name}.at.on=floor"])
        help = f"run `{typed}`, or write, for example, `at: {{xyz: 0 0 {raised}}}`"
    if height < 0.0:
        help = f"check the sign of the height in `at` ({Quantity(height, LENGTH)})"
    message = f"starts with `{part.path}` {'at least ' if bound else ''}{depth_text} below the floor (z = 0)"
    _warn(group, Code.START_BELOW, message, part.path, part.origin, report, help=help)


def _check_feet(robots: Sequence[Robot], report: Report) -> None:
    """Warn of each mode in which some part is certainly lower than all parts of the links with feet."""
    for (number, depth), group in _group(robots, Code.OFF_FEET, report, _under_feet).items():
        mode, part = group[0].mode, group[0].assembly.occurrences[number]
        feet = ", ".join(f"`{foot.mount.path}`" for foot in mode.feet[:3]) + (" and others" if len(mode.feet) > 3 else "")
        _warn(
            group, Code.OFF_FEET, f"starts with `{part.path}` at least {Quantity(float(f'{depth:.3g}'), LENGTH)} below the feet ({feet})",
            part.path, part.origin, report, help="start in a pose in which the feet are the lowest parts",
        )


def _under_feet(robot: Robot) -> tuple[int, float] | None:
    """Return the lowest part of the links without feet, and the height [m] by which it is at least lower than all parts of links with feet.

    Return None if the height is less than `DEEP` or unknown, or if the mode has no feet.
    """
    if not robot.mode.feet:
        return None
    assembly = robot.assembly
    standing = {assembly.link_of[foot.mount.occurrence] for foot in robot.mode.feet}
    feet, lowest, number = math.inf, math.inf, -1
    for body, at in zip(robot.bodies, _start_poses(robot), strict=True):
        for part, box, pose in _visible_parts(assembly, assembly.links[body.link], at):
            if body.link in standing:
                feet = minimum(feet, pose.translation[2] + of_box(box, pose.rotation[2]))
            elif (low := pose.translation[2] + _certain(box, pose.rotation[2])) < lowest:
                lowest, number = low, part.index
    return (number, round(feet - lowest, 6)) if lowest + DEEP < feet < math.inf else None


def _check_limits(robots: Sequence[Robot], report: Report) -> None:
    """Warn of each mode that does not specify a start pose although the start of a joint is outside its limits.

    Joints whose positions are determined by loops or holds are not checked.
    """
    for paths, group in _group(robots, Code.START_LIMITS, report, _outside_limits).items():
        first, *more = (joint for body in group[0].bodies for joint in body.joints if joint.path in paths)
        q = group[0].start.q[first.path]
        _warn(
            group, Code.START_LIMITS,
            f"starts with `{first.path}` at {first.twist.format(q) if q else 0}, outside its limits ({first.limit.format(first.twist)})",
            first.path, first.origin, report, more=[joint.path for joint in more[:3]],
            help=f"add a `pose` with a value for `{first.name if first.mimic is None else first.mimic.joint}` to the mode",
        )


def _outside_limits(robot: Robot) -> tuple[str, ...] | None:
    """Return the paths of the joints of a mode without a start pose whose limits do not contain their start, or None."""
    if not robot.mode.stated or robot.assembly.start_pose(robot.mode).stated or robot.closures:
        return None
    q = robot.start.q
    checked = (joint for body in robot.bodies for joint in body.joints if joint.mimic is None or q[joint.path])
    return tuple(joint.path for joint in checked if not joint.limit.contains(q[joint.path])) or None


def _check_poses(robots: Sequence[Robot], report: Report) -> None:
    """Warn of each pose in which loop closure considerably changes a value that the document specifies.

    Holds can also change joint positions.
    """
    looped = [robot for robot in robots if robot.closures and not any(closure.hold for closure in robot.closures)]
    frames: dict[str, Keyframe | Unclosed] = {}
    for robot in looped:
        frames |= {frame.name: frame for frame in robot.unclosed} | {frame.name: frame for frame in robot.keyframes}
    for pose in (one for one in looped[0].assembly.poses if one.name in frames) if looped else ():
        joints = {joint.path: joint for joint in joints_of(looped[0].assembly) if joint.path in pose.values}
        moved = {path: by for path, by in frames[pose.name].moved.items() if path in joints and abs(by) > MOVED[joints[path].twist.turns]}
        if not moved or report.allows(Code.POSE_MOVED, pose.origin):
            continue
        path, *more = sorted(moved, key=lambda path: -abs(moved[path]))
        old, new = (joints[path].twist.format(value) for value in (pose.values[path], pose.values[path] + moved[path]))
        notes = [Note(message="the difference is too large for a keyframe")] if isinstance(frames[pose.name], Unclosed) else []
        notes += [Note(message=f"{format_count(len(more), 'other value')} of the pose must also change")] if more else []
        report.warn(
            Code.POSE_MOVED, f"the value of `{path}` in pose `{pose.name}` ({old}) does not close the loops (expected {new})",
            pose.origins[path], path=pose.name, notes=notes, allow=True,
            help=f"write `{joints[path].name}: {new}`, or remove joints from the pose",
        )


def _lowest(robot: Robot, spheres: Sequence[float], mesh_vertices: MeshVertices | None, memo: Memo) -> Iterator[tuple[float, int]]:
    """Yield the lowest z coordinate [m] and the index of every part that may be below the plane at the start of the mode."""
    assembly = robot.assembly
    for body, at in zip(robot.bodies, _start_poses(robot), strict=True):
        if at.translation[2] - spheres[body.link] > -DEEP:
            continue
        seen = list(_visible_parts(assembly, assembly.links[body.link], at))
        if body.parent is None and robot.base != "free" and any(_top(box, pose) > -DEEP for _, box, pose in seen):
            continue  # a fixed base may extend into the ground
        for part, box, pose in seen:
            if pose.translation[2] + of_box(box, pose.rotation[2]) > -DEEP:
                continue
            hull = part.record.meshes.get("hull") if mesh_vertices is not None and part.record is not None else None
            if mesh_vertices is None or hull is None:
                yield pose.translation[2] + _certain(box, pose.rotation[2]), part.index
            else:
                points = memo(("hull", part.path), partial(vertices_of, mesh_vertices, hull), hull.sha256)
                yield pose.translation[2] + of_points(points, pose.rotation[2]), part.index


def _start_poses(robot: Robot) -> Sequence[Pose]:
    """Return the poses of the bodies in the world at the start of the mode."""
    return body_poses(robot, robot.start.q, robot.start.base)


def _visible_parts(assembly: Assembly, link: Link, at: Pose) -> Iterator[tuple[Occurrence, Box, Pose]]:
    """Yield the visible parts of a link, each with its bounding box and its pose in the world."""
    for member, inner in zip(link.members, link.poses, strict=True):
        part = assembly.occurrences[member]
        if part.box is not None and part.drawn and part.exact:
            yield part, part.box, at @ inner


def _top(box: Box, pose: Pose) -> float:
    """Return the largest z coordinate [m] of a box at a pose."""
    x, y, z = pose.rotation[2]
    return pose.translation[2] - of_box(box, (-x, -y, -z))


def _certain(box: Box, down: Vector) -> float:
    """Return an upper bound of the smallest coordinate along `down` of a part, given its bounding box.

    The part touches every side of the box, and the point of contact is not higher than the highest point of the side.
    """
    highest = [maximum(component * low, component * high) for component, low, high in zip(down, *box, strict=True)]
    return minimum(sum_of(highest) - highest[axis] + down[axis] * side[axis] for axis in range(3) for side in box)


def _sphere(link: Link, assembly: Assembly) -> float:
    """Return the radius [m] of a sphere around the origin of a link that contains all parts of the link."""
    boxes = ((assembly.occurrences[member].box, pose) for member, pose in zip(link.members, link.poses, strict=True))
    return maximum((
        hypot(*pose.translation) + hypot(*(maximum(abs(low), abs(high)) for low, high in zip(*box, strict=True)))
        for box, pose in boxes if box is not None
    ), default=0.0)
