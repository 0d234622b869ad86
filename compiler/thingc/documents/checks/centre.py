"""The document test `centre`: the centre of mass of the robot, or of some components, must be inside a box."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from pydantic import ConfigDict, Field

from thingc.base.one_line_repr import OneLineStruct
from thingc.base.units import LENGTH
from thingc.documents.checks.kind import CheckKind
from thingc.documents.spec.base import Model, optional, rule
from thingc.documents.spec.fields import LengthField
from thingc.documents.spec.name_types import ComponentField, ModeNames, PoseNames, ShownMountField

if TYPE_CHECKING:
    from thingc.model.resolve.tests import Reader
    from thingc.model.resolve.types import Reference

Interval = Annotated[list[LengthField], Field(min_length=2, max_length=2)]


class WithinSpec(Model):
    """A box, given by the smallest and the largest value along each axis. The box is not limited along an omitted axis."""

    model_config = ConfigDict(json_schema_extra={"minProperties": 1})

    x: Interval | None = optional(["-10 mm", "10 mm"])
    """Smallest and largest x coordinate."""
    y: Interval | None = optional(["-10 mm", "10 mm"])
    """Smallest and largest y coordinate."""
    z: Interval | None = optional([0, "120 mm"])
    """Smallest and largest z coordinate."""

    def _check_rules(self) -> None:
        if self.x is None and self.y is None and self.z is None:
            raise rule("`within` requires bounds on `x`, `y` or `z`", "write, for example, `x: [-10 mm, 10 mm]`")


class CentreTest(Model):
    """The centre of mass of the robot, or of some components, must be inside a box."""

    of: ComponentField | None = None
    """The name of a component, or a pattern for several components; default: the whole robot."""
    in_: ShownMountField | None = Field(default=None, alias="in", description="The frame, a mount; default: the world of the mode.")
    mode: ModeNames | None = optional("bench", ["bench", "wall"])
    """Names or patterns of modes, or `all`; default: the first mode."""
    pose: PoseNames | None = optional("home", "leg_*", ["home", "reach"])
    """Names or patterns of poses, or `all` keyframes of the mode; default: the start pose of the mode."""
    within: WithinSpec = Field(examples=[{"x": ["-10 mm", "10 mm"], "y": ["-10 mm", "10 mm"]}])
    """Bounds on the coordinates of the centre of mass in that frame."""


class CentreCheck(OneLineStruct):
    """A parsed `centre` test. The test requires the centre of mass of the named components, or of the whole robot, to be in a box.

    `box["x"]` contains the smallest and the largest x coordinate [m] of the centre of mass.
    """

    of: tuple[Reference, ...]
    frame: Reference | None
    box: dict[str, tuple[float, float]]


def read_centre(spec: CentreTest, reader: Reader) -> CentreCheck:
    """Parse the keys of a `centre` test."""
    box: dict[str, tuple[float, float]] = {}
    for axis in ("x", "y", "z"):
        bounds = getattr(spec.within, axis)
        if bounds is not None:
            box[axis] = reader.interval(bounds, ("within", axis), LENGTH, f"a bound on {axis}")
    return CentreCheck(of=reader.components(spec.of, "of"), frame=reader.mount(spec.in_, "in"), box=box)


KIND = CheckKind(
    name="centre", position=2, summary="The centre of mass is inside a box.", examples=[{"within": {"x": ["-10 mm", "10 mm"]}}],
    stub={"within": {"z": ["-1 m", "1 m"]}}, smooth={"centre": LENGTH}, model=CentreTest, read=read_centre,
)
