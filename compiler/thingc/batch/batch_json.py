"""What others are told of a batch: its folder (`batch.json`), its runners (the job), and machines that have to see its files."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Sequence
from typing import Any

from thingc.batch import folder_layout
from thingc.batch.folder import PACKED
from thingc.batch.job import Job
from thingc.batch.planning import OUTSIDE, Plan
from thingc.batch.tables import Column
from thingc.driver.environment import Options
from thingc.targets.manifest import versions


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
    files = {
        os.path.join(plan.workspace.root, path): state for path, state in plan.inputs.items() if not path.startswith(OUTSIDE)
    }
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
