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


def raw_of(naming: DocumentNaming) -> dict[str, Any]:
    """Return the attributes that are written only to the MuJoCo model, as nested mappings.

    An attribute with the same value for all collision shapes is set in their default class.
    """
    robot, tree = naming.robot, dict[str, Any]()

    def insert(raw: Raw, *path: str) -> None:
        at = tree
        for key in path if raw else ():
            at = at.setdefault(key, {})
        at.update(raw)

    for (*path, key), value in robot.options:
        insert(((key, value),), *path)
    collisions = (touch for name in naming.links for _, touch in naming.items(naming.link_of[name]) if touch is not None)
    shapes = [(naming.title(touch) or naming.usual[id(touch)], touch) for touch in collisions]
    common: set[tuple[str, str]] = set()
    for key in sorted({key for _, shape in shapes for key, _ in shape.raw}):
        values = [dict(shape.raw).get(key) for _, shape in shapes if not _is_derived(shape, key)]
        if len(values) > 1 and len(set(values)) == 1 and values[0] is not None:
            common.add((key, values[0]))
            insert(((key, values[0]),), "default", "collision", "geom")
    for name in naming.links:
        insert(naming.link_of[name].raw, "body", naming.links[name])
    for joint in naming.moving:
        word = naming.joints[joint.name]
        insert(joint.raw, "joint", word)
        insert(joint.drive.raw if joint.drive is not None else (), "actuator", word)
        insert(joint.follows.raw if joint.follows is not None else (), "equality", f"{word}:mimic")
    for tendon in robot.tendons:
        insert(tendon.raw, "tendon", naming.tendons[tendon.name])
        insert(tendon.drive.raw if tendon.drive is not None else (), "actuator", naming.tendons[tendon.name])
    for magnet in robot.adhesions:
        insert(magnet.raw, "actuator", f"{naming.links[magnet.link]}.{naming.magnets[magnet.name]}")
    for loop in robot.loops:
        insert(loop.raw, "equality", f"{naming.loops[loop.name]}:loop")
    for word, shape in shapes:
        insert(tuple(one for one in shape.raw if one not in common or _is_derived(shape, one[0])), "geom", word)
    for state in robot.poses:
        insert(_controls(naming, state), "key", naming.poses[state.name])
    return tree


def _controls(naming: DocumentNaming, state: SourcePose) -> Raw:
    """Return the control values `ctrl` of a keyframe in source order, or an empty tuple if all are default values.

    The default control is q for a position drive, the force in the mode for an adhesion, and 0 for other drives.
    """
    usual: dict[str, float | None] = {element.name: element.force for element in naming.robot.adhesions}
    for element in (*naming.moving, *naming.robot.tendons):
        if element.drive is not None and element.drive.kind == "position":
            q = state.q.get(element.name, 0.0)
            usual[element.drive.name] = q if isinstance(element, SourceJoint) and isinstance(q, float) else None  # for a tendon, its length
    values = [(name, state.controls.get(name, 0.0)) for name in order_of(naming, "actuator")]
    all_default = all(value == usual.get(name, 0.0) for name, value in values)
    return () if all_default else (("ctrl", " ".join(quantity(value, "") for _, value in values)),)


def order_of(naming: DocumentNaming, kind: str) -> dict[str, str]:
    """Map the source names of the actuators or sensors to document names, in source order."""
    names = naming.other_names.get(f"{kind}s", {})
    return {name: names[name] for name in naming.robot.order.get(kind, ()) if name in names}


def _is_derived(shape: SourceShape, attribute: str) -> bool:
    """Return whether thingc derives this MuJoCo attribute from the friction of the shape, so that `raw` does not contain it."""
    return {"friction": 0, "priority": 0, "condim": 1}.get(attribute, 3) < len(shape.friction)


def name_lines(naming: DocumentNaming) -> Iterator[str]:
    """Yield the lines of the section `names:`. Yield nothing if all elements have default names in generated models."""
    for kind, names in naming.in_files().items():
        yield f"  {kind}:"
        yield from (f"    {word}: {quote(name)}" for word, name in names.items())


def quote(name: str) -> str:
    """Format a string for YAML. Quotes are added unless the string is a plain word."""
    plain = re.fullmatch(r"[A-Za-z_][\w.-]*", name, re.ASCII) and isinstance(core_value(name), str)
    return name if plain else json.dumps(name, ensure_ascii=False)


def raw_lines(naming: DocumentNaming) -> Iterator[str]:
    """Yield the lines of the section `raw: {mjcf: ...}`. Yield nothing if the section would be empty."""
    tree, added = raw_of(naming), naming.robot.added
    fewest = {"actuator": 2, "sensor": 1}  # a sensor of a document can have more readings than that of the source
    orders = {kind: order for kind in naming.robot.order if len(order := order_of(naming, kind)) >= fewest[kind]}
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
        yield from (f"        - {one.tag}: {_flow(_element(naming, one))}" for one in added if one.section == section)


def _element(naming: DocumentNaming, element: SourceAdded) -> dict[str, str]:
    """Return the attributes of an element that is added to the MuJoCo model. References to other elements contain document names."""
    name = naming.added[element.section, element.name]
    return ({"name": name} if name else {}) | {key: _name_text(naming, value) for key, value in element.attributes}


def _name_text(naming: DocumentNaming, value: str | SourceTarget) -> str:
    if isinstance(value, str):
        return value
    names = {"joint": naming.joints, "site": naming.sites, "tendon": naming.tendons, "body": naming.links}
    return (names.get(value.kind) or naming.other_names[f"{value.kind}s"])[value.name]


def _flow(value: Any) -> str:
    return _text(value) if isinstance(value, str) else f"{{{', '.join(f'{_text(key)}: {_flow(one)}' for key, one in value.items())}}}"


def _text(value: str) -> str:
    """Format the value of an XML attribute as a YAML scalar. Quotes are added if YAML would parse another value. Numbers are not quoted."""
    plain = re.fullmatch(r"[A-Za-z0-9_.+-]+( [A-Za-z0-9_.+-]+)*", value) and not isinstance(core_value(value), (bool, type(None)))
    return value if plain and not value.startswith("-") or re.fullmatch(r"-[0-9.e+ -]+", value) else f'"{value}"'
