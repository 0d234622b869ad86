"""Invalid documents, and the exact output for each of them. Every document `<area>/<name>.yaml` (or `.toml`) is a case, unless its name
begins with `_` (such documents are used by others). The file `<name>.txt` beside it contains the output of `thingc check <name>.yaml`
in the folder of the document, and the exit code. A first line `# $ thingc build bad.yaml -p 'reach=3 kg'` sets another command.
`REGENERATE=1 pytest tests/cases` writes the files again. Read the differences like a user."""

from __future__ import annotations

import contextlib
import io
import json
import os
import re
import shlex
from pathlib import Path

import pytest

from thingc.tools.cli.console import USAGE_CODES
from thingc.tools.cli.main import main
from thingc.tools.reporting.explain import explanations

HERE = Path(__file__).resolve().parent
SETTINGS = ("thingc.toml", "pyproject.toml")

DOCUMENTS = sorted(
    path for path in HERE.rglob("*")
    if path.suffix in (".yaml", ".yml", ".toml") and path.is_file() and path.name not in SETTINGS and path.name[0] != "_"
)
NAMES = [str(path.relative_to(HERE).with_suffix("")) for path in DOCUMENTS]

_PROGRESS = re.compile(r"^(modelling|decomposing|slicing) parts: .*\n", re.MULTILINE)
"""Depends on the content of the store."""

_SECONDS = re.compile(r"  \d+\.\d\d s$", re.MULTILINE)
"""The duration of a test of a document."""


def command_of(document: Path) -> list[str]:
    """Return the words of the command line after `thingc`."""
    with document.open("rb") as stream:
        first = stream.readline(1000).decode("latin-1").removeprefix("\xef\xbb\xbf").strip()
    if first.startswith("# $ thingc "):
        return shlex.split(first.removeprefix("# $ thingc "))
    return ["check", document.name]


def said(words: list[str]) -> tuple[str, int]:
    """Return the output of a command, standard output before standard error, and its exit code."""
    with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as err:
        code = main(words)
    return _SECONDS.sub("  0.00 s", out.getvalue()) + _PROGRESS.sub("", err.getvalue()), code


@pytest.mark.parametrize("document", DOCUMENTS, ids=NAMES)
def test_output_equals_the_file(
    document: Path, shared_store: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("THINGC_STORE", shared_store)
    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.chdir(document.parent)
    printed, code = said(command_of(document))
    text = f"{printed}exit {code}\n"
    agreed = document.with_suffix(".txt")
    if os.environ.get("REGENERATE"):
        agreed.write_text(text)
    name = document.relative_to(HERE).with_suffix("")
    again = f"if it is right: REGENERATE=1 .venv/bin/pytest tests/cases -k {name}, and read the difference"
    assert agreed.exists() and text == agreed.read_text(), again


TEXTS = {name: document.with_suffix(".txt").read_text() for name, document in zip(NAMES, DOCUMENTS)
         if document.with_suffix(".txt").exists()}
TEXTS |= {
    f"{code['code']} {side}": example["said"] for code in explanations() for side in ("wrong", "right") if (example := code[side])
}
"""What is said of each document, and of the examples on the pages of the codes."""


def test_every_output_file_has_a_document() -> None:
    assert {str(path.relative_to(HERE).with_suffix("")) for path in HERE.rglob("*.txt")} == set(NAMES)


def test_outputs_contain_no_internals() -> None:
    inside = re.compile(r"Traceback|pydantic|NoneType|KeyError|validation error|errors\.pydantic|object at 0x|<class")
    assert [name for name, text in TEXTS.items() if inside.search(text)] == []


def test_outputs_contain_no_absolute_paths() -> None:
    assert [name for name, text in TEXTS.items() if str(HERE.parent) in text or re.search(r"--> /", text)] == []


def test_errors_have_locations() -> None:
    usage = {code.code for code in USAGE_CODES}
    homeless = []
    for name, text in TEXTS.items():
        lines = text.splitlines()
        for at, line in enumerate(lines):
            found = re.match(r"(?:error|warning)\[(TC\d+)\]", line)
            if found and found.group(1) not in usage and not lines[at + 1].lstrip().startswith("--> "):
                homeless.append((name, line))
    assert homeless == []


def test_carets_point_at_text() -> None:
    """A caret below blanks points at nothing. The location of a missing element is one column wide."""
    astray = []
    for name, text in TEXTS.items():
        for line, below in zip(text.splitlines(), text.splitlines()[1:]):
            shown, caret = re.match(r"  \d+ \| (.*)$", line), re.match(r"  +\| (\s*)(\^+)$", below)
            if shown and caret:
                under = shown.group(1)[len(caret.group(1)) : len(caret.group(1)) + len(caret.group(2))]
                if not under.strip() and len(caret.group(2)) > 1:
                    astray.append((name, line))
    assert astray == []


def test_last_line_counts_the_diagnostics() -> None:
    for name, text in TEXTS.items():
        for severity in ("error", "warning"):
            number = len(re.findall(rf"^{severity}\[", text, re.MULTILINE))
            counted = re.findall(rf"^(?:.*, )?(\d+) {severity}s?(?:, .*)?$", text, re.MULTILINE)
            assert counted == ([str(number)] if number else []), name


def test_json_output_agrees_with_text(shared_store: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The JSON output has the documented keys, and the codes, locations and messages of the text."""
    monkeypatch.setenv("THINGC_STORE", shared_store)
    for name in ("several/everything_at_once", "spec/unknown_keys", "load/empty"):
        document = HERE / f"{name}.yaml"
        monkeypatch.chdir(document.parent)
        with contextlib.redirect_stdout(io.StringIO()) as out:
            code = main([*command_of(document), "--format", "json"])
        answer = json.loads(out.getvalue())
        assert set(answer) == {"diagnostics"}
        shown = TEXTS[name]
        assert shown.endswith(f"exit {code}\n")
        heads = []
        for entry in answer["diagnostics"]:
            assert set(entry) == {"code", "severity", "message", "file", "line", "column", "path", "help", "notes", "fixes"}
            assert all(set(note) == {"message", "file", "line", "column"} for note in entry["notes"])
            heads.append((f"{entry['severity']}[{entry['code']}]: {entry['message']}",
                          f"{entry['file']}:{entry['line']}:{entry['column']}"))
        assert heads == re.findall(r"^((?:error|warning)\[.*)\n +--> (.*)$", shown, re.MULTILINE)
