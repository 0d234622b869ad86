"""Write `urdf/<name>_<mode>.urdf`, a URDF 1.0 file for each chosen mode. The meshes are in the shared folder `urdf/meshes/`."""

from __future__ import annotations

from pathlib import Path

from thingc.base.generated_header import heading
from thingc.targets import raw
from thingc.targets.artifact import Artifacts, Content
from thingc.targets.capabilities import losses
from thingc.targets.geometry import collect_geometry
from thingc.targets.name_mangling import package_name
from thingc.targets.request import EmitRequest
from thingc.targets.urdf.capabilities import CAPABILITIES
from thingc.targets.urdf.links import MESHES, model, mujoco_extension
from thingc.targets.urdf.transmissions import transmission_losses
from thingc.targets.xml_writer import write

FOLDER = f"urdf/{MESHES}"


def emit(request: EmitRequest) -> Artifacts:
    """Write a URDF file for each chosen mode."""
    assembly = request.assembly
    shapes, flat = collect_geometry(assembly, "urdf", FOLDER, request.report)
    meshes = _uri(request)
    files: dict[str, Content] = {f"{FOLDER}/{file}": stored for file, stored in shapes.assets.items()}
    trees = [model(robot, shapes.in_mode(robot.mode.name), request.report, meshes) for robot in request.robots]
    for robot, tree in zip(request.robots, trees, strict=True):
        tree.children.insert(0, mujoco_extension(robot))
    raw.apply(assembly, request.robots, "urdf", trees, request.report)
    for robot, tree in zip(request.robots, trees, strict=True):
        comment = heading(assembly.definition.document, robot.mode.name)
        files[f"urdf/{assembly.name}_{robot.mode.name}.urdf"] = write(tree, comment).text.encode()
    all_losses = (*losses("urdf", CAPABILITIES, assembly, request.robots), *transmission_losses("urdf", request.robots))
    return Artifacts(files=dict(sorted(files.items())), losses=tuple(dict.fromkeys((*flat, *all_losses))))


def _uri(request: EmitRequest) -> str:
    """Return the URI of the mesh folder, which the workspace can configure. If the path of the build folder is unknown, the URI is
    relative.
    """
    match request.workspace.mesh_uri:
        case "package":
            return f"package://{package_name(request.assembly.name)}/{MESHES}"
        case "absolute" if request.folder is not None:
            return Path(request.folder, FOLDER).as_uri()
    return MESHES
