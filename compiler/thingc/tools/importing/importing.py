"""Import a robot from a file in another format.

The import creates the files of a workspace, and reports errors and information that was lost.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Mapping

from msgspec.structs import replace

from thingc.base.diagnostics import Code, Diagnostic, Report, Severity
from thingc.base.filesystem import beginning
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.inertia import HEAVIEST, LARGEST_MOMENT, MassProperties
from thingc.base.primitives import FARTHEST
from thingc.base.safe_text import escape_control
from thingc.base.source import Path, Span
from thingc.base.suggestions import did_you_mean
from thingc.tools.importing.document_names import plain_name
from thingc.tools.importing.import_request import ENDINGS, PLAIN, ImportRequest, refuse_unreadable
from thingc.tools.importing.inertias import RepairedLink, repair_inertias, warn_of_mirror_pairs
from thingc.tools.importing.meshes import matter_of, read_meshes, warn_of_units
from thingc.tools.importing.mjcf.reader import read_mjcf
from thingc.tools.importing.packages import Packages
from thingc.tools.importing.quantities import dimensions_of
from thingc.tools.importing.sdf import read_sdf
from thingc.tools.importing.source_model import SourceLoss, SourceRobot
from thingc.tools.importing.tree import warn_of_depth
from thingc.tools.importing.update_import import RECORD, PreviousImport
from thingc.tools.importing.urdf import expand_xacro, read_urdf
from thingc.tools.importing.write_document import DocumentWriter
from thingc.tools.importing.xml_source import FORMATS, MOST_BYTES, read_xml

_METRES = "check the unit: lengths are in metres"


def refuse_endless(robot: SourceRobot, report: Report) -> None:
    """Report an error for each mass that is not finite, and for each size, distance or mass that is so large that computations overflow."""
    for link in robot.links:
        sizes = {one.where: (one.kind, max(map(abs, dimensions_of(one.kind, one.size)))) for one in link.shapes if one.kind != "mesh"}
        far = {where: shape for where, shape in sizes.items() if not shape[1] <= FARTHEST}
        for where, (kind, size) in far.items():
            message = f"the size of the {kind} ({size:.3g} m) exceeds the maximum ({FARTHEST:g} m)"
            report.add(Code.SOURCE_VALUE, message, where, help=_METRES)
        if link.weight is None or far:
            continue
        of, where = link.weight.properties, link.weight.where
        if not all(map(math.isfinite, (of.mass, *of.centre, *sum(of.inertia, ())))):
            message = f"the mass or the inertia of link `{link.name}` is not finite"
            report.add(Code.SOURCE_VALUE, message, where, help="check the sizes and densities of the shapes of the link")
        elif of.mass > HEAVIEST:
            message = f"the mass of link `{link.name}` ({of.mass:.3g} kg) exceeds the maximum ({HEAVIEST:g} kg)"
            report.add(Code.SOURCE_VALUE, message, where, help="check the unit: masses are in kilograms")
        elif (most := max(map(abs, sum(of.inertia, ())))) > LARGEST_MOMENT:
            message = f"the inertia of link `{link.name}` ({most:.3g} kg m^2) exceeds the maximum ({LARGEST_MOMENT:g} kg m^2)"
            report.add(Code.SOURCE_VALUE, message, where, help="check the units: masses are in kilograms, and lengths in metres")
        elif (most := max(map(abs, of.centre))) > FARTHEST:
            message = f"the distance of the centre of mass from link `{link.name}` ({most:.3g} m) exceeds the maximum ({FARTHEST:g} m)"
            report.add(Code.SOURCE_VALUE, message, where, help=_METRES)
    for one in robot.attachments:
        if (most := max(map(abs, one.pose.translation))) > FARTHEST:
            message = f"the distance of link `{one.child}` from the parent ({most:.3g} m) exceeds the maximum ({FARTHEST:g} m)"
            report.add(Code.SOURCE_VALUE, message, one.where, help=_METRES)


class Imported(FrozenStruct):
    """An imported robot, and the contents of the workspace files that the import writes.

    `files` maps paths to contents. `document` is the path of the generated document, and `places` maps its key paths to the source.
    `earlier` is the previous import, if any.
    """

    name: str
    document: str
    robot: SourceRobot
    files: Mapping[str, bytes]
    losses: tuple[SourceLoss, ...]
    renamed: Mapping[str, str]
    repaired: tuple[RepairedLink, ...]
    places: Mapping[Path, Span]
    earlier: PreviousImport | None = None

    def notes(self) -> list[Diagnostic]:
        """Return a note about each repaired link and each loss, at its location in the source file."""
        repairs = ((one.link, f"repaired: mass and inertia of `{one.link.name}` ({one.how})") for one in self.repaired)
        found = [(Code.SOURCE_INERTIA, link.where, message) for link, message in repairs]
        found += [(Code.SOURCE_LOSS, one.where, f"lost: {one.what}: {one.why}") for one in self.losses]
        return [Diagnostic(code=code, severity=Severity.NOTE, message=message, span=where) for code, where, message in found]


def import_robot(path: str, report: Report, request: ImportRequest = PLAIN) -> Imported | None:
    """Import the robot in the file `path`. If the file has errors, add the errors to `report` and return None."""
    data = _content(path, report)
    path = os.path.abspath(path)
    places = Packages(path, request.packages, os.environ, request.mesh_roots)
    robot = None if data is None else _load_source(path, data, request, places, report)
    if data is None or robot is None:
        return None
    refuse_endless(robot, report)
    name = plain_name(robot.name, "robot")
    earlier = request.earlier(name)
    links = [link.name for link in robot.links]
    for link in (one for one in request.roots if one not in links):
        report.add(Code.COMMAND_LINE, f"--root: there is no link `{link}`", None, help=did_you_mean(link, links, what="links"))
    roots, repair, meshes, keep = request.roots, request.repair, request.meshes, request.keeps(name)
    if request.update and earlier is not None:
        roots, repair = [*(name for name in earlier.roots if name in links), *roots], repair or earlier.repair
        meshes = meshes and earlier.with_meshes
    elif request.update:
        message = "--update: the folder does not contain a valid `import.json`"
        report.add(Code.COMMAND_LINE, message, None, help="specify the folder with -o, or import without --update")
    if report.failed:
        return None
    roots = list(dict.fromkeys(roots))
    places = Packages(path, request.packages, os.environ, request.mesh_roots, robot.mesh_folder)
    robot, repaired = repair_inertias(robot, roots, repair, report, matter_of(places) if meshes else lambda _: None)
    if report.failed:
        return None
    warn_of_mirror_pairs(robot, report)
    warn_of_depth(robot, report)
    placed_meshes, files, left_out = read_meshes(robot, places if meshes else None, report)
    warn_of_units(robot, files, placed_meshes, report)
    if report.failed:
        return None
    origin, hows = escape_control(os.path.basename(path)), {one.link.name: one.how for one in repaired}
    writer = DocumentWriter(robot, roots, origin, hows, placed_meshes, earlier, keep=keep)
    document, text = f"{writer.name}.yaml" if earlier is None else earlier.document, writer.text()
    names = {"links": writer.links, "frames": writer.frames, "joints": writer.joints}
    imported = Imported(
        name=writer.name, document=document, robot=robot, files={**files, document: text.encode()},
        losses=(*robot.losses, *left_out), repaired=repaired, places=writer.places, earlier=earlier,
        renamed={name: new_name for kind in names.values() for name, new_name in kind.items() if name != new_name},
    )
    options = {"roots": roots, "repair": repair, "meshes": meshes, **({"keep": True} if keep else {})}
    record = _record(imported, {**names, **writer.other_names}, options, path, data)
    return replace(imported, files={**imported.files, RECORD: record})


def _content(path: str, report: Report) -> bytes | None:
    """Return the content of a file. If the file cannot be read or has an unsupported suffix, report an error and return None."""
    if not path.lower().endswith(ENDINGS):
        known = ", ".join(f"`{ending}`" for ending in ENDINGS)
        problem = "a folder, not a file" if os.path.isdir(path) else "not of a supported format"
        report.add(Code.COMMAND_LINE, f"`{os.path.basename(os.path.abspath(path))}` is {problem}: {known}", None)
        return None
    try:
        return beginning(path, MOST_BYTES + 1)
    except OSError as fault:
        refuse_unreadable(path, fault, ENDINGS, report)
        return None


def _load_source(path: str, data: bytes, request: ImportRequest, packages: Packages, report: Report) -> SourceRobot | None:
    """Read the robot with the reader that supports the suffix of the file. A file with the suffix `.xml` can be MJCF, URDF or SDF."""
    suffix = os.path.splitext(path)[1].lower()
    if suffix == ".xacro":
        expanded = expand_xacro(path, request.arguments, packages.given, report)
        return None if expanded is None else read_urdf(path, expanded[0], report, files=expanded[1])
    if suffix == ".xml":
        root = read_xml(path, data, report, tags=FORMATS)
        if root is None or root.tag == "mujoco":
            return None if root is None else read_mjcf(root, packages, report, request)
        suffix = FORMATS[root.tag][1]
    return read_sdf(path, data, packages, report) if suffix == ".sdf" else read_urdf(path, data, report)


def _record(imported: Imported, names: Mapping[str, Mapping[str, str]], options: Mapping[str, object], path: str, data: bytes) -> bytes:
    """Return the JSON data of the file `import.json`, which describes an import.

    The next import of the same robot reads this file. The data contain the source, the options, the names, the repairs, the losses, and the
    generated document.
    """
    content = imported.files[imported.document]
    record = {
        "import": 1,
        "source": {"file": os.path.basename(path), "sha256": hashlib.sha256(data).hexdigest(), "robot": imported.robot.name},
        "asked": options,
        "meshes": {name: hashlib.sha256(content).hexdigest() for name, content in imported.files.items() if name != imported.document},
        "names": names,
        "repaired": [
            {
                "link": one.link.name, "how": one.how, "old": _weight(one.link.weight.properties if one.link.weight is not None else None),
                "new": _weight(one.new), "file": os.path.basename(path), "line": one.link.where.line,
            }
            for one in imported.repaired
        ],
        "losses": [
            {"what": one.what, "why": one.why, "file": os.path.basename(one.where.file), "line": one.where.line} for one in imported.losses
        ],
        "document": {
            "file": imported.document, "sha256": hashlib.sha256(content).hexdigest(), "lines": content.decode().splitlines(),
        },
    }
    return (json.dumps(record, indent=2, ensure_ascii=False) + "\n").encode()


def _weight(of: MassProperties | None) -> dict[str, object] | None:
    return None if of is None else {"mass": of.mass, "com": of.centre, "inertia": of.inertia}
