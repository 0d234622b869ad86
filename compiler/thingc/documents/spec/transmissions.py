"""The `transmissions:` block of an `assembly/1` document."""

from typing import Annotated, Any

from pydantic import ConfigDict, Field

from thingc.documents.spec.base import Model, given_keys, optional, rule
from thingc.documents.spec.drives import DriveSpec
from thingc.documents.spec.fields import ArmatureField, JointValueField, MultiplierField, RatioField
from thingc.documents.spec.name_types import ComponentField, CoordinateField
from thingc.documents.spec.repeats import RepeatSpec

MAX_COUPLED = 6
"""Maximum number of actuators of a differential."""
SIMPLE = ("actuator", "joint", "ratio")
"""Keys of a transmission between one actuator and one joint."""


def _square(count: int) -> dict[str, Any]:
    """Return the JSON Schema of a differential of `count` actuators and joints."""
    size = {"minItems": count, "maxItems": count}
    return {"properties": {"actuators": size, "joints": size, "matrix": {**size, "items": size}}}


class DifferentialSpec(Model):
    """A differential: several actuators that move equally many joints together."""

    model_config = ConfigDict(json_schema_extra={"anyOf": [_square(count) for count in range(2, MAX_COUPLED + 1)]})

    actuators: Annotated[list[DriveSpec | ComponentField], Field(min_length=2, max_length=MAX_COUPLED)] = Field(
        examples=[["motor_4", "motor_5"]],
    )
    """The actuators: components with an actuator, or inline drives."""
    joints: Annotated[list[CoordinateField], Field(min_length=2, max_length=MAX_COUPLED)] = Field(examples=[["wrist_pitch", "wrist_roll"]])
    """The joints of this document that the actuators move."""
    matrix: Annotated[list[list[MultiplierField]], Field(min_length=2, max_length=MAX_COUPLED)] = Field(examples=[[[1, 1], [1, -1]]])
    """A row for each actuator: its revolutions per revolution of each joint."""

    def _check_rules(self) -> None:
        count = len(self.actuators)
        if len(self.joints) != count:
            raise rule(f"expected {count} joints for {count} actuators of the differential, found {len(self.joints)}",
                       "list the same number of `actuators` and `joints`", "joints")
        if len(self.matrix) != count or any(len(row) != count for row in self.matrix):
            raise rule(f"`matrix` must have {count} rows of {count} numbers", "write, for example, `[[1, 1], [1, -1]]`", "matrix")


class TransmissionSpec(Model):
    """A transmission, such as a gearbox or a belt, between an actuator and a joint, or a differential."""

    model_config = ConfigDict(json_schema_extra={
        "oneOf": [
            {"required": list(SIMPLE)},
            {"required": ["differential"], "properties": dict.fromkeys((*SIMPLE, "backlash"), False)},
        ],
    })

    actuator: DriveSpec | ComponentField | None = optional("motor_2", {"kind": "motor", "effort": "0.4 N*m"})
    """The actuator: a component with an actuator, or an inline drive. All its values are on the motor side of the transmission."""
    joint: CoordinateField | None = optional("knee")
    """The joint of this document that the actuator moves."""
    ratio: MultiplierField | None = optional(9, "=teeth_joint / teeth_motor", "-125 rev/m")
    """Revolutions of the actuator per revolution of the joint; negative if they turn in opposite directions."""
    differential: DifferentialSpec | None = optional(
        {"actuators": ["left", "right"], "joints": ["pitch", "roll"], "matrix": [[1, 1], [1, -1]]},
    )
    """Several actuators that move several joints together, instead of `actuator`, `joint` and `ratio`."""
    efficiency: RatioField = Field(default=1, examples=["85 %"])  # type: ignore[assignment]
    """Ratio of the transmitted torque to the torque without losses; default: 1."""
    backlash: JointValueField | None = optional("0.3 deg")
    """Play of the transmission, measured at the joint."""
    inertia: ArmatureField | None = optional("4.1e-6 kg*m^2")
    """Inertia of the transmission at the actuator, in addition to the inertia of the rotor; in a differential, at each actuator."""
    repeat: RepeatSpec | None = optional({"count": 6})
    """Repeats the entry as `name_0`, `name_1` and so on."""

    def _check_rules(self) -> None:
        missing = [f"`{key}`" for key in SIMPLE if getattr(self, key) is None]
        if self.differential is not None:
            for key in given_keys(self, (*SIMPLE, "backlash")):
                raise rule(f"a transmission with `differential` cannot have `{key}`", f"remove `{key}`", key)
        elif missing:
            raise rule(f"a transmission requires {' and '.join(missing)}", "write, for example, `{actuator: motor, joint: knee, ratio: 9}`")
