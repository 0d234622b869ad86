"""Compute exact derivatives of a program by the chain rule. Each operation has a derivative rule.

The methods are described in Griewank and Walther, Evaluating Derivatives, 2008.

The generated function computes values and derivatives in one pass, either in forward mode (from the variables) or in reverse mode (from the
outputs). The mode with fewer statements is used. At a kink, such as the minimum of two equal numbers, an output is differentiable only if
all branches have the same derivatives. The generated function tests this condition in forward mode, so forward mode is preferred for
programs with such operations.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from functools import cache, cached_property
from itertools import product
from typing import Any

import numpy as np
from msgspec.structs import replace

from thingc.base.frozen_struct import FrozenStruct
from thingc.batch.plans.columns import Floats
from thingc.batch.plans.program import Argument, Operation, Program, namespace, operand
from thingc.batch.plans.tape import OPERATORS, Const, Ref

SAME = 1e-9
"""Relative difference up to which the derivatives of two branches are treated as equal."""


BESIDE = 1e-6
"""Relative distance of the values that are tested on both sides of a decision between equal numbers."""


class NotSmooth(Exception):
    """Raised if an output of a program does not have a derivative. `output` is the index of the output, and `why` is the reason."""

    def __init__(self, output: int, why: str) -> None:
        super().__init__(why)
        self.output = output
        self.why = why


class Partials(FrozenStruct, kw_only=False):
    """The partial derivatives of an operation as Python expressions.

    The placeholders `{0}`, `{1}` ... represent the arguments, `{r}` the result, and `{n}` the number of arguments that are equal to it. For
    an operation with a variable number of arguments, `each` is the partial derivative by the argument `{i}`. `kink` is a condition under
    which the operation has no derivative, and `why` describes this condition in messages. If `bounded` is true, the derivative also exists
    at a kink if it is equal to the derivatives of all arguments that are equal to the result.
    """

    partials: tuple[str, ...] = ()
    each: str = ""
    kink: str = ""
    why: str = ""
    bounded: bool = False

    def partial(self, index: int) -> str:
        """Return the partial derivative by the argument with this index, as an expression with placeholders."""
        return self.each.replace("{i}", f"{{{index}}}") if self.each else self.partials[index]


_FLOOR = "-(({0} - {r}) / {1})"
_EXTREME = "float({i} == {r} and 1.0 / {n})"
_ROUNDED = Partials(("1.0", "0.0"), kink="{1} < 6", why="is rounded")
UNKNOWN = Partials(each="0.0", kink="True", why="is the result of an operation without a known derivative")
RULES: dict[str, Partials] = {
    "+": Partials(("1.0", "1.0")), "-": Partials(("1.0", "-1.0")), "*": Partials(("{1}", "{0}")),
    "/": Partials(("1.0 / {1}", "-{r} / {1}")),
    "**": Partials(("{1} * {0} ** ({1} - 1)", "{r} * log({0})"), kink="{0} == 0.0 and {1} < 1", why="is a power of 0"),
    "%": Partials(("1.0", _FLOOR), kink="{r} == 0.0", why="is at a jump of a remainder"),
    "remainder": Partials(("1.0", _FLOOR), kink="2.0 * abs({r}) == abs({1})", why="is at a jump of a remainder"),
    "abs": Partials(("float({0} > 0.0) - float({0} < 0.0)",), kink="{0} == 0.0", why="is the absolute value of 0", bounded=True),
    "copysign": Partials(
        ("copysign(1.0, {0}) * copysign(1.0, {1})", "0.0"), kink="{0} == 0.0 or {1} == 0.0", why="uses the sign of 0",
    ),
    "sqrt": Partials(("0.5 / {r}",), kink="{r} == 0.0", why="is the square root of 0"),
    "hypot": Partials(each="{i} / ({r} or 1.0)", kink="{r} == 0.0", why="is the length of a vector of length 0", bounded=True),
    "sin": Partials(("cos({0})",)), "cos": Partials(("-sin({0})",)), "tan": Partials(("1.0 + {r} * {r}",)),
    "asin": Partials(("1.0 / sqrt((1.0 - {0}) * (1.0 + {0}))",), kink="abs({0}) == 1.0", why="is the arc sine of 1 or -1"),
    "acos": Partials(("-1.0 / sqrt((1.0 - {0}) * (1.0 + {0}))",), kink="abs({0}) == 1.0", why="is the arc cosine of 1 or -1"),
    "atan": Partials(("1.0 / (1.0 + {0} * {0})",)),
    "atan2": Partials(
        ("{1} / ({0} * {0} + {1} * {1})", "-{0} / ({0} * {0} + {1} * {1})"),
        kink="{0} == 0.0 and {1} <= 0.0", why="is an angle of 180 deg",
    ),
    "erf": Partials((f"{2.0 / math.sqrt(math.pi)!r} * {math.e!r} ** (-{{0}} * {{0}})",)),
    "radians": Partials((repr(math.pi / 180.0),)), "degrees": Partials((repr(180.0 / math.pi),)), "_fsum": Partials(each="1.0"),
    "min": Partials(each=_EXTREME, kink="{n} > 1", why="is the minimum of equal values", bounded=True),
    "max": Partials(each=_EXTREME, kink="{n} > 1", why="is the maximum of equal values", bounded=True),
    "round": _ROUNDED, "round_significant": _ROUNDED,
    "negative": Partials(("-1.0",)), "item": Partials(("1.0",)), "cosine of": Partials(("-sin({0})",)), "sine of": Partials(("cos({0})",)),
}
"""The derivative rule for each operation, by the name of the operation.

The operation `negative` is the unary minus. The operations `cosine of` and `sine of` return the items of `quarter_exact`. An operation that
rounds to many digits has the same derivative as the exact number.
"""
ROTATION = ("cosine of", "sine of")


class Step(Operation, kw_only=False, dict=True):
    """An operation of a program together with its partial derivatives.

    `varying` contains the positions of arguments that depend on variables.
    """

    varying: tuple[int, ...]

    @cached_property
    def rule(self) -> Partials:
        """The derivative rule of this operation. An operation without a rule is treated as not differentiable."""
        return RULES.get(self.operation, UNKNOWN)

    def code(self, template: str) -> str:
        """Replace the placeholders in the expression of a partial derivative or of a kink by names of values and constants."""
        operands = [operand(argument) for argument in self.arguments]
        return template.format(*operands, r=f"v{self.target}", n=f"{_row(operands)}.count(v{self.target})")

    @property
    def kink(self) -> str:
        """The condition under which the operation does not have a derivative, as a Python expression.

        The condition is empty for an operation that always has a derivative.
        """
        return self.code(self.rule.kink) if self.rule.kink else ""


class Derivatives(FrozenStruct, kw_only=False, eq=False):
    """The values `(m,)` of the outputs of a program, and the derivatives `(m, n)` of these outputs by n variables.

    Derivatives that depend on an operation without a rule are NaN. `special` contains the columns of variables on which a comparison of
    equal numbers depends. For slightly different values of these variables, the compiler may compute the outputs by other operations.
    """

    values: Floats
    jacobian: Floats
    special: frozenset[int] = frozenset()


DerivativeFunction = Callable[[Sequence[float]], "Derivatives | None"]
LONGEST = 50_000
"""Maximum number of statements that are generated for derivatives.

For longer programs, derivatives are computed with arrays instead of generated code.
"""


def derivative_function(program: Program, by: Sequence[int] | None = None) -> DerivativeFunction:
    """Create a function that computes the outputs of a program and their derivatives.

    `by` contains the indices of the variables by which the outputs are differentiated (default: all variables).

    The argument of the returned function contains the values of all variables. For values to which the program does not apply, the returned
    function returns None, or raises `ArithmeticError` or `ValueError`. The returned function raises `NotSmooth` if a derivative does not
    exist.
    """
    varying = program.variables if by is None else tuple(program.variables[place] for place in by)
    steps = _steps_of(program, varying)
    forward, backward = _forward(program, steps, varying), _backward(program, steps, varying)
    times = 2 if any(step.rule.bounded for step in steps) else 1  # reverse mode at a kink also requires forward mode
    shortest = forward if len(forward[0]) <= times * len(backward[0]) else backward
    decisions = _decisions(program, varying)
    shape = (len(program.outputs), len(varying))

    def generate(code: Code) -> Callable[..., Any]:
        tested = [step for step in steps if code is not forward or not step.rule.bounded]
        return _generate_function(program, tested, decisions, code if len(code[0]) <= LONGEST else None)

    run, at_kinks = generate(shortest), cache(lambda: generate(forward))

    def derivatives(values: Sequence[float]) -> Derivatives | None:
        nonlocal decisions, run
        result = run(*values)
        if result is not None and isinstance(result[1], dict) and shortest is not forward:
            result = at_kinks()(*values)
        if result is None:
            return None
        outputs, entries = result
        special: frozenset[int] = frozenset()
        if isinstance(entries, dict):
            special, always = _special(program, decisions, varying, values, entries)
            entries = _by_arrays(program, steps, varying, entries)
            if always:  # the numbers are equal for all values, so this is not a decision
                decisions = [one for one in decisions if one not in always]
                run = generate(shortest)
                at_kinks.cache_clear()
        return Derivatives(np.array(outputs, dtype=np.float64), np.array(entries, dtype=np.float64).reshape(shape), special)

    return derivatives


def with_slopes(program: Program, by: int, numbers: Sequence[int]) -> Program:
    """Convert a program to a program in which the variables `numbers` are linear functions of the variable `by`.

    The arguments of the new program are the variables of the old program, followed by the slopes of the linear functions. The last argument
    is the value of the variable `by` at which the numbers have the given values.
    """
    unused = 1 + max(*program.variables, *(line.target for line in program.statements if isinstance(line, Operation)))
    count = len(numbers)
    values, slopes, changes = (range(unused + k * count, unused + (k + 1) * count) for k in range(3))
    centre, offset = unused + 3 * count, unused + 3 * count + 1
    lines = [Operation(offset, "-", (Ref(by), Ref(centre)))]
    for number, value, slope, change in zip(numbers, values, slopes, changes, strict=True):
        lines += [Operation(change, "*", (Ref(slope), Ref(offset))), Operation(number, "+", (Ref(value), Ref(change)))]
    renamed = dict(zip(numbers, values, strict=True))
    variables = (*(renamed.get(index, index) for index in program.variables), *slopes, centre)
    return replace(program, variables=variables, statements=(*lines, *program.statements))


Code = tuple[list[str], list[str]]
"""The type of generated code: a list of statements, and a list of the entries of the Jacobian as expressions, row by row."""


Decision = tuple[str, frozenset[int]]
"""A test of whether the two numbers in a guard are equal, and the columns of the variables on which the numbers depend."""


def _decisions(program: Program, varying: Sequence[int]) -> list[Decision]:
    """Return the comparisons in the guards of a program that depend on the given variables."""
    depends: dict[int, frozenset[int]] = {index: frozenset((column,)) for column, index in enumerate(varying)}
    tests: dict[str, frozenset[int]] = {}
    for statement in program.statements:
        columns = frozenset[int]().union(*(depends.get(_index(argument), frozenset()) for argument in statement.arguments))
        if isinstance(statement, Operation):
            depends[statement.target] = columns
        elif columns and len(statement.arguments) == 2 and statement.operation in OPERATORS:
            tests[f"{operand(statement.arguments[0])} == {operand(statement.arguments[1])}"] = columns
    return list(tests.items())


def _special(
    program: Program, decisions: Sequence[Decision], varying: Sequence[int], values: Sequence[float], known: dict[str, float],
) -> tuple[frozenset[int], list[Decision]]:
    """Find comparisons between equal numbers whose outcome is different for nearby values of the variables.

    Return the columns of the variables on which these comparisons depend, and the comparisons whose numbers remain equal. Only those
    variables are tested that affect a comparison between numbers that are currently equal.
    """
    functions = namespace()
    equal = [decision for decision in decisions if eval(decision[0], functions, known)]
    probe = _generate_function(program, (), (), None)
    special: set[int] = set()
    differ: set[Decision] = set()
    for column, sign in product(sorted(frozenset[int]().union(*(columns for _, columns in equal))), (1.0, -1.0)):
        place, nearby = program.variables.index(varying[column]), None
        with suppress(ArithmeticError, ValueError):
            nearby = probe(*(value + sign * BESIDE * (abs(value) or 1.0) if at == place else value for at, value in enumerate(values)))
        if nearby is None:
            special.add(column)
        differ.update(test for test in equal if column in test[1] and (nearby is None or not eval(test[0], functions, nearby[1])))
    return frozenset(special), [decision for decision in equal if decision not in differ]


def _generate_function(program: Program, steps: Sequence[Step], decisions: Sequence[Decision], code: Code | None) -> Callable[..., Any]:
    """Generate the function that computes the outputs and the elements of the Jacobian.

    The generated function returns all values by name instead of the Jacobian at a kink of `steps`, for a comparison between equal numbers,
    and without `code`.
    """
    tests = [*(test for test, _ in decisions), *(step.kink for step in steps if step.kink)]
    statements, entries = code or ([], [])
    run: Callable[..., Any] = program.compile_function([
        f" if {'True' if code is None else ' or '.join(tests) or 'False'}: return {program.output_code}, locals()",
        *(f" {statement}" for statement in statements),
        f" return {program.output_code}, {_row(entries)}",
    ], differ=_differ)
    return run


def _forward(program: Program, steps: Sequence[Step], varying: Sequence[int]) -> Code:
    """Generate code for forward differentiation: derivatives of each value by the variables on which the value depends.

    At a kink, the code compares the derivatives of all branches. If they differ, the generated function returns all values by name.
    """
    known: dict[int, dict[int, str]] = {index: {place: "1.0"} for place, index in enumerate(varying)}
    statements: list[str] = []
    for step in steps:
        sums: dict[int, list[str]] = defaultdict(list)
        for place, partial in _partials(step, statements):
            for variable, derivative in known[_index(step.arguments[place])].items():
                sums[variable].append(_product(partial, derivative))
        found = {variable: _name_sum(f"d{step.target}_{variable}", terms, statements) for variable, terms in sums.items()}
        known[step.target] = found
        if step.rule.bounded and found:
            inner = (_row(known.get(_index(one), {}).get(variable, "0.0") for variable in found) for one in step.arguments)
            differ = f"differ(v{step.target}, {_row(found.values())}, {_row(map(operand, step.arguments))}, {_row(inner)})"
            statements.append(f"if {step.kink} and {differ}: return {program.output_code}, locals()")
    entries = [known.get(_index(one), {}).get(variable, "0.0") for one in program.outputs for variable in range(len(varying))]
    return statements, entries


def _backward(program: Program, steps: Sequence[Step], varying: Sequence[int]) -> Code:
    """Generate code for reverse differentiation: derivatives of each output by the values on which the output depends."""
    statements: list[str] = []
    partials = [dict(_partials(step, statements)) for step in steps]
    entries: list[str] = []
    for row, output in enumerate(program.outputs):
        sums: dict[int, list[str]] = defaultdict(list, {_index(output): ["1.0"]})
        for step, by_place in zip(reversed(steps), reversed(partials), strict=True):
            terms = sums.get(step.target)
            if terms is None:
                continue
            adjoint = _name_sum(f"b{row}_{step.target}", terms, statements)
            for place, partial in by_place.items():
                sums[_index(step.arguments[place])].append(_product(partial, adjoint))
        entries += [" + ".join(sums.get(index, ["0.0"])) for index in varying]
    return statements, entries


def _partials(step: Step, statements: list[str]) -> list[tuple[int, str]]:
    """Return the partial derivatives of an operation by each varying argument, as names or constants, without those that are always 0.

    For partial derivatives that are not constant, the function appends statements to `statements`.
    """
    partials = []
    for place in step.varying:
        code = step.code(step.rule.partial(place))
        if "v" not in code:
            code = repr(float(eval(code, namespace())))
        elif not code.isidentifier():
            statements.append(f"p{step.target}_{place} = {code}")
            code = f"p{step.target}_{place}"
        if code not in ("0.0", "-0.0"):
            partials.append((place, code))
    return partials


def _differ(result: float, slopes: Iterable[float], numbers: Iterable[float], inner: Iterable[Iterable[float]]) -> bool:
    """Return whether derivatives of an operation differ from those of an argument that is equal to the result.

    `slopes` are the derivatives of the operation, and `inner` contains those of each argument. `numbers` are the values of the arguments.
    """
    equal = (row for number, row in zip(numbers, inner, strict=True) if number == result)
    return not all(math.isclose(one, other, rel_tol=SAME) for row in equal for one, other in zip(row, slopes, strict=True))


def _row(items: Iterable[str]) -> str:
    """Return a tuple as a Python expression."""
    return f"({''.join(f'{item}, ' for item in items)})"


def _name_sum(name: str, terms: Sequence[str], statements: list[str]) -> str:
    """Return an expression without operators for the sum of `terms`: the only term, or `name`, to which a new statement assigns the sum."""
    if len(terms) == 1 and "*" not in terms[0]:
        return terms[0]
    statements.append(f"{name} = {' + '.join(terms)}")
    return name


def _product(partial: str, derivative: str) -> str:
    if derivative == "1.0":
        return partial
    return derivative if partial == "1.0" else f"-{derivative}" if partial == "-1.0" else f"{partial} * {derivative}"


def _index(argument: Argument) -> int:
    """Return the index of the value to which an argument refers. For a constant, return -1."""
    return int(argument) if isinstance(argument, Ref) else -1


def _by_arrays(program: Program, steps: Sequence[Step], varying: Sequence[int], values: dict[str, float]) -> Floats:
    """Compute the Jacobian of a program from the values of all operations.

    The derivatives of each value are an array with one element per variable. `values` maps the names of values in the program to numbers.
    Raises `NotSmooth` if a derivative does not exist.
    """
    zero = np.zeros(len(varying))
    known: dict[int, Floats] = dict(zip(varying, np.eye(len(zero)), strict=True))
    reasons: dict[int, Partials] = {}
    functions = namespace(program.operations)
    for step in steps:
        inner = [known.get(_index(one), zero) for one in step.arguments]
        at_kink = bool(step.kink) and eval(step.kink, functions, values)
        if step.rule.bounded or not at_kink:
            terms = [eval(step.code(step.rule.partial(place)), functions, values) * inner[place] for place in step.varying]
            known[step.target] = np.sum(terms, axis=0)
        numbers = [eval(operand(argument), functions, values) for argument in step.arguments if at_kink]
        if at_kink and not (step.rule.bounded and not _differ(values[f"v{step.target}"], known[step.target], numbers, inner)):
            smooth = step.rule.bounded or step.rule is UNKNOWN  # smooth if the arguments do not change
            known[step.target] = np.where(np.any([one != 0.0 for one in inner], axis=0) | (not smooth), np.nan, 0.0)
            reasons[step.target] = step.rule
        if np.isnan(known[step.target]).any():
            reasons.update((step.target, reasons[one]) for one in map(_index, step.arguments) if one in reasons)
    for row, output in enumerate(program.outputs):
        reason = reasons.get(_index(output), UNKNOWN)
        if reason is not UNKNOWN and np.isnan(known[_index(output)]).any():
            raise NotSmooth(row, reason.why)
    return np.array([known.get(_index(one), zero) for one in program.outputs]).reshape(len(program.outputs), len(zero))


def _steps_of(program: Program, variables: Sequence[int]) -> list[Step]:
    """Return the operations that depend on the variables and affect outputs, with their derivative rules, in the order of computation."""
    operations = {one.target: one for one in program.statements if isinstance(one, Operation)}
    varying, steps = set(variables), []
    for line in operations.values():
        operation, arguments = line.operation, line.arguments
        inner = operations.get(_index(arguments[0])) if operation == "item" else None
        if inner is not None and inner.operation == "quarter_exact":
            operation, arguments = ROTATION[arguments[1] == Const(1)], inner.arguments
        if places := tuple(place for place, one in enumerate(arguments) if isinstance(one, Ref) and int(one) in varying):
            varying.add(line.target)
            steps.append(Step(line.target, "negative" if (operation, len(arguments)) == ("-", 1) else operation, arguments, places))
    needed = {int(one) for one in program.outputs if isinstance(one, Ref)}
    used = []
    for step in reversed(steps):
        if step.target in needed:
            needed.update(_index(step.arguments[place]) for place in step.varying)
            used.append(step)
    return used[::-1]
