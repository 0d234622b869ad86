"""Small wrong documents and everything that is said about them: `wrong_documents.txt` is read as it stands.

Each case is `=== what is wrong`, documents (`--- name`), and `--- says` with one line per diagnostic, in the order of
places: code, file:line:column, message, and after `|` the hint; notes follow, with `+`.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from resolve.resolving import run
from thingc.base.diagnostics import Code

CASES: dict[str, tuple[dict[str, str], list[str]]] = {}
for _block in re.split(r"^=== ", (Path(__file__).parent / "wrong_documents.txt").read_text(), flags=re.MULTILINE)[1:]:
    _name, _, _rest = _block.partition("\n")
    _parts = re.split(r"^--- (\S+)\n", _rest, flags=re.MULTILINE)[1:]
    _files = dict(zip(_parts[::2], _parts[1::2]))
    _said = _files.pop("says").strip().splitlines()
    assert _name not in CASES and _said
    CASES[_name] = (_files, _said)


@pytest.mark.parametrize("name", CASES)
def test_everything_wrong_is_said_once_in_one_run(name: str, tmp_path: Path) -> None:
    files, said = CASES[name]
    assert run(tmp_path, files).said == said


def test_every_code_of_this_pass_has_a_case() -> None:
    met = {line.split()[0] for _, said in CASES.values() for line in said if line[0] != "+"}
    unmet = {code.name for code in Code if code.code.startswith("TC3") and code.code not in met}
    # A library that is not installed: in `test_materials`. What is wrong with a lock: in `tests/safety`. A test of the document
    # that cannot be run, and modules that hide others: in `tests/cases`.
    lock = {"NO_LOCK", "LOCK_STALE", "LOCK_BROKEN", "NOT_LOCKED", "LOCK_DOCUMENT", "NOT_LOOKED_AT", "TOO_COSTLY"}
    assert unmet - lock == {"HIDDEN", "LIBRARY", "TEST"}
