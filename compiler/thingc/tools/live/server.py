"""An HTTP server for the web page that shows a robot and updates after every save.

The server listens on the loopback interface, so only browsers on this machine can connect. Every URL path starts with a secret token.
Requests for other host names are refused, to prevent DNS rebinding. Web pages of other servers cannot read the responses. The server does
not serve files, but only content in memory.
"""

from __future__ import annotations

import base64
import hmac
import json
import os
import secrets
import socket
import sys
import threading
from collections.abc import Mapping, Sequence
from contextlib import suppress
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from thingc.base.diagnostics import Diagnostic
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.safe_text import json_text
from thingc.documents.workspace import Workspace
from thingc.targets.html.emit import Page, waiting
from thingc.targets.html.viewer_data import source_location

LOOPBACK = "127.0.0.1"
SILENCE = 15.0
"""Interval [s] at which empty events are sent, to detect closed connections."""

IDLE = 32
"""Maximum number of idle connections; a browser uses at most six."""

HEADERS = {
    "Cache-Control": "no-store", "Referrer-Policy": "no-referrer", "X-Content-Type-Options": "nosniff", "X-Frame-Options": "DENY",
    "Cross-Origin-Resource-Policy": "same-origin", "Cross-Origin-Opener-Policy": "same-origin",
}
HTML, JSON = "text/html; charset=utf-8", "application/json"

Finding = Mapping[str, object]
"""A diagnostic in the JSON format of the page."""


class _Shown(FrozenStruct, kw_only=False):
    """The state of one robot on the web page."""

    page: Page | None = None
    count: int = 0
    findings: tuple[Finding, ...] = ()

    def after_rebuild(self, page: Page | None, findings: Sequence[Finding]) -> _Shown:
        """Return the new state after a rebuild. `page` is None if the rebuild had errors."""
        return _Shown(page or self.page, self.count + (page is not None), tuple(findings))


class _Quiet(ThreadingHTTPServer):
    """An HTTP server that does not report connections closed by the browser.

    If more than `IDLE` connections are idle, the server closes the oldest connection, so that new browsers can always connect.
    """

    daemon_threads = True
    request_queue_size = 128

    def __init__(self, *arguments: Any) -> None:
        self._idle: dict[socket.socket, None] = {}
        self._turn = threading.Lock()
        super().__init__(*arguments)

    def wait(self, connection: socket.socket) -> None:
        """Mark a connection as idle, which means that it waits for a request."""
        with self._turn:
            self._idle[connection] = None
            longest = next(iter(self._idle)) if len(self._idle) > IDLE else None
        if longest is not None:
            self.wait_no_more(longest)
            with suppress(OSError):  # the connection has already ended
                longest.shutdown(socket.SHUT_RDWR)

    def wait_no_more(self, connection: socket.socket) -> None:
        """Mark a connection as busy or closed."""
        with self._turn:
            self._idle.pop(connection, None)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Report an error in a connection, but do not report a lost connection."""
        if not isinstance(sys.exc_info()[1], OSError):
            super().handle_error(request, client_address)


class Server:
    """A context manager that serves the web page of a document over HTTP, on `port` or on a free port of this machine.

    Raises OSError if the port is in use. `editor` is passed to `Page.html`, and `document` is the path of the document. Without a secret
    `key`, the token in the URL is random. With a key, the token depends only on the key, the document and the port, so that open pages can
    reconnect to a new server.
    """

    def __init__(self, port: int = 0, editor: str | None = None, document: str = "", key: bytes | None = None) -> None:
        self._news = threading.Condition()
        self._editor = editor
        self._name = os.path.basename(document) or "thingc view"
        self._own = _Shown()
        self._other = _Shown()
        self._seconds = self._kernel = 0.0
        self._closed = False
        self._number = 0
        self._run = secrets.token_hex(4)
        self._http = _Quiet((LOOPBACK, port), type("Handler", (_Handler,), {"served": self}))
        about = f"{self.port} {os.path.realpath(document)}".encode("utf-8", "surrogateescape")
        word = secrets.token_bytes(16) if key is None else hmac.digest(key, about, "sha256")[:16]
        self._token = base64.urlsafe_b64encode(word).decode().rstrip("=")
        self._thread = threading.Thread(target=self._http.serve_forever, kwargs={"poll_interval": 0.1}, daemon=True)

    def __enter__(self) -> Server:
        self._thread.start()
        return self

    def __exit__(self, *exception: object) -> None:
        with self._news:
            self._closed = True
            self._news.notify_all()
        self._http.shutdown()
        self._http.server_close()

    @property
    def port(self) -> int:
        """The port of the server."""
        return int(self._http.server_address[1])

    @property
    def address(self) -> str:
        """The URL of the page."""
        return f"http://{LOOPBACK}:{self.port}/{self._token}/"

    def tell(self, page: Page | None, seconds: float, findings: Sequence[Finding], *, kernel: float = 0.0) -> None:
        """Send the result of a rebuild of the document to all browsers.

        After errors, `page` is None, and browsers continue to show the last page without errors. `seconds` is the duration of the rebuild
        [s], of which building parts took the time `kernel` [s].
        """
        with self._news:
            self._own = self._own.after_rebuild(page, findings)
            self._seconds, self._kernel = seconds, kernel
            self._number += 1
            self._news.notify_all()

    def tell_against(self, page: Page | None, findings: Sequence[Finding] = ()) -> None:
        """Send the result of a rebuild of the overlay to all browsers. Before the first rebuild of the document, nothing is sent."""
        with self._news:
            self._other = self._other.after_rebuild(page, findings)
            self._number += 1 if self._number > 0 else 0
            self._news.notify_all()

    def is_own_host(self, host: str | None) -> bool:
        """Return whether the host name in an HTTP request is the name of this server."""
        return host in (f"{LOOPBACK}:{self.port}", f"localhost:{self.port}")

    def inside(self, path: str) -> str | None:
        """Return the path of an HTTP request without the secret token. Return None if the token is wrong."""
        token, slash, remainder = path.partition("?")[0].removeprefix("/").partition("/")
        return remainder if slash and hmac.compare_digest(token.encode(), self._token.encode()) else None

    def content(self, name: str) -> tuple[str, bytes] | None:
        """Return the content type and the content of the resource with this name. Return None if the resource does not exist."""
        with self._news:
            page, other = self._own.page, self._other.page
            stand = f"{self._run} {self._own.count} {self._other.count}"
        if name == "":
            return HTML, waiting(self._name, self._editor) if page is None else page.html(live=stand, editor=self._editor, against=other)
        source = {"robot.json": page, "against.json": other}.get(name)
        return (JSON, source.news()) if source is not None else None

    def news(self, after: int) -> tuple[int, str] | None:
        """Wait until the number of events is greater than `after`.

        Return the number of events and the state of the page as JSON, or None when the server closes. If no event occurs within the time
        `SILENCE`, the number is `after`.
        """
        with self._news:
            self._news.wait_for(lambda: self._closed or self._number > after, SILENCE)
            return None if self._closed else (self._number, self._state_json())

    def _state_json(self) -> str:
        """Return the current state of the page as JSON.

        `run` identifies the server process. `build` and `against` count the pages of the document and of the overlay.
        """
        own, other = self._own, self._other
        state = {
            "run": self._run, "build": own.count, "against": other.count, "seconds": self._seconds, "kernel": self._kernel,
            "findings": [*own.findings, *(one for one in other.findings if one not in own.findings)],
        }
        return json_text(json.dumps(state, ensure_ascii=False))


def findings_of(diagnostics: Sequence[Diagnostic], workspace: Workspace | None) -> list[dict[str, object]]:
    """Convert diagnostics to the JSON format of the page, with file paths relative to the workspace."""
    return [
        {
            "code": d.code.code, "severity": d.severity.value, "message": d.message, "help": d.advice,
            **source_location(d.span, workspace),
            "notes": [{"message": note.message, **source_location(note.span, workspace)} for note in d.notes],
        }
        for d in diagnostics
    ]


class _Handler(BaseHTTPRequestHandler):
    """Handles the HTTP requests of one connection. Only GET and HEAD requests are supported."""

    served: Server
    server: _Quiet

    protocol_version = "HTTP/1.1"
    server_version = "thingc"
    sys_version = ""
    timeout = 60.0

    def handle_one_request(self) -> None:
        """Wait for an HTTP request and send the response."""
        self.server.wait(self.connection)
        try:
            super().handle_one_request()
        finally:
            self.server.wait_no_more(self.connection)

    def do_GET(self) -> None:
        """Respond to a GET request with the requested content."""
        self._answer(body=True)

    def do_HEAD(self) -> None:
        """Respond to a HEAD request as to a GET request, but without the content."""
        self._answer(body=False)

    def log_message(self, *_: Any) -> None:
        """Do not log requests."""

    def _answer(self, *, body: bool) -> None:
        self.server.wait_no_more(self.connection)
        known_host = self.served.is_own_host(self.headers.get("Host"))
        name = self.served.inside(self.path) if known_host else None
        if name == "events":
            self._events(body=body)
            return
        answer = None if name is None else self.served.content(name)
        refused = HTTPStatus.NOT_FOUND if known_host else HTTPStatus.MISDIRECTED_REQUEST
        kind, content = answer or ("text/plain; charset=utf-8", b"")
        self._begin(HTTPStatus.OK if answer else refused, kind, len(content))
        if body:
            self.wfile.write(content)

    def _begin(self, status: HTTPStatus, kind: str, length: int | None) -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        for header, value in HEADERS.items():
            self.send_header(header, value)
        if length is None:
            self.close_connection = True
        else:
            self.send_header("Content-Length", str(length))
        self.end_headers()

    def _events(self, *, body: bool) -> None:
        """Send events as server-sent events (WHATWG HTML 9.2) until one side closes the connection."""
        self._begin(HTTPStatus.OK, "text/event-stream", None)
        seen = 0
        try:
            if body:
                self.wfile.write(b"retry: 1000\n\n")
                self.wfile.flush()
            while body and (latest := self.served.news(seen)) is not None:
                number, text = latest
                self.wfile.write(f"data: {text}\n\n".encode() if number > seen else b": nothing new\n\n")
                self.wfile.flush()
                seen = number
        except OSError:  # the browser has closed the connection
            self.close_connection = True
