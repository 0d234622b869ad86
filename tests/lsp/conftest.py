"""A client of the language server, for all tests of a file."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from lsp.editor import Editor


@pytest.fixture(scope="module")
def editor(shared_store: str) -> Iterator[Editor]:
    editor = Editor(shared_store)
    yield editor
    assert editor.leave() == 0
