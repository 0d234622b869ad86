"""Draw the hierarchical assembly graph as a self-contained SVG document. The layout is computed by `layered_layout.py`."""

from __future__ import annotations

import unicodedata
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.safe_text import escape_control
from thingc.model.assembly.hag import Definition, DefinitionEdge, DefinitionKind, Hag
from thingc.targets.hag.labels import KINDS, bundles, entries, how, quantities, short, total
from thingc.targets.hag.layered_layout import Drawing, Line, Rectangle, Route, Size, draw

MARGIN = 28.0
HEAD = 62.0
LINE_HEIGHT = 15.0
"""Distance between lines of text."""
PADDING = 12.0
ADVANCE = 0.61
"""Width of a character in a monospaced font, relative to the font size. The width is 0.602 for DejaVu Sans Mono and Menlo, and 0.600 for
Courier.
"""
MAX_CHARACTERS = 46
"""Maximum number of characters in a line. A longer text is wrapped or cut, and its tooltip shows the full text."""
MAX_ENTRIES = 6
"""Maximum number of entries in a label, and maximum number of lines of parameters in a box. The tooltip of the label or the box shows all
entries.
"""

FONT = "ui-monospace, 'SF Mono', Menlo, Consolas, 'DejaVu Sans Mono', 'Liberation Mono', monospace"
INK, MUTED, LINE, JOINT = "#1f2937", "#6b7280", "#a3acba", "#c2410c"
FILL: Mapping[DefinitionKind, str] = {"assembly": "#dbe7f6", "part": "#f7f4ec", "file": "#e6f2e6", "link": "#f3e8f3", "frame": "#ffffff"}
EDGE: Mapping[DefinitionKind, str] = {"assembly": "#3d6fae", "part": "#a89c7c", "file": "#5d8a5d", "link": "#8d6a8d", "frame": "#8a8a8a"}


def picture(hag: Hag) -> str:
    """Draw the hierarchical assembly graph as an SVG document.

    Each box represents a definition with its quantity. Each line represents a component with its placement. Lines of components with joints
    are coloured. The tooltips show all details.
    """
    numbers = {definition.text: index for index, definition in enumerate(hag.definitions)}
    counted = quantities(hag)
    texts = [_box_texts(definition) for definition in hag.definitions]
    sizes = [_box_size(lines, counted[d.text]) for lines, d in zip(texts, hag.definitions)]
    strands = bundles(hag)
    labels = [_label_lines(strand) for strand in strands.values()]
    lines = [
        Line(source=numbers[parent], target=numbers[child], label=_label_size(label))
        for (parent, child), label in zip(strands, labels)
    ]
    drawing = draw(sizes, lines)
    svg = _canvas(hag, drawing)
    board = ET.SubElement(svg, "g", {"transform": f"translate({_n(MARGIN)} {_n(HEAD)})"})
    for strand, route in zip(strands.values(), drawing.routes):
        _draw_line(board, strand, route)
    for strand, route, label in zip(strands.values(), drawing.routes, labels):
        _draw_label(board, strand, route.label, label)
    for definition, rectangle, box in zip(hag.definitions, drawing.boxes, texts):
        _draw_box(board, definition, rectangle, box, counted[definition.text])
    ET.indent(svg, " ")
    return ET.tostring(svg, encoding="unicode") + "\n"


def _canvas(hag: Hag, drawing: Drawing) -> ET.Element:
    width = max(drawing.width, 8.0 * MAX_CHARACTERS, _width(escape_control(hag.label), 16.0)) + 2.0 * MARGIN
    height = drawing.height + HEAD + MARGIN
    svg = ET.Element("svg", {
        "xmlns": "http://www.w3.org/2000/svg", "width": _n(width), "height": _n(height), "viewBox": f"0 0 {_n(width)} {_n(height)}",
        "font-family": FONT, "font-size": "11", "fill": INK,
    })
    ET.SubElement(svg, "title").text = f"{escape_control(hag.label)}: hierarchical assembly graph"
    ET.SubElement(svg, "rect", {"width": "100%", "height": "100%", "fill": "#ffffff"})
    _add_text(svg, MARGIN, 26.0, escape_control(hag.label), {"font-size": "16", "font-weight": "bold"})
    _add_text(svg, MARGIN, 43.0, total(hag), {"fill": MUTED})
    used = [kind for kind in KINDS if any(definition.kind == kind for definition in hag.definitions)]
    x = MARGIN + _width(total(hag), 11.0) + 22.0
    for kind in used:
        ET.SubElement(svg, "rect", _box_style(kind) | {"x": _n(x), "y": "34", "width": "14", "height": "10", "rx": "3"})
        _add_text(svg, x + 19.0, 43.0, kind, {"fill": MUTED})
        x += 19.0 + _width(kind, 11.0) + 14.0
    if any(edge.joint is not None for edge in hag.edges):
        ET.SubElement(svg, "path", {"d": f"M{_n(x)} 39H{_n(x + 18.0)}", "stroke": JOINT, "stroke-width": "1.6"})
        _add_text(svg, x + 23.0, 43.0, "joint", {"fill": MUTED})
        x += 23.0 + _width("joint", 11.0)
    if x + MARGIN > width:
        svg.set("width", _n(x + MARGIN))
        svg.set("viewBox", f"0 0 {_n(x + MARGIN)} {_n(height)}")
    return svg


def _box_texts(definition: Definition) -> list[str]:
    """Return the lines of text in the box of a definition: the name, then the module or file and the parameters."""
    name, location, parameters = short(definition)
    lines = [_cut(name)]
    if location:
        lines.append(_cut(location))
    parameter_lines = _break_lines(parameters.split(", ")) if parameters else []
    return lines + (parameter_lines if len(parameter_lines) <= MAX_ENTRIES else [*parameter_lines[: MAX_ENTRIES - 1], "..."])


def _break_lines(parts: Sequence[str]) -> list[str]:
    """Join words by commas, and break the text into lines of at most `0.8 * MAX_CHARACTERS` characters."""
    lines: list[str] = []
    for position, part in enumerate(parts):
        piece = part + ("," if position < len(parts) - 1 else "")
        if lines and len(lines[-1]) + 1 + len(piece) <= 0.8 * MAX_CHARACTERS:
            lines[-1] += " " + piece
        else:
            lines.append(_cut(piece))
    return lines


def _box_size(lines: Sequence[str], count: int) -> Size:
    head = _width(lines[0], 13.0) + (_width(f"x{count}", 11.0) + 22.0 if count > 1 else 0.0)
    width = max([head, *(_width(line, 11.0) for line in lines[1:])]) + 2.0 * PADDING
    return Size(width=round(max(width, 96.0), 1), height=LINE_HEIGHT * len(lines) + 15.0)


class _LabelLine(FrozenStruct):
    """A text line of a label. `baseline` is the distance of the text from the upper edge of the label. `kind` is `name`, `place` or
    `joint`.
    """

    text: str
    kind: str
    baseline: float


def _label_lines(strand: Sequence[DefinitionEdge]) -> list[_LabelLine]:
    """Return the text lines for the label of a drawn line: the components, each with its placement."""
    lines: list[_LabelLine] = []
    baseline = 11.0
    placements = entries(strand)
    for name, placed in placements[: MAX_ENTRIES if len(placements) <= MAX_ENTRIES else MAX_ENTRIES - 1]:
        lines.append(_LabelLine(text=_cut(name), kind="name", baseline=baseline))
        if placed:
            kind = "joint" if placed.startswith("joint ") else "place"
            baseline += LINE_HEIGHT - 2.0
            lines.append(_LabelLine(text=_cut(placed), kind=kind, baseline=baseline))
        baseline += LINE_HEIGHT + 3.0
    if len(placements) > MAX_ENTRIES:
        lines.append(_LabelLine(text=f"and {len(placements) - MAX_ENTRIES + 1} more", kind="place", baseline=baseline))
    return lines


def _label_size(lines: Sequence[_LabelLine]) -> Size:
    width = max(_width(line.text, 11.0 if line.kind == "name" else 10.0) for line in lines)
    return Size(width=round(width + 10.0, 1), height=lines[-1].baseline + 5.0)


def _draw_line(board: ET.Element, strand: Sequence[DefinitionEdge], route: Route) -> None:
    (x, _, y) = route.stretches[0]
    path = [f"M{_n(x)} {_n(y)}"]
    for (_, x1, y1), (x2, _, y2) in zip(route.stretches, route.stretches[1:]):
        middle = (x1 + x2) / 2.0
        path.append(f"H{_n(x1)}C{_n(middle)} {_n(y1)} {_n(middle)} {_n(y2)} {_n(x2)} {_n(y2)}")
    x, _, y = route.stretches[-1]
    color = JOINT if any(edge.joint is not None for edge in strand) else LINE
    ET.SubElement(board, "path", {"d": "".join(path), "fill": "none", "stroke": color, "stroke-width": "1.4"})
    ET.SubElement(board, "path", {"d": f"M{_n(x)} {_n(y)}l-8 -3.6v7.2z", "fill": color})


def _draw_label(board: ET.Element, strand: Sequence[DefinitionEdge], rectangle: Rectangle, lines: Sequence[_LabelLine]) -> None:
    group = ET.SubElement(board, "g", {"class": "label"})
    ET.SubElement(group, "title").text = "\n".join(": ".join(filter(None, (edge.component, how(edge)))) for edge in strand)
    ET.SubElement(group, "rect", _rectangle(rectangle) | {"fill": "#ffffff", "rx": "3"})
    styles: dict[str, dict[str, str]] = {
        "name": {}, "place": {"fill": MUTED, "font-size": "10"}, "joint": {"fill": JOINT, "font-size": "10"},
    }
    for line in lines:
        _add_text(group, rectangle.x + 5.0, rectangle.y + line.baseline, line.text, styles[line.kind])


def _draw_box(board: ET.Element, definition: Definition, rectangle: Rectangle, lines: Sequence[str], count: int) -> None:
    group = ET.SubElement(board, "g", {"class": f"box {definition.kind}"})
    ET.SubElement(group, "title").text = escape_control(definition.label)
    ET.SubElement(group, "rect", _rectangle(rectangle) | _box_style(definition.kind) | {"rx": "7"})
    for row, line in enumerate(lines):
        style = {"font-size": "13", "font-weight": "bold"} if row == 0 else {"fill": MUTED}
        _add_text(group, rectangle.x + PADDING, rectangle.y + LINE_HEIGHT * row + 19.5, line, style)
    if count > 1:
        badge = f"x{count}"
        width = _width(badge, 11.0) + 10.0
        x = rectangle.x + rectangle.width - width - 7.0
        pill = Rectangle(x=x, y=rectangle.y + 7.0, width=width, height=16.0)
        ET.SubElement(group, "rect", _rectangle(pill) | {"rx": "8", "fill": EDGE[definition.kind]})
        _add_text(group, x + 5.0, rectangle.y + 19.0, badge, {"fill": "#ffffff", "font-weight": "bold"})


def _box_style(kind: DefinitionKind) -> dict[str, str]:
    return {"fill": FILL[kind], "stroke": EDGE[kind]} | ({"stroke-dasharray": "4 3"} if kind == "frame" else {})


def _rectangle(rectangle: Rectangle) -> dict[str, str]:
    return {"x": _n(rectangle.x), "y": _n(rectangle.y), "width": _n(rectangle.width), "height": _n(rectangle.height)}


def _add_text(parent: ET.Element, x: float, y: float, text: str, style: dict[str, str]) -> None:
    ET.SubElement(parent, "text", {"x": _n(x), "y": _n(y), "xml:space": "preserve"} | style).text = text


def _width(text: str, size: float) -> float:
    """Return the width of a string in a monospaced font. East Asian wide characters have twice the width."""
    return sum(2.0 if unicodedata.east_asian_width(c) in "WF" else 1.0 for c in text) * ADVANCE * size


def _cut(text: str) -> str:
    return text if len(text) <= MAX_CHARACTERS else text[: MAX_CHARACTERS - 3] + "..."


def _n(value: float) -> str:
    """Format a coordinate in tenths of a pixel, without a trailing zero."""
    return f"{round(value, 1):.1f}".removesuffix(".0")
