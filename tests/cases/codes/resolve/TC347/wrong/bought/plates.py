"""The plate that is bought."""

from build123d import Box

from thingc import Thing


class Plate(Thing):
    """A plate."""

    def __init__(self):
        super().__init__(material="petg")
        self.body = Box(80, 50, 5)

    def result(self):
        return self.body
