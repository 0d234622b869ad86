"""A bar with holes."""

from pathlib import Path

from build123d import Box

from thingc import Length, Thing


class Bar(Thing):
    """A bar with a hole at each end."""

    def __init__(self, length: Length = 60):
        super().__init__(material="petg")
        self.body = Box(length, 10, 6)
        Path("sizes.txt").write_text(f"{length} mm\n")

    def result(self):
        return self.body
