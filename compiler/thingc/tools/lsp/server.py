"""The server: messages of an editor over standard input and output.

What it answers stands in `FEATURES`: for each request of the protocol a function `feature(analysis, text, place, params)` of a module of
this room. `analysis` is of the document as it stands (`analysis.Analysis`; where its text is broken at the moment, names of the last one
that was not are in `analysis.known`), `text` is the document's text, `place` where the cursor is, counted as a `Span` counts (line 1,
column 1 for requests without a position), and `params` what was sent, as plain JSON. The answer is plain JSON, too, as the protocol has
it; `analysis.lines().range(span)` makes ranges, `analysis.uri(path)` names files. A feature that cannot answer raises
`RenameRefused` with words for the person. So another one is a function and a line of `FEATURES`, with what the server tells the
editor about it (the protocol's options, as JSON) where there is something to tell.

Nothing else in this room knows pygls.
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
    """Who answers a request (`module:function` of this room), and the options that the editor is told, if any. Where it answers by
    something else than a document (symbols of a workspace), `document` is false, and the analysis is of the document looked at last. One
    that looks `everywhere` has in `analysis.open` all texts as they are now, those that the document does not depend on as well."""

    answer: str
    options: Any = None
    document: bool = True
    everywhere: bool = False


LEGEND = {"tokenTypes": ["parameter", "variable", "function", "number", "keyword"], "tokenModifiers": []}
"""What the words of an expression are to an editor (`navigation.TOKENS`): a unit is a keyword."""

FEATURES: dict[str, Feature] = {
    "textDocument/codeAction": Feature(answer="code_actions:actions", options={"codeActionKinds": ["quickfix"]}),
    "textDocument/completion": Feature(
        answer="completion:completion", options={"triggerCharacters": [".", ":", " ", "=", "{", "[", ",", '"', "/", "$"]},
    ),
    "textDocument/definition": Feature(answer="navigation:definition"),
    "textDocument/documentHighlight": Feature(answer="navigation:highlights"),
    "textDocument/documentSymbol": Feature(answer="navigation:symbols"),
    "textDocument/foldingRange": Feature(answer="navigation:folds"),
    "textDocument/formatting": Feature(answer="code_actions:formatted"),
    "textDocument/hover": Feature(answer="hover:hover"),
    "textDocument/inlayHint": Feature(answer="shown_values:hints"),
    "textDocument/prepareRename": Feature(answer="navigation:prepare_rename", everywhere=True),
    "textDocument/references": Feature(answer="navigation:references", everywhere=True),
    "textDocument/rename": Feature(answer="navigation:rename", options={"prepareProvider": True}, everywhere=True),
    "textDocument/semanticTokens/full": Feature(answer="navigation:tokens", options=LEGEND),
    "workspace/symbol": Feature(answer="navigation:workspace_symbols", document=False, everywhere=True),
}
"""Requests of the protocol and who answers them."""


def serve(options: Options, version: str, refused: Callable[[Exception], Diagnostic], stdin: BinaryIO, stdout: BinaryIO) -> bool:
    """Answer an editor until it leaves; whether it has said so before. `options` say where the store is; whether code may run is said by
    the editor. `refused` puts an exception into words."""
    from lsprotocol import types
    from pygls.lsp import get_method_options_type

    server = _server(version)
    converter = server.protocol._converter
    answering = _Answering()

    @server.feature(types.INITIALIZE)
    def initialize(params: types.InitializeParams) -> None:
        loop = asyncio.get_running_loop()
        given = params.initialization_options
        trusted = isinstance(given, dict) and given.get("trusted") is True

        def publish(uri: str, version: int | None, diagnostics: list[dict[str, Any]]) -> None:
            told = types.PublishDiagnosticsParams(
                uri=uri, version=version, diagnostics=converter.structure(diagnostics, list[types.Diagnostic]),
            )
            with contextlib.suppress(RuntimeError):  # the server is leaving
                loop.call_soon_threadsafe(server.text_document_publish_diagnostics, told)

        answering.begin(replace(options, lock=True, code=trusted), publish, refused)

    _notify(server, answering)
    for method, feature in FEATURES.items():
        options_type = get_method_options_type(method)
        told = None if feature.options is None or options_type is None else converter.structure(feature.options, options_type)
        server.feature(method, told)(_handler(answering, feature, converter.unstructure))
    try:
        server.start_io(stdin, stdout)
    finally:
        answering.close()
    return server.protocol._shutdown


def _notify(server: LanguageServer, answering: _Answering) -> None:
    """Tell `answering` of what is opened, typed, saved and closed."""
    from lsprotocol import types

    @server.feature(types.TEXT_DOCUMENT_DID_OPEN)
    def did_open(params: types.DidOpenTextDocumentParams) -> None:
        answering.put(params.text_document.uri, params.text_document.version, params.text_document.text)

    @server.feature(types.TEXT_DOCUMENT_DID_CHANGE)
    def did_change(params: types.DidChangeTextDocumentParams) -> None:
        if params.content_changes:
            answering.put(params.text_document.uri, params.text_document.version, params.content_changes[-1].text)

    @server.feature(types.TEXT_DOCUMENT_DID_CLOSE)
    def did_close(params: types.DidCloseTextDocumentParams) -> None:
        answering.take_away(params.text_document.uri)

    @server.feature(types.TEXT_DOCUMENT_DID_SAVE)
    def did_save(params: types.DidSaveTextDocumentParams) -> None:
        answering.saved([params.text_document.uri])

    @server.feature(types.WORKSPACE_DID_CHANGE_WATCHED_FILES)
    def did_change_files(params: types.DidChangeWatchedFilesParams) -> None:
        answering.saved([one.uri for one in params.changes])


def _server(version: str) -> LanguageServer:
    """What speaks the protocol."""
    from lsprotocol import types
    from pygls.exceptions import JsonRpcException
    from pygls.lsp.server import LanguageServer
    from pygls.protocol import LanguageServerProtocol, default_converter

    logging.getLogger("pygls").addHandler(logging.NullHandler())
    logging.getLogger("pygls").propagate = False

    class Protocol(LanguageServerProtocol):
        """Answers are sent as they are: they have the protocol's form."""

        def get_result_type(self, method: str) -> Any:  # type: ignore[override]
            """The type of an answer; None: as it is."""
            return None if method in FEATURES else super().get_result_type(method)

        def structure_message(self, data: dict[str, Any]) -> Any:
            """What was sent, as the protocol's type; a request that is none is answered, too."""
            try:
                return super().structure_message(data)
            except JsonRpcException as fault:
                if "id" in data and "method" in data:
                    self._send_response(data["id"], error=fault.to_response_error())
                raise

    class Quiet(LanguageServer):
        """Says nothing of its own faults to the person: they cannot mend them."""

        def report_server_error(self, error: Exception, source: Any) -> None:
            """Hears of errors of the protocol, of which the editor is told anyway."""
            logging.getLogger("thingc.tools.lsp").debug("%s: %s", source, error)

    return Quiet(
        "thingc", version, text_document_sync_kind=types.TextDocumentSyncKind.Full, protocol_cls=Protocol,
        converter_factory=default_converter,
    )


def _handler(answering: _Answering, feature: Feature, plain: Callable[[Any], Any]) -> Callable[[Any], Awaitable[Any]]:
    async def handle(params: Any) -> Any:
        return await answering.answered(feature, plain(params))

    return handle


class _Answering:
    """The documents that an editor has opened, and the one thread that looks at them: it analyses them, and answers, one after the other.
    Until the editor has said what it is (`begin`) there are none."""

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="analysing")
        self._opened: OpenDocuments | None = None
        self._recent = ""

    def begin(self, options: Options, publish: Publish, refused: Callable[[Exception], Diagnostic]) -> None:
        """Once."""
        if self._opened is None:
            self._opened = OpenDocuments(options, publish, refused, self._wake)

    def close(self) -> None:
        """Nothing is answered any more."""
        self._thread.shutdown(wait=False, cancel_futures=True)
        if self._opened is not None:
            self._opened.close()

    def put(self, uri: str, version: int, text: str) -> None:
        """A document was opened, or has another text now."""
        path = path_of(uri)
        if path is not None and self._opened is not None:
            self._recent = path
            self._opened.put(path, OpenText(uri=uri, version=version, text=text))
            self._wake()

    def take_away(self, uri: str) -> None:
        """It was closed."""
        path = path_of(uri)
        if path is not None and self._opened is not None:
            self._opened.take_away(path)
            self._wake()

    def saved(self, uris: Iterable[str]) -> None:
        """Files on the disk are others than before."""
        paths = [path for uri in uris if (path := path_of(uri)) is not None]
        if paths and self._opened is not None:
            for path in paths:
                self._opened.saved(path)
            self._wake()

    async def answered(self, feature: Feature, params: dict[str, Any]) -> Any:
        """The answer to a request, behind those that came before it. Raises `JsonRpcException`."""
        return await asyncio.get_running_loop().run_in_executor(self._thread, partial(self._answer, feature, params))

    def _answer(self, feature: Feature, params: dict[str, Any]) -> Any:
        from pygls.exceptions import JsonRpcException

        if self._opened is None:
            raise JsonRpcException("`initialize` comes first", code=NOT_INITIALIZED)
        uri = params.get("textDocument", {}).get("uri", "") if feature.document else None
        path = self._recent if uri is None else path_of(uri)
        if not path:
            return None
        module, _, name = feature.answer.partition(":")
        answer: Callable[..., Any] = getattr(import_module(f"thingc.tools.lsp.{module}"), name)
        while True:
            with contextlib.suppress(Superseded):
                analysis = self._opened.analysis(path)
                break
        if feature.everywhere:
            analysis = replace(analysis, open=self._opened.texts, _kept={})
        place = analysis.lines().place(params["position"]) if "position" in params else TextPlace(line=1, column=1)
        try:
            return answer(analysis, analysis.text, place, params)
        except RenameRefused as fault:
            raise JsonRpcException(str(fault), code=REQUEST_FAILED) from None
        except Exception as fault:
            raise JsonRpcException(f"thingc failed: {type(fault).__name__}: {fault}", code=INTERNAL_ERROR) from None

    def _wake(self) -> None:
        with contextlib.suppress(RuntimeError):  # the server is leaving
            self._thread.submit(self._work)

    def _work(self) -> None:
        if self._opened is not None and self._opened.next():
            self._wake()  # behind the requests that wait
