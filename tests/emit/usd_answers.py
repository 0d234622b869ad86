"""Answers of `read_usd` for the conformance benchmark."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from pxr import UsdPhysics
from scipy.spatial.transform import Rotation

from emit.read_usd import Array, Joint, Model
from emit.sdf_answers import of_chains

NAMES = {"PhysicsRevoluteJoint": "angular", "PhysicsPrismaticJoint": "linear"}


def answer(asked: dict[str, Any]) -> dict[str, Any]:
    """Answer like the readers in `benchmarks/conformance`: a floating base is at the origin."""
    model = Model(Path(asked["file"]).read_text())
    bodies = {link: model.inertia(link) for link in model.links}
    free = asked["free"]
    root = next(link for link, prim in model.links.items() if prim.HasAPI(UsdPhysics.ArticulationRootAPI))

    def frames(values: Array) -> dict[str, Array]:
        q: dict[str, Any] = {}
        for k, (name, axis, value) in enumerate(zip(asked["joints"], asked["axes"], values, strict=True)):
            moves = model.joints[name].free
            if moves is None and axis == 0:
                q[name] = Rotation.from_euler("xyz", values[k : k + 3]).as_matrix()
            elif moves is not None:
                q.setdefault(name, dict.fromkeys(moves, 0.0))[moves[axis]] = value
        poses, _ = model.placed(q)
        start = np.linalg.inv(poses[root]) if free else np.eye(4)
        poses = {link: start @ pose for link, pose in poses.items()}
        return poses | {frame: poses[link] @ pose for link in model.links for frame, pose in model.frames(link).items()}

    coordinates = [(model.joints[name], axis) for name, axis in zip(asked["joints"], asked["axes"], strict=True)]
    return of_chains(asked, bodies, frames) | {
        "mimic": [mimic(joint) for joint, _ in coordinates], "range": [ends(joint, axis) for joint, axis in coordinates],
        "effort": [effort(joint, axis) for joint, axis in coordinates],
    }


def mimic(joint: Joint) -> tuple[str, float, float] | None:
    """Leader, multiplier and offset [rad or m] of a joint, or None."""
    leaders = joint.prim.GetRelationship("newton:mimicJoint").GetTargets()
    if not leaders:
        return None
    offset = joint.prim.GetAttribute("newton:mimicCoef0").Get()
    turns = joint.prim.IsA(UsdPhysics.RevoluteJoint)
    return leaders[0].name, joint.prim.GetAttribute("newton:mimicCoef1").Get(), math.radians(offset) if turns else offset


def ends(joint: Joint, axis: int) -> tuple[float, float] | None:
    """Limits of one coordinate [rad or m]."""
    if joint.free is None:
        return None
    name = joint.free[axis]
    if joint.prim.GetTypeName() in NAMES:
        kind = UsdPhysics.RevoluteJoint if name.startswith("rot") else UsdPhysics.PrismaticJoint
        low, high = kind(joint.prim).GetLowerLimitAttr().Get(), kind(joint.prim).GetUpperLimitAttr().Get()
    else:
        limit = UsdPhysics.LimitAPI(joint.prim, name)
        low, high = limit.GetLowAttr().Get(), limit.GetHighAttr().Get()
    return (math.radians(low), math.radians(high)) if name.startswith("rot") else (low, high)


def effort(joint: Joint, axis: int) -> float:
    """Effort limit of the drive of a coordinate, or 0 without a drive."""
    name = NAMES.get(joint.prim.GetTypeName(), joint.free[axis] if joint.free is not None else "")
    if not joint.prim.HasAPI(UsdPhysics.DriveAPI, name):
        return 0.0
    return float(UsdPhysics.DriveAPI(joint.prim, name).GetMaxForceAttr().Get())
