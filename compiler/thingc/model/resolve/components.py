"""Resolve components: parts, files, nested assemblies and frames, with their settings."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial

from msgspec.structs import replace

from thingc.base.diagnostics import Code, Note
from thingc.base.source import Path
from thingc.base.suggestions import Hint
from thingc.base.units import shorten
from thingc.documents.expressions.evaluation import ExpressionValue
from thingc.documents.spec.assembly import AssemblySpec, ComponentDefaults, ComponentSpec
from thingc.geometry.record import PartDefinition
from thingc.model.resolve import choices as choose, overrides as properties
from thingc.model.resolve.bom import bom_entry
from thingc.model.resolve.document_scope import ComponentScope, DocumentScope, ResolveRun, names_in
from thingc.model.resolve.link_definition import LinkDefinition
from thingc.model.resolve.mirroring import mirror_assembly, other_axis
from thingc.model.resolve.modes import rigid_mode
from thingc.model.resolve.parameters import check_values
from thingc.model.resolve.parts import of_code, of_file
from thingc.model.resolve.repeats import MAX_OCCURRENCES, Unrolled
from thingc.model.resolve.scope import DefaultLayers
from thingc.model.resolve.shapes import of_collision, of_link
from thingc.model.resolve.types import AssemblyDefinition, At, Attach, Component

MAX_NESTING = 120
"""Maximum depth of nested documents. The limit is slightly larger than the limit of the pass `load`, so that `load` reports the error."""

Nest = Callable[[ResolveRun, str, AssemblySpec, Mapping[str, ExpressionValue], choose.Choices], DocumentScope]
"""Function that resolves a nested document with values of its parameters and with choices for the document."""


def nodes(context: ResolveRun, table: DocumentScope, items: Sequence[Unrolled[ComponentSpec]], nest: Nest) -> None:
    """Resolve the components of a document, and store the results in `table.nodes`.

    The parts, links and frames of the document are also counted.
    """
    if table.choices:
        choose.check_names(context, table, items)
    for item in items:
        if context.overfull:  # the call only reports errors: its return value is not used
            return
        spec, chosen = choose.apply_choices(context, table, item)
        node = ComponentScope(name=item.name, spec=spec, path=item.path, scope=item.scope, chosen=chosen)
        table.nodes[item.name] = node
        is_incomplete = bool(table.doubts) and (table.doubts.touch(node.path) or table.doubts.touch(("defaults", "component")))
        node.incomplete = node.unsound = is_incomplete
        _define(context, table, node, nest)
        node.mounts = properties.extra_mounts(node) if item.spec.mounts else {}
        if not node.frame and node.definition is None:
            node.unsound = True
        added = node.table.occurrences if node.table is not None else 1
        if table.occurrences + added > MAX_OCCURRENCES:
            if not context.overfull:  # report once, because enclosing documents exceed the limit as well
                context.overfull = True
                node.scope.error(
                    Code.TOO_MANY, f"the assembly has {table.occurrences + added} components (at most {MAX_OCCURRENCES} are allowed)",
                    node.path, key=True,
                )
            node.definition, node.table, node.unsound = None, None, True
            continue
        table.occurrences += added


def _define(context: ResolveRun, table: DocumentScope, node: ComponentScope, nest: Nest) -> None:
    spec = node.spec
    if spec.part is not None:
        if "part" not in node.chosen or choose.check_part(context, node, spec.part):
            place = ("definition", node.scope.document.relative, *context.route, node.name)
            stated = (spec, context.schemas.get(spec.part), context.values(node.scope, f"params {node.name}", spec.params))
            node.definition = context.sound(place, stated, partial(of_code, context, node, spec.part))
    elif spec.file is not None:
        node.definition = of_file(context, node, spec.file)
        if node.definition is None and "file" in node.chosen:
            context.report_option_error(
                f"components.{node.name}.file", f"`{shorten(spec.file)}` is not a part file in this workspace",
                f"write a path relative to `{context.documents.root.relative}`, for example `parts/motor.step`",
            )
    elif spec.link is not None:
        node.definition = of_link(context, table, node)
    elif spec.assembly is not None:
        properties.refuse_on_assembly(node)
        node.table = _resolve_nested(context, table, node, spec.assembly, nest)
        node.definition = node.table.definition if node.table is not None else None
    node.shapes = of_collision(context, table, node)
    if spec.mirror is not None and isinstance(node.definition, PartDefinition | LinkDefinition):
        node.definition = node.definition.mirror_image(spec.mirror)
    elif spec.mirror is not None and node.table is not None and node.table.definition is not None:
        node.definition = _image(node, node.table, node.table.definition, spec.mirror)
    if spec.as_ is not None and node.table is not None:
        nested, mode = node.definition, rigid_mode(node, node.table)
        node.table = None  # no names in a rigid body can be referenced, except its mounts
        if isinstance(nested, AssemblyDefinition):
            node.definition = None
            if mode is not None:  # the mirror image of a mirrored lump is also a lump
                plain = nested.plain and replace(nested.plain, modes=(mode,), lump=True)
                node.definition = replace(nested, modes=(mode,), lump=True, plain=plain)


def _image(node: ComponentScope, table: DocumentScope, definition: AssemblyDefinition, axis: str) -> AssemblyDefinition | None:
    """Return the mirror image of a nested assembly.

    If a component in the assembly is mirrored along another axis, report an error and return None.
    """
    other = other_axis(definition, axis)
    if other is not None:
        name, its = other
        inner = dict(table.all_nodes())[name]
        node.scope.error(
            Code.MIRROR_AXES, f"`{node.name}` is mirrored along {axis}, and its component `{name}` along {its}",
            (*node.path, "mirror"), help=f"write `mirror: {its}` for `{node.name}`, or `mirror: {axis}` in the nested document",
            notes=[Note(message=f"`{inner.name}` is mirrored here", span=inner.scope.span((*inner.path, "mirror")))],
        )
        return None
    if axis not in table.images:
        table.images[axis] = mirror_assembly(definition, axis)
    return table.images[axis]


def _resolve_nested(context: ResolveRun, table: DocumentScope, node: ComponentScope, text: str, nest: Nest) -> DocumentScope | None:
    """Resolve the nested document of a component.

    If the document could not be read or contains itself, return None. The pass `load` has reported the error.
    """
    scope, path = node.scope, (*node.path, "assembly")
    chosen = "assembly" in node.chosen
    document = context.documents.find_referenced(context.documents.root if chosen else scope.document, text)
    if document is None or document.relative in context.nesting:
        if document is not None and chosen:
            message = f"`{document.relative}` would contain itself"
            context.report_option_error(f"components.{node.name}.assembly", message, "choose another assembly")
        return None
    relative = document.relative
    spec = context.specs.get(relative)
    if not isinstance(spec, AssemblySpec) or scope.doubts.touch((*node.path, "parameters")):
        return None
    if len(context.nesting) >= MAX_NESTING:
        scope.error(Code.TOO_MANY, f"more than {MAX_NESTING} levels of nested assemblies", path)
        return None
    values = _given_values(context, node, relative, spec)
    context.nesting.append(relative)
    context.route.append(node.name)
    try:
        return nest(context, relative, spec, values, choose.below(table.choices, str(node.path[-1]), node.name))
    finally:
        context.nesting.pop()
        context.route.pop()


def _given_values(context: ResolveRun, node: ComponentScope, relative: str, spec: AssemblySpec) -> dict[str, ExpressionValue]:
    """Return the values that a component sets for the parameters of its nested document. Invalid values are reported and omitted."""
    scope, path = node.scope, (*node.path, "parameters")
    evaluated = {name: scope.value(raw, (*path, name)) for name, raw in node.spec.parameters.items()}
    values = {name: value for name, value in evaluated.items() if value is not None}

    def complain(name: str, code: Code, message: str, *, help: Hint | None = None, notes: Iterable[Note] = ()) -> None:
        scope.error(code, message, (*path, name), help=help, notes=notes, key=code is Code.UNKNOWN_PARAMETER)

    document = context.documents.by_path[relative]
    return check_values(context, document, spec, values, f"`{spec.name}`", complain, scope.names)


def components(context: ResolveRun, table: DocumentScope, placements: dict[str, Attach | At | None]) -> Iterator[Component]:
    """Yield the components of a document, in the order of the document.

    Invalid components do not have a definition, and later passes skip them.
    """
    defaults = table.spec.defaults.component if table.spec.defaults is not None else None
    default_layers: tuple[tuple[ComponentDefaults, Path], ...] = ((defaults, ("defaults", "component")),) if defaults is not None else ()
    # report errors in the defaults even if no component uses them
    properties.material(table.scope, DefaultLayers(default_layers), table.materials, unreadable=table.materials_unreadable)
    properties.overrides(table.scope, DefaultLayers(default_layers), table.spec.modes)
    for node in table.nodes.values():
        place = ("component", table.document.relative, *context.route, node.name)
        names = context.memo(("names", *place), names_in, node.spec, defaults)
        inputs = (
            node.spec, defaults, tuple(node.scope.names.get(name) for name in names), node.definition, node.shapes, node.unsound,
            node.unplaced, placements.get(node.name), table.materials, node.mounts, table.materials_unreadable, tuple(table.spec.modes),
        )
        yield context.sound(place, inputs, partial(_component, node, table, placements.get(node.name), default_layers))


def _component(
    node: ComponentScope, table: DocumentScope, placement: Attach | At | None, default_layers: tuple[tuple[ComponentDefaults, Path], ...],
) -> Component:
    scope = node.scope
    is_part = node.spec.part is not None or node.spec.file is not None
    layers = DefaultLayers(((node.spec, node.path), *(default_layers if is_part else ())))
    nested = node.spec.assembly is not None
    material = None if nested else properties.material(scope, layers, table.materials, unreadable=table.materials_unreadable)
    overrides = properties.NO_OVERRIDES if nested else properties.overrides(scope, layers, table.spec.modes)
    if node.shapes:
        variants = {path: replace(choice, shapes=node.shapes.get(path)) for path, choice in overrides.variants.items()}
        overrides = replace(overrides, shapes=node.shapes.get(()), variants=variants)
    return Component(
        name=node.name, key=str(node.path[-1]), definition=None if node.unsound else node.definition, frame=node.frame and not node.unsound,
        placement=None if node.unsound or node.unplaced else placement, material=material, overrides=overrides, mounts=node.mounts,
        bom=bom_entry(scope, layers), origin=scope.origin(node.path, key=True), detail=frozenset(node.spec.detail),
        mode=node.spec.mode,
    )
