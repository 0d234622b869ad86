"""The mutation campaign: all kinds of changes are made, but none without an effect; its rooms exist; changed functions are executed."""

from __future__ import annotations

import ast
import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path
from types import FunctionType

import pytest

FOLDER = Path(__file__).resolve().parents[2] / "benchmarks" / "mutation"
SOURCE = '''\
"""A docstring: 1 + 1."""
from typing import TYPE_CHECKING, Literal
Kind = Literal["a", "b"]
if TYPE_CHECKING:
    LEFT = 1 + 1
def f(ä: tuple[int, str] = (), *, x: int) -> dict[str, int]:
    if not x:
        report.add(Code.X, f"{x + 1} of 2", help="a" + "b")
    y = ä + x; z = x * 0.5; seen.add(3)
    return min(y, z) if -x < y and x in (1, y) else (z, y)
'''
CHANGES = {
    (7, "not x", "x"), (9, "ä + x", "(ä - x)"), (9, "ä + x", "ä"), (9, "x * 0.5", "(x / 0.5)"), (9, "x * 0.5", "(-(x * 0.5))"),
    (9, "0.5", "1.0"), (9, "3", "4"), (10, "min(y, z)", "max(y, z)"), (10, "-x < y", "(-x <= y)"), (10, "-x", "x"), (10, "1", "2"),
    (10, "-x < y and x in (1, y)", "(-x < y or x in (1, y))"), (10, "-x < y and x in (1, y)", "(-x < y)"),
    (10, "-x < y and x in (1, y)", "(x in (1, y))"), (10, "x in (1, y)", "(x not in (1, y))"), (10, "(z, y)", "(y, z)"),
    (10, "min(y, z) if -x < y and x in (1, y) else (z, y)", "((z, y) if -x < y and x in (1, y) else min(y, z))"),
}


def test_mutants_of_a_module(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(FOLDER))
    from mutants import mutants

    found = list(mutants("m.py", SOURCE))
    assert sorted((one.line, one.old, one.new) for one in found) == sorted(CHANGES)
    before = SOURCE.splitlines()
    for one in found:
        ast.parse(one.text)
        assert [k for k, (a, b) in enumerate(zip(before, one.text.splitlines(), strict=True), 1) if a != b] == [one.line]


def test_rooms_and_their_tests_exist(monkeypatch: pytest.MonkeyPatch, root: Path) -> None:
    monkeypatch.syspath_prepend(str(FOLDER))
    from coverage_map import IMPORTED, OTHERS, PACKAGE, ROOMS

    assert [room for room in IMPORTED if not [*(root / PACKAGE / room).glob("*.py")]] == []
    tests = [name for names in (*ROOMS.values(), OTHERS) for name in names]
    assert [name for name in tests if not [*(root / "tests" / name).glob("test_*.py")]] == []


def test_functions_of_a_module_get_changed_code(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.syspath_prepend(str(FOLDER))
    from forks import patched

    path = tmp_path / "changing.py"
    text = "def f(x):\n    return x + 1\ndef g(x):\n    return [f(y) for y in x]\npair = lambda: 1, lambda: 2\n"
    path.write_text(text)
    spec = importlib.util.spec_from_file_location("changing", path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    functions = [one for one in vars(module).values() if isinstance(one, FunctionType)]
    patched(functions, path, text.replace("x + 1", "x - 1"), False)
    assert module.g([5]) == [4]
    with pytest.raises(ValueError):
        patched(functions, path, text, True)
    with pytest.raises(ValueError):  # which of two functions of one line is meant cannot be told
        patched([*functions, *module.pair], path, text, False)


def test_marks_of_executed_statements(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    lines = tmp_path / "lines"
    (tmp_path / "room").mkdir()
    lines.mkdir()
    for name, value in {"TRACED_FOLDER": tmp_path, "TRACED_LINES": lines, "TRACED_ROOMS": "room"}.items():
        monkeypatch.setenv(name, str(value))
    first = '"""A docstring."""\nfrom __future__ import annotations\n'
    text = f'{first}def f(x):\n    """Another."""\n    if x:\n        return 1\n    return 2\nf(0)\n'
    (tmp_path / "room" / "marked.py").write_text(text)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(FOLDER / "plugins"), str(tmp_path / "room")]))
    subprocess.run([sys.executable, "-c", "import marked"], check=True)
    [found] = lines.iterdir()
    assert json.loads(found.read_text()) == {"room/marked.py": [3, 5, 7, 8]}


@pytest.mark.slow
def test_mutants_need_test_files(tmp_path: Path) -> None:
    """Without test files, all mutants would survive, and the results would be stored."""
    words = [sys.executable, FOLDER / "campaign.py", "--number", "1", "--map-minutes", "0", "--folder", tmp_path]
    done = subprocess.run(words, check=False, capture_output=True, text=True)
    assert done.returncode == 1 and done.stderr.startswith("the map has no test files") and list(tmp_path.iterdir()) == []
