"""Which targets a command is about: those that its `--emit` names, else the workspace, else those that are written unasked."""

from __future__ import annotations

import argparse

from thingc.base.diagnostics import Code, Diagnostic, Report, Severity
from thingc.documents.workspace import CONSUMERS, Workspace
from thingc.targets.registry import TARGETS, chosen, unknown
from thingc.tools.cli import console


def in_words() -> str:
    """Every target of ours, each with what it is."""
    unasked, asked = ([f"{name} ({one.says})" for name, one in TARGETS.items() if one.unasked == kind] for kind in (True, False))
    return f"Targets: {', '.join(unasked)}; and, only where they are named, {', '.join(asked)}."


def add_emit(parser: argparse.ArgumentParser) -> None:
    """The option `--emit`."""
    asked = [name for name, target in TARGETS.items() if not target.unasked]
    parser.add_argument(
        "--emit", metavar="T", action="append", default=[],
        help=f"only this target, or `all` (may be repeated; default: those of the workspace, else all but {', '.join(asked)})",
    )


def add_compat(parser: argparse.ArgumentParser) -> None:
    """The option `--compat`."""
    parser.add_argument(
        "--compat", metavar="C", action="append", default=[],
        help=f"have this program read the MuJoCo models, too: {', '.join(CONSUMERS)} (may be repeated; default: those of the workspace)",
    )


def add_building(parser: argparse.ArgumentParser) -> None:
    """The options that say what a build folder holds, and where it is."""
    parser.add_argument("-o", "--output", metavar="DIR", help="write DIR/NAME/ (default: the workspace's build folder)")
    parser.add_argument("--mode", metavar="M", action="append", default=[], help="only this mode (may be repeated; default: all)")
    add_emit(parser)
    add_compat(parser)
    parser.add_argument(
        "--force", action="store_true", help="give up files in the build folder that no build wrote, or that were changed since"
    )
    parser.add_argument("--deny-loss", action="store_true", help="what a target cannot say is an error, unless it is allowed")


def chosen_targets(arguments: argparse.Namespace) -> tuple[tuple[str, ...], list[Diagnostic]]:
    """The targets, and what is wrong with those that the workspace names. Raises `WrongCommandLine` for those of the command line."""
    for _, message, hint in unknown(arguments.emit):
        raise console.WrongCommandLine(message, hint)
    if arguments.emit and not chosen(arguments.emit):
        raise console.WrongCommandLine("`--emit` names no target", "write for example: --emit mjcf,urdf")
    if arguments.emit and arguments.compat and not {"mjcf", "mjz"} & {*chosen(arguments.emit)}:
        raise console.WrongCommandLine("`--compat` is about MuJoCo models, which `--emit` leaves out", "add `mjcf` to what `--emit` names")
    if arguments.emit:
        return chosen(arguments.emit), []
    workspace = Workspace.find(arguments.document, Report())
    if workspace is None:  # what is wrong with it is said by who reads the document
        return chosen(()), []
    return chosen(workspace.emit), [
        Diagnostic(code=Code.UNKNOWN_CHOICE, severity=Severity.ERROR, message=message, help=hint, span=workspace.span(("emit", index)))
        for index, message, hint in unknown(workspace.emit)
    ]
