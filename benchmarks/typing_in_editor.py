"""Measure the latency of `thingc lsp` in an editor: the time from a keystroke to its diagnostics, and from a request to its answer."""

from __future__ import annotations

import json
import random
import statistics
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any


class Editor:
    """An editor that is connected to `thingc lsp` through standard input and output."""

    def __init__(self, thingc: str, folder: Path, environment: dict[str, str]) -> None:
        self.process = subprocess.Popen([thingc, "lsp"], cwd=folder, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        self.versions: dict[str, int] = {}
        self.number = 0
        self.able = self.ask("initialize", {"capabilities": {}, "initializationOptions": {"trusted": True}})["capabilities"]
        self.say("initialized", {})

    def say(self, method: str, params: Any, **more: Any) -> None:
        body = json.dumps({"jsonrpc": "2.0", "method": method, "params": params, **more}).encode()
        assert self.process.stdin is not None
        self.process.stdin.write(b"Content-Length: %d\r\n\r\n" % len(body) + body)
        self.process.stdin.flush()

    def hear(self, wanted: Callable[[Any], bool]) -> Any:
        """Return the next message from the server for which `wanted` returns True."""
        assert self.process.stdout is not None
        while True:
            length = 0
            while line := self.process.stdout.readline().strip():
                if line.lower().startswith(b"content-length:"):
                    length = int(line.split(b":")[1])
            if not length:
                raise SystemExit("the language server has ended")
            message = json.loads(self.process.stdout.read(length))
            if wanted(message):
                return message

    def ask(self, method: str, params: Any) -> Any:
        self.number += 1
        self.say(method, params, id=self.number)
        return self.hear(lambda one: one.get("id") == self.number)["result"]

    def put(self, path: Path, text: str) -> list[Any]:
        """Open a file in the language server or change its text, and return the diagnostics of the file."""
        uri, version = path.as_uri(), self.versions.get(path.as_uri(), 0) + 1
        self.versions[uri] = version
        if version == 1:
            document = {"uri": uri, "languageId": "yaml", "version": 1, "text": text}
            self.say("textDocument/didOpen", {"textDocument": document})
        else:
            named = {"uri": uri, "version": version}
            self.say("textDocument/didChange", {"textDocument": named, "contentChanges": [{"text": text}]})
        said = self.hear(lambda one: one.get("method", "").endswith("publishDiagnostics") and one["params"].get("version") == version
                         and one["params"]["uri"] == uri)
        diagnostics: list[Any] = said["params"]["diagnostics"]
        return diagnostics

    def quiet(self, path: Path) -> None:
        """Wait until the server is idle. The server processes one open document before it answers each request."""
        for _ in range(len(self.versions) + 1):
            beside = {"uri": f"{path.as_uri()}.txt"}
            self.ask("textDocument/formatting", {"textDocument": beside, "options": {"tabSize": 2, "insertSpaces": True}})

    def memory(self) -> float:
        """Return the resident memory of the server [MB]."""
        status = Path(f"/proc/{self.process.pid}/status")
        if not status.exists():
            return float("nan")
        return float(status.read_text().split("VmRSS:")[1].split()[0]) / 1024.0

    def leave(self) -> None:
        self.ask("shutdown", None)
        self.say("exit", None)
        if self.process.wait(30.0) != 0:
            raise SystemExit("the language server did not end as it should")


def keystrokes(editor: Editor, path: Path, times: int) -> list[float]:
    """Delete and retype random letters of a document, and return the time [s] from each keystroke to its diagnostics. The result has 2 *
    `times` items.
    """
    text = path.read_text()
    if any(one["severity"] == 1 for one in editor.put(path, text)):
        raise SystemExit(f"{path.name} is not sound")
    chance = random.Random(1)
    words = [place for place in range(len(text) - 1) if text[place].isalpha() and text[place + 1].isalpha()]
    seconds = []
    for _ in range(times):
        place = chance.choice(words)
        for typed in (text[:place] + text[place + 1:], text):  # delete a letter, and type it again
            start = time.perf_counter()
            editor.put(path, typed)
            seconds.append(time.perf_counter() - start)
            time.sleep(0.02)
    editor.quiet(path)
    return seconds


def completions(editor: Editor, path: Path, times: int) -> list[float]:
    """Request completions at random positions of a document. Return the time [s] of each request."""
    lines = path.read_text().split("\n")
    chance = random.Random(2)
    seconds = []
    for _ in range(times):
        line = chance.randrange(len(lines))
        position = {"line": line, "character": chance.randint(0, len(lines[line]))}
        start = time.perf_counter()
        editor.ask("textDocument/completion", {"textDocument": {"uri": path.as_uri()}, "position": position})
        seconds.append(time.perf_counter() - start)
    return seconds


def slowest(seconds: list[float]) -> float:
    """Return the 99th percentile of times [s]."""
    return statistics.quantiles(seconds, n=100)[98]


def rows(
    thingc: str, folder: Path, environment: dict[str, str], document: Path, wide: list[Path], times: int,
) -> list[tuple[str, float, str, float | None]]:
    """Return a name, value, unit and upper bound for each measurement. First, only `document` is open. In the second part, all documents of
    the workspace `wide` are open, and keystrokes in the last document are measured.
    """
    editor = Editor(thingc, folder, environment)
    typed = keystrokes(editor, document, times)
    stroke = statistics.median(typed)
    found: list[tuple[str, float, str, float | None]] = [
        ("minchw: lsp, a keystroke", stroke, "s", 0.060), ("minchw: lsp, 99 % of keystrokes", slowest(typed), "s", 0.200),
    ]
    if "completionProvider" in editor.able:
        found.append(("minchw: lsp, completion", statistics.median(completions(editor, document, times)), "s", 0.030))
    editor.quiet(document)
    found.append(("minchw: lsp, at rest", editor.memory(), "MB", 150.0))
    for path in wide:
        editor.put(path, path.read_text())
    editor.quiet(document)
    many = keystrokes(editor, wide[-1], times)
    found.append(("lsp: 1 000 in 20 documents", statistics.median(many), "s", 2.0 * stroke))
    editor.leave()
    return found
