"""xacro is expanded in a separate process; errors in the result are reported at the lines of the source files."""

from __future__ import annotations

import contextlib
import math
import shutil
import socket
import sys
from pathlib import Path

import pytest

from thingc.base.diagnostics import Diagnostic, Report
from thingc.geometry.worker import children, process_tree
from thingc.tools.cli.main import main
from thingc.tools.importing import urdf
from thingc.tools.importing.import_request import ImportRequest
from thingc.tools.importing.importing import Imported, import_robot
from thingc.tools.importing.xacro_worker import is_plausible

BOT = Path(__file__).parent / "xacro" / "bot"


@pytest.fixture
def bot(tmp_path: Path) -> Path:
    shutil.copytree(BOT, tmp_path / "bot")
    mesh = tmp_path / "bot" / "meshes" / "base.stl"
    mesh.parent.mkdir()
    mesh.write_text("solid s\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid s\n")
    return tmp_path / "bot" / "urdf" / "bot.urdf.xacro"


def read(path: Path, **arguments: str) -> tuple[Imported | None, list[Diagnostic]]:
    report = Report()
    return import_robot(str(path), report, ImportRequest(arguments=arguments)), report.sorted_diagnostics()


def test_macros_includes_and_packages(bot: Path) -> None:
    imported, said = read(bot)
    assert imported is not None and said == []
    assert [link.name for link in imported.robot.links] == ["base", "left_arm", "right_arm"]
    left, right = imported.robot.attachments
    assert left.pose.translation[1] == pytest.approx(math.pi / 10) and right.pose.translation[1] == -0.1
    assert imported.robot.links[1].weight is not None and imported.robot.links[1].weight.properties.mass == 1.0
    assert [(Path(loss.where.file).name, loss.where.line) for loss in imported.losses] == [("arm.xacro", 12), ("arm.xacro", 12)]
    assert imported.files["meshes/base.stl"] and str(bot.parents[1]) not in imported.files["import.json"].decode()
    imported, _ = read(bot, arms="1")
    assert imported is not None and [link.name for link in imported.robot.links] == ["base", "left_arm"]


def test_argument_used_only_in_yaml(bot: Path) -> None:
    """Only xacro evaluates such a file; if YAML is loaded, all arguments are passed on."""
    (bot.parent / "side.yaml").write_text("left: $(arg side)\n")
    assert [d.message for d in read(bot, side="port")[1]] == ["--arg: the file has no argument `side`"]
    text = bot.read_text().replace("0.5 * 2", "1.0 if xacro.load_yaml('side.yaml')['left'] == 'port' else 2.0")
    bot.write_text(text)
    imported, said = read(bot, side="port")
    assert imported is not None and said == []


@pytest.mark.parametrize(("file", "old", "new", "words", "line"), [
    ("arm.xacro", '"${mass}"', '"${mas}"', "name 'mas' is not defined", 5),
    ("arm.xacro", 'link="base"', 'link="bse"', "the parent link `bse` of joint `left_shoulder` does not exist", 10),
    ("arm.xacro", 'ixx="0.01"', 'ixx="${side}"', "`ixx` of `<inertia>`: expected a number, found `left`", 6),
    ("arm.xacro", "</inertial>", "", "invalid XML: mismatched tag", 8),
    ("bot.urdf.xacro", "arm.xacro", "leg.xacro", "no such file or directory", 5),
    ("bot.urdf.xacro", "$(find xacro_bot)/urdf", "$(find other)", "there is no package `other` (searched: ", 5),
    ("bot.urdf.xacro", "$(arg arms)", "$(arg legs)", "legs", 10),
    ("bot.urdf.xacro", "0.5 * 2", "[].__class__", "Use of invalid name(s)", 4),
    ("bot.urdf.xacro", "0.5 * 2", "[0] * 10**12", "MemoryError when evaluating expression '[0] * 10**12'", 4),
    ("bot.urdf.xacro", "0.5 * 2", "9**9**9**9", "xacro cannot expand this file: ", 1),
])
def test_errors_are_reported_at_their_line(
    bot: Path, file: str, old: str, new: str, words: str, line: int, monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(urdf, "SECONDS", 1 if "9**9" in new else 60)
    path = bot.with_name(file)
    path.write_text(path.read_text().replace(old, new))
    imported, said = read(bot)
    assert imported is None
    assert words in said[0].message and said[0].span is not None
    assert (Path(said[0].span.file).name, said[0].span.line) == (file, line)


def test_missing_extra_names_the_package_to_install(
    bot: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(urdf, "find_spec", lambda name: None)
    assert main(["import", str(bot)]) == 2
    assert "pip install 'thingc[import]'" in capsys.readouterr().err
    assert main(["import", str(bot), "--arg", "arms"]) == 2
    assert "--arg: expected NAME=VALUE, found `arms`" in capsys.readouterr().err


ESCAPE = (
    "(lambda: [(it, it['exec'](it['open']('{path}').read(), dict(__builtins__=it))) for it in [[one for one in"
    " ().__class__.__base__.__subclasses__() if one.__name__ == 'catch_warnings'][0]()._module.__builtins__]])() and 1.0"
)
"""Runs the Python code of a file. xacro checks for forbidden names only outside of functions."""
FREE = (
    "import sys; hook = sys.modules['thingc.geometry.worker.sandbox']; hook._allowed = (); hook._readable = None; hook._STARTING = ()\n"
)
"""Disables the audit hook in Python, so that only the operating system denies access."""
REFUSED = {
    "remove": ("import os; os.remove({victim!r})", "files may be written only to the temporary folder of this process"),
    "rename": ("import os; os.rename({victim!r}, {beside!r})", "files may be written only to the temporary folder of this process"),
    "truncate": ("open({victim!r}, 'w')", "files may be written only to the temporary folder of this process"),
    "make": ("import os; os.mkdir({beside!r})", "files may be written only to the temporary folder of this process"),
    "connect": ("import socket; socket.create_connection(('127.0.0.1', {port}), 1)", "programs and network connections are not allowed"),
    "unix": ("import socket; socket.socket(socket.AF_UNIX)", "programs and network connections are not allowed"),
    "udp": ("import socket; socket.socket(socket.AF_INET, socket.SOCK_DGRAM)", "programs and network connections are not allowed"),
    "chmod": ("import os; os.chmod({victim!r}, 0o777)", "files may be written only to the temporary folder of this process"),
    "terminal": ("open('/dev/tty', 'r+b')", "files may be written only to the temporary folder of this process"),
    "run": ("import subprocess; subprocess.run(['/bin/true'], check=True)", "programs and network connections are not allowed"),
    "read": ("raise ValueError(open({victim!r}).read())", "the file is outside the robot's folder and all known packages"),
}
linux = pytest.mark.skipif(sys.platform != "linux", reason="only Linux has Landlock and /proc")


def run_in_expression(bot: Path, code: str) -> tuple[Imported | None, list[Diagnostic]]:
    """Import a robot whose xacro expression runs this code."""
    bot.with_name("code.py").write_text(code)
    bot.write_text(bot.read_text().replace("0.5 * 2", ESCAPE.format(path=bot.with_name("code.py"))))
    return read(bot)


def test_code_in_an_expression_runs(bot: Path) -> None:
    """Without this, the following tests would prove nothing."""
    assert run_in_expression(bot, "x = 1")[0] is not None
    assert "it ran" in run_in_expression(bot, "raise ValueError('it ran')")[1][0].message


@linux
@pytest.mark.parametrize("past", ["", FREE], ids=["python", "system"])
def test_code_in_an_expression_is_confined(bot: Path, tmp_path: Path, past: str) -> None:
    victim, beside = tmp_path / "theirs" / "victim", tmp_path / "theirs" / "beside"
    victim.parent.mkdir()
    victim.write_text("secret")
    with socket.create_server(("127.0.0.1", 0)) as server:
        names = {"victim": str(victim), "beside": str(beside), "port": server.getsockname()[1]}
        ways = [code.format(**names) for code, _ in REFUSED.values()]
        tried = "def tried(way):\n try:\n  exec(way)\n except Exception as fault:\n  return str(fault)\n return 'done'\n"
        _, said = run_in_expression(bot, f"{past}{tried}raise ValueError('ways:' + '|'.join(map(tried, {ways})))")
    words = said[0].message.partition("ways:")[2].split("|")
    assert len(words) == len(REFUSED)
    for found, (_, expected) in zip(words, REFUSED.values(), strict=True):
        assert ("ermission denied" if past else expected) in found
    assert victim.read_text() == "secret" and not beside.exists()


@linux
def test_code_in_an_expression_has_no_terminal(bot: Path) -> None:
    """A process with a terminal could inject input into it."""
    _, said = run_in_expression(bot, "import os; raise ValueError(f'leads its session: {os.getsid(0) == os.getpid()}')")
    assert "leads its session: True" in said[0].message


@pytest.mark.parametrize("file", ["/etc/hosts", "/dev/zero", "{bot}/../../../../../../etc/hosts", "{bot}.link", ""])
def test_forged_answer_cannot_name_other_files(bot: Path, file: str) -> None:
    """The files of an answer are read again by an unconfined process."""
    bot.with_name(f"{bot.name}.link").symlink_to("/etc/hosts")
    found = file.format(bot=bot)
    for name, true in ((found, False), (str(bot), True)):
        assert is_plausible({"text": "", "files": [name], "packages": {}}, [str(bot.parent)]) is true
    assert not is_plausible({"fault": "x", "file": found or "/", "line": 1}, [str(bot.parent)])


@linux
def test_code_in_an_expression_cannot_forge_an_answer(bot: Path) -> None:
    code = "import json, os\nfor one in range(3, 20):\n try:\n  os.write(one, json.dumps({'fault': 'x', 'file': '/etc/hosts', 'line': 1})"
    _, said = run_in_expression(bot, f"{code}.encode() + b'\\n')\n except OSError:\n  pass\n")
    refusals = ("an invalid answer", "the process ended")  # what it writes into other pipes can end a process
    assert any(words in said[0].message for words in refusals) and said[0].span is not None and said[0].span.file == str(bot)


@linux
def test_answer_size_is_limited(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(children, "ANSWER", 1000)
    monkeypatch.setattr(process_tree, "end_all_but", lambda others: None)  # else it would end the CAD kernel of this test process, too
    for length, failed in ((500, None), (200_000, "crashed")):
        child = children.fork_child(lambda asked: {"text": "x" * asked["length"]}, 0, str(tmp_path), ())
        child.ask({"id": 0, "timeout": 20.0, "length": length})
        assert child.wait().get("failed") == failed


@linux
def test_processes_started_by_an_expression_are_stopped(bot: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    imported, said = run_in_expression(bot, f"{FREE}import os, time\nif os.fork() == 0:\n    os.setsid(); time.sleep(100)\n")
    assert imported is None and "start processes" in said[0].message
    own, alive = f"TMPDIR={tmp_path}".encode(), list[str]()
    for process in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            alive += [process.name] if own in (process / "environ").read_bytes() else []
    assert alive == [] and not [*tmp_path.glob("thingc-worker-*")]


@pytest.mark.parametrize("path", ["{0}/secret.yaml", "../../theirs/../theirs/secret.yaml", "$(find theirs)/secret.yaml", "link.yaml"])
def test_files_outside_the_robot_are_not_read(bot: Path, tmp_path: Path, path: str) -> None:
    """A folder next to the parent folders of the file is a package only if it has a manifest."""
    secret = tmp_path / "theirs" / "secret.yaml"
    secret.parent.mkdir()
    secret.write_text("1.0")
    bot.with_name("link.yaml").symlink_to(secret)
    bot.write_text(bot.read_text().replace("0.5 * 2", f"xacro.load_yaml('{path.format(secret.parent)}')"))
    imported, said = read(bot)
    assert imported is None and "secret.yaml`: the file is outside the robot's folder and all known packages" in said[0].message
    if "find" in path:
        (secret.parent / "package.xml").write_text("<package><name>theirs</name></package>")
        assert read(bot)[0] is not None


def test_include_outside_the_robot_is_not_read(bot: Path, tmp_path: Path) -> None:
    other = tmp_path / "theirs" / "arm.xacro"
    other.parent.mkdir()
    shutil.copy(bot.with_name("arm.xacro"), other)
    bot.write_text(bot.read_text().replace("$(find xacro_bot)/urdf/arm.xacro", str(other)))
    imported, said = read(bot)
    assert imported is None and f"cannot read `{other}`: the file is outside the robot's folder and all known packages" in said[0].message
    assert said[0].help == "to allow reading a folder, use `--package NAME=DIR`" and said[0].span is not None and said[0].span.line == 5
    report = Report()
    assert import_robot(str(bot), report, ImportRequest(packages={"theirs": str(other.parent)})) is not None and not report.failed
