"""Describe a batch for other processes: `batch.json`, the files that workers must be able to read, and the job for runner processes.

A job and its variants are encoded as JSON, so that any executor can send them to another process.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from msgspec import convert
from msgspec.structs import asdict, astuple

from thingc.base.frozen_struct import FrozenStruct
from thingc.batch import folder_layout
from thingc.batch.folder import PACKED
from thingc.batch.variant import OUTSIDE, Variant
from thingc.driver.environment import Options
from thingc.targets.manifest import versions

if TYPE_CHECKING:
    from thingc.batch.planning import Plan
    from thingc.batch.tables import Column

STOPPED = "stopped"
"""The status of a row that ends the batch, because files can no longer be written or read for a reason other than the variant."""


class Job(FrozenStruct):
    """The data that a runner process needs to build the variants of a batch, apart from the variants themselves.

    Attributes:
        assembly: The absolute path of the assembly document.
        folder: The absolute path of the folder of the batch. If `folder` is None, no files are written.
        rules: The texts and the names (see `Rule`) of the rules that compare results of a variant.
        dimensions: The exponents of length, mass, time and angle for each numeric parameter.
        packed: Whether the row of a variant contains its files, so that only shared files are written.
        verify: If models differ only in numbers, MuJoCo compiles one in `verify` models (1: each, 0: none).
        cwd: The working folder of runner processes. None selects the working folder of the parent process.
    """

    assembly: str
    folder: str | None
    store: str | None
    part_timeout: float | None
    modes: tuple[str, ...]
    results_mode: str
    pose: str | None
    reach: tuple[str, str] | None
    rules: tuple[tuple[str, dict[str, str | None]], ...]
    dimensions: Mapping[str, tuple[Any, ...]]
    emit: tuple[str, ...]
    verify: int = 1
    packed: bool = False
    cwd: str | None = None

    def encode(self) -> str:
        """Encode the job as a single line of JSON. The inverse of this function is `decode`."""
        return json.dumps(asdict(self), sort_keys=True)

    @staticmethod
    def decode(text: str) -> Job:
        """Return the job that `encode` has converted to the string `text`."""
        return convert(json.loads(text), Job)


Row = dict[str, Any]
"""The result of a variant, as a row of the journal. Keys with unknown values are omitted.

A row has the keys `index`, `id`, `status` (`built | kept_out | refused | failed`), `rule`, `code`, `message`, `detail`, `results`, `losses`
(counts by kind), `files` and `shared` (of a packed batch, see `packed_layout.py`), `seconds`, `modelled` (definition texts), `reused`
(number of parts), and `pid` of the runner.
"""


def row(task: Variant, status: str, **more: Any) -> Row:
    """Create the row of results of a variant for the journal."""
    return {"index": task.index, "id": task.id, "status": status, **more}


def refusal(fault: OSError) -> str:
    """Return a message that explains an error of the operating system."""
    reason = fault.strerror or str(fault)
    return f"`{fault.filename}`: {reason}" if fault.filename is not None else reason


def describe(plan: Plan, *, layout: str, requested: int, finished: bool, table_columns: Sequence[Column] = ()) -> dict[str, Any]:
    """Return the content of the file `batch.json`, which describes a batch.

    `requested` is the number of variants to build, counted from the first variant of the plan. `table_columns` contains the columns of the
    table of a finished batch.
    """
    return {
        "name": plan.name, "document": plan.relative, "sha256": plan.sha256, "assembly": plan.assembly_relative,
        "plan": plan.digest, "count": plan.count, "asked": requested, "layout": layout, "inputs": dict(plan.inputs),
        "versions": dict(versions()),
        "emit": list(plan.emit), "modes": list(plan.modes), "pose": plan.pose,
        "reach": list(plan.reach) if plan.reach is not None else None, "finished": finished,
        "columns": [{"name": column.name, "kind": column.kind, "unit": column.unit} for column in table_columns],
    }


def digest_files(plan: Plan, folder: str) -> dict[str, str]:
    """Return the digests of all files that every worker must be able to read, keyed by absolute path.

    The mapping also contains the digest of `batch.json`. Files outside the workspace are omitted, because the plan does not contain their
    paths.
    """
    files = {os.path.join(plan.workspace.root, path): state for path, state in plan.inputs.items() if not path.startswith(OUTSIDE)}
    description = os.path.join(folder, folder_layout.BATCH)
    return files | {description: hashlib.sha256(folder_layout.read_file(description)).hexdigest()}


def job_of(plan: Plan, folder: str, options: Options, *, layout: str, verify: int, elsewhere: bool) -> Job:
    """Create the job that runner processes receive for a batch.

    `elsewhere` is True for runner processes on other machines, which have a different environment and working folder.
    """
    store = store_here(options.store) if elsewhere else options.store
    return Job(
        assembly=plan.assembly, folder=folder, store=store, part_timeout=options.part_timeout,
        modes=plan.chosen_modes, results_mode=plan.modes[0], pose=plan.pose, reach=plan.reach,
        rules=tuple((rule.text, dict(rule.names)) for rule in plan.rules if rule.needs_results),
        dimensions={name: tuple(map(_exponent, astuple(dimension))) for name, dimension in plan.dimensions.items()},
        emit=plan.emit, verify=verify, packed=layout == PACKED,
    )


def store_here(store: str | None) -> str | None:
    """Return the URL or the absolute path of a store. By default, the environment variable `THINGC_STORE` specifies the store."""
    store = store or os.environ.get("THINGC_STORE") or None
    return store if store is None or "://" in store else os.path.abspath(store)


def _exponent(exponent: Any) -> float | int:
    return exponent if isinstance(exponent, int) else float(exponent)
