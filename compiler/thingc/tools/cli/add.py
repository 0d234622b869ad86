"""Implementation of `thingc add`, which adds a part, assembly, mode, joint or test to a document, and preserves its comments and layout.

Adds a stub for you to edit. If the changed document would have errors, nothing is written.

  thingc add part Bracket --to rover.yaml --on base.top       add the class Bracket in parts/bracket.py, and a component
  thingc add part links:Bracket                               add only the class, in parts/links.py
  thingc add part thingc_stock.servos:MG90S --to rover.yaml --on bracket.top --by flange --name hip
                                                              add a component of an existing part
  thingc add joint hinge --to rover.yaml --parent base.top --child bracket.bottom
  thingc add mode hung --to rover.yaml --root bracket.top --base held
  thingc add mode on_left --to rover.yaml --standing-on left.sole
  thingc add test light --to rover.yaml --kind mass
  thingc add assembly leg --to rover.yaml                     create leg.yaml, and add a component
  thingc add assembly leg --to rover.yaml --on body.left --by hip --name left --param 'length=80 mm'
                                                              add a component of an existing document
"""

from __future__ import annotations

import argparse
import dataclasses
import hashlib
import sys
from collections.abc import Mapping, Sequence
from typing import get_args

from msgspec.structs import replace

from thingc.base.diagnostics import Diagnostic, Report, shown_path
from thingc.base.joints.kinds import JointType
from thingc.base.memo import Memo
from thingc.base.replacement import Change, provisional
from thingc.base.source import Document
from thingc.documents.format.formatting import format_document, is_formatted
from thingc.documents.format.value_edits import CannotSetValue, remove_value, set_values
from thingc.documents.load.documents import Documents, read_tree, remember
from thingc.driver.edit_document import check_document, document_change, load_documents
from thingc.driver.environment import Options
from thingc.tools.cli import console, signals
from thingc.tools.cli.add_templates import BASES, STUBS, DocumentEdit

OPTIONS = {
    "on": ("part", "assembly"), "at": ("part", "assembly"), "by": ("part", "assembly"), "component": ("part", "assembly"),
    "param": ("part", "assembly"), "new": ("part",), "root": ("mode",), "base": ("mode",), "pose": ("mode",),
    "standing_on": ("mode",), "gravity": ("mode",), "type": ("joint",), "parent": ("joint",),
    "child": ("joint",), "loop": ("joint",), "kind": ("test",),
}
"""The kinds of elements with which each option can be used."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options of `thingc add` to the parser."""
    add = parser.add_argument
    add("what", type=console.one_of(list(STUBS)), metavar="{" + ",".join(STUBS) + "}", help="kind of the new element")
    add("name", metavar="NAME", help="name, part class or document of the new element")
    add("--to", metavar="DOC", help="document to change (optional for parts and assemblies)")
    add("--on", metavar="MOUNT", help="mount to which the new component is attached")
    add("--by", metavar="MOUNT", help="mount of the new component to attach (requires --on)")
    add("--at", metavar="MOUNT", help="mount at which the origin of the new component is placed")
    add("--name", metavar="NAME", dest="component", help="name of the new component (default: from the part)")
    add("--param", metavar="NAME=VALUE", action="append", help="parameter of the new component (may be repeated)")
    add("--new", action="store_true", default=None, help="create a part class even if a similar class exists")
    add("--root", metavar="ROOT", help="component or mount at the root of the new mode (default: the root of the first mode)")
    add(
        "--base", type=console.one_of(BASES), metavar="{" + ",".join(BASES) + "}",
        help="base type in the new mode (default: the first unused type)",
    )
    add("--standing-on", metavar="MOUNT", action="append", help="mount that touches the floor in the new mode (may be repeated)")
    add("--pose", metavar="POSE", help="start pose of the new mode (default: the pose of the first mode)")
    add("--gravity", metavar="GRAVITY", help="gravity in the new mode: floor, wall, ceiling or a vector (default: floor)")
    add("--type", type=console.one_of(get_args(JointType)), metavar="TYPE", help="type of the new joint (default: revolute)")
    add("--parent", metavar="MOUNT", help="parent mount of the new joint")
    add("--child", metavar="MOUNT", help="child mount of the new joint")
    add("--loop", action="store_true", default=None, help="close a loop with the new joint")
    add("--kind", metavar="KIND", help="kind of the new test")
    console.add_no_code(parser)
    console.add_format(parser)
    console.add_geometry(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run `thingc add`, and return the exit code, which is 0 if the element was added."""
    try:
        return _add(arguments, replace(console.options_of(arguments), code=not arguments.no_code))
    except console.WrongCommandLine as fault:
        return _say(arguments, [fault.diagnostic])


def _add(arguments: argparse.Namespace, options: Options) -> int:
    kind = arguments.what
    if kind == "part" and arguments.no_code:
        raise console.WrongCommandLine("--no-code cannot be used to add a part", "remove the option")
    for option, owners in OPTIONS.items():
        if getattr(arguments, option) is not None and kind not in owners:
            option_text = "--name" if option == "component" else "--" + option.replace("_", "-")
            allowed_kinds = " or ".join(map(_article, owners))
            raise console.WrongCommandLine(f"{option_text} applies to {allowed_kinds}, not to {_article(kind)}", "remove the option")
    if arguments.to is None:
        if kind not in ("part", "assembly"):
            help = f"write, for example, `thingc add {kind} {arguments.name} --to robot.yaml`"
            raise console.WrongCommandLine(f"{_article(kind)} requires a document", help)
        for option in ("on", "at", "by"):
            if getattr(arguments, option) is not None:
                raise console.WrongCommandLine(f"--{option} requires --to", "add --to with the document")
        return _write(arguments, options, None, STUBS[kind](arguments, None))
    if arguments.on is not None and arguments.at is not None:
        raise console.WrongCommandLine("--on cannot be combined with --at", "use only one of the two options")
    if arguments.by is not None and arguments.on is None:
        raise console.WrongCommandLine("--by requires --on", "add --on with the mount")
    console.require_document(arguments.to)
    memo = Memo()
    documents = load_documents(arguments.to, options, memo)
    if documents is None:
        return _say(arguments, check_document(arguments.to, options)[1])
    return _write(arguments, options, documents, STUBS[kind](arguments, documents), memo)


def _write(
    arguments: argparse.Namespace, options: Options, documents: Documents | None, addition: DocumentEdit, memo: Memo | None = None,
) -> int:
    """Write the changed document and the new files to disk, unless the changed document has errors. Raises `ReplacementRefused`.

    `memo` caches documents that were already parsed.
    """
    with provisional(addition.files) as keep:
        diagnostics: list[Diagnostic] = []
        changes: dict[str, Change] = {}
        if documents is not None:
            root = documents.root
            changed, memo = _with_addition(root, addition), memo or Memo()
            old, new = document_change(root, changed.text)
            remember(dataclasses.replace(changed, sha256=hashlib.sha256(new).hexdigest()), memo)
            _, diagnostics = check_document(root.path, replace(options, texts={root.path: new}), memo=memo)
            if console.exit_code(diagnostics):
                _, already = check_document(root.path, options)
                if console.exit_code(already):
                    return _say(arguments, already)
                code = _say(arguments, diagnostics, texts={root.path: changed.text})
                console.say(f"{shown_path(root.path)} was not changed (the diagnostics refer to the new text)", stream=sys.stderr)
                return code
            changes[root.path] = old, new
        with signals.delay_signals():
            keep(changes)
    where = [] if documents is None else [f"{shown_path(documents.root.path)}: {'.'.join(keys)}" for keys in addition.values]
    return _say(arguments, diagnostics, lines=[*map(shown_path, addition.files), *where])


def _with_addition(root: Document, addition: DocumentEdit) -> Document:
    """Return the text of the document with the new element. A document in canonical layout stays in canonical layout.

    Raises `WrongCommandLine` if the element cannot be added.
    """
    document = root
    try:
        for keys in addition.placed:
            document = remove_value(document, keys)
        document = set_values(document, addition.values)
    except CannotSetValue as fault:
        raise console.WrongCommandLine(str(fault), "edit the document by hand") from fault
    laid_out = format_document(document.path, document.text.encode(), Report(), tree=document.tree) if is_formatted(root) else None
    if laid_out is None or laid_out == document.text.encode():
        return document
    tree = read_tree(document.path, laid_out, Report())
    return document if tree is None else dataclasses.replace(document, text=laid_out.decode(), tree=tree)


def _article(what: str) -> str:
    return f"an {what}" if what == "assembly" else f"a {what}"


def _say(
    arguments: argparse.Namespace, diagnostics: Sequence[Diagnostic], *, lines: Sequence[str] = (), texts: Mapping[str, str] | None = None,
) -> int:
    """Print the elements that were added to the document, or the errors. `texts` are the contents of the changed documents."""
    if arguments.format == "text":
        console.say(*lines)
    return console.print_found(diagnostics, arguments.format, stream=sys.stdout, debug=arguments.debug, texts=texts, added=list(lines))
