"""Implementation of `thingc mcp`, which runs the MCP server for assistants.

Assistants start this command and use the Model Context Protocol (MCP) over standard input and output.

  pip install 'thingc[mcp]'

The tools check, info, explain, parts and render only read documents, and set and add also write documents. All tools use only documents in
the folder. Code of the workspace runs only with --trusted. Otherwise parts are read from parts.lock.json, as with `thingc check --no-code`.
"""

from __future__ import annotations

import argparse
import os

from thingc.tools.cli import console


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options of `thingc mcp` to the parser."""
    parser.add_argument("-C", "--workspace", metavar="DIR", default=".", help="workspace folder (default: the working folder)")
    parser.add_argument("--trusted", action="store_true", help="allow the server to run Python code")
    console.add_geometry(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run `thingc mcp`, and return the exit code, which is 0 if the assistant disconnects, and 2 if the extra is not installed."""
    from importlib.util import find_spec

    if find_spec("mcp") is None:
        raise console.WrongCommandLine("`thingc mcp` requires the package `mcp`", "run `pip install 'thingc[mcp]'`")
    if not os.path.isdir(arguments.workspace):
        raise console.WrongCommandLine(f"`{arguments.workspace}` is not a folder", "use the folder of a workspace")
    console.options_of(arguments)  # report invalid options now
    options = {"--store": arguments.store, "--jobs": arguments.jobs, "--part-timeout": arguments.part_timeout}
    os.chdir(arguments.workspace)
    from thingc.targets.render.picture import allow_rendering
    from thingc.tools.mcp.server import serve

    allow_rendering()  # a tool may import MuJoCo before another tool renders

    serve(trusted=arguments.trusted, options=[f"{option}={value}" for option, value in options.items() if value])
    return 0
