"""Implementation of `thingc sensitivity`, which computes derivatives of properties of a robot with respect to its parameters.

Derivatives are exact, except for parameters of modelled parts: these are estimated from five similar robots, and the error of the
estimate is shown after `+-`.

  thingc sensitivity assemblies/arm.yaml                            mass and centre of mass by all parameters
  thingc sensitivity assemblies/arm.yaml --of mass,centre.z,tests.* also what the tests of the document measure
  thingc sensitivity assemblies/arm.yaml --of site:tip.z --by reach,joints.elbow.turn -p 'reach=120 mm'
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from itertools import groupby
from typing import TYPE_CHECKING

from msgspec.structs import replace

from thingc.base.diagnostics import Code, Diagnostic, Report
from thingc.base.units import ANGLE, INERTIA, LENGTH, MASS, Quantity, parse_quantity
from thingc.batch.values import standard_unit
from thingc.driver.api import CompileError
from thingc.tools.cli import console

if TYPE_CHECKING:
    from thingc.batch.families.function import NotDifferentiable
    from thingc.batch.families.sensitivity import Sensitivity

SHOWN = {MASS: "g", LENGTH: "mm", ANGLE: "deg", INERTIA: "kg*mm^2"}
"""The units in which results are displayed, by physical dimension.

Parameters without a unit in the document are displayed in the same units.
"""
ALIASES = {"com": "centre"}
"""Maps internal names of results to the corresponding names in documents."""
NONE = 1e-12
"""A smaller relative change of a result is treated as a rounding error."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options of `thingc sensitivity` to the parser."""
    console.add_document(parser)
    parser.add_argument(
        "--of", metavar="RESULT,...", type=_split, default=["mass", "centre"],
        help="results to differentiate, separated by commas (default: mass,centre)",
    )
    parser.add_argument(
        "--by", metavar="NAME,...", type=_split, default=[],
        help="parameters or paths to vary, separated by commas (default: all numeric parameters)",
    )
    parser.add_argument("--mode", metavar="M", help="mode of the robot (default: the first mode)")
    console.add_format(parser)
    console.add_compiling(parser)


def _split(text: str) -> list[str]:
    words = [word.strip() for word in text.split(",")]
    if not all(words):
        raise argparse.ArgumentTypeError(f"expected names separated by commas, found `{text}`")
    return words


def run(arguments: argparse.Namespace) -> int:
    """Run `thingc sensitivity`, and return the exit code. With text output, diagnostics are printed to standard error."""
    from thingc.batch.families import RobotFamily
    from thingc.batch.results import FamilyError

    console.require_document(arguments.document)
    options = console.options_of(arguments)
    settings = {**options.parameters, **options.choices}
    outputs = [".".join((ALIASES.get(first, first), *rest)) for first, *rest in (one.split(".") for one in arguments.of)]
    found: list[Sensitivity] = []
    try:
        with RobotFamily(arguments.document, mode=arguments.mode, options=replace(options, parameters={}, choices={})) as family:
            report = Report(list(family.evaluate(settings).problems))
            if not report.failed:
                found = family.sensitivity(outputs, arguments.by, at=settings)
        report.diagnostics += {one.name: _problem(one, one.missing) for one in reversed(found) if one.missing is not None}.values()
    except CompileError as fault:
        report = Report(list(fault.diagnostics))
    except FamilyError as fault:
        raise console.WrongCommandLine(fault.reason, fault.help) from fault
    diagnostics = console.final(report, strict=arguments.strict)
    return console.print_result(arguments, diagnostics, as_text(found) if found else (), sensitivities=list(map(_as_data, found)))


def _problem(one: Sensitivity, missing: NotDifferentiable) -> Diagnostic:
    return replace(console.error(missing.reason, missing.help, Code.RESULT), span=one.span, path=f"{one.result} by {one.name}")


def _as_data(one: Sensitivity) -> dict[str, object]:
    """Return one sensitivity for the JSON output, in SI units. `derivative` is None if the derivative does not exist."""
    derivative, error = (None, None) if one.missing is not None else (one.derivative, one.error)
    return {
        "result": one.result, "name": one.name, "value": one.value.value, "at": one.number.value, "derivative": derivative, "error": error,
    }


def as_text(found: Sequence[Sensitivity]) -> list[str]:
    """Format the derivatives as a table.

    For each result, the table lists the parameters that affect the result, the largest change first.
    """
    rows = [("result", "value", "parameter", "at", "derivative", "error", "+1 % changes it by", "")]
    idle: list[str] = []
    for result, each in groupby(found, key=lambda one: one.result):
        effects = [one for one in each if one.missing is not None or abs(one.derivative) > max(one.error, NONE * abs(one.value.value))]
        if not effects:
            idle.append(result)
        for number, one in enumerate(sorted(effects, key=lambda one: (-abs(one.change), -abs(one.derivative)))):
            unit, size = _unit(one.value)
            head = (result, f"{one.value.value / size:z.4g} {unit}".rstrip()) if number == 0 else ("", "")
            rows.append((*head, *_cells(one)))
    lines = console.table(rows, right=(1, 3)) if len(rows) > 1 else []
    return [*lines, *([f"no parameter changes {', '.join(idle)}"] if idle else [])]


def _cells(one: Sensitivity) -> tuple[str, ...]:
    """Return the cells of the table row that describes one derivative."""
    by, by_size = (one.unit, parse_quantity(f"1 {one.unit}").value) if one.unit else _unit(one.number)
    at = f"{one.number.value / by_size:z.4g} {by}".rstrip()
    if one.missing is not None:
        return one.name, at, "does not exist", "", "", ""
    unit, size = _unit(replace(one.value, value=one.derivative * by_size))
    per = f"{unit or '1'}/({by})" if "/" in by or "*" in by else f"{unit or '1'}/{by}" if by else unit
    derivative = f"{one.derivative * by_size / size:z.4g} {per}".rstrip()
    error = f"+-{one.error * by_size / size:.1g}" if one.error else "exact"
    unit, size = _unit(replace(one.value, value=one.change))
    change = f"{one.change / size:+.3g} {unit}".rstrip() if one.change else ""
    share = f"{100.0 * one.change / abs(one.value.value):+.2g} %" if abs(one.change) > 1e-9 * abs(one.value.value) > 0.0 else ""
    return one.name, at, derivative, error, change, share


def _unit(value: Quantity) -> tuple[str, float]:
    """Return the display unit of a quantity, and the factor that converts this unit to SI units."""
    unit = "kg" if value.dimension == MASS and abs(value.value) >= 1.0 else SHOWN.get(value.dimension) or standard_unit(value.dimension)
    return unit, parse_quantity(f"1 {unit}").value
