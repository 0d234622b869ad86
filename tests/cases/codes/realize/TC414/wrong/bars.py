"""A bar with a notch."""

from build123d import Box, Pos

from thingc import Length, Thing


class Bar(Thing):
    """A bar with a notch in the middle."""

    def __init__(self, length: Length = 60, depth: Length = 12):
        super().__init__(material="petg")
        self.body = Box(length, 10, 10) - Pos(0, 0, 5) * Box(8, 10, 2 * depth)

    def result(self):
        return self.body
