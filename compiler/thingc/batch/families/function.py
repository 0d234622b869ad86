"""Use a family of robots as a mathematical function with derivatives, which maps numbers in the document to results of the robot."""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, Self

import numpy as np
import numpy.typing as npt
from msgspec.structs import replace

from thingc.base.diagnostics import Diagnostic, Severity
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.suggestions import did_you_mean
from thingc.base.units import Quantity
from thingc.batch.families.evaluation import Evaluation
from thingc.batch.families.search_space import SearchSpace
from thingc.batch.families.stencil import ROUNDING, Stencil
from thingc.batch.plans.columns import Floats
from thingc.batch.plans.derivatives import DerivativeFunction, Derivatives, NotSmooth, derivative_function, with_slopes
from thingc.batch.plans.numeric_plan import MOST, NumericPlan, TracedResults
from thingc.batch.results import FamilyError
from thingc.batch.values import standard_unit
from thingc.driver.settings import ParsedSettings, SettingsReader

if TYPE_CHECKING:
    from thingc.batch.families.jax_function import JaxFunction

STEPS = (4e-3, 2.5e-4, 1.5e-5)
"""Relative distances of two settings from which a derivative is estimated, as fractions of the number.

If the estimate is not accurate enough, for example because one setting has an additional printed layer, a smaller distance is used.
"""

MODELS = "for the numbers of MuJoCo models, use `family.mjx` or `family.batched`; for derivatives of results, use `thingc sensitivity`"
"""The help for the output `mjcf`, which does not exist."""


class NotDifferentiable(FamilyError):
    """Raised if a result does not have a derivative at the given settings. The message contains the name of the result and the reason."""


class DescribedArray(np.ndarray[Any, np.dtype[np.float64]]):
    """An array with further attributes, which copies and pickles keep. Other arrays that numpy computes do not have these attributes."""

    def __reduce__(self) -> tuple[Any, ...]:
        create, arguments, state = super().__reduce__()  # type: ignore[str-unpack]
        return create, arguments, (state, self.__dict__)

    def __setstate__(self, state: Any) -> None:
        super().__setstate__(state[0])
        self.__dict__.update(state[1])

    def copy(self, order: Literal["K", "A", "C", "F"] | None = "C") -> Self:
        """Return a copy of the array with its attributes."""
        copied = super().copy(order)
        copied.__dict__.update(copy.deepcopy(self.__dict__))
        return copied

    def __deepcopy__(self, memo: object = None) -> Self:
        return self.copy()

    __copy__ = __deepcopy__


class FamilyValues(DescribedArray):
    """The results of a `FamilyFunction` in SI units, as an array with shape `(m,)` or `(k, m)`. Missing results have the value NaN.

    `ok` is True for settings without errors for which all results exist. For several sets of settings, `ok` is an array with shape `(k,)`.
    `problems` contains the diagnostics for each set of settings.
    """

    ok: bool | npt.NDArray[np.bool_] | None
    problems: tuple[tuple[Diagnostic, ...], ...]

    def __array_finalize__(self, source: Any) -> None:
        self.ok, self.problems = None, ()


class FamilyJacobian(DescribedArray):
    """The derivatives of m results by n numbers in SI units, as an array with shape `(m, n)`.

    `error` is an array with the shape of the derivatives. The error is 0 for exact derivatives, whose rounding error is about 1e-15. For
    derivatives that are computed by finite differences, `error` contains estimates of the error. Arrays that numpy computes from this array
    have the error None.
    """

    error: Floats | None

    def __array_finalize__(self, source: Any) -> None:
        self.error = None


class RestrictedPlan(FrozenStruct, eq=False, dict=True):
    """A plan that computes only those outputs that a `FamilyFunction` needs.

    For names on which no part depends, `traced` maps the index of the name to the index of its variable in the plan. For names on which
    parts depend, `modelled` contains the corresponding mapping.
    """

    plan: NumericPlan[TracedResults]
    restricted: NumericPlan[TracedResults]
    traced: Mapping[int, int]
    modelled: Mapping[int, int]

    @cached_property
    def derivatives(self) -> DerivativeFunction:
        """A function of all variables of the plan that computes the outputs, and their derivatives by the numbers in `traced`."""
        return derivative_function(self.restricted.program, list(self.traced.values()))

    @cached_property
    def through_parts(self) -> Mapping[int, DerivativeFunction]:
        """For each number in `modelled`, a function that computes the derivatives of the outputs by this number.

        Its arguments are all variables of the plan, the derivatives of the numbers in part records by this number, and the value of this
        number.
        """
        program, first = self.restricted.program, len(self.plan.free)
        numbers = program.variables[first:]
        return {
            name: derivative_function(with_slopes(program, program.variables[place], numbers), [place])
            for name, place in self.modelled.items()
        }

    def slopes(self, name: int, variables: Sequence[float], values: Sequence[Sequence[float]], stencil: Stencil) -> Floats | None:
        """Return estimates `(5, m)` of the derivatives of the outputs by a number on which parts depend, or None if the plan cannot.

        Only the derivatives of the numbers in part records are estimated. The chain rule then gives the derivatives of the outputs.
        `variables` are the values of the variables of the plan, and `values` those of all settings, one row per node of the stencil.
        """
        self.plan.prepare(values)
        rows = [self.plan.to_variables(row) for row in values]
        if any(row is None for row in rows):
            return None
        measured = stencil.with_noise(np.array(rows)[:, len(self.plan.free) :])
        try:
            derivatives = [self.through_parts[name]((*variables, *row, variables[self.modelled[name]])) for row in measured.tolist()]
        except (NotSmooth, ArithmeticError, ValueError):
            return None
        slopes = [row.jacobian[:, 0] for row in derivatives if row is not None and not row.special]
        return np.array(slopes) if len(slopes) == len(derivatives) else None


class FamilyFunction:
    """A function from values of the numbers `names` to the results `outputs`, in one mode. All values are in SI units.

    All other settings have fixed values. `start` `(n,)` contains the values of the numbers in the document. `bounds` `(n, 2)` contains the
    lower and upper bounds of parameters. Bounds that the document does not specify are infinite.
    """

    def __init__(
        self, evaluation: Evaluation, reader: SettingsReader, space: SearchSpace, names: Sequence[str], outputs: Sequence[str],
        at: Mapping[str, Any], reopen: Callable[[], FamilyFunction],
    ) -> None:
        if not isinstance(at, Mapping):
            raise FamilyError(f"expected `at` to be a mapping from names to values, found `{at!r}`")
        self._evaluation, self._reader, self._fixed, self._reopen = evaluation, reader, dict(at), reopen
        self.names = tuple(names)
        fixed = [other for name in at for other in (str(name), *reader.matching_names(str(name)))]
        if duplicates := [name for place, name in enumerate(self.names) if name in (*self.names[:place], *fixed)]:
            raise FamilyError(f"`{duplicates[0]}` is given twice", "keep only one of the values")
        kinds = [self._number(name) for name in self.names]
        self.dimensions = tuple(kind.dimension for kind in kinds)
        self.units = tuple(map(standard_unit, self.dimensions))
        start_values = dict(zip(parsed.names, parsed.values)) if (parsed := reader.read({})).report is None else {}
        self.start = np.array([start_values.get(name, kind.value) for name, kind in zip(self.names, kinds)], dtype=np.float64)
        known = {dimension.name: (dimension.low, dimension.high) for dimension in space}
        limits = [known.get(name, (None, None)) for name in self.names]
        self.bounds = np.array([(-np.inf if low is None else low, np.inf if high is None else high) for low, high in limits])
        self.outputs = self._expand(outputs)
        self._plans: dict[int, RestrictedPlan] = {}

    def __reduce__(self) -> tuple[Any, ...]:
        """Support copying and pickling of the function. The copy opens the document itself."""
        return self._reopen, ()

    def __repr__(self) -> str:
        return f"FamilyFunction({', '.join(self.names)} -> {', '.join(self.outputs)})"

    def value(self, x: npt.ArrayLike) -> FamilyValues:
        """Compute the outputs for given values of the numbers.

        For an array with shape `(n,)`, return an array `(m,)`. For an array with shape `(k, n)`, return an array `(k, m)`. The results
        equal the results of `RobotFamily.evaluate` bit by bit. Raises `FamilyError` if `x` has another shape.
        """
        rows, single = self._rows(x)
        outputs_by_row, ok = np.full((len(rows), len(self.outputs)), np.nan), np.zeros(len(rows), dtype=np.bool_)
        problems: list[tuple[Diagnostic, ...]] = [()] * len(rows)
        remaining: Sequence[int] = range(len(rows))
        together = self._evaluation.columns(rows, self.names, self._item, self._restrict)
        if together is not None:
            planned_outputs, applies, known = together
            outputs_by_row[applies], remaining = planned_outputs[applies], np.flatnonzero(~applies).tolist()
            ok[applies] = not any(evaluated.severity is Severity.ERROR for evaluated in known)
            problems = [known] * len(rows)  # the diagnostics of `remaining` are replaced below
        items = (self._item(rows[place]) for place in remaining)
        for place, evaluated in zip(remaining, self._evaluation.each(items, tests=False), strict=True):
            outputs_by_row[place] = [np.nan if (value := evaluated.results.get(name)) is None else value for name in self.outputs]
            ok[place], problems[place] = evaluated.sound and bool(evaluated.results), evaluated.problems
        ok &= ~np.isnan(outputs_by_row).any(axis=1)
        values = (outputs_by_row[0] if single else outputs_by_row).view(FamilyValues)
        values.ok, values.problems = (bool(ok[0]) if single else ok), tuple(problems)
        return values

    def jacobian(self, x: npt.ArrayLike) -> FamilyJacobian:
        """Compute the derivatives of the outputs by the numbers as an array `(m, n)`, at the values `x` `(n,)`.

        Derivatives are exact, unless a part, a decision of the compiler or a search depends on a number. Derivatives that are not exact are
        estimated from nearby settings, and their `error` is greater than 0. Raises `NotDifferentiable` if a derivative does not exist, and
        `FamilyError` if `x` has another shape or the settings are refused.
        """
        rows, single = self._rows(x)
        if not single:
            raise FamilyError(f"expected {len(self.names)} numbers, found an array of shape {np.shape(x)}", "call `jacobian` for each row")
        shape = (len(self.outputs), len(self.names))
        names, exact = self._derivatives_at(self._item(rows[0])[1]) or ((), None)
        derivatives, error = np.zeros(shape), np.zeros(shape)
        if exact is None:
            self._require(rows[0])
        elif not np.isfinite(exact.values).all():
            name = self.outputs[int(np.flatnonzero(~np.isfinite(exact.values))[0])]
            raise NotDifferentiable(f"`{name}` is not finite at {self._format_row(rows[0])}", f"remove `{name}`, or choose other settings")
        else:
            derivatives[:, names] = exact.jacobian
        for place in range(shape[1]):
            unknown = np.isnan(derivatives[:, place]) if place in names else np.full(shape[0], True)
            if unknown.any():
                estimate = self._estimate(rows[0], place)
                derivatives[unknown, place], error[unknown, place] = (estimates[unknown] for estimates in estimate)
            elif exact is not None and names.index(place) in exact.special:
                derivatives[:, place], error[:, place] = self._differentiate(rows[0], place, derivatives[:, place].copy())
        jacobian = derivatives.view(FamilyJacobian)
        jacobian.error = error
        return jacobian

    def jax(self, *, dtype: str = "float64") -> JaxFunction:
        """Return a pure JAX function that maps values `(n,)` of the numbers to a tuple of outputs `(m,)` and a flag `ok`.

        The JAX function makes the same decisions as the compiler for the values `start`. If settings are refused or require other
        decisions, `ok` is False and the outputs are undefined. Raises `FamilyError` if JAX does not support an operation, or if a part or a
        decision depends on one of the numbers. With `dtype="float64"`, also raises `FamilyError` if JAX does not use 64-bit numbers.
        """
        from thingc.batch.families.jax_function import jax_function

        parsed = self._item(self.start)[1]
        self._require(self.start)
        plan, reason = self._evaluation.plan_at(parsed)
        if plan is None or plan.exchange is not None or (set(self.names) & {parsed.names[at] for at, _ in plan.fixed}):
            reason = reason or "a part depends on one of the numbers"
            raise FamilyError(f"JAX cannot compute {', '.join(self.outputs)}: {reason}", "use `value` and `jacobian`")
        by = [plan.free.index(parsed.names.index(name)) for name in self.names]
        return jax_function(self._restrict(plan).program, by, [parsed.values[at] for at in plan.free], dtype)

    # --- implementation -------------------------------------------------------------------------------------------------

    def _require(self, row: Floats) -> None:
        """Raise `FamilyError` if settings with these values are refused, or if one of the outputs is missing."""
        values = self.value(row)
        if not values.ok:
            missing = "; ".join(f"`{name}` does not exist" for name, value in zip(self.outputs, values, strict=True) if np.isnan(value))
            raise FamilyError(f"there are no results at {self._format_row(row)}: {_errors(values.problems[0]) or missing}")

    def _restrict(self, plan: NumericPlan[TracedResults]) -> NumericPlan[TracedResults]:
        """Return a plan that computes only the outputs of this function."""
        if id(plan) not in self._plans:
            while len(self._plans) >= MOST:
                self._plans.pop(next(iter(self._plans)))
            outputs = tuple(plan.template.argument(name, plan.program) for name in self.outputs)
            parsed = self._item(self.start)[1]
            parts = {self.names.index(name) for name in self._evaluation.cache_for(parsed).modelled if name in self.names}
            names = {self.names.index(name): place for place, name in enumerate(parsed.names) if name in self.names}
            free = {name: plan.free.index(place) for name, place in sorted(names.items()) if place in plan.free}
            self._plans[id(plan)] = RestrictedPlan(
                plan=plan, restricted=dataclasses.replace(plan, program=replace(plan.program, outputs=outputs)),
                traced={name: place for name, place in free.items() if name not in parts},
                modelled={name: place for name, place in free.items() if name in parts},
            )
        return self._plans[id(plan)].restricted

    def _derivatives_at(self, parsed: ParsedSettings) -> tuple[tuple[int, ...], Derivatives] | None:
        """Return the same as `_exact_derivatives`, but create a plan if no existing plan applies."""
        derivatives = self._exact_derivatives(parsed)
        if derivatives is None and parsed.report is None and (plan := self._evaluation.plan_at(parsed)[0]) is not None:
            self._restrict(plan)
            derivatives = self._exact_derivatives(parsed)
        return derivatives

    def _exact_derivatives(self, parsed: ParsedSettings) -> tuple[tuple[int, ...], Derivatives] | None:
        """Return the indices of the numbers whose derivatives an existing plan computes exactly, and these derivatives.

        Return None if no existing plan applies to the settings. Raises `NotDifferentiable` if a derivative does not exist.
        """
        for restricted, variables in self._find_plans(parsed):
            try:
                derivatives = restricted.derivatives(variables)
            except NotSmooth as fault:
                where = self._format_row([parsed.values[parsed.names.index(name)] for name in self.names])
                message = f"`{self.outputs[fault.output]}` is not differentiable at {where}: an intermediate value {fault.why}"
                raise NotDifferentiable(message, f"choose other settings, or remove `{self.outputs[fault.output]}`") from None
            except (ArithmeticError, ValueError):
                continue
            if derivatives is not None and not np.isnan(derivatives.values).any():
                return tuple(restricted.traced), derivatives
        return None

    def _find_plans(self, parsed: ParsedSettings) -> Iterator[tuple[RestrictedPlan, tuple[float, ...]]]:
        """Yield each existing plan that may apply to the given settings, together with the values of its variables."""
        known = self._evaluation.cache_for(parsed).plans if parsed.report is None else ()
        for restricted in self._plans.values():
            if any(restricted.plan is other for other in known) and (variables := restricted.plan.to_variables(parsed.values)) is not None:
                yield restricted, variables

    def _differentiate(self, x: Floats, place: int, derivative: Floats) -> tuple[Floats, Floats]:
        """Differentiate all outputs by the number with the index `place` at a point `x` at which the compiler compares equal numbers.

        For greater and for smaller values of the number, the compiler may compute the results by different operations. The derivatives on
        both sides of `x` must therefore agree with each other, and with the change of the results. If only the values on one side are
        valid, as at a bound, return `derivative` `(m,)`, the derivatives at `x`. Also return the errors `(m,)`. Raises `NotDifferentiable`
        if the derivatives on both sides differ.
        """
        low, high = self.bounds[place]
        scale = abs(x[place]) or min(high - low, 1.0)
        step = OFFSET * scale
        values, sides = np.asarray(self.value(x)), []
        for sign in (1.0, -1.0):
            point = x.copy()
            point[place] += sign * step
            nearby = self.value(point) if low <= point[place] <= high else None
            if nearby is None or not nearby.ok:
                continue
            names, side = self._derivatives_at(self._item(point)[1]) or ((), None)
            if side is None or place not in names or names.index(place) in side.special:
                return self._estimate(x, place)
            sides.append((side.jacobian[:, names.index(place)], (np.asarray(nearby) - values) / (point[place] - x[place])))
        rounding = 100.0 * ROUNDING * np.abs(values) / step
        tolerance = TOLERANCE * np.abs(values) / scale + rounding + OFFSET
        agree = all(np.all(np.abs(slopes - sides[0][0]) <= TOLERANCE * np.abs(slopes) + tolerance) for pair in sides for slopes in pair)
        if not sides or not agree:
            raise NotDifferentiable(
                f"the results are not differentiable with respect to `{self.names[place]}` at {self._format_row(x)}",
                f"choose another value of `{self.names[place]}`"
            )
        if len(sides) == 1 and np.all(np.abs(derivative - sides[0][0]) <= TOLERANCE * np.abs(derivative) + tolerance):
            return derivative, np.zeros(len(derivative))
        error = np.max([np.abs(slope - change) for slope, change in sides], axis=0) * 2.0 + rounding
        return np.mean([slope for slope, _ in sides], axis=0), error

    def _estimate(self, x: Floats, place: int) -> tuple[Floats, Floats]:
        """Estimate the derivatives of all outputs by one number from the results at five nearby settings.

        Return arrays with the derivatives and with their errors.
        """
        low, high = self.bounds[place]
        width = high - low if np.isfinite(low) and np.isfinite(high) else np.inf
        results = np.abs(np.asarray(self.value(x)))
        for share in STEPS:
            step = min(share * (abs(x[place]) or min(width, 1.0)), width / 4.0)
            stencil = Stencil.around(x[place], step, low, high)
            slopes = self._slopes(x, place, stencil)
            if stencil.is_fine(slopes, results):
                break
        return slopes[0], stencil.error(slopes, results)

    def _slopes(self, x: Floats, place: int, stencil: Stencil) -> Floats:
        """Return several estimates of the derivatives of all outputs by one number, as `Stencil.error` requires."""
        slopes = self._slopes_through_parts(x, place, stencil.step)
        if slopes is not None and not np.isnan(slopes).any():
            return slopes
        all_slopes: Floats = stencil.weights @ self._valid_results(_points(x, place, stencil), place)
        return all_slopes if slopes is None else np.where(np.isnan(slopes), np.vstack([all_slopes, all_slopes[:1]]), slopes)

    def _slopes_through_parts(self, x: Floats, place: int, step: float) -> Floats | None:
        """Return estimates `(5, m)` of the derivatives of all outputs by a number on which parts depend, or None if no plan applies."""
        low, high = self.bounds[place]
        for offset in (0.0, SPECIAL * step, -SPECIAL * step) if any(place in plan.modelled for plan in self._plans.values()) else ():
            here = x.copy()
            here[place] += offset
            parsed = self._item(here)[1]
            if not low <= here[place] <= high or self._derivatives_at(parsed) is None:
                continue
            stencil = Stencil.around(here[place], step, low, high)
            values = [self._item(point)[1].values for point in _points(here, place, stencil)]
            plans = (found for found in self._find_plans(parsed) if place in found[0].modelled)
            estimates = (plan.slopes(place, variables, values, stencil) for plan, variables in plans)
            if (slopes := next((estimate for estimate in estimates if estimate is not None), None)) is not None:
                return slopes
        return None

    def _valid_results(self, points: Floats, place: int) -> Floats:
        """Return the results for several settings that are close to each other.

        Raises `NotDifferentiable` if results are missing for one of these settings.
        """
        values = self.value(points)
        if not np.all(values.ok):
            name, problems = self.names[place], values.problems[int(np.argmin(values.ok))] if values.ok is not None else ()
            raise NotDifferentiable(
                f"results for the derivative are missing between `{name}` = {points[0, place]:g} and {points[-1, place]:g}: "
                f"{_errors(problems) or 'a result does not exist'}", f"choose another value of `{name}`",
            )
        return np.asarray(values)

    def _rows(self, x: npt.ArrayLike) -> tuple[Floats, bool]:
        """Convert values `(n,)` or `(k, n)` of the numbers to an array `(k, n)`. Also return whether `x` has the shape `(n,)`."""
        try:
            rows = np.array(x, dtype=np.float64)
        except (TypeError, ValueError, OverflowError):
            raise FamilyError(f"expected {len(self.names)} numbers ({', '.join(self.names)}), found `{x!r}`") from None
        if rows.ndim not in (1, 2) or rows.shape[-1] != len(self.names):
            expected = f"({len(self.names)},) or (k, {len(self.names)})"
            raise FamilyError(f"expected an array of shape {expected} for {', '.join(self.names)}, found {rows.shape}")
        return np.atleast_2d(rows), rows.ndim == 1

    def _item(self, row: Floats) -> tuple[Mapping[str, Any], ParsedSettings]:
        settings = {**self._fixed, **dict(zip(self.names, row.tolist(), strict=True))}
        return settings, self._reader.read(settings)

    def _number(self, name: str) -> Quantity:
        """Return the value of a number in the document. Raises `FamilyError` if the document does not contain a number with this name."""
        if not isinstance(name, str) or "*" in name:
            raise FamilyError(f"expected the name of one number, found `{name}`", "write each name separately, without patterns")
        kind = self._reader.kind(name)
        if isinstance(kind, Quantity):
            return kind
        if kind is not None:
            text = str(kind).lower() if isinstance(kind, bool) else str(kind)
            raise FamilyError(
                f"expected a number as the value of `{name}`, found `{text}`", f"remove `{name}`, or set the value separately",
            )
        if name in self._reader.read({name: 0.0}).names:
            raise FamilyError(f"the document has no value for `{name}`", "set the value in the document")
        if "." in name:
            raise FamilyError(f"the document has no number at `{name}`", "correct the path, or add a value to the document")
        known = [other for other, value in self._reader.parameters.items() if isinstance(value, Quantity)]
        raise FamilyError(f"the document has no number `{name}`", did_you_mean(name, known, what="parameters"))

    def _expand(self, outputs: Sequence[str]) -> tuple[str, ...]:
        """Replace the name of a group of results, such as `centre`, by the names of its results: `centre.x`, `centre.y` and `centre.z`.

        Raises `FamilyError` for an unknown result.
        """
        evaluated = next(self._evaluation.each([self._item(self.start)], tests=False))
        known = evaluated.results
        if not known:
            raise FamilyError(f"there are no results at {self._format_row(self.start)}: {_errors(evaluated.problems)}")
        names: list[str] = []
        for name in outputs:
            group = [name] if name in known else [key for key in known if key.startswith(f"{name}.") and known[key] is not None]
            if not group:
                help = MODELS if name == "mjcf" else did_you_mean(str(name), known, what="results")
                raise FamilyError(f"there is no result `{name}`", help)
            names += group
        return tuple(dict.fromkeys(names))

    def _format_row(self, row: Sequence[float] | Floats) -> str:
        return ", ".join(f"{name} = {value:g}{f' {unit}' if unit else ''}" for name, value, unit in zip(self.names, row, self.units))


def _errors(problems: Sequence[Diagnostic]) -> str:
    errors = [problem for problem in problems if problem.severity is Severity.ERROR]
    return "; ".join(dict.fromkeys(f"{error.message}{f': {error.help}' if error.help else ''}" for error in errors))


OFFSET = 1e-6
"""Relative distance of the two values that are tested on both sides of a special value of a number."""
TOLERANCE = 1e-3
"""Relative difference up to which the derivatives on both sides of a special value are treated as equal."""
SPECIAL = 1e-6
"""The distance between a setting and a number that may be special, such as the default of a part, as a fraction of the step."""


def _points(x: Floats, place: int, stencil: Stencil) -> Floats:
    """Return five settings `(5, n)`, which differ from `x` in the number with the index `place`."""
    points = np.tile(x, (len(stencil.nodes), 1))
    points[:, place] = stencil.nodes
    return points
