"""Documents as a server has them open, without the server."""

from __future__ import annotations

from pathlib import Path

from thingc.base.diagnostics import Diagnostic
from thingc.driver.environment import Options
from thingc.tools.lsp.analysis import Analysis, OpenText
from thingc.tools.lsp.open_documents import OpenDocuments


class Documents:
    """Texts of a trusted workspace, of whose parts what is in a store is known. `woken` is how often workers were to be asked."""

    def __init__(self, store: str) -> None:
        self.woken = 0
        self._opened = OpenDocuments(Options(store=store, lock=True, code=True), lambda *_: None, _raise, self._wake)

    def _wake(self) -> None:
        self.woken += 1

    def analysis(self, path: Path, text: str) -> Analysis:
        """The analysis of a document with this text."""
        self._opened.put(str(path), OpenText(uri=path.as_uri(), version=1, text=text))
        return self._opened.analysis(str(path))


def _raise(fault: Exception) -> Diagnostic:
    raise fault


def analysed(store: str, path: Path, text: str) -> Analysis:
    """The analysis of a document, by itself."""
    return Documents(store).analysis(path, text)
