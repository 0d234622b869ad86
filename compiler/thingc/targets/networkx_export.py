"""Export the graphs of a robot to networkx. The compiler itself does not use networkx.

Attributes without a value are omitted, because GraphML has no null value.
"""

from __future__ import annotations

from typing import Any, TypeAlias

import networkx

from thingc.base.safe_text import escape_control
from thingc.model.assembly.hag import Hag
from thingc.model.assembly.types import Assembly

Graph: TypeAlias = Any
"""Type of a `networkx.MultiDiGraph`. networkx has no type annotations."""


def hag_graph(hag: Hag, quantities: dict[str, int]) -> Graph:
    """Convert the hierarchical assembly graph to a graph of networkx.

    The nodes are identified by the texts of definitions. The attributes of a node are `label`, `reference`, `kind` and `quantity`. The
    quantity is the number of these parts in the robot. The node of a mirror image also has the attributes `mirror` and `mirrors`. `mirrors`
    is the definition text of the original part. Each edge goes from an assembly to one of its components. The key of an edge is the name of
    the component, and its attributes are `mounts` and `joint`.
    """
    graph = networkx.MultiDiGraph(name=hag.label)
    for definition in hag.definitions:
        plain = None if definition.plain is None else definition.plain.text
        graph.add_node(definition.text, **_attributes(
            label=definition.label, reference=definition.reference, kind=definition.kind, quantity=quantities[definition.text],
            mirror=definition.mirror, mirrors=plain,
        ))
    for edge in hag.edges:
        graph.add_edge(edge.parent, edge.child, key=edge.component, **_attributes(mounts=edge.mounts or None, joint=edge.joint))
    return graph


def mate_graph(assembly: Assembly) -> Graph:
    """Return a graph whose nodes are the occurrences of an assembly and whose edges are the mates between them.

    The nodes are identified by the paths of occurrences. The attributes of a node are `definition` (the definition text), `link` and `mass`
    [kg]. Each edge goes from the parent of a mate to its child. The key of an edge has the form `mount -> mount`. The attributes of an edge
    are `parent_mount`, `child_mount`, `joint` (omitted if the mate is rigid) and `loop`.
    """
    graph = networkx.MultiDiGraph(name=assembly.name)
    names = [occurrence.path for occurrence in assembly.occurrences]
    for occurrence in assembly.occurrences:
        link = assembly.links[assembly.link_of[occurrence.index]].name
        graph.add_node(occurrence.path, definition=occurrence.definition.text, link=link, mass=occurrence.properties.mass)
    for mate in assembly.mates:
        graph.add_edge(names[mate.parent], names[mate.child], key=f"{mate.child_mount} -> {mate.parent_mount}", **_attributes(
            parent_mount=mate.parent_mount, child_mount=mate.child_mount, joint=mate.name, loop=True if mate.loop is not None else None,
        ))
    return graph


def link_graph(assembly: Assembly) -> Graph:
    """Return a graph whose nodes are the links of an assembly and whose edges are the joints between them.

    The nodes are identified by the names of links. The attributes of a node are `mass` [kg] and `occurrences`. Each edge goes from the
    parent of a joint in the document to its child. The key of an edge is the path of the joint. The attributes of an edge are `kind`,
    `coordinates` (their paths) and `loop`.
    """
    graph = networkx.MultiDiGraph(name=assembly.name)
    for link in assembly.links:
        members = [assembly.occurrences[member].path for member in link.members]
        graph.add_node(link.name, mass=link.properties.mass, occurrences=members)
    for mate in assembly.mates:
        name = mate.name if mate.name is not None else mate.loop
        parent, child = (assembly.links[assembly.link_of[index]].name for index in (mate.parent, mate.child))
        if name is not None and parent != child:
            kind = mate.joints[0].kind.name if mate.joints else "fixed"
            graph.add_edge(parent, child, key=name, **_attributes(
                kind=kind, coordinates=[joint.path for joint in mate.joints], loop=True if mate.loop is not None else None,
            ))
    return graph


def _attributes(**attributes: Any) -> dict[str, Any]:
    return {name: value for name, value in attributes.items() if value is not None}


def graphml(graph: Graph) -> str:
    """Convert a graph to GraphML text. The attributes of the graph must not contain lists.

    The ids of edges are numbers, because ids must be unique in a GraphML file. The attribute `name` of an edge contains its key in the
    graph.
    """
    displayed = networkx.MultiDiGraph(**_displayable(graph.graph))
    for node, attributes in graph.nodes(data=True):
        displayed.add_node(escape_control(node), **_displayable(attributes))
    for number, (parent, child, key, attributes) in enumerate(graph.edges(keys=True, data=True)):
        ends = escape_control(parent), escape_control(child)
        displayed.add_edge(*ends, key=f"e{number}", name=escape_control(key), **_displayable(attributes))
    return "\n".join(networkx.generate_graphml(displayed, named_key_ids=True)) + "\n"


def _displayable(attributes: dict[str, Any]) -> dict[str, Any]:
    return {name: escape_control(value) if isinstance(value, str) else value for name, value in attributes.items()}
