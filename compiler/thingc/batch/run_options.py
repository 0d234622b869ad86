"""Check the options for running a batch, from Python or from the command line."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from concurrent.futures import Executor
from numbers import Integral, Real
from typing import Any

from msgspec.structs import replace

from thingc.base.diagnostics import Code
from thingc.batch import variants_document
from thingc.batch.cluster.dask_executor import DaskCluster
from thingc.batch.folder import FOLDERS, PACKED, BatchFault
from thingc.batch.planning import Plan
from thingc.batch.results import FamilyError
from thingc.documents.workspace import LONGEST
from thingc.driver.environment import Options
from thingc.targets.registry import parse_targets, unknown


def is_whole(value: Any, least: int) -> bool:
    """Return True if a value is an integer that is not less than `least`."""
    return isinstance(value, Integral) and not isinstance(value, bool) and int(value) >= least


def is_number(value: Any) -> bool:
    """Return True if a value is a finite number."""
    return isinstance(value, Real) and not isinstance(value, bool) and math.isfinite(value)


def at_least(least: int, *, whole: bool = True, **numbers: Any) -> None:
    """Raise `FamilyError` if one of the values is not a finite number or, with `whole`, not an integer, or if it is less than `least`.

    The error message contains the name of the value.
    """
    for name, value in numbers.items():
        if not (is_whole(value, least) if whole else is_number(value) and value >= least):
            kind = "whole number" if whole else "number"
            raise FamilyError(f"expected `{name}` to be a {kind} of at least {least}, found {value}")


def require_functions(argument: str, **functions: Any) -> None:
    """Raise `FamilyError` if one of the options is not a function. All options except `reward` can be None.

    `argument` describes the argument of the functions.
    """
    for name, function in functions.items():
        if not callable(function) and (function is not None or name == "reward"):
            raise FamilyError(f"expected `{name}` to be a function of {argument}, found `{function}`")


def as_names(**argument_value: Any) -> tuple[str, ...]:
    """Convert the value of an argument to a tuple of names. The value is a single name, or an iterable of names.

    Raises `FamilyError` for any other value. The error message contains the name of the argument.
    """
    ((argument, names),) = argument_value.items()
    if isinstance(names, str):
        return (names,)
    if not isinstance(names, Iterable):
        raise FamilyError(f"expected `{argument}` to be a list of names, found `{names}`")
    return tuple(map(str, names))


def check(jobs: int, limit: int | None, timeout: float, verify: int, pictures: int | None, layout: str | None) -> None:
    """Raise `BatchFault` if one of the options for running a batch is invalid."""
    wholes = (("jobs", jobs, 0), ("limit", 1 if limit is None else limit, 1), ("verify", verify, 0), ("pictures", pictures or 0, 0))
    for name, value, least in wholes:
        if not is_whole(value, least):
            raise BatchFault(Code.COMMAND_LINE, f"expected `{name}` to be a whole number of at least {least}, found `{value}`")
    if not is_number(timeout) or not 0.0 < timeout <= LONGEST:
        raise BatchFault(Code.COMMAND_LINE, f"expected `timeout` to be a number of seconds, at most {LONGEST:.0f}, found `{timeout}`")
    if layout not in (None, FOLDERS, PACKED):
        raise BatchFault(Code.COMMAND_LINE, f"unknown layout `{layout}`", f"use `{FOLDERS}`, `{PACKED}`, or None for the default")


def check_engine(executor: Executor | None, ship: bool) -> None:
    """Raise `BatchFault` if `executor` lacks the methods of an executor, or if `ship` is set and the executor cannot transfer files."""
    if executor is not None and not callable(getattr(executor, "submit", None)):
        raise BatchFault(Code.COMMAND_LINE, f"expected `executor` to be an executor of `concurrent.futures`, found `{executor}`")
    if ship and not isinstance(executor, DaskCluster):
        raise BatchFault(Code.COMMAND_LINE, "--ship can only be used with Dask workers", "remove --ship")


def chosen_targets(emit: Sequence[str] | str) -> tuple[str, ...]:
    """Convert the option `emit` to the names of targets, in the order of a build. Raises `BatchFault` for an unknown target."""
    names = tuple(map(str, emit)) if isinstance(emit, Iterable) and not isinstance(emit, str) else (str(emit),)
    for _, message, hint in unknown(names):
        raise BatchFault(Code.COMMAND_LINE, message, hint)
    return parse_targets(names) if names else ()


def read_plan(document: str, options: Options, emit: Sequence[str] | str, layout: str | None) -> Plan:
    """Read a variants document and return its plan. The options `emit` and `layout`, if given, replace the values in the variants document.

    Raises `PlanError` for a document with errors, and `BatchFault` for an unknown target.
    """
    targets, plan = chosen_targets(emit), variants_document.plan(document, options=options)
    return replace(plan, emit=targets or plan.emit, layout=layout or plan.layout)
