"""Write `3mf/NAME_plate_1.3mf` and so on: all printed parts in print orientation, arranged on the bed of the printer, in millimetres.

Parts of different kinds of process, such as `fdm` and `resin`, are on different plates. Equal parts are one object with several instances.
The files contain the settings of the process of each part, as PrusaSlicer reads them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from io import BytesIO
from itertools import chain, count
from xml.etree.ElementTree import Element, SubElement, tostring
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

import numpy as np
import rpack
from numpy.typing import NDArray

from thingc.base.diagnostics import Code, Report
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.grouping import group_by
from thingc.base.pose import Vector
from thingc.geometry.record import PartDefinition
from thingc.geometry.store.local import Store
from thingc.model.assembly.types import Assembly, Occurrence
from thingc.targets import Artifacts, EmitRequest, Loss
from thingc.targets.bom.emit import make_of
from thingc.targets.stl.emit import direction_up, turn_stl
from thingc.tools.workshop.manufactured_parts import labels_of

GAP = 5.0
"""Distance between parts on a plate, and twice the distance between the parts and the edge of the bed [mm]."""

STEPS = 10
"""The grid on which parts are arranged: steps per millimetre."""

GREY = "#c0c0c0"
"""The colour of parts without a colour."""


class Print(FrozenStruct, eq=False):
    """Equal prints: their mesh in print orientation, with the lowest corner of its bounding box at the origin [mm].

    `faces` contains indices of `vertices`. `first` is the first of the `count` occurrences, and `label` is a unique name. `stl` is
    the mesh in the axes of the part, in which `up` points away from the bed. If `sideways` is True, the part only fits on the bed after a
    rotation by 90 degrees about z.
    """

    first: Occurrence
    count: int
    label: str
    stl: bytes
    up: Vector
    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    sideways: bool

    @property
    def name(self) -> str:
        """The name of the object in files, with the number of pieces."""
        return f"{self.label}_x{self.count}" if self.count > 1 else self.label

    @property
    def footprint(self) -> tuple[int, int]:
        """The size on the bed with half a gap on each side, in steps of the grid."""
        x, y, _ = np.ceil((self.vertices.max(axis=0) + GAP) * STEPS)
        return (int(y), int(x)) if self.sideways else (int(x), int(y))


Plate = list[tuple[Print, tuple[int, int]]]
"""The prints on a plate, with the positions of their lower left corners in steps of the grid."""


def emit(request: EmitRequest) -> Artifacts:
    """Write a file for each plate. The file names of plates that are not `fdm` contain the kind of process.

    A part that does not fit on the bed is an error. Parts with a mesh that is not closed are written, with an export loss.
    """
    prints, losses = prints_of(request.assembly, request.store, request.workspace.bed, request.report)
    return Artifacts(files={
        f"3mf/{request.assembly.name}{'' if kind == 'fdm' else f'_{kind}'}_plate_{number}.3mf": encode_3mf(plate)
        for kind, alike in group_by(prints, lambda one: _technique(one.first)).items()
        for number, plate in enumerate(arrange(alike, request.workspace.bed), 1)
    }, losses=tuple(losses))


def prints_of(assembly: Assembly, store: Store, bed: Sequence[float], report: Report) -> tuple[list[Print], list[Loss]]:
    """Return the prints of a robot in the order of the document, and an export loss for each mesh that is not closed.

    `bed` is the size of the bed, with the largest height [m]. Prints that do not fit are reported and omitted.
    """
    printed = (
        one for one in assembly.occurrences
        if isinstance(one.component.definition, PartDefinition) and one.record is not None and "print" in one.record.meshes
        and make_of(one) == "print"
    )
    groups = list(group_by(printed, lambda one: (
        one.definition, direction_up(one, store), _material(one), _technique(one), tuple(settings_of(one).items())
    )).values())
    prints, losses = list[Print](), list[Loss]()
    for group, label in zip(groups, _unique_labels([group[0] for group in groups]), strict=True):
        first = group[0]
        assert first.record is not None
        mesh = first.record.meshes["print"]
        if not mesh.closed:
            what = f"the surface of `{first.definition.label}` is not closed"
            losses.append(Loss("3mf", None, first.path, what, "approximated", first.origin))
        up, stl = direction_up(first, store), store.read(mesh.sha256)
        vertices, faces = upright(stl, up)
        pieces, sideways = len(group), _must_rotate(vertices, label, first, bed, report)
        if sideways is not None:
            prints.append(Print(first=first, count=pieces, label=label, stl=stl, up=up, vertices=vertices, faces=faces, sideways=sideways))
    return prints, losses


def _unique_labels(firsts: Sequence[Occurrence]) -> list[str]:
    """Return the labels of prints. Different prints of one definition are named after their materials, and then numbered."""
    labels, unique = labels_of(firsts), list[str]()
    for label, first in zip(labels, firsts, strict=True):
        full = label if labels.count(label) == 1 else f"{label}_{_material(first)[0]}"
        unique.append(next(one for one in chain([full], (f"{full}_{number}" for number in count(2))) if one not in unique))
    return unique


def _must_rotate(vertices: NDArray[np.float64], label: str, first: Occurrence, bed: Sequence[float], report: Report) -> bool | None:
    """Return whether a part has to be rotated to fit on the bed. If it does not fit, report an error and return None."""
    x, y, z = vertices.max(axis=0) + (GAP, GAP, 0.0)
    bed_x, bed_y, bed_z = (1e3 * length for length in bed)
    if z <= bed_z and x <= bed_x and y <= bed_y:
        return False
    if z <= bed_z and y <= bed_x and x <= bed_y:
        return True
    report.add(
        Code.PRINT_SIZE,
        f"`{label}` ({x - GAP:.6g} x {y - GAP:.6g} x {z:.6g} mm) does not fit on the print bed "
        f"({bed_x:.6g} x {bed_y:.6g} x {bed_z:.6g} mm, of which {GAP / 2.0:g} mm at each edge stay free)", first.origin, path=first.path,
        help="correct `bed` in `thingc.toml`, or print the part in another direction: `print: {up: ...}`",
    )
    return None


def upright(stl: bytes, up: Vector) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Rotate a binary STL file so that `up` points along z, merge equal corners, and move its bounding box to the origin [mm]."""
    turned_stl = turn_stl(stl, up)
    facets = np.frombuffer(turned_stl, dtype=[("vectors", "<f4", (4, 3)), ("attribute", "<u2")], offset=84)["vectors"][:, 1:].reshape(-1, 3)
    vertices, corners = np.unique(facets + np.float32(0.0), axis=0, return_inverse=True)
    return vertices.astype(float) - vertices.min(axis=0), corners.reshape(-1, 3)


def arrange(prints: Sequence[Print], bed: Sequence[float]) -> list[Plate]:
    """Arrange prints on as few plates as possible, the deepest first. Each print must fit on the bed, whose size is in [m]."""
    waiting = sorted(chain.from_iterable([one] * one.count for one in prints), key=lambda one: (-one.footprint[1], -one.footprint[0]))
    width, depth = int(1e3 * bed[0] * STEPS), int(1e3 * bed[1] * STEPS)
    plates: list[Plate] = []
    while waiting:
        low, high = 1, len(waiting)
        while low < high:  # the largest number of prints that fit on one plate
            middle = (low + high + 1) // 2
            low, high = (middle, high) if _pack(waiting[:middle], width, depth) is not None else (low, middle - 1)
        plates.append(_pack(waiting[:low], width, depth) or [])
        del waiting[:low]
    return plates


def _pack(prints: Sequence[Print], width: int, depth: int) -> Plate | None:
    """Place prints on a bed, centred. Return None if they do not fit."""
    sizes = [one.footprint for one in prints]
    try:
        corners = rpack.pack(sizes, max_width=width, max_height=depth)
    except rpack.PackingImpossibleError:
        return None
    used = [max(corner[k] + size[k] for corner, size in zip(corners, sizes, strict=True)) for k in (0, 1)]
    left, front = (width - used[0]) // 2, (depth - used[1]) // 2
    return [(one, (x + left, y + front)) for one, (x, y) in zip(prints, corners, strict=True)]


def encode_3mf(plate: Plate) -> bytes:
    """Return the content of the 3MF file of a plate.

    PrusaSlicer only reads instances and settings from files that state its version of the format. lib3mf cannot write this metadata with
    the prefix that PrusaSlicer expects. OrcaSlicer and Bambu Studio read them if the name of the application contains `PrusaSlicer`.
    """
    model = Element("model", {"xmlns": _CORE, "xmlns:slic3rpe": _PRUSA, "unit": "millimeter"})
    SubElement(model, "metadata", name="slic3rpe:Version3mf").text = "1"
    SubElement(model, "metadata", name="Application").text = "thingc, in the format of PrusaSlicer"
    resources, build, config = SubElement(model, "resources"), SubElement(model, "build"), Element("config")
    materials = SubElement(resources, "basematerials", id="1")
    colored_materials = list(dict.fromkeys(_material(print_.first) for print_, _ in plate))
    for name, color in colored_materials:
        SubElement(materials, "base", name=name, displaycolor=color)
    instances = Counter(print_ for print_, _ in plate)
    numbers = {print_: str(number) for number, print_ in enumerate(instances, 2)}
    for print_, number in numbers.items():
        colour = str(colored_materials.index(_material(print_.first)))
        _add_mesh(SubElement(resources, "object", id=number, name=print_.name, type="model", pid="1", pindex=colour), print_)
        _add_settings(config, number, print_, instances[print_])
    for print_, place in plate:
        SubElement(build, "item", objectid=numbers[print_], transform=_transform(print_, place))
    stream = BytesIO()
    with ZipFile(stream, "w") as archive:
        for path, content in (("[Content_Types].xml", _TYPES), ("_rels/.rels", _RELATIONSHIPS)):
            archive.writestr(ZipInfo(path), content, ZIP_DEFLATED)
        for path, element in (("3D/3dmodel.model", model), ("Metadata/Slic3r_PE_model.config", config)):
            archive.writestr(ZipInfo(path), tostring(element, "utf-8", xml_declaration=True), ZIP_DEFLATED)
    return stream.getvalue()


_CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
_PRUSA = "http://schemas.slic3r.org/3mf/2017/06"
_PACKAGE = "http://schemas.openxmlformats.org/package/2006"
_TYPES = f"""\
<?xml version="1.0" encoding="UTF-8"?>
<Types xmlns="{_PACKAGE}/content-types">
 <Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>
 <Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/>
 <Default Extension="config" ContentType="text/xml"/>
</Types>
"""
_RELATIONSHIPS = f"""\
<?xml version="1.0" encoding="UTF-8"?>
<Relationships xmlns="{_PACKAGE}/relationships">
 <Relationship Target="/3D/3dmodel.model" Id="model" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/>
</Relationships>
"""


def _add_mesh(element: Element, print_: Print) -> None:
    mesh = SubElement(element, "mesh")
    vertices, triangles = SubElement(mesh, "vertices"), SubElement(mesh, "triangles")
    for x, y, z in print_.vertices.round(6).tolist():
        SubElement(vertices, "vertex", x=repr(x), y=repr(y), z=repr(z))
    for first, second, third in print_.faces.tolist():
        SubElement(triangles, "triangle", v1=str(first), v2=str(second), v3=str(third))


def _transform(print_: Print, place: tuple[int, int]) -> str:
    """Format the transform of a print to its place on the bed, as the rows of a matrix for multiplication from the left [mm]."""
    x, y = (corner / STEPS + GAP / 2.0 for corner in place)
    rotation = "0 1 0 -1 0 0 0 0 1" if print_.sideways else "1 0 0 0 1 0 0 0 1"
    return f"{rotation} {x + (print_.vertices[:, 1].max() if print_.sideways else 0.0):.6g} {y:.6g} 0"


def _material(occurrence: Occurrence) -> tuple[str, str]:
    """Return the name and the colour of the material of a part."""
    return occurrence.material.name if occurrence.material is not None else "unknown", occurrence.color or GREY


def _technique(occurrence: Occurrence) -> str:
    return occurrence.overrides.process_with(occurrence.material).technique


def settings_of(occurrence: Occurrence) -> dict[str, str]:
    """Return the settings of the process of a part, with the names and values of PrusaSlicer, and with the other names that OrcaSlicer and
    Bambu Studio have. Each program ignores unknown names. Settings that are not specified are omitted.
    """
    process = occurrence.overrides.process_with(occurrence.material)
    lengths = {("layer_height",): process.layer, ("extrusion_width", "line_width"): process.line_width}
    counts = {
        ("perimeters", "wall_loops"): process.walls, ("top_solid_layers", "top_shell_layers"): process.top,
        ("bottom_solid_layers", "bottom_shell_layers"): process.bottom,
    }
    texts: dict[tuple[str, ...], str] = {
        **{names: f"{1e3 * value:.6g}" for names, value in lengths.items() if value is not None},
        **{names: str(value) for names, value in counts.items() if value is not None},
        **({} if process.infill is None else {("fill_density", "sparse_infill_density"): f"{100 * process.infill:.6g}%"}),
    }
    return {name: text for names, text in texts.items() for name in names}


def _add_settings(config: Element, number: str, print_: Print, instances: int) -> None:
    """Add the settings of an object in the format of PrusaSlicer, with its only volume, which contains all faces."""
    element = SubElement(config, "object", id=number, instances_count=str(instances))
    for key, value in {"name": print_.name, **settings_of(print_.first)}.items():
        SubElement(element, "metadata", type="object", key=key, value=value)
    volume = SubElement(element, "volume", firstid="0", lastid=str(len(print_.faces) - 1))
    for key, value in {"name": print_.name, "volume_type": "ModelPart"}.items():
        SubElement(volume, "metadata", type="volume", key=key, value=value)
