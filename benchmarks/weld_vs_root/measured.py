"""All measurements of the study as plain numbers, which the page and the figure use."""

from __future__ import annotations

import sys
from dataclasses import dataclass, field

import numpy as np
from formulations import FORMULATIONS, INTEGRATORS, ROOTED, STIFF, TIMESTEPS, Formulation, Settings, Study, Vector
from standing import TRIED, Inverse, Stand, inverse, is_stable, stand
from stepping import Timed, posed, seconds_per_step, ways
from swinging import Swing, plan, swing

GRAVITIES = ("floor", "wall")
FRICTION, FREE, DRIVES = "dry friction", "no friction", "drives"
CONDITIONS = {FRICTION: (True, False), FREE: (False, False), DRIVES: (False, True)}
"""For each condition: whether joints have dry friction, and whether the drives hold the posture."""
SWUNG = (0.00025, *TIMESTEPS, 0.01)
"""Timesteps of the simulated swings [s]."""
USUAL = (0.002, "implicitfast")
"""The timestep [s] and the integrator that the document specifies."""
OFF = 1e-9
"""Torque error [N m] that is added to test whether a posture is stable."""


@dataclass(frozen=True)
class Measured:
    """All measurements of the study. Each field is a dictionary with the settings of a measurement as keys."""

    limits: dict[tuple[str, float], float] = field(default_factory=dict)
    """Shortest stable time constant of the stiff weld [timesteps], by integrator and timestep."""
    factors: dict[tuple[str, float], float] = field(default_factory=dict)
    """Time constant of the stiff weld that the study uses [timesteps], by integrator and timestep."""
    stands: dict[tuple[str, str, str, str, float, str], Stand] = field(default_factory=dict)
    """Results of standing still, by condition, gravity, posture, integrator, timestep and formulation."""
    disturbed: dict[str, float] = field(default_factory=dict)
    """Largest final speed of the rooted model if its torques are wrong by `OFF`, by condition."""
    inverses: dict[tuple[str, str, str], Inverse] = field(default_factory=dict)
    """Results of inverse dynamics, by gravity, posture and formulation."""
    swings: dict[tuple[bool, str, str, float, str], Swing] = field(default_factory=dict)
    """Errors of the swing, by feedback, gravity, integrator, timestep and formulation."""
    steps: dict[bool, list[tuple[str, int, float]]] = field(default_factory=dict)
    """Name, number of bodies and wall time of a step [s] of each model, with contacts enabled (True) or disabled (False)."""
    costs: dict[tuple[str, str], float] = field(default_factory=dict)
    """Wall time of a step [s], by integrator and formulation."""


def measure(study: Study) -> Measured:
    """Run all measurements of the study, which takes about two minutes."""
    found = Measured()
    models = {name: study.formulation(name) for name in FORMULATIONS}
    _stiffness(found, study, models[STIFF])
    _standing(found, study, models)
    _swinging(found, study, models)
    _stepping(found, study)
    return found


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def _stiffness(found: Measured, study: Study, formulation: Formulation) -> None:
    """For each integrator and timestep, find the time constant of the weld with the smallest error. With this time constant, the comparison
    uses the best possible weld.
    """
    _say("the best stiff weld of each integrator and timestep")
    for timestep in SWUNG:
        paths = {gravity: plan(study, timestep, gravity) for gravity in GRAVITIES}
        for integrator in INTEGRATORS:
            errors = {}
            for factor in TRIED:
                settings = Settings(timestep, integrator, factor)
                if is_stable(formulation, settings):
                    runs = (swing(formulation, path, settings, gravity, True) for gravity, path in paths.items())
                    errors[factor] = max(run.tip for run in runs)
            found.limits[integrator, timestep] = min(errors)
            found.factors[integrator, timestep] = min(errors, key=errors.__getitem__)


def _standing(found: Measured, study: Study, models: dict[str, Formulation]) -> None:
    for condition, (friction, drives) in CONDITIONS.items():
        _say(f"standing: {condition}")
        for gravity in GRAVITIES:
            for posture, q in study.postures.items():
                torque = study.holding(q, gravity)
                for integrator in INTEGRATORS:
                    for timestep in TIMESTEPS:
                        settings = Settings(timestep, integrator, found.factors[integrator, timestep])
                        for name, model in models.items():
                            key = (condition, gravity, posture, integrator, timestep, name)
                            found.stands[key] = stand(model, q, torque, settings, gravity, friction, drives)
    for gravity in GRAVITIES:
        for posture, q in study.postures.items():
            for name, model in models.items():
                found.inverses[gravity, posture, name] = inverse(model, q, gravity)
    for condition, (friction, drives) in CONDITIONS.items():
        runs = (
            stand(models[ROOTED], q, study.holding(q, gravity) + OFF, Settings(*USUAL), gravity, friction, drives)
            for gravity in GRAVITIES for q in study.postures.values()
        )
        found.disturbed[condition] = max(float(run.speeds[-1]) for run in runs)


def _swinging(found: Measured, study: Study, models: dict[str, Formulation]) -> None:
    for gravity in GRAVITIES:
        _say(f"swinging: {gravity}")
        for timestep in SWUNG:
            path = plan(study, timestep, gravity)
            for integrator in INTEGRATORS:
                settings = Settings(timestep, integrator, found.factors[integrator, timestep])
                for name, model in models.items():
                    for feedback in (False, True):
                        run = swing(model, path, settings, gravity, feedback)
                        found.swings[feedback, gravity, integrator, timestep, name] = run


def _stepping(found: Measured, study: Study) -> None:
    _say("stepping")
    q = study.postures["arched"]
    for contacts in (False, True):
        runs = ways(study, q, contacts)
        costs = seconds_per_step(runs)
        found.steps[contacts] = [(run.name, run.model.nbody - 1, cost) for run, cost in zip(runs, costs)]
    for integrator in INTEGRATORS:
        models = [study.formulation(name) for name in FORMULATIONS]
        runs = [_prepared(study, model, q, integrator, found) for model in models]
        for run, cost in zip(runs, seconds_per_step(runs)):
            found.costs[integrator, run.name] = cost


def _prepared(study: Study, formulation: Formulation, q: Vector, integrator: str, found: Measured) -> Timed:
    """Return a model and a state in which the drives hold the robot. The timestep is that of the document, because the time of a step
    hardly depends on it.
    """
    timestep = USUAL[0]
    settings = Settings(timestep, integrator, found.factors[integrator, timestep])
    formulation.configure(settings, "floor", friction=False, drives=True)
    return Timed(formulation.name, formulation.model, posed(study, formulation.model, q))


def worst_swing(found: Measured, feedback: bool, integrator: str, timestep: float, name: str) -> Swing:
    """Return the largest errors of a swing over both directions of gravity."""
    runs = [found.swings[feedback, gravity, integrator, timestep, name] for gravity in GRAVITIES]
    return Swing(max(run.joint for run in runs), max(run.tip for run in runs))


@dataclass(frozen=True)
class Cheapest:
    """The smallest wall time [s] per simulated second for which the error is within a bound, with its integrator and its timestep [s]."""

    wall: float
    integrator: str
    timestep: float


def cheapest(found: Measured, feedback: bool, bound: float, name: str) -> Cheapest | None:
    """Return the settings with the smallest wall time for which the error of the free sole in the swing is at most `bound` [mm], under both
    gravities. Return None if no settings satisfy the bound.
    """
    within = [
        Cheapest(found.costs[integrator, name] / timestep, integrator, timestep)
        for integrator in INTEGRATORS for timestep in SWUNG
        if worst_swing(found, feedback, integrator, timestep, name).tip <= bound
    ]
    return min(within, key=lambda choice: choice.wall, default=None)


def runs_of(
    found: Measured, condition: str, integrator: str, timestep: float, name: str, gravity: str | None = None
) -> list[Stand]:
    """Return the results of all postures at rest, for one direction of gravity or for both."""
    return [
        run for key, run in found.stands.items()
        if key[0] == condition and key[3:] == (integrator, timestep, name) and gravity in (None, key[1])
    ]


def fastest(runs: list[Stand]) -> float:
    """Return the largest joint speed [rad/s, m/s] over all steps of the given simulations."""
    return float(np.max([run.speeds.max() for run in runs]))
