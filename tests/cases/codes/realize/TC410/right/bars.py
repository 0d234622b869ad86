"""A bar with holes."""

import subprocess

from build123d import Box

from thingc import Length, Thing


class Bar(Thing):
    """A bar with a hole at each end."""

    def __init__(self, length: Length = 60):
        super().__init__(material="petg")
        subprocess.run(["sleep", "0.1"])
        self.body = Box(length, 10, 6)

    def result(self):
        return self.body
