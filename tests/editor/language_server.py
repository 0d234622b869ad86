"""A client for a real `yaml-language-server` over stdio: open, complete, hover, diagnostics."""

from __future__ import annotations

import json
import queue
import subprocess
import threading
import time
from pathlib import Path
from typing import Any

PATIENCE = 300.0
"""Timeout for an answer [s]."""


class LanguageServer:
    """One server for one folder. `schemas` is the value of `yaml.schemas` in the settings of the folder."""

    def __init__(self, program: Path, folder: Path, schemas: dict[str, Any]) -> None:
        self.folder = folder
        self.settings = {
            "yaml": {
                "schemas": schemas,
                "validate": True, "hover": True, "completion": True, "schemaStore": {"enable": False},
                "format": {"enable": False},
            },
            "http": {"proxy": "", "proxyStrictSSL": False}, "[yaml]": {"editor.tabSize": 2, "editor.insertSpaces": True},
        }
        self.process = subprocess.Popen(
            ["node", str(program), "--stdio"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
        )
        self._answers: dict[int, queue.SimpleQueue[Any]] = {}
        self._said: dict[str, queue.SimpleQueue[list[dict[str, Any]]]] = {}
        self._number = 0
        self._versions: dict[str, int] = {}
        threading.Thread(target=self._listen, daemon=True).start()
        self.ask("initialize", {
            "processId": None, "rootUri": folder.as_uri(), "workspaceFolders": [{"uri": folder.as_uri(), "name": "folder"}],
            "capabilities": {
                "textDocument": {
                    "completion": {"completionItem": {"documentationFormat": ["markdown"], "snippetSupport": True}},
                    "hover": {"contentFormat": ["markdown"]}, "publishDiagnostics": {},
                },
                "workspace": {"configuration": True, "didChangeConfiguration": {"dynamicRegistration": False}},
            },
        })
        self.tell("initialized", {})
        self.tell("workspace/didChangeConfiguration", {"settings": self.settings})

    def close(self) -> None:
        """Shut the server down, and kill it if it does not exit."""
        try:
            self.ask("shutdown", None)
            self.tell("exit", None)
            self.process.wait(5)
        except (OSError, queue.Empty, subprocess.TimeoutExpired):
            self.process.kill()
            self.process.wait()

    # --- what an editor does ------------------------------------------------------------------------------------

    def uri(self, name: str) -> str:
        """Return the URI of a document in the folder."""
        return (self.folder / name).as_uri()

    def show(self, name: str, text: str) -> list[dict[str, Any]]:
        """Open a document or replace its text, and return its diagnostics."""
        uri = self.uri(name)
        said = self._said[uri] = queue.SimpleQueue()
        if uri not in self._versions:
            self._versions[uri] = 1
            item = {"uri": uri, "languageId": "yaml", "version": 1, "text": text}
            self.tell("textDocument/didOpen", {"textDocument": item})
        else:
            self._versions[uri] += 1
            self.tell("textDocument/didChange", {
                "textDocument": {"uri": uri, "version": self._versions[uri]}, "contentChanges": [{"text": text}],
            })
        return said.get(timeout=PATIENCE)

    def complete(self, name: str, text: str) -> dict[str, dict[str, Any]]:
        """Return the completion items at `|` in the text, by label."""
        before, after = text.split("|")
        self.show(name, before + after)
        answer = self.ask("textDocument/completion", {**self._at(name, before), "context": {"triggerKind": 1}})
        items = answer["items"] if isinstance(answer, dict) else answer or []
        return {item["label"]: item for item in items}

    def hover(self, name: str, text: str) -> str:
        """Return the hover text for the character after `|`."""
        before, after = text.split("|")
        self.show(name, before + after)
        answer = self.ask("textDocument/hover", self._at(name, before))
        if not answer:
            return ""
        contents = answer["contents"]
        return str(contents["value"] if isinstance(contents, dict) else contents)

    def changed(self, schema: str) -> None:
        """Notify the server that a schema on disk has changed."""
        self.tell("workspace/didChangeWatchedFiles", {"changes": [{"uri": (self.folder / schema).as_uri(), "type": 2}]})

    def _at(self, name: str, before: str) -> dict[str, Any]:
        line = before.count("\n")
        return {
            "textDocument": {"uri": self.uri(name)}, "position": {"line": line, "character": len(before) - before.rfind("\n") - 1},
        }

    # --- the protocol -------------------------------------------------------------------------------------------

    def ask(self, method: str, params: Any) -> Any:
        """Send a request and return its result."""
        self._number += 1
        mine = self._answers[self._number] = queue.SimpleQueue()
        self._send({"id": self._number, "method": method, "params": params})
        answer = mine.get(timeout=PATIENCE)
        if "error" in answer:
            raise RuntimeError(f"{method}: {answer['error']}")
        return answer["result"]

    def tell(self, method: str, params: Any) -> None:
        """Send a notification."""
        self._send({"method": method, "params": params})

    def _send(self, message: dict[str, Any]) -> None:
        data = json.dumps({"jsonrpc": "2.0", **message}).encode()
        assert self.process.stdin is not None
        self.process.stdin.write(b"Content-Length: %d\r\n\r\n" % len(data) + data)
        self.process.stdin.flush()

    def _listen(self) -> None:
        stream = self.process.stdout
        assert stream is not None
        while True:
            length = 0
            while (line := stream.readline().strip()) or not length:
                if not line and self.process.poll() is not None:
                    return
                if line.lower().startswith(b"content-length:"):
                    length = int(line.partition(b":")[2])
            message = json.loads(stream.read(length))
            if "method" not in message:
                self._answers.pop(message["id"]).put(message)
            elif message["method"] == "textDocument/publishDiagnostics":
                said = self._said.get(message["params"]["uri"])
                if said is not None:
                    said.put(message["params"]["diagnostics"])
            elif "id" in message:
                self._send({"id": message["id"], "result": self._asked(message)})

    def _asked(self, message: dict[str, Any]) -> Any:
        if message["method"] == "workspace/configuration":
            return [self.settings.get(item.get("section"), {}) for item in message["params"]["items"]]
        return None


def wait_until(what: Any, seconds: float) -> Any:
    """Return the first true result of `what()` within `seconds`, or else its last one."""
    end = time.monotonic() + seconds
    while not (found := what()) and time.monotonic() < end:
        time.sleep(0.02)
    return found
