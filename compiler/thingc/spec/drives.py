"""What acts along a coordinate or a tendon: springs and friction of its own, and a drive."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import ConfigDict, Field, model_validator

from thingc.spec.base import Model, rule
from thingc.spec.fields import (
    ArmatureField,
    DampingField,
    EffortField,
    FrictionField,
    JointValueField,
    NumberField,
    SpeedField,
    StiffnessField,
)


class DynamicsSpec(Model):
    """What a joint does by itself."""

    damping: DampingField | None = None
    """Viscous friction: torque or force per speed."""
    friction: FrictionField | None = None
    """Dry friction: torque or force."""
    armature: ArmatureField | None = None
    """Reflected rotor inertia; from the drive unless written."""
    stiffness: StiffnessField | None = None
    """A spring towards its `rest`: torque or force per turn or length."""
    rest: JointValueField | None = Field(default=None, examples=["20 deg"])
    """The q at which the spring does nothing; 0 unless written."""


class DriveSpec(Model):
    """An inline actuator."""

    model_config = ConfigDict(json_schema_extra={
        "if": {"properties": {"kind": {"const": "position"}}, "required": ["kind"]}, "then": {"required": ["kp"]},
    })

    kind: Literal["position", "velocity", "motor"]
    """What is commanded: a position, a velocity, or the torque or force itself (`motor`)."""
    kp: StiffnessField | None = None
    """Position gain: torque per angle, or force per length."""
    kv: DampingField | None = None
    """Velocity gain: torque or force per speed."""
    effort: EffortField | None = None
    """Largest torque or force."""
    velocity: SpeedField | None = None
    """Largest speed."""
    armature: ArmatureField | None = None
    """Reflected rotor inertia."""
    axis: Annotated[list[NumberField], Field(min_length=3, max_length=3)] | None = Field(default=None, examples=[[1, 0, 0]])
    """The axis about which it turns a ball: in the parent mount's axes at q = 0, from where it goes with the child."""

    @model_validator(mode="after")
    def _gain(self) -> DriveSpec:
        if self.kind == "position" and self.kp is None:
            raise rule("a position drive needs `kp`; none is here", "write for example `kp: 20 N*m/rad`")
        return self
