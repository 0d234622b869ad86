"""Find the source location and the text of each value in a document, to distinguish changes by the user from their consequences."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import product

from thingc.base.source import MappingNode, Node, ScalarNode, Span
from thingc.base.units import UnitError, parse_quantity
from thingc.documents.load.documents import Documents
from thingc.model.resolve.types import Component
from thingc.tools.diff.snapshot import Fact, Value

_NAME = re.compile(r"[A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*")


Section = tuple[Node | None, ...]
"""The syntax nodes of one element: its own node, followed by the nodes of the defaults, or of the mode that the element extends."""


class DocumentTrees:
    """The syntax trees of the documents of a robot, with methods that find elements in the trees."""

    def __init__(self, documents: Documents) -> None:
        self._trees = {relative: document.tree for relative, document in documents.by_path.items()}
        self._lines = {document.path: document.text.split("\n") for document in documents.by_path.values()}
        self._components: dict[str, Section] = {}
        self._by_key: dict[str, dict[Span, str]] = {}

    def note_component(self, path: str, document: str, component: Component) -> Section:
        """Find the syntax tree of a component in a document, and store the tree under the path of the component.

        Return the syntax nodes of the component. The document is given by its path in the workspace.
        """
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
        """Return the syntax nodes of the nested assembly with the path `prefix`, such as `hand/`, or an empty tuple for an unknown path."""
        return self._components.get(prefix.rstrip("/"), ())

    def section(self, document: str, *keys: str) -> Section:
        """Return the syntax tree of the element at the given keys, followed by the nodes from which the element inherits values."""
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
        """Return the text at a source location of a document, or None if the text spans several lines."""
        lines = self._lines.get(span.file) if span is not None else None
        if lines is None or span is None or span.line != span.end_line or span.line > len(lines):
            return None
        return lines[span.line - 1][span.column - 1 : span.end_column - 1]

    def parameter(self, document: str, name: str) -> dict[str, tuple[str, Span]]:
        """Return the texts and the source locations of the value and the bounds of a parameter in a document."""
        node = _at(self._trees.get(document), ("parameters", name))
        if isinstance(node, MappingNode):
            return {key: _node_text(inner) for key, inner in node.entries.items() if key in ("value", "min", "max")}
        return {} if node is None else {"value": _node_text(node)}

    def fact(self, value: Value, section: Section, keys: Sequence[str], *, scope: str = "", otherwise: Span | None = None) -> Fact:
        """Create a `Fact` for the value at the given keys of a section.

        If the section does not contain the keys, the source location of the `Fact` is `otherwise`. The key `rpy` also finds an orientation
        under the key `quat`. In this case, `Fact.words` is the text of the quaternion.
        """
        paths = [keys, (*keys[:-1], "quat")] if keys and keys[-1] == "rpy" else [keys]
        for node, path in product(section, paths):
            place = _at(node, path)
            if place is not None:
                text, span = _node_text(place)
                words = f"quat {text}" if path is not keys and "=" not in text else None
                return Fact(value=value, written=text, words=words, scope=scope, span=span)
        return Fact(value=value, scope=scope, span=otherwise)

    def number(self, text: str) -> Value:
        """Convert the bound of a parameter to a number in SI units. Expressions and other strings are returned unchanged."""
        try:
            return parse_quantity(text).value
        except UnitError:
            return text


def names_in(written: str) -> list[str]:
    """Return the sorted names in an expression or other text. Dots in names are replaced by `/`, as in paths."""
    return sorted({name.replace(".", "/") for name in _NAME.findall(written)})


def _at(node: Node | None, keys: Sequence[str]) -> Node | None:
    """Return the syntax node at a path of keys. If the path reaches a scalar before the last key, return the scalar.

    For example, the path `mass.value` finds the value `12 g` of `mass: 12 g`.
    """
    for key in keys:
        if isinstance(node, ScalarNode):
            return node
        node = node.entries.get(key) if isinstance(node, MappingNode) else None
    return node


def _node_text(node: Node) -> tuple[str, Span]:
    return (str(node.value) if isinstance(node, ScalarNode) else repr(node.plain())), node.span
