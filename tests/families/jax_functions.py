"""`function.jax()` computes the numbers and derivatives of `value` and `jacobian` in JAX. `test_jax.py` runs these tests."""

from __future__ import annotations

import random
from importlib import import_module

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import thingc
from plans.operations import OPERATIONS
from thingc.base.pose import quarter_exact
from thingc.batch.families import jax_function
from thingc.batch.plans.derivatives import RULES
from thingc.batch.plans.program import program_of
from thingc.batch.plans.tape import Tape
from thingc.batch.results import FamilyError

pytestmark = pytest.mark.usefixtures("in_double_precision")


@pytest.mark.parametrize("name", OPERATIONS)
def test_operation_equals_that_of_a_program(name: str) -> None:
    function, draw, _ = OPERATIONS[name]
    tape, source = Tape(), random.Random(name)
    first = draw(source)
    program = program_of(tape, [function(*(tape.variable(value) for value in first))])
    run = jax.jit(jax_function.jax_function(program, range(len(first)), first, "float64"))
    for _ in range(20):
        values = draw(source)
        expected = program.run(*values)
        found, ok = run(jnp.array(values))
        assert bool(ok) == (expected is not None)
        if expected is not None:
            assert found.tolist() == pytest.approx(expected, rel=1e-14, abs=1e-14)


def test_every_operation_with_a_rule_is_supported() -> None:
    composed = {"negative", "item", "cosine of", "sine of"}
    assert set(RULES) - composed - {"round_significant"} <= jax_function.FUNCTIONS.keys()
    assert jax_function.FUNCTIONS["quarter_exact"](0.3) == pytest.approx(quarter_exact(0.3))


def test_values_and_derivatives_equal_those_of_the_function(everything: thingc.RobotFamily) -> None:
    function = everything.function(["load", "length"], ["mass", "centre", "inertia", "length"])
    run = jax.jit(jax.vmap(function.jax()))
    rows = np.random.default_rng(8).uniform([0.2, 0.2], [0.9, 0.5], (400, 2))
    rows[0], rows[1] = [30.0, 0.3], [0.5, 0.05]
    exact = function.value(rows)
    found, ok = run(rows)
    assert not ok[0] and not ok[1] and ok.sum() > 390 and not (np.asarray(ok) & ~exact.ok).any()
    np.testing.assert_allclose(np.asarray(found)[ok], np.asarray(exact)[ok], rtol=1e-12, atol=1e-15)
    derivatives = jax.jit(jax.jacfwd(lambda x: function.jax()(x)[0]))(jnp.array(rows[2]))
    np.testing.assert_allclose(derivatives, function.jacobian(rows[2]), rtol=1e-11, atol=1e-13)
    gradient = jax.jit(jax.grad(lambda x: function.jax()(x)[0][0]))(jnp.array(rows[2]))
    assert gradient.tolist() == pytest.approx([1.0, 0.3], rel=1e-12)


def test_an_array_of_another_shape_is_refused(everything: thingc.RobotFamily) -> None:
    """JAX would use the last element instead of a missing element, and a row of a matrix instead of an element."""
    function = everything.function(["load", "length"], ["mass"]).jax()
    for x in ([0.7], [0.7, 0.3, 0.2], np.full((2, 2), 0.3), 0.7):
        with pytest.raises(FamilyError, match=r"expected 2 numbers, found an array of shape \(.*\): for many rows of numbers, use"):
            function(x)


def test_settings_that_are_not_finite_are_refused(everything: thingc.RobotFamily) -> None:
    """The number has no upper bound."""
    function = everything.function(["stiff"], ["mass"])
    for stiff, expected in ((9.0, True), (np.inf, False), (np.nan, False)):
        assert bool(function.jax()([stiff])[1]) == function.value([stiff]).ok == expected


def test_exported_names_exist() -> None:
    """Here, because some names import JAX."""
    for package in map(import_module, ("thingc", "thingc.batch", "thingc.batch.families", "thingc.modes", "thingc.targets")):
        assert len(package.__all__) > 3 and all(getattr(package, name) is not None for name in package.__all__)


def test_single_precision(everything: thingc.RobotFamily) -> None:
    function = everything.function(["load", "length"], ["mass", "centre"])
    found, ok = jax.jit(function.jax(dtype="float32"))(jnp.array([0.7, 0.3]))
    assert ok and found.dtype == jnp.float32
    np.testing.assert_allclose(found, function.value([0.7, 0.3]), rtol=2e-6, atol=1e-7)


def test_what_jax_cannot_do_is_explained(everything: thingc.RobotFamily, monkeypatch: pytest.MonkeyPatch) -> None:
    function = everything.function(["load"], ["mass"])
    with pytest.raises(FamilyError, match="expected `dtype` to be \"float64\" or \"float32\", found `float16`"):
        function.jax(dtype="float16")
    monkeypatch.setattr(jax_function, "LONGEST", 10)
    with pytest.raises(FamilyError, match=r"the number of operations \(\d+\) exceeds the maximum of JAX \(10\): use `value` instead"):
        function.jax()
    monkeypatch.undo()
    monkeypatch.delitem(jax_function.FUNCTIONS, "_principal_moments")
    with pytest.raises(FamilyError, match="JAX does not have the operation `_principal_moments`: use `value` instead"):
        function.jax()
    jax.config.update("jax_enable_x64", False)
    with pytest.raises(FamilyError, match="64-bit numbers are disabled in JAX: call `jax.config.update"):
        function.jax()
    pinned = everything.function(["load", "teeth"], ["mass"])
    pinned._evaluation.cache_for(pinned._item(pinned.start)[1]).reasons["teeth"] = "a pass needs the exact value"
    with pytest.raises(FamilyError, match="JAX cannot compute mass: `teeth`: a pass needs the exact value: use `value` and `jacobian`"):
        pinned.jax()
