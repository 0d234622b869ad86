"""Evaluate the parameters of an assembly document: expressions in any order, bounds, and values set by a parent assembly or by `-p`."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any

from msgspec import structs

from thingc.base.diagnostics import Code, Note, Report
from thingc.base.graphs import MAX_CYCLE, format_cycle
from thingc.base.source import Document, Path
from thingc.base.suggestions import Hint, did_you_mean
from thingc.base.units import NUMBER, Quantity, UnitError, parse_quantity, shorten
from thingc.documents.expressions.evaluation import ExpressionValue, format_value, kind_of, plain
from thingc.documents.expressions.parsing import parse_expression
from thingc.documents.expressions.terms import Expression, ExpressionError
from thingc.documents.load.documents import Documents
from thingc.documents.load.text import find_forbidden
from thingc.documents.spec.assembly import AssemblySpec, ParameterSpec
from thingc.documents.spec.invalid_entries import InvalidEntries, Specs
from thingc.documents.workspace import Workspace
from thingc.geometry.record import Value
from thingc.model.resolve.document_scope import ParameterValues, ResolveRun
from thingc.model.resolve.scope import Scope, dimension_message

Complain = Callable[..., None]
"""The function `complain(name, code, message, help=None, notes=())` reports an error at the location where a value is set."""


def declared_parameters(context: ResolveRun, document: Document, spec: AssemblySpec) -> ParameterValues:
    """Return the values of parameters that the document itself specifies, without values from a parent assembly.

    Errors are reported. The result is cached for one run.
    """
    declared = context.declared.get(document.relative)
    if declared is None:
        declared = evaluate_parameters(document, spec, {}, context.report, context.doubts(document))
        out_of_bounds = check_bounds(context.scope(document, declared.values, declared.broken), spec, declared.values)
        declared = context.declared[document.relative] = structs.replace(declared, broken=declared.broken | out_of_bounds)
    return declared


def evaluate_parameters(
    document: Document, spec: AssemblySpec, overrides: Mapping[str, ExpressionValue | Expression], report: Report, doubts: InvalidEntries,
) -> ParameterValues:
    """Evaluate all parameters of a document. Return their values, and the names of invalid parameters.

    The values in `overrides` replace values in the document. Expressions can refer to other parameters in any order. A cycle of expressions
    is reported with the location of each step.
    """
    values: dict[str, ExpressionValue] = {}
    broken: set[str] = {name for name in spec.parameters if name not in overrides and doubts.touch(("parameters", name))}

    def own(name: str) -> tuple[Any, Path]:
        entry = spec.parameters[name]
        if name in overrides:
            return overrides[name], ("parameters", name)
        if isinstance(entry, ParameterSpec):
            return entry.value, ("parameters", name, "value")
        return entry, ("parameters", name)

    def evaluate(name: str) -> None:
        raw, path = own(name)
        names: Mapping[str, ExpressionValue] = values  # every parameter that the expression uses has been computed or is invalid
        if isinstance(raw, Expression) and any(use.name not in spec.parameters for use in raw.names):
            names = {other: values.get(other, False) for other in spec.parameters if other != name}  # suggestions for the unknown name
        scope = Scope(document=document, report=report, names=names, broken=broken, doubts=doubts)
        value = scope.value(raw, path)
        if value is None:
            broken.add(name)
        else:
            values[name] = value

    for first in spec.parameters:
        open_: dict[str, Iterator[str]] = {first: _used_names(own(first)[0], spec)}  # use an explicit stack, because chains may be long
        while open_:
            name, uses = next(reversed(open_.items()))
            use = next((use for use in uses if use not in values and use not in broken), None)
            if use in open_:
                chain = list(open_)[list(open_).index(use):]
                _report_cycle(document, spec, chain, {step: own(step)[1] for step in chain}, report)
                broken.update(chain)
            elif use is not None:
                open_[use] = _used_names(own(use)[0], spec)
            else:
                del open_[name]
                if name not in values and name not in broken:
                    evaluate(name)
    in_order = {name: values[name] for name in spec.parameters if name in values}
    return ParameterValues(values=in_order, broken=frozenset(broken))


def _used_names(raw: Any, spec: AssemblySpec) -> Iterator[str]:
    """Yield the names of the parameters in the expression `raw`, which is the value of a parameter."""
    return iter([use.name for use in raw.names if use.name in spec.parameters] if isinstance(raw, Expression) else [])


def _report_cycle(document: Document, spec: AssemblySpec, chain: list[str], places: Mapping[str, Path], report: Report) -> None:
    order = {name: number for number, name in enumerate(spec.parameters)}
    start = chain.index(min(chain, key=order.__getitem__))
    ordered = chain[start:] + chain[:start]
    cycle = format_cycle(ordered)
    is_long = len(chain) > 1
    message = f"parameters depend on each other in a cycle: {cycle}" if is_long else f"parameter `{chain[0]}` depends on itself"
    report.add(
        Code.PARAMETER_CYCLE, message, document.span(places[ordered[0]]), path=f"parameters.{ordered[0]}",
        help="give one of these parameters a value that does not depend on the others" if is_long
        else "give the parameter a value that does not depend on itself",
        notes=[Note(message=f"`{step}` is set here", span=document.span(places[step])) for step in ordered[1:MAX_CYCLE]],
    )


def canonical(values: Mapping[str, ExpressionValue]) -> tuple[tuple[str, Value], ...]:
    """Convert values of parameters to a canonical form, sorted by name, which is used as a cache key.

    Numbers are in SI units, and numbers without a fractional part are converted to ints.
    """
    return tuple((name, plain(values[name])) for name in sorted(values))


def check_values(
    context: ResolveRun, document: Document, spec: AssemblySpec, requested: Mapping[str, ExpressionValue], owner: str, complain: Complain,
    names: Collection[str] = (),
) -> dict[str, ExpressionValue]:
    """Return the valid values of those that a user or a parent assembly sets for parameters of a document. Report the invalid values.

    A value in `requested` is valid if its parameter exists, its physical dimension matches, and it is within bounds. `owner` is the name of
    the assembly in messages. `names` contains the names that expressions in the values can use.
    """
    table = declared_parameters(context, document, spec)
    scope = context.scope(document, table.values, table.broken)
    valid: dict[str, ExpressionValue] = {}
    for name, value in requested.items():
        declared = table.values.get(name)
        if name not in spec.parameters:
            if not context.doubts(document).lacks("parameters"):
                complain(
                    name, Code.UNKNOWN_PARAMETER, f"{owner} has no parameter `{name}`",
                    help=did_you_mean(name, spec.parameters, what="parameters"),
                    notes=[Note(message=f"{owner} is defined here", span=document.span(("name",)))],
                )
        elif declared is not None and not _same_kind(declared, value, scope, spec, name):
            note = Note(message=f"`{name}` is declared here", span=document.span(("parameters", name), key=True))
            _report_wrong_type(name, declared, value, owner, complain, [note], names)
        elif declared is not None and _check_bounds(scope, spec, name, value, complain):
            valid[name] = value
    return valid


class AssemblyParameters:
    """The parameters of an assembly document, with their default values, for callers outside the pass `resolve`.

    `name` is the name of the assembly, and `values` contains the valid values in the document. Invalid values are not reported here but
    when the assembly is resolved.
    """

    def __init__(self, documents: Documents, specs: Specs, workspace: Workspace) -> None:
        spec = specs[documents.root.relative]
        assert isinstance(spec, AssemblySpec)
        self._spec = spec
        self._context = ResolveRun(documents=documents, specs=specs, workspace=workspace, schemas={}, report=Report())
        self.name = spec.name
        self.values = declared_parameters(self._context, documents.root, spec).values

    def given_values(self, texts: Mapping[str, str], quantities: Mapping[str, Quantity]) -> dict[str, ExpressionValue]:
        """Return the values of all valid parameters.

        `texts` maps names of parameters to strings such as `120 mm`, as in the option `-p`. `quantities` contains parsed values, which
        replace some of these strings.
        """
        root, context = self._context.documents.root, replace(self._context, report=Report(), quantities=quantities)
        valid = from_command_line(context, self._spec, texts)
        values = evaluate_parameters(root, self._spec, valid, Report(), context.doubts(root)).values
        return {name: value for name, value in values.items() if name in valid or name not in texts}

    def check_value(self, name: str, value: ExpressionValue, complain: Complain) -> ExpressionValue | None:
        """Return a new value for the parameter `name`, or None if the new value or the value in the document is invalid.

        The callback `complain` reports an invalid value.
        """
        return check_values(self._context, self._context.documents.root, self._spec, {name: value}, f"`{self.name}`", complain).get(name)


def _same_kind(declared: ExpressionValue, value: ExpressionValue, scope: Scope, spec: AssemblySpec, name: str) -> bool:
    if not isinstance(declared, Quantity) or not isinstance(value, Quantity):
        return type(declared) is type(value)
    if declared.value == 0.0 and declared.dimension == NUMBER:
        return any(value.fits(bound.dimension) for bound in _bounds(scope, spec, name).values()) or value.dimension == NUMBER
    return value.fits(declared.dimension)


def _report_wrong_type(
    name: str, declared: ExpressionValue, value: ExpressionValue, owner: str, complain: Complain, notes: list[Note], names: Collection[str],
) -> None:
    label = f"parameter `{name}` of {owner}"
    if isinstance(declared, Quantity):
        message, help = dimension_message(value, (declared.dimension,), label, None, names)
        if declared.dimension == NUMBER and declared.value == 0.0 and isinstance(value, Quantity):
            help = f"write the default of the parameter with a unit: `0 {value.dimension.example.partition(' ')[2]}`"
        complain(name, Code.DIMENSION, message, help=help, notes=notes)
    else:
        expected = "`true` or `false`" if isinstance(declared, bool) else "a string"
        found = f"{kind_of(value)} (`{shorten(format_value(value))}`)"
        complain(name, Code.VALUE_KIND, f"{label} must be {expected}, found {found}", notes=notes)


def _bounds(scope: Scope, spec: AssemblySpec, name: str) -> dict[str, Quantity]:
    entry = spec.parameters[name]
    bounds: dict[str, Quantity] = {}
    if isinstance(entry, ParameterSpec):
        for key in ("min", "max"):
            raw = getattr(entry, key)
            bound = scope.value(raw, ("parameters", name, key)) if raw is not None else None
            if isinstance(bound, Quantity):
                bounds[key] = bound
    return bounds


def _check_bounds(scope: Scope, spec: AssemblySpec, name: str, value: ExpressionValue, complain: Complain) -> bool:
    """Return whether a value is within the bounds `min` and `max` of its parameter. A value out of bounds is reported."""
    fault = _violated_bound(value, _bounds(scope, spec, name)) if isinstance(value, Quantity) else None
    if fault is not None:
        key, rule = fault
        note = Note(message="the bound is set here", span=scope.span(("parameters", name, key)))
        complain(name, Code.OUT_OF_RANGE, f"parameter `{name}` must be {rule}, found `{value}`", notes=[note])
    return fault is None


def _violated_bound(value: Quantity, bounds: Mapping[str, Quantity]) -> tuple[str, str] | None:
    """Return the key of the bound that a value violates, `min` or `max`, and the rule for the message, such as `at least 5 mm`, or None."""
    for key, bound in bounds.items():
        comparable = bound.fits(value.dimension) or value.fits(bound.dimension)
        if comparable and (value.value < bound.value if key == "min" else value.value > bound.value):
            return key, f"at {'least' if key == 'min' else 'most'} {bound}"
    return None


def check_bounds(scope: Scope, spec: AssemblySpec, names: Iterable[str]) -> set[str]:
    """Report invalid bounds of parameters, and values in the document itself that are out of bounds.

    Return the names of the parameters whose values are out of bounds. An expression that refers to such a parameter is not checked.
    """
    out_of_bounds: set[str] = set()
    for name in names:
        entry = spec.parameters[name]
        if isinstance(entry, ParameterSpec) and (entry.min is not None or entry.max is not None):
            count = len(scope.report.diagnostics)
            _check_own_bounds(scope, name, entry, _bounds(scope, spec, name), scope.names[name])
            if len(scope.report.diagnostics) > count:
                out_of_bounds.add(name)
    return out_of_bounds


def _check_own_bounds(scope: Scope, name: str, entry: ParameterSpec, bounds: dict[str, Quantity], value: ExpressionValue) -> None:
    path: Path = ("parameters", name)
    value_path, values, first_key = (*path, "value"), list(bounds.values()), "min" if entry.min is not None else "max"
    if values and (isinstance(value, str) or (isinstance(value, Quantity) and len(values) == 2)) and not any(
        isinstance(value, Quantity) and (bound.fits(value.dimension) or value.fits(bound.dimension)) for bound in values
    ) and values[0].fits(values[-1].dimension):
        message, help = dimension_message(value, (values[0].dimension,), f"the value of parameter `{name}`", scope.source_text(value_path))
        note = Note(message="the bound is set here", span=scope.span((*path, first_key)))
        scope.error(Code.DIMENSION, message, value_path, help=help, notes=[note])
        return
    if not isinstance(value, Quantity):
        scope.error(
            Code.VALUE_KIND, f"`{first_key}` of parameter `{name}` requires a number, found {kind_of(value)}", (*path, first_key),
            help=f"remove `{first_key}`", key=True, notes=scope.second_note(f"`{name}` is set here", value_path, (*path, first_key)),
        )
        return
    for key, raw in (("min", entry.min), ("max", entry.max)):
        bound = scope.value(raw, (*path, key)) if raw is not None else None
        is_number = isinstance(bound, Quantity)
        if bound is None or (isinstance(bound, Quantity) and (bound.fits(value.dimension) or value.fits(bound.dimension))):
            continue
        bounds.pop(key, None)
        code, subject, place = Code.DIMENSION if is_number else Code.VALUE_KIND, f"`{key}` of parameter `{name}`", (*path, key)
        message, help = dimension_message(bound, (value.dimension,), subject, scope.source_text(place), scope.names if is_number else ())
        scope.error(code, message, place, help=help, notes=scope.second_note(f"`{name}` is set here", value_path, place))
    if len(bounds) == 2 and bounds["min"].value > bounds["max"].value:
        scope.error(
            Code.OUT_OF_RANGE, f"`min` of parameter `{name}` is above its `max`: {bounds['min']} > {bounds['max']}", (*path, "min"),
            help="swap `min` and `max`", notes=[Note(message="`max` is set here", span=scope.span((*path, "max")))],
        )
        return
    fault = _violated_bound(value, bounds)
    if fault is not None:
        key, rule = fault
        note = Note(message="the bound is set here", span=scope.span((*path, key)))
        found = scope.format_value(value, value_path)
        scope.error(Code.OUT_OF_RANGE, f"parameter `{name}` must be {rule}, found {found}", value_path, notes=[note])


def from_command_line(context: ResolveRun, spec: AssemblySpec, texts: Mapping[str, str]) -> dict[str, ExpressionValue | Expression]:
    """Parse options `-p NAME=VALUE` and return the values of parameters of the root document, whose model is `spec`.

    Error messages contain the name of the parameter instead of a location in a document.
    """
    report, document = context.report, context.documents.root

    def complain(name: str, code: Code, message: str, *, help: Hint | None = None, notes: Iterable[Note] = ()) -> None:
        del code  # all errors of -p have the same code, because the code determines the exit status
        report.add(Code.PARAMETER_OPTION, message, None, help=help, path=f"-p {name}", notes=notes)

    values_given, expressions = _parse_options(context, spec, texts, complain)
    valid: dict[str, ExpressionValue | Expression] = dict(check_values(context, document, spec, values_given, f"`{spec.name}`", complain))
    if not expressions:
        return valid
    # Values depend on other options: evaluate all without reporting, then check the results.
    quiet = Report()
    known_expressions = {name: e for name, e in expressions.items() if name in spec.parameters}
    values = evaluate_parameters(document, spec, {**valid, **known_expressions}, quiet, context.doubts(document)).values
    for name, expression in expressions.items():
        fault = quiet.diagnostics[0] if quiet.diagnostics else None
        if name not in known_expressions or name in values:
            valid.update(check_values(context, document, spec, {name: values.get(name, False)}, f"`{spec.name}`", complain))
        elif fault is not None or not context.doubts(document):
            message = fault.message if fault else f"`{shorten(expression.text)}` cannot be evaluated"
            complain(name, Code.PARAMETER_OPTION, message, help=fault.help if fault else None)
    return valid


def _parse_options(
    context: ResolveRun, spec: AssemblySpec, texts: Mapping[str, str], complain: Complain,
) -> tuple[dict[str, ExpressionValue], dict[str, Expression]]:
    """Parse the values of parameters from the command line, which can be expressions. Invalid values are reported."""
    table = declared_parameters(context, context.documents.root, spec)
    values: dict[str, ExpressionValue] = {}
    expressions: dict[str, Expression] = {}
    for name, text in texts.items():
        if (bad := find_forbidden(text)) is not None:
            complain(name, Code.PARAMETER_OPTION, f"parameter `{name}`: {bad[1]}", help="remove the character")
            continue
        try:
            value = context.quantities.get(name) or _parse_parameter(text, table.values.get(name))
        except (UnitError, ExpressionError) as error:
            complain(name, Code.PARAMETER_OPTION, f"parameter `{name}`: {error.message}", help=error.help)
            continue
        if not isinstance(value, Expression):
            values[name] = value
        elif (unknown := next((use.name for use in value.names if use.name not in spec.parameters), None)) is None:
            expressions[name] = value
        elif not context.doubts(context.documents.root).lacks("parameters"):
            help = did_you_mean(unknown, spec.parameters, what="parameters")
            complain(name, Code.PARAMETER_OPTION, f"unknown name `{unknown}` in `{shorten(text)}`", help=help)
    return values, expressions


def _parse_parameter(text: str, declared: ExpressionValue | None) -> ExpressionValue | Expression:
    """Parse a string of the command line in the same way as a value in a document.

    `declared` is the value of the parameter in the document, whose type the new value must have.
    """
    stripped = text.strip()
    if stripped.startswith("="):
        return parse_expression(stripped)
    if isinstance(declared, str):
        return text
    if stripped in ("true", "false"):
        return stripped == "true"
    try:
        return parse_quantity(stripped)
    except UnitError:
        if isinstance(declared, Quantity):
            raise
        return text
