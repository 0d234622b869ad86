"""Copy the mesh files of an imported robot to the folder `meshes/`. Meshes with equal content become one file with the original name."""

from __future__ import annotations

import contextlib
import hashlib
import math
import os
import re
import struct
from collections.abc import Callable, Mapping

from thingc.base.diagnostics import Code, Report
from thingc.base.filesystem import beginning
from thingc.base.inertia import MassProperties
from thingc.base.numeric import dist
from thingc.documents.load.paths import libraries
from thingc.geometry.mesh_bounds import BadMesh, check_mesh_file
from thingc.geometry.meshes.cache import mesh_record
from thingc.geometry.meshes.files import mesh_file
from thingc.tools.importing.document_names import UsedNames
from thingc.tools.importing.packages import MOST_BYTES, NotFound, Packages
from thingc.tools.importing.source_model import SourceLoss, SourceRobot, SourceShape
from thingc.tools.importing.xml_source import Losses

READ = (".stl", ".obj", ".dae", ".ply", ".glb")
FOLDER = "meshes"
SUSPECT, LARGE = 100.0, 5.0
"""A mesh that exceeds both thresholds is probably in millimetres.

The thresholds are a multiple of the largest distance between joints, and a size [m].
"""
SAMPLE = 1000
"""Maximum number of triangles that are read to determine the size of a mesh."""


def matter_of(packages: Packages) -> Callable[[SourceShape], MassProperties | None]:
    """Return a function that computes the mass properties of the mesh of a shape, in metres and at density 1.

    The returned function returns None for a mesh that is not closed or cannot be read. The function also caches the mesh for the first
    build.
    """

    def matter(shape: SourceShape) -> MassProperties | None:
        from thingc.geometry.store.shared_store import open_store

        try:
            path, (x, y, z) = packages.find(shape.mesh or ""), shape.size
            record = mesh_record(mesh_file(path, f"{FOLDER}/{os.path.basename(path)}", (x, y, z)), open_store(None))
        except (NotFound, OSError, BadMesh):
            return None
        return None if record is None else record.matter

    return matter


def warn_of_units(robot: SourceRobot, files: Mapping[str, bytes], paths: Mapping[str, str], report: Report) -> None:
    """Warn if a mesh is probably in millimetres instead of metres, because the mesh is much larger than the distances between joints.

    Only the first such mesh is reported. `files` maps file paths to contents, and `paths` maps the mesh URIs of the source to file paths.
    """
    reach = max((dist(one.pose.translation, (0.0, 0.0, 0.0)) for one in robot.attachments), default=0.0)
    for shape in (shape for link in robot.links for shape in link.shapes if shape.mesh in paths):
        size = _corner(files.get(paths[shape.mesh or ""], b""), paths[shape.mesh or ""]) * max(map(abs, shape.size))
        if size > LARGE and size > SUSPECT * reach > 0.0:
            report.warn(
                Code.SOURCE_DOUBT,
                f"the size of `{shape.mesh}` ({size:.3g} m) is implausible for joints at distances of at most {reach:.3g} m",
                shape.where, help='for a mesh in millimetres, write scale="0.001 0.001 0.001"',
            )
            return


def _corner(data: bytes, path: str) -> float:
    """Return the largest absolute coordinate of the vertices at the beginning of an STL or OBJ file, or 0 for other formats."""
    numbers: list[float] = []
    if path.endswith(".stl") and not data[:SAMPLE].lstrip().startswith(b"solid"):
        facet_count = (len(data) - 84) // 50
        numbers = [abs(one) for k in range(min(facet_count, SAMPLE)) for one in struct.unpack_from("<9f", data, 84 + 50 * k + 12)]
    elif path.endswith((".stl", ".obj")):
        corners = re.findall(rb"^\s*(?:v|vertex)\s+(\S+)\s+(\S+)\s+(\S+)", data[: 100 * SAMPLE], re.MULTILINE)
        with contextlib.suppress(ValueError):
            numbers = [abs(float(one)) for corner in corners for one in corner]
    return max((one for one in numbers if math.isfinite(one)), default=0.0)


def _stem(uri: str) -> str:
    """Return the original name of a mesh that thingc wrote: `meshes.trunk-5fb32a19.stl.obj` becomes `meshes/trunk.stl`."""
    stem = os.path.splitext(os.path.basename(uri))[0]
    while os.path.splitext(stem)[1].lower() in READ:
        stem = os.path.splitext(stem)[0]
    own = stem.removeprefix(f"{FOLDER}.")
    return own if own == stem else re.sub(r"-[0-9a-f]{8}$", "", own)


def read_meshes(
    robot: SourceRobot, packages: Packages | None, report: Report,
) -> tuple[Mapping[str, str], dict[str, bytes], tuple[SourceLoss, ...]]:
    """Read the meshes of an imported robot.

    Return the paths in the workspace keyed by URI, the file contents keyed by path, and the import losses. A missing mesh is reported only
    for the first shape that uses the mesh. If `packages` is None, no mesh is read, and each mesh is recorded as a loss.
    """
    named = [(shape.mesh, shape) for link in robot.links for shape in link.shapes if shape.mesh is not None]
    losses = Losses()
    if packages is None:
        for uri, shape in named:
            losses.note(f"mesh `{uri}`", "meshes are omitted", shape.where)
        return {}, {}, losses.all()
    contents: dict[str, bytes] = {}
    first_places = dict(reversed(named))
    for uri in dict.fromkeys(uri for uri, _ in named):
        shape = first_places[uri]
        if uri in robot.files:
            contents[uri] = robot.files[uri]
            continue
        try:
            if os.path.splitext(uri)[1].lower() not in READ:
                raise NotFound(f"`{uri}` is not a supported mesh: {', '.join(f'`{one}`' for one in READ)}", "use `--no-meshes`")
            contents[uri] = packages.read(uri)[1]
            check_mesh_file(os.path.splitext(uri)[1].lower(), contents[uri])
        except BadMesh as fault:
            report.add(Code.SOURCE_FILE, f"`{uri}` {fault}", shape.where, help="export the mesh again, or use `--no-meshes`")
        except NotFound as fault:
            report.add(Code.SOURCE_FILE, str(fault), shape.where, help=fault.help)
    digests = {uri: hashlib.sha256(content).hexdigest() for uri, content in contents.items()}
    first = {digest: uri for uri, digest in reversed(digests.items())}
    uris = list(dict.fromkeys(first[digest] for digest in digests.values()))
    used = UsedNames()  # meshes in different folders can have the same name
    names = {uri: f"{used.take(_stem(uri), 'mesh')}{os.path.splitext(uri)[1].lower()}" for uri in uris}
    paths = {uri: f"{FOLDER}/{names[first[digest]]}" for uri, digest in digests.items()}
    files = {paths[uri]: contents[uri] for uri in uris}
    for uri in (uri for uri in uris if uri not in robot.files):
        _copy_libraries(uri, first_places[uri], packages, files, losses)
    return paths, files, losses.all()


def _copy_libraries(uri: str, shape: SourceShape, packages: Packages, files: dict[str, bytes], losses: Losses) -> None:
    """Copy the material files (`.mtl`) that an OBJ mesh refers to.

    The names of the material files do not change. Other files that the mesh refers to are recorded in `losses`.
    """
    for name in libraries(packages.find(uri)):
        path = f"{FOLDER}/{name}"
        try:
            content = beginning(packages.find(f"{uri[: -len(os.path.basename(uri))]}{name}"), MOST_BYTES)
        except (NotFound, OSError):
            losses.note(f"the colours of mesh `{uri}`", f"`{name}` cannot be read", shape.where)
            continue
        if files.setdefault(path, content) != content:
            losses.note(f"the colours of mesh `{uri}`", f"another mesh has a different `{name}`", shape.where)
