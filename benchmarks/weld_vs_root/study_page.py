"""Create the page of the study in Markdown: the template `page.md` with tables and numbers."""

from __future__ import annotations

import os
import platform
from collections.abc import Mapping, Sequence
from pathlib import Path
from string import Template

import mujoco
from formulations import FORMULATIONS, INTEGRATORS, REACHING, ROOTED, SOFT, SOLIMP, STIFF, TIMESTEPS
from measured import (
    DRIVES,
    FREE,
    FRICTION,
    GRAVITIES,
    OFF,
    SWUNG,
    USUAL,
    Measured,
    cheapest,
    fastest,
    runs_of,
    worst_swing,
)
from standing import HORIZON, NEARLY, REST
from stepping import ROOTED_FUSED, ROUNDS, WELD_FUSED
from swinging import DURATION, KD, KP

TEMPLATE = Path(__file__).with_name("page.md")
BOUNDS = (10.0, 1.0, 0.1, 0.01)
"""Bounds of the error of the free sole [mm] that the page compares."""


def page(found: Measured) -> str:
    """Return the text of the whole page. Raises `KeyError` if a value of the template is missing."""
    conditions = {"friction": FRICTION, "free": FREE, "drives": DRIVES}
    return Template(TEMPLATE.read_text()).substitute(
        cores=os.cpu_count(), python=platform.python_version(), mujoco=mujoco.__version__,
        solimp=" ".join(f"{value:g}" for value in SOLIMP), limits=_factors(found.limits), factors=_factors(found.factors),
        reaching=", ".join(f"{joint} {angle}" for joint, angle in REACHING.items()),
        horizon=f"{HORIZON:g}", rest=f"{REST:g}", nearly=f"{NEARLY:g}", usual=f"{USUAL[1]}, {USUAL[0] * 1e3:g} ms",
        off=f"{OFF:g}", **{f"off_{key}": number(found.disturbed[condition]) for key, condition in conditions.items()},
        duration=f"{DURATION:g}", kp=f"{KP:g}", kd=f"{KD:g}", rounds=ROUNDS,
        inverse=_inverse(found), speed=_speed(found),
        swing_blind=_swings(found, False), swing_fed=_swings(found, True),
        equal_blind=_equal(found, False), equal_fed=_equal(found, True),
        **_short(found),
        **{f"usual_{key}": _usual(found, condition) for key, condition in conditions.items()},
        **{f"all_{key}": _all(found, condition) for key, condition in conditions.items()},
    )


def number(value: float) -> str:
    """Format a number with three significant digits, and 0 as `0`."""
    if value == 0.0:
        return "0"
    return f"{value:.3g}" if value < float("inf") else "diverged"


def table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Format a table in Markdown, with its first column left-aligned."""
    lines = ["| " + " | ".join(heads) + " |", "|---" + "|--:" * (len(heads) - 1) + "|"]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows])


def span(values: Sequence[int | None]) -> str:
    """Format the numbers of steps of several runs as a range, such as `12`, `12 to 40` or `12 to never`."""
    low = min((value for value in values if value is not None), default=None)
    if low is None:
        return "never"
    high = longest(values)
    return high if high == str(low) else f"{low} to {high}"


def longest(values: Sequence[int | None]) -> str:
    """Format the largest number of steps of several runs."""
    return "never" if None in values else str(max(value for value in values if value is not None))


def _short(found: Measured) -> dict[str, str]:
    """Return the numbers in the summary of the page, over all postures and both gravities."""
    timestep, integrator = USUAL
    soft, stiff = (runs_of(found, DRIVES, integrator, timestep, name) for name in (SOFT, STIFF))
    errors = {name: worst_swing(found, True, "RK4", timestep, name).tip for name in (STIFF, ROOTED)}
    costs = {name: cost for name, _, cost in found.steps[False]}
    return {
        "soft_nearly": span([run.nearly for run in soft]),
        "soft_drift": number(max(run.drift for run in soft)),
        "soft_turn": number(max(run.turn for run in soft)),
        "soft_ankle": number(max(run.ankle for run in soft)),
        "soft_tip": number(max(run.tip for run in soft)),
        "stiff_tip": number(max(run.tip for run in stiff)),
        "stiff_drift": number(max(run.drift for run in stiff)),
        "stiff_steps": span([run.steps for run in stiff]),
        "stiff_ratio": f"{errors[STIFF] / errors[ROOTED]:.1f}",
        "rooted_speed": f"{costs[WELD_FUSED] / costs[ROOTED_FUSED]:.2f}",
    }


def _factors(factors: Mapping[tuple[str, float], float]) -> str:
    """Format a text such as `Euler 1.25, RK4 1 to 1.5`, which shows the range over the timesteps."""
    texts = []
    for integrator in INTEGRATORS:
        values = [factors[integrator, timestep] for timestep in SWUNG]
        low, high = f"{min(values):g}", f"{max(values):g}"
        texts.append(f"{integrator} {low}" + (f" to {high}" if high != low else ""))
    return ", ".join(texts)


def _usual(found: Measured, condition: str) -> str:
    timestep, integrator = USUAL
    rows = []
    for gravity in GRAVITIES:
        for name in FORMULATIONS:
            runs = runs_of(found, condition, integrator, timestep, name, gravity)
            worst = (
                fastest(runs), max(run.drift for run in runs), max(run.turn for run in runs), max(run.tip for run in runs),
                max(run.energy for run in runs),
            )
            steps = (span([run.nearly for run in runs]), span([run.steps for run in runs]))
            rows.append([f"{gravity}: {name}", *steps, *(number(value) for value in worst)])
    heads = ["", "steps until nearly at rest", "until at rest", "largest speed", "held sole [mm]", "foot [deg]", "free sole [mm]"]
    heads.append("energy [mJ]")
    return table(heads, rows)


def _all(found: Measured, condition: str) -> str:
    rows = []
    for integrator in INTEGRATORS:
        for timestep in TIMESTEPS:
            groups = [runs_of(found, condition, integrator, timestep, name) for name in FORMULATIONS]
            rows.append([
                f"{integrator}, {timestep * 1e3:g} ms",
                *(longest([run.nearly for run in runs]) for runs in groups),
                *(longest([run.steps for run in runs]) for runs in groups),
                *(number(max(run.drift for run in runs)) for runs in groups),
            ])
    return table(["", *_columns("steps until nearly at rest", "until at rest", "held sole [mm]")], rows)


def _columns(*quantities: str) -> list[str]:
    return [f"{quantity}: {name}" for quantity in quantities for name in FORMULATIONS]


def _inverse(found: Measured) -> str:
    rows = []
    for gravity, posture in dict.fromkeys(key[:2] for key in found.inverses):
        soft, stiff, rooted = (found.inverses[gravity, posture, name] for name in (SOFT, STIFF, ROOTED))
        values = (rooted.exact, soft.error, stiff.error, stiff.base, max(soft.projected, stiff.projected), rooted.error)
        rows.append([f"{gravity}: {posture}", *(number(value) for value in values)])
    heads = [
        "", "largest torque [N m]", "error [N m]: weld, default", "weld, stiff", "force required at the base [N]",
        "error [N m]: welds, projected", "rooted",
    ]
    return table(heads, rows)


def _swings(found: Measured, feedback: bool) -> str:
    rows = []
    for integrator in INTEGRATORS:
        for timestep in SWUNG:
            runs = [worst_swing(found, feedback, integrator, timestep, name) for name in FORMULATIONS]
            values = [*(number(run.tip) for run in runs), *(number(run.joint) for run in runs)]
            rows.append([f"{integrator}, {timestep * 1e3:g} ms", *values])
    return table(["", *_columns("sole [mm]", "joints [deg]")], rows)


def _speed(found: Measured) -> str:
    rows = []
    for index, (name, bodies, _) in enumerate(found.steps[False]):
        row = [name, str(bodies)]
        for contacts in (False, True):
            cost, first = found.steps[contacts][index][2], found.steps[contacts][0][2]
            row += [f"{1.0 / cost:,.0f}", f"{1e3 * cost / USUAL[0]:.2f}", f"{cost / first:.2f}"]
        rows.append(row)
    columns = ("steps/s", "wall ms per simulated s", "ratio")
    return table(["", "bodies", *(f"{kind}: {column}" for kind in ("no contacts", "contacts") for column in columns)], rows)


def _equal(found: Measured, feedback: bool) -> str:
    rows = []
    for bound in BOUNDS:
        choices = [cheapest(found, feedback, bound, name) for name in FORMULATIONS]
        rooted = choices[FORMULATIONS.index(ROOTED)]
        row = [f"{bound:g} mm"]
        for choice in choices:
            settings = "" if choice is None else f"{1e3 * choice.wall:.2f} ({choice.integrator}, {choice.timestep * 1e3:g} ms)"
            row.append(settings or "not reached")
        for choice in choices[:-1]:
            row.append("-" if choice is None or rooted is None else f"{choice.wall / rooted.wall:.2f}")
        rows.append(row)
    return table(["error", *FORMULATIONS, *(f"{name} / {ROOTED}" for name in FORMULATIONS[:-1])], rows)
