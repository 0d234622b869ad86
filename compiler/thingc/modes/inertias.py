"""Masses of a robot in the order of one mode's tree."""

from __future__ import annotations

from dataclasses import dataclass

from thingc.base.one_line_repr import OneLineRepr
from thingc.modes.frames import Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Inertias(OneLineRepr):
    """Of n links: `mass` (n,) [kg], `centre` (n, 3) [m] in the link's frame, `inertia` (n, 3, 3) [kg m^2] about the centre in
    the link's axes. Of its m joints: `armature` (m,) [kg m^2, of a slide kg], the inertia of what turns behind the gears."""

    mass: Array
    centre: Array
    inertia: Array
    armature: Array
