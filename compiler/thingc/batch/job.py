"""What a runner is told: one job for a batch, and tasks, one for each variant. Plain JSON, so that any executor can carry it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from msgspec import convert
from msgspec.structs import asdict

from thingc.base.frozen_struct import FrozenStruct
from thingc.geometry.record import Value

STOPPED = "stopped"
"""The status of a row that ends the batch: nothing is wrong with its variant, but nothing can be written (or read) any more."""


class Job(FrozenStruct):
    """What all variants of a batch have in common.

    `assembly` is the absolute path of the document, `folder` that of the batch's folder (None: nothing is written); `rules` the
    comparisons that need results, `dimensions` the exponents (length, mass, time, angle) of the parameters that are numbers;
    `packed`: the files of a variant come with its row, and only shared ones are written; `verify`: of so many models that differ in
    nothing but numbers MuJoCo is given one (1: each, 0: none); `cwd` the folder in which runners work (None: that of who starts them).
    """

    assembly: str
    folder: str | None
    store: str | None
    part_timeout: float | None
    modes: tuple[str, ...]
    results_mode: str
    pose: str | None
    reach: tuple[str, str] | None
    rules: tuple[str, ...]
    rule_names: tuple[dict[str, str | None], ...]
    dimensions: Mapping[str, tuple[Any, ...]]
    emit: tuple[str, ...]
    verify: int = 1
    packed: bool = False
    cwd: str | None = None

    def encode(self) -> str:
        """One line of JSON; `decode` reads it."""
        return json.dumps(asdict(self), sort_keys=True)

    @staticmethod
    def decode(text: str) -> Job:
        """The job of `encode`."""
        return convert(json.loads(text), Job)


class Task(FrozenStruct):
    """One variant: its settings as texts, and the values of its parameters (for rules)."""

    index: int
    id: str
    parameters: Mapping[str, str]
    choices: Mapping[str, str]
    values: Mapping[str, Value]


Row = dict[str, Any]
"""What came of one variant: `index`, `id`, `status` (`built | kept_out | refused | failed`), `rule`, `code`, `message`, `detail`,
`results`, `losses` (how many, by what becomes of them), `files` and `shared` (of a packed batch, see `packed_layout.py`), `seconds`,
`modelled`, `reused` (definition texts) and `pid` of the runner, as far as there is something to say."""


def row(task: Task, status: str, **more: Any) -> Row:
    """A row of the journal."""
    return {"index": task.index, "id": task.id, "status": status, **more}


def refusal(fault: OSError) -> str:
    """What the system refused, and why."""
    reason = fault.strerror or str(fault)
    return f"`{fault.filename}`: {reason}" if fault.filename is not None else reason
