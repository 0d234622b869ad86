"""Merge MuJoCo models that have different meshes into one model, which contains all meshes.

In the merged model, an array selects the mesh of each geom.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING
from xml.etree import ElementTree

from thingc.base.frozen_struct import FrozenStruct
from thingc.batch.mujoco_arrays.equality import digest
from thingc.batch.shared_model import changeable_fields, element_names

if TYPE_CHECKING:
    import mujoco

_OF_MESHES = ("mesh_", "nmesh", "bvh_", "nbvh", "oct_", "names", "name_", "paths", "mat_", "tex_", "geom_matid", "stat.")
"""Prefixes of the names of fields that describe meshes, or that depend on meshes or on visual geometry."""
_FOLLOWING = frozenset(("noct", "nnames", "nnames_map", "npaths", "nbuffer", "narena", "nmat", "geom_dataid"))


class ModelSource(FrozenStruct, eq=False):
    """The XML text of a MuJoCo model, and the contents of its mesh files by file name."""

    text: str
    assets: Mapping[str, bytes]


def likeness(model: mujoco.MjModel) -> bytes:
    """Return bytes that are equal for models that can be merged.

    The bytes depend on all values of the model except meshes and numbers that can be changed.
    """
    elements = {kind: parts for kind, parts in element_names(model).items() if kind not in ("mesh", "material")}
    fields = digest(model, lambda name: not (name in changeable_fields() or name in _FOLLOWING or name.startswith(_OF_MESHES)))
    return fields + repr([elements, [model.numeric(k).name for k in range(model.nnumeric)]]).encode()


def merge_models(sources: Sequence[ModelSource], models: Sequence[mujoco.MjModel]) -> tuple[mujoco.MjModel, list[list[int]]] | None:
    """Merge several MuJoCo models without visual geometry into one.

    Return the merged model, and a list for each source model with the mesh number of every geom. For a geom without a mesh, the mesh number
    is -1. Return None if the geoms of the merged model do not match the geoms of the source models.
    """
    root = ElementTree.fromstring(sources[0].text)
    for body in root.iter("body"):
        for geom in body.findall("geom"):
            if geom.get("class") == "visual":
                body.remove(geom)
            else:
                geom.attrib.pop("material", None)
    asset = root.find("asset")
    if asset is None:
        return None
    asset.clear()
    files: dict[str, bytes] = {}
    named: list[dict[str, str]] = []
    model_by_name: dict[tuple[str, bytes, str], str] = {}
    for source, model in zip(sources, models, strict=True):
        used = {model.mesh(k).name for k in range(model.nmesh)}
        meshes: dict[str, str] = {}
        for mesh in ElementTree.fromstring(source.text).iterfind("asset/mesh"):
            name, file = mesh.get("name", ""), mesh.get("file", "")
            if name not in used:
                continue
            data = source.assets[file]
            key = (name, hashlib.sha256(data).digest(), mesh.get("inertia", ""))
            if key not in model_by_name:
                model_by_name[key] = name if name not in model_by_name.values() else f"{name}~{len(model_by_name)}"
                stem, _, suffix = file.rpartition(".")
                placed = f"{stem}~{len(model_by_name)}.{suffix}"
                files[placed] = data
                ElementTree.SubElement(asset, "mesh", {**mesh.attrib, "name": model_by_name[key], "file": placed})
            meshes[name] = model_by_name[key]
        named.append(meshes)
    for geom in root.iter("geom"):
        if (mesh_name := geom.get("mesh")) is not None and mesh_name in named[0]:
            geom.set("mesh", named[0][mesh_name])
    merged = _with_hulls(ElementTree.tostring(root, encoding="unicode"), files, list(model_by_name.values()))
    if any([merged.geom(k).name for k in range(merged.ngeom)] != [one.geom(k).name for k in range(one.ngeom)] for one in models):
        return None
    numbers = {merged.mesh(k).name: k for k in range(merged.nmesh)}
    chosen = [
        [numbers[meshes[model.mesh(int(data)).name]] if data >= 0 else -1 for data in model.geom_dataid]
        for meshes, model in zip(named, models, strict=True)
    ]
    return merged, chosen


def _with_hulls(text: str, files: dict[str, bytes], meshes: Sequence[str]) -> mujoco.MjModel:
    """Compile a MuJoCo model in which every mesh has a convex hull, including meshes that no colliding geom uses.

    MuJoCo computes convex hulls only for meshes of colliding geoms. However, any geom of the merged model can later use any mesh. The
    function therefore adds a temporary geom for each mesh and deletes it again. The hull of the mesh remains in the model.
    """
    import mujoco

    spec = mujoco.MjSpec.from_string(text, assets=files)
    touching = spec.worldbody.add_body(name="#")
    for mesh in meshes:
        touching.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=mesh, contype=1)
    spec.compile()
    spec.delete(spec.body("#"))
    return spec.compile()
