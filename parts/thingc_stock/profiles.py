"""Aluminium profiles of any length."""

from __future__ import annotations

from typing import Annotated, Literal

from build123d import Location, Plane, Solid

from thingc import MATE, Length, MountPoint, Range, Thing
from thingc_stock.shapes import disc, prism


class Profile2020(Thing):
    """An aluminium profile 20 x 20 mm with a slot of 6 mm on each side, cut to length.

    The bore of 4.3 mm, which is for an M5 thread, is as in series L5 (industrialprofile.com/profile-technical-data). The slot of 6 mm with
    a chamber about 12 mm wide is as in github.com/nophead/NopSCADlib, vitamins/extrusions.scad, E2020. The rest of the cross section is an
    estimate, which gives a mass of 0.45 kg/m. The cross sections of manufacturers differ.

    The origin is in the middle of one end; z is along the length of the profile.

    Mounts: `start` (z outwards, down) and `end` are at the two ends. `left` (+x), `right`, `top` (+y) and `bottom` are on the sides at half
    the length. `left_start`, `left_end` and so on are on the sides, at a distance of half a width from the ends.

    Args:
        length: length of the profile
        finish: finish of the surface
    """

    bom = {"make": "machine", "number": "strut profile 20x20"}

    def __init__(self, length: Annotated[Length, Range(10, 6000)] = 200.0, finish: Literal["natural", "black"] = "natural"):
        super().__init__(material="aluminium", color="#c4c8cc" if finish == "natural" else "#2d2f33")
        self.start = MountPoint(MATE, "profile-2020")
        self.end = MountPoint(Location((0, 0, length)), "profile-2020")
        sides = {"left": (1, 0, 0), "right": (-1, 0, 0), "top": (0, 1, 0), "bottom": (0, -1, 0)}

        def side(name: str, z: float) -> MountPoint:
            out = sides[name]
            return MountPoint(Location(Plane((10 * out[0], 10 * out[1], z), x_dir=(0, 0, 1), z_dir=out)), "slot-6")

        self.left, self.right, self.top, self.bottom = (side(name, length / 2) for name in sides)
        self.left_start, self.right_start, self.top_start, self.bottom_start = (side(name, 10.0) for name in sides)
        self.left_end, self.right_end, self.top_end, self.bottom_end = (side(name, length - 10.0) for name in sides)

    def result(self) -> Solid:
        """Return the solid of a square profile along z with four slots and a bore."""
        body = prism([(10, -9), (10, 9), (9, 10), (-9, 10), (-10, 9), (-10, -9), (-9, -10), (9, -10)], 0, self.p.length)
        # half of a slot: x from its middle, and y from the surface inwards
        half = [(3.0, 0.0), (3.0, 1.5), (5.9, 1.5), (5.9, 3.1), (2.9, 6.1)]
        slot = [(x, 10 - y) for x, y in half] + [(-x, 10 - y) for x, y in reversed(half)]
        slot = [(slot[0][0], 11), *slot, (slot[-1][0], 11)]
        turned_slots = [slot, [(y, -x) for x, y in slot], [(-x, -y) for x, y in slot], [(-y, x) for x, y in slot]]
        return body.cut(*(prism(one, -1, self.p.length + 2) for one in turned_slots), disc(4.3, self.p.length + 2, -1)).solid()

    def collision(self) -> list[Solid]:
        """Return the collision shape: the enclosing box."""
        return [prism([(10, -10), (10, 10), (-10, 10), (-10, -10)], 0, self.p.length)]
