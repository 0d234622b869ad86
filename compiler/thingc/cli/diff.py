"""`thingc diff`: what a change of documents, or of the code of parts, does to a robot."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from thingc.cli import common
from thingc.diagnostics import Diagnostic
from thingc.typos import did_you_mean

if TYPE_CHECKING:
    from thingc.diff import Asked, Both, BrokenSide, Comparison, Differences
    from thingc.environment import Options

EPILOG = """\
Meaning, not text: components, joints, mates, parameters, modes, poses, materials, tests, and what follows for masses, geometry,
mounts, the bill of materials and prints, each with its cause. A new layout of the same robot is no change.

  thingc diff HEAD~3                                the working tree with a revision: the documents that the change concerns
  thingc diff main..HEAD                            two revisions; nothing is checked out
  thingc diff main -- assemblies/arm.yaml           of one document
  thingc diff old.yaml new.yaml                     two documents; also build folders, and parts.lock.json
  thingc diff main..HEAD --format markdown > comment.md
  thingc diff main..HEAD --fail-on mass,joints,tests
"""
FORMS = ("text", "json", "markdown")


def configure(parser: argparse.ArgumentParser) -> None:
    """The options of `diff`."""
    parser.epilog = EPILOG
    parser.add_argument(
        "side", metavar="SIDE", nargs="*",
        help="the old state, and the new one (default: the working tree): documents, build folders, locks, or revisions of git, also "
        "OLD..NEW; documents that are compared in both follow --",
    )
    parser.add_argument(
        "--fail-on", metavar="WHAT", action="append", default=[],
        help="exit with 1 where something of this kind changes: mass, joints, tests, ... (separated by commas; may be repeated)",
    )
    parser.add_argument("--no-tests", action="store_true", help="leave the tests of the documents out")
    parser.add_argument(
        "--no-code", action="store_true", help="run nothing of the workspace: parts are as parts.lock.json says (see `thingc lock`)"
    )
    parser.add_argument(
        "--time-limit", metavar="TIME", default="20 s", help="with --no-code: longest computing for one document (default: %(default)s)"
    )
    common.add_format(parser, FORMS)
    common.add_geometry(parser)


def run(arguments: argparse.Namespace) -> int:
    """Exit code 0, or 1 where something changed that must not; 1 where a side does not compile."""
    from thingc.affected import NotARepository
    from thingc.diff import BrokenSide, UnknownSide, as_json, as_markdown, as_text, asked

    try:
        watched = fail_on(arguments.fail_on)
        options = common.options_of(arguments)
        words: list[str] = arguments.side[: len(arguments.side) - len(arguments.behind)]
        wanted = asked(words, arguments.behind)
        with ExitStack() as stack:
            answer = _answer(arguments, wanted, options, stack)
    except UnknownSide as fault:
        return _refused(arguments, common.WrongCommandLine(str(fault), fault.hint))
    except NotARepository as fault:
        return _refused(arguments, common.WrongCommandLine(f"git cannot say: {fault}", "run this in a repository, or name two documents"))
    except common.WrongCommandLine as fault:
        return _refused(arguments, fault)
    if isinstance(answer, BrokenSide):
        if arguments.format == "json":
            common.print_json(answer.diagnostics)
        else:
            common.print_text(answer.diagnostics, stream=sys.stdout, debug=arguments.debug, texts=answer.texts)
        return 1
    if arguments.format == "json":
        common.print_data(as_json(answer))
    elif arguments.format == "markdown":
        common.hand_on(as_markdown(answer))
    else:
        common.say(*as_text(answer))
    return 1 if any(change.what in watched for change in answer.changes) else 0


def _refused(arguments: argparse.Namespace, fault: common.WrongCommandLine) -> int:
    form = arguments.format if arguments.format == "json" else "text"
    common.print_found([fault.diagnostic], form, stream=sys.stderr, debug=False)
    return common.USAGE


def fail_on(words: Sequence[str]) -> frozenset[str]:
    """What `--fail-on` names, in the singular of answers. Raises `WrongCommandLine`."""
    from thingc.diff import WHATS

    known: dict[str, str] = {what: what for what in WHATS}
    known |= {f"{what}es" if what.endswith("s") else f"{what}s": what for what in WHATS}
    named: set[str] = set()
    for word in (one.strip() for text in words for one in text.split(",")):
        if word not in known:
            raise common.WrongCommandLine(
                f"--fail-on: expected what may change, found `{word}`", did_you_mean(word, known if word else WHATS, what="words"),
            )
        named.add(known[word])
    return frozenset(named)


def _answer(arguments: argparse.Namespace, wanted: Asked, options: Options, stack: ExitStack) -> Differences | BrokenSide:
    """Raises `UnknownSide`, `NotARepository`, `WrongCommandLine`."""
    from thingc.diff import answered, compared, laid_out

    options = replace(options, lock=arguments.no_code, code=not arguments.no_code)
    names = (wanted.old.name, wanted.new.name)
    work = partial(compared, options=options, tests=not (arguments.no_tests or arguments.no_code), names=names)
    if not arguments.no_code:
        return answered(*names, laid_out(wanted, stack), work)
    if "" in sys.path or os.getcwd() in sys.path and not sys.flags.safe_path:
        raise common.WrongCommandLine(
            "Python looks for modules in the working folder, which may be part of the change", "run `thingc`, or `python -I -m thingc`"
        )
    seconds = common.time_of("--time-limit", arguments.time_limit)
    return answered(*names, laid_out(wanted, stack), partial(_apart, work, seconds))


def _apart(work: Callable[[Both], Comparison | BrokenSide], seconds: float, both: Both) -> Comparison | BrokenSide:
    """A document compared in a bounded process of its own."""
    from thingc.cli.confined import confined
    from thingc.diff import BrokenSide, pack, unpack

    answer = confined(lambda: pack(work(both)), seconds)
    if isinstance(answer, Diagnostic):
        return BrokenSide(name=both.name, diagnostics=(replace(answer, path=both.name),), texts={})
    return unpack(answer)
