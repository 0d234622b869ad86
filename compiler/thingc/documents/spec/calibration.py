"""The `calibration/1` document, key by key. Field docstrings are the hover text of an editor."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import ConfigDict, Field, model_validator

from thingc.base.units import ANGLE, LENGTH
from thingc.documents.spec.base import Model, rule
from thingc.documents.spec.fields import Value, quantity
from thingc.documents.spec.name_types import JointPattern


class MotorSpec(Model):
    """The motor of a joint, and its encoder: `ticks = offset + sign * q / resolution`."""

    model_config = ConfigDict(json_schema_extra={"oneOf": [{"required": ["ticks_per_turn"]}, {"required": ["resolution"]}]})

    id: int = Field(examples=[3])
    """The identifier of the motor on its bus, from 0 to 253."""
    model: str | None = Field(default=None, examples=["sts3215"])
    """The model of the motor."""
    offset: int = Field(examples=[2047])
    """The encoder value at q = 0, in ticks."""
    sign: Literal[1, -1] = 1
    """Whether the encoder value increases (1) or decreases (-1) with q."""
    ticks_per_turn: int | None = Field(default=None, examples=[4096])
    """The number of encoder values per turn of the joint. The encoder value is at least 0 and less than this number."""
    resolution: Annotated[Value, quantity(ANGLE, LENGTH)] | None = Field(default=None, examples=["0.01 mm"])
    """The motion of the joint per tick, for encoders that count several turns."""
    range: Annotated[list[int], Field(min_length=2, max_length=2)] | None = Field(default=None, examples=[[884, 3320]])
    """The measured smallest and largest encoder value; default: from the limits of the joint."""

    @model_validator(mode="after")
    def _one_scale(self) -> MotorSpec:
        if (self.ticks_per_turn is None) == (self.resolution is None):
            here = "found none" if self.resolution is None else "found both"
            help = "write, for example, `ticks_per_turn: 4096`"
            raise rule(f"a motor needs exactly one of `ticks_per_turn` and `resolution`, {here}", help)
        return self


class CalibrationSpec(Model):
    """The motors and encoders of a physical robot."""

    thingc: Literal["calibration/1"]
    """Kind and version of this document."""
    description: str = Field(default="", examples=["Follower arm on the left desk."])
    """A one-line description."""
    joints: dict[JointPattern, MotorSpec] = Field(examples=[{"elbow": {"id": 3, "offset": 2047, "sign": -1, "ticks_per_turn": 4096}}])
    """The motor of each joint, by the name of the joint in the robot."""
