"""Small parts that model in no time: what the documents of the cases are made of."""

from __future__ import annotations

from typing import Annotated, Literal

from build123d import Box, Location, Pos

from thingc import Actuator, Angle, Count, Length, MountPoint, Range, Thing

DOWN = (180, 0, 0)


class Plate(Thing):
    """A square plate with mounts on top, below and at one side."""

    def __init__(self, width: Length = 60, height: Length = 6):
        super().__init__(material="petg")
        self.body = Box(width, width, height)
        self.top = MountPoint(Location((0, 0, height / 2)))
        self.bottom = MountPoint(Location((0, 0, -height / 2), DOWN))
        self.side = MountPoint(Location((width / 2, 0, 0), (0, 90, 0)))

    def result(self):
        return self.body


class Lever(Thing):
    """A bar that turns at one end.

    Args:
        length: hub to tip
    """

    def __init__(
        self, length: Annotated[Length, Range(20, 500)] = 80, bend: Angle = 0, holes: Count = 2,
        hand: Literal["left", "right"] = "left", hollow: bool = False, label: str = "",
    ):
        super().__init__(material="petg")
        self.body = Box(length, 10, 6)
        self.hub = MountPoint(Location((-length / 2, 0, -3), DOWN))
        self.tip = MountPoint(Location((length / 2, 0, 3)))

    def result(self):
        return self.body


class Servo(Thing):
    """A bought servo with a gain."""

    actuator = Actuator(kind="position", stall_torque=2.0, no_load_speed=5.0, kp=2.0)
    bom = {"make": "buy"}

    def __init__(self) -> None:
        self.body = Box(20, 20, 30)
        self.back = MountPoint(Location((0, 0, -15), DOWN))
        self.horn = MountPoint(Location((0, 0, 15)))

    def result(self):
        return self.body

    def mass(self):
        return 0.05


class Gainless(Servo):
    """A servo whose data sheet states no gain."""

    actuator = Actuator(kind="position", stall_torque=2.0)


class Bare(Thing):
    """A block that says nothing of what it is made of."""

    def __init__(self, width: Length, label: str = ""):
        self.body = Box(width, width, width)
        self.face = MountPoint(Location((0, 0, width / 2)))
        self.foot = MountPoint(Location((0, 0, -width / 2), DOWN))

    def result(self):
        return self.body


class Pod(Thing):
    """A block of a material that few documents have."""

    def __init__(self) -> None:
        super().__init__(material="titanium")
        self.body = Box(10, 10, 10)
        self.foot = MountPoint(Location((0, 0, -5), DOWN))

    def result(self):
        return self.body


class Fork(Thing):
    """A plate that was cut for a lever of 80 mm."""

    def __init__(self) -> None:
        super().__init__(material="petg")
        self.seat = MountPoint(Location((0, 0, 3)))
        self.lever = self.seat.align(Lever().hub)
        self.body = Box(60, 60, 6)

    def result(self):
        return self.body


class Wobbly(Thing):
    """A part that states an inertia that no solid has."""

    def __init__(self) -> None:
        super().__init__(material="petg")
        self.body = Box(10, 10, 10)
        self.foot = MountPoint(Location((0, 0, -5), DOWN))

    def result(self):
        return self.body

    def matrix_of_inertia(self):
        return [[1e-6, 0, 0], [0, 1e-6, 0], [0, 0, 3e-6]]


class Comb(Thing):
    """A bar with teeth to sit on."""

    def __init__(self, teeth: Count = 3) -> None:
        super().__init__(material="petg")
        self.body = Box(20 * teeth, 10, 10)
        self.top = MountPoint(Location((0, 0, 5)))
        self.tooth = [MountPoint(Location((20 * tooth, 5, 0), (-90, 0, 0))) for tooth in range(teeth)]

    def result(self):
        return self.body


class Stair(Thing):
    """Blocks that climb by one step each, or descend."""

    def __init__(self, rise: int = 1, blocks: Count = 2) -> None:
        super().__init__(material="petg")
        self.body = sum((Pos(9 * at, 0, rise * at) * Box(10, 10, 10) for at in range(1, blocks)), Box(10, 10, 10))
        self.top = MountPoint(Location((9 * (blocks - 1), 0, rise * (blocks - 1) + 5)))

    def result(self):
        return self.body


class Feather(Stair):
    """A stair that knows its density, in another unit than it should."""

    def density(self):
        return 1.27


class Anvil(Stair):
    """A stair that knows its mass, in another unit than it should."""

    def mass(self):
        return (12.0, "vendor")
