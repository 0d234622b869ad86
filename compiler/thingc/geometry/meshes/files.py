"""Mesh files as documents name them, before anybody reads one: what is in them by content, and in which unit."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.inertia import MassProperties
from thingc.base.one_line_repr import OneLineRepr
from thingc.base.pose import Vector
from thingc.documents.load.paths import libraries
from thingc.geometry.record import Mesh
from thingc.geometry.store.file_digests import digest_of


class MeshFile(OneLineRepr, FrozenStruct):
    """A mesh file of the workspace: its path there, the SHA-256 of its content (and of those that its colours come from), and the factors
    by which its numbers are metres along x, y and z; of one that is mirrored some are negative. `folder` is where it lies (absolute)."""

    path: str
    sha256: str
    scale: Vector
    beside: tuple[tuple[str, str], ...] = ()
    folder: str = ""

    @property
    def suffix(self) -> str:
        """`.stl`."""
        return os.path.splitext(self.path)[1].lower()

    @property
    def name(self) -> str:
        """What it is called among other files: `meshes.trunk.stl`, with 8 hex of the SHA-256 of its scale before the suffix where its
        numbers are no metres."""
        stem, suffix = os.path.splitext(self.path.replace("/", "."))
        if self.scale == (1.0, 1.0, 1.0):
            return stem + suffix
        return f"{stem}-{hashlib.sha256(repr(self.scale).encode()).hexdigest()[:8]}{suffix}"

    @property
    def content(self) -> tuple[object, ...]:
        """All that what is read of it depends on."""
        return self.suffix, self.sha256, self.beside, self.scale


def mesh_file(absolute: str, path: str, scale: Vector, digest: Callable[[str], str] = digest_of) -> MeshFile:
    """The mesh file at an absolute path, which is `path` in the workspace; `digest` gives the SHA-256 of a file. Raises `OSError`."""
    folder = os.path.dirname(absolute)
    beside = [(name, os.path.join(folder, name)) for name in libraries(absolute)]
    return MeshFile(
        path=path, sha256=digest(absolute), scale=scale, folder=folder,
        beside=tuple((name, digest(place)) for name, place in beside if os.path.isfile(place)),
    )


class MeshPiece(OneLineRepr, FrozenStruct, array_like=True):
    """The triangles of one colour (`#rrggbb`, `#rrggbbaa`; None: the file says none)."""

    mesh: Mesh
    color: str | None


class MeshRecord(OneLineRepr, FrozenStruct):
    """A mesh file [m], mirrored and turned as its scale, unit and up axis say. `mesh` is all of it, in the store as OBJ; `pieces` what is
    drawn, by colour. `matter` is what it holds at density 1: volume [m^3], centre, inertia [m^5]; None of a surface that is open. `box` are
    two corners. `own` are the bytes of the file, in the store, where MuJoCo reads them as they are."""

    mesh: Mesh
    pieces: tuple[MeshPiece, ...]
    matter: MassProperties | None
    box: tuple[Vector, Vector]
    own: tuple[str, int] | None
