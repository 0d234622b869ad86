"""Read the meshes that workers write. Meshes for simulators are Wavefront OBJ files in which all vertices come before all triangles."""

from __future__ import annotations

from typing import TYPE_CHECKING

from thingc.base.pose import Vector
from thingc.geometry.record import Mesh
from thingc.geometry.store.local import Store

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


def vertices(store: Store, mesh: Mesh) -> tuple[Vector, ...]:
    """Read the vertices [m] of a mesh in the store, and return them sorted.

    The function does not use numpy, because importing numpy is slow. Raises `BlobMissing` if a mesh is missing in the store.
    """
    numbers = (line.split() for line in store.read(mesh.sha256).splitlines() if line.startswith(b"v"))
    return tuple(sorted((float(x), float(y), float(z)) for _, x, y, z in numbers))


def arrays(data: bytes) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Parse a mesh file (OBJ). Return the vertices `(n, 3)` [m] and the triangles `(m, 3)`. A triangle consists of vertex indices, counted
    from 0.
    """
    import numpy as np

    points, mark, corners = data.partition(b"f")
    vertices = np.fromstring(points.replace(b"v", b" ").decode(), sep=" ").reshape(-1, 3)
    faces = np.fromstring((mark + corners).replace(b"f", b" ").decode(), sep=" ", dtype=np.int64).reshape(-1, 3) - 1
    return vertices, faces


def exact_arrays(data: bytes) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Parse a mesh `slicing` of a part record. Return the vertices `(n, 3)` [mm] and the triangles `(m, 3)`."""
    import numpy as np

    count = int.from_bytes(data[:8], "little")
    faces = np.frombuffer(data, dtype="<u4", offset=8 + 24 * count).astype(np.int64)
    return np.frombuffer(data, dtype="<f8", count=3 * count, offset=8).reshape(-1, 3), faces.reshape(-1, 3)
