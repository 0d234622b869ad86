"""Functions that several commands use to add options, to print diagnostics and tables, and to compute exit codes."""

from __future__ import annotations

import argparse
import difflib
import errno
import os
import re
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, TextIO, TypeVar

from thingc.base.diagnostic_output import as_json, as_text, summary
from thingc.base.diagnostics import Code, Diagnostic, Report, Severity, UserError, shown_path
from thingc.base.filesystem import NO_ROOM, listing, without_suffix, working_folder
from thingc.base.pose import Matrix, Vector, axis_name, transpose
from thingc.base.safe_text import escape_control, json_text, shown_line
from thingc.base.suggestions import Hint, did_you_mean, file_meant, nearest, text_of
from thingc.driver.environment import Answer, Environment, Options, with_environment

if TYPE_CHECKING:
    from thingc.driver.pipeline import Compilation
    from thingc.model.assembly.types import Assembly

Number = TypeVar("Number", int, float)
USAGE = 2
FINDINGS = ("text", "json", "github", "sarif")
"""Output formats of diagnostics."""


def error(message: str, help: Hint | None, code: Code, detail: str | None = None) -> Diagnostic:
    """Create an error diagnostic that has no source location."""
    return Diagnostic(code=code, severity=Severity.ERROR, message=message, help=text_of(help), detail=detail)


class WrongCommandLine(UserError):
    """Raised if the command line is invalid (exit code 2)."""


def add_document(parser: argparse.ArgumentParser, *, what: str = "an assembly document (YAML or TOML)", metavar: str = "DOC") -> None:
    """Add the optional argument DOC to a parser. Without this argument, `main` uses the document that `default_document()` returns."""
    parser.add_argument("document", metavar=metavar, nargs="?", help=f"{what} (default: the only robot of the workspace)")


def default_document() -> str:
    """Return the path of the document that a command processes if the command line does not contain a document. Also print the path.

    The document is the only assembly below the working folder, or else in its workspace, that is not nested in another assembly. Raises
    `WrongCommandLine` unless exactly one such assembly exists.
    """
    from thingc.documents.load.discovery import assemblies_in, documents_near, is_document
    from thingc.documents.workspace import Workspace

    folder = os.getcwd()
    workspace = Workspace.find(os.path.join(folder, "document"), Report())
    assemblies, robots = list[str](), list[str]()
    if workspace is not None:
        assemblies = (
            assemblies_in(folder, workspace)
            or [path for path in documents_near(folder, None) if is_document(path, "assembly/")]  # documents of nested workspaces
            or assemblies_in(workspace.root, workspace)
        )
        robots = _top_documents(assemblies)
    if len(robots) == 1:
        say(f"using {shown_path(robots[0])}, the only robot in this folder", stream=sys.stderr)
        return shown_path(robots[0])
    hint = did_you_mean("", map(shown_path, robots), what="robots") if robots else "run `thingc new NAME` to create one"
    raise WrongCommandLine(f"the argument DOC is required in a folder with {len(robots) or 'no'} robots", hint)


def _top_documents(assemblies: Sequence[str]) -> list[str]:
    """Return the assembly documents that are not nested in another document.

    In a document with errors, references to documents are found by a text search.
    """
    from thingc.documents.load.documents import load
    from thingc.documents.workspace import Workspace

    nested: set[str] = set()
    for path in assemblies if len(assemblies) > 1 else ():
        workspace = Workspace.find(path, Report())
        documents = None if workspace is None else load(path, workspace, Report())
        if documents is not None and not documents.broken:
            nested.update(os.path.realpath(document.path) for document in documents.by_path.values() if document is not documents.root)
        else:
            with open(path, encoding="utf-8", errors="replace") as stream:
                named = re.findall(r"""\bassembly["']?\s*[:=]\s*["']?([^\s"',{}]+)""", stream.read())
            nested.update(os.path.realpath(os.path.join(os.path.dirname(path), document)) for document in named)
    return [path for path in assemblies if os.path.realpath(path) not in nested]


def add_compiling(parser: argparse.ArgumentParser) -> None:
    """Add the options of all commands that compile a document to a parser."""
    parser.add_argument(
        "-p", "--parameter", metavar="NAME=VALUE", action="append", default=[],
        help="set a parameter of the document (may be repeated)",
    )
    parser.add_argument(
        "--set", metavar="PATH=TEXT", action="append", default=[], dest="choice",
        help="set a value of the document by its path (may be repeated)",
    )
    parser.add_argument("--strict", action="store_true", help="treat warnings as errors")
    add_geometry(parser)


def add_editing(parser: argparse.ArgumentParser) -> None:
    """Add the options of commands that change values in a document."""
    parser.add_argument("--diff", action="store_true", help="show the changes without writing them")
    add_format(parser)
    parser.add_argument("--strict", action="store_true", help="treat warnings as errors")
    add_geometry(parser)


def add_geometry(parser: argparse.ArgumentParser, *, jobs: str = "number of parts to build in parallel") -> None:
    """Add the options for part geometry, such as `--store`, to a parser. `jobs` is the help text of the option `--jobs`."""
    parser.add_argument("--store", metavar="DIR", help="folder or URL of the part cache (default: THINGC_STORE or the user's cache)")
    parser.add_argument("--jobs", metavar="N", type=positive, default=0, help=f"{jobs} (default: one per core)")
    parser.add_argument("--part-timeout", metavar="TIME", help="time limit for building each part")
    parser.add_argument("--debug", action="store_true", help="show the Python traceback of each failed part")


def add_format(parser: argparse.ArgumentParser, choices: Sequence[str] = ("text", "json")) -> None:
    """Add the option `--format`, which selects the output format, to a parser."""
    metavar = "{" + ",".join(choices) + "}"
    parser.add_argument("--format", type=one_of(choices), metavar=metavar, default=choices[0], help="output format (default: %(default)s)")


def add_no_code(parser: argparse.ArgumentParser) -> None:
    """Add the option `--no-code`, with which a command runs no code of the workspace, to a parser."""
    parser.add_argument("--no-code", action="store_true", help="read parts from parts.lock.json instead of running Python code")


def one_of(known: Sequence[str]) -> Callable[[str], str]:
    """Return an argparse type that accepts only the words in `known`."""
    def choice(text: str) -> str:
        if text not in known:
            expected = ", ".join(f"`{known_word}`" for known_word in known[:-1]) + f" or `{known[-1]}`"
            close = nearest(text, known)
            raise argparse.ArgumentTypeError(f"expected {expected}, found `{text}`{f' (did you mean `{close}`?)' if close else ''}")
        return text

    return choice


def number_in(low: float, high: float, expected: str, parse: Callable[[str], Number]) -> Callable[[str], Number]:
    """Return an argparse type that accepts only numbers from `low` to `high`. The function `parse` raises `ValueError` for other text."""
    def number(text: str) -> Number:
        with suppress(ValueError):
            if low <= (value := parse(text)) <= high:
                return value
        raise argparse.ArgumentTypeError(f"expected {expected}, found `{text}`")

    return number


def whole(text: str) -> int:
    """Parse a whole number without a sign. Raises `ValueError`."""
    if not text.isdecimal():
        raise ValueError(text)
    return int(text)


positive = number_in(1, sys.maxsize, "a whole number of at least 1", whole)
"""An argparse type that accepts positive integers."""


def parameters(settings: Sequence[str]) -> Mapping[str, str]:
    """Convert the values of the option `-p NAME=VALUE` to a mapping from names to values.

    Raises `WrongCommandLine` for an invalid value.
    """
    example = "-p 'reach=120 mm'"
    for setting in settings:
        name, _, value = (piece.strip() for piece in setting.partition("="))
        if name and value and not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name):
            hint = f"write --set '{name}={value}'" if "." in name else f"write, for example, {example}"
            raise WrongCommandLine(f"expected -p NAME=VALUE, found `{setting}`", hint)
    return paths(settings, "-p NAME=VALUE", example, "-p sets `{}` twice")


def paths(settings: Sequence[str], form: str, example: str, duplicate_message: str, name: Callable[[str], str] = str) -> dict[str, str]:
    """Convert the values of the option `--set PATH=TEXT` to a mapping from paths to texts. Raises `WrongCommandLine` for an invalid value.

    `form` and `example` describe a correct argument in error messages. `duplicate_message` is the error message for two
    paths for which the function `name` returns the same name.
    """
    texts: dict[str, str] = {}
    for setting in settings:
        path, equals, text = (piece.strip() for piece in setting.partition("="))
        if not equals or not path or not text:
            raise WrongCommandLine(f"expected {form}, found `{setting}`", f"write, for example, {example}")
        if name(path) in map(name, texts):
            raise WrongCommandLine(duplicate_message.format(path), "keep only one of the two values")
        texts[path] = text
    return texts


def refuse_modules_of_others() -> None:
    """Raise `WrongCommandLine` if Python can import modules from the working folder, because its files are untrusted."""
    if "" in sys.path or os.getcwd() in sys.path and not sys.flags.safe_path:
        message = "Python can import untrusted modules from the working folder"
        raise WrongCommandLine(message, "run `thingc`, or `python -I -m thingc`")


def time_of(option: str, text: str) -> float:
    """Convert the value of an option to a duration [s]. Raises `WrongCommandLine` for an invalid value."""
    from thingc.base.units import TIME, UnitError, parse_quantity
    from thingc.documents.workspace import LONGEST

    try:
        quantity = parse_quantity(text)
    except UnitError as fault:
        raise WrongCommandLine(f"{option}: {fault}", f"write, for example, {option} '30 s'") from fault
    if quantity.dimension != TIME or not 0.0 < quantity.value <= LONGEST:
        bounds = "above 0" if quantity.value <= LONGEST else f"of at most {LONGEST:.0f} s"
        raise WrongCommandLine(f"{option}: expected a time {bounds}, found `{text}`", "write, for example, '30 s'")
    return quantity.value


def options_of(arguments: argparse.Namespace) -> Options:
    """Convert the command-line arguments to compile options. Raises `WrongCommandLine` or `UnknownChoice` for an invalid value."""
    from thingc.driver.pipeline import chosen_consumers

    timeout = None if arguments.part_timeout is None else time_of("--part-timeout", arguments.part_timeout)
    choices, example = getattr(arguments, "choice", []), "--set components.foot.part=feet:Wide"
    return Options(
        parameters=parameters(getattr(arguments, "parameter", [])),
        choices=paths(choices, "--set PATH=TEXT", example, "--set sets `{}` twice"),
        store=arguments.store, jobs=arguments.jobs, part_timeout=timeout,
        compat=chosen_consumers(",".join(getattr(arguments, "compat", []))) or None,
        progress=ProgressLine() if getattr(arguments, "format", "text") == "text" else None,
        printed=show_printed if getattr(arguments, "format", "text") == "text" else None,
    )


def compile_document(
    arguments: argparse.Namespace, process: Callable[[Environment, Compilation, Assembly], Answer], mode: str | None = None,
    **options: object,
) -> tuple[list[Diagnostic], Answer | None]:
    """Compile the document of a command in one mode, by default in all modes, and call `process` if the document has no errors.

    Return the diagnostics, and the result of `process`, or None after errors. `options` replaces compile options of the command line. The
    diagnostics contain an `UnknownChoice` that was raised. Raises `WrongCommandLine`.
    """
    from msgspec.structs import replace

    from thingc.driver import pipeline

    def compile_and_process(environment: Environment) -> tuple[list[Diagnostic], Answer | None]:
        compilation = pipeline.compile(environment, () if mode is None else [mode])
        assembly = None if exit_code(final(compilation.report, strict=arguments.strict)) else compilation.assembly
        answer = None if assembly is None else process(environment, compilation, assembly)
        return final(compilation.report, strict=arguments.strict), answer

    require_document(arguments.document)
    try:
        return with_environment(arguments.document, replace(options_of(arguments), **options), compile_and_process)
    except pipeline.UnknownChoice as fault:
        return [fault.diagnostic], None


def require_document(path: str) -> None:
    """Raise `WrongCommandLine` unless the path is a regular file with the suffix of a document, such as `.yaml`."""
    from thingc.documents.load.paths import DOCUMENT_SUFFIXES
    from thingc.documents.workspace import OWN_FILE, SHARED_FILE

    is_file, is_folder = os.path.isfile(path), os.path.isdir(path)
    if is_file and path.lower().endswith(DOCUMENT_SUFFIXES):
        return
    folder = path if is_folder else os.path.dirname(path) or "."
    prefix = os.path.join(path, "") if is_folder else os.path.dirname(path)
    nearby = [
        os.path.join(prefix, name) for name in listing(folder)
        if name.lower().endswith(DOCUMENT_SUFFIXES) and name not in (OWN_FILE, SHARED_FILE) and not name.startswith(".")
    ]
    if is_folder:
        raise WrongCommandLine(f"expected a document, found the folder `{path}`", suggest_document("", folder, nearby), Code.NO_DOCUMENT)
    if os.path.exists(path) and not is_file:
        raise WrongCommandLine(f"`{path}` is not a regular file", "use a regular file", Code.NO_DOCUMENT)
    if is_file:
        message = f"`{path}` is not a document ({', '.join(DOCUMENT_SUFFIXES)})"
        raise WrongCommandLine(message, file_meant(path, nearby, what="documents"), Code.NO_DOCUMENT)
    hint = suggest_document(path, folder if os.path.isdir(folder) else os.curdir, nearby)
    raise WrongCommandLine(f"there is no document `{path}`", hint, Code.NO_DOCUMENT)


def suggest_document(path: str, folder: str, nearby: Sequence[str]) -> Hint:
    """Return a hint for the error that the document `path` does not exist.

    The hint suggests a document with a similar name among the documents `nearby`, or else in the rest of the workspace of `folder`. If no
    name is similar, the hint lists all documents.
    """
    from thingc.documents.load.discovery import documents_near
    from thingc.documents.workspace import Workspace

    workspace = Workspace.find(os.path.join(os.path.abspath(folder), "document"), Report())
    stem, elsewhere = without_suffix(os.path.basename(path)), [shown_path(path) for path in documents_near(folder, workspace)]
    for known in (nearby, elsewhere):
        path_by_stem = {without_suffix(os.path.basename(path)): path for path in sorted(known, reverse=True)}
        close = nearest(stem, path_by_stem)
        if close is not None:
            return f"did you mean `{path_by_stem[close]}`?"
    return did_you_mean("", nearby or elsewhere, what="documents")


def expand_paths(arguments: Iterable[str]) -> list[str]:
    """Return the paths of the documents on the command line, without duplicates. A folder is replaced by all documents below the folder.

    Raises `WrongCommandLine` for a folder that contains no documents.
    """
    from thingc.documents.load.discovery import documents_in

    paths: dict[str, str] = {}
    for argument in arguments:
        inside = [argument]
        if os.path.isdir(argument):
            inside = [path if os.path.isabs(argument) else shown_path(path) for path in documents_in(argument)]
            if not inside:
                help = "start each document with its kind, such as `thingc: assembly/1`"
                raise WrongCommandLine(f"there is no document in `{argument}` or its subfolders", help, Code.NO_DOCUMENT)
        for path in inside:
            paths.setdefault(os.path.realpath(path), path)
    return list(paths.values())


def present(documents: Iterable[str], diagnostics: list[Diagnostic]) -> Iterator[str]:
    """Yield the paths of those documents that exist. For each other path, add an error to `diagnostics`."""
    for document in documents:
        try:
            require_document(document)
        except WrongCommandLine as fault:
            diagnostics.append(fault.diagnostic)
        else:
            yield document


class ProgressLine:
    """Displays on standard error how many steps of a computation are done, and the elapsed time [s].

    On a terminal, the progress is displayed in one line. Otherwise, a line is printed at the start, at the end and at most once per second.
    """

    def __init__(self) -> None:
        self._shown = time.monotonic()

    def __call__(self, what: str, done: int, total: int, seconds: float) -> None:
        """Display that `done` of `total` steps are done."""
        time_now = time.monotonic()
        line = f"{what}: {done} of {total} ({seconds:.0f} s)"
        if sys.stderr.isatty():
            say_in_place(line if done < total else "")
        elif seconds == 0.0 or done == total or time_now - self._shown >= 1:
            self._shown = time_now
            say(line, stream=sys.stderr)


def show_printed(part: str, lines: Sequence[str]) -> None:
    """Print the output of part code to standard error. Each line starts with the name of the part."""
    say_in_place()
    say(*(f"{part} | {line}" for line in lines), stream=sys.stderr)


def say_waiting(folder: str) -> None:
    """Print a message to standard error: this process waits until another process has written the same build folder."""
    say(f"waiting for another build of {shown_path(folder)}", stream=sys.stderr)


def say(*lines: str, stream: TextIO | None = None) -> None:
    """Print lines of text to `stream`, by default standard output. Use this function for all output except diagnostics.

    Control characters, for example in file names, are escaped.
    """
    stream = stream or sys.stdout
    stream.write("".join(f"{escape_control(line)}\n" for line in lines))
    stream.flush()


def say_diff(name: str, old: str, new: str) -> None:
    """Print the difference between two texts of a document as a unified diff. Control characters other than tabs are escaped."""
    lines = difflib.unified_diff(old.splitlines(keepends=True), new.splitlines(keepends=True), name, name)
    sys.stdout.write("".join(shown_line(line.rstrip("\r\n")) + "\n" for line in lines))


@contextmanager
def writing(path: str | None, help: str) -> Iterator[None]:
    """A context manager that converts an `OSError` to `WrongCommandLine`. `path` is the file that is written, or None for several files."""
    try:
        yield
    except OSError as fault:
        message = f"cannot write `{path or fault.filename}`: {(fault.strerror or str(fault)).lower()}"
        raise WrongCommandLine(message, help, Code.OUTPUT) from fault


def write_raw(content: bytes | str) -> None:
    """Write output for other programs, such as XML, to standard output. Control characters are not escaped."""
    if isinstance(content, str):
        sys.stdout.write(content)
    else:
        sys.stdout.flush()
        sys.stdout.buffer.write(content)


def say_in_place(line: str = "") -> None:
    """Print a line to standard error, which the next printed line overwrites. Do nothing if standard error is not a terminal."""
    if sys.stderr.isatty():
        sys.stderr.write(f"\r\x1b[K{escape_control(line)}")
        sys.stderr.flush()


def print_text(diagnostics: Sequence[Diagnostic], *, stream: TextIO, debug: bool, texts: Mapping[str, str] | None = None) -> int:
    """Print diagnostics as text with source excerpts and a summary, and return the exit code.

    On a terminal, the text is coloured unless NO_COLOR is set. `texts` maps file names in the diagnostics to the contents of documents that
    are not on disk.
    """
    if diagnostics:
        color = stream.isatty() and "NO_COLOR" not in os.environ
        print(as_text(diagnostics, color=color, debug=debug, texts=texts), file=stream)
        if counts := summary(diagnostics):
            print(counts, file=stream)
    return exit_code(diagnostics)


def print_json(diagnostics: Sequence[Diagnostic], **more: object) -> None:
    """Print diagnostics as one JSON object to standard output. `more` contains additional keys for this object."""
    print_data({"diagnostics": as_json(diagnostics), **more})


def print_data(value: Mapping[str, object]) -> None:
    """Print the given data as one JSON object to standard output."""
    import json

    sys.stdout.write(json_text(json.dumps(value, indent=2, ensure_ascii=False)) + "\n")


def print_found(
    diagnostics: Sequence[Diagnostic], form: str, *, stream: TextIO, debug: bool, texts: Mapping[str, str] | None = None, **more: object,
) -> int:
    """Print diagnostics in the output format `form`, and return the exit code.

    Text is written to `stream`, and all other formats to standard output. `more` contains additional keys for the JSON output.
    """
    if form == "text":
        print_text(diagnostics, stream=stream, debug=debug, texts=texts)
    elif form == "json":
        print_json(diagnostics, **more)
    else:
        from thingc.tools.reporting.ci_formats import as_github, as_sarif, repository

        base = repository(working_folder() or os.sep)
        if form == "github":
            sys.stdout.write(as_github(diagnostics, base=base))
        else:
            from thingc import __version__

            sys.stdout.write(as_sarif(diagnostics, base=base, version=__version__, documentation=_documentation()))
    return exit_code(diagnostics)


def print_result(arguments: argparse.Namespace, diagnostics: Sequence[Diagnostic], lines: Iterable[str], **more: object) -> int:
    """Print the result of a command: lines of text, or JSON with the keys in `more`. Return the exit code.

    In the text format, diagnostics are printed to standard error.
    """
    code = print_found(diagnostics, arguments.format, stream=sys.stderr, debug=arguments.debug, texts=None, **more)
    if arguments.format == "text":
        say(*lines)
    return code


def show_page(address: str, *, browser: bool) -> None:
    """Print the address of a page. If `browser` is true, also open it in a browser."""
    import webbrowser

    say(address)
    if browser and not webbrowser.open(address):
        say("cannot start a browser: open the address in your browser", stream=sys.stderr)


def _documentation() -> str | None:
    """Return the documentation URL in the metadata of the installed package, or None if the metadata does not contain a URL."""
    from importlib.metadata import PackageNotFoundError, metadata

    try:
        addresses = metadata("thingc").get_all("Project-URL") or []
    except PackageNotFoundError:
        return None
    labelled = (address.partition(",") for address in addresses)
    return next((url.strip() for label, _, url in labelled if label.strip().lower() == "diagnostics"), None)


def final(report: Report, *, strict: bool) -> list[Diagnostic]:
    """Return the diagnostics of a report in the order in which they are printed. If `strict` is true, warnings become errors."""
    return report.apply_strict(strict=strict).sorted_diagnostics()


def exit_code(diagnostics: Sequence[Diagnostic]) -> int:
    """Return the exit code for the diagnostics: 0 without errors, 2 if the code of an error is one of `USAGE_CODES`, else 1."""
    errors = [d for d in diagnostics if d.severity is Severity.ERROR]
    return USAGE if any(d.code in USAGE_CODES for d in errors) else 1 if errors else 0


def of_exception(fault: Exception) -> Diagnostic:
    """Convert an exception to an error diagnostic. Unexpected exceptions become internal errors."""
    if isinstance(fault, UserError):
        return fault.diagnostic
    from thingc.geometry.store.local import StoreUnusable
    from thingc.tools.affected.dependents import NotARepository

    if isinstance(fault, NotARepository):
        return error(f"git failed: {fault}", "run the command in a Git repository, or compare two files", Code.COMMAND_LINE)
    if isinstance(fault, FileNotFoundError) and working_folder() is None:
        help = "change to an existing folder with `cd`"
        return error("the working folder no longer exists", help, Code.WORKING_FOLDER)
    if isinstance(fault, StoreUnusable):
        help = "choose a writable folder with --store or THINGC_STORE"
        return error(f"the cache `{fault.root}` cannot be used: {fault.reason}", help, Code.OUTPUT)
    if isinstance(fault, OSError) and (fault.filename is not None or fault.errno in NO_ROOM):
        kind = PermissionError if fault.errno == errno.EROFS else type(fault)
        where = "cannot write a file" if fault.filename is None else f"`{shown_path(str(fault.filename))}`"
        help = "choose a shorter name" if fault.errno == errno.ENAMETOOLONG else _CURES.get(kind, "free disk space, or use another folder")
        return error(f"{where}: {fault.strerror or fault}", help, Code.OUTPUT)
    import traceback

    message = f"internal error: {type(fault).__name__}: {' '.join(str(fault).split())}"
    help = "report this bug in thingc with the output of --debug"
    return error(message, help, Code.INTERNAL, "".join(traceback.format_exception(fault)))


_CURES: Mapping[type[OSError], str] = {
    FileExistsError: "move or delete the existing file", NotADirectoryError: "move or delete the file",
    IsADirectoryError: "move or delete the folder",
    PermissionError: "change the permissions, or choose another folder",
    FileNotFoundError: "run the command again",
}


USAGE_CODES = frozenset({
    Code.COMMAND_LINE, Code.WORKING_FOLDER, Code.NO_DOCUMENT, Code.PARAMETER_OPTION, Code.CHOICE_OPTION, Code.UNEXPECTED, Code.OUTPUT,
    Code.NO_GRAPHICS, Code.BATCH_LOCKED, Code.BATCH_UNFINISHED, Code.BATCH_CHANGED, Code.NO_BATCH,
})


def table(rows: Sequence[tuple[str, ...]], right: tuple[int, ...] = ()) -> list[str]:
    """Format rows of equal length as lines with aligned columns. The columns whose indices are in `right` are right-aligned."""
    rows = [tuple(map(escape_control, row)) for row in rows]
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    return [
        "  ".join(cell.rjust(w) if k in right else cell.ljust(w) for k, (cell, w) in enumerate(zip(row, widths))).rstrip()
        for row in rows
    ]


def millimetres(place: Vector) -> str:
    """Convert a position from metres to a text in millimetres, such as `0 120 30.5`. The numbers are rounded to 0.1 µm."""
    return " ".join(f"{round(1000.0 * x, 4) + 0.0:g}" for x in place)


def axes(rotation: Matrix) -> str:
    """Format the directions of the x, y and z axes of a frame relative to its parent frame.

    Axes that are parallel to axes of the parent are formatted as `+x, -y, -z`. Other axes are formatted as direction vectors.
    """
    return ", ".join(axis_name(axis) or f"({' '.join(f'{x:z.3f}' for x in axis)})" for axis in transpose(rotation))
