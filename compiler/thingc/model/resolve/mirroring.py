"""Create the mirror image of a nested document: mirror every part, and reflect every placement and motion.

Mirror images of symmetric parts, such as screws, bearings and plates, are later replaced by the original part.

Let S be the reflection in the frame of each component, and D the reflection in the frame of each mount (see `thingc.base.pose`). The
relative pose of components mated by mounts A and B becomes

    X'_PC = S X_PC S = (S X_PA D) (D Rz(turn) Tz(gap) X_J(q + offset) M D) inv(S X_CB D)

The factor in the middle is `Rz(pi - turn) Tz(gap) Rx(pi) X_J'(q + offset) Rx(pi) M`, where X_J' is X_J with negated slides. Rotations about
the axes of an inverted frame are therefore unchanged, and a joint with the same q is the mirror image. (Coincident mounts are mated without
M. The middle factor is then the same motion about -D axis, with slides along D axis.) Limits, poses, drives, mimics and loops are
unchanged. A component that is placed `at` X in a frame is then at `D X D`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from msgspec.structs import replace

from thingc.base.pose import Mirror, Vector
from thingc.geometry.record import PartDefinition, PartFailure, PartRecord, with_mirror
from thingc.model.resolve.link_definition import LinkDefinition
from thingc.model.resolve.types import AssemblyDefinition, At, Attach, Component, Joint, Overrides, StatedValue

AT_MOUNT = Mirror("y")
"""The reflection D in the frame of a mount."""


def mirror_assembly(definition: AssemblyDefinition, axis: str, met: dict[int, AssemblyDefinition] | None = None) -> AssemblyDefinition:
    """Create the mirror image of an assembly, reflected along `axis` of the assembly's frame.

    If the assembly is already a mirror image along this axis, return the original.

    No component in the assembly may be mirrored along another axis (see `other_axis`). `met` contains the mirror images of nested
    assemblies, so that equal definitions remain the same object.
    """
    met = {} if met is None else met
    if definition.plain is not None:
        return definition.plain
    if id(definition) not in met:
        met[id(definition)] = replace(
            definition, text=with_mirror(definition.text, axis), label=with_mirror(definition.label, axis), mirror=axis, plain=definition,
            components=tuple(_component(component, axis, met) for component in definition.components),
            joints=tuple(map(_mirror_joint, definition.joints)),
        )
    return met[id(definition)]


def other_axis(definition: AssemblyDefinition, axis: str) -> tuple[str, str] | None:
    """Return the dotted path and the mirror axis of a component that is already mirrored along another axis, or None."""
    for component in definition.components:
        inner = component.definition
        if inner is None:
            continue
        if inner.mirror is not None and inner.mirror != axis:
            return component.name, inner.mirror
        below = other_axis(inner, axis) if isinstance(inner, AssemblyDefinition) else None
        if below is not None:
            return f"{component.name}.{below[0]}", below[1]
    return None


def _component(component: Component, axis: str, met: dict[int, AssemblyDefinition]) -> Component:
    definition, bom = component.definition, component.bom
    if isinstance(definition, PartDefinition):
        bom = replace(bom, number=None)  # the order number of the part does not apply to its mirror image
    if isinstance(definition, PartDefinition | LinkDefinition):
        definition = definition.plain or definition.mirror_image(axis)
    elif definition is not None:
        definition = mirror_assembly(definition, axis, met)
    return replace(
        component, definition=definition, bom=bom, image_of=component, overrides=_overrides(component.overrides, axis),
        placement=_placement(component.placement) if component.placement is not None else None,
        mounts={name: mount.mirror_image(axis) for name, mount in component.mounts.items()},
    )


def _overrides(overrides: Overrides, axis: str) -> Overrides:
    mirror = Mirror(axis)
    x, y, z = mirror.signs
    return replace(
        overrides, shapes=_shapes(overrides.shapes, axis), com=_mirror_stated(overrides.com, mirror.signs),
        up=mirror.vector(overrides.up) if isinstance(overrides.up, tuple) else overrides.up,
        variants={path: replace(choice, shapes=_shapes(choice.shapes, axis)) for path, choice in overrides.variants.items()},
        inertia=_mirror_stated(overrides.inertia, (1.0, 1.0, 1.0, x * y, x * z, y * z)),
    )


def _shapes(shapes: LinkDefinition | None, axis: str) -> LinkDefinition | None:
    return shapes and (shapes.plain or shapes.mirror_image(axis))


def _mirror_stated(value: StatedValue | None, signs: tuple[float, ...]) -> StatedValue | None:
    if value is None:
        return None
    return replace(value, value=tuple(entry * sign + 0.0 for entry, sign in zip(value.value, signs, strict=True)))


def _placement(placement: Attach | At) -> Attach | At:
    if isinstance(placement, Attach):
        return replace(placement, turn=math.pi - placement.turn)
    return replace(placement, pose=AT_MOUNT.frame(placement.pose))


def _mirror_joint(joint: Joint) -> Joint:
    """Return the mirror image of a joint, or of one of its coordinates."""
    twist = joint.twist
    if joint.axis is not None:
        image = None if twist is None else replace(twist, angular=_mirror_axis(twist.angular), linear=AT_MOUNT.vector(twist.linear))
        return replace(joint, axis=_mirror_axis(joint.axis), gap=-joint.gap, twist=image, pose=AT_MOUNT.frame(joint.pose))
    if twist is not None and any(twist.linear):
        x, y, z = twist.linear
        twist = replace(twist, linear=(-x + 0.0, -y + 0.0, -z + 0.0))
    return replace(joint, turn=math.pi - joint.turn, twist=twist, mirrored=not joint.mirrored, pose=AT_MOUNT.frame(joint.pose))


def _mirror_axis(axis: Vector) -> Vector:
    """Return `-D axis`, which is the rotation axis of the mirror image of a joint. The rotation angle is unchanged."""
    x, y, z = AT_MOUNT.vector(axis)
    return (-x + 0.0, -y + 0.0, -z + 0.0)


def with_own_images(model: AssemblyDefinition, records: Mapping[str, PartRecord | PartFailure]) -> AssemblyDefinition:
    """Return a copy of the model in which mirror images of symmetric parts are replaced by the original part.

    The replaced component also gets the order number of the original component in the bill of materials.

    `records` contains the records of all definitions in the model, and of the originals of mirror images.
    """
    def with_original(component: Component) -> Component:
        definition = component.definition
        if not isinstance(definition, PartDefinition) or component.image_of is None or definition.plain is None:
            return component
        image, plain = (records.get(text) for text in (definition.text, definition.plain.text))
        if not isinstance(image, PartRecord) or not isinstance(plain, PartRecord) or not image.own_image:
            return component
        if (image.com, image.matrix) != (plain.com, plain.matrix):  # the specified centres of mass and inertias
            return component
        return replace(component, definition=definition.plain, bom=component.image_of.bom, mounts_mirrored=definition.mirror)

    return with_components(model, with_original)


def with_components(model: AssemblyDefinition, change: Callable[[Component], Component]) -> AssemblyDefinition:
    """Return a copy of the model in which `change` has replaced every component at every level, inner components first."""
    results: dict[int, AssemblyDefinition] = {}  # equal definitions remain the same object, and unchanged definitions are not copied

    def of(definition: AssemblyDefinition) -> AssemblyDefinition:
        if id(definition) not in results:
            components = tuple(map(of_component, definition.components))
            same = all(new is old for new, old in zip(components, definition.components, strict=True))
            results[id(definition)] = definition if same else replace(definition, components=components)
        return results[id(definition)]

    def of_component(component: Component) -> Component:
        inner = of(component.definition) if isinstance(component.definition, AssemblyDefinition) else component.definition
        return change(component if inner is component.definition else replace(component, definition=inner))

    return of(model)
