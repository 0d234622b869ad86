"""Ctrl-C at any time: one exit code, no traceback, no partially written files."""

from __future__ import annotations

import fcntl
import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

from editor.language_server import wait_until
from live.documents import write

SAID = "interrupted; all written files are complete\n"

AT_AN_IMPORT = """\
import signal, sys

class Interrupts:
    def find_spec(self, name, path, target=None):
        if name == {module!r}:
            try:
                signal.raise_signal(signal.{name})
            except KeyboardInterrupt:  # what is written in Rust has an error of its own for it
                raise RuntimeError("it has been made another")

from thingc.__main__ import entry
sys.meta_path.insert(0, Interrupts())
sys.argv = ["thingc", "build", "robot.yaml"]
entry()
"""

MADE_ANOTHER = """\
import signal, sys
import thingc.driver.build_document
from thingc.__main__ import entry

def build(environment, wish):
    try:
        signal.raise_signal(signal.SIGINT)
    except KeyboardInterrupt:  # as MuJoCo does where it looks for `callable`
        raise RuntimeError("cannot find `callable`")

thingc.driver.build_document.build = build
sys.argv = ["thingc", "build", "robot.yaml"]
entry()
"""

IMPORTS = """\
import sys

def imported(event, about):
    if event == "import" and about[0] in ("mujoco", "glfw"):
        print(about[0], file=sys.stderr)

sys.addaudithook(imported)
sys.argv = ["thingc", "build", "robot.yaml"]
from thingc.__main__ import entry
entry()
"""

BETWEEN_FILES = """\
import signal, sys
import thingc.base.replacement
from thingc.__main__ import entry

replace = thingc.base.replacement._replace

def _replace(*change):
    replace(*change)
    signal.raise_signal(signal.SIGINT)

thingc.base.replacement._replace = _replace
sys.argv = ["thingc", "rename", "finger.yaml", "mounts.seat", "socket"]
entry()
"""

WITH_A_LOCK = """\
import os, signal, sys
import thingc.driver.output
from thingc.__main__ import entry

opened = os.open

def open_(path, *words):
    descriptor = opened(path, *words)
    if str(path).endswith(".thingc-lock"):
        signal.raise_signal(signal.SIGINT)
    return descriptor

os.open = open_
sys.argv = ["thingc", "new", "rover"]
entry()
"""

LATE_AND_REFUSED = """\
import signal, sys
import thingc.driver.output
from thingc.__main__ import entry

delete = thingc.driver.output._delete

def delete_(path):
    signal.raise_signal(signal.SIGINT)
    delete(path)

thingc.driver.output._delete = delete_
sys.argv = ["thingc", "new", "rover"]
entry()
"""


@pytest.fixture(autouse=True)
def in_the_foreground() -> Iterator[None]:
    """Restore the SIGINT handler. Background jobs of a shell ignore SIGINT, and so do their child processes by default."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture
def here(tmp_path: Path) -> Path:
    return write(tmp_path).parent


def run(here: Path, store: str, words: Sequence[str]) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-P", *words], cwd=here, capture_output=True, text=True, timeout=60.0, env={**os.environ, "THINGC_STORE": store},
    )


@pytest.mark.parametrize(("module", "number"), [
    ("argparse", signal.SIGINT), ("thingc.tools.cli.build", signal.SIGINT), ("pydantic", signal.SIGTERM), ("mujoco", signal.SIGINT),
])
def test_interrupt_during_imports(module: str, number: signal.Signals, here: Path) -> None:
    """With its own store: MuJoCo is not imported for a model that another test has already verified."""
    done = run(here, str(here / "store"), ["-c", AT_AN_IMPORT.format(module=module, name=number.name)])
    assert (done.returncode, done.stdout, done.stderr) in [(130, "", SAID), (130, "", "")], "early there is no command to speak of yet"
    assert not (here / "build").exists() or list((here / "build").iterdir()) == []


def test_interrupt_converted_by_c_code_is_recognized(here: Path, shared_store: str) -> None:
    done = run(here, shared_store, ["-c", MADE_ANOTHER])
    assert (done.returncode, done.stdout, done.stderr) == (130, "", SAID)


def test_builds_do_not_import_glfw(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """glfw examines its library in a subprocess, which would print its own traceback on Ctrl-C."""
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    done = run(here, str(here / "store"), ["-c", IMPORTS])
    assert done.returncode == 0 and (here / "build/robot/mjcf").exists() and "mujoco" in done.stderr and "glfw" not in done.stderr


def test_interrupt_between_related_files(here: Path, shared_store: str) -> None:
    done = run(here, shared_store, ["-c", BETWEEN_FILES])
    assert (done.returncode, done.stderr) == (130, SAID)
    assert "mounts: {socket: bone.seat}" in (here / "finger.yaml").read_text()
    assert "child: finger_$i.socket" in (here / "robot.yaml").read_text() and "finger_1.socket" in (here / "robot.yaml").read_text()


def test_interrupted_new_creates_a_complete_workspace(here: Path, shared_store: str) -> None:
    done = run(here, shared_store, ["-c", WITH_A_LOCK])
    assert (done.returncode, done.stderr) == (130, SAID)
    assert (here / "rover/.vscode/extensions.json").exists() and not any(path.name.startswith(".rover") for path in here.iterdir())


def test_new_does_not_wait_for_another_command(here: Path, shared_store: str) -> None:
    """Interrupts are blocked at that time, so waiting could not be interrupted."""
    with (here / ".rover.thingc-lock").open("w") as stream:
        fcntl.flock(stream, fcntl.LOCK_EX)
        done = run(here, shared_store, ["-m", "thingc", "new", "rover"])
    assert (done.returncode, done.stdout) == (2, "") and not (here / "rover").exists()
    assert "another command is creating `rover`" in done.stderr and "wait until the command has finished" in done.stderr


def test_interrupt_during_a_refusal_counts(here: Path, shared_store: str) -> None:
    (here / "rover").mkdir()
    (here / "rover/letter.txt").write_text("Dear")
    done = run(here, shared_store, ["-c", LATE_AND_REFUSED])
    assert (done.returncode, done.stderr) == (130, SAID)
    assert [path.name for path in (here / "rover").iterdir()] == ["letter.txt"]


def heeds(process: subprocess.Popen[str]) -> bool:
    """Return whether the process has installed a handler for SIGTERM; Python itself installs none."""
    status = Path(f"/proc/{process.pid}/status").read_text()
    return bool(int(status.partition("SigCgt:")[2].split()[0], 16) & 1 << signal.SIGTERM - 1)


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="Linux says which signals a process handles")
@pytest.mark.parametrize("seconds", [0.0, 0.15, 0.3, 0.45])
def test_interrupt_at_any_time(seconds: float, here: Path, shared_store: str) -> None:
    """As in a terminal, the whole process group gets the signal."""
    process = subprocess.Popen(
        [sys.executable, "-P", "-m", "thingc", "new", "rover"], cwd=here, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        start_new_session=True, env={**os.environ, "THINGC_STORE": shared_store},
    )
    assert wait_until(lambda: heeds(process), 30.0)
    try:
        process.wait(seconds)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGINT)
    _, said = process.communicate(timeout=60.0)
    made = (here / "rover").exists()
    assert (process.returncode, said) in ([(0, ""), (130, ""), (130, SAID)] if made else [(130, SAID), (130, "")])
    assert not made or (here / "rover/.vscode/extensions.json").exists(), "a whole workspace"
    assert not any(path.name.startswith(".rover") for path in here.iterdir())
