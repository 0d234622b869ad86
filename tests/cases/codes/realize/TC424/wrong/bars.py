"""A bar with marks."""

from build123d import Box

from thingc import Length, Thing


class Bar(Thing):
    """A bar with a table of its marks."""

    def __init__(self, length: Length = 60):
        super().__init__(material="petg")
        self.body = Box(length, 10, 6)
        self.marks = [mark * length for mark in range(10**9)]

    def result(self):
        return self.body
