"""Detect geometry that MuJoCo does not support or handles differently, and cache which geometry MuJoCo has accepted.

When MuJoCo compiles a model, it spends most of the time on reading meshes (200 of 220 ms for twelve parts). Whether MuJoCo accepts a mesh
depends only on its bytes, and on whether MuJoCo reads it as a surface. Therefore, known meshes are not read again. After an edit of limits,
masses or poses, MuJoCo compiles the model with a tetrahedron in place of each known mesh.
"""

from __future__ import annotations

import functools
import hashlib
import itertools
import json
import struct
from collections.abc import Collection, Iterable, Mapping, Sequence
from types import MappingProxyType

from thingc.base.diagnostics import Report
from thingc.base.primitives import Primitive
from thingc.geometry.record import Mesh
from thingc.geometry.store.local import Store
from thingc.model.assembly.types import Assembly
from thingc.targets.artifact import Loss
from thingc.targets.geometry import Geometry, MeshAsset, collect_geometry
from thingc.targets.manifest import versions
from thingc.targets.xml_writer import Element

LEAST_VOLUME = 1e-14
"""Smallest volume [m^3] of a part whose mesh can be read as a solid.

MuJoCo rejects solid meshes with a volume of up to 1e-15 (mjMINVAL). The volume of a mesh can be slightly smaller than the volume of its
part.
"""

FOLDER = "mjcf/assets"
"""Folder of the meshes that all models share."""


MODEL, MESH, START = "mujoco-model", "mujoco-mesh", "mujoco-start"
"""Kinds of JSON documents in the store. The documents represent accepted models, accepted meshes and accepted initial states.

A mesh counts as accepted if a version of MuJoCo compiled it without messages. An initial state counts as accepted if it has no errors
(`initial_state_checks.py`).
"""

HARMLESS = frozenset({"condim", "friction", "gap", "group", "margin", "priority", "rgba", "solimp", "solmix", "solref"})
"""Attributes of a geom that do not affect how MuJoCo processes its mesh."""

# A tetrahedron, which MuJoCo accepts in place of any mesh.
_CORNERS = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
_SIDES = ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))
_BOX_SIDES = (
    (0, 1, 3), (0, 3, 2), (4, 7, 5), (4, 6, 7), (0, 4, 5), (0, 5, 1), (2, 7, 6), (2, 3, 7), (0, 2, 6), (0, 6, 4), (1, 7, 3), (1, 5, 7),
)
"""The triangles of a box, as indices of its corners. The corners are ordered such that z changes first, then y, then x."""


class AcceptedModels:
    """A cache, in the store, of the models, meshes and initial states that MuJoCo has accepted.

    The cached results are valid for the given meshes and version of MuJoCo.
    """

    def __init__(self, store: Store, version: str, meshes: Sequence[MeshAsset]) -> None:
        self.store = store
        self.version = version
        self._meshes = meshes
        self._context = json.dumps([version, {mesh.file: mesh.stored.sha256 for mesh in meshes}], sort_keys=True)

    @functools.cached_property
    def _unaccepted(self) -> dict[str, str]:
        """Return the cache keys of the meshes that MuJoCo has not accepted yet, by file."""
        keys = {mesh.file: self._mesh_key(mesh) for mesh in self._meshes}
        return {file: key for file, key in keys.items() if self.store.get_json(MESH, key) is None}

    def model(self, texts: Sequence[str], *, started: bool) -> bool:
        """Return whether MuJoCo has accepted a model with exactly these XML files and meshes.

        If `started` is True, the initial state must also have been checked.
        """
        levels = (True,) if started else (True, False)
        return any(self.store.get_json(MODEL, self._key((*texts, str(level)))) is not None for level in levels)

    def accept(self, texts: Sequence[str], *, started: bool) -> None:
        """Record that MuJoCo accepted a model and its meshes. If `started` is True, also record that the initial state was checked."""
        self.store.note_json(MODEL, self._key((*texts, str(started))), True)
        self.accept_meshes()

    def accept_meshes(self, *meshes: MeshAsset) -> None:
        """Record that MuJoCo accepted meshes. By default, record that MuJoCo accepted all meshes of a model."""
        for mesh in meshes or self._meshes:
            if (key := self._unaccepted.pop(mesh.file, None)) is not None:
                self.store.note_json(MESH, key, True)

    def unread(self, required: Collection[str]) -> list[MeshAsset]:
        """Return the meshes that MuJoCo must read: meshes that it has not accepted yet, and meshes whose names are in `required`."""
        return [mesh for mesh in self._meshes if mesh.name in required or mesh.file in self._unaccepted]

    def start(self, key: str) -> bool:
        """Return whether the initial state with the digest `key` was accepted."""
        return self.store.get_json(START, self._key((key,))) is not None

    def accept_start(self, key: str) -> None:
        """Record that the initial state with the digest `key` was accepted."""
        self.store.note_json(START, self._key((key,)), True)

    def data(
        self, models: Iterable[Element], required: Collection[str] = (), replacements: Mapping[str, bytes] = MappingProxyType({}),
    ) -> dict[str, bytes]:
        """Return the contents of the mesh files that MuJoCo reads, by file name.

        A mesh that MuJoCo has accepted is replaced by a tetrahedron, unless its name is in `required`. The other meshes are replaced by the
        bytes in `replacements`, if any. If raw attributes of the `models` may affect meshes, no mesh counts as accepted.
        """
        all_needed = any(changes_meshes(model) for model in models)
        files = {mesh.file for mesh in (self._meshes if all_needed else self.unread(required))}
        return {
            mesh.file: replacements.get(mesh.file) or self.store.read(mesh.stored.sha256) if mesh.file in files
            else mesh_bytes(mesh.file, _CORNERS, _SIDES)
            for mesh in self._meshes
        }

    def _mesh_key(self, mesh: MeshAsset) -> str:
        extension = mesh.file.rpartition(".")[2]
        scale = f" {mesh.scale}" if mesh.original is not None else ""
        return f"{self.version} {mesh.stored.sha256} {extension} {'shell' if is_shell(mesh) else 'solid'}{scale}"

    def _key(self, texts: Sequence[str]) -> str:
        return hashlib.sha256("\0".join((self._context, *texts)).encode()).hexdigest()


@functools.cache
def mujoco_version() -> str:
    """Return the version of the installed MuJoCo. The package is not imported, because the import takes 0.1 s."""
    if "mujoco" in versions():
        return versions()["mujoco"]
    from importlib.metadata import version

    return version("mujoco")


def changes_meshes(model: Element) -> bool:
    """Return whether raw attributes change meshes or their use, or whether added elements define contact pairs."""
    if model.find_or_empty("contact").find("pair") is not None:
        return True
    if any(element.raw for tag in ("compiler", "default") for element in model.find_or_empty(tag).walk()):
        return True
    changed = (element for element in model.walk() if element.raw)
    return any(element.tag == "mesh" or element.tag == "geom" and not HARMLESS.issuperset(element.raw) for element in changed)


def box_bytes(file: str, points: Sequence[Sequence[float]]) -> bytes:
    """Return the bytes of a mesh file that contains the bounding box of points (n, 3). The name of the file determines the format."""
    low, high = (tuple(map(side, zip(*points, strict=True))) for side in (min, max))
    return mesh_bytes(file, [*itertools.product(*zip(low, high, strict=True))], _BOX_SIDES)


def mesh_bytes(file: str, corners: Sequence[Sequence[float]], sides: Sequence[Sequence[int]]) -> bytes:
    """Create the bytes of a mesh file from corners `(n, 3)` and triangles `(m, 3)`.

    The name of the file determines the format, which is OBJ or binary STL.
    """
    if file.endswith(".obj"):
        lines = [f"v {x} {y} {z}" for x, y, z in corners] + [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in sides]
        return "\n".join(lines).encode() + b"\n"
    triangles = (struct.pack("<12fH", 0, 0, 0, *(x for corner in side for x in corners[corner]), 0) for side in sides)
    return bytes(80) + struct.pack("<I", len(sides)) + b"".join(triangles)


def choose_geometry(assembly: Assembly, report: Report) -> tuple[Geometry, list[Loss]]:
    """Return the visual and collision shapes of every occurrence, and the export losses of MJCF.

    Report an error for each shape that MuJoCo does not accept.
    """
    return collect_geometry(assembly, "mjcf", FOLDER, report, original=True, describe_flat=_describe_flat)


def is_shell(mesh: MeshAsset) -> bool:
    """Return whether MuJoCo must read a mesh as a surface (`inertia="shell"`), because it encloses almost no volume."""
    return mesh.mesh.flat or not mesh.mesh.closed or mesh.volume < LEAST_VOLUME


def _describe_flat(piece: Mesh | Primitive) -> str:
    """Return the reason why MuJoCo does not support contacts of a shape."""
    return f"the enclosing {piece.shape} has no volume" if isinstance(piece, Primitive) else "the collision mesh is flat"
