"""An editor for tests: the client of pygls over the standard input and output of a `thingc lsp` process."""

from __future__ import annotations

import asyncio
import os
import sys
import threading
from collections.abc import Coroutine
from pathlib import Path
from typing import Any, TypeVar

from lsprotocol import types
from pygls.lsp.client import LanguageClient

_T = TypeVar("_T")
PATIENCE = 120.0


class Editor:
    """Edits documents and receives published diagnostics. Every operation waits for its response."""

    def __init__(self, store: str, *, trusted: bool = True, folder: Path | None = None) -> None:
        self._loop = asyncio.new_event_loop()
        threading.Thread(target=self._loop.run_forever, daemon=True).start()
        self.client = LanguageClient("editor", "1")
        self.published: list[types.PublishDiagnosticsParams] = []
        self._heard = asyncio.Condition()
        self.versions: dict[str, int] = {}

        @self.client.feature(types.TEXT_DOCUMENT_PUBLISH_DIAGNOSTICS)
        async def note(params: types.PublishDiagnosticsParams) -> None:
            async with self._heard:
                self.published.append(params)
                self._heard.notify_all()

        self._run(self.client.start_io(
            sys.executable, "-P", "-m", "thingc", "lsp", "--store", store, cwd=str(folder) if folder is not None else None,
            env={**os.environ},
        ))
        self.told = self._run(self.client.initialize_async(types.InitializeParams(
            capabilities=types.ClientCapabilities(), initialization_options={"trusted": trusted},
        )))
        self.client.initialized(types.InitializedParams())

    def _run(self, what: Coroutine[Any, Any, _T]) -> _T:
        return asyncio.run_coroutine_threadsafe(asyncio.wait_for(what, PATIENCE), self._loop).result()

    @property
    def process(self) -> Any:
        """The server's process."""
        return self.client._server

    def request(self, method: str, params: Any) -> Any:
        """Return the response to a request with these parameters (plain JSON); raises `JsonRpcException`."""
        protocol = self.client.protocol
        typed = protocol._converter.structure(params, types.METHOD_TO_TYPES[method][2])

        async def asked() -> Any:
            return await protocol.send_request_async(method, typed)

        return self._run(asked())

    def notify(self, method: str, params: Any) -> None:
        """Send a notification without waiting."""
        self._loop.call_soon_threadsafe(self.client.protocol.notify, method, params)

    def open(self, path: Path, text: str | None = None) -> list[types.Diagnostic]:
        """Open a file and return its published diagnostics."""
        uri = path.as_uri()
        self.versions[uri] = 1
        self.notify(types.TEXT_DOCUMENT_DID_OPEN, types.DidOpenTextDocumentParams(types.TextDocumentItem(
            uri, "toml" if path.suffix == ".toml" else "yaml", 1, path.read_text() if text is None else text,
        )))
        return self.said(path)

    def type(self, path: Path, text: str) -> list[types.Diagnostic]:
        """Replace the text of a file and return its published diagnostics."""
        self.type_ahead(path, text)
        return self.said(path)

    def type_ahead(self, path: Path, text: str) -> None:
        """Replace the text of a file without waiting."""
        uri = path.as_uri()
        self.versions[uri] += 1
        self.notify(types.TEXT_DOCUMENT_DID_CHANGE, types.DidChangeTextDocumentParams(
            types.VersionedTextDocumentIdentifier(version=self.versions[uri], uri=uri),
            [types.TextDocumentContentChangeWholeDocument(text)],
        ))

    def close(self, path: Path) -> None:
        """Close a file."""
        self.notify(types.TEXT_DOCUMENT_DID_CLOSE, types.DidCloseTextDocumentParams(types.TextDocumentIdentifier(path.as_uri())))

    def said(self, path: Path) -> list[types.Diagnostic]:
        """Wait for the diagnostics of the last version of a file and return them."""
        uri = path.as_uri()
        return self.wait(lambda one: one.uri == uri and one.version == self.versions[uri])

    def wait(self, wanted: Any, since: int = 0) -> list[types.Diagnostic]:
        """Wait for a publication after the first `since` ones that is `wanted`, and return its diagnostics."""
        async def heard() -> list[types.Diagnostic]:
            async with self._heard:
                await self._heard.wait_for(lambda: any(wanted(one) for one in self.published[since:]))
                return list(next(one for one in reversed(self.published) if wanted(one)).diagnostics)

        return self._run(heard())

    def leave(self) -> int:
        """Shut the server down and return its exit code."""
        async def leave() -> int:
            await self.client.shutdown_async(None)
            self.client.exit(None)
            return int(await self.client._server.wait())

        return self._run(leave())


def lines(diagnostics: list[types.Diagnostic]) -> list[str]:
    """Return one line per diagnostic: `3:5 TC302 unknown component ...`."""
    return [f"{one.range.start.line + 1}:{one.range.start.character + 1} {one.code} {one.message.splitlines()[0]}" for one in diagnostics]
