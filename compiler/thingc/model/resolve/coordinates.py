"""Coordinates of joints: how documents name them, their limits, what they do by themselves, and what they follow."""

from __future__ import annotations

import re

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.joints.kind import JointKind
from thingc.base.numeric import inf, sum_of
from thingc.base.one_line_repr import OneLineRepr
from thingc.base.source import Origin


class Limit(OneLineRepr, FrozenStruct):
    """Of a joint: `lower`, `upper` [rad or m]; `effort` [N m or N] and `velocity` [rad/s or m/s] as far as written. Of a ball `cone`, how
    far it may turn [rad] from q = 0, about whatever axis."""

    lower: float | None = None
    upper: float | None = None
    cone: float | None = None
    effort: float | None = None
    velocity: float | None = None

    @property
    def bounded(self) -> bool:
        """Whether q has a bound."""
        return (self.lower, self.upper, self.cone) != (None, None, None)


class Dynamics(OneLineRepr, FrozenStruct):
    """Of a joint, SI, as far as written: viscous `damping`, dry `friction`, reflected inertia `armature`, `stiffness` of a spring, and the
    q at which that does nothing, `rest`."""

    damping: float | None = None
    friction: float | None = None
    armature: float | None = None
    stiffness: float | None = None
    rest: float | None = None

    def sprung(self, q: float) -> float:
        """What its spring does [N m or N] at `q` [rad or m], along positive q."""
        return 0.0 if self.stiffness is None else self.stiffness * ((self.rest or 0.0) - q)

    @property
    def acts(self) -> bool:
        """Whether any of it is not 0."""
        return any((self.damping, self.friction, self.armature, self.stiffness))


class CoordinateName(str):
    """A coordinate as documents call it: `hand.wrist[0]`, of a joint that has one `hand.yaw`. `joint` is the joint's name, `number`
    which of its coordinates it is (None: it has one), `path` what artifacts call it: `hand/wrist_0`."""

    joint: str
    number: int | None
    path: str

    def __new__(cls, text: str) -> CoordinateName:
        """Of a text that a document has; what is no number in brackets at its end belongs to the name."""
        name = super().__new__(cls, text)
        numbered = _NUMBERED.fullmatch(text)
        name.joint, name.number = (numbered[1], int(numbered[2])) if numbered is not None else (text, None)
        name.path = name.joint.replace(".", "/") + ("" if name.number is None else f"_{name.number}")
        return name

    def in_files(self, path: str) -> CoordinateName:
        """The same coordinate, which artifacts call `path`."""
        name = CoordinateName(self)
        name.path = path
        return name

    def numbered(self, number: int) -> CoordinateName:
        """The coordinate with this number of the joint of this name."""
        return CoordinateName(f"{self.joint}[{number}]")


_NUMBERED = re.compile(r"(.*)\[(\d+)\]")


class Mimic(OneLineRepr, FrozenStruct):
    """q = offset + multiplier * x + higher[0] * x^2 + higher[1] * x^3 ... with x = q(joint), SI; `joint` is a coordinate of the same
    document, as that calls it. `name` is that of its equality in files, if any is given."""

    joint: CoordinateName
    multiplier: float
    offset: float
    origin: Origin
    higher: tuple[float, ...] = ()
    name: str | None = None

    @property
    def polynomial(self) -> tuple[float, ...]:
        """The coefficients of the powers of q(joint), from the 0th on."""
        return (self.offset, self.multiplier, *self.higher)

    def tangent(self, x: float) -> tuple[float, float]:
        """(m, c): near `x` q is m q(joint) + c."""
        if not self.higher:
            return self.multiplier, self.offset
        slope = self.multiplier + sum_of(k * c * x ** (k - 1) for k, c in enumerate(self.higher, start=2))
        return slope, self.at(x) - slope * x

    def at(self, x: float) -> float:
        """q where q(joint) is `x`; infinite beyond what a number can be."""
        linear = self.multiplier * x + self.offset
        try:
            return linear if not self.higher else linear + sum_of(c * x**k for k, c in enumerate(self.higher, start=2))
        except OverflowError:
            return inf


class Coordinate(OneLineRepr, FrozenStruct):
    """What a coordinate of a joint is in every pass: its name, the kind of its joint, and its numbers in SI units."""

    name: CoordinateName
    kind: JointKind
    limit: Limit
    dynamics: Dynamics
    offset: float
    mimic: Mimic | None
    origin: Origin

    @property
    def path(self) -> str:
        """What artifacts call it: `hand/wrist_0`."""
        return self.name.path
