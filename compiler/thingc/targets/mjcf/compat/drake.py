"""Adapt MJCF models to Drake, whose parser accepts every file but ignores some elements and attributes. For features that a
`MultibodyPlant` does not support, Drake prints at most a warning.

If a body has several joints, Drake expects the axes and anchors of all joints except the last in the axes of the parent. Therefore, a
rotated body with several joints is put into an additional parent body, which has the rotation. Drake reads the attribute `ctrlrange` of a
drive as its force range. Therefore, only motors have this attribute.
"""

from __future__ import annotations

from collections.abc import Iterator

from thingc.model.robot.types import Robot
from thingc.targets.artifact import Loss
from thingc.targets.mjcf.compat.consumer import Consumer
from thingc.targets.xml_writer import Element

SECTIONS = {
    ("equality", "joint"): "the mimic", ("equality", "weld"): "the closing constraint", ("equality", "connect"): "the closing constraint",
    ("actuator", "adhesion"): "the adhesion", ("keyframe", "key"): "the keyframe",
}
"""Elements that Drake ignores, by section and tag."""

ATTRIBUTES = {
    ("joint", "frictionloss"): "the dry friction", ("joint", "actuatorfrcrange"): "the effort limit",
    ("body", "mocap"): "the motion at run time",
}
"""Attributes that Drake ignores, by tag and name of the attribute."""


COMMANDS = "the command range: Drake would limit the force instead"
"""Description of the loss for a drive that is not a motor."""

TURNED = ":turned"
"""Suffix of the name of an additional body that has the rotation of another body."""


def _adapt(robot: Robot, root: Element) -> Iterator[Loss]:
    """Put each body that Drake would read incorrectly into an additional body. Yield an export loss for each feature that Drake ignores."""
    for parent in list(root.walk()):
        parent.children[:] = [_wrap_rotated(child) if _is_misread(child) else child for child in parent.children]
    for section in root.children:
        for index, item in enumerate(section.children):
            if item.tag in ("position", "velocity") and "ctrlrange" in item.attributes.keys() - item.raw.keys():
                kept_attributes = {name: value for name, value in item.attributes.items() if name != "ctrlrange"}
                section.children[index] = Element(tag=item.tag, attributes=kept_attributes, origin=item.origin, raw=item.raw)
                yield Loss("mjcf", None, _path(item), COMMANDS, "omitted", item.origin)
        if section.tag == "sensor":
            for path in dict.fromkeys(_path(item) for item in section.children):
                origin = next(item.origin for item in section.children if _path(item) == path)
                yield Loss("mjcf", None, path, "the sensor: not supported by Drake", "omitted", origin)
        for item in section.children:
            what = SECTIONS.get((section.tag, item.tag)) or ("the delay of the drive" if "delay" in item.attributes else None)
            if what is not None:
                own = robot.mode.name if item.tag in ("weld", "connect") else None
                yield Loss("mjcf", own, _path(item), f"{what}: not supported by Drake", "omitted", item.origin)
    for element in root.find_or_empty("worldbody").walk():
        for name in element.attributes:
            what = ATTRIBUTES.get((element.tag, name))
            if what is not None:
                yield Loss("mjcf", None, _path(element), f"{what}: not supported by Drake", "omitted", element.origin)


def _is_misread(element: Element) -> bool:
    """Return whether an element is a rotated body with several joints."""
    return element.tag == "body" and "quat" in element.attributes and sum(child.tag == "joint" for child in element.children) > 1


def _wrap_rotated(body: Element) -> Element:
    """Put a rotated body into a new massless body with the same pose, and return the new body. The original body becomes the child of the
    new body.
    """
    outside = {name: value for name, value in body.attributes.items() if name in ("pos", "quat")}
    inside = {name: value for name, value in body.attributes.items() if name not in outside}
    inner = Element(tag="body", attributes=inside, children=body.children, origin=body.origin, raw=body.raw)
    outside = {"name": f"{body.attributes['name']}{TURNED}"} | outside
    return Element(tag="body", attributes=outside, children=[inner], origin=body.origin)


def _path(element: Element) -> str:
    return element.get("name", element.tag).partition(":")[0]


DRAKE = Consumer(name="drake", label="Drake", version="Drake 1.51.1", adapt=_adapt)
