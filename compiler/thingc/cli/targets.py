"""Which targets a command is about: those that its `--emit` names, else the workspace, else those that are written unasked."""

from __future__ import annotations

import argparse

from thingc.cli import common
from thingc.diagnostics import Code, Diagnostic, Report, Severity
from thingc.emit import TARGETS, chosen, unknown
from thingc.workspace import Workspace


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


def chosen_targets(arguments: argparse.Namespace) -> tuple[tuple[str, ...], list[Diagnostic]]:
    """The targets, and what is wrong with those that the workspace names. Raises `WrongCommandLine` for those of the command line."""
    for _, message, hint in unknown(arguments.emit):
        raise common.WrongCommandLine(message, hint)
    if arguments.emit:
        return chosen(arguments.emit), []
    workspace = Workspace.find(arguments.document, Report())
    if workspace is None:  # what is wrong with it is said by who reads the document
        return chosen(()), []
    return chosen(workspace.emit), [
        Diagnostic(code=Code.UNKNOWN_CHOICE, severity=Severity.ERROR, message=message, help=hint, span=workspace.span(("emit", index)))
        for index, message, hint in unknown(workspace.emit)
    ]
