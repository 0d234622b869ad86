"""The SVG of the assembly graph: boxes do not overlap, lines avoid boxes, texts fit, and the XML is well-formed."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from itertools import combinations, pairwise

import pytest
from hypothesis import given, settings, strategies as st

from emit.graphs import NASTY, arm, awkward, graph, walker
from thingc.base.safe_text import escape_control
from thingc.model.assembly.hag import Hag
from thingc.targets.hag import emit as hag
from thingc.targets.hag.layered_layout import Drawing, Line, Rectangle, Size, draw

SVG = "{http://www.w3.org/2000/svg}"
GRAPHS = pytest.mark.parametrize("drawn", [arm(), walker(), awkward()], ids=["arm", "walker", "awkward"])


def are_disjoint(a: Rectangle, b: Rectangle) -> bool:
    return a.x + a.width <= b.x or b.x + b.width <= a.x or a.y + a.height <= b.y or b.y + b.height <= a.y


def rectangle(element: ET.Element) -> Rectangle:
    return Rectangle(**{name: float(element.attrib[name]) for name in ("x", "y", "width", "height")})


def groups(svg: ET.Element, kind: str) -> list[ET.Element]:
    return [g for g in svg.iter(f"{SVG}g") if g.attrib.get("class", "").split(" ")[0] == kind]


def points(path: str) -> list[tuple[float, float]]:
    """Points along a path of `M x y`, `H x` and `C` segments, with 12 on each curve."""
    found: list[tuple[float, float]] = []
    for command, words in re.findall(r"([MHC])([^MHC]*)", path):
        numbers = [float(word) for word in words.split()]
        if command == "M":
            found.append((numbers[0], numbers[1]))
        elif command == "H":
            x, y = found[-1]
            found.extend((x + (numbers[0] - x) * k / 8, y) for k in range(1, 9))
        else:
            (x0, y0), (x1, y1, x2, y2, x3, y3) = found[-1], numbers
            for k in range(1, 13):
                t = k / 12
                a, b, c, d = (1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t * t * (1 - t), t**3
                found.append((a * x0 + b * x1 + c * x2 + d * x3, a * y0 + b * y1 + c * y2 + d * y3))
    return found


@GRAPHS
def test_boxes_and_labels_do_not_overlap(drawn: Hag) -> None:
    """All boxes and labels are inside the picture, and no two of them overlap."""
    svg = ET.fromstring(hag.svg(drawn))
    width, height = float(svg.attrib["width"]), float(svg.attrib["height"])
    assert svg.attrib["viewBox"] == f"0 0 {svg.attrib['width']} {svg.attrib['height']}"
    (board,) = [g for g in svg.iter(f"{SVG}g") if "transform" in g.attrib]
    match = re.fullmatch(r"translate\((\S+) (\S+)\)", board.attrib["transform"])
    assert match is not None
    left, top = float(match[1]), float(match[2])
    boxes = groups(svg, "box")
    assert [box.findtext(f"{SVG}title") for box in boxes] == [escape_control(d.label) for d in drawn.definitions]
    places = []
    for group in [*boxes, *groups(svg, "label")]:
        place = next(rectangle(r) for r in group.iter(f"{SVG}rect"))
        places.append(place)
        assert left + place.x >= 0 and left + place.x + place.width <= width
        assert top + place.y >= 0 and top + place.y + place.height <= height
    assert all(are_disjoint(a, b) for a, b in combinations(places, 2))


@GRAPHS
def test_texts_fit_their_boxes(drawn: Hag) -> None:
    """Texts fit at the advance of the widest common monospaced font, 0.602 of the font size."""
    svg = ET.fromstring(hag.svg(drawn))
    for group in [*groups(svg, "box"), *groups(svg, "label")]:
        place = next(rectangle(r) for r in group.iter(f"{SVG}rect"))
        for text in group.iter(f"{SVG}text"):
            size = float(text.attrib.get("font-size", "11"))
            words = text.text or ""
            columns = len(words) + sum(1 for character in words if ord(character) > 0x2E80 and character != "\ufffd")
            assert place.x <= float(text.attrib["x"])
            assert float(text.attrib["x"]) + 0.602 * size * columns <= place.x + place.width + 0.5
            assert place.y + size * 0.6 <= float(text.attrib["y"]) <= place.y + place.height - 1.0
        for inner in list(map(rectangle, group.iter(f"{SVG}rect")))[1:]:
            assert place.x < inner.x and inner.x + inner.width < place.x + place.width
            assert place.y < inner.y and inner.y + inner.height < place.y + place.height


@GRAPHS
def test_lines_avoid_boxes(drawn: Hag) -> None:
    """Each line runs from left to right, from its parent to its child, and crosses no box."""
    svg = ET.fromstring(hag.svg(drawn))
    boxes = [next(rectangle(r) for r in group.iter(f"{SVG}rect")) for group in groups(svg, "box")]
    texts = [d.text for d in drawn.definitions]
    (board,) = [g for g in svg.iter(f"{SVG}g") if "transform" in g.attrib]
    lines = [path.attrib["d"] for path in board.iter(f"{SVG}path") if path.attrib.get("fill") == "none"]
    pairs = list(dict.fromkeys((edge.parent, edge.child) for edge in drawn.edges))
    assert len(lines) == len(pairs)
    for line, (parent, child) in zip(lines, pairs):
        way = points(line)
        start, end = boxes[texts.index(parent)], boxes[texts.index(child)]
        assert way[0][0] == pytest.approx(start.x + start.width, abs=0.2) and start.y < way[0][1] < start.y + start.height
        assert way[-1][0] == pytest.approx(end.x, abs=0.2) and end.y < way[-1][1] < end.y + end.height
        assert all(a[0] <= b[0] + 0.1 for a, b in pairwise(way)), "from left to right"
        for box in boxes:
            inside = [(x, y) for x, y in way if box.x + 1 < x < box.x + box.width - 1 and box.y + 1 < y < box.y + box.height - 1]
            assert inside == []


def test_picture_shows_names_counts_and_joints() -> None:
    """The texts include definitions, quantities, repeats, joints, parameters and files."""
    svg = ET.fromstring(hag.svg(arm()))
    texts = [text.text for text in svg.iter(f"{SVG}text")]
    for words in ("12 definitions, 23 components", "BasePlate", "thingc_stock.dynamixel", "x4", "x10", "screw_0 ... screw_7",
                  "joint yaw: yaw_seat -> yaw_servo.rotor", "pen_diameter=20 mm", "end_effector.yaml", "joint", "frame"):
        assert words in texts, words


def test_special_characters_are_escaped() -> None:
    """Labels with markup, control characters and surrogates stay plain text in well-formed XML."""
    text = hag.svg(awkward())
    svg = ET.fromstring(text.encode())
    assert {element.tag.removeprefix(SVG) for element in svg.iter()} == {"svg", "title", "rect", "text", "g", "path"}
    titles = [title.text for title in svg.iter(f"{SVG}title")]
    assert NASTY.replace("\x07", "\\x07").replace("\ud800", "\\ud800") in titles


def test_svg_is_self_contained() -> None:
    """The SVG has no links, stylesheets or scripts. The only URL is the namespace."""
    text = hag.svg(walker())
    assert "href" not in text and "url(" not in text and "<style" not in text and "<script" not in text
    assert text.count("http") == 1, "the namespace alone"


def test_documents_with_equal_names_show_their_paths() -> None:
    """Definitions with the same name from different files are distinguished by their file."""
    drawn = graph("top", [("top", "top.yaml", "assembly"), ("foot", "a/foot.yaml", "assembly"),
                          ("foot(n=2) [b/foot.yaml]", "b/foot.yaml", "assembly")],
                  [("top", "foot", "one", "", None), ("top", "foot(n=2) [b/foot.yaml]", "two", "a -> one.b", None)])
    texts = [text.text for text in ET.fromstring(hag.svg(drawn)).iter(f"{SVG}text")]
    first = texts.index("a/foot.yaml")
    assert texts[first - 1 : first + 4] == ["foot", "a/foot.yaml", "foot", "b/foot.yaml", "n=2"]


sizes = st.builds(lambda w, h: Size(width=float(w), height=float(h)), st.integers(20, 300), st.integers(10, 120))


@st.composite
def pictures(draw_: st.DrawFn) -> tuple[list[Size], list[Line]]:
    boxes = draw_(st.lists(sizes, min_size=1, max_size=12))
    every = [(a, b) for b in range(len(boxes)) for a in range(b)]
    pairs = draw_(st.lists(st.sampled_from(every), unique=True, max_size=25)) if every else []
    return boxes, [Line(source=a, target=b, label=draw_(sizes)) for a, b in pairs]


def check_drawing(boxes: list[Size], lines: list[Line], drawing: Drawing) -> None:
    places = [*drawing.boxes, *(route.label for route in drawing.routes)]
    assert [(b.width, b.height) for b in drawing.boxes] == [(s.width, s.height) for s in boxes]
    for place in places:
        assert place.x >= 0 and place.y >= -0.1
        assert place.x + place.width <= drawing.width + 0.11 and place.y + place.height <= drawing.height + 0.11
    assert all(are_disjoint(a, b) for a, b in combinations(places, 2))
    for line, route in zip(lines, drawing.routes):
        start, end = drawing.boxes[line.source], drawing.boxes[line.target]
        assert start.x + start.width < route.label.x and route.label.x + route.label.width < end.x
        for (x0, x1, y) in route.stretches:
            assert x0 <= x1 and 0 <= y <= drawing.height
            for box in drawing.boxes:
                through = x0 < box.x + box.width - 0.1 and box.x + 0.1 < x1 and box.y < y < box.y + box.height
                assert not through or box in (start, end)
        assert all(a[1] < b[0] for a, b in pairwise(route.stretches))


@settings(max_examples=38)
@given(pictures())
def test_layout_of_random_acyclic_graphs(picture: tuple[list[Size], list[Line]]) -> None:
    """In random graphs, nothing overlaps, and routes cross no box between their ends."""
    boxes, lines = picture
    check_drawing(boxes, lines, draw(boxes, lines))


def test_avoidable_crossings_are_removed() -> None:
    """Two trees whose leaves alternate in the input are laid out without a crossing."""
    box, label = Size(width=50, height=20), Size(width=30, height=10)
    lines = [Line(source=k % 2, target=2 + k, label=label) for k in range(8)]
    drawing = draw([box] * 10, lines)
    order = sorted(range(2, 10), key=lambda k: drawing.boxes[k].y)
    assert len({k % 2 for k in order[:4]}) == 1


def test_cyclic_graph_is_rejected() -> None:
    box, label = Size(width=50, height=20), Size(width=30, height=10)
    with pytest.raises(ValueError, match="cycle"):
        draw([box] * 2, [Line(source=0, target=1, label=label), Line(source=1, target=0, label=label)])
