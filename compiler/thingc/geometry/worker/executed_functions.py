"""Which functions of the authors' code have run.

Their source is compiled with a mark at the beginning of each function that `source_reader.functions` gives: an assignment that notes its
file and number, and costs less than a tenth of a microsecond. A profiler would be called for every function of build123d as well, and a
mark that is a call would be one more for Python's bound on recursion.
"""

from __future__ import annotations

import ast
import builtins
import inspect
import types
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from thingc.geometry.key.source_reader import LOOKING, functions
from thingc.geometry.things import signature

_NAME = "__thingc_ran__"

_noted: dict[tuple[str, int], bool] = {}
_marked: set[tuple[str, str]] = set()
"""Files whose functions have marks, with the SHA-256 of their source."""


def install() -> None:
    """Give the marks what they write to. Once per process, before part modules are loaded; inherited by its children."""
    setattr(builtins, _NAME, _noted)
    signature.install(_look_at)


def compiled(source: bytes, file: str, sha256: str) -> types.CodeType:
    """The code of a source file whose content is `sha256`, its functions with marks. Code that may look at functions, and what is nested
    too deeply, has none. Raises what `compile` raises."""
    if LOOKING.search(source) is None:
        try:
            code = compile(_with_marks(source, file), file, "exec", dont_inherit=True)
            _marked.add((file, sha256))
            return code
        except RecursionError:
            pass
    return compile(source, file, "exec", dont_inherit=True)


def _with_marks(source: bytes, file: str) -> ast.Module:
    tree = ast.parse(source, file)
    for number, function in enumerate(functions(tree, source)):
        first = function.body[0]
        documented = isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant)
        place = function.body[min(int(documented), len(function.body) - 1)]
        mark: Any = (file, number)
        target = ast.Subscript(value=ast.Name(id=_NAME, ctx=ast.Load()), slice=ast.Constant(value=mark), ctx=ast.Store())
        noting = ast.copy_location(ast.Assign(targets=[target], value=ast.Constant(value=True)), place)
        function.body.insert(int(documented), ast.fix_missing_locations(noting))
    return tree


def begin() -> None:
    """Forget what has run."""
    _noted.clear()


def of(files: Iterable[str], hashes: Mapping[str, str]) -> dict[str, list[int] | None]:
    """By file that was loaded, the numbers of the functions that ran, or whose defaults were looked at, sorted; None where nobody knows."""
    return {file: sorted(number for one, number in _noted if one == file) if (file, hashes[file]) in _marked else None for file in files}


def _look_at(function: Callable[..., Any]) -> None:
    """Note a function whose signature is read."""
    code = getattr(inspect.unwrap(function), "__code__", None)
    if isinstance(code, types.CodeType):
        marks = [one for one in code.co_consts if isinstance(one, tuple) and len(one) == 2 and one[0] == code.co_filename]
        _noted.update(dict.fromkeys(marks, True))
