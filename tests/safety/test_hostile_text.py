"""Names, texts and file names that contain terminal escape sequences or invisible characters: no command prints or writes them
unescaped."""

from __future__ import annotations

import json
import os
import pty
import subprocess
from collections.abc import Sequence
from pathlib import Path

import pytest
from harness import THINGC, environment

from thingc.tools.cli.main import main

TEXT = "\x1b[31m\x1b]0;owned\x07\x9b1m\u202e\u2067\u200b\r\n\n::error::forged\n"
EVIL = TEXT + "\ud800"
"""The text with a lone surrogate: a valid Python string that cannot be printed or used in a docstring."""
IN_YAML = r"\e[31m\e]0;owned\a\x9b1m\u202e\u2067\u200b\r\n\n::error::forged\n"
"""`TEXT` as a double-quoted YAML string."""

PART = f'''\
import sys
import warnings

from build123d import Box, Location
from thingc import MountPoint, Thing


class Odd(Thing):
    """{TEXT.encode("unicode_escape").decode()}"""

    bom = {{"make": "buy", "number": "=1+1", "supplier": {EVIL!r}, "cost": "0.50 EUR", "name": "@SUM(A1)"}}

    def __init__(self, text: str = "a"):
        super().__init__(material="abs")
        self.text = text
        self.tip = MountPoint(Location((0, 0, 5)))

    def result(self):
        print({TEXT!r})
        print({TEXT!r}, file=sys.stderr)
        warnings.warn({EVIL!r})
        if self.text == "fail":
            raise ValueError({EVIL!r})
        return Box(10, 10, 10)
'''
ROBOT = rf"""
thingc: assembly/1
name: odd
materials: {{abs: {{density: 1050 kg/m^3, color: red}}}}
components:
  a: {{part: odd:Odd, params: {{text: "{IN_YAML}"}}}}
modes:
  m: {{root: a, base: fixed}}
tests:
  heavy: {{mass: {{min: 5 kg}}}}
"""
WRONG = rf"""
thingc: assembly/1
name: odd
"{IN_YAML}": 1
materials: ["{IN_YAML}"]
components:
  a: {{part: "q{IN_YAML}:X"}}
  b: {{part: odd:Odd, params: {{text: fail, "{IN_YAML}": 1}}, attach: {{tip: "a.{IN_YAML}"}}}}
  c: {{part: odd:Odd, params: {{text: fail}}, attach: {{tip: a.tip}}}}
  d: {{file: "{IN_YAML}", attach: {{tip: a.tip}}}}
joints: {{"{IN_YAML}": {{type: "{IN_YAML}"}}}}
"""
VARIANTS = r"""
thingc: variants/1
name: many
assembly: odd.yaml
list: [{choices: {components.a.part: odd:Odd}}]
"""


@pytest.fixture
def hostile(tmp_path: Path, shared_store: str, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a workspace in which all user-defined names and texts are hostile. It is the working folder."""
    folder = tmp_path / "a\x1b[31m\nb\u202e"
    (folder / "parts").mkdir(parents=True)
    (folder / "parts" / "odd.py").write_text(PART)
    for name, text in (("odd", ROBOT), ("wrong", WRONG), ("many", VARIANTS)):
        (folder / f"{name}.yaml").write_text(text.lstrip())
    (folder / "bad\x1b[31m\n.yaml").write_text(ROBOT.lstrip())
    monkeypatch.setenv("THINGC_STORE", shared_store)
    monkeypatch.chdir(folder)
    return folder


def printed(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str]:
    """Return the exit code and the combined output of a command."""
    capsys.readouterr()
    code = main(words)
    out, err = capsys.readouterr()
    return code, out + err


def harmless(text: str) -> None:
    """Assert that all characters are printable, that no text starts a new line, and that no internal error occurred."""
    hidden = [line for line in text.split("\n") if not line.replace("\t", " ").isprintable()]
    assert hidden == []
    assert "\n::error::forged" not in text and "\nforged" not in text
    assert "TC899" not in text


COMMANDS: list[Sequence[str]] = [
    *(["check", document, "--format", form] for document in ("wrong.yaml", "odd.yaml") for form in ("text", "json", "github", "sarif")),
    ["check", "wrong.yaml", "--debug"], ["check", "bad\x1b[31m\n.yaml"], ["check", "no\x1b[31m\n.yaml"], ["check", "--fix", "wrong.yaml"],
    ["check", "--fix", "--diff", "wrong.yaml"],
    *(["build", document, "--format", form] for document in ("wrong.yaml", "odd.yaml") for form in ("text", "json", "github", "sarif")),
    *(["info", "odd.yaml", "--format", form] for form in ("text", "json")), ["info", "odd.yaml", "--mates"],
    *(["hag", "odd.yaml", "--format", form] for form in ("text", "dot", "mermaid", "svg")),
    *(["test", "odd.yaml", "--format", form] for form in ("text", "json", "junit")), ["test", "odd.yaml", "--only", "\x1b[31m\n"],
    *(["parts", "odd", "--format", form] for form in ("text", "json")), ["parts", "\x1b[31m\n"],
    ["why", "odd.yaml", "a"], ["why", "odd.yaml", "--losses"], ["why", "odd.yaml", "\x1b[31m\n"],
    *(["diff", "odd.yaml", "wrong.yaml", "--format", form] for form in ("text", "json", "markdown")),
    ["diff", "\x1b[31m\n"], ["diff", "--fail-on", "\x1b[31m\n"],
    ["touched", "--all"], ["touched", "--all", "--format", "json"], ["touched", "--since", "\x1b[31m\n"],
    ["fmt", "--diff", "."], ["fmt", "--check", "."], ["fmt", "."], ["lock"], ["lock", "--check"], ["schema", "--no-model"],
    *(["batch", "many.yaml", "--dry-run", "--format", form] for form in ("text", "json")),
    ["explain", "\x1b[31m\n"], ["\x1b[31m\n"], ["check", "odd.yaml", "--\x1b[31m\n"], ["check", "odd.yaml", "-p", "\x1b[31m\n"],
    ["check", "odd.yaml", "-p", "x\u202e=1"], ["check", "odd.yaml", "--set", "\x1b[31m=\u202e"],
    ["build", "odd.yaml", "--emit", "\x1b[31m"], ["build", "odd.yaml", "--mode", "\x1b[31m"], ["build", "odd.yaml", "-o", "out\x1b[31m\n"],
]


@pytest.mark.parametrize("words", COMMANDS, ids=lambda words: " ".join(words).encode("unicode_escape").decode())
def test_commands_escape_hostile_text(hostile: Path, capsys: pytest.CaptureFixture[str], words: list[str]) -> None:
    code, text = printed(capsys, *words)
    assert text or words[0] == "lock"
    harmless(text)
    if "json" in words or "sarif" in words:
        json.loads("{" + text.partition("{")[2].rpartition("}")[0] + "}")
    if words[:2] == ["check", "wrong.yaml"] and "--format" not in words:
        assert code == 1 and "q\\x1b[31m\\x1b]0;owned\\x07\\x9b1m\\u202e\\u2067\\u200b\\r\\n" in text


def test_check_without_code_escapes_a_hostile_lock_file(hostile: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (hostile / "bad\x1b[31m\n.yaml").unlink()
    (hostile / "wrong.yaml").unlink()
    assert printed(capsys, "lock")[0] == 0
    lock = hostile / "parts.lock.json"
    harmless(lock.read_text())
    ran = subprocess.run([THINGC, "check", "--no-code", "odd.yaml"], capture_output=True, text=True, env=environment())
    assert ran.returncode == 0
    harmless(ran.stdout + ran.stderr)
    held = lock.read_text()
    lock.write_text(held.replace('"odd:Odd', '"\\u001b[31m\\n\\ud800odd:Odd').replace('"abs"', '"\\u001b[31m\\u202e"'))
    ran = subprocess.run([THINGC, "check", "--no-code", "odd.yaml"], capture_output=True, text=True, env=environment())
    assert ran.returncode == 1
    harmless(ran.stdout + ran.stderr)


def test_written_files_are_escaped(hostile: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """Every text file of a build, a batch, a lock and the editor schemas: these may be printed in a terminal, too."""
    monkeypatch.setenv("THINGC_STORE", str(hostile.parent / "store"))  # the journal of the batch has what the part prints
    for words in (["batch", "many.yaml", "--pictures", "none", "--jobs", "1"], ["build", "odd.yaml"], ["schema", "--no-model"]):
        code, text = printed(capsys, *words)
        assert code == 0, text
        harmless(text)
    seen = 0
    for path in (*hostile.rglob("build/**/*"), *hostile.rglob(".thingc/**/*")):
        if path.is_file() and path.suffix in (".csv", ".json", ".jsonl", ".html", ".xml", ".svg", ".dot", ".mmd", ".obj", ".step", ".md"):
            text = path.read_text().replace("\r\n", "\n")
            assert all(line.replace("\t", " ").isprintable() for line in text.split("\n")), path.name
            seen += 1
    assert seen > 12


def test_terminal_receives_only_own_escape_sequences(hostile: Path) -> None:
    """thingc itself uses escape sequences for colours and the progress line."""
    parent, child = pty.openpty()
    process = subprocess.Popen([THINGC, "check", "wrong.yaml", "odd.yaml"], stdout=child, stderr=child, env=environment(TERM="xterm"))
    os.close(child)
    text = b""
    while True:
        try:
            data = os.read(parent, 65536)
        except OSError:
            break
        if not data:
            break
        text += data
    assert process.wait() == 1
    plain = text.decode().replace("\r\n", "\n")
    for own in ("\x1b[1;31m", "\x1b[1;33m", "\x1b[1;36m", "\x1b[1;32m", "\x1b[1m", "\x1b[0m", "\r\x1b[K"):
        plain = plain.replace(own, "")
    assert "\\x1b[31m" in plain
    harmless(plain)


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "utf-8"])
def test_terminal_with_limited_encoding(hostile: Path, encoding: str) -> None:
    (hostile / "odd.yaml").write_text(ROBOT.lstrip().replace("odd:Odd", "odd:Ödd漢"))
    ran = subprocess.run([THINGC, "check", "odd.yaml"], capture_output=True, env=environment(PYTHONIOENCODING=encoding, LC_ALL="C"))
    text = ran.stdout.decode(encoding)
    assert ran.returncode == 1 and "TC899" not in text
    assert {"ascii": r"\xd6dd\u6f22", "latin-1": r"Ödd\u6f22", "utf-8": "Ödd漢"}[encoding] in text
