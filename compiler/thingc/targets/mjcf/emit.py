"""Write MJCF files: a MuJoCo model and a scene for each mode, and the meshes that all models share."""

from __future__ import annotations

from msgspec.structs import replace

from thingc.base.diagnostics import Code, Report
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.generated_header import heading
from thingc.base.zip_files import MODEL, ZipEntry, deflate, make_zip
from thingc.geometry.store.local import BlobMissing, Store
from thingc.model.robot.types import Robot
from thingc.targets import modes_json
from thingc.targets.artifact import Artifacts, Content, Loss, StoredArtifact
from thingc.targets.capabilities import losses
from thingc.targets.custom_names import apply_custom_names
from thingc.targets.geometry import Geometry
from thingc.targets.mjcf import body_tree as tree, compat, raw, raw_elements, scene, verify
from thingc.targets.mjcf.accepted_models import choose_geometry
from thingc.targets.mjcf.capabilities import CAPABILITIES
from thingc.targets.request import EmitRequest
from thingc.targets.xml_writer import Element, write


class Models(FrozenStruct):
    """The MJCF models of all modes, before they are written to files. `assets` contains the mesh files in the folder `assets/`, by file
    name.
    """

    candidates: tuple[verify.Candidate, ...]
    assets: dict[str, StoredArtifact]
    losses: tuple[Loss, ...]


def emit(request: EmitRequest) -> Artifacts:
    """Return `mjcf/<name>_<mode>.xml` and `mjcf/scene_<mode>.xml` of each chosen mode, and `mjcf/assets/`."""
    mjcf_models = models(request)
    files: dict[str, Content] = {}
    for candidate in mjcf_models.candidates:
        files[f"mjcf/{candidate.file}"] = candidate.model.text.encode()
        files[f"mjcf/scene_{candidate.mode}.xml"] = candidate.scene.text.encode()
    files |= {f"mjcf/assets/{file}": stored for file, stored in mjcf_models.assets.items()}
    return Artifacts(files=dict(sorted(files.items())), losses=mjcf_models.losses)


def emit_with_modes(request: EmitRequest) -> Artifacts:
    """Return the files of `emit`, and `modes.json`, which contains addresses in the models."""
    artifacts = emit(request)
    return replace(artifacts, files={**artifacts.files, **modes_json.emit(request).files})


def models(request: EmitRequest) -> Models:
    """Return the MJCF models of the chosen modes. The models are computed only once for all targets of a request.

    If `verify` is not 0, MuJoCo compiles all models or a sample of the models. Messages of MuJoCo are reported at the locations in the
    documents that cause them.
    """
    request = request.in_target("mjcf")
    known = request.made.get("mjcf")
    if isinstance(known, Models):
        return known
    assembly, robots, report = request.assembly, request.robots, request.report
    geometry, tree_losses, roots, compat_losses = _roots(request)
    all_losses: dict[Loss, None] = dict.fromkeys((*tree_losses, *losses("mjcf", CAPABILITIES, assembly, robots)))
    candidates: list[verify.Candidate] = []
    for robot, root in zip(robots, roots, strict=True):
        file, comment = f"{assembly.name}_{robot.mode.name}.xml", _heading(robot)
        all_losses |= dict.fromkeys(tree.losses(robot))
        model = write(root, comment)
        candidates.append(verify.Candidate(
            mode=robot.mode.name, file=file, root=root, heading=comment, model=model,
            scene=scene.scene(robot, file, comment, model, request.memo, compat.separator(request.compat)), robot=robot,
        ))
    all_losses |= compat_losses
    scenes = {f"scene_{candidate.mode}.xml" for candidate in candidates}
    for file in sorted(scenes & {candidate.file for candidate in candidates}):
        report.add(
            Code.SAME_NAME, f"the model and the scene of the robot have the same file name (`mjcf/{file}`)", assembly.definition.origin,
            help="rename the robot",
        )
    if request.verify:
        starts = not request.repeated
        selected = verify.select_models(candidates, request.verify, request.memo)
        remaining = verify.remaining(selected, geometry.meshes, request.store, request.memo, starts=starts)
        verify.check(remaining, geometry, request.store, report, request.memo, starts=starts)
        if not report.diagnostics:
            verify.record_accepted(selected, request.verify, request.memo)
    mjcf_models = request.made["mjcf"] = Models(candidates=tuple(candidates), assets=geometry.assets, losses=tuple(all_losses))
    return mjcf_models


def sources(request: EmitRequest, *, floor: bool = False) -> tuple[dict[str, str], dict[str, StoredArtifact]]:
    """Return the XML text of the MJCF model of each mode, and the mesh files by name. MuJoCo does not compile or check these models.

    If `floor` is True, each model contains the floor of its scene.
    """
    request = apply_custom_names(request.in_target("mjcf"))
    geometry, _, roots, _ = _roots(request)
    texts: dict[str, str] = {}
    for robot, root in zip(request.robots, roots, strict=True):
        model = write(root, _heading(robot))
        texts[robot.mode.name] = scene.scene_text(robot, model, compat.separator(request.compat)) if floor else model.text
    return texts, geometry.assets


def model_trees(request: EmitRequest) -> list[Element]:
    """Return the MJCF tree of each mode. If no target writes the models, errors and warnings of the models are not reported."""
    request = request.in_target("mjcf")
    known = request.made.get("mjcf")
    if isinstance(known, Models):
        return [candidate.root for candidate in known.candidates]
    return _roots(replace(request, report=Report()))[2]


def _roots(request: EmitRequest) -> tuple[Geometry, list[Loss], list[Element], dict[Loss, None]]:
    """Return the shapes and the final MJCF tree of each mode.

    Also return two kinds of export losses: those of the shapes, and those that result from adapting the trees to other programs.
    """
    geometry, flat = choose_geometry(request.assembly, request.report)
    roots = [tree.model(robot, geometry.in_mode(robot.mode.name), request.memo) for robot in request.robots]
    omitted = raw_elements.add(request.assembly, request.robots, roots, request.report)
    raw.apply(request.assembly, request.robots, roots, request.report)
    return geometry, [*flat, *omitted], *compat.adapt_models(request.compat, request.robots, roots, request.report)


def _heading(robot: Robot) -> str:
    return heading(robot.assembly.definition.document, robot.mode.name)


def emit_archives(request: EmitRequest) -> Artifacts:
    """Write `mjcf/<name>_<mode>.mjz` for each chosen mode.

    MJZ is a zip file that contains a model with its meshes, and that MuJoCo can open. The bytes of the file are reproducible. The function
    does not use the writers of MuJoCo and Python. `MjSpec.encode` would store the current time and write numbers with only six digits.
    `zipfile` would compress the meshes again for every mode and every edit. Instead, each mesh is compressed once, and the result is cached
    in the store.
    """
    mjcf_models = models(request)
    if request.report.failed:
        return Artifacts(files={}, losses=mjcf_models.losses)
    assets = {f"assets/{file}": _asset(stored, request.store) for file, stored in mjcf_models.assets.items()}
    return Artifacts(
        files={
            f"mjcf/{candidate.file.removesuffix('.xml')}.mjz": make_zip({MODEL: candidate.model.text.encode(), **assets})
            for candidate in mjcf_models.candidates
        },
        losses=mjcf_models.losses,
    )


def _asset(stored: StoredArtifact, store: Store) -> ZipEntry:
    """Return the zip entry of a compressed asset. The entry is read from the store if possible."""
    deflated = store.get_json("deflated", stored.sha256)
    if deflated is not None:
        try:
            return ZipEntry(data=store.read(deflated["sha256"]), crc=deflated["crc"], size=deflated["size"])
        except BlobMissing:
            pass
    entry = deflate(store.read(stored.sha256))
    store.put_json("deflated", stored.sha256, {"sha256": store.put(entry.data), "crc": entry.crc, "size": entry.size})
    return entry
