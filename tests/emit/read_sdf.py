"""An independent reader of SDF models: it computes kinematics by the rules of the format, in numpy, without code of thingc.

The pose of a link is in the model's frame, that of a joint in its child, that of a frame in the element it is attached to, unless
`relative_to` specifies another frame. A joint is at 0 in the poses of the file. Its axes are in its own frame, which moves with the
child; the first of two axes moves with the parent."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

Array = Any
Value = Any
"""Position of a joint: an angle [rad] or a length [m], two angles for `universal`, a 3 x 3 rotation for `ball`."""


@dataclass(frozen=True)
class Joint:
    """A joint: its unit axes in its own frame, and the pitch of a screw per turn [m]."""

    name: str
    type: str
    parent: str
    child: str
    axes: list[Array]
    pitch: float

    def motion(self, value: Value) -> Array:
        """Motion of the joint's frame in the parent, relative to its pose at 0."""
        moved = np.eye(4)
        if self.type in ("revolute", "continuous", "screw"):
            moved[:3, :3] = Rotation.from_rotvec(value * self.axes[0]).as_matrix()
            moved[:3, 3] = self.pitch * value / (2.0 * np.pi) * self.axes[0]
        elif self.type == "prismatic":
            moved[:3, 3] = value * self.axes[0]
        elif self.type == "universal":
            turns = [Rotation.from_rotvec(angle * axis).as_matrix() for angle, axis in zip(value, self.axes, strict=True)]
            moved[:3, :3] = turns[0] @ turns[1]
        elif self.type == "ball":
            moved[:3, :3] = value
        else:
            assert self.type == "fixed", self.type
        return moved

    @property
    def zero(self) -> Value:
        return {"universal": (0.0, 0.0), "ball": np.eye(3)}.get(self.type, 0.0)


class Model:
    """The single model of a file."""

    def __init__(self, text: str | bytes) -> None:
        self.root = ElementTree.fromstring(text)
        (self.model,) = self.root.findall("model")
        self.links = [link.attrib["name"] for link in self.model.findall("link")]
        self.frames = {frame.attrib["name"]: frame.attrib["attached_to"] for frame in self.model.findall("frame")}
        self.joints = [_joint(element) for element in self.model.findall("joint")]
        self._own = {"__model__": (None, np.eye(4))}
        for tag, default in (("link", "__model__"), ("joint", "child"), ("frame", "attached_to")):
            for element in self.model.findall(tag):
                relative_to = default if tag == "link" else element.attrib.get(default) or element.findtext(default)
                pose = element.find("pose")
                if pose is not None:
                    relative_to = pose.attrib.get("relative_to", relative_to)
                assert element.attrib["name"] not in self._own, "names are unique over links, joints and frames"
                self._own[element.attrib["name"]] = (relative_to, matrix(pose))

    def joint(self, name: str) -> Joint:
        return next(joint for joint in self.joints if joint.name == name)

    def element(self, name: str) -> ElementTree.Element:
        """The element with this name."""
        return next(element for element in self.model if element.attrib.get("name") == name)

    def at_zero(self, name: str) -> Array:
        """Pose of a link, joint or frame in the model frame, as written in the file."""
        pose = np.eye(4)
        step: str | None = name
        while step is not None:
            step, own = self._own[step]
            pose = own @ pose
        return pose

    def placed(self, q: Mapping[str, Value], base: Array | None = None) -> tuple[dict[str, Array], dict[str, Array]]:
        """Compute poses of links and frames in the world at joint positions `q`.

        Joints that `q` does not contain are at 0. The second result has, for each joint that closes a loop, the pose of its child
        according to the joint, in the pose of the child according to the tree. `base` is the pose of a floating base."""
        world = {"world": np.eye(4)}
        canonical = self.model.attrib["canonical_link"]
        if not {"root", "root_0"} & {joint.name for joint in self.joints}:
            world[canonical] = self.at_zero(canonical) if base is None else base
        at_zero = {name: self.at_zero(name) for name in (*self.links, *(joint.name for joint in self.joints))} | {"world": np.eye(4)}
        apart: dict[str, Array] = {}
        for joint in self.joints:
            J = at_zero[joint.name]
            moved = J @ joint.motion(q.get(joint.name, joint.zero)) @ np.linalg.inv(J) @ at_zero[joint.child]
            there = world[joint.parent] @ np.linalg.inv(at_zero[joint.parent]) @ moved
            if joint.child in world:
                apart[joint.name] = np.linalg.inv(world[joint.child]) @ there
            world.setdefault(joint.child, there)
        assert {*world} == {"world", *self.links}, "everything hangs on something"
        for name, link in self.frames.items():
            world[name] = world[link] @ np.linalg.inv(at_zero[link]) @ self.at_zero(name)
        return world, apart

    def inertia(self, link: str) -> tuple[float, Array, Array]:
        """Mass [kg], centre of mass [m] and inertia about it [kg m^2] of a link, both in the axes of the link."""
        inertial = self.element(link).find("inertial")
        assert inertial is not None
        pose, moments = matrix(inertial.find("pose")), inertial.find("inertia")
        assert moments is not None
        i = {one.tag: float(one.text or "nan") for one in moments}
        own = np.array([[i["ixx"], i["ixy"], i["ixz"]], [i["ixy"], i["iyy"], i["iyz"]], [i["ixz"], i["iyz"], i["izz"]]])
        return float(inertial.findtext("mass") or "nan"), pose[:3, 3], pose[:3, :3] @ own @ pose[:3, :3].T

    def mimics(self) -> dict[tuple[str, str], tuple[str, str, float, float]]:
        """Mimics by joint and axis: leader, axis of the leader, multiplier and offset."""
        return {
            (joint.attrib["name"], axis.tag): (
                mimic.attrib["joint"], mimic.attrib["axis"], number(mimic, "multiplier"),
                number(mimic, "offset") - number(mimic, "multiplier") * number(mimic, "reference"),
            )
            for joint in self.model.findall("joint") for axis in joint for mimic in axis.findall("mimic")
        }


def number(element: ElementTree.Element, tag: str) -> float:
    """The number in a child element."""
    return float(element.findtext(tag) or "nan")


def matrix(pose: ElementTree.Element | None) -> Array:
    """Convert a pose (x y z and extrinsic roll, pitch, yaw) to a 4 x 4 matrix."""
    placed = np.eye(4)
    if pose is not None:
        values = [float(word) for word in (pose.text or "").split()]
        placed[:3, 3], placed[:3, :3] = values[:3], Rotation.from_euler("xyz", values[3:]).as_matrix()
    return placed


def _joint(element: ElementTree.Element) -> Joint:
    axes = [np.array([float(word) for word in (axis.findtext("xyz") or "").split()]) for axis in element if axis.tag.startswith("axis")]
    parent, child = element.findtext("parent") or "", element.findtext("child") or ""
    pitch = float(element.findtext("screw_thread_pitch") or 0.0)
    assert all(abs(np.linalg.norm(axis) - 1.0) < 1e-12 for axis in axes)
    return Joint(element.attrib["name"], element.attrib["type"], parent, child, axes, pitch)
