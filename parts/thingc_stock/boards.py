"""Circuit boards (Raspberry Pi, Arduino and ESP32) with their holes and their tall components."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from build123d import Location, Plane, Solid

from thingc import MountPoint, Thing
from thingc_stock.shapes import block, disc

THICKNESS = 1.6
"""Thickness of a standard board [mm]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """The dimensions of a board [mm].

    `hole_middle` is the centre of the hole pattern relative to the centre of the board, `holes` contains the hole distances in x and y, and
    `hole` is the diameter. `blocks` lists the tall components by their centre (x, y) and size (x, y, z). The z size is negative for
    components below the board.
    """

    size: tuple[float, float]
    corner: float
    hole_middle: tuple[float, float]
    holes: tuple[float, float]
    hole: float
    blocks: Sequence[tuple[float, float, float, float, float]]


class Board(Thing):
    """A printed circuit board.

    The origin is in the middle of the underside; z is up, and x is along the long side of the board.

    Mounts: `bottom` is on the underside of the board, and `top` on the upper side. `hole_0`, `hole_1` ... are at the upper ends of the
    holes, counted from (+x, +y) towards (-x, +y). `post_0`, `post_1` ... are at the lower ends of the same holes, with z down, for the
    attachment of posts.
    """

    layout: ClassVar[Layout]
    bom = {"make": "buy"}

    def __init__(self, color: str = "#1d6b46"):
        super().__init__(material="fr4", color=color)
        one = self.layout
        (x, y), (dx, dy) = one.hole_middle, (one.holes[0] / 2, one.holes[1] / 2)
        self.places = [(x + dx, y + dy), (x - dx, y + dy), (x - dx, y - dy), (x + dx, y - dy)]
        self.bottom = MountPoint(Location(Plane((0, 0, 0), x_dir=(-1, 0, 0), z_dir=(0, 0, -1))))
        self.top = MountPoint(Location((0, 0, THICKNESS)))
        self.hole = [MountPoint(Location((*place, THICKNESS))) for place in self.places]
        self.post = [MountPoint(Location(Plane((*place, 0), x_dir=(-1, 0, 0), z_dir=(0, 0, -1)))) for place in self.places]

    def result(self) -> Solid:
        """Return the solid of the board with its holes, and with a block for each tall component."""
        one = self.layout
        board = block((*one.size, THICKNESS), (0, 0, THICKNESS / 2), corner=one.corner)
        tall = [block((dx, dy, abs(dz)), (x, y, THICKNESS + dz / 2 if dz > 0 else dz / 2)) for x, y, dx, dy, dz in one.blocks]
        return board.fuse(*tall).cut(*(disc(one.hole, 4, -1, x, y) for x, y in self.places)).solid()

    def collision(self) -> list[Solid]:
        """Return the collision shape: the box around the board and the blocks."""
        one = self.layout
        above, below = max(dz for *_, dz in one.blocks), min(0.0, *(dz for *_, dz in one.blocks))
        return [block((*one.size, THICKNESS + max(0.0, above) - below), (0, 0, (THICKNESS + max(0.0, above) + below) / 2))]


class RaspberryPi4(Board):
    """Raspberry Pi 4 Model B.

    Dimensions from github.com/RalfLangeDresden/RaspberryPiCases, raspberry/PiPcbConstants.scad: 85 x 56 mm, holes of 2.75 mm at distances
    of 58 x 49 mm, 3.5 mm from the edges. The mass of 46 g was measured by Gareth Halfacree ("Benchmarking the Raspberry Pi 4"), as cited at
    4ort.xyz/entity/raspberry-pi-4-model-b. The positions and heights of the sockets are estimates.
    """

    layout = Layout(
        size=(85.0, 56.0), corner=3.0, hole_middle=(-10.0, 0.0), holes=(58.0, 49.0), hole=2.75,
        blocks=(
            (33.0, 17.75, 21.3, 16.0, 13.5), (34.7, -1.0, 17.5, 13.2, 16.0), (34.7, -19.0, 17.5, 13.2, 16.0), (-10.0, 24.5, 51.0, 5.1, 8.5),
            (-31.3, -24.7, 9.0, 7.5, 3.2), (-16.5, -24.7, 7.0, 7.5, 3.0), (-3.0, -24.7, 7.0, 7.5, 3.0), (11.5, -22.5, 7.0, 14.0, 6.0),
            (-13.0, 4.0, 15.0, 15.0, 2.4),
        ),
    )
    bom = {"make": "buy", "number": "Raspberry Pi 4 Model B", "supplier": "Raspberry Pi"}

    def mass(self) -> tuple[float, str]:
        """Return the measured mass of 46 g."""
        return (0.046, "measured")


class RaspberryPiZero2(Board):
    """Raspberry Pi Zero 2 W with a pin header.

    Dimensions of the Raspberry Pi Zero from github.com/RalfLangeDresden/RaspberryPiCases, raspberry/PiPcbConstants.scad: 65 x 30 mm, holes
    of 2.75 mm at distances of 58 x 23 mm. The mass (11 g) and the components on the board are estimates.
    """

    layout = Layout(
        size=(65.0, 30.0), corner=3.0, hole_middle=(0.0, 0.0), holes=(58.0, 23.0), hole=2.75,
        blocks=(
            (0.0, 11.5, 51.0, 5.1, 8.5), (-4.0, 0.5, 15.0, 14.0, 1.2), (-20.1, -12.5, 11.2, 7.6, 3.2), (8.9, -12.5, 7.6, 5.4, 2.6),
            (21.5, -12.5, 7.6, 5.4, 2.6), (-26.5, 1.9, 12.0, 11.4, 1.3),
        ),
    )
    bom = {"make": "buy", "number": "Raspberry Pi Zero 2 W", "supplier": "Raspberry Pi"}

    def mass(self) -> tuple[float, str]:
        """Return the estimated mass of 11 g."""
        return (0.011, "estimated")


class ArduinoNano(Board):
    """Arduino Nano with pins below.

    Dimensions from docs.arduino.cc/hardware/nano (read in github.com/arduino/docs-content,
    content/hardware/03.nano/boards/nano/tech-specs.yml): 45 x 18 mm, 7 g. The holes and the components on the board are estimates.
    """

    layout = Layout(
        size=(45.0, 18.0), corner=0.0, hole_middle=(0.0, 0.0), holes=(41.9, 15.2), hole=1.65,
        blocks=(
            (-19.0, 0.0, 9.2, 7.6, 3.9), (3.0, 0.0, 7.0, 7.0, 1.2), (20.0, 0.0, 5.1, 7.6, 8.0), (0.0, 7.6, 36.0, 2.5, -8.5),
            (0.0, -7.6, 36.0, 2.5, -8.5),
        ),
    )
    bom = {"make": "buy", "number": "A000005", "supplier": "Arduino"}

    def __init__(self, color: str = "#0f6f7c"):
        super().__init__(color=color)

    def mass(self) -> tuple[float, str]:
        """Return the mass of 7 g from the manufacturer's page."""
        return (0.007, "vendor")


class Esp32DevKitC(Board):
    """Espressif ESP32-DevKitC V4 with pins below.

    The width (27.9 mm) and the distance between the rows of pins (25.4 mm) are from github.com/wokwi/wokwi-boards,
    boards/esp32-devkit-c-v4/board.json. The length (54.4 mm) and the mass (10 g) are estimates. The board has no holes; `hole_0`,
    `hole_1` ... are its corner pins.
    """

    layout = Layout(
        size=(54.4, 27.9), corner=0.0, hole_middle=(0.0, 0.0), holes=(48.3, 25.4), hole=1.0,
        blocks=(
            (14.6, 0.0, 25.5, 18.0, 3.1), (-24.5, 0.0, 6.0, 7.6, 2.7), (-9.0, 0.0, 5.0, 5.0, 1.0), (0.0, 12.7, 48.3, 2.5, -8.5),
            (0.0, -12.7, 48.3, 2.5, -8.5),
        ),
    )
    bom = {"make": "buy", "number": "ESP32-DevKitC-32E", "supplier": "Espressif"}

    def __init__(self, color: str = "#24262a"):
        super().__init__(color=color)

    def mass(self) -> tuple[float, str]:
        """Return the estimated mass of 10 g."""
        return (0.010, "estimated")
