"""The entry point of `thingc`: parse the command line, import the module of one command, and run the command.

Examples:
  thingc check assemblies/arm.yaml           report errors and warnings
  thingc build assemblies/arm.yaml           write models, print files and a bill of materials to build/arm/
  thingc build assemblies/arm.yaml -p 'reach=120 mm' --mode bench --emit mjcf
  thingc info assemblies/arm.yaml            show masses, and the source of each number

Run `thingc COMMAND --help` for the arguments and options of a command.
"""

from __future__ import annotations

import argparse
import importlib
import os
import re
import sys
from collections.abc import Sequence
from typing import NoReturn

from thingc.tools.cli.signals import INTERRUPTED, has_come

COMMANDS = {
    "new": "create a workspace with an example robot",
    "import": "convert a robot (URDF, xacro, MJCF, SDF) or a STEP assembly to a document",
    "build": "write simulation models and manufacturing files of a robot",
    "watch": "build a robot after every save",
    "view": "show a robot in the browser and update it after every save",
    "batch": "build every variant of a variants document",
    "check": "check documents for errors and warnings",
    "add": "add a part, assembly, mode, joint or test to a document",
    "set": "set values in a document by their paths",
    "joints": "propose joints between parts that touch",
    "rezero": "move the zero positions of joints, or reverse joints",
    "rename": "rename an element in documents and Python code",
    "fmt": "format documents",
    "test": "run the tests in a document",
    "diff": "compare two versions of a robot",
    "same": "check whether two robots are the same mechanism",
    "calibration": "check and convert the calibration of a physical robot",
    "info": "show the masses, links and joints of a robot",
    "collision": "measure how well collision shapes approximate the parts of a robot",
    "limits": "find the joint positions at which parts touch",
    "motion": "replay a motion of a robot in MuJoCo",
    "sensitivity": "show how parameters affect the mass and other results of a robot",
    "print": "show the size, support, mass, time and cost of printed parts",
    "render": "draw a picture of a robot in a pose",
    "hag": "print the assembly graph of a robot",
    "lock": "write the properties of parts to parts.lock.json",
    "parts": "list the available parts, with their parameters and mounts",
    "schema": "write a JSON Schema for each document",
    "lsp": "run the language server for editors",
    "mcp": "run the MCP server for AI assistants",
    "explain": "explain a diagnostic code such as TC302",
    "touched": "list the documents that a change affects",
    "why": "show why a part was built or reused",
}


class Parser(argparse.ArgumentParser):
    """An argument parser that raises `WrongCommandLine` instead of exiting if the command line is invalid."""

    def error(self, message: str) -> NoReturn:
        """Raise `WrongCommandLine` with the error message from argparse."""
        message = re.sub(r"^argument (\{.*?\}: )?", "", message).replace("the following arguments are required:", "the command requires")
        raise _usage_error(message, f"run `{self.prog} --help` for usage")


def parser_for(command: str | None, *, alone: bool = False) -> tuple[Parser, Parser | None]:
    """Create the main parser, and the parser of `command`. The second result is None if `command` is None.

    Only the module of `command` is imported, so the parsers of other commands have no options. If `alone` is true, the parsers of other
    commands are omitted, because only the main help needs them.
    """
    subparser: Parser | None = None
    parser = Parser(
        prog="thingc", description="A compiler for robots: one document, many kinematic roots.", epilog=examples_of(__doc__),
        formatter_class=argparse.RawDescriptionHelpFormatter, allow_abbrev=False,
    )
    parser.add_argument("--version", action="store_true", help="print the version and exit")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", title="commands")
    for name, summary in COMMANDS.items():
        if alone and name != command:
            continue
        sub = commands.add_parser(
            name, help=summary, description=summary[0].upper() + summary[1:] + ".", allow_abbrev=False,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        if name == command:
            module = importlib.import_module(f"thingc.tools.cli.{name}")
            sub.epilog = examples_of(module.__doc__)
            module.configure(sub)
            subparser = sub
    return parser, subparser


def examples_of(docstring: str | None) -> str:
    """Return the end of the help of a command: the docstring of its module without the first paragraph."""
    return (docstring or "").partition("\n\n")[2]


def parse_arguments(command_line: Sequence[str]) -> argparse.Namespace | None:
    """Parse the command line. Return None after printing the help or the version.

    Raises `WrongCommandLine`, or `SystemExit` if no command is given.
    """
    command = next((argument for argument in command_line if not argument.startswith("-")), None)
    if command is not None and command not in COMMANDS:
        from thingc.base.suggestions import near_hint

        hint = near_hint(command, COMMANDS) or "run `thingc --help` for a list of commands"
        raise _usage_error(f"there is no command `{command}`", str(hint))
    empty = next((argument for argument in command_line if re.fullmatch(r"-\w--|--[\w-]+=--", argument)), None)
    if empty is not None:  # for such a word, argparse returns a list
        raise _usage_error(f"`{empty}`: expected a value, found `--`", "write `./--` for a file or folder of that name")
    parser, subparser = parser_for(command, alone=command is not None and command_line[0] == command)
    after_dashes: Sequence[str] | None = None  # argparse would add these words to other arguments
    if subparser is not None and subparser.get_default("behind") is not None and "--" in command_line:
        command_line, after_dashes = command_line[: command_line.index("--")], command_line[command_line.index("--") + 1 :]
    try:
        # `intermixed` allows options between arguments, as in `thingc motion DOC --mode M NAME`, but takes `-x` after `--` for an option
        if subparser is not None and command_line[0] == command and "--" not in command_line:
            options, unknown = subparser.parse_known_intermixed_args(command_line[1:], argparse.Namespace(command=command, version=False))
        else:
            options, unknown = parser.parse_known_args(command_line)
    except SystemExit as leaving:
        if leaving.code:
            raise
        return None
    if after_dashes is not None:
        options.behind = list(after_dashes)
    if unknown:
        from thingc.base.suggestions import nearest

        argument = unknown[0].partition("=")[0]
        kind = "option" if argument.startswith("-") else "argument"
        of = f" for `thingc {command}`" if command is not None else ""
        known = {name.lstrip("-"): name for action in (subparser or parser)._actions for name in action.option_strings}
        if command is not None and argument in known.values() and command_line.index(unknown[0]) < command_line.index(command):
            raise _usage_error(f"`{argument}` is an option of `thingc {command}`, not of `thingc`", f"write the option after `{command}`")
        close = nearest(argument.lstrip("-"), known) if kind == "option" else None
        help = f"did you mean `{known[close]}`?" if close else f"run `{(subparser or parser).prog} --help` for usage"
        raise _usage_error(f"unexpected {kind} `{argument}`{of}", help)
    if options.version:
        from thingc import __version__
        from thingc.tools.cli import console

        console.say(f"thingc {__version__}")
        return None
    if options.command is None:
        parser.print_help()
        raise SystemExit(2)
    return options


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return the exit code: 0 success, 1 errors in documents or parts, 2 invalid command line, 130 interrupted."""
    command_line = list(sys.argv[1:] if arguments is None else arguments)
    options: argparse.Namespace | None = None
    try:
        options = parse_arguments(command_line)
        if options is None:
            return 0
        os.getcwd()  # raises FileNotFoundError if the working folder was deleted
        if getattr(options, "document", "") is None:
            from thingc.tools.cli import console

            options.document = console.default_document()
        code: int = importlib.import_module(f"thingc.tools.cli.{options.command}").run(options)
        sys.stdout.flush()
    except SystemExit as leaving:
        if options is not None:
            raise
        return int(leaving.code or 0)
    except BrokenPipeError:
        # without this, `thingc info ... | head` prints an error when Python flushes standard output at exit
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except KeyboardInterrupt:
        return _report_interrupt()
    except Exception as fault:
        return _report_interrupt() if has_come() else _report(fault, options, command_line)
    return code


def _report_interrupt() -> int:
    """Report that the command was interrupted, and return the exit code."""
    from thingc.tools.cli import console

    console.say("interrupted; all written files are complete", stream=sys.stderr)
    return INTERRUPTED


def _usage_error(message: str, hint: str) -> Exception:
    from thingc.tools.cli import console

    return console.WrongCommandLine(message, hint)


def _report(fault: Exception, options: argparse.Namespace | None, command_line: Sequence[str]) -> int:
    """Print an exception as a diagnostic in the requested output format, and return the exit code.

    Commands whose text output consists of diagnostics print errors about the command line to standard output (`stdout_errors`).
    """
    from thingc.tools.cli import console

    diagnostic, debug = console.of_exception(fault), getattr(options, "debug", False)
    formats = [value for option, value in zip(command_line, command_line[1:]) if option == "--format"]
    formats += [option.removeprefix("--format=") for option in command_line if option.startswith("--format=")]
    form = getattr(options, "format", "text") if options is not None else formats[-1] if formats else "text"
    if form not in console.FINDINGS or str(fault).startswith("--format"):  # an unsupported format is reported as text
        form = "text"
    wrong = isinstance(fault, console.WrongCommandLine) and getattr(options, "stdout_errors", False)
    try:
        code = console.print_found([diagnostic], form, stream=sys.stdout if wrong else sys.stderr, debug=debug)
        sys.stdout.flush()
    except OSError:  # standard output is closed
        code = console.print_text([diagnostic], stream=sys.stderr, debug=debug)
    return code
