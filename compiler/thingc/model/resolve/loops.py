"""What a mode says of loops: the further mounts that it holds to the world, and the joints it wants loops cut at."""

from __future__ import annotations

from fnmatch import fnmatchcase

from thingc.base.diagnostics import Code
from thingc.base.source import Path
from thingc.documents.spec.modes import HoldSpec
from thingc.model.resolve import references
from thingc.model.resolve.coordinates import CoordinateName
from thingc.model.resolve.defaults import DefaultLayers
from thingc.model.resolve.document_scope import DocumentScope
from thingc.model.resolve.references import report_unmatched, suggested
from thingc.model.resolve.scope import Scope
from thingc.model.resolve.types import Cut, Hold


def holds(table: DocumentScope, scope: Scope, layers: DefaultLayers) -> tuple[Hold, ...]:
    """The holds of a mode, key by key over what it extends. One that is wrong is left out (reported)."""
    merged: dict[str, tuple[object, Path]] = {}
    for model, path in reversed(layers.items):
        for text, said in (getattr(model, "hold", None) or {}).items():
            merged[text] = (said, (*path, "hold", text))
    held: list[Hold] = []
    for text, (said, path) in merged.items():
        reference = references.root(table, scope, text, path, key=True)
        pose, turns = None, False
        if isinstance(said, HoldSpec):
            turns = said.carries == "force"
            pose = scope.pose(said, path) if said.at is None else None
            if said.at is None and pose is None:
                continue
        if reference is not None:
            held.append(Hold(mount=reference, pose=pose, origin=scope.origin(path, key=True), turns=turns))
    return tuple(held)


def cuts(table: DocumentScope, scope: Scope, layers: DefaultLayers) -> tuple[Cut, ...]:
    """The joints that a mode wants loops cut at, in the order in which it names them; fixed ones only where they close a loop. One that is
    wrong is left out (reported)."""
    said = layers.pick("cut")
    if said is None:
        return ()
    patterns, path = said
    joints = dict(table.all_joints())
    chosen: dict[str, Path] = {}
    for index, pattern in enumerate(patterns):
        at = (*path, index)
        if pattern in patterns[:index]:
            scope.error(Code.CUT, f"`{pattern}` stands twice in `cut`", at, help="take one of the two out: a joint is cut once")
            continue
        fitting = [CoordinateName(pattern)] if pattern in joints else [name for name in joints if fnmatchcase(name.joint, pattern)]
        known = [(name.joint, joint) for name in fitting if (joint := joints[name]) is not None]
        cuttable = [name for name, joint in known if joint.twist is not None or joint.loop]
        for name in cuttable:
            chosen.setdefault(name, at)
        moving = [name for name, joint in joints.items() if joint is not None and joint.twist is not None]
        if cuttable or (fitting and not known):
            continue
        if known:
            fixed = "is fixed: it makes" if pattern in joints else "fits fixed joints alone: they make"
            message = f"`{pattern}` {fixed} one link of two components, and no loop is cut there"
            scope.error(Code.CUT, message, at, help=suggested(pattern, moving, what="joints"))
        elif not table.unsure_joints():
            report_unmatched(scope, pattern, moving, at, "joint")
    return tuple(Cut(joint=CoordinateName(name).path, origin=scope.origin(at)) for name, at in chosen.items())
