"""Write the sections `raw:` and `names:` of the document of an imported robot.

The section `raw:` contains attributes and elements that are written only to the MuJoCo model. The section `names:` contains names of
elements in generated files.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from typing import Any

from thingc.documents.load.yaml_scalars import core_value
from thingc.tools.importing.document_names import DocumentNaming
from thingc.tools.importing.quantities import quantity
from thingc.tools.importing.source_model import Raw, SourceAdded, SourceJoint, SourcePose, SourceShape, SourceTarget


def raw_of(words: DocumentNaming) -> dict[str, Any]:
    """Return the attributes that are written only to the MuJoCo model, as nested mappings.

    An attribute with the same value for all collision shapes is set in their default class.
    """
    robot, tree = words.robot, dict[str, Any]()

    def lay(raw: Raw, *path: str) -> None:
        at = tree
        for word in path if raw else ():
            at = at.setdefault(word, {})
        at.update(raw)

    for (*path, key), value in robot.options:
        lay(((key, value),), *path)
    touching = (touch for name in words.links for _, touch in words.items(words.link_of[name]) if touch is not None)
    shapes = [(words.title(touch) or words.usual[id(touch)], touch) for touch in touching]
    common: set[tuple[str, str]] = set()
    for key in sorted({key for _, shape in shapes for key, _ in shape.raw}):
        values = [dict(shape.raw).get(key) for _, shape in shapes if not _says(shape, key)]
        if len(values) > 1 and len(set(values)) == 1 and values[0] is not None:
            common.add((key, values[0]))
            lay(((key, values[0]),), "default", "collision", "geom")
    for name in words.links:
        lay(words.link_of[name].raw, "body", words.links[name])
    for joint in words.moving:
        word = words.joints[joint.name]
        lay(joint.raw, "joint", word)
        if joint.drive is not None:
            lay(joint.drive.raw, "actuator", word)
        if joint.follows is not None:
            lay(joint.follows.raw, "equality", f"{word}:mimic")
    for tendon in robot.tendons:
        lay(tendon.raw, "tendon", words.tendons[tendon.name])
        if tendon.drive is not None:
            lay(tendon.drive.raw, "actuator", words.tendons[tendon.name])
    for magnet in robot.adhesions:
        lay(magnet.raw, "actuator", f"{words.links[magnet.link]}.{words.magnets[magnet.name]}")
    for loop in robot.loops:
        lay(loop.raw, "equality", f"{words.loops[loop.name]}:loop")
    for word, shape in shapes:
        lay(tuple(one for one in shape.raw if one not in common or _says(shape, one[0])), "geom", word)
    for state in robot.poses:
        lay(_controls(words, state), "key", words.poses[state.name])
    return tree


def _controls(words: DocumentNaming, state: SourcePose) -> Raw:
    """Return the control values `ctrl` of a keyframe in source order, or an empty tuple if all are default values.

    The default control is q for a position drive, the force in the mode for an adhesion, and 0 for other drives.
    """
    usual: dict[str, float | None] = {one.name: one.force for one in words.robot.adhesions}
    driven = [*words.moving, *words.robot.tendons]
    for one in driven:
        if one.drive is not None and one.drive.kind == "position":
            q = state.q.get(one.name, 0.0)
            usual[one.drive.name] = q if isinstance(one, SourceJoint) and isinstance(q, float) else None  # a tendon's default is its length
    wanted = [(name, state.controls.get(name, 0.0)) for name in order_of(words, "actuator")]
    alike = all(value == usual.get(name, 0.0) for name, value in wanted)
    return () if alike else (("ctrl", " ".join(quantity(value, "") for _, value in wanted)),)


def order_of(words: DocumentNaming, kind: str) -> dict[str, str]:
    """Map the source names of the actuators or sensors to document names, in source order."""
    names = words.others().get(f"{kind}s", {})
    return {name: names[name] for name in words.robot.order.get(kind, ()) if name in names}


def _says(shape: SourceShape, attribute: str) -> bool:
    """Return whether thingc derives this attribute of a shape from the friction coefficients.

    The document does not contain such an attribute.
    """
    return {"friction": 0, "priority": 0, "condim": 1}.get(attribute, 3) < len(shape.friction)


def name_lines(words: DocumentNaming) -> Iterator[str]:
    """Yield the lines of the section `names:`. Yield nothing if all elements have default names in generated models."""
    for kind, names in words.in_files().items():
        yield f"  {kind}:"
        yield from (f"    {word}: {quote(name)}" for word, name in names.items())


def quote(name: str) -> str:
    """Format a string for YAML. Quotes are added unless the string is a plain word."""
    plain = re.fullmatch(r"[A-Za-z_][\w.-]*", name, re.ASCII) and isinstance(core_value(name), str)
    return name if plain else json.dumps(name, ensure_ascii=False)


def raw_lines(words: DocumentNaming) -> Iterator[str]:
    """Yield the lines of the section `raw: {mjcf: ...}`. Yield nothing if the section would be empty."""
    tree, added = raw_of(words), words.robot.added
    orders = {kind: order for kind in words.robot.order if len(order := order_of(words, kind)) > 1}
    if tree or added or orders:
        yield "  mjcf:"
    for kind, things in tree.items():
        if any(isinstance(one, str) for one in things.values()):
            yield f"    {kind}: {_flow(things)}"
            continue
        yield f"    {kind}:"
        yield from (f"      {_text(name)}: {_flow(values)}" for name, values in things.items())
    if orders:
        yield "    order:"
        yield from (f"      {kind}: [{', '.join(map(quote, order.values()))}]" for kind, order in orders.items())
    if added:
        yield "    add:"
    for section in dict.fromkeys(one.section for one in added):
        yield f"      {section}:"
        yield from (f"        - {one.tag}: {_flow(_element(words, one))}" for one in added if one.section == section)


def _element(words: DocumentNaming, one: SourceAdded) -> dict[str, str]:
    """Return the attributes of an element that is added to the MuJoCo model. References to other elements contain document names."""
    name = words.added[one.section, one.name]
    return ({"name": name} if name else {}) | {key: _name_text(words, value) for key, value in one.attributes}


def _name_text(words: DocumentNaming, value: str | SourceTarget) -> str:
    if isinstance(value, str):
        return value
    names = {"joint": words.joints, "site": words.sites, "tendon": words.tendons, "body": words.links}
    return (names.get(value.kind) or words.others()[f"{value.kind}s"])[value.name]


def _flow(value: Any) -> str:
    return _text(value) if isinstance(value, str) else f"{{{', '.join(f'{_text(key)}: {_flow(one)}' for key, one in value.items())}}}"


def _text(word: str) -> str:
    """Format the value of an XML attribute as a YAML scalar. Quotes are added if YAML would parse another value. Numbers are not quoted."""
    plain = re.fullmatch(r"[A-Za-z0-9_.+-]+( [A-Za-z0-9_.+-]+)*", word) and not isinstance(core_value(word), (bool, type(None)))
    return word if plain and not word.startswith("-") or re.fullmatch(r"-[0-9.e+ -]+", word) else f'"{word}"'
