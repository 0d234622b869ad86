"""What others are told of a batch: its folder (`batch.json`), machines that have to see its files, and its runners. These get one job, and
variants; plain JSON, so that any executor can carry it."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from typing import Any

from msgspec import convert
from msgspec.structs import asdict

from thingc.base.frozen_struct import FrozenStruct
from thingc.batch import folder_layout
from thingc.batch.folder import PACKED
from thingc.batch.planning import OUTSIDE, Plan, Variant
from thingc.batch.tables import Column
from thingc.driver.environment import Options
from thingc.targets.manifest import versions

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


Row = dict[str, Any]
"""What came of one variant: `index`, `id`, `status` (`built | kept_out | refused | failed`), `rule`, `code`, `message`, `detail`,
`results`, `losses` (how many, by what becomes of them), `files` and `shared` (of a packed batch, see `packed_layout.py`), `seconds`,
`modelled`, `reused` (definition texts) and `pid` of the runner, as far as there is something to say."""


def row(task: Variant, status: str, **more: Any) -> Row:
    """A row of the journal."""
    return {"index": task.index, "id": task.id, "status": status, **more}


def refusal(fault: OSError) -> str:
    """What the system refused, and why."""
    reason = fault.strerror or str(fault)
    return f"`{fault.filename}`: {reason}" if fault.filename is not None else reason


def describe(plan: Plan, *, layout: str, asked: int, finished: bool, wanted: Sequence[Column] = ()) -> dict[str, Any]:
    """What `batch.json` says; `asked` is how many variants are asked for, the first ones of the plan, `wanted` are the columns of the table
    of a batch that has finished."""
    return {
        "name": plan.name, "document": plan.relative, "sha256": plan.sha256, "assembly": plan.assembly_relative,
        "plan": plan.digest, "count": plan.count, "asked": asked, "layout": layout, "inputs": dict(plan.inputs),
        "versions": dict(versions()),
        "emit": list(plan.emit), "modes": list(plan.modes), "pose": plan.pose,
        "reach": list(plan.reach) if plan.reach is not None else None, "finished": finished,
        "columns": [{"name": one.name, "kind": one.kind, "unit": one.unit} for one in wanted],
    }


def seen(plan: Plan, folder: str) -> dict[str, str]:
    """What every worker has to see: absolute path and digest. `batch.json` is in the folder already; of files outside of the workspace
    the plan does not say where they are."""
    files = {os.path.join(plan.workspace.root, path): state for path, state in plan.inputs.items() if not path.startswith(OUTSIDE)}
    with open(os.path.join(folder, folder_layout.BATCH), "rb") as stream:
        files[stream.name] = hashlib.sha256(stream.read()).hexdigest()
    return files


def job_of(plan: Plan, folder: str, options: Options, *, layout: str, verify: int, elsewhere: bool) -> Job:
    """The job of the runners; `elsewhere`: on other machines, which have another environment and another working folder."""
    store = options.store
    if elsewhere:
        store = store or os.environ.get("THINGC_STORE")
        store = store if store is None or "://" in store else os.path.abspath(store)
    rules = [rule for rule in plan.rules if rule.needs_results]
    return Job(
        assembly=plan.assembly, folder=folder, store=store, part_timeout=options.part_timeout,
        modes=plan.chosen_modes, results_mode=plan.modes[0], pose=plan.pose, reach=plan.reach,
        rules=tuple(rule.text for rule in rules), rule_names=tuple(dict(rule.names) for rule in rules),
        dimensions={
            name: (_exponent(one.length), _exponent(one.mass), _exponent(one.time), _exponent(one.angle))
            for name, one in plan.dimensions.items()
        },
        emit=plan.emit, verify=verify, packed=layout == PACKED,
    )


def _exponent(exponent: Any) -> float | int:
    return exponent if isinstance(exponent, int) else float(exponent)
