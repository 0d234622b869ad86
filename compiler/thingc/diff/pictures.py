"""Pictures of what changed, by one camera: before, after, and after with what changed in colours."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from xml.etree import ElementTree

from thingc.diff.change import Change
from thingc.render import extent, small_picture

SIZE = (960, 720)
"""Width and height [px]."""
NEW, OTHER, MOVED, SAME = "0.2 0.65 0.3 1", "0.9 0.45 0.1 1", "0.25 0.45 0.9 1", "0.86 0.86 0.88 1"
"""Colours of what is new, what is another now, what only stands elsewhere, and of the rest."""
Model = tuple[str, dict[str, bytes]]


def pictures(old: Model, new: Model, changes: Iterable[Change]) -> Mapping[str, bytes]:
    """PNG files `before`, `after` and `overlay` of MuJoCo models with their meshes; none where nothing is to be seen. Call
    `ready` of `render` first, before MuJoCo is imported."""
    seen = [extent(xml, assets, None) for xml, assets in (old, new)]
    points = [point for corners, _ in seen for point in corners]
    if not points:
        return {}
    drawn = {"before": old, "after": new, "overlay": (coloured(new[0], colours(changes)), new[1])}
    return {name: small_picture(xml, assets, None, points, seen[1][1], SIZE) for name, (xml, assets) in drawn.items()}


def colours(changes: Iterable[Change]) -> dict[str, str]:
    """The colour of each part of the new robot that is not as it was, by path; what is inside of a new assembly is named itself."""
    found: dict[str, str] = {}
    for change in changes:
        path = change.new_path or change.path
        if change.what == "component" and change.change == "added":
            found[path] = NEW
        elif change.what in ("geometry", "component") and change.change == "changed" or change.what == "geometry":
            found.setdefault(path, OTHER)
    for change in changes:
        if change.what == "component" and change.change == "moved":
            found.setdefault(change.new_path or change.path, MOVED)
    return found


def coloured(xml: str, colours: Mapping[str, str]) -> str:
    """A model whose drawn parts have these colours, and the rest a pale one."""
    root = ElementTree.fromstring(xml)
    for geom in root.iter("geom"):
        if geom.get("class") == "visual" and (name := geom.get("name")) is not None:
            geom.set("rgba", colours.get(name, SAME))
    return ElementTree.tostring(root, encoding="unicode")
