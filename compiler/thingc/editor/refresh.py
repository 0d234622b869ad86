"""The schemas of a workspace, made anew where something that they say has changed."""

from __future__ import annotations

import os
import time
from collections.abc import Collection, Iterable, Mapping
from typing import TYPE_CHECKING, Any

from thingc.diagnostics import Report
from thingc.editor import folder
from thingc.editor.facts import Facts, Records, facts_of
from thingc.editor.narrowing import Surroundings, narrowed, remembered
from thingc.editor.parts import Parts, PartsInReach
from thingc.editor.reading import KINDS, Reading, read
from thingc.editor.symbols import DocumentSymbols, near, of_variants, read_symbols, symbols_of
from thingc.frozen import dataclass
from thingc.load import documents_in, packaged_documents
from thingc.realize.record import PartDefinition, PartFailure, PartSchema
from thingc.source import MappingNode, ScalarNode
from thingc.watching import Stat, stat_of
from thingc.workspace import OWN_FILE, Workspace

if TYPE_CHECKING:
    from thingc.resolve.model import AssemblyDefinition

LOOK = 1.0
"""How old [s] what is known of other documents may be for somebody who types."""

MAX_OTHERS = 100
"""Documents of a workspace that are offered to each other, the nearest first."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RefreshOutcome:
    """What a refresh did, by the documents' paths in the workspace: all `documents`, those whose schema was `written` or was
    the `same`, those that are not readable now and `kept` their last schema, and those `removed` because there is no such
    document any more."""

    documents: tuple[str, ...]
    written: tuple[str, ...]
    kept: tuple[str, ...]
    removed: tuple[str, ...]


class Schemas:
    """The schemas of one workspace; `geometry` is asked for parts, and `only` these documents (absolute paths) are looked at
    (None: all that there are)."""

    def __init__(self, workspace: Workspace, geometry: PartsInReach, only: Collection[str] | None = None) -> None:
        self.workspace = workspace
        self.only = None if only is None else frozenset(workspace.relative(path) for path in only)
        self.geometry = geometry
        self._parts = Parts(geometry)
        self._general: dict[str, dict[str, Any]] = {}
        self._seen: dict[str, Stat] = {}
        self._readings: dict[str, Reading | None] = {}
        self._models: dict[str, AssemblyDefinition | None] = {}
        self._symbols: dict[str, DocumentSymbols] = {}
        self._done: dict[str, tuple[object, Surroundings]] = {}
        self._narrowed: dict[str, tuple[tuple[Facts, Surroundings], dict[str, Any]]] = {}
        self._looked = float("-inf")

    def _scan(self) -> dict[str, Stat]:
        paths = documents_in(self.workspace.root, self.workspace)
        own = os.path.join(self.workspace.root, OWN_FILE)
        if os.path.exists(own):
            paths.append(own)
        stats = {path: stat_of(path) for path in paths}
        # Whoever saves a file may empty it before it is written: it is the document that it was.
        emptied = {path: stat for path in self._seen if path not in stats and (stat := stat_of(path)) is not None and stat[1] == 0}
        return stats | emptied

    def refresh(self) -> RefreshOutcome:
        """Read what has changed, and write the schemas that say something else then. Raises OSError where that cannot be."""
        before, self._seen = self._seen, self._scan()
        relatives = {path: self.workspace.relative(path) for path in self._seen}
        self._read(relatives, before)
        readings = {name: one for name in relatives.values() if (one := self._readings.get(name)) is not None}
        references = dict.fromkeys(reference for one in readings.values() for reference in one.references)
        schemas = self._parts.describe(references)
        for name, reading in readings.items():
            if reading.kind == "assembly" and name not in self._models:
                self._models[name] = reading.model(self.workspace, schemas)
        definitions = self._definitions(readings)
        wanted = (*definitions, *self._parts.defaults().values())
        self._parts.realize(wanted)
        usual = self._parts.usual(definitions)
        written, kept = [], []
        for name in relatives.values():
            if self.only is not None and name not in self.only:
                continue
            result = self._write(name, readings.get(name), usual)
            if result is None:
                kept.append(name)
            elif result:
                written.append(name)
        removed = [] if self.only is not None else folder.remove_others(self.workspace.root, relatives.values())
        chosen = [name for name in relatives.values() if self.only is None or name in self.only]
        return RefreshOutcome(
            documents=tuple(chosen), written=tuple(written), kept=tuple(kept), removed=tuple(removed),
        )

    def general(self, kind: str) -> dict[str, Any] | None:
        """What every document of a kind may say; None where there is no such kind."""
        return self._schema(kind)

    def schema_of(
        self, path: str, tree: MappingNode, model: AssemblyDefinition | None, records: Records,
        known: Mapping[str, PartSchema | PartFailure],
    ) -> dict[str, Any] | None:
        """The schema of a document (absolute path) as it is being written, with what the workspace's other files say now; None for what
        is no document. `model` and `records` are of the sound rest of its `tree`, `known` is what the parts take that it names. Nothing
        is written."""
        if time.monotonic() - self._looked > LOOK:
            before, self._seen = self._seen, self._scan()
            self._read_symbols({one: self.workspace.relative(one) for one in self._seen}, before)
            self._looked = time.monotonic()
        kind = symbols_of(tree).kind
        general, name = self._schema(kind), self.workspace.relative(path)
        if general is None or kind not in ("assembly", "variants"):
            return general
        if kind == "variants":
            return self._of_variants(name, general, tree)
        schemas = {**self._parts.describe(()), **known}
        self._parts.realize(self._parts.defaults().values())
        around = self._around(name, self._parts.usual(()), {})
        made = (facts_of(tree, model, records, schemas, around.usual), around)
        if name not in self._narrowed or self._narrowed[name][0] != made:
            self._narrowed[name] = (made, narrowed(general, *made))
        return self._narrowed[name][1]

    def _of_variants(self, name: str, general: dict[str, Any], tree: MappingNode) -> dict[str, Any]:
        others = self._others(name, "assembly")
        assembly = tree.entries.get("assembly")
        return of_variants(general, others.get(str(assembly.value)) if isinstance(assembly, ScalarNode) else None, others)

    def _around(self, name: str, usual: Mapping[str, Any], lost: dict[str, Any]) -> Surroundings:
        return Surroundings(
            parts=self._parts.things(), usual=dict(usual), assemblies=self._others(name, "assembly"),
            materials={**self._others(name, "materials"), **self._packaged()}, lost=lost,
        )

    def _read_symbols(self, relatives: Mapping[str, str], before: Mapping[str, Stat]) -> None:
        gone = set(self._symbols) - set(relatives.values())
        for name in gone:
            del self._symbols[name]
        for path, name in relatives.items():
            if before.get(path) != self._seen[path]:
                symbols = read_symbols(path)
                if symbols.whole or name not in self._symbols:
                    self._symbols[name] = symbols

    def _read(self, relatives: Mapping[str, str], before: Mapping[str, Stat]) -> None:
        anything = before != self._seen
        self._read_symbols(relatives, before)
        for path, name in relatives.items():
            known = self._readings.get(name)
            if name in self._readings and known is not None and known.current() and not (known.waiting and anything):
                continue
            if name in self._readings and known is None and before.get(path) == self._seen[path]:
                continue
            self._readings[name] = read(path, self.workspace, self._seen)
            self._models.pop(name, None)

    def _definitions(self, readings: Iterable[str]) -> tuple[PartDefinition, ...]:
        from thingc.resolve import part_definitions

        per_model = (part_definitions(model) for name in readings if (model := self._models.get(name)) is not None)
        return tuple(dict.fromkeys(definition for one in per_model for definition in one))

    def _write(self, name: str, reading: Reading | None, usual: Mapping[str, Any]) -> bool | None:
        """Whether the schema of a document was written; None where it keeps its last one."""
        symbols = self._symbols[name]
        kind = reading.kind if reading is not None else symbols.kind
        last: dict[str, Any] | None = None
        if reading is None or reading.broken:
            last = folder.read(self.workspace.root, name)
            if last:
                return None
        general = self._schema(kind)
        if general is None:
            return False
        if kind == "variants" and reading is not None:
            return folder.write(self.workspace.root, name, self._of_variants(name, general, reading.documents.root.tree))
        if kind != "assembly":
            return folder.write(self.workspace.root, name, general)
        references = tuple(reading.references) if reading is not None else ()
        unsure = self._parts.unsure({**dict.fromkeys(references), **dict.fromkeys(self._last_references(name))})
        lost: dict[str, Any] = {}
        if unsure:
            last = last if last is not None else folder.read(self.workspace.root, name)
            lost, mounts = remembered(last, unsure)
            usual = {**mounts, **usual}
        around = self._around(name, usual, lost)
        made = (reading, self._models.get(name), dict(self._parts.records) if reading is not None else None)
        done = self._done.get(name)
        there = os.path.exists(os.path.join(self.workspace.root, folder.schema_path(name)))
        if there and done is not None and done[1] == around and _same(done[0], made):
            return False
        facts = Facts()
        if reading is not None:
            facts = facts_of(
                reading.documents.root.tree, self._models.get(name), self._parts.records, self._parts.schemas, usual,
            )
        written = folder.write(self.workspace.root, name, narrowed(general, facts, around))
        self._done[name] = (made, around)
        return written

    def _last_references(self, name: str) -> list[str]:
        """The Things of modules that cannot be parsed now, as the last schema of a document has them."""
        if not self._parts.unreadable:
            return []
        definitions = folder.read(self.workspace.root, name).get("$defs", {})
        return [one.removeprefix("params of ") for one in definitions if one.startswith("params of ")]

    def _schema(self, kind: str) -> dict[str, Any] | None:
        """The general schema of a kind; None where there is none."""
        from thingc.spec import json_schema

        if kind not in KINDS:
            return None
        if kind not in self._general:
            self._general[kind] = json_schema(kind)
        return self._general[kind]

    def _packaged(self) -> dict[str, DocumentSymbols]:
        """The documents of materials of packages in reach, by their names with dots."""
        return {
            name: DocumentSymbols(kind="materials", description=f"The materials of `{name.partition('.')[0]}`.")
            for name in packaged_documents(self.workspace)
        }

    def _others(self, name: str, kind: str) -> dict[str, DocumentSymbols]:
        """The other documents of a kind by what this one would call them, the nearest first."""
        others = {near(name, other): one for other, one in self._symbols.items() if one.kind == kind and other != name}
        order = sorted(others, key=lambda text: (text.count("/"), text))[:MAX_OTHERS]
        return {text: others[text] for text in order}


def _same(one: Any, other: Any) -> bool:
    """Whether two makings are of the same objects: a reading that was kept is the same object."""
    return one[0] is other[0] and one[1] is other[1] and one[2] == other[2]


def workspace_of(path: str, report: Report) -> Workspace | None:
    """The workspace of a folder or of a document; None where its file is wrong, which is reported."""
    return Workspace.find(os.path.join(path, OWN_FILE) if os.path.isdir(path) else path, report)
