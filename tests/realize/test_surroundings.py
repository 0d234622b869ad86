"""The environment in which parts run: fixed variables, a private folder, and cleanup after killed workers."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from realize.conftest import modelled_parts
from thingc.geometry.client import Workers
from thingc.geometry.key.environment_variables import FIXED, HOMES, TEMPORARY, environment
from thingc.geometry.record import PartFailure, PartRecord
from thingc.geometry.worker.scratch import PREFIX, Scratch

TELLS = """
    import json, os, tempfile
    from build123d import Box
    from thingc import Thing

    class {name}(Thing):
        def result(self):
            files = [tempfile.mkstemp()[1], os.path.expanduser("~/mine")]
            seen = {{"environment": dict(os.environ), "working": os.getcwd(), "files": files, "there": os.listdir(os.path.expanduser("~"))}}
            raise ValueError(json.dumps(seen))
"""


def told(failure: PartFailure) -> Any:
    """Return the data in the error message of the part."""
    assert failure.kind == "raised", failure
    return json.loads(failure.message.removeprefix("ValueError: "))


@contextlib.contextmanager
def own_workers(forking: bool = True) -> Iterator[Workers]:
    made = Workers(1, forking=forking)
    try:
        yield made
    finally:
        made.close()


@pytest.mark.parametrize("forking", [True, False])
def test_parts_see_only_fixed_or_hashed_variables(
    place: Any, define: Callable[..., Any], monkeypatch: pytest.MonkeyPatch, tmp_path: Path, forking: bool
) -> None:
    for name in ("SIZE", "HOME", "VIRTUAL_ENV", "PYTHONPATH", "LANG"):
        monkeypatch.setenv(name, str(tmp_path))
    monkeypatch.setenv("LD_LIBRARY_PATH", "/a/kernel")
    (tmp_path / "temporary").mkdir()
    monkeypatch.setenv("TMPDIR", str(tmp_path / "temporary"))
    for name in ("One", "Two"):
        place.write(f"parts/{name.lower()}.py", TELLS.format(name=name))
    with own_workers(forking) as workers, place.service(workers=workers) as service:
        one, two = (told(answer) for answer in service.realize([define("one:One"), define("two:Two")]).values())
    for seen in (one, two):
        home = seen["environment"]["HOME"]
        assert home.startswith(str(tmp_path / "temporary"))
        given = {**FIXED, "PYTHONHASHSEED": "0", "LD_LIBRARY_PATH": "/a/kernel", **dict.fromkeys((*HOMES, *TEMPORARY), home)}
        assert seen["environment"] == given
        assert seen["working"] == str(place.root)
        assert seen["files"][0].startswith(home) and seen["files"][1] == f"{home}/mine"
        assert seen["there"] == [os.path.basename(seen["files"][0])]
    assert one["environment"]["HOME"] != two["environment"]["HOME"]
    assert list((tmp_path / "temporary").iterdir()) == []


THREADS = """
    import json, os
    from build123d import Box, Sphere
    from manifold3d import Manifold
    from thingc import Thing

    class Many(Thing):
        def result(self):
            before = len(os.listdir("/proc/self/task"))
            assert (Manifold.sphere(10, 400) - Manifold.sphere(10, 400).translate((1, 2, 3))).num_tri() > 50_000
            assert (Box(10, 10, 10) - Sphere(6)).is_valid
            seen = {"more": len(os.listdir("/proc/self/task")) - before, "processors": sorted(os.sched_getaffinity(0))}
            raise ValueError(json.dumps(seen))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="Linux says which threads a process has")
def test_parts_run_with_one_thread(place: Any, define: Callable[..., Any]) -> None:
    place.write("parts/many.py", THREADS)
    with place.service() as service:
        (answer,) = service.realize([define("many:Many")]).values()
    assert told(answer) == {"more": 0, "processors": sorted(os.sched_getaffinity(0))}


def test_state_of_the_code_is_read_once_per_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The fingerprint depends on every file of thingc, as it was when this process first needed the fingerprint."""
    from thingc.driver import up_to_date

    module = tmp_path / "room" / "module.py"
    module.parent.mkdir()
    module.write_text("A = 1\n")
    monkeypatch.setattr(up_to_date, "thingc", SimpleNamespace(__file__=str(tmp_path / "__init__.py")))
    up_to_date._code_state.cache_clear()
    try:
        before = up_to_date.fingerprint()
        module.write_text("A = 10\n")
        assert up_to_date.fingerprint() == before
        up_to_date._code_state.cache_clear()  # as in a new process
        assert up_to_date.fingerprint() != before
    finally:
        up_to_date._code_state.cache_clear()


def test_passed_variable_is_part_of_the_key(place: Any, define: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> None:
    from thingc.driver import up_to_date

    place.write("parts/arm.py", "from build123d import Box\ndef plate():\n    return Box(1, 1, 1)\n")
    monkeypatch.delenv("LD_LIBRARY_PATH", raising=False)
    before = up_to_date.fingerprint()
    with place.service() as service:
        service.realize([define("arm:plate")])
    monkeypatch.setenv("LD_LIBRARY_PATH", "/another/kernel")
    assert up_to_date.fingerprint() != before
    with place.service() as service:
        service.realize([define("arm:plate")])
        assert service.decisions["arm:plate"].reason == "variable LD_LIBRARY_PATH is new"
    monkeypatch.setenv("SIZE", "5")
    with place.service() as service:
        service.realize([define("arm:plate")])
        assert modelled_parts(service) == []


def test_scratch_folders_are_removed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    left = subprocess.run(
        [sys.executable, "-c", textwrap.dedent("""
            import os, signal, tempfile
            from thingc.geometry.worker.scratch import Scratch
            open(os.path.join(Scratch().make(), "file"), "w").close()
            os.kill(os.getpid(), signal.SIGKILL)
        """)],
        env={**os.environ, "TMPDIR": str(tmp_path)}, check=False,
    )
    assert left.returncode == -signal.SIGKILL
    dead = {path.name for path in tmp_path.glob(PREFIX + "*")}
    assert len(dead) == 1
    (tmp_path / f"{PREFIX}of-nobody").write_text("a file is no folder of a worker")
    one, two = Scratch(), Scratch()  # the first sweeps the dead, the second leaves the living
    assert os.path.isdir(one.folder) and os.path.isdir(two.folder)
    assert dead.isdisjoint(os.listdir(tmp_path))
    one.make()
    one.close()
    two.close()
    assert os.listdir(tmp_path) == [f"{PREFIX}of-nobody"]


def test_hang_crash_or_failed_start_leaves_no_folder(
    place: Any, define: Callable[..., Any], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setenv("TMPDIR", str(temporary))
    text = """
        import os, signal, tempfile, time
        def hangs():
            tempfile.mkdtemp()
            time.sleep(600)
        def crashes():
            tempfile.mkdtemp()
            os.kill(os.getpid(), signal.SIGSEGV)
    """
    place.write("parts/bad.py", text)
    with own_workers() as workers, place.service(workers=workers, timeout=1.5) as service:
        found = service.realize([define("bad:hangs"), define("bad:crashes")])
    assert [answer.kind for answer in found.values()] == ["hung", "crashed"]
    command = [sys.executable, "-m", "thingc.geometry.worker.server"]
    shadow = place.write("shadow/build123d.py", "raise ImportError('no kernel')")
    usual = environment()
    path = os.pathsep.join([str(shadow.parent), usual.get("PYTHONPATH", "")])
    done = subprocess.run(command, env={**usual, "PYTHONPATH": path}, input=b"", capture_output=True, timeout=60)
    assert b"no kernel" in done.stdout
    assert list(temporary.iterdir()) == []
    process = subprocess.Popen(command, env=usual, stdin=subprocess.PIPE, stdout=subprocess.PIPE)  # ended while it loads
    while not list(temporary.iterdir()):
        time.sleep(0.01)
    process.kill()
    process.communicate()
    Scratch().close()


def test_workers_start_without_home(place: Any, define: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> None:
    place.write("parts/arm.py", "from build123d import Box\ndef plate():\n    return Box(1, 1, 1)\n")
    monkeypatch.delenv("HOME", raising=False)
    with own_workers() as workers, place.service(workers=workers) as service:
        assert isinstance(service.realize([define("arm:plate")])["arm:plate"], PartRecord)
