"""Cache results in the store, by their build key and by the files that were read.

A build key can have several results. The cache stores each result with the states of the files that the result depends on, which are
called its reads. A lookup returns the result whose reads are all unchanged.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from typing import Any

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.safe_text import some
from thingc.geometry.key.build_key import BuildKey
from thingc.geometry.key.file_states import state_of
from thingc.geometry.store.local import Store

CANDIDATES = 8
"""Maximum number of results that are stored under one build key. If there are more results, the oldest result is removed."""


class CachedResult(FrozenStruct):
    """A cached result, with the states of the files that it depends on and the reason why the part was built."""

    value: Any
    reads: tuple[tuple[str, str], ...]
    reason: str = ""


class Results:
    """The cached results of one workspace. The state of each file is determined only once, so later changes of a file are ignored.

    `consulted` contains the absolute paths of the files that were read. `met` contains the reads of the results that were returned, with
    their states.
    """

    def __init__(self, store: Store, root: str) -> None:
        self.store = store
        self.root = root
        self.consulted: set[str] = set()
        self.met: dict[str, str] = {}
        self._states: dict[tuple[str, bool], str] = {}

    def state(self, path: str, like: str) -> str:
        """Return the current state of the file or folder `path` (relative to the workspace, or absolute).

        `like` is an earlier state of the same file or folder. If `like` is the state of a folder whose names were listed, the new state has
        the same form.
        """
        self.consulted.add(os.path.normpath(os.path.join(self.root, path)))
        return self._state_of(path, like)

    def _state_of(self, path: str, like: str) -> str:
        """Return the state of a path in the same way as `state`, but without adding the path to `consulted`.

        Use this method for a path on which no result depends.
        """
        listed = like.startswith("folder:")
        absolute = os.path.normpath(os.path.join(self.root, path))
        if (absolute, listed) not in self._states:
            self._states[absolute, listed] = state_of(absolute, listed=listed)
        return self._states[absolute, listed]

    def find(self, kind: str, key: str, usable: Callable[[Any], bool] = lambda _: True) -> CachedResult | None:
        """Return a cached result for which `usable` returns True and whose files are unchanged. Return None if there is no such result."""
        for candidate in self._candidates(kind, key):
            reads = tuple((path, state) for path, state in candidate["reads"])
            if all(self.state(path, state) == state for path, state in reads) and usable(candidate["value"]):
                self.met.update(reads)
                return CachedResult(value=candidate["value"], reads=reads, reason=candidate.get("reason", ""))
        return None

    def keep(self, kind: str, build_key: BuildKey, value: Any, reads: list[Any], reason: str = "") -> None:
        """Store a result under its build key. Later lookups try this result before older results with the same build key."""
        plain = [list(read) for read in reads]
        self.met.update((path, state) for path, state in plain)
        for path, _ in plain:
            self.consulted.add(os.path.normpath(os.path.join(self.root, path)))
        others = [candidate for candidate in self._candidates(kind, build_key.key) if candidate["reads"] != plain]
        self.store.put_json(kind, build_key.key, [{"reads": plain, "value": value, "reason": reason}, *others[: CANDIDATES - 1]])

    def _candidates(self, kind: str, key: str) -> list[Any]:
        candidates = self.store.get_json(kind, key)
        return candidates if isinstance(candidates, list) else []

    def note_files(self, files: dict[str, str]) -> None:
        """Store the states of the files that parts depend on. Paths are relative to the workspace, or absolute."""
        if self.store.get_json("files", self.root) != files:
            self.store.note_json("files", self.root, files)

    def files_changed(self) -> bool:
        """Return whether a file that parts depended on in the last run has changed. If there was no last run, return True."""
        files = self.store.get_json("files", self.root)
        return not isinstance(files, dict) or any(self._state_of(path, state) != state for path, state in files.items())

    # --- last builds, for `thingc why` -------------------------------------------------------------------------------

    def last(self, text: str) -> BuildKey | None:
        """Return the build key that a part definition had when it was last built or reused in this workspace.

        Return None if the definition has not been built or reused in this workspace.
        """
        key = self.store.get_json("last", self._workspace_key(text))
        ingredients = self.store.get_json("build_key", key) if isinstance(key, str) else None
        return BuildKey(ingredients=ingredients) if isinstance(ingredients, dict) else None

    def met_before(self, reference: str) -> bool:
        """Return whether any definition of the part `reference` (`module:Class` or a file) has been built or reused in this workspace."""
        return self.store.get_json("met", self._workspace_key(reference)) is not None

    def remember(self, realized: Iterable[tuple[str, str, BuildKey]]) -> None:
        """Store the last builds as tuples of reference, definition text and build key.

        Data that has not changed is not written.
        """
        for reference, text, build_key in realized:
            if self.store.get_json("last", self._workspace_key(text)) == build_key.key:
                continue
            self.store.note_json("build_key", build_key.key, build_key.ingredients)
            self.store.note_json("last", self._workspace_key(text), build_key.key)
            if not self.met_before(reference):
                self.store.note_json("met", self._workspace_key(reference), True)

    def _workspace_key(self, name: str) -> str:
        """Return the store key of an entry that is valid only for this workspace."""
        return f"{self.root}\n{name}"

    def changed_read(self, key: str) -> str | None:
        """Describe which files of the newest result under a build key have changed. Return None if no file has changed."""
        reads = next((candidate["reads"] for candidate in self._candidates("record", key)), ())
        changes = [_change_text(path, state, now) for path, state in reads if (now := self.state(path, state)) != state]
        return some(changes, 3, separator="; ") if changes else None


def _change_text(path: str, state: str, now: str) -> str:
    if state.startswith("folder:") and now.startswith("folder:"):
        return f"folder {path} contains other files"
    if state == "absent":
        return f"file {path} appeared"
    return f"file {path} is missing" if now == "absent" else f"file {path} changed"
