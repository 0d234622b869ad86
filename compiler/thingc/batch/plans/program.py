"""Programs that compute numbers from the values of variables.

A program consists of those statements of a tape that are needed for the requested outputs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any

from thingc.base import numeric
from thingc.base.frozen_struct import FrozenStruct
from thingc.batch.plans.tape import OPERATORS, Const, Ref, Tape, Traced, lines_needed

Argument = Ref | Const
Run = Callable[..., "tuple[float, ...] | None"]
"""A function that maps values of the variables to values of the outputs. The function returns None if a guard fails."""


def namespace(operations: Mapping[str, Callable[..., Any]] = {}) -> dict[str, Any]:
    """Return a mapping of the names that generated Python code can use: all registered operations, and the given `operations`."""
    return {"inf": numeric.inf, "nan": numeric.nan, "log": math.log, **numeric.OPERATIONS, **operations}


class Operation(FrozenStruct, kw_only=False):
    """A statement of a program that computes the value with the index `target` from constants and from values with other indices."""

    target: int
    operation: str
    arguments: tuple[Argument, ...]


class Guard(FrozenStruct, kw_only=False):
    """A condition on the variables of a program.

    The program applies only to values of the variables for which the operation returns `outcome`.
    """

    operation: str
    arguments: tuple[Argument, ...]
    outcome: bool


class Program(FrozenStruct, kw_only=False, eq=False, dict=True):
    """A program that computes the numbers `outputs` from the variables of a tape.

    The program repeats the operations of the compiler on double-precision floats in the same order. The results of a program are therefore
    equal to the results of a compilation bit by bit.
    """

    variables: tuple[int, ...]
    statements: tuple[Operation | Guard, ...]
    outputs: tuple[Argument, ...]
    operations: Mapping[str, Callable[..., Any]] = {}
    """Operations of the tape in addition to the operations of `base/numeric.py`, by name."""

    @cached_property
    def run(self) -> Run:
        """The program as a Python function, which maps values of the variables to the outputs.

        If the compiler would make another decision or fail for the given values, this function returns None, or raises `ArithmeticError` or
        `ValueError`.
        """
        run: Run = self.compile_function([f" return {self.output_code}"])
        return run

    @property
    def output_code(self) -> str:
        """The tuple of the outputs as a Python expression."""
        return f"({''.join(f'{operand(output)}, ' for output in self.outputs)})"

    def compile_function(self, lines: Sequence[str], **functions: Callable[..., Any]) -> Any:
        """Compile a Python function of the variables, which executes the statements of the program and then the source code in `lines`.

        The function returns None if a guard has a different outcome. The code can use `functions` by name, and all names that `namespace`
        returns.
        """
        statements = [
            f" v{statement.target} = {expression(statement.operation, statement.arguments)}" if isinstance(statement, Operation)
            else f" if {'not ' * statement.outcome}{expression(statement.operation, statement.arguments)}: return None"
            for statement in self.statements
        ]
        scope = namespace({**self.operations, **functions})
        exec("\n".join([f"def run({', '.join(f'v{index}' for index in self.variables)}):", *statements, *lines]), scope)
        return scope["run"]

    @cached_property
    def needed(self) -> frozenset[int]:
        """The indices of all computed values on which the outputs depend. The set does not include values that only guards use."""
        needed = {int(output) for output in self.outputs if isinstance(output, Ref)}
        for statement in reversed(self.statements):
            if isinstance(statement, Operation) and statement.target in needed:
                needed.update(int(argument) for argument in statement.arguments if isinstance(argument, Ref))
        return frozenset(needed.difference(self.variables))


def program_of(tape: Tape, outputs: Sequence[Any]) -> Program:
    """Create a program that computes the numbers `outputs` from the variables of the tape. The program contains all guards of the tape.

    Numbers in `outputs` that are not traced become constants.
    """
    guards = list(dict.fromkeys((Guard(operation, arguments, outcome), at) for at, operation, arguments, outcome in tape.guards))
    results = tuple(Ref(output.line) if isinstance(output, Traced) else Const(output) for output in outputs)
    needed = lines_needed(tape, [*results, *(argument for guard, _ in guards for argument in guard.arguments)])
    statements: dict[Operation | Guard, None] = {}
    waiting = sorted(guards, key=lambda guard: -guard[1])
    for index, (operation, arguments) in enumerate([*tape.lines, ("end", ())]):
        while waiting and waiting[-1][1] <= index:
            statements[waiting.pop()[0]] = None
        if index in needed and operation != "variable":
            statements[Operation(index, operation, arguments)] = None
    variables = tuple(index for index, (operation, _) in enumerate(tape.lines) if operation == "variable")
    return Program(variables, tuple(statements), results, dict(tape.operations))


def expression(operation: str, arguments: Sequence[Argument]) -> str:
    """Format an operation and its arguments as a Python expression."""
    operands = [operand(argument) for argument in arguments]
    if operation in OPERATORS:
        return f"-{operands[0]}" if len(operands) == 1 else f"({operands[0]} {operation} {operands[1]})"
    if operation == "item":
        return f"{operands[0]}[{operands[1]}]"
    return f"{operation}({', '.join(operands)})"


def value_in(argument: Argument, values: Mapping[int, Any]) -> Any:
    """Return the value of an argument, which is a constant or refers to an entry of `values`."""
    return values[int(argument)] if isinstance(argument, Ref) else argument.value


def operand(argument: Argument) -> str:
    """Format an argument of an operation as a Python expression. The expression is either the name of a value or a constant."""
    return f"v{int(argument)}" if isinstance(argument, Ref) else f"({argument.text})"
