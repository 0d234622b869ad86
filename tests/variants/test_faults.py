"""Batches with faults: runners that end, hang or raise, interrupts, a killed driver, and a full disk. Processes and signals are real. A
target (`robots.EMITTER`), installed as an entry point of a package, causes the fault that the parameter `fault` of a variant selects."""

from __future__ import annotations

import csv
import json
import os
import resource
import signal
import subprocess
import sys
import textwrap
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import psutil
import pytest

from conformance.harness import thingc_here
from thingc.base.diagnostics import Code
from thingc.batch import BatchFault, run
from thingc.driver.environment import Options
from variants.robots import InThisProcess, batch_here, environment, thingc, tree, with_emitter, workspace

pytestmark = pytest.mark.slow

FAULTS = """
    thingc: variants/1
    assembly: pendulum.yaml
    name: faults
    parameters: {length: {from: 200 mm, to: 430 mm, count: 24}}
    emit: [mjcf, faulty]
"""


ALONE = ("--pictures", "none", "--jobs", "1")
"""A single runner, for tests that do not depend on runners. A runner takes longer to start than these variants take to build."""


def listed(faults: dict[int, str], count: int = 24) -> str:
    """Return a document of several variants, of which some have a fault."""
    entries = "".join(
        f"      - {{parameters: {{length: {200 + 10 * k} mm, fault: {faults.get(k, 'none')}}}}}\n" for k in range(count)
    )
    return f"""
    thingc: variants/1
    assembly: pendulum.yaml
    name: faults
    emit: [mjcf, faulty]
    list:
{entries}"""


def table(folder: Path) -> list[dict[str, str]]:
    with (folder / "build" / "faults" / "results.csv").open() as stream:
        return list(csv.DictReader(stream))


def journal(folder: Path) -> list[dict[str, object]]:
    return [json.loads(line) for line in (folder / "build" / "faults" / "journal.jsonl").read_text().splitlines()]


def started(folder: Path, env: dict[str, str], *more: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "thingc", "batch", "faults.yaml", "--pictures", "none", *more], cwd=folder, env=env, stdout=subprocess.PIPE,
        stderr=subprocess.PIPE, text=True, start_new_session=True,
    )


def wait_for_lines(folder: Path, count: int, process: subprocess.Popen[str]) -> None:
    """Wait until the journal contains this number of variants."""
    path = folder / "build" / "faults" / "journal.jsonl"
    deadline = time.monotonic() + 120.0
    while time.monotonic() < deadline:
        if path.exists() and path.read_bytes().count(b"\n") >= count:
            return
        assert process.poll() is None, process.communicate()
        time.sleep(0.01)
    raise AssertionError(f"{count} variants were not done in time")


def descendants(pid: int) -> list[psutil.Process]:
    return psutil.Process(pid).children(recursive=True)


def assert_gone(processes: list[psutil.Process]) -> None:
    """Check that no process of a batch runs much longer than the batch. The limit is long for busy machines."""
    _, alive = psutil.wait_procs(processes, timeout=60.0)
    assert not [one for one in alive if one.status() != psutil.STATUS_ZOMBIE]


def assert_whole(folder: Path, count: int) -> None:
    """Check that the journal contains every variant once, with a complete folder, no geometry."""
    out = folder / "build" / "faults"
    assert Counter(line["index"] for line in journal(folder)) == Counter(range(count))
    assert {line["id"] for line in journal(folder)} == {p.name for p in (out / "variants").iterdir()}
    for place in (out / "variants").iterdir():
        manifest = json.loads((place / "manifest.json").read_text())
        assert {*manifest["files"], "manifest.json"} == {str(p.relative_to(place)) for p in place.rglob("*") if p.is_file()}
    assert not [p for p in (out / "assets").iterdir() if len(p.name) != 64]


def test_only_variants_that_end_their_runners_fail(tmp_path: Path, shared_store: str) -> None:
    faults = {3: "kill", 4: "segv", 7: "hang", 8: "raise"}
    here = workspace(tmp_path, faults=listed(faults, 10))
    env = environment(shared_store, with_emitter(tmp_path))
    done = thingc("batch", "faults.yaml", "--pictures", "none", "--timeout", "5 s", "--jobs", "1", cwd=here, env=env)
    assert done.returncode == 1, done.stderr
    rows = table(here)
    codes = {"kill": Code.VARIANT_DIED, "segv": Code.VARIANT_DIED, "hang": Code.VARIANT_HUNG, "raise": Code.VARIANT_RAISED}
    assert [(row["status"], row["code"]) for row in rows] == [
        ("failed", codes[faults[k]].code) if k in faults else ("built", "") for k in range(10)
    ]
    assert "SIGKILL" in rows[3]["message"] and "SIGSEGV" in rows[4]["message"] and "5 s" in rows[7]["message"]
    assert "the emitter has given up" in rows[8]["message"]
    assert Counter(line["index"] for line in journal(here)) == Counter(range(10))
    assert "Traceback" in next(str(line["detail"]) for line in journal(here) if line["index"] == 8)
    assert {p.name for p in (here / "build" / "faults" / "variants").iterdir()} == {row["id"] for row in rows if row["status"] == "built"}
    assert "failed" in done.stderr and Code.VARIANT_HUNG.code in done.stderr and "Traceback" not in done.stderr


def test_killed_runner_loses_one_variant(tmp_path: Path, shared_store: str) -> None:
    here = workspace(tmp_path, faults=listed(dict.fromkeys(range(24), "slow")))
    env = environment(shared_store, with_emitter(tmp_path))
    process = started(here, env, "--jobs", "2")
    wait_for_lines(here, 6, process)
    victims = [one for one in descendants(process.pid) if "thingc.batch.runner" in " ".join(one.cmdline())]
    assert len(victims) == 2
    victims[0].kill()
    assert process.wait(120) == 1
    rows = table(here)
    lost = [row for row in rows if row["status"] == "failed"]
    assert len(rows) == 24 and len(lost) == 1 and "SIGKILL" in lost[0]["message"]
    assert Counter(line["index"] for line in journal(here)) == Counter(range(24))


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interrupted_batch_can_be_resumed(tmp_path: Path, shared_store: str, number: signal.Signals) -> None:
    here = workspace(tmp_path, faults=listed(dict.fromkeys(range(16), "slow"), 16))
    env = environment(shared_store, with_emitter(tmp_path))
    process = started(here, env, "--jobs", "1", "--limit", "14", "--emit", "faulty,mjcf", "--verify", "none")
    wait_for_lines(here, 4, process)
    running = descendants(process.pid)
    process.send_signal(number)
    out, err = process.communicate(timeout=30)
    assert process.returncode == 130 and out == ""
    done = len(journal(here))
    again = "thingc batch faults.yaml --emit faulty,mjcf --limit 14 --pictures none --verify none --jobs 1 --resume"
    assert err == f"interrupted ({done} of 14 variants are done); to continue, run: {again}\n"
    assert 4 <= done < 14 and running
    assert_gone(running)
    if number is signal.SIGTERM:
        return  # what is left is the same
    before = {line["id"]: (here / "build/faults/variants" / str(line["id"]) / "manifest.json").stat().st_mtime_ns for line in journal(here)}
    anew = batch_here(*again.removesuffix(" --resume").split()[2:], cwd=here, env=env)  # what has been done is not thrown away
    assert anew.returncode == 2 and "error[TC922]" in anew.stderr and "--resume" in anew.stderr, anew.stderr
    assert len(journal(here)) == done
    rest = batch_here(*again.split()[2:], cwd=here, env=env)
    assert rest.returncode == 0 and f"14 variants ({done} of them in earlier runs): 14 built" in rest.stderr, rest.stderr
    assert_whole(here, 14)
    assert all((here / "build/faults/variants" / id / "manifest.json").stat().st_mtime_ns == when for id, when in before.items())


def test_failed_variants_are_built_again_on_request(tmp_path: Path, shared_store: str) -> None:
    here = workspace(tmp_path, faults=listed({3: "kill", 5: "raise"}, 7))
    path = with_emitter(tmp_path)
    env = environment(shared_store, path)
    assert thingc("batch", "faults.yaml", *ALONE, cwd=here, env=env).returncode == 1
    emitter = Path(path) / "faulty_target.py"
    emitter.write_text(emitter.read_text().replace('fault == "kill"', 'fault == "never"'))  # what killed runners is mended
    assert batch_here("faults.yaml", *ALONE, "--resume", cwd=here, env=env).returncode == 1
    assert len(journal(here)) == 7  # they stay failed
    alone = thingc_here("batch", "faults.yaml", *ALONE, "--retry", cwd=here, store=shared_store)
    assert alone.code == 2 and "--retry requires --resume" in alone.err and "add --resume" in alone.err
    done = batch_here("faults.yaml", *ALONE, "--resume", "--retry", cwd=here, env=env)
    assert done.returncode == 1 and "7 variants (5 of them in earlier runs): 6 built" in done.stderr, done.stderr
    assert sorted(str(line["index"]) for line in journal(here)[7:]) == ["3", "5"]
    assert [row["status"] for row in table(here)] == ["failed" if k == 5 else "built" for k in range(7)]
    built = {line["id"] for line in journal(here) if line["status"] == "built"}
    assert len(built) == 6 and built == {place.name for place in (here / "build/faults/variants").iterdir()}


def test_crashed_part_is_built_again_on_request(tmp_path: Path) -> None:
    """The part ends its process as long as a file exists that it does not read, so its key does not depend on the file."""
    mood = tmp_path / "bad mood"
    mood.touch()
    parts = f"""
        import os
        from build123d import Box
        from thingc import Length, Thing

        class Moody(Thing):
            def __init__(self, side: Length = 10):
                super().__init__()
                self.side = side

            def result(self):
                if self.side > 25 and os.path.exists({str(mood)!r}):
                    os._exit(1)
                return Box(self.side, 10, 10)
    """
    document = """
        thingc: assembly/1
        name: moods
        parameters: {side: {value: 10 mm, min: 1 mm}}
        materials: {light: {density: 500 kg/m^3}}
        defaults: {component: {material: light}}
        components: {block: {part: "moods:Moody", params: {side: =side}}}
        modes: {standing: {root: block}}
    """
    family = """
        thingc: variants/1
        assembly: moods.yaml
        name: moods
        list:
          - {parameters: {side: 20 mm}}
          - {parameters: {side: 30 mm}}
    """
    here = workspace(tmp_path, moods=document, family=family)
    (here / "parts" / "moods.py").write_text(textwrap.dedent(parts))

    def statuses(**more: bool) -> list[tuple[str, str]]:
        run(str(here / "family.yaml"), executor=InThisProcess(), options=Options(store=str(tmp_path / "store")), pictures=0, **more)
        with (here / "build/moods/results.csv").open() as stream:
            return [(row["status"], row["code"]) for row in csv.DictReader(stream)]

    assert statuses() == statuses(resume=True) == [("built", ""), ("refused", Code.PART_CRASHED.code)]
    mood.unlink()
    assert statuses(resume=True)[1][0] == "refused"
    assert statuses(resume=True, retry=True) == [("built", ""), ("built", "")]


def test_runners_end_with_a_killed_driver_and_resume_works(tmp_path: Path, shared_store: str) -> None:
    """The driver is killed by SIGKILL several times at random moments. The final result equals that of an undisturbed batch."""
    here = workspace(tmp_path, faults=FAULTS)
    env = environment(shared_store, with_emitter(tmp_path))
    more = ["--jobs", "2"]
    for lines in (1, 12):
        process = started(here, env, *more)
        wait_for_lines(here, lines, process)
        running = descendants(process.pid)
        process.kill()
        process.wait()
        assert_gone(running)
        if lines == 12:  # as if the kill had torn the line that was being written
            with (here / "build/faults/journal.jsonl").open("a") as stream:
                stream.write('{"index": 2')
        more = ["--jobs", "1", "--resume"]  # a runner takes longer to start than these variants
    done = batch_here("faults.yaml", *ALONE, "--resume", cwd=here, env=env)
    assert done.returncode == 0, done.stderr
    assert_whole(here, 24)
    fresh = workspace(tmp_path / "fresh", faults=FAULTS)
    assert batch_here("faults.yaml", *ALONE, cwd=fresh, env=env).returncode == 0
    assert tree(here / "build/faults/variants") == tree(fresh / "build/faults/variants")


def test_second_batch_in_a_folder_is_an_error(tmp_path: Path, shared_store: str) -> None:
    here = workspace(tmp_path, faults=listed(dict.fromkeys(range(4), "slow"), 4))
    env = environment(shared_store, with_emitter(tmp_path))
    process = started(here, env, "--jobs", "1")
    wait_for_lines(here, 1, process)
    process.send_signal(signal.SIGSTOP)  # else it may be done before the second looks
    second = batch_here("faults.yaml", *ALONE, "--resume", cwd=here, env=env)
    process.send_signal(signal.SIGCONT)
    assert second.returncode == 2 and f"error[{Code.BATCH_LOCKED.code}]" in second.stderr
    assert process.wait(120) == 0
    assert_whole(here, 4)


def test_two_batches_share_a_store(tmp_path: Path) -> None:
    """Both need the same parts, which are not built yet."""
    text = """
        thingc: variants/1
        assembly: stand.yaml
        name: faults
        parameters: {side: {from: 20 mm, to: 60 mm, count: 3}}
        emit: [mjcf]
    """
    first, second = workspace(tmp_path / "first", faults=text), workspace(tmp_path / "second", faults=text)
    env = environment(str(tmp_path / "store"))
    processes = [started(here, env, "--jobs", "1") for here in (first, second)]
    assert [process.wait(300) for process in processes] == [0, 0], [process.communicate() for process in processes]
    assert_whole(first, 3)
    assert tree(first / "build/faults/variants") == tree(second / "build/faults/variants")


# --- a system that refuses -------------------------------------------------------------------------------------------


def test_unwritable_folder_is_reported(tmp_path: Path, shared_store: str) -> None:
    here = workspace(tmp_path, faults=FAULTS.replace("[mjcf, faulty]", "[mjcf]"))
    (tmp_path / "file").write_text("")
    done = thingc_here("batch", "faults.yaml", *ALONE, "-o", "file/inside", cwd=here, store=shared_store)
    assert done.code == 2 and "Traceback" not in done.err
    assert f"error[{Code.OUTPUT.code}]: cannot write the batch to `file/inside/faults`: a parent of the folder is a file\n" in done.err


def test_file_size_limit_ends_the_batch_and_resume_works(tmp_path: Path, shared_store: str) -> None:
    """No file may grow beyond 9 kB. The journal reaches the limit first, as on a full disk."""
    here = workspace(tmp_path, faults=FAULTS)
    env = environment(shared_store, with_emitter(tmp_path))

    def small() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (9_000, resource.RLIM_INFINITY))

    done = subprocess.run(
        [sys.executable, "-m", "thingc", "batch", "faults.yaml", *ALONE], cwd=here, env=env, capture_output=True, text=True,
        preexec_fn=small, timeout=120,
    )
    assert done.returncode == 2 and f"error[{Code.OUTPUT.code}]" in done.stderr and "not enough disk space" in done.stderr, done.stderr
    assert "Traceback" not in done.stderr and "--resume" in done.stderr
    noted = journal(here)  # every line is whole
    assert 0 < len(noted) < 24
    again = batch_here("faults.yaml", *ALONE, "--resume", cwd=here, env=env)
    assert again.returncode == 0, again.stderr
    assert_whole(here, 24)


@pytest.fixture
def small_disk(tmp_path: Path) -> Path:
    """A file system of 300 kB."""
    place = tmp_path / "disk"
    place.mkdir()
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=300k", "tmpfs", str(place)], capture_output=True)
    if mounted.returncode:
        pytest.skip("only root may mount a file system here")
    yield place
    subprocess.run(["umount", "-l", str(place)], check=True)


def test_full_disk_ends_the_batch_and_resume_works(tmp_path: Path, shared_store: str, small_disk: Path) -> None:
    here = workspace(tmp_path, faults=FAULTS.replace("[mjcf, faulty]", "[mjcf]").replace("count: 24", "count: 80"))
    env = environment(shared_store)
    done = thingc("batch", "faults.yaml", *ALONE, "-o", str(small_disk), cwd=here, env=env)
    assert done.returncode == 2 and f"error[{Code.OUTPUT.code}]" in done.stderr and "No space left" in done.stderr, done.stderr
    noted = [json.loads(line) for line in (small_disk / "faults" / "journal.jsonl").read_text().splitlines()]
    assert 0 < len(noted) < 80 and all(line["status"] == "built" for line in noted)
    for line in noted:
        assert (small_disk / "faults" / line["path"] / "manifest.json").exists()
    subprocess.run(["mount", "-o", "remount,size=64m", str(small_disk)], check=True)
    again = batch_here("faults.yaml", *ALONE, "-o", str(small_disk), "--resume", cwd=here, env=env)
    assert again.returncode == 0 and f"({len(noted)} of them in earlier runs)" in again.stderr, again.stderr


def test_unusable_store_is_reported(tmp_path: Path) -> None:
    here = workspace(tmp_path, faults=FAULTS.replace("[mjcf, faulty]", "[mjcf]").replace("pendulum", "stand").replace("length", "side")
                     .replace("200 mm, to: 430 mm", "20 mm, to: 43 mm"))
    (tmp_path / "file").write_text("")
    done = batch_here("faults.yaml", *ALONE, cwd=here, env=environment(str(tmp_path / "file" / "store")), runners=True)
    assert done.returncode == 2 and f"error[{Code.OUTPUT.code}]" in done.stderr and "Traceback" not in done.stderr, done.stderr


def test_missing_interpreter_is_reported(tmp_path: Path, shared_store: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The missing interpreter stands for a system that cannot start further processes."""
    here = workspace(tmp_path, faults=FAULTS.replace("[mjcf, faulty]", "[mjcf]"))
    monkeypatch.setattr(sys, "executable", str(tmp_path / "gone"))
    why = "cannot start a process for variants: cannot start a process: No such file or directory"
    with pytest.raises(BatchFault, match=why) as caught:
        run(str(here / "faults.yaml"), jobs=1, options=Options(store=shared_store), pictures=0)
    assert caught.value.diagnostic.code is Code.RUNNERS


def test_runners_that_do_not_start_are_reported(tmp_path: Path, shared_store: str) -> None:
    here = workspace(tmp_path, faults=FAULTS.replace("[mjcf, faulty]", "[mjcf]"))
    place = tmp_path / "broken"
    place.mkdir()
    (place / "sitecustomize.py").write_text(
        "import os, sys\nif 'thingc.batch.runner' in sys.orig_argv:\n    sys.stderr.write('no room for a runner')\n    os._exit(7)\n",
    )
    done = batch_here("faults.yaml", *ALONE, cwd=here, env=environment(shared_store, str(place)), runners=True)
    assert done.returncode == 1 and f"error[{Code.RUNNERS.code}]" in done.stderr and "exited with code 7" in done.stderr, done.stderr
    told = batch_here("faults.yaml", *ALONE, "--resume", "--debug", cwd=here, env=environment(shared_store, str(place)), runners=True)
    assert "no room for a runner" in told.stderr
    assert os.path.exists(here / "build" / "faults" / "batch.json")


# --- parts that fail -------------------------------------------------------------------------------------------------

BAD_PART = '''
import ctypes
import time
from typing import Literal

from build123d import Box

from thingc import Length, Thing


class Bad(Thing):
    def __init__(self, how: Literal["well", "hang", "crash", "raise"] = "well", side: Length = 20):
        super().__init__(material="light")
        if how == "hang":
            time.sleep(3600)
        if how == "crash":
            ctypes.string_at(0)
        if how == "raise":
            raise ValueError("it cannot be cut")
        self.body = Box(side, side, side)

    def result(self):
        return self.body
'''

BAD_ROBOT = """
    thingc: assembly/1
    name: bad
    parameters: {how: well, side: 20 mm}
    materials: {light: {density: 500 kg/m^3}}
    components: {cube: {part: bad:Bad, params: {how: =how, side: =side}}}
"""


def bad_parts(folder: Path, text: str) -> Path:
    here = workspace(folder, bad=BAD_ROBOT, faults=text)
    (here / "parts" / "bad.py").write_text(BAD_PART)
    return here


def test_failing_part_affects_only_its_variant(tmp_path: Path) -> None:
    here = bad_parts(tmp_path, """
        thingc: variants/1
        assembly: bad.yaml
        name: faults
        parameters: {how: [well, crash, raise, hang], side: [10 mm, 30 mm]}
    """)
    env = environment(str(tmp_path / "store"))
    done = batch_here("faults.yaml", *ALONE, "--part-timeout", "3 s", cwd=here, env=env)
    assert done.returncode == 1, done.stderr
    codes = {"well": "", "crash": Code.PART_CRASHED.code, "raise": Code.PART_RAISED.code, "hang": Code.PART_HUNG.code}
    rows = table(here)
    assert [(row["parameters.how"], row["code"]) for row in rows] == [(how, codes[how]) for how in codes for _ in range(2)]
    assert [row["status"] for row in rows] == ["built"] * 2 + ["refused"] * 6
    assert len({line["pid"] for line in journal(here)}) == 1


def test_geometry_workers_end_with_a_killed_driver(tmp_path: Path) -> None:
    here = bad_parts(tmp_path, """
        thingc: variants/1
        assembly: bad.yaml
        name: faults
        parameters: {how: [well, hang], side: [10 mm, 30 mm]}
    """)
    process = started(here, environment(str(tmp_path / "store")), "--jobs", "1")
    wait_for_lines(here, 2, process)
    time.sleep(1.0)
    running = descendants(process.pid)
    names = [" ".join(one.cmdline()) for one in running]
    assert any("thingc.geometry.worker.server" in name for name in names) and any("thingc.batch.runner" in name for name in names)
    process.kill()
    process.wait()
    assert_gone(running)


# --- somebody else's engine ------------------------------------------------------------------------------------------


class Losing(ThreadPoolExecutor):
    """An executor that loses every variant the first `losses` times that it is submitted, like a cluster that loses workers."""

    def __init__(self, losses: int) -> None:
        super().__init__(2)
        self.losses = losses
        self.met: Counter[int] = Counter()

    def submit(self, fn, /, *arguments, **named):  # type: ignore[no-untyped-def]
        indices = [task.index for task in arguments[1]]
        self.met.update(indices)
        if min(self.met[index] for index in indices) <= self.losses:
            return super().submit(_lose)
        return super().submit(fn, *arguments, **named)


def _lose() -> None:
    raise ConnectionError("the worker is gone")


@pytest.mark.parametrize(("losses", "statuses"), [(2, {"built": 24}), (3, {"failed": 24})])
def test_lost_variants_are_submitted_again(
    tmp_path: Path, shared_store: str, losses: int, statuses: dict[str, int],
) -> None:
    here = workspace(tmp_path, faults=FAULTS.replace("[mjcf, faulty]", "[mjcf]"))
    with Losing(losses) as executor:
        summary = run(str(here / "faults.yaml"), executor=executor, jobs=2, options=Options(store=shared_store))
    assert summary.statuses == statuses
    assert Counter(line["index"] for line in journal(here)) == Counter(range(24))
    assert {row["code"] for row in table(here)} == ({""} if losses < 3 else {Code.VARIANT_DIED.code})
    assert not [one for one in psutil.Process().children() if "thingc.batch.runner" in " ".join(one.cmdline())]
