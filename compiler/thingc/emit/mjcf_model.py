"""One mode's robot as an MJCF tree, by the conventions of the MuJoCo Menagerie."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from thingc.emit import mjcf_closures, mjcf_sensors
from thingc.emit.artifact import Loss
from thingc.emit.mjcf_drives import NOTHING, both_ways, drive_attributes, joint_range
from thingc.emit.mjcf_geometry import Geometry, MeshAsset, Shape, Shapes
from thingc.emit.mjcf_inertial import inertial
from thingc.emit.mjcf_xml import Element, number, numbers, pose_attributes
from thingc.graph.types import ActuatorModel, Link
from thingc.inertia import MassProperties
from thingc.memo import Memo
from thingc.pose import Pose
from thingc.resolve.model import Material
from thingc.robot.types import CoreJoint, Robot
from thingc.source import Origin

FREE_JOINT = "root"
"""The name of a free base's joint."""

INTEGRATORS = {"euler": "Euler", "rk4": "RK4", "implicit": "implicit", "implicitfast": "implicitfast"}
RESERVED_CLASSES = frozenset({"main", "visual", "collision"})

STIFF = "0.9999 0.9999 0.001 0.5 2"
"""`solimp` of a joint that mimics, as hard as MuJoCo allows. MuJoCo regularizes the constraint by the plain sum of both joints'
inverse inertias, whatever the multiplier; with its default a slide that mimics a light hinge lags by seconds instead of 20 ms."""


def model(robot: Robot, geometry: Geometry, memo: Memo | None = None) -> Element:
    """The whole `<mujoco>` element of a mode, before raw attributes. What `memo` has of it is taken from there."""
    return _Builder(robot, geometry, memo or Memo()).build()


def losses(robot: Robot) -> tuple[Loss, ...]:
    """What MJCF cannot say of this mode beyond its geometry. Velocity limits are of no mode: every one has them."""
    found: list[Loss] = []
    for joint in _joints(robot):
        if joint.limit.velocity is not None:
            what = f"its velocity limit of {joint.limit.velocity:.6g} {'rad/s' if joint.kind == 'hinge' else 'm/s'}"
            span = next(iter(joint.origin), None)
            found.append(
                Loss(target="mjcf", mode=None, path=joint.path, what=what, how="carried as custom data", span=span)
            )
    return (*found, *mjcf_closures.losses(robot), *mjcf_sensors.losses(robot))


def class_name(robot: Robot) -> str:
    """The robot's default class: its name, unless MuJoCo or we have a class of that name already."""
    name = robot.assembly.name
    return f"{name}_robot" if name in RESERVED_CLASSES else name


def adhesion_name(robot: Robot, path: str) -> str:
    """The actuator of a magnet: its mount's path, marked where a joint of that path has the name."""
    taken = any(mate.joint is not None and mate.joint.path == path for mate in robot.assembly.mates)
    return f"{path}:adhesion" if taken else path


def _joints(robot: Robot) -> list[CoreJoint]:
    return [body.joint for body in robot.bodies if body.joint is not None]


class _Builder:
    """The sections of one model, one method each."""

    def __init__(self, robot: Robot, geometry: Geometry, memo: Memo) -> None:
        self.robot = robot
        self.memo = memo
        self.raw = {word for attribute in robot.assembly.raw for word in _suffixes(attribute.path[1:2])}
        self.geometry = geometry
        self.assembly = robot.assembly
        self.links: list[Link] = [robot.assembly.links[body.link] for body in robot.bodies]
        self.joints = {joint.path: joint for joint in _joints(robot)}
        self.driven = [path for path in robot.present if path in self.joints and self.joints[path].actuator is not None]
        self.root = Element(
            tag="mujoco", attributes={"model": f"{self.assembly.name}_{robot.mode.name}"}, origin=robot.mode.origin
        )

    def grow(self, parent: Element, place: tuple[str, ...], make: Callable[..., tuple[Element, ...]], *inputs: Any) -> None:
        """Add the elements that `make(*inputs)` gives, which are none of this model alone, unless raw attributes name them."""
        elements, names = self.memo(place, _made, make, *inputs)
        if self.raw.isdisjoint(names):
            parent.children.extend(elements)
        else:
            parent.children.extend(element.copy() for element in elements)

    def build(self) -> Element:
        """The sections in the order of the Menagerie."""
        self.root.add("compiler", {"angle": "radian", "meshdir": "assets", "autolimits": "true"})
        self.option()
        self.default()
        self.custom()
        self.asset()
        self.worldbody()
        self.contact()
        self.equality()
        self.actuator()
        mjcf_sensors.sensors(self.robot, self.root.add("sensor"))
        self.keyframe()
        self.root.children = [
            section for section in self.root.children if section.children or section.tag in ("compiler", "option", "worldbody")
        ]
        return self.root

    def option(self) -> None:
        """Gravity [m/s^2], and how to step: the document's `simulation` with the mode's over it."""
        mode = self.robot.mode
        attributes: dict[str, str] = {}
        for name, value in {**self.assembly.definition.simulation, **mode.simulation}.items():
            text = value if isinstance(value, str) else number(value)
            attributes[name] = INTEGRATORS.get(text.lower(), text) if name == "integrator" else text
        self.root.add("option", {**attributes, "gravity": numbers(self.robot.gravity)}, mode.origin)

    def default(self) -> None:
        """Classes. Geoms weigh nothing: the mass of a link is what its `inertial` says."""
        own = self.root.add("default").add("default", {"class": class_name(self.robot)})
        own.add("site", {"group": "3"})
        visual = own.add("default", {"class": "visual"})
        visual.add("geom", {"type": "mesh", "contype": "0", "conaffinity": "0", "group": "2", "mass": "0"})
        own.add("default", {"class": "collision"}).add("geom", {"type": "mesh", "group": "3", "mass": "0"})

    def custom(self) -> None:
        """Velocity limits [rad/s or m/s], which MJCF has no place for."""
        section = self.root.add("custom")
        for joint in self.joints.values():
            if joint.limit.velocity is not None:
                data = number(joint.limit.velocity)
                section.add("numeric", {"name": f"{joint.path}:velocity", "data": data}, joint.origin)

    def asset(self) -> None:
        """Materials and meshes, in the order in which the document's occurrences first need them."""
        section = self.root.add("asset")
        self.grow(section, ("material",), _materials, self.geometry.shapes)
        self.grow(section, ("mesh",), _meshes, self.geometry.meshes)

    def worldbody(self) -> None:
        """The tree of links."""
        world = self.root.add("worldbody")
        made: list[Element] = []
        for index, body in enumerate(self.robot.bodies):
            link = self.links[index]
            attributes = {"name": link.name, **pose_attributes(body.X_PL)}
            if body.parent is None:
                attributes["childclass"] = class_name(self.robot)
                if self.robot.base == "held":
                    attributes["mocap"] = "true"
            element = (world if body.parent is None else made[body.parent]).add("body", attributes, link.origin)
            made.append(element)
            if link.properties.mass > 0.0:
                self.grow(element, ("inertial", link.name), _inertial, link.properties, link.origin)
            if body.parent is None and self.robot.base == "free":
                element.add("freejoint", {"name": FREE_JOINT}, self.robot.mode.origin)
            if body.joint is not None:
                driven = body.joint.path in self.driven
                self.grow(element, ("joint", self.robot.mode.name, body.joint.path), _joint, body.joint, driven)
            self.grow(element, ("geoms", link.name), _geoms, link.poses, tuple(self.geometry.shapes[member] for member in link.members))
        for site in self.robot.sites:
            self.grow(made[site.body], ("site", site.path), _site, site.path, site.pose, site.origin)
        mjcf_closures.sites(self.robot, made)
        mjcf_sensors.cameras(self.robot, made)
        # The sites of a link belong to it, not to what hangs on it: children come last.
        for element in made:
            element.children.sort(key=lambda child: child.tag == "body")

    def contact(self) -> None:
        """Pairs of links that never touch; a held link no more touches the world that holds it than the root does."""
        section = self.root.add("contact")
        for first, second in self.robot.excluded:
            origin = self.robot.bodies[max(first, second)].joint
            section.add(
                "exclude", {"body1": self.links[first].name, "body2": self.links[second].name},
                origin.origin if origin is not None else self.robot.mode.origin,
            )
        for body, origins in {c.child: c.origin for c in reversed(self.robot.closures) if c.hold}.items():
            section.add("exclude", {"body1": "world", "body2": self.links[body].name}, origins)

    def equality(self) -> None:
        """Joints that mimic: q = offset + multiplier q(other); then loops."""
        section = self.root.add("equality")
        for joint in self.joints.values():
            if joint.mimic is not None and joint.mimic.joint in self.joints:
                polynomial = numbers((joint.mimic.offset, joint.mimic.multiplier, 0.0, 0.0, 0.0))
                names = {"name": f"{joint.path}:mimic", "joint1": joint.path, "joint2": joint.mimic.joint}
                section.add("joint", {**names, "polycoef": polynomial, "solimp": STIFF}, joint.mimic.origin)
        mjcf_closures.equalities(self.robot, section, [link.name for link in self.links])

    def actuator(self) -> None:
        """Drives in joint order, then magnets."""
        section = self.root.add("actuator")
        for path in self.driven:
            joint, drive = self.joints[path], self.joints[path].actuator
            if drive is not None:
                self.grow(section, ("actuator", self.robot.mode.name, path), _drive, joint, drive)
        body_of = {body.link: index for index, body in enumerate(self.robot.bodies)}
        for magnet in self.assembly.adhesions:
            link = self.links[body_of[self.assembly.link_of[magnet.occurrence]]]
            attributes = {"name": adhesion_name(self.robot, magnet.path), "body": link.name}
            attributes |= {"ctrlrange": numbers((0.0, max(magnet.force, NOTHING))), "gain": "1"}
            section.add("adhesion", attributes, self.assembly.occurrences[magnet.occurrence].origin)

    def keyframe(self) -> None:
        """Poses of the mode: q and controls; the base stands where the mode puts it, a free one where holds want it."""
        section = self.root.add("keyframe")
        for frame in self.robot.keyframes:
            base = frame.base or self.robot.bodies[0].X_PL
            turned = self.memo(("base", self.robot.mode.name, frame.name), Pose.quaternion, base)
            qpos = [*base.translation, *turned] if self.robot.base == "free" else []
            qpos += [frame.q[path] for path in self.joints]
            ctrl = [frame.q[path] if self.is_position(path) else 0.0 for path in self.driven]
            ctrl += [self.robot.adhesion.get(magnet.path, 0.0) for magnet in self.assembly.adhesions]
            values: list[tuple[str, str | tuple[float, ...]]] = [("name", frame.name)]
            values += [(name, tuple(row)) for name, row in (("qpos", qpos), ("ctrl", ctrl)) if row]
            if self.robot.base == "held":
                values += [("mpos", base.translation), ("mquat", turned)]
            self.grow(section, ("key", self.robot.mode.name, frame.name), _key, tuple(values), frame.origin)

    def is_position(self, path: str) -> bool:
        """Whether a joint's control is a position."""
        drive = self.joints[path].actuator
        return drive is not None and drive.kind == "position"


def _suffixes(words: tuple[str, ...]) -> Iterator[str]:
    """What the name in the path of a raw attribute may mean: see `mjcf_raw`."""
    for word in words:
        parts = word.replace(".", "/").split("/")
        yield from ("/".join(parts[first:]) for first in range(len(parts)))


def _made(make: Callable[..., tuple[Element, ...]], *inputs: Any) -> tuple[tuple[Element, ...], frozenset[str]]:
    """Elements, and their names as raw attributes have them."""
    elements = make(*inputs)
    return elements, frozenset(element.attributes.get("name", "").replace(".", "/") for element in elements)


def _meshes(meshes: tuple[MeshAsset, ...]) -> tuple[Element, ...]:
    return tuple(
        Element(
            tag="mesh", attributes={"name": mesh.name, "file": mesh.file, **({"inertia": "shell"} if mesh.shell else {})},
            origin=mesh.origin,
        )
        for mesh in meshes
    )


def _materials(shapes: tuple[Shapes, ...]) -> tuple[Element, ...]:
    found: dict[str, Element] = {}
    for one in shapes:
        name = _material_name(one)
        if name is not None and name not in found and one.visual is not None:
            origin = one.material.origin if one.material is not None else one.origin
            found[name] = Element(tag="material", attributes={"name": name, "rgba": _rgba(one.color or "")}, origin=origin)
    return tuple(found.values())


def _inertial(properties: MassProperties, origin: Origin) -> tuple[Element, ...]:
    return (Element(tag="inertial", attributes=inertial(properties), origin=origin),)


def _site(path: str, pose: Pose, origin: Origin) -> tuple[Element, ...]:
    return (Element(tag="site", attributes={"name": path, **pose_attributes(pose)}, origin=origin),)


def _joint(joint: CoreJoint, driven: bool) -> tuple[Element, ...]:
    """A hinge or slide. An effort limit stands on its actuator; on the joint itself only where it is not `driven`."""
    attributes = {"name": joint.path, "type": joint.kind}
    if any(joint.anchor):
        attributes["pos"] = numbers(joint.anchor)
    attributes["axis"] = numbers(joint.axis)
    bounds = joint_range(joint.limit)
    if bounds is not None:
        attributes["range"] = numbers(bounds)
    if joint.limit.effort is not None and not driven:
        attributes["actuatorfrcrange"] = both_ways(joint.limit.effort)
    dynamics = joint.dynamics
    for name, value in (
        ("stiffness", dynamics.stiffness), ("damping", dynamics.damping), ("frictionloss", dynamics.friction),
        ("armature", dynamics.armature),
    ):
        if value is not None:
            attributes[name] = number(value)
    return (Element(tag="joint", attributes=attributes, origin=joint.origin),)


def _geoms(poses: tuple[Pose, ...], shapes: tuple[Shapes, ...]) -> tuple[Element, ...]:
    """What the occurrences of a link show and what they touch with; `poses` are their own in the link."""
    made: list[Element] = []
    for pose, one in zip(poses, shapes, strict=True):
        if one.visual is not None:
            attributes = {"name": one.path, "class": "visual", **_shape(one.visual, pose)}
            material = _material_name(one)
            if material is not None:
                attributes["material"] = material
            made.append(Element(tag="geom", attributes=attributes, origin=one.origin))
        for index, shape in enumerate(one.collision):
            name = f"{one.path}:collision" + (f"_{index}" if index else "")
            attributes = {"name": name, "class": "collision", **_shape(shape, pose), **_friction(one.material)}
            made.append(Element(tag="geom", attributes=attributes, origin=one.origin))
    return tuple(made)


def _drive(joint: CoreJoint, drive: ActuatorModel) -> tuple[Element, ...]:
    attributes = {"name": joint.path, "joint": joint.path, **drive_attributes(joint, drive)}
    return (Element(tag=drive.kind, attributes=attributes, origin=drive.origin),)


def _key(attributes: tuple[tuple[str, str | tuple[float, ...]], ...], origin: Origin) -> tuple[Element, ...]:
    texts = {name: value if isinstance(value, str) else numbers(value) for name, value in attributes}
    return (Element(tag="key", attributes=texts, origin=origin),)


def _shape(shape: Shape, pose: Pose) -> dict[str, str]:
    if shape.kind == "mesh":
        return {"mesh": shape.mesh or "", **pose_attributes(pose @ shape.pose)}
    return {"type": shape.kind, "size": numbers(shape.size), **pose_attributes(pose @ shape.pose)}


def _friction(material: Material | None) -> dict[str, str]:
    """`friction` where the material states any, the rest MuJoCo's own.

    MuJoCo takes the larger of two geoms' friction, which would lose the document's number on any floor: a priority makes
    it count (the larger one again between two of ours). Torsional and rolling friction only act with `condim` 4 and 6.
    """
    if material is None or (material.slide is None and material.torsion is None and material.roll is None):
        return {}
    slide = 1.0 if material.slide is None else material.slide
    torsion = 0.005 if material.torsion is None else material.torsion
    roll = 0.0001 if material.roll is None else material.roll
    attributes = {"friction": numbers((slide, torsion, roll)), "priority": "1"}
    if material.roll is not None:
        attributes["condim"] = "6"
    elif material.torsion is not None:
        attributes["condim"] = "4"
    return attributes


def _material_name(one: Shapes) -> str | None:
    """`petg_e6e6fa`: material and colour, because a document may colour one material differently."""
    if one.color is None:
        return None
    name = one.material.name if one.material is not None else "color"
    return f"{name}_{one.color.removeprefix('#')}"


def _rgba(color: str) -> str:
    """`#rrggbb` or `#rrggbbaa` as four numbers from 0 to 1."""
    digits = color.removeprefix("#")
    channels = [int(digits[k : k + 2], 16) / 255.0 for k in range(0, len(digits), 2)]
    return numbers(channels if len(channels) == 4 else [*channels, 1.0])
