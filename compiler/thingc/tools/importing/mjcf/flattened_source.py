"""Flatten an MJCF file and its included files to one text with one tag per line, so that MuJoCo's line numbers can be mapped to the source.

MuJoCo itself would open every file that the source refers to. Instead, this module reads included files and meshes of limited size, and
passes the contents to MuJoCo in memory. Elements that documents do not support, and elements that could use unlimited memory, are omitted
and recorded as losses.
"""

from __future__ import annotations

import hashlib
import math
import os
import re
from xml.sax.saxutils import quoteattr

from thingc.base.diagnostics import Code, Note, Report
from thingc.base.source import Span
from thingc.tools.importing.packages import NotFound, Packages
from thingc.tools.importing.xml_source import Losses, SourceElement, read_xml
from thingc.tools.importing.xml_values import NOT_FINITE

MOST_COPIES, MOST_ELEMENTS = 10_000, 100_000
"""Maximum number of copies of an element that `<replicate>` creates, and maximum number of elements of a model, including copies."""
MOST_STEPS = 100_000
"""Maximum number of simulation steps that MuJoCo uses to compute the length range of a muscle."""
MOST_MESH_BYTES = 500_000_000
"""Maximum total size of meshes [bytes]. A mesh counts once for each use, because MuJoCo computes a convex hull for each use."""
LEFT_OUT = {
    "texture": "shapes have the colours of materials", "hfield": "documents do not support height fields",
    "skin": "documents do not support skins", "flex": "documents support only rigid links",
    "flexcomp": "documents support only rigid links",
    "composite": "replace `<composite>` by bodies", "size": "MuJoCo computes the sizes of a model",
    "text": "documents cannot store custom data", "tuple": "documents cannot store custom data",
    "extension": "documents do not support plugins",
    "statistic": "MuJoCo computes the statistics of a model", "light": "lights are part of a scene, not of a robot",
    "visual": "rendering settings are part of a scene, not of a robot",
}
ABSENT = ".absent"
"""Text in front of the file extension in the names of files that replace missing meshes."""
SMALL_SOLID = b"v 0 0 0\nv .001 0 0\nv 0 .001 0\nv 0 0 .001\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
FOLDERS = ("meshdir", "assetdir", "texturedir", "strippath")


class FlattenedSource:
    """An MJCF file and its included files, which the method `text` flattens to one text for MuJoCo.

    `lines` contains the source element of each line of the text. `files` maps file names in the text to contents. `meshes` maps the same
    names to paths relative to the folder of the source. `models` contains the texts of attached models, and `roots` the root elements of
    included files. If `with_meshes` is False, each mesh that cannot be read is replaced by a small solid.
    """

    def __init__(self, root: SourceElement, packages: Packages, report: Report, with_meshes: bool) -> None:
        self.root, self.packages, self.report, self.with_meshes = root, packages, report, with_meshes
        self.included: dict[str, Span] = {}
        self.texts: list[str] = []
        self.lines: list[SourceElement] = []
        self.files: dict[str, bytes] = {}
        self.meshes: dict[str, str] = {}
        self.losses = Losses()
        self.roots: list[SourceElement] = []
        self.strip, self.folder = False, ""
        self.element_count = self.mesh_bytes = 0
        self.names: set[str | None] = set()
        self.models: dict[str, bytes] = {}
        self.model_files: dict[int, str] = {}
        self.sizes: dict[str, int] = {}

    def text(self) -> str | None:
        """Return the flattened text. If a file is missing or invalid, report an error and return None."""
        error_count = len(self.report.diagnostics)
        text = self._file(self.root)
        return text if len(self.report.diagnostics) == error_count else None

    def element(self, message: str) -> SourceElement:
        """Return the source element of the line that a MuJoCo message mentions, such as `line 7`.

        Return the root element if the message does not contain a line number.
        """
        number = [int(one) for one in re.findall(r"line\s*=?\s*(\d{1,9})\b", message)]
        return self.lines[number[-1] - 1] if number and 1 <= number[-1] <= len(self.lines) else self.root

    def find_root(self, element: SourceElement) -> SourceElement:
        """Return the root element whose attribute `model` names the robot to which `element` belongs.

        This is the root element of the file that contains `element`, or of the main file if that file does not specify a model name.
        """
        named = (one for one in self.roots if one.where.file == element.where.file and one.attributes.get("model", "").strip())
        return next(named, self.root)

    def place(self, message: str, attribute: str | None = None) -> Span:
        """Return the source location of the line that a MuJoCo message mentions."""
        element = self.element(message)
        return element.where if attribute is None else element.place(attribute)

    def _file(self, root: SourceElement) -> str:
        """Return the flattened text of a file. The texts of attached models are flattened first.

        Line numbers are unique across all texts.
        """
        self._include(root)
        for model in (one for section in root.all("asset") for one in section.all("model")):
            if (attached := self._read(model)) is not None:
                elements_before, name = self.element_count, model.attributes.get("name") or attached.attributes.get("model", "")
                self.models[f"{len(self.models)}.xml"] = self._file(attached).encode()
                self.model_files[id(model)] = f"{len(self.models) - 1}.xml"
                self.sizes[name] = max(self.sizes.get(name, 0), self.element_count - elements_before)
        settings: dict[str, str] = {}
        for compiler in root.all("compiler"):
            settings |= compiler.attributes
        self.strip = settings.get("strippath") == "true"
        folder_of_file = os.path.relpath(os.path.dirname(root.where.file), self.packages.folder)
        self.folder = os.path.join(folder_of_file, settings.get("meshdir", settings.get("assetdir", "")))
        start = len(self.texts)
        self._write(root, 1)
        return "\n" * start + "\n".join(self.texts[start:])

    def _include(self, element: SourceElement) -> None:
        """Replace each `<include>` inside an element by the elements of the included file, recursively."""
        self.names.add(element.attributes.get("name"))
        children: list[SourceElement] = []
        for child in element.children:
            if child.tag != "include":
                self._include(child)
                children.append(child)
            elif (included := self._read(child)) is not None:
                self.roots.append(included)
                self._include(included)
                children += included.children
        element.children[:] = children

    def _read(self, element: SourceElement) -> SourceElement | None:
        """Read an included file and return its root element. If the file is missing or invalid, report an error and return None.

        As in MuJoCo, the path of an included file is relative to the file that contains the `<include>`, or else relative to the main file.
        """
        name, where = element.attributes.get("file", ""), element.place("file")
        if element.children:
            self.report.add(
                Code.SOURCE_VALUE, "an `<include>` has child elements", element.where,
                help="move the child elements out of the `<include>`",
            )
        path_from_main = os.path.relpath(os.path.join(os.path.dirname(element.where.file), name), self.packages.folder)
        try:
            try:
                path, data = self.packages.read(path_from_main)
            except NotFound:
                path, data = self.packages.read(name)
        except NotFound as fault:
            self.report.add(Code.SOURCE_FILE, str(fault), where, help=fault.help)
            return None
        if path in self.included or path == self.root.where.file:
            notes = [Note(message="first included here", span=self.included[path])] if path in self.included else []
            self.report.add(Code.SOURCE_FILE, f"`{name}` is included a second time", where, notes=notes,
                            help="remove one of the two `<include>` elements")
            return None
        self.included[path] = where
        return read_xml(path, data, self.report)

    def _write(self, element: SourceElement, copies: int) -> None:
        """Append the lines of an element to the flattened text. `copies` is the number of copies of the element that MuJoCo creates.

        If the model has too many elements, the method reports one error and does not append lines.
        """
        if self.element_count > MOST_ELEMENTS:
            return
        self.element_count += copies * (1 + self.sizes.get(element.attributes.get("model", ""), 0) if element.tag == "attach" else 1)
        if self.element_count > MOST_ELEMENTS:
            message = f"the number of elements exceeds the maximum ({MOST_ELEMENTS:,})"
            self.report.add(Code.SOURCE_VALUE, message, element.where, help="reduce the number of elements")
            return
        if element.tag == "replicate":
            count = re.match(r"\s*\+?(\d{1,12})", element.attributes.get("count", ""))  # MuJoCo ignores text after the number
            copies *= 1 if count is None else int(count[1])
            if copies > MOST_COPIES:
                message = f"the number of copies ({copies:,}) exceeds the maximum ({MOST_COPIES:,})"
                self.report.add(Code.SOURCE_VALUE, message, element.place("count"), help="reduce `count`")
                return
        if element.tag in LEFT_OUT or element.tag == "geom" and ("hfield" in (element.attributes.get("type"), *element.attributes)):
            self.losses.note(f"`<{element.tag}>`", LEFT_OUT.get(element.tag, LEFT_OUT["hfield"]), element.where)
            if element.tag != "extension":  # MuJoCo requires `<extension>` for elements that use a plugin
                return
        if element.tag == "layer":
            return  # only materials contain `<layer>`, and their textures are omitted
        if element.tag == "lengthrange" and _steps(element) > MOST_STEPS:
            message = f"the element requires more than {MOST_STEPS:,} simulation steps per muscle"
            self.report.add(Code.SOURCE_VALUE, message, element.where, help="reduce `inttotal`, or increase `timestep`")
            return
        attributes = dict(element.attributes)
        self._check_numbers(element)
        if element.tag == "inertial" and element.attributes.get("mass", "").strip().startswith("-"):
            self.losses.note(f"a mass of {element.attributes['mass'].strip()}", "MuJoCo uses 0 instead", element.place("mass"))
        if element.tag == "compiler":
            attributes = {name: value for name, value in attributes.items() if name not in FOLDERS}
        elif element.tag == "material":
            attributes.pop("texture", None)
        elif id(element) in self.model_files:
            attributes["file"] = self.model_files[id(element)]
        elif element.tag == "mesh" and "file" in attributes:
            attributes |= self._mesh(element)
        self._line(f"<{element.tag}{''.join(f' {name}={quoteattr(value)}' for name, value in attributes.items())}>", element)
        for child in element.children:
            self._write(child, copies)
        self._line(f"</{element.tag}>", element)

    def _check_numbers(self, element: SourceElement) -> None:
        """Report an error for each number in an element that is not finite. MuJoCo does not report such numbers."""
        for name, value in element.attributes.items():
            wrong = next((word for word in value.split() if word.lower().lstrip("+-") in NOT_FINITE), None)
            if wrong is not None and name != "name" and value not in self.names:
                message = f"`{name}` of `<{element.tag}>`: expected finite numbers, found `{wrong}`"
                help = "remove the attribute: without a range, there are no limits" if name.endswith("range") else None
                self.report.add(Code.SOURCE_VALUE, message, element.place(name), help=help)

    def _line(self, text: str, element: SourceElement) -> None:
        self.texts.append(re.sub(r"[\r\n]", " ", text))
        self.lines.append(element)

    def _mesh(self, element: SourceElement) -> dict[str, str]:
        """Return the attributes of a mesh element for MuJoCo, including the name and the file name in memory.

        The file name contains a hash of the content and the attributes, because MuJoCo caches meshes by file name.
        """
        file = element.attributes["file"]
        file = os.path.basename(file.replace("\\", "/")) if self.strip else file
        uri = os.path.normpath(os.path.join(self.folder, file))
        name, ending = element.attributes.get("name", os.path.splitext(os.path.basename(file))[0]), os.path.splitext(uri)[1].lower()
        try:
            _, content = self.packages.read(uri)
            self.mesh_bytes += len(content)
            if self.mesh_bytes > MOST_MESH_BYTES:
                message = f"the total size of the meshes exceeds the maximum ({MOST_MESH_BYTES:,} bytes)"
                raise NotFound(message, "use meshes with fewer facets, and list each mesh only once")
        except NotFound as fault:
            if self.with_meshes:
                self.report.add(Code.SOURCE_FILE, str(fault), element.place("file"), help=fault.help)
                return {}
            content, ending = SMALL_SOLID, f"{ABSENT}.obj"
        made_of = repr((uri, sorted(element.attributes.items()))).encode()
        file_name = f"{hashlib.sha256(made_of + content).hexdigest()}{ending}"
        self.files[file_name], self.meshes[file_name] = content, uri
        return {"name": name, "file": file_name}


def _steps(element: SourceElement) -> float:
    """Return the number of simulation steps that a `<lengthrange>` requires, or 0 for values that MuJoCo rejects."""
    try:
        total, step = (float(element.attributes.get(name, usual)) for name, usual in (("inttotal", "10"), ("timestep", "0.01")))
    except ValueError:
        return 0.0
    return total / step if step > 0.0 else math.inf
