"""Arms."""

from build123d import Box

from thingc import Thing


class Arm(Thing):
    """An arm."""

    def __init__(self):
        super().__init__(material="petg")
        self.body = Box(10, 10, 4)

    def result(self):
        return self.body
