"""A bar as long as the document says."""

from build123d import Box

from thingc import Length, Thing


class Bar(Thing):
    """A bar."""

    def __init__(self, length: Length = 60):
        super().__init__(material="petg")
        self.body = Box(length, 10, 4)

    def result(self):
        return self.body
