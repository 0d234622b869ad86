"""`thingc lsp`: a language server, for editors."""

from __future__ import annotations

import argparse
import os
import sys

from msgspec.structs import replace

from thingc.tools.cli import console, signals

EPILOG = """\
An editor starts it; it speaks the Language Server Protocol over standard input and output.

  pip install 'thingc[lsp]'

Nothing of a workspace is run unless the editor says that it is trusted: `initializationOptions: {trusted: true}`. Until then parts are as
parts.lock.json says, as for `thingc check --no-code`.
"""


def configure(parser: argparse.ArgumentParser) -> None:
    """The options of `lsp`."""
    parser.epilog = EPILOG
    parser.add_argument("--stdio", action="store_true", help="what it does anyway; editors say so")
    console.add_geometry(parser)


def run(arguments: argparse.Namespace) -> int:
    """Exit code 0 when the editor has left, 1 where it went without a word; 2 where the extra is not installed."""
    from importlib.util import find_spec

    if find_spec("pygls") is None:
        raise console.WrongCommandLine("`thingc lsp` needs pygls, which is not installed", "pip install 'thingc[lsp]'")
    options = replace(console.options_of(arguments), progress=None, printed=None)
    from thingc import __version__
    from thingc.tools.lsp.server import serve

    signals.leave_at_once()
    protocol = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # whatever is printed is no message of the protocol
    return 0 if serve(options, __version__, console.of_exception, sys.stdin.buffer, protocol) else 1
