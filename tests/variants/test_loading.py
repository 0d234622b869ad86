"""Loading of batches as models: existing and missing variants. Each mesh is read once."""

from __future__ import annotations

import csv
import json
import pickle
import shutil
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import mujoco
import pytest

from thingc.batch import BatchResults, BuiltVariant, FamilyError, UnknownVariant, load
from thingc.batch.mesh_files import MeshFiles
from thingc.batch.mujoco_arrays.equality import different_fields
from thingc.modes import Modes
from variants.families import arrays, built


def table(folder: Path) -> list[dict[str, str]]:
    with (folder / "results.csv").open() as stream:
        return list(csv.DictReader(stream))


def test_results_equal_the_table(some: Path) -> None:
    family = load(some)
    rows = [row for row in table(some) if row["status"] == "built"]
    assert 0 < len(rows) < 12 and family.planned == 12 and family.finished and family.name == "some"
    assert len(family) == len(rows) and [variant.id for variant in family] == [row["id"] for row in rows]
    for variant, row in zip(family, rows, strict=True):
        assert (variant.index, variant.name) == (int(row["index"]), row["name"])
        assert variant.settings["length"] == float(row["parameters.length"]) and variant.settings["damped"] is True
        cells = {name: cell for name, cell in row.items() if cell != ""}
        assert set(variant.results) == set(cells)
        for name, cell in cells.items():
            found = variant.results[name]
            assert cell == ({True: "true", False: "false"}[found] if isinstance(found, bool) else str(found)), name
    assert [row["status"] for row in family.rows] == [row["status"] for row in table(some)]


def test_variants_are_found_by_index_id_and_name(some: Path) -> None:
    family = load(some)
    third = family[2]
    assert family[third.id] is third and family[third.name] is third and family[2 - len(family)] is third
    assert [one.id for one in family[1:3]] == [family[1].id, third.id]
    assert third in family and family.index(third) == 2
    with pytest.raises(IndexError, match="index 99 is out of range"):
        family[99]


def test_results_are_filtered_by_columns_or_a_function(some: Path) -> None:
    family = load(some)
    short = load(some, where={"parameters.length": 0.2, "mass": (2.0, 2.42)})
    wanted = [one.id for one in family if one.settings["length"] == 0.2 and one.results["mass"] <= 2.42]
    assert wanted and [one.id for one in short] == wanted
    ends = family.filter({"index": (2, 6)})  # both included
    assert [one.index for one in ends] == [2, 3, 5, 6]
    heavy = family.filter(lambda one: one.settings["bob"] > 0.25)
    assert 0 < len(heavy) < len(family) and all(one.settings["bob"] > 0.25 for one in heavy)
    assert family.column("mass") == [one.results["mass"] for one in family]
    with pytest.raises(UnknownVariant, match="has no column `mas`: did you mean `mass`"):
        load(some, where={"mas": 1.0})


def test_models_equal_those_of_the_files(some: Path) -> None:
    family = load(some, mode="flying")
    for variant in family:
        files = Path(variant.folder, "mjcf")
        assert arrays(variant.model()) == arrays(mujoco.MjModel.from_xml_path(str(files / "pendulum_flying.xml")))
        scene = variant.model("hanging", scene=True)
        assert arrays(scene) == arrays(mujoco.MjModel.from_xml_path(str(files / "scene_hanging.xml")))
        assert scene.geom("floor").id >= 0
    assert family[0].model().body("weight").mass[0] == family[0].settings["bob"]


def test_models_without_visual_geometry_move_alike(sliders: Path) -> None:
    for scene in (False, True):
        variant = load(sliders)[0]
        mode = "lying"
        whole, bare = variant.model(mode, scene=scene), variant.model(mode, scene=scene, visual=False)
        touching = [k for k in range(whole.ngeom) if whole.geom_contype[k] or whole.geom_conaffinity[k]]
        assert [whole.geom(k).name for k in touching] == [bare.geom(k).name for k in range(bare.ngeom)]
        assert bare.ngeom < whole.ngeom and bare.nmeshface < whole.nmeshface
        states = []
        for model in (whole, bare):
            data = mujoco.MjData(model)
            data.ctrl[:] = 0.3
            mujoco.mj_step(model, data, 500)
            states.append((data.qpos.tolist(), data.qvel.tolist(), data.ncon))
        assert states[0] == states[1]
        assert (states[0][2] > 0) == scene  # it lies on the floor


def test_sizes_equal_those_of_the_compiled_model(some: Path, boards: Path, sliders: Path, arms: Path) -> None:
    for variant in (variant for folder in (some, boards, sliders, arms) for variant in load(folder)):
        for mode in variant.family.mode_names:
            model, sizes = variant.model(mode), variant.sizes(mode)
            assert (sizes.nq, sizes.nv, sizes.nu) == (model.nq, model.nv, model.nu)


def test_linked_meshes_are_read_once(boards: Path) -> None:
    family = load(boards)
    sources = [variant.sources()[1] for variant in family]
    names = [name for name in sources[0] if "Round" in name]
    assert names
    for name in names:  # the same in all of them
        assert sources[0][name] is sources[1][name] is sources[2][name]
    sides = [variant.model().mesh_vert.max() for variant in family]
    assert sides == pytest.approx([0.02, 0.025, 0.03])
    read = {id(data) for one in sources for data in one.values()}
    assert len(read) == len(list((boards / "assets").iterdir())) < sum(len(one) for one in sources)


def test_meshes_in_memory_are_bounded(boards: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("thingc.batch.mesh_files.MESH_BYTES", 1)
    family = load(boards)
    for variant in family:
        assert variant.sources()[1] and variant.model().nmesh > 0
        assert len(family.meshes._contents) == len(list(Path(variant.folder, "mjcf", "assets").iterdir()))


def test_threads_share_meshes(boards: Path) -> None:
    """The first thread reads a mesh. The other threads wait for it, and get the same mesh."""
    together = threading.Barrier(8)
    read = len(list((boards / "assets").iterdir()))

    def look(family: BatchResults) -> list[dict[str, bytes]]:
        together.wait()
        return [variant.sources()[1] for variant in family]

    with ThreadPoolExecutor(8) as pool:
        for _ in range(50):
            found = [files for looked in pool.map(look, [load(boards)] * 8) for files in looked]
            assert len({id(data) for files in found for data in files.values()}) == read


def test_results_can_be_pickled(boards: Path) -> None:
    """Environments and process pools send variants to their workers, regardless of the variants that were loaded here."""
    family = load(boards)
    model = family[1].model(visual=False)
    copy = pickle.loads(pickle.dumps(family))
    assert [one.id for one in copy] == [one.id for one in family] and copy[1].family is copy
    assert arrays(copy[1].model(visual=False)) == arrays(model)
    assert len(pickle.dumps(family[1])) < 100_000  # no meshes


def test_modes_switch_between_the_models_of_a_variant(some: Path) -> None:
    variant = load(some)[1]
    robot = variant.modes()
    assert isinstance(robot, Modes) and tuple(robot) == ("hanging", "flying")
    hanging, flying = (mujoco.MjData(variant.model(mode)) for mode in ("hanging", "flying"))
    hanging.qpos[:] = 0.4, -0.2
    mujoco.mj_forward(hanging.model, hanging)
    robot.switch(("hanging", hanging), ("flying", flying))
    mujoco.mj_forward(flying.model, flying)
    assert flying.body("weight").xpos == pytest.approx(hanging.body("weight").xpos, abs=1e-12)


def test_missing_variants_are_errors(some: Path, tmp_path: Path, shared_store: str) -> None:
    family = load(some)
    out = next(row for row in family.rows if row["status"] == "kept_out")
    for wrong, words in (
        (lambda: family["some_99"], "has no variant `some_99`: did you mean"),
        (lambda: family[out["name"]], r"is not available: status `kept_out` \(rule `"),
        (lambda: family[0].model(), "has 2 modes \\(`hanging`, `flying`\\): select a mode with `mode="),
        (lambda: family[0].model("hangin"), "has no mode `hangin`: did you mean `hanging`"),
        (lambda: load(some, mode="sitting"), "has no mode `sitting`: known modes: `flying`, `hanging`"),
        (lambda: load(some, mode=5), "has no mode `5`"),
        (lambda: load(some, where=5), "expected `where` to be a mapping from columns to values, or a function of a variant, found `5`"),
        (lambda: family.filter({"mass": [2.0, 2.4]}), r"expected a value for the column `mass`, or a range `\(low, high\)`, found"),
        (lambda: family.filter({"mass": (2.4, 2.0)}), r"expected a range of the column `mass` to be two numbers `\(low, high\)`"),
        (lambda: family.filter({"name": (1, 2)}), r"expected a string for the column `name`, such as `some_"),
        (lambda: next(family.models(["some_01"], "flying")), "expected variants, found `some_01`"),
        (lambda: family[1.5], "has no variant `1.5`: use the index, the id or the name of a variant"),
        (lambda: load(some.parent), r"is not the folder of a batch \(batches inside: `some`\): run `thingc batch` to create a batch"),
        (lambda: load(tmp_path / "none"), "none` is not the folder of a batch: run `thingc batch` to create a batch"),
    ):
        with pytest.raises(FamilyError, match=words):
            wrong()
    bills = load(built(tmp_path, shared_store, "some", emit=("bom",)))
    with pytest.raises(FamilyError, match="the MuJoCo model `.*` does not exist"):
        bills[0].model("flying")


def test_unfinished_batch_can_be_loaded(some: Path, tmp_path: Path) -> None:
    here = tmp_path / "some"
    shutil.copytree(some, here)
    described = json.loads((here / "batch.json").read_text())
    (here / "batch.json").write_text(json.dumps({**described, "finished": False}))
    journal = (here / "journal.jsonl").read_text().splitlines(keepends=True)
    (here / "journal.jsonl").write_text("".join(journal[:7]) + journal[7][:20])
    for name in ("results.csv", "results.parquet"):
        (here / name).unlink()
    family = load(here)
    done = [json.loads(line) for line in journal[:7]]
    assert not family.finished and family.planned == 12 and len(family.rows) == 7
    assert {one.id for one in family} == {line["id"] for line in done if line["status"] == "built"}
    shutil.rmtree(family[0].folder)
    assert len(load(here)) == len(family) - 1


def test_loading_imports_few_modules(some: Path) -> None:
    program = (
        "import sys, thingc.batch as v; f = v.load(sys.argv[1]); n = len(f); print(n, f[0].sizes('flying').nq); "
        "print(sorted(m for m in ('numpy', 'mujoco', 'pyarrow', 'gymnasium', 'networkx', 'build123d') if m in sys.modules))"
    )
    said = subprocess.run([sys.executable, "-c", program, str(some)], capture_output=True, text=True, check=True).stdout
    assert said.splitlines()[1] == "[]" and said.splitlines()[0] == f"{len(load(some))} 9"


@pytest.mark.parametrize(("scene", "visual"), [(False, True), (True, False)])
def test_few_models_are_compiled_if_only_numbers_differ(
    sliders: Path, scene: bool, visual: bool, monkeypatch: pytest.MonkeyPatch,
) -> None:
    family = load(sliders)
    drawn = [family[k] for k in (3, 1, *range(8), *reversed(range(8)), 5, 3)]
    whole = [variant.model(scene=scene, visual=visual) for variant in drawn]
    compiled: list[str] = []
    plain = BuiltVariant._compile

    def counted(variant: BuiltVariant, *given: Any) -> Any:
        compiled.append(variant.id)
        return plain(variant, *given)

    monkeypatch.setattr(BuiltVariant, "_compile", counted)
    for share in (False, True):
        for model, other in zip(family.models(drawn, scene=scene, visual=visual, share=share), whole, strict=True):
            assert not different_fields(model, other)
    assert len(compiled) <= 7 < len(drawn)  # one whose arrays are written, and the 1st, 2nd, 4th, 8th, 16th ... which are compared
    alone = next(family.models(drawn[1:2], scene=scene, visual=visual))  # as episodes have them
    assert not different_fields(alone, whole[1])
    for lent in family.models(drawn, scene=scene, visual=visual, share=True):
        lent.opt.timestep = 0.5  # which is the borrower's own affair
    alone = next(family.models(drawn[1:2], scene=scene, visual=visual))
    assert not different_fields(alone, whole[1])


def test_models_with_other_structure_are_compiled(some: Path, boards: Path, arms: Path) -> None:
    for folder in (some, boards, arms):  # joints, meshes; and masses of bodies whose `diaginertia` the compiler takes for something else
        family = load(folder)
        for mode in family.mode_names:
            for _ in range(2):
                assert [arrays(one) for one in family.models(mode=mode)] == [arrays(variant.model(mode)) for variant in family]


def test_wrong_array_leads_to_compilation(sliders: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first model that is created without a compilation is compared with a compiled one."""
    from thingc.batch.mujoco_arrays import arrays as patched

    family = load(sliders)
    monkeypatch.setattr(patched.Statistics, "write", lambda self, values, index: None)
    assert [arrays(one) for one in family.models()] == [arrays(variant.model()) for variant in family]


def test_variants_with_equal_meshes_share_files_in_mujoco(tmp_path: Path) -> None:
    """Each variant has links to the meshes in a separate folder."""
    meshes, seen = MeshFiles(), []
    (tmp_path / "mesh.obj").write_bytes(b"v 0 0 0")
    for name in ("one", "other"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "mesh.obj").hardlink_to(tmp_path / "mesh.obj")
        stated = (tmp_path / name / "mesh.obj").stat()
        with meshes.mount({"mesh.obj": ((stated.st_dev, stated.st_ino), str(tmp_path / name / "mesh.obj"))}) as files:
            seen.append(files)
    assert seen[0] is seen[1]
