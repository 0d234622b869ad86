"""Import robots without diagnostics, and write the files of an import."""

from __future__ import annotations

from pathlib import Path

from thingc.base.diagnostics import Report
from thingc.tools.importing.import_request import PLAIN, ImportRequest
from thingc.tools.importing.importing import Imported, import_robot


def import_cleanly(source: Path, request: ImportRequest = PLAIN) -> Imported:
    """Import a robot, and check that there are no diagnostics."""
    report = Report()
    imported = import_robot(str(source), report, request)
    assert imported is not None and report.diagnostics == [], [one.message for one in report.diagnostics]
    return imported


def write_import(imported: Imported, folder: Path) -> Path:
    """Write the files of an import into a folder, and return the path of the document."""
    for name, content in imported.files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    return folder / imported.document
