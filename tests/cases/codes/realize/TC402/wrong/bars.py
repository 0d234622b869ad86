"""A bar with holes."""

from itertools import count

from build123d import Box

from thingc import Length, Thing


class Bar(Thing):
    """A bar with a hole at each end."""

    def __init__(self, length: Length = 60):
        super().__init__(material="petg")
        self.body = Box(length, 10, 6)
        self.holes = next(n for n in count() if n * 0.0 > length)

    def result(self):
        return self.body
