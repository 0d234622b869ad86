"""Springs, friction and drives that act along a joint coordinate or a tendon."""

from typing import Annotated, Literal

from pydantic import ConfigDict, Field, ValidationInfo, field_validator
from pydantic_core import PydanticKnownError

from thingc.documents.spec import fields
from thingc.documents.spec.base import Model, optional, rule
from thingc.documents.spec.name_types import ComponentField

DriveKind = Literal["position", "velocity", "motor"]

UNUSED = {"velocity": ("kp",), "motor": ("kp", "kv")}
"""Gains that each kind of drive does not use. Documents cannot override these gains."""


class DynamicsSpec(Model):
    """The passive dynamics of a joint: damping, friction, armature and spring."""

    damping: fields.DampingField | None = None
    """Viscous friction: torque or force per speed."""
    friction: fields.FrictionField | None = None
    """Dry friction: torque or force."""
    armature: fields.ArmatureField | None = None
    """Reflected rotor inertia; default: from the drive."""
    stiffness: fields.StiffnessField | None = None
    """Stiffness of a spring towards its `rest`: torque or force per angle or length."""
    rest: fields.JointValueField | None = optional("20 deg")
    """The rest position of the spring; default: 0."""


class DriveSpec(Model):
    """A drive: either its values, or a component that is an actuator, with some values replaced."""

    model_config = ConfigDict(json_schema_extra={
        "anyOf": [{"required": ["component"]}, {"required": ["kind"]}],
        "dependentRequired": {"noise": ["kind"], "deadband": ["kind"]},
        "if": {"properties": {"kind": {"const": "position"}, "component": False}, "required": ["kind"]}, "then": {"required": ["kp"]},
        "allOf": [
            {
                "if": {"properties": {"kind": {"const": kind}}, "required": ["kind", "component"]},
                "then": {"properties": dict.fromkeys(unused, False)},
            }
            for kind, unused in UNUSED.items()
        ],
    })

    component: ComponentField | None = None
    """A component that is an actuator. The other keys replace values of the actuator."""
    kind: DriveKind | None = Field(default=None, validate_default=True)
    """The commanded quantity: a position, a velocity, or the torque or force itself (`motor`); default: as in the component."""
    kp: fields.StiffnessField | None = None
    """Position gain: torque per angle, or force per length."""
    kv: fields.DampingField | None = None
    """Velocity gain: torque or force per speed."""
    effort: fields.EffortField | None = None
    """Largest torque or force."""
    velocity: fields.SpeedField | None = None
    """Largest speed."""
    armature: fields.ArmatureField | None = None
    """Reflected rotor inertia."""
    stall: fields.EffortField | None = None
    """Stall torque or force, which is the maximum at rest. The maximum falls linearly to 0 at `velocity`."""
    delay: fields.TimeField | None = optional("10 ms")
    """Time until a command takes effect."""
    deadband: fields.CommandField | None = optional("0.5 deg")
    """Largest difference between the command and the motion that the drive ignores; for a `motor`, the largest ignored command."""
    noise: fields.CommandField | None = optional("0.1 deg")
    """Standard deviation of the noise that is added to the command."""
    axis: Annotated[list[fields.NumberField], Field(min_length=3, max_length=3)] | None = optional([1, 0, 0])
    """The axis of the drive of a ball joint, in the axes of the parent mount at q = 0. The axis moves with the child mount."""

    @field_validator("kind")
    @classmethod
    def _kind_or_component(cls, kind: str | None, info: ValidationInfo) -> str | None:
        if kind is None and info.data.get("component", "wrong") is None:
            raise PydanticKnownError("missing")
        return kind

    def _check_rules(self) -> None:
        for key in UNUSED.get(self.kind or "", ()) if self.component is not None else ():
            if getattr(self, key) is not None:
                raise rule(f"a {self.kind} drive cannot have `{key}`", f"remove `{key}`", key)
        for key in ("noise", "deadband") if self.kind is None else ():
            if getattr(self, key) is not None:
                raise rule(f"`{key}` requires `kind`", "write, for example, `kind: position`", key)
        if self.kind == "position" and self.kp is None and self.component is None:
            raise rule("a position drive requires `kp`", "write, for example, `kp: 20 N*m/rad`")
