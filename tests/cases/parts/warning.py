"""A part that has something to say."""

from __future__ import annotations

import warnings

from build123d import Box, Location

from thingc import MountPoint, Thing


class Warned(Thing):
    def __init__(self) -> None:
        super().__init__(material="petg")
        warnings.warn("the walls are thinner than the nozzle", stacklevel=1)
        self.body = Box(10, 10, 10)
        self.foot = MountPoint(Location((0, 0, -5)))

    def result(self):
        return self.body
