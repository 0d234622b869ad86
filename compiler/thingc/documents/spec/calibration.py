"""The `calibration/1` document, key by key. Field docstrings are the hover text of an editor."""

from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field

from thingc.base.units import ANGLE, LENGTH, Quantity
from thingc.documents.expressions.evaluation import evaluate
from thingc.documents.expressions.terms import Expression, ExpressionError
from thingc.documents.spec.base import Model, optional, require_either, rule
from thingc.documents.spec.fields import FieldValidator, describe, fault, quantity, raise_all, read_value, within
from thingc.documents.spec.name_types import JointPattern

MOST_TICKS = 1 << 32
"""Largest accepted encoder value."""
FINEST = 1e-12
"""Smallest accepted resolution [rad or m]."""


def _whole_number(minimum: int, maximum: int) -> FieldValidator:
    def validate(value: Any) -> int:
        if isinstance(value, bool) or not isinstance(value, int):
            raise fault("type", f"expected a whole number, found {describe(value)}")
        if not minimum <= value <= maximum:
            raise fault("quantity", f"expected a whole number from {minimum} to {maximum}, found {value}")
        return value

    return FieldValidator(validate, "a whole number", {"type": "integer", "minimum": minimum, "maximum": maximum})


def _sign(value: Any) -> int:
    if type(value) is not int or abs(value) != 1:
        raise fault("choice", f"expected `1` or `-1`, found {describe(value)}")
    return value


def _resolution(value: Any) -> Quantity:
    """Validate the motion of a joint per tick. Expressions cannot use parameters, because a calibration has none."""
    parsed = read_value(value, (ANGLE, LENGTH), "an angle or a length", "0.01 mm")
    try:
        resolution = evaluate(parsed, {}) if isinstance(parsed, Expression) else parsed
    except ExpressionError as error:
        raise fault("expression", error.message, help="use only numbers with units", offset=error.offset, end=error.end) from None
    if not isinstance(resolution, Quantity) or resolution.dimension not in (ANGLE, LENGTH) or resolution.value < FINEST:
        help = "write the angle or the length per encoder tick, such as `0.01 mm`"
        raise fault("quantity", f"expected an angle or a length of at least {FINEST:g} in SI units, found `{resolution}`", help=help)
    return resolution


EncoderValue = Annotated[int, _whole_number(-MOST_TICKS, MOST_TICKS)]
Resolution = Annotated[Quantity, FieldValidator(_resolution, "an angle or a length", quantity(ANGLE, LENGTH).schema)]


class MotorSpec(Model):
    """The motor of a joint, and its encoder: `ticks = offset + sign * q / resolution`."""

    model_config = ConfigDict(json_schema_extra={"oneOf": [{"required": ["ticks_per_turn"]}, {"required": ["resolution"]}]})

    id: Annotated[int, _whole_number(0, 253)] = Field(examples=[3])  # 254 and 255 are broadcast addresses of Feetech and Dynamixel
    """The identifier of the motor on its bus, from 0 to 253."""
    model: str | None = optional("sts3215")
    """The model of the motor."""
    offset: EncoderValue = Field(examples=[2047])
    """The encoder value at q = 0, in ticks."""
    sign: Annotated[int, FieldValidator(_sign, "`1` or `-1`", {"type": "integer", "enum": [1, -1]})] = 1
    """Whether the encoder value increases (1) or decreases (-1) with q."""
    ticks_per_turn: Annotated[int, _whole_number(2, MOST_TICKS)] | None = optional(4096)
    """The number of encoder values per turn of the joint. The encoder value is at least 0 and less than this number."""
    resolution: Resolution | None = optional("0.01 mm")
    """The motion of the joint per tick, for encoders that count several turns."""
    range: Annotated[list[EncoderValue], Field(min_length=2, max_length=2)] | None = optional([884, 3320])
    """The measured smallest and largest encoder value; default: from the limits of the joint."""

    def _check_rules(self) -> None:
        require_either(self, "ticks_per_turn", "resolution", "a motor", "write, for example, `ticks_per_turn: 4096`")
        count, ends, wrong = self.ticks_per_turn, self.range or [], []
        if ends and ends[0] >= ends[1]:
            help = "write the smallest encoder value first"
            wrong.append(rule(f"the `range` must increase, found {ends[0]} and {ends[1]}", help, "range"))
        values = [("offset", self.offset), *(("range", value) for value in ends)]
        wrong += [
            rule(f"expected an encoder value from 0 to {count - 1}, found {value}", "write an encoder value, without a homing offset", key)
            for key, value in values if count is not None and not 0 <= value < count
        ]
        raise_all(wrong)


class CalibrationSpec(Model):
    """The motors and encoders of a physical robot."""

    thingc: Literal["calibration/1"]
    """Kind and version of this document."""
    description: str = Field(default="", examples=["Follower arm on the left desk."])
    """A one-line description."""
    joints: dict[JointPattern, MotorSpec] = Field(examples=[{"elbow": {"id": 3, "offset": 2047, "sign": -1, "ticks_per_turn": 4096}}])
    """The motor of each joint, by the name of the joint in the robot."""

    def _check_rules(self) -> None:
        joints: dict[int, str] = {}
        help = "give each motor of the bus a different `id`"
        raise_all([
            within(rule(f"joints `{joints[motor.id]}` and `{name}` have the same motor `id: {motor.id}`", help), ("joints", name, "id"))
            for name, motor in self.joints.items() if joints.setdefault(motor.id, name) != name
        ])
