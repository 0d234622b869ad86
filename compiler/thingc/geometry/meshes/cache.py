"""Records of mesh files, cached in the store by the content of the files."""

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
"""Kind of the JSON documents in the store that contain mesh records."""

VERSION = 3
"""Version of the format of mesh records. Increase this number when the format changes, so that older cached records are not used."""


def mesh_record(file: MeshFile, store: Store, read: bool = True) -> MeshRecord | None:
    """Return the record of a mesh file, from the store or by reading the file.

    If `read` is False and the store does not contain the record, return None. Raises `BadMesh` if the file is not a valid mesh.
    """
    key = json.dumps([VERSION, *file.content])
    cached = store.get_json(KIND, key)
    if cached is not None and all(store.has(sha256, size) for sha256, size in cached["blobs"]):
        return convert(cached, MeshRecord)
    if not read:
        return None
    from thingc.geometry.meshes.mesh_reader import read_mesh

    record = read_mesh(file, store)
    gc.collect(1)  # the meshes of trimesh are large and contain reference cycles: free their memory now, not at the end of the command
    store.put_json(KIND, key, _as_json(record))
    return record


def mesh_records(files: Mapping[MeshFile, tuple[Origin, bool]], store: Store, report: Report, memo: Memo) -> dict[MeshFile, MeshRecord]:
    """Return the records of mesh files.

    `files` maps each file to its location in the document and to a flag. If the flag is False and the record is not cached, the file is
    not read and has no record in the result. If a file is not a mesh, report an error at its location.
    """
    records: dict[MeshFile, MeshRecord] = {}
    for file, (origin, read) in files.items():
        try:
            record = memo(("mesh record", file.path, file.scale, read), mesh_record, file, store, read)
        except BadMesh as fault:
            report.add(Code.PART_INVALID, f"`{file.path}` {fault}", origin, help="export the mesh again as STL, OBJ, COLLADA, PLY or glTF")
            continue
        if record is not None:
            records[file] = record
    return records


def _as_json(record: MeshRecord) -> dict[str, Any]:
    meshes = [record.mesh, *(piece.mesh for piece in record.pieces)]
    blobs = [*([mesh.sha256, mesh.size] for mesh in meshes), *([record.own] if record.own is not None else [])]
    return {**to_builtins(record), "blobs": blobs}
