"""`thingc`: reads the command line and hands on to one module per command (imported only when it is asked for)."""

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
    "new": "make a workspace that builds at once, with a robot to change",
    "import": "write a robot of another format (URDF, xacro, MJCF, SDF) as a document, and what that cannot say of it",
    "build": "write simulation models and manufacturing files of a robot",
    "watch": "build a robot again after every save, with the CAD kernel loaded",
    "view": "show a robot in the browser, as its document stands after every save",
    "batch": "build every variant of a document of variants",
    "check": "say everything that is wrong with documents, and write nothing",
    "add": "put a part, assembly, mode, joint or test where it belongs, to begin with; comments and layout stay",
    "set": "write values into a document, at their paths; comments and layout stay",
    "rename": "give something another name in all documents that use it, and in the Python of parts",
    "fmt": "write documents in canonical layout; comments stay",
    "test": "run the tests that a document states of its robot",
    "diff": "what a change of documents does to a robot: its parts, masses, joints, tests, prints",
    "info": "masses, links and joints of a robot, and where each number comes from",
    "render": "draw a picture of a robot in one of its poses",
    "hag": "print the assembly graph (text, DOT, Mermaid, SVG, GraphML or JSON)",
    "lock": "write down what the parts take and are, so that checking needs none of their code",
    "parts": "list every part in reach, with its parameters and mounts",
    "schema": "write, for editors, a JSON Schema per document that knows its parts, mounts and names",
    "lsp": "answer an editor: what is wrong, as you type (a language server)",
    "explain": "what a code such as TC302 means, with a wrong and a right example",
    "touched": "name the documents that a change concerns",
    "why": "why a part was modelled or reused, and what a target could not say",
}

EPILOG = """\
A first look:
  thingc check assemblies/arm.yaml           is it right?
  thingc build assemblies/arm.yaml           models, meshes, print files, bill of materials in build/arm/
  thingc build assemblies/arm.yaml -p 'reach=120 mm' --mode bench --emit mjcf
  thingc info assemblies/arm.yaml            what it weighs, and how thingc knows

`thingc COMMAND --help` tells more about one command.
"""


class WrongUsage(Exception):
    """Words that are no command line of ours: the message says which, `hint` what to type."""

    def __init__(self, message: str, hint: str) -> None:
        super().__init__(message)
        self.hint = hint


class Parser(argparse.ArgumentParser):
    """Leaves it to `main` to say what is wrong, in the form of all diagnostics."""

    def error(self, message: str) -> NoReturn:
        """Raises `WrongUsage`."""
        message = re.sub(r"^argument (\{.*?\}: )?", "", message).replace("the following arguments are required: ", "missing: ")
        raise WrongUsage(message, f"`{self.prog} --help` shows what it takes")


def parser_for(command: str | None, *, alone: bool = False) -> tuple[Parser, Parser | None]:
    """The parser, with the options of one command only (the others need not be imported), and that command's own. Unless it is `alone`
    it stands among the others, which the parser's help lists."""
    own: Parser | None = None
    parser = Parser(
        prog="thingc",
        description="A compiler for robots: one document, many kinematic roots.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("--version", action="store_true", help="print the version and leave")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", title="commands")
    for name, summary in COMMANDS.items():
        if alone and name != command:
            continue
        sub = commands.add_parser(
            name, help=summary, description=summary[0].upper() + summary[1:] + ".", allow_abbrev=False,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        if name == command:
            importlib.import_module(f"thingc.tools.cli.{name}").configure(sub)
            own = sub
    return parser, own


def parsed(words: Sequence[str]) -> argparse.Namespace | None:
    """The command line understood; None where only help was wanted, which has been printed. Raises `WrongUsage`."""
    command = next((word for word in words if not word.startswith("-")), None)
    if command is not None and command not in COMMANDS:
        from thingc.base.suggestions import near_hint

        raise WrongUsage(f"there is no command `{command}`", near_hint(command, COMMANDS) or "`thingc --help` lists them")
    empty = next((word for word in words if re.fullmatch(r"-\w--|--[\w-]+=--", word)), None)
    if empty is not None:  # argparse would hand on a list
        raise WrongUsage(f"`{empty}`: expected a value, found `--`", "write `./--` for a file or folder of that name")
    parser, own = parser_for(command, alone=command is not None and words[0] == command)
    behind: Sequence[str] | None = None
    if own is not None and own.get_default("behind") is not None and "--" in words:  # argparse would take them for more of the others
        words, behind = words[: words.index("--")], words[words.index("--") + 1 :]
    try:
        options, unknown = parser.parse_known_args(words)
    except SystemExit as leaving:
        if leaving.code:
            raise
        return None
    if behind is not None:
        options.behind = list(behind)
    if unknown:
        from thingc.base.suggestions import nearest

        word = unknown[0].partition("=")[0]
        what = "option" if word.startswith("-") else "argument"
        of = f" of `thingc {command}`" if command is not None else ""
        known = {name.lstrip("-"): name for action in (own or parser)._actions for name in action.option_strings}
        if command is not None and word in known.values() and words.index(unknown[0]) < words.index(command):
            raise WrongUsage(f"`{word}` is an option of `thingc {command}`, not of `thingc`", f"write it behind `{command}`")
        close = nearest(word.lstrip("-"), known) if what == "option" else None
        help = f"did you mean `{known[close]}`?" if close else f"`{(own or parser).prog} --help` shows what it takes"
        raise WrongUsage(f"there is no {what} `{word}`{of}" if what == "option" else f"`{word}` is one word too many", help)
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
    """Run one command; returns the exit code: 0 good, 1 errors in documents or parts, 2 a wrong command line."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    options: argparse.Namespace | None = None
    try:
        options = parsed(words)
        if options is None:
            return 0
        os.getcwd()  # raises where the folder is gone, which every command would stumble over somewhere
        if getattr(options, "document", "") is None:
            from thingc.tools.cli import console

            options.document = console.document_meant()
        code: int = importlib.import_module(f"thingc.tools.cli.{options.command}").run(options)
        sys.stdout.flush()
    except SystemExit as leaving:
        if options is not None:
            raise
        return int(leaving.code or 0)
    except WrongUsage as fault:
        return _refuse(fault, words)
    except BrokenPipeError:
        # `thingc info ... | head`: the reader has what it wants; without this Python complains while it shuts down.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except KeyboardInterrupt:
        return _interrupted()
    except Exception as fault:
        from thingc.tools.cli import console

        if has_come():
            return _interrupted()
        diagnostic, debug = console.of_exception(fault), getattr(options, "debug", False)
        try:
            code = console.print_found([diagnostic], _form(getattr(options, "format", "text")), stream=sys.stderr, debug=debug)
            sys.stdout.flush()
        except OSError:  # standard output is what cannot be written
            code = console.print_text([diagnostic], stream=sys.stderr, debug=debug)
    return code


def _interrupted() -> int:
    """Say that an interrupt has ended the command."""
    from thingc.tools.cli import console

    console.say("interrupted; what was written is whole", stream=sys.stderr)
    return INTERRUPTED


def _refuse(fault: WrongUsage, words: Sequence[str]) -> int:
    """Say what is wrong with the command line."""
    from thingc.tools.cli import console

    diagnostics = [console.WrongCommandLine(str(fault), fault.hint).diagnostic]
    asked = [after for word, after in zip(words, words[1:]) if word == "--format"]
    asked += [word.removeprefix("--format=") for word in words if word.startswith("--format=")]
    # Who asks for a form that the command has not, is told so in text.
    form = _form(asked[-1]) if asked and not str(fault).startswith("--format") else "text"
    return console.print_found(diagnostics, form, stream=sys.stderr, debug=False)


def _form(asked: str) -> str:
    """The form in which diagnostics are printed where `asked` is one of theirs or of a command's own."""
    from thingc.tools.cli import console

    return asked if asked in console.FINDINGS else "text"
