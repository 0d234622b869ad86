"""Legs."""

from build123d import Box
from shapes import WIDTH

from thingc import Thing


class Leg(Thing):
    """A leg."""

    def __init__(self):
        super().__init__(material="petg")
        self.body = Box(WIDTH, 10, 4)

    def result(self):
        return self.body
