"""Write the JSON Schemas of all documents of a workspace to `.thingc/schema/`, or create the JSON Schema of one unsaved document."""

from __future__ import annotations

import contextlib
import json
import os
import time
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any, Protocol

from thingc.base.diagnostics import Code, Report
from thingc.base.filesystem import write_whole
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.safe_text import json_text
from thingc.base.source import MappingNode, ScalarNode
from thingc.documents.load.discovery import documents_in, packaged_documents
from thingc.documents.load.documents import KINDS, Documents, load
from thingc.documents.spec.invalid_entries import Specs
from thingc.documents.spec.validation import part_references, validate
from thingc.documents.workspace import OWN_FILE, Workspace
from thingc.geometry.record import PartDefinition, PartFailure, PartRecord, PartSchema
from thingc.model.resolve.resolver import Settings, Sources, resolve
from thingc.model.resolve.types import AssemblyDefinition
from thingc.tools.live.file_watcher import Stat, stat_of
from thingc.tools.schemas.document_facts import DocumentFacts, Names, Records, facts_of, usual_mounts
from thingc.tools.schemas.general_schema import json_schema
from thingc.tools.schemas.narrow_schema import SchemaContext, narrow
from thingc.tools.schemas.parameter_schemas import DocumentSymbols, of_variants, read_symbols, relative_to_document, symbols_of


class AvailableParts(Protocol):
    """The protocol of a source of parts, such as a geometry service, which lists all available parts and returns their schemas and records.
    """

    def catalogue(self) -> list[str]:
        """Return the references `module:Class` of all public part classes that documents can use."""

    def describe(self, references: Sequence[str]) -> dict[str, PartSchema | PartFailure]:
        """Return the schema of each part class, keyed by its reference `module:Class`."""

    def realize(self, definitions: Sequence[PartDefinition]) -> Mapping[str, PartRecord | PartFailure]:
        """Return the part record for each part definition, keyed by the text of the definition."""


@dataclass(slots=True)
class Parts:
    """Caches the part schemas and part records from a source of parts."""

    service: AvailableParts
    schemas: dict[str, PartSchema | PartFailure] = field(default_factory=dict)
    records: dict[str, PartRecord | PartFailure] = field(default_factory=dict)
    _reach: tuple[str, ...] | None = None

    def describe(self, references: Iterable[str]) -> Mapping[str, PartSchema | PartFailure]:
        """Return the schemas of all available part classes, and of the part classes in `references`."""
        if self._reach is None:
            self._reach = tuple(self.service.catalogue())
        missing = [one for one in dict.fromkeys((*self._reach, *references)) if one not in self.schemas]
        if missing:
            self.schemas.update(self.service.describe(missing))
        return self.schemas

    def realize(self, definitions: Iterable[PartDefinition]) -> Records:
        """Return the records of all known part definitions, including the given definitions."""
        missing = {one.text: one for one in definitions if one.text not in self.records}
        if missing:
            self.records.update(self.service.realize(list(missing.values())))
        return self.records

    def things(self) -> dict[str, PartSchema]:
        """Return the schemas of all available Things, and of other part classes that documents use, keyed by reference."""
        return {
            name: one for name, one in sorted(self.schemas.items())
            if isinstance(one, PartSchema) and (one.kind == "thing" or name not in (self._reach or ()))
        }

    def defaults(self) -> dict[str, PartDefinition]:
        """Return the part definition of each Thing with default parameters. Things with required parameters are omitted."""
        return {name: made for name, one in self.things().items() if (made := one.default) is not None}

    def usual(self, definitions: Iterable[PartDefinition]) -> dict[str, Names]:
        """Return the default mounts of each part class.

        They are the mounts of the part with default parameters, or else of the first known part definition.
        """
        mounts: dict[str, Names] = {}
        for one in (*self.defaults().values(), *sorted(definitions, key=lambda one: one.text)):
            record = self.records.get(one.text)
            if isinstance(record, PartRecord):
                mounts.setdefault(one.reference, usual_mounts(record))
        return mounts

    def all_described(self, references: Iterable[str]) -> bool:
        """Return whether all part classes in `references` could be described.

        Missing classes are ignored, but not classes with errors, such as a syntax error.
        """
        answers = [self.schemas.get(one) for one in references]
        return not any(isinstance(one, PartFailure) and one.kind not in ("missing", "refused") for one in answers)


class ParsedDocument(FrozenStruct):
    """A parsed document and all documents to which it refers. `references` contains the part references in these documents.

    If `broken` is true, the document is not well-formed, and only a part of its text was parsed.
    """

    documents: Documents
    specs: Specs
    references: tuple[str, ...]
    broken: bool

    @property
    def kind(self) -> str:
        """The kind of the document: `assembly`, `materials`, `variants` or `workspace`."""
        return self.documents.root.kind

    def model(self, workspace: Workspace, schemas: Mapping[str, PartSchema | PartFailure]) -> AssemblyDefinition | None:
        """Return the model of the valid elements of the document, or None if no element can be resolved."""
        sources = Sources(workspace=workspace, documents=self.documents, specs=self.specs, schemas=schemas)
        return resolve(sources, Settings(), Report())


def read_document(path: str, workspace: Workspace) -> ParsedDocument | None:
    """Read a document and all documents to which it refers. Return None if the document cannot be parsed at all.

    This function does not report errors in the document, because `thingc check` reports them.
    """
    report = Report()
    documents = load(path, workspace, report, kinds=KINDS)
    if documents is None:
        return None
    specs = validate(documents, Report()) if documents.root.kind == "assembly" else Specs()
    return ParsedDocument(
        documents=documents, specs=specs,
        references=tuple(dict.fromkeys(reference for reference, _ in part_references(specs, documents))),
        broken=any(d.code is Code.SYNTAX and d.span is not None and d.span.file == path for d in report.diagnostics),
    )


general_schema = cache(json_schema)
"""The function `json_schema` with a cache. Its results must not be changed."""
LOOK = 1.0
"""Maximum age [s] of the cached names in other documents while the user types."""

MAX_OTHERS = 100
"""Maximum number of suggested documents. The nearest documents have precedence."""


class RefreshOutcome(FrozenStruct):
    """The result of writing the schemas of a workspace. Each document is given by its path in the workspace.

    Attributes:
        documents: All processed documents.
        written: The documents whose schema has changed and was written.
        kept: The documents whose last schema was preserved, because the document or one of its parts has errors.
        removed: The documents that no longer exist. Their schemas were deleted.
    """

    documents: tuple[str, ...]
    written: tuple[str, ...]
    kept: tuple[str, ...]
    removed: tuple[str, ...]


class Schemas:
    """Creates the JSON Schemas of the documents of one workspace. `geometry` is the source of the parts of the workspace."""

    def __init__(self, workspace: Workspace, geometry: AvailableParts) -> None:
        self.workspace = workspace
        self._parts = Parts(geometry)
        self._seen: dict[str, Stat] = {}
        self._symbols: dict[str, DocumentSymbols] = {}
        self._narrowed: dict[str, tuple[tuple[DocumentFacts, SchemaContext], dict[str, Any]]] = {}
        self._looked = float("-inf")

    def _look(self) -> dict[str, str]:
        """Return a mapping from the absolute path of each document to its path in the workspace.

        Also read the symbols of changed documents.
        """
        settings_file = os.path.join(self.workspace.root, OWN_FILE)
        paths = documents_in(self.workspace.root, self.workspace) + ([settings_file] if os.path.exists(settings_file) else [])
        before, self._seen = self._seen, {path: stat_of(path) for path in paths}
        names = {path: self.workspace.relative(path) for path in self._seen}
        for old_name in set(self._symbols) - set(names.values()):
            del self._symbols[old_name]
        for path, name in names.items():
            if before.get(path) != self._seen[path]:
                symbols = read_symbols(path)
                if symbols.whole or name not in self._symbols:
                    self._symbols[name] = symbols
        return names

    def write(self, only: Collection[str] | None = None) -> RefreshOutcome:
        """Write the changed JSON Schemas of all documents, or only of the documents with the absolute paths `only`. Raises OSError."""
        names = self._look()
        read = {name: one for path, name in names.items() if (one := read_document(path, self.workspace)) is not None}
        schemas = self._parts.describe(dict.fromkeys(reference for one in read.values() for reference in one.references))
        models = {name: one.model(self.workspace, schemas) for name, one in read.items() if one.kind == "assembly"}
        definitions = dict.fromkeys(definition for one in models.values() if one is not None for definition in one.part_definitions())
        self._parts.realize((*definitions, *self._parts.defaults().values()))
        usual = self._parts.usual(definitions)
        selected = None if only is None else {self.workspace.relative(path) for path in only}
        chosen = [name for name in names.values() if selected is None or name in selected]
        results = {name: self._write(name, read.get(name), models.get(name), usual) for name in chosen}
        return RefreshOutcome(
            documents=tuple(chosen), written=tuple(name for name in chosen if results[name]),
            kept=tuple(name for name in chosen if results[name] is None),
            removed=() if only is not None else tuple(remove_others(self.workspace.root, names.values())),
        )

    def general(self, kind: str) -> dict[str, Any] | None:
        """Return the JSON Schema for all documents of a kind, such as `assembly`. Return None for an unknown kind."""
        return general_schema(kind) if kind in KINDS else None

    def schema_of(
        self, path: str, tree: MappingNode, model: AssemblyDefinition | None, records: Records,
        known: Mapping[str, PartSchema | PartFailure],
    ) -> dict[str, Any] | None:
        """Return the JSON Schema of an unsaved document, given by its absolute path. Return None for an unknown kind of document.

        Other documents are read from disk. `model` and `records` are results for the valid part of the document's `tree`. `known` contains
        the schemas of the parts in the document. This method does not write files.
        """
        if time.monotonic() - self._looked > LOOK:
            self._look()
            self._looked = time.monotonic()
        kind = symbols_of(tree).kind
        general, name = self.general(kind), self.workspace.relative(path)
        if general is None or kind not in ("assembly", "variants"):
            return general
        if kind == "variants":
            return self._of_variants(name, general, tree)
        schemas = {**self._parts.describe(()), **known}
        self._parts.realize(self._parts.defaults().values())
        surroundings = self._around(name, self._parts.usual(()))
        facts_and_surroundings = (facts_of(tree, model, records, schemas, surroundings.usual), surroundings)
        if name not in self._narrowed or self._narrowed[name][0] != facts_and_surroundings:
            self._narrowed[name] = (facts_and_surroundings, narrow(general, *facts_and_surroundings))
        return self._narrowed[name][1]

    def _of_variants(self, name: str, general: dict[str, Any], tree: MappingNode) -> dict[str, Any]:
        others = self._others(name, "assembly")
        assembly = tree.entries.get("assembly")
        return of_variants(general, others.get(str(assembly.value)) if isinstance(assembly, ScalarNode) else None, others)

    def _around(self, name: str, usual: Mapping[str, Names]) -> SchemaContext:
        packaged = {
            name: DocumentSymbols(kind="materials", description=f"The materials of `{name.partition('.')[0]}`.")
            for name in packaged_documents(self.workspace)
        }
        return SchemaContext(
            parts=self._parts.things(), usual=usual, assemblies=self._others(name, "assembly"),
            materials={**self._others(name, "materials"), **packaged},
        )

    def _write(self, name: str, reading: ParsedDocument | None, model: AssemblyDefinition | None, usual: Mapping[str, Any]) -> bool | None:
        """Write the JSON Schema of a document to its file. Return whether the schema has changed.

        If the document or one of its parts has errors, preserve the last schema and return None.
        """
        root, kind = self.workspace.root, reading.kind if reading is not None else self._symbols[name].kind
        broken = reading is None or reading.broken or not self._parts.all_described(reading.references)
        if broken and os.path.exists(os.path.join(root, schema_path(name))):
            return None
        schema = self.general(kind)
        if schema is None:
            return False
        if kind == "variants" and reading is not None:
            schema = self._of_variants(name, schema, reading.documents.root.tree)
        elif kind == "assembly":
            facts = DocumentFacts() if reading is None else facts_of(
                reading.documents.root.tree, model, self._parts.records, self._parts.schemas, usual,
            )
            schema = narrow(schema, facts, self._around(name, usual))
        return write_schema(root, name, schema)

    def _others(self, name: str, kind: str) -> dict[str, DocumentSymbols]:
        """Return the headers and parameters of the other documents of a kind.

        The keys are paths relative to the given document, the nearest document first.
        """
        others = {relative_to_document(name, other): one for other, one in self._symbols.items() if one.kind == kind and other != name}
        return {text: others[text] for text in sorted(others, key=lambda text: (text.count("/"), text))[:MAX_OTHERS]}


# --- the folder `.thingc/schema/` of a workspace, never in git ---


SCHEMAS = ".thingc/schema"


def schema_path(relative: str) -> str:
    """Return the path of the JSON Schema file of a document. Both paths are relative to the workspace, with `/` as separator."""
    return f"{SCHEMAS}/{relative}.json"


def write_schema(root: str, relative: str, schema: dict[str, Any]) -> bool:
    """Write the JSON Schema of a document to its file if the schema has changed. Return whether the file was written. Raises OSError.

    The file contains a single line, because writing indented JSON takes ten times longer.
    """
    ignored = os.path.join(root, ".thingc", ".gitignore")
    if not os.path.exists(ignored):
        write_text(ignored, "*\n")
    return write_text(os.path.join(root, schema_path(relative)), json_text(json.dumps(schema, ensure_ascii=False)) + "\n")


def write_text(path: str, text: str) -> bool:
    """Write a text file and create its folder, unless the file already contains the same text. Return whether the file was written.

    Raises `OSError`.
    """
    os.makedirs(os.path.dirname(path), exist_ok=True)
    return write_whole(os.path.realpath(path), text.encode())


def remove_others(root: str, documents: Iterable[str]) -> list[str]:
    """Delete the JSON Schemas of documents that no longer exist. Return the former paths of these documents in the workspace."""
    top = os.path.join(root, SCHEMAS)
    current = set(documents)
    removed: list[str] = []
    for folder, _, files in os.walk(top, topdown=False):
        for name in sorted(files):
            path = os.path.join(folder, name)
            relative = os.path.relpath(path, top).replace(os.sep, "/").removesuffix(".json")
            if name.endswith(".json") and relative not in current:
                os.unlink(path)
                removed.append(relative)
        if folder != top:
            with contextlib.suppress(OSError):  # the folder is not empty
                os.rmdir(folder)
    return sorted(removed)
