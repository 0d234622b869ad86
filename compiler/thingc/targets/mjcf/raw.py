"""Apply the raw attributes that documents define with `raw: {mjcf: ...}` to the MJCF model.

    joint: {yaw: {solreflimit: 0.01 1}}                       a kind of element, its name, an attribute
    option: {iterations: 20, flag: {contact: disable}}        a section that exists once, and elements in it
    default: {collision: {geom: {solref: 0.01 1}}}            a class, a kind of element, an attribute

This module checks names. MuJoCo checks the attributes and their values.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from thingc.base.diagnostics import Report
from thingc.base.suggestions import Hint, did_you_mean
from thingc.model.assembly.types import Assembly
from thingc.model.resolve.raw import IN_ORDER, ORDERED
from thingc.model.resolve.types import RawAttribute
from thingc.model.robot.types import Robot
from thingc.targets.mjcf import adhesion_contacts
from thingc.targets.raw import report_fault
from thingc.targets.xml_writer import Element, unwritable

TARGET = "mjcf"

SINGLE = ("compiler", "option", "size", "statistic", "visual")
"""Names of the sections that exist only once in a model. Missing sections are added at the top of the model, in the order of this tuple."""

NAMED: dict[str, tuple[str | None, tuple[str, ...] | None]] = {
    "actuator": ("actuator", None), "body": (None, ("body",)), "camera": (None, ("camera",)), "equality": ("equality", None),
    "geom": (None, ("geom",)),
    "joint": (None, ("joint", "freejoint")), "key": ("keyframe", ("key",)), "material": ("asset", ("material",)),
    "mesh": ("asset", ("mesh",)), "numeric": ("custom", ("numeric",)), "sensor": ("sensor", None),
    "site": (None, ("site",)), "tendon": ("tendon", None),
}
"""Kinds of elements that can be selected by name. Each kind has a section (None: the tree of bodies) and tags (None: any tag)."""

KINDS = (*NAMED, *SINGLE, "default")

RESERVED_CLASSES = frozenset({"main", "visual", "collision", adhesion_contacts.CLASS})


def apply(assembly: Assembly, robots: Sequence[Robot], models: Sequence[Element], report: Report) -> None:
    """Apply the raw attributes to the model of each mode. Kinds and names that no mode contains are reported.

    If only some modes contain an element (such as the drive of a joint, or a keyframe), its attributes are applied in these modes. Elements
    that the raw attribute `order` lists come first in every mode, in the listed order.
    """
    ranks: dict[int, int] = {}
    for attribute in assembly.raw:
        if attribute.target != TARGET:
            continue
        is_order = attribute.path[-1] == IN_ORDER
        fault = None if is_order else _shape_fault(attribute)
        if fault is not None:
            report_fault(attribute, (*fault, 0), report)
            continue
        in_models = [_element(attribute, robot, model) for robot, model in zip(robots, models, strict=True)]
        elements = [element for element in in_models if element is not None]
        for element in elements:
            if is_order:
                ranks.setdefault(id(element), len(ranks))
            else:
                if element.tag == "freejoint" and attribute.path[-1] not in ("align", "group"):  # a freejoint has no other attributes
                    element.tag, element.attributes = "joint", {**element.attributes, "type": "free"}
                element.set_raw(attribute.path[-1], attribute)
        if not elements and robots and not _may_be_in_other_mode(attribute, assembly):
            _report_unknown(attribute, robots, models, report)
    for model in models if ranks else ():
        _sort(model, ranks)


def _sort(model: Element, ranks: Mapping[int, int]) -> None:
    """Sort the elements of a model by rank (keyed by `id`). Elements without a rank come last. The controls in keyframes are reordered like
    the actuators.
    """
    for section in (section for kind in ORDERED if (section := model.find(kind)) is not None):
        children = section.children
        indices = sorted(range(len(children)), key=lambda index: ranks.get(id(children[index]), len(ranks)))
        section.children = [children[index] for index in indices]
        keys = model.find_or_empty("keyframe")
        for number, key in enumerate(keys.children if section.tag == "actuator" else ()):
            if "ctrl" in key.attributes and "ctrl" not in key.raw:
                controls = key.get("ctrl").split()
                keys.children[number] = key.copy()
                keys.children[number].attributes["ctrl"] = " ".join(controls[index] for index in indices)


def _shape_fault(attribute: RawAttribute) -> tuple[str, Hint] | None:
    """Return a message and a hint if the path of a raw attribute is invalid. Otherwise, return None."""
    path = attribute.path
    kind = path[0] if path else ""
    if kind not in KINDS:
        return f"unknown kind of element `{kind}` in `raw.mjcf`", did_you_mean(kind, KINDS, what="kinds of elements")
    lengths, expected, form = {2, 3}, f"an attribute of `{kind}`", f"{kind}: {{ATTRIBUTE: VALUE}}"
    if kind in NAMED:
        lengths, expected, form = {3}, f"an attribute of one {kind}", f"{kind}: {{NAME: {{ATTRIBUTE: VALUE}}}}"
    elif kind == "default":
        lengths, expected, form = {4}, "an attribute in a default class", "default: {CLASS: {ELEMENT: {ATTRIBUTE: VALUE}}}"
    if len(path) not in lengths:
        return f"`{attribute.dotted}` must be the path of {expected}", f"write `{form}`"
    problem = unwritable(path[-1], attribute.value)
    return None if problem is None else (problem, "use an attribute of MJCF and valid XML text")


def _element(attribute: RawAttribute, robot: Robot, model: Element) -> Element | None:
    """Return the element of an MJCF model that a raw attribute changes, or None if the model does not contain it."""
    path = attribute.path
    kind = path[0]
    if kind in NAMED:
        elements = {_linked_name(element.get("name")): element for element in _elements_of_kind(kind, model)}
        return next((elements[name] for name in possible_names(attribute) if name in elements), None)
    if kind == "default":
        classes = _classes(robot, model)
        owner = next((classes[name] for name in possible_names(attribute) if name in classes), None)
        return None if owner is None else owner.child(path[2], before=("default",))
    section = model.find(kind)
    if section is None:
        section = Element(tag=kind)
        position = sum(1 for child in model.children if child.tag in SINGLE[: SINGLE.index(kind)])
        model.children.insert(position, section)
    return section if len(path) == 2 else section.child(possible_names(attribute)[-1])


def _linked_name(name: str) -> str:
    """Return the name of an element with `/` as separator, in the form of linked raw attributes. Documents may write `hand.cap` for
    `hand/cap`.
    """
    return name.replace(".", "/")


def possible_names(attribute: RawAttribute) -> tuple[str, ...]:
    """Return the names that an element of the model may have, for the name in a raw attribute.

    A name in a nested document gets the path of this document as prefix. Assets, classes and sections do not belong to an occurrence. For
    assets, classes and sections, the name without the prefix is also possible.
    """
    name = _linked_name(attribute.path[1])
    if attribute.path[0] not in (*SINGLE, "default", "mesh", "material", "key"):
        return (name,)
    steps = name.split("/")
    return tuple("/".join(steps[first:]) for first in range(len(steps)))


def class_name(robot: Robot) -> str:
    """Return the name of the default class of the robot. The class has the name of the robot, unless MuJoCo or thingc uses this name for
    another class.
    """
    name = robot.assembly.name
    return f"{name}_robot" if name in RESERVED_CLASSES else name


def _classes(robot: Robot, model: Element) -> dict[str, Element]:
    """Return the default classes by name. In documents, the name of the document refers to the default class of the robot."""
    elements = model.find_or_empty("default").walk()
    classes = {element.get("class"): element for element in elements if "class" in element.attributes}
    return {robot.assembly.name: classes[class_name(robot)], **classes} if class_name(robot) in classes else classes


def _elements_of_kind(kind: str, model: Element) -> Iterable[Element]:
    section_tag, tags = NAMED[kind]
    section = model.find_or_empty(section_tag or "worldbody")
    return (
        element for element in section.walk()
        if element is not section and "name" in element.attributes and (tags is None or element.tag in tags)
    )


def _may_be_in_other_mode(attribute: RawAttribute, assembly: Assembly) -> bool:
    """Return whether a mode that is not built may contain the element of a raw attribute, if the built models do not contain it."""
    kind, name = attribute.path[0], attribute.path[1]
    owner, _, mount = _linked_name(name).rpartition("/")
    magnet = kind == "actuator" and any(occurrence.path == owner and mount in occurrence.mounts for occurrence in assembly.occurrences)
    if len(attribute.origin) > 1 and (kind == "key" or magnet or attribute.path[-1] == IN_ORDER):
        return True  # the name belongs to a nested document, whose poses and modes are not used
    if kind == "joint":
        return name == assembly.free_joint
    if kind == "actuator":
        return _linked_name(name) in map(_linked_name, assembly.drives.values())
    if kind == "tendon":
        return _linked_name(name) in {tendon.path for tendon in assembly.tendons}
    if kind == "key":
        return any(pose.name in possible_names(attribute) for pose in assembly.poses)
    return False


def _report_unknown(attribute: RawAttribute, robots: Sequence[Robot], models: Sequence[Element], report: Report) -> None:
    kind, name = attribute.path[0], attribute.path[1]
    if kind == "default":
        classes = {key for robot, model in zip(robots, models, strict=True) for key in _classes(robot, model)}
        known_names, described_kind = classes, "class"
    else:
        known_names, described_kind = {element.get("name") for model in models for element in _elements_of_kind(kind, model)}, kind
    message = f"`raw.{attribute.target}` refers to the unknown {described_kind} `{name}`"
    names = "classes" if described_kind == "class" else "bodies" if described_kind == "body" else f"{described_kind}s"
    report_fault(attribute, (message, did_you_mean(name, known_names, what=names), 1), report)
