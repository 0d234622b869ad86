"""Parts of the robot."""

from build123d import Axis, Box, Location, Pos, fillet

from thingc import Length, MountPoint, Thing


class MyPart(Thing):
    """A block. Describe the purpose of the part here.

    The origin is at the centre of the underside. The z axis points up.

    Args:
        length: length along x
        width: width along y
        height: height along z
    """

    def __init__(self, length: Length = 40, width: Length = 30, height: Length = 10):
        super().__init__(material="pla")
        self.bottom = MountPoint(Location((0, 0, 0), (0, 180, 0)))
        self.top = MountPoint(Location((0, 0, height)))
        block = Pos(0, 0, height / 2) * Box(length, width, height)
        self.body = fillet(block.edges().filter_by(Axis.Z), min(length, width) / 10)

    def result(self):
        """Return the block."""
        return self.body

    def collision(self):
        """Return convex solids, which are the collision shapes in simulators if a document sets `collision: part`."""
        return [self.body]
