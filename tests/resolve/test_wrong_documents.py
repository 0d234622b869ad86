"""Small invalid documents and all their diagnostics, from `wrong_documents.txt`.

Each case is `=== title`, documents (`--- name`), and `--- says` with one line per diagnostic, in the order of positions: code,
file:line:column, message, and after `|` the hint; notes follow, with `+`."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from resolve.resolving import run

CASES: dict[str, tuple[dict[str, str], list[str]]] = {}
for _block in re.split(r"^=== ", (Path(__file__).parent / "wrong_documents.txt").read_text(), flags=re.MULTILINE)[1:]:
    _name, _, _rest = _block.partition("\n")
    _parts = re.split(r"^--- (\S+)\n", _rest, flags=re.MULTILINE)[1:]
    _files = dict(zip(_parts[::2], _parts[1::2]))
    _said = _files.pop("says").strip().splitlines()
    assert _name not in CASES and _said
    CASES[_name] = (_files, _said)


@pytest.mark.parametrize("name", CASES)
def test_all_errors_are_reported_once_in_one_run(name: str, tmp_path: Path) -> None:
    files, said = CASES[name]
    assert run(tmp_path, files).said == said
