"""What a program that reads MJCF besides MuJoCo is to us."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.source import Origin
from thingc.model.robot.types import Robot
from thingc.targets.artifact import Loss
from thingc.targets.xml_writer import Element


class Refusal(FrozenStruct):
    """What a consumer refuses a model for, and nothing harmless can be done about: `what` it is, in words that follow a colon; the
    `origin` of what is to blame, its `path` there, and a hint."""

    what: str
    origin: Origin
    path: str
    hint: str


class Consumer(FrozenStruct):
    """A program that reads MJCF: its `name` in `compat`, what people call it, and the version of which this was found out.

    `suit` changes the tree of a mode's model, which is this consumer's alone, where that does no harm, so that it is read: what
    then is not as the document has it is a loss. `refuses` is what it will refuse of the tree all the same.
    """

    name: str
    label: str
    version: str
    suit: Callable[[Robot, Element], Iterator[Loss]]
    refuses: Callable[[Robot, Element], Iterator[Refusal]]


def nothing_lost(robot: Robot, root: Element) -> Iterator[Loss]:
    """Of a consumer for which nothing has to be changed."""
    yield from ()


def nothing_refused(robot: Robot, root: Element) -> Iterator[Refusal]:
    """Of a consumer that refuses nothing which we write."""
    yield from ()
