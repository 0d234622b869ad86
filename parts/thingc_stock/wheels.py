"""Wheels (rim and tyre) and ball casters (socket and ball)."""

from __future__ import annotations

from typing import Annotated

from build123d import Location, Plane, Solid

from thingc import MATE, Count, Length, MountPoint, Range, Thing
from thingc_stock.shapes import bevelled, block, disc, prism, spots, turned


class Rim(Thing):
    """A rim with spokes, printed or turned, for a `Tyre` of the same diameter and width.

    The origin is in the middle of the rim; z is along the axle, outwards.

    Mounts: `hub` is on the inner face of the hub, for attachment to a shaft, a horn or a `ShaftHub`. `tyre` is in the middle, for
    attachment of the mount `seat` of a tyre, and `face` is on the outer face.

    Args:
        diameter: diameter of the seat of the tyre
        width: width of the rim
        bore: bore of the hub
        spokes: number of spokes
    """

    def __init__(
        self,
        diameter: Annotated[Length, Range(20, 400)] = 56.0,
        width: Annotated[Length, Range(5, 100)] = 12.0,
        bore: Annotated[Length, Range(2, 60)] = 5.0,
        spokes: Annotated[Count, Range(3, 12)] = 5,
    ):
        super().__init__(material="pla_white")
        self.hub = MountPoint(Location((0, 0, -width / 2)) * MATE)
        self.tyre = MountPoint(Location((0, 0, 0)), f"tyre-{diameter:g}")
        self.face = MountPoint(Location((0, 0, width / 2)))

    def result(self) -> Solid:
        """Return the solid of the ring, the hub, and the spokes between them."""
        p = self.p
        r, z = p.diameter / 2, p.width / 2
        wall = max(1.6, 0.07 * p.diameter)
        lip = min(1.0, 0.1 * p.width)
        edge = [(r + lip, z), (r + lip, z - lip), (r, z - 2 * lip)]
        ring = turned([(r - wall, -z), *((x, -y) for x, y in edge), *reversed(edge), (r - wall, z)])
        core = max(1.8 * p.bore, 0.24 * p.diameter)
        hub = disc(core, p.width, -z)
        half = 0.055 * p.diameter
        near, far = 0.4 * core, r - 0.5 * wall
        spoke = prism([(near, -half), (far, -0.7 * half), (far, 0.7 * half), (near, half)], -0.7 * z, 1.1 * z)
        spokes = [Location((0, 0, 0), (0, 0, 360.0 * k / p.spokes)) * spoke for k in range(p.spokes)]
        return ring.fuse(hub, *spokes).cut(disc(p.bore, p.width + 2, -z - 1)).solid()

    def collision(self) -> list[Solid]:
        """Return the collision shape: the enclosing cylinder."""
        return [disc(self.p.diameter, self.p.width, -self.p.width / 2)]


class Tyre(Thing):
    """A rubber tyre with a tread for a rim of the class `Rim`.

    The origin is in the middle of the tyre; z is along the axle. The collision shape is a cylinder, because a faceted wheel would vibrate.

    Mounts: `seat` is in the middle, for attachment to the mount `tyre` of a rim.

    Args:
        diameter: diameter of the rim's seat
        width: width of the tyre
        thickness: thickness of the rubber
        treads: number of notches around the tyre
    """

    def __init__(
        self,
        diameter: Annotated[Length, Range(20, 400)] = 56.0,
        width: Annotated[Length, Range(5, 100)] = 12.0,
        thickness: Annotated[Length, Range(1, 60)] = 5.0,
        treads: Annotated[Count, Range(0, 90)] = 24,
    ):
        super().__init__(material="rubber")
        self.outer = diameter + 2 * thickness
        self.seat = MountPoint(MATE, f"tyre-{diameter:g}")

    def result(self) -> Solid:
        """Return the solid of a ring with a bevelled outer surface and the notches of the tread."""
        p = self.p
        body = bevelled(self.outer, p.width, 0.3 * p.thickness, -p.width / 2, bore=p.diameter)
        depth = 0.25 * p.thickness
        notches = [
            Solid.make_box(2 * depth, 0.028 * self.outer, p.width, Plane(spot.position + (0, 0, 0.15 * p.width), x_dir=spot.position))
            for spot in spots(self.outer - 2 * depth, p.treads)
        ]
        return body.cut(*notches).solid() if notches else body

    def collision(self) -> list[Solid]:
        """Return the collision shape: the enclosing cylinder."""
        return [disc(self.outer, self.p.width, -self.p.width / 2)]


class CasterSocket(Thing):
    """The housing of a ball caster: a cup for the ball, with a flange for two screws.

    The origin is in the middle of the flange's top face; z points down to the floor. The shape is not based on a manufacturer's drawing;
    the proportions are estimates of common plastic casters.

    Mounts: `top` is on the face that is attached to the robot. `ball` is at the centre of the ball, with z down. `screw_0` and `screw_1`
    are at the screw holes on the y axis.

    Args:
        ball: diameter of the ball
        height: distance from the flange's top to the floor
    """

    bom = {"make": "buy"}

    def __init__(self, ball: Annotated[Length, Range(6, 60)] = 19.05, height: Annotated[Length, Range(7, 90)] = 23.0):
        super().__init__(material="abs", color="#2a2c30")
        assert height > 1.1 * ball, f"a ball of {ball:g} mm needs a height above {1.1 * ball:g} mm"
        self.centre_z = height - ball / 2
        self.top = MountPoint(MATE)
        self.ball = MountPoint(Location((0, 0, self.centre_z)))
        self.screw = [MountPoint(Location((0, y, 2.5)), "m3-head") for y in (0.85 * ball, -0.85 * ball)]

    def result(self) -> Solid:
        """Return the solid of the flange and the cup, with space for the ball and with two holes."""
        p = self.p
        flange = block((0.7 * p.ball, 2.2 * p.ball, 2.5), (0, 0, 1.25), corner=0.1 * p.ball)
        cup = bevelled(1.3 * p.ball, self.centre_z + 0.1 * p.ball, 0.8)
        room = Solid.make_sphere(p.ball / 2 + 0.3, Plane((0, 0, self.centre_z)))
        holes = [disc(3.2, 6, -1, y=mount.location.position.Y) for mount in self.screw]
        return flange.fuse(cup).cut(room, *holes).solid()

    def collision(self) -> list[Solid]:
        """Return the collision shape: the cup down to the middle of the ball, above the floor."""
        return [disc(1.3 * self.p.ball, self.centre_z)]


class CasterBall(Thing):
    """The ball of a ball caster.

    Mounts: `middle` is at the centre of the ball, for attachment to the mount `ball` of a socket.

    Args:
        diameter: diameter of the ball
    """

    bom = {"make": "buy"}

    def __init__(self, diameter: Annotated[Length, Range(6, 60)] = 19.05):
        super().__init__(material="pom")
        self.middle = MountPoint(MATE)

    def result(self) -> Solid:
        """Return the solid of the ball."""
        return Solid.make_sphere(self.p.diameter / 2)

    def collision(self) -> list[Solid]:
        """Return the collision shape: a sphere."""
        return [Solid.make_sphere(self.p.diameter / 2)]
