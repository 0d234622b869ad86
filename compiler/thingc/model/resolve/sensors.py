"""Resolve the sensors of a document: their mounts and the joints, tendons, drives and links that they measure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Literal

from thingc.base import numeric
from thingc.base.diagnostics import Code
from thingc.base.joints.twist import dimensions_of
from thingc.base.pose import NO_POSE
from thingc.base.sensor_kinds import SENSORS, ReadingName
from thingc.base.source import Path
from thingc.base.suggestions import Hint, did_you_mean
from thingc.base.units import ANGLE, LENGTH, Dimension, Quantity
from thingc.documents.spec.sensors import SensorSpec
from thingc.model.resolve import references
from thingc.model.resolve.coordinates import CoordinateName
from thingc.model.resolve.document_scope import DocumentScope
from thingc.model.resolve.references import suggest
from thingc.model.resolve.scope import Scope
from thingc.model.resolve.shapes import primitive
from thingc.model.resolve.transmissions import undriven_reported
from thingc.model.resolve.types import Joint, Reference, Sensor, Tendon

FOVY = numeric.radians(45.0)
"""Default field of view [rad] of a camera, as in MuJoCo."""


def sensors(table: DocumentScope, scope: Scope, tendons: Sequence[Tendon]) -> Iterator[Sensor]:
    """Yield the resolved sensors of a document, in the order of the document. Invalid sensors are reported and omitted."""
    by_name = {one.name: one for one in tendons}
    for name, spec in table.spec.sensors.items():
        sensor = _Reader(table, scope, name, spec).sensor(by_name)
        if sensor is not None:
            yield sensor


class _Reader:
    """Resolves the references and values of one sensor. `sound` is True as long as no error has been reported.

    `coordinate` is the name of the measured joint coordinate. By default, it is the name of the sensor.
    """

    def __init__(self, table: DocumentScope, scope: Scope, name: str, spec: SensorSpec) -> None:
        self.table, self.scope, self.name, self.spec = table, scope, name, spec
        self.path: Path = ("sensors", name)
        self.coordinate = CoordinateName(spec.joint if spec.joint is not None else name)
        self.sound = True

    def sensor(self, tendons: Mapping[str, Tendon]) -> Sensor | None:
        """Resolve all references and values of a sensor. Return None if the sensor is invalid."""
        spec = self.spec
        joint = self._joint() if spec.joint is not None or spec.type == "joint" else None
        tendon = self._tendon(spec.tendon, tendons) if spec.tendon is not None else None
        mount, seen_from = self._mount("at", spec.at), self._mount("in", spec.in_)
        touching = (*self._component("of", spec.of), *self._component("with", spec.with_))
        volume = None
        if spec.volume is not None:
            volume = primitive(self.scope, spec.volume, (*self.path, "volume"), NO_POSE)
            self.sound &= volume is not None
        fovy = self._fovy() if spec.type == "camera" else None
        if not self.sound:
            return None
        of = None if joint is None or joint.twist is None else joint.twist.coordinate
        if tendon is not None:
            of = ANGLE if tendon.turns else LENGTH
        noise, cutoff = self._numbers("noise", spec.noise, of), self._numbers("cutoff", spec.cutoff, of)
        reach = self.scope.number(spec.range, (*self.path, "range"), LENGTH, f"`range` of sensor `{self.name}`", above=0.0)
        cutoff = cutoff if reach is None else {"distance": reach}
        return Sensor(
            name=self.name, kind=spec.type, at=mount, seen_from=seen_from, joint=None if joint is None else self.coordinate.path,
            tendon=spec.tendon, touching=touching, volume=volume, fovy=fovy, noise=noise, cutoff=cutoff,
            origin=self.scope.origin(self.path, key=True),
        )

    def _mount(self, key: str, text: str | None) -> Reference | None:
        if text is None:
            return None
        mount = references.shown_mount(self.table, self.scope, text, (*self.path, key))
        self.sound &= mount is not None
        return mount

    def _component(self, key: str, text: str | None) -> tuple[Reference, ...]:
        """Resolve the reference to a component whose contacts the sensor measures."""
        if text is None:
            return ()
        place: Path = (*self.path, key)
        named = references.component(self.table, self.scope, text, place)
        if named is not None and named[1].table is not None:
            self.scope.error(
                Code.REFERENCE, f"the touch sensor `{self.name}` cannot be on the assembly `{text}`", place,
                help="use a component of the assembly, for example `hand.finger`",
            )
            named = None
        self.sound &= named is not None
        return () if named is None else (named[0],)

    def _numbers(self, key: Literal["noise", "cutoff"], written: Any, of: Dimension | None) -> dict[str, float]:
        """Return the noise or the cutoff of each reading of a sensor, in SI units.

        A single value is valid only if exactly one reading accepts noise or cutoff.
        """
        if written is None:
            return {}
        able: dict[ReadingName, Dimension] = {}
        for reading in SENSORS[self.spec.type].readings:
            if isinstance(reading.unit, str) and of is not None:
                able[reading.name] = dimensions_of(of)[reading.unit]
            elif isinstance(reading.unit, Dimension):
                able[reading.name] = reading.unit
        place: Path = (*self.path, key)
        of_readings = isinstance(written, Mapping)
        if not of_readings and len(able) > 1:
            self.scope.error(
                Code.BROKEN_RULE, f"`{key}` of a sensor of type `{self.spec.type}` must be a mapping", place,
                help=f"write, for example, `{key}: {{{next(iter(able))}: ...}}`",
            )
            return {}
        numbers: dict[str, float | None] = {}
        for name, raw in written.items() if of_readings else [(next(iter(able)), written)]:
            at = (*place, name) if of_readings else place
            if name in able:
                numbers[name] = self.scope.number(raw, at, able[name], f"`{key}` of sensor `{self.name}`", above=0.0)
            else:
                message = f"a sensor of type `{self.spec.type}` does not measure `{name}`"
                self.scope.error(Code.BROKEN_RULE, message, at, key=True, help=did_you_mean(name, able, what="readings"))
        return {name: number for name, number in numbers.items() if number is not None}

    def _fovy(self) -> float | None:
        if self.spec.fovy is None:
            return FOVY
        place: Path = (*self.path, "fovy")
        fovy = self.scope.number(self.spec.fovy, place, ANGLE, f"`fovy` of camera `{self.name}`", above=0.0)
        if fovy is not None and fovy >= numeric.pi:
            text = self.scope.format_value(Quantity(fovy, ANGLE), place)
            self.scope.error(Code.OUT_OF_RANGE, f"`fovy` of camera `{self.name}` must be below 180 deg, found {text}", place)
            fovy = None
        self.sound &= fovy is not None
        return fovy

    def _tendon(self, name: str, tendons: Mapping[str, Tendon]) -> Tendon | None:
        place: Path = (*self.path, "tendon")
        tendon = tendons.get(name)
        if tendon is None:
            doubts = self.table.doubts
            if name not in (*self.table.spec.tendons, *doubts.names("tendons")) and not doubts.lacks("tendons"):
                self.scope.error(
                    Code.UNKNOWN_TENDON, f"this document has no tendon `{name}`", place, help=suggest(name, tendons, what="tendons"),
                )
        elif self.spec.type == "drive" and tendon.drive is None:
            self._report_undriven("tendon", name, place, key=False)
            tendon = None
        self.sound &= tendon is not None
        return tendon

    def _report_undriven(self, what: str, name: str, place: Path, *, key: bool) -> None:
        self.scope.error(
            Code.JOINT_FIELD, f"{what} `{name}` has no drive to measure", place, key=key,
            help=f"add a `drive` to the {what}, or measure the {what} itself",
        )

    def _joint(self) -> Joint | None:
        """Return the joint coordinate that a sensor measures, or the coordinate of the drive that it measures."""
        unnamed = self.spec.joint is None
        place: Path = self.path if unnamed else (*self.path, "joint")
        joint = self._find_joint(place, unnamed)
        if joint is not None and self.spec.type == "drive" and joint.drive is None and not undriven_reported(self.table, joint):
            self._report_undriven("joint", self.coordinate, place, key=unnamed)
            joint = None
        self.sound &= joint is not None
        return joint

    def _find_joint(self, place: Path, unnamed: bool) -> Joint | None:
        table, scope, name = self.table, self.scope, self.coordinate
        joints = dict(table.all_joints())
        balls = (joint for other, joint in joints.items() if other.joint == name.joint and joint is not None and joint.kind.at_once)
        ball = next(balls, None)
        help: Hint
        if ball is not None and self.spec.type == "joint":
            code, help = Code.JOINT_FIELD, "use a joint with one coordinate, or an `imu` on its child"
            message = f"joint `{name.joint}` is {ball.kind.words} and has no single coordinate"
        elif name not in joints:
            if table.may_lack_joints():
                return None
            moving = [other for other, joint in joints.items() if joint is not None and joint.twist is not None]
            code, message, help = Code.UNKNOWN_JOINT, f"there is no joint `{name}`", suggest(name, moving, what="joints")
            if unnamed and moving:
                help = f"set `joint`; {help}"
        elif (joint := joints[name]) is not None and joint.twist is None:
            code, help = Code.JOINT_FIELD, "use a moving joint, or a `force` sensor at one of its mounts"
            message = f"a sensor cannot measure joint `{name}`, which is {joint.kind.words}"
        else:
            return joint
        scope.error(code, message, place, key=unnamed, help=help)
        return None
