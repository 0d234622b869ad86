"""Adapt MJCF models to PyMJCF (`dm_control.mjcf`), which rejects names that contain `/`."""

from __future__ import annotations

from collections.abc import Iterator

from thingc.model.robot.types import Robot
from thingc.targets.artifact import Loss
from thingc.targets.mjcf.compat.consumer import Consumer
from thingc.targets.xml_writer import Element

SEPARATOR = "."
"""Separator in the paths of names that replaces `/`. Names in documents do not contain this character."""

FILES = frozenset({"file", "meshdir", "texturedir", "assetdir"})
"""Attributes whose values are file paths. In all other attributes, `/` only occurs in names."""


def _adapt(robot: Robot, root: Element) -> Iterator[Loss]:
    renamed = False
    for element in root.walk():
        for name, value in element.attributes.items():
            if isinstance(value, str) and "/" in value and name not in FILES:
                element.attributes[name] = value.replace("/", SEPARATOR)
                renamed = True
    if renamed:
        what = f"`/` in names: replaced by `{SEPARATOR}` for PyMJCF"
        yield Loss("mjcf", None, robot.assembly.name, what, "approximated", robot.assembly.definition.origin)


PYMJCF = Consumer(name="pymjcf", label="PyMJCF", version="dm_control 1.0.50", adapt=_adapt)
