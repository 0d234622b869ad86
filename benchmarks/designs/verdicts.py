"""One design, compiled and judged: built and the same robot in every mode, or refused by a rule that is named."""

from __future__ import annotations

import sys
import time
import traceback
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "compiler")]

import numpy as np  # noqa: E402
from drawing import Design  # noqa: E402

import thingc  # noqa: E402
from conformance import roots  # noqa: E402
from thingc.base.diagnostics import Code, Diagnostic, Severity  # noqa: E402

CRASHES = {Code.INTERNAL, Code.PART_CRASHED, Code.PART_HUNG}
"""Codes that name no rule of the design: something of thingc or of a part went wrong."""

UNSOUND = {Code.PART_EMPTY, Code.PART_INVALID, Code.MJCF_REFUSED, Code.MJCF_WARNING}
"""Codes that say what came of a design, where a rule should have been named before."""

BOUNDS = {"TC315", "TC803"}
"""Codes of values that leave their range."""

SAMPLES = 3
"""Of joint angles, for each design."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """`outcome` is `built`, `refused` or `crashed`. `faults` is what must not be: modes that differ, a rule that was broken and
    not named, a refusal without a place. `seconds` of compiling and judging."""

    design: Design
    outcome: str
    diagnostics: tuple[Diagnostic, ...]
    faults: tuple[str, ...]
    modes: int
    modelled: tuple[str, ...]
    reused: tuple[str, ...]
    seconds: float


def judged(design: Design, document: Path, store: Path) -> Verdict:
    """Compile the design, whose documents are written, and compare its modes. Raises nothing."""
    start = time.perf_counter()
    outcome, said, faults = "crashed", (), ()
    modes, modelled, reused = 0, (), ()
    try:
        compiled = thingc.compile(str(document), parameters=design.parameters, store=str(store))
        models = {name: mode.model() for name, mode in compiled.modes.items()}
        modes, modelled, reused = len(models), compiled.modelled, compiled.reused
        outcome, said = "built", compiled.diagnostics
        faults = (*compared(models, design.number), *(f"{code} `{word}` was not reported" for code, word in design.broken))
    except thingc.CompileError as error:
        said = error.diagnostics
        outcome = "crashed" if any(d.code in CRASHES for d in said) else "refused"
        faults = unnamed(design, said)
    except Exception:
        faults = (traceback.format_exc(),)
    return Verdict(
        design=design, outcome=outcome, diagnostics=tuple(said), faults=tuple(faults), modes=modes, modelled=modelled, reused=reused,
        seconds=time.perf_counter() - start,
    )


def compared(models: roots.Models, seed: int) -> list[str]:
    """What differs between the modes that must not, for joints and bases anywhere."""
    source = np.random.default_rng(seed)
    first = next(iter(models.values()))
    said = roots.links(models)
    for _ in range(SAMPLES):
        q = roots.angles(first, source)
        said += [*roots.poses(models, q, source), *roots.whole(models, q, "body", source)]
    return [*said, *roots.dynamics_of_modes(models, roots.angles(first, source), source)]


def unnamed(design: Design, said: Sequence[Diagnostic]) -> list[str]:
    """Rules that were broken on purpose and are not named, bounds that are named and were kept, errors without words or place."""
    errors = [d for d in said if d.severity is Severity.ERROR]
    faults = [
        f"{code} `{word}` was not reported" for code, word in design.broken
        if not any(d.code.code == code and word in d.message for d in errors)
    ]
    faults += [
        f"nothing is out of range: {d.code.code} {d.message}" for d in errors
        if d.code.code in BOUNDS and not any(word in d.message for _, word in design.broken)
    ]
    faults += [
        f"no rule is named: {d.code.code} {d.message}" for d in errors
        if d.code in UNSOUND or (d.code is Code.PART_RAISED and "AssertionError: " not in d.message)
    ]
    # What is wrong with a parameter given from outside has no place in a document, but a note where its bound is.
    return [*faults, *(f"no words or place: {d.code.code} {d.message}" for d in errors if not d.message or not (d.span or d.notes))]
