"""Part schemas, records and failures as plain JSON values, as the store and the worker's pipe carry them.

Files in the workspace are written relative to it (`root`), so that records can be shared between machines.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from typing import Any, TypeVar

from msgspec import convert, to_builtins
from msgspec.structs import replace

from thingc.geometry.record import ImpureInputs, PartFailure, PartRecord, PartSchema


def shortened(file: str | None, root: str) -> str | None:
    """A file relative to the workspace, with `/`; as it is outside of it."""
    if file is None:
        return None
    inside = os.path.join(root, "")
    return file[len(inside) :].replace(os.sep, "/") if file.startswith(inside) else file


def full(file: str | None, root: str) -> str | None:
    """The inverse of `shortened`."""
    return None if file is None else os.path.normpath(os.path.join(root, file))


# --- schemas and failures ---------------------------------------------------------------------------------------------


Answer = TypeVar("Answer", PartSchema, PartFailure)


def to_json(answer: PartSchema | PartFailure, root: str) -> Any:
    """The inverse of `from_json`."""
    return {**to_builtins(answer), "file": shortened(answer.file, root)}


def from_json(value: Any, root: str, kind: type[Answer]) -> Answer:
    """A part schema or a failure."""
    return convert({**value, "file": full(value["file"], root)}, kind)


def with_left(answer: dict[str, Any], commands: Iterable[str]) -> dict[str, Any]:
    """What a worker has made of a part, with a word on each of the processes that the part has left behind: their command lines, empty
    for a copy of itself."""
    if "record" not in answer:
        return answer
    names = sorted({"a copy of itself" if not line else f"`{line if len(line) <= 60 else line[:57] + '...'}`" for line in commands})
    left = [[f"leaves {name} running, which was ended", None, None, ImpureInputs.LEFT.value] for name in names]
    return {**answer, "record": {**answer["record"], "warnings": [*answer["record"]["warnings"], *left]}}


# --- records ----------------------------------------------------------------------------------------------------------


def record_to_json(record: PartRecord, root: str) -> Any:
    """The inverse of `record_from_json`; without `convex` and `slices`, which are kept apart. `mount_order` is the order of the mounts: the
    store sorts keys."""
    code = None if record.code is None else (shortened(record.code[0], root) or "", record.code[1])
    warnings = tuple(replace(warning, file=shortened(warning.file, root)) for warning in record.warnings)
    plain = replace(record, code=code, warnings=warnings, convex=(), slices={})
    return {**to_builtins(plain, order="deterministic"), "mount_order": list(record.mounts)}


def record_from_json(value: Any, root: str) -> PartRecord:
    """A part record, without convex pieces and slices."""
    record = convert({**value, "mounts": {name: value["mounts"][name] for name in value["mount_order"]}}, PartRecord)
    code = None if record.code is None else (full(record.code[0], root) or "", record.code[1])
    return replace(record, code=code, warnings=tuple(replace(warning, file=full(warning.file, root)) for warning in record.warnings))


def blobs_of(value: Any) -> list[tuple[str, int | None]]:
    """The blobs that a record's JSON needs: `(sha256, size)`, the size None where it is not known."""
    meshes = [*value["meshes"].values(), *(piece for piece in value["pieces"] if piece[0] == "Mesh")]
    blobs: list[tuple[str, int | None]] = [(sha256, size) for _, sha256, size, *_ in meshes]
    return blobs if value["brep"] is None else [*blobs, (value["brep"], None)]
