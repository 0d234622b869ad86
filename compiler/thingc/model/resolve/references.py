"""Resolve references to components and mounts, which are names separated by dots, including names inside nested assemblies."""

from __future__ import annotations

import re
from collections.abc import Iterable
from fnmatch import fnmatchcase
from itertools import islice

from thingc.base.diagnostics import Code, Note
from thingc.base.source import Origin, Path
from thingc.base.suggestions import Hint, did_you_mean, nearest
from thingc.documents.spec.name_types import RESERVED
from thingc.model.resolve.document_scope import ComponentScope, DocumentScope
from thingc.model.resolve.scope import Scope
from thingc.model.resolve.types import COUNTED, AssemblyDefinition, Reference

ORIGIN = "origin"
"""Name of the mount that every component has, whose frame is the frame of the component."""

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*", re.ASCII)
INDEX = re.compile(r"\$(?:\{([A-Za-z][A-Za-z0-9_]*)\}|([A-Za-z][A-Za-z0-9_]*))", re.ASCII)
GLOB = re.compile(r"[*?\[]")
"""Regular expression of a character that occurs only in patterns."""

MAX_SUGGESTED = 1000
"""Maximum number of names that are compared with a misspelled name."""


def replace_index(scope: Scope, text: str, path: Path, *, key: bool = False) -> str | None:
    """Replace the index `$i` or `${i}` of the enclosing `repeat` in a string.

    If the string contains another index, report an error and return None.
    """
    if "$" not in text:
        return text
    unknown: list[str] = []

    def fill(match: re.Match[str]) -> str:
        name = match.group(1) or match.group(2)
        if scope.index is not None:
            if name == scope.index[0]:
                return scope.index[1]
            # `$i_upper` means `$i` followed by `_upper`: the name of the index ends before `_`.
            if match.group(1) is None and name.startswith(scope.index[0] + "_"):
                return scope.index[1] + name[len(scope.index[0]):]
        unknown.append(match.group())
        return ""

    filled = INDEX.sub(fill, text)
    if not unknown:
        return filled
    notes: list[Note] = []
    if scope.index is None:
        message = f"the index `{unknown[0]}` in `{text}` requires `repeat`"
        help = "add `repeat: {count: ...}`, or replace the index with a number"
    else:
        message, help = f"unknown index `{unknown[0]}` in `{text}`", f"use the index `${scope.index[0]}` of this `repeat`"
        notes = scope.second_note("the `repeat` is defined here", (*path[:2], "repeat", "as"), path)
    scope.error(Code.REFERENCE, message, path, help=help, key=key, notes=notes)
    return None


def repeat_origin(scope: Scope, path: Path, *, key: bool = False) -> Origin:
    """Return the location of the enclosing `repeat`, if the string at `path` contains the index of this `repeat`.

    For the first item of the `repeat`, which always exists, return an empty origin.
    """
    text = str(path[-1]) if key else scope.source_text(path) or ""
    if scope.index is None or scope.index[1] == "0" or "$" not in text:
        return ()
    return scope.origin((*path[:2], "repeat", "count"))


def split_names(scope: Scope, text: str, path: Path, *, key: bool = False) -> tuple[str, ...] | None:
    """Split a reference such as `hand.cap.pen` into its names.

    If the string is a pattern or not a valid reference, report an error and return None.
    """
    filled = replace_index(scope, text, path, key=key)
    if filled is None:
        return None
    parts = tuple(filled.split("."))
    invalid = next((part for part in parts if not _NAME.fullmatch(part)), None)
    if invalid is None:
        return parts
    message, help = f"`{invalid}` in `{filled}` is not a valid name", None
    item = re.fullmatch(r"([A-Za-z]\w*)\[(\d+)\]", invalid, re.ASCII)
    if item is not None:
        corrected = ".".join(f"{item.group(1)}_{item.group(2)}" if part == invalid else part for part in parts)
        help = f"write the number of the item after an underscore: `{corrected}`"
    elif GLOB.search(invalid):
        message, help = f"expected a single name, found the pattern `{filled}`", "write the name in full"
    scope.error(Code.REFERENCE, message, path, help=help, key=key)
    return None


def mount(table: DocumentScope, scope: Scope, text: str, path: Path, *, key: bool = False) -> Reference | None:
    """Resolve a reference to a mount of a component (`component.mount`).

    If the reference is invalid, report an error once and return None.
    """
    parts = split_names(scope, text, path, key=key)
    if parts is None:
        return None
    if len(parts) == 1:
        _report_single(table, scope, parts[0], path, key)
        return None
    if not _mount_below(table, scope, parts, path, key):
        return None
    return Reference(
        path=parts[:-1], mount=parts[-1], origin=scope.origin(path, key=key), repeat_origin=repeat_origin(scope, path, key=key),
    )


def shown_mount(table: DocumentScope, scope: Scope, text: str, path: Path, *, key: bool = False) -> Reference | None:
    """Resolve a reference to a mount of a component, or to a mount that this document exports.

    If the reference is invalid, report an error once and return None.
    """
    if text not in table.exports:
        if "." not in text and table.doubts.lacks("mounts"):
            return None
        close = nearest(text, table.exports) if "." not in text and text not in table.nodes else None
        if close is not None:
            scope.error(Code.UNKNOWN_MOUNT, f"this document exports no mount `{text}`", path, help=f"did you mean `{close}`?", key=key)
            return None
        return mount(table, scope, text, path, key=key)
    exported = table.exports[text]
    return None if exported is None else Reference(path=exported.path, mount=exported.mount, origin=scope.origin(path, key=key))


def own_mount(node: ComponentScope, scope: Scope, text: str, path: Path, *, key: bool = False) -> Reference | None:
    """Resolve the first reference of `attach`, which is a mount of the component itself: `back`, or `cap.pen` for a nested assembly."""
    parts = split_names(scope, text, path, key=key)
    if parts is None:
        return None
    if len(parts) > 1 and parts[0] == node.name and (node.table is None or node.name not in node.table.nodes):
        scope.error(
            Code.REFERENCE, f"`attach` must begin with the name of a mount of `{node.name}`, found `{'.'.join(parts)}`", path,
            help=f"write `{'.'.join(parts[1:])}`", key=key,
        )
        return None
    if not _mount_of(node, scope, parts, (node.name, *parts), path, key):
        return None
    return Reference(
        path=(node.name, *parts[:-1]), mount=parts[-1], origin=scope.origin(path, key=key),
        repeat_origin=repeat_origin(scope, path, key=key),
    )


def component(table: DocumentScope, scope: Scope, text: str, path: Path, *, key: bool = False) -> tuple[Reference, ComponentScope] | None:
    """Resolve a reference to a component. If the reference is invalid, report an error once and return None."""
    parts = split_names(scope, text, path, key=key)
    node = None if parts is None else _descend(table, scope, parts, path, key)
    if parts is None or node is None:
        return None
    return Reference(path=parts, mount=None, origin=scope.origin(path, key=key)), node


def root(table: DocumentScope, scope: Scope, text: str, path: Path, *, key: bool = False) -> Reference | None:
    """Resolve the root of a mode, which is a component, a mount of a component, or an exported mount of the document.

    If the reference is invalid, report an error once and return None.
    """
    parts = split_names(scope, text, path, key=key)
    if parts is None:
        return None
    origin = scope.origin(path, key=key)
    if len(parts) == 1 and parts[0] in table.exports:
        exported = table.exports[parts[0]]
        return None if exported is None else Reference(path=exported.path, mount=exported.mount, origin=origin)
    if len(parts) == 1:
        is_component = parts[0] in table.nodes
        if not is_component and (table.doubts.lacks("mounts") or _unbuilt(table.unbuilt, parts[0])):
            return None
        if not is_component and nearest(parts[0], islice(table.nodes, MAX_SUGGESTED)) is None:
            close = nearest(parts[0], table.exports)
            if close is not None:
                message = f"this document has no component or exported mount `{parts[0]}`"
                scope.error(Code.UNKNOWN_COMPONENT, message, path, help=f"did you mean `{close}`?", key=key)
                return None
        if not is_component and parts[0] in RESERVED:
            example = table.base or next(iter(table.nodes), "plate")
            scope.error(
                Code.UNKNOWN_COMPONENT, f"`{parts[0]}` is not a component", path, key=key,
                help=f"use the component that is fixed to the world, for example `{example}`",
            )
            return None
        return Reference(path=parts, mount=None, origin=origin) if _descend(table, scope, parts, path, key) is not None else None
    inner: DocumentScope | None = table
    for step in parts[:-1]:
        node = inner.nodes.get(step) if inner is not None else None
        inner = node.table if node is not None else None
    if inner is not None and parts[-1] in inner.nodes and parts[-1] not in inner.exports:
        return Reference(path=parts, mount=None, origin=origin)
    if parts[-1] == ORIGIN and _descend(table, scope, parts[:-1], path, key) is not None:
        return Reference(path=parts[:-1], mount=None, origin=origin)
    if parts[-1] == ORIGIN or not _mount_below(table, scope, parts, path, key):
        return None
    return Reference(path=parts[:-1], mount=parts[-1], origin=origin)


def matching(table: DocumentScope, pattern: str) -> list[tuple[str, ComponentScope]]:
    """Return the components whose paths match a pattern, in document order.

    Each name in the path is matched separately. A name without special characters matches only the component with this name.
    """
    level: list[tuple[str, ComponentScope]] = []
    scopes: list[tuple[str, DocumentScope]] = [("", table)]
    for step in pattern.split("."):
        level = []
        for prefix, inner in scopes:
            if step in inner.nodes:
                level.append((prefix + step, inner.nodes[step]))
            elif GLOB.search(step):
                level.extend((prefix + name, node) for name, node in inner.nodes.items() if fnmatchcase(name, step))
        scopes = [(f"{name}.", node.table) for name, node in level if node.table is not None]
    return level


def suggest(name: str, names: Iterable[str], *, what: str) -> Hint:
    """Return a hint with a known name that is similar to an unknown name.

    Only the first `MAX_SUGGESTED` names are compared, because comparing 100 000 names would take seconds per error.

    For the name `none`, the hint explains that the key should be omitted.
    """
    if name.lower() == "none":
        return "remove the key to omit the value"
    return did_you_mean(name, islice(names, MAX_SUGGESTED), what=what)


_UNKNOWN = {"joint": Code.UNKNOWN_JOINT, "mode": Code.UNKNOWN_MODE, "pose": Code.UNKNOWN_POSE}


def report_unmatched(
    scope: Scope, text: str, known: Iterable[str], path: Path, what: str, *, fits: str = "", pattern: bool = False,
) -> None:
    """Report an error for a name or a pattern that does not match any element.

    `what` is the type of element for the message: `joint`, `mode` or `pose`.

    `fits` describes the elements that are allowed, if patterns match only some of the elements.
    """
    help = suggest(text, known, what=f"{fits or what}s")
    if pattern or GLOB.search(text):
        scope.error(Code.NO_MATCH, f"pattern `{text}` matches no {fits or what}", path, help=help)
    else:
        scope.error(_UNKNOWN[what], f"there is no {what} `{text}`", path, help=help)


def _unbuilt(prefixes: list[str], name: str) -> bool:
    return any(name.startswith(prefix) or name == prefix[:-1] for prefix in prefixes)


def _descend(table: DocumentScope, scope: Scope, parts: tuple[str, ...], path: Path, key: bool) -> ComponentScope | None:
    """Return the component that a list of component names selects, through nested documents.

    If the component does not exist, report an error once and return None.
    """
    node: ComponentScope | None = None
    inner: DocumentScope | None = table
    for depth, part in enumerate(parts):
        if inner is None:
            if node is not None and not node.unsound:
                _report_leaf(node, scope, parts, depth, path, key)
            return None
        child = inner.nodes.get(part)
        if child is None:
            _report_component(table, inner, scope, parts, depth, path, key)
            return None
        node, inner = child, child.table
        if node.unsound and inner is None and node.spec.assembly is not None:
            return node if depth == len(parts) - 1 else None
    return node


def _mount_below(table: DocumentScope, scope: Scope, parts: tuple[str, ...], path: Path, key: bool) -> bool:
    """Return whether a mount `component...mount` can exist, as far as this is known from the documents.

    If the mount cannot exist, report an error.
    """
    node = table.nodes.get(parts[0])
    if node is None:
        _report_component(table, table, scope, parts, 0, path, key)
        return False
    return _mount_of(node, scope, parts[1:], parts, path, key)


def _mount_of(node: ComponentScope, scope: Scope, remaining: tuple[str, ...], parts: tuple[str, ...], path: Path, key: bool) -> bool:
    while len(remaining) > 1 and node.table is not None:
        inner = node.table.nodes.get(remaining[0])
        if inner is None:
            _report_component(node.table, node.table, scope, parts, len(parts) - len(remaining), path, key)
            return False
        node, remaining = inner, remaining[1:]
    if node.unsound and node.table is None and not node.frame and node.definition is None:
        return True
    if node.incomplete:
        return True
    if len(remaining) > 1:
        _report_leaf(node, scope, parts, len(parts) - len(remaining), path, key)
        return False
    name = remaining[0]
    if name == ORIGIN or name in node.mounts:
        return True
    if node.bare is not None:
        scope.error(
            Code.UNKNOWN_MOUNT, f"{node.bare} `{node.name}` has no mount `{name}`", path,
            help=suggest(name, [ORIGIN, *node.mounts], what="mounts"), key=key,
            notes=[*declaration_note(node), *_repeat_notes(scope, path, key)],
        )
        return False
    if node.table is None:
        return True
    if name in node.table.exports:
        return node.table.exports[name] is not None
    description = f"assembly `{node.name}` (`{node.table.document.relative}`)"
    if name in node.table.nodes:
        scope.error(
            Code.UNKNOWN_MOUNT, f"`{name}` is a component of {description}, not a mount", path,
            help=f"use a mount of the component, for example `{'.'.join(parts)}.{ORIGIN}`", key=key,
            notes=declaration_note(node.table.nodes[name]),
        )
        return False
    if _unbuilt(node.table.unbuilt, name) or node.table.doubts.lacks("mounts"):
        return False
    names = [*node.table.exports, ORIGIN, *node.mounts]
    help = suggest(name, names, what="exported mounts")
    if nearest(name, names) is None:
        help = f"{help}; to export a mount, list the mount under `mounts:` of the nested document"
    scope.error(
        Code.UNKNOWN_MOUNT, f"{description} exports no mount `{name}`", path, help=help, key=key,
        notes=[*definition_note(node.table), *_repeat_notes(scope, path, key)],
    )
    return False


def declaration_note(node: ComponentScope) -> list[Note]:
    """Return a note with the location at which a component is declared."""
    return [Note(message=f"`{node.name}` is defined here", span=node.scope.span(node.path, key=True))]


def definition_note(table: DocumentScope) -> list[Note]:
    """Return a note with the location of the assembly that a nested document defines."""
    return [Note(message=f"`{table.spec.name}` is defined here", span=table.document.span(("name",)))]


def _repeat_notes(scope: Scope, path: Path, key: bool) -> list[Note]:
    """Return a note with the count of the `repeat` whose index a reference uses. The count may be the cause of the error."""
    return scope.second_note(COUNTED, (*path[:2], "repeat", "count"), path) if repeat_origin(scope, path, key=key) else []


def _report_single(table: DocumentScope, scope: Scope, name: str, path: Path, key: bool) -> None:
    if _unbuilt(table.unbuilt, name):
        return
    notes: list[Note] = []
    help: Hint
    if name in table.nodes:
        message = f"expected a mount, found the component `{name}`"
        help = f"use a mount of the component, for example `{name}.{ORIGIN}`"
        notes = declaration_note(table.nodes[name])
    elif name in table.exports:
        notes = [Note(message=f"`{name}` is exported here", span=table.scope.span(("mounts", name), key=True))]
        message, help = f"expected a mount of a component, found the exported mount `{name}`", "write `component.mount`"
    else:
        message, help = f"expected a mount such as `component.mount`, found `{name}`", suggest(name, table.nodes, what="components")
        having = [f"`{node.name}.{name}`" for node in table.nodes.values() if _shows(node, name)]
        if 0 < len(having) <= 3:
            help = f"did you mean {' or '.join(having)}?"
        elif nearest(name, islice(table.nodes, MAX_SUGGESTED)) is not None:
            help = f"{str(help)[:-2]}.MOUNT`?"
    scope.error(Code.REFERENCE, message, path, help=help, key=key, notes=notes)


def _report_component(
    table: DocumentScope, inner: DocumentScope, scope: Scope, parts: tuple[str, ...], depth: int, path: Path, key: bool,
) -> None:
    name = parts[depth]
    if _unbuilt(inner.unbuilt, name):
        return
    is_own = inner is table and depth == 0
    owner = "this document" if is_own else f"assembly `{parts[depth - 1]}` (`{inner.document.relative}`)"
    help: Hint
    message = f"{owner} has no component `{name}`"
    repeated = inner.spec.components.get(name)
    if name in inner.exports:
        message = f"`{name}` is an exported mount of {owner}, not a component"
        help = f"write `{'.'.join(parts[: depth + 1])}`" if depth else "start the reference with a component"
        notes = [Note(message=f"`{name}` is exported here", span=inner.scope.span(("mounts", name), key=True))]
    elif repeated is not None and repeated.repeat is not None:
        copies = [one.name for one in inner.nodes.values() if one.path == ("components", name)]
        help = f"use a copy of `{name}`: `{copies[0]}` to `{copies[-1]}`" if copies else f"set `count` of `{name}` to at least 1"
        notes = [Note(message=f"`{name}` is repeated here", span=inner.scope.span(("components", name, "repeat")))]
    else:
        candidates = [*inner.nodes, *(prefix[:-1] for prefix in inner.unbuilt if prefix)]
        help = suggest(name, candidates, what="components")
        if nearest(name, islice(candidates, MAX_SUGGESTED)) is None and len(parts) == depth + 2:
            having = [f"`{'.'.join((*parts[:depth], one.name, parts[-1]))}`" for one in inner.nodes.values() if _shows(one, parts[-1])]
            help = f"did you mean {' or '.join(having)}?" if 0 < len(having) <= 3 else help
        notes = [*([] if is_own else definition_note(inner)), *_repeat_notes(scope, path, key)]
    scope.error(Code.UNKNOWN_COMPONENT, message, path, help=help, key=key, notes=notes)


def _shows(node: ComponentScope, mount: str) -> bool:
    """Return whether a component has a mount with this name, as far as this is known from the documents.

    Mounts that the class of a part defines are not known.
    """
    return mount in node.mounts or (node.table is not None and mount in node.table.exports)


def _report_leaf(node: ComponentScope, scope: Scope, parts: tuple[str, ...], depth: int, path: Path, key: bool) -> None:
    if node.unsound and node.definition is None and not node.frame:
        return
    kind = f"a {node.bare}" if node.bare is not None else "an assembly" if isinstance(node.definition, AssemblyDefinition) else "a part"
    scope.error(
        Code.UNKNOWN_COMPONENT, f"`{node.name}` in `{'.'.join(parts)}` is {kind} and has no components", path,
        help=f"write `{'.'.join(parts[:depth])}.mount`", key=key, notes=declaration_note(node),
    )
