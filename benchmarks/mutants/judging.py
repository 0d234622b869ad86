"""Judge the reaction of thingc to a mutant: rejected at the right line, rejected elsewhere, or accepted and built."""

from __future__ import annotations

import os
import shutil
from dataclasses import dataclass
from pathlib import Path

from mutations import Mutant

from thingc.base.diagnostic_output import as_json, as_text
from thingc.base.diagnostics import Code, Diagnostic, Severity
from thingc.base.source import Document, MappingNode, ScalarNode, walk
from thingc.documents.load.discovery import documents_in
from thingc.driver import pipeline
from thingc.driver.environment import Environment, Options

ROOT = Path(__file__).resolve().parents[2]
COPIED = ("assemblies", "parts", "thingc.toml")


@dataclass(frozen=True)
class Subject:
    """A valid document in the temporary workspace, and the documents that are compiled to check it. The documents are the valid document
    itself, if it is an assembly, and the robot that contains it.
    """

    document: Document
    roots: tuple[str, ...]


@dataclass(frozen=True)
class Verdict:
    """The result for a mutant. `outcome` is `right`, `elsewhere` or `built`. The outcome is `right` if an error is reported at most one
    line away from the change, or at a line that uses a removed name.

    `said` contains the first error, or the warnings if the mutant was accepted.
    """

    outcome: str
    codes: tuple[str, ...]
    said: str


def subjects(folder: Path, store: str) -> list[Subject]:
    """Copy all valid documents of the robots to a temporary workspace. Also convert the first document to TOML."""
    for name in COPIED:
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(source, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(source, folder / name)
    twin = folder / "assemblies" / "arm_twin.toml"
    twin.write_text(_as_toml(folder / "assemblies" / "arm.yaml"))
    found: dict[str, Subject] = {}
    # assemblies with the most nested documents come first, because they are whole robots
    paths = [path for path in documents_in(str(folder)) if "thingc: variants/" not in Path(path).read_text()]
    compiled = {path: _compiled(path, store) for path in paths}
    by_size = sorted((path for path in paths if compiled[path] is not None), key=lambda path: (-len(compiled[path] or ()), path))
    for root in by_size:
        for document in compiled[root] or ():
            own = (document.path,) if document.kind == "assembly" and document.path != root else ()
            found.setdefault(document.path, Subject(document, (*own, root)))
    return [found[path] for path in sorted(found)]


def _compiled(path: str, store: str) -> list[Document] | None:
    """Compile a document, which must not have diagnostics, and return all documents that it uses. Return None if the document is not an
    assembly.
    """
    with Environment(path, Options(store=store)) as environment:
        compilation = pipeline.compile(environment, kinds=("assembly", "materials"))
        assert not compilation.report.diagnostics, as_text(compilation.report.sorted_diagnostics())
        assert compilation.documents is not None
        documents = compilation.documents
        return list(documents.by_path.values()) if documents.root.kind == "assembly" else None


def _as_toml(path: Path) -> str:
    """Convert a document to TOML. Blocks become tables, and nested mappings become inline tables."""
    import tomlkit
    import yaml

    return tomlkit.dumps(yaml.safe_load(path.read_text()) | {"name": "arm_twin"})


def judge(subject: Subject, mutant: Mutant, store: str) -> Verdict:
    """Compile the robot with the mutant in place of the document. If the mutant is accepted, build it for MuJoCo. Exceptions of thingc are
    not caught.
    """
    path = Path(subject.document.path)
    path.write_text(mutant.text)
    said: list[Diagnostic] = []
    try:
        for root in subject.roots:
            with Environment(root, Options(store=store, part_timeout=30.0)) as environment:
                compilation = pipeline.compile(environment)
                if not compilation.report.failed:
                    pipeline.build(environment, compilation, ["mjcf"])
                said += compilation.report.sorted_diagnostics()
                if compilation.report.failed:
                    break
    finally:
        path.write_text(subject.document.text)
    as_text(said)
    as_json(said)
    errors = [d for d in said if d.severity is Severity.ERROR]
    assert not any(d.code is Code.INTERNAL for d in said), said
    codes = tuple(sorted({d.code.code for d in errors}))
    if not errors:
        return Verdict("built", codes, "; ".join(d.message for d in said))
    right = any(_blames(d, subject, mutant) for d in errors)
    return Verdict("right" if right else "elsewhere", codes, f"line {errors[0].span.line if errors[0].span else '-'}: {errors[0].message}")


def _blames(diagnostic: Diagnostic, subject: Subject, mutant: Mutant) -> bool:
    """Return whether a diagnostic or one of its notes is at most one line away from the change, or at a line that uses the removed name."""
    places = [diagnostic.span, *(note.span for note in diagnostic.notes)]
    lines = mutant.text.splitlines()
    parent = _parent(subject.document, mutant)
    for span in places:
        if span is None:
            continue
        if span.file == subject.document.path:
            if mutant.first - 1 <= span.line <= mutant.last + 1 or span.line == parent:
                return True
            shown = lines[span.line - 1] if span.line <= len(lines) else ""
        else:
            shown = _line(span.file, span.line)
        if mutant.gone and mutant.gone in shown:
            return True
    return False


def _line(file: str, number: int) -> str:
    lines = Path(file).read_text(errors="replace").splitlines() if os.path.isfile(file) else []
    return lines[number - 1] if number <= len(lines) else ""


def _parent(document: Document, mutant: Mutant) -> int | None:
    """Return the line of the mapping that contains the key, if the mutant deletes or misspells a key. A missing key is reported at this
    line.
    """
    if mutant.kind not in ("delete", "misspell key"):
        return None
    return document.span(mutant.path[:-1], key=True).line if len(mutant.path) > 1 else 1


def field_of(document: Document, mutant: Mutant) -> str:
    """Return the path of the changed value, such as `joints.*.limit.lower`. Names that the author chose are replaced by `*`."""
    named = {"components", "joints", "parameters", "poses", "modes", "materials", "mounts", "links", "sensors", "tests", "params",
             "attach", "hold", "adhesion", "actuators", "raw", "mjcf", "joint", "body", "geom"}
    steps: list[str] = []
    for step in mutant.path:
        steps.append("*" if isinstance(step, int) or (steps and steps[-1] in named) else str(step))
    return ".".join(steps)


def scalars_in(document: Document) -> int:
    """Return the number of scalar values in a document."""
    return sum(isinstance(node, ScalarNode) for _, node in walk(document.tree) if not isinstance(node, MappingNode))
