"""Parts that go wrong, each in its own way."""

from __future__ import annotations

import os
import signal

from build123d import Box, Circle, Location, fillet

from thingc import Length, MountPoint, Thing


class Picky(Thing):
    """Asserts what it needs."""

    def __init__(self, length: Length = 10):
        assert length > 20, "too short for its two holes"
        self.foot = MountPoint(Location((0, 0, 0)))

    def result(self):
        return None


class Strict(Thing):
    """Raises in words of its own."""

    def __init__(self, length: Length = 10):
        raise ValueError(f"no stock of {length:g} mm")

    def result(self):
        return None


class Rounded(Thing):
    """Asks the kernel for a fillet that there is no room for."""

    def __init__(self, radius: Length = 50):
        box = Box(10, 10, 10)
        self.body = fillet(box.edges(), radius)

    def result(self):
        return self.body


class Divider(Thing):
    """Divides by nothing."""

    def __init__(self, teeth: int = 0):
        self.pitch = 1 / teeth

    def result(self):
        return None


class Crashing(Thing):
    """Ends its interpreter as a fault in the kernel does."""

    def __init__(self) -> None:
        os.kill(os.getpid(), signal.SIGSEGV)

    def result(self):
        return None


class Leaving(Thing):
    """Leaves."""

    def __init__(self) -> None:
        os._exit(3)

    def result(self):
        return None


class Flat(Thing):
    """Returns a face."""

    def __init__(self) -> None:
        self.body = Circle(10)

    def result(self):
        return self.body


class Talking(Thing):
    """Returns no shape at all."""

    def result(self):
        return "a box, please"


class Unmountable(Thing):
    """Has an argument that no document can give."""

    def __init__(self, tool=None):
        self.tool = tool

    def result(self):
        return self.tool


class Shapeless(Thing):
    """A bar whose author has not come to its result yet."""

    def __init__(self, length: Length = 10):
        self.body = Box(length, 10, 10)


class Forgetful(Thing):
    """A bar whose author forgot to return it."""

    def result(self):
        Box(10, 10, 10)


NUMBER = 3
