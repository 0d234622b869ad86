"""Decompose the mesh of a part into convex pieces, for `collision: decompose`."""

from __future__ import annotations

from typing import Any

from msgspec import to_builtins

from thingc.geometry.store.local import Store
from thingc.geometry.store.meshes import arrays
from thingc.geometry.worker.kernel import meshing
from thingc.geometry.worker.kernel.build_part import stored_obj
from thingc.geometry.worker.kernel.meshing import Triangles, without_slivers
from thingc.geometry.worker.kernel.part_files import surfaces

CONVEX = 1e-4
"""A surface counts as convex if its convex hull has at most this relative excess volume. A convex surface becomes one piece."""


def decompose(sha256: str, max_pieces: int, store: Store) -> list[Any]:
    """Decompose a mesh in the store into convex pieces with CoACD. Return the pieces as a JSON value, in the unit of the mesh.

    The result is the same in every run.

    Surfaces that do not touch are decomposed separately, unless this results in more than `max_pieces` pieces. With 0, the
    number is not limited.
    """
    mesh = Triangles(*arrays(store.read(sha256)))
    pieces: list[Triangles] = []
    for members in surfaces(mesh):
        body = without_slivers(mesh.vertices, mesh.faces[members])
        hull = meshing.hull(body.vertices)
        if hull is None or body.volume < 0.0:  # a flat surface, or a void inside a body
            pieces = []
            break
        pieces.extend([hull] if hull.volume - body.volume <= CONVEX * hull.volume else _by_coacd(body))
    if not pieces or 0 < max_pieces < len(pieces):
        pieces = _by_coacd(mesh, max_pieces)
    return [to_builtins(stored_obj(piece, store)) for piece in pieces]


def _by_coacd(mesh: Triangles, max_pieces: int = 0) -> list[Triangles]:
    """Decompose a mesh into at most `max_pieces` pieces with the package CoACD.

    The algorithm is described in Wei et al., "Approximate convex decomposition for 3D meshes with collision-aware concavity and tree
    search", 2022.
    """
    import coacd

    coacd.set_log_level("off")
    pieces = coacd.run_coacd(coacd.Mesh(mesh.vertices, mesh.faces), seed=0, max_convex_hull=max_pieces or -1)
    hulls = (meshing.hull(vertices) for vertices, _ in pieces)
    return [piece for piece in hulls if piece is not None]
