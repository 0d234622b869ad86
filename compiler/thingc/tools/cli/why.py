"""Implementation of `thingc why`, which shows why a part was built or reused, or which information the output formats cannot represent.

The command expects either an occurrence or --losses.

  thingc why assemblies/arm.yaml hand/cap       show whether the part must be rebuilt, and what has changed
  thingc why assemblies/arm.yaml --losses       show what targets cannot express, and the consequences
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Iterable, Sequence
from functools import partial

from thingc.base.diagnostics import Diagnostic, shown_path
from thingc.base.grouping import group_by
from thingc.base.suggestions import did_you_mean
from thingc.driver import pipeline
from thingc.driver.environment import Environment, with_environment
from thingc.driver.pipeline import Compilation
from thingc.targets.artifact import Loss
from thingc.tools.cli import console
from thingc.tools.cli.build import add_compat, add_emit, chosen_targets

_NUMBER = re.compile(r"(?<![\w.^])-?\d+(?:\.\d+)?(?:e[+-]?\d+)?(?![\w.])")
"""Regular expression of numbers in the descriptions of export losses."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options of `thingc why` to the parser."""
    console.add_document(parser)
    parser.add_argument("occurrence", metavar="OCCURRENCE", nargs="?", help="path of a part, such as hand/cap")
    parser.add_argument("--losses", action="store_true", help="list the export losses of each target")
    add_emit(parser)
    add_compat(parser)
    console.add_compiling(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run `thingc why`, and return the exit code, which is 2 for an unknown occurrence."""
    if (arguments.occurrence is None) != arguments.losses:
        help = "write, for example, `thingc why assemblies/arm.yaml hand/cap`"
        raise console.WrongCommandLine("expected either OCCURRENCE or --losses", help)
    console.require_document(arguments.document)
    diagnostics = with_environment(arguments.document, console.options_of(arguments), partial(_answer, arguments))
    return console.print_text(diagnostics, stream=sys.stderr, debug=arguments.debug)


def _answer(arguments: argparse.Namespace, environment: Environment) -> list[Diagnostic]:
    """Print why a part was built or reused, or print the export losses of targets. Return the diagnostics."""
    compilation = pipeline.compile(environment)
    diagnostics = console.final(compilation.report, strict=arguments.strict)
    if console.exit_code(diagnostics):
        return diagnostics
    if arguments.losses:
        targets, wrong = chosen_targets(arguments)
        if wrong:
            return wrong
        _losses(environment, compilation, targets)
        return console.final(compilation.report, strict=False)
    _reason(compilation, arguments.occurrence)
    return diagnostics


def _reason(compilation: Compilation, requested: str) -> None:
    assembly = compilation.assembly
    if assembly is None:
        return
    by_path = {o.path: o for o in assembly.occurrences}
    path = requested.replace(".", "/")
    if path not in by_path:
        inside = [p for p in by_path if p.startswith(path + "/")]
        hint = f"use a part of the assembly: {', '.join(f'`{p}`' for p in inside)}" if inside else did_you_mean(path, by_path)
        raise console.WrongCommandLine(f"there is no occurrence `{requested}`", hint)
    occurrence = by_path[path]
    text = occurrence.definition.text
    if text not in compilation.decisions:
        console.say(f"{path} is a frame without geometry")
        return
    decision = compilation.decisions[text]
    console.say(f"{path} is {occurrence.definition.label}", f"{'reused' if decision.reused else 'modelled'}: {decision.reason}")
    users = [o.path for o in assembly.occurrences if o.definition.text == text]
    if len(users) > 1:
        console.say(f"shared by {', '.join(users)}")


def _losses(environment: Environment, compilation: Compilation, targets: Sequence[str]) -> None:
    losses = [loss for target in pipeline.build(environment, compilation, targets).values() for loss in target.losses]
    for similar_losses in _alike(losses):
        console.say(_in_words(similar_losses))
    if not losses and not console.exit_code(console.final(compilation.report, strict=False)):
        console.say("no losses")


def _alike(losses: Iterable[Loss]) -> Iterable[list[Loss]]:
    """Group export losses of one target that differ only in source location, numbers and mode."""
    return group_by(losses, lambda loss: (
        loss.target, None if loss.mode == loss.path else loss.mode, _NUMBER.sub("...", loss.what), loss.how,
    )).values()


def _in_words(losses: Sequence[Loss]) -> str:
    """Format a group of export losses as one line, with the source location of the first loss.

    Numbers that differ between the losses are replaced by `...`.
    """
    first = losses[0]
    place = f"{shown_path(first.span.file)}:{first.span.line}: " if first.span is not None else ""
    of_modes = first.mode == first.path
    where = "" if of_modes or first.mode is None else f" in {first.mode}"
    text = first.what if len({loss.what for loss in losses}) == 1 else _NUMBER.sub("...", first.what)
    paths = ", ".join(dict.fromkeys(loss.path for loss in losses))
    of = f"{'mode' if len(losses) == 1 else 'modes'} {paths}" if of_modes else paths
    return f"{place}{first.target}{where}: {of}: {text} ({first.how})"
