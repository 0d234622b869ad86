"""Tables of the intended geometry of named mounts and screws, against which the study checks the parts.

Every position was computed by hand from the drawings of the attached parts and from the parameters of the part. The tables never use
positions from the code of a part or of the servo that the part holds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from math import cos, pi, sin
from typing import Any

from build123d import Location
from features import Feature, Vector

from thingc import MountPoint

UP, DOWN = (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)
RIGHT, LEFT = (1.0, 0.0, 0.0), (-1.0, 0.0, 0.0)
AWAY, NEAR = (0.0, 1.0, 0.0), (0.0, -1.0, 0.0)

CLEARANCE = {"M2": 2.4, "M2.5": 2.9, "M3": 3.4, "M4": 4.5}
"""Diameters of clearance holes [mm], according to ISO 273, medium."""
TAP = {"M2.5": 2.05, "M3": 2.5}
"""Diameters of tap drills for coarse threads [mm]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Intent:
    """The intended geometry of a named mount or screw of a part, for one set of parameters.

    The function `frame` returns the frame from the finished Thing. The origin of this frame must be at `at`, and its z axis must be `z`.
    The solid must have each of the `features` there. The study checks whether plain selectors find the first of these features.
    """

    name: str
    frame: Callable[[Any], Location]
    at: Vector
    z: Vector
    features: tuple[Feature, ...]


def mount(name: str, at: Vector, z: Vector, *features: Feature) -> Intent:
    """Return the intended geometry of a mount. The name `screw_0` means item 0 of the list `screw`. Without `features`, the solid must have
    a plane face through the mount that is normal to z.
    """
    return Intent(name=name, frame=lambda thing: _mount(thing, name).location, at=at, z=z, features=features or (plane(at, z),))


def screw(name: str, read: Callable[[Any], Any], at: Vector, z: Vector, *features: Feature) -> Intent:
    """Return the intended geometry of a screw that is attached to a part.

    The function `read` returns the `Screw`. The centre of its bearing plane must be at `at`, and its head must point towards `z`.
    """
    # The z axis of the seat of a screw points along the shank.
    into = (-z[0], -z[1], -z[2])
    return Intent(name=name, frame=lambda thing: read(thing).seat.location, at=at, z=into, features=features)


def plane(on: Vector, normal: Vector, *other: Vector) -> Feature:
    return Feature(kind="plane", on=on, axis=normal, other=other)


def hole(on: Vector, axis: Vector, diameter: float, rim: Vector | None = None) -> Feature:
    return Feature(kind="hole", on=on, axis=axis, diameter=diameter, rim=rim)


def at_mouth(mouth: Vector, z: Vector, diameter: float, inside: float = 0.5) -> Feature:
    """Return a hole that opens in a full circle at `mouth` towards `z`. The cylindrical face must exist at a depth of `inside` [mm] below
    the mouth.
    """
    on = (mouth[0] - inside * z[0], mouth[1] - inside * z[1], mouth[2] - inside * z[2])
    return hole(on, z, diameter, mouth)


def circle(count: int, diameter: float) -> Iterable[tuple[int, float, float]]:
    """Yield the index, x and y of `count` positions on a circle. The first position is on the x axis, and the second is rotated towards the
    y axis.
    """
    for k in range(count):
        yield k, diameter / 2 * cos(2 * pi * k / count), diameter / 2 * sin(2 * pi * k / count)


def _mount(thing: Any, name: str) -> MountPoint:
    head, _, number = name.rpartition("_")
    if number.isdigit():
        return getattr(thing, head)[int(number)]  # type: ignore[no-any-return]
    return getattr(thing, name)  # type: ignore[no-any-return]
