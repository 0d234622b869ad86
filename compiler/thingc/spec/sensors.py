"""The `sensors:` block of an `assembly/1` document."""

from __future__ import annotations

from typing import Literal

from pydantic import ConfigDict, model_validator

from thingc.spec.base import Model
from thingc.spec.fields import AngleField, fault
from thingc.spec.named import JointField, ShownMountField


class SensorSpec(Model):
    """What the robot measures: on a mount (`imu`, `force`, `camera`), or of a joint."""

    model_config = ConfigDict(json_schema_extra={
        "if": {"properties": {"type": {"const": "joint"}}, "required": ["type"]},
        "then": {"not": {"required": ["at"]}},
        "else": {"required": ["at"], "not": {"required": ["joint"]}},
        "dependentSchemas": {"fovy": {"properties": {"type": {"const": "camera"}}}},
    })

    type: Literal["imu", "force", "joint", "camera"]
    """`imu` (acceleration and rate of turn), `force` (and torque), `joint` (position and speed) or `camera`."""
    at: ShownMountField | None = None
    """The mount it sits on; a camera looks along its z, with its y up."""
    joint: JointField | None = None
    """Of a `joint` sensor the joint, if it is not the one that is called like the sensor."""
    fovy: AngleField | None = None
    """Of a camera the angle of view from bottom to top; 45 deg unless written."""

    @model_validator(mode="after")
    def _keys(self) -> SensorSpec:
        if self.type == "joint":
            if self.at is not None:
                raise fault(
                    "rule", "a `joint` sensor has no `at`: it measures a joint", help="write `joint: NAME`, or choose another `type`",
                )
        else:
            if self.at is None:
                raise fault("rule", f"a sensor of type `{self.type}` needs `at`; none is here", help="write for example `at: body.top`")
            if self.joint is not None:
                raise fault("rule", f"`joint` belongs to a sensor of type `joint`; this one is `{self.type}`", help="take it out")
        if self.fovy is not None and self.type != "camera":
            raise fault("rule", f"`fovy` belongs to a camera; this sensor is `{self.type}`", help="take it out")
        return self
