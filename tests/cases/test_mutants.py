"""The document of the arm with hundreds of single mistakes: there is never an exception, and errors are near the mistake. The first
compiler passes (load to link) run in this process. The records of the parts are created once. A mutant that needs another part stops
before linking."""

from __future__ import annotations

import random
import re
import shutil
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import pytest

from thingc.base.diagnostic_output import as_json, as_text
from thingc.base.diagnostics import Code, Diagnostic, Report, Severity
from thingc.base.source import Document, MappingNode, Node, ScalarNode, Span, walk
from thingc.documents.load.documents import load
from thingc.documents.spec.validation import part_references, validate
from thingc.documents.workspace import Workspace
from thingc.driver import pipeline
from thingc.driver.environment import Environment, Options
from thingc.geometry.record import PartFailure, PartRecord
from thingc.geometry.service import GeometryService
from thingc.geometry.store.local import Store
from thingc.model.assembly.linking import link
from thingc.model.resolve.resolver import Settings, Sources, resolve
from thingc.model.robot.kinematic_tree import root

pytestmark = pytest.mark.slow

MUTANTS = 40
NEAR = 0.85
"""The smallest share of refused mutants whose first error is on the changed line or next to it. The others are correct: the error of a
removed component is at its use."""

OTHER_VALUES = (
    "3", "-7 kg", "1e9", ".nan", "true", "~", "[1, 2]", "{a: 1}", "''", "nonsense", "=1 / 0", "=reech", "120 mm", "30 deg", "0",
    "*x", "a.b.c.d", "$i", "9" * 400, "arm.yaml", "../../x.yaml", "é", "os:system",
)


@dataclass(frozen=True)
class Mutant:
    """The text of the document, and the changed lines."""

    what: str
    text: str
    lines: range


class Arm:
    """The arm in a separate folder, with its records."""

    def __init__(self, project: Path, folder: Path, store: str) -> None:
        shutil.copytree(project / "assemblies", folder / "assemblies", ignore=shutil.ignore_patterns("README*"))
        (folder / "parts").mkdir()
        shutil.copy(project / "parts" / "arm.py", folder / "parts")
        (folder / "thingc.toml").write_text('thingc = "workspace/1"\n')
        self.path = folder / "assemblies" / "arm.yaml"
        self.text = self.path.read_text()
        self.store = Store(store)
        with Environment(str(self.path), Options(store=store)) as environment:
            whole = pipeline.compile(environment)
            assert whole.report.diagnostics == [] and whole.assembly is not None and whole.documents is not None
            self.document: Document = whole.documents.root
            self.records: Mapping[str, PartRecord | PartFailure] = environment.geometry.realize(
                whole.assembly.definition.part_definitions()
            )

    def said(self, text: str) -> tuple[list[Diagnostic], bool]:
        """Return the diagnostics for another text of the document, and whether all passes ran."""
        self.path.write_text(text)
        report = Report()
        workspace = Workspace.find(str(self.path), report)
        assert workspace is not None
        documents = load(str(self.path), workspace, report)
        if documents is None:
            return report.sorted_diagnostics(), True
        specs = validate(documents, report)
        with GeometryService(workspace, self.store, jobs=1, timeout=1.0) as geometry:
            references = [reference for reference, _ in part_references(specs, documents)]
            sources = Sources(workspace=workspace, documents=documents, specs=specs, schemas=geometry.describe(references))
            model = resolve(sources, Settings(), report)
        if model is None:
            return report.sorted_diagnostics(), True
        texts = {definition.text for definition in model.part_definitions()}
        if not texts <= set(self.records):
            return report.sorted_diagnostics(), False
        assembly = link(model, {text: self.records[text] for text in texts}, report)
        if assembly is not None:
            for mode in assembly.modes:
                root(assembly, mode, report)
        return report.sorted_diagnostics(), True


@pytest.fixture(scope="module")
def arm(root: Path, tmp_path_factory: pytest.TempPathFactory, shared_store: str) -> Arm:
    return Arm(root, tmp_path_factory.mktemp("mutants"), shared_store)


def indices(text: str, span: Span) -> tuple[int, int]:
    """Return the start and end index of a span in the text."""
    starts = [0, *(found.end() for found in re.finditer("\n", text))]
    return starts[span.line - 1] + span.column - 1, starts[span.end_line - 1] + span.end_column - 1


def places(document: Document) -> Iterator[tuple[str, Node, Span | None]]:
    """Return every scalar and every entry with its dotted path and the span of its key."""
    for path, node in walk(document.tree):
        if not path:
            continue
        key = document.span(path, key=True) if isinstance(path[-1], str) else None
        yield ".".join(map(str, path)), node, key


def mutants(document: Document, seed: int) -> Iterator[Mutant]:
    """Yield mutants without end, in an order that depends on the seed."""
    chance = random.Random(seed)
    text = document.text
    found = list(places(document))
    scalars = [(path, node) for path, node, _ in found if isinstance(node, ScalarNode)]
    entries = [(path, node, key) for path, node, key in found if key is not None]

    def replaced(what: str, begin: int, end: int, new: str) -> Mutant:
        first = text.count("\n", 0, begin) + 1
        return Mutant(what, text[:begin] + new + text[end:], range(first, first + text.count("\n", begin, end) + 1))

    def misspelled(word: str) -> str:
        at = chance.randrange(len(word))
        return word[:at] + chance.choice(("", word[at] * 2, "_")) + word[at + 1:]

    while True:
        kind = chance.choice(("delete", "misspell key", "misspell value", "retype", "swap", "repeat"))
        if kind == "delete":
            path, node, key = chance.choice(entries)
            begin, end = indices(text, key)[0], indices(text, node.span)[1]
            rest = re.compile(r"[ \t]*(?:,[ \t]*|(?:#.*)?\n)?").match(text, end)
            yield replaced(f"delete {path}", begin, rest.end() if rest is not None else end, "")
        elif kind == "misspell key":
            path, _, key = chance.choice(entries)
            begin, end = indices(text, key)
            yield replaced(f"misspell the key {path}", begin, end, misspelled(text[begin:end]))
        elif kind == "repeat":
            path, node, key = chance.choice(entries)
            if isinstance(node, MappingNode) and node.span.line != node.span.end_line:
                continue
            begin, end = indices(text, key)[0], indices(text, node.span)[1]
            flow = text[text.rfind("\n", 0, begin) + 1 : begin].strip()
            again = f"{text[begin:end]}{', ' if flow else chr(10) + ' ' * (key.column - 1)}{text[begin:end]}"
            yield replaced(f"repeat {path}", begin, end, again)
        else:
            path, node = chance.choice(scalars)
            begin, end = indices(text, node.span)
            if kind == "misspell value":
                new = misspelled(text[begin:end])
            elif kind == "retype":
                new = chance.choice(OTHER_VALUES)
            else:
                other_begin, other_end = indices(text, chance.choice(scalars)[1].span)
                new = text[other_begin:other_end]
            yield replaced(f"{kind} {path}: {text[begin:end]} -> {new[:40]}", begin, end, new)


def judged(arm: Arm, seed: int, count: int) -> tuple[Counter[str], list[str]]:
    """Return counts of the mutants (`equal`, `accepted`, `unfinished`, `near`, `far`), and descriptions of those that are far."""
    tally: Counter[str] = Counter()
    far: list[str] = []
    makers = mutants(arm.document, seed)
    for _ in range(count):
        mutant = next(makers)
        if mutant.text == arm.text:
            tally["equal"] += 1
            continue
        said, whole = arm.said(mutant.text)
        errors = [d for d in said if d.severity is Severity.ERROR]
        assert Code.INTERNAL not in {d.code for d in said}, mutant.what
        for diagnostic in said:
            assert diagnostic.span is not None, (mutant.what, diagnostic.message)
        as_text(said)
        as_json(said)
        if not errors:
            tally["accepted" if whole else "unfinished"] += 1
            continue
        allowed = range(mutant.lines.start - 1, mutant.lines.stop + 1)
        if any(d.span is not None and d.span.line in allowed and d.span.file == str(arm.path) for d in errors):
            tally["near"] += 1
        else:
            tally["far"] += 1
            far.append(f"{mutant.what} (line {mutant.lines.start}): {errors[0].message}")
    return tally, far


def test_mutants_cause_no_exceptions(arm: Arm) -> None:
    tally, far = judged(arm, 1, MUTANTS)
    assert tally["near"] + tally["far"] > MUTANTS // 2, tally
    assert tally["near"] >= NEAR * (tally["near"] + tally["far"]), (tally, far)
