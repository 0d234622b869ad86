"""Record which functions of the authors' part code have run.

The compiled code has a mark at the beginning of each function that `source_reader.functions` returns. The mark is an assignment that stores
the file and the number of the function. The assignment takes less than a tenth of a microsecond. Two other methods would have
disadvantages. A profiler would also be called for every function of build123d. A mark that is a function call would count towards Python's
recursion limit.
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

_ran: dict[tuple[str, int], bool] = {}
_marked: set[tuple[str, str]] = set()
"""Paths of the files whose functions have marks, each with the SHA-256 of its source."""


def install() -> None:
    """Define the global variable to which the marks write. Call this function once per process, before part modules are loaded.

    Child processes inherit this variable.
    """
    setattr(builtins, _NAME, _ran)
    signature.install(_note_inspected)


def compile_marked(source: bytes, file: str, sha256: str) -> types.CodeType:
    """Compile a source file with the content hash `sha256`, and return the code with marks in its functions.

    Functions in code that may inspect functions, or that is nested too deeply, do not get marks. Raises the same exceptions as the built-in
    function `compile`.
    """
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
        assignment = ast.copy_location(ast.Assign(targets=[target], value=ast.Constant(value=True)), place)
        function.body.insert(int(documented), ast.fix_missing_locations(assignment))
    return tree


def begin() -> None:
    """Clear the record of functions that have run."""
    _ran.clear()


def of(files: Iterable[str], hashes: Mapping[str, str]) -> dict[str, list[int] | None]:
    """Return the functions that ran, or whose default arguments were read. The result maps each file to the sorted numbers of these
    functions.

    The value is None for a file that was compiled without marks.
    """
    return {file: sorted(number for one, number in _ran if one == file) if (file, hashes[file]) in _marked else None for file in files}


def _note_inspected(function: Callable[..., Any]) -> None:
    """Record a function whose signature is inspected."""
    code = getattr(inspect.unwrap(function), "__code__", None)
    if isinstance(code, types.CodeType):
        marks = [one for one in code.co_consts if isinstance(one, tuple) and len(one) == 2 and one[0] == code.co_filename]
        _ran.update(dict.fromkeys(marks, True))
