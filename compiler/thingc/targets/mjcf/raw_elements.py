"""Add the elements that documents define with `raw: {mjcf: {add: ...}}` to models.

An added element can refer to joints, components and mounts of the document by their paths. An added element can also refer to elements of
the model, and to elements that were added before. If an element refers to a mount, the mount gets a site. If a mode does not contain the
target of a reference, the element is omitted in this mode. For example, the target can be a drive that is omitted, or a joint that cuts a
loop.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from thingc.base.diagnostics import Code, Report
from thingc.base.source import Origin
from thingc.base.suggestions import did_you_mean
from thingc.model.assembly.types import Assembly
from thingc.model.resolve.coordinates import CoordinateName
from thingc.model.resolve.raw import KINDS, named_kind
from thingc.model.resolve.types import RawElement
from thingc.model.robot.tree import in_link
from thingc.model.robot.types import Robot
from thingc.targets.artifact import Loss
from thingc.targets.mjcf import elements
from thingc.targets.xml_writer import Element, unwritable

SECTIONS = ("contact", "custom", "tendon", "equality", "actuator", "sensor", "keyframe")
"""Names of sections, in the order in which missing sections are added."""


def add(assembly: Assembly, robots: Sequence[Robot], models: Sequence[Element], report: Report) -> list[Loss]:
    """Add the raw elements of the documents to the model of each mode. Return an export loss for each element that was omitted in a mode.

    Report an error for each element that no mode can contain.
    """
    losses: list[Loss] = []
    if not assembly.added or not models:
        return losses
    targets = [_Target(robot, model) for robot, model in zip(robots, models, strict=True)]
    for element in assembly.added:
        invalid = next(_find_invalid(element), None)
        if invalid is not None:
            report.add(Code.RAW_UNKNOWN, *invalid, path=element.dotted, help="use elements and attributes from the MJCF reference")
            continue
        missing = [target.add(element) for target in targets]
        if None not in missing and not _may_be_in_other_mode(assembly, missing[0] or ("", "")):
            kind, name = missing[0] or ("", "")
            known = sorted({known_name for target in targets for known_name in target.names.get(kind, ())})
            names = "bodies" if kind == "body" else f"{kind}s"
            report.add(
                Code.RAW_UNKNOWN, f"`{element.tag}` refers to the unknown {kind} `{name}`", element.origin,
                help=did_you_mean(name, known, what=names), path=element.dotted,
            )
        for target, reference in zip(targets, missing, strict=True):
            if reference is not None:
                what = f"the element: the mode has no {reference[0]} `{reference[1]}`"
                losses.append(Loss("mjcf", target.robot.mode.name, element.dotted, what, "omitted", element.origin))
    for target in targets:
        target.add_controls()
    return losses


def _find_invalid(element: RawElement) -> Iterator[tuple[str, Origin]]:
    """Yield a message for each element or attribute that documents must not add.

    Such elements and attributes could change other elements when MuJoCo reads them.
    """
    for name, value in ((element.tag, ""), *element.attributes.items()):
        why = unwritable(name, value)
        if why is not None:
            yield why, element.origin
    if element.tag == "include":
        yield "`include` is not allowed", element.origin
    for child in element.children:
        yield from _find_invalid(child)


def _may_be_in_other_mode(assembly: Assembly, missing: tuple[str, str]) -> bool:
    """Return whether a missing target may exist in a mode that is not built. Also return True if the target is an added element for which
    an error was reported.
    """
    kind, name = missing
    added_names = {(added.section, added.attributes.get("name", "").replace(".", "/")) for added in assembly.added}
    if (kind, name.replace(".", "/")) in added_names:
        return True
    joints = {joint.path for mate in assembly.mates for joint in mate.joints}
    return (kind == "joint" and name in joints) or (kind == "actuator" and name in assembly.drives.values())


class _Target:
    """An MJCF model to which elements are added. The object contains the names of the model's elements, grouped by kind."""

    def __init__(self, robot: Robot, model: Element) -> None:
        self.robot = robot
        self.model = model
        self.drives = 0
        self.names: dict[str, set[str]] = {}
        for element in model.find_or_empty("worldbody").walk():
            self.names.setdefault("joint" if element.tag == "freejoint" else element.tag, set()).add(element.get("name"))
        for kind in ("tendon", "actuator"):
            self.names[kind] = {child.get("name") for child in model.find_or_empty(kind).children}

    def add(self, raw_element: RawElement) -> tuple[str, str] | None:
        """Add an element to the model. Return the kind and the name of a missing target, or None if the element was added."""
        element = self.make_element(raw_element)
        if isinstance(element, tuple):
            return element
        later = SECTIONS[SECTIONS.index(raw_element.section) + 1 :]
        self.model.child(raw_element.section, before=later).children.append(element)
        if raw_element.section in self.names and "name" in element.attributes:
            self.names[raw_element.section].add(element.get("name"))
        self.drives += raw_element.section == "actuator"
        return None

    def make_element(self, raw_element: RawElement) -> Element | tuple[str, str]:
        """Create the MJCF element for a raw element of a document.

        If the raw element refers to an element that does not exist, return the kind and the name of this element instead.
        """
        element = Element(tag=raw_element.tag, attributes=dict(raw_element.attributes), origin=raw_element.origin)
        for name, value in raw_element.attributes.items():
            kind = named_kind(raw_element.attributes, name)
            if kind is not None and name != "name":
                model_name = self.find_name(kind, value)
                if model_name is None:
                    return kind, value
                element.attributes[name] = model_name
        for child in raw_element.children:
            inner = self.make_element(child)
            if isinstance(inner, tuple):
                return inner
            element.children.append(inner)
        return element

    def find_name(self, kind: str, path: str) -> str | None:
        """Return the name of the element in this model that has the given kind and document path. Return None if there is no such element.

        If the path is a mount without a site, a site is added.
        """
        plain = kind != "joint" or path in self.names.get(kind, ())
        name = path if plain else CoordinateName(path.replace("/", ".")).path
        if name in self.names.get(kind, ()) or kind not in KINDS:
            return name
        linked = next((known for known in self.names.get(kind, ()) if known.replace(".", "/") == path), None)  # `/` in place of `.`
        if linked is not None:
            return linked
        assembly = self.robot.assembly
        if kind == "body":
            links = (assembly.links[assembly.link_of[part.index]].name for part in assembly.occurrences if part.path == path)
            return next((link for link in links if link in self.names["body"]), None)
        if kind == "site":
            owner, _, mount = path.rpartition("/")
            for part in assembly.occurrences:
                link = assembly.links[assembly.link_of[part.index]].name
                if part.path == owner and mount in part.mounts and link in self.names["body"]:  # not between joints of one body
                    body = next(body for body in self.model.walk() if body.tag == "body" and body.attributes["name"] == link)
                    pose = in_link(assembly)[part.index] @ part.mounts[mount].pose
                    body.insert(elements.site(path, pose, part.origin), before=("body",))
                    self.names.setdefault("site", set()).add(path)
                    return path
        return None

    def add_controls(self) -> None:
        """Set the controls of drives that were added to 0 in all keyframes."""
        section = self.model.find_or_empty("keyframe")
        for index, key in enumerate(section.children if self.drives else ()):
            ctrl = " ".join([*key.get("ctrl").split(), *["0"] * self.drives])
            section.children[index] = Element(tag=key.tag, attributes={**key.attributes, "ctrl": ctrl}, origin=key.origin)
