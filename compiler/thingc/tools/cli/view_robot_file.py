"""Show a robot file of another format in the browser, and update the page after every save of the file."""

from __future__ import annotations

import argparse
import json
import sys
import threading
import time
from contextlib import suppress
from typing import Any

from thingc.base.diagnostics import Diagnostic, Report
from thingc.base.safe_text import in_script
from thingc.base.source import Document, Span
from thingc.documents.workspace import Workspace
from thingc.driver import pipeline
from thingc.driver.environment import Environment, Options
from thingc.targets.html.emit import Page, page_of
from thingc.tools.cli import console, robot_files, signals
from thingc.tools.importing.import_request import ImportRequest
from thingc.tools.importing.imported_document import ImportedDocument, imported_document
from thingc.tools.live.file_watcher import FileWatcher, looks
from thingc.tools.live.rebuild_loop import PAUSE, QUIET
from thingc.tools.live.server import Server, findings_of


def view_robot_file(arguments: argparse.Namespace, options: Options, server: Server) -> int:
    """Serve the page of a robot file until Ctrl-C. Return the exit code, which is 2 if the file cannot be opened."""
    source, path = robot_files.import_request(arguments), arguments.document
    watched = FileWatcher(path)
    signals.install_handlers(ignored=True)
    first = True
    with server, suppress(KeyboardInterrupt):
        for saved in looks(watched.take_changes, threading.Event(), PAUSE):
            if not (saved or first):
                continue
            time.sleep(0.0 if first else QUIET)
            started = time.perf_counter()
            page, diagnostics, files = _page(path, options, source, arguments.mode, strict=arguments.strict)
            watched.note(files)
            server.tell(page, time.perf_counter() - started, findings_of(diagnostics, Workspace.find(path, Report())))
            code = console.print_text(diagnostics, stream=sys.stderr, debug=arguments.debug)
            if first and code == console.USAGE:
                return code
            if first:
                console.say("showing; press Ctrl-C to stop", stream=sys.stderr)
                console.show_page(server.address, browser=not arguments.no_open)
            first = False
    return 0


def _page(
    path: str, options: Options, source: ImportRequest, modes: list[str], *, strict: bool
) -> tuple[Page | None, list[Diagnostic], set[str]]:
    """Import and compile a robot file. Return its page (None after errors), the diagnostics, and the files that the robot consists of."""
    report, page, files = Report(), None, set[str]()
    with imported_document(path, options, report, source) as document:
        if document is not None:
            files = {where.file for where in document.imported.places.values()}
            with Environment(document.path, document.options) as environment:
                compilation = pipeline.compile(environment, modes)
                document.report_at_source(compilation, report)
                if not report.failed and compilation.documents is not None:
                    found = page_of(pipeline.request_of(environment, compilation))
                    page = _with_places(found, document, compilation.documents.root, Workspace.find(path, Report()))
    return page, console.final(report, strict=strict), files


def _with_places(page: Page, document: ImportedDocument, root: Document, workspace: Workspace | None) -> Page:
    """Replace the locations in the data of a page by locations in the source file."""

    def locate(value: Any) -> Any:
        if isinstance(value, list):
            return [locate(one) for one in value]
        if not isinstance(value, dict):
            return value
        found = {key: locate(one) for key, one in value.items()}
        if found.get("file") == root.relative and isinstance(found.get("line"), int):
            line = found["line"]
            column = len(text := root.line(line)) - len(text.lstrip()) + 1
            where = document.source_span(Span(file=document.path, line=line, column=column, end_line=line, end_column=column), root)
            if where is not None and workspace is not None:
                found |= {"file": workspace.relative(where.file), "line": where.line}
        return found

    return Page(name=page.name, data=in_script(locate(json.loads(page.data))), glb=page.glb)
