"""`thingc check --no-code` runs no code of the workspace and reads no file outside it; with a lock file, `thingc check` needs no CAD
kernel. Verified from outside: with Python's audit hook, with strace, and with traps that leave a file."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from harness import THINGC, environment, ran

DOCUMENTS = ("assemblies/arm.yaml", "assemblies/minchw/minchw.yaml")

_AUDITED = """\
import json, os, sys
seen = []
def hook(event, arguments):
    if event in ("open", "import", "exec", "compile") or event.startswith(("os.", "subprocess.", "socket.", "ctypes.", "pty.")):
        if event == "exec":
            seen.append([event, getattr(arguments[0], "co_filename", "")])
        elif event == "compile":
            seen.append([event, str(arguments[1])])
        elif event == "import":
            seen.append([event, str(arguments[0]), str(arguments[1])])
        elif event == "open":
            seen.append([event, str(arguments[0]), str(arguments[1]), arguments[2]])
        else:
            seen.append([event])
sys.addaudithook(hook)
words = sys.argv[2:]
from thingc.tools.cli.check import without_code
from thingc.driver.environment import Options
found = []
for word in words:
    found += without_code(word, Options(), strict=False)
with open(sys.argv[1], "w") as stream:
    json.dump([[d.code.code for d in found], seen], stream)
"""

TRAP = "import os\nopen(os.path.join({folder!r}, 'SPRUNG-' + __name__ + '-' + str(os.getpid())), 'w').close()\n"


def trapped(folder: Path, marks: Path) -> None:
    """Put code that creates a marker file wherever it might be imported: modules named like those that a check needs, in the root and in
    the part folders, startup hooks of Python and pytest, and the parts themselves."""
    trap = TRAP.format(folder=str(marks))
    for name in ("json", "yaml", "pydantic", "thingc", "argparse", "re", "tomllib", "tree_sitter", "build123d", "bd_materials", "conftest",
                 "sitecustomize", "usercustomize", "setup", "evil", "dataclasses"):
        for place in (folder, folder / "parts", folder / "assemblies"):
            (place / f"{name}.py").write_text(trap)
    for place in (folder / "thingc_stock", folder / "parts" / "thingc_plugins"):
        place.mkdir()
        (place / "__init__.py").write_text(trap)
    (folder / "evil.pth").write_text("import evil\n")
    (folder / "evil-1.0.dist-info").mkdir()
    (folder / "evil-1.0.dist-info" / "entry_points.txt").write_text("[thingc.emitters]\nevil = evil:emit\n")
    (folder / "pyproject.toml").write_text('[project]\nname = "evil"\n[project.entry-points."thingc.emitters"]\nevil = "evil:emit"\n')
    for part in (folder / "parts").rglob("*.py"):
        if part.name not in ("evil.py",):
            part.write_text(part.read_text() + f"\nif True:\n    {trap.splitlines()[0]}\n    {trap.splitlines()[1]}\n")


@pytest.fixture
def hostile(workspace: Path, tmp_path: Path) -> Iterator[Path]:
    """Yield a workspace full of traps, whose marker files would be created next to it."""
    trapped(workspace, tmp_path)
    (workspace / "thingc.toml").write_text('thingc = "workspace/1"\nparts = ["parts", "."]\npackages = ["thingc_stock", "evil", "os"]\n')
    (workspace / "hostile.yaml").write_text(
        "thingc: assembly/1\nname: hostile\nmaterials: [secret.yaml]\ncomponents:\n"
        "  a: {part: 'evil:Evil'}\n  b: {part: 'os:system', params: {command: 'touch SPRUNG'}}\n  c: {part: 'thingc_stock.evil:Evil'}\n"
        "  d: {part: 'subprocess:Popen'}\n  e: {file: secret.step}\n  f: {assembly: secret.yaml}\n  g: {assembly: ../outside.yaml}\n"
        "  h: {assembly: /etc/passwd}\n  i: {assembly: pipe.yaml}\n  j: {part: 'linked:Linked'}\n  k: {assembly: loop.yaml}\n"
        "  l: {assembly: zero.yaml}\n"
    )
    secret = tmp_path / "secret.txt"
    secret.write_text("the secret words\n")
    (tmp_path / "outside.yaml").write_text("the secret words\n")
    for name in ("secret.yaml", "secret.step", "parts/linked.py", "root.yaml"):
        (workspace / name).symlink_to(secret)
    (workspace / "loop.yaml").symlink_to("loop.yaml")
    (workspace / "zero.yaml").symlink_to("/dev/zero")
    os.mkfifo(workspace / "pipe.yaml")
    yield workspace


def sprung(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.rglob("SPRUNG*"))


def test_no_trap_runs_and_no_secret_is_printed(hostile: Path, tmp_path: Path) -> None:
    store = tmp_path / "store"
    for words in (["hostile.yaml"], ["root.yaml"], ["pipe.yaml"], ["zero.yaml"], list(DOCUMENTS)):
        done = ran(["check", "--no-code", *words], hostile, {"THINGC_STORE": str(store)})
        assert done.code in (1, 2), done
        assert "secret words" not in done.out + done.err and "Traceback" not in done.err and "TC899" not in done.out
        assert done.seconds < 7.0
    assert not sprung(tmp_path)
    assert not store.exists()


def test_python_m_is_refused_if_it_would_import_local_modules(workspace: Path) -> None:
    words = ["check", "--no-code", DOCUMENTS[0]]
    unsafe = ran(words, workspace, program=(sys.executable, "-m", "thingc"))
    assert unsafe.code == 2 and "Python can import untrusted modules from the working folder" in unsafe.out
    safe = ran(words, workspace, program=(sys.executable, "-I", "-m", "thingc"))
    assert safe.code == 0, safe


def test_audit_hook_sees_no_foreign_code_or_files(hostile: Path, tmp_path: Path) -> None:
    answer = tmp_path / "audit.json"
    words = ["hostile.yaml", "root.yaml", *DOCUMENTS]
    subprocess.run(
        [sys.executable, "-I", "-B", "-c", _AUDITED, str(answer), *words], cwd=hostile,
        env=environment(THINGC_STORE=str(tmp_path / "store")),
        check=True, timeout=120,
    )
    codes, seen = json.loads(answer.read_text())
    assert {"TC114", "TC341"} <= set(codes)
    inside = os.path.realpath(hostile) + os.sep
    allowed = tuple(os.path.realpath(path) + os.sep for path in {sys.prefix, sys.base_prefix, *sys.path} if path)
    assert len(seen) > 500  # the hook was there
    for event, *more in seen:
        assert not event.startswith(("subprocess.", "socket.", "pty.", "os.fork", "os.exec", "os.posix_spawn", "os.system")), event
        if event == "open":
            path, mode, flags = more
            real = os.path.realpath(path)
            if real == str(answer):
                continue
            assert real.startswith((inside, *allowed)), path
            assert not (flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT)) and not set(mode) & set("wax+"), path
        elif event == "exec":
            assert not os.path.realpath(more[0]).startswith(inside), more
        elif event == "import":
            assert not os.path.realpath(more[1]).startswith(inside), more
    assert not sprung(tmp_path)


@pytest.mark.skipif(shutil.which("strace") is None, reason="strace is not installed")
def test_strace_confirms_the_audit_hook(hostile: Path, tmp_path: Path) -> None:
    log = tmp_path / "strace.log"
    done = subprocess.run(
        ["strace", "-f", "-qq", "-e", "trace=%file,execve,connect", "-o", str(log), THINGC, "check", "--no-code", "hostile.yaml",
            *DOCUMENTS],
        cwd=hostile, env=environment(THINGC_STORE=str(tmp_path / "store"), PYTHONDONTWRITEBYTECODE="1"), capture_output=True, text=True,
        timeout=300,
    )
    if "ptrace" in done.stderr.lower():
        pytest.skip("strace may not trace here")
    assert done.returncode == 1
    lines = log.read_text().splitlines()
    assert sum(" execve(" in line and "= 0" in line for line in lines) == 1  # thingc itself
    assert not any(" connect(" in line for line in lines)
    inside = os.path.realpath(hostile)
    system = ("/lib", "/usr", "/etc/locale.alias", "/etc/ld.so", "/etc/localtime", "/etc/ssl/openssl.cnf", "/proc/", "/sys/",
        "/dev/null", "/dev/urandom")
    allowed = (inside, *{os.path.realpath(path) for path in {sys.prefix, sys.base_prefix, *sys.path} if path}, *system)
    opened = [found for line in lines if (found := re.search(r"open(?:at)?\([^\"]*\"([^\"]*)\", ([^,)]*).*= (-?\d+)", line))]
    assert len(opened) > 100
    for found in opened:
        path, flags, result = found.groups()
        if int(result) < 0:
            continue
        real = os.path.realpath(os.path.join(inside, path))
        # what a folder's name is, is asked while Python finds itself; no file is read
        assert real.startswith(allowed) or "O_DIRECTORY" in found.group(0), path
        assert "O_WRONLY" not in flags and "O_RDWR" not in flags and "O_CREAT" not in flags or real == "/dev/null", path


_WATCHED = """\
import sys
KERNEL = {"build123d", "OCP", "bd_warehouse", "numpy", "mujoco"}
class Poison:
    @staticmethod
    def find_spec(name, path=None, target=None):
        if name.partition(".")[0] in KERNEL:
            raise SystemExit(f"{name} was imported")
sys.meta_path.insert(0, Poison)
started = []
def hook(event, arguments):
    if event in ("subprocess.Popen", "os.fork", "os.posix_spawn", "os.exec", "os.system"):
        started.append(event)
sys.addaudithook(hook)
from thingc.tools.cli.main import main
code = main(sys.argv[1:])
assert not started, started
assert not KERNEL & set(sys.modules)
sys.exit(code)
"""


def test_check_with_lock_needs_no_kernel_on_a_fresh_clone(workspace: Path, tmp_path: Path) -> None:
    program = (sys.executable, "-I", "-c", _WATCHED)
    words = ["check", "--store", str(tmp_path / "empty"), *DOCUMENTS]
    done = ran(words, workspace, program=program)
    assert done.code == 0, done
    assert done.out == "".join(f"{document}: ok\n" for document in DOCUMENTS)
    # The oracle can fail: without the lock the same needs a worker.
    (workspace / "parts.lock.json").unlink()
    done = ran(["check", "--store", str(tmp_path / "other"), DOCUMENTS[0]], workspace, program=program)
    assert done.code != 0 and "subprocess.Popen" in done.err
