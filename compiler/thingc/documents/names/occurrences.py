"""Every text of a document that declares a name or names something, by the types of its model's fields (`spec/name_types.py`)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.source import Document, MappingNode, Node, Path, ScalarNode, SequenceNode, walk
from thingc.documents.spec.annotation_types import FieldType, alternatives, branch_of, model_keys, shape_of
from thingc.documents.spec.assembly import AssemblySpec
from thingc.documents.spec.choices import nested
from thingc.documents.spec.name_types import DeclaresName, RefersTo
from thingc.documents.spec.validation import model_of

EXPRESSION = RefersTo("expression")


class NameOccurrence(FrozenStruct):
    """A text that names something: the key at `path`, or (`key` False) the scalar there."""

    path: Path
    key: bool
    text: str
    names: DeclaresName | RefersTo


class SettingWord(FrozenStruct):
    """A word of the path of a setting (`components.leg.joints.knee.limit.upper`) that names something, at an `offset` in it: what a key at
    `path` names in the document that is nested through the components `through`."""

    offset: int
    through: tuple[str, ...]
    path: Path
    names: DeclaresName | RefersTo


def mentions_of(document: Document) -> Iterator[NameOccurrence]:
    """Those of a document, in its order. What stands where its model has nothing is passed over."""
    model = model_of(document.kind)
    if model is not None:
        yield from _in(document.tree, shape_of(model), ())


def _in(node: Node, shape: FieldType, path: Path) -> Iterator[NameOccurrence]:
    if isinstance(node, ScalarNode):
        if isinstance(node.value, str):
            names = _of_text(node.value, shape)
            if names is not None:
                yield NameOccurrence(path=path, key=False, text=node.value, names=names)
    elif isinstance(node, SequenceNode):
        listed = next((one for one in _alternatives(shape) if one.kind == "list"), None)
        inner = shape if listed is None else _member(listed)  # a vector is a field as a whole: what is in it are expressions
        for index, item in enumerate(node.items):
            yield from _in(item, inner, (*path, index))
    elif RefersTo("raw") in {one.names for one in _alternatives(shape)}:
        yield from _in_raw(node, path)
    else:
        branch = branch_of(shape, node.entries)
        if branch is not None and branch.model is not None:
            keys = model_keys(branch.model)
            for key, value in node.entries.items():
                if key in keys:
                    yield from _in(value, keys[key][0], (*path, key))
        elif branch is not None:
            names, inner = _key(branch).names, _member(branch)
            for key, value in node.entries.items():
                if names is not None:
                    yield NameOccurrence(path=(*path, key), key=True, text=key, names=names)
                yield from _in(value, inner, (*path, key))


def _of_text(text: str, shape: FieldType) -> DeclaresName | RefersTo | None:
    branches = _alternatives(shape)
    if text.lstrip().startswith("=") and any(one.kind == "field" for one in branches):
        return EXPRESSION
    if any(text in one.choices for one in branches):
        return None
    return next((one.names for one in branches if one.names is not None), None)


def _in_raw(node: MappingNode, path: Path) -> Iterator[NameOccurrence]:
    """The names of elements: `raw: {mjcf: {joint: {NAME: ...}}}`; of what is added those that it refers to, and those that are ordered."""
    for kind, named in node.entries.items():
        if kind in ("add", "order"):
            for place, value in walk(named, (*path, kind)):
                if isinstance(value, ScalarNode) and isinstance(value.value, str) and (kind == "order" or referred(place)):
                    yield NameOccurrence(path=place, key=False, text=value.value, names=RefersTo("raw"))
            continue
        for name in named.entries if isinstance(named, MappingNode) else ():
            yield NameOccurrence(path=(*path, kind, name), key=True, text=name, names=RefersTo("raw"))


def referred(path: Path) -> str | None:
    """The kind of element that a value in what is added refers to: a joint, a site, a body or anything (`object`); None of any other."""
    key = str(path[-1]).rstrip("12")
    if key in ("objname", "refname"):
        return "object"
    return REFERRED.get(key)


REFERRED = {
    **dict.fromkeys(("joint", "jointinparent", "actuator"), "joint"), **dict.fromkeys(("body", "subtree", "geom"), "body"),
    **dict.fromkeys(("site", "cranksite", "slidersite", "refsite", "sidesite"), "site"),
}
"""Attributes of elements that are added whose value may be called after something of a document, and of what kind that is."""


def setting_words(text: str) -> Iterator[SettingWord]:
    """The words of a path of a setting that name something."""
    offset = 0
    through: list[str] = []
    rest: str | None = text
    while rest is not None:
        inner = nested(rest)
        words = rest.split(".") if inner is None else ["components", inner[0]]
        shape: FieldType | None = shape_of(AssemblySpec)
        at = offset
        for depth, word in enumerate(words):
            branches = _alternatives(shape) if shape is not None else ()
            models = (model_keys(one.model) for one in branches if one.model is not None)
            model = next((keys for keys in models if word in keys), None)
            named = next((one for one in branches if one.kind == "dict"), None)
            names = _key(named).names if model is None and named is not None else None
            if names is not None:
                yield SettingWord(offset=at, through=tuple(through), path=tuple(words[: depth + 1]), names=names)
            shape = model[word][0] if model is not None else _member(named) if named is not None else None
            at += len(word) + 1
        offset, rest = at, None
        if inner is not None:
            through.append(inner[0])
            rest = inner[1]


_KNOWN: dict[int, tuple[Any, FieldType]] = {}
"""Shapes of annotations of the models, by their identity; they are there as long as the models are."""


def _known(annotation: Any) -> FieldType:
    if id(annotation) not in _KNOWN:
        _KNOWN[id(annotation)] = annotation, shape_of(annotation)
    return _KNOWN[id(annotation)][1]


def _member(shape: FieldType) -> FieldType:
    return _known(shape.members[0])


def _key(shape: FieldType) -> FieldType:
    return _known(shape.key)


def _alternatives(shape: FieldType) -> list[FieldType]:
    return [_known(one) for one in shape.members] if shape.kind == "union" else alternatives(shape)
