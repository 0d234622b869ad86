"""Explain errors about unknown keys: find the key that the user probably intended, and the mapping where the key is valid."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from thingc.base.source import Document, MappingNode, Node, Path, ScalarNode, node_at
from thingc.base.suggestions import Hint, Suggestion, closest_name, did_you_mean, near_hint, nearest
from thingc.base.units import shorten
from thingc.documents.spec.annotation_types import FieldType, alternatives, branch_of, likeness, model_keys, one_of, shape_of
from thingc.documents.spec.base import Model
from thingc.documents.spec.foreign_keywords import key_for
from thingc.documents.spec.pruning import MISPLACED, Fault


class UnknownKey:
    """An error about an unknown key in a document. `root` is the model of the document, and `fault` is the validation error.

    `instead` is the key of the same mapping that the user probably intended, or None. `help` is the help text of the error.
    """

    def __init__(self, document: Document, root: type[Model], fault: Fault) -> None:
        self.document = document
        self.path = fault.path
        self.key = str(fault.path[-1])
        self.model = fault.shape.model
        self.known = list(model_keys(self.model)) if self.model is not None else []
        mapping = node_at(document.tree, fault.path[:-1])
        self.present = set(mapping.entries) if isinstance(mapping, MappingNode) else set()
        absent = [key for key in self.known if key not in self.present]
        told = key_for(self.model, self.key) if self.model is not None else None
        self.instead: str | None = None
        self.help: Hint
        if told is not None:
            self.help = self._suggest(told)
            return
        place = None if closest_name(self.key, absent) is not None else self._mate() or self._place(root)
        if place is not None:
            self.help = place
            return
        self.instead = nearest(self.key, absent)
        if self.instead is not None:
            self.help = near_hint(self.key, self.known) or ""
            if str(self.help) != f"did you mean `{self.instead}`?":
                self.help = f"did you mean `{self.instead}`?"
        elif close := nearest(self.key, self.known):
            self.help = f"`{close}` already exists here"
        else:
            self.help = did_you_mean(self.key, self.known, what="keys")

    def _suggest(self, told: str) -> Hint:
        """Return the help text that suggests the key `told` instead of the unknown key.

        If `told` is a whole sentence, this sentence is returned unchanged.
        """
        if told not in self.known:
            return told
        if told in self.present:
            return f"use `{told}`, which already exists here"
        self.instead = told
        return Suggestion(f"use `{told}`", (self.key, told))

    def _mate(self) -> str | None:
        """Suggest the long form of `attach` for an unknown key `turn` or `gap` in a component with the short form of `attach`."""
        if not {"mount", "to"} <= set(self.known) - self.present:
            return None
        return f"write in full: `mount: {shorten(self.key, 40)}, to: {_node_text(node_at(self.document.tree, self.path))}`"

    def _place(self, root: type[Model]) -> str | None:
        """Describe where an unknown key is valid: in a nested mapping, in a parent mapping, or in a section of the document."""
        value = node_at(self.document.tree, self.path)
        if "parameters" in self.known and "part" not in self.known and len(self.path) > 1 and isinstance(value, ScalarNode):
            return f"set a parameter by `parameters: {{{shorten(self.key, 40)}: {shorten(value.text, 40)}}}`"
        shown = _node_text(value)
        if len(self.path) == 3 and self.path[0] == "defaults":
            entries = dict(sections(root)).get(f"{self.path[1]}s")
            if entries is not None and entries.model is not None and self.key in model_keys(entries.model):
                return f"`{self.key}` has no default: set the key in each entry of `{self.path[1]}s`"
        inside = [key for key in self.known if any(self.key in model_keys(one) for one in _models(self.model, key))]
        if inside:
            here = [key for key in inside if key in self.present]
            short = node_at(self.document.tree, (*self.path[:-1], "attach")) if here == ["attach"] else None
            if isinstance(short, MappingNode) and len(short.entries) == 1 and "mount" not in short.entries:
                ((mount, to),) = short.entries.items()
                mate = f"mount: {shorten(mount, 40)}, to: {_node_text(to)}, {self.key}: {shown}"
                return f"write the key inside `attach`, in full: `attach: {{{mate}}}`"
            if here:
                return f"move the key into {one_of(here)}"
            return f"write the key inside {one_of(inside)}: `{inside[0]}: {{{self.key}: {shown}}}`"
        for depth, shape in reversed(list(enumerate(along(root, self.document, self.path[:-1])))[:-1]):
            if shape.model is not None and self.key in model_keys(shape.model):
                around = ".".join(str(step) for step in self.path[:depth])
                what = f"the enclosing `{around}`" if around else "the document itself"
                return f"`{self.key}` is a key of {what}: check the indentation"
        if len(self.path) == 1:
            return self._section(root, value.plain() if value is not None else None) or self._of_entries(root)
        return self._parameter(shown)

    def _section(self, root: type[Model], value: Any) -> str | None:
        """Return a help text that names the section in which the unknown key probably belongs.

        The keys of the value must be similar to the keys of the entries in this section, such as `joints`. Otherwise, return None.
        """
        if not isinstance(value, dict):
            return None
        likes = {name: likeness(entry, value) for name, entry in sections(root) if entry.model is not None}
        best = max(likes, key=lambda name: likes[name], default=None)
        if best is None or likes[best] < 2.0:
            return None
        return f"move `{self.key}` below the key `{best}`, indented by two more spaces"

    def _of_entries(self, root: type[Model]) -> str | None:
        """Return a hint that lists other sections in which the unknown key is valid."""
        having = [name for name, entry in sections(root) if entry.model is not None and self.key in model_keys(entry.model)]
        return f"`{self.key}` is a key of an entry of {one_of(having)}: check the indentation" if having else None

    def _parameter(self, shown: str) -> str | None:
        """Return a help text that describes how to set the parameters of a part or of a nested document."""
        for of, key in (("part", "params"), ("assembly", "parameters")):
            if {of, key} <= set(self.known) and of in self.present and shown != "..." and nearest(self.key, self.known) is None:
                return f"set a parameter of the {of} by `{key}: {{{shorten(self.key, 40)}: {shown}}}`"
        return None


def _node_text(value: Node | None) -> str:
    return shorten(value.text, 40) if isinstance(value, ScalarNode) else "..."


def sections(root: type[Model]) -> Iterator[tuple[str, FieldType]]:
    """Yield the name of each section of a document with named entries, and the type of its entries."""
    for name, (shape, _) in model_keys(root).items():
        if shape.kind == "dict":
            yield name, shape_of(shape.members[0])


def along(root: type[Model], document: Document, path: Path) -> Iterator[FieldType]:
    """Yield the types of the document and of all values along `path`, up to the first unknown key."""
    shape = shape_of(root)
    yield shape
    for depth, step in enumerate(path):
        if shape.kind == "union":
            node = node_at(document.tree, path[:depth])
            chosen = branch_of(shape, node.plain()) if node is not None else None
            if chosen is None:
                return
            shape = chosen
        if shape.kind == "model" and shape.model is not None and str(step) in model_keys(shape.model):
            shape = model_keys(shape.model)[str(step)][0]
        elif shape.kind in ("dict", "list"):
            shape = shape_of(shape.members[0])
        else:
            return
        yield shape


def _models(model: type[Model] | Any, key: str) -> Iterator[type[Model] | Any]:
    """Yield the document models of the mappings that a key accepts as its value."""
    return (one.model for one in alternatives(model_keys(model)[key][0]) if one.model is not None)


def combine_faults(document: Document, root: type[Model], faults: list[Fault]) -> list[Fault]:
    """Combine the errors about keys that have the same indentation as the entry to which they belong.

    Errors that report these keys as missing are dropped.
    """
    misplaced: list[Fault] = []
    for section, entry in sections(root):
        around = node_at(document.tree, (section,))
        if entry.model is None or not isinstance(around, MappingNode):
            continue
        owner: str | None = None
        last: str | None = None
        for name, node in around.entries.items():
            key = model_keys(entry.model).get(name)
            wrong = key is not None and any(fault.path[:2] == (section, name) for fault in faults)
            if key is None or not wrong or not _is_rather(node.plain(), key[0], entry):
                owner = last = name
                continue
            if misplaced and last == misplaced[-1].value[-1] and misplaced[-1].path[0] == section:
                misplaced[-1].value.append(name)
            else:
                misplaced.append(Fault(path=(section, name), kind=MISPLACED, context={"owner": owner}, value=[name], shape=entry, key=True))
            last = name
    if not misplaced:
        return faults
    beside = {(one.path[0], name) for one in misplaced for name in one.value}
    owned = {(one.path[0], one.context["owner"], name) for one in misplaced for name in one.value}
    owners = {(one.path[0], one.context["owner"]) for one in misplaced}
    rest = [
        fault for fault in faults
        if fault.path[:2] not in beside and not (fault.kind == "missing" and fault.path in owned)
        and not (fault.kind == "rule" and fault.path in owners)
    ]
    return [*rest, *misplaced]


def message_of(fault: Fault, *, toml: bool) -> tuple[str, str]:
    """Return the message and the help text for keys that have the same indentation as the entry to which they belong.

    For TOML documents, the texts mention tables instead of indentation.
    """
    section, owner, names = str(fault.path[0]), fault.context["owner"], [f"`{shorten(name)}`" for name in fault.value]
    several = len(names) > 1
    shown = ", ".join(names[:-1]) + f" and {names[-1]}" if several else names[0]
    message = f"{shown} {'are' if several else 'is'} {'written' if toml else 'indented'} like a {section.removesuffix('s')}"
    it = "them" if several else "it"
    if owner is None:
        return f"{message}, and {'are keys' if several else 'is a key'} of one", f"move {it} inside one of the {section}"
    owner = shorten(owner)
    help = f"write `[{section}.{owner}.{fault.value[0]}]`" if toml else f"indent {it} further, like the other keys of `{owner}`"
    return f"{message}, and probably {'belong' if several else 'belongs'} to `{owner}`", help


def _is_rather(value: Any, key: FieldType, entry: FieldType) -> bool:
    """Return whether a value is more similar to the value of the key `key` than to a whole entry of the section."""
    if not isinstance(value, dict):
        return True
    known = sum(name in model_keys(entry.model) for name in value) if entry.model is not None else 0
    return any(likeness(one, value) > known for one in alternatives(key) if one.kind in ("model", "dict"))
