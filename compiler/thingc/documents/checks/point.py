"""The document test `point`: a mount must be able to reach a point, with every joint within its limits."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from pydantic import ConfigDict, Field

from thingc.base.numeric import radians
from thingc.base.one_line_repr import OneLineStruct
from thingc.base.pose import Vector
from thingc.base.units import ANGLE, LENGTH
from thingc.documents.checks.kind import CheckKind, read_direction
from thingc.documents.spec.base import Model, optional, rule
from thingc.documents.spec.fields import AngleField, LengthField, NumberField, Vector3Length
from thingc.documents.spec.name_types import ModeNames, ShownMountField

if TYPE_CHECKING:
    from thingc.model.resolve.tests import Reader
    from thingc.model.resolve.types import Reference

ANGLE_OFF = radians(1.0)
"""Default for the largest angle [rad] between the z axis of the mount and the required direction."""


class PointTest(Model):
    """The robot must be able to move a mount to a point, with every joint within its limits."""

    model_config = ConfigDict(json_schema_extra={"dependentRequired": {"angle": ["direction"]}})

    mount: ShownMountField
    """The mount that must reach the point."""
    mode: ModeNames | None = optional("bench", ["bench", "wall"])
    """Names or patterns of modes, or `all`; default: the first mode."""
    in_: ShownMountField | None = Field(
        default=None, alias="in", description="The frame of the point, a mount; default: the world of the mode.",
    )
    at: Vector3Length
    """The point."""
    within: LengthField
    """The largest allowed distance of the origin of the mount from the point."""
    direction: Annotated[list[NumberField], Field(min_length=3, max_length=3)] | None = optional([0, 0, -1])
    """Required direction of the z axis of the mount, in the same frame as the point: three numbers, of any length."""
    angle: AngleField | None = None
    """The largest allowed angle between the z axis of the mount and `direction`; default: 1 deg."""

    def _check_rules(self) -> None:
        if self.angle is not None and self.direction is None:
            raise rule("`angle` requires `direction`", "write, for example, `direction: [0, 0, -1]`")


class PointCheck(OneLineStruct):
    """A parsed `point` test. The test requires the distance of the mount from `point` [m] to be at most `within` [m].

    If `direction` (a unit vector) is set, the angle between the z axis of the mount and `direction` must be at most `angle` [rad].
    """

    mount: Reference
    point: Vector
    frame: Reference | None
    within: float
    direction: Vector | None
    angle: float


def read_point(spec: PointTest, reader: Reader) -> PointCheck | None:
    """Parse the keys of a `point` test. If the test is invalid, report the error and return None."""
    mount, frame = reader.mount(spec.mount, "mount"), reader.mount(spec.in_, "in")
    point = reader.vector(spec.at, "at", LENGTH)
    within = reader.number(spec.within, "within", LENGTH, above=0.0)
    direction = None if spec.direction is None else read_direction(spec.direction, reader, "direction", "[0, 0, -1]")
    angle = reader.number(spec.angle, "angle", ANGLE, above=0.0, default=ANGLE_OFF)
    if mount is None or point is None:
        return None
    return PointCheck(mount=mount, point=point, frame=frame, within=within, direction=direction, angle=angle)


KIND = CheckKind(
    name="point", position=4, summary="A mount can reach a point.",
    examples=[{"mount": "hand.tip", "at": "200 0 50 mm", "within": "1 mm"}],
    stub={"mount": "$mount", "at": ["0", "0", "0"], "within": "1 m"}, lengths=("point", "distance"),
    smooth={"distance": LENGTH, "angle": ANGLE}, model=PointTest, read=read_point,
)
