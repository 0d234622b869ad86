"""Apply options `--set` that select a part, a file, a document or a material, such as `--set components.foot.part=feet:Wide`.

The module `set_values` applies all other options `--set`. Such an option is called a choice. Its path refers to a component
(`components.leg.components.foot.part`), or to a default for components (`defaults.component.material`). A choice replaces the value in the
document. Definitions with different choices are different definitions. Paths of files and documents are relative to the compiled document.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence

from thingc.base.source import ScalarNode, node_at
from thingc.base.suggestions import did_you_mean
from thingc.base.units import shorten
from thingc.documents.load.paths import SUFFIXES_WITH_UNIT, resolve_path
from thingc.documents.spec.assembly import AssemblySpec, ComponentDefaults, ComponentSpec, DefaultsSpec
from thingc.documents.spec.settable_values import DEFAULT_MATERIAL, EXAMPLES, KEYS, VALUES, ChoicePath, is_value, parse, split_nested
from thingc.geometry.record import PartFailure
from thingc.model.resolve.bom import path_in_workspace
from thingc.model.resolve.document_scope import ComponentScope, DocumentScope, ResolveRun
from thingc.model.resolve.parts import missing_hint
from thingc.model.resolve.repeats import Unrolled

Choices = tuple[tuple[str, str], ...]
"""Sorted pairs of a path in one document and the chosen string."""


def from_command_line(context: ResolveRun, choices: Mapping[str, str]) -> Choices:
    """Return the `--set` options with valid paths, sorted by path. Options with invalid paths are reported."""
    sound: dict[str, str] = {}
    for path, text in choices.items():
        if parse(path) is None and not is_value(path):
            context.report_option_error(path, f"`{shorten(path)}` cannot be set", f"write {VALUES}; {EXAMPLES}")
        else:
            sound[path] = text
    return tuple(sorted(sound.items()))


def without_written(context: ResolveRun, relative: str, spec: AssemblySpec, choices: Choices) -> Choices:
    """Return the choices that differ from the document. Choices of the value that the document already contains are dropped."""
    return tuple((path, text) for path, text in choices if not _is_written(context, relative, spec, path, text))


def _is_written(context: ResolveRun, relative: str, spec: AssemblySpec, path: str, text: str) -> bool:
    choice = parse(path)
    if choice is None:
        node = node_at(context.documents.by_path[relative].tree, tuple(path.split(".")))
        return isinstance(node, ScalarNode) and node.text == text
    if choice.key == DEFAULT_MATERIAL and not choice.components:
        default = spec.defaults.component if spec.defaults is not None else None
        return default is not None and default.material == text
    if len(choice.components) != 1 or choice.components[0] not in spec.components:
        return False
    own = getattr(spec.components[choice.components[0]], choice.key, None)
    if choice.key not in ("assembly", "file") or own is None:
        return bool(own == text)
    return path_in_workspace(relative, own) == path_in_workspace(context.documents.root.relative, text)


def below(choices: Choices, *names: str) -> Choices:
    """Return the choices for the nested document of a component, with paths relative to this document.

    `names` are the names by which choices can refer to the component. If several names have choices for the same path, the last name takes
    precedence.
    """
    inside = [(through, text) for path, text in choices if (through := split_nested(path)) is not None]
    by_path = {path: text for name in names for (component, path), text in inside if component == name}
    return tuple(sorted(by_path.items()))


def values(choices: Choices) -> dict[str, str]:
    """Return the values that options `--set` insert into the document, keyed by path.

    Choices of parts, files, documents and materials are not included.
    """
    return {path: text for path, text in choices if parse(path) is None and split_nested(path) is None}


def own(choices: Choices, *names: str) -> dict[str, str]:
    """Return the choices for a component itself, keyed by the setting (`part`, `material`).

    `names` contains the names of the component, with the most specific name last.
    """
    return {key: text for name in names for key in KEYS for path, text in choices if path == f"components.{name}.{key}"}


def with_default_material(context: ResolveRun, table: DocumentScope) -> AssemblySpec:
    """Return the model of the document with the chosen default material for components, if any."""
    spec = table.spec
    text = dict(table.choices).get(DEFAULT_MATERIAL)
    if text is None or not _known_material(context, table, text, DEFAULT_MATERIAL):
        return spec
    defaults = spec.defaults or DefaultsSpec()
    component = defaults.component or ComponentDefaults()
    chosen = component.model_copy(update={"material": text})
    return spec.model_copy(update={"defaults": defaults.model_copy(update={"component": chosen})})


def check_names(context: ResolveRun, table: DocumentScope, items: Sequence[Unrolled[ComponentSpec]]) -> None:
    """Report each choice whose path refers to a component that the document does not contain."""
    names = {item.name for item in items} | set(table.spec.components)
    if table.doubts.lacks("components") or table.unbuilt:
        return
    for path, _ in table.choices:
        choice, through = parse(path), split_nested(path)
        name = through[0] if through is not None else next(iter(choice.components), None) if choice is not None else None
        if name is not None and name not in names:
            context.report_option_error(
                path, f"`{table.spec.name}` has no component `{name}`", did_you_mean(name, table.spec.components, what="components"),
            )


def apply_choices(context: ResolveRun, table: DocumentScope, item: Unrolled[ComponentSpec]) -> tuple[ComponentSpec, frozenset[str]]:
    """Apply the choices for a component to its model. Return the changed model and the chosen keys. Invalid choices are reported."""
    spec = item.spec
    if not table.choices:
        return spec, frozenset()
    names = (str(item.path[-1]), item.name)
    # For a repeated component, report an invalid choice once for all items.
    label = item.name if any(path.startswith(f"components.{item.name}.") for path, _ in table.choices) else names[0]
    kind = next((key for key in ("part", "file", "assembly", "link") if getattr(spec, key) is not None), "frame")
    chosen: dict[str, str] = {}
    for key, text in own(table.choices, *names).items():
        path = f"components.{label}.{key}"
        if key == "material":
            if kind == "assembly":
                context.report_option_error(
                    path, f"the assembly `{label}` has no material",
                    f"set `components.{label}.{DEFAULT_MATERIAL}`, or the material of one of its components",
                )
                continue
            if not _known_material(context, table, text, path):
                continue
        elif key != kind:
            fault, help = f"is defined by `{kind}`, not `{key}`", f"set `components.{label}.{kind}`"
            if kind == "frame":
                fault, help = "is a frame without geometry", "use a component with geometry"
            elif kind == "link":
                fault, help = "is a link with inline shapes", "set the material of the link, or use another component"
            context.report_option_error(path, f"component `{label}` {fault}", help)
            continue
        if key == "file" and spec.unit is not None and text.lower().endswith(SUFFIXES_WITH_UNIT):
            message = f"`unit: {spec.unit}` of component `{label}` cannot be used with `{shorten(text)}`, which specifies a unit"
            context.report_option_error(path, message, "remove `unit` from the component")
            continue
        chosen[key] = text
    inside = below(table.choices, *names)
    if inside and kind != "assembly":
        path = f"components.{label}.{inside[0][0]}"
        context.report_option_error(path, f"component `{label}` is not an assembly", None)
    return (spec.model_copy(update=chosen) if chosen else spec), frozenset(chosen)


def check_part(context: ResolveRun, node: ComponentScope, reference: str) -> bool:
    """Return whether the part class that a choice selects exists in the workspace. If the class does not exist, report an error."""
    schema = context.schemas.get(reference)
    if schema is not None and not isinstance(schema, PartFailure):
        return True
    if isinstance(schema, PartFailure):
        help = missing_hint(context, reference, schema) if schema.kind == "missing" else None
        context.report_option_error(f"components.{node.name}.part", f"part `{shorten(reference)}`: {schema.message}", help)
    return False


def _known_material(context: ResolveRun, table: DocumentScope, name: str, path: str) -> bool:
    if name in table.materials:
        return True
    if not table.materials_unreadable:
        context.report_option_error(
            path, f"there is no material `{shorten(name)}` in `{table.spec.name}` or its `materials`",
            did_you_mean(name, table.materials, what="materials"),
        )
    return False


def chosen_files(choices: Mapping[str, str], document: str) -> list[str]:
    """Return the absolute paths of part files that choices select. The file names in choices are relative to the top document."""
    paths = [resolve_path(text, os.path.abspath(document)) for text in chosen_texts(choices, "file")]
    return [path for path in paths if path is not None]


def chosen_texts(choices: Mapping[str, str], key: str) -> list[str]:
    """Return the part classes (`part`), files (`file`) or documents (`assembly`) that the choices select, without duplicates.

    Paths of files and documents are relative to the top document.
    """
    paths: Iterable[tuple[ChoicePath | None, str]] = ((parse(path), text) for path, text in choices.items())
    return list(dict.fromkeys(text for choice, text in paths if choice is not None and choice.key == key))
