"""Pack the meshes of a page into one binary file in the format glTF 2.0. The positions of vertices are stored as 16-bit numbers relative to
the bounding box of their mesh (KHR_mesh_quantization).

For a part of 200 mm, the error of a position is at most 3 um. The file contains each mesh once. The transform of its node converts the
packed positions to metres. The poses of the meshes are not in this file, but in the data of the page. The module does not use numpy,
because importing numpy takes longer than packing.
"""

from __future__ import annotations

import json
import struct
from array import array

from thingc.geometry.record import Mesh
from thingc.geometry.store.local import Store

POSITIONS, CORNERS = 34962, 34963
"""Targets of buffer views in glTF: vertex data and indices."""

SHORT, UNSIGNED_SHORT, UNSIGNED_INT = 5122, 5123, 5125
"""Component types in glTF: signed 16-bit, unsigned 16-bit and unsigned 32-bit integers."""

PACKING = "KHR_mesh_quantization"
"""Name of the glTF extension for 16-bit positions."""

MOST = 32767
"""The largest signed 16-bit number. As a normalised position, it represents the value 1."""


class PackedMeshes:
    """Collects the meshes of a web page and numbers them in the order of their first request."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._numbers: dict[str, int] = {}

    def number(self, mesh: Mesh) -> int:
        """Return the number of a mesh in the glTF file. If the file does not contain the mesh yet, the mesh is added."""
        return self._numbers.setdefault(mesh.sha256, len(self._numbers))

    def glb(self) -> bytes:
        """Return a glTF file with all requested meshes. Raises `BlobMissing` if a mesh is missing in the store."""
        tree: dict[str, list[dict[str, object]]] = {"nodes": [], "meshes": [], "accessors": [], "bufferViews": []}
        data = bytearray()
        for sha256 in self._numbers:
            _add(sha256, self._store.read(sha256), tree, data)
        scene = {"scene": 0, "scenes": [{"nodes": list(range(len(tree["nodes"])))}], "buffers": [{"byteLength": len(data)}], **tree}
        packing = {"extensionsUsed": [PACKING], "extensionsRequired": [PACKING]}
        nothing = {"scene": 0, "scenes": [{}]}  # an empty list is invalid in glTF
        return _file({"asset": {"version": "2.0", "generator": "thingc"}, **packing, **(scene if data else nothing)}, bytes(data))


def _add(sha256: str, obj: bytes, tree: dict[str, list[dict[str, object]]], data: bytearray) -> None:
    """Append a mesh to a glTF file. The mesh must be an OBJ file in which all vertices come before all triangles."""
    points, mark, corners = obj.partition(b"f")
    numbers = [float(word) for word in points.replace(b"v", b" ").split()]
    indices = [int(word) - 1 for word in (mark + corners).replace(b"f", b" ").split()]
    axes = [numbers[k::3] for k in range(3)]
    low, high = [min(axis) for axis in axes], [max(axis) for axis in axes]
    centre, half = [(a + b) / 2.0 for a, b in zip(low, high)], max((b - a) / 2.0 for a, b in zip(low, high)) or 1.0
    packed = array("h", bytes(8 * len(axes[0])))  # four 16-bit numbers per vertex, because vertices must begin at multiples of four bytes
    for k, axis in enumerate(axes):
        packed[k::4] = array("h", [round((x - centre[k]) / half * MOST) for x in axis])
    wide = len(axes[0]) > 65536
    views, accessors = tree["bufferViews"], tree["accessors"]
    ends = [[f([round((x - centre[k]) / half * MOST) for x in (low[k], high[k])]) for k in range(3)] for f in (min, max)]
    for content, use in ((packed, POSITIONS), (array("I" if wide else "H", indices), CORNERS)):
        raw = _little(content)
        view: dict[str, object] = {"buffer": 0, "byteOffset": len(data), "byteLength": len(raw), "target": use}
        views.append({**view, "byteStride": 8} if use == POSITIONS else view)
        data += raw + bytes(-len(raw) % 4)
    accessors.append({
        "bufferView": len(views) - 2, "componentType": SHORT, "normalized": True, "count": len(axes[0]), "type": "VEC3",
        "min": ends[0], "max": ends[1],
    })
    accessors.append({
        "bufferView": len(views) - 1, "componentType": UNSIGNED_INT if wide else UNSIGNED_SHORT, "count": len(indices), "type": "SCALAR",
    })
    primitive = {"attributes": {"POSITION": len(accessors) - 2}, "indices": len(accessors) - 1}
    tree["meshes"].append({"name": sha256, "primitives": [primitive]})
    tree["nodes"].append({"mesh": len(tree["meshes"]) - 1, "translation": centre, "scale": [half, half, half]})


def _little(numbers: array[int]) -> bytes:
    """Convert numbers to bytes in little-endian order, on any machine."""
    if struct.pack("=H", 1) != struct.pack("<H", 1):
        numbers.byteswap()
    return numbers.tobytes()


def _file(tree: dict[str, object], data: bytes) -> bytes:
    """Return a binary glTF file (glTF 2.0, section 4.4), which consists of a header, JSON and a buffer."""
    text = json.dumps(tree, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
    if data:
        chunks += struct.pack("<II", len(data), 0x004E4942) + data
    return struct.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks
