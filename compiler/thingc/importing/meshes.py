"""Meshes of a robot, gathered into `meshes/`: one file for each content, called as it was."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping

from thingc.diagnostics import Code, Report
from thingc.importing.model import SourceLoss, SourceRobot
from thingc.importing.naming import distinct
from thingc.importing.packages import NotFound, Packages

READ = (".stl", ".obj", ".dae", ".ply", ".glb", ".gltf")
FOLDER = "meshes"


def gathered(robot: SourceRobot, packages: Packages | None, report: Report) -> tuple[Mapping[str, str], dict[str, bytes], list[SourceLoss]]:
    """The path in the workspace of every mesh that shapes of the robot name, and the files by it. What cannot be found is reported at its
    first place; without `packages` all meshes are losses."""
    named = [(shape.mesh, shape) for link in robot.links for shape in link.shapes if shape.mesh is not None]
    if packages is None:
        return {}, {}, [SourceLoss(what=f"mesh `{uri}`", why="meshes are left out", where=shape.where) for uri, shape in named]
    contents: dict[str, bytes] = {}
    first_places = dict(reversed(named))
    for uri in dict.fromkeys(uri for uri, _ in named):
        shape = first_places[uri]
        try:
            if os.path.splitext(uri)[1].lower() not in READ:
                raise NotFound(f"`{uri}` is no mesh that is read: {', '.join(f'`{one}`' for one in READ)}", "`--no-meshes` leaves it out")
            with open(packages.find(uri), "rb") as stream:
                contents[uri] = stream.read()
        except NotFound as fault:
            report.add(Code.SOURCE_FILE, str(fault), shape.where, help=fault.help)
        except OSError as fault:
            report.add(Code.SOURCE_FILE, f"cannot read `{uri}`: {(fault.strerror or str(fault)).lower()}", shape.where)
    digests = {uri: hashlib.sha256(content).hexdigest() for uri, content in contents.items()}
    first = {digest: uri for uri, digest in reversed(digests.items())}
    uris = list(dict.fromkeys(first[digest] for digest in digests.values()))
    names: dict[str, str] = {}
    for uri in uris:  # meshes of one name, in two folders, are two
        stem, ending = os.path.splitext(os.path.basename(uri))
        taken = [os.path.splitext(name)[0] for name in names.values()]
        names[uri] = f"{distinct([stem], 'mesh', taken)[stem]}{ending.lower()}"
    paths = {uri: f"{FOLDER}/{names[first[digest]]}" for uri, digest in digests.items()}
    return paths, {paths[uri]: contents[uri] for uri in uris}, []
