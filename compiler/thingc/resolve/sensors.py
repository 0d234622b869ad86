"""Sensors: the mounts that they sit on, and the joints that they measure."""

from __future__ import annotations

import math
from collections.abc import Iterator

from thingc.diagnostics import Code
from thingc.resolve import references
from thingc.resolve.coordinates import CoordinateName
from thingc.resolve.model import Sensor
from thingc.resolve.references import suggested
from thingc.resolve.scope import Scope
from thingc.resolve.table import Table
from thingc.source import Path
from thingc.spec.sensors import SensorSpec
from thingc.units import ANGLE, Quantity

FOVY = math.radians(45.0)
"""The angle of view [rad] of a camera that does not state one: MuJoCo's."""


def sensors(table: Table, scope: Scope) -> Iterator[Sensor]:
    """The sensors of the document, in its order. One that is wrong is left out (reported)."""
    for name, spec in table.spec.sensors.items():
        path: Path = ("sensors", name)
        mount, joint, fovy = None, None, None
        if spec.type == "joint":
            joint = _joint(table, scope, name, spec, path)
        elif spec.at is not None:
            mount = references.shown_mount(table, scope, spec.at, (*path, "at"))
        if spec.type == "camera":
            fovy = _fovy(scope, name, spec, path)
        if (mount is None and joint is None) or (spec.type == "camera" and fovy is None):
            continue
        yield Sensor(name=name, kind=spec.type, mount=mount, joint=joint, fovy=fovy, origin=scope.origin(path, key=True))


def _fovy(scope: Scope, name: str, spec: SensorSpec, path: Path) -> float | None:
    if spec.fovy is None:
        return FOVY
    fovy = scope.number(spec.fovy, (*path, "fovy"), ANGLE, f"`fovy` of camera `{name}`", above=0.0)
    if fovy is not None and fovy >= math.pi:
        shown = scope.shown(Quantity(fovy, ANGLE), (*path, "fovy"))
        scope.error(Code.OUT_OF_RANGE, f"`fovy` of camera `{name}` must be below 180 deg, found {shown}", (*path, "fovy"))
        return None
    return fovy


def _joint(table: Table, scope: Scope, name: str, spec: SensorSpec, path: Path) -> str | None:
    """The path of the joint that a sensor measures: the one it names, else the one that has its own name."""
    wanted = CoordinateName(spec.joint if spec.joint is not None else name)
    place: Path = (*path, "joint") if spec.joint is not None else path
    joints = dict(table.all_joints())
    moving = [one for one, joint in joints.items() if joint is not None and joint.twist is not None]
    if any(one.joint == wanted.joint and joint is not None and joint.kind.at_once for one, joint in joints.items()):
        scope.error(
            Code.JOINT_FIELD, f"joint `{wanted.joint}` is a ball: it has no coordinate to measure", place, key=spec.joint is None,
            help="measure a joint of one coordinate, or put an `imu` on its child",
        )
        return None
    if wanted not in joints:
        if not table.unsure_joints():
            help = suggested(wanted, moving, what="joints")
            if spec.joint is None and moving:
                help += "; name it with `joint: ...`"
            scope.error(Code.UNKNOWN_JOINT, f"there is no joint `{wanted}`", place, key=spec.joint is None, help=help)
        return None
    joint = joints[wanted]
    if joint is None:
        return None
    if joint.twist is None:
        scope.error(
            Code.JOINT_FIELD, f"joint `{wanted}` is {joint.kind.name} and does not move: there is nothing to measure", place,
            key=spec.joint is None, help="measure a joint that moves, or a `force` at one of its mounts",
        )
        return None
    return wanted.path
