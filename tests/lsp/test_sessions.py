"""Real editing sessions, as transcripts: what somebody does, and, indented, what is said then of each file of which something else is said.

`REGENERATE=1 pytest tests/lsp/test_sessions.py` writes them anew: read the difference. What is done:

    file NAME                     the lines behind it, with `| ` before each, are a file on the disk (beside those of `live/documents.py`)
    open NAME, close NAME
    type NAME "OLD" "NEW"         the text OLD goes, as far as NEW is another, which is typed letter by letter: every letter is answered
    act NAME "WORD" "TITLE"       asks for code actions where WORD stands; all are listed, and the one that begins with TITLE is done
    format NAME                   formats it
    show NAME "WORD"              the lines of its text that have the word
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from live.documents import write
from lsp.editor import Editor, lines

FOLDER = Path(__file__).parent / "sessions"


@pytest.fixture(scope="module")
def editor(shared_store: str) -> Iterator[Editor]:
    editor = Editor(shared_store)
    yield editor
    assert editor.leave() == 0


class Session:
    """One transcript, played in a folder of its own."""

    def __init__(self, editor: Editor, folder: Path) -> None:
        self.editor, self.folder = editor, folder
        self.texts: dict[Path, str] = {}
        self.now: dict[str, list[str]] = {}
        self.said: dict[str, list[str]] = {}
        write(folder)

    def play(self, transcript: str) -> str:
        """The transcript with what was said."""
        played = []
        for step in re.split(r"\n(?=[^\s|])", transcript.strip()):
            command = "\n".join(line for line in step.split("\n") if not line.startswith("  "))
            played.append("\n".join([command, *(f"  {line}" for line in self.step(command))]))
        for path in list(self.texts):
            self.editor.close(path)
        return "\n".join(played) + "\n"

    def step(self, command: str) -> list[str]:
        """What a step says."""
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
        """Change a text as an editor does: all places are those of the text before."""
        text = self.texts[path]
        starts = [0, *(found.end() for found in re.finditer("\n", text))]

        def index(position: Any) -> int:
            return min(starts[position.line] + position.character, len(text)) if position.line < len(starts) else len(text)

        for edit in sorted(edits, key=lambda one: (-one.range.start.line, -one.range.start.character)):
            text = text[: index(edit.range.start)] + edit.new_text + text[index(edit.range.end):]
        self.change(path, text)

    def heard(self, since: int) -> list[str]:
        """Of which files something else is said now."""
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
def test_session(editor: Editor, tmp_path: Path, name: str) -> None:
    transcript = (FOLDER / f"{name}.txt").read_text()
    played = Session(editor, tmp_path).play(transcript)
    if os.environ.get("REGENERATE"):
        (FOLDER / f"{name}.txt").write_text(played)
    assert played == (FOLDER / f"{name}.txt").read_text()
