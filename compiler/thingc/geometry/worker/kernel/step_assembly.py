"""Write the STEP file of an assembly in the worker process. The module uses only OCP. Neither build123d nor part code is loaded.

The file contains one shape for each part definition, and all instances of the definition refer to this shape. Groups of instances become
sub-assemblies. Each instance can have its own colour. The file does not contain the time, the name of the machine or the author.
"""

from __future__ import annotations

import io
import os
import re
import tempfile
from typing import Any

from msgspec import convert
from OCP.BinTools import BinTools
from OCP.Interface import Interface_Static
from OCP.Message import Message, Message_Gravity
from OCP.Quantity import Quantity_Color, Quantity_TypeOfColor
from OCP.STEPCAFControl import STEPCAFControl_Writer
from OCP.STEPControl import STEPControl_AsIs
from OCP.TCollection import TCollection_ExtendedString
from OCP.TDataStd import TDataStd_Name
from OCP.TDocStd import TDocStd_Document
from OCP.TopAbs import TopAbs_COMPOUND, TopAbs_FACE, TopAbs_SOLID
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Iterator, TopoDS_Shape
from OCP.XCAFApp import XCAFApp_Application
from OCP.XCAFDoc import XCAFDoc_ColorType, XCAFDoc_DocumentTool

from thingc.base.pose import Pose
from thingc.geometry.store.local import Store
from thingc.geometry.worker.kernel.convert import transformation
from thingc.geometry.worker.kernel.integrals import subshapes
from thingc.geometry.worker.kernel.step_order import sort_styles, without_noise

_HEADER = re.compile(rb"HEADER;.*?ENDSEC;", re.DOTALL)
STAMP = "2000-01-01T00:00:00"


def assemble(name: str, instances: list[dict[str, Any]], store: Store) -> dict[str, Any]:
    """Write the STEP file (AP242, mm) of `instances`. Each instance has the form `{"path", "definition", "brep", "pose", "color"}`, with
    its pose in SI units.

    Return the digest and the size of the file in the store, as `{"sha256", "size"}`. Raises `BlobMissing` if a B-rep is missing in the
    store.
    """
    document = new_document()
    _fill(document, name, instances, store)
    data = write_document(document, name)
    return {"sha256": store.put(data), "size": len(data)}


def write_part(name: str, shape: Any, color: str | None) -> bytes:
    """Write the STEP file (AP242, mm) of one part with a name and a colour, and return its content."""
    document = new_document()
    shapes = XCAFDoc_DocumentTool.ShapeTool_s(document.Main())
    label = shapes.AddShape(shape, False)
    _name(label, name.replace("'", ""))
    if color is not None:
        # readers find the colour of a single solid, and otherwise the colours of faces
        colored = [label] if shape.ShapeType() == TopAbs_SOLID else [
            shapes.AddSubShape(label, one) for one in subshapes(shape, TopAbs_FACE)
        ]
        for one in colored:
            XCAFDoc_DocumentTool.ColorTool_s(document.Main()).SetColor(one, _color(color), XCAFDoc_ColorType.XCAFDoc_ColorSurf)
    return write_document(document, name)


def new_document() -> Any:
    """Create a document of the kernel, and disable the output that the kernel writes to standard output."""
    for printer in list(Message.DefaultMessenger_s().Printers()):
        printer.SetTraceLevel(Message_Gravity.Message_Fail)
    document = TDocStd_Document(TCollection_ExtendedString("thingc"))
    XCAFApp_Application.GetApplication_s().NewDocument(TCollection_ExtendedString("BinXCAF"), document)
    return document


def write_document(document: Any, name: str) -> bytes:
    """Write a document of the kernel as a STEP file (AP242, mm), and return its content."""
    writer = STEPCAFControl_Writer()
    writer.SetNameMode(True)
    writer.SetColorMode(True)
    for parameter, value in (("write.step.unit", "MM"), ("write.step.schema", "AP242DIS")):
        Interface_Static.SetCVal_s(parameter, value)
    # the kernel changes all names after the last product name, so each file needs its own document and writer
    if not writer.Transfer(document, STEPControl_AsIs):
        raise ArithmeticError("the kernel could not translate the assembly to STEP")
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "assembly.step")
        writer.Write(path)
        with open(path, "rb") as stream:
            data = stream.read()
    return sort_styles(without_noise(_neutral(data, name)))


def _fill(document: Any, name: str, instances: list[dict[str, Any]], store: Store) -> None:
    shapes = XCAFDoc_DocumentTool.ShapeTool_s(document.Main())
    colors = XCAFDoc_DocumentTool.ColorTool_s(document.Main())
    root = shapes.NewShape()
    _name(root, name)
    groups: dict[str, Any] = {"": root}
    definitions: dict[str, Any] = {}
    compounds: dict[str, bool] = {}

    def group(path: str) -> Any:
        if path not in groups:
            outer, _, last_name = path.rpartition("/")
            label = shapes.NewShape()
            _name(label, path.replace("/", "."))
            _name(shapes.AddComponent(group(outer), label, TopLoc_Location()), last_name)
            groups[path] = label
        return groups[path]

    for instance in instances:
        brep, color = instance["brep"], _color(instance["color"])
        if brep not in compounds:
            compounds[brep] = load_shape(store, brep).ShapeType() == TopAbs_COMPOUND
        is_compound = compounds[brep]
        # STEP assigns styles to solids, not to compounds: for several solids, the colour belongs to the definition
        shared = f"{instance['definition']} {brep} {instance['color'] if is_compound else ''}"
        if shared not in definitions:
            shape = load_shape(store, brep)
            label = shapes.AddShape(shape, False)
            _name(label, instance["definition"])
            definitions[shared] = label
            children = TopoDS_Iterator(shape)
            while is_compound and color is not None and children.More():
                colors.SetColor(shapes.AddSubShape(label, children.Value()), color, XCAFDoc_ColorType.XCAFDoc_ColorSurf)
                children.Next()
        outer, _, last_name = instance["path"].rpartition("/")
        placed = TopLoc_Location(transformation(convert(instance["pose"], Pose)))
        component = shapes.AddComponent(group(outer), definitions[shared], placed)
        _name(component, last_name)
        if color is not None and not is_compound:
            colors.SetColor(component, color, XCAFDoc_ColorType.XCAFDoc_ColorSurf)
    shapes.UpdateAssemblies()


def _color(text: str | None) -> Any:
    """Convert a colour `#rrggbb` to a colour of the CAD kernel. Return None if the text is None."""
    if text is None:
        return None
    red, green, blue = (int(text[i : i + 2], 16) / 255.0 for i in (1, 3, 5))
    return Quantity_Color(red, green, blue, Quantity_TypeOfColor.Quantity_TOC_sRGB)


def _name(label: Any, text: str) -> None:
    TDataStd_Name.Set_s(label, TCollection_ExtendedString(text, True))  # True: the text is UTF-8


def load_shape(store: Store, sha256: str) -> Any:
    """Read a B-rep from the store."""
    shape = TopoDS_Shape()
    BinTools.Read_s(shape, io.BytesIO(store.read(sha256)))
    return shape


def _neutral(data: bytes, name: str) -> bytes:
    """Replace the header of a STEP file by a fixed header, and encode the file in ASCII, because not every CAD program reads UTF-8."""
    escaped = "".join(character if character.isprintable() else "_" for character in name).replace("'", "''").replace("\\", "\\\\")
    header = (
        "HEADER;\n"
        "FILE_DESCRIPTION(('assembly'),'2;1');\n"
        f"FILE_NAME('{escaped}','{STAMP}',(''),(''),'thingc','thingc','');\n"
        "FILE_SCHEMA(('AP242_MANAGED_MODEL_BASED_3D_ENGINEERING_MIM_LF { 1 0 10303 442 1 1 4 }'));\n"
        "ENDSEC;"
    )
    text = _HEADER.sub(lambda _: header.encode(), data, count=1).decode()
    return re.sub("[^\0-\x7f]+", lambda match: _escape(match.group()), text).encode("ascii")


def _escape(text: str) -> str:
    """Encode a string for a STEP file (ISO 10303-21, 6.4.3.3).

    Each character is written as four hexadecimal digits, or as eight digits if it is outside of the basic multilingual plane.
    """
    if max(text) > "\uffff":
        return f"\\X4\\{text.encode('utf-32-be').hex().upper()}\\X0\\"
    return f"\\X2\\{text.encode('utf-16-be').hex().upper()}\\X0\\"
