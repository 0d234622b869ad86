"""Resolve an assembly document with its parameters, section by section."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import chain

from msgspec.structs import replace

from thingc.base.diagnostics import Code, make_notes
from thingc.base.joints.kinds import coordinates_of
from thingc.base.source import Path
from thingc.base.suggestions import did_you_mean
from thingc.documents.expressions.evaluation import ExpressionValue, format_value
from thingc.documents.expressions.terms import CONSTANTS, FUNCTIONS, Expression
from thingc.documents.spec.assembly import AssemblySpec, DetailSpec
from thingc.geometry.record import definition_label, definition_text
from thingc.model.resolve import choices as chosen, references
from thingc.model.resolve.bom import catalog
from thingc.model.resolve.components import components, nodes
from thingc.model.resolve.contacts import components_fitting
from thingc.model.resolve.document_scope import DocumentScope, ResolveRun
from thingc.model.resolve.joints import joints
from thingc.model.resolve.materials import in_scope, unreadable
from thingc.model.resolve.mimics import mimics
from thingc.model.resolve.modes import modes, place_in_modes, simulation, step_origin
from thingc.model.resolve.motions import motions
from thingc.model.resolve.names import names
from thingc.model.resolve.parameters import canonical, check_bounds, declared_parameters, evaluate_parameters
from thingc.model.resolve.placement import Places, check, own_placements
from thingc.model.resolve.poses import poses
from thingc.model.resolve.raw import added_elements, raw
from thingc.model.resolve.repeats import check_names, unroll
from thingc.model.resolve.scope import DefaultLayers, Scope
from thingc.model.resolve.sensors import sensors
from thingc.model.resolve.set_values import substitute
from thingc.model.resolve.tendons import tendons
from thingc.model.resolve.tests import tests
from thingc.model.resolve.transmissions import names_of, transmissions
from thingc.model.resolve.types import AssemblyDefinition, ChoicePath, Component, LinkName, Reference

MAX_DEFINITIONS = 2000
"""Maximum number of times that documents are resolved with different parameters. For example, thirty documents, each of which nests the
next document twice with other parameters, would be resolved 2^30 times.
"""


def resolve_assembly(
    context: ResolveRun, relative: str, spec: AssemblySpec, overrides: Mapping[str, ExpressionValue | Expression],
    choices: chosen.Choices = (), *, top: bool = False,
) -> DocumentScope:
    """Resolve an assembly document with parameters and choices.

    Return the scope of the document, which contains the resolved `definition`. For equal arguments, the same scope is returned.

    Modes are only resolved for the `top` document, because a parent assembly does not use the modes of nested documents.
    """
    document = context.documents.by_path[relative]
    declared = declared_parameters(context, document, spec)
    evaluated = evaluate_parameters(document, spec, overrides, context.report, context.doubts(document)) if overrides else declared
    values = evaluated.values
    choices = chosen.without_written(context, relative, spec, choices) if choices else ()
    parameters = tuple(sorted((*canonical(values), *choices)))
    key = (relative, parameters)
    cached = context.table(key)
    if cached is not None:
        return cached
    document, spec = substitute(context, document, spec, chosen.values(choices))
    scope = context.scope(document, values, evaluated.broken)
    _check_count(context, scope)
    if overrides:
        check_bounds(scope, spec, [name for name in values if name not in overrides])
    named = (spec.name, dict(parameters), dict(canonical(declared.values)))
    table = DocumentScope(
        document=document, spec=spec, scope=scope, parameters=parameters, text=definition_text(*named),
        label=definition_label(*named, {name: format_value(value) for name, value in values.items()}), choices=choices,
    )
    context.tables[key] = table
    _fill(context, table, top=top)
    return table


def _check_count(context: ResolveRun, scope: Scope) -> None:
    """Report an error, at most once, that there are too many nested documents."""
    if len(context.tables) >= MAX_DEFINITIONS and not context.overfull:
        context.overfull = True
        scope.error(
            Code.TOO_MANY, f"more than {MAX_DEFINITIONS} nested assemblies with different parameters", ("name",),
            help="nest fewer documents, or use fewer different values of their parameters",
        )


def _fill(context: ResolveRun, table: DocumentScope, *, top: bool) -> None:
    """Resolve all sections of a document in the order of their dependencies, and store the resulting definition in `table`."""
    scope, spec = table.scope, table.spec
    _check_names(scope, spec)
    table.materials = in_scope(context, scope, spec)
    table.materials_unreadable = unreadable(context, scope, spec)
    if table.choices:
        spec = table.spec = chosen.with_default_material(context, table)
    parts, table.unbuilt = unroll(scope, "components", spec.components, spec.parameters)
    moving, table.unbuilt_joints = unroll(scope, "joints", spec.joints, spec.parameters)
    geared, _ = unroll(scope, "transmissions", spec.transmissions, spec.parameters)
    check_names(scope, chain(
        ((item.name, item.path, "a component") for item in parts),
        ((name, ("mounts", name), "an exported mount") for name in spec.mounts),
    ))
    check_names(scope, chain(
        ((item.name, item.path, "a joint") for item in moving),
        ((name, ("tendons", name), "a tendon") for name in spec.tendons),
        ((f"{j.name}_{k}", j.path, f"a coordinate of joint `{j.name}`") for j in moving for k in coordinates_of(j.spec.type)),
        names_of(geared),
    ))
    check_names(scope, ((item.name, item.path, "a transmission") for item in geared), reserved=False)
    nodes(context, table, parts, resolve_assembly)
    places: Places = {}
    placements = own_placements(context, table, places)
    unknown_child = joints(table, moving, places)
    unknown_child = place_in_modes(table, placements) or unknown_child
    table.has_modes = bool(table.by_mode) or any(node.table is not None and node.table.has_modes for node in table.nodes.values())
    mimics(table, moving)
    transmissions(table, geared, [item.name for item in moving if item.spec.drive is not None])
    check(table, places, unknown_child=unknown_child)
    _exports(table, scope)
    links = tuple(_links(table, scope))
    poses(table, scope)
    if top:
        motions(context, table, scope)
    resolved = tuple(components(context, table, placements))
    model = _definition(context, table, resolved, links, top)
    table.definition = replace(model, omitted=_omitted_details(table, spec.detail, model)) if top and spec.detail is not None else model


def _definition(
    context: ResolveRun, table: DocumentScope, resolved: tuple[Component, ...], links: tuple[LinkName, ...], top: bool,
) -> AssemblyDefinition:
    """Create the definition of an assembly from the resolved sections of its document."""
    scope, spec = table.scope, table.spec
    inputs = (spec.modes, context.values(scope, "modes", spec.modes), *context.around(table))
    own_modes = context.sound("modes", inputs, lambda: modes(table, scope)) if top else ()
    settings = DefaultLayers(((spec.simulation, ("simulation",)),)) if spec.simulation else DefaultLayers(())
    tendons_ = (*tendons(table, scope), *table.coupled)
    return AssemblyDefinition(
        document=table.document.relative, name=spec.name, description=spec.description, parameters=table.parameters, text=table.text,
        label=table.label, materials={name: value for name, value in table.materials.items() if value is not None}, components=resolved,
        joints=context.same("joint", table.document.relative, [joint for joint in table.joints.values() if joint is not None]),
        links=links, mounts={name: mount for name, mount in table.exports.items() if mount is not None},
        poses=tuple(pose for pose in table.poses.values() if pose is not None), modes=own_modes,
        motions=tuple(motion for motion in table.motions.values() if motion is not None), simulation=simulation(scope, settings),
        step_origin=step_origin(scope, settings), raw=raw(scope, spec.raw), added=added_elements(scope, spec.raw), tendons=tendons_,
        sensors=tuple(sensors(table, scope, tendons_)), names=tuple(names(table, scope)),
        tests=tuple(tests(context, table, scope, own_modes)) if top and spec.tests else (), origin=scope.origin(("name",)),
        materials_known=not table.materials_unreadable, whole=not scope.doubts, loose=tuple(table.loose),
        catalog=catalog(context, scope, spec), order=tuple(_order(table, scope)),
    )


def _check_names(scope: Scope, spec: AssemblySpec) -> None:
    """Check the names of all elements of a document. The names of components and joints are checked when their `repeat` is unrolled."""
    for name in spec.parameters:
        if name in CONSTANTS or name in FUNCTIONS:
            scope.error(
                Code.RESERVED_NAME, f"a parameter cannot have the reserved name `{name}`", ("parameters", name),
                key=True, help="choose another name",
            )
    sections: tuple[tuple[str, Mapping[str, object], str, bool], ...] = (
        ("parameters", spec.parameters, "a parameter", False), ("links", spec.links, "a link", True),
        ("poses", spec.poses, "a pose", False), ("modes", spec.modes, "a mode", False), ("motions", spec.motions, "a motion", False),
        ("sensors", spec.sensors, "a sensor", False), ("tests", spec.tests, "a test", False),
        ("materials", spec.materials if isinstance(spec.materials, Mapping) else {}, "a material", False),
    )
    for section, entries, noun, reserved in sections:
        check_names(scope, ((name, (section, name), noun) for name in entries), reserved=reserved)


def _exports(table: DocumentScope, scope: Scope) -> None:
    for name in table.doubts.names("mounts"):
        table.exports[name] = None
    for name, text in table.spec.mounts.items():
        table.exports[name] = references.mount(table, scope, text, ("mounts", name))


def _links(table: DocumentScope, scope: Scope) -> Iterator[LinkName]:
    for name, text in table.spec.links.items():
        path: Path = ("links", name)
        component = references.component(table, scope, text, path)
        if component is not None:
            yield LinkName(name=name, component=component[0], origin=scope.origin(path, key=True))


def _order(table: DocumentScope, scope: Scope) -> Iterator[Reference]:
    """Yield the components of the document that `order` lists. Components of nested documents, and repeated ones, are reported."""
    listed: dict[tuple[str, ...], Reference] = {}
    for index, text in enumerate(table.spec.order):
        for component in components_fitting(table, scope, text, ("order", index)):
            if len(component.path) > 1:
                message, help = f"`{component.text}` is a component of a nested document", "write `order` in that document"
                scope.error(Code.ASSEMBLY_ORDER, message, ("order", index), help=help)
            elif listed.setdefault(component.path, component) is not component:
                notes = make_notes("it is also listed here", listed[component.path].origin)
                scope.error(Code.ASSEMBLY_ORDER, f"`{component.text}` is listed twice", ("order", index), help="remove one", notes=notes)
            else:
                yield component


def _omitted_details(table: DocumentScope, detail: DetailSpec, model: AssemblyDefinition) -> dict[ChoicePath, frozenset[str]]:
    """Return the levels of detail that each simulation target omits, and those that single modes omit: `("modes", "bench")`.

    An error is reported for a level to which no component belongs, in this document or in a nested document, and for an unknown mode.
    """
    scope = table.scope
    known = {level for assembly in model.assemblies() for component in assembly.components for level in component.detail}
    given: dict[ChoicePath, tuple[str, ...]] = {(key,): levels for key, levels in detail if key != "modes" and levels is not None}
    given |= {("modes", name): levels for name, levels in detail.modes.items()}
    for name in (name for name in detail.modes if name not in table.spec.modes):
        help = references.suggest(name, table.spec.modes, what="modes")
        scope.error(Code.UNKNOWN_MODE, f"there is no mode `{name}`", ("detail", "modes", name), key=True, help=help)
    for path, levels in given.items():
        for name in (level for level in levels if level not in known):
            help = did_you_mean(name, known, what="levels") if known else f"write `detail: [{name}]` in a component"
            scope.error(Code.UNKNOWN_CHOICE, f"no component has the level of detail `{name}`", ("detail", *path), help=help)
    common = given.pop(("sim",), ())
    formats: dict[ChoicePath, tuple[str, ...]] = {(name,): given.get((name,), common) for name in ("mjcf", "urdf", "sdf", "usd")}
    return {path: frozenset(levels) for path, levels in (given | formats).items()}
