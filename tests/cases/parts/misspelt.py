"""A part file with a slip in a name."""

from __future__ import annotations

from build123d import Box, Location

from thingc import MountPoint, Thing


class Misspelt(Thing):
    """A part with a slip in a name."""

    def __init__(self) -> None:
        super().__init__(material="petg")
        self.body = Box(10, 10, 10)
        self.top = MountPont(Location((0, 0, 5)))

    def result(self):
        return self.body
