"""A part for the cases of the lock."""

from typing import Annotated

from build123d import Box, Location

from thingc import Length, MountPoint, Range, Thing


class Block(Thing):
    """A block with a mount on its top.

    Args:
        edge: of the cube
    """

    def __init__(self, edge: Annotated[Length, Range(5, 50)] = 10) -> None:
        super().__init__(material="steel")
        self.body = Box(edge, edge, edge)
        self.top = MountPoint(Location((0, 0, edge / 2)))

    def result(self) -> Box:
        """The block."""
        return self.body
