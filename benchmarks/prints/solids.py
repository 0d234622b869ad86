"""Twelve reference solids to print, with features such as thin walls, flat tops, cavities, overhangs and bridges. All solids stand on the
plane z = 0.
"""

from __future__ import annotations

from build123d import Axis, Box, Cone, Cylinder, Pos, Rot, Sphere, Torus, fillet
from build123d.topology import Part

from thingc import Length, Thing


class _Solid(Thing):
    """Base class of the reference solids, whose material is PETG."""

    body: Part

    def __init__(self) -> None:
        super().__init__(material="petg")

    def result(self) -> Part:
        """Return the geometry of the solid."""
        return self.body


class Block(_Solid):
    """A solid box."""

    def __init__(self, length: Length = 40, width: Length = 30, height: Length = 20) -> None:
        super().__init__()
        self.body = Pos(0, 0, height / 2) * Box(length, width, height)


class Plate(_Solid):
    """A thin plate with round corners and holes."""

    def __init__(self) -> None:
        super().__init__()
        plate = Pos(0, 0, 2) * Box(80, 60, 4)
        self.body = fillet(plate.edges().filter_by(Axis.Z), 8) - [Pos(x, y, 2) * Cylinder(3, 4) for x in (-30, 30) for y in (-20, 20)]


class Rod(_Solid):
    """A solid cylinder."""

    def __init__(self) -> None:
        super().__init__()
        self.body = Pos(0, 0, 20) * Cylinder(15, 40)


class Frustum(_Solid):
    """A cone frustum whose walls lean inwards."""

    def __init__(self) -> None:
        super().__init__()
        self.body = Pos(0, 0, 15) * Cone(20, 6, 30)


class Funnel(_Solid):
    """A cone frustum whose walls lean outwards."""

    def __init__(self) -> None:
        super().__init__()
        self.body = Pos(0, 0, 15) * Cone(8, 20, 30)


class Ball(_Solid):
    """A sphere, whose surface becomes flat at the top and at the bottom."""

    def __init__(self) -> None:
        super().__init__()
        self.body = Pos(0, 0, 20) * Sphere(20)


class Ring(_Solid):
    """A torus, with the shape of a ring."""

    def __init__(self) -> None:
        super().__init__()
        self.body = Pos(0, 0, 8) * Torus(22, 8)


class Tube(_Solid):
    """A tube with a wall thickness of 5 mm."""

    def __init__(self) -> None:
        super().__init__()
        self.body = Pos(0, 0, 20) * (Cylinder(20, 40) - Cylinder(15, 40))


class Tray(_Solid):
    """A tray with a floor and four walls, each 6 mm thick."""

    def __init__(self) -> None:
        super().__init__()
        self.body = Pos(0, 0, 12) * Box(70, 50, 24) - Pos(0, 0, 15) * Box(58, 38, 18)


class Table(_Solid):
    """A table top on two legs, which is printed as a bridge."""

    def __init__(self) -> None:
        super().__init__()
        legs = [Pos(x, 0, 10) * Box(10, 30, 20) for x in (-25, 25)]
        self.body = Pos(0, 0, 23) * Box(60, 30, 6) + legs


class Wedge(_Solid):
    """A wedge with a slope of 18 degrees."""

    def __init__(self) -> None:
        super().__init__()
        block = Pos(0, 0, 12) * Box(60, 30, 24)
        self.body = block - Pos(0, 0, 24) * Rot(0, -18, 0) * Pos(0, 0, 20) * Box(100, 40, 40)


class Comb(_Solid):
    """A comb with fins from 0.8 to 4 mm on a thin back."""

    def __init__(self) -> None:
        super().__init__()
        fins = [Pos(-30 + 10 * k, 0, 12) * Box(thickness, 24, 20) for k, thickness in enumerate((0.8, 1.2, 1.6, 2.0, 2.6, 3.2, 4.0))]
        self.body = Pos(0, 0, 1.5) * Box(70, 24, 3) + fins
