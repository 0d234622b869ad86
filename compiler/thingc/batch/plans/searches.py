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

CACHED = 32
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
        """Return the cached or new result of a function call, as `Memo` does. Record the call of a search on the tape."""
        known = getattr(function, "__name__", "") in SEARCHES
        return super().__call__(place, partial(self._search, function) if known else function, *inputs)

    def _search(self, function: Callable[..., Any], *inputs: Any) -> Any:
        tape, numbers = self._tape, list[Traced]()
        loops, start = (*inputs, None)[:2]
        if isinstance(loops, Loops) and isinstance(start, SolverState):
            inputs = (loops.alone(start.q), *inputs[1:])
        build = _make_builder(inputs, numbers)
        if build is None:
            return function(*inputs)
        plain = [number.value for number in numbers]
        arguments = build(plain)
        result = function(*arguments)
        start_values = _unmoved_joints(arguments)
        structure = _structure(result, start_values, [])

        @lru_cache(CACHED)
        def repeat(*values: float) -> tuple[float, ...]:
            arguments, floats = build(values), list[float]()
            if _structure(function(*arguments), _unmoved_joints(arguments), floats) != structure:
                raise ValueError("a search has a different result for these numbers")
            return tuple(floats)

        name = f"search_{len(tape.operations)}"
        tape.operations[name] = repeat
        combined = tape.apply(name, numbers, repeat(*plain))
        tape.guards.append((len(tape.lines), "==", (Ref(combined.line), Ref(combined.line)), True))  # even if none of its numbers is used
        items = [tape.apply("item", (combined, place), value) for place, value in enumerate(combined.value)]
        return _with_numbers(result, start_values, _unmoved_joints(inputs), iter(items))


def _make_builder(value: Any, numbers: list[Traced]) -> Callable[[Numbers], Any] | None:
    """Return a function that creates a copy of `value` with other numbers in place of the traced numbers.

    Return None if `value` does not contain traced numbers. The traced numbers in `value` are appended to `numbers`. The returned function
    has one argument, which contains a value for each traced number.
    """
    if isinstance(value, Traced):
        place = next((place for place, item in enumerate(numbers) if item.line == value.line), len(numbers))
        if place == len(numbers):
            numbers.append(value)
        return lambda values: values[place]
    if isinstance(value, Loops):
        parts = _make_builder((value.bodies, value.closures, tuple(value.joints.values()), value.base), numbers)
        return None if parts is None else lambda values: Loops(*parts(values))
    if isinstance(value, JointEdge):  # only values that affect loops, so that other values do not repeat the search
        value = replace(value, dynamics=Dynamics(), actuator=None, limit=replace(value.limit, effort=None, velocity=None))
    if isinstance(value, FrozenStruct):
        fields = _make_builder({name: getattr(value, name) for name in value.__struct_fields__}, numbers)
        return None if fields is None else lambda values: replace(value, **fields(values))
    items = list(value.items() if isinstance(value, Mapping) else enumerate(value) if isinstance(value, (tuple, list)) else ())
    changed = [(key, inner) for key, item in items if (inner := _make_builder(item, numbers)) is not None]
    if not changed:
        return None
    unchanged = dict(items)

    def build(values: Numbers) -> Any:
        rebuilt = {**unchanged, **{key: item(values) for key, item in changed}}
        return rebuilt if isinstance(value, Mapping) else _rebuild(value, rebuilt.values())

    return build


def _rebuild(value: Any, items: Iterable[Any]) -> Any:
    """Create a list, tuple or named tuple from other items, with the same type as `value`."""
    return getattr(type(value), "_make", type(value))(items)


def _unmoved_joints(inputs: Sequence[Any]) -> dict[str, Any]:
    """Return the start values of all joints that move no loop, keyed by path. A search usually does not change these values."""
    loops, start = (*inputs, None)[:2]
    return {path: start.q[path] for path in loops.outside} if isinstance(loops, Loops) and isinstance(start, SolverState) else {}


def _is_unchanged(path: Any, value: Any, outside: Mapping[str, float]) -> bool:
    return path in outside and repr(value) == repr(outside[path])


def _structure(value: Any, outside: Mapping[str, float], numbers: list[float]) -> Any:
    """Append the floats in the result of a search to `numbers`, and return the rest of the result in a form that can be compared.

    A float that equals the start value with the same path in `outside` belongs to the structure, and is not appended.
    """
    if type(value) is float:
        numbers.append(value)
        return float
    if isinstance(value, FrozenStruct):
        return type(value), _structure(tuple(getattr(value, name) for name in value.__struct_fields__), outside, numbers)
    if isinstance(value, Mapping):
        return tuple((key, _is_unchanged(key, item, outside) or _structure(item, outside, numbers)) for key, item in value.items())
    return tuple(_structure(item, outside, numbers) for item in value) if isinstance(value, tuple) else value


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
        return {key: traced[key] if _is_unchanged(key, item, outside) else change(item) for key, item in value.items()}
    return _rebuild(value, map(change, value)) if isinstance(value, tuple) else value
