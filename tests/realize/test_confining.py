"""Restrictions on parts: they cannot change files outside their folder, leave processes running or start too many processes."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import psutil
import pytest

from thingc.geometry.client import Workers
from thingc.geometry.record import ImpureInputs, PartFailure, PartRecord

linux = pytest.mark.skipif(sys.platform != "linux", reason="Linux says whose processes are whose, and has Landlock")

HEAD = """\
import ctypes, os, signal, subprocess, sys, tempfile, time
from pathlib import Path
from build123d import *
VICTIM = {victim!r}
BESIDE = {beside!r}
def made():
    return Box(1, 1, 1)
"""

REFUSED = {
    "open": "open(VICTIM, 'r+b').write(b'x')",
    "append": "Path(VICTIM).open('a')",
    "os_open": "os.open(VICTIM, os.O_WRONLY)",
    "remove": "os.remove(VICTIM)",
    "replace": "os.replace(tempfile.mkstemp()[1], VICTIM)",
    "rename": "Path(VICTIM).rename(os.path.join(tempfile.gettempdir(), 'mine'))",
    "truncate": "os.truncate(VICTIM, 0)",
    "link": "os.link(VICTIM, os.path.join(tempfile.gettempdir(), 'mine'))",
    "through_a_link": "os.symlink(VICTIM, Path.home() / 'link'), (Path.home() / 'link').write_bytes(b'x')",
    "mkdir": "os.mkdir(BESIDE + '.folder')",
    "export_stl": "export_stl(Box(1, 1, 1), BESIDE)",
    "export_step": "export_step(Box(1, 1, 1), BESIDE)",
}
"""Ways to change a file that raise a Python audit event: each is one diagnostic at its line."""

PAST_PYTHON = {
    "process": "subprocess.run(['sh', '-c', 'echo x >> ' + VICTIM + '; rm ' + VICTIM])",
    "c": "ctypes.CDLL(None).unlink(VICTIM.encode())",
    "kernel": "__import__('OCP.BRepTools').BRepTools.BRepTools.Write_s(Box(1, 1, 1).wrapped, VICTIM)",
    "server": "ctypes.CDLL(None).kill(os.getppid(), signal.SIGKILL)",
}
"""Ways that bypass Python: the operating system denies them, and the part is modelled."""

OWN = {
    "temporary": "Path(tempfile.mkstemp()[1]).write_text('x')",
    "home": "(Path.home() / 'a').mkdir() or (Path.home() / 'a' / 'b').write_text('x') or os.rename(Path.home() / 'a', Path.home() / 'c')",
    "folder": "[open(os.path.join(folder, 'x'), 'w').close() for folder in [tempfile.mkdtemp()]]",
    "nameless": "tempfile.TemporaryFile().close() or tempfile.NamedTemporaryFile().close()",
    "removed": "tempfile.TemporaryDirectory().cleanup()",
    "device": "open(os.devnull, 'w').write('x')",
    "exported": "export_stl(Box(1, 1, 1), os.path.join(tempfile.gettempdir(), 'x.stl')) or 1 / 0",
    "process": "subprocess.run(['sh', '-c', 'echo x > $HOME/y && cat $HOME/y'], check=True)",
}
"""Operations that a part may do in its own folder."""


@pytest.fixture(scope="module")
def answers(module_place: Any, define: Callable[..., Any]) -> dict[str, Any]:
    """Return the answers of all parts, modelled in one workspace, and the path of the file that they try to change: a blob of the store."""
    victim = module_place.store.path(module_place.store.put(b"what another part needs"))
    head = HEAD.format(victim=victim, beside=str(module_place.root / "beside"))
    groups = {"refused": REFUSED, "past": PAST_PYTHON if sys.platform == "linux" else {}, "own": OWN}
    for group, lines in groups.items():
        text = head + "".join(f"def do_{name}():\n    {line}\n    return made()\n" for name, line in lines.items())
        module_place.write(f"parts/{group}.py", text)
    with module_place.service() as service:
        found = service.realize([define(f"{group}:do_{name}") for group, lines in groups.items() for name in lines])
    return {**found, "victim": victim}


@pytest.mark.parametrize("name", REFUSED)
def test_writing_outside_the_folder_is_refused_at_its_line(answers: dict[str, Any], module_place: Any, name: str) -> None:
    failure = answers[f"refused:do_{name}"]
    assert isinstance(failure, PartFailure) and failure.kind == "trespassed", failure
    beside = "beside.folder" if name == "mkdir" else "beside" if name.startswith("export") else None
    assert failure.message == f"`{beside or answers['victim']}`"
    lines = Path(failure.file or "").read_text().splitlines()
    assert lines[(failure.line or 0) - 1].strip() == REFUSED[name]


@pytest.mark.parametrize("name", OWN)
def test_writing_in_own_folder_is_allowed(answers: dict[str, Any], name: str) -> None:
    assert isinstance(answers[f"own:do_{name}"], PartRecord), answers[f"own:do_{name}"]


@linux
@pytest.mark.parametrize("name", PAST_PYTHON)
def test_system_denies_writes_that_bypass_python(answers: dict[str, Any], name: str) -> None:
    assert isinstance(answers[f"past:do_{name}"], PartRecord), answers[f"past:do_{name}"]


def test_refused_writes_change_nothing(answers: dict[str, Any], module_place: Any) -> None:
    assert Path(answers["victim"]).read_bytes() == b"what another part needs"
    assert sorted(path.name for path in module_place.root.iterdir()) == ["parts"]


def test_writes_are_refused_without_fork(place: Any, define: Callable[..., Any]) -> None:
    """Workers that cannot fork have no Landlock either. Their own results are still written to the store."""
    victim = place.store.path(place.store.put(b"what another part needs"))
    bad = "def bad():\n    Path(VICTIM).write_bytes(b'')\n    return made()\n"
    place.write("parts/bad.py", HEAD.format(victim=victim, beside="") + bad)
    workers = Workers(1, forking=False)
    try:
        with place.service(workers=workers) as service:
            failure, good = service.realize([define("bad:bad"), define("bad:made")]).values()
    finally:
        workers.close()
    assert failure.kind == "trespassed" and isinstance(good, PartRecord)
    assert place.store.has(good.meshes["print"].sha256, good.meshes["print"].size)
    assert Path(victim).read_bytes() == b"what another part needs"


# --- processes --------------------------------------------------------------------------------------------------------

LEAVING = HEAD + """
import multiprocessing
MARK = os.path.join(os.getcwd(), "mark")
SLEEP = [sys.executable, "-c", "import time; time.sleep(600)", MARK]
def child():
    subprocess.Popen(SLEEP)
    return made()
def daemon():
    said = subprocess.run(["sh", "-c", "setsid {lone} > /dev/null & echo $!"], stdout=subprocess.PIPE, text=True).stdout
    while not Path("/proc", said.strip(), "cmdline").read_text().startswith("sleep"):  # it is a copy of the shell at first
        time.sleep(0.01)
    return made()
def copy():
    if os.fork() == 0:
        os.setsid()
        if os.fork() == 0:
            time.sleep(600)
        os._exit(0)
    os.wait()
    return made()
def polite():
    with multiprocessing.get_context("fork").Pool(2) as pool:
        pool.map(abs, [-1, 2])
    multiprocessing.get_context("spawn").Lock()  # a helper that watches over it, and ends when the part does
    subprocess.run(["true"])
    subprocess.Popen(["true"])
    return made()
def crashing():
    subprocess.Popen(SLEEP, start_new_session=True)
    os.kill(os.getpid(), signal.SIGSEGV)
def hanging():
    subprocess.Popen(SLEEP, start_new_session=True)
    time.sleep(600)
"""


LONE = f"sleep 600.{os.getpid()}"
"""A command line unique to this process: other copies of these tests may run on the same machine."""


def marked(place: Any) -> list[str]:
    lines = [" ".join(process.info["cmdline"] or []) for process in psutil.process_iter(["cmdline"])]
    return [line for line in lines if str(place.root) in line and "mark" in line or LONE in line]


@linux
def test_leftover_processes_are_stopped_and_named(place: Any, define: Callable[..., Any]) -> None:
    place.write("parts/leaving.py", LEAVING.format(victim="", beside="", lone=LONE))
    names = ("child", "daemon", "copy", "polite", "crashing")
    workers = Workers(2)
    try:
        with place.service(workers=workers) as service:
            found = service.realize([define(f"leaving:{name}") for name in names])
        with place.service(timeout=2.0, workers=workers) as service:
            found |= service.realize([define("leaving:hanging")])
        (server,) = workers._processes
        assert psutil.Process(server.process.pid).children(recursive=True) == []  # none of a part that has been dead for long, too
    finally:
        workers.close()
    assert marked(place) == []
    for name, words in (("child", f"the process `{sys.executable}"), ("daemon", f"the process `{LONE}`"), ("copy", "a copy of itself")):
        (left,) = [warning for warning in found[f"leaving:{name}"].warnings if warning.asked is ImpureInputs.LEFT]
        assert left.message.startswith(f"left {words}") and left.message.endswith(" running")
    assert [one for one in found["leaving:polite"].warnings if one.asked is ImpureInputs.LEFT] == []
    failures = [found[f"leaving:{name}"] for name in ("crashing", "hanging")]
    assert [(one.kind, one.message) for one in failures] == [("crashed", "killed by SIGSEGV"), ("hung", "more than 2 s")]


BOMBS = HEAD + """
def shell():
    # ten generations: 2 047 processes at most, should nobody stop it
    subprocess.run(["sh", "-c", "f() {{ [ $1 -eq 0 ] && sleep 30 || {{ f $(($1 - 1)) | f $(($1 - 1)) & }}; }}; f 10; sleep 600"])
def sessions():
    for _ in range(2000):  # none of them in a group with another
        subprocess.Popen(["sleep", "600"], start_new_session=True)
    time.sleep(600)
"""


@linux
@pytest.mark.parametrize("name", ["shell", "sessions"])
def test_fork_bomb_is_one_diagnostic(place: Any, define: Callable[..., Any], name: str) -> None:
    place.write("parts/bombs.py", BOMBS.format(victim="", beside=""))
    with place.service(timeout=60.0) as service:
        bomb, good = service.realize([define(f"bombs:{name}"), define("bombs:made")]).values()
    assert (bomb.kind, bomb.message) == ("swarmed", "more than 256 at once")
    assert (os.path.basename(bomb.file), bomb.line is not None) == ("bombs.py", True)
    assert isinstance(good, PartRecord)
    assert [one.pid for one in psutil.process_iter(["cwd"]) if one.info["cwd"] == str(place.root)] == []
