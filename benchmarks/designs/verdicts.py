"""Compile a design and judge the result. Either the design builds with the same robot in every mode, or a rule with a diagnostic code
rejects it.
"""

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
"""Diagnostic codes that report a failure of thingc or of a part, not a violated rule."""

UNSOUND = {Code.PART_EMPTY, Code.PART_INVALID, Code.MJCF_REFUSED, Code.MJCF_WARNING}
"""Diagnostic codes of faults that an earlier rule should have reported."""

BOUNDS = {"TC315", "TC803"}
"""Diagnostic codes of values outside of their range."""

SAMPLES = 3
"""Number of random joint configurations in which the modes of each design are compared."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """The result of a design. `outcome` is `built`, `refused` or `crashed`.

    `faults` lists failures of thingc: modes that differ, violated rules that are not reported, and errors without a location. `seconds` is
    the time to compile and judge the design [s].
    """

    design: Design
    outcome: str
    diagnostics: tuple[Diagnostic, ...]
    faults: tuple[str, ...]
    modes: int
    modelled: tuple[str, ...]
    reused: tuple[str, ...]
    seconds: float


def judged(design: Design, document: Path, store: Path) -> Verdict:
    """Compile a design, whose documents must exist, and compare its modes. All exceptions are caught and become part of the result."""
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
    """Return the differences between modes in random joint configurations and random poses of the base."""
    source = np.random.default_rng(seed)
    first = next(iter(models.values()))
    said = roots.links(models)
    for _ in range(SAMPLES):
        q = roots.angles(first, source)
        said += [*roots.poses(models, q, source), *roots.whole(models, q, "body", source)]
    return [*said, *roots.dynamics_of_modes(models, roots.angles(first, source), source)]


def unnamed(design: Design, said: Sequence[Diagnostic]) -> list[str]:
    """Return a description of each fault in the reported errors. Faults are violated rules that are not reported, bounds that are reported
    but satisfied, and errors without a message or location.
    """
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
    # Errors in parameters from the command line have no location in a document, but a note at their bound.
    return [*faults, *(f"no words or place: {d.code.code} {d.message}" for d in errors if not d.message or not (d.span or d.notes))]
