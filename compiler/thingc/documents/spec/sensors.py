"""The `sensors:` block of an `assembly/1` document."""

from typing import Annotated, Any

from pydantic import ConfigDict, Field

from thingc.base.primitives import PrimitiveShape
from thingc.base.sensor_kinds import SENSORS, ReadingName, SensorKey, SensorType
from thingc.base.units import ACCELERATION, ANGLE, ANGULAR_VELOCITY, FORCE, LENGTH, TORQUE, VELOCITY
from thingc.documents.spec.annotation_types import one_of
from thingc.documents.spec.base import Model, optional, require_one, rule
from thingc.documents.spec.fields import AngleField, LengthField, Value, Vector3Length, quantity
from thingc.documents.spec.link_shapes import LongSpec, RoundSpec
from thingc.documents.spec.name_types import ComponentField, JointField, ShownMountField, TendonField

_READINGS = (ACCELERATION, ANGULAR_VELOCITY, VELOCITY, FORCE, TORQUE, LENGTH, ANGLE)
ReadingField = Annotated[Value, quantity(*_READINGS, doc="a value in the unit of the sensor")]

VOLUMES: tuple[PrimitiveShape, ...] = ("box", "sphere", "cylinder", "capsule", "ellipsoid")
"""The possible shapes of the volume of a touch sensor."""

_EXAMPLES: dict[SensorKey, str] = {
    "at": "at: body.top", "joint": "joint: knee", "tendon": "tendon: cable", "of": "of: shin",
    "volume": "volume: {sphere: {radius: 10 mm}}",
}


class VolumeSpec(Model):
    """A volume around a mount, with exactly one of the keys `box`, `sphere`, `cylinder`, `capsule`, `ellipsoid`."""

    model_config = ConfigDict(json_schema_extra={"oneOf": [{"required": [kind]} for kind in VOLUMES]})

    box: Vector3Length | None = optional("20 20 5 mm")
    """A box: its lengths along x, y and z of the mount."""
    sphere: RoundSpec | None = optional({"radius": "10 mm"})
    """A sphere: its radius."""
    cylinder: LongSpec | None = optional({"radius": "10 mm", "length": "5 mm"})
    """A cylinder: its radius, and its length along z."""
    capsule: LongSpec | None = optional({"radius": "10 mm", "length": "20 mm"})
    """A capsule along z: a cylinder with this radius and length between two hemispheres."""
    ellipsoid: Vector3Length | None = optional("10 10 5 mm")
    """An ellipsoid: its half axes along x, y and z."""

    @property
    def kind(self) -> PrimitiveShape:
        """The kind of the volume, one of `VOLUMES`."""
        return next(kind for kind in VOLUMES if getattr(self, kind) is not None)

    def _check_rules(self) -> None:
        require_one(self, VOLUMES, "a volume", "write only one of these keys")


def _rules(schema: dict[str, Any]) -> None:
    """Add to the schema which keys each type of sensor accepts, so that editors can check them."""
    others = [key for key in schema["properties"] if key != "type"]
    schema["allOf"] = [
        {
            "if": {"properties": {"type": {"const": kind.name}}, "required": ["type"]},
            "then": {"allOf": [
                *({"required": [*group]} if len(group) == 1 else {"oneOf": [{"required": [key]} for key in group]} for group in kind.needs),
                {"not": {"anyOf": [{"required": [key]} for key in others if key not in kind.keys]}},
            ]},
        }
        for kind in SENSORS.values()
    ]


class SensorSpec(Model):
    """A sensor on a mount, or of a joint, a tendon, a drive, a link or the whole robot."""

    model_config = ConfigDict(json_schema_extra=_rules)

    type: SensorType
    """The type of the sensor, such as `imu`, `force`, `joint`, `camera`, `touch` or `rangefinder`."""
    at: ShownMountField | None = None
    """The mount of the sensor. Cameras and rangefinders look along its z axis. The y axis is the upward direction of a camera."""
    in_: ShownMountField | None = Field(
        default=None, alias="in", description="For a `pose` or a `twist`, the mount relative to which it is measured; default: the world.",
    )
    joint: JointField | None = None
    """The measured joint of a `joint` sensor (default: the joint with the name of the sensor), or the driven joint of a `drive` sensor."""
    tendon: TendonField | None = None
    """The measured tendon of this document, or the tendon whose drive is measured."""
    of: ComponentField | None = None
    """For a `contact` sensor, the component whose link is touched."""
    with_: ComponentField | None = Field(
        default=None, alias="with", description="For a `contact`, the component whose link is the other side; default: any.",
    )
    volume: VolumeSpec | None = optional({"sphere": {"radius": "10 mm"}})
    """For a `touch` sensor, the volume around the mount in which contacts of the link are measured."""
    range: LengthField | None = optional("4 m")
    """For a `rangefinder` sensor, the largest measured distance; default: unlimited."""
    fovy: AngleField | None = None
    """For a `camera` sensor, the vertical field of view; default: 45 deg."""
    noise: ReadingField | dict[ReadingName, ReadingField] | None = optional("0.02 m/s^2", {"gyro": "0.001 rad/s"})
    """The standard deviation of the noise; for several readings, a mapping by name of the reading."""
    cutoff: ReadingField | dict[ReadingName, ReadingField] | None = optional("160 m/s^2", {"gyro": "35 rad/s"})
    """The largest absolute value of the reading; for several readings, a mapping by name of the reading."""

    def value_of(self, key: SensorKey) -> Any:
        """Return the value of a key of the sensor. Return None if the document does not contain the key."""
        return getattr(self, f"{key}_" if key in ("in", "with") else key)

    def _check_rules(self) -> None:
        kind = SENSORS[self.type]
        for key in _KEYS:
            if self.value_of(key) is not None and key not in kind.keys:
                types = one_of([sensor.name for sensor in SENSORS.values() if key in sensor.keys])
                raise rule(f"a sensor of type `{self.type}` cannot have `{key}`", f"remove `{key}`, or choose another `type`: {types}", key)
        for group in kind.needs:
            written = [key for key in group if self.value_of(key) is not None]
            if len(written) != 1:
                required = " or ".join(f"`{key}`" for key in group)
                here = "found both" if written else "found none"
                help = "keep only one of the two keys" if written else f"write, for example, `{_EXAMPLES[group[0]]}`"
                raise rule(f"a sensor of type `{self.type}` requires {required}, {here}", help)


_KEYS: tuple[SensorKey, ...] = ("at", "in", "joint", "tendon", "of", "with", "volume", "range", "fovy", "noise", "cutoff")
