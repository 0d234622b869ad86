"""What a mode says of loops: the further mounts that it holds to the world, and the joints it wants loops cut at."""

from __future__ import annotations

from fnmatch import fnmatchcase

from thingc.diagnostics import Code
from thingc.resolve import references
from thingc.resolve.layers import Layers
from thingc.resolve.model import CoordinateName, Cut, Hold
from thingc.resolve.references import GLOB, suggested
from thingc.resolve.scope import Scope
from thingc.resolve.table import Table
from thingc.source import Path
from thingc.spec.modes import HoldSpec


def holds(table: Table, scope: Scope, layers: Layers) -> tuple[Hold, ...]:
    """The holds of a mode, key by key over what it extends. One that is wrong is left out (reported)."""
    merged: dict[str, tuple[object, Path]] = {}
    for model, path in reversed(layers.items):
        for text, said in (getattr(model, "hold", None) or {}).items():
            merged[text] = (said, (*path, "hold", text))
    found: list[Hold] = []
    for text, (said, path) in merged.items():
        reference = references.root(table, scope, text, path, key=True)
        pose, turns = None, False
        if isinstance(said, HoldSpec):
            turns = said.carries == "force"
            pose = scope.pose(said.xyz, (*path, "xyz"), said.rpy, (*path, "rpy")) if said.at is None else None
            if said.at is None and pose is None:
                continue
        if reference is not None:
            found.append(Hold(mount=reference, pose=pose, origin=scope.origin(path, key=True), turns=turns))
    return tuple(found)


def cuts(table: Table, scope: Scope, layers: Layers) -> tuple[Cut, ...]:
    """The joints that a mode wants loops cut at, in document order."""
    said = layers.pick("cut")
    if said is None:
        return ()
    patterns, path = said
    joints = dict(table.all_joints())
    chosen: dict[CoordinateName, Path] = {}
    for index, pattern in enumerate(patterns):
        at = (*path, index)
        if pattern in joints:
            chosen.setdefault(CoordinateName(pattern), at)
            continue
        fitting = [name for name, joint in joints.items() if joint is not None and fnmatchcase(name.joint, pattern)]
        for name in fitting:
            chosen.setdefault(name, at)
        if fitting or table.unsure_joints():
            continue
        moving = [name for name, joint in joints.items() if joint is not None and joint.twist is not None]
        help = suggested(pattern, moving, what="joints")
        if GLOB.search(pattern):
            scope.error(Code.NO_MATCH, f"pattern `{pattern}` fits no joint", at, help=help)
        else:
            scope.error(Code.UNKNOWN_JOINT, f"there is no joint `{pattern}`", at, help=help)
    return tuple(
        Cut(joint=CoordinateName(name.joint).path, origin=scope.origin(chosen[name]))
        for name, joint in joints.items() if name in chosen and joint is not None and not name.number
    )
