"""The `tendons:` block of an `assembly/1` document."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from thingc.spec.base import Model
from thingc.spec.drives import DriveSpec, DynamicsSpec
from thingc.spec.fields import JointValueField, MultiplierField
from thingc.spec.named import CoordinateKey


class TendonLimitSpec(Model):
    """Between which lengths a tendon stays."""

    lower: JointValueField | None = None
    """The smallest length."""
    upper: JointValueField | None = None
    """The largest length."""


class TendonSpec(Model):
    """A sum of coordinates, its length, which springs, dampers, limits and a drive act along."""

    joints: Annotated[dict[CoordinateKey, MultiplierField], Field(min_length=1)] = Field(
        examples=[{"left": "12 mm/rad", "right": "-8 mm/rad"}],
    )
    """By how much it gets longer for each unit of a joint of this document; the length is the sum."""
    limit: TendonLimitSpec | None = Field(default=None, examples=[{"lower": "-10 mm", "upper": "25 mm"}])
    """Between which lengths it stays."""
    dynamics: DynamicsSpec | None = Field(default=None, examples=[{"stiffness": "200 N/m", "rest": "5 mm"}])
    """What it does by itself."""
    drive: DriveSpec | None = Field(default=None, examples=[{"kind": "motor", "effort": "40 N"}])
    """What pulls it."""
