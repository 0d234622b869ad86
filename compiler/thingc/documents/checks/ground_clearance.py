"""The document test `ground_clearance`: the robot must keep a distance from a horizontal plane."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pydantic import Field

from thingc.base.one_line_repr import OneLineStruct
from thingc.base.units import LENGTH
from thingc.documents.checks.kind import CheckKind
from thingc.documents.spec.base import Model, optional
from thingc.documents.spec.fields import LengthField
from thingc.documents.spec.name_types import ComponentField, ModeNames, PoseNames

if TYPE_CHECKING:
    from thingc.model.resolve.tests import Reader
    from thingc.model.resolve.types import Reference


class GroundClearanceTest(Model):
    """The robot must keep a minimum distance from a horizontal plane, in one or several poses."""

    mode: ModeNames | None = optional("bench", ["bench", "wall"])
    """Names or patterns of modes, or `all`; default: the first mode."""
    pose: PoseNames | None = optional("home", "leg_*", ["home", "reach"])
    """Names or patterns of poses, or `all` keyframes of the mode; default: the start pose of the mode."""
    plane: LengthField | None = None
    """The z coordinate of the plane in the world of the mode; default: 0, the floor of the scene."""
    at_least: LengthField
    """The smallest allowed height of the lowest point above the plane."""
    except_: list[ComponentField] = Field(
        default=[], alias="except", description="Components that the test ignores, such as feet and wheels. The list can contain patterns.",
        examples=[["foot", "wheel_*"]],
    )


class GroundClearance(OneLineStruct):
    """A parsed `ground_clearance` test.

    The test requires parts to be at least `least` [m] above the plane z = `plane` [m] in the world. Parts of the components in `spared` are
    ignored.
    """

    plane: float
    least: float
    spared: tuple[Reference, ...]


def read_ground_clearance(spec: GroundClearanceTest, reader: Reader) -> GroundClearance:
    """Parse the keys of a `ground_clearance` test."""
    plane = reader.number(spec.plane, "plane", LENGTH, default=0.0)
    least = reader.number(spec.at_least, "at_least", LENGTH, least=0.0)
    spared = [reference for index, text in enumerate(spec.except_) for reference in reader.components(text, ("except", index))]
    return GroundClearance(plane=plane, least=least, spared=tuple(spared))


KIND = CheckKind(
    name="ground_clearance", position=8, summary="The robot keeps a minimum distance from a horizontal plane.",
    examples=[{"at_least": "5 mm", "except": ["foot"]}], stub={"at_least": "0"}, lengths=("ground_clearance", "clearance"),
    smooth={"clearance": LENGTH}, model=GroundClearanceTest, read=read_ground_clearance,
)
