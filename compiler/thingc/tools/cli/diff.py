"""Implementation of `thingc diff`, which shows how a change in documents or in part code affects a robot.

Compares robots, not text: components, joints, mates, parameters, modes, poses, materials and tests. The output also lists the effects on
masses, geometry, mounts, the bill of materials and prints, each with its cause. Changes of layout are ignored.

  thingc diff HEAD~3                                compare the working tree with a revision: all affected documents
  thingc diff main..HEAD                            compare two revisions, without checking them out
  thingc diff main -- assemblies/arm.yaml           compare one document, or one robot file of another format
  thingc diff old.yaml new.yaml                     compare two documents, build folders or parts.lock.json files
  thingc diff old.urdf new.urdf                     compare two robot files of other formats (.urdf, .xacro, .sdf, .xml)
  thingc diff main..HEAD --format markdown > comment.md
  thingc diff main..HEAD --html change.html
  thingc diff main..HEAD --fail-on mass,joints,tests
"""

from __future__ import annotations

import argparse
import os
import re
import sys
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from functools import partial

from msgspec.structs import replace

from thingc.base.diagnostics import Diagnostic
from thingc.base.suggestions import did_you_mean
from thingc.driver.environment import Options
from thingc.targets.render.picture import ready
from thingc.tools.cli import console, robot_files
from thingc.tools.cli.sandboxed_check import run_confined
from thingc.tools.diff.arguments import ComparisonRequest, parse_sides
from thingc.tools.diff.checkouts import BrokenSide, DocumentPair, compare_versions, laid_out
from thingc.tools.diff.comparison import Comparison
from thingc.tools.diff.results import DiffResult, as_json, compare_documents, pack, unpack
from thingc.tools.diff.snapshot import WHATS
from thingc.tools.diff.text_report import as_html, as_markdown, as_text

FORMS = ("text", "json", "markdown")


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options of `thingc diff` to the parser."""
    parser.set_defaults(behind=[])
    add = parser.add_argument
    add(
        "side", metavar="SIDE", nargs="*",
        help="document, robot file, build folder, lock file or Git revision to compare (default: the working tree)",
    )
    add("--fail-on", metavar="WHAT", action="append", default=[], help="exit with code 1 for changes of this kind (may be repeated)")
    add("--no-tests", action="store_true", help="do not run the tests of the documents")
    console.add_no_code(parser)
    add("--time-limit", metavar="TIME", default="20 s", help="CPU time limit for each document (with --no-code; default: %(default)s)")
    add("--html", metavar="FILE", help="write an HTML page with pictures to FILE")
    add("--pictures", metavar="FOLDER", help="write pictures of the changes to FOLDER")
    robot_files.configure(parser)
    console.add_format(parser, FORMS)
    console.add_geometry(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run `thingc diff`. Return the exit code 1 if a kind of element in `--fail-on` changed or one side cannot be compiled, else 0."""
    watched = fail_on(arguments.fail_on)
    options = console.options_of(arguments)
    try:
        with ExitStack() as stack:
            answer = _answer(arguments, parse_sides(arguments.side, arguments.behind), options, stack)
    except BrokenSide as broken:
        form = "json" if arguments.format == "json" else "text"
        console.print_found(broken.diagnostics, form, stream=sys.stdout, debug=arguments.debug, texts=broken.texts)
        return 1
    with console.writing(None, "choose another file"):
        pictures = _write_page(arguments, answer)
    if arguments.format == "json":
        console.print_data(as_json(answer))
    elif arguments.format == "markdown":
        console.write_raw(as_markdown(answer, pictures))
    else:
        console.say(*as_text(answer))
    return 1 if any(change.what in watched for change in answer.changes) else 0


def _write_page(arguments: argparse.Namespace, answer: DiffResult) -> Callable[[str, str], str] | None:
    """Write the HTML page for the option `--html` and the pictures for the option `--pictures`. Raises `OSError`.

    Return a function that returns the path of a picture, given a document and the key of the picture. Return None without `--pictures`.
    """
    if arguments.html is not None:
        with open(arguments.html, "w", encoding="utf-8") as page:
            page.write(as_html(answer))
    if arguments.pictures is None:
        return None

    def place(name: str, key: str) -> str:
        stem = re.sub(r"\W+", "_", os.path.splitext(os.path.relpath(name))[0]).strip("_")
        return f"{arguments.pictures}/{stem}_{key}.png"

    os.makedirs(arguments.pictures, exist_ok=True)
    for name, comparison in answer.documents:
        for key, png in comparison.pictures.items():
            with open(place(name, key), "wb") as stream:
                stream.write(png)
    return place


def fail_on(words: Sequence[str]) -> frozenset[str]:
    """Convert the values of the option `--fail-on` to kinds of changes in `WHATS`. Raises `WrongCommandLine` for an unknown kind."""
    known: dict[str, str] = {what: what for what in WHATS}
    known |= {f"{what}es" if what.endswith("s") else f"{what}s": what for what in WHATS}
    named: set[str] = set()
    for word in (one.strip() for text in words for one in text.split(",")):
        if word not in known:
            message = f"--fail-on: expected a kind of change, found `{word}`"
            raise console.WrongCommandLine(message, did_you_mean(word, known if word else WHATS, what="words"))
        named.add(known[word])
    return frozenset(named)


def _answer(arguments: argparse.Namespace, request: ComparisonRequest, options: Options, stack: ExitStack) -> DiffResult:
    """Compare the old and the new state of the documents, and return the result.

    Raises `BrokenSide`, `UnknownComparison`, `NotARepository`, `NoGraphics` and `WrongCommandLine`.
    """
    options = replace(options, lock=arguments.no_code, code=not arguments.no_code)
    names = (request.old.name, request.new.name)
    tests, draw = not (arguments.no_tests or arguments.no_code), bool(arguments.html or arguments.pictures)
    if draw and options.code:
        ready()  # call this before the tests import MuJoCo, because MuJoCo selects its graphics library at import
    work: Callable[[DocumentPair], Comparison] = partial(
        compare_versions, options=options, source=robot_files.import_request(arguments), tests=tests, names=names, draw=draw,
    )
    if arguments.no_code:
        import numpy  # noqa: F401  (the sandbox cannot load libraries)

        console.refuse_modules_of_others()
        work = partial(_compare_sandboxed, work, console.time_of("--time-limit", arguments.time_limit))
    return compare_documents(*names, laid_out(request, stack, code=options.code), work, code=options.code)


def _compare_sandboxed(work: Callable[[DocumentPair], Comparison], seconds: float, both: DocumentPair) -> Comparison:
    """Compare the old and the new version of one document in a sandboxed process. `seconds` is the maximum CPU time of the process."""
    answer = run_confined(lambda: pack(partial(work, both)), seconds)
    if isinstance(answer, Diagnostic):
        raise BrokenSide([replace(answer, path=both.name)], {})
    return unpack(answer)
