"""A part file with a mistake in its syntax."""

from thingc import Thing


class Shelf(Thing):
    def __init__(self, width=60)
        self.width = width


class Foot(Thing):
    pass


class Hook(Thing):
    pass


class Rail(Thing):
    pass
