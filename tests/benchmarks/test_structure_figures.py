"""The figures of `make structure` for modules of a few lines."""

from __future__ import annotations

import ast
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
LONG = "def long(a, /, b, c, *d, e, f, g, **h):\n" + "    pass\n" * 50
TEXTS = {
    "graph/one.py": "def late():\n    from thingc.graph.two import b\n\nclass Link:\n    def seven(self, a, b, c, d, e, f, g): ...\n",
    "graph/two.py": "from thingc.graph import one\nif TYPE_CHECKING:\n    import thingc.api\n\nclass Link: ...\n",
    "api.py": "import thingc.graph.two\n" + LONG,
    "graph/__init__.py": "",
    "templates/__init__.py": "",
    "templates/arm/parts/rod.py": "class Link: ...\n",
}


def test_figures_of_a_structure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks" / "structure"))
    monkeypatch.delitem(sys.modules, "figures", raising=False)
    import figures  # type: ignore[import-not-found]

    found = figures.structure(TEXTS)
    assert found.rooms == {"graph": 8, "api.py": 52, "templates": 0}
    assert found.largest == (52, "api.py")
    assert found.circles == [["thingc.graph.one", "thingc.graph.two"]], "an import in a function counts, one for types does not"
    assert found.twice == ["Link: graph/one.py, graph/two.py"]
    assert [(one.where, one.lines, one.parameters) for one in found.functions] == [
        ("api.py:2 long", 51, 8), ("graph/one.py:1 late", 2, 0), ("graph/one.py:5 seven", 1, 7)
    ]
    assert found.names == {"late": 1, "seven": 1, "long": 1}
    text = '"""Of a module."""\n\nX = 1  # one\n"""Of X."""\n# none\ndef f():\n    """Of f."""\n    return (\n        X)\n'
    assert figures.code_lines(text, ast.parse(text)) == 4
    rows = dict(found.rows())
    assert (rows["functions of more than 50 lines"], rows["functions with 8 or more parameters"]) == (1, 1)
