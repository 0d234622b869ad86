"""Read a STEP assembly with the document model of the CAD kernel and print names, colours and volumes as JSON."""

from __future__ import annotations

import json
import sys

from OCP.BRepGProp import BRepGProp
from OCP.collections import Sequence_TDF_Label
from OCP.GProp import GProp_GProps
from OCP.Quantity import Quantity_Color, Quantity_TypeOfColor
from OCP.STEPCAFControl import STEPCAFControl_Reader
from OCP.TCollection import TCollection_ExtendedString
from OCP.TDataStd import TDataStd_Name
from OCP.TDF import TDF_Label
from OCP.TDocStd import TDocStd_Document
from OCP.TopLoc import TopLoc_Location
from OCP.XCAFDoc import XCAFDoc_ColorType, XCAFDoc_DocumentTool, XCAFDoc_ShapeTool

reader = STEPCAFControl_Reader()
reader.SetNameMode(True)
reader.SetColorMode(True)
assert reader.ReadFile(sys.argv[1]).name == "IFSelect_RetDone"
document = TDocStd_Document(TCollection_ExtendedString("x"))
assert reader.Transfer(document)
shapes, colors = XCAFDoc_DocumentTool.ShapeTool_s(document.Main()), XCAFDoc_DocumentTool.ColorTool_s(document.Main())

def name(label):
    found = TDataStd_Name()
    return found.Get().ToExtString() if label.FindAttribute(TDataStd_Name.GetID_s(), found) else ""

def walk(label, path, place):
    parts = Sequence_TDF_Label()
    XCAFDoc_ShapeTool.GetComponents_s(label, parts, False)
    for k in range(1, parts.Length() + 1):
        part, target = parts.Value(k), TDF_Label()
        XCAFDoc_ShapeTool.GetReferredShape_s(part, target)
        here = place * XCAFDoc_ShapeTool.GetLocation_s(part)
        if XCAFDoc_ShapeTool.IsAssembly_s(target):
            yield from walk(target, [*path, name(part)], here)
            continue
        sums, color = GProp_GProps(), Quantity_Color()
        BRepGProp.VolumeProperties_s(XCAFDoc_ShapeTool.GetShape_s(target).Moved(here), sums)
        colored = colors.GetInstanceColor(XCAFDoc_ShapeTool.GetShape_s(part), XCAFDoc_ColorType.XCAFDoc_ColorSurf, color)
        centre = sums.CentreOfMass()
        yield "/".join([*path, name(part)]), {
            "definition": name(target), "volume": sums.Mass(), "centre": [centre.X(), centre.Y(), centre.Z()],
            "color": list(color.Values(Quantity_TypeOfColor.Quantity_TOC_sRGB)) if colored else None,
        }

free = Sequence_TDF_Label()
shapes.GetFreeShapes(free)
(root,) = [free.Value(k) for k in range(1, free.Length() + 1)]
json.dump({"name": name(root), "leaves": dict(walk(root, [], TopLoc_Location()))}, sys.stdout)
