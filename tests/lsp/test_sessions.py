"""Editing sessions as transcripts: the steps and, indented, the new diagnostics of every file whose diagnostics have changed.

`REGENERATE=1 pytest tests/lsp/test_sessions.py` rewrites the transcripts: review the difference.

A transcript contains these steps:

`file NAME` writes the following lines, each with the prefix `| `, to a file on disk (next to those of `live/documents.py`).

`open NAME` and `close NAME` open and close a document.

`type NAME "OLD" "NEW"` deletes the part of OLD that differs from NEW, and types that of NEW letter by letter; every letter is answered.

`act NAME "WORD" "TITLE"` requests code actions at WORD, lists all of them, and applies the one that starts with TITLE.

`format NAME` formats a document.

`show NAME "WORD"` prints the lines of its text that contain the word."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path
from typing import Any

import pytest

from live.documents import write
from lsp.editor import Editor, lines

FOLDER = Path(__file__).parent / "sessions"


class Session:
    """Plays one transcript in its own folder."""

    def __init__(self, editor: Editor, folder: Path) -> None:
        self.editor, self.folder = editor, folder
        self.texts: dict[Path, str] = {}
        self.now: dict[str, list[str]] = {}
        self.said: dict[str, list[str]] = {}
        write(folder)

    def play(self, transcript: str) -> str:
        """Return the transcript with the recorded responses."""
        played = []
        for step in re.split(r"\n(?=[^\s|])", transcript.strip()):
            command = "\n".join(line for line in step.split("\n") if not line.startswith("  "))
            played.append("\n".join([command, *(f"  {line}" for line in self.step(command))]))
        for path in list(self.texts):
            self.editor.close(path)
        return "\n".join(played) + "\n"

    def step(self, command: str) -> list[str]:
        """Return the response to a step."""
        if command.startswith("#"):
            return []
        verb, name, *words = re.findall(r'"(?:[^"\\]|\\.)*"|\S+', command.split("\n")[0])
        path, (old, new, *_) = self.folder / name, ([*(json.loads(word) for word in words), "", ""])
        if verb == "file":
            path.write_text("".join(line.removeprefix("| ").removeprefix("|") + "\n" for line in command.split("\n")[1:]))
            return []
        if verb == "show":
            return [line for line in self.texts[path].splitlines() if old in line]
        since = len(self.editor.published)
        listed: list[str] = []
        if verb == "open":
            self.texts[path] = path.read_text()
            self.editor.open(path)
        elif verb == "close":
            del self.texts[path]
            self.editor.close(path)
            self.editor.wait(lambda one: one.uri == path.as_uri() and one.version is None, since)
        elif verb == "type":
            before, found, after = self.texts[path].partition(old)
            assert found and old not in after, f"{old!r} stands once"
            kept = len(os.path.commonprefix([old, new]))
            if kept < len(old):
                self.change(path, before + old[:kept] + after)
            for typed in range(kept + 1, len(new) + 1):
                self.change(path, before + new[:typed] + after)
        elif verb == "act":
            offered = self.request("textDocument/codeAction", path, range=self.at(path, old), context={"diagnostics": []})
            listed = [f"{'* ' if one.is_preferred else '- '}{one.title}" for one in offered]
            chosen = next((one for one in offered if one.title.startswith(new)), None)
            assert chosen is not None, f"{command}: {offered}, {self.now}"
            (uri, edits), = chosen.edit.changes.items()
            assert uri == path.as_uri()
            self.apply(path, edits)
        elif verb == "format":
            self.apply(path, self.request("textDocument/formatting", path, options={"tabSize": 2, "insertSpaces": True}))
        else:
            raise AssertionError(f"no such step: {verb}")
        return [*listed, *self.heard(since)]

    def change(self, path: Path, text: str) -> None:
        self.texts[path] = text
        self.editor.type(path, text)

    def request(self, method: str, path: Path, **params: Any) -> Any:
        return self.editor.request(method, {"textDocument": {"uri": path.as_uri()}, **params})

    def at(self, path: Path, word: str) -> dict[str, Any]:
        before = self.texts[path].partition(word)[0]
        position = {"line": before.count("\n"), "character": len(before.rpartition("\n")[2])}
        return {"start": position, "end": position}

    def apply(self, path: Path, edits: Any) -> None:
        """Apply edits as an editor does: all positions refer to the original text."""
        text = self.texts[path]
        starts = [0, *(found.end() for found in re.finditer("\n", text))]

        def index(position: Any) -> int:
            return min(starts[position.line] + position.character, len(text)) if position.line < len(starts) else len(text)

        for edit in sorted(edits, key=lambda one: (-one.range.start.line, -one.range.start.character)):
            text = text[: index(edit.range.start)] + edit.new_text + text[index(edit.range.end):]
        self.change(path, text)

    def heard(self, since: int) -> list[str]:
        """Return the diagnostics of all files whose diagnostics have changed."""
        for _ in range(len(self.texts) + 1):  # each is answered behind one document that is looked at
            self.request("textDocument/formatting", self.folder / "none.txt", options={"tabSize": 2, "insertSpaces": True})
        told = []
        for one in self.editor.published[since:]:
            if one.uri.startswith(self.folder.as_uri()):
                self.now[Path(one.uri).name] = lines(list(one.diagnostics))
        for name, found in sorted(self.now.items()):
            if found != self.said.get(name, []):
                told += [f"{name}:{line}" for line in found] or [f"{name}: nothing any more"]
            self.said[name] = found
        return told


@pytest.mark.parametrize("name", sorted(path.stem for path in FOLDER.glob("*.txt")))
def test_session_matches_its_transcript(editor: Editor, tmp_path: Path, name: str) -> None:
    transcript = (FOLDER / f"{name}.txt").read_text()
    played = Session(editor, tmp_path).play(transcript)
    if os.environ.get("REGENERATE"):
        (FOLDER / f"{name}.txt").write_text(played)
    assert played == (FOLDER / f"{name}.txt").read_text()
