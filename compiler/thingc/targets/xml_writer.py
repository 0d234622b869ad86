"""XML elements with their origin in the documents. Documents are written with numbers at full precision, and with two spaces of indentation
per level.

The XML writers of simulators are not used, because they write fewer digits (MuJoCo's `to_xml`: six) and do not track the origin of
elements.
"""

from __future__ import annotations

import re
from collections.abc import Container, Iterable, Iterator, Mapping
from dataclasses import dataclass, field

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.numeric import formatter
from thingc.base.safe_text import escape_control
from thingc.base.source import Origin
from thingc.model.resolve.types import RawAttribute

XmlValue = str | float | tuple[float, ...]
"""The value of an attribute or an element: a string, or numbers that are formatted when the document is written."""


class RawValue(FrozenStruct):
    """The value that a raw attribute sets, and the value that it replaces (None if the attribute did not exist)."""

    attribute: RawAttribute
    before: XmlValue | None


@dataclass(slots=True, kw_only=True, eq=False)
class Element:
    """An XML element with its origin in the documents.

    `text` is the content of an element without children. `origin` is the location of the element in the documents, and `raw` contains its
    raw attributes. These three fields are empty by default.

    The class is mutable, because trees are built from the top and raw attributes are applied later. An element that several trees share
    must not be changed. A tree that needs a different element makes a `copy`.
    """

    tag: str
    attributes: dict[str, XmlValue] = field(default_factory=dict)
    children: list[Element] = field(default_factory=list)
    text: XmlValue = ""
    origin: Origin = ()
    raw: dict[str, RawValue] = field(default_factory=dict)
    _opening: str | None = field(default=None, init=False, repr=False)

    @property
    def opening(self) -> str:
        """Return the tag with its escaped attributes, without the closing bracket, such as `<joint name="yaw"`."""
        if self._opening is None:
            self._opening = f"<{self.tag}" + "".join([f' {name}="{_escape(value)}"' for name, value in self.attributes.items()])
        return self._opening

    def get(self, name: str, default: str = "") -> str:
        """Return the value of an attribute as a string."""
        return format_value(self.attributes.get(name, default))

    @property
    def texts(self) -> dict[str, str]:
        """Return the values of all attributes as strings."""
        return {name: format_value(value) for name, value in self.attributes.items()}

    def copy(self) -> Element:
        """Return a deep copy of the element. Changes of the copy do not affect the original."""
        top = self._shallow_copy()
        stack = [(self, top)]
        while stack:
            old, new = stack.pop()
            new.children = [child._shallow_copy() for child in old.children]
            stack += zip(old.children, new.children, strict=True)
        return top

    def _shallow_copy(self) -> Element:
        return Element(tag=self.tag, attributes=dict(self.attributes), text=self.text, origin=self.origin, raw=dict(self.raw))

    def add(self, tag: str, attributes: Mapping[str, XmlValue] | None = None, origin: Origin = ()) -> Element:
        """Add a child element with the given tag and attributes, and return it."""
        child = Element(tag=tag, attributes=dict(attributes or {}), origin=origin)
        self.children.append(child)
        return child

    def add_text(self, tag: str, text: XmlValue, attributes: Mapping[str, XmlValue] | None = None) -> None:
        """Add a child element whose content is a string or numbers."""
        self.children.append(Element(tag=tag, attributes=dict(attributes or {}), text=text))

    def fill(self, values: Mapping[str, XmlValue | None]) -> None:
        """Add a child element with the content of each value, by tag. Values that are None are omitted."""
        for tag, value in values.items():
            if value is not None:
                self.add_text(tag, value)

    def find(self, tag: str) -> Element | None:
        """Return the first child element with this tag, or None."""
        return next((child for child in self.children if child.tag == tag), None)

    def find_or_empty(self, tag: str) -> Element:
        """Return the first child element with this tag, or an empty element that is not part of the tree."""
        return self.find(tag) or Element(tag=tag)

    def child(self, tag: str, before: Container[str] = ()) -> Element:
        """Return the first child element with this tag. If there is none, add one, before the first child whose tag is in `before`."""
        child = self.find(tag)
        if child is None:
            child = Element(tag=tag)
            self.insert([child], before)
        return child

    def insert(self, children: Iterable[Element], before: Container[str]) -> None:
        """Add child elements before the first child whose tag is in `before`. If there is no such child, add them at the end."""
        position = next((index for index, child in enumerate(self.children) if child.tag in before), len(self.children))
        self.children[position:position] = children

    def walk(self) -> Iterator[Element]:
        """Yield this element and its descendants in the order in which they are written.

        The method is not recursive, because the nesting of links can be deep.
        """
        stack = [self]
        while stack:
            element = stack.pop()
            yield element
            stack.extend(reversed(element.children))

    @property
    def label(self) -> str:
        """Return the display name of the element, such as joint `yaw`. If the element has no name, return its tag."""
        return f"{self.tag} `{self.get('name')}`" if "name" in self.attributes else f"`{self.tag}`"

    def set_raw(self, name: str, attribute: RawAttribute) -> None:
        """Set an attribute of the element to the value of a raw attribute. The method `unset_raw` undoes the change."""
        before = self.raw[name].before if name in self.raw else self.attributes.get(name)
        self.raw[name] = RawValue(attribute=attribute, before=before)
        self.attributes[name] = attribute.value
        self._opening = None

    def unset_raw(self, name: str) -> RawValue:
        """Restore the value of an attribute that the raw attribute replaced, and return the raw value."""
        value = self.raw.pop(name)
        if value.before is None:
            del self.attributes[name]
        else:
            self.attributes[name] = value.before
        self._opening = None
        return value


class XmlText(FrozenStruct):
    """The text of an XML document. `lines[k]` is the element whose opening tag is on line `k + 1`. For a closing tag or a blank line,
    `lines[k]` is None.
    """

    text: str
    lines: tuple[Element | None, ...]

    def element_at(self, line: int) -> Element | None:
        """Return the element whose opening tag is on a line (counted from 1).

        If no tag opens on the line, return the element on the nearest line above.
        """
        return next((element for element in reversed(self.lines[:line]) if element is not None), None)


@formatter("xml")
def number(value: float) -> str:
    """Format a number at full precision. Whole numbers have no decimal point, and -0.0 becomes `0`."""
    integer = int(value) if abs(value) < 1e16 else None
    return str(integer) if integer is not None and integer == value else repr(float(value))


def format_value(value: XmlValue) -> str:
    """Format the value of an attribute or an element. Numbers are separated by spaces."""
    if isinstance(value, str):
        return value
    return " ".join(map(number, value)) if isinstance(value, tuple) else number(value)


def _escape(value: XmlValue) -> str:
    return value.translate(_ESCAPES) if isinstance(value, str) else format_value(value)


def write(root: Element, heading: str, *, sections: bool = True) -> XmlText:
    """Format an XML document as text. Each element is on its own line, with an indentation of two spaces per level. `heading` is written as
    a comment.

    If `sections` is True, blank lines separate the children of the root element.
    """
    text: list[str] = [f"<!-- {_DASHES.sub('-', heading)} -->"]
    lines: list[Element | None] = [None]
    stack: list[tuple[Iterator[Element], str, str]] = [(iter((root,)), "", "")]  # a stack, because a chain of links may be long
    while stack:
        elements, indent, closing = stack[-1]
        for element in elements:
            if sections and len(stack) == 2 and len(lines) > 2:
                text.append("")
                lines.append(None)
            lines.append(element)
            if element.children:
                text.append(f"{indent}{element.opening}>")
                stack.append((iter(element.children), indent + "  ", f"{indent}</{element.tag}>"))
                break
            content = f">{_escape(element.text)}</{element.tag}>" if element.text != "" else "/>"
            text.append(f"{indent}{element.opening}{content}")
        else:
            stack.pop()
            if closing:
                text.append(closing)
                lines.append(None)
    return XmlText(text="\n".join(text) + "\n", lines=tuple(lines))


NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_.-]*(?::[A-Za-z_][A-Za-z0-9_.-]*)?")
"""Pattern of valid names of elements and attributes, optionally with a prefix and `:`."""

NAMESPACES = {"drake": "http://drake.mit.edu", "gz": "http://gazebosim.org/schema"}
"""Namespaces of the prefixes that readers of URDF and SDF use.

A file that uses a prefix declares its namespace, for example `xmlns:drake`.
"""

NO_CHARACTER = "[^\t\n\r -\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]"
"""Pattern of characters that an XML document cannot contain, even if they are escaped (`Char` in XML 1.0). It is compiled when it is used,
which takes 4 ms.
"""


def unwritable(name: str, value: str) -> str | None:
    """Return the reason why XML does not allow an element or attribute with this name and value, or None if XML allows it."""
    if NAME.fullmatch(name) is None:
        return f"`{name}` is not a valid name in XML"
    invalid = re.search(NO_CHARACTER, value)
    return None if invalid is None else f"the character `{escape_control(invalid[0])}` is not allowed in XML"


_ESCAPES = str.maketrans({"&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;", "\n": "&#10;", "\r": "&#13;", "\t": "&#9;"})
_DASHES = re.compile("-{2,}")  # XML forbids these strings in comments
