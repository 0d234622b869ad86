"""The hierarchical assembly graph (HAG): the definitions of assemblies and parts in a robot, and the components that use them."""

from __future__ import annotations

from typing import Literal

from msgspec.structs import replace

from thingc.base.one_line_repr import OneLineStruct
from thingc.geometry.record import PartDefinition
from thingc.model.resolve.link_definition import LinkDefinition
from thingc.model.resolve.types import AssemblyDefinition, At, Attach, Component, Joint, Reference

DefinitionKind = Literal["assembly", "part", "file", "link", "frame"]
"""Kind of a node of the hierarchical assembly graph (HAG)."""


class Definition(OneLineStruct):
    """A node of the hierarchical assembly graph: a definition of a part, a link or an assembly.

    `text` and `reference` together identify the definition. `reference` is `module:Class`, a file, or the path of a document in the
    workspace. `label` is the display name. For a mirror image, `mirror` is the mirror axis, and `plain` is the original definition.
    """

    text: str
    label: str
    reference: str
    kind: DefinitionKind
    mirror: str | None = None
    plain: Definition | None = None

    @classmethod
    def of(cls, definition: PartDefinition | LinkDefinition | AssemblyDefinition) -> Definition:
        """Create the node of the hierarchical assembly graph for the definition of a part, a link or an assembly."""
        kind: DefinitionKind
        match definition:
            case PartDefinition():
                reference, kind = definition.reference, "part" if definition.kind == "code" else "file"
            case LinkDefinition():
                reference, kind = "link", "link"
            case AssemblyDefinition():
                reference, kind = definition.document, "assembly"
        plain = None if definition.plain is None else cls.of(definition.plain)
        return cls(text=definition.text, label=definition.label, reference=reference, kind=kind, mirror=definition.mirror, plain=plain)


class DefinitionEdge(OneLineStruct):
    """An edge of the hierarchical assembly graph: the definition `parent` has a component `component` with the definition `child`.

    `parent` and `child` are the texts of the two definitions. `mounts` describes how the component is placed (`back -> plate.servo_seat`).
    `joint` is the name of the joint that places the component, if any.
    """

    parent: str
    child: str
    component: str
    mounts: str
    joint: str | None


class Hag(OneLineStruct):
    """The hierarchical assembly graph of a robot. The graph is acyclic. Its nodes are distinct definitions in depth-first order."""

    root: str
    definitions: tuple[Definition, ...]
    edges: tuple[DefinitionEdge, ...]

    @property
    def label(self) -> str:
        """The display name of the robot."""
        return self.definitions[0].label


FRAME = Definition(text="frame", label="frame", reference="frame", kind="frame")
"""The node for all components without geometry."""


def hag_of(model: AssemblyDefinition) -> Hag:
    """Build the hierarchical assembly graph of a model.

    Each distinct definition is one node. The nodes are in depth-first order, beginning with the top document.
    """
    nodes: dict[tuple[str, str, str], Definition] = {}
    texts: set[str] = set()
    edges: list[DefinitionEdge] = []
    met: dict[Definition, None] = {}
    waiting: list[PartDefinition | LinkDefinition | AssemblyDefinition | None] = [model]

    def node_of(definition: PartDefinition | LinkDefinition | AssemblyDefinition | None) -> Definition:
        """Return the node of a definition, or of a frame for None.

        Edges refer to a node by its text. If a later definition has the same text, its reference, or the body of a lump, is appended to
        its text in brackets.
        """
        node = Definition.of(definition) if definition is not None else FRAME
        reference = node.reference
        if isinstance(definition, AssemblyDefinition) and definition.lump:  # it has the text of the moving assembly, which differs
            reference = Definition.of(definition.components[0].definition or definition).text
        key = (node.kind, reference, node.text)
        if key not in nodes:
            suffix = f" [{reference}]" if node.text in texts else ""
            nodes[key] = replace(node, text=node.text + suffix, label=node.label + suffix)
            texts.add(node.text + suffix)
        return nodes[key]

    while waiting:
        definition = waiting.pop()
        node = node_of(definition)
        if node in met:
            continue
        met[node] = None
        if not isinstance(definition, AssemblyDefinition):
            continue
        joints = {joint.child.path[0]: joint for joint in definition.joints if joint.child.path and not joint.loop}
        components = [component for component in definition.components if component.definition is not None or component.frame]
        for component in components:
            joint = joints.get(component.name)
            edges.append(DefinitionEdge(
                parent=node.text, child=node_of(component.definition).text, component=component.name, mounts=_mounts(component, joint),
                joint=joint.name.joint if joint is not None and component.placement is None else None,
            ))
        waiting.extend(component.definition for component in reversed(components))
    return Hag(root=node_of(model).text, definitions=tuple(met), edges=tuple(edges))


def _mounts(component: Component, joint: Joint | None) -> str:
    """Return a description of the placement of a component: `back -> plate.servo_seat`, `in bracket.board` for `at`, or "" for the base."""
    placement = component.placement
    if isinstance(placement, Attach):
        return f"{_own(component, placement.mount)} -> {_reference_text(placement.to)}"
    if isinstance(placement, At):
        return f"in {_reference_text(placement.to)}"
    return f"{_own(component, joint.child)} -> {_reference_text(joint.parent)}" if joint is not None else ""


def _own(component: Component, reference: Reference) -> str:
    """Format a reference to a mount of a component without the name of the component."""
    return _reference_text(reference).removeprefix(f"{component.name}.")


def _reference_text(reference: Reference) -> str:
    return reference.text if reference.mount is not None else f"{reference.text}.origin"
