"""Where a document says something, and in what words: so that what somebody changed is told from what follows from it."""

from __future__ import annotations

import re
from collections.abc import Sequence

from thingc.base.source import MappingNode, Node, ScalarNode, Span
from thingc.base.units import UnitError, parse_quantity
from thingc.documents.load.documents import Documents
from thingc.model.resolve.types import Component
from thingc.tools.diff.snapshot import Fact, Value

_NAME = re.compile(r"[A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*")


Section = tuple[Node | None, ...]
"""What a document says of one thing: in its own place, then where it says it of others, too (defaults, the mode that one extends)."""


class DocumentTrees:
    """The trees of documents, asked by what they are about."""

    def __init__(self, documents: Documents) -> None:
        self._trees = {relative: document.tree for relative, document in documents.by_path.items()}
        self._lines = {document.path: document.text.split("\n") for document in documents.by_path.values()}
        self._components: dict[str, Section] = {}
        self._by_key: dict[str, dict[Span, str]] = {}

    def note_component(self, path: str, document: str, component: Component) -> Section:
        """What the document (its path in the workspace) says of a component, which from now on is known by its path."""
        tree = self._trees.get(document)
        components = tree.entries.get("components") if tree is not None else None
        if not isinstance(components, MappingNode):
            return ()
        if document not in self._by_key:
            self._by_key[document] = {span: key for key, span in components.keys.items()}
        key = next((self._by_key[document][span] for span in component.origin if span in self._by_key[document]), component.name)
        section = (components.entries.get(key), _at(tree, ("defaults", "component")))
        self._components[path] = section
        return section

    def component(self, prefix: str) -> Section:
        """What the document above says of the assembly at a prefix (`hand/`)."""
        return self._components.get(prefix.rstrip("/"), ())

    def section(self, document: str, *keys: str) -> Section:
        """What a document says under some keys, and in what that `extends`."""
        *above, name = keys
        nodes: dict[str, Node | None] = {}
        while name not in nodes:
            node = nodes[name] = _at(self._trees.get(document), (*above, name))
            further = node.entries.get("extends") if isinstance(node, MappingNode) else None
            if not isinstance(further, ScalarNode):
                break
            name = str(further.value)
        return tuple(nodes.values())

    def words_at(self, span: Span | None) -> str | None:
        """What stands at a place of a document; None where that is more than a line."""
        lines = self._lines.get(span.file) if span is not None else None
        if lines is None or span is None or span.line != span.end_line or span.line > len(lines):
            return None
        return lines[span.line - 1][span.column - 1 : span.end_column - 1]

    def parameter(self, document: str, name: str) -> dict[str, tuple[str, Span]]:
        """The words and place of the value and the bounds of a parameter that a document declares."""
        node = _at(self._trees.get(document), ("parameters", name))
        if isinstance(node, MappingNode):
            return {key: _node_text(inner) for key, inner in node.entries.items() if key in ("value", "min", "max")}
        return {} if node is None else {"value": _node_text(node)}

    def fact(self, value: Value, section: Section, keys: Sequence[str], *, scope: str = "", otherwise: Span | None = None) -> Fact:
        """A value that stands under some keys of a section, where it stands in none its place is `otherwise`. An orientation is `rpy`
        also where the document says it by `quat`; those are its words then."""
        for node in section:
            place = _at(node, keys)
            if place is not None:
                text, span = _node_text(place)
                return Fact(value=value, written=text, scope=scope, span=span)
            place = _at(node, (*keys[:-1], "quat")) if keys[-1] == "rpy" else None
            if place is not None:
                text, span = _node_text(place)
                return Fact(value=value, written=text, words=None if "=" in text else f"quat {text}", scope=scope, span=span)
        return Fact(value=value, scope=scope, span=otherwise)

    def number(self, text: str) -> Value:
        """What a bound comes to [SI]; an expression, or what is no quantity, as it is written."""
        try:
            return parse_quantity(text).value
        except UnitError:
            return text


def names_in(written: str) -> list[str]:
    """The names in an expression, or in other words, sorted: those of parts of others with dots, as paths."""
    return sorted({name.replace(".", "/") for name in _NAME.findall(written)})


def _at(node: Node | None, keys: Sequence[str]) -> Node | None:
    """What stands under keys; a scalar on the way is all that there is (`mass: 12 g` for `mass.value`)."""
    for key in keys:
        if isinstance(node, ScalarNode):
            return node
        node = node.entries.get(key) if isinstance(node, MappingNode) else None
    return node


def _node_text(node: Node) -> tuple[str, Span]:
    return (str(node.value) if isinstance(node, ScalarNode) else repr(node.plain())), node.span
