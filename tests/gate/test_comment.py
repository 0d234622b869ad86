"""The comment of the action on a pull request, with a local server in place of GitHub's API."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest

from diff.cranes import write
from gate.repository import git

ROOT = Path(__file__).resolve().parents[2]
BIN = Path(sys.executable).parent


class StandIn(ThreadingHTTPServer):
    """The comments of one pull request. Requests without the right token change nothing."""

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), _Answers)
        self.comments: list[dict[str, Any]] = [
            {"id": 1, "body": "<!-- thingc diff -->\nnot ours", "user": {"type": "User"}},
            *({"id": k, "body": "a remark", "user": {"type": "Bot"}} for k in range(2, 120)),
        ]


class _Answers(BaseHTTPRequestHandler):
    server: StandIn

    def do_GET(self) -> None:
        assert self.path.startswith("/repos/me/robots/issues/7/comments?per_page=100&page=")
        page = int(self.path.rpartition("=")[2])
        self._answer(self.server.comments[100 * (page - 1) : 100 * page])

    def do_POST(self) -> None:
        assert self.path == "/repos/me/robots/issues/7/comments"
        self._write(lambda body: self.server.comments.append({"id": 200, "body": body, "user": {"type": "Bot"}}))

    def do_PATCH(self) -> None:
        assert self.path == "/repos/me/robots/issues/comments/200"
        self._write(lambda body: self.server.comments[-1].update(body=body))

    def _write(self, take: Any) -> None:
        body = json.loads(self.rfile.read(int(self.headers["Content-Length"])))["body"]
        if self.headers["Authorization"] != "Bearer secret":
            self._answer({"message": "Resource not accessible by integration"}, 403)
            return
        take(body)
        self._answer({})

    def _answer(self, value: Any, code: int = 200) -> None:
        self.send_response(code)
        self.end_headers()
        self.wfile.write(json.dumps(value).encode())

    def log_message(self, format: str, *arguments: Any) -> None:
        """Suppress the log."""


@pytest.fixture
def api() -> Iterator[StandIn]:
    server = StandIn()
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    yield server
    server.shutdown()
    thread.join()
    server.server_close()


def said(folder: Path, temp: Path, api: StandIn, store: str, code: int = 0, **environment: str) -> str:
    done = subprocess.run(
        ["bash", ROOT / "gate" / "diff.sh"], cwd=folder, capture_output=True, text=True, env={
            "PATH": f"{BIN}:{os.environ['PATH']}", "HOME": str(temp), "RUNNER_TEMP": str(temp), "THINGC_STORE": store,
            "API": f"http://127.0.0.1:{api.server_port}", "TOKEN": "secret", "REPOSITORY": "me/robots", "NUMBER": "7", "CODE": "yes",
            "FAIL_ON": "", "SINCE": "main", **environment,
        },
    )
    assert done.returncode == code, done.stdout + done.stderr
    return done.stdout


def test_comment_is_posted_once_and_then_updated(api: StandIn, tmp_path: Path, shared_store: str) -> None:
    folder, temp = tmp_path / "robots", tmp_path / "temp"
    temp.mkdir()
    write(folder)
    git(folder, "init", "-q", "-b", "main")
    git(folder, "add", "-A")
    git(folder, "commit", "-qm", "a crane")
    git(folder, "checkout", "-qb", "work")
    write(folder, ("value: 120 g", "value: 150 g"))
    git(folder, "commit", "-qam", "a heavier hook")
    denied = "no comment: the token of this run has no permission to write one (403)"
    assert denied in said(folder, temp, api, shared_store, TOKEN="another")
    assert len(api.comments) == 119
    assert "comment created\n" in said(folder, temp, api, shared_store)
    first = api.comments[-1]["body"]
    assert first.startswith("<!-- thingc diff -->\n### `main") and "`mass.value 120 g -> 150 g (+25 %)`" in first
    write(folder, ("value: 120 g", "value: 160 g"))
    git(folder, "commit", "-qam", "a still heavier hook")
    assert "comment updated\n" in said(folder, temp, api, shared_store, code=1, FAIL_ON="mass")
    assert len(api.comments) == 120 and "120 g -> 160 g" in api.comments[-1]["body"] and api.comments[0]["body"].endswith("not ours")
    write(folder, ("parent: mast.head", "parent: mats.head"))
    git(folder, "commit", "-qam", "a slip")
    assert "nothing to compare: one side does not compile" in said(folder, temp, api, shared_store, FAIL_ON="mass")
    assert "120 g -> 160 g" in api.comments[-1]["body"]
