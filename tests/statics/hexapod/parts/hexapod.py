"""A hexapod of plain solids: a body, and bars that form a leg; the last bar has a ball as its foot."""

from __future__ import annotations

from build123d import Align, Box, Location, Pos, Sphere

from thingc import Length, MountPoint, Thing

ANGLES = (40, 90, 140, -40, -90, -140)
"""Directions of the legs [deg]: front, middle and rear on the left, then on the right."""


class Body(Thing):
    """A box around its own frame, with six hips about its vertical z axis."""

    def __init__(self, length: Length = 160, width: Length = 90, height: Length = 40):
        super().__init__(material="stuff")
        self.body = Box(length, width, height)
        places = [(x * length / 2, side * width / 2) for side in (1, -1) for x in (1, 0, -1)]
        self.hip = [MountPoint(Location((x, y, 0), (0, 0, angle))) for (x, y), angle in zip(places, ANGLES)]

    def result(self):
        return self.body


class Bar(Thing):
    """A square bar along x that turns about `far` and `near` (along y), or about `hip` (along z)."""

    def __init__(self, length: Length = 60, width: Length = 24):
        super().__init__(material="stuff")
        self.body = Box(length, width, width, align=(Align.MIN, Align.CENTER, Align.CENTER))
        self.hip = MountPoint(Location((0, 0, 0), (180, 0, 90)))
        self.near = MountPoint(Location((0, 0, 0), (90, 0, 90)))
        self.far = MountPoint(Location((length, 0, 0), (-90, 0, 0)))

    def result(self):
        return self.body


class Shin(Thing):
    """A bar along x with a ball at its end. `sole` is the farthest point of the ball."""

    def __init__(self, length: Length = 90, width: Length = 14, foot: Length = 9):
        super().__init__(material="rubber")
        self.bar = Box(length, width, width, align=(Align.MIN, Align.CENTER, Align.CENTER))
        self.ball = Pos(length, 0, 0) * Sphere(foot)
        self.near = MountPoint(Location((0, 0, 0), (90, 0, 90)))
        self.sole = MountPoint(Location((length + foot, 0, 0), (0, 90, 0)))

    def result(self):
        return self.bar + self.ball

    def collision(self):
        return [self.bar, self.ball]
