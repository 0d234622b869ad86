"""Find the places in a document at which the values of a joint are written."""

from __future__ import annotations

from thingc.base.source import MappingNode, Node, SequenceNode, node_at
from thingc.model.resolve.document_scope import DocumentScope
from thingc.model.resolve.scope import DefaultLayers


def nodes_of(table: DocumentScope, layers: DefaultLayers, number: int | None) -> dict[str, Node]:
    """Return the nodes of the values of a joint or coordinate, keyed by path (`limit.lower`).

    If the joint does not specify a value, the node of the default value is returned.
    """
    nodes: dict[str, Node] = {}
    for _, base in reversed(layers.items):
        _collect(node_at(table.document.tree, base), "", nodes, number)
    return nodes


def _collect(node: Node | None, prefix: str, nodes: dict[str, Node], number: int | None) -> None:
    if isinstance(node, MappingNode):
        for key, child in node.entries.items():
            own: Node | None = child
            if number is not None and isinstance(child, SequenceNode) and key != "axis":
                own = child.items[number] if number < len(child.items) else None
            elif number is not None and isinstance(child, MappingNode) and all(word.isdigit() for word in child.entries):
                own = child.entries.get(str(number))
            if own is not None:
                nodes[prefix + key] = own
                _collect(own, f"{prefix}{key}.", nodes, number)
