"""A tape as a function of Python: straight on, without a branch but its guards."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from thingc.base import numeric
from thingc.batch.plans.tape import OPERATIONS, Const, Ref, Tape, Traced

Run = Callable[..., "tuple[float, ...] | None"]
"""Values of the variables -> those of the outputs; None where a guard does not hold."""

def compiled(tape: Tape, outputs: Sequence[Any]) -> Run:
    """The function that works `outputs` (numbers, traced or not) out anew. It does the same operations on doubles as the passes did, in
    their order, so that what it gives is what they would give, to the last bit; it gives None where a pass would have decided otherwise,
    or could not have gone on."""
    names: dict[str, Any] = {"inf": numeric.inf, "nan": numeric.nan, **numeric.OPERATIONS}
    guards = list(dict.fromkeys((operation, arguments, outcome, at) for at, operation, arguments, outcome in tape.guards))
    seen: set[Any] = set()
    needed = _needed(tape, [*(Ref(one.line) for one in outputs if isinstance(one, Traced)), *(a for _, args, _, _ in guards for a in args)])
    variables = [line for line, (operation, _) in enumerate(tape.lines) if operation == "variable"]
    text = [f"def run({', '.join(f'v{line}' for line in variables)}):"]
    waiting = iter(sorted(guards, key=lambda one: one[3]))
    guard = next(waiting, None)
    for line in range(len(tape.lines) + 1):
        while guard is not None and guard[3] <= line:
            operation, arguments, outcome, _ = guard
            if (key := (operation, arguments, outcome)) not in seen:
                seen.add(key)
                told = _code(operation, arguments)
                text.append(f" if {told}: return None" if not outcome else f" if not {told}: return None")
            guard = next(waiting, None)
        if line < len(tape.lines) and line in needed and tape.lines[line][0] != "variable":
            text.append(f" v{line} = {_code(*tape.lines[line])}")
    values = ", ".join(f"v{one.line}" if isinstance(one, Traced) else repr(one) for one in outputs)
    text.append(f" return ({values}{',' if outputs else ''})")
    exec("\n".join(text), names)
    run: Run = names["run"]
    return run


def variables_of(tape: Tape, number: Traced) -> list[int]:
    """The variables that a number depends on, by their number."""
    variables = [line for line, (operation, _) in enumerate(tape.lines) if operation == "variable"]
    needed = _needed(tape, [Ref(number.line)])
    return [k for k, line in enumerate(variables) if line in needed]


def _needed(tape: Tape, wanted: Sequence[Any]) -> set[int]:
    needed: set[int] = set()
    waiting = [int(one) for one in wanted if isinstance(one, Ref)]
    while waiting:
        line = waiting.pop()
        if line not in needed:
            needed.add(line)
            waiting.extend(int(one) for one in tape.lines[line][1] if isinstance(one, Ref))
    return needed


def _code(operation: str, arguments: Sequence[Ref | Const]) -> str:
    words = [f"v{int(one)}" if isinstance(one, Ref) else f"({one.text})" for one in arguments]
    if operation in OPERATIONS:
        return f"-{words[0]}" if len(words) == 1 else f"({words[0]} {operation} {words[1]})"
    if operation == "item":
        return f"{words[0]}[{words[1]}]"
    return f"{operation}({', '.join(words)})"

