"""Drake: its reader takes every file, and leaves out, with a warning of its own at most, what a `MultibodyPlant` has no word for."""

from __future__ import annotations

from collections.abc import Iterator

from thingc.emit.artifact import Loss
from thingc.emit.mjcf.compat.consumer import Consumer, nothing_refused
from thingc.emit.xml import Element
from thingc.robot.types import Robot

SECTIONS = {
    ("equality", "joint"): "what it follows", ("equality", "weld"): "what closes it", ("equality", "connect"): "what closes it",
    ("actuator", "adhesion"): "its adhesion", ("keyframe", "key"): "its keyframe",
}
"""What it leaves out, by section and tag."""

ATTRIBUTES = {
    ("joint", "frictionloss"): "its dry friction", ("joint", "actuatorfrcrange"): "its effort limit",
    ("body", "mocap"): "that it is moved at run time",
}
"""What it leaves out of an element of the tree."""


def _suit(robot: Robot, root: Element) -> Iterator[Loss]:
    """The tree is as Drake takes it; what it leaves out is lost."""
    for section in root.children:
        if section.tag == "sensor":
            for path in dict.fromkeys(_path(one) for one in section.children):
                origin = next(one.origin for one in section.children if _path(one) == path)
                yield Loss.of(origin, "mjcf", None, path, "its sensor: Drake leaves it out", "omitted")
        for one in section.children:
            what = SECTIONS.get((section.tag, one.tag))
            if what is not None:
                own = robot.mode.name if one.tag in ("weld", "connect") else None
                yield Loss.of(one.origin, "mjcf", own, _path(one), f"{what}: Drake leaves it out", "omitted")
    world = root.find("worldbody")
    for element in world.walk() if world is not None else ():
        for name in element.attributes:
            what = ATTRIBUTES.get((element.tag, name))
            if what is not None:
                yield Loss.of(element.origin, "mjcf", None, _path(element), f"{what}: Drake leaves it out", "omitted")


def _path(element: Element) -> str:
    return element.attributes.get("name", element.tag).partition(":")[0]


DRAKE = Consumer(name="drake", label="Drake", version="Drake 1.51.1", suit=_suit, refuses=nothing_refused)
