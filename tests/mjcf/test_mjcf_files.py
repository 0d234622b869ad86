"""The write_build_folder files: their bytes, their layout on disk, the scene and the archive."""

from __future__ import annotations

import hashlib
import pickle
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
import zipfile
from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import given, strategies as st

from mjcf.handmade import Made, Piece, Segment, box_part, material, matrix, raw, spin
from mjcf.test_mjcf_model import arm
from thingc.geometry.store.local import BlobMissing, Store
from thingc.targets.artifact import Content, StoredArtifact
from thingc.targets.mjcf.emit import emit, emit_with_modes
from thingc.targets.registry import TARGETS, emitter, targets
from thingc.targets.request import EmitRequest
from thingc.targets.stl import emit as stl
from thingc.targets.xml_writer import Element, number, write


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store(str(tmp_path / "store"))


def emit_both_targets(request: EmitRequest) -> dict[str, Content]:
    """The files of both targets, `mjcf` and `mjz`."""
    return {**emit(request).files, **emitter("mjz")(request).files}


def write_build_folder(made: Made, store: Store, folder: Path, *modes: tuple[str, str]) -> Path:
    """Write a build into a folder, as the driver does."""
    request = made.request(store, *modes)
    for path, content in emit_both_targets(request).items():
        target = folder / path
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(store.read(content.sha256) if isinstance(content, StoredArtifact) else content)
    assert request.report.diagnostics == []
    return folder / "mjcf"


MODES = (("bench", "fixed"), ("drawing", "held"), ("adrift", "free"))


def test_file_names_of_models_scenes_and_assets(store: Store) -> None:
    request = arm(store).request(store, *MODES)
    assert sorted(emitter("mjz")(request).files) == ["mjcf/arm_adrift.mjz", "mjcf/arm_bench.mjz", "mjcf/arm_drawing.mjz"]
    files = emit(request).files
    assert [path for path in files if "assets" not in path] == [
        "mjcf/arm_adrift.xml",
        "mjcf/arm_bench.xml",
        "mjcf/arm_drawing.xml",
        "mjcf/scene_adrift.xml",
        "mjcf/scene_bench.xml",
        "mjcf/scene_drawing.xml",
    ]
    assets = [path.removeprefix("mjcf/assets/") for path in files if "assets" in path]
    stems = sorted({path.partition(".")[0] + "." + path.split(".")[1].removesuffix("_hull") for path in assets})
    assert len(stems) == 3 and sorted(assets) == sorted(f"{s}{end}" for s in stems for end in (".obj", "_hull.obj"))
    assert all(isinstance(files[f"mjcf/assets/{name}"], StoredArtifact) for name in assets)


@pytest.mark.parametrize(("mode", "base"), MODES)
def test_folder_loads_from_disk(store: Store, tmp_path: Path, mode: str, base: str) -> None:
    """MuJoCo loads model and scene of each mode from disk, and simulates 20 steps without warnings."""
    folder = write_build_folder(arm(store), store, tmp_path, *MODES)
    alone = mujoco.MjModel.from_xml_path(str(folder / f"arm_{mode}.xml"))
    scene = mujoco.MjModel.from_xml_path(str(folder / f"scene_{mode}.xml"))
    assert scene.ngeom == alone.ngeom + 1 and scene.nlight == 1 and scene.ntex == 2
    assert scene.geom("floor").type == mujoco.mjtGeom.mjGEOM_PLANE
    assert (alone.nq, alone.nkey, alone.nu) == (scene.nq, scene.nkey, scene.nu)
    np.testing.assert_array_equal(alone.key_qpos, scene.key_qpos)
    data = mujoco.MjData(scene)
    mujoco.mj_resetDataKeyframe(scene, data, 0)
    for _ in range(20):
        mujoco.mj_step(scene, data)
    assert not data.warning.number.any()


def test_archive_equals_the_model(store: Store, tmp_path: Path) -> None:
    """The archive loads under any file name, and its compiled model equals that of the XML file exactly."""
    folder = write_build_folder(arm(store), store, tmp_path, *MODES)
    beside = mujoco.MjModel.from_xml_path(str(folder / "arm_drawing.xml"))
    renamed = tmp_path / "anything.mjz"
    renamed.write_bytes((folder / "arm_drawing.mjz").read_bytes())
    for path in (folder / "arm_drawing.mjz", renamed):
        packed = mujoco.MjSpec.from_file(str(path)).compile()
        for name in ("body_mass", "body_inertia", "body_pos", "body_quat", "mesh_vert", "key_qpos", "jnt_axis", "geom_quat"):
            np.testing.assert_array_equal(getattr(packed, name), getattr(beside, name))


def test_archive_is_a_valid_reproducible_zip(store: Store, tmp_path: Path) -> None:
    folder = write_build_folder(arm(store), store, tmp_path, *MODES)
    with zipfile.ZipFile(folder / "arm_bench.mjz") as archive:
        assert archive.testzip() is None
        names = archive.namelist()
        assert names == sorted(names) and names[-1] == "model.xml"
        assert {info.date_time for info in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}
        assert archive.read("model.xml") == (folder / "arm_bench.xml").read_bytes()
        for name in names[:-1]:
            assert archive.read(name) == (folder / name).read_bytes()
        assert {info.external_attr >> 16 for info in archive.infolist()} == {0o100644}


def test_missing_compressed_asset_is_recreated(store: Store) -> None:
    made = arm(store)
    first = emit_both_targets(made.request(store))
    kept = next(iter(path for path in first if path.endswith(".obj")))
    note = store.get_json("deflated", first[kept].sha256)  # type: ignore[union-attr]
    Path(store.path(note["sha256"])).unlink()
    with pytest.raises(BlobMissing):
        store.read(note["sha256"])
    assert emit_both_targets(made.request(store)) == first


def test_output_is_deterministic(store: Store, tmp_path: Path) -> None:
    """Two runs here, one with an empty store, and one in another process with another hash seed give equal bytes."""
    first = emit_both_targets(arm(store).request(store, *MODES))
    assert emit_both_targets(arm(store).request(store, *MODES)) == first
    other = Store(str(tmp_path / "other"))
    assert emit_both_targets(arm(other).request(other, *MODES)) == first
    program = (
        "import sys, pickle, hashlib; sys.path[:0] = sys.argv[2:]\n"
        "from thingc.targets.mjcf.emit import emit, emit_archives\n"
        "request = pickle.load(open(sys.argv[1], 'rb'))\n"
        "files = {**emit(request).files, **emit_archives(request).files}\n"
        "print(hashlib.sha256(repr(list(files.items())).encode()).hexdigest())\n"
    )
    third = Store(str(tmp_path / "third"))
    asked = tmp_path / "request.pickle"
    asked.write_bytes(pickle.dumps(arm(third).request(third, *MODES)))
    tests = str(Path(__file__).resolve().parent.parent)
    run = subprocess.run(
        [sys.executable, "-c", program, str(asked), tests, *sys.path[1:]],
        capture_output=True,
        text=True,
        timeout=120,
        env={"PYTHONHASHSEED": "7"},
        cwd=tmp_path,
    )
    assert run.stdout.strip() == hashlib.sha256(repr(list(first.items())).encode()).hexdigest(), run.stderr


def test_files_contain_no_absolute_paths(store: Store, tmp_path: Path) -> None:
    folder = write_build_folder(arm(store), store, tmp_path, *MODES)
    for path in folder.glob("*.xml"):
        assert str(tmp_path) not in path.read_text()
        assert "/somewhere" not in path.read_text()


def test_xml_layout_is_canonical(store: Store) -> None:
    """The order of sections is that of Menagerie, with two spaces, one element per line, no `-0` and no `1.0`."""
    made = arm(store)
    made.segments[1].pose = matrix((-0.0, 0.5, 2.0), spin((0, 0, 1), 0.0))
    text = emit(made.request(store)).files["mjcf/arm_bench.xml"].decode()  # type: ignore[union-attr]
    root = ElementTree.fromstring(text)
    assert [child.tag for child in root] == [
        "compiler",
        "option",
        "default",
        "custom",
        "asset",
        "worldbody",
        "contact",
        "actuator",
        "keyframe",
    ]
    assert text.splitlines()[:3] == [
        "<!-- Written by thingc from robots/arm.yaml, mode bench. -->",
        '<mujoco model="arm_bench">',
        '  <compiler angle="radian" meshdir="assets" autolimits="true"/>',
    ]
    assert '      <body name="bracket" pos="0 0.5 2">' in text
    for line in text.splitlines():
        assert line.count("<") <= 1 and (len(line) - len(line.lstrip())) % 2 == 0
        assert '"-0"' not in line and " -0 " not in line and ".0 " not in line


def test_scene_floor_is_renamed_on_a_name_clash(store: Store, tmp_path: Path) -> None:
    part = box_part(store, (0, 0, 0), (0.1, 0.1, 0.1))
    folder = write_build_folder(Made(segments=[Segment("floor", [Piece("floor", part)])]), store, tmp_path)
    scene = mujoco.MjModel.from_xml_path(str(folder / "scene_bench.xml"))
    assert scene.geom("scene:floor").type == mujoco.mjtGeom.mjGEOM_PLANE
    assert scene.geom("floor").type == mujoco.mjtGeom.mjGEOM_MESH


def test_scene_statistic_is_the_bounding_box(store: Store, tmp_path: Path) -> None:
    """`statistic` is the box around the robot. Raw attributes of the document override the scene."""
    part = box_part(store, (0, 0, 0), (0.2, 0.1, 0.4))
    made = Made(
        segments=[
            Segment("a", [Piece("a", part)], pose=matrix((1.0, 0, 0))),
            Segment(
                "b",
                [Piece("b", part, matrix((0, 0, 0.4)))],
                parent=0,
                joint="j",
                pose=matrix((0, 0, 0.1), spin((0, 0, 1), np.pi / 2)),
            ),
        ]
    )
    made.raw = (raw(101, "visual global azimuth", "33"),)
    scene = mujoco.MjModel.from_xml_path(str(write_build_folder(made, store, tmp_path) / "scene_bench.xml"))
    np.testing.assert_allclose(scene.stat.center, [1.05, 0.1, 0.45], atol=1e-12)
    np.testing.assert_allclose(scene.stat.extent, np.linalg.norm([0.3, 0.2, 0.9]), rtol=5e-3)
    assert scene.vis.global_.azimuth == 33.0


def test_robot_without_geometry_loads(store: Store, tmp_path: Path) -> None:
    folder = write_build_folder(Made(segments=[Segment("a", [])]), store, tmp_path, *MODES[:2])
    for mode, _ in MODES[:2]:
        assert mujoco.MjModel.from_xml_path(str(folder / f"scene_{mode}.xml")).nbody == 2


def test_materials_are_distinct_by_colour(store: Store) -> None:
    """Colours of a material, of a part without one, and with alpha. One material in two colours becomes two."""
    part = box_part(store, (0, 0, 0), (0.1, 0.1, 0.1))
    made = Made(
        segments=[
            Segment(
                "a",
                [
                    Piece("a", part, color="#ff0000", material=material()),
                    Piece("b", part, color="#00ff0080", material=material()),
                    Piece("c", part, color="#0000ff"),
                    Piece("d", part, material=material()),
                    Piece("e", part, color="#ff0000", material=material()),
                ],
            )
        ]
    )
    root = ElementTree.fromstring(emit(made.request(store)).files["mjcf/arm_bench.xml"])  # type: ignore[arg-type]
    assert [(m.get("name"), m.get("rgba")) for m in root.iter("material")] == [
        ("petg_ff0000", "1 0 0 1"),
        ("petg_00ff0080", f"0 1 0 {128 / 255!r}"),
        ("color_0000ff", "0 0 1 1"),
    ]
    assert [g.get("material") for g in root.iter("geom") if g.get("class") == "visual"] == [
        "petg_ff0000",
        "petg_00ff0080",
        "color_0000ff",
        None,
        "petg_ff0000",
    ]


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_numbers_round_trip_exactly(value: float) -> None:
    assert float(number(value)) == value
    assert number(value) != "-0" and not number(value).endswith(".0")


def test_numbers_have_a_short_format() -> None:
    assert [number(x) for x in (0.0, -0.0, 1.0, -3.0, 0.1, 1e22, 1e-9, 123456789.0)] == [
        "0",
        "0",
        "1",
        "-3",
        "0.1",
        "1e+22",
        "1e-09",
        "123456789",
    ]


@given(st.text(st.characters(min_codepoint=32, exclude_categories=("Cs",))))
def test_attributes_are_escaped(value: str) -> None:
    root = Element(tag="mujoco", attributes={"model": value})
    assert ElementTree.fromstring(write(root, "a -- b").text).get("model") == value


def test_line_breaks_in_attributes_keep_one_element_per_line() -> None:
    root = Element(tag="a", attributes={"b": "x\ny\tz"})
    text = write(root, "").text
    assert ElementTree.fromstring(text).get("b") == "x\ny\tz"
    assert len(text.splitlines()) == 2


def test_heading_is_a_valid_comment_for_any_file_name() -> None:
    text = write(Element(tag="a"), "Written from a---b--c.yaml, mode m.").text
    assert text.splitlines()[0] == "<!-- Written from a-b-c.yaml, mode m. -->"
    assert ElementTree.fromstring(text).tag == "a"


def test_lines_map_to_elements() -> None:
    root = Element(tag="a")
    first = root.add("b", {"name": "1"})
    second = first.add("c")
    third = root.add("d")
    made = write(root, "heading")
    for index, line in enumerate(made.text.splitlines(), start=1):
        for element in (root, first, second, third):
            if line.strip().startswith(f"<{element.tag}"):
                assert made.element_at(index) is element


def test_emitters_are_found_by_target_name() -> None:
    assert targets()[: len(TARGETS)] == tuple(TARGETS)
    assert emitter("stl") is stl.emit
    assert emitter("mjcf") is emit_with_modes
    with pytest.raises(KeyError):
        emitter("nothing")


def test_targets_of_installed_packages_are_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The entry points equal those that `importlib.metadata` finds in the same folder."""
    info = tmp_path / "other-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: other\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(
        "[console_scripts]\nx = y:z\n\n[thingc.emitters]\n# a comment\nsvg = other_svg:emit\nzed=other_svg:emit [extra]\n\n"
        "[last]\na = b:c\n"
    )
    (tmp_path / "other_svg.py").write_text("def emit(request):\n    return 'drawn'\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    from importlib.metadata import entry_points

    installed = sorted(e.name for e in entry_points(group="thingc.emitters"))
    assert {"svg", "zed"} <= set(installed)
    assert targets() == (*TARGETS, *installed)
    assert emitter("svg")(None) == "drawn"  # type: ignore[arg-type, comparison-overlap]
    assert emitter("zed")(None) == "drawn"  # type: ignore[arg-type, comparison-overlap]
