"""Complete batches: the folder, the table, the journal, and errors."""

from __future__ import annotations

import concurrent.futures
import csv
import json
import math
import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pyarrow.parquet
import pytest

from conformance.harness import thingc_here
from thingc.base.diagnostics import Code
from thingc.batch import BatchFault, Summary, plan, run
from thingc.batch.build_records import in_order
from thingc.batch.folder_layout import Journal, lines
from thingc.batch.job import job_of
from thingc.batch.plans.planner import Planner
from thingc.batch.plans.refusals import Refusals
from thingc.batch.runner import Runner
from thingc.batch.variant import Variant
from thingc.driver.environment import Options
from thingc.driver.session import Session
from thingc.tools.cli.main import main
from variants.robots import PENDULUM, SWEEP, InThisProcess, environment, thingc, tree, workspace

pytestmark = pytest.mark.slow

RUN_COLUMNS = ("parts_modelled", "parts_reused", "seconds")


def batch(folder: Path, store: str, document: str = "sweep", **options: Any) -> Summary:
    """Run a batch, by default without pictures. Runners are started only if a test sets `jobs`."""
    executor = None if "jobs" in options else InThisProcess()
    return run(str(folder / f"{document}.yaml"), options=Options(store=store), **{"executor": executor, "pictures": 0, **options})


def rows(folder: Path) -> list[dict[str, str]]:
    with (folder / "results.csv").open() as stream:
        return list(csv.DictReader(stream))


def spoken(cell: object) -> str:
    """Convert a cell of the Parquet table to the text in the CSV file."""
    if cell is None:
        return ""
    if isinstance(cell, bool):
        return "true" if cell else "false"
    return repr(cell) if isinstance(cell, float) else str(cell)


def without_run(found: list[dict[str, str]]) -> list[dict[str, str]]:
    return [{name: cell for name, cell in row.items() if name not in RUN_COLUMNS} for row in found]


@pytest.mark.parametrize("layout", ["folders", "packed"])
def test_plans_build_the_same_files_as_passes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, layout: str) -> None:
    """The numbers differ in each variant, a rule excludes one variant, and one variant is refused. No part is built."""
    here = workspace(tmp_path, sweep=SWEEP + "    keep: [reach <= 350 mm]\n")
    planned = plan(str(here / "sweep.yaml"))
    plain: dict[str, Any] = {"index": 0, "choices": {"components.stand.mass": "1 kg"}, "values": {}}
    tasks = [
        Variant(id=f"{k:012x}", name=f"{k}", parameters={"length": f"{length} mm", "bob": f"{100 + k} g"}, **plain)
        for k, length in enumerate((200, 250.5, 300.25, 0.5, 390.5, 311.7))
    ]
    found, compiled, whole = {}, [], Session.compile

    def spied(session: Session, *given: Any) -> Any:
        compiled.append(given)
        return whole(session, *given)

    monkeypatch.setattr(Session, "compile", spied)
    monkeypatch.setattr("thingc.batch.plans.build_templates.PATIENCE", 2)
    for verify in (1, 64):
        folder = tmp_path / f"{verify}"
        (folder / "variants").mkdir(parents=True)
        (folder / "assets").mkdir()
        job = job_of(planned, str(folder), Options(), layout=layout, verify=verify, elsewhere=False)
        with Runner(job) as runner:
            made = [runner.build(task) for task in tasks[:2]]
            compiled.clear()
            made += [runner.build(task) for task in tasks[2:]]
        found[verify] = [{name: value for name, value in row.items() if name != "seconds"} for row in made], tree(folder), len(compiled)
    assert [row["status"] for row in found[1][0]] == ["built", "built", "built", "refused", "kept_out", "built"]
    assert found[1][:2] == found[64][:2] and (found[1][2], found[64][2]) == (4, 1)


def test_each_variant_has_a_folder_and_a_row(tmp_path: Path, shared_store: str) -> None:
    here = workspace(tmp_path)
    summary = batch(here, shared_store, jobs=1)
    out = here / "build" / "sweep"
    assert summary.statuses == {"built": 12} and summary.modelled == 0 and Path(summary.folder) == out
    assert sorted(p.name for p in out.iterdir()) == [
        "assets", "batch.json", "index.html", "journal.jsonl", "results.csv", "results.parquet", "shown.json", "variants",
    ]
    table = rows(out)
    assert [row["index"] for row in table] == [str(k) for k in range(12)]
    assert {row["id"] for row in table} == {p.name for p in (out / "variants").iterdir()}
    for row in table:
        length, bob = float(row["parameters.length"]), float(row["parameters.bob"])
        assert float(row["mass"]) == pytest.approx(2.1 + bob, rel=1e-14)
        assert float(row["centre.y"]) == pytest.approx(-(0.1 * length / 2 + bob * length) / (2.1 + bob), rel=1e-12)
        assert float(row["reach"]) == pytest.approx(length, rel=1e-12)
        assert (out / row["path"] / "manifest.json").is_file()
        assert row["parameters.damped"] == "true" and row["parameters.label"] == "plain"
    assert list(table[0])[-3:] == list(RUN_COLUMNS)


def test_parquet_table_has_types_and_units(tmp_path: Path, shared_store: str) -> None:
    here = workspace(tmp_path)
    batch(here, shared_store)
    out = here / "build" / "sweep"
    table = pyarrow.parquet.read_table(out / "results.parquet")
    written = rows(out)
    assert table.column_names == list(written[0])
    for name in table.column_names:
        for cell, text in zip(table.column(name).to_pylist(), (row[name] for row in written), strict=True):
            assert text == spoken(cell), name
    units = {field.name: (field.metadata or {}).get(b"unit", b"").decode() for field in table.schema}
    assert units["parameters.length"] == "m" and units["mass"] == "kg" and units["inertia.xx"] == "kg*m^2" and units["status"] == ""
    assert units["parameters.effort"] == "kg*m^2/s^2" and units["torque_margin"] == ""
    described = json.loads((out / "batch.json").read_text())
    assert {one["name"]: one["unit"] for one in described["columns"]} == units


def test_table_does_not_depend_on_the_number_of_jobs(tmp_path: Path, shared_store: str) -> None:
    tables, trees = [], []
    for name, executor, jobs in (("a", InThisProcess(), 1), ("b", None, 2)):
        here = workspace(tmp_path / name)
        batch(here, shared_store, executor=executor, jobs=jobs)
        tables.append(without_run(rows(here / "build" / "sweep")))
        trees.append(tree(here / "build" / "sweep" / "variants"))
    assert tables[0] == tables[1] and trees[0] == trees[1]


def test_jobs_can_run_in_other_processes(tmp_path: Path, shared_store: str) -> None:
    """The arguments of an executor can be sent to another process."""
    here = workspace(tmp_path)
    with concurrent.futures.ProcessPoolExecutor(2) as executor:
        summary = batch(here, shared_store, executor=executor, jobs=2)
    assert summary.statuses == {"built": 12}
    assert [line["index"] for line in in_order(str(here / "build" / "sweep"))] == list(range(12))


PATHS = """
    thingc: variants/1
    assembly: pendulum.yaml
    name: paths
    parameters: {joints.swing.limit.upper: [90 deg, 60 deg], joints.twist.dynamics.damping: [0.2 N*m*s/rad]}
"""


def test_settings_by_path_are_columns_and_single_builds_agree(tmp_path: Path, shared_store: str) -> None:
    here = workspace(tmp_path, paths=PATHS)
    assert batch(here, shared_store, "paths", pictures=0).statuses == {"built": 2}
    table = rows(here / "build" / "paths")
    names = list(table[0])
    at = names.index("joints.swing.limit.upper")
    assert names[at - 1].startswith("parameters.") and names[at + 1: at + 3] == ["joints.twist.dynamics.damping", "mass"]
    assert [row["joints.swing.limit.upper"] for row in table] == [repr(math.pi / 2), repr(math.pi / 3)]
    described = json.loads((here / "build" / "paths" / "batch.json").read_text())
    units = {one["name"]: one["unit"] for one in described["columns"]}
    assert (units["joints.swing.limit.upper"], units["joints.twist.dynamics.damping"]) == ("rad", "kg*m^2/rad/s")
    words = shlex.split(table[1]["command"])[1:]
    assert "joints.swing.limit.upper=60 deg" in words
    assert thingc_here(*words, "-o", "alone", cwd=here, store=shared_store).err.startswith("Built alone/pendulum: ")
    assert tree(here / "alone" / "pendulum") == tree(here / "build" / "paths" / table[1]["path"])


CHOICES = """
    thingc: variants/1
    assembly: stand.yaml
    name: stands
    parameters: {side: [30 mm, 40 mm]}
    choices:
      components.mast.assembly: [mast.yaml, tall_mast.yaml]
      components.mast.components.upper.part: [plates:Round, plates:Square]
      components.plate.material: [light, heavy]
    emit: [mjcf, stl, bom]
"""


def test_variant_equals_the_single_build(
    tmp_path: Path, shared_store: str, monkeypatch: pytest.MonkeyPatch,
) -> None:
    here = workspace(tmp_path, stands=CHOICES)
    summary = batch(here, shared_store, "stands")
    assert summary.statuses == {"built": 16}
    out = here / "build" / "stands"
    monkeypatch.chdir(here)
    for row in rows(out)[::3]:  # each choice with each other
        words = shlex.split(row["command"])
        assert words[:3] == ["thingc", "build", "stand.yaml"]
        assert main([*words[1:], "-o", str(tmp_path / "single"), "--store", shared_store]) == 0
        assert tree(out / row["path"]) == tree(tmp_path / "single" / "stand"), row["name"]


def test_choices_change_the_robot(tmp_path: Path, shared_store: str) -> None:
    """The masses have closed forms: plates of 10 mm, square or round, at 500 or 5000 kg/m^3."""
    here = workspace(tmp_path, stands=CHOICES)
    batch(here, shared_store, "stands")
    square, disc = 0.04**2 * 0.01, 3.141592653589793 * 0.02**2 * 0.01
    found = set()
    for row in rows(here / "build" / "stands"):
        side = float(row["parameters.side"])
        tall = row["components.mast.assembly"] == "tall_mast.yaml"
        upper = square if row["components.mast.components.upper.part"] == "plates:Square" else disc
        plate = side**2 * 0.01 * (10.0 if row["components.plate.material"] == "heavy" else 1.0)
        assert float(row["mass"]) == pytest.approx(500.0 * (plate + square * (2 if tall else 1) + upper), rel=1e-9)
        found.add(row["mass"])
    assert len(found) == 16


def test_meshes_are_written_once(tmp_path: Path, shared_store: str) -> None:
    here = workspace(tmp_path, stands=CHOICES)
    batch(here, shared_store, "stands")
    out = here / "build" / "stands"
    kept = {p.name: p.stat().st_ino for p in (out / "assets").iterdir()}
    meshes = [p for p in (out / "variants").rglob("mjcf/assets/*") if p.is_file()]
    assert len(meshes) > 16 and {p.stat().st_ino for p in meshes} <= set(kept.values())
    import hashlib

    assert all(hashlib.sha256((out / "assets" / name).read_bytes()).hexdigest() == name for name in kept)


def test_parts_are_built_once(tmp_path: Path) -> None:
    here = workspace(tmp_path, stands=CHOICES, heavier=CHOICES.replace("[30 mm, 40 mm]", "30 mm").replace("name: stands", "name: heavier"))
    first = batch(here, str(tmp_path / "store"), "stands")
    assert first.modelled == 3  # two squares and a disc
    again = batch(here, str(tmp_path / "store"), "heavier")
    assert again.modelled == 0 and again.statuses == {"built": 8}


RULES = """
    thingc: variants/1
    assembly: pendulum.yaml
    name: rules
    parameters:
      length: [200 mm, 400 mm]
      bob: [1 g, 100 g, 15 kg]
      effort: [6 N*m, 0.1 N*m]
    keep: ["mass < 3 kg", "torque_margin > 1.3", "bob > 10 g", "centre.y > -0.5 m"]
"""


def test_excluded_variants_have_no_files(tmp_path: Path, shared_store: str) -> None:
    here = workspace(tmp_path, rules=RULES)
    summary = batch(here, shared_store, "rules")
    out = here / "build" / "rules"
    for row in rows(out):
        bob, length, effort = (float(row[f"parameters.{name}"]) for name in ("bob", "length", "effort"))
        torque = 9.81 * 0.3420201433256687 * length * (bob + 0.05)
        rule = "bob > 10 g" if bob < 0.01 else "mass < 3 kg" if bob > 1 else "torque_margin > 1.3" if effort / torque <= 1.3 else ""
        assert (row["status"], row["rule"]) == ("kept_out" if rule else "built", rule)
        assert (row["mass"] == "") == (rule == "bob > 10 g")  # decided before anything was compiled
        assert (out / "variants" / row["id"]).exists() == (not rule) == (row["path"] != "")
    assert summary.statuses == {"built": 2, "kept_out": 10}


REFUSED = """
    thingc: variants/1
    assembly: refused.yaml
    name: some
    parameters: {upper: [10 deg, 40 deg]}
    list: [{name: named, parameters: {upper: 50 deg}}]
"""


def test_error_in_a_variant_does_not_stop_the_batch(tmp_path: Path, shared_store: str) -> None:
    """In the pose of 20 degrees, a joint with the limit 10 degrees is an error of one variant."""
    from variants.robots import PENDULUM

    here = workspace(
        tmp_path, some=REFUSED,
        refused=PENDULUM.replace("tilt: 20 deg", "tilt: 20 deg\n      upper: 90 deg")
        .replace("upper: 90 deg}\n        drive", "upper: =upper}\n        drive"),
    )
    done = thingc_here("batch", "some.yaml", "--jobs", "1", "--pictures", "none", cwd=here, store=shared_store)
    table = rows(here / "build" / "some")
    assert [(row["name"], row["status"], row["code"]) for row in table] == [
        ("named", "built", ""), ("some_1", "refused", Code.POSE_LIMITS.code), ("some_2", "built", ""),
    ]
    assert done.code == 1 and "1 refused" in done.err and Code.POSE_LIMITS.code in done.err
    assert table[1]["message"] and table[1]["path"] == ""


def test_output_of_parts_is_in_the_journal(tmp_path: Path) -> None:
    """The output appears once, in the line of the variant for which the part was built."""
    here = workspace(
        tmp_path, prints="""
        thingc: variants/1
        assembly: talker.yaml
        name: prints
        parameters: {weight: [1 kg, 2 kg]}
        """,
        talker="""
        thingc: assembly/1
        name: talker
        parameters: {weight: 1 kg}
        components:
          it: {part: talking:Talks, mass: =weight}
        """,
    )
    (here / "parts" / "talking.py").write_text(
        "from build123d import Box\nfrom thingc import Thing\nclass Talks(Thing):\n    def result(self):\n"
        "        print('hello')\n        return Box(10, 10, 10)\n"
    )
    assert batch(here, str(tmp_path / "store"), "prints", pictures=0).statuses == {"built": 2}
    journal = (here / "build" / "prints" / "journal.jsonl").read_text().splitlines()
    assert [line["printed"] for line in map(json.loads, journal) if "printed" in line] == [{"talking:Talks": ["hello"]}]


def test_errors_of_variants_have_the_units_of_the_documents(tmp_path: Path, shared_store: str) -> None:
    here = workspace(tmp_path, limits="""
        thingc: variants/1
        assembly: pendulum.yaml
        name: limits
        parameters:
          joints.swing.limit.lower: [-90 deg, 80 deg]
          joints.swing.limit.upper: [60 deg, 97.4 deg]
    """)
    assert batch(here, shared_store, "limits").statuses == {"built": 2, "refused": 2}
    refused = rows(here / "build" / "limits")[2]
    assert (refused["code"], refused["message"]) == (
        "TC809", "expected lower < upper in the limits of joint `swing`, found `80 deg` and `60 deg`",
    )
    assert refused["command"] == (
        "thingc build pendulum.yaml --set 'joints.swing.limit.lower=80 deg' --set 'joints.swing.limit.upper=60 deg' --emit mjcf"
    )


def test_export_losses_are_counted(tmp_path: Path, shared_store: str) -> None:
    """The numbers are in the table and at the end of the output, also for variants that an earlier run has built."""
    here = workspace(tmp_path, fast="""
        thingc: variants/1
        assembly: pendulum.yaml
        name: fast
        emit: [mjcf, bom]
        parameters:
          joints.swing.limit.velocity: [2 rad/s, 3 rad/s]
    """)
    first = batch(here, shared_store, "fast", pictures=0, limit=1)
    assert (first.lossy, first.losses) == (1, {"carried as custom data": 1})
    done = thingc_here("batch", "fast.yaml", "--resume", "--pictures", "none", "--jobs", "1", cwd=here, store=shared_store)
    said = "2 variants with 2 export losses (2 carried as custom data): see the column `losses`\n"
    assert done.code == 0 and said in done.err
    table = rows(here / "build" / "fast")
    assert [(row["status"], row["losses"]) for row in table] == [("built", "1"), ("built", "1")]
    assert list(table[0])[-6:] == ["losses", "path", "command", *RUN_COLUMNS]


# --- folders ---------------------------------------------------------------------------------------------------------


def test_resume_builds_only_missing_variants(tmp_path: Path, shared_store: str) -> None:
    here = workspace(tmp_path)
    out = here / "build" / "sweep"
    assert batch(here, shared_store, limit=5).count == 5
    stamps = {p.name: p.stat().st_mtime_ns for p in (out / "variants").iterdir()}
    victim = sorted(stamps)[0]
    for path in sorted((out / "variants" / victim).rglob("*"), reverse=True):
        path.unlink() if path.is_file() else path.rmdir()
    (out / "variants" / victim).rmdir()
    summary = batch(here, shared_store, resume=True)
    assert (summary.count, summary.before, summary.statuses) == (12, 4, {"built": 12})
    now = {p.name: p.stat().st_mtime_ns for p in (out / "variants").iterdir()}
    assert all(now[name] == when for name, when in stamps.items() if name != victim) and now[victim] != stamps[victim]
    fresh = workspace(tmp_path / "fresh")
    batch(fresh, shared_store)
    assert without_run(rows(out)) == without_run(rows(fresh / "build" / "sweep"))


def test_finished_batch_is_replaced(tmp_path: Path, shared_store: str) -> None:
    here = workspace(tmp_path)
    batch(here, shared_store)
    text = (here / "sweep.yaml").read_text()
    (here / "sweep.yaml").write_text(text.replace("[200 mm, 300 mm, 400 mm]", "[250 mm]"))
    out = here / "build" / "sweep"
    left = out / ".old-4711-0123abcd" / "variants" / "0123456789ab"  # by a batch that was killed while it deleted
    left.mkdir(parents=True)
    (left / "robot.xml").write_text("<mujoco/>")
    assert batch(here, shared_store).statuses == {"built": 4}
    assert len(list((out / "variants").iterdir())) == 4
    assert sorted(p.name for p in out.iterdir()) == [
        "assets", "batch.json", "index.html", "journal.jsonl", "results.csv", "results.parquet", "shown.json", "variants",
    ]


@pytest.mark.parametrize("place", [".old-notes", "notes.txt", "variants/notes.txt", "variants/ID/notes.txt", "assets/notes.txt"])
def test_folder_with_unexpected_files_is_not_changed(tmp_path: Path, shared_store: str, place: str) -> None:
    here = workspace(tmp_path)
    summary = batch(here, shared_store)
    some = next((Path(summary.folder) / "variants").iterdir()).name
    stranger = Path(summary.folder) / place.replace("ID", some)
    stranger.write_text("mine")
    before = tree(Path(summary.folder))
    with pytest.raises(BatchFault) as fault:
        batch(here, shared_store)
    assert fault.value.diagnostic.code is Code.UNEXPECTED and place.replace("ID", some) in fault.value.diagnostic.message
    assert tree(Path(summary.folder)) == before


@pytest.mark.skipif(os.geteuid() == 0, reason="nothing is unreadable to root")
def test_unreadable_folder_is_not_changed(tmp_path: Path, shared_store: str) -> None:
    here = workspace(tmp_path)
    inner = Path(batch(here, shared_store).folder) / "assets"
    inner.chmod(0)
    try:
        with pytest.raises(BatchFault, match="assets"):
            batch(here, shared_store)
    finally:
        inner.chmod(0o700)
    assert any(inner.iterdir())


def test_folder_of_another_document_is_not_changed(tmp_path: Path, shared_store: str) -> None:
    here = workspace(tmp_path)
    batch(here, shared_store)
    (here / "other.yaml").write_text((here / "sweep.yaml").read_text())
    with pytest.raises(BatchFault) as fault:
        batch(here, shared_store, "other")
    assert fault.value.diagnostic.code is Code.UNEXPECTED
    (here / "build" / "robot").mkdir()
    (here / "build" / "robot" / "model.xml").write_text("<mujoco/>")
    (here / "sweep.yaml").write_text((here / "sweep.yaml").read_text().replace("name: sweep", "name: robot"))
    with pytest.raises(BatchFault) as fault:
        batch(here, shared_store)
    assert fault.value.diagnostic.code is Code.UNEXPECTED and (here / "build" / "robot" / "model.xml").exists()


@pytest.mark.parametrize(("change", "words"), [
    (("sweep.yaml", "400 mm", "500 mm"), "settings"), (("pendulum.yaml", "mass: 2 kg", "mass: 3 kg"), "`pendulum.yaml` changed"),
    (("sweep.yaml", "name: sweep", "name: sweep\nemit: [mjcf, bom]"), "targets"),
])
def test_resume_rejects_another_batch(tmp_path: Path, shared_store: str, change: tuple[str, str, str], words: str) -> None:
    here = workspace(tmp_path)
    batch(here, shared_store, limit=3)
    before = tree(here / "build")
    file, old, new = change
    (here / file).write_text((here / file).read_text().replace(old, new))
    with pytest.raises(BatchFault) as fault:
        batch(here, shared_store, resume=True)
    assert fault.value.diagnostic.code is Code.BATCH_CHANGED and words in fault.value.diagnostic.message
    assert tree(here / "build") == before


def test_resume_accepts_equal_settings_in_other_notation(tmp_path: Path, shared_store: str) -> None:
    here = workspace(tmp_path)
    batch(here, shared_store, limit=3)
    text = (here / "sweep.yaml").read_text()
    (here / "sweep.yaml").write_text("# now in metres\n" + text.replace("[200 mm, 300 mm, 400 mm]", "[0.2 m, 30 cm, 0.4 m]"))
    assert batch(here, shared_store, resume=True).before == 3


def test_resume_ignores_other_builds_in_the_workspace(tmp_path: Path, shared_store: str) -> None:
    """The other build has parts, and the batch has none."""
    here = workspace(tmp_path, stands="thingc: variants/1\nassembly: stand.yaml\nname: stands\nparameters: {side: [30 mm, 40 mm]}\n")
    batch(here, shared_store, limit=3)
    batch(here, shared_store, "stands")
    assert batch(here, shared_store, resume=True).before == 3


@pytest.mark.parametrize(("given", "words"), [
    ({"limit": 0}, "expected `limit` to be a whole number of at least 1, found `0`"),
    ({"jobs": -1}, "expected `jobs` to be a whole number of at least 0, found `-1`"),
    ({"timeout": float("nan")}, "expected `timeout` to be a number of seconds, at most 1000000, found `nan`"),
    ({"timeout": 1e10}, "expected `timeout` to be a number of seconds, at most 1000000, found `10000000000.0`"),
    ({"verify": "all"}, "expected `verify` to be a whole number of at least 0, found `all`"),
    ({"pictures": "all"}, "expected `pictures` to be a whole number of at least 0, found `all`"),
    ({"layout": "zipped"}, "unknown layout `zipped`: use `folders`, `packed`"),
    ({"emit": ["mjcg"]}, "there is no target `mjcg`: did you mean `mjcf`"),
    ({"executor": 5}, "expected `executor` to be an executor of `concurrent.futures`, found `5`"),
])
def test_invalid_requests_are_reported_before_the_batch(given: dict[str, Any], words: str, tmp_path: Path) -> None:
    here = workspace(tmp_path)
    with pytest.raises(BatchFault, match=words) as caught:
        run(str(here / "sweep.yaml"), **given)
    assert caught.value.diagnostic.code is Code.COMMAND_LINE and not (here / "build").exists()


def test_resume_needs_a_batch(tmp_path: Path, shared_store: str) -> None:
    here = workspace(tmp_path)
    with pytest.raises(BatchFault) as fault:
        batch(here, shared_store, resume=True)
    assert fault.value.diagnostic.code is Code.NO_BATCH


# --- the command -----------------------------------------------------------------------------------------------------


def test_dry_run_writes_nothing(tmp_path: Path, shared_store: str) -> None:
    here = workspace(tmp_path, stands=CHOICES, rules=RULES)
    store = str(tmp_path / "store")
    told = thingc_here("batch", "stands.yaml", "--dry-run", "--format", "json", cwd=here, store=store).answer
    assert (told["count"], told["of"], told["parts"], told["modelled"], told["reused"]) == (16, 16, 3, 3, 0)
    assert len(told["first"]) == 5 and told["failing"] == {} and told["diagnostics"] == []
    assert not (here / "build").exists()
    batch(here, store, "stands")
    told = thingc_here("batch", "stands.yaml", "--dry-run", "--format", "json", cwd=here, store=store).answer
    assert (told["modelled"], told["reused"]) == (0, 3)
    told = thingc_here("batch", "rules.yaml", "--dry-run", "--format", "json", cwd=here, store=store).answer
    assert told["failing"] == {"bob > 10 g": 4}


def test_allowed_warnings_of_the_document_are_suppressed(tmp_path: Path, shared_store: str) -> None:
    shutil.copytree(Path(__file__).resolve().parents[2] / "gallery" / "wrist", tmp_path / "wrist")
    (tmp_path / "wrist" / "loads.yaml").write_text("thingc: variants/1\nname: loads\nassembly: wrist.yaml\nlist: [{name: light}]\n")
    told = thingc_here("batch", "loads.yaml", "--dry-run", "--format", "json", cwd=tmp_path / "wrist", store=shared_store).answer
    assert told["diagnostics"] == []


@pytest.mark.parametrize("name", ["results.csv", "results.parquet", "index.html"])
def test_edited_table_or_page_is_not_overwritten(tmp_path: Path, shared_store: str, name: str) -> None:
    here = workspace(tmp_path, few="thingc: variants/1\nassembly: pendulum.yaml\nname: few\nparameters: {length: [200 mm, 300 mm]}\n")
    folder = Path(batch(here, shared_store, "few", pictures=0).folder)
    before = (folder / name).read_bytes()
    (folder / name).write_bytes(before + b"mine")
    with pytest.raises(BatchFault) as fault:
        batch(here, shared_store, "few", pictures=0)
    said = fault.value.diagnostic
    assert said.code is Code.UNEXPECTED and said.message.endswith(f"contains unknown or modified files (`{name}`)")
    assert (folder / name).read_bytes() == before + b"mine"
    (folder / name).write_bytes(before)
    assert batch(here, shared_store, "few", pictures=0).statuses == {"built": 2}


STOPS = """
    thingc: variants/1
    assembly: {of}.yaml
    name: stops
    parameters:
      joints.swing.limit.upper: [90 deg, 10 deg, -5 deg]
      joints.twist.limit.lower: [-90 deg, 1 deg]
      steps: [3, 4, 5]
    keep: [steps < 5]
"""


def test_dry_run_counts_refused_variants(tmp_path: Path, shared_store: str) -> None:
    """The counts equal those of the batch for a robot of frames, and for a robot whose frames are parts that are not built yet."""
    parts = PENDULUM.replace("weight:\n        frame: true", "weight:\n        part: plates:Square")
    assert parts.count("plates:Square") == 1
    here = workspace(tmp_path, plated=parts, stops=STOPS.format(of="pendulum"), plates=STOPS.format(of="plated"))
    store = str(tmp_path / "store")
    for document in ("stops", "plates"):
        told = thingc_here("batch", f"{document}.yaml", "--dry-run", "--format", "json", cwd=here, store=store).answer
        # the pose puts `swing` at 20 deg and leaves `twist` at 0: one of three and one of two of the values let it
        assert (told["count"], told["failing"], told["looked_at"], told["unsound"]) == (18, {"steps < 5": 6}, 12, {"TC601": 10})
    assert batch(here, shared_store, "stops", pictures=0).statuses == {"built": 2, "kept_out": 6, "refused": 10}
    said = thingc_here("batch", "plates.yaml", "--dry-run", cwd=here, store=store).out
    assert "\n10 would be rejected: TC601 (pose outside joint limits), first `stops_03`: the value of `twist` in pose `tilted` (0 " in said
    assert "models 1 part," in said and "drawn from" not in said


def test_large_dry_run_samples_variants(tmp_path: Path, shared_store: str, monkeypatch: pytest.MonkeyPatch) -> None:
    from thingc.batch import dry_run, plan

    monkeypatch.setattr(dry_run, "MOST", 5)
    monkeypatch.setattr(Planner, "find_plan", lambda *_: None)
    monkeypatch.setattr(Refusals, "problems", lambda *_: None)
    here = workspace(tmp_path, stops=STOPS.format(of="pendulum"))
    options = Options(store=shared_store)
    found = dry_run.forecast(plan(str(here / "stops.yaml"), options=options), options)
    assert found.count == 18 and found.failing == {"steps < 5": 6} and found.left == 12  # those are counted of all
    assert 0 < found.looked_at <= 5 and 0 < found.unsound["TC601"] <= found.looked_at
    again = dry_run.forecast(plan(str(here / "stops.yaml"), options=options), options)
    assert (again.looked_at, again.unsound) == (found.looked_at, found.unsound)


def test_large_dry_run_uses_plans(tmp_path: Path, shared_store: str, monkeypatch: pytest.MonkeyPatch) -> None:
    from thingc.batch import dry_run, plan

    many = STOPS.format(of="pendulum").replace("[90 deg, 10 deg, -5 deg]", "{from: 90 deg, to: -5 deg, count: 12}")
    here = workspace(tmp_path, stops=many.replace("[-90 deg, 1 deg]", "{from: -90 deg, to: 10 deg, count: 10}"))
    planned, options = plan(str(here / "stops.yaml"), options=Options(store=shared_store)), Options(store=shared_store)
    resolved: list[object] = []
    passes = dry_run.Resolving.passes
    monkeypatch.setattr(dry_run.Resolving, "passes", lambda *given: resolved.append(given) or passes(*given))
    monkeypatch.setattr(dry_run, "MOST", 100)
    found = dry_run.forecast(planned, options)
    assert (found.count, found.left, found.looked_at) == (360, 240, 240) and len(resolved) < 180
    monkeypatch.setattr(dry_run, "MOST", 300)
    monkeypatch.setattr(Planner, "find_plan", lambda *_: None)
    monkeypatch.setattr(Refusals, "problems", lambda *_: None)
    resolved.clear()
    alone = dry_run.forecast(planned, options)
    assert len(resolved) >= 240 and (alone.unsound, alone.examples) == (found.unsound, found.examples) and 0 < alone.unsound["TC601"] < 240


def test_output_of_the_command(tmp_path: Path, shared_store: str) -> None:
    here = workspace(tmp_path)
    done = thingc("batch", "sweep.yaml", "--jobs", "1", cwd=here, env=environment(shared_store))
    assert (done.returncode, done.stdout) == (0, "")
    assert done.stderr == "build/sweep: 12 variants: 12 built; 0 parts modelled\n"
    words = ("--format", "json", "-o", "elsewhere", "--limit", "2", "--jobs", "1", "--pictures", "none")
    answer = thingc_here("batch", "sweep.yaml", *words, cwd=here, store=shared_store).answer
    assert answer["statuses"] == {"built": 2} and answer["folder"] == "elsewhere/sweep" and answer["diagnostics"] == []


# --- the journal -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("torn", [0, 1, 9, 20])
def test_incomplete_last_line_is_removed(tmp_path: Path, torn: int) -> None:
    path = tmp_path / "journal.jsonl"
    with Journal(str(path)) as journal:
        for k in range(3):
            journal.append({"index": k, "id": "x" * 12})
    whole = path.read_bytes()
    path.write_bytes(whole + b'{"index": 3, "id": "yyyy"'[:torn])
    assert [line["index"] for _, line in lines(path.read_bytes().splitlines(keepends=True))] == [0, 1, 2]
    with Journal(str(path)) as journal:
        journal.append({"index": 3, "id": "z"})
    assert [line["index"] for _, line in lines(path.read_bytes().splitlines(keepends=True))] == [0, 1, 2, 3]
    assert path.read_bytes().startswith(whole)


def test_later_line_of_a_variant_is_used(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    with Journal(str(path)) as journal:
        for index, status in ((2, "built"), (0, "failed"), (2, "refused"), (5, "built")):
            journal.append({"index": index, "status": status})
    assert [(line["index"], line["status"]) for line in in_order(str(tmp_path))] == [(0, "failed"), (2, "refused"), (5, "built")]


# --- memory ----------------------------------------------------------------------------------------------------------

MANY = """
    thingc: variants/1
    assembly: pendulum.yaml
    name: many
    parameters:
      length: {from: 100 mm, to: 900 mm, count: COUNT}
      bob: [100 g, 200 g, 300 g, 400 g, 500 g, 600 g, 700 g, 800 g, 900 g, 1 kg]
    keep: ["length < 100.01 mm", "bob < 150 g"]
"""

PEAKS = """
import sys
from thingc.batch import run
for document in sys.argv[1:]:
    summary = run(document)
    with open("/proc/self/status") as stream:  # ru_maxrss would count what pytest held before the exec
        peak = next(int(line.split()[1]) for line in stream if line.startswith("VmHWM:"))
    print(summary.count, summary.statuses["built"], peak)
assert "pandas" not in sys.modules  # which takes longer to import than a dozen variants
"""


def test_memory_of_the_driver_does_not_grow(tmp_path: Path, shared_store: str) -> None:
    """The second batch has five times as many variants, and both have several chunks. The plan excludes all variants but one, so the
    driver does the work. Without stored rows, the peak grows by 5 to 10 MB. 10 000 stored rows would add more than 10 MB to that."""
    for name, count in (("few", "250"), ("many", "1250")):
        here = workspace(tmp_path, **{name: MANY.replace("COUNT", count).replace("name: many", f"name: {name}")})
    words = [sys.executable, "-c", PEAKS, "few.yaml", "many.yaml"]
    done = subprocess.run(words, cwd=here, env=environment(shared_store), capture_output=True, text=True, timeout=300)
    (few, one, before), (many, other, after) = (map(int, line.split()) for line in done.stdout.splitlines())
    assert (few, one, many, other) == (2500, 1, 12_500, 1), done.stderr
    assert after - before < 12_000, f"{before} and {after} kB for 2 500 and 12 500 variants"


@pytest.mark.parametrize(("words", "first", "second"), [
    (("--dry-run", "--resume"), "--dry-run", "--resume"), (("--resume", "--page-only"), "--page-only", "--resume"),
    (("--page-only", "--dry-run"), "--dry-run", "--page-only"),
])
def test_incompatible_options(tmp_path: Path, words: tuple[str, ...], first: str, second: str) -> None:
    here = workspace(tmp_path)
    done = thingc_here("batch", "sweep.yaml", *words, cwd=here, store=tmp_path / "store")
    assert done.code == 2 and f"{first} cannot be combined with {second}" in done.err
    assert not (here / "build").exists()
