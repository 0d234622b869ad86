"""Write `step/<name>.step`, which contains the whole robot at q = 0, in the frame of the base component."""

from __future__ import annotations

from collections.abc import Callable

from thingc.base.diagnostics import Code
from thingc.geometry.record import AssemblyFailed, Placed, StoredFile
from thingc.targets.artifact import Artifacts, Loss, StoredArtifact
from thingc.targets.request import EmitRequest

PendingFile = tuple[Callable[[], StoredFile] | None, tuple[Loss, ...]]
"""A function that waits for the STEP file, or None if no part has exact geometry, and the export losses of the target."""


def emit(request: EmitRequest) -> Artifacts:
    """Write a STEP file that contains one shape for each definition. Each occurrence is a coloured instance of a shape. The name of the
    instance is the path of the occurrence. The shape of a part file has the name of the first component that uses the file.

    The geometry service writes the file with the CAD kernel. Parts without a B-rep (meshes) and links with listed shapes are reported as
    export losses. If the robot has no geometry, no file is written, and an export loss is reported. If the CAD kernel fails, an error is
    reported for the document.
    """
    assembly = request.assembly
    file, losses = begin(request)
    if file is None:
        what = "no part of the robot has exact geometry" if losses else "no part of the robot has geometry"
        no_file = Loss("step", None, assembly.name, what, "omitted", assembly.definition.origin)
        return Artifacts(files={}, losses=(*losses, no_file))
    try:
        written = file()
    except AssemblyFailed as fault:
        request.report.add(
            Code.STEP_FAILED, f"cannot write the STEP file of `{assembly.name}`: {fault.reason}", assembly.definition.origin,
            help="select targets other than `step` with --emit", detail=fault.detail,
        )
        return Artifacts(files={}, losses=losses)
    return Artifacts(files={f"step/{assembly.name}.step": StoredArtifact(sha256=written.sha256, size=written.size)}, losses=losses)


def begin(request: EmitRequest) -> PendingFile:
    """Start to write the STEP file in a process of the CAD kernel, if it was not started before. Meanwhile, other targets are written.

    The function `emit` waits until the file is finished.
    """
    pending: PendingFile | None = request.made.get("step")
    if pending is not None:
        return pending
    assembly = request.assembly
    instances: list[Placed] = []
    names: dict[str, str] = {}
    losses: list[Loss] = []
    for occurrence in assembly.occurrences:
        record = occurrence.record
        if not occurrence.drawn and not occurrence.touching and (record is None or record.box is None):
            continue
        if record is None or record.brep is None:
            what = f"`{occurrence.definition.label}` {'is a mesh' if record is not None else 'consists of shapes'} without exact surfaces"
            losses.append(Loss("step", None, occurrence.path, what, "omitted", occurrence.origin))
            continue
        text, pose = occurrence.definition.text, assembly.rest[occurrence.index]
        # the kernel's own reader fails on a quotation mark in a product's name (OCCT 8.0: "Incorrect Syntax")
        name = names.setdefault(text, occurrence.component.key if occurrence.definition.kind == "file" else text.replace("'", ""))
        instances.append(Placed(path=occurrence.path, definition=name, brep=record.brep, pose=pose, color=occurrence.color))
    file = request.geometry.assemble(assembly.name, instances) if instances else None
    pending = request.made["step"] = file, tuple(losses)
    return pending
