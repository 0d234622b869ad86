"""Write the hierarchical assembly graph in text formats: as an indented tree for the terminal, as DOT, and as a Mermaid flowchart."""

from __future__ import annotations

from itertools import groupby

from thingc.base.safe_text import escape_control
from thingc.model.assembly.hag import Definition, DefinitionEdge, Hag
from thingc.targets import json_writer
from thingc.targets.artifact import Artifacts
from thingc.targets.hag.labels import bundles, children, entries, how, mirrors, quantities, total
from thingc.targets.hag.svg import picture as svg
from thingc.targets.request import EmitRequest


def emit(request: EmitRequest) -> Artifacts:
    """Write `hag.dot`, `hag.mmd` and `hag.svg`, which contain the same hierarchical assembly graph."""
    hag = request.assembly.hag
    return Artifacts(files={"hag.dot": dot(hag).encode(), "hag.mmd": mermaid(hag).encode(), "hag.svg": svg(hag).encode()})

def graphml(hag: Hag) -> str:
    """Convert the hierarchical assembly graph to GraphML, which Gephi, yEd, Cytoscape and networkx read (see `networkx_export.hag_graph`).
    """
    from thingc.targets import networkx_export

    return networkx_export.graphml(networkx_export.hag_graph(hag, quantities(hag)))


def json(hag: Hag) -> str:
    """Convert the hierarchical assembly graph to JSON in the node-link format of networkx."""
    import networkx

    from thingc.targets.networkx_export import hag_graph

    return json_writer.encode(networkx.node_link_data(hag_graph(hag, quantities(hag)), edges="edges")).decode()


def text(hag: Hag) -> str:
    """Format the hierarchical assembly graph for the terminal, as an indented tree of components. The tree is followed by the quantity of
    each definition.

    A nested assembly is only expanded at its first occurrence. All components of a `repeat` share one line.
    """
    below = children(hag)
    labels = {definition.text: escape_control(definition.label) for definition in hag.definitions}
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
    """Return a remark about a definition. The remark contains the kind of the definition (nothing for a part) and, for a mirror image, the
    original part.
    """
    kind = f" ({definition.kind})" if definition.kind != "part" else ""
    return kind if definition.plain is None else f"{kind} mirrors {escape_control(definition.plain.label)}"

def dot(hag: Hag) -> str:
    """Convert the hierarchical assembly graph to the DOT language of Graphviz.

    Each definition becomes a node. Each component becomes an edge, labelled with its mounts and its joint.
    """
    style = {
        "assembly": 'shape=box style="rounded,filled" fillcolor="#dbe7f6" color="#3d6fae"',
        "part": 'shape=box style="rounded,filled" fillcolor="#f7f4ec" color="#8f8466"',
        "file": 'shape=note style="filled" fillcolor="#e6f2e6" color="#5d8a5d"',
        "link": 'shape=box style="filled" fillcolor="#f3e8f3" color="#8d6a8d"',
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
    """Convert the hierarchical assembly graph to a Mermaid flowchart.

    Each definition becomes a node. If several components connect two definitions, the edge between them lists all these components.
    """
    shapes = {"assembly": ('(["', '"])'), "part": ('["', '"]'), "file": ('[/"', '"/]'), "link": ('[["', '"]]'), "frame": ('("', '")')}
    names = _names(hag)
    lines = ["flowchart LR"]
    for definition in hag.definitions:
        opening, closing = shapes[definition.kind]
        lines.append(f"  {names[definition.text]}{opening}{_mermaid_escaped(definition.label)}{closing}:::{definition.kind}")
    for (parent, child), edges in bundles(hag).items():
        label = "<br/>".join(": ".join(_mermaid_escaped(part) for part in (name, placed) if part) for name, placed in entries(edges))
        lines.append(f'  {names[parent]} -->|"{label}"| {names[child]}')
    lines += [f'  {names[image.text]} -.->|"mirror {image.mirror}"| {names[plain]}' for image, plain in mirrors(hag)]
    lines += [
        "  classDef assembly fill:#dbe7f6,stroke:#3d6fae,color:#1f2937",
        "  classDef part fill:#f7f4ec,stroke:#8f8466,color:#1f2937",
        "  classDef file fill:#e6f2e6,stroke:#5d8a5d,color:#1f2937",
        "  classDef link fill:#f3e8f3,stroke:#8d6a8d,color:#1f2937",
        "  classDef frame fill:#ffffff,stroke:#8a8a8a,color:#1f2937,stroke-dasharray:4 3",
    ]
    return "\n".join(lines) + "\n"

def _child(edge: DefinitionEdge) -> str:
    return edge.child

def _names(hag: Hag) -> dict[str, str]:
    return {definition.text: f"n{index}" for index, definition in enumerate(hag.definitions)}

def _dot_quoted(*lines: str) -> str:
    """Format lines of text as a quoted DOT string. The character `"` is escaped. In labels, `\\` and `&` (HTML entities) are also
    escaped. Each line ends with `\\n`.
    """
    escaped = (escape_control(line).replace("&", "&amp;").replace("\\", "\\\\").replace('"', '\\"') for line in lines)
    return '"' + "\\n".join(escaped) + '"'

def _mermaid_escaped(text: str) -> str:
    """Escape a string for a quoted Mermaid label.

    Characters that end the label, or begin an entity, HTML or Markdown, are replaced by entity codes.
    """
    return "".join(f"#{ord(character)};" if character in "\"#&<`\\" else character for character in escape_control(text))
