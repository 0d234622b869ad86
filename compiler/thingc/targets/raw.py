"""Apply raw attributes to URDF and SDF, in which links and joints have names: `raw: {urdf: ...}` and `raw: {sdf: ...}`.

    urdf: {joint: {crane.swing: {limit: {effort: 20}}}}            a kind of element, its name, elements in it, an attribute
    sdf: {joint: {crane.swing: {axis: {limit: {effort: 20}}}}}     the same, but the last key is an element, which contains the value

This module only checks the names, and that the result is valid XML. Elements on the path that do not exist are added.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from thingc.base.diagnostics import Code, Report
from thingc.base.suggestions import Hint, did_you_mean
from thingc.model.assembly.types import Assembly
from thingc.model.resolve.types import RawAttribute
from thingc.model.robot.types import Robot
from thingc.targets.name_mangling import safe
from thingc.targets.xml_writer import NAMESPACES, Element, unwritable

KINDS = ("link", "joint")
"""Kinds of elements that can be selected by name."""

PREFIXES = {"urdf": ("drake",), "sdf": ("drake", "gz")}
"""Namespace prefixes that readers use for their own elements and attributes."""


def apply(assembly: Assembly, robots: Sequence[Robot], target: Literal["urdf", "sdf"], files: Sequence[Element], report: Report) -> None:
    """Apply the raw attributes of the documents to the XML files of a target.

    `files` contains one element for each chosen mode. Attributes that match no file are reported. If only some modes contain an element,
    its attributes are applied in these modes.
    """
    for attribute in assembly.raw:
        if attribute.target == target:
            report_fault(attribute, _fault(attribute, robots, files) or _apply(attribute, files), report)


Fault = tuple[str, Hint, int]
"""An error in the path of a raw attribute: the message, a hint, and the index of the invalid key."""


def report_fault(attribute: RawAttribute, fault: Fault | None, report: Report) -> None:
    """Report an error in a raw attribute of any format. For None, nothing is reported."""
    if fault is not None:
        message, hint, key = fault
        report.add(Code.RAW_UNKNOWN, message, attribute.at_key(key), help=hint, path=attribute.dotted)


def _apply(attribute: RawAttribute, files: Sequence[Element]) -> Fault | None:
    prefixes = [step.partition(":")[0] for step in attribute.path[2:] if ":" in step]
    for file in files:
        for element in _matching_elements(file, attribute):
            file.attributes |= {f"xmlns:{prefix}": NAMESPACES[prefix] for prefix in prefixes}
            steps = attribute.path[2:] if attribute.target == "sdf" else attribute.path[2:-1]
            for number, step in enumerate(steps, start=2):
                if element.text:
                    return f"`{element.tag}` contains a value and has no `{step}`", "write the value", number
                element = element.find(step) or element.add(step, origin=attribute.origin)
            inside = element.find(attribute.path[-1]) if attribute.target == "urdf" else None
            if inside is not None:
                names = ", ".join(f"`{name}`" for name in inside.attributes) or "the new value"
                return f"`{inside.tag}` is an element, not an attribute", f"use one of the attributes: {names}", len(attribute.path) - 1
            if attribute.target == "urdf":
                element.set_raw(attribute.path[-1], attribute)
            elif element.children:
                tags = ", ".join(dict.fromkeys(f"`{child.tag}`" for child in element.children))
                return f"`{element.tag}` contains elements instead of a value", f"use one of {tags}", len(attribute.path) - 1
            else:
                element.text = attribute.value
    return None


def _fault(attribute: RawAttribute, robots: Sequence[Robot], files: Sequence[Element]) -> Fault | None:
    """Return the reason why the path of a raw attribute is invalid, or None if the path is valid."""
    path, target = attribute.path, attribute.target
    if path[0] not in KINDS:
        message = f"unknown kind of element `{path[0]}` in `raw.{target}`"
        return message, did_you_mean(path[0], KINDS, what="kinds of elements"), 0
    if len(path) < 3:
        return f"`{attribute.dotted}` must be the path of a value", f"write `{path[0]}: {{NAME: {{KEY: VALUE}}}}`", 0
    for number, step in enumerate(path[2:], start=2):
        why = unwritable(step, "")
        if why is not None:
            return why, "use letters, digits, `_`, `-` and `.`, starting with a letter", number
        prefix, colon, _ = step.rpartition(":")
        if colon and prefix not in PREFIXES[target]:
            prefixes = ", ".join(f"`{known_prefix}:`" for known_prefix in PREFIXES[target])
            return f"unknown prefix `{prefix}:` in `raw.{target}`", f"use one of the prefixes {prefixes}", number
    why = unwritable(path[-1], attribute.value)
    if why is not None:
        return why, "remove the character", len(path)
    if any(True for file in files for _ in _matching_elements(file, attribute)):
        return None
    cut = {joint.path for robot in robots for closure in robot.closures for joint in closure.joints}
    if not files or (path[0] == "joint" and in_files(path[1]) in map(safe, cut)):
        return None
    known = {element.get("name") for file in files for element in file.walk() if element.tag == path[0]}
    return f"`raw.{target}` refers to the unknown {path[0]} `{path[1]}`", did_you_mean(path[1], known, what=f"{path[0]}s"), 1


REFERRING = ("transmission", "ros2_control")
"""URDF elements whose children refer to joints of the robot by name."""


def _matching_elements(file: Element, attribute: RawAttribute) -> list[Element]:
    name = in_files(attribute.path[1])
    referring = {id(below) for element in file.walk() if element.tag in REFERRING for below in element.walk() if below is not element}
    return [
        element for element in file.walk()
        if element.tag == attribute.path[0] and in_files(element.get("name")) == name and id(element) not in referring
    ]


def in_files(name: str) -> str:
    """Convert the name of a link or joint from its form in documents (`hand.cap` or `hand/cap`) to its form in output files."""
    return safe(name.replace(".", "/"))
