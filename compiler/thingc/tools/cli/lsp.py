"""Implementation of `thingc lsp`, which runs the language server for editors.

Editors start this command and use the Language Server Protocol over standard input and output.

  pip install 'thingc[lsp]'

Code of a workspace runs only if the editor sends `initializationOptions: {trusted: true}`. Otherwise parts are read from parts.lock.json,
as with `thingc check --no-code`.
"""

from __future__ import annotations

import argparse
import os
import sys

from msgspec.structs import replace

from thingc.tools.cli import console, signals


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options of `thingc lsp` to the parser."""
    parser.add_argument("--stdio", action="store_true", help="communicate over standard input and output (default)")
    console.add_geometry(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run `thingc lsp`, and return the exit code.

    The code is 0 after a shutdown request, 1 if the editor disconnects without this request, and 2 if the extra is not installed.
    """
    from importlib.util import find_spec

    if find_spec("pygls") is None:
        raise console.WrongCommandLine("`thingc lsp` requires the package `pygls`", "run `pip install 'thingc[lsp]'`")
    options = replace(console.options_of(arguments), progress=None, printed=None)
    from thingc import __version__
    from thingc.tools.lsp.server import serve

    signals.leave_at_once()
    protocol = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # printed text must not be mixed with the protocol messages
    return 0 if serve(options, __version__, console.of_exception, sys.stdin.buffer, protocol) else 1
