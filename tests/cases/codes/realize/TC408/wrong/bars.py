"""A bar as long as the environment says."""

import os

from build123d import Box

from thingc import Thing


class Bar(Thing):
    """A bar."""

    def __init__(self):
        super().__init__(material="petg")
        self.body = Box(float(os.environ.get("BAR_LENGTH", 60)), 10, 4)

    def result(self):
        return self.body
