"""Read the elements of URDF files that are intended for other programs: `<gazebo>`, `<transmission>`, `<ros2_control>` and `<mujoco>`.

Elements that a document cannot express are recorded as losses with a reason. Elements that only control how a program reads the file are
ignored.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import Literal

from thingc.base.diagnostics import Code
from thingc.base.pose import Pose, make_pose
from thingc.base.suggestions import did_you_mean
from thingc.tools.importing.source_model import SourceSensor, SourceTransmission
from thingc.tools.importing.xml_source import Losses, SourceElement
from thingc.tools.importing.xml_values import Values

TAGS = ("gazebo", "transmission", "ros2_control", "mujoco")
KEPT = {"preserveFixedJoint", "disableFixedJointLumping", "provideFeedback", "canonicalBody"}
"""Elements of `<gazebo>` that are ignored and not recorded as losses, because thingc always preserves fixed links."""
WHY = {
    **dict.fromkeys(("kp", "kd", "maxVel", "minDepth", "maxContacts"), "contact stiffness depends on the simulator"),
    **dict.fromkeys(("gravity", "turnGravityOff"), "all links have the mode's gravity"), "fdir1": "friction is isotropic",
    "material": "a reference to a Gazebo material", "selfCollide": "all links can touch, except links that a joint connects",
    "plugin": "Gazebo plugins are not imported", "static": "modes define the fixed links", "hardware": "ROS plugins are not imported",
}
COMMANDS = ("position", "velocity", "effort")
ONLY_READING = {"angle", "fusestatic", "discardvisual", "strippath", "meshdir", "assetdir", "convexhull", "balanceinertia", "autolimits"}
"""Attributes of MuJoCo's `<compiler>` that only control how MuJoCo reads the file."""


SENSORS: dict[str, Literal["imu", "camera"]] = {"imu": "imu", "imu_sensor": "imu", "camera": "camera"}
LOOKING = Pose(rotation=((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)))
"""Rotation from a camera frame of Gazebo (x forward, z up) to a mount of a document (z forward, y up)."""
MOST_VIEW = math.radians(179.0)
"""Maximum vertical field of view of a camera [rad]."""
FIELD_OF_VIEW, WIDTH, HEIGHT = 1.047, 320.0, 240.0
"""SDF's default values for a camera: horizontal field of view [rad], width and height of the image [px]."""


class Blocks:
    """Reads the elements of a URDF file that are intended for other programs.

    Unsupported elements are recorded as losses, and invalid numbers are reported as errors.

    Attributes:
        friction: The coefficients of sliding friction, by link name.
        free: Whether Gazebo's element `<static>` is false, which means that the base is not fixed to the world.
        sensors: The sensors by name, with poses in their links.
        driven: The names of the joints with a drive, or None if the file does not define drives.
        transmissions: The transmissions with a reduction other than 1, by name.
        meshes: The folder in which MuJoCo searches for meshes, or None if the file does not specify it.
    """

    def __init__(self, root: SourceElement, values: Values, losses: Losses) -> None:
        self.root, self.values, self.losses = root, values, losses
        self.friction: dict[str, float] = {}
        self.free = False
        self.sensors: dict[str, SourceSensor] = {}
        self.transmissions: dict[str, SourceTransmission] = {}
        for block in root.all("gazebo"):
            self._gazebo(block)
        self.joints = dict.fromkeys(one.attributes.get("name", "") for one in root.all("joint"))
        driven = {name for name, block in (*self._transmission_joints(), *self._commanded_joints()) if self._is_joint(name, block)}
        self.driven = driven if any(one.tag in ("transmission", "ros2_control") for one in root.children) else None
        self.meshes: str | None = None
        for block in root.all("mujoco"):
            self._mujoco(block)

    def _rest(self, elements: Iterable[SourceElement], of: str) -> None:
        for element in elements:
            self.losses.note(f"`<{element.tag}>` {of}", WHY.get(element.tag, "not imported"), element.where)

    def _gazebo(self, block: SourceElement) -> None:
        name = block.attributes.get("reference")
        if name is None:
            self.free |= any(one.text.lower() in ("0", "false") for one in block.all("static"))
            self._rest((one for one in block.children if one.tag != "static" or not self.free), "of `<gazebo>`")
            return
        here = f"of `<gazebo reference=\"{name}\">`"
        links, joints = ([one.attributes.get("name") for one in self.root.all(tag)] for tag in ("link", "joint"))
        if name not in links and name not in joints:
            self.losses.note(f"`<gazebo reference=\"{name}\">`", "the link or joint does not exist", block.where)
            return
        first, second = (next(block.all(tag), None) for tag in ("mu1", "mu2"))
        slides = [None if one is None else self._from_zero(one) for one in (first, second)]
        if first is not None and slides[0] is not None and name in links:
            self.friction[name] = slides[0]
        elif first is not None:
            self.losses.note(f"`<mu1>` {here}", "the reference is not a link", first.where)
        if second is not None and slides[1] is not None and slides[0] != slides[1]:
            self.losses.note(f"`<mu2>` {here}", "friction is the same in all directions", second.where)
        for sensor in block.all("sensor"):
            self._sensor(sensor, name, name in links)
        self._rest((one for one in block.children if one.tag not in {"mu1", "mu2", "sensor", *KEPT}), here)

    def _sensor(self, element: SourceElement, link: str, on_link: bool) -> None:
        name, kind = element.attributes.get("name", ""), element.attributes.get("type", "")
        what, known = f"sensor `{name}`", SENSORS.get(kind)
        if known is None or not on_link or not name or name in self.sensors:
            if known is None:
                why = f"sensors of type `{kind}` are not supported"
            elif not on_link:
                why = "the sensor is not on a link"
            else:
                why = "the name is not unique" if name else "the sensor has no name"
            self.losses.note(what, why, element.where)
            return
        pose = next(element.all("pose"), None)
        words = ["0"] * 6 if pose is None else pose.text.split()
        numbers = [self.values.number_of(pose or element, word, "`<pose>`") for word in words]
        if len(numbers) != 6:
            self.values.fault(pose or element, None, f"`<pose>`: expected 6 numbers separated by spaces, found {len(numbers)}")
        x, y, z, roll, pitch, yaw = (one or 0.0 for one in (*numbers, *[0.0] * 6)[:6])
        at, fovy = make_pose((x, y, z), (roll, pitch, yaw)), 0.0
        if known == "camera":
            at, fovy = at @ LOOKING, self._fovy(element)
            if not 0.0 < fovy < MOST_VIEW:
                self.losses.note(what, "the field of view is not between 0 and 180 degrees", element.where)
                return
        self.sensors[name] = SourceSensor(name=name, kind=known, link=link, pose=at, fovy=fovy, where=element.where)
        if any(one.tag not in ("pose", "always_on", "visualize", "camera") for one in element.children):
            self.losses.note(f"rate, noise and plugins of {what}", "sensors in a document only have a type and a mount", element.where)

    def _fovy(self, element: SourceElement) -> float:
        """Return the vertical field of view [rad], computed from the horizontal field of view and the size of the image."""
        cameras = [*element.all("camera")]
        images = [image for camera in cameras for image in camera.all("image")]
        sizes = [FIELD_OF_VIEW, WIDTH, HEIGHT]
        for k, (tag, inside) in enumerate((("horizontal_fov", cameras), ("width", images), ("height", images))):
            for one in (one for outer in inside for one in outer.all(tag)):
                sizes[k] = self._from_zero(one) or sizes[k]
        return 2.0 * math.atan(math.tan(min(sizes[0], 3.1) / 2.0) * sizes[2] / sizes[1])

    def _number(self, element: SourceElement) -> float | None:
        """Read a number from the text of an element, or from the attribute `value` of the element."""
        return self.values.number_of(element, element.attributes.get("value", element.text), f"`<{element.tag}>`")

    def _from_zero(self, element: SourceElement) -> float | None:
        """Read a number that must be at least 0 from an element."""
        number = self._number(element)
        if number is not None and number < 0.0:
            self.values.fault(element, None, f"`<{element.tag}>`: expected a number of at least 0, found {number:g}")
            return None
        return number

    def _is_joint(self, name: str, block: SourceElement) -> bool:
        """Return whether the joint to which a transmission or controller refers exists.

        If the joint does not exist, report a warning and record a loss.
        """
        if name not in self.joints:
            self.losses.note(f"the drive of joint `{name}`", "the joint does not exist", block.where)
            message = f"the driven joint `{name}` does not exist"
            self.values.report.warn(Code.SOURCE_DOUBT, message, block.place("name"), help=did_you_mean(name, self.joints, what="joints"))
        return name in self.joints

    def _transmission_joints(self) -> Iterator[tuple[str, SourceElement]]:
        """Yield the name and the XML element of each joint in a `<transmission>`."""
        for block in self.root.all("transmission"):
            faces = [one.text for part in block.children for one in part.all("hardwareInterface")]
            for joint in block.all("joint"):
                name = joint.attributes.get("name", "")
                yield name, joint
                self._interfaces(name, {kind for kind in COMMANDS for face in faces if kind in face.lower()}, joint)
            self._read_reductions(block, " ".join(one.text for one in block.all("type")), "mechanicalReduction")
            self._rest((one for one in block.children if one.tag not in ("joint", "actuator", "type")), "of `<transmission>`")

    def _commanded_joints(self) -> Iterator[tuple[str, SourceElement]]:
        """Yield the name and the XML element of each joint that `<ros2_control>` commands."""
        for block in self.root.all("ros2_control"):
            for joint in block.all("joint"):
                name, commands = joint.attributes.get("name", ""), [*joint.all("command_interface")]
                if commands:
                    yield name, joint
                    self._interfaces(name, {one.attributes.get("name", "") for one in commands}, joint)
                bounds = [one for command in commands for one in command.all("param") if one.attributes.get("name") in ("min", "max")]
                if bounds:
                    self.losses.note(f"the command limits of joint `{name}`", "the limits of the joint apply", bounds[0].where)
            for one in block.all("transmission"):
                self._read_reductions(one, " ".join(plugin.text for plugin in one.all("plugin")), "mechanical_reduction")
            self._rest((one for one in block.children if one.tag not in ("joint", "transmission")), "of `<ros2_control>`")

    def _read_reductions(self, block: SourceElement, kind: str, tag: str) -> None:
        """Read the reductions of a `<transmission>` from its elements `tag`. `kind` contains the name of the ROS plugin.

        Transmissions with a ratio of 1 are ignored. If the reductions cannot be imported, they are recorded as a loss.
        """
        joints, actuators = ([*block.all(name)] for name in ("joint", "actuator"))
        a, j = ([self._reduction(one, tag) for one in some] for some in (actuators or [block], joints))
        matrix: tuple[tuple[float, ...], ...] = ()
        if len(j) == len(a) == 1:
            matrix = ((a[0] * j[0],),)
        elif len(j) == len(a) == 2 and "Differential" in kind:
            matrix = ((a[0] * j[0], a[0] * j[1]), (a[1] * j[0], -a[1] * j[1]))
        elif len(j) == len(a) == 2 and "FourBarLinkage" in kind:
            matrix = ((a[0] * j[0], 0.0), (a[1], a[1] * j[1]))
        name, named = block.attributes.get("name", "transmission"), tuple(one.attributes.get("name", "") for one in joints)
        if matrix == ((1.0,),) or not matrix and all(one == 1.0 for one in (*a, *j)):
            return
        made = SourceTransmission(name=name, joints=named, matrix=matrix, where=block.where)
        others = [one for one in self.transmissions.values() if set(one.joints) & set(named)]
        if not matrix or 0.0 in (*a, *j):
            self.losses.note(f"the reductions of transmission `{name}`", "unknown type, or a reduction of 0", block.where)
        elif not others and name not in self.transmissions:
            self.transmissions[name] = made
        elif [(one.joints, one.matrix) for one in others] != [(named, matrix)]:
            why = "another transmission has the same name or joints"
            self.losses.note(f"the reductions of transmission `{name}`", why, block.where)

    def _reduction(self, element: SourceElement, tag: str) -> float:
        """Return the reduction of an actuator or joint of a transmission, which is 1 if the file does not specify it."""
        numbers = [self._number(one) for one in element.all(tag)]
        return 1.0 if not numbers or numbers[0] is None else numbers[0]

    def _interfaces(self, name: str, kinds: set[str], joint: SourceElement) -> None:
        """Record as a loss that a joint's position or velocity command becomes a motor, because URDF does not contain controller gains."""
        if kinds & {"position", "velocity"} and "effort" not in kinds:
            kind = "position" if "position" in kinds else "velocity"
            what = f"the {kind} command interface of joint `{name}`"
            self.losses.note(what, "the gains of the controller are unknown", joint.where)

    def _mujoco(self, block: SourceElement) -> None:
        for one in block.children:
            if one.tag != "compiler":
                self.losses.note(f"`<{one.tag}>` of `<mujoco>`", "not imported", one.where)
                continue
            for key in ("meshdir", "assetdir"):
                self.meshes = one.attributes.get(key) if self.meshes is None else self.meshes
            for attribute in sorted(one.attributes.keys() - ONLY_READING):
                self.losses.note(f"`{attribute}` of `<compiler>`", "masses and shapes are imported as they are in the file", one.where)
