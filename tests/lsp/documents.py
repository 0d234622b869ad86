"""Open documents of a language server, without the server process."""

from __future__ import annotations

from pathlib import Path

from thingc.base.diagnostics import Diagnostic
from thingc.driver.environment import Options
from thingc.tools.lsp.analysis import Analysis, OpenText
from thingc.tools.lsp.open_documents import OpenDocuments


class Documents:
    """Documents of a trusted workspace; only the parts in a store are known. `woken` counts the requests for workers."""

    def __init__(self, store: str) -> None:
        self.woken = 0
        self._opened = OpenDocuments(Options(store=store, lock=True, code=True), lambda *_: None, _raise, self._wake)
        self._opened.close()  # otherwise, a thread would look for changed files until the process ends

    def _wake(self) -> None:
        self.woken += 1

    def analysis(self, path: Path, text: str) -> Analysis:
        """Return the analysis of a document with this text."""
        self._opened.put(str(path), OpenText(uri=path.as_uri(), version=1, text=text))
        return self._opened.analysis(str(path))


def _raise(fault: Exception) -> Diagnostic:
    raise fault


def analysed(store: str, path: Path, text: str) -> Analysis:
    """Return the analysis of a single document."""
    return Documents(store).analysis(path, text)
