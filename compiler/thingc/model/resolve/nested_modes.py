"""Place nested assemblies in one of their modes: robots and other objects that share a scene.

The root of the mode is placed, and the base of the mode becomes a joint: a fixed joint, or a joint of the kinds `free`, `planar` or `ball`.
Poses, actuators, contacts and cuts of the mode apply to the modes of the enclosing document.
"""

from __future__ import annotations

from collections.abc import Mapping

from thingc.base.diagnostics import Code
from thingc.base.joints.kinds import KINDS
from thingc.base.pose import IDENTITY
from thingc.model.resolve import references
from thingc.model.resolve.coordinates import CoordinateName
from thingc.model.resolve.document_scope import ComponentScope, DocumentScope
from thingc.model.resolve.joints import NO_DYNAMICS, NO_LIMIT
from thingc.model.resolve.modes import nested_mode
from thingc.model.resolve.references import suggested
from thingc.model.resolve.types import At, Attach, Joint, Mode, Reference

ROOT = "root"
"""Name of the joint of the base of a nested assembly. Joints in documents cannot have this name."""


def place_in_modes(table: DocumentScope, placements: dict[str, Attach | At | None]) -> bool:
    """Replace the placement of each component with a `mode` by the joint of the base of the mode.

    Invalid modes are reported, and their components remain unplaced. Return whether a component has a `mode` without a pose.
    """
    lost = False
    for node in table.nodes.values():
        at, scope, path = placements.get(node.name), node.scope, (*node.path, "mode")
        if node.spec.mode is None or node.table is None or node.unplaced:
            continue
        if not isinstance(at, At):
            scope.error(
                Code.BROKEN_RULE, f"`{node.name}` has `mode` but no `at`, the pose at which the mode is placed", path, key=True,
                help="write, for example, `at: {in: room.origin}`, with a component `room: {frame: true}`",
            )
            lost = node.unplaced = True
            continue
        placements[node.name] = None
        mode = _mode_of(node, node.table, node.spec.mode)
        if mode is None:
            node.unplaced = True
            continue
        table.by_mode[node.name] = mode
        kind, root, origin = KINDS[mode.base], mode.root, scope.origin(path)
        child = Reference(path=(node.name, *root.path), mount=root.mount or references.ORIGIN, origin=origin)
        name = CoordinateName(f"{node.name}.{ROOT}")
        for number, twist in enumerate(kind.twists or (None,)):
            own = name.numbered(number) if len(kind.twists) > 1 else name
            table.joints[own] = Joint(
                name=own, kind=kind, twist=twist, parent=at.to, child=child, limit=NO_LIMIT, dynamics=NO_DYNAMICS, turn=0.0, gap=0.0,
                offset=0.0, drive=None, mimic=None, origin=at.origin, spans={}, keep=not kind.moves, base=True,
                axis=IDENTITY[2] if root.mount is None else None, pose=at.pose @ mode.at,
            )
    return lost


def _mode_of(node: ComponentScope, inner: DocumentScope, name: str) -> Mode | None:
    """Return a mode of a nested assembly. If a scene does not support the mode, report an error and return None."""
    scope, path = node.scope, (*node.path, "mode")
    if name not in inner.spec.modes:
        if not inner.doubts.lacks("modes"):
            scope.error(
                Code.UNKNOWN_MODE, f"`{node.name}` (`{inner.document.relative}`) has no mode `{name}`", path,
                help=suggested(name, inner.spec.modes, what="modes"), notes=references.defined(inner),
            )
        return None
    mode = nested_mode(inner, name)
    if mode is None:
        return None
    unsupported: Mapping[str, bool] = {
        "`base: held`": mode.base == "held", "`hold`": bool(mode.holds), "`at: {on: floor}`": mode.on_floor, "`at_in`": bool(mode.at_in),
    }
    found = next((key for key, used in unsupported.items() if used), None)
    if found is not None:
        scope.error(
            Code.REFERENCE, f"mode `{name}` of `{node.name}` has {found}, which a nested assembly does not support", path,
            help="use a mode with another base, and set its height in `at` of the component",
        )
    return mode if found is None else None
