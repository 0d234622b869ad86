"""Write a robot in one mode as an MJCF tree, with the conventions of the MuJoCo Menagerie."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import chain, product
from typing import Any

from thingc.base.memo import Memo
from thingc.base.numeric import maximum, sum_of
from thingc.base.pose import Pose, Vector
from thingc.model.assembly.types import Link, LinkedTendon
from thingc.model.resolve.types import OTHERS, ContactGroup
from thingc.model.robot.kinematics import placed_bodies
from thingc.model.robot.tree import BASE
from thingc.model.robot.types import Robot, TreeJoint
from thingc.targets.artifact import Loss
from thingc.targets.capabilities import drive_cell, is_written
from thingc.targets.geometry import Geometry
from thingc.targets.mjcf import adhesion_contacts, closures, elements, merged_joints, sensors, tendons
from thingc.targets.mjcf.capabilities import CAPABILITIES
from thingc.targets.mjcf.drives import NOTHING, add_custom_data, time_step
from thingc.targets.mjcf.elements import pose_attributes
from thingc.targets.mjcf.lowering import base_positions, in_body, is_ball, mujoco_joints, positions
from thingc.targets.mjcf.raw import class_name, possible_names
from thingc.targets.xml_writer import Element, XmlValue

FREE_JOINT = BASE
"""Name of the joint that represents a ball base. A planar base has the joints `root_0`, `root_1` and `root_2`."""

INTEGRATORS = {"euler": "Euler", "rk4": "RK4", "implicit": "implicit", "implicitfast": "implicitfast"}

STIFF_SOLIMP = "0.9999 0.9999 0.001 0.5 2"
"""The value of `solimp` for a mimic joint, which makes the constraint as stiff as MuJoCo allows.

MuJoCo regularizes the constraint by the sum of the inverse inertias of both joints, regardless of the multiplier. With the default of
MuJoCo, a slide that mimics a light hinge would lag by seconds instead of 20 ms.
"""


def model(robot: Robot, geometry: Geometry, memo: Memo | None = None) -> Element:
    """Create the `<mujoco>` element for the robot in one mode, before raw attributes are applied.

    Elements that have not changed are reused from `memo`.
    """
    return _Builder(robot, geometry, memo or Memo()).build()


def losses(robot: Robot) -> Iterator[Loss]:
    """Yield the export losses that concern only this mode. Examples are cut or reversed joints, and sensors."""
    for joint in _joints(robot):
        if joint.reversed and joint.kind.at_once and joint.dynamics.friction and joint.path.endswith("_0"):
            what = "the dry friction: MuJoCo uses the axes of the parent instead of the child"
            path = robot.assembly.mates[joint.mate].name or joint.path
            yield Loss("mjcf", robot.mode.name, path, what, "approximated", joint.origin)
    yield from merged_joints.losses(robot)
    yield from closures.losses(robot)
    yield from sensors.losses(robot)
    yield from tendons.losses(robot)


def group_masks(groups: Sequence[ContactGroup[int]]) -> dict[int, elements.Masks]:
    """Return the contact masks of the occurrences in contact groups.

    Each group has its own bit in `contype`, and `conaffinity` contains the bits of the groups with which it collides. The bit 1 of
    `others` is the default of MuJoCo.
    """
    bits = {OTHERS: 1, **{group.name: 1 << number for number, group in enumerate(groups, 1)}}
    return {member: (bits[group.name], sum(bits[name] for name in set(group.collides))) for group in groups for member in group.members}


def adhesion_name(robot: Robot, path: str) -> str:
    """Return the name of the actuator of a magnet: the path of its mount, with a suffix if a joint has the same path."""
    is_used = any(joint.path == path for mate in robot.assembly.mates for joint in mate.joints)
    return f"{path}:adhesion" if is_used else path


def _joints(robot: Robot) -> list[TreeJoint]:
    return [joint for body in robot.bodies for joint in body.joints]


class _Builder:
    """Builds the MJCF model of a mode. Each method adds one section of the model."""

    def __init__(self, robot: Robot, geometry: Geometry, memo: Memo) -> None:
        self.robot = robot
        self.memo = memo
        self.raw = {name for attribute in robot.assembly.raw if len(attribute.path) > 1 for name in possible_names(attribute)}
        self.geometry = geometry
        self.assembly = robot.assembly
        self.adhering = adhesion_contacts.adhering(robot)
        self.links: list[Link] = [robot.assembly.links[body.link] for body in robot.bodies]
        self.joints = {joint.path: joint for joint in _joints(robot)}
        self.driven = [path for path in robot.present if path in self.joints and self.joints[path].actuator is not None]
        self.root = Element(tag="mujoco", attributes={"model": f"{self.assembly.name}_{robot.mode.name}"}, origin=robot.mode.origin)

    def add_cached(self, parent: Element, key: tuple[str, ...], make: Callable[..., tuple[Element, ...]], *inputs: Any) -> None:
        """Add the elements that `make(*inputs)` returns. The elements are cached under `key` and reused if the inputs have not changed.

        Models share cached elements. An element is copied only if a raw attribute changes it.
        """
        created, names = self.memo(key, elements.make_elements, make, *inputs)
        parent.children += created if self.raw.isdisjoint(names) else [element.copy() for element in created]

    def build(self) -> Element:
        """Build the `<mujoco>` element, with its sections in the order of the MuJoCo Menagerie."""
        self.root.add("compiler", {"angle": "radian", "meshdir": "assets", "autolimits": "true"})
        self.option()
        self.default()
        self.custom()
        self.asset()
        self.worldbody()
        self.contact()
        section = self.root.add("tendon")
        tendons.tendons(self.robot, section)
        closures.tendons(self.robot, section)
        self.equality()
        self.actuator()
        sensors.sensors(self.robot, self.root.add("sensor"))
        self.keyframe()
        self.root.children = [
            section for section in self.root.children if section.children or section.tag in ("compiler", "option", "worldbody")
        ]
        return self.root

    def option(self) -> None:
        """Add gravity [m/s^2] and solver options. The `simulation` of the mode overrides the `simulation` of the document."""
        mode = self.robot.mode
        attributes: dict[str, XmlValue] = {**self.assembly.definition.simulation, **mode.simulation}
        if "integrator" in attributes:
            integrator = str(attributes["integrator"])
            attributes["integrator"] = INTEGRATORS.get(integrator.lower(), integrator)
        attributes |= adhesion_contacts.option(self.robot, attributes)
        self.root.add("option", {**attributes, "gravity": self.robot.gravity}, mode.origin)

    def default(self) -> None:
        """Add the default classes. Geoms have no mass, because each link has an `inertial` element."""
        classes = self.root.add("default").add("default", {"class": class_name(self.robot)})
        classes.add("site", {"group": "3"})
        visual = classes.add("default", {"class": "visual"})
        visual.add("geom", {"type": "mesh", "contype": "0", "conaffinity": "0", "group": "2", "mass": "0"})
        collision = classes.add("default", {"class": "collision"})
        collision.add("geom", {"type": "mesh", "group": "3", "mass": "0"})
        if self.adhering:
            collision.add("default", {"class": adhesion_contacts.CLASS}).add("geom", adhesion_contacts.contact(self.assembly))

    def custom(self) -> None:
        """Add velocity limits [rad/s or m/s] and properties of drives as custom data, because MJCF has no attributes for them."""
        section = self.root.add("custom")
        for joint in self.joints.values():
            if joint.limit.velocity is not None:
                data = joint.limit.velocity
                section.add("numeric", {"name": f"{joint.path}:velocity", "data": data}, joint.origin)
            if joint.actuator is not None and joint.actuator.backlash:
                section.add("numeric", {"name": f"{joint.path}:backlash", "data": joint.actuator.backlash}, joint.actuator.origin)
        driven: list[TreeJoint | LinkedTendon] = [*(self.joints[path] for path in self.driven), *tendons.driven_tendons(self.robot)]
        for driven_by in driven:
            add_custom_data(section, driven_by)

    def asset(self) -> None:
        """Add the materials and the meshes. Materials and meshes are in the order in which the occurrences of the document first use
        them.
        """
        section = self.root.add("asset")
        self.add_cached(section, ("material",), elements.materials, self.geometry.shapes)
        self.add_cached(section, ("mesh",), elements.meshes, self.geometry.meshes)

    def worldbody(self) -> None:
        """Add the kinematic tree of links, as nested `body` elements. Links with a free joint are children of the world."""
        world = self.root.add("worldbody")
        elements_by_body: dict[int, Element] = {}
        all_shapes = (shape for item in self.geometry.shapes for shape in (*item.visual, *item.collision))
        names = frozenset(shape.name for shape in all_shapes if shape.name is not None)
        at_zero = self.free_poses(dict.fromkeys(self.joints, 0.0), self.robot.bodies[0].X_PL)
        masks = group_masks(self.robot.mode.groups)
        for index, body in merged_joints.model_bodies(self.robot).items():
            link, parent = self.links[index], None if body.parent is None or body.free else elements_by_body[body.parent]
            attributes = {"name": link.name, **pose_attributes(at_zero.get(index, body.X_PL))}
            if parent is None:
                attributes["childclass"] = class_name(self.robot)
                if body.parent is None and self.robot.base == "held":
                    attributes["mocap"] = "true"
            element = (parent or world).add("body", attributes, link.origin)
            elements_by_body[index] = element
            if link.properties.mass > 0.0:
                self.add_cached(element, ("inertial", link.name), elements.inertial, link.properties, link.origin)
            if body.parent is None and self.robot.base == "free":
                element.add("freejoint", {"name": self.assembly.free_joint}, self.robot.mode.origin)
            joints = self.robot.moves if body.parent is None else body.joints
            if body.free:
                element.add("freejoint", {"name": self.name_of(joints[0])}, joints[0].origin)
                joints = ()
            if is_ball(joints):
                key = ("joint", self.robot.mode.name, joints[0].path)
                self.add_cached(element, key, elements.ball, self.name_of(joints[0]), joints[0])
                joints = ()
            for joint in joints:
                driven = joint.path in self.driven
                self.add_cached(element, ("joint", self.robot.mode.name, joint.path), elements.joint, joint, driven)
            shapes = tuple(self.geometry.shapes[member] for member in link.members)
            collision_class = adhesion_contacts.CLASS if body.link in self.adhering else "collision"
            inputs = link.poses, shapes, collision_class, names, tuple(masks.get(member) for member in link.members)
            self.add_cached(element, ("geoms", link.name, collision_class), elements.geoms, *inputs)
        for site in merged_joints.sites(self.robot).values():
            self.add_cached(elements_by_body[site.body], ("site", site.path), elements.site, site.path, site.pose, site.origin)
        closures.sites(self.robot, world, elements_by_body)
        sensors.cameras(self.robot, elements_by_body)
        sensors.volumes(self.robot, elements_by_body)
        tendons.shapes(self.robot, elements_by_body)
        # A body's sites, geoms and joints come before its child bodies.
        for element in elements_by_body.values():
            element.children.sort(key=lambda child: child.tag == "body")

    def free_poses(self, q: Mapping[str, float], base: Pose) -> dict[int, Pose]:
        """Return the poses in the world of the bodies with free joints, by index. `base` is the pose of the root link."""
        free = [index for index, body in enumerate(self.robot.bodies) if body.free]
        placed = placed_bodies(self.robot.bodies, q, base) if free else ()
        return {index: placed[index] for index in free}

    def contact(self) -> None:
        """Add the pairs of links between which contacts are excluded, and the pairs of shapes with their own contact settings."""
        section = self.root.add("contact")
        for first, second in self.robot.excluded:
            crossed = self.robot.bodies[max(first, second)].joints
            section.add(
                "exclude", {"body1": self.links[first].name, "body2": self.links[second].name},
                crossed[0].origin if crossed else self.robot.mode.origin,
            )
        for pair in self.robot.mode.pairs:
            sides = (elements.named_collision(self.geometry.shapes[index]) for index in (pair.one, pair.other))
            for (first_name, first_shape), (second_name, second_shape) in product(*sides):
                settings = elements.pair(pair, first_shape.material, second_shape.material)
                section.add("pair", {"geom1": first_name, "geom2": second_name, **settings}, pair.origin)

    def equality(self) -> None:
        """Add equality constraints for mimic joints, followed by equality constraints for loops.

        The position of a mimic joint is a polynomial in the position of the other joint. In this polynomial, both positions are relative to
        their values at qpos0.
        """
        section = self.root.add("equality")
        for joint in self.joints.values():
            for slide in mujoco_joints(joint)[1:]:
                # The rotation depends on the slide. Otherwise the share of the slide in the constraint would be so small that loads slip.
                polynomial: tuple[float, ...] = (0.0, 1.0 / slide.ratio, 0.0, 0.0, 0.0)
                names = {"name": f"{joint.path}:screw", "joint1": joint.path, "joint2": slide.name}
                section.add("joint", {**names, "polycoef": polynomial, "solimp": STIFF_SOLIMP}, joint.origin)
            if joint.mimic is not None and joint.mimic.joint.path in self.joints:
                polynomial = (*joint.mimic.polynomial, 0.0, 0.0, 0.0)[:5]
                names = {"name": joint.mimic.name or f"{joint.path}:mimic", "joint1": joint.path, "joint2": joint.mimic.joint.path}
                section.add("joint", {**names, "polycoef": polynomial, "solimp": STIFF_SOLIMP}, joint.mimic.origin)
        closures.equalities(self.robot, section, [link.name for link in self.links])

    def actuator(self) -> None:
        """Add the actuators. The drives of joints come first, followed by the drives of tendons and by the adhesion of magnets."""
        section, step = self.root.add("actuator"), time_step(self.robot)
        for path in self.driven:
            joint, drive = self.joints[path], self.joints[path].actuator
            if drive is None or not is_written(CAPABILITIES["drives"][drive_cell(joint, drive)]):
                continue
            ball: tuple[str, Vector] | tuple[()] = ()
            if drive.axis is not None:
                body = next(body for body in self.robot.bodies if joint in body.joints)
                ball = self.name_of(joint), in_body(body, drive.axis)
            self.add_cached(section, ("actuator", self.robot.mode.name, path), elements.drive, joint, drive, step, *ball)
        tendons.drives(self.robot, section)
        body_of = {body.link: index for index, body in enumerate(self.robot.bodies)}
        for magnet in self.assembly.adhesions:
            link = self.links[body_of[self.assembly.link_of[magnet.occurrence]]]
            names = {"name": adhesion_name(self.robot, magnet.path), "body": link.name}
            bounds = (0.0, maximum(magnet.force, NOTHING))
            section.add("adhesion", {**names, "ctrlrange": bounds, "gain": "1"}, self.assembly.occurrences[magnet.occurrence].origin)

    def keyframe(self) -> None:
        """Add a keyframe for each pose of the mode, with joint positions and controls.

        The pose of the base is specified by the mode. If the base is free, the holds determine its pose.
        """
        section = self.root.add("keyframe")
        for frame in self.robot.keyframes:
            base = frame.base or self.robot.bodies[0].X_PL
            quaternion = self.memo(("base", self.robot.mode.name, frame.name), Pose.quaternion, base)
            qpos = [*base.translation, *quaternion] if self.robot.base == "free" else [*base_positions(self.robot)]
            poses = self.free_poses(frame.q, base)
            for index, body in enumerate(self.robot.bodies):
                qpos += positions(body, frame.q, poses.get(index, body.X_PL))
            ctrl = [self.position(path, frame.q) for path in self.driven]
            ctrl += tendons.controls(self.robot, frame.q)
            ctrl += [self.robot.adhesion.get(magnet.path, 0.0) for magnet in self.assembly.adhesions]
            values: list[tuple[str, XmlValue]] = [("name", frame.name)]
            values += [(name, tuple(row)) for name, row in (("qpos", qpos), ("ctrl", ctrl)) if row]
            mocap = [(base.translation, quaternion)] if self.robot.base == "held" else []
            mocap += [(pose.translation, pose.quaternion()) for pose in closures.anchors(self.robot).values()]
            values += zip(("mpos", "mquat"), (tuple(chain(*column)) for column in zip(*mocap)))
            self.add_cached(section, ("key", self.robot.mode.name, frame.name), elements.key, tuple(values), frame.origin)

    def name_of(self, joint: TreeJoint) -> str:
        """Return the name of the MuJoCo joint to which a joint coordinate belongs."""
        return FREE_JOINT if joint.mate < 0 else self.assembly.mates[joint.mate].name or joint.path

    def position(self, path: str, q: Mapping[str, float]) -> float:
        """Return the control value [rad or m] with which a position drive holds the joint positions `q`. Return 0 for any other drive.

        For a drive of a ball joint, the control value is the component of the rotation vector along the axis of the drive.
        """
        joint = self.joints[path]
        drive = joint.actuator
        if drive is None or drive.kind != "position":
            return 0.0
        if drive.axis is None:
            return q[path]
        return sum_of(part * q[c.path] for part, c in zip(drive.axis, self.assembly.mates[joint.mate].joints, strict=True))
