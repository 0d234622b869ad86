"""The document test `mass`: the mass of the robot, or of some components, must be within bounds."""

from __future__ import annotations

from typing import TYPE_CHECKING

from thingc.base.one_line_repr import OneLineStruct
from thingc.base.units import MASS
from thingc.documents.checks.kind import BOUNDED, CheckKind, require_bounds
from thingc.documents.spec.base import Model
from thingc.documents.spec.fields import MassField
from thingc.documents.spec.name_types import ComponentField

if TYPE_CHECKING:
    from thingc.model.resolve.tests import Reader
    from thingc.model.resolve.types import Reference


class MassTest(Model):
    """The mass of the robot, or of some components, must be within bounds."""

    model_config = BOUNDED

    of: ComponentField | None = None
    """The name of a component, or a pattern for several components; default: the whole robot. A nested assembly includes all its
    components.
    """
    min: MassField | None = None
    """The smallest mass allowed."""
    max: MassField | None = None
    """The largest mass allowed."""

    def _check_rules(self) -> None:
        require_bounds(self.min, self.max, "mass", "max: 2.2 kg")


class MassCheck(OneLineStruct):
    """A parsed `mass` test. The test requires the mass [kg] of the named components, or of the whole robot, to be within bounds."""

    of: tuple[Reference, ...]
    minimum: float | None
    maximum: float | None


def read_mass(spec: MassTest, reader: Reader) -> MassCheck:
    """Parse the keys of a `mass` test."""
    low, high = reader.bounds(spec.min, spec.max, MASS, "the mass")
    return MassCheck(of=reader.components(spec.of, "of"), minimum=low, maximum=high)


KIND = CheckKind(
    name="mass", position=1, summary="The mass is within bounds.", examples=[{"max": "2.2 kg"}], stub={"max": "10 kg"},
    smooth={"mass": MASS}, model=MassTest, read=read_mass,
)
