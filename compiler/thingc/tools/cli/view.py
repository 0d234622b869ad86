"""Implementation of `thingc view`, which shows a robot in the browser and updates the page after every save.

Serves the page on this machine only, under a secret address, and opens it in a browser. The page updates after every save and shows the
diagnostics of `thingc check`. Nothing is written. An existing build folder with html/, or its page, is opened without a server.

  thingc view assemblies/arm.yaml
  thingc view assemblies/arm.yaml --mode bench --no-open
  thingc view assemblies/arm.yaml --against assemblies/arm.yaml      show the effect of an edit
  thingc view robot.urdf                                             a robot file of another format
  thingc view build/arm
"""

from __future__ import annotations

import argparse
import os
import secrets
import sys
import threading
import webbrowser
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path
from urllib.parse import quote

from msgspec.structs import replace

from thingc.base.diagnostics import Code, Diagnostic, Report, shown_path
from thingc.base.suggestions import did_you_mean
from thingc.documents.load.discovery import documents_near, is_document
from thingc.documents.workspace import Workspace
from thingc.driver import pipeline
from thingc.driver.build_document import BuildRequest
from thingc.driver.environment import Environment, Options, with_environment
from thingc.geometry.store.local import cache_root
from thingc.targets.artifact import MANIFEST
from thingc.targets.html.emit import Page, page_of
from thingc.tools.cli import console, robot_files
from thingc.tools.cli.watch import Lines, hopeless, until_interrupted
from thingc.tools.importing.import_request import select_robot_files
from thingc.tools.live.rebuild_loop import Rebuild, RebuildLoop
from thingc.tools.live.server import Server, findings_of

EDITOR = "vscode://file{file}:{line}"

KEY = 32
"""Length [bytes] of the secret key from which the URL of a document's page is derived."""

OF_DOCUMENTS = {
    "mode": "--mode", "against": "--against", "port": "--port", "editor": "--editor", "parameter": "-p", "choice": "--set",
    "strict": "--strict", "store": "--store", "jobs": "--jobs", "part_timeout": "--part-timeout",
}
"""Options that have no effect on an existing build, keyed by the attribute of the parsed arguments."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options of `thingc view` to the parser."""
    console.add_document(parser, metavar="DOC|BUILD", what="document, robot file, build folder or viewer page")
    robot_files.configure(parser)
    parser.add_argument("--mode", metavar="M", action="append", default=[], help="mode to show (may be repeated; default: all modes)")
    parser.add_argument("--against", metavar="DOC", help="document of a second robot to show transparently")
    port = console.number_in(1, 65535, "a port from 1 to 65535", console.whole)
    parser.add_argument("--port", metavar="N", type=port, default=0, help="port of the server (default: a free port)")
    parser.add_argument("--no-open", action="store_true", help="print the address of the page without opening a browser")
    parser.add_argument("--editor", metavar="URL", default=EDITOR, help="URL template of links to source files (default: %(default)s)")
    console.add_compiling(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run `thingc view`, and return the exit code: 0 after Ctrl-C or after opening an existing build, 2 if there is nothing to show."""
    if os.path.isdir(arguments.document) or _is_page(arguments.document):
        return _open_build(arguments)
    options = console.options_of(arguments)
    if select_robot_files([arguments.document]):
        if arguments.against is not None:
            raise console.WrongCommandLine("--against is only supported for documents", "import the robot, and view the document")
        from thingc.tools.cli.view_robot_file import view_robot_file

        return view_robot_file(arguments, options, _server(arguments))
    console.require_document(arguments.document)
    before, has_second, turn = None, False, threading.Lock()
    plain = replace(options, parameters={}, choices={})
    if arguments.against is not None:
        console.require_document(arguments.against)
        has_second = not os.path.samefile(arguments.against, arguments.document)
        if not has_second:
            before, diagnostics = with_environment(arguments.against, plain, _page)
            if before is None:
                return console.print_text(diagnostics, stream=sys.stderr, debug=arguments.debug)
    wish = BuildRequest(targets=(), modes=arguments.mode, strict=arguments.strict)
    live = RebuildLoop(arguments.document, options, lambda: wish, console.of_exception, writes=False, turn=turn)
    server = _server(arguments)
    if before is not None:
        server.tell_against(before)
    lines = Lines(arguments, "showing")

    def hear(rebuild: Rebuild) -> None:
        with turn:
            rebuild, page, diagnostics = _rebuild_result(live, rebuild)
        server.tell(page, rebuild.seconds, diagnostics, kernel=rebuild.kernel)
        lines.say(rebuild)
        if rebuild.number == 1 and not hopeless(rebuild):
            console.show_page(server.address, browser=not arguments.no_open)

    with server, _overlay(arguments, plain, turn, server) if has_second else nullcontext():
        return until_interrupted(live, hear)


def _rebuild_result(live: RebuildLoop, rebuild: Rebuild) -> tuple[Rebuild, Page | None, list[dict[str, object]]]:
    """Return the result of a rebuild, the page that shows the robot (None after errors), and the diagnostics for the page."""
    environment = live.environment
    assert environment is not None
    page = None
    if rebuild.good and rebuild.built is not None:
        try:
            page = page_of(pipeline.request_of(environment, rebuild.built.compilation))
        except Exception as fault:  # the next save may fix the error
            rebuild = replace(rebuild, good=False, diagnostics=(*rebuild.diagnostics, console.of_exception(fault)))
    return rebuild, page, findings_of(rebuild.diagnostics, environment.workspace)


@contextmanager
def _overlay(arguments: argparse.Namespace, options: Options, turn: threading.Lock, server: Server) -> Iterator[None]:
    """A context manager that sends the second document, which is shown over the first document, to the server after every rebuild.

    A thread watches this document, and acquires the lock `turn` to compile it.
    """
    wish = BuildRequest(targets=(), strict=arguments.strict)
    live = RebuildLoop(arguments.against, options, lambda: wish, console.of_exception, writes=False, turn=turn)
    lines, stop = Lines(arguments, of=shown_path(arguments.against)), threading.Event()

    def follow() -> None:
        for rebuild in live.rounds(stop):
            if stop.is_set():
                return
            with turn:
                rebuild, page, diagnostics = _rebuild_result(live, rebuild)
            server.tell_against(page, diagnostics)
            lines.say(rebuild)

    thread = threading.Thread(target=follow, daemon=True)
    with live:
        thread.start()
        try:
            yield
        finally:
            stop.set()
    thread.join(1.0)


def _page(environment: Environment) -> tuple[Page | None, list[Diagnostic]]:
    """Compile a document. Return the page that shows the robot (None after errors), and the diagnostics."""
    compilation = pipeline.compile(environment)
    diagnostics = console.final(compilation.report, strict=False)
    return None if compilation.report.failed else page_of(pipeline.request_of(environment, compilation)), diagnostics


def _server(arguments: argparse.Namespace) -> Server:
    workspace = Workspace.find(arguments.document, Report())
    root = workspace.root if workspace is not None else os.path.dirname(os.path.abspath(arguments.document))
    try:
        return Server(arguments.port, arguments.editor.replace("{file}", f"{quote(root)}/{{file}}"), arguments.document, _key())
    except OSError as fault:
        reason = fault.strerror or str(fault)
        raise console.WrongCommandLine(f"cannot use port {arguments.port}: {reason}", "omit --port to use a free port") from fault


def _key() -> bytes | None:
    """Return the secret key of this user: random bytes that are stored in a private file. Return None if the key cannot be stored."""
    path = os.path.join(cache_root(), "view.key")
    try:
        os.makedirs(os.path.dirname(path), mode=0o700, exist_ok=True)
        with suppress(FileExistsError), open(path, "xb", opener=lambda name, flags: os.open(name, flags, 0o600)) as stream:
            stream.write(secrets.token_bytes(KEY))
        with open(path, "rb") as stream:
            state = os.fstat(stream.fileno())
            key = stream.read(KEY)
    except OSError:
        return None
    others = os.name == "posix" and (state.st_uid != os.getuid() or state.st_mode & 0o077)
    return key if len(key) == KEY and not others else None


def _open_build(arguments: argparse.Namespace) -> int:
    """Open the page of an existing build in the browser. A given folder must contain exactly one build.

    Raises `WrongCommandLine` if no build exists, or if an option has no effect.
    """
    folder = Path(arguments.document) if _is_page(arguments.document) else _build_meant(arguments.document)
    pages = [folder] if folder.is_file() else sorted(folder.glob("html/*.html"))
    if not pages:
        message = f"the build `{shown_path(str(folder))}` has no HTML page"
        raise console.WrongCommandLine(message, "build the robot with `--emit html`, or view the document", Code.NO_DOCUMENT)
    unsupported = [name for key, name in OF_DOCUMENTS.items() if getattr(arguments, key) not in ([], 0, None, False, EDITOR)]
    if unsupported:
        message = f"{unsupported[0]} cannot be used with the build folder `{shown_path(str(folder))}`"
        raise console.WrongCommandLine(message, "view the document, or omit the option")
    for page in pages:
        console.say(shown_path(str(page)))
        if not arguments.no_open:
            webbrowser.open(page.resolve().as_uri())
    return 0


def _is_page(name: str) -> bool:
    """Return whether an HTML file is the page of a build, or a copy of such a page."""
    return name.lower().endswith(".html") and os.path.isfile(name)


def _build_meant(name: str) -> Path:
    """Return the folder `name` if it is a build folder, or else the only build folder inside.

    Raises `WrongCommandLine` unless exactly one build folder exists.
    """
    folder = Path(name)
    if (folder / MANIFEST).is_file():
        return folder
    builds = [path.parent for path in sorted(folder.glob(f"*/{MANIFEST}"))]
    builds = [one for one in builds if any(one.glob("html/*.html"))] or builds
    if len(builds) == 1:
        return builds[0]
    if builds:
        hint = did_you_mean("", [shown_path(str(one)) for one in builds], what="builds")
        raise console.WrongCommandLine(f"`{name}` contains {len(builds)} builds", f"use one of the builds: {hint}", Code.NO_DOCUMENT)
    robots = [shown_path(path) for path in documents_near(name, None) if is_document(path, "assembly/")]
    hint = did_you_mean("", robots, what="robots") if robots else "view a document, or a build folder with html/"
    raise console.WrongCommandLine(f"there is no build in the folder `{name}`", hint, Code.NO_DOCUMENT)
