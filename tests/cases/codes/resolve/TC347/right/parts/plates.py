"""A plate of ours."""

from build123d import Box

from thingc import Thing


class Plate(Thing):
    """A plate."""

    def __init__(self):
        super().__init__(material="petg")
        self.body = Box(60, 40, 4)

    def result(self):
        return self.body
