"""Measurements of document tests, one module for each kind of `thingc.documents.checks`, with the same name."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib import import_module
from typing import Any, Generic, TypeVar

from thingc.base.diagnostics import Report
from thingc.base.frozen_struct import FrozenStruct
from thingc.driver.testing.results import Outcome, TestCase
from thingc.model.assembly.types import LinkedTest
from thingc.model.resolve.types import NamedPose

Stated = TypeVar("Stated")


def _one_pose(check: Any, pose: NamedPose) -> Sequence[NamedPose]:
    return [pose]


class CheckRunner(FrozenStruct, Generic[Stated]):
    """How to run tests of one kind.

    `measure(case, stated)` measures one case. `poses(stated, pose)` returns the poses of a case that is named after `pose`.
    `finish(linked, outcomes, report)` receives all outcomes, if the test was run in all of its modes.
    """

    measure: Callable[[TestCase, Stated], Outcome]
    poses: Callable[[Stated, NamedPose], Sequence[NamedPose]] = _one_pose
    finish: Callable[[LinkedTest, Sequence[Outcome], Report], None] | None = None


def runner_of(kind: str) -> CheckRunner[Any]:
    """Return the runner of a kind of test."""
    runner: CheckRunner[Any] = import_module(f"{__name__}.{kind}").RUNNER
    return runner
