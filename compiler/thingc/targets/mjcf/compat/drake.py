"""Drake: its reader takes every file, and leaves out, with a warning of its own at most, what a `MultibodyPlant` has no word for.

Of several joints of one body it takes the axes and anchors of all but the last in the axes of the parent. So a body that is turned and has
several stands in one of its own that is turned in its place, and does not move. The range of what drives are commanded it takes for that of
their force, so that only motors, of which it is, have one.
"""

from __future__ import annotations

from collections.abc import Iterator

from thingc.model.robot.types import Robot
from thingc.targets.artifact import Loss
from thingc.targets.mjcf.compat.consumer import Consumer, nothing_refused
from thingc.targets.xml_writer import Element

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


COMMANDS = "the range of its commands: Drake takes it for that of its force"
"""What is lost of a drive that is no motor."""

TURNED = ":turned"
"""What the name of a body ends with that is turned in place of the one in it."""


def _suit(robot: Robot, root: Element) -> Iterator[Loss]:
    """Bodies that Drake would read otherwise are wrapped; what it leaves out is lost."""
    for parent in list(root.walk()):
        parent.children[:] = [_unturned(child) if _is_misread(child) else child for child in parent.children]
    for section in root.children:
        for index, one in enumerate(section.children):
            if one.tag in ("position", "velocity") and "ctrlrange" in one.attributes.keys() - one.raw.keys():
                rest = {name: value for name, value in one.attributes.items() if name != "ctrlrange"}
                section.children[index] = Element(tag=one.tag, attributes=rest, origin=one.origin, raw=one.raw)
                yield Loss.of(one.origin, "mjcf", None, _path(one), COMMANDS, "omitted")
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


def _is_misread(element: Element) -> bool:
    """Whether it is a body that is turned, and moves by several joints."""
    return element.tag == "body" and "quat" in element.attributes and sum(child.tag == "joint" for child in element.children) > 1


def _unturned(body: Element) -> Element:
    """A body without a mass in place of this one, which stands in it as it is."""
    outside = {name: value for name, value in body.attributes.items() if name in ("pos", "quat")}
    inside = {name: value for name, value in body.attributes.items() if name not in outside}
    inner = Element(tag="body", attributes=inside, children=body.children, origin=body.origin, raw=body.raw)
    outside = {"name": f"{body.attributes['name']}{TURNED}"} | outside
    return Element(tag="body", attributes=outside, children=[inner], origin=body.origin)


def _path(element: Element) -> str:
    return element.get("name", element.tag).partition(":")[0]


DRAKE = Consumer(name="drake", label="Drake", version="Drake 1.51.1", suit=_suit, refuses=nothing_refused)
