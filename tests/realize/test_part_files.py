"""File parts: if the format has no unit, the unit of the document applies."""

from __future__ import annotations

import base64
import json
import struct
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from build123d import Box, Color, Compound, Pos, export_brep, export_step, export_stl

from thingc.geometry.record import PartDefinition, PartFailure, PartRecord, definition_text

SIDES = (2.0, 3.0, 4.0)
"""The sides of the box in every file, in the unit of the file."""

METRES = {"um": 1e-6, "mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254, "ft": 0.3048}
"""The units in metres."""


def filed(name: str, unit: str | None) -> PartDefinition:
    given = {} if unit is None else {"unit": unit}
    return PartDefinition(
        reference=name, kind="file", parameters=tuple(given.items()), text=definition_text(name, dict(given), {}), label=name,
    )


def write_gltf(path: Path, corners: list[tuple[float, float, float]], indices: list[int]) -> None:
    """Write a mesh as glTF 2.0 with embedded bytes, in a node translated by 10 along y."""
    numbers = b"".join(struct.pack("<3f", *corner) for corner in corners) + b"".join(struct.pack("<H", index) for index in indices)
    views = [{"buffer": 0, "byteOffset": 0, "byteLength": 12 * len(corners)},
             {"buffer": 0, "byteOffset": 12 * len(corners), "byteLength": 2 * len(indices)}]
    accessors = [{"bufferView": 0, "componentType": 5126, "count": len(corners), "type": "VEC3",
                  "min": [min(c[k] for c in corners) for k in range(3)], "max": [max(c[k] for c in corners) for k in range(3)]},
                 {"bufferView": 1, "componentType": 5123, "count": len(indices), "type": "SCALAR"}]
    path.write_text(json.dumps({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0, "translation": [0.0, 10.0, 0.0]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}], "accessors": accessors, "bufferViews": views,
        "buffers": [{"byteLength": len(numbers), "uri": "data:application/octet-stream;base64," + base64.b64encode(numbers).decode()}],
    }))


@pytest.fixture(scope="module")
def folder(module_place: Any) -> Path:
    """Return the folder with a box in every format."""
    root: Path = module_place.root
    box = Box(*SIDES)
    export_step(box, root / "box.step")
    export_brep(box, root / "box.brep")
    export_stl(box, root / "box.stl")
    corners = [(x, y, z) for x in (-1.0, 1.0) for y in (-1.5, 1.5) for z in (-2.0, 2.0)]
    quads = ((1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4))
    (root / "box.obj").write_text(
        "".join(f"v {x} {y} {z}\n" for x, y, z in corners) + "".join(f"f {a} {b} {c} {d}\n" for a, b, c, d in quads)
    )
    (root / "box.off").write_text("OFF\n8 6 0\n" + "".join(f"{x} {y} {z}\n" for x, y, z in corners)
                                  + "".join("4 " + " ".join(str(one - 1) for one in quad) + "\n" for quad in quads))
    (root / "box.ply").write_text(
        "ply\nformat ascii 1.0\nelement vertex 8\n" + "".join(f"property float {axis}\n" for axis in "xyz")
        + "element face 6\nproperty list uchar int vertex_indices\nend_header\n" + "".join(f"{x} {y} {z}\n" for x, y, z in corners)
        + "".join("4 " + " ".join(str(one - 1) for one in quad) + "\n" for quad in quads)
    )
    write_gltf(root / "box.gltf", corners, [one - 1 for q in quads for one in (q[0], q[1], q[2], q[0], q[2], q[3])])
    space = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
    vertices = "".join(f'<vertex x="{x}" y="{y}" z="{z}"/>' for x, y, z in corners)
    faces = "".join(
        f'<triangle v1="{a - 1}" v2="{b - 1}" v3="{c - 1}"/>' for q in quads for a, b, c in ((q[0], q[1], q[2]), (q[0], q[2], q[3]))
    )
    with zipfile.ZipFile(root / "box.3mf", "w") as archive:
        archive.writestr("3D/3dmodel.model", (
            f'<model unit="inch" xmlns="{space}"><resources><object id="1" type="model"><mesh><vertices>{vertices}</vertices>'
            f'<triangles>{faces}</triangles></mesh></object></resources><build><item objectid="1"/></build></model>'
        ))
    return root


@pytest.mark.parametrize("name", ["box.stl", "box.obj", "box.ply", "box.off", "box.brep"])
def test_document_unit_applies_to_formats_without_unit(name: str, folder: Path, module_place: Any) -> None:
    wanted = {unit: filed(name, unit) for unit in (None, *METRES)}
    with module_place.service() as service:
        found = service.realize(list(wanted.values()))
    for unit, definition in wanted.items():
        record = found[definition.text]
        assert isinstance(record, PartRecord), record
        sides = np.array(SIDES) * METRES[unit or "mm"]
        np.testing.assert_allclose(np.subtract(*reversed(record.box or ())), sides, rtol=1e-6)
        assert record.volume == pytest.approx(sides.prod(), rel=1e-6)
        assert record.inertia[0][0] == pytest.approx(sides.prod() / 12 * (sides[1] ** 2 + sides[2] ** 2), rel=1e-6)
        assert record.area == pytest.approx(2 * (sides.prod() / sides).sum(), rel=1e-6)
    assert {definition.text for definition in wanted.values()} >= {name, f"{name}(unit='m')"}


@pytest.mark.parametrize(("name", "unit"), [("box.step", "mm"), ("box.3mf", "in")])
def test_unit_in_the_file_is_used(name: str, unit: str, folder: Path, module_place: Any) -> None:
    with module_place.service() as service:
        record = service.realize([filed(name, None)])[name]
    assert isinstance(record, PartRecord), record
    np.testing.assert_allclose(np.subtract(*reversed(record.box or ())), np.array(SIDES) * METRES[unit], rtol=1e-6)


def test_gltf_is_in_metres_and_y_up(folder: Path, module_place: Any) -> None:
    with module_place.service() as service:
        record = service.realize([filed("box.gltf", None)])["box.gltf"]
    assert isinstance(record, PartRecord), record
    low, high = record.box or ((), ())
    np.testing.assert_allclose(low, (-1.0, -2.0, 8.5), rtol=1e-6)
    np.testing.assert_allclose(high, (1.0, 2.0, 11.5), rtol=1e-6)
    assert record.volume == pytest.approx(24.0, rel=1e-6) and record.warnings == ()


def triangles() -> list[list[tuple[float, ...]]]:
    """Return the faces of a box of 20 x 30 x 40 mm at the origin: two per side, counter-clockwise seen from outside."""
    found = []
    for axis in range(3):
        one, other = (axis + 1) % 3, (axis + 2) % 3
        for end in (0.0, 1.0):
            square = []
            for u, v in ((0, 0), (1, 0), (1, 1), (0, 1)):
                corner = [0.0, 0.0, 0.0]
                corner[axis], corner[one], corner[other] = end * 10.0 * (axis + 2), u * 10.0 * (one + 2), v * 10.0 * (other + 2)
                square.append(tuple(corner))
            square = square if end else square[::-1]
            found += [[square[0], square[1], square[2]], [square[0], square[2], square[3]]]
    return found


def written(path: Path, faces: list[list[tuple[float, ...]]]) -> None:
    lines = ["solid box"]
    for face in faces:
        lines += ["facet normal 0 0 0", "outer loop", *(f"vertex {x!r} {y!r} {z!r}" for x, y, z in face), "endloop", "endfacet"]
    path.write_text("\n".join([*lines, "endsolid box", ""]))


@pytest.mark.parametrize(
    ("name", "change", "words"),
    [
        ("whole", lambda faces: faces, None),
        ("hole", lambda faces: faces[1:], "triangles added to fill holes: 1"),
        ("side", lambda faces: faces[2:], "triangles added to fill holes: 2"),
        ("turned", lambda faces: [faces[0][::-1], *faces[1:]], "triangles flipped: 1"),
        ("apart", lambda faces: [[(x + 1e-6, y, z) for x, y, z in faces[0]], *faces[1:]],
         "vertices merged within 1e-05 mm: 3"),
        ("inside_out", lambda faces: [face[::-1] for face in faces], None),
    ],
)
def test_open_surface_is_repaired_with_a_warning(name: str, change: Any, words: str | None, module_place: Any) -> None:
    written(module_place.root / f"{name}.stl", change(triangles()))
    with module_place.service() as service:
        record = service.realize([filed(f"{name}.stl", None)])[f"{name}.stl"]
    assert isinstance(record, PartRecord), record
    assert record.volume == pytest.approx(24e-6, rel=1e-6)
    assert [warning.message for warning in record.warnings] == (
        [f"repaired the open surface ({words})"] if words is not None else []
    )


def test_multiple_colours_are_reported(module_place: Any) -> None:
    """A part has one colour. A file with a single colour sets it."""
    red, blue = Box(10, 10, 10), Pos(20, 0, 0) * Box(10, 10, 10)
    for name, colors in (("one", ("red", "red")), ("two", ("red", "blue"))):
        for box, color in zip((red, blue), colors, strict=True):
            box.color = Color(color)
        export_step(Compound(children=[red, blue]), module_place.root / f"{name}.step")
    with module_place.service() as service:
        found = service.realize([filed("one.step", None), filed("two.step", None)])
    one, two = found["one.step"], found["two.step"]
    assert isinstance(one, PartRecord) and isinstance(two, PartRecord)
    assert (one.color, one.warnings) == ("#ff0000", ())
    assert two.color is None and [warning.message for warning in two.warnings] == [
        "expected one colour, found `#0000ff`, `#ff0000`: the material determines the colour",
    ]


@pytest.mark.parametrize(
    ("name", "change", "count"),
    [
        ("twice", lambda faces: [*faces, *(face[1:] + face[:1] for face in faces)], 12),
        ("one", lambda faces: [*faces, faces[3]], 1),
    ],
)
def test_duplicate_triangles_count_once(name: str, change: Any, count: int, module_place: Any) -> None:
    written(module_place.root / f"{name}.stl", change(triangles()))
    with module_place.service() as service:
        record = service.realize([filed(f"{name}.stl", None)])[f"{name}.stl"]
    assert isinstance(record, PartRecord), record
    assert record.volume == pytest.approx(24e-6, rel=1e-6)
    assert [warning.message for warning in record.warnings] == [f"duplicate triangles removed: {count}"]


@pytest.mark.parametrize("change", [
    lambda faces: [*faces, *(face[::-1] for face in faces)],
    lambda faces: [one for face in faces for one in (face[::-1], face)],
])
def test_opposite_duplicate_triangles_are_removed(change: Any, module_place: Any) -> None:
    written(module_place.root / "sides.stl", change(triangles()))
    with module_place.service() as service:
        record = service.realize([filed("sides.stl", None)])["sides.stl"]
    assert isinstance(record, PartRecord), record
    assert record.volume == pytest.approx(24e-6, rel=1e-6)
    assert [warning.message for warning in record.warnings] == ["opposite triangles removed: 12"]


def test_overlapping_solids_of_a_file_are_reported(module_place: Any) -> None:
    """The warning suggests to unite the solids in the CAD program."""
    written(module_place.root / "two.stl", [*triangles(), *([(x + 5, y + 5, z + 5) for x, y, z in face] for face in triangles())])
    with module_place.service() as service:
        record = service.realize([filed("two.stl", None)])["two.stl"]
    assert isinstance(record, PartRecord), record
    assert [warning.message for warning in record.warnings] == [
        "the 2 solids overlap by 13120 mm^3; unite the solids in the CAD program"
    ]


BOX = triangles()


def binary(faces: list[list[tuple[float, ...]]], count: int) -> bytes:
    """Return a binary STL file whose header declares `count` triangles."""
    return bytes(80) + struct.pack("<I", count) + b"".join(struct.pack("<12fH", 0, 0, 0, *sum(face, ()), 0) for face in faces)


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("open.stl", None, "the surface is not closed (6 edges belong to only one triangle)"),
        ("words.stl", b"no triangles at all", "the file is truncated: expected at least 84 bytes, found 19"),
        ("words.ply", b"no triangles at all", "the file is not a valid PLY file"),
        ("words.glb", b"no triangles at all", "the file is not a valid GLB file"),
        ("beyond.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "the file is not a valid OBJ file"),
        ("short.stl", binary(BOX, 50), "the file is truncated: expected 50 triangles, found bytes for 12"),
        ("long.stl", binary(BOX, 5), "the file has data after its end: expected 5 triangles, found bytes for"),
        ("cut.stl", binary(BOX, 12)[:-80], "the file is truncated: expected 12 triangles, found bytes for 10.4"),
        ("head.stl", bytes(50), "the file is truncated: expected at least 84 bytes, found 50"),
        ("text.stl", b"solid box\nfacet normal 0 0 0\nouter loop\nvertex 0 0 0\n", "the file is truncated (no `endsolid`)"),
        ("far.stl", binary([[(1e38, 0.0, 0.0), *BOX[0][1:]], *BOX[1:]], 12), "a coordinate is too large (1e+38 mm)"),
        ("words.brep", b"no shape at all", "the file is not a complete BREP file"),
        ("words.step", b"no shape at all", "the STEP file contains no shape"),
        ("gone.gltf", b'{"asset": {"version": "2.0"}, "buffers": [{"uri": "gone", "byteLength": 9}]}', "the file is not a valid GLTF file"),
        ("endless.off", b"OFF\n3 1 0\n0 0 nan\n1 0 0\n0 1 0\n3 0 1 2\n", "a coordinate is not finite"),
    ],
)
def test_file_without_a_solid_is_rejected_with_a_message(name: str, content: bytes | None, words: str, module_place: Any) -> None:
    if content is None:
        faces = triangles()
        written(module_place.root / name, [*faces[2:4], *faces[6:]])  # a hole of six edges
    else:
        (module_place.root / name).write_bytes(content)
    with module_place.service() as service:
        failure = service.realize([filed(name, None)])[name]
    assert isinstance(failure, PartFailure), failure
    assert failure.message.startswith(words), failure.message
    assert str(module_place.root) not in failure.message
