"""A part with type annotations. mypy (in `make test`) and pyright (in `test_things_typing.py`) check it.

Each comment `type: ignore` marks an expected error. mypy reports comments without an error as unused, and pyright does not read them.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, assert_type

from build123d import Box, Location, Part, Pos

from thingc import Actuator, Count, Length, MountPoint, Range, Ratio, Thing, asset


class Horn(Thing):
    def __init__(self, radius: Length = 10):
        super().__init__(material="steel")
        self.body = Box(radius, radius, 2)
        self.seat = MountPoint(Pos(0, 0, 1))


class Servo(Thing):
    actuator = Actuator(kind="position", stall_torque=(4.1, "vendor"), kp=20)

    def __init__(
        self, width: Annotated[Length, Range(10, 60)] = 30, holes: Count = 4, side: Literal["left", "right"] = "left"
    ):
        super().__init__(material="aluminium")
        self.rotor = MountPoint(Location((0, 0, 17)))
        self.horn_ref = Horn().move(Pos(0, 0, 17))
        self.spots = [Pos(x, 0, 0) for x in range(holes)]

    def screw(self, length: Length) -> Horn:
        return Horn(length)

    def mass(self) -> float:
        return 0.082


class Bracket(Thing):
    def __init__(self, infill: Ratio = 0.15):
        super().__init__()
        self.servo_ref = Servo().move(Location((0, 0, 30)))
        assert_type(self.servo_ref, Servo)
        assert_type(self.servo_ref.rotor.location, Location)
        assert_type(self.servo_ref.horn_ref.body, Box)
        assert_type(self.servo_ref.screw(5).body, Box)
        assert_type(self.servo_ref.adjust(width__add=0.2).rotor, MountPoint)
        assert_type(self.servo_ref.spots, list[Pos])
        assert_type(asset("horn.step"), Path)
        cap: Horn = MountPoint(Location()).align(Horn().seat)
        assert_type(cap.body, Box)

    def result(self) -> Part:
        return self.servo_ref.horn_ref.body


Servo(width=31.5, holes=6)
Servo(width="wide")  # type: ignore
Servo(side="middle")  # type: ignore
Servo(wdith=3)  # type: ignore
missing = Servo().rotr  # type: ignore
Servo().horn = 3  # type: ignore
Servo().move(3)  # type: ignore
Servo().rotor.align(Horn())  # type: ignore
Actuator(kind="stepper")  # type: ignore
