"""Resolve the transmissions of a document.

A transmission between an actuator and a joint becomes the drive of the joint. A differential becomes one tendon for each actuator: the
length of the tendon is the position of the actuator, so that forces, speeds and rotor inertias are coupled as in the differential.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from msgspec.structs import replace

from thingc.base.diagnostics import Code, Note
from thingc.base.joints.twist import dimensions_of
from thingc.base.numeric import maximum, sum_of
from thingc.base.source import Path
from thingc.base.units import ANGLE, NUMBER, Dimension
from thingc.documents.spec.drives import DriveSpec
from thingc.documents.spec.transmissions import DifferentialSpec, TransmissionSpec
from thingc.model.resolve import references
from thingc.model.resolve.coordinates import CoordinateName, Gear
from thingc.model.resolve.document_scope import DocumentScope
from thingc.model.resolve.joints import NO_DYNAMICS, NO_LIMIT, drive_of
from thingc.model.resolve.repeats import Unrolled
from thingc.model.resolve.scope import LayeredValue
from thingc.model.resolve.tendons import factor_of, moving_joint
from thingc.model.resolve.types import Drive, Joint, Tendon

LARGEST_RATIO = 1e6
"""Largest absolute value of a ratio in SI units. The smallest is its inverse."""
SINGULAR = 1e-9
"""Determinant of a matrix below which the matrix is singular, relative to the product of the largest entries of its rows."""


def transmissions(table: DocumentScope, items: Iterable[Unrolled[TransmissionSpec]], driven: Iterable[str]) -> None:
    """Resolve the transmissions of a document, and store the drives in `table.joints` and `table.coupled`.

    `driven` contains the names of the joints that have their own `drive`. Each actuator and each joint may be used once.
    """
    used: dict[tuple[str, ...], tuple[str, Path]] = {}
    own = set(driven)
    for name, joint in table.joints.items():
        if joint is not None and joint.drive is not None and name.joint in own:
            where: Path = ("joints", name.joint, "drive")
            used["joint", name] = f"joint `{name}`", where
            if joint.drive.component is not None:
                used["actuator", *joint.drive.component.path] = f"joint `{name}`", where
    for item in items:
        reader = _Reader(table, item, used)
        if item.spec.differential is None:
            reader.simple()
        else:
            reader.differential(item.spec.differential)


class _Reader:
    """Resolves one transmission. `used` maps joints and actuators to the element that already uses them, and its location."""

    def __init__(self, table: DocumentScope, item: Unrolled[TransmissionSpec], used: dict[tuple[str, ...], tuple[str, Path]]) -> None:
        self.table, self.item, self.used = table, item, used
        self.scope, self.spec, self.path = item.scope, item.spec, item.path
        self.what = f"transmission `{item.name}`"

    def simple(self) -> None:
        """Resolve a transmission between one actuator and one joint, and store the drive of the joint."""
        joint, place = self.joint(self.spec.joint or "", (*self.path, "joint")), (*self.path, "ratio")
        if joint is None:
            if isinstance(self.spec.actuator, str):
                self.drive(self.spec.actuator, (*self.path, "actuator"), ANGLE, 1.0)
            return
        ratio, motor = self.factor(self.spec.ratio, place, joint, None, f"`ratio` of {self.what}")
        if ratio == 0.0:
            self.fault(f"`ratio` of {self.what} must not be 0", place,
                       "write the turns of the actuator per turn of the joint, such as `ratio: 9`")
        drive = self.drive(self.spec.actuator, (*self.path, "actuator"), motor or ANGLE, ratio or 1.0)
        if joint.twist is not None and drive is not None and drive.gear is not None:
            what, coordinate = f"`backlash` of {self.what}", joint.twist.coordinate
            play = self.scope.number(self.spec.backlash, (*self.path, "backlash"), coordinate, what, least=0.0)
            drive = replace(drive, gear=replace(drive.gear, backlash=play))
            limit = joint.limit
            if play is not None and limit.lower is not None and limit.upper is not None and play > limit.upper - limit.lower:
                compared = f"({joint.twist.format(play)}) exceeds the range of joint `{joint.name}` ({limit.format(joint.twist)})"
                message, origin = f"the backlash of {self.what} {compared}", self.scope.origin((*self.path, "backlash"))
                self.scope.report.warn(Code.TRANSMISSION, message, origin, help="check the unit", allow=True)
        self.table.joints[joint.name] = replace(joint, drive=drive, geared=True)

    def differential(self, spec: DifferentialSpec) -> None:
        """Resolve a differential, and store a tendon for each of its actuators."""
        path: Path = (*self.path, "differential")
        joints = [self.joint(text, (*path, "joints", k)) for k, text in enumerate(spec.joints)]
        sound = [joint for joint in joints if joint is not None]
        self.table.joints |= {joint.name: replace(joint, drive=None, geared=True) for joint in sound}
        rows: list[list[float]] = []
        for k, (actuator, raw) in enumerate(zip(spec.actuators, spec.matrix, strict=True)):
            row, motor = self.row(raw, sound, (*path, "matrix", k)) if len(sound) == len(joints) else ([], ANGLE)
            place = (*path, "actuators", k)
            drive = self.drive(actuator, place, motor, 1.0) if row or isinstance(actuator, str) else None
            rows.append(row)
            if len(row) == len(joints) and drive is not None:
                self.table.coupled.append(Tendon(
                    name=f"{self.item.name}_{k}", turns=motor == ANGLE, limit=NO_LIMIT, dynamics=NO_DYNAMICS, drive=drive,
                    moves=tuple((joint.name, factor) for joint, factor in zip(sound, row, strict=True)), origin=self.scope.origin(place),
                ))
        if all(len(row) == len(joints) for row in rows):
            least = math.prod((maximum(map(abs, row)) for row in rows), start=SINGULAR)
            if not abs(_determinant(rows)) > least:
                self.fault(f"the `matrix` of {self.what} is singular",
                           (*path, "matrix"), "write linearly independent rows, for example `[[1, 1], [1, -1]]`")

    def row(self, raw: Sequence[Any], joints: Sequence[Joint], path: Path) -> tuple[list[float], Dimension]:
        """Return the row of an actuator in the matrix of a differential, and the physical dimension of the actuator's position."""
        motor: Dimension | None = None
        row: list[float] = []
        for k, (value, joint) in enumerate(zip(raw, joints, strict=False)):
            factor, motor = self.factor(value, (*path, k), joint, motor, f"the factor of `{joint.name}` in {self.what}")
            if factor is not None:
                row.append(factor)
        return row, motor or ANGLE

    def factor(self, raw: Any, place: Path, joint: Joint, motor: Dimension | None, what: str) -> tuple[float | None, Dimension | None]:
        """Return the motion of an actuator per motion of a joint, and the physical dimension of the actuator's position."""
        factor, motor = factor_of(self.scope, raw, place, joint, motor, what)
        if not factor or 1.0 / LARGEST_RATIO <= abs(factor) <= LARGEST_RATIO:
            return factor, motor
        bounds = f"between {1.0 / LARGEST_RATIO:g} and {LARGEST_RATIO:g} in SI units"
        self.scope.error(Code.OUT_OF_RANGE, f"the absolute value of {what} must be {bounds}, found {factor:g}", place)
        return None, motor

    def joint(self, text: str, place: Path) -> Joint | None:
        """Return a joint that the transmission drives. Report an error if the joint is invalid or has another drive."""
        name = references.replace_index(self.scope, text, place)
        joint = None if name is None else moving_joint(self.table, self.scope, name, place, f"{self.what} cannot move")
        return joint if joint is not None and self.once(("joint", joint.name), f"joint `{joint.name}`", place, "the joint") else None

    def drive(self, spec: DriveSpec | str | None, place: Path, motor: Dimension, ratio: float) -> Drive | None:
        """Return the drive of an actuator, with the values of the transmission."""
        if isinstance(spec, DriveSpec) and spec.axis is not None:
            self.scope.error(Code.JOINT_FIELD, f"the actuator of {self.what} cannot have an `axis`", (*place, "axis"), key=True,
                             help="remove `axis`")
        drive = drive_of(self.table, self.scope, self.what, motor, LayeredValue(spec, place))
        named = None if drive is None else drive.component
        if named is not None and not self.once(("actuator", *named.path), f"actuator `{named.text}`", place, "the actuator"):
            return None
        efficiency = self.scope.number(
            self.spec.efficiency, (*self.path, "efficiency"), NUMBER, f"`efficiency` of {self.what}", above=0.0, most=1.0,
        )
        mass = dimensions_of(motor)["armature"]
        inertia = self.scope.number(self.spec.inertia, (*self.path, "inertia"), mass, f"`inertia` of {self.what}", least=0.0)
        gear = Gear(name=self.item.name, turns=motor == ANGLE, ratio=ratio, efficiency=efficiency or 1.0, inertia=inertia)
        return None if drive is None else replace(drive, gear=gear)

    def once(self, key: tuple[str, ...], what: str, place: Path, short: str) -> bool:
        """Return whether no other element uses a joint or an actuator. Report an error if another element uses it."""
        user, where = self.used.setdefault(key, (self.what, place))
        if where == place and user == self.what:
            return True
        notes = self.scope.second_note("also used here", where, place)
        if where[-1] == "drive" and key[0] == "joint":
            help = f"remove the `drive` of {what}, or {self.what}"
            self.fault(f"{what} has both a `drive` and {self.what}", place, help, notes)
        else:
            both = f"twice by {self.what}" if user == self.what else f"by both {user} and {self.what}"
            self.fault(f"{what} is used {both}", place, f"use {short} only once", notes)
        return False

    def fault(self, message: str, place: Path, help: str, notes: Sequence[Note] = ()) -> None:
        """Report an invalid transmission."""
        self.scope.error(Code.TRANSMISSION, message, place, help=help, notes=notes)


def _determinant(rows: Sequence[Sequence[float]]) -> float:
    """Return the determinant of a small square matrix, by expansion along its first row."""
    if len(rows) == 1:
        return rows[0][0]
    return sum_of((-1.0) ** k * value * _determinant([[*row[:k], *row[k + 1 :]] for row in rows[1:]]) for k, value in enumerate(rows[0]))


def names_of(items: Iterable[Unrolled[TransmissionSpec]]) -> Iterator[tuple[str, Path, str]]:
    """Yield the names of the drives of differentials, with their paths in the document and a description."""
    for item in items:
        if item.spec.differential is not None:
            for k in range(len(item.spec.differential.actuators)):
                yield f"{item.name}_{k}", item.path, f"a drive of transmission `{item.name}`"


def coupled_drives(table: DocumentScope) -> Iterator[tuple[CoordinateName, Tendon]]:
    """Yield the drives of differentials in a document and its nested documents, each with its name, in which names are joined by dots."""
    return ((CoordinateName(prefix + drive.name), drive) for prefix, inner in table.all_tables() for drive in inner.coupled)


def undriven_reported(table: DocumentScope, joint: Joint) -> bool:
    """Return whether a joint has no drive because its drive or a transmission is invalid, which has been reported."""
    coupled = any(name == joint.name for _, one in coupled_drives(table) for name, _ in one.moves)
    return "drive" in joint.spans or (joint.geared and not coupled) or table.doubts.touch(("transmissions",))
