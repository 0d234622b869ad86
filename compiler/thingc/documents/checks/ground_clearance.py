"""`ground_clearance`: the robot keeps a distance from a level plane, with all parts and links but those that may touch it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING

from pydantic import Field

from thingc.base.brief import Brief, counted
from thingc.base.diagnostics import Code, Note
from thingc.base.frozen import dataclass
from thingc.base.primitives import Primitive
from thingc.base.units import LENGTH, Quantity
from thingc.documents.checks.kind import CheckKind
from thingc.documents.checks.outcome import Failure, Measure, Outcome, shown
from thingc.documents.spec.base import Model
from thingc.documents.spec.fields import LengthField
from thingc.documents.spec.named import ComponentField, ModeNames, PoseNames

if TYPE_CHECKING:
    from thingc.base.pose import Pose
    from thingc.driver.testing.results import Case
    from thingc.model.assembly.types import Occurrence, Surface
    from thingc.model.resolve.model import Reference
    from thingc.model.resolve.tests import Reader

LISTED = 5
"""Further parts that a message names."""


class GroundClearanceTest(Model):
    """The robot keeps a distance from a level plane, in poses."""

    mode: ModeNames | None = Field(default=None, examples=["bench", ["bench", "wall"]])
    """Modes, patterns allowed, or `all`; the first unless written."""
    pose: PoseNames | None = Field(default=None, examples=["home", "leg_*", ["home", "reach"]])
    """Poses, patterns allowed, or `all` keyframes of the mode; where the mode starts unless written."""
    plane: LengthField | None = None
    """How high the plane is in the world of the mode (its z); 0, the floor of the scene, unless written."""
    at_least: LengthField
    """The least height over the plane of whatever is lowest."""
    except_: list[ComponentField] = Field(
        default=[], alias="except", description="Components that may come nearer, patterns allowed: feet, wheels.",
        examples=[["foot", "wheel_*"]],
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class GroundClearance(Brief):
    """No part but those of the components `spared` is lower than `least` [m] over z = `plane` [m] of the mode's world."""

    plane: float
    least: float
    spared: tuple[Reference, ...]


def read(written: GroundClearanceTest, reader: Reader) -> GroundClearance:
    """A plane and a height over it."""
    plane = 0.0 if written.plane is None else reader.number(written.plane, "plane", LENGTH)
    least = reader.number(written.at_least, "at_least", LENGTH, least=0.0)
    spared = [reference for index, text in enumerate(written.except_) for reference in reader.components(text, ("except", index))]
    return GroundClearance(plane=plane, least=least, spared=tuple(spared))


def run(case: Case, check: GroundClearance) -> Outcome:
    """The height of the lowest part over the plane."""
    expected: dict[str, Measure] = {"at_least": check.least, "plane": check.plane}
    heights = sorted(_heights(case, check))
    if not heights:
        shapeless = Failure(code=Code.TEST_CLEARANCE, key="except", message="no part that is looked at has a shape")
        return Outcome(measured={}, expected=expected, said="no shape", failure=shapeless)
    height, path = heights[0]
    failure: Failure | None = None
    if height < check.least:
        others = [(other, name) for other, name in heights[1:] if other < check.least]
        notes = [Note(message=f"`{name}` is {_over(other)}, too") for other, name in others[:LISTED]]
        if len(others) > LISTED:
            notes.append(Note(message=f"and {counted(len(others) - LISTED, 'more part')}"))
        failure = Failure(
            code=Code.TEST_CLEARANCE, key="at_least", notes=tuple(notes),
            message=f"the lowest point of `{path}` is {_over(height)}, and {Quantity(check.least, LENGTH)} were asked for",
            help=f"if that is right, write `except: [{path.replace('/', '.')}]`",
        )
    return Outcome(
        measured={"clearance": height, "part": path}, expected=expected,
        said=f"{path} {_over(height)} (at least {Quantity(check.least, LENGTH)})", failure=failure,
    )


def _heights(case: Case, check: GroundClearance) -> Iterator[tuple[float, str]]:
    """How high [m] the lowest points of parts and links are over the plane, each with its path: of the lowest one, and of every one that is
    too low. Others are left out where their boxes show that they are higher."""
    from thingc.model.robot import occurrence_poses
    from thingc.model.robot.standing import DECIMALS, ROUNDING, of_box

    spared = {index for reference in check.spared for index in case.linked.components[reference]}
    poses = occurrence_poses(case.robot, case.frames[0].q, case.frames[0].base)
    boxed = [
        (pose.translation[2] + of_box(occurrence.box, pose.rotation[2]) - ROUNDING, occurrence, pose)
        for occurrence, pose in zip(case.robot.assembly.occurrences, poses, strict=True)
        if occurrence.box is not None and any(map(_has_end, occurrence.solids)) and occurrence.index not in spared
    ]
    lowest = math.inf
    for under, occurrence, pose in sorted(boxed, key=lambda entry: (entry[0], entry[1].path)):
        if under >= max(check.plane + check.least, lowest):
            break
        low = min(_low(case, occurrence, number, pose) for number, surface in enumerate(occurrence.solids) if _has_end(surface))
        lowest = min(lowest, low)
        yield round(low - check.plane, DECIMALS) + 0.0, occurrence.path


def _has_end(surface: Surface) -> bool:
    """Whether it has a lowest point: a plane is ground itself."""
    return not isinstance(surface.solid, Primitive) or surface.solid.shape != "plane"


def _low(case: Case, occurrence: Occurrence, number: int, pose: Pose) -> float:
    """The lowest z [m] of one of the solids of an occurrence, which stands at a pose."""
    from thingc.geometry.store.meshes import vertices
    from thingc.model.robot.standing import of_points, vertices_of

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
**Ground clearance** is how high the lowest part is over a level plane: the floor of the scene, or `plane` above it. It is decided on
the true shapes of the parts, tessellated within the workspace's `mesh` tolerance, whatever their [collision](#collision) shape is, and on
those shapes of [links](#links-of-shapes) that touch (where none does, on those that are drawn), but for planes. What stands or rolls on
the floor is named by `except`.

<!-- keys: GroundClearanceTest -->
| key | value | without it | |
|---|---|---|---|
| `mode` | modes | the first | |
| `pose` | poses | where the mode starts | |
| `plane` | a length | `0` | z of the plane in the world of the mode |
| `at_least` | a length | an error | the least height over it |
| `except` | list of components, patterns allowed | none | those that may come nearer; a nested assembly counts as a whole |
"""

KIND = CheckKind(
    name="ground_clearance", position=8, summary="The robot keeps a distance from a level plane.",
    examples=[{"at_least": "5 mm", "except": ["foot"]}],
    stub={"at_least": "0"},
    page=PAGE, model=GroundClearanceTest, read=read, run=run,
)
