"""Wrong documents, and exactly what a person reads about each.

Every document `<area>/<name>.yaml` (or `.toml`) is a case, unless its name begins with `_` (those are used by others); beside
it `<name>.txt` holds what `thingc check <name>.yaml` prints when it is run in the document's folder, and the exit code.
A first line `# $ thingc build bad.yaml -p 'reach=3 kg'` gives another command.

`REGENERATE=1 pytest tests/cases` writes the texts anew: read the difference as the person at the keyboard would.
"""

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
"""Depends on what the store holds already."""

_SECONDS = re.compile(r"  \d+\.\d\d s$", re.MULTILINE)
"""How long a test of a document took."""


def command_of(document: Path) -> list[str]:
    """The words of the command line behind `thingc`."""
    with document.open("rb") as stream:
        first = stream.readline(1000).decode("latin-1").removeprefix("\xef\xbb\xbf").strip()
    if first.startswith("# $ thingc "):
        return shlex.split(first.removeprefix("# $ thingc "))
    return ["check", document.name]


def said(words: list[str]) -> tuple[str, int]:
    """What a command prints, standard output before standard error, and its exit code."""
    with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as err:
        code = main(words)
    return _SECONDS.sub("  0.00 s", out.getvalue()) + _PROGRESS.sub("", err.getvalue()), code


@pytest.mark.parametrize("document", DOCUMENTS, ids=NAMES)
def test_what_is_said_is_word_for_word_what_was_agreed(
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


def test_every_text_belongs_to_a_document() -> None:
    assert {str(path.relative_to(HERE).with_suffix("")) for path in HERE.rglob("*.txt")} == set(NAMES)


def test_no_text_shows_the_inside_of_the_compiler() -> None:
    inside = re.compile(r"Traceback|pydantic|NoneType|KeyError|validation error|errors\.pydantic|object at 0x|<class")
    assert [name for name, text in TEXTS.items() if inside.search(text)] == []


def test_no_text_has_an_absolute_path() -> None:
    assert [name for name, text in TEXTS.items() if str(HERE.parent) in text or re.search(r"--> /", text)] == []


def test_every_error_has_a_place_unless_it_is_of_the_command_line() -> None:
    usage = {code.code for code in USAGE_CODES}
    homeless = []
    for name, text in TEXTS.items():
        lines = text.splitlines()
        for at, line in enumerate(lines):
            found = re.match(r"(?:error|warning)\[(TC\d+)\]", line)
            if found and found.group(1) not in usage and not lines[at + 1].lstrip().startswith("--> "):
                homeless.append((name, line))
    assert homeless == []


def test_every_caret_stands_under_something() -> None:
    """A caret under blank space points at nothing (a place where something is missing is one column)."""
    astray = []
    for name, text in TEXTS.items():
        for line, below in zip(text.splitlines(), text.splitlines()[1:]):
            shown, caret = re.match(r"  \d+ \| (.*)$", line), re.match(r"  +\| (\s*)(\^+)$", below)
            if shown and caret:
                under = shown.group(1)[len(caret.group(1)) : len(caret.group(1)) + len(caret.group(2))]
                if not under.strip() and len(caret.group(2)) > 1:
                    astray.append((name, line))
    assert astray == []


def test_the_closing_line_counts_what_was_said() -> None:
    for name, text in TEXTS.items():
        for severity in ("error", "warning"):
            number = len(re.findall(rf"^{severity}\[", text, re.MULTILINE))
            counted = re.findall(rf"^(?:.*, )?(\d+) {severity}s?(?:, .*)?$", text, re.MULTILINE)
            assert counted == ([str(number)] if number else []), name


def test_json_says_the_same(shared_store: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The machine's answer has the contract's keys and the codes, places and words of the text."""
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
