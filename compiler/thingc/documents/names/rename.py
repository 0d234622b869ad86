"""Rename a name at its declaration and at all its uses, or explain why the name cannot be renamed.

The edits are verified by parsing the edited documents. Every reference must refer to the same element as before.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping

from msgspec.structs import replace

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.python_source import parse_python
from thingc.base.safe_text import escape_control
from thingc.base.source import MappingNode, Node, ScalarNode, SequenceNode, Span, entries_of, node_at
from thingc.base.units import shorten
from thingc.documents.expressions.terms import CONSTANTS, FUNCTIONS
from thingc.documents.names.part_names import Name, NamePlace
from thingc.documents.names.workspace_index import WorkspaceIndex, mentions
from thingc.documents.spec.name_types import RESERVED

WORDS = {"export": "exported mount", "part mount": "mount of a part", "part parameter": "parameter of a part"}
"""Descriptions of kinds of names in messages, if they differ from the internal name of the kind."""

_RESERVING = frozenset({"component", "joint", "export", "link", "mount", "part mount"})
"""Kinds of names that cannot be `world`, `root` or `origin`, because these names are reserved."""
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*", re.ASCII)


class RenameRefused(Exception):
    """Raised if a name cannot be renamed. The message of the exception explains the reason."""


class RenameEdits(FrozenStruct):
    """The edits that rename an element of a document.

    `texts` maps absolute paths to the new contents of files. `after` is the index of all names after the rename. The edited locations in
    each file are sorted from last to first.
    """

    places: tuple[Span, ...]
    texts: Mapping[str, str]
    after: WorkspaceIndex


def renamable(sight: WorkspaceIndex, name: Name) -> None:
    """Raise `RenameRefused` if a name cannot be renamed, whatever the new name is."""
    what = WORDS.get(name.what, name.what)
    if name.what in ("document", "part"):
        kinds = "files" if name.what == "document" else "classes"
        raise RenameRefused(f"`thingc rename` does not rename {kinds}, such as `{shorten(name.text)}`")
    if sight.index.find_declaration(name) is None:
        if name.what == "index":
            raise RenameRefused(f"the index `{name.text}` is the default: first add `as: {name.text}` under `repeat`")
        raise RenameRefused(f"cannot find the definition of the {what} `{name.text}` of `{name.owner}` without running its code")
    if name.what == "sensor" and any(
        one.name.what == "joint" and one.span == sight.index.find_declaration(name) for one in sight.index.places
    ):
        raise RenameRefused(f"the sensor `{name.text}` measures the joint with the same name: first add `joint: {name.text}` to the sensor")
    if name.what == "transmission" and (drive := re.search(rf"\b{name.text}_[\d*?[]", text := sight.read(name.file) or "")):
        where = f"{sight.relative(name.file)}:{text.count(chr(10), 0, drive.start()) + 1}"
        raise RenameRefused(f"`{where}` uses a drive of the transmission `{name.text}`: rename the transmission by hand")
    for path, text in sight.broken.items():
        if mentions(text, name.text):
            raise RenameRefused(f"`{sight.relative(path)}` contains `{name.text}` but cannot be parsed: fix the file first")
    if name.what.startswith("part"):
        if not name.file.startswith(tuple(sight.folders)):
            raise RenameRefused(f"`{name.owner}` does not belong to this workspace")
        other = sight.parts.find_in_code(name)
        if other is not None:
            where = f"{sight.relative(other[0])}:{other[1]}"
            raise RenameRefused(f"`{name.text}` at {where} may refer to this {what} of `{name.owner}`: rename it there by hand")
    if name.what == "material":
        for path in sight.parts.files():
            if f'"{name.text}"' in (text := sight.read(path) or "") or f"'{name.text}'" in text:
                raise RenameRefused(f"`{sight.relative(path)}` also uses the material `{name.text}`: rename it there by hand")


def rename_edits(sight: WorkspaceIndex, name: Name, new: str) -> RenameEdits:
    """Compute the text edits that rename a name at its declaration and at all of its uses.

    Raises `RenameRefused` if the new name is invalid or already used, or if other references would resolve differently.
    """
    renamable(sight, name)
    _check(sight, name, new)
    edited = [place for place in sight.index.by_name[name] if place.role != "fits"]
    spans = {place.span for place in edited}
    texts = with_spans(sight, spans, new)
    after = sight.with_texts(texts)
    _compare(sight, after, name, new, spans)
    return RenameEdits(places=tuple(sorted(spans, key=lambda one: (one.file, -one.line, -one.column))), texts=texts, after=after)


def with_spans(sight: WorkspaceIndex, spans: Iterable[Span], new: str) -> dict[str, str]:
    """Replace the text at each span by `new`, and return the new contents of the changed files by absolute path."""
    lines: dict[str, list[str]] = {}
    for span in sorted(spans, key=lambda one: (one.file, one.line, one.column), reverse=True):
        if span.file not in lines:
            lines[span.file] = re.split(r"(\r\n|\r|\n)", sight.read(span.file) or "")
        number = 2 * (span.line - 1)
        line = lines[span.file][number]
        at = 1 if number == 0 and line.startswith("\ufeff") else 0
        lines[span.file][number] = line[: at + span.column - 1] + new + line[at + span.end_column - 1 :]
    return {path: "".join(lines[path]) for path in sorted(lines)}


def _check(sight: WorkspaceIndex, name: Name, new: str) -> None:
    what = WORDS.get(name.what, name.what)
    if not _NAME.fullmatch(new) or len(new) > 1000:
        raise RenameRefused(f"`{escape_control(shorten(new))}` is not a valid name: use a letter, then letters, digits and `_`")
    if new.lower() in ("true", "false", "null"):
        raise RenameRefused(f"`{new}` is not a string in YAML unless it is quoted: choose another name")
    if new in RESERVED and name.what in _RESERVING:
        raise RenameRefused(f"`{new}` is reserved and cannot be the name of a {what}")
    if name.what == "parameter" and (new in CONSTANTS or new in FUNCTIONS):
        raise RenameRefused(f"`{new}` is reserved in expressions and cannot be the name of a parameter")
    if name.what.startswith("part"):
        import keyword

        if keyword.iskeyword(new):
            raise RenameRefused(f"`{new}` is a Python keyword and cannot be the name of a {what}")
        if new in sight.parts.attributes(name):
            raise RenameRefused(f"`{name.owner}` already has a `{new}`")
        alike = sight.parts.find_in_code(replace(name, text=new))
        if alike is not None:  # both names would become the same, so the rename could not be undone
            where = f"{sight.relative(alike[0])}:{alike[1]}"
            raise RenameRefused(f"`{new}` at {where} would then refer to this {what} of `{name.owner}`: choose another name")
        return
    for other, called in _find_conflicts(sight, name, new):
        raise RenameRefused(f"there is already {called} `{other}`" + ("" if other == new else f", which differs from `{new}` only in case"))


def _find_conflicts(sight: WorkspaceIndex, name: Name, new: str) -> Iterator[tuple[str, str]]:
    """Yield the existing names that conflict with a new name, each with the type of its element."""
    written = sight.documents[name.file]
    if name.what == "index":
        if new in written.section("parameters"):
            yield new, "a parameter"
        return
    if name.what == "mount":
        node = node_at(written.document.tree, (*name.owner.split("."), "mounts"))
        mine, theirs = {new.lower()}, dict.fromkeys(entries_of(node), "a mount")
    else:
        theirs = {}
        groups = {"component": ("component", "export"), "export": ("component", "export")}.get(name.what, (name.what,))
        for what in groups:
            section = "mounts" if what == "export" else f"{what}s"
            for key in written.section(section):
                items = written.items(section, key) if what in ("component", "joint") else [key]
                if (what, key) != (name.what, name.text):
                    theirs.update(dict.fromkeys((*items, key), f"{'an' if what == 'export' else 'a'} {WORDS.get(what, what)}"))
        own = written.items(f"{name.what}s", name.text) if name.what in ("component", "joint") else [name.text]
        mine = {new.lower(), *(f"{new}{item[len(name.text):]}".lower() for item in own)}
    if name.what == "parameter":
        theirs.update({
            index: "an index" for section in ("components", "joints") for key in written.section(section)
            if (index := written.index_of((section, key)))
        })
    theirs.pop(name.text, None)
    yield from ((other, called) for other, called in theirs.items() if other.lower() in mine)


def _compare(before: WorkspaceIndex, after: WorkspaceIndex, name: Name, new: str, spans: set[Span]) -> None:
    """Verify the edits of a rename. Raise `RenameRefused` if the edits change anything other than the renamed name."""
    for path in {span.file for span in spans}:
        if path.endswith(".py"):
            try:
                parse_python(after.read(path) or "")
            except SyntaxError:
                raise RenameRefused(f"`{before.relative(path)}` would not be valid Python with `{new}`") from None
            continue
        old, now = before.documents[path].document, after.documents.get(path)
        astray = old.tree.span if now is None else next(_differing(old.tree, now.document.tree, spans), None)
        if astray is not None:
            where = f"{before.relative(path)}:{astray.line}"
            raise RenameRefused(f"`{name.text}` at {where} uses YAML syntax that thingc cannot edit: rename the element by hand")
    along = {place.name for place in before.index.places if place.role == "declared" and place.span in spans}
    section = {"component": "components", "joint": "joints"}.get(name.what, "")

    def now_called(one: Name) -> Name:
        if one in along:
            one = replace(one, text=new)
        if section and (one.file, one.owner) == (name.file, f"{section}.{name.text}"):
            one = replace(one, owner=f"{section}.{new}")
        return one

    wanted = Counter(_known_by(replace(place, name=now_called(place.name))) for place in before.index.places)
    got = Counter(_known_by(place) for place in after.index.places)
    wrong = min((wanted - got) + (got - wanted), default=None)
    if wrong is not None:
        where = f"{before.relative(wrong[0])}:{wrong[1]}"
        raise RenameRefused(f"`{name.text}` cannot be renamed to `{new}`: the text at {where} would change its meaning")


def _known_by(place: NamePlace) -> tuple[str, int, str, str, str, str, str]:
    return place.span.file, place.span.line, place.role, place.name.what, place.name.file, place.name.owner, place.name.text


def _differing(old: Node, new: Node, spans: set[Span]) -> Iterator[Span]:
    """Yield the spans at which two document trees differ, except for the spans that the rename edits."""
    if isinstance(old, MappingNode) and isinstance(new, MappingNode):
        if len(old.entries) != len(new.entries):
            yield old.span
        for (key, one), (other_key, other) in zip(old.entries.items(), new.entries.items(), strict=False):
            if key != other_key and not any(old.keys[key].holds(span) for span in spans):
                yield old.keys[key]
            yield from _differing(one, other, spans)
    elif isinstance(old, SequenceNode) and isinstance(new, SequenceNode):
        if len(old.items) != len(new.items):
            yield old.span
        for one, other in zip(old.items, new.items, strict=False):
            yield from _differing(one, other, spans)
    elif not isinstance(old, ScalarNode) or not isinstance(new, ScalarNode) or type(old.value) is not type(new.value):
        yield old.span
    else:
        changed = old.value != new.value
        if changed and not any(old.span.holds(span) for span in spans):
            yield old.span
