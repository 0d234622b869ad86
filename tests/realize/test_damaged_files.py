"""Damaged mesh files, and files that declare more data than the limits allow, are rejected with a message before their content uses
memory."""

from __future__ import annotations

import io
import json
import random
import re
import struct
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import trimesh
from build123d import Box, export_brep, export_step

from thingc.geometry.mesh_bounds import INSTANCES, LARGEST, BadMesh, check_mesh_file
from thingc.geometry.meshes.files import mesh_file
from thingc.geometry.meshes.mesh_reader import read_mesh as read_shape
from thingc.geometry.record import PartFailure
from thingc.geometry.store.local import Store
from thingc.geometry.worker.kernel.mesh_files import MOST, BadPartFile, read_mesh

SPACE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
BOX = trimesh.creation.box((2.0, 3.0, 4.0))
FORMATS = ("binary.stl", "words.stl", "box.obj", "binary.ply", "words.ply", "box.off", "box.glb", "box.3mf", "box.dae")
SHAPES = (".stl", ".obj", ".ply", ".glb", ".dae")
"""Formats that links can use; all except COLLADA can also be parts."""


def model_3mf(objects: str, item: str) -> bytes:
    return f'<model xmlns="{SPACE}"><resources>{objects}</resources><build><item objectid="{item}"/></build></model>'.encode()


def zipped(model: bytes) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("3D/3dmodel.model", model)
    return stream.getvalue()


def box_3mf() -> bytes:
    corners = "".join(f'<vertex x="{x}" y="{y}" z="{z}"/>' for x, y, z in BOX.vertices.tolist())
    faces = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in BOX.faces.tolist())
    return model_3mf(f'<object id="1"><mesh><vertices>{corners}</vertices><triangles>{faces}</triangles></mesh></object>', "1")


def content(name: str) -> bytes:
    if name == "box.3mf":
        return zipped(box_3mf())
    kind = {"words.stl": "stl_ascii"}.get(name, name[-3:])
    options = {"encoding": "ascii"} if name == "words.ply" else {}
    data = BOX.export(file_type=kind, **options)
    return data.encode() if isinstance(data, str) else bytes(data)


def damaged(data: bytes, chance: random.Random) -> bytes:
    """Return the data truncated, with some bits flipped, with bytes inserted or removed, or with some bytes replaced by other values."""
    way, at, some = chance.randrange(5), chance.randrange(len(data)), chance.choice((1, 4, 100))
    if way == 0:
        return data[:at]
    if way == 1:
        turned = bytearray(data)
        for _ in range(some):
            turned[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
        return bytes(turned)
    if way == 2:
        return data[:at] + chance.randbytes(some) + data[at:]
    word = b"" if way == 3 else chance.choice((b"\0" * some, b"\xff" * some, b"nan", b"1e999", b"-7", b"<", b"99999999999999999999"))
    return data[:at] + word + data[at + some :]


def words_of(path: Path, store: Store) -> list[str]:
    """Return the error messages for a file read as a part and as a mesh of a link; empty if it can be read."""
    words = []
    if path.suffix != ".dae":
        try:
            read_mesh(str(path), path.suffix, 1.0)
        except BadPartFile as fault:
            words.append(str(fault))
    if path.suffix in SHAPES:
        try:
            read_shape(mesh_file(str(path), path.name, (1.0, 1.0, 1.0)), store)
        except BadMesh as fault:
            words.append(f"the file {fault}")
    return words


@pytest.mark.parametrize("name", FORMATS)
def test_damaged_files_are_rejected_with_a_message(name: str, tmp_path: Path) -> None:
    """An exception that a reader does not convert to an error message fails this test."""
    chance, store, found = random.Random(name), Store(str(tmp_path / "store")), list[str]()
    whole, path = content(name), tmp_path / name
    path.write_bytes(whole)
    assert words_of(path, store) == []
    for number in range(60):
        inside = name == "box.3mf" and number % 2
        path.write_bytes(zipped(damaged(box_3mf(), chance)) if inside else damaged(whole, chance))
        found += words_of(path, store)
    assert len(found) > 20
    assert [words for words in found if re.search(r"[a-z](Error|Exception|Warning)\b", words)] == []


def nested_3mf(mesh: str = "") -> bytes:
    twice = "".join(
        f'<object id="{k}"><components>{2 * f"<component objectid={chr(34)}{k - 1}{chr(34)}/>"}</components></object>' for k in range(1, 40)
    )
    return zipped(model_3mf(f'<object id="0">{mesh}</object>{twice}', "39"))


def nested_dae() -> bytes:
    twice = "".join(f'<node id="n{k}">{2 * f"<instance_node url={chr(34)}#n{k - 1}{chr(34)}/>"}</node>' for k in range(1, 40))
    text = content("box.dae").decode()
    nodes = f'<library_nodes><node id="n0"/>{twice}</library_nodes>'
    scene = re.sub(r"(<visual_scene [^>]*>)", r'\1<node><instance_node url="#n39"/></node>', text)
    return scene.replace("<library_visual_scenes>", f"{nodes}<library_visual_scenes>").encode()


def glb(count: int, *, accessors: int = 1, nodes: int = 1, primitives: int = 1, kind: str = "VEC3") -> bytes:
    """Return a glTF file whose accessors have no bytes; such accessors contain zeros."""
    text = json.dumps({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": nodes * [{"mesh": 0}],
        "meshes": [{"primitives": primitives * [{"attributes": {"POSITION": 0}}]}],
        "accessors": accessors * [{"componentType": 5126, "count": count, "type": kind}],
    }).encode()
    text += b" " * (-len(text) % 4)
    return struct.pack("<4sIIII", b"glTF", 2, 20 + len(text), len(text), 0x4E4F534A) + text


def inflating_3mf() -> bytes:
    return zipped(box_3mf().replace(b"<build>", b" " * LARGEST + b"<build>"))


OBJECTS = f"has {2**40 - 1 + 1} placed objects (at most {INSTANCES} are supported)"
CYCLE = '<object id="1"><components><component objectid="1"/></components></object>'


@pytest.mark.parametrize(("name", "data", "words"), [
    ("nested.3mf", nested_3mf(), OBJECTS),
    ("cycle.3mf", zipped(model_3mf(CYCLE, "1")), "has more than 100 levels of nested objects"),
    ("nested.dae", nested_dae(), f"(at most {INSTANCES} are supported)"),
    ("nested.dae", nested_dae().decode().replace("utf-8", "utf-16").encode("utf-16"), f"(at most {INSTANCES} are supported)"),
    ("often.dae", content("box.dae").replace(b"<instance_geometry", INSTANCES * b"<instance_geometry url='#x'/>" + b"<instance_geometry"),
     f"has {INSTANCES + 3} placed objects"),
    ("sparse.glb", glb(15_000_003), "has 5000001 triangles (at most"),
    ("negative.glb", glb(-3_000_000_000), "has 9000000000 numbers (at most"),
    ("shared.glb", glb(1_000_000, accessors=20, kind="MAT4"), "has 320000000 numbers (at most 200000000 are supported)"),
    ("primitives.glb", glb(3, primitives=INSTANCES), f"has {INSTANCES + 1} nodes and placed objects"),
    ("nodes.glb", glb(3, nodes=101, primitives=99), "has 10100 nodes and placed objects"),
    ("empty.glb", b"", "is empty"),
    ("inflating.3mf", inflating_3mf, "bytes of XML (at most 200000000 are supported)"),
])
def test_declared_sizes_are_limited_before_reading(
    name: str, data: bytes | Callable[[], bytes], words: str, tmp_path: Path,
) -> None:
    path = tmp_path / name
    path.write_bytes(data() if callable(data) else data)
    found = words_of(path, Store(str(tmp_path / "store")))
    assert found and words in found[0]


@pytest.mark.parametrize(("suffix", "data"), [
    (".obj", b"v 0 0 0\n" + b" f 1 1 1\n" * 11), (".stl", b"solid x\n" + b"facet\nEndFacet\n" * 11 + b"endsolid x\n"),
    (".stl", bytes(80) + struct.pack("<I", 11) + bytes(550)), (".ply", b"ply\nelement face 11\nend_header\n"),
])
def test_triangles_are_counted_before_reading(suffix: str, data: bytes) -> None:
    check_mesh_file(suffix, data, 11)
    with pytest.raises(BadMesh, match=r"has 11 triangles \(at most 10 are supported\)"):
        check_mesh_file(suffix, data, 10)


def test_sparse_file_is_too_large(tmp_path: Path) -> None:
    path = tmp_path / "sparse.stl"
    with path.open("wb") as stream:
        stream.truncate(50_000_000_000)
    with pytest.raises(BadPartFile, match="the file is larger than 200 MB"):
        read_mesh(str(path), ".stl", 1.0)


def test_triangles_of_instanced_meshes_are_multiplied(tmp_path: Path) -> None:
    """The product of triangles and placements does not appear anywhere in the file."""
    scene = trimesh.Scene()
    ball = trimesh.creation.icosphere(5)
    scene.add_geometry(ball, geom_name="ball")
    for k in range(MOST // len(ball.faces)):
        scene.graph.update(f"n{k}", geometry="ball", matrix=trimesh.transformations.translation_matrix((3.0 * k, 0.0, 0.0)))
    path = tmp_path / "often.glb"
    path.write_bytes(scene.export(file_type="glb"))
    with pytest.raises(BadPartFile, match=rf"triangles \(at most {MOST} are supported\)"):
        read_mesh(str(path), ".glb", 1.0)


def test_files_the_kernel_cannot_read_are_invalid(place: Any, define_file: Any) -> None:
    """Exceptions and crashes of the kernel are not reported as failures of part code. The kernel would read some truncated files
    forever."""
    export_brep(Box(1, 2, 3), place.root / "whole.brep")
    export_step(Box(1, 2, 3), place.root / "whole.step")
    brep, step = ((place.root / f"whole.{kind}").read_bytes() for kind in ("brep", "step"))
    open_list = step.replace(b"CARTESIAN_POINT('',(-0.5,-1.,-1.5));", b"CARTESIAN_POINT('',(-0.5,-1.,-1.5);", 1)
    assert open_list != step
    files = {"half.brep": brep[: len(brep) // 3], "half.step": step[: len(step) // 2], "open.step": open_list}
    for name, data in files.items():
        (place.root / name).write_bytes(data)
    with place.service() as service:
        found = service.realize([define_file(name) for name in files])
    assert all(isinstance(failure, PartFailure) and failure.kind == "invalid" for failure in found.values()), found
    assert [found[name].message for name in files] == [
        "the file is not a complete BREP file", "the STEP file contains no shape",
        "the CAD kernel cannot read the file (killed by SIGSEGV)",
    ]
