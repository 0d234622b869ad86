"""Record an iterative search, such as the search for the pose of a closed loop, as a single operation on a tape.

The steps of a search are not recorded one by one, because the number of steps depends on the values of the inputs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import lru_cache, partial
from typing import Any

from msgspec.structs import replace

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.memo import Memo
from thingc.batch.plans.tape import Ref, Tape, Traced
from thingc.model.assembly.types import JointEdge
from thingc.model.resolve.coordinates import Dynamics
from thingc.model.robot.loop_solver import Loops, SolverState

SEARCHES = ("close_pose", "closest_failure", "balance")
"""Names of search functions that are called through the memo, and that the tape repeats as single operations."""

KEPT = 32
"""Number of cached results per search. Results are cached because several plans are tried for the same numbers."""

Numbers = Sequence[float]


class SearchMemo(Memo):
    """A cache for the results of functions that are called during a traced compilation.

    The cache records each call of a search function with traced numbers on the tape. `SEARCHES` contains the names of these search
    functions. When a recorded search is repeated and its result has a different structure, the operation raises `ValueError`, because the
    tape does not apply.
    """

    __slots__ = ("_tape",)

    def __init__(self, tape: Tape) -> None:
        super().__init__()
        self._tape = tape

    def __call__(self, place: Any, function: Callable[..., Any], *inputs: Any) -> Any:
        """Return the result of a function call, from the cache if possible, as `Memo` does.

        If the function is a search, the call is recorded on the tape.
        """
        known = getattr(function, "__name__", "") in SEARCHES
        return super().__call__(place, partial(self._search, function) if known else function, *inputs)

    def _search(self, function: Callable[..., Any], *inputs: Any) -> Any:
        tape, numbers = self._tape, list[Traced]()
        loops, start = (*inputs, None)[:2]
        if isinstance(loops, Loops) and isinstance(start, SolverState):
            inputs = (loops.alone(start.q), *inputs[1:])
        build = _builder(inputs, numbers)
        if build is None:
            return function(*inputs)
        plain = [one.value for one in numbers]
        given = build(plain)
        result = function(*given)
        kept = _outside(given)
        structure = _structure(result, kept, [])

        @lru_cache(KEPT)
        def repeat(*values: float) -> tuple[float, ...]:
            given, found = build(values), list[float]()
            if _structure(function(*given), _outside(given), found) != structure:
                raise ValueError("a search has a different result for these numbers")
            return tuple(found)

        name = f"search_{len(tape.operations)}"
        tape.operations[name] = repeat
        whole = tape.apply(name, numbers, repeat(*plain))
        tape.guards.append((len(tape.lines), "==", (Ref(whole.line), Ref(whole.line)), True))  # even if none of its numbers is used
        items = [tape.apply("item", (whole, place), value) for place, value in enumerate(whole.value)]
        return _with_numbers(result, kept, _outside(inputs), iter(items))


def _builder(value: Any, numbers: list[Traced]) -> Callable[[Numbers], Any] | None:
    """Return a function that creates a copy of `value` with other numbers in place of the traced numbers.

    Return None if `value` does not contain traced numbers. The traced numbers in `value` are appended to `numbers`. The returned function
    has one argument, which contains a value for each traced number.
    """
    if isinstance(value, Traced):
        place = next((place for place, one in enumerate(numbers) if one.line == value.line), len(numbers))
        if place == len(numbers):
            numbers.append(value)
        return lambda values: values[place]
    if isinstance(value, Loops):
        parts = _builder((value.bodies, value.closures, tuple(value.joints.values()), value.base), numbers)
        return None if parts is None else lambda values: Loops(*parts(values))
    if isinstance(value, JointEdge):  # only values that affect loops, so that other values do not repeat the search
        value = replace(value, dynamics=Dynamics(), actuator=None, limit=replace(value.limit, effort=None, velocity=None))
    if isinstance(value, FrozenStruct):
        fields = _builder({name: getattr(value, name) for name in value.__struct_fields__}, numbers)
        return None if fields is None else lambda values: replace(value, **fields(values))
    items = list(value.items() if isinstance(value, Mapping) else enumerate(value) if isinstance(value, (tuple, list)) else ())
    changed = [(key, inner) for key, one in items if (inner := _builder(one, numbers)) is not None]
    if not changed:
        return None
    whole = dict(items)

    def build(values: Numbers) -> Any:
        made = {**whole, **{key: one(values) for key, one in changed}}
        return made if isinstance(value, Mapping) else _like(value, made.values())

    return build


def _like(value: Any, items: Iterable[Any]) -> Any:
    """Create a list, tuple or named tuple from other items, with the same type as `value`."""
    return getattr(type(value), "_make", type(value))(items)


def _outside(inputs: Sequence[Any]) -> dict[str, Any]:
    """Return a mapping from paths to start values for all joints that do not move any loop.

    A search usually does not change these values.
    """
    loops, start = (*inputs, None)[:2]
    return {path: start.q[path] for path in loops.outside} if isinstance(loops, Loops) and isinstance(start, SolverState) else {}


def _is_kept(path: Any, value: Any, outside: Mapping[str, float]) -> bool:
    return path in outside and repr(value) == repr(outside[path])


def _structure(value: Any, outside: Mapping[str, float], numbers: list[float]) -> Any:
    """Return the structure of the result of a search without floats, which can be compared with the structure of other results.

    The floats in the result are appended to `numbers`, except floats that equal a start value in `outside`.
    """
    if type(value) is float:
        numbers.append(value)
        return float
    if isinstance(value, FrozenStruct):
        return type(value), _structure(tuple(getattr(value, name) for name in value.__struct_fields__), outside, numbers)
    if isinstance(value, Mapping):
        return tuple((key, _is_kept(key, one, outside) or _structure(one, outside, numbers)) for key, one in value.items())
    return tuple(_structure(one, outside, numbers) for one in value) if isinstance(value, tuple) else value


def _with_numbers(value: Any, outside: Mapping[str, float], traced: Mapping[str, Any], numbers: Iterator[Traced]) -> Any:
    """Return the result of a search, in which floats are replaced by traced numbers.

    A float that equals a start value in `outside` is replaced by the traced number with the same path in `traced`. All other floats are
    replaced by the items of `numbers`, in order.
    """
    change = partial(_with_numbers, outside=outside, traced=traced, numbers=numbers)
    if type(value) is float:
        return next(numbers)
    if isinstance(value, FrozenStruct):
        return replace(value, **{name: change(getattr(value, name)) for name in value.__struct_fields__})
    if isinstance(value, Mapping):
        return {key: traced[key] if _is_kept(key, one, outside) else change(one) for key, one in value.items()}
    return _like(value, map(change, value)) if isinstance(value, tuple) else value
