"""An independent reader of UsdPhysics, based on usd-core: links, joints and masses by the rules of the schema."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics, UsdValidation
from scipy.spatial.transform import Rotation

Array = Any

LOCKED = "transX", "transY", "transZ", "rotX", "rotY", "rotZ"


def matrix(pose: Any) -> Array:
    """Convert a pose of USD, which uses row vectors, to a matrix for column vectors."""
    return np.array(pose).T


def framed(position: Any, turn: Any) -> Array:
    return matrix(Gf.Matrix4d(Gf.Rotation(Gf.Quatd(turn)), Gf.Vec3d(position)))


def turned(axis: str, angle: float) -> Array:
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler(axis.lower(), angle).as_matrix()
    return pose


def shifted(axis: str, length: float) -> Array:
    pose = np.eye(4)
    pose["XYZ".index(axis), 3] = length
    return pose


@dataclass
class Joint:
    """A joint: its name, the links it connects (or `world`), its frame on each, and its free axes (None for a ball joint, which is free
    to rotate)."""

    prim: Any
    name: str
    parent: str
    child: str
    frames: tuple[Array, Array]
    free: list[str] | None
    excluded: bool

    def motion(self, q: Any) -> Array:
        """Pose of the second frame in the first at `q`.

        `q` is a number [rad or m], a mapping of axes to numbers, or, for a ball joint, a rotation in the axes of the child."""
        if self.free is None:
            pose, axes = np.eye(4), self.frames[1][:3, :3]
            pose[:3, :3] = axes.T @ (np.eye(3) if q is None else q) @ axes
            return pose
        values = q if isinstance(q, Mapping) else dict.fromkeys(self.free, q)
        assert set(values) == set(self.free), (self.name, values, self.free)
        pose = np.eye(4)
        for name in LOCKED:
            if values.get(name):
                pose = pose @ (turned if name.startswith("rot") else shifted)(name[-1], values[name])
        return pose


class Model:
    """A stage read from the text of a layer."""

    def __init__(self, text: str) -> None:
        layer = Sdf.Layer.CreateAnonymous(".usda")
        assert layer.ImportFromString(text)
        self.stage = Usd.Stage.Open(layer)
        self.root = self.stage.GetDefaultPrim()
        self.links = {prim.GetName(): prim for prim in self.root.GetChildren() if prim.HasAPI(UsdPhysics.RigidBodyAPI)}
        self.joints = {prim.GetName(): self._joint(prim) for prim in self.stage.Traverse() if prim.IsA(UsdPhysics.Joint)}

    def faults(self) -> list[str]:
        """Messages of all validators of USD, including those of UsdPhysics."""
        found = UsdValidation.ValidationContext(UsdValidation.ValidationRegistry().GetOrLoadAllValidators()).Validate(self.stage)
        return [fault.GetMessage() for fault in found]

    def at(self, path: str) -> Any:
        """The prim at a path relative to the default prim."""
        return self.stage.GetPrimAtPath(self.root.GetPath().AppendPath(path))

    def at_zero(self, path: str) -> Array:
        """World transform of a prim as written in the file."""
        return matrix(UsdGeom.Xformable(self.at(path)).ComputeLocalToWorldTransform(Usd.TimeCode.Default()))

    def frames(self, link: str) -> dict[str, Array]:
        """The frames on a link, in the link's frame."""
        found = [prim for prim in self.links[link].GetChildren() if prim.IsA(UsdGeom.Xform)]
        return {prim.GetName(): matrix(UsdGeom.Xformable(prim).GetLocalTransformation()) for prim in found}

    def inertia(self, link: str) -> tuple[float, Array, Array]:
        """Mass, centre of mass, and inertia about it in the axes of the link."""
        mass = UsdPhysics.MassAPI(self.links[link])
        turn = Gf.Quatd(mass.GetPrincipalAxesAttr().Get())
        assert abs(turn.GetLength() - 1.0) < 1e-6
        axes = matrix(Gf.Matrix3d(turn))
        assert np.linalg.det(axes) > 0.0
        inertia = axes @ np.diag(mass.GetDiagonalInertiaAttr().Get()) @ axes.T
        return mass.GetMassAttr().Get(), np.array(mass.GetCenterOfMassAttr().Get()), inertia

    def placed(self, q: Mapping[str, Any]) -> tuple[dict[str, Array], dict[str, Array]]:
        """Compute the world poses of links at joint positions `q` (by name, 0 by default), and the errors of closing joints.

        The error of a joint that closes a loop, or holds a mount, is the pose of its frame on the child in its frame on the parent. The
        root link of a floating base is at its pose in the file."""
        tree = {joint.child: joint for joint in self.joints.values() if not joint.excluded}
        poses: dict[str, Array] = {"world": matrix(UsdGeom.Xformable(self.root).ComputeLocalToWorldTransform(Usd.TimeCode.Default()))}

        def where(link: str) -> Array:
            if link not in poses:
                joint = tree.get(link)
                if joint is None:
                    poses[link] = self.at_zero(link)
                else:
                    motion = joint.motion(q.get(joint.name, None if joint.free is None else dict.fromkeys(joint.free, 0.0)))
                    poses[link] = where(joint.parent) @ joint.frames[0] @ motion @ np.linalg.inv(joint.frames[1])
            return poses[link]

        for link in self.links:
            where(link)
        closing = [joint for joint in self.joints.values() if joint.excluded]
        apart = {
            joint.name: np.linalg.inv(poses[joint.parent] @ joint.frames[0]) @ poses[joint.child] @ joint.frames[1] for joint in closing
        }
        return poses, apart

    def _joint(self, prim: Any) -> Joint:
        joint = UsdPhysics.Joint(prim)
        sides = []
        for relation, position, turn in (
            (joint.GetBody0Rel(), joint.GetLocalPos0Attr(), joint.GetLocalRot0Attr()),
            (joint.GetBody1Rel(), joint.GetLocalPos1Attr(), joint.GetLocalRot1Attr()),
        ):
            (path,) = relation.GetTargets()
            sides.append(("world" if path == self.root.GetPath() else path.name, framed(position.Get(), turn.Get())))
        free: list[str] | None = []
        if prim.IsA(UsdPhysics.RevoluteJoint):
            free = [f"rot{UsdPhysics.RevoluteJoint(prim).GetAxisAttr().Get()}"]
        elif prim.IsA(UsdPhysics.PrismaticJoint):
            free = [f"trans{UsdPhysics.PrismaticJoint(prim).GetAxisAttr().Get()}"]
        elif prim.IsA(UsdPhysics.SphericalJoint):
            free = None
        elif not prim.IsA(UsdPhysics.FixedJoint):
            limits = {name: UsdPhysics.LimitAPI(prim, name) for name in LOCKED}
            free = [name for name, limit in limits.items() if limit.GetLowAttr().Get() <= limit.GetHighAttr().Get()]
        excluded = joint.GetExcludeFromArticulationAttr().Get()
        return Joint(prim, prim.GetName(), sides[0][0], sides[1][0], (sides[0][1], sides[1][1]), free, bool(excluded))
