"""Convert the computation of the results of a robot to a JAX function for use with `jit`, `vmap` and `grad` (`pip install thingc[jax]`)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import reduce
from typing import Any

try:
    import jax
    import jax.numpy as jnp
except ImportError as fault:  # pragma: no cover - reported with a help text
    raise ImportError("JAX functions require JAX: `pip install thingc[jax]`") from fault

from thingc.batch.plans.program import Operation, Program, value_in
from thingc.batch.plans.tape import OPERATORS
from thingc.batch.results import FamilyError

JaxFunction = Callable[[Any], "tuple[Any, Any]"]
"""A function that maps values `(n,)` to outputs `(m,)` and to a flag. The flag is True if the program applies to these values."""
LONGEST = 10_000
"""Maximum number of statements in a program, because the compile time of JAX grows faster than this number."""


def jax_function(program: Program, by: Sequence[int], values: Sequence[float], dtype: str, instead: str = "value") -> JaxFunction:
    """Convert a program to a JAX function of the variables with the indices `by`. All other variables have the constant values in `values`.

    The JAX function makes the same decisions as the program for `values`. The JAX function returns the outputs, and a boolean that is False
    for variables that require other decisions. Raises `FamilyError` if JAX does not support an operation, if the program is too long, or if
    `dtype` is `float64` and JAX does not use 64-bit numbers. The help text of the error suggests the method `instead`.
    """
    if dtype not in ("float64", "float32"):
        raise FamilyError(f"expected `dtype` to be \"float64\" or \"float32\", found `{dtype}`")
    if dtype == "float64" and not jax.config.jax_enable_x64:  # type: ignore[attr-defined]
        help_text = "call `jax.config.update(\"jax_enable_x64\", True)` first, or use `dtype=\"float32\"`"
        raise FamilyError("64-bit numbers are disabled in JAX", help_text)
    help = f"use `{instead}` instead"
    if len(program.statements) > LONGEST:
        raise FamilyError(f"the number of operations ({len(program.statements)}) exceeds the maximum of JAX ({LONGEST})", help)
    unknown = {one.operation for one in program.statements} - FUNCTIONS.keys() - {"item"}
    if unknown:
        raise FamilyError(f"JAX does not have the operation `{sorted(unknown)[0]}`", help)

    def run(x: Any) -> tuple[Any, Any]:
        variables = [jnp.asarray(value, dtype=dtype) for value in values]
        vector = as_vector(x, len(by), dtype)
        for place, index in enumerate(by):
            variables[index] = vector[place]
        known: dict[int, Any] = dict(zip(program.variables, variables, strict=True))
        ok = jnp.isfinite(vector).all()
        for statement in program.statements:
            arguments = [value_in(argument, known) for argument in statement.arguments]
            result = arguments[0][arguments[1]] if statement.operation == "item" else FUNCTIONS[statement.operation](*arguments)
            if isinstance(statement, Operation):
                known[statement.target] = result
            else:
                ok = ok & (jnp.asarray(result, dtype=bool) == statement.outcome)
        return jnp.stack([jnp.asarray(value_in(statement, known), dtype=dtype) for statement in program.outputs]), ok

    return run


def as_array(x: Any, expected: str, dtype: Any = None) -> jax.Array:
    """Convert numbers to a JAX array. Raises `FamilyError` for other values. `expected` describes the numbers in the message."""
    try:
        return jnp.asarray(x, dtype=dtype)
    except (TypeError, ValueError):
        raise FamilyError(f"expected {expected}, found `{x!r}`") from None


def as_vector(x: Any, count: int, dtype: Any = None) -> jax.Array:
    """Convert numbers to an array with shape `(count,)`. Raises `FamilyError` for other shapes.

    JAX itself replaces missing elements of an array by its last element.
    """
    vector = as_array(x, f"{count} numbers", dtype)
    if vector.shape != (count,):
        raise FamilyError(f"expected {count} numbers, found an array of shape {vector.shape}", "for many rows of numbers, use `jax.vmap`")
    return vector


def _hypot(*components: Any) -> Any:
    return jnp.sqrt(sum(component * component for component in components))


def _remainder(x: Any, y: Any) -> Any:
    return x - y * jnp.round(x / y)


def _moments(*entries: Any) -> Any:
    matrix = jnp.stack([jnp.asarray(entry) for entry in entries]).reshape(3, 3)
    return jnp.linalg.eigvalsh((matrix + matrix.T) / 2.0)


FUNCTIONS: dict[str, Callable[..., Any]] = {
    **OPERATORS, "abs": jnp.abs, "sqrt": jnp.sqrt, "sin": jnp.sin, "cos": jnp.cos, "tan": jnp.tan, "asin": jnp.arcsin, "acos": jnp.arccos,
    "atan": jnp.arctan, "atan2": jnp.arctan2, "radians": jnp.radians, "degrees": jnp.degrees, "copysign": jnp.copysign,
    "erf": jax.scipy.special.erf,
    "remainder": _remainder, "round": jnp.round, "isfinite": jnp.isfinite, "isinf": jnp.isinf, "hypot": _hypot,
    "_fsum": lambda *values: sum(values), "min": lambda *values: reduce(jnp.minimum, values),
    "max": lambda *values: reduce(jnp.maximum, values),
    "quarter_exact": lambda angle: (jnp.cos(angle), jnp.sin(angle)), "_principal_moments": _moments,
}
"""For each operation of programs, by name, the function of JAX that computes the operation.

The functions do not repeat the decisions of the original functions, such as exact quarter turns, so last digits may differ.
"""
