"""Create the Markdown text that an editor shows when the mouse pointer is over a key or value of a document."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from thingc.base.diagnostics import Code
from thingc.base.numeric import sum_of
from thingc.base.source import Path, entries_of, node_at
from thingc.base.units import ANGLE, FORCE, MASS, TORQUE, Quantity
from thingc.model.assembly.types import Assembly, JointEdge
from thingc.tools.lsp import shown_values
from thingc.tools.lsp.analysis import Analysis
from thingc.tools.lsp.cursor import Cursor, cursor_at
from thingc.tools.lsp.positions import TextPlace
from thingc.tools.lsp.schema_walk import SchemaWalk, described_as, find_description

_CODES = {code.code: code for code in Code}


def hover(analysis: Analysis, text: str, place: TextPlace, params: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return the hover text for a position in a document, in the format of LSP. Return None if there is no text to show."""
    lines = analysis.lines()
    cursor = cursor_at(text, lines.index(place), toml=analysis.path.lower().endswith(".toml"))
    if cursor is None or cursor.start == cursor.end:
        return None
    text_of_value = hover_text(analysis, cursor, text[cursor.start : cursor.end])
    if not text_of_value:
        return None
    return {"contents": {"kind": "markdown", "value": text_of_value}, "range": lines.range_of(cursor.start, cursor.end)}


def hover_text(analysis: Analysis, cursor: Cursor, written: str) -> str:
    """Return the hover text for the key or value `written` at the cursor. Return an empty string if there is no text to show."""
    if cursor.role == "key" and written in _CODES:
        code = _CODES[written]
        return f"**{code.code}**: {code.title}\n\nFix: {code.cure}\n\nRun `thingc explain {code.code}` for details."
    known = analysis.known
    schema = None if known.available_names is None else known.available_names.schema_of(known, cursor.scalars)
    walk = None if schema is None else SchemaWalk(schema, cursor.keys, cursor.scalars)
    if cursor.role == "key":
        path = (*cursor.path, written)
        return _of_name(known, path) or ("" if walk is None else find_description(walk.at(path)))
    flats = [] if walk is None else walk.at(cursor.path)
    parts = [_of_value(known, cursor, written), _describe_reference(known, cursor.path, written) or described_as(flats, written)]
    return "\n\n".join(part for part in parts if part) or find_description(flats)


def _of_value(analysis: Analysis, cursor: Cursor, written: str) -> str:
    """Format the value of a quantity or expression for a hover text."""
    values = shown_values.evaluate_expression(analysis, cursor.path, written)
    if not values or (not written.startswith("=") and not written.strip()[-1:].isalpha()):
        return ""
    if written.startswith("="):
        at = re.search(r"[A-Za-z]\w*$|$", cursor.typed)
        word = re.match(r"[A-Za-z]\w*|", written[at.start() if at is not None else 0 :])
        parameter_text = _of_parameter(analysis, word.group()) if word is not None and written != f"={word.group()}" else ""
        return "\n\n".join((f"`{written}` = **{shown_values.format_values(values)}**", *([parameter_text] if parameter_text else [])))
    value = " ".join(f"{one.value:.6g} {one.dimension.symbol}".strip() for one in values if isinstance(one, Quantity))
    return "" if value == written.strip() else f"`{written}` = {value}"


def _of_name(analysis: Analysis, path: Path) -> str:
    """Describe the element whose name is at this path of a document: a component, joint, pose, mode or mount, or a joint in a pose."""
    section, name = path[0], str(path[-1])
    if len(path) == 2 and section in _OF:
        return _OF[str(section)](analysis, name)
    if section == "mounts" and name in analysis.facts.exports:
        return _of_mount(analysis, analysis.facts.exports[name])
    if section == "poses" and len(path) == 3:
        return _of_joint(analysis, name)
    if section == "components" and path[2:3] == ("attach",) and len(path) == 4 and name not in ("mount", "to", "turn", "gap"):
        return _of_mount(analysis, f"{path[1]}.{name}")
    return ""


def _describe_reference(analysis: Analysis, path: Path, written: str) -> str:
    """Describe the element to which a reference in a document refers."""
    key = path[-1] if not isinstance(path[-1], int) else path[-2] if len(path) > 1 else ""
    if key in ("pose", "poses"):
        return _of_pose(analysis, written)
    if key in ("mode", "extends"):
        return _of_mode(analysis, written)
    if key == "joint":
        return _of_joint(analysis, written)
    if written.count("$") == 1:  # inside a `repeat`, use the first matching name
        items = re.compile(re.sub(r"\\\$[A-Za-z]\w*", r"\\w+", re.escape(written)))
        written = next(filter(items.fullmatch, analysis.facts.mounts), written)
    return _of_mount(analysis, written) or _of_component(analysis, written) or (_of_joint(analysis, written) if key == "drive" else "")


def _of_parameter(analysis: Analysis, name: str) -> str:
    parameter = shown_values.parameters_of(analysis).get(name)
    if parameter is None:
        return ""
    node = None if analysis.tree is None else node_at(analysis.tree, ("parameters", name))
    entries = {key: str(one.plain()) for key, one in entries_of(node).items()}
    bounds = [f"at {word} `{entries[key]}`" for key, word in (("min", "least"), ("max", "most")) if key in entries]
    return "; ".join((f"**{name}** = {shown_values.format_values((parameter,))}", *bounds, *([entries["doc"]] if "doc" in entries else [])))


# --- components and mounts ---------------------------------------------------------------------------------------------


def _of_component(analysis: Analysis, name: str) -> str:
    """Return a hover text for a component: the kind, the mass and the pose."""
    facts = analysis.facts
    piece = next((piece_or_none for piece_or_none in facts.pieces if name == piece_or_none.name or name in piece_or_none.items), None)
    description = piece.what if piece is not None else facts.components.get(name, "")
    if not description:
        return ""
    lines = [f"**{name}**: {description}"]
    items = piece.items if piece is not None else (name,)
    if len(items) > 1 and name not in items:
        lines.append(f"{len(items)} copies, `{items[0]}` to `{items[-1]}`.")
    if analysis.assembly is not None:
        lines += _describe_component(analysis.assembly, items[0] if name not in items else name)
    return "\n\n".join(lines)


def _describe_component(assembly: Assembly, name: str) -> Iterator[str]:
    """Yield a text about the mass of a component, and a text about the pose of a component that is not an assembly."""
    path = name.replace(".", "/")
    inside = [one for one in assembly.occurrences if one.path == path or one.path.startswith(f"{path}/")]
    if not inside:
        return
    mass = sum_of(one.properties.mass for one in inside)
    sources = dict.fromkeys(one.mass_source for one in inside if one.properties.mass)
    if mass:
        yield f"Mass {Quantity(mass, MASS).format(5)} ({', '.join(sources)})" + (f", {len(inside)} parts." if len(inside) > 1 else ".")
    if len(inside) == 1:
        base = assembly.occurrences[assembly.base].path
        if inside[0].index != assembly.base:
            place = f"At {shown_values.format_frame(assembly.rest[inside[0].index])} of `{base}`, with every joint at 0"
        else:
            place = "The base"
        yield f"{place}; link `{assembly.links[assembly.link_of[inside[0].index]].name}`."


def _of_mount(analysis: Analysis, reference: str) -> str:
    text = analysis.facts.mounts.get(reference)
    frame = shown_values.mount_frame_text(analysis, reference)
    if text is None and not frame:
        return ""
    return f"**{reference}**: {text or 'a mount.'}" + (f"\n\nAt {frame}{'' if ' of `' in frame else ' of its component'}." if frame else "")


# --- joints, poses and modes ----------------------------------------------------------------------------------------------


def _of_joint(analysis: Analysis, name: str) -> str:
    """Return a hover text for a joint: the kind, the mounts, the limits and the drive."""
    facts = analysis.facts.joints.get(name)
    mates = () if analysis.assembly is None else analysis.assembly.mates
    coordinate = next(((mate, edge) for mate in mates for edge in mate.joints if str(edge.name) == name), None)
    if facts is None and coordinate is None:
        return ""
    lines = [f"**{name}**: {facts.what}" if facts is not None else f"**{name}**"]
    if coordinate is not None:
        mate, edge = coordinate
        lines.append(_motion(edge))
        if edge.actuator is not None:
            unit = TORQUE if edge.twist.coordinate == ANGLE else FORCE
            effort = "" if edge.limit.effort is None else f", up to {Quantity(edge.limit.effort, unit).format(5)}"
            lines.append(f"Driven ({edge.actuator.kind}{effort}).")
        drives = () if analysis.assembly is None else analysis.assembly.tendons
        coupled = [one.transmission for one in drives if one.transmission is not None and edge.path in one.moves]
        if coupled:
            lines.append(f"Driven by the differential `{coupled[0]}`.")
        elif edge.mimic is None and edge.actuator is None and mate.loop is None:
            lines.append("Not driven.")
    return "\n\n".join(lines)


def _motion(edge: JointEdge) -> str:
    turns = any(edge.twist.angular)
    direction = shown_values.format_direction(edge.twist.angular if turns else edge.twist.linear).removeprefix("+")
    speed = edge.limit.velocity
    limit = "" if speed is None else f"; up to {speed * 30.0 / math.pi:.4g} rpm" if turns else f"; up to {speed:.4g} m/s"
    return f"{'Turns about' if turns else 'Slides along'} {direction} of the parent mount{limit}."


def _of_pose(analysis: Analysis, name: str) -> str:
    """Return a hover text for a pose: the joint coordinates, and the modes that start in this pose.

    Name patterns and nested poses are replaced by the matching joints.
    """
    model = analysis.model
    pose = None if model is None else next((one for one in model.poses if one.name == name and name in analysis.facts.poses), None)
    if model is None or pose is None:
        return ""
    dimensions = {} if analysis.assembly is None else {
        edge.path: edge.twist.coordinate for mate in analysis.assembly.mates for edge in mate.joints
    }
    values = [f"{path.replace('/', '.')} {Quantity(value, dimensions.get(path, ANGLE)).format(5)}" for path, value in pose.values.items()]
    more = f", and {len(values) - 12} more" if len(values) > 12 else ""
    modes = [f"`{mode.name}`" for mode in model.modes if mode.pose == name]
    return f"**{name}**: " + (f"{', '.join(values[:12])}{more}; all other joints at 0." if values else "every joint at 0.") + (
        f"\n\nModes that start in this pose: {', '.join(modes)}." if modes else ""
    )


def _of_mode(analysis: Analysis, name: str) -> str:
    """Return a hover text for a mode: the root, the base and the start pose."""
    mode = None if analysis.model is None else next((one for one in analysis.model.modes if one.name == name and one.stated), None)
    if mode is None:
        return ""
    base = {"fixed": "fixed to the world", "free": "free", "held": "held at a pose in the world"}.get(mode.base, mode.base)
    lines = [f"**{name}**: `{mode.root.text}` is the root, {base}" + (f"; starts in pose `{mode.pose}`." if mode.pose else ".")]
    if mode.on_floor or any(mode.at.translation):
        position = shown_values.format_position(mode.at.translation)
        lines.append("The robot stands on the floor." if mode.on_floor else f"The root is at {position}.")
    if mode.holds:
        lines.append(f"The mode holds {', '.join(f'`{one.mount.text}`' for one in mode.holds)}.")
    return "\n\n".join(lines)


_OF: dict[str, Callable[[Analysis, str], str]] = {
    "components": _of_component, "joints": _of_joint, "parameters": _of_parameter, "poses": _of_pose, "modes": _of_mode,
}

