"""Write `dxf/NAME_THICKNESS_MATERIAL_x2.dxf` for each flat part: outlines for laser cutters, water jets and mills, in millimetres.

The layer `CUT` contains edges that pass through the sheet, and the layer `ENGRAVE` the edges of pockets, seen from the side of the pockets.
"""

from __future__ import annotations

import math
from io import StringIO
from typing import Any

import ezdxf
from ezdxf import zoom

from thingc.targets import Artifacts, EmitRequest, Loss
from thingc.tools.workshop.curves import Arc, Curve, Point, Sheet, Spline, StraightEdge
from thingc.tools.workshop.manufactured_parts import compute_parts

LAYERS = {"CUT": 1, "ENGRAVE": 5}
"""The layers and their colours: red and blue in the index of AutoCAD, as laser cutters usually distinguish them."""


def emit(request: EmitRequest) -> Artifacts:
    """Write a file for each part that is flat and not bought. Other parts that are not bought are export losses."""
    parts, losses = compute_parts(
        request, "dxf", lambda breps: request.geometry.search("thingc.tools.kernel.sheets:sheet_of", breps, Sheet),
    )
    files: dict[str, bytes] = {}
    for part, sheet in parts:
        if sheet.reason:
            what = f"`{part.first.definition.label}` is not flat: {sheet.reason}"
            losses.append(Loss("dxf", None, part.first.path, what, "omitted", part.first.origin))
        else:
            files[f"dxf/{part.file_name(f'{1e3 * sheet.thickness:.6g}mm')}.dxf"] = encode_dxf(sheet)
    return Artifacts(files=dict(sorted(files.items())), losses=tuple(losses))


def encode_dxf(sheet: Sheet) -> bytes:
    """Return the content of the DXF file of a sheet (AutoCAD 2000). The file contains neither the time nor random identifiers."""
    fixed = ezdxf.options.write_fixed_meta_data_for_testing
    ezdxf.options.write_fixed_meta_data_for_testing = True
    try:
        drawing = ezdxf.new("R2000", units=ezdxf.units.MM)
        for layer, color in LAYERS.items():
            drawing.layers.add(layer, color=color)
        for layer, curves in zip(LAYERS, (sheet.cut, sheet.engraved), strict=True):
            for curve in curves:
                _add(drawing.modelspace(), curve, {"layer": layer})
        zoom.extents(drawing.modelspace())
        stream = StringIO()
        drawing.write(stream)
    finally:
        ezdxf.options.write_fixed_meta_data_for_testing = fixed
    content: bytes = drawing.encode(stream.getvalue())
    return content


def _add(space: Any, curve: Curve, attributes: dict[str, str]) -> None:
    match curve:
        case StraightEdge(start=start, end=end):
            space.add_line(_millimetres(start), _millimetres(end), attributes)
        case Arc(centre=centre, radius=radius) if curve.full:
            space.add_circle(_millimetres(centre), 1e3 * radius, attributes)
        case Arc(centre=centre, radius=radius, start=first, end=last):
            space.add_arc(_millimetres(centre), 1e3 * radius, math.degrees(first), math.degrees(last), dxfattribs=attributes)
        case Spline(degree=degree, points=points, weights=weights, knots=knots):
            space.add_rational_spline(list(map(_millimetres, points)), weights, degree, knots, attributes)


def _millimetres(point: Point) -> Point:
    return round(1e3 * point[0], 9), round(1e3 * point[1], 9)
