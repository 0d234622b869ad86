"""Packed batches: many variants in one file, compared with the same batch in folders, and with single builds."""

from __future__ import annotations

import base64
import json
import pickle
import shlex
import shutil
import signal
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pyarrow
import pyarrow.parquet
import pytest

from conformance.harness import thingc_here
from thingc.base.diagnostics import Code
from thingc.batch import BatchFault, FamilyError, UnknownVariant, batch, build_records, load, packed_layout, page, plan, run
from thingc.batch.build_records import find_variant, in_order
from thingc.batch.folder_layout import Journal
from thingc.batch.packed_layout import Chunk, PackedWriter, seal
from thingc.batch.page import show_again
from thingc.driver.environment import Options
from thingc.tools.cli.main import main
from variants.families import BOARDS, SOME, arrays
from variants.robots import InThisProcess, batch_here, environment, tree, with_emitter, workspace
from variants.test_batch import rows, without_run
from variants.test_faults import FAULTS, assert_gone, descendants, listed, started

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module", autouse=True)
def small() -> Iterator[None]:
    """Five variants per chunk and two per group, for batches that run in this process."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(packed_layout, "CHUNK", 5)
        patch.setattr(packed_layout, "GROUP", 2)
        yield


@pytest.fixture(scope="module")
def here(small: None, tmp_path_factory: pytest.TempPathFactory, shared_store: str) -> Path:
    """A workspace in which the batch `some` is built and packed."""
    folder = workspace(tmp_path_factory.mktemp("packed"), some=SOME, boards=BOARDS)
    summary = run(str(folder / "some.yaml"), options=Options(store=shared_store), executor=InThisProcess(), layout="packed")
    assert summary.layout == "packed" and summary.statuses == {"built": 8, "kept_out": 4}
    return folder


def sealed(folder: Path) -> dict[str, bytes]:
    """Return the files that do not depend on the run."""
    return {name: data for name, data in tree(folder / "chunks").items() if not name.endswith(".run.parquet")}


def test_packed_batch_has_few_files_and_the_same_table(here: Path, some: Path) -> None:
    out = here / "build" / "some"
    assert sorted(tree(out)) == sorted([
        *(f"chunks/{k:06d}{end}" for k in range(3) for end in (".parquet", ".run.parquet")), "batch.json", "index.html",
        "results.csv", "results.parquet", "shown.json",
    ])
    ours, theirs = without_run(rows(out)), without_run(rows(some))
    assert [row.pop("path") for row in ours] == [f"chunks/{k // 5:06d}.parquet" if row["path"] else "" for k, row in enumerate(theirs)]
    assert ours == [{name: cell for name, cell in row.items() if name != "path"} for row in theirs]
    table = pyarrow.parquet.read_table(out / "chunks" / "000001.parquet")  # what anybody can read
    assert table.column("index").to_pylist() == [5, 6, 7, 8, 9]
    built = next(k for k, status in enumerate(table.column("status").to_pylist()) if status == "built")
    id = table.column("id").to_pylist()[built]
    assert table.column("modes.json").to_pylist()[built] == (some / "variants" / id / "modes.json").read_bytes()


def test_results_of_a_packed_batch_equal_those_of_folders(here: Path, some: Path) -> None:
    ours, theirs = load(here / "build" / "some", mode="flying"), load(some, mode="flying")
    assert [one.id for one in ours] == [one.id for one in theirs] and len(ours.rows) == len(theirs.rows) == 12
    for one, other in zip(reversed(ours), reversed(theirs), strict=True):
        assert one.settings == other.settings and one.index == other.index and one.sizes() == other.sizes()
        assert one.results["mass"] == other.results["mass"] and one.results.keys() == other.results.keys()
        assert arrays(one.model(scene=True)) == arrays(other.model(scene=True)) and one.modes()["flying"].name == "flying"
    third = ours[2]
    assert ours[third.id] is third and ours[third.name] is third and third in ours[1:3]
    assert [one.id for one in ours.filter({"parameters.length": 0.2})] == [one.id for one in theirs.filter({"parameters.length": 0.2})]
    again = pickle.loads(pickle.dumps(ours[1:3]))
    assert [one.id for one in again] == [theirs[1].id, third.id] and again[1] == third
    found = find_variant(plan(str(here / "some.yaml")), third.id, str(here / "build" / "some"))
    assert found is not None and found[0].index == third.index
    out = next(row for row in ours.rows if row["status"] == "kept_out")
    kept_out = "is not available: status `kept_out`"
    for key, words in ((out["name"], kept_out), ("some_99", "did you mean"), ("0" * 12, "has no variant")):
        with pytest.raises(UnknownVariant, match=words):
            ours[key]


def test_unpacked_variant_equals_the_single_build(here: Path, boards: Path, shared_store: str) -> None:
    """The variants have parts: meshes are shared, and the names of files differ between variants."""
    env = environment(shared_store)
    done = batch_here("boards.yaml", "--layout", "packed", "--pictures", "2", "--jobs", "1", cwd=here, env=env)
    assert done.returncode == 0, done.stderr
    assert "to write the folder of one variant, run: thingc batch boards.yaml --unpack ID" in done.stderr
    out = here / "build" / "boards"
    assert len(tree(out / "pictures")) == 2 and not (out / "variants").exists()
    first, second, _ = rows(out)
    written = thingc_here("batch", "boards.yaml", "--unpack", second["id"], cwd=here, store=shared_store)
    assert written.out == f"build/boards/variants/{second['id']}\n", written.err
    assert thingc_here(*shlex.split(second["command"])[1:], "-o", "alone", cwd=here, store=shared_store).code == 0
    assert tree(out / "variants" / second["id"]) == tree(here / "alone" / "stand")
    family = load(out)
    assert [tree(Path(one.unpack())) for one in family] == [tree(boards / "variants" / one.id) for one in family]
    assert arrays(family[1].model()) != arrays(family[first["id"]].model()) == arrays(load(boards)[0].model())
    wrong = thingc_here("batch", "boards.yaml", "--unpack", "boards_7", cwd=here, store=shared_store)
    assert wrong.code == 2 and "has no variant `boards_7`: did you mean `boards_" in wrong.err
    options = Options(store=shared_store)
    # a finished batch is replaced
    again = run(str(here / "boards.yaml"), options=options, executor=InThisProcess(), limit=1, layout="folders")
    assert again.layout == "folders" and not (out / "chunks").exists() and len(list((out / "variants").iterdir())) == 1


def test_chunks_are_reproducible(here: Path, tmp_path: Path, shared_store: str) -> None:
    """The chunks do not depend on the order in which variants finish, nor on interruptions. Here, the batch stops after 7 of 12
    variants, within a chunk."""
    other = workspace(tmp_path, some=SOME)
    options = Options(store=shared_store)
    run(str(other / "some.yaml"), options=options, executor=InThisProcess(), layout="packed", limit=7)
    assert sorted(tree(other / "build/some/chunks"))[-1] == "000001.run.parquet"
    summary = run(str(other / "some.yaml"), options=options, executor=InThisProcess(), resume=True)
    assert summary.before == 7 and sealed(other / "build/some") == sealed(here / "build/some")
    before = {path: path.stat().st_mtime_ns for path in (other / "build/some").rglob("results.*")}
    assert run(str(other / "some.yaml"), options=options, executor=InThisProcess(), resume=True).before == 12
    assert {path: path.stat().st_mtime_ns for path in before} == before  # nothing is new: nothing is written


def journalled(folder: Path, number: int) -> None:
    """Convert a sealed chunk back to a journal, the last variant first, as before the chunk was complete."""
    chunk = Chunk(str(folder), number)
    with Journal(str(folder / f"chunks/{number:06d}.jsonl")) as journal:
        for index in reversed(chunk.indices):
            files = {path: base64.b64encode(data).decode() for path, data in chunk.files(index).items()}
            journal.append({**chunk.line(index), **({"files": files, "shared": chunk.asset_digests(index)} if files else {})})
    chunk.close()


def test_sealed_chunk_accepts_files_without_a_column(tmp_path: Path) -> None:
    (tmp_path / "chunks").mkdir()
    for index, files in enumerate(({}, {"files": {"modes.json": base64.b64encode(b"{}").decode()}, "shared": {}})):
        with PackedWriter(str(tmp_path), bytearray(2)) as writer:
            status = "built" if files else "failed"
            writer.append({"index": index, "id": f"{index:012x}", "name": f"one_{index}", "status": status, **files})
            writer.sync()
    chunk = Chunk(str(tmp_path), 0)
    assert [chunk.files(index) for index in chunk.indices] == [{}, {"modes.json": b"{}"}]


@pytest.mark.parametrize("sealed_before", [False, True], ids=["before the chunk is there", "before its journal is gone"])
def test_kill_during_sealing_loses_nothing(here: Path, tmp_path: Path, shared_store: str, *, sealed_before: bool) -> None:
    other = workspace(tmp_path, some=SOME)
    shutil.copytree(here / "build", other / "build")
    out = other / "build" / "some"
    expected = tree(out / "chunks")
    journalled(out, 1)
    (out / "chunks" / ".new-000001.parquet").write_bytes(b"half a chunk")
    if not sealed_before:
        (out / "chunks" / "000001.parquet").unlink()
    ours = load(out)
    assert [one.id for one in ours] == [one.id for one in load(here / "build" / "some")] and ours[4].sizes("flying").nq == 9
    assert list(in_order(str(out))) == list(in_order(str(here / "build" / "some")))
    count, some_lines = build_records.sample_records(str(out), 4)
    assert count == 12 and list(some_lines) == list(in_order(str(out)))[::3]
    summary = run(str(other / "some.yaml"), options=Options(store=shared_store), executor=InThisProcess(), resume=True)
    assert summary.before == 12 and tree(out / "chunks") == expected


def test_failed_variants_are_packed_after_a_later_build(tmp_path: Path, shared_store: str, monkeypatch: pytest.MonkeyPatch) -> None:
    here = workspace(tmp_path, faults=listed({1: "kill", 3: "raise", 6: "raise"}, 8))
    path = with_emitter(tmp_path)
    monkeypatch.setenv("PYTHONPATH", path)
    monkeypatch.syspath_prepend(path)
    options = Options(store=shared_store)
    assert run(str(here / "faults.yaml"), options=options, jobs=1, layout="packed").statuses == {"built": 5, "failed": 3}
    emitter = Path(path) / "faulty_target.py"
    emitter.write_text(emitter.read_text().replace('fault == "raise"', 'fault == "never"').replace('fault == "kill"', 'fault == "never"'))
    sys.modules.pop("faulty_target")
    monkeypatch.setattr(batch, "LocalExecutor", InThisProcess)
    assert run(str(here / "faults.yaml"), options=options, jobs=1, resume=True).statuses == {"built": 5, "failed": 3}
    times = []
    monkeypatch.setattr(packed_layout, "seal", lambda folder, number: (times.append(number), seal(folder, number)))
    done = run(str(here / "faults.yaml"), options=options, jobs=1, resume=True, retry=True)
    assert done.statuses == {"built": 8} and done.before == 5 and times == [0, 1]  # each chunk once
    assert load(here / "build/faults")[1].sizes("flying").nq == 9
    fresh = workspace(tmp_path / "fresh", faults=listed({1: "kill", 3: "raise", 6: "raise"}, 8))
    run(str(fresh / "faults.yaml"), options=options, jobs=1, layout="packed")
    sys.modules.pop("faulty_target")  # another test has another one
    assert sealed(fresh / "build/faults") == sealed(here / "build/faults")


def test_packed_batch_can_be_resumed_after_kills(tmp_path: Path, shared_store: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """SIGKILL and SIGTERM come at random moments. Every variant in a journal stays, and the chunk equals that of an undisturbed batch."""
    monkeypatch.setattr(packed_layout, "CHUNK", 24)  # as in the killed processes: one chunk
    monkeypatch.setattr(packed_layout, "GROUP", 64)
    env = environment(shared_store, with_emitter(tmp_path))
    places = [workspace(tmp_path / name, faults=FAULTS + "    layout: packed\n") for name in ("killed", "fresh")]
    assert batch_here("faults.yaml", "--pictures", "none", cwd=places[1], env=env).returncode == 0
    here, journal = places[0], places[0] / "build/faults/chunks/000000.jsonl"
    for number, count in ((signal.SIGKILL, 2), (signal.SIGTERM, 8)):
        process = started(here, env, "--jobs", "1", *(["--resume"] if journal.exists() else []))
        while process.poll() is None and (not journal.exists() or journal.read_bytes().count(b"\n") < count):
            time.sleep(0.001)
        running = descendants(process.pid)
        process.send_signal(number)
        process.communicate(timeout=60)
        assert_gone(running)
        with journal.open("a") as stream:
            stream.write('{"index": 2')  # a line that the kill has torn
    there = journal.read_bytes().count(b"\n")
    done = batch_here("faults.yaml", "--pictures", "none", "--resume", cwd=here, env=env)
    assert done.returncode == 0 and f"({there} of them in earlier runs): 24 built" in done.stderr and not journal.exists(), done.stderr
    assert sealed(here / "build/faults") == sealed(places[1] / "build/faults")


def test_resume_keeps_the_layout(here: Path, shared_store: str) -> None:
    with pytest.raises(BatchFault, match="started with different input: the layout is `packed`, not `folders`") as caught:
        run(str(here / "some.yaml"), options=Options(store=shared_store), resume=True, layout="folders")
    assert caught.value.diagnostic.code is Code.BATCH_CHANGED


def test_page_of_a_long_table_has_some_of_its_rows(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(page, "MOST", 4)
    out = here / "build" / "some"
    described = json.loads((out / "batch.json").read_text())
    written = Path(page.write_page(str(out), described, [])).read_text()
    told = json.loads(written.split('id="batch"')[1].split(">", 1)[1].split("</script>")[0])
    assert len(told["rows"]) == 4 and told["done"] == 12 and told["layout"] == "packed"


@pytest.mark.parametrize("name", ["000001.parquet", "000001.run.parquet"])
def test_damaged_chunk_is_reported_and_rebuilt_after_deletion(name: str, tmp_path: Path, shared_store: str) -> None:
    document = workspace(tmp_path, some=SOME) / "some.yaml"
    run(str(document), options=Options(store=shared_store), executor=InThisProcess(), layout="packed")
    out = tmp_path / "build" / "some"
    whole, file = sealed(out), out / "chunks" / name
    for damage in (b"", b"no table", file.read_bytes()[:-9]):
        file.write_bytes(damage)
        damaged = f"`.*{name}` is damaged: delete the file, and continue with --resume"
        with pytest.raises(OSError, match=damaged):
            load(out, mode="flying")
        with pytest.raises(BatchFault, match="is damaged") as caught:
            run(str(document), options=Options(store=shared_store), resume=True)
        assert caught.value.diagnostic.code is Code.BATCH_CHANGED
    file.unlink()
    gone = "no longer exists: continue with --resume"
    with pytest.raises(OSError, match=f"`.*{name}` {gone}"):
        load(out, mode="flying")
    for asked in (lambda: show_again(str(document)), lambda: find_variant(plan(str(document)), "some_00", str(out))):
        with pytest.raises(BatchFault, match="no longer exists"):
            asked()
    again = run(str(document), options=Options(store=shared_store), executor=InThisProcess(), resume=True)
    assert again.statuses == {"built": 8, "kept_out": 4}
    assert sealed(out) == whole
    shutil.rmtree(out / "chunks")
    with pytest.raises(OSError, match=f"`.*000000.run.parquet` {gone}"):
        load(out)


def test_missing_file_is_reported(here: Path, tmp_path: Path, shared_store: str) -> None:
    other = workspace(tmp_path, some=SOME)
    run(str(other / "some.yaml"), options=Options(store=shared_store), executor=InThisProcess(), layout="packed", emit=("bom",), limit=2)
    with pytest.raises(FamilyError, match="the MuJoCo model `.*` does not exist"):
        load(other / "build" / "some")[0].model("flying")


@pytest.mark.parametrize("way", ["shared", "shared path", "file", "file and folder", "id"])
def test_untrusted_chunk_cannot_leave_the_folder(
    here: Path, tmp_path: Path, shared_store: str, capsys: pytest.CaptureFixture[str], way: str,
) -> None:
    shutil.copytree(here, tmp_path / "copy")
    out = tmp_path / "copy" / "build" / "some"
    (tmp_path / "secret").write_text("mine")
    batch = build_records.BuildRecords(str(out))
    index, name = batch.built[0], batch.line(batch.built[0])["name"]
    file = out / "chunks" / f"{index // 5:06d}.parquet"
    table = pyarrow.parquet.read_table(file)
    shared = {"shared": {"mjcf/leak.txt": "../../../../secret"}, "shared path": {"../../../../stolen": "a" * 64}}.get(way)

    def put(name: str, change: Callable[[str], str]) -> pyarrow.Table:
        at = table.column_names.index(name)
        cells = [None if cell is None else change(cell) for cell in table[name].to_pylist()]
        return table.set_column(at, table.schema.field(at), pyarrow.array(cells, table.schema.field(at).type))

    if shared is not None:
        table = put("shared", lambda _: json.dumps(shared))
    elif way == "id":
        table = put("line", lambda line: json.dumps({**json.loads(line), "id": "../../../stolen"}))
    else:
        new = {"file": "../../../../stolen", "file and folder": "mjcf"}[way]
        table = table.rename_columns([new if name == "modes.json" else name for name in table.column_names])
    pyarrow.parquet.write_table(table.replace_schema_metadata(pyarrow.parquet.read_schema(file).metadata), file)
    before = tree(tmp_path)
    with pytest.raises(OSError, match=r"^(expected a hash of (64|12) hex digits|'.*' is )"):
        build_records.unpack(str(out), index)
    assert main(["batch", str(tmp_path / "copy" / "some.yaml"), "-o", str(out.parent), "--unpack", name]) == 2
    assert "[TC923]" in (said := capsys.readouterr().err) and "is damaged" in said
    assert tree(tmp_path) == before
