"""What is open in one editor, and what was found out of it: each document is analysed again when something that it concerns has changed."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from thingc.diagnostics import Report
from thingc.environment import Options, geometry_of
from thingc.lsp.analysis import Analysis, OpenText, analyse
from thingc.lsp.at_hand import AtHand
from thingc.lsp.publishing import diagnostics_by_file
from thingc.memo import Memo
from thingc.realize import NoWorkers, read_lock

if TYPE_CHECKING:
    from thingc.realize import PartAnswers, Store
    from thingc.workspace import Workspace

Publish = Callable[[str, int | None, list[dict[str, object]]], None]
"""`publish(uri, version, diagnostics)`; the version is None for a file that is not open."""


class OpenDocuments:
    """The texts of an editor and their analyses. Texts come and go in one thread (`put`, `take_away`), and are looked at in another
    (`catch_up`, `analysis`).

    `options` say whether code of workspaces may run, and where the store is.
    """

    def __init__(self, options: Options, publish: Publish) -> None:
        self.options = options
        self._publish = publish
        self._lock = threading.Lock()
        self._texts: dict[str, OpenText] = {}
        self._analyses: dict[str, Analysis] = {}
        self._memos: dict[str, Memo] = {}
        self._outdated: dict[str, None] = {}
        self._unsaid: dict[str, None] = {}
        self._shown: set[str] = set()
        self._at_hand: dict[str, AtHand] = {}

    def put(self, path: str, text: OpenText) -> None:
        """A file was opened, or has another text now."""
        with self._lock:
            self._texts = {**self._texts, path: text}
            self._changed(path)

    def take_away(self, path: str) -> None:
        """A file was closed: what is on the disk counts."""
        with self._lock:
            self._texts = {one: text for one, text in self._texts.items() if one != path}
            self._changed(path)

    def saved(self, path: str) -> None:
        """A file on the disk is another than before."""
        with self._lock:
            if path not in self._texts:
                self._changed(path)

    def _changed(self, path: str) -> None:
        for one, analysis in self._analyses.items():
            if path in analysis.looked_at:
                self._outdated[one] = None
        self._outdated[path] = None

    def analysis(self, path: str) -> Analysis:
        """The analysis of a document as it stands now."""
        with self._lock:
            outdated = path in self._outdated or path not in self._analyses
            self._outdated.pop(path, None)
            texts = self._texts
        if outdated:
            self._analyses[path] = analyse(
                path, texts, self.options, self._lend if self.options.code else None, self._memos.setdefault(path, Memo()),
                self._analyses.get(path),
            )
            self._unsaid[path] = None
        return self._analyses[path]

    def catch_up(self) -> None:
        """Analyse every open document that something has changed for, and publish what was found."""
        while True:
            with self._lock:
                path = next((one for one in self._outdated if one in self._texts), None)
                if path is None:
                    for closed in self._outdated:
                        self._analyses.pop(closed, None)
                        self._memos.pop(closed, None)
                        self._unsaid[closed] = None
                    self._outdated.clear()
                    break
            self.analysis(path)
        self._say()

    def _say(self) -> None:
        """Publish the diagnostics of the files that were looked at, and of those of which there is something else to say now."""
        said = diagnostics_by_file(one for path, one in self._analyses.items() if path in self._texts)
        for path in dict.fromkeys((*self._unsaid, *said, *self._shown)):
            text = self._texts.get(path)
            if path in self._unsaid or path in said or path in self._shown:
                uri = text.uri if text is not None else Analysis(path=path).uri(path)
                self._publish(uri, None if text is None else self._version(path), said.get(path, []))
        self._shown = {path for path, found in said.items() if found}
        self._unsaid.clear()

    def _version(self, path: str) -> int | None:
        analysis = self._analyses.get(path)
        return None if analysis is None or path not in analysis.open else analysis.open[path].version

    def _lend(self, workspace: Workspace, store: Store) -> PartAnswers:
        at_hand = self._at_hand.get(workspace.root)
        if at_hand is None or at_hand.workspace != workspace:
            service = geometry_of(workspace, self.options, store, lambda: read_lock(workspace, Report()), workers=NoWorkers())
            at_hand = self._at_hand[workspace.root] = AtHand(service)
        return at_hand

    def texts(self) -> Mapping[str, OpenText]:
        """All that is open, by absolute path."""
        return self._texts

    def close(self) -> None:
        """End what was started."""
