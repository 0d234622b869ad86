"""`thingc view`: a robot in the browser, as its document stands after every save."""

from __future__ import annotations

import argparse
import os
import sys
import webbrowser
from dataclasses import replace
from pathlib import Path
from urllib.parse import quote

from thingc import pipeline
from thingc.building import Wish
from thingc.cli import common
from thingc.cli.watch import Lines, refused, until_interrupted
from thingc.diagnostics import Code, Diagnostic, shown_path
from thingc.emit import Page, page_of
from thingc.emit.artifact import MANIFEST
from thingc.environment import Environment, attempted
from thingc.live import Live, Round, Server, findings_of

EDITOR = "vscode://file{file}:{line}"

EPILOG = """\
Serves the page on this machine alone, under an address that nobody can guess, and shows it in a browser; every save is shown there in its
turn, with what `thingc check` says on top. Nothing is written. A build folder with a page is opened as it is.

  thingc view assemblies/arm.yaml
  thingc view assemblies/arm.yaml --mode bench --no-open
  thingc view assemblies/arm.yaml --against assemblies/arm.yaml      what an edit changes
  thingc view build/arm
"""


def configure(parser: argparse.ArgumentParser) -> None:
    """The options of `view`."""
    parser.epilog = EPILOG
    parser.add_argument("document", metavar="DOC|BUILD", help="an assembly document (YAML or TOML), or a build folder with html/")
    parser.add_argument("--mode", metavar="M", action="append", default=[], help="only this mode (may be repeated; default: all)")
    parser.add_argument("--against", metavar="DOC", help="a second document, or this one as it is now, to be seen through the robot")
    parser.add_argument("--port", metavar="N", type=_port, default=0, help="the port to listen on (default: a free one)")
    parser.add_argument("--no-open", action="store_true", help="only print the address")
    parser.add_argument(
        "--editor", metavar="URL", default=EDITOR,
        help="what links to documents and part files open, with {file} and {line} (default: %(default)s)",
    )
    common.add_compiling(parser)


def run(arguments: argparse.Namespace) -> int:
    """Exit code 0 after Ctrl-C, or when a build is opened; 2 where there is nothing to show."""
    try:
        if os.path.isdir(arguments.document):
            return _open_build(arguments)
        common.require_document(arguments.document)
        options = common.options_of(arguments)
        against = None
        if arguments.against is not None:
            common.require_document(arguments.against)
            against, found = attempted(arguments.against, replace(options, parameters={}, choices={}), _page)
            if against is None:
                common.print_text(found, stream=sys.stderr, debug=arguments.debug)
                return common.exit_code(found)
        live = Live(
            arguments.document, options, lambda: Wish(targets=(), modes=arguments.mode, strict=arguments.strict), refused, writes=False,
        )
        server = _server(arguments, against)
    except common.WrongCommandLine as fault:
        common.print_text([fault.diagnostic], stream=sys.stderr, debug=arguments.debug)
        return common.USAGE
    lines = Lines(arguments, "showing")

    def hear(made: Round) -> None:
        environment = live.environment
        assert environment is not None
        page = None
        if made.good and made.built is not None:
            try:
                page = page_of(pipeline.request_of(environment, made.built.compilation))
            except Exception as fault:  # the next save may mend it
                made = replace(made, good=False, diagnostics=(*made.diagnostics, refused(fault)))
        server.tell(page, made.seconds, findings_of(made.diagnostics, environment.workspace))
        lines.say(made)
        if made.number == 1 and common.exit_code(made.diagnostics) != common.USAGE:
            common.say(server.address)
            if not arguments.no_open:
                webbrowser.open(server.address)

    with server:
        return until_interrupted(live, hear)


def _page(environment: Environment) -> tuple[Page | None, list[Diagnostic]]:
    """The page of a document as it stands, None where it has errors; and what is said of it."""
    compilation = pipeline.compile(environment)
    found = common.final(compilation.report, strict=False)
    return None if compilation.report.failed else page_of(pipeline.request_of(environment, compilation)), found


def _server(arguments: argparse.Namespace, against: Page | None) -> Server:
    from thingc.diagnostics import Report
    from thingc.workspace import Workspace

    workspace = Workspace.find(arguments.document, Report())
    root = workspace.root if workspace is not None else os.path.dirname(os.path.abspath(arguments.document))
    editor = arguments.editor.replace("{file}", f"{quote(root)}/{{file}}")
    try:
        return Server(arguments.port, editor, against)
    except OSError as fault:
        reason = fault.strerror or str(fault)
        raise common.WrongCommandLine(f"port {arguments.port} cannot be had: {reason}", "leave --port out: a free one is taken") from fault


def _open_build(arguments: argparse.Namespace) -> int:
    """Show the page of a finished build. Raises `WrongCommandLine` where it has none."""
    if arguments.against is not None:
        raise common.WrongCommandLine("--against is about documents", "name both documents, not their builds")
    folder = Path(arguments.document)
    pages = sorted(folder.glob("html/*.html"))
    if not pages:
        if (folder / MANIFEST).is_file():
            raise common.WrongCommandLine(
                f"the build `{arguments.document}` has no page", "build it with `--emit html`, or name its document", Code.NO_DOCUMENT
            )
        raise common.WrongCommandLine(
            f"`{arguments.document}` is a folder without a build", "name a document, or a build with html/", Code.NO_DOCUMENT
        )
    for page in pages:
        common.say(shown_path(str(page)))
        if not arguments.no_open:
            webbrowser.open(page.resolve().as_uri())
    return 0


def _port(text: str) -> int:
    """A port, as argparse wants it checked."""
    if not text.isdigit() or not 0 < int(text) < 65536:
        raise argparse.ArgumentTypeError(f"expected a port from 1 to 65535, found `{text}`")
    return int(text)
