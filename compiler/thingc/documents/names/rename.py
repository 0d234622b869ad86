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
from thingc.documents.names.workspace_index import WorkspaceIndex, contains_word
from thingc.documents.spec.name_types import RESERVED

DESCRIPTIONS = {"export": "exported mount", "part mount": "mount of a part", "part parameter": "parameter of a part"}
"""Descriptions of kinds of names in messages, if they differ from the internal name of the kind."""

_RESERVING = frozenset({"component", "joint", "export", "link", "mount", "part mount"})
"""Kinds of names that cannot be `world`, `root` or `origin`, because these names are reserved."""
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*", re.ASCII)


class RenameRefused(Exception):
    """Raised if a name cannot be renamed. The message of the exception explains the reason."""


class RenameEdits(FrozenStruct):
    """The edits that rename an element of a document.

    `places` contains the edited locations, for each file from last to first. `texts` maps absolute paths to the new contents of files.
    `after` is the index of all names after the rename.
    """

    places: tuple[Span, ...]
    texts: Mapping[str, str]
    after: WorkspaceIndex


def check_renamable(workspace: WorkspaceIndex, name: Name) -> None:
    """Raise `RenameRefused` if a name cannot be renamed to any new name."""
    description = DESCRIPTIONS.get(name.kind, name.kind)
    if name.kind in ("document", "part"):
        kinds = "files" if name.kind == "document" else "classes"
        raise RenameRefused(f"`thingc rename` does not rename {kinds}, such as `{shorten(name.text)}`")
    if workspace.index.find_declaration(name) is None:
        if name.kind == "index":
            raise RenameRefused(f"the index has its default name `{name.text}`: first add `as: {name.text}` under `repeat`")
        raise RenameRefused(f"the definition of the {description} `{name.text}` was not found in the code of `{name.owner}`")
    if name.kind == "sensor" and any(
        place.name.kind == "joint" and place.span == workspace.index.find_declaration(name) for place in workspace.index.places
    ):
        raise RenameRefused(f"the sensor `{name.text}` measures the joint with the same name: first add `joint: {name.text}` to the sensor")
    if name.kind == "transmission" and (drive := re.search(rf"\b{name.text}_[\d*?[]", text := workspace.read(name.file) or "")):
        where = f"{workspace.relative(name.file)}:{text.count(chr(10), 0, drive.start()) + 1}"
        raise RenameRefused(f"`{where}` uses a drive of the transmission `{name.text}`: rename the transmission by hand")
    for path, text in workspace.broken.items():
        if contains_word(text, name.text):
            raise RenameRefused(f"`{workspace.relative(path)}`, which contains `{name.text}`, cannot be parsed: fix the file first")
    if name.kind.startswith("part"):
        if not name.file.startswith(tuple(workspace.folders)):
            raise RenameRefused(f"`{name.owner}` does not belong to this workspace")
        code_place = workspace.parts.find_in_code(name)
        if code_place is not None:
            where = f"{workspace.relative(code_place[0])}:{code_place[1]}"
            raise RenameRefused(f"`{name.text}` at {where} may refer to the {description} of `{name.owner}`: rename by hand")
    if name.kind == "material":
        for path in workspace.parts.files():
            if f'"{name.text}"' in (text := workspace.read(path) or "") or f"'{name.text}'" in text:
                raise RenameRefused(f"`{workspace.relative(path)}` also uses the material `{name.text}`: rename the material by hand")


def rename_edits(workspace: WorkspaceIndex, name: Name, new: str) -> RenameEdits:
    """Compute the text edits that rename a name at its declaration and at all of its uses.

    Raises `RenameRefused` if the new name is invalid or already used, or if other references would resolve differently.
    """
    check_renamable(workspace, name)
    _check(workspace, name, new)
    edited = [place for place in workspace.index.by_name[name] if place.role != "fits"]
    spans = {place.span for place in edited}
    texts = replace_spans(workspace, spans, new)
    after = workspace.with_texts(texts)
    _compare(workspace, after, name, new, spans)
    return RenameEdits(places=tuple(sorted(spans, key=lambda one: (one.file, -one.line, -one.column))), texts=texts, after=after)


def replace_spans(workspace: WorkspaceIndex, spans: Iterable[Span], new: str) -> dict[str, str]:
    """Replace the text at each span by `new`, and return the new contents of the changed files by absolute path."""
    lines: dict[str, list[str]] = {}
    for span in sorted(spans, key=lambda one: (one.file, one.line, one.column), reverse=True):
        if span.file not in lines:
            lines[span.file] = re.split(r"(\r\n|\r|\n)", workspace.read(span.file) or "")
        number = 2 * (span.line - 1)
        line = lines[span.file][number]
        at = 1 if number == 0 and line.startswith("\ufeff") else 0
        lines[span.file][number] = line[: at + span.column - 1] + new + line[at + span.end_column - 1 :]
    return {path: "".join(lines[path]) for path in sorted(lines)}


def _check(workspace: WorkspaceIndex, name: Name, new: str) -> None:
    description = DESCRIPTIONS.get(name.kind, name.kind)
    if not _NAME.fullmatch(new) or len(new) > 1000:
        raise RenameRefused(f"`{escape_control(shorten(new))}` is not a valid name: use letters, digits and `_` after a letter")
    if new.lower() in ("true", "false", "null"):
        raise RenameRefused(f"`{new}` is a reserved word of YAML: choose another name")
    if new in RESERVED and name.kind in _RESERVING:
        raise RenameRefused(f"a {description} cannot have the reserved name `{new}`")
    if name.kind == "parameter" and (new in CONSTANTS or new in FUNCTIONS):
        raise RenameRefused(f"a parameter cannot have the reserved name `{new}`")
    if name.kind.startswith("part"):
        import keyword

        if keyword.iskeyword(new):
            raise RenameRefused(f"a {description} cannot have the Python keyword `{new}` as its name")
        if new in workspace.parts.attributes(name):
            raise RenameRefused(f"`{name.owner}` already has a `{new}`")
        code_place = workspace.parts.find_in_code(replace(name, text=new))
        if code_place is not None:  # both names would become the same, so the rename could not be undone
            where = f"{workspace.relative(code_place[0])}:{code_place[1]}"
            raise RenameRefused(f"`{new}` at {where} would refer to the {description} of `{name.owner}`: choose another name")
        return
    for existing, kind in _find_conflicts(workspace, name, new):
        difference = "" if existing == new else " with different case"
        raise RenameRefused(f"there is already {kind} `{existing}`{difference}")


def _find_conflicts(workspace: WorkspaceIndex, name: Name, new: str) -> Iterator[tuple[str, str]]:
    """Yield the existing names that conflict with the new name, each with a description of its element ("a joint")."""
    document = workspace.documents[name.file]
    if name.kind == "index":
        if new in document.section("parameters"):
            yield new, "a parameter"
        return
    if name.kind == "mount":
        node = node_at(document.document.tree, (*name.owner.split("."), "mounts"))
        new_names, existing = {new.lower()}, dict.fromkeys(entries_of(node), "a mount")
    else:
        existing = {}
        groups = {"component": ("component", "export"), "export": ("component", "export")}.get(name.kind, (name.kind,))
        for kind in groups:
            section = "mounts" if kind == "export" else f"{kind}s"
            for key in document.section(section):
                items = document.item_names(section, key) if kind in ("component", "joint") else [key]
                if (kind, key) != (name.kind, name.text):
                    existing.update(dict.fromkeys((*items, key), f"{'an' if kind == 'export' else 'a'} {DESCRIPTIONS.get(kind, kind)}"))
        names = document.item_names(f"{name.kind}s", name.text) if name.kind in ("component", "joint") else [name.text]
        new_names = {new.lower(), *(f"{new}{item[len(name.text):]}".lower() for item in names)}
    if name.kind == "parameter":
        existing.update({
            index: "an index" for section in ("components", "joints") for key in document.section(section)
            if (index := document.repeat_index((section, key)))
        })
    existing.pop(name.text, None)
    yield from ((existing_name, description) for existing_name, description in existing.items() if existing_name.lower() in new_names)


def _compare(before: WorkspaceIndex, after: WorkspaceIndex, name: Name, new: str, spans: set[Span]) -> None:
    """Raise `RenameRefused` if the edits of a rename change anything except the renamed name.

    `before` and `after` are the indexes of names before and after the edits, and `spans` contains the edited locations.
    """
    for path in {span.file for span in spans}:
        if path.endswith(".py"):
            try:
                parse_python(after.read(path) or "")
            except SyntaxError:
                raise RenameRefused(f"`{before.relative(path)}` would not be valid Python with `{new}`") from None
            continue
        old, now = before.documents[path].document, after.documents.get(path)
        unsupported = old.tree.span if now is None else next(_find_differences(old.tree, now.document.tree, spans), None)
        if unsupported is not None:
            where = f"{before.relative(path)}:{unsupported.line}"
            raise RenameRefused(f"`{name.text}` at {where} uses YAML syntax that thingc cannot edit: rename the element by hand")
    renamed_names = {place.name for place in before.index.places if place.role == "declared" and place.span in spans}
    section = {"component": "components", "joint": "joints"}.get(name.kind, "")

    def name_after(old_name: Name) -> Name:
        if old_name in renamed_names:
            old_name = replace(old_name, text=new)
        if section and (old_name.file, old_name.owner) == (name.file, f"{section}.{name.text}"):
            old_name = replace(old_name, owner=f"{section}.{new}")
        return old_name

    expected = Counter(_place_key(replace(place, name=name_after(place.name))) for place in before.index.places)
    actual = Counter(_place_key(place) for place in after.index.places)
    difference = min((expected - actual) + (actual - expected), default=None)
    if difference is not None:
        where = f"{before.relative(difference[0])}:{difference[1]}"
        raise RenameRefused(f"`{name.text}` cannot be renamed to `{new}`: the text at {where} would change its meaning")


def _place_key(place: NamePlace) -> tuple[str, int, str, str, str, str, str]:
    return place.span.file, place.span.line, place.role, place.name.kind, place.name.file, place.name.owner, place.name.text


def _find_differences(old: Node, new: Node, spans: set[Span]) -> Iterator[Span]:
    """Yield the spans at which two document trees differ, except for the spans that the rename edits."""
    if isinstance(old, MappingNode) and isinstance(new, MappingNode):
        if len(old.entries) != len(new.entries):
            yield old.span
        for (key, old_item), (other_key, new_item) in zip(old.entries.items(), new.entries.items(), strict=False):
            if key != other_key and not any(old.keys[key].holds(span) for span in spans):
                yield old.keys[key]
            yield from _find_differences(old_item, new_item, spans)
    elif isinstance(old, SequenceNode) and isinstance(new, SequenceNode):
        if len(old.items) != len(new.items):
            yield old.span
        for old_item, new_item in zip(old.items, new.items, strict=False):
            yield from _find_differences(old_item, new_item, spans)
    elif isinstance(old, ScalarNode) and isinstance(new, ScalarNode) and type(old.value) is type(new.value):
        if old.value != new.value and not any(old.span.holds(span) for span in spans):
            yield old.span
    else:
        yield old.span
