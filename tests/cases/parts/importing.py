"""A part file that needs a module that does not exist."""

from no_such_library import gears

from thingc import Thing


class Gear(Thing):
    def result(self):
        return gears.spur()
