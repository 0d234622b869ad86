"""Compute how far tolerances move a mount, for document tests of the kind `stack`.

The deviation is linear in the deviations of the mounts and joints between two mounts. A mount that deviates by t along a unit vector e
moves the end of the chain by `t (e . u)` along the direction u. A rotation by the angle a about e moves the end by `a (e x r) . u`, where r
is the vector from the mount to the end. See Chase and Parkinson, "A survey of research in the application of tolerance analysis to the
design of mechanical assemblies", Research in Engineering Design 3, 1991.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from thingc.base.diagnostics import Code, Note, first_notes
from thingc.base.interfaces import Bore, Boss
from thingc.base.numeric import erf, hypot, sqrt, sum_of
from thingc.base.one_line_repr import format_count
from thingc.base.pose import Pose, Vector, add_scaled, cross, dot, rotate
from thingc.base.units import LENGTH, Quantity
from thingc.documents.checks.stack import KIND, StackCheck
from thingc.driver.testing.outcomes import ABOVE, BELOW, ROUNDING, Failure, Measure, Outcome, TestCase, TestMeasurement, format_si
from thingc.model.assembly.interfaces import mount_name
from thingc.model.assembly.kinematics import neighbourhood, on_loops
from thingc.model.assembly.types import Assembly, Mate, MountAt
from thingc.model.robot.kinematics import body_poses, in_world, occurrence_poses
from thingc.model.robot.types import Keyframe, Robot

LISTED = 5
"""Maximum number of contributors that a message lists."""

AXES: tuple[Vector, ...] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

Contribution = tuple[str, list[float]]
"""The name of a mount or joint, and the deviations [m] that its independent tolerances cause."""


def measure(case: TestCase, check: StackCheck) -> Outcome:
    """Compute the deviation of a mount along a direction: its largest value [m], and the root of the sum of squares [m]."""
    robot, base, end = case.robot, case.linked.mounts[check.base], case.linked.mounts[check.of]
    path = _path(robot.assembly, base.occurrence, end.occurrence)
    closed = {joint.path for mate in path for joint in mate.joints} & on_loops(len(robot.assembly.occurrences), robot.assembly.mates)
    if closed:
        message = f"joint `{sorted(closed)[0].replace('/', '.')}` is in a closed loop"
        failure = Failure(code=Code.TEST_STACK, key="of", message=message, help="use two mounts that are connected without a closed loop")
        return Outcome(summary="closed loop", failure=failure)
    contributions = list(_contributions(robot, case.frames[0], check.along, base, end, path))
    if not contributions:
        message = "no part, joint or fit between the mounts has a tolerance"
        failure = Failure(code=Code.TEST_STACK, key="of", message=message, help="add `tolerance` to the `process` of a material")
        return Outcome(summary="no tolerance", failure=failure)
    worst = sum_of(abs(deviation) for _, deviations in contributions for deviation in deviations)
    rss = hypot(*(deviation for _, deviations in contributions for deviation in deviations))
    bounds = (("worst", "the largest deviation", worst, check.worst), ("rss", "the RSS deviation", rss, check.rss))
    measured: dict[str, Measure] = {"worst": worst, "rss": rss}
    expected: dict[str, Measure] = {key: bound for key, _, _, bound in bounds if bound is not None}
    shares = _largest_shares(contributions, rss)
    summary = f"worst {format_si(worst, LENGTH)}, RSS {format_si(rss, LENGTH)} of {format_count(len(contributions), 'contributor')}"
    summary = f"{summary}; {shares[0].message}" if shares else summary
    faults = [
        (key, f"{description} ({format_si(value, LENGTH)}) {ABOVE} ({Quantity(bound, LENGTH)})")
        for key, description, value, bound in bounds if bound is not None and value > bound * (1.0 + ROUNDING)
    ]
    if check.within is not None and check.share is not None:
        # three standard deviations of a normal distribution
        share = erf(3.0 * check.within / (sqrt(2.0) * rss)) if rss > 0.0 else 1.0
        measured["yield"], expected["yield"] = share, check.share
        share_text = f"{100.0 * share:.4g} % of all robots are within {Quantity(check.within, LENGTH)}"
        summary = f"{summary}; {share_text}"
        if share < check.share:
            faults.append(("yield", f"the share of robots within tolerance ({100.0 * share:.4g} %) {BELOW} ({100.0 * check.share:g} %)"))
    if not faults:
        return Outcome(measured=measured, expected=expected, summary=summary)
    failure = Failure(code=Code.TEST_STACK, key=faults[0][0], message="; ".join(text for _, text in faults), notes=tuple(shares))
    return Outcome(measured=measured, expected=expected, summary=summary, failure=failure)


def _largest_shares(contributions: Sequence[Contribution], rss: float) -> list[Note]:
    """Return notes that list the largest contributors and their shares of the variance. `rss` [m] is the root of the sum of squares.

    If no contributor deviates along the direction, return an empty list.
    """
    if rss == 0.0:
        return []
    squares = [(sum_of(value * value for value in deviations), name) for name, deviations in contributions]
    squares.sort(key=lambda pair: (-pair[0], pair[1]))
    shares = [Note(message=f"{100.0 * square / rss**2:.3g} % due to {name}: {format_si(sqrt(square), LENGTH)}") for square, name in squares]
    return first_notes(shares, LISTED, "other contributor")


def _path(assembly: Assembly, start: int, end: int) -> list[Mate]:
    """Return the mates between two occurrences, from the first to the second."""
    neighbours = neighbourhood(len(assembly.occurrences), assembly.mates)
    steps: dict[int, Mate | None] = {end: None}
    stack = [end]
    while stack:
        current = stack.pop()
        for mate in (assembly.mates[number] for number in neighbours[current]):
            neighbour = mate.parent if mate.child == current else mate.child
            if neighbour not in steps:
                steps[neighbour] = mate
                stack.append(neighbour)
    path: list[Mate] = []
    while (step := steps[start]) is not None:
        path.append(step)
        start = step.parent if step.child == start else step.child
    return path


def _contributions(
    robot: Robot, frame: Keyframe, along: Vector, base: MountAt, end_mount: MountAt, path: Sequence[Mate],
) -> Iterator[Contribution]:
    """Yield the contributions of all mounts, fits and joints on a path between the mounts `base` and `end_mount`.

    `path` contains the mates between the components of the two mounts. `along` is a unit vector in the frame of `base`.
    """
    assembly = robot.assembly
    poses = occurrence_poses(robot, frame.q, frame.base)
    direction = rotate((poses[base.occurrence] @ base.pose).rotation, along)
    end = (poses[end_mount.occurrence] @ end_mount.pose).translation
    current, entry_mount = base.occurrence, base.mount
    for mate in path:
        forward = mate.parent == current
        exit_mount, next_mount = (mate.parent_mount, mate.child_mount) if forward else (mate.child_mount, mate.parent_mount)
        if exit_mount != entry_mount:  # both mounts deviate from the frame of the part
            yield from _mount_contributions(assembly, poses, current, (entry_mount, exit_mount), direction, end)
        yield from _fit_contributions(assembly, poses, mate, direction)
        current, entry_mount = mate.child if forward else mate.parent, next_mount
    if end_mount.mount != entry_mount:
        yield from _mount_contributions(assembly, poses, current, (entry_mount, end_mount.mount), direction, end)
    play = {joint.path: joint.actuator.backlash for mate in path for joint in mate.joints if joint.actuator and joint.actuator.backlash}
    for body, pose in zip(robot.bodies, body_poses(robot, frame.q, frame.base), strict=True):
        for joint, twist in in_world(body, pose, frame.q):
            if joint.path in play:
                velocity = add_scaled(cross(twist.angular, add_scaled(end, twist.anchor, -1.0)), twist.linear, 1.0)
                yield f"the backlash of `{joint.name}`", [0.5 * play[joint.path] * dot(velocity, direction)]


def _mount_contributions(
    assembly: Assembly, poses: Sequence[Pose], index: int, mounts: Sequence[str], direction: Vector, end: Vector,
) -> Iterator[Contribution]:
    """Yield the contributions of the mounts `mounts` of one part. The mount `origin`, which is the frame of the part, does not deviate.

    `index` is the index of the part, `direction` a unit vector and `end` the position [m] of the end of the chain, both in the world.
    """
    occurrence = assembly.occurrences[index]
    process = occurrence.overrides.process_with(occurrence.material)
    for name in mounts:
        own = occurrence.mounts[name].tolerance
        tolerance = process.tolerance if own is None else own
        if name == "origin" or tolerance is None and process.tilt is None:
            continue
        arm = add_scaled(end, poses[index].apply(occurrence.mounts[name].pose.translation), -1.0)
        axes = [rotate(poses[index].rotation, axis) for axis in AXES]
        shifts = [(tolerance or 0.0) * dot(axis, direction) for axis in axes]
        tilts = [(process.tilt or 0.0) * dot(cross(axis, arm), direction) for axis in axes]
        yield f"`{mount_name(occurrence, name)}`", [*shifts, *tilts]


def _fit_contributions(assembly: Assembly, poses: Sequence[Pose], mate: Mate, direction: Vector) -> Iterator[Contribution]:
    """Yield the contribution of a boss that is loose in a bore: half of the difference of the diameters, in any radial direction."""
    ends = [assembly.occurrences[index].mounts[name] for index, name in ((mate.parent, mate.parent_mount), (mate.child, mate.child_mount))]
    for first, second in (ends, ends[::-1]):
        bores = [feature.diameter for feature in first.features if isinstance(feature, Bore)]
        bosses = [feature.diameter for feature in second.features if isinstance(feature, Boss)]
        if len(bores) == len(bosses) == 1 and bores[0] > bosses[0]:
            rotation = (poses[mate.parent] @ ends[0].pose).rotation
            across = hypot(*(dot(rotate(rotation, axis), direction) for axis in AXES[:2]))
            name = mount_name(assembly.occurrences[mate.child], mate.child_mount)
            yield f"the play of `{name}`", [0.5 * (bores[0] - bosses[0]) * across]


MEASUREMENT = TestMeasurement(kind=KIND, measure=measure)
