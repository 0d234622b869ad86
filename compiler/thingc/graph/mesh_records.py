"""What is known of the mesh files that a model lists: those that somebody needs are read, of others what was read before."""

from __future__ import annotations

from thingc.diagnostics import Code, Report
from thingc.graph.mass import said_whole
from thingc.memo import Memo
from thingc.meshes import BadMesh, MeshFile, MeshRecord, measured
from thingc.realize.store.local import Store
from thingc.resolve.link_definition import LinkDefinition, mesh_files_of
from thingc.resolve.model import AssemblyDefinition
from thingc.source import Origin


def mesh_records(model: AssemblyDefinition, store: Store | None, report: Report, memo: Memo, *, drawn: bool) -> dict[MeshFile, MeshRecord]:
    """The records of mesh files, without those of which nothing is known. A file is read where it is to be `drawn`, or a link weighs by
    it, or a mode stands on the floor; one that is no mesh is an error. Without a `store` nothing is read."""
    if store is None:
        return {}
    every = drawn or any(mode.on_floor for mode in model.modes)
    records: dict[MeshFile, MeshRecord] = {}
    for file, (origin, weighed) in _listed(model).items():
        try:
            record = memo(("mesh record", file.path, file.scale, every or weighed), _measured, file, store, every or weighed)
        except BadMesh as fault:
            report.add(Code.PART_INVALID, f"`{file.path}` {fault}", origin, help="export it anew, as STL, OBJ, COLLADA, PLY or glTF")
            continue
        if record is not None:
            records[file] = record
    return records


def _measured(file: MeshFile, store: Store, read: bool) -> MeshRecord | None:
    return measured(file, store, read=read)


def _listed(model: AssemblyDefinition) -> dict[MeshFile, tuple[Origin, bool]]:
    """Every mesh file, where it is listed first, and whether some link weighs by it."""
    files: dict[MeshFile, tuple[Origin, bool]] = {}
    waiting, met = [model], {id(model)}
    while waiting:
        for component in waiting.pop().components:
            definition = component.definition
            if isinstance(definition, AssemblyDefinition) and id(definition) not in met:
                met.add(id(definition))
                waiting.append(definition)
            if not isinstance(definition, LinkDefinition) or not mesh_files_of(definition):
                continue
            weighed = not said_whole(component.overrides)
            for shape in definition.shapes:
                if isinstance(shape.solid, MeshFile):
                    origin, before = files.get(shape.solid, (shape.origin, False))
                    files[shape.solid] = (origin, before or weighed)
    return files
