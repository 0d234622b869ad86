"""Mesh files of links, compared with a written-out MuJoCo model of the same files, and diagnostics for invalid files."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh

from thingc.base.diagnostics import Code
from thingc.driver import pipeline
from thingc.driver.environment import Environment, Options
from thingc.driver.pipeline import Compilation
from thingc.geometry.record import Mesh
from thingc.geometry.service import GeometryService
from thingc.targets.artifact import Artifacts, StoredArtifact

GIVEN = "mass: 1 kg, com: 0 0 0 mm, inertia: {ixx: 0.01 kg*m^2, iyy: 0.01 kg*m^2, izz: 0.01 kg*m^2}"
HEAD = "thingc: assembly/1\nname: meshed\nmaterials: {steel: {density: 7800 kg/m^3, color: gray}}\ncomponents:\n"


def wedge() -> trimesh.Trimesh:
    """A solid [m] without any symmetry."""
    corners = [(0, 0, 0), (0.3, 0, 0), (0, 0.2, 0), (0.02, 0.03, 0.1), (0.2, 0.02, 0.05)]
    made = trimesh.convex.convex_hull(np.array(corners, dtype=float))
    made.apply_translation((0.1, 0.05, 0.02))
    return made


def workspace(folder: Path) -> Path:
    """Files of the wedge: in metres except for `mm.stl`, and with unit and axis as the formats specify."""
    folder.joinpath("thingc.toml").write_text('thingc = "workspace/1"\n')
    meshes = folder / "meshes"
    meshes.mkdir()
    solid = wedge()
    solid.export(meshes / "m.stl")
    solid.copy().apply_scale(1000.0).export(meshes / "mm.stl")
    solid.export(meshes / "m.obj")
    solid.export(meshes / "m.ply")
    turned = solid.copy()
    turned.apply_transform([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])  # y up
    turned.export(meshes / "y_up.glb")
    text = trimesh.exchange.dae.export_collada(solid.copy().apply_scale(10.0)).decode()
    text = text.replace("<up_axis>Y_UP</up_axis>", "<up_axis>Z_UP</up_axis>")
    unit = '<unit name="decimetre" meter="0.1"/>'
    text = text.replace("<up_axis>", unit + "<up_axis>") if "<unit" not in text else text
    (meshes / "dm.dae").write_text(text)
    open_ = trimesh.Trimesh(solid.vertices, solid.faces[:-2], process=False)
    open_.export(meshes / "open.stl")
    faces = [f"f {' '.join(str(k + 1) for k in face)}" for face in solid.faces]
    points = [f"v {x} {y} {z}" for x, y, z in solid.vertices]
    half = len(faces) // 2
    (meshes / "colours.mtl").write_text("newmtl red\nKd 1 0 0\nnewmtl blue\nKd 0 0 1\n")
    lines = ["mtllib colours.mtl", *points, "usemtl red", *faces[:half], "usemtl blue", *faces[half:]]
    (meshes / "colours.obj").write_text("\n".join(lines) + "\n")
    return folder


def compile_and_build(folder: Path, components: str, targets: list[str], **options: object) -> tuple[Compilation, dict[str, Artifacts]]:
    (folder / "meshed.yaml").write_text(HEAD + components)
    with Environment(str(folder / "meshed.yaml"), Options(store=str(folder / "store"), **options)) as environment:  # type: ignore[arg-type]
        compilation = pipeline.compile(environment)
        made = {} if compilation.report.failed or not targets else pipeline.build(environment, compilation, targets)
        return compilation, made


@pytest.fixture(scope="module")
def here(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return workspace(tmp_path_factory.mktemp("meshes"))


@pytest.fixture(autouse=True)
def no_kernel(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(GeometryService, "warm", lambda self: pytest.fail("the kernel was begun"))


FILES = {
    "m.stl": "unit: m", "mm.stl": "unit: mm", "m.obj": "unit: m", "m.ply": "unit: m", "y_up.glb": "", "dm.dae": "",
    "colours.obj": "unit: m",
}


def test_formats_units_and_up_axes_give_the_same_solid(here: Path) -> None:
    """Mass, centre and inertia computed from each file equal those of trimesh for the wedge."""
    shapes = "".join(
        f"  c{k}: {{link: true, material: steel, {'at: {in: c0.origin}, ' if k else ''}shapes: [{{mesh: meshes/{name}"
        f"{', ' + unit if unit else ''}}}]}}\n" for k, (name, unit) in enumerate(FILES.items())
    )
    compilation, _ = compile_and_build(here, shapes, [])
    assert compilation.report.diagnostics == [] and compilation.assembly is not None
    solid = wedge()
    solid.density = 7800.0
    for one, name in zip(compilation.assembly.occurrences, FILES, strict=True):
        assert one.properties.mass == pytest.approx(solid.mass, rel=1e-5), name
        assert one.properties.centre == pytest.approx(solid.center_mass, rel=1e-5), name
        assert np.array(one.properties.inertia) == pytest.approx(solid.moment_inertia, rel=1e-4, abs=1e-6), name
        assert one.box is not None and np.array(one.box) == pytest.approx(solid.bounds, abs=1e-6), name


def test_mjcf_uses_the_original_file_with_a_scale(here: Path) -> None:
    """Geoms of a mirrored and a rotated file, compared with a written-out model of the same files."""
    shapes = (
        f"  base: {{link: true, {GIVEN}, shapes: [{{mesh: meshes/mm.stl, scale: [1, 1, -1], at: {{xyz: 10 20 30 mm, rpy: 0 0 90 deg}}}}, "
        "{mesh: meshes/m.obj, unit: m, scale: 0.5, for: collision}]}\n"
    )
    compilation, made = compile_and_build(here, shapes, ["mjcf"])
    assert compilation.report.diagnostics == []
    files = made["mjcf"].files
    assets = {path.removeprefix("mjcf/assets/"): content for path, content in files.items() if path.startswith("mjcf/assets/")}
    store = here / "store" / "blobs"
    assert all(isinstance(content, StoredArtifact) for content in assets.values())
    data = {name: (store / stored.sha256[:2] / stored.sha256[2:]).read_bytes() for name, stored in assets.items()}  # type: ignore[union-attr]
    assert (here / "meshes" / "mm.stl").read_bytes() in data.values() and (here / "meshes" / "m.obj").read_bytes() in data.values()
    ours = mujoco.MjModel.from_xml_string(files["mjcf/meshed_default.xml"].decode(), data)  # type: ignore[union-attr]
    by_hand = mujoco.MjModel.from_xml_string(
        """<mujoco><compiler angle="degree"/><asset><mesh name="a" file="mm.stl" scale="0.001 0.001 -0.001"/>
        <mesh name="b" file="m.obj" scale="0.5 0.5 0.5"/></asset><worldbody><body>
        <geom type="mesh" mesh="a" pos="0.01 0.02 0.03" euler="0 0 90"/><geom type="mesh" mesh="b"/></body></worldbody></mujoco>""",
        {name: (here / "meshes" / name).read_bytes() for name in ("mm.stl", "m.obj")},
    )
    mine = [k for k in range(ours.ngeom) if ours.geom_contype[k]]
    assert len(mine) == by_hand.ngeom == 2
    for one, other in zip(mine, range(2), strict=True):
        assert ours.geom_pos[one] == pytest.approx(by_hand.geom_pos[other], abs=1e-7)
        assert points_in_body(ours, one) == pytest.approx(points_in_body(by_hand, other), abs=1e-7)
    image = wedge().vertices * (1, 1, -1)
    expected = np.column_stack([-image[:, 1], image[:, 0], image[:, 2]]) + (0.01, 0.02, 0.03)
    assert points_in_body(ours, mine[0]) == pytest.approx(sorted_rows(expected), abs=1e-6)


def points_in_body(model: mujoco.MjModel, geom: int) -> np.ndarray:
    mesh = model.geom_dataid[geom]
    first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, model.geom_quat[geom])
    return sorted_rows(model.mesh_vert[first : first + count] @ turn.reshape(3, 3).T + model.geom_pos[geom])


def sorted_rows(points: np.ndarray) -> np.ndarray:
    rounded = np.unique(np.round(points, 6), axis=0)
    return rounded[np.lexsort(rounded.T)]


def test_mesh_groups_keep_their_colours(here: Path) -> None:
    """A change of the material library changes the colours, and the library is a dependency of the build."""
    shapes = f"  base: {{link: true, {GIVEN}, shapes: [{{mesh: meshes/colours.obj, unit: m, for: visual}}]}}\n"
    compilation, made = compile_and_build(here, shapes, ["mjcf", "html", "glb", "urdf", "sdf", "usd"])
    assert compilation.report.diagnostics == [] and compilation.assembly is not None
    assert [surface.color for surface in compilation.assembly.occurrences[0].drawn] == ["#0000ff", "#ff0000"]
    library = here / "meshes" / "colours.mtl"
    before = library.read_text()
    library.write_text(before.replace("Kd 1 0 0", "Kd 0 1 0"))
    again, _ = compile_and_build(here, shapes, [])
    library.write_text(before)
    assert again.assembly is not None and again.documents is not None
    assert str(here / "meshes" / "colours.obj") in again.documents.files
    assert [surface.color for surface in again.assembly.occurrences[0].drawn] == ["#0000ff", "#00ff00"]
    assert str(library) in again.documents.files, "what a build depends on"


def test_all_objects_of_an_obj_are_written(here: Path) -> None:
    """MuJoCo reads only the first object of an OBJ file, so the written file contains all faces in one object."""
    solid = wedge()
    points = "".join(f"v {x} {y} {z}\n" for x, y, z in (*solid.vertices, *(solid.vertices + (1, 0, 0))))
    faces = [[f"f {' '.join(str(k + 1 + first) for k in face)}\n" for face in solid.faces] for first in (0, len(solid.vertices))]
    text = f"o one\n{points}{''.join(faces[0])}o two\n{''.join(faces[1])}"
    (here / "meshes" / "two.obj").write_text(text)
    model = "<mujoco><asset><mesh name='m' file='m.obj'/></asset><worldbody><geom type='mesh' mesh='m'/></worldbody></mujoco>"
    theirs = mujoco.MjModel.from_xml_string(model, {"m.obj": text.encode()})
    assert theirs.nmeshface == len(solid.faces)
    shapes = f"  base: {{link: true, {GIVEN}, shapes: [{{mesh: meshes/two.obj, unit: m, for: visual}}]}}\n"
    _, made = compile_and_build(here, shapes, ["mjcf"])
    (stored,) = (content for path, content in made["mjcf"].files.items() if path.startswith("mjcf/assets/"))
    assert isinstance(stored, StoredArtifact)
    written = (here / "store" / "blobs" / stored.sha256[:2] / stored.sha256[2:]).read_bytes()
    assert mujoco.MjModel.from_xml_string(model, {"m.obj": written}).nmeshface == 2 * len(solid.faces)


IMAGE = (
    "<newparam sid='s'><sampler2D><source>no_such</source></sampler2D></newparam>"
    "<technique sid='common'><phong><diffuse><texture texture='s'/></diffuse>"
)


@pytest.mark.parametrize(("what", "slip", "color"), [
    (r"<technique sid.*?<diffuse>.*?</diffuse>", IMAGE, "#ffffff"),
    ('target="#', 'target="#no_such_', None),
])
def test_collada_with_missing_material_is_read(here: Path, what: str, slip: str, color: str | None) -> None:
    text = re.sub(what, slip, (here / "meshes" / "dm.dae").read_text(), flags=re.DOTALL)
    assert slip in text
    (here / "meshes" / "slip.dae").write_text(text)
    compilation, _ = compile_and_build(here, f"  base: {{link: true, {GIVEN}, shapes: [{{mesh: meshes/slip.dae, for: visual}}]}}\n", [])
    assert compilation.report.diagnostics == [] and compilation.assembly is not None
    (surface,) = compilation.assembly.occurrences[0].drawn
    assert isinstance(surface.solid, Mesh) and surface.solid.faces == len(wedge().faces) and surface.color == color


def test_mirrored_link_mirrors_its_meshes(here: Path) -> None:
    shapes = (
        "  left: {link: true, material: steel, shapes: [{mesh: meshes/m.stl, unit: m, at: {xyz: 0 40 0 mm, rpy: 20 0 30 deg}}]}\n"
        "  right: {link: true, mirror: y, at: {in: left.origin}, material: steel, shapes: [{mesh: meshes/m.stl, unit: m, "
        "at: {xyz: 0 40 0 mm, rpy: 20 0 30 deg}}]}\n"
    )
    compilation, _ = compile_and_build(here, shapes, [])
    assert compilation.report.diagnostics == [] and compilation.assembly is not None
    left, right = compilation.assembly.occurrences
    signs = np.diag([1.0, -1.0, 1.0])
    assert right.properties.mass == pytest.approx(left.properties.mass, rel=1e-9)
    assert right.properties.centre == pytest.approx(signs @ left.properties.centre, abs=1e-9)
    assert np.array(right.properties.inertia) == pytest.approx(signs @ np.array(left.properties.inertia) @ signs, abs=1e-9)


def test_check_with_given_masses_reads_no_mesh(here: Path) -> None:
    """With an explicit mass and inertia, `thingc check` imports neither numpy nor trimesh."""
    (here / "given.yaml").write_text(HEAD + f"  base: {{link: true, {GIVEN}, shapes: [{{mesh: meshes/open.stl, unit: m}}]}}\n")
    program = (
        "import sys; from thingc.tools.cli.main import main; code = main(['check', sys.argv[1], '--store', sys.argv[2]]);"
        "print(code, sorted({'numpy', 'trimesh', 'mujoco', 'networkx'} & set(sys.modules)))"
    )
    store = str(here / "empty-store")
    ran = subprocess.run([sys.executable, "-c", program, str(here / "given.yaml"), store], capture_output=True, text=True, check=True)
    assert ran.stdout.splitlines()[-1] == "0 []", ran.stdout


def test_mesh_data_is_cached_by_content(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shapes = "  base: {link: true, material: steel, shapes: [{mesh: meshes/m.ply, unit: m}]}\n"
    first, _ = compile_and_build(here, shapes, [])
    monkeypatch.setattr("thingc.geometry.meshes.mesh_reader.read_mesh", lambda *_: pytest.fail("it was read again"))
    again, _ = compile_and_build(here, shapes, [])
    assert first.assembly is not None and again.assembly is not None
    assert again.assembly.occurrences[0].properties == first.assembly.occurrences[0].properties


BAD = {
    "cut.stl": (lambda data: data[:-7], "expected 6 triangles, found bytes for 5.86"),
    "words.stl": (lambda data: b"solid nothing\nendsolid", "contains no triangles"),
    "words.obj": (lambda data: b"v 0 0\nf 1 2 3\n", "is not a valid OBJ file"),
    "nan.stl": (lambda data: data[:96] + b"\xff\xff\xff\xff" + data[100:], "has a coordinate that is not finite"),
    "far.obj": (lambda data: b"v 1e308 0 0\nv -1e308 0 0\nv 0 1e308 0\nf 1 2 3\n", "(at most 1e+06 m is supported)"),
    "bomb.stl": (lambda data: data[:80] + (6_000_000).to_bytes(4, "little") + data[84:], "expected 6000000 triangles"),
    "bomb.ply": (lambda data: b"ply\nformat ascii 1.0\nelement vertex 3\nelement face 9000000\nend_header\n", "has 9000000 triangles"),
    "text.glb": (lambda data: b"no glTF", "is not a valid GLB file"),
    "text.dae": (lambda data: b"<COLLADA><oops></COLLADA>", "is not a valid DAE file (XML Parsing Error: "),
    "page.dae": (lambda data: b"<!DOCTYPE html><html><body>404</body></html>", "contains no `<COLLADA xmlns=...>`"),
    "asset.dae": (
        lambda data: b'<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset/></COLLADA>',
        "contains no `<scene>`",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_invalid_mesh_files_are_reported(here: Path, name: str) -> None:
    change, said = BAD[name]
    (here / "meshes" / name).write_bytes(change((here / "meshes" / "m.stl").read_bytes()))
    compilation, _ = compile_and_build(here, f"  base: {{link: true, {GIVEN}, shapes: [\n    {{mesh: meshes/{name}}}]}}\n", [])
    (fault,) = compilation.report.diagnostics
    assert fault.code is Code.PART_INVALID and fault.message.startswith(f"`meshes/{name}` ") and said in fault.message
    assert fault.span is not None and (fault.span.line, fault.span.column) == (6, 12)


def test_open_mesh_requires_a_given_inertia(here: Path) -> None:
    """A mesh that is not closed is used for drawing and contacts, but its mass cannot be computed."""
    link = "  base: {{link: true, {0}, shapes: [{{mesh: meshes/open.stl, unit: m}}]}}\n"
    compilation, made = compile_and_build(here, link.format(GIVEN), ["mjcf"])
    assert compilation.report.diagnostics == []
    assert b'inertia="shell"' in made["mjcf"].files["mjcf/meshed_default.xml"]  # type: ignore[operator]
    for said in ("material: steel", "mass: 1 kg"):
        compilation, _ = compile_and_build(here, link.format(said), [])
        (fault,) = compilation.report.diagnostics
        assert fault.code is Code.NO_MATERIAL and "the mesh `meshes/open.stl`, which is not closed" in fault.message


@pytest.mark.parametrize(("unit", "words"), [("mm", "is shorter than 1 mm"), ("m", None)])
def test_implausible_unit_is_a_warning(here: Path, unit: str, words: str | None) -> None:
    compilation, _ = compile_and_build(here, f"  base: {{link: true, {GIVEN}, shapes: [{{mesh: meshes/m.stl, unit: {unit}}}]}}\n", [])
    said = [one for one in compilation.report.diagnostics if one.code is Code.SIZE]
    assert [words in one.message for one in said] == ([True] if words is not None else [])
    assert all("unit: m" in (one.help or "") for one in said)
    compilation, _ = compile_and_build(here, f"  base: {{link: true, {GIVEN}, shapes: [{{mesh: meshes/mm.stl, unit: m}}]}}\n", [])
    assert any(one.code is Code.SIZE and "is longer than 10 m" in one.message for one in compilation.report.diagnostics)


def test_material_library_outside_the_folder_is_not_read(here: Path) -> None:
    """An OBJ file may refer only to a material library in its own folder."""
    outside = here.parent / "secret.mtl"
    outside.write_text("newmtl red\nKd 1 0 0\n")
    text = (here / "meshes" / "colours.obj").read_text().replace("mtllib colours.mtl", f"mtllib ../../{outside.name}")
    (here / "meshes" / "sly.obj").write_text(text)
    compilation, _ = compile_and_build(here, f"  base: {{link: true, {GIVEN}, shapes: [{{mesh: meshes/sly.obj, unit: m}}]}}\n", [])
    assert compilation.assembly is not None
    assert {surface.color for surface in compilation.assembly.occurrences[0].drawn} == {None}
