"""Cases that need other files than documents: unreadable files, folders without write permission, links, large files."""

from __future__ import annotations

import fnmatch
import io
import json
import os
import subprocess
import sys
import warnings
from collections.abc import Callable
from pathlib import Path

import pytest

from thingc.base.diagnostics import Code
from thingc.documents.load.discovery import MOST_FOLDERS
from thingc.targets.registry import TARGETS, written_pattern
from thingc.tools.cli.main import COMMANDS, main

HERE = Path(__file__).resolve().parent
GOOD = (HERE / "load" / "good.yaml").read_text()


@pytest.fixture
def folder(tmp_path: Path, shared_store: str, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty workspace with the parts of the cases, which is the working folder."""
    inside = tmp_path / "workspace"
    inside.mkdir()
    (inside / "parts").mkdir()
    (inside / "parts" / "boxes.py").write_text((HERE / "parts" / "boxes.py").read_text())
    (inside / "thingc.toml").write_text('thingc = "workspace/1"\n')
    (inside / "robot.yaml").write_text(GOOD)
    monkeypatch.setenv("THINGC_STORE", shared_store)
    monkeypatch.chdir(inside)
    return inside


def said(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, list[str]]:
    """Return the exit code and the lines of both streams without progress."""
    capsys.readouterr()
    code = main(words)
    out, err = capsys.readouterr()
    return code, [line for line in (out + err).splitlines() if not line.startswith(("modelling ", "decomposing ", "slicing "))]


def test_folder_with_other_files_is_not_changed(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "out" / "two").mkdir(parents=True)
    (folder / "out" / "two" / "thesis.tex").write_text("years of work")
    code, lines = said(capsys, "build", "robot.yaml", "-o", "out", "--emit", "bom")
    assert code == 2
    assert lines == [
        f"error[{Code.UNEXPECTED.code}]: `out/two` contains unknown files (`thesis.tex`)",
        "  help: move the files, or build into another folder with -o",
        "", "1 error",
    ]
    assert [path.name for path in (folder / "out").rglob("*") if path.is_file() and path.suffix] == ["thesis.tex"]
    assert (folder / "out" / "two" / "thesis.tex").read_text() == "years of work"


def test_later_file_stops_the_next_build(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert said(capsys, "build", "robot.yaml", "-o", "out", "--emit", "bom")[0] == 0
    before = {path: path.read_bytes() for path in (folder / "out" / "two").iterdir()}
    (folder / "out" / "two" / "notes.txt").write_text("mine")
    (folder / "robot.yaml").write_text(GOOD.replace("-90 deg", "-80 deg"))
    code, lines = said(capsys, "build", "robot.yaml", "-o", "out", "--emit", "bom")
    assert code == 2 and "notes.txt" in lines[0] and Code.UNEXPECTED.code in lines[0]
    assert {path: path.read_bytes() for path in before} == before


def test_invalid_document_keeps_the_last_build(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert said(capsys, "build", "robot.yaml", "-o", "out", "--emit", "bom")[0] == 0
    before = {path: path.read_bytes() for path in (folder / "out" / "two").iterdir()}
    (folder / "robot.yaml").write_text(GOOD.replace("plate.top", "plate.topp"))
    assert said(capsys, "build", "robot.yaml", "-o", "out", "--emit", "bom")[0] == 1
    assert {path: path.read_bytes() for path in (folder / "out" / "two").iterdir()} == before


def test_output_folder_that_is_a_file(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "out").write_text("a file")
    code, lines = said(capsys, "build", "robot.yaml", "-o", "out", "--emit", "bom")
    assert code == 2
    assert lines[0].startswith(f"error[{Code.OUTPUT.code}]: ") and "out" in lines[0]
    assert str(folder) not in "\n".join(lines)


def test_unwritable_store(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "store").write_text("a file")
    code, lines = said(capsys, "check", "robot.yaml", "--store", "store")
    assert code == 2
    assert lines[0].startswith(f"error[{Code.OUTPUT.code}]: the cache ") and "cannot be used" in lines[0]
    assert lines[1] == "  help: choose a writable folder with --store or THINGC_STORE"


@pytest.mark.skipif(sys.platform != "linux", reason="needs a file whose reading fails for everybody")
def test_unreadable_document(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "robot.yaml").unlink()
    (folder / "robot.yaml").symlink_to("/proc/self/mem")
    code, lines = said(capsys, "fmt", "robot.yaml")
    assert code == 1
    assert lines[0] == f"error[{Code.UNREADABLE.code}]: cannot read `robot.yaml`: input/output error"


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may read everything")
def test_document_without_read_permission(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "robot.yaml").chmod(0)
    code, lines = said(capsys, "check", "robot.yaml")
    assert code == 1
    assert lines[0] == f"error[{Code.UNREADABLE.code}]: cannot read `robot.yaml`: permission denied"


def test_document_link_out_of_the_workspace(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder.parent / "elsewhere.yaml").write_text(GOOD)
    (folder / "robot.yaml").unlink()
    (folder / "robot.yaml").symlink_to(folder.parent / "elsewhere.yaml")
    code, lines = said(capsys, "check", "robot.yaml")
    assert code == 1
    assert lines[:2] == [
        "error[TC114]: `robot.yaml` is a symbolic link to a file outside the workspace", "  help: use the file that the link points to",
    ]


def test_pipe_is_an_error_without_waiting(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    os.mkfifo(folder / "pipe.yaml")
    assert said(capsys, "check", "pipe.yaml") == (2, [
        "error[TC802]: `pipe.yaml` is not a regular file", "  help: use a regular file", "", "1 error",
    ])
    (folder / "robot.yaml").write_text("thingc: assembly/1\nname: two\ncomponents:\n  hand: {assembly: pipe.yaml}\n")
    code, lines = said(capsys, "check", "robot.yaml")
    assert code == 1 and lines[0] == "error[TC113]: there is no file `pipe.yaml`"


@pytest.mark.parametrize(("word", "hint"), [
    ("hexapod.yaml", "did you mean `legged/hexapod.yaml`?"),  # in a folder below
    ("legged/hexapd.yaml", "did you mean `legged/hexapod.yaml`?"),
    ("away/leg.toml", "did you mean `legged/leg.yaml`?"),  # in a folder that does not exist
    ("legged/nothing.yaml", "known documents: `legged/hexapod.yaml`, `legged/leg.yaml`"),  # and not one with letters of the folder's name
    ("empty/nothing.yaml", "known documents: `legged/hexapod.yaml`, `legged/leg.yaml`"),
    ("empty", "known documents: `legged/hexapod.yaml`, `legged/leg.yaml`"),
    ("legged", "known documents: `legged/hexapod.yaml`, `legged/leg.yaml`"),
])
def test_document_in_another_folder_is_suggested(
    tmp_path: Path, word: str, hint: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "thingc.toml").write_text('thingc = "workspace/1"\n')
    (tmp_path / "empty").mkdir()
    (tmp_path / "legged").mkdir()
    for number in range(MOST_FOLDERS):  # what lies deep in one folder keeps nobody from looking into the next
        (tmp_path / f"full/{number}").mkdir(parents=True)
    (tmp_path / "notes.yaml").write_text("no: document\n")
    for name in ("hexapod", "leg"):
        (tmp_path / f"legged/{name}.yaml").write_text("thingc: assembly/1\n")
    assert said(capsys, "info", word)[1][1] == f"  help: {hint}"


@pytest.mark.parametrize("words", [("touched",), ("check", "--touched"), ("check", "--touched", "--fix")])
def test_folder_in_place_of_a_changed_file(folder: Path, capsys: pytest.CaptureFixture[str], words: tuple[str, ...]) -> None:
    assert said(capsys, *words, "parts") == (2, [
        "error[TC801]: expected a file, found the folder `parts`", "  help: list the changed files, or add --all", "",
        "1 error",
    ])


def test_errors_in_standard_input_are_shown(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(b"thingc: assembly/1\r\nname: [b\r\n")))
    code, lines = said(capsys, "fmt", "-")
    assert code == 1
    assert lines[:4] == [
        "error[TC103]: the `[` is not closed with `]`", "   --> <stdin>:2:7", "  2 | name: [b", "    |       ^",
    ]


def test_link_that_leaves_the_workspace(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder.parent / "secret.yaml").write_text(GOOD)
    (folder.parent / "secret.step").write_text("")
    (folder / "hand.yaml").symlink_to(folder.parent / "secret.yaml")
    (folder / "motor.step").symlink_to(folder.parent / "secret.step")
    (folder / "robot.yaml").write_text(
        "thingc: assembly/1\nname: two\ncomponents:\n  hand: {assembly: hand.yaml}\n"
        "  motor: {file: motor.step, at: {in: hand.origin}}\n"
    )
    code, lines = said(capsys, "check", "robot.yaml")
    assert code == 1
    assert [line for line in lines if line.startswith("error")] == [
        "error[TC114]: `hand.yaml` is outside the workspace", "error[TC114]: `motor.step` is outside the workspace",
    ]


def test_document_of_more_than_ten_megabytes(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "robot.yaml").write_bytes(GOOD.encode() + b"#" * 10_000_000)
    code, lines = said(capsys, "check", "robot.yaml")
    assert code == 1 and lines[0] == "error[TC108]: the file has more than 10000000 bytes"


def test_traceback_of_a_part_needs_debug(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "parts" / "failing.py").write_text((HERE / "parts" / "failing.py").read_text())
    (folder / "robot.yaml").write_text("thingc: assembly/1\nname: two\ncomponents:\n  it: {part: failing:Strict}\n")
    code, lines = said(capsys, "check", "robot.yaml")
    assert code == 1 and not any("Traceback" in line for line in lines)
    code, lines = said(capsys, "check", "robot.yaml", "--debug")
    assert code == 1
    assert "  | Traceback (most recent call last):" in lines
    assert "  | ValueError: no stock of 10 mm" in lines


def test_workspace_without_a_workspace_file(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "thingc.toml").unlink()
    assert said(capsys, "check", "robot.yaml") == (0, ["robot.yaml: ok"])
    (folder / "robot.yaml").write_text(GOOD.replace("materials: {petg: {density: 1270 kg/m^3}}", "materials: [../petg.yaml]"))
    (folder.parent / "petg.yaml").write_text("thingc: materials/1\nmaterials: {petg: {density: 1270 kg/m^3}}\n")
    code, lines = said(capsys, "check", "robot.yaml")
    assert code == 1 and lines[0] == "error[TC114]: `../petg.yaml` is outside the workspace"


@pytest.mark.defect
def test_defect_of_the_compiler_is_reported(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def defect(*_: object, **__: object) -> None:
        raise ZeroDivisionError("division\nby zero")

    monkeypatch.setattr("thingc.driver.pipeline.check", defect)
    (folder / "robot.yaml").write_text(GOOD + "# so that no earlier answer stands\n")
    code, lines = said(capsys, "check", "robot.yaml")
    assert code == 1
    assert lines[0] == f"error[{Code.INTERNAL.code}]: internal error: ZeroDivisionError: division by zero"
    assert not any("Traceback" in line for line in lines)


# --- names that nobody can read ------------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "told"), [
    (b"a\nb.yaml", r"a\nb.yaml"), (b"a\x1b[31m.yaml", r"a\x1b[31m.yaml"), ("a\u202e.yaml".encode(), r"a\u202e.yaml"),
    (b"caf\xe9.yaml", r"caf\udce9.yaml"), (b"a\tb.yaml", r"a\tb.yaml"),
])
def test_document_with_an_unreadable_name(
    folder: Path, capsys: pytest.CaptureFixture[str], name: bytes, told: str
) -> None:
    (folder / os.fsdecode(name)).write_text(GOOD)
    for command in ("check", "build", "info", "hag", "test"):
        code, lines = said(capsys, command, os.fsdecode(name))
        assert code == 1 and lines[0].startswith(f"error[{Code.FILE_NAME.code}]: the file name `{told}` has "), lines


def test_link_does_not_hide_an_unreadable_name(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "\u202emay.yaml").write_text(GOOD)
    (folder / "link.yaml").symlink_to("\u202emay.yaml")
    (folder / "nests.yaml").write_text("thingc: assembly/1\nname: n\ncomponents: {a: {assembly: link.yaml}}\n")
    assert said(capsys, "check", "link.yaml")[1][0].startswith(f"error[{Code.FILE_NAME.code}]: ")
    code, lines = said(capsys, "check", "nests.yaml")
    assert code == 1 and lines[0].startswith(f"error[{Code.FILE_NAME.code}]: ") and "nests.yaml:3:" in lines[1]


@pytest.mark.parametrize("command", [
    ["check", "robot.yaml"], ["build", "robot.yaml"], ["lock"], ["schema"], ["parts"], ["fmt", "--modeline", "robot.yaml"],
], ids=lambda words: words[0])
def test_workspace_in_a_folder_with_an_invalid_name(folder: Path, capsys: pytest.CaptureFixture[str], command: list[str]) -> None:
    other = folder.parent / os.fsdecode(b"caf\xe9")
    folder.rename(other)
    os.chdir(other)
    code, lines = said(capsys, *command)
    assert code == 1 and lines[0].startswith(f"error[{Code.FILE_NAME.code}]: the folder `") and "caf\\udce9" in lines[0]


def test_rest_of_the_path_can_contain_any_characters(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    other = folder.parent / "a\n\x1b[31m \u202e"
    folder.rename(other)
    os.chdir(other)
    assert said(capsys, "check", str(other / "robot.yaml")) == (0, [f"{other}/robot.yaml: ok".replace("\n", "\\n").replace(
        "\x1b", "\\x1b").replace("\u202e", "\\u202e")])
    assert said(capsys, "build", "robot.yaml", "--emit", "bom")[0] == 0


NEEDED = {
    "new": ["robot"], "import": ["a.urdf"], "batch": ["a.yaml"], "add": ["mode", "m", "--to", "a.yaml"], "set": ["a.yaml", "a=1"],
    "rezero": ["a.yaml", "a=1 deg"], "calibration": ["a.yaml", "a.calibration.yaml"],
    "rename": ["a.yaml", "components.a", "b"], "fmt": ["a.yaml"], "explain": ["TC302"], "touched": ["a.yaml"], "why": ["a.yaml"],
    "check": ["a.yaml"], "schema": ["."], "lock": ["."], "parts": [], "lsp": [], "mcp": [], "diff": [],
}


def test_commands_in_a_deleted_working_folder(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Each command runs in a separate process, so that no module is imported before."""
    (folder / "gone").mkdir()
    os.chdir(folder / "gone")
    (folder / "gone").rmdir()
    (folder / "robot.yaml").unlink()
    for command in COMMANDS:
        words = [command, *NEEDED.get(command, ["a.yaml"])]
        code, lines = said(capsys, *words)
        assert code == 2 and Code.WORKING_FOLDER.code in "\n".join(lines), words
    for words in (["check", "x.yaml"], ["--help"], ["check", "--help"], ["--version"]):
        for python in ([sys.executable, "-m", "thingc"], [sys.executable, "-P", "-c", "from thingc.__main__ import entry; entry()"]):
            done = subprocess.run([*python, *words], capture_output=True, text=True, timeout=60)
            assert "Traceback" not in done.stderr, done.stderr
            assert (done.returncode, Code.WORKING_FOLDER.code in done.stderr) == ((2, True) if words[-1] == "x.yaml" else (0, False)), words


@pytest.mark.parametrize("form", ["text", "json", "github", "sarif"])
def test_deleted_working_folder(folder: Path, capsys: pytest.CaptureFixture[str], form: str) -> None:
    (folder / "gone").mkdir()
    os.chdir(folder / "gone")
    (folder / "gone").rmdir()
    for words in (["check", "x.yaml"], ["check", str(folder / "robot.yaml")], ["build", "x.yaml"], ["lock"], ["parts"]):
        if form in ("text", "json") or words[0] in ("check", "build", "lock"):
            code, lines = said(capsys, *words, "--format", form)
            assert code == 2 and Code.WORKING_FOLDER.code in "\n".join(lines), words
    assert said(capsys, "explain", "TC302")[0] == 2 and main(["--version"]) == 0


def test_part_that_raises_an_invalid_string(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "parts" / "odd.py").write_text(
        'from thingc import Thing\n\n\nclass Odd(Thing):\n    def result(self):\n        raise ValueError("half \\ud800 \\x1b[31m")\n'
    )
    (folder / "odd.yaml").write_text("thingc: assembly/1\nname: odd\ncomponents: {a: {part: odd:Odd}}\n")
    for form in ("text", "json"):
        code, lines = said(capsys, "check", "odd.yaml", "--format", form)
        assert code == 1 and Code.PART_RAISED.code in "\n".join(lines)
        assert "half ? \\x1b[31m" in "\n".join(lines) or "half ? \\u001b[31m" in "\n".join(lines)


DEEP = "too deeply nested" if sys.version_info < (3, 12) else "Parser stack overflowed"


@pytest.mark.parametrize(("code", "words"), [
    (b"x = " + b"-" * 50_000 + b"1\n", f"MemoryError: {DEEP}"),
    (b"x = " + b"(" * 500 + b"\n", "SyntaxError: "),
    (b"x = 1\0\n", "Error: "), (b'x = "\\ud800\x1b[31m\n', "SyntaxError: "),
])
def test_invalid_part_files(folder: Path, capsys: pytest.CaptureFixture[str], code: bytes, words: str) -> None:
    (folder / "parts" / "odd.py").write_bytes(code)
    exit_code, lines = said(capsys, "parts", "--format", "json")
    assert exit_code == 1 and Code.PART_UNREADABLE.code in "\n".join(lines) and words in "\n".join(lines)
    assert Code.PART_UNREADABLE.code in said(capsys, "lock")[1][0]


def test_python_warnings_in_part_files_are_not_printed(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Python 3.12 and newer prints such a warning with a line of a file whose name it does not know."""
    (folder / "parts" / "odd.py").write_text('from build123d import Box\n\n\ndef odd():\n    """A \\d box."""\n    return Box(9, 9, 9)\n')
    (folder / "odd.yaml").write_text("thingc: assembly/1\nname: odd\ncomponents: {a: {part: odd:odd, mass: 1 g}}\n")
    with warnings.catch_warnings():
        warnings.filterwarnings("error", ".*invalid escape sequence")
        assert said(capsys, "check", "odd.yaml") == (0, ["odd.yaml: ok"])
        assert said(capsys, "parts")[0] == 0


# --- what a person has done to a build folder ----------------------------------------------------------------------


def _edit(two: Path) -> None:
    with (two / "bom.csv").open("a") as stream:
        stream.write("x\n")


def _add(two: Path) -> None:
    (two / "notes.txt").write_text("mine")


def _link(two: Path) -> None:
    (two.parent / "elsewhere.csv").write_bytes((two / "bom.csv").read_bytes())
    (two / "bom.csv").unlink()
    (two / "bom.csv").symlink_to("../elsewhere.csv")


def _replace(two: Path) -> None:
    (two / "bom.csv").unlink()
    (two / "bom.csv").mkdir()
    (two / "bom.csv" / "mine").write_text("mine")


@pytest.mark.parametrize("changed", [False, True], ids=["nothing else changed", "the document changed"])
@pytest.mark.parametrize(("meddle", "name"), [(_edit, "bom.csv"), (_add, "notes.txt"), (_link, "bom.csv"), (_replace, "bom.csv/mine")])
def test_edited_build_files_are_kept(
    folder: Path, capsys: pytest.CaptureFixture[str], meddle: Callable[[Path], None], name: str, changed: bool
) -> None:
    """With and without the recorded state of the previous build."""
    words = ["build", "robot.yaml", "-o", "out", "--emit", "bom,hag"]
    assert said(capsys, *words)[0] == 0
    two = folder / "out" / "two"
    whole = {path.name: path.read_bytes() for path in two.iterdir()}
    meddle(two)
    if changed:
        (folder / "robot.yaml").write_text(GOOD.replace("-90 deg", "-80 deg"))
    before = {path: (path.is_symlink(), path.is_file() and path.read_bytes()) for path in two.rglob("*")}
    for _ in range(2):
        code, lines = said(capsys, *words)
        assert code == 2 and lines[0].startswith(f"error[{Code.UNEXPECTED.code}]: `out/two` contains ") and f"`{name}`" in lines[0]
        assert lines[1].endswith("or use --force")
        assert {path: (path.is_symlink(), path.is_file() and path.read_bytes()) for path in two.rglob("*")} == before
    assert said(capsys, *words, "--force")[0] == 0
    assert sorted(path.name for path in two.iterdir()) == sorted(whole)
    assert (two / "bom.csv").read_bytes() == whole["bom.csv"] or changed
    assert said(capsys, *words)[1] == ["out/two is up to date (6 files)"]


CORNER = "v 0 0 0\nv {0} 0 0\nv 0 {0} 0\nv 0 0 {0}\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"


@pytest.mark.parametrize("words", [[], ["--set", "components.a.file=other.obj"]], ids=["named", "chosen"])
def test_file_behind_a_changed_link(folder: Path, capsys: pytest.CaptureFixture[str], words: list[str]) -> None:
    """With the recorded state of the previous build: the file that it read still exists under its own name."""
    (folder / "robot.yaml").write_text(
        "thingc: assembly/1\nname: two\nmaterials: {pla: {density: 1000 kg/m^3}}\ncomponents:\n  a: {file: latest.obj, material: pla}\n"
    )
    for size in (30, 60):
        (folder / f"v{size}.obj").write_text(CORNER.format(size))
        for name in ("latest.obj", "other.obj"):
            (folder / name).unlink(missing_ok=True)
            (folder / name).symlink_to(f"v{size}.obj")
        for _ in range(2):
            assert said(capsys, "build", "robot.yaml", "--emit", "bom", *words)[0] == 0
            (line,) = json.loads((folder / "build" / "two" / "bom.json").read_text())
            assert line["mass"] == pytest.approx(size**3 / 6e6)  # of a corner of a cube, in kg
    (folder / "latest.obj").unlink()
    (folder / "other.obj").unlink()
    assert said(capsys, "build", "robot.yaml", "--emit", "bom", *words)[0] != 0


def test_build_folder_that_is_no_longer_a_link(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The files behind the link are unchanged, and the folder is another one."""
    words = ["build", "robot.yaml", "--emit", "bom"]
    (folder / "build").mkdir()
    (folder / "kept").mkdir()
    two = folder / "build" / "two"
    two.symlink_to("../kept", target_is_directory=True)
    for _ in range(2):
        assert said(capsys, *words)[0] == 0
    assert (folder / "kept" / "bom.csv").exists()
    two.unlink()
    assert said(capsys, *words) == (0, ["Built build/two: 3 files; 0 parts modelled, 2 reused"])
    assert (two / "bom.csv").read_bytes() == (folder / "kept" / "bom.csv").read_bytes()


def test_build_files_are_relative_to_the_working_folder(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """This also holds for a build that finds nothing changed since a build in another folder."""
    words = ["build", str(folder / "robot.yaml"), "--emit", "bom", "--format", "json"]
    for place, first in ((folder, "build/two/bom.csv"), (folder / "parts", "../build/two/bom.csv")):
        monkeypatch.chdir(place)
        assert json.loads("\n".join(said(capsys, *words)[1]))["artifacts"][0] == first


def test_deleted_build_files_are_written_again(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["build", "robot.yaml", "-o", "out", "--emit", "bom"]
    assert said(capsys, *words)[0] == 0
    (folder / "out" / "two" / "bom.csv").unlink()
    assert said(capsys, *words)[0] == 0 and (folder / "out" / "two" / "bom.csv").exists()


def test_targets_write_only_declared_files(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The next build with other targets would report an undeclared file as unexpected."""
    assert said(capsys, "build", "robot.yaml", "-o", "out", "--emit", ",".join(TARGETS))[0] == 0
    names = [str(path.relative_to(folder / "out" / "two")) for path in (folder / "out" / "two").rglob("*") if path.is_file()]
    assert [name for name in names if not written_pattern().fullmatch(name)] == ["manifest.json"]
    stated = {pattern for target in TARGETS.values() for pattern in target.writes}
    assert {pattern for pattern in stated for name in names if fnmatch.fnmatch(name, pattern)} == stated
    for targets in ("bom", "mjcf", "hag,stl"):
        assert said(capsys, "build", "robot.yaml", "-o", "out", "--emit", targets)[0] == 0


BALLAST = """
from thingc.targets.artifact import Artifacts

{states}


def emit(request):
    return Artifacts(files={{"ballast.csv": b"link,mass"}})
"""


@pytest.mark.parametrize(("states", "sound"), [
    ("", False), ('WRITES = ("other.csv", "ballast.*/x")', False), ('WRITES = "ballast.csv"', True), ('WRITES = ("b*.csv",)', True),
])
def test_installed_targets_declare_their_files(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, states: str, sound: bool
) -> None:
    """Otherwise, the next build would report their files as unexpected."""
    installed = folder.parent / "installed"
    (installed / "ballast-1.0.dist-info").mkdir(parents=True)
    (installed / "ballast-1.0.dist-info" / "entry_points.txt").write_text("[thingc.emitters]\nballast = ballast_of_links:emit\n")
    (installed / "ballast_of_links.py").write_text(BALLAST.format(states=states))
    monkeypatch.syspath_prepend(str(installed))
    monkeypatch.delitem(sys.modules, "ballast_of_links", raising=False)
    words = ["build", "robot.yaml", "-o", "out", "--emit", "ballast"]
    if sound:
        for _ in range(2):
            assert said(capsys, *words)[0] == 0
            (folder / "robot.yaml").write_text(GOOD.replace("-90 deg", "-80 deg"))
    else:
        assert said(capsys, *words) == (1, [
            f"error[{Code.UNSTATED.code}]: the target `ballast` writes the unlisted file `ballast.csv`",
            '  help: ask the author of the package to write `WRITES = ("ballast.csv",)` in `ballast_of_links`',
            "", "1 error",
        ])
        assert not (folder / "out").exists()
