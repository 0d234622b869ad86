"""A bar with holes."""

from build123d import Box, Cylinder, Pos

from thingc import Length, Thing

HOLES = {"axle", "belt", "chain", "drive", "end"}
"""In a row, each as wide as its name is long."""


class Bar(Thing):
    """A bar with a row of holes."""

    def __init__(self, length: Length = 60):
        super().__init__(material="petg")
        self.body = Box(length, 10, 5)
        for place, name in enumerate(HOLES):
            self.body -= Pos(10 * place - 20, 0, 0) * Cylinder(len(name) / 2, 5)

    def result(self):
        return self.body
