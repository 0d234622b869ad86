"""`thingc add`: a part, assembly, mode, joint or test to begin with, where it belongs; comments and layout of documents stay."""

from __future__ import annotations

import argparse
import dataclasses
import hashlib
import sys
from collections.abc import Mapping, Sequence
from typing import get_args

from msgspec.structs import replace

from thingc.base.diagnostics import Diagnostic, Report, Severity, shown_path
from thingc.base.joints.kind import JointType
from thingc.base.memo import Memo
from thingc.base.replacement import Change, provisional
from thingc.base.source import Document
from thingc.documents.format.formatting import format_document, is_laid_out
from thingc.documents.format.value_edits import CannotSetValue, set_values, without
from thingc.documents.load.documents import Documents, read_tree, remember
from thingc.driver.edit_document import checked, document_change, opened
from thingc.driver.environment import Options
from thingc.tools.cli import console, signals
from thingc.tools.cli.add_templates import BASES, STUBS, DocumentEdit

EPILOG = """\
Nothing is written unless all of the document would be right with what is added. It is a stub: change it as you like.

  thingc add part Bracket --to rover.yaml --on base.top       parts/bracket.py with a class, and a component that is one
  thingc add part links:Bracket                               only the class, in parts/links.py
  thingc add part thingc_stock.servos:MG90S --to rover.yaml --on bracket.top --by flange --name hip
                                                              a component that is a part which is there
  thingc add joint hinge --to rover.yaml --parent base.top --child bracket.bottom
  thingc add mode hung --to rover.yaml --root bracket.top --base held
  thingc add mode on_left --to rover.yaml --standing-on left.sole
  thingc add test light --to rover.yaml --kind mass
  thingc add assembly leg --to rover.yaml                     leg.yaml, and a component that is one
  thingc add assembly leg --to rover.yaml --on body.left --by hip --name left --param 'length=80 mm'
                                                              another one of a document that is there
"""
WHAT = ("part", "assembly", "mode", "joint", "test")
OPTIONS = {
    "on": ("part", "assembly"), "at": ("part", "assembly"), "by": ("part", "assembly"), "component": ("part", "assembly"),
    "param": ("part", "assembly"), "new": ("part",), "root": ("mode",), "base": ("mode",), "pose": ("mode",),
    "standing_on": ("mode",), "gravity": ("mode",), "type": ("joint",), "parent": ("joint",),
    "child": ("joint",), "loop": ("joint",), "kind": ("test",),
}
"""What each option belongs to."""


def configure(parser: argparse.ArgumentParser) -> None:
    """The options of `add`."""
    parser.epilog = EPILOG
    add = parser.add_argument
    add("what", type=console.one_of(WHAT), metavar="{" + ",".join(WHAT) + "}", help="what is added")
    add("name", metavar="NAME", help="its name; of a part its class or MODULE:CLASS, of an assembly its document, there or not")
    add("--to", metavar="DOC", help="the document that it is added to; a part or an assembly may be for none yet")
    add("--on", metavar="MOUNT", help="of a part or an assembly: the mount that it is attached to")
    add("--by", metavar="MOUNT", help="of a part or an assembly: the mount of its own that meets that of --on")
    add("--at", metavar="MOUNT", help="of a part or an assembly: the frame that its own is laid into, instead of --on")
    add("--name", metavar="NAME", dest="component", help="of a part or an assembly: what the component is called; as the part unless given")
    add(
        "--param", metavar="NAME=VALUE", action="append",
        help="of a part or an assembly: a parameter of it, for example 'length=80 mm' (may be repeated)",
    )
    add("--new", action="store_true", default=None, help="of a part: a class to begin with, also where another one is called nearly so")
    add("--root", metavar="ROOT", help="of a mode: a component or a mount; that of the first mode unless given")
    add(
        "--base", type=console.one_of(BASES), metavar="{" + ",".join(BASES) + "}",
        help="of a mode: the first that no other mode with this root has, unless given",
    )
    add(
        "--standing-on", metavar="MOUNT", action="append",
        help="of a mode: the mount that is its root and is held on the floor; with --base free, or of several, the floor carries them",
    )
    add("--pose", metavar="POSE", help="of a mode: where it starts; as the first mode does unless given")
    add("--gravity", metavar="GRAVITY", help="of a mode: wall, ceiling, or three accelerations; floor unless given")
    add("--type", type=console.one_of(get_args(JointType)), metavar="TYPE", help="of a joint: its kind; revolute unless given")
    add("--parent", metavar="MOUNT", help="of a joint: the mount that it is measured from")
    add("--child", metavar="MOUNT", help="of a joint: the mount that moves; what had placed its component is taken out")
    add("--loop", action="store_true", default=None, help="of a joint: closes a loop instead of placing the child")
    add("--kind", metavar="KIND", help="of a test: what it measures, for example mass")
    console.add_format(parser)
    console.add_geometry(parser)


def run(arguments: argparse.Namespace) -> int:
    """Exit code 0 where it is added."""
    try:
        return _add(arguments, console.options_of(arguments))
    except console.WrongCommandLine as fault:
        return _say(arguments, [fault.diagnostic])


def _add(arguments: argparse.Namespace, options: Options) -> int:
    what = arguments.what
    for option, owners in OPTIONS.items():
        if getattr(arguments, option) is not None and what not in owners:
            written = "--name" if option == "component" else "--" + option.replace("_", "-")
            meant = " or ".join(map(_article, owners))
            raise console.WrongCommandLine(f"{written} is for {meant}, and this is {_article(what)}", "take it out")
    if arguments.to is None:
        if what not in ("part", "assembly"):
            help = f"write for example `thingc add {what} {arguments.name} --to robot.yaml`"
            raise console.WrongCommandLine(f"{_article(what)} belongs to a document", help)
        for option in ("on", "at", "by"):
            if getattr(arguments, option) is not None:
                raise console.WrongCommandLine(f"--{option} places it in the document that --to names", "write --to as well")
        return _write(arguments, options, None, STUBS[what](arguments, None))
    if arguments.on is not None and arguments.at is not None:
        raise console.WrongCommandLine("--on and --at both say where it is", "keep one of them: --on attaches a mount, --at lays a frame")
    if arguments.by is not None and arguments.on is None:
        raise console.WrongCommandLine("--by names what meets a mount, and which mount is not said", "write --on as well")
    console.require_document(arguments.to)
    memo = Memo()
    documents = opened(arguments.to, options, memo)
    if documents is None:
        return _say(arguments, checked(arguments.to, options)[1])
    return _write(arguments, options, documents, STUBS[what](arguments, documents), memo)


def _write(
    arguments: argparse.Namespace, options: Options, documents: Documents | None, addition: DocumentEdit, memo: Memo | None = None,
) -> int:
    """Write files and document, unless something would be wrong then. `memo` knows the documents. Raises `ReplacementRefused`."""
    with provisional(addition.files) as keep:
        diagnostics: list[Diagnostic] = []
        changes: dict[str, Change] = {}
        if documents is not None:
            root = documents.root
            changed, memo = _with_addition(root, addition), memo or Memo()
            before, after = document_change(root, changed.text)
            remember(dataclasses.replace(changed, sha256=hashlib.sha256(after).hexdigest()), memo)
            _, diagnostics = checked(root.path, replace(options, texts={root.path: after}), memo=memo)
            if _wrong(diagnostics):
                _, already = checked(root.path, options)
                return _say(arguments, already) if _wrong(already) else _say(arguments, diagnostics, texts={root.path: changed.text})
            changes[root.path] = before, after
        with signals.held():
            keep(changes)
    where = [] if documents is None else [f"{shown_path(documents.root.path)}: {'.'.join(keys)}" for keys in addition.values]
    return _say(arguments, diagnostics, done=[*map(shown_path, addition.files), *where])


def _wrong(diagnostics: Sequence[Diagnostic]) -> bool:
    return any(one.severity is Severity.ERROR for one in diagnostics)


def _with_addition(root: Document, addition: DocumentEdit) -> Document:
    """The document with it; laid out, where it was laid out before. Raises `WrongCommandLine` where that cannot be."""
    document = root
    try:
        for keys in addition.placed:
            document = without(document, keys)
        document = set_values(document, addition.values)
    except CannotSetValue as fault:
        raise console.WrongCommandLine(str(fault), "write it by hand") from fault
    laid_out = format_document(document.path, document.text.encode(), Report(), tree=document.tree) if is_laid_out(root) else None
    if laid_out is None or laid_out == document.text.encode():
        return document
    tree = read_tree(document.path, laid_out, Report())
    return document if tree is None else dataclasses.replace(document, text=laid_out.decode(), tree=tree)


def _article(what: str) -> str:
    return f"an {what}" if what == "assembly" else f"a {what}"


def _say(
    arguments: argparse.Namespace, diagnostics: Sequence[Diagnostic], *, done: Sequence[str] = (), texts: Mapping[str, str] | None = None,
) -> int:
    """Print what was added, or why nothing was; `texts` are those of documents as they would be."""
    if arguments.format == "text":
        console.say(*done)
    return console.print_found(diagnostics, arguments.format, stream=sys.stdout, debug=arguments.debug, texts=texts, added=list(done))
