"""Drivers that select the bridges to build, either by random sampling or with Optuna."""

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
"""Number of bridges that each call of `Optuna.ask` requests from Optuna."""


class Driver(Protocol):
    """A search strategy that proposes variants and receives their results. Call `ask` until it returns None. Build each document that `ask`
    returns, and pass the results to `tell`.
    """

    def ask(self) -> Path | None:
        """Return the path of the next `variants/1` document to build, or None at the end of the search."""

    def tell(self, rows: Sequence[Tried]) -> None:
        """Receive the results of the last document, in the order of its variants."""


class Random:
    """Builds the random sample that the document specifies. If `count` is given, the sample has `count` points of the same sequence."""

    def __init__(self, document: Path, count: int | None, options: Options) -> None:
        self._waiting: list[Path] = [document if count is None else _written(document, "bridge_search_random", sample={"count": count})]

    def ask(self) -> Path | None:
        """Return the path of the document at the first call, and None at later calls."""
        return self._waiting.pop() if self._waiting else None

    def tell(self, rows: Sequence[Tried]) -> None:
        """Do nothing, because random sampling does not use results."""


class Optuna:
    """Selects bridges with Optuna's tree-structured Parzen estimator. The torque margin is a constraint. The sampler uses the seed of the
    document.
    """

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
        """Write a document with the next bridges, and return its path. Return None at the end of the search."""
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
        """Report the bridge length and the torque margin of each variant to Optuna."""
        for trial, row in zip(self._asked, rows, strict=True):
            trial.set_constraint("torque_margin", MARGIN - row.margin)
            self._study.tell(trial, row.bridge)


def _written(document: Path, name: str, *, sample: dict[str, Any] | None = None, listed: list[Any] | None = None) -> Path:
    """Write a copy of a variants document to the build folder of the workspace. The copy has another sample, or a list of variants. Return
    the path of the copy.
    """
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
