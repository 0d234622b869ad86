"""Compute the coordinate frames and axes with which `thingc render` marks the mounts, the joints and the root of a robot."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from thingc.base.numeric import hypot
from thingc.base.pose import NO_POSE, Pose, Vector, cross, turned_about, turned_x
from thingc.base.suggestions import did_you_mean
from thingc.driver.pipeline import UnknownChoice
from thingc.model.robot.kinematics import body_pose
from thingc.model.robot.tree import in_link
from thingc.model.robot.types import Robot
from thingc.targets.render.frames import Mark, frame_mark, joint_mark

ROOT_SIZE = 1.6
"""Length of the drawn axes of the root link, relative to the axes of a mount."""


def mounts(robot: Robot, q: Mapping[str, float]) -> Iterator[Mark]:
    """Yield the frames of three kinds of mounts: mounts that attach a component, exported mounts, and mounts that the document adds.

    Frames at equal poses are omitted.
    """
    assembly = robot.assembly
    named = [(mate.parent, mate.parent_mount) for mate in assembly.mates]
    named += [(one.occurrence, one.mount) for one in assembly.exported]
    named += [(one.index, name) for one in assembly.occurrences for name in one.component.mounts]
    return (_mount(robot, q, *place) for place in dict.fromkeys(named) if place[1] != "origin")


def mounts_of(robot: Robot, q: Mapping[str, float], names: Sequence[str]) -> Iterator[Mark]:
    """Yield the frame and all mounts of a component, and of the components nested in it. Raises `UnknownChoice`."""
    assembly = robot.assembly
    for name in names:
        path = name.replace(".", "/")
        occurrences = [one for one in assembly.occurrences if one.path == path or one.path.startswith(f"{path}/")]
        if not occurrences:
            known = {one.path[:end] for one in assembly.occurrences for end in _ends(one.path)}
            raise UnknownChoice(f"there is no component `{name}`", did_you_mean(path, known, what="components"))
        for one in occurrences:
            yield from (_mount(robot, q, one.index, mount) for mount in one.mounts)


def joints(robot: Robot, q: Mapping[str, float]) -> Iterator[Mark]:
    """Yield the axes of all joint coordinates. `q` maps the paths of coordinates to values [rad or m].

    The axis of a coordinate moves with the coordinates that precede it in the same joint.
    """
    for mate in robot.assembly.mates:
        body, pose = _on_body(robot, q, mate.parent, mate.X_PJ)
        for number, joint in enumerate(mate.joints):
            label = _component_path(mate.name or joint.path) + (f"[{number}]" if len(mate.joints) > 1 else "")
            yield joint_mark(label=label, body=body, pose=pose @ _along(joint.twist.axis), slides=not joint.twist.turns)
            if not joint.kind.at_once:  # exponential coordinates have fixed axes
                pose = pose @ joint.twist.exponential(q.get(joint.path, 0.0) + joint.offset)


def root(robot: Robot) -> Iterator[Mark]:
    """Yield the coordinate frame of the root link of the mode."""
    choice = robot.mode.root
    body, pose = _on_body(robot, {}, choice.occurrence, choice.pose)
    yield frame_mark(label=f"root {_component_path(choice.path)} ({robot.base})", body=body, pose=pose, size=ROOT_SIZE)


def _mount(robot: Robot, q: Mapping[str, float], occurrence: int, name: str) -> Mark:
    one = robot.assembly.occurrences[occurrence]
    body, pose = _on_body(robot, q, occurrence, one.mounts[name].pose)
    return frame_mark(label=f"{_component_path(one.path)}.{name}", body=body, pose=pose)


def _on_body(robot: Robot, q: Mapping[str, float], occurrence: int, pose: Pose) -> tuple[str, Pose]:
    """Return the name of the body that carries an occurrence, and `pose` in the frame of this body at the joint coordinates `q`.

    Massless intermediate links are not bodies. An occurrence on such a link is carried by the preceding body.
    """
    assembly, number = robot.assembly, robot.assembly.link_of[occurrence]
    body = next(body for body in robot.bodies if body.link == number)
    pose = in_link(assembly)[occurrence] @ pose
    while body.parent is not None and body.link in assembly.between:
        pose = body_pose(body, NO_POSE, {joint.path: q.get(joint.path, 0.0) for joint in body.joints}) @ pose
        body = robot.bodies[body.parent]
    return assembly.links[body.link].name, pose


def _along(axis: Vector) -> Pose:
    """Return a rotation whose z axis is the unit vector `axis`."""
    if axis == (0.0, 0.0, 1.0):
        return NO_POSE
    across = cross((0.0, 0.0, 1.0), axis)
    size = hypot(*across)
    if size == 0.0:
        return turned_x(math.pi)
    return Pose(rotation=turned_about((across[0] / size, across[1] / size, across[2] / size), math.atan2(size, axis[2])))


def _component_path(path: str) -> str:
    return path.replace("/", ".")


def _ends(path: str) -> list[int]:
    """Return the index of the end of each name in a path: `[4, 11]` for `hand/finger`."""
    return [*(at for at, letter in enumerate(path) if letter == "/"), len(path)]
