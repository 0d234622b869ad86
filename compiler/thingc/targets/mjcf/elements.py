"""Create the elements of an MJCF model, such as joints, geoms and actuators.

Each function depends only on the values that determine its element. Therefore, elements can be reused if these values have not changed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import lru_cache
from typing import Any

from thingc.base.inertia import LEAST_MOMENT, ZERO, MassProperties, physical_fault, principal_moments, within_triangle
from thingc.base.numeric import maximum
from thingc.base.pose import IDENTITY, Pose, Vector
from thingc.base.source import Origin
from thingc.model.assembly.types import ActuatorModel
from thingc.model.resolve.coordinates import Dynamics
from thingc.model.resolve.types import ContactPair, Material
from thingc.model.robot.types import TreeJoint
from thingc.targets import geometry
from thingc.targets.geometry import MeshAsset, Shape, Shapes, channels, material_name, name_with_index
from thingc.targets.mjcf.accepted_models import is_shell
from thingc.targets.mjcf.drives import both_ways, drive_attributes, joint_range
from thingc.targets.mjcf.lowering import mujoco_joints
from thingc.targets.xml_writer import Element, XmlValue

GRID = 0.1
"""Distance [m] between the grid lines that MuJoCo may draw on a plane. MuJoCo requires a value for this attribute."""


def make_elements(make: Callable[..., tuple[Element, ...]], *inputs: Any) -> tuple[tuple[Element, ...], frozenset[str]]:
    """Call `make(*inputs)`, and return the created elements with the names that raw attributes use for them."""
    elements = make(*inputs)
    return elements, frozenset(element.get("name").replace(".", "/") for element in elements)


def meshes(meshes: tuple[MeshAsset, ...]) -> tuple[Element, ...]:
    """Return the `mesh` elements of the section `asset`."""
    elements: list[Element] = []
    for mesh in meshes:
        attributes: dict[str, XmlValue] = {"name": mesh.name, "file": mesh.file}
        if mesh.original is not None and mesh.scale not in (None, (1.0, 1.0, 1.0)):
            attributes["scale"] = mesh.scale
        if is_shell(mesh):
            attributes["inertia"] = "shell"
        elements.append(Element(tag="mesh", attributes=attributes, origin=mesh.origin))
    return tuple(elements)


def materials(shapes: tuple[Shapes, ...]) -> tuple[Element, ...]:
    """Return a `material` element for each colour of the robot."""
    return tuple(
        Element(tag="material", attributes={"name": name, "rgba": channels(color)}, origin=origin)
        for name, (color, origin) in geometry.materials(shapes).items()
    )


def site(path: str, pose: Pose, origin: Origin) -> tuple[Element, ...]:
    """Return the `site` element for a named frame."""
    return (Element(tag="site", attributes={"name": path, **pose_attributes(pose)}, origin=origin),)


def joint(joint: TreeJoint, driven: bool) -> tuple[Element, ...]:
    """Return the `joint` elements of a joint coordinate: a hinge, a slide, or both for a screw.

    If `driven` is True, the effort limit is written to the actuator of the joint. Otherwise, the effort limit is written to the joint
    itself.
    """
    pos: dict[str, XmlValue] = {"pos": joint.twist.anchor} if any(joint.twist.anchor) else {}
    attributes, *others = ({"name": item.name, "type": item.type, **pos, "axis": item.axis} for item in mujoco_joints(joint))
    bounds = joint_range(joint.limit)
    if bounds is not None:
        attributes["range"] = bounds
    if joint.limit.effort is not None and not driven:
        attributes["actuatorfrcrange"] = both_ways(joint.limit.effort)
    attributes |= dynamics_attributes(joint.dynamics)
    return tuple(Element(tag="joint", attributes=item, origin=joint.origin) for item in (attributes, *others))


def ball(name: str, joint: TreeJoint) -> tuple[Element, ...]:
    """Return the `joint` element of a ball joint.

    The argument `joint` can be any coordinate of the ball joint, because the coordinates differ only in their axes.
    """
    attributes: dict[str, XmlValue] = {"name": name, "type": "ball"}
    if any(joint.twist.anchor):
        attributes["pos"] = joint.twist.anchor
    if joint.limit.cone is not None:
        attributes["range"] = (0.0, joint.limit.cone)
    return (Element(tag="joint", attributes=attributes | dynamics_attributes(joint.dynamics), origin=joint.origin),)


def dynamics_attributes(dynamics: Dynamics) -> dict[str, XmlValue]:
    """Return the passive properties of a joint or a tendon, such as damping and friction, as MJCF attributes."""
    return {
        name: value for name, value in (
            ("stiffness", dynamics.stiffness), ("damping", dynamics.damping), ("frictionloss", dynamics.friction),
            ("armature", dynamics.armature), ("springref", dynamics.rest),
        ) if value is not None
    }


Masks = tuple[int, int]
"""The attributes `contype` and `conaffinity` of a geom."""


def named_collision(shapes: Shapes) -> Iterator[tuple[str, Shape]]:
    """Yield the collision shapes of an occurrence with the names of their geoms."""
    for index, shape in enumerate(shapes.collision):
        yield shape.name or name_with_index(f"{shapes.path}:collision", index), shape


def pair(settings: ContactPair[int], first: Material | None, second: Material | None) -> dict[str, XmlValue]:
    """Return the attributes of a `pair` element for two materials, other than its geoms.

    The friction is always written, because MuJoCo does not derive the friction of a pair from its geoms. Without a friction in the
    settings, the friction of the two materials is combined as MuJoCo combines the friction of two geoms.
    """
    attributes: dict[str, XmlValue] = {
        key: value for key, value in (("margin", settings.margin), ("gap", settings.gap)) if value is not None
    }
    materials = [material for material in (first, second) if _friction(material)] or [None]
    kinds = [(None, None, None) if material is None else (material.slide, material.torsion, material.roll) for material in materials]
    if settings.friction != (None, None, None):
        kinds = [settings.friction]
    combined = [_coefficients(*kind) for kind in kinds]
    slide, torsion, roll = (maximum(column) for column in zip(*(coefficients for coefficients, _ in combined), strict=True))
    condim = sorted(condim for _, condim in combined)[-1]
    return {**attributes, "condim": condim, "friction": (slide, slide, torsion, roll, roll)}


def geoms(
    poses: tuple[Pose, ...], shapes: tuple[Shapes, ...], collision_class: str, reserved: frozenset[str], masks: tuple[Masks | None, ...],
) -> tuple[Element, ...]:
    """Return the visual geoms and the collision geoms of a link. The collision geoms have the default class `collision_class`.

    For each occurrence of the link, `poses` contains its pose in the link, `shapes` its shapes, and `masks` its contact masks, or None
    outside contact groups. `reserved` contains all custom names of shapes in the model. If a visual shape and a collision shape have the
    same name, only the collision geom gets this name.
    """
    elements: list[Element] = []
    for pose, occurrence, mask in zip(poses, shapes, masks, strict=True):
        used = {shape.name for shape in occurrence.collision}
        for index, shape in enumerate(occurrence.visual):
            name = shape.name or occurrence.path
            if index and not shape.name or name in (used if shape.name else reserved):
                name = name_with_index(f"{name}:visual", index)  # do not use `cap_1`, which may be the name of another component
            used.add(shape.name)
            attributes = {"name": name, "class": "visual", **_shape(shape, pose)}
            material = material_name(shape.material, shape.color)
            if material is not None:
                attributes["material"] = material
            elements.append(Element(tag="geom", attributes=attributes, origin=shape.origin or occurrence.origin))
        mask_attributes: dict[str, XmlValue] = {} if mask is None else {"contype": str(mask[0]), "conaffinity": str(mask[1])}
        for name, shape in named_collision(occurrence):
            attributes = {"name": name, "class": collision_class, **_shape(shape, pose), **_friction(shape.material), **mask_attributes}
            elements.append(Element(tag="geom", attributes=attributes, origin=shape.origin or occurrence.origin))
    return tuple(elements)


def drive(joint: TreeJoint, drive: ActuatorModel, step: float, ball: str | None = None, axis: Vector | None = None) -> tuple[Element, ...]:
    """Return the actuator element for the drive of a joint. `step` is the time step [s].

    For a drive of the ball joint `ball`, the attribute `gear` is the `axis` of the torque in the frame of the body. If the joint is
    reversed, the axis is fixed to the parent in the tree of the mode.
    """
    target = "jointinparent" if ball is not None and joint.reversed else "joint"
    attributes = {"name": drive.name or joint.path, target: ball or joint.path, **drive_attributes(joint, drive, step)}
    return (Element(tag=drive.kind, attributes=attributes if axis is None else attributes | {"gear": axis}, origin=drive.origin),)


def key(attributes: tuple[tuple[str, XmlValue], ...], origin: Origin) -> tuple[Element, ...]:
    """Return the `key` element for a pose of the mode."""
    return (Element(tag="key", attributes=dict(attributes), origin=origin),)


def _shape(shape: Shape, pose: Pose) -> dict[str, XmlValue]:
    if shape.kind == "mesh":
        return {"mesh": shape.mesh or "", **pose_attributes(pose @ shape.pose)}
    size = (*shape.size, GRID) if shape.kind == "plane" else shape.size
    return {"type": shape.kind, "size": size, **pose_attributes(pose @ shape.pose)}


def _friction(material: Material | None) -> dict[str, XmlValue]:
    """Return the friction attributes of a geom, with the defaults of MuJoCo for values that the material does not specify.

    The result is empty if the material does not specify any friction. When two geoms touch, MuJoCo uses the larger friction, so a floor
    could override the value of the document. To prevent this, the geom gets a priority. For two geoms of the robot, MuJoCo still uses the
    larger value. Torsional friction requires `condim` 4, and rolling friction requires `condim` 6.
    """
    if material is None or (material.slide is None and material.torsion is None and material.roll is None):
        return {}
    coefficients, condim = _coefficients(material.slide, material.torsion, material.roll)
    attributes: dict[str, XmlValue] = {"friction": coefficients, "priority": "1"}
    return attributes if condim == "3" else {**attributes, "condim": condim}


def _coefficients(slide: float | None, torsion: float | None, roll: float | None) -> tuple[Vector, str]:
    """Return the friction coefficients, with the defaults of MuJoCo, and the attribute `condim` that they require."""
    condim = "6" if roll is not None else "4" if torsion is not None else "3"
    return (1.0 if slide is None else slide, 0.005 if torsion is None else torsion, 0.0001 if roll is None else roll), condim


def inertial(properties: MassProperties, origin: Origin) -> tuple[Element, ...]:
    """Return the `inertial` element of a link: mass [kg], centre of mass [m], and inertia about it [kg m^2], in the link frame.

    A link that never moves may have an inertia of almost 0, or one that no solid can have (a point mass). MuJoCo cannot compute the
    principal axes of such an inertia, which has no effect, so it is written as 0.
    """
    inertia = properties.inertia
    attributes: dict[str, XmlValue] = {"pos": properties.centre, "mass": properties.mass}
    if inertia == ZERO or physical_fault(inertia) is not None or principal_moments(inertia)[0] < LEAST_MOMENT * (1.0 + 1e-9):
        attributes["diaginertia"] = "0 0 0"
    else:
        i = within_triangle(inertia)
        attributes["fullinertia"] = (i[0][0], i[1][1], i[2][2], i[0][1], i[0][2], i[1][2])
    return (Element(tag="inertial", attributes=attributes, origin=origin),)


def pose_attributes(pose: Pose) -> dict[str, XmlValue]:
    """Return the attributes `pos` [m] and `quat` (w, x, y, z) of a pose. A `pos` of zero and a `quat` that is the identity are omitted."""
    return dict(_pose_texts(pose))


@lru_cache(maxsize=4096)
def _pose_texts(pose: Pose) -> tuple[tuple[str, XmlValue], ...]:
    attributes: list[tuple[str, XmlValue]] = []
    if any(component != 0.0 for component in pose.translation):
        attributes.append(("pos", pose.translation))
    if pose.rotation != IDENTITY:
        attributes.append(("quat", pose.quaternion()))
    return tuple(attributes)
