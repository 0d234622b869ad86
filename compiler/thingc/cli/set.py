"""`thingc set`: writes values into a document, at their paths; its comments and layout stay."""

from __future__ import annotations

import argparse
import difflib
import hashlib
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace

from thingc import pipeline
from thingc.cli import common
from thingc.diagnostics import Code, Diagnostic, Severity, Stage, shown_path
from thingc.environment import Environment, Options
from thingc.layout import write_in_place
from thingc.layout.setting import Keys, Unsettable, changes, with_values
from thingc.load import Documents
from thingc.printing import OPTIONS
from thingc.source import Document, MappingNode, node_at
from thingc.spec.choices import nested, parse

EPILOG = """\
A value is named as by --set of the other commands, by its path; a parameter of the document by its name, or as parameters.NAME.
Nothing is written unless all of the document would be right with all of the values.

  thingc set assemblies/arm.yaml 'joints.elbow.limit.upper=90 deg' 'reach=120 mm'
  thingc set robot.yaml components.foot.part=feet:Wide
  thingc set robot.yaml 'components.plate.mass=82 g' --diff      show it, and write nothing
"""


def configure(parser: argparse.ArgumentParser) -> None:
    """The options of `set`."""
    parser.epilog = EPILOG
    parser.add_argument("document", metavar="DOC", help="an assembly document (YAML or TOML)")
    parser.add_argument("value", metavar="PATH=VALUE", nargs="+", help="a path, or the name of a parameter, and what shall stand there")
    parser.add_argument("--diff", action="store_true", help="write nothing, show what would change")
    common.add_format(parser)
    parser.add_argument("--strict", action="store_true", help="warnings are errors")
    common.add_geometry(parser)


def run(arguments: argparse.Namespace) -> int:
    """Exit code 0 where the values are written (with `--diff`: could be)."""
    try:
        common.require_document(arguments.document)
        options = common.options_of(arguments)
        given = settings(arguments.value)
    except common.WrongCommandLine as fault:
        common.print_found([fault.diagnostic], arguments.format, stream=sys.stdout, debug=False)
        return common.USAGE
    return write(arguments.document, given, options, arguments, diff=arguments.diff)


def settings(words: Sequence[str]) -> dict[str, str]:
    """`PATH=VALUE` words to a mapping. Raises `WrongCommandLine`."""
    values: dict[str, str] = {}
    for word in words:
        path, equals, value = (piece.strip() for piece in word.partition("="))
        if not equals or not path or not value:
            raise common.WrongCommandLine(f"expected PATH=VALUE, found `{word}`", "write for example 'joints.elbow.limit.upper=90 deg'")
        if _named(path) in map(_named, values):
            raise common.WrongCommandLine(f"`{path}` is set twice", "keep one of them")
        values[path] = value
    return values


def write(document: str, given: Mapping[str, str], options: Options, arguments: argparse.Namespace, *, diff: bool = False) -> int:
    """Write values (paths or names of parameters to texts) into a document, unless something would be wrong with it then; says what.
    Of the `arguments` only `format` and `debug`, and `strict` if it is there, are looked at. The exit code."""
    typed = {_named(path): f"{path}={text}" for path, text in given.items()}
    given = {_named(path): text for path, text in given.items()}
    parameters = {path: text for path, text in given.items() if "." not in path}
    choices = {path: text for path, text in given.items() if "." in path}
    strict = getattr(arguments, "strict", False)
    documents, diagnostics = checked(document, replace(options, parameters=parameters, choices=choices), strict=strict)
    if documents is None or any(d.code in (Code.CHOICE_OPTION, Code.PARAMETER_OPTION) for d in diagnostics):
        return _say(arguments, [_as_typed(one, typed) for one in diagnostics])
    root = documents.root
    elsewhere = [fault for path in choices if (fault := _elsewhere(root, path)) is not None]
    if elsewhere:
        return _say(arguments, elsewhere)
    values = {_keys(root, path): text for path, text in given.items()}
    try:
        text = with_values(root, values)
    except Unsettable as fault:
        return _say(arguments, [_wrong(str(fault), "write it by hand")])
    before, after = both(root, text)
    _, diagnostics = checked(document, replace(options, texts={root.path: after}), strict=strict)
    if any(d.severity is Severity.ERROR for d in diagnostics):
        return _say(arguments, diagnostics, texts={root.path: text})
    if diff:
        name = shown_path(root.path)
        common.say_lines_of_documents(difflib.unified_diff(root.text.splitlines(), text.splitlines(), name, name, lineterm=""))
        return common.exit_code(diagnostics)
    refused = put(root, before, after)
    if refused is not None:
        return _say(arguments, [refused])
    return _say(arguments, diagnostics, done=list(changes(root, values)))


def _named(path: str) -> str:
    """A parameter by its name alone, also one that is written `parameters.reach`; other paths as they are."""
    name = path.removeprefix("parameters.")
    return path if "." in name else name


def _as_typed(found: Diagnostic, typed: Mapping[str, str]) -> Diagnostic:
    """What is said of a value as of an option of other commands (`-p`, `--set`), said of the words that were typed here."""
    option = next((option for option in OPTIONS if found.path is not None and found.path.startswith(option)), None)
    if option is None or found.path is None:
        return found
    path = found.path.removeprefix(option).partition("=")[0]
    return replace(found, path=f"set {typed.get(path, path)}")


def both(root: Document, text: str) -> tuple[bytes, bytes]:
    """The bytes of a document as they are, and as they would be with that text. Raises OSError where it cannot be read."""
    with open(root.path, "rb") as stream:
        before = stream.read()
    return before, (b"\xef\xbb\xbf" if before.startswith(b"\xef\xbb\xbf") else b"") + text.encode()


def put(root: Document, before: bytes, after: bytes) -> Diagnostic | None:
    """Put new bytes into a document; why not, where it cannot be written or is not what was read any more."""
    name = shown_path(root.path)
    message = f"`{name}` has changed meanwhile, and is left as it is"
    if hashlib.sha256(before).hexdigest() == root.sha256:
        try:
            write_in_place(root.path, after)
        except OSError as fault:
            message = f"cannot write `{name}`: {(fault.strerror or str(fault)).lower()}"
        else:
            return None
    return Diagnostic(code=Code.OUTPUT, severity=Severity.ERROR, message=message)


def checked(document: str, options: Options, *, strict: bool = False) -> tuple[Documents | None, list[Diagnostic]]:
    """The document with all that it names, None where it cannot be read, and what a check says of it."""
    with Environment(document, replace(options, lock=True)) as environment:
        compilation = pipeline.compile(environment)
    pipeline.say_unneeded(compilation, [Stage.CHECK])
    return compilation.documents, common.final(compilation.report, strict=strict)


def _keys(root: Document, path: str) -> Keys:
    """Where a path, or a parameter, is written."""
    if "." in path:
        return tuple(path.split("."))
    full = isinstance(node_at(root.tree, ("parameters", path)), MappingNode)
    return ("parameters", path, "value") if full else ("parameters", path)


def _elsewhere(root: Document, path: str) -> Diagnostic | None:
    """What to say of a path that does not end in this document itself."""
    through = nested(path)
    if through is None:
        choice = parse(path)
        name = choice.components[0] if choice is not None and choice.components else None
        if name is None or node_at(root.tree, ("components", name)) is not None:
            return None
        return _wrong(f"`{path}` is one of a repeated component: it has no line of its own", "set it for all of them")
    component, rest = through
    text = node_at(root.tree, ("components", component, "assembly"))
    inner = getattr(text, "text", "the nested document")
    return _wrong(
        f"`{path}` is written in `{inner}`, and would hold for every component that is one", f"`thingc set {inner} '{rest}=...'`"
    )


def _wrong(message: str, help: str) -> Diagnostic:
    return Diagnostic(code=Code.COMMAND_LINE, severity=Severity.ERROR, message=message, help=help)


def _say(
    arguments: argparse.Namespace, found: Sequence[Diagnostic], *, done: Sequence[tuple[str, str | None, str]] = (),
    texts: Mapping[str, str] | None = None,
) -> int:
    """Print what was found and done; `texts` are those of documents as they would be."""
    if arguments.format == "text":
        for path, old, new in done:
            common.say(f"{path}: {'' if old is None else old + ' -> '}{new}")
        if done and found:
            common.say("")
        common.print_text(found, stream=sys.stdout, debug=arguments.debug, texts=texts)
    else:
        common.print_json(found, set=[{"path": path, "before": old, "after": new} for path, old, new in done])
    return common.exit_code(found)
