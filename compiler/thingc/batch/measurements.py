"""Compute the results of a variant, such as its mass and reach, from the assembly and the robot.

The measurements do not require a simulation.

    mass, centre.x y z, inertia.xx ... yz   the whole robot at q = 0, in the frame of the base component
    box.x y z                               sides of the bounding box of the boxes of all parts, along the axes of the world
    reach                                   distance between the two mounts in the document
    torque_margin                           smallest effort / |static torque| of all drives
    length.JOINT                            distance of a joint from the previous joint, as in the documents
    site:MOUNT.x y z                        position of a mount in the world, if requested
    tests.NAME                              the value that a test measures, if requested (`tested_values`), by pose if there are several

Box, reach, torques and sites are computed for one mode and one pose.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING

from thingc.base.diagnostics import Code, UserError
from thingc.base.inertia import total
from thingc.base.memo import Memo
from thingc.base.numeric import dist
from thingc.base.pose import Pose
from thingc.base.suggestions import did_you_mean
from thingc.base.units import Dimension
from thingc.model.assembly.kinematics import coordinates, joints_of
from thingc.model.assembly.shape_links import bounding_box
from thingc.model.assembly.types import Assembly, MountAt
from thingc.model.robot.kinematics import placed_bodies
from thingc.model.robot.tree import in_link
from thingc.model.robot.types import Robot
from thingc.model.statics.efforts import static_efforts
from thingc.model.statics.support import lifted_feet, stance

if TYPE_CHECKING:
    from thingc.targets.request import EmitRequest

Results = dict[str, float | None]
"""A mapping from the name of each result to its value in SI units. A result that a variant does not have is None or missing."""
SITE = "site:"
"""Prefix of the names of results that are positions of mounts."""
TORQUES = "torque_margin"
"""The name of the result that requires the torques of all drives."""

INERTIAS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
"""The rows and columns of the elements of the inertia that are results, in order."""

TEST = "tests."
"""Prefix of the names of values that document tests measure."""


class UnknownMount(UserError):
    """Raised if a referenced mount does not exist."""

    code = Code.RESULT


def measure(
    robot: Robot, pose: str | None, reach: tuple[str, str] | None, sites: Sequence[str] = (), *, torques: bool = True,
    memo: Memo | None = None,
) -> Results:
    """Compute the results of a robot in the pose `pose`.

    If `pose` is None, use the pose of the mode, or else q = 0. Raises `UnknownMount` for a reference to an unknown mount. If the loops of
    the mode cannot be closed in the pose, the results for box, reach, sites and torque margin are omitted. The torque margin is also
    omitted if `torques` is False, if the robot has closed loops, or if the robot does not stand on its feet. The torques of a robot with
    closed loops depend on how the loops share the load. `reach` contains references to two mounts. `sites` contains references to mounts,
    or to single coordinates of mounts.
    """
    assembly = robot.assembly
    robot_inertia = total(link.properties.seen_from(assembly.rest[link.frame]) for link in assembly.links)
    results: Results = {"mass": robot_inertia.mass}
    results.update({f"centre.{axis}": value for axis, value in zip("xyz", robot_inertia.centre)})
    results.update({f"inertia.{'xyz'[j]}{'xyz'[k]}": robot_inertia.inertia[j][k] for j, k in INERTIAS})
    within = in_link(assembly)
    results.update(lengths(assembly, within))
    ends = [_mount(assembly, text) for text in reach or ()]
    mounts = dict(_site(assembly, text) for text in sites)
    placed = _pose_robot(robot, pose)
    if placed is None:
        return results
    q, bodies = placed
    at = {body.link: body_pose for body, body_pose in zip(robot.bodies, bodies)}
    occurrences = [at[link] @ inner for link, inner in zip(assembly.link_of, within)]
    parts = zip(assembly.occurrences, occurrences, strict=True)
    box = bounding_box([part_pose.around(part.box) for part, part_pose in parts if part.box is not None])
    if box is not None:
        results.update({f"box.{axis}": high - low for axis, low, high in zip("xyz", *box)})
    if ends:
        results["reach"] = dist(*((occurrences[end.occurrence] @ end.pose).translation for end in ends))
    for name, mount in mounts.items():
        position = (occurrences[mount.occurrence] @ mount.pose).translation
        results.update({f"{name}.{axis}": value for axis, value in zip("xyz", position)})
    if torques and not robot.closures and not lifted_feet(stance(robot, q, bodies).feet):
        efforts = static_efforts(robot, q, bodies, memo)
        results[TORQUES] = efforts.least_margin if efforts.fall is None else None
    return results


def tested_values(kind: str) -> Mapping[str, Dimension]:
    """Return the values of a kind of document test that can be results, with their physical dimensions."""
    from thingc.documents.checks import kinds

    return kinds()[kind].smooth


def measure_tests(request: EmitRequest, names: Collection[str]) -> Results:
    """Run document tests, and return the values that they measure by name.

    The name of a value contains the mode and the pose if the test runs in several modes or poses, and the key if the test measures several
    values.
    """
    from thingc.driver.testing.test_runner import Selection, run

    report = request.report
    reported = len(report.diagnostics)
    outcomes = run(request, Selection(only=tuple(names)))
    del report.diagnostics[reported:]  # a failed test is not an error here
    results: Results = {}
    for result in outcomes:
        same_name = [other for other in outcomes if other.name == result.name]
        differing = [getattr(result, key) for key in ("mode", "pose") if len({getattr(other, key) for other in same_name}) > 1]
        keys = tested_values(result.kind)
        for key in keys:
            value = result.outcome.measured.get(key)
            name_parts = [TEST + result.name, *map(str, differing), *([key] if len(keys) > 1 else [])]
            entries = zip("xyz", value) if isinstance(value, list) else [("", value)]
            results.update((".".join((*name_parts, *axis)), entry) for axis, entry in entries)  # type: ignore[misc]
    return results


def _pose_robot(robot: Robot, pose: str | None) -> tuple[dict[str, float], tuple[Pose, ...]] | None:
    """Return the positions of all joints in a pose, and the poses of all bodies in the world.

    Return None if the closed loops of the robot cannot be closed.
    """
    name = pose if pose is not None else robot.mode.pose
    frame = next((known for known in robot.keyframes if known.name == name), None)
    base = robot.bodies[0].X_PL
    if frame is not None:
        return frame.q, placed_bodies(robot.bodies, frame.q, frame.base or base)
    if robot.closures:
        return None
    named = next((known for known in robot.assembly.poses if known.name == name), None)
    q = coordinates(joints_of(robot.assembly), named.values if named is not None else {})
    return q, placed_bodies(robot.bodies, q, base)


def lengths(assembly: Assembly, within: Sequence[Pose]) -> Results:
    """Return the result `length.JOINT` [m] for each joint, except the first joint of each chain.

    The length is the distance between the parent mount of the joint and the mount at which the previous joint holds the link. Parent and
    child are defined by the documents, so the lengths do not depend on the root. `within` contains the poses of all components in their
    links (see `in_link`).
    """
    placed = {assembly.link_of[mate.child]: mate for mate in assembly.mates if mate.joints and mate.loop is None}
    distances: Results = {}
    for mate in assembly.mates:
        previous = placed.get(assembly.link_of[mate.parent])
        if mate.name is None or mate.keep or previous is None or previous is mate:
            continue
        start = within[mate.parent].apply(mate.X_PJ.translation)
        previous_end = within[previous.child].apply(previous.X_JC.inverse().translation)
        distances[f"length.{mate.name.replace('/', '.')}"] = dist(start, previous_end)
    return distances


def _mount(assembly: Assembly, text: str) -> MountAt:
    """Return the mount to which a reference refers. Raises `UnknownMount` if the mount does not exist."""
    names = text.split(".")
    path = "/".join(names)
    for exported in assembly.exported:
        if exported.path == path:
            return exported
    owner = "/".join(names[:-1])
    for occurrence in assembly.occurrences:
        if occurrence.path == owner and names[-1] in occurrence.mounts:
            return MountAt(occurrence=occurrence.index, mount=names[-1], pose=occurrence.mounts[names[-1]].pose)
    known = [item.path.replace("/", ".") for item in assembly.exported]
    known += [f"{item.path}.{mount}".replace("/", ".") for item in assembly.occurrences for mount in item.mounts if item.path == owner]
    raise UnknownMount(f"there is no mount `{text}`", did_you_mean(text, known, what="mounts"))


def _site(assembly: Assembly, text: str) -> tuple[str, MountAt]:
    """Return the name of the result for a reference to a mount, and the mount. The reference can end with a coordinate, as in `hook.z`."""
    try:
        return f"{SITE}{text}", _mount(assembly, text)
    except UnknownMount:
        if text[-2:] not in (".x", ".y", ".z"):
            raise
        return f"{SITE}{text[:-2]}", _mount(assembly, text[:-2])
