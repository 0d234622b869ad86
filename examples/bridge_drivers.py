"""Drivers that select the bridges to build: random samples of the document of variants, or Optuna."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Protocol

import yaml

import thingc.batch
from bridge_report import MARGIN, Tried
from thingc import Options

ROUND = 8
"""Number of bridges to request from Optuna at once."""


class Driver(Protocol):
    """A search strategy. Call `ask` for the next document of variants until it returns None, and report the results to `tell`."""

    def ask(self) -> Path | None:
        """Return the next document of variants to build, or None."""

    def tell(self, rows: Sequence[Tried]) -> None:
        """Receive the results, in the order of the variants."""


class Random:
    """The sample of the document itself or, with `count`, another number of points of the same sequence."""

    def __init__(self, document: Path, count: int | None, options: Options) -> None:
        self._waiting: list[Path] = [document if count is None else _written(document, "bridge_search_random", sample={"count": count})]

    def ask(self) -> Path | None:
        """Return the document once."""
        return self._waiting.pop() if self._waiting else None

    def tell(self, rows: Sequence[Tried]) -> None:
        """Do nothing, because random sampling does not use results."""


class Optuna:
    """A tree-structured Parzen estimator with the torque margin as a constraint. It uses the seed of the document."""

    def __init__(self, document: Path, count: int | None, options: Options) -> None:
        import optuna

        optuna.logging.set_verbosity(optuna.logging.WARNING)
        plan = thingc.batch.plan(str(document), options=options)
        self._document = document
        self._left = plan.count if count is None else count
        self._ranges = {axis.key: (axis.range[0].value, axis.range[1].value) for axis in plan.axes if axis.range is not None}
        self._study = optuna.create_study(direction="maximize", sampler=optuna.samplers.TPESampler(seed=plan.seed))
        self._asked: list[Any] = []
        self._round = 0

    def ask(self) -> Path | None:
        """Return a document that lists the next bridges."""
        size = min(ROUND, self._left)
        if not size:
            return None
        self._left -= size
        self._asked = [self._study.ask() for _ in range(size)]
        listed = [
            {"parameters": {name: f"{trial.suggest_float(name, low, high)!r} m" for name, (low, high) in self._ranges.items()}}
            for trial in self._asked
        ]
        self._round += 1
        return _written(self._document, f"bridge_search_optuna_{self._round:02d}", listed=listed)

    def tell(self, rows: Sequence[Tried]) -> None:
        """Convert the settings of a trial to lengths and margins."""
        for trial, row in zip(self._asked, rows, strict=True):
            trial.set_constraint("torque_margin", MARGIN - row.margin)
            self._study.tell(trial, row.bridge)


def _written(document: Path, name: str, *, sample: dict[str, Any] | None = None, listed: list[Any] | None = None) -> Path:
    """Write a copy of a document to the build folder of the workspace, with another sample, or with a list instead. Return its path."""
    found = yaml.safe_load(document.read_text())
    folder = document.parents[2] / "build"
    folder.mkdir(exist_ok=True)
    found["name"] = name
    found["assembly"] = Path(os.path.relpath(document.parent / found["assembly"], folder)).as_posix()
    if listed is not None:
        del found["sample"]
        found["list"] = listed
    else:
        found["sample"] = {**found["sample"], **(sample or {})}
    path = folder / f"{name}.yaml"
    path.write_text(json.dumps(found, indent=2) + "\n")
    return path


DRIVERS: dict[str, Callable[[Path, int | None, Options], Driver]] = {"random": Random, "optuna": Optuna}
