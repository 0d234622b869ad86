"""A part that is never done."""

from threading import Event

from thingc import Thing


class Endless(Thing):
    def __init__(self) -> None:
        Event().wait()

    def result(self):
        return None
