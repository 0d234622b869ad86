"""The `tendons:` block of an `assembly/1` document."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import ConfigDict, Field, model_validator

from thingc.documents.spec.base import Model, rule
from thingc.documents.spec.drives import DriveSpec, DynamicsSpec
from thingc.documents.spec.fields import JointValueField, LengthField, MultiplierField, NumberField
from thingc.documents.spec.name_types import CoordinateKey, ShownMountField


class TendonLimitSpec(Model):
    """Between which lengths a tendon stays."""

    lower: JointValueField | None = None
    """The smallest length."""
    upper: JointValueField | None = None
    """The largest length."""


class AroundSpec(Model):
    """A sphere or a cylinder that a tendon goes around, between two mounts."""

    model_config = ConfigDict(json_schema_extra={"oneOf": [{"required": ["sphere"]}, {"required": ["cylinder"]}]})

    around: ShownMountField
    """The mount at its centre; z of the mount is the axis of a cylinder."""
    sphere: LengthField | None = None
    """The radius of a sphere."""
    cylinder: LengthField | None = None
    """The radius of a cylinder, which has no ends."""
    side: ShownMountField | None = None
    """A mount outside of it, on the same link: on that side the tendon goes by; on the shorter one unless written."""

    @model_validator(mode="after")
    def _one_shape(self) -> AroundSpec:
        if (self.sphere is None) == (self.cylinder is None):
            here = "none is here" if self.sphere is None else "both are here"
            help = "write for example `cylinder: 12 mm`, its radius"
            raise rule(f"a tendon goes around exactly one of `sphere` and `cylinder`; {here}", help)
        return self


class PulleySpec(Model):
    """Where a path begins anew: what is behind counts by a part only, as a rope does that a block divides."""

    pulley: NumberField
    """By what the lengths behind it are divided."""


def _rules(schema: dict[str, Any]) -> None:
    """What `TendonSpec` checks beyond its fields, for editors."""
    schema["oneOf"] = [{"required": ["joints"]}, {"required": ["path"]}]
    schema["dependentSchemas"] = {"width": {"required": ["path"]}}


class TendonSpec(Model):
    """A sum of coordinates, or a path through mounts: a length, which springs, dampers, limits and a drive act along."""

    model_config = ConfigDict(json_schema_extra=_rules)

    joints: Annotated[dict[CoordinateKey, MultiplierField], Field(min_length=1)] | None = Field(
        default=None, examples=[{"left": "12 mm/rad", "right": "-8 mm/rad"}],
    )
    """By how much it gets longer for each unit of a joint of this document; the length is the sum."""
    path: Annotated[list[ShownMountField | AroundSpec | PulleySpec], Field(min_length=2)] | None = Field(
        default=None, examples=[["arm.hook", {"around": "drum.axle", "cylinder": "12 mm"}, "hand.hook"]],
    )
    """The mounts that it goes through, with what it goes around between two of them, and pulleys; its length is that of the path."""
    width: LengthField | None = None
    """For a tendon along a path, its diameter when drawn."""
    limit: TendonLimitSpec | None = Field(default=None, examples=[{"lower": "-10 mm", "upper": "25 mm"}])
    """Between which lengths it stays."""
    dynamics: DynamicsSpec | None = Field(default=None, examples=[{"stiffness": "200 N/m", "rest": "5 mm"}])
    """What it does by itself."""
    drive: DriveSpec | None = Field(default=None, examples=[{"kind": "motor", "effort": "40 N"}])
    """What pulls it."""

    @model_validator(mode="after")
    def _one_way(self) -> TendonSpec:
        if (self.joints is None) == (self.path is None):
            here = "none is here" if self.joints is None else "both are here"
            raise rule(f"a tendon goes over `joints` or along a `path`; {here}", "write for example `path: [arm.hook, hand.hook]`")
        if self.width is not None and self.path is None:
            raise rule("`width` belongs to a tendon on a `path`", "take it out: one over joints is nowhere", "width")
        return self
