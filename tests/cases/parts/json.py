"""A part file that has the name of a module of Python."""

from build123d import Box

from thingc import Thing


class Lid(Thing):
    """A lid."""

    def result(self):
        return Box(20, 10, 2)
