"""Generate random robots with known joints in build123d, and export them as STEP assemblies.

A robot is a chain of links, and each connection is of a random kind: a stub shaft in a bore, a clevis with a pin, a bearing, a slide, a
bolted flange, or the horn of a servo. Some connections are rigid, and some hinges have gaps. Names are random, so that they do not help.
"""

from __future__ import annotations

import copy
import math
import random
from dataclasses import dataclass, field

from build123d import Axis, Box, Color, Compound, Cylinder, Location, Part, Plane, Pos, Solid, Vector

WORDS = ("body", "Träger", "link", "plate", "part/2", "", "アーム", "bracket", "Part", "x_y", "carrier")
COLORS = ("steelblue", "orange", "dimgray", "firebrick", "seagreen", "gold")


@dataclass
class Joint:
    """A known joint: its kind, the kind of connection, a point on its axis [mm] and its direction."""

    kind: str
    connection: str
    point: tuple[float, float, float]
    axis: tuple[float, float, float]


@dataclass
class Connection:
    """The shapes of a connection, in a frame whose z axis is the axis of motion.

    `below` belongs to the first link, `above` to the second link, and `loose` are further parts. `start` and `end` are the points at which
    the beams of the second and the first link begin.
    """

    below: Part
    above: Part
    loose: list[tuple[str, Part]] = field(default_factory=list)
    start: tuple[float, float, float] = (0, 0, 12)
    end: tuple[float, float, float] = (-20, 0, -3)
    kind: str | None = "revolute"


def _cylinder(radius: float, low: float, high: float, x: float = 0, y: float = 0) -> Part:
    return Pos(x, y, (low + high) / 2) * Cylinder(radius, high - low)


def _box(x: tuple[float, float], y: tuple[float, float], z: tuple[float, float]) -> Part:
    centre = [(low + high) / 2 for low, high in (x, y, z)]
    return Pos(*centre) * Box(x[1] - x[0], y[1] - y[0], z[1] - z[0])


def _below() -> Part:
    return _box((-20, 10), (-10, 10), (-6, 0))


def _above() -> Part:
    return _box((-10, 10), (-10, 10), (0, 6)) + _box((-4, 4), (-4, 4), (6, 12))


def stub(rng: random.Random) -> Connection:
    """A stub shaft in a bore, with a shoulder."""
    radius, gap = rng.uniform(3, 6), rng.choice((0.0, 0.05, 0.1))
    return Connection(_below() - _cylinder(radius, -6, 0), _above() + _cylinder(radius - gap, rng.choice((-6, -8)), 0))


def clevis(rng: random.Random) -> Connection:
    """A tongue in a fork, with a separate pin. With a gap at the sides, nothing prevents the tongue from sliding along the pin."""
    radius, gap, side = rng.uniform(1.5, 3), rng.choice((0.0, 0.05)), rng.choice((0.0, 0.0, 0.0, 0.2))
    fork = _box((-8, 8), (-8, 8), (4, 8)) + _box((-8, 8), (-8, 8), (-8, -4)) + _box((-14, -8), (-8, 8), (-8, 8))
    tongue = _box((-7, 14), (-7, 7), (-4 + side, 4 - side))
    hole = _cylinder(radius, -9, 9)
    return Connection(fork - hole, tongue - hole, [("pin", _cylinder(radius - gap, -9, 9))], start=(13, 0, 0), end=(-13, 0, 0))


def bearing(rng: random.Random) -> Connection:
    """A stub shaft in a plain bearing."""
    gap = rng.choice((0.0, 0.05))
    ring = _cylinder(7, -6, 0) - _cylinder(4, -6, 0)
    return Connection(_below() - _cylinder(7, -6, 0), _above() + _cylinder(4 - gap, -6, 0), [("ring", ring)])


def slide(rng: random.Random) -> Connection:
    """A square bar in a square tube."""
    tube = _box((-10, 10), (-10, 10), (-15, 15)) - _box((-6, 6), (-6, 6), (-15, 15)) + _box((-16, -10), (-5, 5), (-5, 5))
    return Connection(tube, _box((-6, 6), (-6, 6), (-25, 25)), start=(0, 0, 24), end=(-15, 0, 0), kind="prismatic")


def bolted(rng: random.Random) -> Connection:
    """Two plates with four screws."""
    below, above, screws = _below() + _box((-10, 10), (-10, 10), (-6, 0)), _above(), []
    for x, y in ((-7, -7), (-7, 7), (7, -7), (7, 7)):
        below, above = below - _cylinder(1.6, -6, 0, x, y), above - _cylinder(1.6, 0, 6, x, y)
        screws.append(("screw", Pos(x, y, 0) * (_cylinder(1.5, -6, 6) + _cylinder(2.8, 6, 9))))
    return Connection(below, above, screws, kind=None)


def horn(rng: random.Random) -> Connection:
    """A plate on the horn of a servo, which is one solid with the servo."""
    below, above = _cylinder(10, -4, 0) + _box((-20, 10), (-10, 10), (-10, -4)), _above()
    for k in range(4):
        x, y = 7 * math.cos(k * math.pi / 2), 7 * math.sin(k * math.pi / 2)
        below, above = below - _cylinder(1.25, -4, 0, x, y), above - _cylinder(1.25, 0, 6, x, y)
    return Connection(below, above, end=(-19, 0, -7))


CONNECTIONS = {"stub": stub, "clevis": clevis, "bearing": bearing, "slide": slide, "bolted": bolted, "horn": horn}


def _beam(start: Vector, end: Vector) -> Part:
    middle, direction = (start + end) / 2, end - start
    return Plane(origin=middle, z_dir=direction).location * Box(5, 5, direction.length + 3)


def generate(seed: int) -> tuple[Compound, list[Joint]]:
    """Return a random robot as an assembly of build123d, and its joints."""
    rng = random.Random(seed)
    place = Location(Vector(rng.uniform(-50, 50), rng.uniform(-50, 50), rng.uniform(-50, 50)), Vector(0, 0, rng.choice((0, 90, 37))))
    joints, groups, screw = [], [], None
    start, outwards = place * Location(Vector(0, 0, 10)), Vector(0, 0, 1)
    here, solid = place, Part() + _box((-30, 30), (-30, 30), (-10, 12))
    begin = start.position
    loose: list[tuple[str, Part, Location]] = []
    for _ in range(rng.randint(2, 5)):
        name = rng.choice([*CONNECTIONS])
        made = CONNECTIONS[name](rng)
        direction = outwards.rotate(Axis((0, 0, 0), (rng.uniform(-1, 1), rng.uniform(-1, 1), 0.1)), rng.uniform(-20, 20))
        end = begin + direction * rng.uniform(50, 80)
        # the x axis of the connection continues the beam
        frame = Plane(origin=(0, 0, 0), x_dir=direction, z_dir=direction.cross(Vector(0.3, 0.5, 0.8)).normalized()).location
        frame = frame * Location(Vector(0, 0, 0), Vector(rng.choice((0, 90, 45, 180)), 0, 0))
        frame = Location(end - (frame * Location(Vector(*made.end))).position) * frame
        link = here.inverse() * (Part() + here * solid + frame * made.below + _beam(begin, end))
        groups.append((link, here, loose))
        loose = []
        for kind, part in made.loose:
            if kind == "screw":  # equal screws are instances of one shape
                screw = screw or (_cylinder(1.5, -6, 6) + _cylinder(2.8, 6, 9)).solid()
                centre = part.bounding_box().center()
                loose.append((kind, screw, frame * Location(Vector(centre.X, centre.Y, 0))))
            else:
                loose.append((kind, part, frame))
        axis = (frame * Location(Vector(0, 0, 1))).position - frame.position
        if made.kind is not None:
            joints.append(Joint(made.kind, name, tuple(frame.position), tuple(axis)))
        here, solid = frame, made.above
        begin = (frame * Location(Vector(*made.start))).position
        outwards = begin - frame.position
        outwards = outwards.normalized()
    groups.append((Part() + solid, here, loose))
    return _assembly(rng, seed, groups), joints


def _assembly(rng: random.Random, seed: int, groups: list[tuple[Part, Location, list[tuple[str, Part, Location]]]]) -> Compound:
    """Name, colour and place the parts. A link with loose parts becomes a nested assembly half of the time."""
    children = []
    for part, place, loose in groups:
        pieces = [_piece(rng, part, place)]
        colors = {kind: Color(rng.choice(COLORS)) for kind, _, _ in loose}
        pieces += [_piece(rng, shape, at, colors[kind]) for kind, shape, at in loose]
        if loose and rng.random() < 0.5:
            children.append(Compound(label=f"group {len(children)}", children=pieces))
        else:
            children += pieces
    return Compound(label=f"robot {seed}", children=children)


def _piece(rng: random.Random, part: Part | Solid, place: Location, color: Color | None = None) -> Solid:
    solid = place * copy.copy(part.solid() if isinstance(part, Part) else part)
    solid.label = rng.choice(WORDS)
    solid.color = color or Color(rng.choice(COLORS))
    return solid
