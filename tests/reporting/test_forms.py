"""`--format` of all commands: valid documents, invalid ones, invalid command lines and internal errors; and colours."""

from __future__ import annotations

import contextlib
import json
import os
import pty
import re
import resource
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest
from code_pages import read_page, unpack

from reporting.test_github import parsed
from reporting.test_sarif import checked
from thingc.base.diagnostics import Code
from thingc.tools.cli.console import of_exception
from thingc.tools.cli.main import main

CASES = Path(__file__).resolve().parents[1] / "cases"
FORMS = ("text", "json", "github", "sarif")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, shared_store: str) -> Path:
    """Return the cases about names, in a separate repository, which is the working folder."""
    monkeypatch.setenv("THINGC_STORE", shared_store)
    (tmp_path / ".git").mkdir()
    shutil.copy(CASES / "thingc.toml", tmp_path)
    for name in ("parts", "names"):
        shutil.copytree(CASES / name, tmp_path / name)
    for side, example in read_page(Code.UNKNOWN_COMPONENT).examples.items():
        (tmp_path / f"{side}.yaml").write_text(example.files[example.document])
    unpack(read_page(Code.PART_WARNING), "wrong", tmp_path / "remark")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def said(capsys: pytest.CaptureFixture[str], words: Sequence[str]) -> tuple[int, dict[str, list[str]], str]:
    """Return the exit code, the codes in each format in order, and standard error of the text format."""
    codes, forms, err = set(), {}, ""
    for form in FORMS:
        capsys.readouterr()
        codes.add(main([*words, "--format", form]))
        printed = capsys.readouterr()
        if form == "text":
            err = printed.err
            forms[form] = re.findall(r"^(?:error|warning)\[(TC\d+)\]", printed.out + printed.err, re.MULTILINE)
        elif form == "json":
            forms[form] = [entry["code"] for entry in json.loads(printed.out)["diagnostics"]]
        elif form == "github":
            forms[form] = [parsed(line)[1]["title"] for line in printed.out.splitlines()]
        else:
            run = checked(printed.out)
            invocation = run["invocations"][0]
            told = [result["ruleId"] for result in run["results"]]
            for kind in ("toolConfigurationNotifications", "toolExecutionNotifications"):
                told += [notification["descriptor"]["id"] for notification in invocation.get(kind, [])]
            forms[form] = told
    (code,) = codes
    return code, forms, err


@pytest.mark.parametrize(("words", "code"), [
    (["check", "names/mount.yaml"], 1), (["check", "names/mount.yaml", "wrong.yaml"], 1),
    (["check", "right.yaml"], 0),
    (["check", "remark/robot.yaml"], 0), (["build", "names/mount.yaml", "-o", "out"], 1), (["check", "nothing.yaml"], 2),
    (["check", "wrong.yaml", "-p", "x"], 2), (["check", "--speed", "3"], 2), (["chek", "wrong.yaml"], 2),
    (["build", "right.yaml", "--mode", "nmae"], 2),
    (["build", "right.yaml", "--emit", "bom", "-o", "out"], 0),
])
def test_all_formats_report_the_same_codes(words: list[str], code: int, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    exit_code, forms, _ = said(capsys, words)
    assert exit_code == code
    assert forms["text"] == forms["json"] == forms["github"] == forms["sarif"]
    assert bool(forms["text"]) == (code != 0 or "remark" in words[1])


def test_cached_result_is_available_in_all_formats(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A warning is cached with the stamp of the document. The second run reads it from there, in any format."""
    words = ["check", "remark/robot.yaml"]
    assert main(words) == 0
    monkeypatch.setattr("thingc.driver.pipeline.check", lambda *_, **__: pytest.fail("the stamp should have answered"))
    exit_code, forms, _ = said(capsys, words)
    assert exit_code == 0 and list(forms.values()) == [["TC406"]] * 4


@pytest.mark.defect
def test_internal_error_is_reported_in_the_requested_format(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch,
) -> None:
    def defect(*_: object, **__: object) -> None:
        raise ZeroDivisionError("division by zero")

    monkeypatch.setattr("thingc.driver.pipeline.check", defect)
    (folder / "wrong.yaml").write_text("thingc: assembly/1\nname: never_seen_before\ncomponents: {}\n")
    exit_code, forms, _ = said(capsys, ["check", "wrong.yaml"])
    assert exit_code == 1 and list(forms.values()) == [["TC899"]] * 4


def test_unsupported_format_is_refused_in_text(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", "right.yaml", "--format", "sarif"]) == 2
    printed = capsys.readouterr()
    assert printed.out == "" and "expected `text` or `json`, found `sarif`" in printed.err


def printed_on_terminal(words: Sequence[str], environment: dict[str, str]) -> str:
    """Return the output of `thingc` when its standard output is a pseudo-terminal."""
    master, slave = pty.openpty()
    try:
        subprocess.run([sys.executable, "-m", "thingc", *words], stdout=slave, stderr=slave, env=environment, check=False, timeout=60)
        os.close(slave)
        slave = -1
        text = b""
        with contextlib.suppress(OSError):  # Linux: EIO at the end
            while more := os.read(master, 65536):
                text += more
    finally:
        os.close(master)
        if slave >= 0:
            os.close(slave)
    return text.decode().replace("\r\n", "\n")


PLAIN = "error[TC302]: this document has no component `plaet`\n"


def test_colours_are_used_only_on_terminals(folder: Path) -> None:
    environment = {key: value for key, value in os.environ.items() if key != "NO_COLOR"}
    words = ["check", "wrong.yaml"]
    colored = printed_on_terminal(words, environment)
    assert "\x1b[1;31merror[TC302]\x1b[0m" in colored
    plain = re.sub(r"\x1b\[[\d;]*[mK]", "", colored)
    assert PLAIN in plain and "^^^^^^^^^" in plain
    assert printed_on_terminal(words, {**environment, "NO_COLOR": "1"}).count("\x1b[1;31m") == 0
    piped = subprocess.run([sys.executable, "-m", "thingc", *words], capture_output=True, text=True, env=environment, timeout=60)
    assert piped.stdout.startswith(PLAIN) and "\x1b" not in piped.stdout


@pytest.mark.parametrize("form", ["json", "github", "sarif"])
def test_machine_readable_formats_have_no_colours(form: str, folder: Path) -> None:
    environment = {key: value for key, value in os.environ.items() if key != "NO_COLOR"}
    (folder / "bare.yaml").write_text("thingc: assembly/1\nname: bare\ncomponents: {a: {frame: true}, b: {frame: true}}\n")
    printed = printed_on_terminal(["check", "bare.yaml", "--format", form], environment)
    assert "TC322" in printed and "\x1b[1;31m" not in printed


@pytest.mark.parametrize(("fault", "help"), [
    (FileExistsError(17, "File exists", "build"), "move or delete the existing file"),
    (PermissionError(13, "Permission denied", "build"), "change the permissions, or choose another folder"),
    (OSError(28, "No space left on device", "build"), "free disk space, or use another folder"),
    (OSError(30, "Read-only file system", "build"), "change the permissions, or choose another folder"),
])
def test_operating_system_errors_have_a_hint(fault: OSError, help: str) -> None:
    said = of_exception(fault)
    assert (said.code, said.message, said.help) == (Code.OUTPUT, f"`build`: {fault.strerror}", help)


@pytest.mark.parametrize(("words", "said"), [
    (["add", "part", "Bracket"], "cannot write `parts/bracket.py`: file too large"),
    (["add", "assembly", "leg"], "cannot write `leg.yaml`: file too large"),
    (["lock"], "cannot write a file: File too large"), (["schema"], "cannot write a file: File too large"),
    (["check", "--format", "json"], "cannot write a file: File too large"),
], ids=lambda value: " ".join(value[:2]) if isinstance(value, list) else "")
def test_full_disk_is_a_user_error_and_leaves_no_files(words: list[str], said: str, tmp_path: Path, shared_store: str) -> None:
    """The system refuses to write any byte (RLIMIT_FSIZE is 0), and does not report for which file."""
    (tmp_path / "thingc.toml").write_text('thingc = "workspace/1"\n')
    (tmp_path / "robot.yaml").write_text("thingc: assembly/1\nname: robot\ncomponents: {base: {frame: true}}\n")
    with open(tmp_path / "printed", "wb") as printed:
        done = subprocess.run(
            [sys.executable, "-P", "-m", "thingc", *words], cwd=tmp_path, stdout=printed, stderr=subprocess.PIPE, text=True, timeout=60,
            env={**os.environ, "THINGC_STORE": shared_store}, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0)),
        )
    assert done.returncode == 2 and "Traceback" not in done.stderr
    assert done.stderr.splitlines()[-4:] == [
        f"error[TC805]: {said}", "  help: free disk space, or use another folder", "", "1 error",
    ]
    left = sorted(str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*") if path.is_file())
    assert left == ["printed", "robot.yaml", "thingc.toml"] and not (tmp_path / "parts").exists()
