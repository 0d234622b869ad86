"""Read a document and all documents that it references, and parse them to trees with source positions."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import TYPE_CHECKING

from thingc.base.bom_values import PICTURE_SUFFIXES
from thingc.base.diagnostics import Code, Note, Report
from thingc.base.filesystem import beginning
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.memo import Memo
from thingc.base.safe_text import find_invisible
from thingc.base.source import Document, MappingNode, Node, ScalarNode, SequenceNode, Span, entries_of
from thingc.base.suggestions import did_you_mean, near_hint, nearest
from thingc.base.units import shorten
from thingc.documents.load import paths
from thingc.documents.load.discovery import find_packaged, is_packaged
from thingc.documents.load.paths import CATALOG_SUFFIXES, DOCUMENT_SUFFIXES
from thingc.documents.load.text import MAX_ALL_BYTES, MAX_BYTES, MAX_FAULTS, decode

if TYPE_CHECKING:
    from thingc.documents.workspace import Workspace

KINDS: dict[str, str] = {"assembly": "1", "materials": "1", "variants": "1", "calibration": "1", "workspace": "1"}
"""Kinds of documents, each with its supported version."""

MAX_CHAIN = 100
"""Maximum depth of nested documents."""


class Documents(FrozenStruct):
    """A parsed root document and all parsed documents that it references, directly or indirectly.

    `by_path` is keyed by path in the workspace, in the order of first reference. `links` maps pairs (path of a document, reference in this
    document) to the path of the referenced document. `broken` contains the paths of documents on a reported cycle of assemblies. `files`
    contains the absolute paths of all referenced files in the workspace, existing or not, and all paths that were examined to find
    documents of packages. Symbolic links in these paths are not resolved.
    """

    root: Document
    by_path: dict[str, Document]
    links: dict[tuple[str, str], str] = {}
    broken: frozenset[str] = frozenset()
    files: frozenset[str] = frozenset()

    def find_referenced(self, document: Document, text: str) -> Document | None:
        """Return the document to which the reference `text` in `document` points, or None if that document could not be read."""
        path = self.links.get((document.relative, text))
        return None if path is None else self.by_path.get(path)


def load(
    document: str, workspace: Workspace, report: Report, *, kinds: Collection[str] = ("assembly",),
    texts: Mapping[str, bytes] | None = None, memo: Memo | None = None,
) -> Documents | None:
    """Read a document and all documents that its keys `assembly:` and `materials:` reference, directly or indirectly.

    Add all errors to `report`. Return all documents that can be read, or None if the root document cannot be read. `kinds` contains the
    accepted kinds of the root document. `texts` maps absolute paths to contents that replace the contents on disk. `memo` caches parsed
    documents.
    """
    path = os.path.abspath(document)
    name = shorten(os.path.basename(path))
    if not path.lower().endswith(DOCUMENT_SUFFIXES):
        report.add(Code.FILE_TYPE, f"expected a document ({', '.join(DOCUMENT_SUFFIXES)}), found `{name}`", None)
        return None
    if not workspace.contains(path):
        report.add(
            Code.OUTSIDE_WORKSPACE, f"`{name}` is a symbolic link to a file outside the workspace", None,
            help="use the file that the link points to",
        )
        return None
    if find_invisible(workspace.relative(path)):
        paths.refuse_name(workspace.relative(path), None, report)
        return None
    reader = _Reader(workspace, report, texts, memo)
    root = reader.read(path)
    if root is None:
        return None
    if root.kind not in kinds:
        _report_kind(root, kinds, report)
        return None
    reader.follow(root, [])
    return reader.documents(root)


def remember(document: Document, memo: Memo) -> None:
    """Cache a parsed document, so that `load` returns it for the same path and content."""
    memo.keep(*_cache_inputs(document.path, document.relative, document.sha256), document)


def _cache_inputs(path: str, relative: str, sha256: str) -> tuple[tuple[str, str, str], tuple[str]]:
    """Return the key and the inputs by which a document is cached.

    The key contains the path of the document in the workspace, and the inputs contain the digest of its content.
    """
    return ("document", path, relative), (sha256,)


def load_more(documents: Documents, texts: Iterable[str], workspace: Workspace, report: Report) -> Documents:
    """Read additional assemblies and the documents that they reference, and return them together with `documents`.

    `texts` contains the paths of the additional assemblies, relative to the root document. Documents that have already been read are not
    read again. Only errors of new documents are reported.
    """
    reader = _Reader(workspace, report)
    reader.by_path.update(documents.by_path)
    reader.links.update(documents.links)
    reader.done.update(documents.by_path)
    reader.broken.update(documents.broken)
    reader.files.update(documents.files)
    for text in texts:
        document = reader.read_referenced(documents.root, text, None, "assembly")
        if document is not None:
            reader.follow(document, [])
    return reader.documents(documents.root)


def _report_kind(root: Document, kinds: Collection[str], report: Report) -> None:
    """Report that the root document has a kind that the command does not accept, such as `materials` instead of `assembly`."""
    if root.kind == "variants":
        report.add(
            Code.WRONG_KIND, "expected an assembly document, found a variants document", root.span(("thingc",)),
            help="use `thingc batch` to build variants, or use an assembly document",
        )
        return
    *first_kinds, last = (f"`{kind}`" for kind in kinds)
    expected = f"{', '.join(first_kinds)} or {last}" if first_kinds else last
    report.add(
        Code.WRONG_KIND, f"expected a document of kind {expected}, found `{root.kind}`", root.span(("thingc",)), help=(
            "use a variants document, or `thingc build` to build one assembly" if kinds == ("variants",)
            else "use `thingc calibration ROBOT FILE`" if root.kind == "calibration" or kinds == ("calibration",)
            else "use the assembly that lists this document" if root.kind == "materials"
            else "use the assembly document"
        ),
    )


def read_tree(path: str, data: bytes, report: Report) -> MappingNode | None:
    """Parse the content of a YAML, TOML or CSV file. The format is determined from the file extension.

    If the content is not a well-formed mapping, report the error and return None.
    """
    source = decode(path, data, report)
    if source is None:
        return None
    tree: Node | None
    before = len(report.diagnostics)
    if path.lower().endswith(".toml"):
        from thingc.documents.load.toml_tree import read_toml

        tree = read_toml(source, report)
    elif path.lower().endswith(CATALOG_SUFFIXES):
        from thingc.documents.load.csv_tree import read_csv

        tree = read_csv(source, report)
    else:
        from thingc.documents.load.yaml_tree import read_yaml

        tree = read_yaml(source, report)
    if isinstance(tree, MappingNode):
        return tree
    empty = tree is None or (isinstance(tree, ScalarNode) and tree.value is None)
    if empty and len(report.diagnostics) == before:
        report.add(Code.NOT_A_MAPPING, "the document is empty", source.span(0, 0), help=f"start the document with `{head_line(path)}`")
    elif tree is not None and not empty:
        found = "a list" if isinstance(tree, SequenceNode) else "a string"
        span, help = tree.span, f"start the document with `{head_line(path)}`"
        if isinstance(tree, ScalarNode) and (missing := re.match(r"([A-Za-z_]\w*):(\S+)", tree.text)):
            help = f"add a space after the colon: `{missing.group(1)}: {missing.group(2)}`"
        elif isinstance(tree, ScalarNode) and re.match(r"(\[\s*)?\w+\s*=", tree.text):
            stem = os.path.splitext(os.path.basename(path))[0]
            help = f"rename the TOML document to `{stem}.toml`, or {help}"
        report.add(Code.NOT_A_MAPPING, f"a document must be a mapping, found {found}", span, help=help)
    return None


class _Reader:
    """Reads a document and all documents that it references. Each file is read once.

    `by_path` contains the documents in the order in which they are first referenced.
    """

    def __init__(self, workspace: Workspace, report: Report, texts: Mapping[str, bytes] | None = None, memo: Memo | None = None) -> None:
        self.workspace = workspace
        self.report = report
        self.texts = texts or {}
        self.memo = memo or Memo()
        self.by_path: dict[str, Document] = {}
        self.failed: set[str] = set()
        self.done: set[str] = set()
        self.links: dict[tuple[str, str], str] = {}
        self.broken: set[str] = set()
        self.files: set[str] = set()
        self.bytes = 0
        self.stopped = False
        self.faults_before = len(report.diagnostics)

    def documents(self, root: Document) -> Documents:
        """Return all documents that this reader has read, as `Documents` with the root document `root`."""
        return Documents(root=root, by_path=self.by_path, links=self.links, broken=frozenset(self.broken), files=frozenset(self.files))

    def find(self, text: str, document: Document, where: Span | None, kind: str) -> str | None:
        """Return the absolute path of a file of a kind in `_REFERENCED` that a document references (see `find_file`)."""
        description, suffixes = _REFERENCED[kind]
        resolved = paths.resolve_path(text, document.path)
        if resolved is not None and self.workspace.contains(resolved):
            self.files.add(resolved)
        return paths.find_file(
            text, relative_to=document.path, where=where, workspace=self.workspace, suffixes=suffixes, what=description, report=self.report,
        )

    def limit_exceeded(self, where: Span) -> bool:
        """Return whether a limit is exceeded: the total size of all documents (`MAX_ALL_BYTES`), or the number of errors.

        The first time a limit is exceeded, report an error at `where`.
        """
        if self.stopped:
            return True
        if self.bytes > MAX_ALL_BYTES:
            self.report.add(Code.TOO_LARGE, f"this document and its nested documents have more than {MAX_ALL_BYTES} bytes", where)
        elif len(self.report.diagnostics) - self.faults_before > MAX_FAULTS:
            self.report.add(Code.TOO_LARGE, f"more than {MAX_FAULTS} errors (the remaining files are not read)", where)
        else:
            return False
        self.stopped = True
        return True

    def read(self, path: str) -> Document | None:
        relative = self.workspace.relative(path)
        if relative in self.by_path or relative in self.failed:
            return self.by_path.get(relative)
        self.failed.add(relative)
        try:
            data = self.texts[path] if path in self.texts else beginning(path, MAX_BYTES + 1)
        except (OSError, ValueError) as error:
            reason = error.strerror if isinstance(error, OSError) and error.strerror else "unknown error"
            name = shorten(os.path.basename(path))
            self.report.add(Code.UNREADABLE, f"cannot read `{name}`: {reason[:1].lower()}{reason[1:]}", None)
            return None
        self.bytes += len(data)
        sha256 = hashlib.sha256(data).hexdigest()
        document: Document | None = self.memo.last(*_cache_inputs(path, relative, sha256))
        if document is None:
            diagnostics_before = len(self.report.diagnostics)
            tree = read_tree(path, data, self.report)
            if tree is not None and path.lower().endswith(CATALOG_SUFFIXES):
                kind: str | None = "catalog" if tree.entries else "motion"
            else:
                kind = None if tree is None else document_kind(tree, self.report)
            if tree is None or kind is None:
                return None
            document = Document(path=path, relative=relative, kind=kind, tree=tree, sha256=sha256, text=data.decode("utf-8-sig"))
            if len(self.report.diagnostics) == diagnostics_before:
                remember(document, self.memo)
        self.by_path[relative] = document
        self.failed.discard(relative)
        return document

    def follow(self, document: Document, chain: list[tuple[Document, Span]]) -> None:
        """Read the documents that a document references.

        `chain` contains the assemblies in which the document is nested, each with the location of its reference to the next assembly.
        """
        if document.relative in self.done:
            return
        self.done.add(document.relative)
        for key, text, where in _references(document):
            if self.limit_exceeded(where):
                return
            if key in ("file", "mesh", "picture"):
                path = self.find(text, document, where, key)
                if key == "mesh" and path is not None:
                    self.files.update(os.path.join(os.path.dirname(path), name) for name in paths.libraries(path))
            elif (referenced := self.read_referenced(document, text, where, key)) is None:
                continue
            elif key == "assembly":
                self.nest(referenced, [*chain, (document, where)])
            else:
                self.follow(referenced, chain)

    def nest(self, nested: Document, hops: list[tuple[Document, Span]]) -> None:
        """Read all documents to which a nested document refers. Report cycles, and assemblies that are nested too deeply.

        `hops` contains the assemblies in which `nested` is nested, each with the location of its reference to the next assembly.
        """
        position = next((k for k, (ancestor, _) in enumerate(hops) if ancestor.relative == nested.relative), None)
        if position is not None:
            self.cycle(hops[position:])
        elif len(hops) >= MAX_CHAIN:
            self.report.add(Code.TOO_LARGE, f"more than {MAX_CHAIN} levels of nested assemblies", hops[-1][1])
        else:
            self.follow(nested, hops)

    def cycle(self, hops: list[tuple[Document, Span]]) -> None:
        names = [document.relative for document, _ in hops]
        next_names = [*names[1:], names[0]]
        self.broken.update(names)
        self.report.add(
            Code.DOCUMENT_CYCLE, f"`{names[0]}` contains itself: {' -> '.join([*names, names[0]])}", hops[0][1], notes=[
                Note(message=f"`{name}` contains `{inner}` here", span=where)
                for name, inner, (_, where) in zip(names[1:], next_names[1:], hops[1:], strict=True)
            ], help="remove one of the components that form the cycle",
        )

    def read_referenced(self, document: Document, text: str, where: Span | None, kind: str) -> Document | None:
        if kind == "materials" and is_packaged(text):
            path = find_packaged(text, where=where, workspace=self.workspace, examined=self.files, report=self.report)
        else:
            path = self.find(text, document, where, kind)
        target = None if path is None else self.read(path)
        if target is None:
            return None
        if target.kind != kind:
            self.report.add(
                Code.WRONG_KIND, f"expected {_REFERENCED[kind][0]}, found `{shorten(text)}` of kind `{target.kind}`", where,
                notes=[Note(message=f"the kind of `{shorten(text)}` is set here", span=target.span(("thingc",)))],
            )
            return None
        self.links[document.relative, text] = target.relative
        return target


def head_line(path: str, kind: str = "assembly") -> str:
    """Return the first line of a new document (`thingc: assembly/1`), in the syntax of the file type of `path`."""
    head = f"{kind}/{KINDS[kind]}"
    return f'thingc = "{head}"' if path.lower().endswith(".toml") else f"thingc: {head}"


def document_kind(tree: MappingNode, report: Report, *, usual: str = "assembly") -> str | None:
    """Return the kind of a document, such as `assembly`, from the value of its key `thingc`.

    If the kind is missing or unknown, report an error and return None.

    `usual` is the kind that the help text of the error suggests.
    """
    file = tree.span.file
    node = tree.entries.get("thingc")
    if node is None:
        first = next(iter(tree.keys), None)
        if first is not None and nearest(first, ["thingc"]) and isinstance(tree.entries[first], ScalarNode):
            message = f"expected the key `thingc`, found `{shorten(first)}`"
            report.add(Code.HEADER, message, tree.keys[first], help=near_hint(first, ["thingc"]))
        else:
            where = tree.keys[first] if first is not None else tree.span
            report.add(Code.HEADER, "the key `thingc` is missing", where, help=f"start the document with `{head_line(file, usual)}`")
        return None
    if isinstance(node, ScalarNode) and node.damaged:
        return None
    value = node.value if isinstance(node, ScalarNode) else None
    if not isinstance(value, str):
        if isinstance(node, ScalarNode):
            found = "nothing" if value is None else f"`{shorten(node.text)}`"
        else:
            found = "a list" if isinstance(node, SequenceNode) else "a mapping"
        report.add(
            Code.HEADER, f"expected a kind and a version in `thingc`, found {found}", tree.keys["thingc"] if value is None else node.span,
            help=f"write, for example, `{head_line(file, usual)}`",
        )
        return None
    kind, slash, version = value.partition("/")
    if kind not in KINDS:
        report.add(Code.HEADER, f"unknown kind of document `{shorten(kind)}`", node.span, help=did_you_mean(kind, KINDS, what="kinds"))
        return None
    if version != KINDS[kind]:
        message = f"unknown version `{shorten(version)}` of `{kind}`" if slash else f"the version of `{kind}` is missing"
        report.add(Code.HEADER, message, node.span, help=f"write `{head_line(file, kind)}`")
        return None
    return kind


def _references(document: Document) -> Iterator[tuple[str, str, Span]]:
    """Yield all files that a document references: the kind of the file (a key of `_REFERENCED`), the path, and its location."""
    entries, references = document.tree.entries, list[tuple[str, Node | None]]()
    if document.kind == "catalog":
        references = [("picture", entries_of(row).get("picture")) for row in _items(entries.get("rows"))]
    elif document.kind == "assembly":
        components = [entries_of(component) for component in entries_of(entries.get("components")).values()]
        with_shapes = [owner for component in components for owner in (component, entries_of(component.get("collision")))]
        shapes = [entries_of(shape) for owner in with_shapes for shape in _items(owner.get("shapes"))]
        references = [
            *(("materials", path) for path in _items(entries.get("materials"))),
            *(("file", component.get("file")) for component in components), *(("mesh", shape.get("mesh")) for shape in shapes),
            *(("assembly", component.get("assembly")) for component in components), ("catalog", entries.get("catalog")),
            *(("motion", entries_of(motion).get("file")) for motion in entries_of(entries.get("motions")).values()),
            *(("picture", entries_of(component.get("bom")).get("picture")) for component in components),
        ]
    for key, node in references:
        if isinstance(node, ScalarNode) and isinstance(node.value, str):
            yield key, node.value, node.span


def _items(node: Node | None) -> tuple[Node, ...]:
    return node.items if isinstance(node, SequenceNode) else ()


_REFERENCED = {
    "assembly": ("an assembly document", DOCUMENT_SUFFIXES), "materials": ("a materials document", DOCUMENT_SUFFIXES),
    "catalog": ("a catalogue", CATALOG_SUFFIXES), "motion": ("a CSV file of a motion", CATALOG_SUFFIXES),
    "file": ("a part file", paths.PART_SUFFIXES), "mesh": ("a mesh file", paths.MESH_SUFFIXES),
    "picture": ("a picture", PICTURE_SUFFIXES),
}
"""The kinds of documents and files that a document can reference, with a description and the possible file extensions."""
