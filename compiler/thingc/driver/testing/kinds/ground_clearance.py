"""Measure the height of a robot above the ground, for document tests of the kind `ground_clearance`."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

from thingc.base.diagnostics import Code, Note, first_notes
from thingc.base.numeric import inf, maximum, minimum
from thingc.base.pose import Pose
from thingc.base.primitives import Primitive
from thingc.base.units import LENGTH, Quantity
from thingc.documents.checks.ground_clearance import KIND, GroundClearance
from thingc.driver.testing.outcomes import BELOW, Failure, Measure, Outcome, TestCase, TestMeasurement, format_si
from thingc.geometry.store.meshes import vertices
from thingc.model.assembly.types import Occurrence, Surface
from thingc.model.robot.floor_height import DECIMALS, ROUNDING, of_box, of_points, vertices_of
from thingc.model.robot.kinematics import occurrence_poses

LISTED = 5
"""Maximum number of parts that a message lists in addition to the lowest part."""


def measure(case: TestCase, check: GroundClearance) -> Outcome:
    """Measure the smallest height [m] of any tested part above the ground plane of the test."""
    expected: dict[str, Measure] = {"at_least": check.least, "plane": check.plane}
    heights = sorted(_heights(case, check))
    if not heights:
        shapeless = Failure(code=Code.TEST_CLEARANCE, key="except", message="no part in the test has a shape")
        return Outcome(expected=expected, summary="no shape", failure=shapeless)
    (height, name), *others = ((height, path.replace("/", ".")) for height, path in heights)
    failure: Failure | None = None
    if height < check.least:
        other_notes = [Note(message=f"`{other}` is {_format_height(low)}") for low, other in others if low < check.least]
        failure = Failure(
            code=Code.TEST_CLEARANCE, key="at_least", notes=tuple(first_notes(other_notes, LISTED, "more part")),
            message=f"the ground clearance of `{name}` ({format_si(height, LENGTH)}) {BELOW} ({Quantity(check.least, LENGTH)})",
            help=f"if this is intended, add `except: [{name}]`",
        )
    return Outcome(
        measured={"clearance": height, "part": heights[0][1]}, expected=expected,
        summary=f"{name} {_format_height(height)} (at least {Quantity(check.least, LENGTH)})", failure=failure,
    )


def _heights(case: TestCase, check: GroundClearance) -> Iterator[tuple[float, str]]:
    """Yield the height [m] of the lowest point of each part above the ground plane, and the path of the part.

    Parts that are neither too low nor the lowest part may be omitted, if their bounding boxes are high enough.
    """
    ignored = {index for reference in check.spared for index in case.linked.components[reference]}
    poses = occurrence_poses(case.robot, case.frames[0].q, case.frames[0].base)
    boxed = [
        (pose.translation[2] + of_box(occurrence.box, pose.rotation[2]) - ROUNDING, occurrence, pose)
        for occurrence, pose in zip(case.robot.assembly.occurrences, poses, strict=True)
        if occurrence.box is not None and any(map(_has_end, occurrence.solids)) and occurrence.index not in ignored
    ]
    lowest = inf
    for lower_bound, occurrence, pose in sorted(boxed, key=lambda entry: (entry[0], entry[1].path)):
        if lower_bound >= maximum(check.plane + check.least, lowest):
            break
        low = minimum(_low(case, occurrence, number, pose) for number, surface in enumerate(occurrence.solids) if _has_end(surface))
        lowest = minimum(lowest, low)
        yield round(low - check.plane, DECIMALS) + 0.0, occurrence.path


def _has_end(surface: Surface) -> bool:
    """Return whether a solid has a lowest point. Return False for an infinite plane, which usually represents the ground itself."""
    return not isinstance(surface.solid, Primitive) or surface.solid.shape != "plane"


def _low(case: TestCase, occurrence: Occurrence, number: int, pose: Pose) -> float:
    """Return the height [m] of the lowest point of a solid in the world.

    `number` is the index of the solid in its part, and `pose` is the pose of the part.
    """
    surface = occurrence.solids[number]
    if isinstance(surface.solid, Primitive):
        return pose.translation[2] + surface.solid.lowest(pose.rotation[2])
    store, mesh, X_WS = case.request.store, surface.solid, pose @ surface.pose
    key = ("true mesh_vertices", occurrence.path, number)
    points = case.request.memo(key, partial(vertices_of, partial(vertices, store), mesh), mesh.sha256)
    return X_WS.translation[2] + of_points(points, X_WS.rotation[2])


def _format_height(height: float) -> str:
    return f"{format_si(abs(height), LENGTH)} {'below' if height < 0.0 else 'above'} the plane"


MEASUREMENT = TestMeasurement(kind=KIND, measure=measure)
