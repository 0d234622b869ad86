"""Collect the names that editors suggest for an assembly document.

The names are from the model of the document and from its syntax tree. The model contains only valid elements. The syntax tree also contains
names in lines with errors.
"""

from __future__ import annotations

from collections.abc import Mapping

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.grouping import group_by
from thingc.base.interfaces import format_interface
from thingc.base.source import MappingNode, Node, ScalarNode, entries_of
from thingc.base.units import ANGLE, LENGTH, Quantity
from thingc.geometry.record import MountRecord, PartDefinition, PartFailure, PartRecord, PartSchema
from thingc.model.resolve.link_definition import LinkDefinition
from thingc.model.resolve.types import AssemblyDefinition, Component, Joint
from thingc.tools.schemas.parameter_schemas import parse_value, symbols_of, within

ORIGIN = "origin"
MAX_NAMES = 2000
"""Maximum number of suggested mounts, components or joints of a document."""

Names = dict[str, str]
"""Maps names to descriptions."""
Records = Mapping[str, PartRecord | PartFailure]


class WrittenComponent(FrozenStruct):
    """A component in the text of a document. The components that a `repeat` creates are described as one component.

    Attributes:
        label: A short description.
        what: A sentence that describes the component.
        mounts: The mounts of the component by name.
        pattern: A regular expression that matches the names of all items of the component.
        source: The key and the value that define the content of the component, such as `part` and `arm:BasePlate`, or None.
        sure: Whether `mounts` is complete.
        actuator: Whether the key `drive` of a joint can refer to the component.
    """

    name: str
    items: tuple[str, ...]
    pattern: str
    source: tuple[str, str] | None
    label: str
    what: str
    mounts: Names
    sure: bool
    assembly: bool
    actuator: bool


class DocumentFacts(FrozenStruct):
    """The names in a document that editors suggest, with their descriptions.

    `mounts` contains references such as `plate.servo_seat`. `components` and `joints` contain dotted paths, including elements of nested
    documents. `parameters` maps the parameters of the document to their values. `nested_poses` maps components to the poses of the nested
    documents. `materials_sure` specifies whether `materials` is complete.
    """

    pieces: tuple[WrittenComponent, ...] = ()
    mounts: Names = {}
    components: Names = {}
    joints: dict[str, JointFacts] = {}
    exports: Names = {}
    poses: Names = {}
    nested_poses: dict[str, tuple[str, ...]] = {}
    modes: Names = {}
    motions: Names = {}
    materials: Names = {}
    materials_sure: bool = False
    parameters: dict[str, Quantity] = {}


class JointFacts(FrozenStruct):
    """The description of a joint, and the properties that editors need to suggest values for the joint.

    `what` is the description of the joint. `angle` specifies whether the joint coordinate is an angle, and is None if this is unknown or if
    the joint has several coordinates. `settable` specifies whether poses can set the joint. `own` is false for a joint of a nested
    document.
    """

    what: str
    angle: bool | None
    settable: bool
    own: bool


def facts_of(
    tree: MappingNode, model: AssemblyDefinition | None, records: Records, schemas: Mapping[str, PartSchema | PartFailure],
    usual: Mapping[str, Names],
) -> DocumentFacts:
    """Return the names for completion in editors: components, joints, mounts and others of one document.

    `usual` contains the default mounts of part classes, for parts whose mounts are unknown.
    """
    parts = {} if model is None else _by_item(model)
    pieces = tuple(_piece(name, node, parts.get(name, ()), records, schemas, usual) for name, node in _entries(tree, "components").items())
    mounts: Names = {}
    components: Names = {}
    for piece in pieces:
        for item in piece.items:
            components[item] = piece.what
            mounts.update({f"{item}.{mount}": text for mount, text in piece.mounts.items()})
            if len(mounts) > MAX_NAMES:
                break
    if model is not None:
        components.update(_inner_components(model, ""))
    materials = {} if model is None else {name: _material(one.density, one.slide) for name, one in sorted(model.materials.items())}
    inline = _entries(tree, "materials")
    return DocumentFacts(
        pieces=pieces, mounts=_first(mounts), components=_first(components), joints=_joints(tree, model),
        exports={name: _scalar_text(node) for name, node in _entries(tree, "mounts").items()},
        poses={name: _summary(node) for name, node in _entries(tree, "poses").items()},
        nested_poses={} if model is None else {
            component.name: tuple(pose.name for pose in component.definition.poses)
            for component in model.components if isinstance(component.definition, AssemblyDefinition)
        },
        modes={name: _summary(node) for name, node in _entries(tree, "modes").items()},
        motions=dict.fromkeys(_entries(tree, "motions"), ""),
        materials={**dict.fromkeys(inline, ""), **materials},
        materials_sure=model is not None and model.materials_known and not inline and bool(materials),
        parameters={
            name: quantity for name, one in symbols_of(tree).parameters.items() if (quantity := parse_value(one.value)) is not None
        },
    )


def _first(names: Names) -> Names:
    return names if len(names) <= MAX_NAMES else dict(list(names.items())[:MAX_NAMES])


def _entries(tree: Node, section: str) -> Mapping[str, Node]:
    return entries_of(entries_of(tree).get(section))


def _scalar_text(node: Node | None) -> str:
    return str(node.value) if isinstance(node, ScalarNode) and node.value is not None else ""


def _summary(node: Node) -> str:
    """Format the first eight scalar entries of a mapping on one line: `yaw: 30 deg, elbow: 120 deg`."""
    entries = [f"{key}: {_scalar_text(one)}" for key, one in entries_of(node).items() if _scalar_text(one)]
    return ", ".join(entries[:8]) + (", ..." if len(entries) > 8 else "")


def _by_item(model: AssemblyDefinition) -> dict[str, tuple[Component, ...]]:
    """Group the components of a model by the name in the document. The components that a `repeat` creates form one group."""
    by_name: dict[str, tuple[Component, ...]] = {}
    for items in group_by(model.components, lambda component: (component.origin[0].line, component.origin[0].column)).values():
        name = items[0].name
        by_name[name] = tuple(items)
        if name.rpartition("_")[2].isdigit():
            by_name.setdefault(name.rpartition("_")[0], tuple(items))
    return by_name


def _piece(
    name: str, node: Node, components: tuple[Component, ...], records: Records, schemas: Mapping[str, PartSchema | PartFailure],
    usual: Mapping[str, Names],
) -> WrittenComponent:
    entries = entries_of(node)
    source = next(((key, _scalar_text(entries[key])) for key in ("part", "file", "assembly") if _scalar_text(entries.get(key))), None)
    repeated = "repeat" in entries
    items = tuple(component.name for component in components) or ((f"{name}_0",) if repeated else (name,))
    mounts: Names = {}
    is_exact = bool(components)
    for component in components:
        names = _mounts_of(component, records)
        is_exact = is_exact and names is not None and _exact(component, records)
        mounts.update(names or {})
    if not is_exact and source is not None:
        mounts = {**usual.get(source[1], {}), **mounts}
    mounts.setdefault(ORIGIN, f"The frame of `{name}` itself.")
    for extra in _entries(node, "mounts"):
        mounts.setdefault(extra, f"Added to `{name}` by this document.")
    schema = schemas.get(source[1]) if source is not None and source[0] == "part" else None
    label = _label(source, components)
    return WrittenComponent(
        name=name, items=items, pattern=rf"{name}_\d+" if repeated else name, source=source, label=label,
        what=_what(label, source, components, schema),
        mounts=_first(mounts), sure=is_exact, assembly=source is not None and source[0] == "assembly",
        actuator=isinstance(schema, PartSchema) and schema.actuator,
    )


def _label(source: tuple[str, str] | None, components: tuple[Component, ...]) -> str:
    if source is None:
        has_no_part = components and (components[0].frame or isinstance(components[0].definition, LinkDefinition))
        return f"a {components[0].label}" if has_no_part else "a component"
    definition = components[0].definition if components else None
    return definition.label if isinstance(definition, PartDefinition) else source[1]


def _what(label: str, source: tuple[str, str] | None, components: tuple[Component, ...], schema: PartSchema | PartFailure | None) -> str:
    definition = components[0].definition if components else None
    if isinstance(definition, LinkDefinition):
        return f"A {label.removeprefix('a ')} with shapes."
    if source is None:
        return "A frame: a component without geometry." if components and components[0].frame else "A component."
    doc = schema.doc.strip().partition("\n")[0] if isinstance(schema, PartSchema) else ""
    if isinstance(definition, AssemblyDefinition):
        doc = " ".join(definition.description.split())
    return f"`{label}`" + (f": {doc}" if doc else "")


def _exact(component: Component, records: Records) -> bool:
    """Return whether the mounts in the record of a part are correct.

    They can be wrong in a placeholder record of a part that was not built.
    """
    record = records.get(component.definition.text) if isinstance(component.definition, PartDefinition) else None
    return not isinstance(record, PartRecord) or record.exact


def _mounts_of(component: Component, records: Records) -> Names | None:
    """Return the mounts of a component with their descriptions, or None if the mounts are unknown.

    The name of a mount in a nested assembly includes its component, such as `cap.pen`.
    """
    mounts: Names = {}
    definition = component.definition
    if isinstance(definition, PartDefinition):
        record = records.get(definition.text)
        if not isinstance(record, PartRecord):
            return None
        mounts = {name: _of_mount(definition.label, mount) for name, mount in sorted(record.mounts.items())}
    elif isinstance(definition, AssemblyDefinition):
        if not definition.whole:
            return None
        mounts = {name: f"Exported by `{definition.document}`: `{shown.text}`." for name, shown in definition.mounts.items()}
        for inner in definition.components:
            below = _mounts_of(inner, records)
            mounts.update({f"{inner.name}.{name}": text for name, text in (below or {}).items()})
            mounts[f"{inner.name}.{ORIGIN}"] = f"The frame of `{inner.name}`."
    elif definition is None and not component.frame:
        return None
    mounts.update(dict.fromkeys(component.mounts, f"Added to `{component.name}`."))
    return mounts


def usual_mounts(record: PartRecord) -> Names:
    """Return the description of each mount of a built part. These are the default mounts of the part class."""
    return {name: _of_mount(record.text, mount) for name, mount in sorted(record.mounts.items())}


def _of_mount(label: str, mount: MountRecord) -> str:
    interface = format_interface(mount.interface, mount.features)
    return f"A mount of `{label}`" + (f", interface `{interface}`." if interface else ".")


def _inner_components(model: AssemblyDefinition, prefix: str) -> Names:
    names: Names = {}
    for component in model.components:
        definition = component.definition
        if isinstance(definition, AssemblyDefinition):
            for inner in definition.components:
                label = inner.definition.label if inner.definition is not None else "a frame"
                names[f"{prefix}{component.name}.{inner.name}"] = f"`{label}` in `{definition.document}`."
            names.update(_inner_components(definition, f"{prefix}{component.name}."))
    return names


def _joints(tree: MappingNode, model: AssemblyDefinition | None) -> dict[str, JointFacts]:
    joints = {} if model is None else _joints_of(model, "")
    names = {name for joint in joints for name in (joint, joint.rpartition("_")[0])}
    for name, node in _entries(tree, "joints").items():
        if name not in names:
            kind = _scalar_text(entries_of(node).get("type"))
            joints[name] = JointFacts(what=f"A {kind} joint." if kind else "A joint.", angle=None, settable=True, own=True)
    return joints


def _joints_of(model: AssemblyDefinition, prefix: str) -> dict[str, JointFacts]:
    joints = {f"{prefix}{joint.name}": _joint_facts(joint, own=not prefix) for joint in model.joints}
    for component in model.components:
        if isinstance(component.definition, AssemblyDefinition):
            joints.update(_joints_of(component.definition, f"{prefix}{component.name}."))
        if len(joints) > MAX_NAMES:
            break
    return joints


def _joint_facts(joint: Joint, *, own: bool) -> JointFacts:
    coordinate = joint.twist.coordinate if joint.twist is not None else None
    angle = None if coordinate is None else coordinate == ANGLE
    bounds = (joint.limit.lower, joint.limit.upper)
    limits = within(*(None if bound is None else Quantity(bound, coordinate or LENGTH).format(12) for bound in bounds))
    text = f"{joint.kind.name.capitalize()}, from `{joint.parent.text}` to `{joint.child.text}`{f'; {limits}' if limits else ''}."
    if joint.mimic is not None:
        text += f" Mimics `{joint.mimic.joint}`."
    return JointFacts(what=text, angle=angle, settable=coordinate is not None and joint.mimic is None and not joint.kind.at_once, own=own)


def _material(density: float | None, slide: float | None) -> str:
    lines = [] if density is None else [f"{density:.12g} kg/m^3"]
    return ", ".join([*lines, *([] if slide is None else [f"friction {slide:.12g}"])])

