"""Create labels for the hierarchical assembly graph. This module groups edges, counts the quantities of definitions, and describes the
placements of components.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from graphlib import TopologicalSorter
from typing import get_args

from thingc.base.grouping import group_by
from thingc.base.one_line_repr import format_count
from thingc.base.safe_text import escape_control
from thingc.model.assembly.hag import Definition, DefinitionEdge, DefinitionKind, Hag

KINDS: tuple[DefinitionKind, ...] = get_args(DefinitionKind)
"""Kinds of definitions, in the order in which the legend lists them."""


def bundles(hag: Hag) -> dict[tuple[str, str], list[DefinitionEdge]]:
    """Return all edges from one definition to another definition, which are drawn as one line, by the texts of these definitions. The pairs
    are in the order in which they first occur.
    """
    return group_by(hag.edges, lambda edge: (edge.parent, edge.child))

def quantities(hag: Hag) -> dict[str, int]:
    """Return the quantity of each definition in the robot, keyed by definition text.

    The quantity is the number of paths from the root of the graph to the definition.
    """
    above: dict[str, list[str]] = {definition.text: [] for definition in hag.definitions}
    for edge in hag.edges:
        above[edge.child].append(edge.parent)
    counted = dict.fromkeys(above, 0)
    counted[hag.root] = 1
    for text in TopologicalSorter(above).static_order():
        counted[text] += sum(counted[parent] for parent in above[text])
    return counted

def how(edge: DefinitionEdge) -> str:
    """Describe the placement of a component on one line, such as `joint yaw: yaw_seat -> yaw_servo.rotor`.

    Return an empty string for the base component.
    """
    parts = [f"joint {edge.joint}"] if edge.joint is not None else []
    if edge.mounts:
        parts.append(edge.mounts)
    return escape_control(": ".join(parts))

def mirrors(hag: Hag) -> list[tuple[Definition, str]]:
    """Return each mirror image in the graph, with the definition text of its original part.

    Mirror images are omitted if the graph does not contain the original part.
    """
    texts = {definition.text for definition in hag.definitions}
    return [(image, image.plain.text) for image in hag.definitions if image.plain is not None and image.plain.text in texts]

def total(hag: Hag) -> str:
    """Describe the size of the graph and of the expanded tree without its root, such as `12 definitions, 18 components`."""
    components = sum(quantities(hag).values()) - 1
    return f"{format_count(len(hag.definitions), 'definition')}, {format_count(components, 'component')}"

def entries(edges: Sequence[DefinitionEdge]) -> list[tuple[str, str]]:
    """Return the edges of a bundle as tuples `(component, placement)`.

    Three or more components of a `repeat` (`leg_0`, `leg_1`, ...) form one entry: `leg_0 ... leg_5`. Such an entry has the placement of the
    first component, in which `*` replaces the number.
    """
    placements: list[tuple[str, str]] = []
    position = 0
    while position < len(edges):
        run = _run(edges, position)
        first, last = edges[position], edges[position + run - 1]
        if run < 3:
            placements.append((first.component, how(first)))
            position += 1
            continue
        placed = how(first)
        if any(how(edge) != placed for edge in edges[position : position + run]):
            number = first.component.rpartition("_")[2]
            placed = re.sub(rf"(?<=_){number}(?![0-9A-Za-z_])", "*", placed)
        placements.append((f"{first.component} ... {last.component}", placed))
        position += run
    return placements

def short(definition: Definition) -> tuple[str, str, str]:
    """Return the texts in the box of a definition as a tuple `(name, where, parameters)`, such as `("RotorBrace", "arm", "length=100 mm")`.
    """
    text = escape_control(definition.label).removesuffix(f" [{escape_control(definition.reference)}]")
    head, opening, rest = text.partition("(") if definition.kind != "file" else (text, "", "")
    parameters = rest[:-1] if opening and rest.endswith(")") else rest
    if definition.kind == "part" and ":" in head:
        where, _, name = head.rpartition(":")
        return name, where, parameters
    if definition.kind == "file":
        where, _, name = head.rpartition("/")
        return name, where, parameters
    return head, escape_control(definition.reference) if definition.kind == "assembly" else "", parameters

def _run(edges: Sequence[DefinitionEdge], start: int) -> int:
    """Return the number of consecutive edges from the index `start` whose names are `stem_k`, `stem_k+1` and so on."""
    stem, _, number = edges[start].component.rpartition("_")
    if not stem or not number.isdecimal():
        return 1
    length = 1
    while start + length < len(edges) and edges[start + length].component == f"{stem}_{int(number) + length}":
        length += 1
    return length

def children(hag: Hag) -> dict[str, list[DefinitionEdge]]:
    """Return the edges from each assembly to its components. The keys are the definition texts of the assemblies."""
    return group_by(hag.edges, lambda edge: edge.parent)
