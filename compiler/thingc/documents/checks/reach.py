"""The document test `reach`: the largest distance between two mounts, over the ranges of all joints, must be within bounds."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pydantic import Field

from thingc.base.one_line_repr import OneLineStruct
from thingc.base.units import LENGTH
from thingc.documents.checks.kind import BOUNDED, CheckKind, require_bounds
from thingc.documents.spec.base import Model
from thingc.documents.spec.fields import LengthField
from thingc.documents.spec.name_types import ShownMountField

if TYPE_CHECKING:
    from thingc.model.resolve.tests import Reader
    from thingc.model.resolve.types import Reference


class ReachTest(Model):
    """The greatest distance between two mounts, over the ranges of all joints, must be within bounds."""

    model_config = BOUNDED

    of: ShownMountField
    """The mount whose distance from the mount `from` is measured."""
    from_: ShownMountField = Field(alias="from", description="The mount from which the distance is measured.")
    min: LengthField | None = None
    """Lower bound of the greatest distance."""
    max: LengthField | None = None
    """Upper bound of the greatest distance. The distance is measured by a search, which can miss greater distances."""

    def _check_rules(self) -> None:
        require_bounds(self.min, self.max, "reach", "min: 300 mm")


class ReachCheck(OneLineStruct):
    """A parsed `reach` test.

    The test requires the largest distance [m] between the mounts `of` and `base`, over the ranges of all joints, to be within bounds.
    """

    of: Reference
    base: Reference
    minimum: float | None
    maximum: float | None


def read_reach(spec: ReachTest, reader: Reader) -> ReachCheck | None:
    """Parse the keys of a `reach` test. If the test is invalid, report the error and return None."""
    of, base = reader.mount(spec.of, "of"), reader.mount(spec.from_, "from")
    low, high = reader.bounds(spec.min, spec.max, LENGTH, "the reach")
    return ReachCheck(of=of, base=base, minimum=low, maximum=high) if of is not None and base is not None else None


KIND = CheckKind(
    name="reach", position=3, summary="The greatest distance between two mounts is within bounds.",
    examples=[{"of": "hand.tip", "from": "plate.bottom", "min": "300 mm"}],
    stub={"of": "$mount", "from": "$base", "min": "1 mm"}, lengths=("reach",),
    smooth={"reach": LENGTH}, model=ReachTest, read=read_reach,
)
