"""Mesh files that documents list, with the digests of their contents and their scale. This module does not read meshes."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable

from thingc.base.inertia import MassProperties
from thingc.base.one_line_repr import OneLineStruct
from thingc.base.pose import Vector
from thingc.documents.load.paths import libraries
from thingc.geometry.record import Mesh
from thingc.geometry.store.file_digests import digest_of


class MeshFile(OneLineStruct):
    """A mesh file of the workspace.

    `path` is the path of the file in the workspace, `folder` is the absolute path of its folder, and `sha256` is the digest of its
    content. `beside` contains the names and digests of other files that define the colours of the mesh. `scale` contains the factors along
    x, y and z that convert the file to metres. Some factors are negative if the mesh is mirrored.
    """

    path: str
    sha256: str
    scale: Vector
    beside: tuple[tuple[str, str], ...] = ()
    folder: str = ""

    @property
    def suffix(self) -> str:
        """The suffix in lower case, such as `.stl`."""
        return os.path.splitext(self.path)[1].lower()

    @property
    def name(self) -> str:
        """The file name in the build output, such as `meshes.trunk.stl`.

        If the unit is not metres, the name also contains 8 hex digits of the SHA-256 of the scale.
        """
        stem, suffix = os.path.splitext(self.path.replace("/", "."))
        if self.scale == (1.0, 1.0, 1.0):
            return stem + suffix
        return f"{stem}-{hashlib.sha256(repr(self.scale).encode()).hexdigest()[:8]}{suffix}"

    @property
    def content(self) -> tuple[object, ...]:
        """The values that determine the record of the mesh file."""
        return self.suffix, self.sha256, self.beside, self.scale


def mesh_file(absolute: str, path: str, scale: Vector, digest: Callable[[str], str] = digest_of) -> MeshFile:
    """Create the `MeshFile` for an absolute path.

    `path` is the path of the file in the workspace, and the function `digest` returns the SHA-256 of a file. Raises `OSError` if the file
    cannot be read.
    """
    folder = os.path.dirname(absolute)
    color_files = [(name, os.path.join(folder, name)) for name in libraries(absolute)]
    return MeshFile(
        path=path, sha256=digest(absolute), scale=scale, folder=folder,
        beside=tuple((name, digest(place)) for name, place in color_files if os.path.isfile(place)),
    )


class MeshPiece(OneLineStruct, array_like=True):
    """The triangles of one colour (`#rrggbb`, `#rrggbbaa`; None if the file does not specify a colour)."""

    mesh: Mesh
    color: str | None


class MeshRecord(OneLineStruct):
    """The contents of a mesh file [m] after the scale, the unit and the up axis of the file are applied.

    `mesh` is the whole mesh, as an OBJ file in the store. `pieces` contains the visual meshes, one for each colour. `matter` is the solid
    at density 1 (volume [m^3], centre, inertia [m^5]), or None for an open surface. `box` contains the smallest and the largest corner of
    the bounding box [m]. `convex` contains the requested convex decompositions, by the largest number of pieces (see `PartRecord`).
    `own` is the digest and the size of the original file in the store. `own` is None if MuJoCo cannot read this file
    unchanged.
    """

    mesh: Mesh
    pieces: tuple[MeshPiece, ...]
    matter: MassProperties | None
    box: tuple[Vector, Vector]
    own: tuple[str, int] | None
    convex: dict[int, tuple[Mesh, ...]] = {}
