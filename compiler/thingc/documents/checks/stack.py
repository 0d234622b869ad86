"""The document test `stack`: the deviation between two mounts that the tolerances of all parts between them cause must be within bounds."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from pydantic import Field

from thingc.base.diagnostics import Code
from thingc.base.one_line_repr import OneLineStruct
from thingc.base.pose import Vector
from thingc.base.units import LENGTH, NUMBER
from thingc.documents.checks.kind import CheckKind, read_direction
from thingc.documents.spec.base import Model, optional, rule
from thingc.documents.spec.fields import LengthField, NumberField, RatioField
from thingc.documents.spec.name_types import ModeNames, PoseNames, ShownMountField

if TYPE_CHECKING:
    from thingc.model.resolve.tests import Reader
    from thingc.model.resolve.types import Reference


class StackTest(Model):
    """The deviation of a mount along one direction, caused by tolerances and backlash, must be within bounds."""

    of: ShownMountField
    """The mount whose deviation is computed."""
    from_: ShownMountField = Field(alias="from", description="The mount relative to which the deviation is computed.")
    along: Annotated[list[NumberField], Field(min_length=3, max_length=3)] = Field(examples=[[0, 0, 1]])
    """Direction of the deviation in the frame of the mount `from`: three numbers, of any length."""
    mode: ModeNames | None = optional("bench", ["bench", "wall"])
    """Names or patterns of modes, or `all`; default: the first mode."""
    pose: PoseNames | None = optional("home", "leg_*", ["home", "reach"])
    """Names or patterns of poses, or `all` keyframes of the mode; default: the start pose of the mode."""
    worst: LengthField | None = None
    """The largest allowed deviation if all contributions have the same sign."""
    rss: LengthField | None = None
    """The largest allowed root of the sum of squares of all contributions."""
    within: LengthField | None = None
    """The deviation within which the share `yield` of all robots must be."""
    yield_: RatioField | None = Field(
        default=None, alias="yield", examples=["99 %"],
        description="The smallest share of robots whose deviation is at most `within`. Each tolerance is three standard deviations.",
    )

    def _check_rules(self) -> None:
        if (self.within is None) != (self.yield_ is None):
            raise rule("`within` and `yield` must be used together", "write, for example, `within: 0.5 mm` and `yield: 99 %`")
        if self.worst is None and self.rss is None and self.within is None:
            raise rule("a `stack` test requires `worst`, `rss`, or `within` and `yield`", "write, for example, `rss: 0.5 mm`")


class StackCheck(OneLineStruct):
    """A parsed `stack` test of the deviation of the mount `of` from the mount `base`.

    `along` is a unit vector in the frame of `base`. The bounds `worst`, `rss` and `within` are in metres, and `share` is between 0 and 1.
    """

    of: Reference
    base: Reference
    along: Vector
    worst: float | None
    rss: float | None
    within: float | None
    share: float | None


def read_stack(spec: StackTest, reader: Reader) -> StackCheck | None:
    """Parse the keys of a `stack` test. If the test is invalid, report the error and return None."""
    of, base = reader.mount(spec.of, "of"), reader.mount(spec.from_, "from")
    along = read_direction(spec.along, reader, "along", "[0, 0, 1]")
    worst, rss, within = (
        None if raw is None else reader.number(raw, key, LENGTH, above=0.0)
        for key, raw in (("worst", spec.worst), ("rss", spec.rss), ("within", spec.within))
    )
    share = None if spec.yield_ is None else reader.number(spec.yield_, "yield", NUMBER, above=0.0, most=1.0)
    if share == 1.0:
        reader.error(Code.OUT_OF_RANGE, "`yield` must be below 100 %", "yield", help="use `worst` to limit the deviation of all robots")
    if of is None or base is None or along is None:
        return None
    return StackCheck(of=of, base=base, along=along, worst=worst, rss=rss, within=within, share=share)


KIND = CheckKind(
    name="stack", position=10, summary="The deviation that tolerances cause between two mounts is within bounds.",
    examples=[{"of": "hand.tip", "from": "plate.bottom", "along": [0, 0, 1], "rss": "0.5 mm"}],
    stub={"of": "$mount", "from": "$base", "along": ["0", "0", "1"], "worst": "1 mm"}, lengths=("worst", "rss"),
    smooth={"worst": LENGTH, "rss": LENGTH}, model=StackTest, read=read_stack,
)
