"""Renamed components are matched by definition and neighbours, and marked as uncertain if others are similar."""

from __future__ import annotations

import random

import networkx
from msgspec.structs import replace
from networkx.algorithms.isomorphism import MultiDiGraphMatcher

from thingc.base.pose import make_translation
from thingc.tools.diff.matching import match
from thingc.tools.diff.snapshot import ComponentNode, Edge, Snapshot


def robot(source: random.Random, size: int, kinds: int = 4) -> Snapshot:
    """A random tree of parts of a few kinds, each on a mount of an earlier part. Several parts may use the same mount."""
    nodes = [ComponentNode(path="part_0", kind="part", reference="m:P0", text="m:P0", place=make_translation(0.0, 0.0, 0.0))]
    edges = []
    for number in range(1, size):
        kind, above = f"m:P{source.randrange(kinds)}", nodes[source.randrange(max(0, number - 6), number)]
        place = make_translation(*(source.uniform(-1.0, 1.0) for _ in range(3)))
        nodes.append(ComponentNode(path=f"part_{number}", kind="part", reference=kind, text=kind, place=place))
        edges.append(Edge(parent=above.path, child=f"part_{number}", mounts=(f"m{source.randrange(3)}", "seat"), joint=""))
    return Snapshot(name="robot", nodes=tuple(nodes), edges=tuple(edges))


def rename_parts(snapshot: Snapshot, names: dict[str, str], source: random.Random) -> Snapshot:
    """The same robot with other names and in another order."""
    nodes = [replace(node, path=names.get(node.path, node.path)) for node in snapshot.nodes]
    edges = [replace(one, parent=names.get(one.parent, one.parent), child=names.get(one.child, one.child)) for one in snapshot.edges]
    source.shuffle(nodes)
    source.shuffle(edges)
    return Snapshot(name="robot", nodes=tuple(nodes), edges=tuple(edges))


def graph(snapshot: Snapshot, marked: str) -> networkx.MultiDiGraph:
    """The robot as a graph, with one part marked."""
    made = networkx.MultiDiGraph()
    for node in snapshot.nodes:
        made.add_node(node.path, colour=(node.text, node.path == marked))
    for edge in snapshot.edges:
        made.add_edge(edge.parent, edge.child, mounts=edge.mounts)
    return made


def are_interchangeable(snapshot: Snapshot, one: str, other: str) -> bool:
    """Whether an automorphism maps one part to another."""
    matcher = MultiDiGraphMatcher(
        graph(snapshot, one), graph(snapshot, other), node_match=lambda a, b: a["colour"] == b["colour"],
        edge_match=lambda a, b: sorted(x["mounts"] for x in a.values()) == sorted(x["mounts"] for x in b.values()),
    )
    return bool(matcher.is_isomorphic())


def test_renamed_parts_of_random_robots_are_matched() -> None:
    """At least 95 % are matched. Matches without uncertainty are correct, up to interchangeable parts."""
    found = of = 0
    for seed in range(200):
        source = random.Random(seed)
        old = robot(source, 24)
        names = {f"part_{k}": f"piece_{k * 7 % 24}" for k in source.sample(range(24), source.choice((1, 2, 5, 12, 24)))}
        new = rename_parts(old, names, source)
        matched = match(old, new)
        for path, name in names.items():
            of += 1
            if path in matched:
                found += 1
                if matched[path].new != name and not matched[path].perhaps:
                    assert are_interchangeable(new, matched[path].new, name), (seed, path, name, matched[path])
        assert all(matched[node.path].new == node.path for node in old.nodes if node.path not in names)
    assert found >= 0.95 * of


def test_matching_is_symmetric() -> None:
    for seed in range(40):
        source = random.Random(seed)
        old = robot(source, 20, kinds=2)
        new = rename_parts(old, {f"part_{k}": f"other_{k}" for k in source.sample(range(20), 10)}, source)
        there, back = match(old, new), match(new, old)
        assert {(m.old, m.new, m.perhaps) for m in there.values()} == {(m.new, m.old, m.perhaps) for m in back.values()}


def test_a_thousand_renamed_components_are_matched() -> None:
    source = random.Random(1)
    old = robot(source, 1000, kinds=12)
    new = rename_parts(old, {f"part_{k}": f"other_{k}" for k in range(1000)}, source)
    matched = match(old, new)
    assert len(matched) == 1000
    assert sum(m.new == m.old.replace("part", "other") for m in matched.values()) > 900


def test_similar_parts_are_matched_by_position() -> None:
    def row(names: list[str], at: list[float]) -> Snapshot:
        base = ComponentNode(path="base", kind="part", reference="m:B", text="m:B", place=make_translation(0.0, 0.0, 0.0))
        screws = [
            ComponentNode(path=name, kind="part", reference="m:S", text="m:S", place=make_translation(x, 0.0, 0.0))
            for name, x in zip(names, at, strict=True)
        ]
        edges = [Edge(parent="base", child=name, mounts=("face", "seat"), joint="") for name in names]
        return Snapshot(name="row", nodes=(base, *screws), edges=tuple(edges))

    matched = match(row(["a", "b", "c"], [0.0, 1.0, 2.0]), row(["x", "y"], [2.1, 0.9]))
    assert {(m.old, m.new, m.perhaps) for m in matched.values()} == {("base", "base", False), ("b", "y", True), ("c", "x", True)}
    assert matched["b"].reason == "the same definition and mates, the nearest of 3 equal ones"
