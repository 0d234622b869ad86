"""The vertices and triangles of a mesh in the store, in plain Python: what only looks at them need not pay for numpy."""

from __future__ import annotations

import struct
from collections.abc import Iterator

from thingc.pose import Vector
from thingc.realize.record import Mesh
from thingc.realize.store.local import Store

HEADER, FACE, CORNER = 84, 50, 12
"""Bytes of a binary STL file's head, of a triangle, and of a corner of one (the first is its normal)."""


def vertices(store: Store, mesh: Mesh) -> tuple[Vector, ...]:
    """The vertices [in the unit of the file] of a mesh that is kept as binary STL, each once, in order. Raises `BlobMissing`."""
    data = store.read(mesh.sha256)
    corners = {
        data[at : at + CORNER]
        for face in range(HEADER + CORNER, len(data), FACE) for at in range(face, face + 3 * CORNER, CORNER)
    }
    return tuple(sorted(struct.unpack("<3f", corner) for corner in corners))


def triangles(store: Store, mesh: Mesh) -> Iterator[tuple[Vector, Vector, Vector]]:
    """The corners [in the unit of the file] of each triangle of such a mesh. Raises `BlobMissing`."""
    for _, _, _, ax, ay, az, bx, by, bz, cx, cy, cz, _ in struct.iter_unpack("<12fH", store.read(mesh.sha256)[HEADER:]):
        yield (ax, ay, az), (bx, by, bz), (cx, cy, cz)
