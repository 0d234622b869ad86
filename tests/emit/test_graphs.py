"""Exported graphs, read by networkx and by a plain XML reader."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from pathlib import Path

import networkx
import pytest
from msgspec.structs import replace

from emit.graphs import arm, awkward, walker
from emit.small_robot import assembly
from thingc.base.safe_text import escape_control
from thingc.geometry.store.local import Store
from thingc.model.assembly.hag import Hag
from thingc.targets.hag import emit as hag, labels
from thingc.targets.networkx_export import hag_graph, link_graph, mate_graph


@pytest.mark.parametrize("drawn", [arm(), walker(), awkward()], ids=["arm", "walker", "awkward"])
def test_assembly_graph_round_trips(drawn: Hag) -> None:
    """networkx reads the JSON and GraphML exports. Quantities equal the number of paths from the root."""
    graph = hag_graph(drawn, labels.quantities(drawn))
    assert list(graph) == [one.text for one in drawn.definitions] and graph.number_of_edges() == len(drawn.edges)
    assert networkx.is_directed_acyclic_graph(graph)
    for node, quantity in graph.nodes(data="quantity"):  # in a multigraph, paths by their edges
        paths = [[]] if node == drawn.root else networkx.all_simple_edge_paths(graph, drawn.root, node)
        assert sum(1 for _ in paths) == quantity
    again = networkx.node_link_graph(json.loads(hag.json(drawn)), edges="edges")
    if drawn.root != awkward().root:  # JSON is shown escaped where its text is not for every terminal
        assert networkx.utils.graphs_equal(again, graph)
    text = hag.graphml(drawn)
    ids = [edge.get("id") for edge in ET.fromstring(text).iter("{http://graphml.graphdrawing.org/xmlns}edge")]
    assert len(set(ids)) == len(ids) == len(drawn.edges)
    read = networkx.parse_graphml(text, force_multigraph=True)
    assert {node: data["label"] for node, data in read.nodes(data=True)} == {
        escape_control(d.text): escape_control(d.label) for d in drawn.definitions
    }
    assert sorted((a, b, name) for a, b, name in read.edges(data="name")) == sorted(
        (escape_control(edge.parent), escape_control(edge.child), escape_control(edge.component)) for edge in drawn.edges
    )


def test_mirrored_definition_refers_to_original() -> None:
    """The node of a mirrored definition has attributes with the mirror axis and the original definition."""
    plain = replace(arm().definitions[1], kind="part")
    image = replace(plain, text="p:Leg(mirror=y)", mirror="y", plain=plain)
    both = Hag(root=plain.text, definitions=(plain, image), edges=())
    graph = hag_graph(both, dict.fromkeys((plain.text, image.text), 1))
    assert (graph.nodes[image.text]["mirror"], graph.nodes[image.text]["mirrors"]) == ("y", plain.text)
    assert "mirrors" not in graph.nodes[plain.text]


def test_rigid_mates_form_the_links(tmp_path: Path) -> None:
    """Connected components of the mate graph without joints equal the links of the link graph."""
    robot = assembly(Store(str(tmp_path)))
    mates, links = mate_graph(robot), link_graph(robot)
    assert networkx.is_tree(mates.to_undirected()) and len(mates) == len(robot.occurrences)
    rigid = networkx.Graph((a, b) for a, b, joint in mates.edges(data="joint") if joint is None)
    rigid.add_nodes_from(mates)
    members = {frozenset(data["occurrences"]) for _, data in links.nodes(data=True)}
    assert {frozenset(one) for one in networkx.connected_components(rigid)} == members
    assert {(a, b, name): data["kind"] for a, b, name, data in links.edges(keys=True, data=True)} == {
        ("base", "servo_a", "yaw"): "revolute", ("servo_a", "palm", "hand/lift"): "prismatic",
    }
    for name, data in links.nodes(data=True):
        assert data["mass"] == next(link.properties.mass for link in robot.links if link.name == name)
        assert {mates.nodes[one]["link"] for one in data["occurrences"]} == {name}
