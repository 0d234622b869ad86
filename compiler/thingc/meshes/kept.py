"""What is known of mesh files, kept in the store by their content."""

from __future__ import annotations

import json
from typing import Any

from thingc.inertia import MassProperties
from thingc.meshes.files import MeshFile
from thingc.meshes.record import MeshPiece, MeshRecord
from thingc.realize.record import Mesh
from thingc.realize.store.local import Store

KIND = "mesh-files"
"""Documents in the store."""

VERSION = 1
"""Of what is read of a file: another one is read anew."""


def measured(file: MeshFile, store: Store, *, read: bool = True) -> MeshRecord | None:
    """What is known of a file, from the store, else by reading it; without `read` None where nobody has read it yet. Raises `BadMesh`."""
    key = json.dumps([VERSION, *file.content])
    known = store.get_json(KIND, key)
    if known is not None and all(store.has(sha256, size) for sha256, size in known["blobs"]):
        return _record(known)
    if not read:
        return None
    from thingc.meshes.reading import read_mesh

    record = read_mesh(file, store)
    store.put_json(KIND, key, _plain(record))
    return record


def _plain(record: MeshRecord) -> dict[str, Any]:
    meshes = [record.mesh, *(piece.mesh for piece in record.pieces)]
    matter = record.matter
    return {
        "mesh": _mesh(record.mesh), "pieces": [[_mesh(piece.mesh), piece.color] for piece in record.pieces],
        "matter": None if matter is None else [matter.mass, matter.centre, matter.inertia], "box": record.box, "own": record.own,
        "blobs": [*([mesh.sha256, mesh.size] for mesh in meshes), *([record.own] if record.own is not None else [])],
    }


def _mesh(mesh: Mesh) -> list[Any]:
    return [mesh.sha256, mesh.size, mesh.vertices, mesh.faces, mesh.closed, mesh.flat]


def _read_mesh(plain: list[Any]) -> Mesh:
    sha256, size, vertices, faces, closed, flat = plain
    return Mesh(sha256=sha256, size=size, vertices=vertices, faces=faces, closed=closed, flat=flat)


def _record(plain: dict[str, Any]) -> MeshRecord:
    matter = plain["matter"]
    low, high = (tuple(corner) for corner in plain["box"])
    return MeshRecord(
        mesh=_read_mesh(plain["mesh"]), pieces=tuple(MeshPiece(mesh=_read_mesh(mesh), color=color) for mesh, color in plain["pieces"]),
        matter=None if matter is None else MassProperties(
            mass=matter[0], centre=tuple(matter[1]), inertia=tuple(tuple(row) for row in matter[2]),  # type: ignore[arg-type]
        ),
        box=(low, high), own=None if plain["own"] is None else (plain["own"][0], plain["own"][1]),
    )
