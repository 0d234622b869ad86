"""The kinds of sensors, the keys that they accept in documents, the values that they measure, and the settings of a sensor."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.one_line_repr import OneLineStruct
from thingc.base.primitives import Primitive
from thingc.base.source import Origin
from thingc.base.units import ACCELERATION, ANGULAR_VELOCITY, FORCE, LENGTH, TORQUE, VELOCITY, Dimension

SensorType = Literal[
    "imu", "force", "joint", "camera", "accelerometer", "gyro", "magnetometer", "velocimeter", "rangefinder", "touch", "contact", "pose",
    "twist", "centre", "tendon", "drive", "clock", "energy",
]
"""Values of a sensor's `type:`, the names of all kinds."""

ReadingName = Literal[
    "accelerometer", "gyro", "quat", "force", "torque", "position", "velocity", "effort", "magnetometer", "distance", "contact", "linear",
    "angular", "momentum", "length", "time", "potential", "kinetic",
]
"""Names of sensor readings."""

SensorKey = Literal["at", "in", "joint", "tendon", "of", "with", "volume", "range", "fovy", "noise", "cutoff"]
"""Keys of a sensor in documents, in addition to `type`."""

CoordinateKey = Literal["lower", "velocity", "effort"]
"""Key of a joint, tendon or drive whose unit is the unit of a reading. For example, a reading with the key `velocity` is an angular
velocity for a rotation and a velocity for a translation.
"""


class SensorReading(FrozenStruct):
    """A number or vector that a sensor measures.

    The name of the reading in exported files is `SENSOR:name`, where `SENSOR` is the name of the sensor.

    `unit` is the physical dimension of the noise and the cutoff of this reading. If `unit` is None, as for a quaternion, the reading cannot
    have noise or a cutoff.
    """

    name: ReadingName
    unit: Dimension | CoordinateKey | None = None


class SensorKind(FrozenStruct):
    """A kind of sensor, such as `gyro`, with the values that it measures and the keys that it accepts in documents.

    `needs` contains groups of keys; exactly one key of each group is required. The keys in `may` are optional.
    """

    name: SensorType
    readings: tuple[SensorReading, ...]
    needs: tuple[tuple[SensorKey, ...], ...]
    may: tuple[SensorKey, ...]

    @property
    def keys(self) -> frozenset[SensorKey]:
        """The keys that this kind of sensor accepts in a document, except `type`.

        If the measured values have a unit, the keys for noise and cutoff are accepted. A sensor with a `range` does not accept a cutoff.
        """
        keys = {key for group in self.needs for key in group} | {*self.may}
        if any(reading.unit is not None for reading in self.readings):
            keys |= {"noise"} if "range" in keys else {"noise", "cutoff"}
        return frozenset(keys)


class Measurement(OneLineStruct):
    """The settings of a sensor, which depend on its kind.

    `volume` is the sensitive volume of a touch sensor, in the frame of its mount. `fovy` [rad] is the vertical field of view of a camera.
    `noise` and `cutoff` [SI] map the name of each reading to its value.
    """

    kind: SensorType
    origin: Origin
    volume: Primitive | None = None
    fovy: float | None = None
    noise: dict[str, float] = {}
    cutoff: dict[str, float] = {}


def _kind(
    name: SensorType, readings: Mapping[ReadingName, Dimension | CoordinateKey | None], *needs: tuple[SensorKey, ...],
    may: tuple[SensorKey, ...] = (),
) -> SensorKind:
    read = tuple(SensorReading(name=one, unit=unit) for one, unit in readings.items())
    return SensorKind(name=name, readings=read, needs=needs, may=may)


_AT: tuple[SensorKey, ...] = ("at",)
_MOVED: Mapping[ReadingName, CoordinateKey] = {"position": "lower", "velocity": "velocity", "effort": "effort"}

_KINDS = (
    _kind("imu", {"accelerometer": ACCELERATION, "gyro": ANGULAR_VELOCITY, "quat": None}, _AT),
    _kind("force", {"force": FORCE, "torque": TORQUE}, _AT),
    _kind("joint", _MOVED, may=("joint",)),
    _kind("camera", {}, _AT, may=("fovy",)),
    _kind("accelerometer", {"accelerometer": ACCELERATION}, _AT),
    _kind("gyro", {"gyro": ANGULAR_VELOCITY}, _AT),
    _kind("magnetometer", {"magnetometer": None}, _AT),
    _kind("velocimeter", {"velocity": VELOCITY}, _AT),
    _kind("rangefinder", {"distance": LENGTH}, _AT, may=("range",)),
    _kind("touch", {"force": FORCE}, _AT, ("volume",)),
    _kind("contact", {"contact": None}, ("of",), may=("with",)),
    _kind("pose", {"position": LENGTH, "quat": None}, _AT, may=("in",)),
    _kind("twist", {"linear": VELOCITY, "angular": ANGULAR_VELOCITY}, _AT, may=("in",)),
    _kind("centre", {"position": LENGTH, "velocity": VELOCITY, "momentum": None}),
    _kind("tendon", {"length": "lower", "velocity": "velocity", "effort": "effort"}, ("tendon",)),
    _kind("drive", _MOVED, ("joint", "tendon")),
    _kind("clock", {"time": None}),
    _kind("energy", {"potential": TORQUE, "kinetic": TORQUE}),
)

SENSORS: Mapping[SensorType, SensorKind] = {kind.name: kind for kind in _KINDS}
"""Every kind by name, in the order of `SensorType`."""
