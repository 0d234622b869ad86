"""Implementation of `thingc touched`, which lists the documents that changed files affect.

Lists the documents below the working folder that depend on the given files, directly or through nested documents, materials, part code
or part files. Runs no code of the workspace.

  thingc touched parts/arm.py
  thingc touched --since origin/main                    all changes of this branch
  thingc touched --since origin/main --roots            documents to build: assemblies with modes, or not nested in others
  thingc touched --since origin/main -0 | xargs -0r thingc check --
  thingc touched --since origin/main --robot-files      changed URDF, xacro, MJCF and SDF files
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence

from thingc.base.diagnostics import shown_path
from thingc.tools.cli import console
from thingc.tools.importing.import_request import changed_robots


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options of `thingc touched` to the parser."""
    parser.add_argument("files", metavar="FILE", nargs="*", help="changed or deleted file")
    parser.add_argument("--since", metavar="REVISION", help="include files that changed since the Git merge base with REVISION")
    parser.add_argument("--all", action="store_true", help="list all documents below the working folder")
    parser.add_argument("-0", "--null", action="store_true", help="terminate paths with a NUL character instead of a newline")
    parser.add_argument("--roots", action="store_true", help="list only top-level assemblies and assemblies with modes")
    parser.add_argument("--robot-files", action="store_true", help="list changed robot files instead of documents")
    parser.add_argument("--store", metavar="DIR", help="folder or URL of the part cache (default: THINGC_STORE or the user's cache)")
    console.add_format(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run `thingc touched`, and return the exit code, which is 0, or 2 if git cannot determine the changes."""
    if arguments.null and arguments.format == "json":
        raise console.WrongCommandLine("-0 cannot be combined with --format json", "use only one of the two options")
    paths: Sequence[str]
    if arguments.robot_files:
        paths = changed_robots(_changed_paths(arguments.files, arguments.since))
    else:
        paths = documents(arguments.files, arguments.since, everything=arguments.all, roots=arguments.roots, store=arguments.store)
    paths_to_print = [shown_path(path) for path in paths]
    if arguments.format == "json":
        console.print_json([], documents=paths_to_print)
    elif arguments.null:
        console.write_raw(b"".join(os.fsencode(path) + b"\0" for path in paths_to_print))
    else:
        console.say(*paths_to_print)
    return 0


def documents(
    files: Sequence[str], since: str | None = None, *, everything: bool = False, roots: bool = False, store: str | None = None
) -> tuple[str, ...]:
    """Return the absolute paths of the documents below the working folder that depend on `files`, or on files changed since a git revision.

    Raises `WrongCommandLine` if neither files nor a revision are given, if an argument is a folder, or if git fails.
    """
    from thingc.driver.environment import Options, store_of
    from thingc.tools.affected.dependents import affected_documents

    changed = _changed_paths(files, since) if files or since is not None or not everything else []
    affected = affected_documents(None if everything else changed, os.getcwd(), store_of(Options(store=store)))
    return affected.roots if roots else affected.documents


def _changed_paths(files: Sequence[str], since: str | None) -> list[str]:
    """Return the absolute paths of `files`, and of the files changed since a git revision. Raises `WrongCommandLine`."""
    from thingc.tools.affected.dependents import NotARepository, changed_since

    if not files and since is None:
        raise console.WrongCommandLine("expected changed files, or --since", "write, for example, --since origin/main")
    for file in files:
        if os.path.isdir(file) and not os.path.islink(file):
            hint = "list the changed files, or add --all"
            raise console.WrongCommandLine(f"expected a file, found the folder `{file}`", hint)
    changed = [os.path.abspath(file) for file in files]
    if since is not None:
        try:
            changed += changed_since(since, os.getcwd())
        except NotARepository as fault:
            hint = "use a branch, tag or commit, or run `git fetch --unshallow`"
            raise console.WrongCommandLine(f"--since {since}: {fault}", hint) from fault
    return changed
