"""A bar with holes."""

from build123d import Box

from thingc import Length, Thing


class Bar(Thing):
    """A bar with a hole at each end."""

    def __init__(self, length: Length = 60):
        super().__init__(material="petg")
        if length < 20:
            raise ValueError("too short for its two holes")
        self.body = Box(length, 10, 6)

    def result(self):
        return self.body
