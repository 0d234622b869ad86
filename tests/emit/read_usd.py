"""A reader of UsdPhysics by its rules, on usd-core, which knows nothing of how files are written: links, joints, masses."""

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
    """A pose of USD's, whose vectors are rows, as columns have it."""
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
    """A joint: its name, the links it connects (`world`), its frame on either, and what may move (None of a ball: anything turns)."""

    prim: Any
    name: str
    parent: str
    child: str
    frames: tuple[Array, Array]
    free: list[str] | None
    excluded: bool

    def motion(self, q: Any) -> Array:
        """The second frame in the first at q: a number [rad or m], several by what moves, or the turn of a ball in its child's axes."""
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
    """A layer as it is read."""

    def __init__(self, text: str) -> None:
        layer = Sdf.Layer.CreateAnonymous(".usda")
        assert layer.ImportFromString(text)
        self.stage = Usd.Stage.Open(layer)
        self.root = self.stage.GetDefaultPrim()
        self.links = {prim.GetName(): prim for prim in self.root.GetChildren() if prim.HasAPI(UsdPhysics.RigidBodyAPI)}
        self.joints = {prim.GetName(): self._joint(prim) for prim in self.stage.Traverse() if prim.IsA(UsdPhysics.Joint)}

    def faults(self) -> list[str]:
        """What USD's own validators say, those of UsdPhysics among them."""
        found = UsdValidation.ValidationContext(UsdValidation.ValidationRegistry().GetOrLoadAllValidators()).Validate(self.stage)
        return [fault.GetMessage() for fault in found]

    def at(self, path: str) -> Any:
        """A prim below the default one."""
        return self.stage.GetPrimAtPath(self.root.GetPath().AppendPath(path))

    def at_zero(self, path: str) -> Array:
        """Where the file has a prim."""
        return matrix(UsdGeom.Xformable(self.at(path)).ComputeLocalToWorldTransform(Usd.TimeCode.Default()))

    def frames(self, link: str) -> dict[str, Array]:
        """The frames on a link, in it."""
        found = [prim for prim in self.links[link].GetChildren() if prim.IsA(UsdGeom.Xform)]
        return {prim.GetName(): matrix(UsdGeom.Xformable(prim).GetLocalTransformation()) for prim in found}

    def inertia(self, link: str) -> tuple[float, Array, Array]:
        """Mass, centre, and inertia about it in the axes of the link."""
        mass = UsdPhysics.MassAPI(self.links[link])
        turn = Gf.Quatd(mass.GetPrincipalAxesAttr().Get())
        assert abs(turn.GetLength() - 1.0) < 1e-6
        axes = matrix(Gf.Matrix3d(turn))
        assert np.linalg.det(axes) > 0.0
        inertia = axes @ np.diag(mass.GetDiagonalInertiaAttr().Get()) @ axes.T
        return mass.GetMassAttr().Get(), np.array(mass.GetCenterOfMassAttr().Get()), inertia

    def placed(self, q: Mapping[str, Any]) -> tuple[dict[str, Array], dict[str, Array]]:
        """Where links are with joints at q (by name, 0 where it says nothing), and how far those are apart that close loops and hold: the
        frame on the child in that on the parent. The root of a base that floats is where the file has it."""
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
