"""MJCF: one MuJoCo model, one scene and one archive per mode, and the meshes that all of them share."""

from __future__ import annotations

from thingc.emit import mjcf_archive, mjcf_check, mjcf_geometry, mjcf_model, mjcf_raw, mjcf_scene
from thingc.emit.artifact import Artifacts, Content, Loss
from thingc.emit.mjcf_xml import write
from thingc.emit.request import EmitRequest


def emit(request: EmitRequest) -> Artifacts:
    """`mjcf/<name>_<mode>.xml`, `.mjz` and `mjcf/scene_<mode>.xml` of each chosen mode, and `mjcf/assets/`.

    Every file has been compiled by MuJoCo; what it says against one is in the report, at the place in the documents.
    """
    assembly, robots, report = request.assembly, request.robots, request.report
    geometry = mjcf_geometry.geometry(assembly, report)
    models = [mjcf_model.model(robot, geometry) for robot in robots]
    mjcf_raw.lay(assembly, robots, models, report)

    files: dict[str, Content] = {}
    losses: dict[Loss, None] = dict.fromkeys(geometry.losses)
    candidates: list[mjcf_check.Candidate] = []
    for robot, model in zip(robots, models, strict=True):
        stem = f"{assembly.name}_{robot.mode.name}"
        heading = f"Written by thingc from {assembly.definition.document}, mode {robot.mode.name}."
        written = write(model, heading)
        scene = write(mjcf_scene.scene(robot, model, f"{stem}.xml"), heading)
        files[f"mjcf/{stem}.xml"] = written.text.encode()
        files[f"mjcf/scene_{robot.mode.name}.xml"] = scene.text.encode()
        losses |= dict.fromkeys(mjcf_model.losses(robot))
        candidates.append(mjcf_check.Candidate(
            mode=robot.mode.name, file=f"{stem}.xml", root=model, heading=heading, model=written, scene=scene,
            origin=robot.mode.origin,
        ))
    mjcf_check.check(candidates, geometry.meshes, request.store, report)
    if not report.failed:
        for candidate in candidates:
            model_text = candidate.model.text.encode()
            files[f"mjcf/{candidate.file.removesuffix('.xml')}.mjz"] = mjcf_archive.archive(
                model_text, geometry.assets, request.store
            )
    files |= {f"mjcf/assets/{file}": stored for file, stored in geometry.assets.items()}
    return Artifacts(files=dict(sorted(files.items())), losses=tuple(losses))
