"""Read the STEP file of an assembly in the worker process. The module uses only OCP. Neither build123d nor part code is loaded.

The kernel converts lengths to mm. Parts that are equal up to a rigid motion are stored once. A placement that mirrors or scales a part is
applied to the shape of the part.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
from msgspec import to_builtins
from OCP.BRepBuilderAPI import BRepBuilderAPI_Transform
from OCP.collections import Sequence_TDF_Label
from OCP.gp import gp_Trsf
from OCP.IFSelect import IFSelect_ReturnStatus
from OCP.Quantity import Quantity_Color, Quantity_ColorRGBA
from OCP.STEPCAFControl import STEPCAFControl_Reader
from OCP.TCollection import TCollection_AsciiString
from OCP.TDataStd import TDataStd_Name, TDataStd_TreeNode
from OCP.TDF import TDF_Label, TDF_Tool
from OCP.TopAbs import TopAbs_FACE
from OCP.XCAFDoc import XCAFDoc, XCAFDoc_ColorType, XCAFDoc_DocumentTool, XCAFDoc_Material, XCAFDoc_ShapeTool

from thingc.base.pose import NO_POSE, Pose
from thingc.geometry.store.local import Store
from thingc.geometry.worker.kernel import convert
from thingc.geometry.worker.kernel.feature_search import area_and_centre, features_of
from thingc.geometry.worker.kernel.integrals import at_origin, compound_of, measure, solids_of, subshapes
from thingc.geometry.worker.kernel.step_assembly import new_document, write_part
from thingc.tools.importing.step_assembly import StepAssembly, StepChild, StepGroup, StepPart

_KINDS = (XCAFDoc_ColorType.XCAFDoc_ColorSurf, XCAFDoc_ColorType.XCAFDoc_ColorGen, XCAFDoc_ColorType.XCAFDoc_ColorCurv)
_NO_NAME = re.compile(r"\s*|=>\[.*|(NAUO)?\d+", re.DOTALL)
"""Names of instances that the kernel or another program creates if an instance has no name."""
SAME = 1e-4
"""Largest distance [mm] between the centres of corresponding faces of equal parts."""


def read_step_assembly(path: str, store: Store) -> dict[str, Any]:
    """Read a STEP file, and write a STEP file of each part to the store.

    Return the assembly as `{"assembly": ...}`, or the reason why it cannot be imported as `{"refused": ...}`.
    """
    document = new_document()
    reader = STEPCAFControl_Reader()
    reader.SetNameMode(True)
    reader.SetColorMode(True)
    reader.SetMatMode(True)
    if reader.ReadFile(path) != IFSelect_ReturnStatus.IFSelect_RetDone or not reader.Transfer(document):
        return {"refused": "the file is damaged, or is not STEP"}
    labels = _labels(XCAFDoc_DocumentTool.ShapeTool_s(document.Main()).GetFreeShapes)
    if not labels:
        return {"refused": "the file contains no shape"}
    reading = _Reading(document, store)
    stem = os.path.splitext(os.path.basename(path))[0]
    children = [child for label in labels if (child := reading.free(label)) is not None]
    only = children[0] if len(children) == 1 else None
    while only is not None and only.assembly is not None and len(reading.groups[only.assembly].children) == 1:
        only = reading.groups[only.assembly].children[0]
    if only is not None and only.part is not None:
        return {"refused": "the file has no assembly structure: it contains one part"}
    root = children[0].assembly if len(children) == 1 else reading.add_group(stem, iter(children))
    if root is None:
        return {"refused": "the file contains no solid"}
    return {"assembly": to_builtins(StepAssembly(
        parts=tuple(reading.parts), assemblies=tuple(reading.groups), root=root, left_out=tuple(reading.left_out), merged=reading.merged,
    ))}


class _Reading:
    """Collects the parts and assemblies of a document of the kernel."""

    def __init__(self, document: Any, store: Store) -> None:
        self.colors = XCAFDoc_DocumentTool.ColorTool_s(document.Main())
        self.store = store
        self.parts: list[StepPart] = []
        self.groups: list[StepGroup] = []
        self.left_out: list[str] = []
        self.merged: dict[str, str] = {}
        self._known: dict[str, StepChild | None] = {}
        self._outlines: list[_Outline] = []

    def free(self, label: TDF_Label) -> StepChild | None:
        """Read a part or an assembly that is not contained in another assembly."""
        return self._child(label, _name(label), NO_POSE, None, None)

    def add_group(self, name: str, children: Iterator[StepChild | None]) -> int | None:
        """Add an assembly, and return its index. Return None if it contains no solids."""
        present = tuple(child for child in children if child is not None)
        if not present:
            return None
        group = StepGroup(name=name, children=present)
        if group not in self.groups:
            self.groups.append(group)
        return self.groups.index(group)

    def _component(self, label: TDF_Label, color: str | None, warp: gp_Trsf | None) -> StepChild | None:
        referred = TDF_Label()
        XCAFDoc_ShapeTool.GetReferredShape_s(label, referred)
        placement = XCAFDoc_ShapeTool.GetLocation_s(label).Transformation()
        pose = NO_POSE
        if warp is not None:
            warp = warp.Multiplied(placement)
        elif placement.IsNegative() or abs(placement.ScaleFactor() - 1.0) > 1e-9:
            warp = placement
        else:
            pose = convert.pose(placement)
        return self._child(referred, _name(label), pose, color or self._color(label), warp)

    def _child(self, label: TDF_Label, name: str, pose: Pose, color: str | None, warp: gp_Trsf | None) -> StepChild | None:
        key = repr((_entry(label), color, warp and [warp.Value(i, j) for i in (1, 2, 3) for j in (1, 2, 3, 4)]))
        if key not in self._known:
            self._known[key] = self._definition(label, color or self._color(label), warp)
        known = self._known[key]
        name = _name(label) if _NO_NAME.fullmatch(name) else name
        return None if known is None else StepChild(name=name, pose=pose @ known.pose, part=known.part, assembly=known.assembly)

    def _definition(self, label: TDF_Label, color: str | None, warp: gp_Trsf | None) -> StepChild | None:
        """Read a part or an assembly. A part with several solids of different colours becomes an assembly.

        `color` is the colour that an outer assembly assigns, and `warp` is a placement that is not rigid.
        """
        name = _name(label)
        if XCAFDoc_ShapeTool.IsAssembly_s(label):
            labels = _labels(partial(XCAFDoc_ShapeTool.GetComponents_s, label))
            number = self.add_group(name, (self._component(one, color, warp) for one in labels))
            return None if number is None else StepChild(name=name, pose=NO_POSE, assembly=number)
        solids = solids_of(XCAFDoc_ShapeTool.GetShape_s(label))
        if not solids:
            self.left_out.append(name)
            return None
        of_solids = [(color,) if color else self._colors(solid) for solid in solids]
        if len({colors[:1] for colors in of_solids}) == 1:
            return self._part(name, label, solids, of_solids[0], warp)
        pieces = (self._part(name, label, [solid], colors, warp) for solid, colors in zip(solids, of_solids, strict=True))
        return StepChild(name=name, pose=NO_POSE, assembly=self.add_group(name, pieces))

    def _part(self, name: str, label: TDF_Label, solids: Sequence[Any], colors: tuple[str, ...], warp: gp_Trsf | None) -> StepChild:
        placed = [solid if warp is None else BRepBuilderAPI_Transform(solid, warp, True).Shape() for solid in map(at_origin, solids)]
        shape = compound_of(placed)
        material, density = _material(label)
        outline = _Outline(shape)
        for number, (part, other) in enumerate(zip(self.parts, self._outlines, strict=True)):
            if (part.colors, part.material, part.density) == (colors, material, density):
                pose = other.motion_to(outline)
                if pose is not None:
                    if name != part.name:
                        self.merged[name] = part.name
                    return StepChild(name=name, pose=pose, part=number)
        self._outlines.append(outline)
        self.parts.append(StepPart(
            name=name, sha256=self.store.put(write_part(name, shape, colors[0] if colors else None)), colors=colors, material=material,
            density=density, features=features_of(shape),
        ))
        return StepChild(name=name, pose=NO_POSE, part=len(self.parts) - 1)

    def _color(self, of: Any) -> str | None:
        """Return the colour of a label or of a shape."""
        color, find = Quantity_ColorRGBA(), self.colors.GetColor_s if isinstance(of, TDF_Label) else self.colors.GetColor
        return next((_hexadecimal(color) for kind in _KINDS if find(of, kind, color)), None)

    def _colors(self, solid: Any) -> tuple[str, ...]:
        """Return the colours of a solid and its faces, the colour of the largest area first."""
        whole = self._color(solid)
        areas: dict[str, float] = {}
        for face in subshapes(solid, TopAbs_FACE):
            color = self._color(face) or whole
            if color is not None:
                areas[color] = areas.get(color, 0.0) + area_and_centre(face)[0]
        return tuple(sorted(areas, key=lambda color: (-areas[color], color)))


class _Outline:
    """The integrals of a shape and the centres of its faces, by which equal parts are recognized."""

    def __init__(self, shape: Any) -> None:
        measures = measure(shape)
        self.centre = np.array(measures.centre)
        self.size = max(high - low for low, high in zip(*measures.box, strict=True))
        self.moments, self.axes = np.linalg.eigh(np.array(measures.inertia))
        self.numbers = np.array([measures.volume ** (1 / 3), measures.area ** 0.5, *np.maximum(self.moments, 0.0) ** 0.2])
        faces = [area_and_centre(face) for face in subshapes(shape, TopAbs_FACE)]
        self.faces = np.array([(*centre, area ** 0.5) for area, centre in faces])

    def motion_to(self, other: _Outline) -> Pose | None:
        """Return the rigid motion that maps this shape to an equal shape, or None if there is no such motion.

        Besides translations, the motions between the principal axes are tried, unless two principal moments are equal.
        """
        if len(self.faces) != len(other.faces) or np.abs(self.numbers - other.numbers).max() > SAME:
            return None
        rotations = [np.eye(3)]
        if np.diff(self.moments).min() > 1e-4 * self.moments.max():
            for signs in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
                turned = other.axes @ np.diag([*signs, 1.0]) @ self.axes.T
                rotations.append(other.axes @ np.diag([*signs, np.sign(np.linalg.det(turned))]) @ self.axes.T)
        for rotation in rotations:
            moved = np.column_stack([(self.faces[:, :3] - self.centre) @ rotation.T + other.centre, self.faces[:, 3]])
            distances = np.abs(moved[:, None, :] - other.faces[None, :, :]).max(axis=2)
            nearest = distances.argmin(axis=1)
            if len(set(nearest)) == len(nearest) and distances.min(axis=1).max() < SAME:
                exact = np.where(np.abs(rotation - rotation.round()) < 1e-9, rotation.round(), rotation)
                x, y, z = (other.centre - exact @ self.centre).tolist()
                return Pose(rotation=convert.matrix(exact.tolist()), translation=convert.vector((x, y, z)))
        return None


def _labels(fill: Callable[[Sequence_TDF_Label], object]) -> list[TDF_Label]:
    """Return the labels that a function of the kernel adds to a sequence."""
    found = Sequence_TDF_Label()
    fill(found)
    return [found.Value(number + 1) for number in range(found.Length())]


def _entry(label: TDF_Label) -> str:
    entry = TCollection_AsciiString()
    TDF_Tool.Entry_s(label, entry)
    return str(entry.ToCString())


def _name(label: TDF_Label) -> str:
    """Return the name of a label, or an empty string. Names that a program, such as build123d, encoded twice in UTF-8 are decoded."""
    name = TDataStd_Name()
    text = str(name.Get().ToExtString()) if label.FindAttribute(TDataStd_Name.GetID_s(), name) else ""
    text = "" if text.startswith("Open CASCADE STEP translator") else text  # the kernel's name of a part without a name
    try:
        return text.encode("latin-1").decode()
    except UnicodeError:
        return text


def _material(label: TDF_Label) -> tuple[str | None, float | None]:
    """Return the material of a part and its density [kg/m^3], which the kernel provides in [g/cm^3]."""
    reference, node, material = XCAFDoc.MaterialRefGUID_s(), TDataStd_TreeNode(), XCAFDoc_Material()
    if not label.IsAttribute(reference):  # the kernel crashes if it searches for an attribute that does not exist
        return None, None
    label.FindAttribute(reference, node)
    if not node.HasFather() or not node.Father().Label().FindAttribute(XCAFDoc_Material.GetID_s(), material):
        return None, None
    name = material.GetName().ToCString().strip() if material.GetName() is not None else ""
    density = 1000.0 * material.GetDensity()
    return name or None, density if 1.0 < density < 30_000.0 else None


def _hexadecimal(color: Quantity_ColorRGBA) -> str:
    return str(Quantity_Color.ColorToHex_s(color.GetRGB(), True).ToCString()).lower()
