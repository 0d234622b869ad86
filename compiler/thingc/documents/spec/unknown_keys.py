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
    """Explains an error about an unknown key. `root` is the model of the document, and `fault` is the validation error.

    `intended` is the key of the same mapping that the user probably intended, or None. `help` is the help text of the error.
    """

    def __init__(self, document: Document, root: type[Model], fault: Fault) -> None:
        self.document = document
        self.path = fault.path
        self.key = str(fault.path[-1])
        self.model = fault.shape.model
        self.known_keys = list(model_keys(self.model)) if self.model is not None else []
        mapping = node_at(document.tree, fault.path[:-1])
        self.present = set(mapping.entries) if isinstance(mapping, MappingNode) else set()
        absent = [key for key in self.known_keys if key not in self.present]
        suggestion = key_for(self.model, self.key) if self.model is not None else None
        self.intended: str | None = None
        self.help: Hint
        if suggestion is not None:
            self.help = self._suggest(suggestion)
            return
        place = None if closest_name(self.key, absent) is not None else self._suggest_attach() or self._suggest_place(root)
        if place is not None:
            self.help = place
            return
        self.intended = nearest(self.key, absent)
        if self.intended is not None:
            hint, message = near_hint(self.key, self.known_keys), f"did you mean `{self.intended}`?"
            self.help = hint if hint is not None and str(hint) == message else message
        elif close := nearest(self.key, self.known_keys):
            self.help = f"remove the key, or use the existing key `{close}`"
        else:
            self.help = did_you_mean(self.key, self.known_keys, what="keys")

    def _suggest(self, suggestion: str) -> Hint:
        """Return the help text that suggests another key. `suggestion` is this key, or a sentence, which is returned unchanged."""
        if suggestion not in self.known_keys:
            return suggestion
        if suggestion in self.present:
            return f"use the existing key `{suggestion}`"
        self.intended = suggestion
        return Suggestion(f"use `{suggestion}`", (self.key, suggestion))

    def _suggest_attach(self) -> str | None:
        """Suggest the long form of `attach` for an unknown key `turn` or `gap` in a component with the short form of `attach`."""
        if not {"mount", "to"} <= set(self.known_keys) - self.present:
            return None
        return f"write the mate in full: `mount: {shorten(self.key, 40)}, to: {_node_text(node_at(self.document.tree, self.path))}`"

    def _suggest_place(self, root: type[Model]) -> str | None:
        """Describe where an unknown key is valid: in a nested mapping, in a parent mapping, or in a section of the document."""
        value = node_at(self.document.tree, self.path)
        if "parameters" in self.known_keys and "part" not in self.known_keys and len(self.path) > 1 and isinstance(value, ScalarNode):
            return f"write `parameters: {{{shorten(self.key, 40)}: {shorten(value.text, 40)}}}` to set a parameter"
        value_text = _node_text(value)
        if len(self.path) == 3 and self.path[0] == "defaults":
            entries = dict(sections(root)).get(f"{self.path[1]}s")
            if entries is not None and entries.model is not None and self.key in model_keys(entries.model):
                return f"set `{self.key}` in each entry of `{self.path[1]}s`"
        mapping_keys = [key for key in self.known_keys if any(self.key in model_keys(model) for model in _models(self.model, key))]
        if mapping_keys:
            present_keys = [key for key in mapping_keys if key in self.present]
            short_form = node_at(self.document.tree, (*self.path[:-1], "attach")) if present_keys == ["attach"] else None
            if isinstance(short_form, MappingNode) and len(short_form.entries) == 1 and "mount" not in short_form.entries:
                ((mount, to),) = short_form.entries.items()
                mate = f"mount: {shorten(mount, 40)}, to: {_node_text(to)}, {self.key}: {value_text}"
                return f"write the key and the mate in full: `attach: {{{mate}}}`"
            if present_keys:
                return f"move the key into {one_of(present_keys)}"
            return f"write the key inside {one_of(mapping_keys)}: `{mapping_keys[0]}: {{{self.key}: {value_text}}}`"
        for depth, shape in reversed(list(enumerate(types_along(root, self.document, self.path[:-1])))[:-1]):
            if shape.model is not None and self.key in model_keys(shape.model):
                enclosing = ".".join(str(step) for step in self.path[:depth])
                return f"move the key into {f'`{enclosing}`' if enclosing else 'the document'} (check the indentation)"
        if len(self.path) == 1:
            return self._suggest_section(root, value.plain() if value is not None else None) or self._suggest_entry(root)
        return self._suggest_parameter(value_text)

    def _suggest_section(self, root: type[Model], value: Any) -> str | None:
        """Return a help text that names the section in which the unknown key probably belongs, such as `joints`.

        Return None if the value does not have the keys of an entry of any section.
        """
        if not isinstance(value, dict):
            return None
        scores = {name: likeness(entry, value) for name, entry in sections(root) if entry.model is not None}
        best = max(scores, key=lambda name: scores[name], default=None)
        if best is None or scores[best] < 2.0:
            return None
        return f"move `{self.key}` into the mapping `{best}`"

    def _suggest_entry(self, root: type[Model]) -> str | None:
        """Return a hint that lists other sections in which the unknown key is valid."""
        section_names = [name for name, entry in sections(root) if entry.model is not None and self.key in model_keys(entry.model)]
        return f"move the key into an entry of {one_of(section_names)} (check the indentation)" if section_names else None

    def _suggest_parameter(self, text: str) -> str | None:
        """Return a help text that describes how to set the parameters of a part or of a nested document."""
        for kind, key in (("part", "params"), ("assembly", "parameters")):
            unclear = text == "..." or nearest(self.key, self.known_keys) is not None
            if {kind, key} <= set(self.known_keys) and kind in self.present and not unclear:
                return f"write `{key}: {{{shorten(self.key, 40)}: {text}}}` to set a parameter of the {kind}"
        return None


def _node_text(value: Node | None) -> str:
    return shorten(value.text, 40) if isinstance(value, ScalarNode) else "..."


def sections(root: type[Model]) -> Iterator[tuple[str, FieldType]]:
    """Yield the name of each section of a document with named entries, and the type of its entries."""
    for name, (shape, _) in model_keys(root).items():
        if shape.kind == "dict":
            yield name, shape_of(shape.members[0])


def types_along(root: type[Model], document: Document, path: Path) -> Iterator[FieldType]:
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
        if shape.model is not None and str(step) in model_keys(shape.model):
            shape = model_keys(shape.model)[str(step)][0]
        elif shape.kind in ("dict", "list"):
            shape = shape_of(shape.members[0])
        else:
            return
        yield shape


def _models(model: type[Model] | Any, key: str) -> Iterator[type[Model] | Any]:
    """Yield the document models of the mappings that a key accepts as its value."""
    return (alternative.model for alternative in alternatives(model_keys(model)[key][0]) if alternative.model is not None)


def combine_faults(document: Document, root: type[Model], faults: list[Fault]) -> list[Fault]:
    """Replace the errors about keys that have the same indentation as the entry to which they belong, by one error for each group of keys.

    Errors that report these keys as missing are removed.
    """
    misplaced: list[Fault] = []
    for section, entry in sections(root):
        section_node = node_at(document.tree, (section,))
        if entry.model is None or not isinstance(section_node, MappingNode):
            continue
        owner: str | None = None
        last: str | None = None
        for name, node in section_node.entries.items():
            key = model_keys(entry.model).get(name)
            wrong = key is not None and any(fault.path[:2] == (section, name) for fault in faults)
            if key is None or not wrong or not _is_misplaced(node.plain(), key[0], entry):
                owner = last = name
                continue
            if misplaced and last == misplaced[-1].value[-1] and misplaced[-1].path[0] == section:
                misplaced[-1].value.append(name)
            else:
                misplaced.append(Fault(path=(section, name), kind=MISPLACED, context={"owner": owner}, value=[name], shape=entry, key=True))
            last = name
    if not misplaced:
        return faults
    misplaced_paths = {(combined.path[0], name) for combined in misplaced for name in combined.value}
    missing_paths = {(combined.path[0], combined.context["owner"], name) for combined in misplaced for name in combined.value}
    owners = {(combined.path[0], combined.context["owner"]) for combined in misplaced}
    remaining = [
        fault for fault in faults
        if fault.path[:2] not in misplaced_paths and not (fault.kind == "missing" and fault.path in missing_paths)
        and not (fault.kind == "rule" and fault.path in owners)
    ]
    return [*remaining, *misplaced]


def message_of(fault: Fault, *, toml: bool) -> tuple[str, str]:
    """Return the message and the help text for keys that have the same indentation as the entry to which they belong.

    For TOML documents, the texts mention tables instead of indentation.
    """
    section, owner, names = str(fault.path[0]), fault.context["owner"], [f"`{shorten(name)}`" for name in fault.value]
    several = len(names) > 1
    keys = ", ".join(names[:-1]) + f" and {names[-1]}" if several else names[0]
    entry, what = section.removesuffix("s"), "keys" if several else "key"
    message = f"{keys} must be {'keys' if several else 'a key'} of"
    if owner is None:
        return f"{message} a {entry}", f"move the {what} into one of the {section}"
    owner = shorten(owner)
    help = f"write `[{section}.{owner}.{fault.value[0]}]`" if toml else f"indent the {what} like the other keys of `{owner}`"
    return f"{message} the {entry} `{owner}`", help


def _is_misplaced(value: Any, key: FieldType, entry: FieldType) -> bool:
    """Return whether a value is more similar to the value of the key `key` than to a whole entry of the section."""
    if not isinstance(value, dict):
        return True
    matching = sum(name in model_keys(entry.model) for name in value) if entry.model is not None else 0
    return any(likeness(alternative, value) > matching for alternative in alternatives(key) if alternative.kind in ("model", "dict"))
