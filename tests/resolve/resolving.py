"""Load, validate and resolve documents written in tests, with hand-written part schemas."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from thingc.base.diagnostics import Report
from thingc.base.source import Span
from thingc.documents.load.documents import load
from thingc.documents.spec.validation import validate
from thingc.documents.workspace import Workspace
from thingc.geometry.record import ParameterSchema, PartFailure, PartSchema
from thingc.model.resolve.resolver import Settings, Sources, resolve
from thingc.model.resolve.types import AssemblyDefinition, Component, Joint, Mode, NamedPose


def schema(reference: str, *parameters: ParameterSchema, actuator: bool = False, material: str | None = None) -> PartSchema:
    return PartSchema(
        reference=reference, kind="thing", doc="", parameters=parameters, material=material, actuator=actuator, file="", line=0,
    )


SCHEMAS: dict[str, PartSchema | PartFailure] = {
    "arm:Plate": schema("arm:Plate"),
    "arm:Brace": schema(
        "arm:Brace",
        ParameterSchema(name="length", kind="length", required=False, default=0.08, minimum=0.01, maximum=0.5),
        ParameterSchema(name="tilt", kind="angle", required=False, default=0.0),
        ParameterSchema(name="holes", kind="count", required=False, default=4, minimum=0, maximum=12),
        ParameterSchema(name="fill", kind="ratio", required=False, default=0.2, minimum=0.0, maximum=1.0),
        ParameterSchema(name="weight", kind="mass", required=False, default=0.01),
        ParameterSchema(name="scale", kind="number", required=False, default=1.0),
        ParameterSchema(name="open", kind="flag", required=False, default=False),
        ParameterSchema(name="label", kind="text", required=False, default="brace"),
        ParameterSchema(name="size", kind="choice", required=False, default="M3", choices=("M2", "M3", "M4")),
        ParameterSchema(name="teeth", kind="choice", required=False, default=8, choices=(8, 16, 32)),
    ),
    "arm:Rod": schema("arm:Rod", ParameterSchema(name="length", kind="length", required=True, default=None)),
    "arm:Two": schema(
        "arm:Two",
        ParameterSchema(name="length", kind="length", required=True, default=None),
        ParameterSchema(name="tilt", kind="angle", required=True, default=None),
    ),
    "arm:Servo": schema("arm:Servo", actuator=True),
    "arm:Gone": PartFailure(
        subject="arm:Gone", kind="missing", message="`arm` has no `Gone`", file="/parts/arm.py",
        candidates=("arm:Plate", "arm:Brace", "arm:Gome"),
    ),
    "amr:Plate": PartFailure(subject="amr:Plate", kind="missing", message="there is no module `amr`", candidates=("arm", "legs")),
    "os:system": PartFailure(
        subject="os:system", kind="refused",
        message="the module `os` is not in a part folder or in an allowed package",
        candidates=("thingc_stock", "bd_warehouse"),
    ),
    "arm:Bad": PartFailure(
        subject="arm:Bad", kind="raised", message="NameError: name 'Boks' is not defined", file="/parts/arm.py", line=12,
    ),
}


@dataclass(frozen=True)
class Outcome:
    """The result of a document: the model and all diagnostics."""

    model: AssemblyDefinition | None
    report: Report
    root: Path

    @property
    def said(self) -> list[str]:
        """Return diagnostics as `TC305 arm.yaml:7:12 message | help`, in the order of positions; notes follow, with `+`."""
        lines = []
        for d in self.report.sorted_diagnostics():
            place = self._place(d.span) if d.span else f"({d.path})"
            lines.append(f"{d.code.code} {place} {d.message}" + (f" | {d.help}" if d.help else ""))
            lines.extend(f"+ {self._place(note.span)} {note.message}" for note in d.notes)
        return lines

    def _place(self, span: Span | None) -> str:
        if span is None:
            return "-"
        file = Path(span.file)
        return f"{file.relative_to(self.root) if file.is_relative_to(self.root) else file}:{span.line}:{span.column}"

    @property
    def good(self) -> AssemblyDefinition:
        """Return the model of a document that must have no diagnostics."""
        assert self.said == []
        assert self.model is not None
        return self.model

    def component(self, name: str) -> Component:
        assert self.model is not None
        return next(c for c in self.model.components if c.name == name)

    def joint(self, name: str) -> Joint:
        assert self.model is not None
        return next(j for j in self.model.joints if j.name == name)

    def pose(self, name: str) -> NamedPose:
        assert self.model is not None
        return next(p for p in self.model.poses if p.name == name)

    def mode(self, name: str) -> Mode:
        assert self.model is not None
        return next(m for m in self.model.modes if m.name == name)


def run(
    folder: Path, files: Mapping[str, str] | str, parameters: Mapping[str, str] | None = None, root: str = "",
    schemas: Mapping[str, PartSchema | PartFailure] = SCHEMAS,
) -> Outcome:
    """Write the documents (dedented; a single one is `arm.yaml`), then load, validate and resolve the first of them."""
    if isinstance(files, str):
        files = {"arm.yaml": files}
    (folder / "thingc.toml").write_text('thingc = "workspace/1"\nparts = []\n')
    for name, text in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(textwrap.dedent(text).lstrip("\n"))
    report = Report()
    document = str(folder / (root or next(iter(files))))
    workspace = Workspace.find(document, report)
    assert workspace is not None, report
    documents = load(document, workspace, report)
    if documents is None:
        return Outcome(None, report, folder)
    specs = validate(documents, report)
    sources = Sources(workspace=workspace, documents=documents, specs=specs, schemas=schemas)
    return Outcome(resolve(sources, Settings(parameters=parameters or {}), report), report, folder)
