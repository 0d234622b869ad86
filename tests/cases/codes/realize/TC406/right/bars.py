"""A bar with holes."""

import warnings

from build123d import Box

from thingc import Length, Thing


class Bar(Thing):
    """A bar with a hole at each end."""

    def __init__(self, length: Length = 60):
        super().__init__(material="petg")
        if length / 20 < 3.5:
            warnings.warn("walls below 3.5 mm break", stacklevel=1)
        self.body = Box(length, 10, length / 20)

    def result(self):
        return self.body
