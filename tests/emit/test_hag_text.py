"""The assembly graph as an indented tree, DOT and Mermaid: complete and correctly escaped."""

from __future__ import annotations

import html
import re
from itertools import pairwise

import pytest
from msgspec.structs import replace

from emit.graphs import LABELS, NASTY, SCREW, XM430, arm, awkward, graph, walker
from thingc.base.safe_text import escape_control
from thingc.model.assembly.hag import DefinitionEdge, Hag
from thingc.targets.hag import emit as hag, labels

NASTY_SHOWN = NASTY.replace("\x07", "\\x07").replace("\ud800", "\\ud800")


def count_unrolled(graph: Hag, node: str) -> dict[str, int]:
    """Count each definition below `node` by walking the count_unrolled tree."""
    found: dict[str, int] = {}
    for edge in graph.edges:
        if edge.parent == node:
            for text, number in [(edge.child, 1), *count_unrolled(graph, edge.child).items()]:
                found[text] = found.get(text, 0) + number
    return found


@pytest.mark.parametrize("drawn", [arm(), walker(), awkward()], ids=["arm", "walker", "awkward"])
def test_quantities_match_unrolled_tree(drawn: Hag) -> None:
    """Quantities equal the counts in the count_unrolled tree."""
    counted = labels.quantities(drawn)
    assert counted.pop(drawn.root) == 1
    assert counted == count_unrolled(drawn, drawn.root)
    assert labels.quantities(arm())[XM430] == 4 and labels.quantities(arm())[SCREW] == 10


def test_tree_matches_expected_text() -> None:
    """The indented tree of a small robot equals a written-out text."""
    drawn = graph("bot", [
        ("bot", "bot.yaml", "assembly"), ("leg(n=2)", "leg.yaml", "assembly"), ("w:Foot", "w:Foot", "part"),
        ("w:Hub", "w:Hub", "part"), ("frame", "frame", "frame"),
    ], [
        ("bot", "w:Hub", "hub", "", None),
        ("bot", "leg(n=2)", "left", "hip -> hub.left", "hip_left"),
        ("bot", "leg(n=2)", "right", "hip -> hub.right", "hip_right"),
        ("bot", "frame", "imu", "in hub.top", None),
        ("leg(n=2)", "w:Foot", "foot_0", "top -> a_0.end_0", None),
        ("leg(n=2)", "w:Foot", "foot_1", "top -> a_1.end_0", None),
        ("leg(n=2)", "w:Foot", "foot_2", "top -> a_2.end_0", None),
        ("leg(n=2)", "w:Foot", "toe", "top -> foot_2.end", "toe"),
    ])
    assert hag.text(drawn) == """\
bot
├── hub                    w:Hub
├── left                   leg(n=2)             joint hip_left: hip -> hub.left
│   ├── foot_0 ... foot_2  w:Foot               top -> a_*.end_*
│   └── toe                w:Foot               joint toe: top -> foot_2.end
├── right                  leg(n=2) (as above)  joint hip_right: hip -> hub.right
└── imu                    frame                in hub.top

5 definitions, 12 components:
  2 x leg(n=2) (assembly)
  8 x w:Foot
  1 x w:Hub
  1 x frame (frame)
"""


def test_assembly_without_components_is_one_line() -> None:
    assert hag.text(graph("bot", [("bot", "bot.yaml", "assembly")], [])) == "bot\n"


def strings(text: str) -> list[str]:
    """The quoted strings of a DOT document, unescaped by the rules of Graphviz for labels: escapes with a backslash, and entities as in
    HTML."""
    found = re.findall(r'"((?:[^"\\]|\\.)*)"', text, flags=re.DOTALL)
    plain = [re.sub(r"\\(.)", lambda match: "\n" if match[1] == "n" else match[1], string) for string in found]
    return [html.unescape(string) for string in plain]


def label_of(text: str) -> str:
    return escape_control(LABELS.get(text, text))


@pytest.mark.parametrize("drawn", [arm(), walker(), awkward()], ids=["arm", "walker", "awkward"])
def test_dot_contains_all_definitions_and_components(drawn: Hag) -> None:
    """The DOT text, parsed with regular expressions, has a node per definition and an edge per component."""
    text = hag.dot(drawn)
    outside = re.sub(r'"(?:[^"\\]|\\.)*"', "", text, flags=re.DOTALL)
    assert '"' not in outside and outside.count("{") == outside.count("}") == 1, "every string ends where it should"
    found = re.findall(r'^  (n\d+) \[label=("(?:[^"\\]|\\.)*")', text, flags=re.MULTILINE)
    nodes = {name: strings(label)[0] for name, label in found}
    assert list(nodes.values()) == [escape_control(d.label) for d in drawn.definitions]
    edges = re.findall(r'^  (n\d+) -> (n\d+) \[label=("(?:[^"\\]|\\.)*")', text, flags=re.MULTILINE)
    assert [(nodes[a], nodes[b], strings(label)[0]) for a, b, label in edges] == [
        (label_of(e.parent), label_of(e.child), "\n".join(filter(None, (e.component, labels.how(e))))) for e in drawn.edges
    ]


def test_special_characters_are_escaped_in_dot() -> None:
    assert NASTY_SHOWN in strings(hag.dot(awkward()))


def read_mermaid(text: str) -> str:
    """The displayed text of a quoted Mermaid label."""
    assert not re.search(r'["<`\\]|&(?!amp)', text.replace("<br/>", ""))
    return re.sub(r"#(\d+);", lambda match: chr(int(match[1])), text.replace("<br/>", "\n"))


@pytest.mark.parametrize("drawn", [arm(), walker(), awkward()], ids=["arm", "walker", "awkward"])
def test_mermaid_contains_all_definitions_and_pairs(drawn: Hag) -> None:
    """The Mermaid text has a node per definition and one edge per pair of parent and child. Every line is recognized."""
    lines = hag.mermaid(drawn).splitlines()
    assert lines[0] == "flowchart LR"
    nodes = {}
    for line in lines:
        match = re.fullmatch(r'  (n\d+)[\[(/]+"([^"]*)"[\])/]+:::(\w+)', line)
        if match:
            nodes[match[1]] = read_mermaid(match[2])
    assert list(nodes.values()) == [escape_control(d.label) for d in drawn.definitions]
    edges = [match for line in lines if (match := re.fullmatch(r'  (n\d+) -->\|"([^"]*)"\| (n\d+)', line))]
    pairs = {(nodes[match[1]], nodes[match[3]]) for match in edges}
    assert pairs == {(label_of(e.parent), label_of(e.child)) for e in drawn.edges}
    assert len(edges) == len({(e.parent, e.child) for e in drawn.edges})
    assert len(lines) == 1 + len(nodes) + len(edges) + 5, "every line is understood"


def test_mermaid_edge_lists_its_components() -> None:
    """The label of an edge lists each component with its mounts."""
    text = read_mermaid(next(line for line in hag.mermaid(arm()).splitlines() if "yaw_servo: " in line).split('"')[1])
    assert text.split("\n") == [
        "yaw_servo: back -> plate.servo_seat", "shoulder_servo: front -> bracket.seat", "elbow_servo: back -> humerus.upper",
        "wrist_servo: back -> forearm.upper",
    ]


def test_items_of_a_repeat_are_one_entry() -> None:
    """Eight consecutive screws are shown as one entry with a wildcard. Two screws are shown separately, and a gap splits the range."""
    screws = [edge for edge in arm().edges if edge.component.startswith("screw_")]
    assert labels.entries(screws) == [("screw_0 ... screw_7", "head -> plate.hole_*")]
    assert labels.entries(screws[:2]) == [("screw_0", "head -> plate.hole_0"), ("screw_1", "head -> plate.hole_1")]
    assert labels.entries([screws[0], *screws[2:]]) == [
        ("screw_0", "head -> plate.hole_0"), ("screw_2 ... screw_7", "head -> plate.hole_*"),
    ]
    assert all(a.component < b.component for a, b in pairwise(screws))


def test_mirrored_definition_is_marked() -> None:
    """The tree, DOT and Mermaid mark a mirrored definition and link it to its original if the graph contains it."""
    plain = replace(arm().definitions[1], text="p:Leg(length=0.1)", label="p:Leg(length=100 mm)", reference="p:Leg", kind="part")
    image = replace(plain, text="p:Leg(length=0.1, mirror=y)", label="p:Leg(length=100 mm, mirror=y)", mirror="y", plain=plain)
    top = replace(plain, text="bot", label="bot", reference="bot.yaml", kind="assembly")
    edges = tuple(
        DefinitionEdge(parent="bot", child=one.text, component=name, mounts="", joint=None)
        for one, name in ((image, "left"), (plain, "right"))
    )
    both = Hag(root="bot", definitions=(top, image, plain), edges=edges)
    assert "1 x p:Leg(length=100 mm, mirror=y) mirrors p:Leg(length=100 mm)\n" in hag.text(both)
    assert '  n1 -> n2 [label="mirror y" style=dashed constraint=false];\n' in hag.dot(both)
    assert '  n1 -.->|"mirror y"| n2\n' in hag.mermaid(both)
    assert "length=100 mm, mirror=y" in hag.svg(both)
    alone = Hag(root="bot", definitions=(top, image), edges=edges[:1])
    assert " mirrors p:Leg(length=100 mm)\n" in hag.text(alone)
    assert "dashed" not in hag.dot(alone) and "-.->" not in hag.mermaid(alone)


def test_output_is_deterministic() -> None:
    for write in (hag.text, hag.dot, hag.mermaid, hag.svg):
        assert write(walker()) == write(walker())
