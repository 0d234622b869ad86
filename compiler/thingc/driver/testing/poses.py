"""Compute the joint positions in which a robot is tested. In these positions, the kinematic loops of the robot are closed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from msgspec.structs import replace

from thingc.base.diagnostics import Report
from thingc.driver.testing.numpy_tree import quasi_random
from thingc.model.assembly.kinematics import joints_of
from thingc.model.assembly.types import Assembly, LinkedMode
from thingc.model.resolve.types import JointRange, NamedPose
from thingc.model.robot.kinematic_tree import root
from thingc.model.robot.types import Keyframe, Robot


def pose_robot(assembly: Assembly, mode: LinkedMode, poses: Iterable[NamedPose]) -> Robot | None:
    """Return the robot in a mode with a keyframe for each pose in which its loops close.

    Return None if the loops do not close in any of the poses.
    """
    requested = {pose.name: pose for pose in poses}
    other_poses = tuple(pose for pose in assembly.poses if pose.name not in requested)
    return root(replace(assembly, poses=(*requested.values(), *other_poses)), replace(mode, poses=tuple(requested)), Report())


def sweep_poses(pose: NamedPose, ranges: tuple[JointRange, ...], samples: int) -> list[NamedPose]:
    """Return `samples` poses in which the joints of `ranges` are spread over their ranges. Other joints are positioned as in `pose`."""
    poses: list[NamedPose] = []
    for number, point in enumerate(quasi_random(samples, len(ranges))):
        moved = {r.joint: r.lower + float(fraction) * (r.upper - r.lower) for r, fraction in zip(ranges, point, strict=True)}
        poses.append(NamedPose(name=f"{pose.name}:{number}", values={**pose.values, **moved}, origins=pose.origins, origin=pose.origin))
    return poses


def keyframe(robot: Robot, pose: NamedPose) -> Keyframe | None:
    """Return the keyframe of a robot for a named pose, or None if the kinematic loops of the robot do not close in the pose."""
    return next((frame for frame in robot.keyframes if frame.name == pose.name), None)


def joints_text(assembly: Assembly, q: Mapping[str, float]) -> str:
    """Format joint positions [rad or m] for display, such as `shoulder = -60 deg, elbow = 120 deg`."""
    joints = {joint.path: joint for joint in joints_of(assembly)}
    return ", ".join(f"{joints[path].name} = {joints[path].twist.format(round(value, 6) + 0.0)}" for path, value in q.items())
