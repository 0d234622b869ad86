"""Resolve the definitions of parts. Parameters are checked with the schema of the part class. Parts can also be CAD or mesh files."""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Mapping

from thingc.base.diagnostics import MAX_FAULTS, Code, Note
from thingc.base.one_line_repr import format_count
from thingc.base.safe_text import quote_names
from thingc.base.source import Path, Span, format_path, line_of
from thingc.base.suggestions import Hint, did_you_mean, near_hint, nearest
from thingc.base.units import NUMBER, Quantity, shorten
from thingc.documents.expressions.evaluation import ExpressionValue, format_value, kind_of
from thingc.documents.load.paths import PART_SUFFIXES, resolve_path
from thingc.documents.workspace import DEFAULT_PARTS
from thingc.geometry.record import (
    DIMENSIONS,
    FILE_UNIT,
    WHOLE,
    FailureKind,
    ParameterSchema,
    PartDefinition,
    PartFailure,
    PartSchema,
    Value,
    definition_text,
)
from thingc.model.resolve.document_scope import ComponentScope, ResolveRun
from thingc.model.resolve.scope import Scope, TooManyErrors, dimension_message

_WRITE_WHERE = "write files only to `tempfile.gettempdir()`"
FAILURES: Mapping[FailureKind, tuple[Code, str, str]] = {
    "raised": (Code.PART_RAISED, "raised an exception", "change the `params` of the component, or fix the part file"),
    "hung": (Code.PART_HUNG, "took too long", "fix the part, or allow more time with `--part-timeout`"),
    "crashed": (Code.PART_CRASHED, "crashed the interpreter", "change the `params` of the component, or the CAD calls in the part file"),
    "trespassed": (Code.PART_WRITES, "writes files outside its own folder", _WRITE_WHERE),
    "swarmed": (Code.PART_SWARMED, "starts too many processes", "start fewer processes, and wait for each process"),
    "starved": (Code.PART_STARVED, "needs too much memory", "simplify the part, or raise `part_memory` in `thingc.toml`"),
    "empty": (Code.PART_EMPTY, "has no volume", "return a solid from `result()`, or None for a part without geometry"),
    "refused": (Code.PART_REFUSED, "is not allowed", "use a part from the `parts` folders or the `packages` of the workspace"),
    "missing": (Code.PART_MISSING, "does not exist", "write `module:Class`, with a module in a part folder and a class in that module"),
    "resultless": (Code.NO_RESULT, "has no shape", "add `def result(self):` that returns a shape, or None for a part without geometry"),
    **dict.fromkeys(("invalid", "absent"), (Code.PART_INVALID, "is not valid", "fix the part file")),
    "unbounded": (Code.PART_INVALID, "cannot be simplified", "increase `faces`"),
    "stale": (Code.LOCK_STALE, "has changed", "run `thingc lock`, and commit `parts.lock.json`"),
    "unlocked": (Code.NOT_LOCKED, "is not locked", "run `thingc lock`, and commit `parts.lock.json`"),
}
"""For each kind of failure: the diagnostic code, the end of the message after the name of the part, and the help text."""


def of_code(context: ResolveRun, node: ComponentScope, reference: str) -> PartDefinition | None:
    """Return the part definition of a component with the key `part:`.

    If the part is invalid, report an error (once per reference) and return None.
    """
    schema = context.schemas.get(reference)
    if schema is None:
        return None
    if isinstance(schema, PartFailure):
        _report_failure(context, node, reference, schema)
        return None
    set_values = _given_parameters(node, schema)
    if set_values is None:
        return None
    values = {**schema.defaults, **set_values}
    text = definition_text(reference, values, schema.defaults)
    if text not in context.parts:
        context.parts[text] = schema.definition(values)
    return context.parts[text]


def _given_parameters(node: ComponentScope, schema: PartSchema) -> dict[str, Value] | None:
    """Return the parameters that the document sets for a part, in canonical form.

    If a parameter is unknown, invalid or missing, report an error and return None.
    """
    scope, path = node.scope, (*node.path, "params")
    by_name = {parameter.name: parameter for parameter in schema.parameters}
    values: dict[str, Value] = {}
    for name, raw in node.spec.params.items():
        parameter = by_name.get(name)
        if parameter is None:
            scope.error(
                Code.UNKNOWN_PARAMETER, f"`{schema.reference}` has no parameter `{name}`", (*path, name), key=True,
                help=did_you_mean(name, by_name, what="parameters"),
                notes=[*scope.second_note("the part is used here", (*node.path, "part"), (*path, name)), *_declared_at(schema)],
            )
            continue
        value = scope.value(raw, (*path, name))
        canonical = None if value is None else _check_value(scope, schema, parameter, value, (*path, name))
        if canonical is not None:
            values[name] = canonical
    missing = [parameter for parameter in schema.parameters if parameter.required and parameter.name not in node.spec.params]
    if missing and not scope.doubts.touch(path):
        named = " and ".join(f"`{parameter.name}`" for parameter in missing)
        examples = (f"{needed.name}: {DIMENSIONS[needed.kind].example if needed.kind in DIMENSIONS else '...'}" for needed in missing)
        scope.error(
            Code.MISSING_PARAMETER, f"`{schema.reference}` requires {'the parameters' if len(missing) > 1 else 'the parameter'} {named}",
            (*node.path, "part"), help=f"write `params: {{{', '.join(examples)}}}`", notes=_declared_at(schema),
        )
    return values if len(values) == len(node.spec.params) and not missing else None


def _check_value(scope: Scope, schema: PartSchema, parameter: ParameterSchema, value: ExpressionValue, path: Path) -> Value | None:
    """Check the value of a part parameter with the schema of the part class, and return the value in canonical form.

    If the value is invalid, report an error and return None.
    """
    subject = f"parameter `{parameter.name}` of `{schema.reference}`"
    source = scope.source_text(path)
    literal = source is not None and not source.lstrip().startswith("=")
    code, help = Code.VALUE_KIND, None
    dimension = DIMENSIONS.get(parameter.kind, NUMBER)
    if parameter.kind == "choice":
        chosen = _find_choice(parameter, value, (source or "").strip())
        if chosen is not None:
            return chosen
        choices = [format_value(choice) if isinstance(choice, (bool, str)) else f"{choice:g}" for choice in parameter.choices]
        text = shorten((source or "").strip() or format_value(value))
        message = f"{subject} must be one of {quote_names(choices, 12)}, found `{text}`"
        help = did_you_mean(text, choices, what="choices") if nearest(text, choices) is not None else None
    elif parameter.kind == "text":
        if isinstance(value, str):
            return value
        if isinstance(value, Quantity) and literal and source is not None:
            return source.strip()
        message = f"{subject} must be a string, found {kind_of(value)} ({scope.format_value(value, path)})"
        help = "put quotes around the value" if literal else None
    elif parameter.kind == "flag":
        if isinstance(value, bool):
            return value
        message = f"{subject} must be `true` or `false`, found {kind_of(value)} ({scope.format_value(value, path)})"
        help = "write `true` or `false`"
    elif not isinstance(value, Quantity) or not value.fits(dimension):
        code, (message, help) = Code.DIMENSION, dimension_message(value, (dimension,), subject, source, scope.names)
        if parameter.kind in ("number", *WHOLE) and isinstance(value, Quantity):
            help = "the part expects a plain number without a unit"
    elif parameter.kind in WHOLE and value.value != int(value.value):
        message = f"{subject} must be a whole number, found {scope.format_value(value, path)}"
    elif (rule := _violated_rule(parameter, value.value)) is not None:
        code, message = Code.OUT_OF_RANGE, f"{subject} must be {rule}, found {scope.format_value(value, path)}"
    else:
        return int(value.value) if parameter.kind in WHOLE else value.value + 0.0
    scope.error(code, message, path, help=help, notes=_declared_at(schema))
    return None


def _find_choice(parameter: ParameterSchema, value: ExpressionValue, source: str) -> Value | None:
    """Return the choice of a parameter that equals a value with the text `source` in the document, or None."""
    for choice in parameter.choices:
        if isinstance(choice, bool) or isinstance(value, bool):
            if choice is value:
                return choice
        elif isinstance(choice, str):
            if choice == (value if isinstance(value, str) else source):
                return choice
        elif isinstance(value, Quantity) and value.dimension == NUMBER and value.value == choice:
            return choice
    return None


def _violated_rule(parameter: ParameterSchema, number: float) -> str | None:
    """Return the rule that a number violates, such as `at least 5 mm`, or None if it is within the bounds of the parameter."""
    if parameter.minimum is not None and number < parameter.minimum:
        return f"at least {parameter.format_value(parameter.minimum)}"
    if parameter.maximum is not None and number > parameter.maximum:
        return f"at most {parameter.format_value(parameter.maximum)}"
    return None


def _declared_at(schema: PartSchema) -> list[Note]:
    if not schema.file or schema.line < 1:
        return []
    place = Span(file=schema.file, line=schema.line, column=1, end_line=schema.line, end_column=2)
    return [Note(message=f"`{schema.reference}` is defined here", span=place)]


USES_SHOWN = 3
"""Maximum number of references that the message shows for an error in a part file."""


def _report_failure(context: ResolveRun, node: ComponentScope, reference: str, failure: PartFailure) -> None:
    if reference in context.failed_parts:
        return
    if len(context.failed_parts) >= MAX_FAULTS:
        raise TooManyErrors
    context.failed_parts.add(reference)
    path = (*node.path, "part")
    if failure.kind == "raised" and failure.file is not None and failure.line is not None:
        _report_unloaded(context, node.scope.span(path), reference, failure, failure.file, failure.line)
        return
    notes: list[Note] = []
    if failure.file is not None and failure.line is not None:
        notes.append(Note(message="location in the part file", span=line_of(failure.file, failure.line)))
    code, description, advice = FAILURES[failure.kind]
    help: Hint | None = None if failure.kind == "missing" else "fix the part file"
    message = f"part `{reference}`: {failure.message}"
    if failure.kind == "raised":
        message = f"part `{reference}` cannot be loaded: {failure.message}"
    elif failure.kind == "trespassed":
        message = f"part `{reference}` {description}: {failure.message}"
    elif failure.message.startswith(f"`{reference}`"):
        message = failure.message
        help = missing_hint(context, reference, failure) if failure.candidates else _reference_hint(context, reference)
    if failure.kind == "resultless":
        message, help = failure.message, advice
    elif failure.kind in ("stale", "unlocked"):
        help = "run `thingc lock`, and commit `parts.lock.json`"
    elif failure.kind == "refused":
        allowed = ", ".join(f"`{package}`" for package in failure.candidates)
        help = f"use a part from the part folders of the workspace{' or from the allowed packages: ' + allowed if allowed else ''}"
    elif failure.kind == "missing":
        help = missing_hint(context, reference, failure)
    context.report.add(code, message, node.scope.span(path), help=help, path=format_path(path), notes=notes, detail=failure.detail)


def _report_unloaded(context: ResolveRun, use: Span, reference: str, failure: PartFailure, file: str, line: int) -> None:
    """Report an error in a part file. The error is reported once, even if the file defines several parts.

    `use` is the location of a reference to the part.
    """
    from thingc.documents.spec.validation import part_references

    references = {reference: use}
    for reference_, place in part_references(context.specs, context.documents):
        schema = context.schemas.get(reference_)
        if isinstance(schema, PartFailure) and (schema.message, schema.file, schema.line) == (failure.message, file, line):
            references.setdefault(reference_, place)
    context.failed_parts.update(references)
    count = len(references) - 1
    others = f" and {format_count(count, 'other part')}" if count else ""
    notes = [Note(message=f"`{name}` is used here", span=place) for name, place in list(references.items())[:USES_SHOWN]]
    if len(references) > USES_SHOWN:
        notes.append(Note(message="also used: " + ", ".join(f"`{name}`" for name in list(references)[USES_SHOWN:])))
    context.report.add(
        Code.PART_RAISED, f"part `{reference}`{others} cannot be loaded: {failure.message}",
        line_of(file, line, failure.column), help="fix the part file", notes=notes, detail=failure.detail,
    )


def _reference_hint(context: ResolveRun, text: str) -> str:
    """Return a hint for a reference that does not have the form `module:Class`."""
    call = re.fullmatch(r"([\w.]+:[\w.]+)\((.*)\)", text, re.DOTALL)
    if call is not None:
        return f"write `part: {shorten(call.group(1))}`, and set its parameters: `params: {{...}}`"
    module, _, name = text.rpartition(":") if ":" in text else text.rpartition(".")
    for folder in context.workspace.parts:
        relative = context.workspace.relative(folder)
        module = module.removeprefix("./").removeprefix(f"{relative}/").removeprefix(f"{relative}.")
    module = module.removesuffix(".py").replace("/", ".")
    corrected = f"{module}:{name}"
    if re.fullmatch(r"[A-Za-z_][\w.]*:[A-Za-z_]\w*", corrected) and corrected != text:
        return f"did you mean `{shorten(corrected)}`?"
    return "write `module:Class`, for example `arm:BasePlate`"


def missing_hint(context: ResolveRun, reference: str, failure: PartFailure) -> Hint:
    """Return a hint for an unknown part.

    The hint suggests the same class name in another module, or a similar class name in the same module.
    """
    classes = [name for name in failure.candidates if ":" in name]
    namesakes = [name for name in classes if name.partition(":")[2] == reference.rpartition(":")[2]]
    if namesakes:
        return near_hint(reference, namesakes) or f"did you mean {' or '.join(f'`{name}`' for name in namesakes[:3])}?"
    if classes:
        return did_you_mean(reference, classes, what="parts")
    return _module_hint(context, reference, failure.candidates)


def _module_hint(context: ResolveRun, reference: str, modules_found: Collection[str]) -> Hint:
    """Return a hint for an unknown module. The hint suggests a similar module name, or shows where modules are searched."""
    module, _, name = reference.partition(":")
    close = near_hint(module, modules_found)
    if close is not None:
        return close
    folders = [context.workspace.relative(folder) for folder in context.workspace.parts] or list(DEFAULT_PARTS)
    hint = f"use a module in {' or '.join(f'`{folder}/`' for folder in folders)}"
    if "." not in module:
        hint = f"add a class `{shorten(name)}` to `{folders[0]}/{shorten(module)}.py`"
    modules = sorted(set(modules_found) - set(context.workspace.packages))
    return f"{hint}; {did_you_mean('', modules, what='modules')}" if modules else hint


FEWEST_FACES = 4
"""Smallest number of faces of a closed surface, which is a tetrahedron."""


def of_file(context: ResolveRun, node: ComponentScope, file: str) -> PartDefinition | None:
    """Return the part definition of a component with the key `file:`.

    The parameters of the definition are `faces`, if specified, and the unit of the file, if it is not mm. If the file cannot be used,
    return None. The pass `load` has reported this, unless a `--set` option selects the file.
    """
    base_document = context.documents.root.path if "file" in node.chosen else node.scope.document.path
    absolute = resolve_path(file, base_document)
    workspace = context.workspace
    if absolute is None or os.path.isabs(file) or not workspace.contains(absolute) or not absolute.lower().endswith(PART_SUFFIXES):
        return None
    reference = workspace.relative(absolute)
    unit = node.spec.unit or FILE_UNIT
    faces = node.scope.count(node.spec.faces, (*node.path, "faces"), "`faces`", least=FEWEST_FACES)
    if faces is None and node.spec.faces is not None:
        return None
    settings: dict[str, Value] = {} if faces is None else {"faces": faces}
    settings |= {} if unit == FILE_UNIT else {"unit": unit}
    text = definition_text(reference, settings, {})
    if text not in context.parts and os.path.isfile(absolute):
        context.parts[text] = PartDefinition(
            reference=reference, kind="file", parameters=tuple(settings.items()), text=text, words=tuple(map(str, settings.values())),
            label=reference + (f" in {unit}" if "unit" in settings else "") + (f", {faces} faces" if "faces" in settings else ""),
        )
    return context.parts.get(text)
