"""A file of a robot -> the files of a workspace, and what is wrong with it."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace

from thingc.diagnostics import Code, Report
from thingc.frozen import dataclass
from thingc.importing.document import Draft, document_of
from thingc.importing.inertias import Repair, Repaired, repaired, warn_of_mirror_pairs
from thingc.importing.meshes import gathered
from thingc.importing.model import SourceLoss, SourceRobot
from thingc.importing.packages import Packages
from thingc.importing.urdf import read_urdf
from thingc.importing.xml_source import MOST_BYTES
from thingc.inertia import MassProperties
from thingc.typos import did_you_mean

READERS = {".urdf": read_urdf}
RECORD = "import.json"


@dataclass(frozen=True, slots=True, kw_only=True)
class Imported:
    """A robot that was read, and the `files` of its workspace by their path in it."""

    name: str
    robot: SourceRobot
    files: Mapping[str, bytes]
    losses: tuple[SourceLoss, ...]
    renamed: Mapping[str, str]
    repaired: tuple[Repaired, ...]


def import_robot(
    path: str, report: Report, *, roots: Sequence[str] = (), repair: Repair | None = None, packages: Mapping[str, str] | None = None,
    meshes: bool = True,
) -> Imported | None:
    """Read the file at `path`, and write down what it says; `roots` are links of it, each of which gets a mode, and `repair` says what to
    do about links that cannot move. `packages` are folders of packages by name; without `meshes` these are left out. None where it cannot
    be, which has been reported."""
    reader = READERS.get(os.path.splitext(path)[1].lower())
    if reader is None:
        known = ", ".join(f"`{one}`" for one in READERS)
        help = f"`xacro {path} > robot.urdf` makes one of it" if path.endswith(".xacro") else None
        report.add(Code.COMMAND_LINE, f"`{os.path.basename(path)}` is of no kind that is read: {known}", None, help=help)
        return None
    try:
        with open(path, "rb") as stream:
            data = stream.read(MOST_BYTES + 1)
    except OSError as fault:
        report.add(Code.COMMAND_LINE, f"cannot read `{path}`: {(fault.strerror or str(fault)).lower()}", None)
        return None
    path = os.path.abspath(path)
    robot = reader(path, data, report)
    if robot is None:
        return None
    links = [link.name for link in robot.links]
    for name in roots:
        if name not in links:
            report.add(Code.COMMAND_LINE, f"--root {name}: there is no such link", None, help=did_you_mean(name, links, what="links"))
    if report.failed:
        return None
    robot, mended = repaired(robot, roots, repair, report)
    if report.failed:
        return None
    warn_of_mirror_pairs(robot, report)
    found, files, left_out = gathered(robot, Packages(path, packages or {}, os.environ) if meshes else None, report)
    if report.failed:
        return None
    written = document_of(robot, list(dict.fromkeys(roots)), os.path.basename(path), {one.link.name: one.how for one in mended}, found)
    written = replace(written, losses=(*written.losses, *left_out))
    record = _record(robot, written, mended, path, data, files)
    renamed = {name: word for names in (written.links, written.frames, written.joints) for name, word in names.items() if name != word}
    return Imported(
        name=written.name, robot=robot, files={f"{written.name}.yaml": written.text.encode(), RECORD: record, **files},
        losses=written.losses, renamed=renamed, repaired=mended,
    )


def _record(robot: SourceRobot, written: Draft, mended: Sequence[Repaired], path: str, data: bytes, files: Mapping[str, bytes]) -> bytes:
    """`import.json`: what was read, what everything is called now, and what is not in the document, with its line in the source."""
    losses = [
        {"what": one.what, "why": one.why, "file": os.path.basename(one.where.file), "line": one.where.line} for one in written.losses
    ]
    document = {
        "import": 1,
        "source": {"file": os.path.basename(path), "sha256": hashlib.sha256(data).hexdigest(), "robot": robot.name},
        "document": {"file": f"{written.name}.yaml", "sha256": hashlib.sha256(written.text.encode()).hexdigest()},
        "meshes": {name: hashlib.sha256(content).hexdigest() for name, content in files.items()},
        "names": {"links": written.links, "frames": written.frames, "joints": written.joints},
        "repaired": [
            {
                "link": one.link.name, "how": one.how, "old": _weight(one.link.weight.properties if one.link.weight is not None else None),
                "new": _weight(one.new), "file": os.path.basename(path), "line": one.link.where.line,
            }
            for one in mended
        ],
        "losses": losses,
    }
    return (json.dumps(document, indent=2, ensure_ascii=False) + "\n").encode()


def _weight(of: MassProperties | None) -> dict[str, object] | None:
    return None if of is None else {"mass": of.mass, "com": of.centre, "inertia": of.inertia}
