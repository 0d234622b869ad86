"""Included models of SDF (http://sdformat.org/tutorials?tut=composition)."""

from __future__ import annotations

import re

from msgspec.structs import replace

from thingc.base.diagnostics import Code, Report
from thingc.tools.importing.packages import NotFound, Packages
from thingc.tools.importing.xml_source import Losses, SourceElement, read_robot, read_xml
from thingc.tools.importing.xml_values import ChildValues

MOST_INCLUDES = 100
READ = ("uri", "name", "pose", "placement_frame", "static")
"""Elements of an `<include>` that are read."""


class Includes:
    """Replaces each `<include>` in the elements of a file by the model that it names; `roots` are those of all files that were read."""

    def __init__(self, root: SourceElement, packages: Packages, report: Report, losses: Losses) -> None:
        self.packages, self.report, self.losses, self.values = packages, report, losses, ChildValues(report)
        self.roots, self.folders = [root], {root.where.file: ""}
        self._expand(root)

    def uri(self, uri: str, source: str) -> str:
        """A URI in the file `source`, as the first file would write it."""
        folder = self.folders[source]
        return uri if not folder or "://" in uri else f"{folder}/{uri}"

    def _expand(self, element: SourceElement) -> None:
        for number, child in enumerate(element.children):
            if child.tag == "include":
                try:
                    element.children[number] = self._model(child) or child
                except NotFound as fault:
                    uri = self.values.place(child, "uri")
                    if element.tag == "world":  # maybe the sun or the ground
                        self.report.warn(Code.SOURCE_DOUBT, f"this is left out: {fault}", uri, help="if it is scenery, take it out")
                    else:
                        self.report.add(Code.SOURCE_FILE, str(fault), uri, help=fault.help)
            elif child.tag in ("world", "model"):
                self._expand(child)

    def _model(self, include: SourceElement) -> SourceElement | None:
        """Raises `NotFound`."""
        before = len(self.report.diagnostics)
        said = {tag: one for tag in READ if (one := self.values.one(include, tag)) is not None}
        if "placement_frame" in said and "pose" not in said:
            self.values.fault(include, None, "an `<include>` with `<placement_frame>` requires `<pose>`", "write <pose>0 0 0 0 0 0</pose>")
        if include.attributes.get("merge", "").strip() in ("1", "true"):
            self.values.fault(include, "merge", "`merge` is not read", "`gz sdf -p FILE > robot.sdf` writes the merged model")
        if len(self.roots) > MOST_INCLUDES:
            message = f"the file includes more than {MOST_INCLUDES} models, or one that includes itself"
            self.values.fault(include, None, message, "include a model that does not include this one")
        uri = self.values.word(include, "uri")
        if uri is None or len(self.report.diagnostics) > before:
            return None
        uri = self._file(self.uri(uri.rstrip("/"), include.where.file))
        path, data = self.packages.read(uri)
        root = read_robot(path, data, self.report, "sdf", "an SDF")
        models = [] if root is None else [*root.all("model")]
        if root is None or len(models) != 1:
            self.values.fault(include, "uri", f"expected a file with one model, found {len(models)} in `{uri}`")
            return None
        self.roots.append(root)
        self.folders[path] = uri.rpartition("/")[0] or "."
        self._expand(model := models[0])
        for child in (one for one in include.children if one.tag not in READ):
            self.losses.note(f"`<{child.tag}>` of `<include>`", "it is not read", child.where)
        kept = [child for child in model.children if child.tag not in said]
        names = {str(tag): said[tag].text for tag in ("name", "placement_frame") if tag in said}
        own = [said[tag] for tag in ("pose", "static") if tag in said]
        return replace(include, tag="model", attributes={**model.attributes, **names}, children=[*own, *kept], texts=[])

    def _file(self, uri: str) -> str:
        """Of a folder the file of the newest version that its `model.config` names."""
        if uri.endswith((".sdf", ".world", ".urdf")):
            return uri
        try:
            config = read_xml(*self.packages.read(f"{uri}/model.config"), self.report)
        except NotFound:
            config = None
        files = [] if config is None else [*config.all("sdf")]
        newest = max(files, key=lambda one: [*map(int, re.findall(r"\d+", one.attributes.get("version", "")))], default=None)
        return f"{uri}/{'model.sdf' if newest is None else newest.text}"
