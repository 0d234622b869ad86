"""Robots in the poses of tests, with closed loops."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from msgspec.structs import replace

from thingc.base.diagnostics import Report
from thingc.driver.testing.numpy_tree import quasi_random
from thingc.model.assembly.kinematics import joints_of
from thingc.model.assembly.types import Assembly, LinkedMode
from thingc.model.resolve.types import JointRange, NamedPose
from thingc.model.robot.spanning_tree import root
from thingc.model.robot.types import Keyframe, Robot


def posed(assembly: Assembly, mode: LinkedMode, poses: Iterable[NamedPose]) -> Robot | None:
    """Return the robot of a mode with a keyframe for each pose in which its loops close. Return None if no pose closes the loops."""
    wanted = {pose.name: pose for pose in poses}
    others = tuple(pose for pose in assembly.poses if pose.name not in wanted)
    return root(replace(assembly, poses=(*wanted.values(), *others)), replace(mode, poses=tuple(wanted)), Report())


def starting_pose(assembly: Assembly, mode: LinkedMode) -> NamedPose:
    """Return the initial pose of a mode: its own pose, else all joints at 0, with a name that no pose of the document has."""
    own = next((pose for pose in assembly.poses if pose.name == mode.pose), None)
    if own is not None:
        return own
    name = "at_zero"
    while any(pose.name == name for pose in assembly.poses):
        name += "_"
    return NamedPose(name=name, values={}, origins={}, origin=mode.origin)


def swept(pose: NamedPose, ranges: tuple[JointRange, ...], samples: int) -> list[NamedPose]:
    """Return `samples` poses in which joints move through their ranges. The name of a pose is its index."""
    poses: list[NamedPose] = []
    for number, place in enumerate(quasi_random(samples, len(ranges))):
        moved = {r.joint: r.lower + float(part) * (r.upper - r.lower) for r, part in zip(ranges, place, strict=True)}
        poses.append(NamedPose(name=f"{pose.name}:{number}", values={**pose.values, **moved}, origins=pose.origins, origin=pose.origin))
    return poses


def keyframe(robot: Robot, pose: NamedPose) -> Keyframe | None:
    """Return the keyframe of a pose, or None if the loops do not close in the pose."""
    return next((frame for frame in robot.keyframes if frame.name == pose.name), None)


def joints_text(assembly: Assembly, q: Mapping[str, float]) -> str:
    """Format coordinates [rad or m]: `shoulder -60 deg, elbow 120 deg`."""
    twists = {joint.path: joint.twist for joint in joints_of(assembly)}
    return ", ".join(f"{path} {twists[path].shown(round(value, 6) + 0.0)}" for path, value in q.items())
