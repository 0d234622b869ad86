"""Resolve the frames of an SDF model: compute the pose of each frame in the model, and find the link to which the frame is attached.

See http://sdformat.org/tutorials?tut=pose_frame_semantics.
"""

from __future__ import annotations

import math

from msgspec.structs import replace

from thingc.base.diagnostics import Code, Note
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.graphs import format_cycle
from thingc.base.pose import NO_POSE, Pose, make_pose
from thingc.base.suggestions import did_you_mean
from thingc.tools.importing.xml_source import SourceElement
from thingc.tools.importing.xml_values import ChildValues

WORLD = "world"
MODEL = "__model__"


class NamedFrame(FrozenStruct):
    """A named frame of an SDF model. `element` is the XML element of a link, joint, frame or model.

    `scope` is the key of the enclosing model, which is an empty string for the outermost model. `relative_to` is the key of the frame to
    which the pose is relative.
    """

    element: SourceElement
    scope: str
    relative_to: str = ""


class Frames:
    """The frames of an SDF model and its nested models, keyed by full name, such as `arm::hand`.

    Errors are reported by methods of `values`.
    """

    def __init__(self, model: SourceElement, values: ChildValues) -> None:
        self.model, self.values = model, values
        self.named: dict[str, NamedFrame] = {}
        self.poses: dict[str, Pose] = {"": NO_POSE}
        self.links: dict[str, str | None] = {}
        self.offsets: dict[str, Pose] = {}
        self._find(model, "")
        self.named = {key: replace(frame, relative_to=self._relative_to(frame)) for key, frame in self.named.items()}
        for key in self.named:
            self._put(key)

    def all(self, tag: str) -> list[tuple[str, NamedFrame]]:
        """Return all frames whose XML element has this tag, such as `link` or `joint`."""
        return [(key, frame) for key, frame in self.named.items() if frame.element.tag == tag]

    def _find(self, model: SourceElement, scope: str) -> None:
        """Collect the named frames of a model and of its nested models."""
        for child in model.children:
            if child.tag not in ("link", "frame", "joint", "model") or (name := self.values.word(child, "name")) is None:
                continue
            key = key_of(name, scope)
            if key in self.named or not key or key == WORLD:
                notes = [Note(message="the first element is here", span=self.named[key].element.place("name"))] if key in self.named else []
                what = f"two elements of the model are named `{name}`" if notes else f"`{name}` is a reserved name of SDF"
                self.values.report.add(Code.SOURCE_TREE, what, child.place("name"), notes=notes, help="rename the element")
                continue
            self.named[key] = NamedFrame(element=child, scope=scope)
            if child.tag == "model":
                self._find(child, key)

    def _relative_to(self, frame: NamedFrame) -> str:
        """Return the key of the frame in which the pose of `frame` is expressed.

        By default, this is the frame to which `frame` is attached.
        """
        pose = self.values.one(frame.element, "pose")
        for attribute in ("relative_to", "frame"):  # before SDF 1.7, the attribute was called `frame`
            if pose is not None and pose.attributes.get(attribute, "").strip():
                return self.find_frame(pose, attribute, pose.attributes[attribute], frame.scope)
        return self._carrier(frame)

    def _carrier(self, frame: NamedFrame) -> str:
        """Return the key of the frame to which `frame` is attached.

        A joint is attached to its child link, and a `<frame>` element to the frame in its attribute `attached_to`. By default, a frame is
        attached to the enclosing model.
        """
        attribute = {"joint": "child", "frame": "attached_to"}.get(frame.element.tag)
        name = None if attribute is None else self.values.text_of(frame.element, attribute)
        return frame.scope if attribute is None or not name else self.find_frame(frame.element, attribute, name, frame.scope)

    def find_frame(self, element: SourceElement, attribute: str, name: str, scope: str) -> str:
        """Return the key of the frame to which a name in the model `scope` refers.

        If the frame does not exist, report an error and return `scope`.
        """
        key = key_of(name.strip(), scope)
        if key and key not in self.named:
            inside = [one.removeprefix(f"{scope}::") for one, frame in self.named.items() if frame.scope == scope]
            help = did_you_mean(name, inside, what="names")
            self.values.fault(element, attribute, f"there is no link, joint, frame or model `{name}`", help)
            return scope
        return key

    def _put(self, key: str) -> None:
        """Compute the pose of a frame in the outermost model, and the poses of all frames on which this pose depends."""
        way: dict[str, NamedFrame] = {}
        while key not in self.poses:
            if key in way:
                circle = format_cycle([*way][[*way].index(key) :])
                message = f"the poses form a cycle: {circle}"
                self.values.report.add(
                    Code.SOURCE_TREE, message, way[key].element.where, help="make one of the poses relative to the model",
                )
                self.poses[key] = NO_POSE
                break
            way[key] = self.named[key]
            key = way[key].relative_to
        for key, frame in reversed(way.items()):
            self.poses[key] = self.poses[frame.relative_to] @ self.pose_of(key, frame.element)

    def pose_of(self, key: str, element: SourceElement) -> Pose:
        """Return the pose of an element relative to its reference frame.

        If a model has the attribute `placement_frame`, its `<pose>` is the pose of that frame.
        """
        name, pose, inner = element.attributes.get("placement_frame", "").strip(), self.read_pose(element), NO_POSE
        if element.tag == "model" and name and key not in self.offsets:
            at, way = self.find_frame(element, "placement_frame", name, key), set[str]()
            while at != key and at not in way:  # cycles are reported elsewhere
                way.add(at)
                inner = self.pose_of(at, self.named[at].element) @ inner
                at = self.named[at].relative_to
            self.offsets[key] = inner.inverse()
        return pose @ self.offsets.get(key, NO_POSE)

    def read_pose(self, element: SourceElement) -> Pose:
        """Read the pose in the child element `<pose>` of an XML element. The default is the identity."""
        pose = self.values.one(element, "pose")
        if pose is None or not pose.text:
            return NO_POSE
        quaternion = pose.attributes.get("rotation_format", "").strip() == "quat_xyzw"
        numbers = self.values.numbers(element, "pose", 7 if quaternion else 6)
        if numbers is None:
            return NO_POSE
        x, y, z, *turn = numbers
        if quaternion:
            return Pose(translation=(x, y, z), rotation=self.values.rotation(element, "pose", turn))
        degrees = pose.attributes.get("degrees", "").strip().lower() in ("1", "true")
        roll, pitch, yaw = (math.radians(one) if degrees else one for one in turn)
        return make_pose((x, y, z), (roll, pitch, yaw))

    def link_of(self, key: str) -> str | None:
        """Return the name of the link to which a frame is attached, or None.

        The frame of a model is attached to the canonical link, by default the first link.
        """
        passed_frames: list[str] = []
        while key not in self.links:
            self.links[key] = None  # prevents infinite recursion in cycles
            passed_frames.append(key)
            frame = self.named.get(key)
            if frame is not None and frame.element.tag == "link":
                self.links[key] = key
                break
            if frame is not None and frame.element.tag != "model":
                key = self._carrier(frame)
                continue
            canonical = (self.model if frame is None else frame.element).attributes.get("canonical_link", "")
            inside = [one for one, other in self.named.items() if other.scope == key and other.element.tag in ("link", "model")]
            inside.sort(key=lambda one: self.named[one].element.tag)  # links before models
            key = key_of(canonical, key) if canonical and key_of(canonical, key) in self.named else next(iter(inside), key)
        self.links |= dict.fromkeys(passed_frames, self.links[key])
        return self.links[key]


def key_of(name: str, scope: str) -> str:
    """Return the full name of a frame, which includes the names of the enclosing nested models.

    The frame `hand` in the model `arm` is `arm::hand`. The name `__model__` refers to the model itself.
    """
    return "::".join(filter(None, (scope, name.removesuffix(MODEL).removesuffix("::"))))
