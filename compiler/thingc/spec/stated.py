"""What an assembly says where something may be set or chosen in its place, asked by whoever is about to."""

from __future__ import annotations

from typing import TYPE_CHECKING

from thingc.expressions import Expression, ExpressionValue
from thingc.source import Document, ScalarNode, node_at
from thingc.spec.choices import DEFAULT_MATERIAL, KEYS, nested
from thingc.spec.fields import any_value

if TYPE_CHECKING:
    from thingc.load import Documents
    from thingc.spec.assembly import AssemblySpec


def stated_value(documents: Documents, path: str) -> ExpressionValue | Expression | None:
    """What the root document, or the nested one that the path leads into, says at the path of a value: text where that is no value by
    itself (the three of a vector). None where it says nothing there, and for an expression of a nested document."""
    document: Document | None = documents.root
    while document is not None and (through := nested(path)) is not None:
        component, path = through
        text = node_at(document.tree, ("components", component, "assembly"))
        document = documents.named(document, text.text) if isinstance(text, ScalarNode) else None
    node = None if document is None else node_at(document.tree, tuple(path.split(".")))
    if not isinstance(node, ScalarNode):
        return None
    try:
        value = any_value(node.value)
    except ValueError:
        return node.text
    return None if isinstance(value, Expression) and document is not documents.root else value


def stated_choices(assembly: AssemblySpec) -> dict[str, str]:
    """What a document says at the paths of choices of its own components: choosing it says nothing."""
    default = assembly.defaults.component if assembly.defaults is not None else None
    choices = {DEFAULT_MATERIAL: default.material} if default is not None and default.material is not None else {}
    for name, component in assembly.components.items():
        choices.update({f"components.{name}.{key}": text for key in KEYS if (text := getattr(component, key)) is not None})
    return choices
