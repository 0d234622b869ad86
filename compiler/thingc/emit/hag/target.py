"""The hierarchical assembly graph as text: an indented tree for the terminal, DOT, Mermaid; `svg.py` draws it."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

from thingc.emit import jsontext
from thingc.emit.artifact import Artifacts
from thingc.emit.request import EmitRequest
from thingc.graph.types import Definition, DefinitionEdge, Hag
from thingc.shown import shown

KINDS = ("assembly", "part", "file", "frame")
"""Kinds of definitions, in the order of a legend."""

@dataclass(frozen=True, slots=True, kw_only=True)
class Bundle:
    """All edges from one definition to another: drawn as one line."""

    parent: str
    child: str
    edges: tuple[DefinitionEdge, ...]


def emit(request: EmitRequest) -> Artifacts:
    """`hag.dot`, `hag.mmd` and `hag.svg` of the same graph."""
    hag = request.assembly.hag
    return Artifacts(
        files={"hag.dot": dot(hag).encode(), "hag.mmd": mermaid(hag).encode(), "hag.svg": svg(hag).encode()}
    )


def svg(hag: Hag) -> str:
    """A self-contained SVG document, see `svg.py`."""
    from thingc.emit.hag.svg import picture

    return picture(hag)


def graphml(hag: Hag) -> str:
    """GraphML, which Gephi, yEd, Cytoscape and networkx read, see `graphs.hag_graph`."""
    from thingc.emit import graphs

    return graphs.graphml(graphs.hag_graph(hag, quantities(hag)))


def json(hag: Hag) -> str:
    """The same graph as node-link JSON."""
    from thingc.emit import graphs

    return jsontext.encode(graphs.plain(graphs.hag_graph(hag, quantities(hag)))).decode()


def bundles(hag: Hag) -> tuple[Bundle, ...]:
    """The edges put together by their two ends, in the order first met."""
    grouped: dict[tuple[str, str], list[DefinitionEdge]] = {}
    for edge in hag.edges:
        grouped.setdefault((edge.parent, edge.child), []).append(edge)
    return tuple(Bundle(parent=parent, child=child, edges=tuple(edges)) for (parent, child), edges in grouped.items())


def quantities(hag: Hag) -> dict[str, int]:
    """How often each definition stands in the whole robot, by its text: the number of paths from the root to it."""
    waiting = {definition.text: 0 for definition in hag.definitions}
    for edge in hag.edges:
        waiting[edge.child] += 1
    below = _children(hag)
    counted = dict.fromkeys(waiting, 0)
    counted[hag.root] = 1
    ready = [text for text, number in waiting.items() if number == 0]
    for text in ready:
        for edge in below.get(text, ()):
            counted[edge.child] += counted[text]
            waiting[edge.child] -= 1
            if waiting[edge.child] == 0:
                ready.append(edge.child)
    return counted


def how(edge: DefinitionEdge) -> str:
    """How a component is placed, on one line: `joint yaw: yaw_seat -> yaw_servo.rotor`; empty for a base."""
    parts = [f"joint {edge.joint}"] if edge.joint is not None else []
    if edge.mounts:
        parts.append(edge.mounts)
    return shown(": ".join(parts))


def text(hag: Hag) -> str:
    """An indented tree for the terminal: component, definition, and how it is placed; then how often each is used.

    A nested assembly that is used again is not unrolled again; what a `repeat` made is one line.
    """
    below = _children(hag)
    labels = {definition.text: shown(definition.label) for definition in hag.definitions}
    rows: list[tuple[str, str, str]] = []
    unrolled: set[str] = set()

    def grow(parent: str, stem: str) -> None:
        unrolled.add(parent)
        groups = [(child, *entry) for child, edges in groupby(below.get(parent, []), _child) for entry in entries(list(edges))]
        for position, (child, component, placed) in enumerate(groups):
            last = position == len(groups) - 1
            again = child in unrolled and bool(below.get(child))
            branch = "└── " if last else "├── "
            rows.append((stem + branch + component, labels[child] + (" (as above)" if again else ""), placed))
            if not again:
                grow(child, stem + ("    " if last else "│   "))

    grow(hag.root, "")
    counted = quantities(hag)
    widths = [max((len(row[column]) for row in rows), default=0) for column in (0, 1)]
    lines = [labels[hag.root]]
    lines += [f"{name:<{widths[0]}}  {definition:<{widths[1]}}  {placed}".rstrip() for name, definition, placed in rows]
    used = [definition for definition in hag.definitions if definition.text != hag.root]
    if used:
        digits = max(len(str(counted[definition.text])) for definition in used)
        lines += ["", f"{total(hag)}:"]
        lines += [f"  {counted[d.text]:>{digits}} x {labels[d.text]}{_remark(d)}" for d in used]
    return "\n".join(lines) + "\n"


def _remark(definition: Definition) -> str:
    """What kind of definition it is, unless it is a part, and what it mirrors."""
    kind = f" ({definition.kind})" if definition.kind != "part" else ""
    return kind if definition.plain is None else f"{kind} mirrors {shown(definition.plain.label)}"


def mirrors(hag: Hag) -> list[tuple[Definition, str]]:
    """Every mirror image of a definition that stands in the graph as well, with the text of that."""
    there = {definition.text for definition in hag.definitions}
    return [(one, one.plain.text) for one in hag.definitions if one.plain is not None and one.plain.text in there]


def total(hag: Hag) -> str:
    """`12 definitions, 18 components`: the size of the graph and of the tree that it unrolls to (without its root)."""
    components = sum(quantities(hag).values()) - 1
    return f"{_plural(len(hag.definitions), 'definition')}, {_plural(components, 'component')}"


def dot(hag: Hag) -> str:
    """Graphviz: a node per definition, an edge per component with its mounts and joint."""
    style = {
        "assembly": 'shape=box style="rounded,filled" fillcolor="#dbe7f6" color="#3d6fae"',
        "part": 'shape=box style="rounded,filled" fillcolor="#f7f4ec" color="#8f8466"',
        "file": 'shape=note style="filled" fillcolor="#e6f2e6" color="#5d8a5d"',
        "frame": 'shape=box style="rounded,dashed" color="#8a8a8a"',
    }
    names = _names(hag)
    lines = [
        f"digraph {_dot_quoted(hag.label)} {{",
        "  rankdir=LR;",
        '  node [fontname="monospace" fontsize=11];',
        '  edge [fontname="monospace" fontsize=9 color="#6b7280"];',
    ]
    for definition in hag.definitions:
        lines.append(f"  {names[definition.text]} [label={_dot_quoted(definition.label)} {style[definition.kind]}];")
    for edge in hag.edges:
        label = _dot_quoted(*(line for line in (edge.component, how(edge)) if line))
        color = ' color="#c2410c"' if edge.joint is not None else ""
        lines.append(f"  {names[edge.parent]} -> {names[edge.child]} [label={label}{color}];")
    lines += [
        f'  {names[image.text]} -> {names[plain]} [label="mirror {image.mirror}" style=dashed constraint=false];'
        for image, plain in mirrors(hag)
    ]
    return "\n".join([*lines, "}"]) + "\n"


def mermaid(hag: Hag) -> str:
    """A Mermaid flowchart: a node per definition, one edge per pair of definitions that lists the components."""
    shapes = {"assembly": ('(["', '"])'), "part": ('["', '"]'), "file": ('[/"', '"/]'), "frame": ('("', '")')}
    names = _names(hag)
    lines = ["flowchart LR"]
    for definition in hag.definitions:
        opening, closing = shapes[definition.kind]
        lines.append(f"  {names[definition.text]}{opening}{_mermaid_escaped(definition.label)}{closing}:::{definition.kind}")
    for bundle in bundles(hag):
        label = "<br/>".join(
            ": ".join(_mermaid_escaped(part) for part in (name, placed) if part) for name, placed in entries(bundle.edges)
        )
        lines.append(f'  {names[bundle.parent]} -->|"{label}"| {names[bundle.child]}')
    lines += [f'  {names[image.text]} -.->|"mirror {image.mirror}"| {names[plain]}' for image, plain in mirrors(hag)]
    lines += [
        "  classDef assembly fill:#dbe7f6,stroke:#3d6fae,color:#1f2937",
        "  classDef part fill:#f7f4ec,stroke:#8f8466,color:#1f2937",
        "  classDef file fill:#e6f2e6,stroke:#5d8a5d,color:#1f2937",
        "  classDef frame fill:#ffffff,stroke:#8a8a8a,color:#1f2937,stroke-dasharray:4 3",
    ]
    return "\n".join(lines) + "\n"


def entries(edges: Sequence[DefinitionEdge]) -> list[tuple[str, str]]:
    """Edges of one bundle as `(component, how it is placed)`; three or more that a `repeat` made (`leg_0`, `leg_1`, ...) are
    one entry: `leg_0 ... leg_5`, placed as the first with each number that counts along written as `*`."""
    found: list[tuple[str, str]] = []
    position = 0
    while position < len(edges):
        run = _run(edges, position)
        first, last = edges[position], edges[position + run - 1]
        if run < 3:
            found.append((first.component, how(first)))
            position += 1
            continue
        placed = how(first)
        if any(how(edge) != placed for edge in edges[position : position + run]):
            number = first.component.rpartition("_")[2]
            placed = re.sub(rf"(?<=_){number}(?![0-9A-Za-z_])", "*", placed)
        found.append((f"{first.component} ... {last.component}", placed))
        position += run
    return found


def _run(edges: Sequence[DefinitionEdge], start: int) -> int:
    """How many edges from `start` on are named `stem_k`, `stem_k+1`, ..."""
    stem, _, number = edges[start].component.rpartition("_")
    if not stem or not number.isdecimal():
        return 1
    length = 1
    while start + length < len(edges) and edges[start + length].component == f"{stem}_{int(number) + length}":
        length += 1
    return length


def _children(hag: Hag) -> dict[str, list[DefinitionEdge]]:
    below: dict[str, list[DefinitionEdge]] = {}
    for edge in hag.edges:
        below.setdefault(edge.parent, []).append(edge)
    return below


def _child(edge: DefinitionEdge) -> str:
    return edge.child


def _names(hag: Hag) -> dict[str, str]:
    return {definition.text: f"n{index}" for index, definition in enumerate(hag.definitions)}


def _plural(number: int, word: str) -> str:
    return f"{number} {word}" if number == 1 else f"{number} {word}s"


def _dot_quoted(*lines: str) -> str:
    """A DOT string: `"` and, in labels, `\\` and `&` (HTML entities) are special; lines end with `\\n`."""
    escaped = (shown(line).replace("&", "&amp;").replace("\\", "\\\\").replace('"', '\\"') for line in lines)
    return '"' + "\\n".join(escaped) + '"'


def _mermaid_escaped(text: str) -> str:
    """Inside a quoted Mermaid label: characters that end it, begin an entity, HTML or Markdown, as entity codes."""
    return "".join(f"#{ord(character)};" if character in "\"#&<`\\" else character for character in shown(text))


def short(definition: Definition) -> tuple[str, str, str]:
    """`(name, where, parameters)` of a definition, for a box: `("RotorBrace", "arm", "length=100 mm")`."""
    text = shown(definition.label).removesuffix(f" [{shown(definition.reference)}]")
    head, opening, rest = text.partition("(") if definition.kind != "file" else (text, "", "")
    parameters = rest[:-1] if opening and rest.endswith(")") else rest
    if definition.kind == "part" and ":" in head:
        where, _, name = head.rpartition(":")
        return name, where, parameters
    if definition.kind == "file":
        where, _, name = head.rpartition("/")
        return name, where, parameters
    return head, shown(definition.reference) if definition.kind == "assembly" else "", parameters
