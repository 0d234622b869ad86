"""`ground_clearance`: the robot keeps a distance from a level plane. Components that may touch the plane are excluded."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING

from pydantic import Field

from thingc.base.diagnostics import DiagnosticCode, Note
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.numeric import inf, maximum, minimum
from thingc.base.one_line_repr import OneLineRepr, counted
from thingc.base.pose import Pose
from thingc.base.primitives import Primitive
from thingc.base.units import LENGTH, Quantity
from thingc.documents.checks.kind import CheckKind
from thingc.documents.spec.base import Model
from thingc.documents.spec.fields import LengthField
from thingc.documents.spec.name_types import ComponentField, ModeNames, PoseNames
from thingc.driver.testing.outcomes import Failure, Measure, Outcome, shown

if TYPE_CHECKING:
    from thingc.driver.testing.outcomes import TestCase
    from thingc.model.assembly.types import Occurrence, Surface
    from thingc.model.resolve.tests import Reader
    from thingc.model.resolve.types import Reference


class ClearanceCode(DiagnosticCode):
    """Diagnostic codes of `ground_clearance` tests."""

    TEST_CLEARANCE = ("TC662", "too near to the ground", "Change a part or a pose, or list parts that may touch the ground under `except`.")


class GroundClearanceTest(Model):
    """The robot keeps a distance from a level plane, in poses."""

    mode: ModeNames | None = Field(default=None, examples=["bench", ["bench", "wall"]])
    """Names or patterns of modes, or `all`; default: the first mode."""
    pose: PoseNames | None = Field(default=None, examples=["home", "leg_*", ["home", "reach"]])
    """Names or patterns of poses, or `all` keyframes of the mode; default: the start pose of the mode."""
    plane: LengthField | None = None
    """Height of the plane (its z) in the world of the mode; default: 0, the floor of the scene."""
    at_least: LengthField
    """The smallest allowed height of the lowest point above the plane."""
    except_: list[ComponentField] = Field(
        default=[], alias="except", description="Components that may be lower, such as feet and wheels; patterns allowed.",
        examples=[["foot", "wheel_*"]],
    )


class GroundClearance(OneLineRepr, FrozenStruct):
    """Requires all parts, except parts of the components `spared`, to be at least `least` [m] above z = `plane` [m] in the mode's world."""

    plane: float
    least: float
    spared: tuple[Reference, ...]


def read_ground_clearance(written: GroundClearanceTest, reader: Reader) -> GroundClearance:
    """Read a `ground_clearance` test."""
    plane = 0.0 if written.plane is None else reader.number(written.plane, "plane", LENGTH)
    least = reader.number(written.at_least, "at_least", LENGTH, least=0.0)
    spared = [reference for index, text in enumerate(written.except_) for reference in reader.components(text, ("except", index))]
    return GroundClearance(plane=plane, least=least, spared=tuple(spared))


LISTED = 5
"""Maximum number of additional parts in a message."""


def measure(case: TestCase, check: GroundClearance) -> Outcome:
    """Measure the height of the lowest part above the plane."""
    expected: dict[str, Measure] = {"at_least": check.least, "plane": check.plane}
    heights = sorted(_heights(case, check))
    if not heights:
        shapeless = Failure(code=ClearanceCode.TEST_CLEARANCE, key="except", message="no checked part has a shape")
        return Outcome(measured={}, expected=expected, said="no shape", failure=shapeless)
    height, path = heights[0]
    failure: Failure | None = None
    if height < check.least:
        others = [(other, name) for other, name in heights[1:] if other < check.least]
        notes = [Note(message=f"`{name}` is also {_over(other)}") for other, name in others[:LISTED]]
        if len(others) > LISTED:
            notes.append(Note(message=f"and {counted(len(others) - LISTED, 'more part')}"))
        failure = Failure(
            code=ClearanceCode.TEST_CLEARANCE, key="at_least", notes=tuple(notes),
            message=f"the lowest point of `{path}` is {_over(height)}, but at least {Quantity(check.least, LENGTH)} is required",
            help=f"if this is intended, add `except: [{path.replace('/', '.')}]`",
        )
    return Outcome(
        measured={"clearance": height, "part": path}, expected=expected,
        said=f"{path} {_over(height)} (at least {Quantity(check.least, LENGTH)})", failure=failure,
    )


def _heights(case: TestCase, check: GroundClearance) -> Iterator[tuple[float, str]]:
    """Yield the height [m] of the lowest point of parts and links above the plane, with their paths.

    The lowest point and all points that are too low are included. Other points may be omitted if bounding boxes show that they are higher.
    """
    from thingc.model.robot.floor_height import DECIMALS, ROUNDING, of_box
    from thingc.model.robot.kinematics import occurrence_poses

    spared = {index for reference in check.spared for index in case.linked.components[reference]}
    poses = occurrence_poses(case.robot, case.frames[0].q, case.frames[0].base)
    boxed = [
        (pose.translation[2] + of_box(occurrence.box, pose.rotation[2]) - ROUNDING, occurrence, pose)
        for occurrence, pose in zip(case.robot.assembly.occurrences, poses, strict=True)
        if occurrence.box is not None and any(map(_has_end, occurrence.solids)) and occurrence.index not in spared
    ]
    lowest = inf
    for under, occurrence, pose in sorted(boxed, key=lambda entry: (entry[0], entry[1].path)):
        if under >= maximum(check.plane + check.least, lowest):
            break
        low = minimum(_low(case, occurrence, number, pose) for number, surface in enumerate(occurrence.solids) if _has_end(surface))
        lowest = minimum(lowest, low)
        yield round(low - check.plane, DECIMALS) + 0.0, occurrence.path


def _has_end(surface: Surface) -> bool:
    """Return whether a surface has a lowest point. A plane has no lowest point, because a plane itself represents the ground."""
    return not isinstance(surface.solid, Primitive) or surface.solid.shape != "plane"


def _low(case: TestCase, occurrence: Occurrence, number: int, pose: Pose) -> float:
    """Return the lowest z [m] of a solid of an occurrence at a pose."""
    from thingc.geometry.store.meshes import vertices
    from thingc.model.robot.floor_height import of_points, vertices_of

    surface = occurrence.solids[number]
    if isinstance(surface.solid, Primitive):
        return pose.translation[2] + surface.solid.lowest(pose.rotation[2])
    store, mesh, placed = case.request.store, surface.solid, pose @ surface.pose
    place = ("true mesh_vertices", occurrence.path, number)
    points = case.request.memo(place, partial(vertices_of, partial(vertices, store), mesh), mesh.sha256)
    return placed.translation[2] + of_points(points, placed.rotation[2])


def _over(height: float) -> str:
    return f"{shown(abs(height), LENGTH)} {'below' if height < 0.0 else 'above'} the plane"


PAGE = """\
## Ground clearance

Checks the height of the lowest part above a horizontal plane. The test uses the true shapes of parts, tessellated with the workspace's
`mesh` tolerance. For [links of shapes](shapes.md#links-of-shapes), it uses the collision shapes, or the visual shapes if the link has
no collision shapes, without planes. Add feet, wheels and other components that touch the floor to `except`.

<!-- keys: GroundClearanceTest -->
| Key | Type | Default | Description |
|---|---|---|---|
| `mode` | modes | the first mode | |
| `pose` | poses | the mode's own pose | |
| `plane` | a length | `0` | z of the plane in the world of the mode |
| `at_least` | a length | required | smallest allowed height |
| `except` | list of components, patterns allowed | none | components that may come closer; a nested assembly counts as a whole |
"""

KIND = CheckKind(
    name="ground_clearance", position=8, summary="The robot keeps a distance from a level plane.",
    examples=[{"at_least": "5 mm", "except": ["foot"]}],
    stub={"at_least": "0"}, lengths=("ground_clearance", "clearance"),
    page=PAGE, model=GroundClearanceTest, read=read_ground_clearance,
    codes=ClearanceCode, measure=measure,
)
