"""XML of others, read within bounds, every element with its place, and what of it a document does not say.

Expat reads it, and nothing that a file could ask it to fetch or to grow.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from xml.parsers import expat

from thingc.base.diagnostics import Code, Note, Report
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.source import Span, line_of
from thingc.tools.importing.source_model import SourceLoss

MARK = "thingc.at"
"""The attribute with the place of an element that xacro has made: number of the file, line, column (both from 1), and byte."""
MOST_BYTES = 50_000_000
MOST_LEVELS = 100
MOST_ELEMENTS = 500_000
_DECLARED = re.compile(rb"""\s*<\?xml\b[^>]*?(\sencoding\s*=\s*["']([^"'>]*)["'])""")


class SourceElement(FrozenStruct, eq=False):
    """An element: its tag, attributes, elements in it and text; `where` is its start tag."""

    tag: str
    attributes: Mapping[str, str]
    where: Span
    children: list[SourceElement] = []
    texts: list[str] = []
    source: bytes
    start: int

    @property
    def text(self) -> str:
        """What stands between its tags, without the space around it."""
        return "".join(self.texts).strip()

    def all(self, tag: str) -> Iterator[SourceElement]:
        """The elements right in it that are called so."""
        return (child for child in self.children if child.tag == tag)

    def place(self, attribute: str) -> Span:
        """Where the value of an attribute stands; the start tag where it is not written."""
        pattern = rb"""[^>]*?\s%s\s*=\s*(?:"([^"]*)"|'([^']*)')""" % re.escape(attribute.encode())
        written = re.compile(pattern).match(self.source, self.start)
        if written is None:
            return self.where
        first, end = written.span(1 if written[1] is not None else 2)
        begun = self.source[self.start : first].decode("utf-8", "replace")
        lines = begun.count("\n")
        column = len(begun) - begun.rfind("\n") if lines else self.where.column + len(begun)
        return _span(self.where.file, self.where.line + lines, column, len(self.source[first:end].decode("utf-8", "replace")))


def utf8_of(data: bytes) -> bytes:
    """Convert an XML file from its declared encoding to UTF-8 and blank the declaration. Raises `ValueError` or `LookupError`."""
    declared = _DECLARED.match(data)
    if declared is None:  # UTF-8, or UTF-16, whose declaration does not match: expat reads both
        return data
    (start, end), encoding = declared.span(1), declared[2].decode("latin-1")
    text = data.decode("" if encoding.lower() == "punycode" else encoding)  # which takes quadratic time
    return f"{text[:start]}{' ' * (end - start)}{text[end:]}".encode("utf-8", "replace")


class _Stop(Exception):
    """Reading ends here: what is wrong has been reported."""


def read_robot(path: str, data: bytes, report: Report, tag: str, form: str, *, files: Sequence[str] = ()) -> SourceElement | None:
    """As `read_xml`, the root of a file of the format `form`, which begins with `tag`; None for any other, too, which has been reported."""
    root = read_xml(path, data, report, files=files)
    if root is None or root.tag == tag:
        return root
    message = f"{form} file begins with `<{tag}>`, and this one with `<{root.tag}>`"
    report.add(Code.SOURCE_XML, message, root.where, help=f"name a file of a robot: `.{form.split()[-1].lower()}`")
    return None


def read_xml(path: str, data: bytes, report: Report, *, files: Sequence[str] = ()) -> SourceElement | None:
    """The root of a file, an absolute path, with these bytes; None where it is none, which has been reported. Elements that xacro has made
    say where they were written, in one of the `files`."""
    if len(data) > MOST_BYTES:
        report.add(Code.SOURCE_XML, f"the file has more than {MOST_BYTES:,} bytes", line_of(path), help="no robot needs so many")
        return None
    try:
        reading = _Reading(path, utf8_of(data), report, files)
    except (ValueError, LookupError) as fault:
        line = data.count(b"\n", 0, getattr(fault, "start", 0)) + 1
        help = "save the file as UTF-8, or declare the encoding that it has"
        report.add(Code.SOURCE_XML, f"cannot decode the file: {fault}", line_of(path, line), help=help)
        return None
    try:
        reading.parser.Parse(reading.data, True)
    except _Stop:
        return None
    except expat.ExpatError as fault:
        report.add(
            Code.SOURCE_XML, f"this is no well-formed XML: {expat.ErrorString(fault.code)}", _span(path, fault.lineno, fault.offset + 1),
            help="fix the place shown; `xmllint FILE` reports more. A file that is not UTF-8 must declare its encoding",
            notes=[Note(message=f"`<{one.tag}>` is open here", span=one.where) for one in reading.open[-1:]],
        )
        return None
    return reading.root


def _content(path: str) -> bytes:
    try:
        with open(path, "rb") as stream:
            return utf8_of(stream.read(MOST_BYTES))
    except (OSError, ValueError, LookupError):
        return b""


def _span(path: str, line: int, column: int, width: int = 0) -> Span:
    return Span(file=path, line=line, column=column, end_line=line, end_column=column + width)


class _Reading:
    def __init__(self, path: str, data: bytes, report: Report, files: Sequence[str]) -> None:
        self.path, self.data, self.report = path, data, report
        self.files = [(file, _content(file)) for file in files]
        self.root: SourceElement | None = None
        self.open: list[SourceElement] = []
        self.count = 0
        self.parser = expat.ParserCreate()
        self.parser.buffer_text = True
        self.parser.StartElementHandler = self._begin
        self.parser.EndElementHandler = self._end
        self.parser.CharacterDataHandler = self._text
        self.parser.EntityDeclHandler = self._entity
        self.parser.StartDoctypeDeclHandler = self._doctype

    def _here(self, width: int = 0) -> Span:
        return _span(self.path, self.parser.CurrentLineNumber, self.parser.CurrentColumnNumber + 1, width)

    def _refuse(self, message: str, help: str) -> None:
        self.report.add(Code.SOURCE_XML, message, self._here(), help=help)
        raise _Stop

    def _begin(self, tag: str, attributes: dict[str, str]) -> None:
        self.count += 1
        if len(self.open) >= MOST_LEVELS:
            self._refuse(f"elements nest more than {MOST_LEVELS} levels deep", "no robot needs so many")
        if self.count > MOST_ELEMENTS:
            self._refuse(f"the file has more than {MOST_ELEMENTS:,} elements", "split it")
        where, source, start = self._here(len(tag) + 1), self.data, self.parser.CurrentByteIndex
        mark = attributes.pop(MARK, "").split(":") if self.files else []
        if len(mark) == 4 and all(one.isdecimal() for one in mark) and int(mark[0]) < len(self.files):
            number, line, column, start = map(int, mark)
            file, source = self.files[number]
            where = _span(file, line, column, len(tag) + 1)
        element = SourceElement(tag=tag, attributes=attributes, where=where, source=source, start=start)
        if self.open:
            self.open[-1].children.append(element)
        else:
            self.root = element
        self.open.append(element)

    def _end(self, tag: str) -> None:
        self.open.pop()

    def _text(self, text: str) -> None:
        if self.open:
            self.open[-1].texts.append(text)

    def _entity(self, name: str, *rest: object) -> None:
        self._refuse(f"the file declares an entity, `{name}`", "entities are not read: write out what it stands for")

    def _doctype(self, name: str, system: str | None, public: str | None, internal: bool) -> None:
        if system or public:
            self._refuse(f"the file wants another one to be read first, `{system or public}`", "leave its `<!DOCTYPE ...>` out")


class Losses:
    """Those of one source, begun with what was noted `before`."""

    def __init__(self, before: Iterable[SourceLoss] = ()) -> None:
        self._noted = list(before)

    def note(self, what: str, why: str, where: Span) -> None:
        """One more: `what` it is, and `why` it is not in the document."""
        self._noted.append(SourceLoss(what=what, why=why, where=where))

    def all(self) -> tuple[SourceLoss, ...]:
        """Those that were noted, from the first line of the source to the last."""
        return tuple(sorted(self._noted, key=lambda one: (one.where.file, one.where.line, one.where.column)))

    def unread(
        self, element: SourceElement, attributes: Mapping[str, Collection[str]], inside: Mapping[str, Collection[str]],
        idle: Mapping[str, Collection[str]], read: Collection[Span] = (),
    ) -> None:
        """Note each element in another, and each attribute, that is not read, the whole of it: `attributes` and `inside` are those that
        are, by tag, `idle` by tag the texts with which one that is not says nothing; and what stands at the places `read` is."""
        for attribute in element.attributes:
            if attribute not in attributes.get(element.tag, ()) and not attribute.startswith("xmlns"):
                self.note(f"`{attribute}` of `<{element.tag}>`", "it is not read", element.where)
        for child in element.children:
            if child.tag in inside.get(element.tag, ()):
                self.unread(child, attributes, inside, idle, read)
            elif child.where not in read and child.text.lower() not in idle.get(child.tag, ()):
                self.note(f"`<{child.tag}>` of `<{element.tag}>`", "it is not read", child.where)
