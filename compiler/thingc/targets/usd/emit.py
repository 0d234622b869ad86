"""`usd/<name>_<mode>.usda`: a stage of UsdPhysics for each chosen mode, with its meshes in it."""

from __future__ import annotations

from thingc.base.generated_header import heading
from thingc.targets.artifact import Artifacts, Content
from thingc.targets.capabilities import losses
from thingc.targets.geometry import solid_geometry
from thingc.targets.request import EmitRequest
from thingc.targets.usd import losses as special
from thingc.targets.usd import raw
from thingc.targets.usd.capabilities import CAPABILITIES
from thingc.targets.usd.meshes import identifiers, prototypes
from thingc.targets.usd.stage import model
from thingc.targets.usd.usda import rendered, write


def emit(request: EmitRequest) -> Artifacts:
    """A file for each chosen mode; the meshes, which all of them hold, are put into words once."""
    assembly = request.assembly
    shapes, flat = solid_geometry(assembly, "usd", "usd", request.report)
    scope = f"{assembly.name}_meshes"
    names = identifiers({asset.name: asset.name for asset in shapes.meshes})
    meshes = rendered(prototypes(shapes, request.store, scope, names)) if names else ""
    files: dict[str, Content] = {}
    lost = dict.fromkeys((*flat, *losses("usd", CAPABILITIES, assembly, request.robots, cut=True)))
    paths = {name: f"/{scope}/{word}" for name, word in names.items()}
    models = [model(robot, shapes, paths, request.report) for robot in request.robots]
    raw.lay(assembly, models, request.report)
    for robot, made in zip(request.robots, models, strict=True):
        said = heading(assembly.definition.document, robot.mode.name)
        files[f"usd/{assembly.name}_{robot.mode.name}.usda"] = write([rendered(made), meshes], assembly.name, said).encode()
        lost |= dict.fromkeys(special.losses(robot))
    return Artifacts(files=dict(sorted(files.items())), losses=tuple(lost))
