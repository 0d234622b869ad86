"""`stl/<definition>.stl`: what a slicer takes. Millimetres, one file per definition that is made rather than bought."""

from __future__ import annotations

from thingc.diagnostics import Code, Note
from thingc.emit.artifact import Artifacts, Content, Loss, Stored
from thingc.emit.bom import make_of
from thingc.emit.request import EmitRequest
from thingc.graph.types import Occurrence
from thingc.realize.record import PartDefinition


def emit(request: EmitRequest) -> Artifacts:
    """The print mesh of every definition with geometry of which at least one occurrence is not bought.

    A mesh that is not closed is written all the same and listed as a loss: a slicer may repair it or refuse it. Two
    definitions whose names make the same file name (`a/b.step` and `a.b.step`) are an error at the second.
    """
    files: dict[str, Content] = {}
    losses: list[Loss] = []
    owners: dict[str, Occurrence] = {}
    for occurrence in request.assembly.occurrences:
        definition, record = occurrence.component.definition, occurrence.record
        if not isinstance(definition, PartDefinition) or record is None or make_of(occurrence) == "buy":
            continue
        mesh = record.meshes.get("print")
        if mesh is None:
            continue
        path = f"stl/{definition.stem}.stl"
        owner = owners.setdefault(path.casefold(), occurrence)
        if owner is not occurrence:
            if owner.definition != occurrence.definition:
                request.report.add(
                    Code.SAME_FILE,
                    f"`{occurrence.definition.label}` and `{owner.definition.label}` would both be written as `{path}`",
                    occurrence.origin,
                    path=occurrence.path,
                    help="rename one of the two files",
                    notes=[Note(message=f"`{owner.definition.label}` is used here", span=owner.origin[0])],
                )
            continue
        files[path] = Stored(sha256=mesh.sha256, size=mesh.size)
        if not mesh.closed:
            what = f"the surface of `{occurrence.definition.label}` is not closed, so it encloses no volume to print"
            losses.append(Loss.of(occurrence.origin, "stl", None, occurrence.path, what, "approximated"))
    return Artifacts(files=dict(sorted(files.items())), losses=tuple(losses))
