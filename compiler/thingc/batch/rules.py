"""The rules of a variants document (`keep:`), which compare parameters and results of each variant."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from thingc.base.diagnostics import Code, Diagnostic, Report, Severity
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.source import Document, Path
from thingc.base.suggestions import Hint, did_you_mean, text_of
from thingc.base.units import INERTIA, LENGTH, MASS, NUMBER, Dimension, Quantity
from thingc.documents.expressions.evaluation import ExpressionValue, evaluate
from thingc.documents.expressions.terms import Expression, ExpressionError

RESULTS: dict[str, Dimension] = {
    "mass": MASS, **dict.fromkeys(("centre.x", "centre.y", "centre.z"), LENGTH),
    **dict.fromkeys(("inertia.xx", "inertia.yy", "inertia.zz", "inertia.xy", "inertia.xz", "inertia.yz"), INERTIA),
    **dict.fromkeys(("box.x", "box.y", "box.z"), LENGTH), "reach": LENGTH, "torque_margin": NUMBER,
}
"""The results that every variant has, with the physical dimension of each result.

In addition, variants have the results `length.JOINT`, which are distances of a joint from the previous joint.
"""

LENGTHS = "length."
PARAMETERS = "parameters."
OF_RESULTS = "results."


class Rule(FrozenStruct):
    """A rule of a variants document, such as `mass < 2 kg`.

    `names` maps each name in the comparison to a result, or to None for a parameter.
    """

    text: str
    expression: Expression
    names: Mapping[str, str | None]

    @property
    def needs_results(self) -> bool:
        """True if the rule depends on results of a compiled robot, and not only on parameters."""
        return any(result is not None for result in self.names.values())

    def holds(self, parameters: Mapping[str, ExpressionValue], results: Mapping[str, float | None]) -> bool:
        """Return whether a variant with these parameters and results satisfies the rule.

        Raises `ExpressionError` if the rule cannot be evaluated, for example because of a division by zero. Raises `KeyError` with the name
        of the result if the variant does not have a required result.
        """
        values: dict[str, ExpressionValue] = {}
        for name, result in self.names.items():
            if result is None:
                values[name] = parameters[name.removeprefix(PARAMETERS)]
                continue
            number = results.get(result)
            if number is None:
                raise KeyError(result)
            values[name] = Quantity(number, dimension_of(result))
        return evaluate(self.expression, values) is True


def violations(
    rules: Iterable[Rule], parameters: Mapping[str, ExpressionValue], results: Mapping[str, float | None], mode: str,
) -> Iterator[tuple[Rule, Diagnostic | None]]:
    """Yield the violated rules, each with None, and the rules that cannot be evaluated, each with its error.

    `results` contains the results of the variant in the mode `mode`.
    """
    for rule in rules:
        error = None
        try:
            if rule.holds(parameters, results):
                continue
        except KeyError as fault:
            error = Diagnostic(
                code=Code.RESULT, severity=Severity.ERROR,
                message=f"`{fault.args[0]}` in the rule `{rule.text}` is not defined in mode `{mode}`",
                help="choose another mode or pose for the results, or remove the rule",
            )
        except ExpressionError as fault:
            error = Diagnostic(code=Code.RULE, severity=Severity.ERROR, message=f"`{rule.text}`: {fault.message}", help=text_of(fault.help))
        yield rule, error


def dimension_of(result: str) -> Dimension:
    """Return the physical dimension of a result. For example, the result `mass` has the dimension of a mass."""
    return RESULTS.get(result, LENGTH)


def result_of_name(name: str, parameters: Iterable[str], lengths: Iterable[str]) -> str | None:
    """Return the name of the result to which a name in a rule refers, or None for the name of a parameter.

    Raises `KeyError` for an unknown name, and `ValueError` for an ambiguous name.
    """
    known = {*RESULTS, *(LENGTHS + joint for joint in lengths)}
    parameter_names = set(parameters)
    if name.startswith(PARAMETERS) and name.removeprefix(PARAMETERS) in parameter_names:
        return None
    if name.startswith(OF_RESULTS) and name.removeprefix(OF_RESULTS) in known:
        return name.removeprefix(OF_RESULTS)
    if name in parameter_names and name in known:
        raise ValueError(name)
    if name in parameter_names:
        return None
    if name in known:
        return name
    raise KeyError(name)


def read_rules(
    document: Document, expressions: Iterable[Expression], parameters: Mapping[str, ExpressionValue], lengths: Iterable[str], *,
    reach: bool, report: Report,
) -> list[Rule]:
    """Check the names and physical dimensions in the rules of a document, and return the valid rules. Errors are added to the report.

    `parameters` contains the values of all parameters of the assembly. `lengths` contains the joints that have a result `length.JOINT`.
    `reach` is True if the document defines the result `reach`.
    """
    rules: list[Rule] = []
    lengths = list(lengths)
    for index, expression in enumerate(expressions):
        path: Path = ("keep", index)
        names: dict[str, str | None] = {}
        valid = True
        for use in expression.names:
            help: Hint | None = None
            try:
                result = result_of_name(use.name, parameters, lengths)
                if result != "reach" or reach:
                    names[use.name] = result
                    continue
                message = "the key `reach` of the variants document is required for the rule"
                help = "add two mounts of the assembly, for example `reach: {of: tip, from: base}`"
            except KeyError:
                message = f"unknown name `{use.name}`: expected the name of a parameter or a result"
                known = [*parameters, *RESULTS, *(LENGTHS + joint for joint in lengths)]
                help = did_you_mean(use.name, known, what="names")
            except ValueError:
                message = f"the name `{use.name}` of a parameter and a result is ambiguous"
                help = f"write `{PARAMETERS}{use.name}` or `{OF_RESULTS}{use.name}`"
            _report(report, document, path, message, use.offset, use.end, help)
            valid = False
        rule = Rule(text=expression.text, expression=expression, names=names)
        if valid and _dimensions_agree(report, document, path, rule, parameters):
            rules.append(rule)
    return rules


def _dimensions_agree(report: Report, document: Document, path: Path, rule: Rule, parameters: Mapping[str, ExpressionValue]) -> bool:
    """Return whether the physical dimensions in a rule are consistent. If not, report an error.

    To check the dimensions, the rule is evaluated with the parameters of the assembly, and with the value 1 for each result.
    """
    try:
        rule.holds(parameters, {result: 1.0 for result in rule.names.values() if result is not None})
    except ExpressionError as error:
        if error.kind != "value":
            _report(report, document, path, error.message, error.offset, error.end, error.help)
            return False
    return True


def _report(report: Report, document: Document, path: Path, message: Hint, offset: int, end: int, help: Hint | None) -> None:
    from thingc.documents.spec.validation_messages import span_within  # imports pydantic

    where = span_within(document, path, offset, end) or document.span(path)
    report.add(Code.RULE, message, where, help=help, path=f"keep[{path[-1]}]")
