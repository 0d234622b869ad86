"""What is known of mesh files, kept in the store by their content."""

from __future__ import annotations

import gc
import json
from collections.abc import Mapping
from typing import Any

from msgspec import convert, to_builtins

from thingc.base.diagnostics import Code, Report
from thingc.base.memo import Memo
from thingc.base.source import Origin
from thingc.geometry.mesh_bounds import BadMesh
from thingc.geometry.meshes.files import MeshFile, MeshRecord
from thingc.geometry.store.local import Store

KIND = "mesh-files"
"""Documents in the store."""

VERSION = 3
"""Of what is read of a file: another one is read anew."""


def measured(file: MeshFile, store: Store, read: bool = True) -> MeshRecord | None:
    """What is known of a file, from the store, else by reading it; without `read` None where nobody has read it yet. Raises `BadMesh`."""
    key = json.dumps([VERSION, *file.content])
    known = store.get_json(KIND, key)
    if known is not None and all(store.has(sha256, size) for sha256, size in known["blobs"]):
        return convert(known, MeshRecord)
    if not read:
        return None
    from thingc.geometry.meshes.mesh_reader import read_mesh

    record = read_mesh(file, store)
    gc.collect(1)  # what trimesh makes of a mesh refers to itself, and is large: that of many meshes would wait for a command's end
    store.put_json(KIND, key, _as_json(record))
    return record


def mesh_records(listed: Mapping[MeshFile, tuple[Origin, bool]], store: Store, report: Report, memo: Memo) -> dict[MeshFile, MeshRecord]:
    """The records of mesh files, each with the place where it is listed and whether it has to be read, without those of which nothing is
    known. One that is no mesh is an error at its place."""
    records: dict[MeshFile, MeshRecord] = {}
    for file, (origin, read) in listed.items():
        try:
            record = memo(("mesh record", file.path, file.scale, read), measured, file, store, read)
        except BadMesh as fault:
            report.add(Code.PART_INVALID, f"`{file.path}` {fault}", origin, help="export it anew, as STL, OBJ, COLLADA, PLY or glTF")
            continue
        if record is not None:
            records[file] = record
    return records


def _as_json(record: MeshRecord) -> dict[str, Any]:
    meshes = [record.mesh, *(piece.mesh for piece in record.pieces)]
    blobs = [*([mesh.sha256, mesh.size] for mesh in meshes), *([record.own] if record.own is not None else [])]
    return {**to_builtins(record), "blobs": blobs}
