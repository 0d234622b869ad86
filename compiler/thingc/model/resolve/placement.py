"""Check the placement of components: every component except the base must be placed by exactly one `attach`, `at` or joint."""

from __future__ import annotations

from functools import partial

from thingc.base.diagnostics import Code, Note
from thingc.base.safe_text import quote_names
from thingc.base.source import Span
from thingc.base.units import ANGLE, LENGTH
from thingc.documents.spec.assembly import AttachSpec
from thingc.model.resolve import references
from thingc.model.resolve.document_scope import ComponentScope, DocumentScope, ResolveRun
from thingc.model.resolve.types import At, Attach

Places = dict[str, list[tuple[str, Span]]]
"""Descriptions of placements (`` `attach` ``, `` joint `yaw` ``) and their locations, by component name."""


def own_placements(context: ResolveRun, table: DocumentScope, places: Places) -> dict[str, Attach | At | None]:
    """Return the placements that components specify by `attach` or `at`.

    Invalid placements are reported, and their components remain unplaced.
    """
    placements: dict[str, Attach | At | None] = {}
    component_inputs = context.component_inputs(table)
    for node in table.nodes.values():
        if node.spec.attach is None and node.spec.at is None:
            continue
        key = "attach" if node.spec.attach is not None else "at"
        place = ("placement", table.document.relative, *context.route, node.name)
        inputs = (context.values(node.scope, f"{key} {node.name}", getattr(node.spec, key)), component_inputs, node.spec.keep)
        placement: Attach | At | None = context.sound(place, inputs, partial(_attach if key == "attach" else _at, table, node))
        places.setdefault(node.name, []).append((f"`{key}`", node.scope.span((*node.path, key), key=True)))
        placements[node.name] = placement
        node.unplaced = node.unplaced or placement is None
    return placements


def _attach(table: DocumentScope, node: ComponentScope) -> Attach | None:
    spec, scope = node.spec.attach, node.scope
    path = (*node.path, "attach")
    turn = gap = 0.0
    if isinstance(spec, AttachSpec):
        mine = references.own_mount(node, scope, spec.mount, (*path, "mount"))
        to_text, to_path = spec.to, (*path, "to")
        turn = scope.number(spec.turn, (*path, "turn"), ANGLE, "`turn`") or 0.0
        gap = scope.number(spec.gap, (*path, "gap"), LENGTH, "`gap`") or 0.0
    elif spec:
        name, to_text = next(iter(spec.items()))
        to_path = (*path, name)
        if _is_swapped(table, node, name):
            mine_meant = to_text.removeprefix(f"{node.name}.")
            scope.error(
                Code.REFERENCE, f"`attach` must begin with a mount of `{node.name}`, found `{name}`",
                to_path, key=True, help=f"write `{{{mine_meant}: {name}}}`" if "." not in mine_meant else None,
            )
            return None
        mine = references.own_mount(node, scope, name, to_path, key=True)
    else:
        return None
    to = references.mount(table, scope, to_text, to_path)
    if to is None or mine is None:
        table.loose.extend(end for end in (mine, to) if end is not None)
        return None
    if to.path[0] == node.name:
        scope.error(Code.PLACED_ON_ITSELF, f"`{node.name}` is attached to itself", to_path, help="use a mount of another component")
        return None
    return Attach(mount=mine, to=to, turn=turn, gap=gap, origin=scope.origin(path, key=True), keep=node.spec.keep)


def _is_swapped(table: DocumentScope, node: ComponentScope, name: str) -> bool:
    """Return whether the two references of `attach` are swapped: the first reference is a mount of another component."""
    first, dot, _ = name.partition(".")
    return bool(dot) and first in table.nodes and first != node.name and (node.table is None or first not in node.table.nodes)


def _at(table: DocumentScope, node: ComponentScope) -> At | None:
    spec, scope = node.spec.at, node.scope
    if spec is None:
        return None
    path = (*node.path, "at")
    to = references.mount(table, scope, spec.in_, (*path, "in"))
    pose = scope.pose(spec, path)
    if to is None or pose is None:
        table.loose.extend([to] if to is not None else [])
        return None
    if to.path[0] == node.name:
        scope.error(
            Code.PLACED_ON_ITSELF, f"`{node.name}` is placed relative to itself", (*path, "in"), help="use a frame of another component",
        )
        return None
    return At(to=to, pose=pose, origin=scope.origin(path, key=True), keep=node.spec.keep)


def check(table: DocumentScope, places: Places, *, unknown_child: bool) -> None:
    """Find the base component of a document. Afterwards, a component that is placed twice, and every additional base, counts as unplaced.

    Nothing is reported for components whose placement may be invalid because of another error. `unknown_child` is True if the child of a
    joint could not be read. Missing placements are then not reported, because this joint may place any component.
    """
    uncertain = {
        node.name for node in table.nodes.values()
        if node.incomplete and any(table.doubts.touch((*node.path, key)) for key in ("attach", "at"))
    }
    free = [name for name in table.nodes if name not in places and name not in uncertain]
    joints = [joint for joint in table.joints.values() if joint is not None and not joint.loop]
    # the document may have swapped parent and child of joints whose parent is unplaced
    swapped = {joint.child.path[0]: joint for joint in joints if joint.parent.path and joint.parent.path[0] in free[1:]}
    for name, placements in places.items():
        node = table.nodes[name]
        if len(placements) < 2 or name in uncertain:
            continue
        node.unplaced = True
        (first, first_span), (second, second_span) = placements[0], placements[1]
        message, help = f"`{name}` is placed by both {first} and {second}", "remove one of the two placements" + _loop_hint(second)
        if name in swapped and (parent := swapped[name].parent.path[0]) in free:
            joint = swapped[name]
            help = f"swap the mounts of joint `{joint.name.joint}`: `parent: {joint.child.text}`, `child: {joint.parent.text}`"
            table.nodes[parent].unplaced = True
            free.remove(parent)
        table.scope.report.add(
            Code.PLACED_TWICE, message, second_span, help=help, path=f"components.{name}", notes=[
                Note(message=f"`{name}` is placed by {first} here", span=first_span),
                *(Note(message=f"`{name}` is also placed by {placement} here", span=span) for placement, span in placements[2:]),
            ],
        )
    if free:
        table.base = free[0]
    if not unknown_child and not table.unbuilt:
        if not free and table.nodes and not uncertain:
            _report_no_base(table, places)
        if len(free) > 1:
            _report_bases(table, free)
    for name in free[1:]:
        table.nodes[name].unplaced = True


def _report_no_base(table: DocumentScope, places: Places) -> None:
    joint = next((placement for ways in reversed(places.values()) for placement, _ in ways if "joint" in placement), "")
    table.scope.error(
        Code.NO_BASE, "the assembly has no base component", ("components",), key=True,
        help=f"remove the placement of one component, for example of `{next(iter(table.nodes))}`{_loop_hint(joint)}",
        notes=[Note(message=f"`{name}` is placed by {ways[0][0]}", span=ways[0][1]) for name, ways in [*places.items()][:4]],
    )


def _loop_hint(way: str) -> str:
    """Return the end of a help text for the description of a placement. For joints other than free joints, suggest to close a loop."""
    return f", or add `loop: true` to {way}" if way.startswith("joint ") else ""


def _report_bases(table: DocumentScope, free: list[str]) -> None:
    message = f"expected one unplaced component (the base), found {len(free)}: {quote_names(free, 6)}"
    second = table.nodes[free[1]]
    table.scope.report.add(
        Code.TWO_BASES, message, second.scope.span(second.path, key=True), path=f"components.{free[1]}",
        help="place every component except the base with `attach`, `at` or a joint", notes=[
            Note(message=f"`{name}` is not placed either", span=table.nodes[name].scope.span(table.nodes[name].path, key=True))
            for name in [free[0], *free[2:6]]
        ],
    )
