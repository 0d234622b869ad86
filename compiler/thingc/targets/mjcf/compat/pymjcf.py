"""PyMJCF (`dm_control.mjcf`): `/` in names stands for its own scopes, and it refuses names that have one."""

from __future__ import annotations

from collections.abc import Iterator

from thingc.model.robot.types import Robot
from thingc.targets.artifact import Loss
from thingc.targets.mjcf.compat.consumer import Consumer, nothing_refused
from thingc.targets.xml_writer import Element

SEPARATOR = "."
"""In the place of `/`, as documents write paths; no name in a document has one."""

FILES = frozenset({"file", "meshdir", "texturedir", "assetdir"})
"""Attributes whose `/` are those of paths in a file system. No other attribute has any that is not a name's."""


def _suit(robot: Robot, root: Element) -> Iterator[Loss]:
    renamed = False
    for element in root.walk():
        for name, value in element.attributes.items():
            if isinstance(value, str) and "/" in value and name not in FILES:
                element.attributes[name] = value.replace("/", SEPARATOR)
                renamed = True
    if renamed:
        what = f"`/` in names, which PyMJCF refuses: they have `{SEPARATOR}` in its place"
        yield Loss.of(robot.assembly.definition.origin, "mjcf", None, robot.assembly.name, what, "approximated")


PYMJCF = Consumer(name="pymjcf", label="PyMJCF", version="dm_control 1.0.50", suit=_suit, refuses=nothing_refused)
