"""Parse Python source without running it."""

from __future__ import annotations

import ast
import os
import warnings


def parse_python(source: str | bytes) -> ast.Module:
    """Return the syntax tree of a file. Warnings (such as for `"\\d"` since Python 3.12) are suppressed: they concern running the file.

    Raises `SyntaxError`, `ValueError`, `RecursionError` or `MemoryError`, as `ast.parse`, if it is not valid Python.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return ast.parse(source, os.devnull)  # Python reads lines of errors from this file, by default `<unknown>`
