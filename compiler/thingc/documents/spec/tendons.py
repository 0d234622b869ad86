"""The `tendons:` block of an `assembly/1` document."""

from typing import Annotated

from pydantic import ConfigDict, Field

from thingc.documents.spec.base import Model, optional, require_either, require_with
from thingc.documents.spec.drives import DriveSpec, DynamicsSpec
from thingc.documents.spec.fields import JointValueField, LengthField, MultiplierField, NumberField
from thingc.documents.spec.name_types import CoordinateKey, ShownMountField


class TendonLimitSpec(Model):
    """The smallest and the largest length of a tendon."""

    lower: JointValueField | None = None
    """The smallest length of the tendon."""
    upper: JointValueField | None = None
    """The largest length of the tendon."""


class AroundSpec(Model):
    """A sphere or a cylinder around which a tendon wraps, between two mounts."""

    model_config = ConfigDict(json_schema_extra={"oneOf": [{"required": ["sphere"]}, {"required": ["cylinder"]}]})

    around: ShownMountField
    """The mount at the centre of the sphere or cylinder. The z axis of the mount is the axis of the cylinder."""
    sphere: LengthField | None = None
    """The radius of a sphere."""
    cylinder: LengthField | None = None
    """The radius of an infinite cylinder."""
    side: ShownMountField | None = None
    """A mount outside the sphere or cylinder, on the same link. The tendon passes on the side of this mount; default: the shorter side."""

    def _check_rules(self) -> None:
        require_either(self, "sphere", "cylinder", "`around`", "write the radius, for example `cylinder: 12 mm`")


class PulleySpec(Model):
    """A pulley, which splits a path into segments. Lengths after the pulley are divided by a factor, as in a block and tackle."""

    pulley: NumberField
    """The divisor of the lengths after the pulley."""


class TendonSpec(Model):
    """A tendon, whose length is a sum of joint coordinates or the length of a path.

    Springs, dampers, limits and a drive act on this length.
    """

    model_config = ConfigDict(json_schema_extra={
        "oneOf": [{"required": ["joints"]}, {"required": ["path"]}], "dependentSchemas": {"width": {"required": ["path"]}},
    })

    joints: Annotated[dict[CoordinateKey, MultiplierField], Field(min_length=1)] | None = optional(
        {"left": "12 mm/rad", "right": "-8 mm/rad"},
    )
    """Change of the tendon's length per unit of each joint coordinate. The length is the sum over all joints."""
    path: Annotated[list[ShownMountField | AroundSpec | PulleySpec], Field(min_length=2)] | None = optional(
        ["arm.hook", {"around": "drum.axle", "cylinder": "12 mm"}, "hand.hook"],
    )
    """The path of the tendon: mounts, spheres and cylinders between two mounts, and pulleys."""
    width: LengthField | None = None
    """The diameter with which a tendon along a path is drawn."""
    limit: TendonLimitSpec | None = optional({"lower": "-10 mm", "upper": "25 mm"})
    """The smallest and largest length of the tendon."""
    dynamics: DynamicsSpec | None = optional({"stiffness": "200 N/m", "rest": "5 mm"})
    """The passive dynamics of the tendon."""
    drive: DriveSpec | None = optional({"kind": "motor", "effort": "40 N"})
    """The drive of the tendon."""

    def _check_rules(self) -> None:
        require_either(self, "joints", "path", "a tendon", "write, for example, `path: [arm.hook, hand.hook]`")
        require_with(self, "width", "path", "remove `width`: a tendon with `joints` does not have a path")
