"""The language server. The server exchanges messages of the Language Server Protocol (LSP) with an editor over standard input and output.

`FEATURES` maps each request to a function `feature(analysis, text, place, params)` of a module in this folder. `analysis` is the
`analysis.Analysis` of the document. If the text cannot be parsed, `analysis.known` contains the names of the last parsable text. `text` is
the text of the document, and `place` is the position of the cursor (line 1, column 1 for requests without a position). `params` are the
parameters of the request as JSON values. The result consists of JSON values in the format of LSP. Convert spans with
`analysis.lines().range(span)`, and paths with `analysis.uri(path)`. If a feature fails, raise `RenameRefused` with a message for the user.
To add a feature, write a function and add the function to `FEATURES`, with the LSP server options, if any.

Only this module uses pygls.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Awaitable, Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING, Any, BinaryIO

from msgspec.structs import replace

from thingc.base.frozen_struct import FrozenStruct
from thingc.documents.names.rename import RenameRefused
from thingc.tools.lsp.analysis import OpenText
from thingc.tools.lsp.open_documents import OpenDocuments, Publish, Superseded
from thingc.tools.lsp.positions import TextPlace, path_of

if TYPE_CHECKING:
    from pygls.lsp.server import LanguageServer

    from thingc.base.diagnostics import Diagnostic
    from thingc.driver.environment import Options

REQUEST_FAILED = -32803
INTERNAL_ERROR = -32603
NOT_INITIALIZED = -32002


class Feature(FrozenStruct):
    """The handler of an LSP request, as `module:function` in this folder, and the LSP server options for the request.

    If `document` is false, the request does not concern a document. For example, a request for workspace symbols uses the analysis of the
    last document. If `everywhere` is true, `analysis.open` contains all open texts. Otherwise, it contains only texts on which the document
    depends.
    """

    answer: str
    options: Any = None
    document: bool = True
    everywhere: bool = False


LEGEND = {"tokenTypes": ["parameter", "variable", "function", "number", "keyword"], "tokenModifiers": []}
"""The legend of semantic tokens, in the order of `navigation.TOKENS`. Units are sent as keywords."""

FEATURES: dict[str, Feature] = {
    "textDocument/codeAction": Feature(answer="code_actions:actions", options={"codeActionKinds": ["quickfix"]}),
    "textDocument/completion": Feature(
        answer="completion:completion", options={"triggerCharacters": [".", ":", " ", "=", "{", "[", ",", '"', "/", "$"]},
    ),
    "textDocument/definition": Feature(answer="navigation:definition"),
    "textDocument/documentHighlight": Feature(answer="navigation:highlights"),
    "textDocument/documentSymbol": Feature(answer="navigation:symbols"),
    "textDocument/foldingRange": Feature(answer="navigation:folds"),
    "textDocument/formatting": Feature(answer="code_actions:format_text"),
    "textDocument/hover": Feature(answer="hover:hover"),
    "textDocument/inlayHint": Feature(answer="shown_values:hints"),
    "textDocument/prepareRename": Feature(answer="navigation:prepare_rename", everywhere=True),
    "textDocument/references": Feature(answer="navigation:references", everywhere=True),
    "textDocument/rename": Feature(answer="navigation:rename", options={"prepareProvider": True}, everywhere=True),
    "textDocument/semanticTokens/full": Feature(answer="navigation:tokens", options=LEGEND),
    "workspace/symbol": Feature(answer="navigation:workspace_symbols", document=False, everywhere=True),
}
"""Maps LSP requests to their handlers."""


def serve(options: Options, version: str, refused: Callable[[Exception], Diagnostic], stdin: BinaryIO, stdout: BinaryIO) -> bool:
    """Run the language server until the editor disconnects. Return whether the editor sent the request `shutdown` before it disconnected.

    `options` specify the store. The editor specifies whether part code may run. The function `refused` converts an exception to a
    diagnostic.
    """
    from lsprotocol import types
    from pygls.lsp import get_method_options_type

    server = _server(version)
    converter = server.protocol._converter
    queue = _RequestQueue()

    @server.feature(types.INITIALIZE)
    def initialize(params: types.InitializeParams) -> None:
        loop = asyncio.get_running_loop()
        settings = params.initialization_options
        trusted = isinstance(settings, dict) and settings.get("trusted") is True

        def publish(uri: str, version: int | None, diagnostics: list[dict[str, Any]]) -> None:
            published = types.PublishDiagnosticsParams(
                uri=uri, version=version, diagnostics=converter.structure(diagnostics, list[types.Diagnostic]),
            )
            with contextlib.suppress(RuntimeError):  # the server is stopping
                loop.call_soon_threadsafe(server.text_document_publish_diagnostics, published)

        queue.begin(replace(options, lock=True, code=trusted), publish, refused)

    _notify(server, queue)
    for method, feature in FEATURES.items():
        options_type = get_method_options_type(method)
        feature_options = None if feature.options is None or options_type is None else converter.structure(feature.options, options_type)
        server.feature(method, feature_options)(_handler(queue, feature, converter.unstructure))
    try:
        server.start_io(stdin, stdout)
    finally:
        queue.close()
    return server.protocol._shutdown


def _notify(server: LanguageServer, queue: _RequestQueue) -> None:
    """Register handlers for the notifications that a document was opened, changed, saved or closed."""
    from lsprotocol import types

    def put(document: types.VersionedTextDocumentIdentifier | types.TextDocumentItem, text: str) -> None:
        opened = OpenText(uri=document.uri, version=document.version, text=text)
        queue.change([document.uri], lambda documents, path: documents.put(path, opened))

    @server.feature(types.TEXT_DOCUMENT_DID_OPEN)
    def did_open(params: types.DidOpenTextDocumentParams) -> None:
        put(params.text_document, params.text_document.text)

    @server.feature(types.TEXT_DOCUMENT_DID_CHANGE)
    def did_change(params: types.DidChangeTextDocumentParams) -> None:
        if params.content_changes:
            put(params.text_document, params.content_changes[-1].text)

    @server.feature(types.TEXT_DOCUMENT_DID_CLOSE)
    def did_close(params: types.DidCloseTextDocumentParams) -> None:
        queue.change([params.text_document.uri], OpenDocuments.close_text)

    @server.feature(types.TEXT_DOCUMENT_DID_SAVE)
    def did_save(params: types.DidSaveTextDocumentParams) -> None:
        queue.change([params.text_document.uri], OpenDocuments.mark_saved)

    @server.feature(types.WORKSPACE_DID_CHANGE_WATCHED_FILES)
    def did_change_files(params: types.DidChangeWatchedFilesParams) -> None:
        queue.change([change.uri for change in params.changes], OpenDocuments.mark_saved)


def _server(version: str) -> LanguageServer:
    """Create the pygls server."""
    from lsprotocol import types
    from pygls.exceptions import JsonRpcException
    from pygls.lsp.server import LanguageServer
    from pygls.protocol import LanguageServerProtocol, default_converter

    logging.getLogger("pygls").addHandler(logging.NullHandler())
    logging.getLogger("pygls").propagate = False

    class Protocol(LanguageServerProtocol):
        """A subclass of pygls' LSP protocol that sends results without conversion, because the results are already JSON values."""

        def get_result_type(self, method: str) -> Any:  # type: ignore[override]
            """Return the type of a result, or None to send the result without conversion."""
            return None if method in FEATURES else super().get_result_type(method)

        def structure_message(self, data: dict[str, Any]) -> Any:
            """Convert a message of the editor to Python objects. If the message is an invalid request, send an error response."""
            try:
                return super().structure_message(data)
            except JsonRpcException as fault:
                if "id" in data and "method" in data:
                    self._send_response(data["id"], error=fault.to_response_error())
                raise

    class QuietServer(LanguageServer):
        """A subclass of pygls' language server that does not show internal errors to the user."""

        def report_server_error(self, error: Exception, source: Any) -> None:
            """Log a protocol error, which the editor also receives as a response."""
            logging.getLogger("thingc.tools.lsp").debug("%s: %s", source, error)

    return QuietServer(
        "thingc", version, text_document_sync_kind=types.TextDocumentSyncKind.Full, protocol_cls=Protocol,
        converter_factory=default_converter,
    )


def _handler(queue: _RequestQueue, feature: Feature, plain: Callable[[Any], Any]) -> Callable[[Any], Awaitable[Any]]:
    async def handle(params: Any) -> Any:
        return await queue.answer_in_order(feature, plain(params))

    return handle


class _RequestQueue:
    """The open documents of an editor, and a thread that analyses the documents and answers the editor's requests in order.

    Before the method `begin` is called, there are no documents.
    """

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="analysing")
        self._opened: OpenDocuments | None = None

    def begin(self, options: Options, publish: Publish, refused: Callable[[Exception], Diagnostic]) -> None:
        """Create the collection of open documents. Only the first call has an effect."""
        if self._opened is None:
            self._opened = OpenDocuments(options, publish, refused, self._wake)

    def close(self) -> None:
        """Stop the thread that answers requests."""
        self._thread.shutdown(wait=False, cancel_futures=True)
        if self._opened is not None:
            self._opened.close()

    def change(self, uris: Iterable[str], change: Callable[[OpenDocuments, str], None]) -> None:
        """Call the function `change` with the open documents and the path of each file, and then continue the analyses."""
        paths = [path for uri in uris if (path := path_of(uri)) is not None]
        if paths and self._opened is not None:
            for path in paths:
                change(self._opened, path)
            self._wake()

    async def answer_in_order(self, feature: Feature, params: dict[str, Any]) -> Any:
        """Answer a request of the editor after all earlier requests have been answered. Raises `JsonRpcException` if the request fails."""
        return await asyncio.get_running_loop().run_in_executor(self._thread, partial(self._answer, feature, params))

    def _answer(self, feature: Feature, params: dict[str, Any]) -> Any:
        from pygls.exceptions import JsonRpcException

        if self._opened is None:
            raise JsonRpcException("`initialize` must be the first request", code=NOT_INITIALIZED)
        uri = params.get("textDocument", {}).get("uri", "") if feature.document else None
        path = self._opened.recent if uri is None else path_of(uri)
        if not path:
            return None
        module, _, name = feature.answer.partition(":")
        answer: Callable[..., Any] = getattr(import_module(f"thingc.tools.lsp.{module}"), name)
        while True:
            with contextlib.suppress(Superseded):
                analysis = self._opened.analysis(path)
                break
        if feature.everywhere:
            analysis = replace(analysis, open=self._opened.texts, _cache={})
        place = analysis.lines().place(params["position"]) if "position" in params else TextPlace(line=1, column=1)
        try:
            return answer(analysis, analysis.text, place, params)
        except RenameRefused as fault:
            raise JsonRpcException(str(fault), code=REQUEST_FAILED) from None
        except Exception as fault:
            raise JsonRpcException(f"thingc failed: {type(fault).__name__}: {fault}", code=INTERNAL_ERROR) from None

    def _wake(self) -> None:
        with contextlib.suppress(RuntimeError):  # the server is stopping
            self._thread.submit(self._analyse_next)

    def _analyse_next(self) -> None:
        if self._opened is not None and self._opened.next():
            self._wake()  # run after the requests that are already waiting
