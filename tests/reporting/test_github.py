"""GitHub annotations, parsed with a second implementation of the rules of the runner."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from reporting.reports import every_shape, on_one_line, repository
from thingc.base.diagnostics import Severity
from thingc.tools.cli.main import main
from thingc.tools.reporting.ci_formats import as_github


def parsed(line: str) -> tuple[str, dict[str, str], str]:
    """Return command, properties and message as the runner's ActionCommand parses them: split first, then unescape, `%25` last."""
    head = re.fullmatch(r"::([a-z]+) ([^\n]*?)::([^\n]*)", line)
    assert head is not None, line
    properties = {}
    for entry in head.group(2).split(","):
        key, _, value = entry.partition("=")
        properties[key] = unescaped(value, {"%3A": ":", "%2C": ","})
    return head.group(1), properties, unescaped(head.group(3), {})


def unescaped(text: str, more: dict[str, str]) -> str:
    for written, meant in {"%0D": "\r", "%0A": "\n", **more, "%25": "%"}.items():
        text = text.replace(written, meant)
    return text


def test_every_diagnostic_round_trips(tmp_path: Path) -> None:
    folder = repository(tmp_path)
    diagnostics = every_shape(folder)
    lines = as_github(diagnostics, base=str(folder)).splitlines()
    assert len(lines) == len(diagnostics)
    for line, diagnostic in zip(lines, diagnostics):
        command, properties, message = parsed(line)
        assert command == {Severity.ERROR: "error", Severity.WARNING: "warning", Severity.NOTE: "notice"}[diagnostic.severity]
        assert properties["title"] == diagnostic.code.code
        assert message.startswith(on_one_line(diagnostic.message))
        assert diagnostic.help is None or message.endswith(f"\nhelp: {diagnostic.help}")
        assert all(f"note: {note.message}" in message for note in diagnostic.notes)
        place = diagnostic.span
        if place is None:
            assert set(properties) == {"title"}
            continue
        assert (folder / properties["file"]).resolve() == Path(place.file)
        assert (int(properties["line"]), int(properties["endLine"])) == (place.line, place.end_line)
        # GitHub takes columns of one line only, and both or none.
        one_line = place.line == place.end_line and place.column != place.end_column
        assert ("col" in properties) == ("endColumn" in properties) == one_line
        if one_line:
            assert (int(properties["col"]), int(properties["endColumn"])) == (place.column, place.end_column)
    assert "note: written here (work/a b,c%d#é.yaml:1:1)" in parsed(lines[0])[2]


def test_files_are_relative_to_the_repository(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:
    folder = repository(tmp_path)
    (folder / "work" / "robot.yaml").write_text("thingc: assembly/1\nname: two\ncomponents:\n  plate: {frame: tru}\n")
    for started, word in ((folder / "work", "robot.yaml"), (folder, "work/robot.yaml")):
        monkeypatch.chdir(started)
        assert main(["check", word, "--format", "github", "--store", str(tmp_path / "store")]) == 1
        assert parsed(capsys.readouterr().out.rstrip("\n"))[1]["file"] == "work/robot.yaml"


def test_valid_document_prints_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(repository(tmp_path) / "work")
    assert main(["check", "robot.yaml", "--format", "github", "--store", str(tmp_path / "store")]) == 0
    assert capsys.readouterr().out == ""
