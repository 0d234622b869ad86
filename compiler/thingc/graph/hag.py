"""The hierarchical assembly graph: definitions, and which is a subcomponent of which."""

from __future__ import annotations

from thingc.graph.leaves import FRAME
from thingc.graph.types import Definition, DefinitionEdge, Hag
from thingc.realize.record import PartDefinition
from thingc.resolve.model import AssemblyDefinition, At, Attach, Component, Joint, Reference


def hag_of(model: AssemblyDefinition) -> Hag:
    """The graph of `model`: equal definitions are one node, in the order first met, the top first (depth first)."""
    names = _Names()
    edges: list[DefinitionEdge] = []
    met: dict[tuple[str, str, str], None] = {}
    waiting: list[tuple[str, AssemblyDefinition | Definition]] = [("", model)]
    while waiting:
        _, node = waiting.pop()
        if isinstance(node, Definition):
            met[(node.kind, node.reference, node.text)] = None
            continue
        key = ("assembly", node.document, node.text)
        if key in met:
            continue
        met[key] = None
        parent = names.text(*key)
        joints = {joint.child.path[0]: joint for joint in node.joints if joint.child.path and not joint.loop}
        inner: list[tuple[str, AssemblyDefinition | Definition]] = []
        for component in node.components:
            child = _definition(component)
            if child is None:
                continue
            joint = joints.get(component.name)
            text = (
                names.text("assembly", child.document, child.text) if isinstance(child, AssemblyDefinition)
                else names.text(child.kind, child.reference, child.text)
            )
            edges.append(DefinitionEdge(
                parent=parent, child=text, component=component.name, mounts=_mounts(component, joint),
                joint=joint.name if joint is not None and component.placement is None else None,
            ))
            inner.append((component.name, child))
        waiting.extend(reversed(inner))
    return Hag(
        root=names.text("assembly", model.document, model.text),
        definitions=tuple(Definition(text=names.text(*key), reference=key[1], kind=key[0]) for key in met),
        edges=tuple(edges),
    )


class _Names:
    """Texts are what edges refer to: where two documents (or an assembly and a frame) print alike, the later one met
    gets its document in brackets."""

    def __init__(self) -> None:
        self._given: dict[tuple[str, str, str], str] = {}
        self._taken: set[str] = set()

    def text(self, kind: str, reference: str, text: str) -> str:
        key = (kind, reference, text)
        if key not in self._given:
            self._given[key] = text if text not in self._taken else f"{text} [{reference}]"
            self._taken.add(self._given[key])
        return self._given[key]


def _definition(component: Component) -> AssemblyDefinition | Definition | None:
    if isinstance(component.definition, AssemblyDefinition):
        return component.definition
    if isinstance(component.definition, PartDefinition):
        part = component.definition
        return Definition(text=part.text, reference=part.reference, kind="part" if part.kind == "code" else "file")
    return FRAME if component.frame else None


def _mounts(component: Component, joint: Joint | None) -> str:
    """`back -> plate.servo_seat`; `in bracket.board` for a plain placement; empty for the base."""
    placement = component.placement
    if isinstance(placement, Attach):
        return f"{_own(component, placement.mount)} -> {_shown(placement.to)}"
    if isinstance(placement, At):
        return f"in {_shown(placement.to)}"
    return f"{_own(component, joint.child)} -> {_shown(joint.parent)}" if joint is not None else ""


def _own(component: Component, reference: Reference) -> str:
    """A reference of the component to its own mount, without its own name."""
    shown = _shown(reference)
    return shown.removeprefix(f"{component.name}.")


def _shown(reference: Reference) -> str:
    return reference.text if reference.mount is not None else f"{reference.text}.origin"
