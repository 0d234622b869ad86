"""Update an imported robot: merge changes in the source with the user's edits since the last import."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from typing import Any, get_args

from msgspec.structs import replace

from thingc.base.diagnostics import Code, Report, shown_path
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.replacement import Change
from thingc.base.source import format_path, span_at
from thingc.tools.importing.import_request import Repair
from thingc.tools.importing.three_way_merge import Merge, MergeConflict, Merged, Text, read_text

RECORD = "import.json"


class PreviousImport(FrozenStruct):
    """The previous import of the robot `robot` from the file `source`. `folder` is the absolute path of the import folder.

    `document` is the file name of the document, and `text` is the content that the import wrote. `meshes` maps mesh files to SHA-256
    hashes. `links` and `joints` map names in the source to names in the document. `roots`, `repair` and `keep` are the options of the
    import.
    """

    folder: str
    source: str
    robot: str
    document: str
    text: str
    meshes: Mapping[str, str]
    links: Mapping[str, str]
    joints: Mapping[str, str]
    roots: tuple[str, ...]
    repair: Repair | None
    with_meshes: bool
    keep: bool

    def edited_files(self) -> tuple[str, ...]:
        """Return the names of the files that the user has changed since the import. Deleted files are omitted."""
        written = {self.document: _sha256(self.text.encode()), **self.meshes}
        return tuple(name for name, sha256 in written.items() if (data := self.read(name)) is not None and _sha256(data) != sha256)

    def read(self, name: str) -> bytes | None:
        """Return the content of a file in the import folder, or None if the file does not exist."""
        try:
            with open(os.path.join(self.folder, name), "rb") as stream:
                return stream.read()
        except OSError:
            return None


class Update(FrozenStruct):
    """The files to write when an imported robot is updated, the merged document, and the files that the user has edited.

    The files are keyed by absolute path. The order of the keys is the order in which the files are written.
    """

    changes: Mapping[str, Change]
    merged: Merged
    kept: tuple[str, ...]


def earlier_import(folder: str) -> PreviousImport | None:
    """Return the previous import in a folder. Return None if the file `import.json` is missing or invalid."""
    folder = os.path.realpath(folder)
    try:
        with open(os.path.join(folder, RECORD), "rb") as stream:
            record: Any = json.load(stream)
        document, options, names, source = record["document"], record["asked"], record["names"], record["source"]
        text = "".join(f"{line}\n" for line in document["lines"])
        earlier = PreviousImport(
            folder=folder, source=str(source["file"]), robot=str(source["robot"]), document=_inside(document["file"]), text=text,
            roots=tuple(options["roots"]), repair=options["repair"] if options["repair"] in get_args(Repair) else None,
            meshes={_inside(name): str(sha256) for name, sha256 in record["meshes"].items()}, with_meshes=bool(options["meshes"]),
            links={**names["links"], **names["frames"]}, joints={**names["joints"]},
            keep=bool(options.get("keep")),
        )
        return earlier if document["sha256"] == _sha256(text.encode()) else None
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return None


def update(earlier: PreviousImport, document: str, files: Mapping[str, bytes], report: Report) -> Update | None:
    """Update a previous import with the `files` of a new import. These files include the document.

    The new document is merged with the user's edits. For conflicting values, report the conflict and use the user's value. If the document
    cannot be merged, report an error and return None. If the user has deleted the document, the new document is written.
    """
    path = os.path.join(earlier.folder, document)
    new = files[document].decode()
    try:
        with open(path, "rb") as stream:
            old_content: bytes | None = stream.read()
        ours = (old_content or b"").decode("utf-8-sig")
    except FileNotFoundError:
        old_content, ours = None, earlier.text
    except (OSError, UnicodeDecodeError):
        report.add(Code.OUTPUT, f"cannot read the imported file `{shown_path(path)}`", None, help="fix or delete the file")
        return None
    texts = [text for one in (earlier.text, new, ours) if (text := read_text(path, one, report)) is not None]
    if len(texts) < 3:
        return None
    try:
        one = Merge(*texts).merge()
        if ours == earlier.text:  # the comments in the new document may have changed, too
            one = replace(one, text=new)
    except MergeConflict as fault:
        report.add(Code.SOURCE_CONFLICT, f"the changes cannot be merged: {fault}", None, help="write the value without anchors or aliases")
        return None
    _say_conflicts(one, read_text(path, one.text, Report()) or texts[2], report)
    written = _changed_meshes(earlier, {name: data for name, data in files.items() if name not in (document, RECORD)}, report)
    written[document] = old_content, one.text.encode()
    written[RECORD] = earlier.read(RECORD), files[RECORD]
    for name, before in earlier.meshes.items():
        there = earlier.read(name)
        if there is not None and _sha256(there) == before and name not in files and name not in one.text:
            written[name] = there, None
    return Update(
        changes={os.path.join(earlier.folder, name): change for name, change in written.items() if change[0] != change[1]}, merged=one,
        kept=tuple(name for name in earlier.edited_files() if name != earlier.document),
    )


def _changed_meshes(earlier: PreviousImport, meshes: Mapping[str, bytes], report: Report) -> dict[str, Change]:
    """Return the old and the new content of each mesh file that changed in the source. Report files that the user has changed, too."""
    written: dict[str, Change] = {}
    for name, content in meshes.items():
        there = earlier.read(name)
        now, before, after = None if there is None else _sha256(there), earlier.meshes.get(name), _sha256(content)
        if now == after:
            continue
        if now is None or now == before:
            written[name] = there, content
        elif after != before:
            help = "delete the file and import again to use the version of the source"
            report.add(Code.SOURCE_CONFLICT, f"`{name}` has changed in the folder and in the source", None, help=help)
    return written


def _say_conflicts(one: Merged, after: Text, report: Report) -> None:
    for path, ours, new in one.conflicts:
        message = f"`{format_path(path)}` is {ours} in the document and {new} in the source"
        report.add(Code.SOURCE_CONFLICT, message, span_at(after.tree, path), help="write the correct value in the document")


def _inside(name: str) -> str:
    """Check that a path in the file `import.json` is inside the import folder, because the file may have been edited.

    Raises `ValueError` if the path is outside.
    """
    parts = str(name).split("/")
    if len(parts) > 2 or any(part in ("", ".", "..") or "\\" in part or "\0" in part for part in parts):
        raise ValueError(name)
    return name


def _sha256(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()
