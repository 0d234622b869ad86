"""Convert part schemas, records and failures to and from JSON values, for the store and for the pipe to workers.

Paths of files in the workspace are relative to the folder of the workspace, so that machines can share records.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from typing import Any, TypeVar

from msgspec import convert, to_builtins
from msgspec.structs import replace

from thingc.geometry.record import ImpureInputs, PartFailure, PartRecord, PartSchema

File = TypeVar("File", str, str | None)


def relative_path(file: File, root: str) -> File:
    """Return the path of a file relative to the workspace, with `/` as separator. A path outside of the workspace is unchanged."""
    if file is None:
        return file
    inside = os.path.join(root, "")
    return file[len(inside) :].replace(os.sep, "/") if file.startswith(inside) else file


def full(file: File, root: str) -> File:
    """Return the absolute path for a path that `relative_path` returned."""
    return file if file is None else os.path.normpath(os.path.join(root, file))


# --- schemas and failures ---------------------------------------------------------------------------------------------


Answer = TypeVar("Answer", PartSchema, PartFailure)


def to_json(answer: PartSchema | PartFailure, root: str) -> Any:
    """Convert a part schema or a failure to a JSON value. This function is the inverse of `from_json`."""
    return {**to_builtins(answer), "file": relative_path(answer.file, root)}


def from_json(value: Any, root: str, kind: type[Answer]) -> Answer:
    """Convert a JSON value to a part schema or a failure. This function is the inverse of `to_json`."""
    return convert({**value, "file": full(value["file"], root)}, kind)


def with_left(answer: dict[str, Any], commands: Iterable[str]) -> dict[str, Any]:
    """Return a worker's answer with a warning for each process that the part left running.

    `commands` contains the command lines of these processes. An empty command line means a copy of the part's own process.
    """
    if "record" not in answer:
        return answer
    short = (line if len(line) <= 60 else f"{line[:57]}..." for line in commands)
    names = sorted({f"the process `{line}`" if line else "a copy of itself" for line in short})
    warnings = [[f"left {name} running", None, None, ImpureInputs.LEFT.value] for name in names]
    return {**answer, "record": {**answer["record"], "warnings": [*answer["record"]["warnings"], *warnings]}}


# --- records ----------------------------------------------------------------------------------------------------------


def record_to_json(record: PartRecord, root: str) -> Any:
    """Convert a part record to a JSON value. This function is the inverse of `record_from_json`.

    The JSON does not contain `convex` and `slices`, which are cached separately. The JSON also contains `mount_order`, because the store
    sorts the keys of objects.
    """
    code = None if record.code is None else (relative_path(record.code[0], root), record.code[1])
    warnings = tuple(replace(warning, file=relative_path(warning.file, root)) for warning in record.warnings)
    plain = replace(record, code=code, warnings=warnings, convex={}, slices={})
    return {**to_builtins(plain, order="deterministic"), "mount_order": list(record.mounts)}


def record_from_json(value: Any, root: str) -> PartRecord:
    """Convert a JSON value to a part record without convex pieces and slices. This function is the inverse of `record_to_json`."""
    record = convert({**value, "mounts": {name: value["mounts"][name] for name in value["mount_order"]}}, PartRecord)
    code = None if record.code is None else (full(record.code[0], root), record.code[1])
    return replace(record, code=code, warnings=tuple(replace(warning, file=full(warning.file, root)) for warning in record.warnings))


def blobs_of(value: Any) -> list[tuple[str, int | None]]:
    """Return the stored files to which the JSON value of a part record refers, as `(sha256, size)`. The size is None if it is unknown."""
    meshes = [*value["meshes"].values(), *(piece for piece in value["pieces"] if piece[0] == "Mesh")]
    blobs: list[tuple[str, int | None]] = [(sha256, size) for _, sha256, size, *_ in meshes]
    return blobs if value["brep"] is None else [*blobs, (value["brep"], None)]
