"""Render pictures of the robot before and after a change with the same camera, and an overlay in which changed parts are coloured."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from xml.etree import ElementTree

from thingc.targets.render.picture import body_poses, extent, small_picture
from thingc.tools.diff.document_changes import above_of
from thingc.tools.diff.snapshot import Change

SIZE = (960, 720)
"""Width and height of a picture [px]."""
NEW, OTHER, MOVED, SAME, GONE = "0.2 0.65 0.3 1", "0.9 0.45 0.1 1", "0.25 0.45 0.9 1", "0.86 0.86 0.88 1", "0.85 0.1 0.15 0.45"
"""RGBA colours of added, changed, moved, unchanged and removed parts."""
Model = tuple[str, dict[str, bytes]]


def pictures(old: Model, new: Model, changes: Iterable[Change]) -> Mapping[str, bytes]:
    """Render two MuJoCo models with their meshes.

    Return PNG data for `before`, `after` and `overlay`, or an empty mapping if no geom is visible. Call `render.ready` before the first
    import of MuJoCo.
    """
    extents = [extent(xml, assets, None) for xml, assets in (old, new)]
    points = [point for corners, _ in extents for point in corners]
    if not points:
        return {}
    changes = list(changes)
    drawn = {"before": old, "after": new, "overlay": with_removed((set_colours(new[0], colours(changes)), new[1]), old, changes)}
    return {name: small_picture(xml, assets, None, points, extents[1][1], SIZE) for name, (xml, assets) in drawn.items()}


def colours(changes: Iterable[Change]) -> dict[str, str]:
    """Return the colour of each changed part of the new robot, keyed by path.

    If an assembly was added, the result contains each of its components.
    """
    by_path: dict[str, str] = {}
    for change in changes:
        path = change.new_path or change.path
        if change.what == "component" and change.change == "added":
            by_path[path] = NEW
        elif change.what in ("geometry", "component") and change.change == "changed" or change.what == "geometry":
            by_path.setdefault(path, OTHER)
    for change in changes:
        if change.what == "component" and change.change == "moved":
            by_path.setdefault(change.new_path or change.path, MOVED)
    return by_path


def set_colours(xml: str, colours: Mapping[str, str]) -> str:
    """Set the colours of the changed parts in a MuJoCo model. All other visual geoms get a pale colour."""
    root = ElementTree.fromstring(xml)
    for geom in root.iter("geom"):
        if geom.get("class") == "visual" and (name := geom.get("name")) is not None:
            geom.set("rgba", colours.get(name, SAME))
    return ElementTree.tostring(root, encoding="unicode")


def with_removed(new: Model, old: Model, changes: Iterable[Change]) -> Model:
    """Return the new MuJoCo model with the removed parts added at their poses in the old model."""
    removed_paths = {change.path for change in changes if change.what == "component" and change.change == "removed"}
    before, root = ElementTree.fromstring(old[0]), ElementTree.fromstring(new[0])
    meshes = {mesh.get("name"): mesh for mesh in before.iter("mesh")}
    world, asset = root.find("worldbody"), root.find("asset")
    removed = [
        (body, geom) for body in before.iter("body") for geom in body.findall("geom")
        if geom.get("class") == "visual" and not removed_paths.isdisjoint(above_of(geom.get("name", "")))
    ]
    if not removed or world is None:
        return new
    if asset is None:
        asset = ElementTree.SubElement(root, "asset")
    poses, files = body_poses(*old, None), dict(new[1])
    for body, geom in removed:
        (x, y, z), (a, b, c, d) = poses[body.get("name", "")]
        place = ElementTree.SubElement(world, "body", {"pos": f"{x} {y} {z}", "quat": f"{a} {b} {c} {d}"})
        attributes = {key: value for key, value in geom.attrib.items() if key not in ("name", "material")} | {"rgba": GONE}
        mesh = meshes.get(geom.get("mesh"))
        if mesh is not None:
            name, file = f"gone:{mesh.get('name')}", mesh.get("file", "")
            where = f"gone_{file.replace('/', '_')}"  # MuJoCo ignores the folder in the name of a mesh file
            if where not in files:
                ElementTree.SubElement(asset, "mesh", {**mesh.attrib, "name": name, "file": where})
                files[where] = old[1][file]
            attributes["mesh"] = name
        ElementTree.SubElement(place, "geom", attributes)
    return ElementTree.tostring(root, encoding="unicode"), files
