"""`thingc touched`: the documents that a change concerns."""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence

from thingc.base.diagnostics import shown_path
from thingc.tools.cli import console

EPILOG = """\
Names the documents below this folder that depend on the files given: through the documents that they nest, their
materials, the code of their parts, files that are parts. Nothing of theirs is run.

  thingc touched parts/arm.py
  thingc touched --since origin/main                    everything that this branch has changed
  thingc touched --since origin/main --roots            what to build: assemblies with modes, and what nothing else nests
  thingc touched --since origin/main -0 | xargs -0r thingc check --
"""


def configure(parser: argparse.ArgumentParser) -> None:
    """The options of `touched`."""
    parser.epilog = EPILOG
    parser.add_argument("files", metavar="FILE", nargs="*", help="a file that has changed (it need not be there any more)")
    parser.add_argument("--since", metavar="REVISION", help="also every file that has changed since this branch left REVISION (git)")
    parser.add_argument("--all", action="store_true", help="every document below this folder, whatever has changed")
    parser.add_argument("-0", "--null", action="store_true", help="names exactly as they are, each ended by a NUL, for scripts")
    parser.add_argument("--roots", action="store_true", help="only assemblies with modes of their own, and those that no other nests")
    parser.add_argument(
        "--store", metavar="DIR", help="where modelled parts are kept (default: THINGC_STORE, else the user's cache folder)"
    )
    console.add_format(parser)


def run(arguments: argparse.Namespace) -> int:
    """Exit code 0, whether anything is touched or not; 2 where git cannot say what has changed."""
    if arguments.null and arguments.format == "json":
        raise console.WrongCommandLine("-0 and --format json are two forms of one answer", "leave one of them out")
    paths = documents(arguments.files, arguments.since, everything=arguments.all, roots=arguments.roots, store=arguments.store)
    shown = [shown_path(path) for path in paths]
    if arguments.format == "json":
        console.print_json([], documents=shown)
    elif arguments.null:
        console.hand_on(b"".join(os.fsencode(path) + b"\0" for path in shown))
    else:
        console.say(*shown)
    return 0


def documents(
    files: Sequence[str], since: str | None = None, *, everything: bool = False, roots: bool = False, store: str | None = None
) -> tuple[str, ...]:
    """Absolute paths of the documents below the working folder that the files, or what changed since a revision, touch.

    Raises `WrongCommandLine` where nothing was asked, where a folder is named, or where git cannot answer.
    """
    from thingc.driver.environment import Options, store_of
    from thingc.tools.affected.dependents import NotARepository, changed_since, touched

    if not files and since is None and not everything:
        raise console.WrongCommandLine("expected files that have changed, or --since", "write for example --since origin/main")
    for file in files:
        if os.path.isdir(file) and not os.path.islink(file):
            hint = "name the files that have changed, or write --all"
            raise console.WrongCommandLine(f"`{file}` is a folder, and files were expected", hint)
    changed = [os.path.abspath(file) for file in files]
    if since is not None:
        try:
            changed += changed_since(since, os.getcwd())
        except NotARepository as fault:
            hint = "name a branch, a tag or a commit of this repository; a shallow clone may not have it (git fetch --unshallow)"
            raise console.WrongCommandLine(f"--since {since}: {fault}", hint) from fault
    affected = touched(None if everything else changed, os.getcwd(), store_of(Options(store=store)))
    return affected.roots if roots else affected.documents
