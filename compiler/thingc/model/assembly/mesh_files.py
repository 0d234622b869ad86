"""Which mesh files a model lists, and which of them have to be read."""

from __future__ import annotations

from thingc.base.source import Origin
from thingc.geometry.meshes.files import MeshFile
from thingc.model.assembly.mass import is_fully_stated
from thingc.model.resolve.link_definition import LinkDefinition, mesh_files_of
from thingc.model.resolve.nested_assemblies import assemblies_of
from thingc.model.resolve.types import AssemblyDefinition


def listed_meshes(model: AssemblyDefinition, *, drawn: bool) -> dict[MeshFile, tuple[Origin, bool]]:
    """Every mesh file, where it is listed first, and whether it has to be read: it is to be `drawn`, some link weighs by it, or a mode
    stands on the floor."""
    every = drawn or any(mode.on_floor for mode in model.modes)
    files: dict[MeshFile, tuple[Origin, bool]] = {}
    for assembly in assemblies_of(model):
        for component in assembly.components:
            definition = component.definition
            if not isinstance(definition, LinkDefinition) or not mesh_files_of(definition):
                continue
            wanted = every or not is_fully_stated(component.overrides)
            for shape in definition.shapes:
                if isinstance(shape.solid, MeshFile):
                    origin, before = files.get(shape.solid, (shape.origin, False))
                    files[shape.solid] = (origin, before or wanted)
    return files
