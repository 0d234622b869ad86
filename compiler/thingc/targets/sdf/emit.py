"""`sdf/<name>_<mode>/`: each chosen mode as a model folder of Gazebo's, and `sdf/world_<mode>.sdf`, a world with it."""

from __future__ import annotations

from thingc.base.generated_header import heading
from thingc.targets import raw
from thingc.targets.artifact import Artifacts, Content
from thingc.targets.capabilities import losses
from thingc.targets.geometry import solid_geometry
from thingc.targets.request import EmitRequest
from thingc.targets.sdf import losses as special
from thingc.targets.sdf.capabilities import CAPABILITIES
from thingc.targets.sdf.model_element import MESHES, model
from thingc.targets.sdf.world import config, world
from thingc.targets.sdf.zero_pose import zero_state
from thingc.targets.xml_writer import write


def emit(request: EmitRequest) -> Artifacts:
    """A folder and a world for each chosen mode. A model folder holds its own meshes, as Gazebo has it: one can be copied without the
    others."""
    assembly = request.assembly
    shapes, flat = solid_geometry(assembly, "sdf", f"sdf/{assembly.name}_MODE/{MESHES}", request.report)
    meshes = {f"{MESHES}/{file}": stored for file, stored in shapes.assets.items()}
    files: dict[str, Content] = {}
    lost = dict.fromkeys((*flat, *losses("sdf", CAPABILITIES, assembly, request.robots, cut=True)))
    zeros = [zero_state(robot) for robot in request.robots]
    made = [model(robot, shapes, zero, request.report) for robot, zero in zip(request.robots, zeros, strict=True)]
    models = [written for written, _ in made]
    lost |= dict.fromkeys(loss for _, renamed in made for loss in renamed)
    raw.lay(assembly, request.robots, "sdf", models, request.report)
    for robot, zero, written in zip(request.robots, zeros, models, strict=True):
        name = f"{assembly.name}_{robot.mode.name}"
        said = heading(assembly.definition.document, robot.mode.name)
        files[f"sdf/{name}/model.sdf"] = write(written, said).text.encode()
        files[f"sdf/{name}/model.config"] = write(config(name, written.get("version"), said), said).text.encode()
        files[f"sdf/world_{robot.mode.name}.sdf"] = write(world(robot, name), said).text.encode()
        files |= {f"sdf/{name}/{path}": content for path, content in meshes.items()}
        lost |= dict.fromkeys(special.losses(robot, zero))
    return Artifacts(files=dict(sorted(files.items())), losses=tuple(lost))
