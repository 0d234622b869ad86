"""Parse Python source without running it."""

from __future__ import annotations

import ast
import os
import warnings


def parse_python(source: str | bytes) -> ast.Module:
    """Return the syntax tree of a file. Warnings (such as for `"\\d"` since Python 3.12) are suppressed, because the code is not run.

    Raises `SyntaxError`, `ValueError`, `RecursionError` or `MemoryError`, as `ast.parse`, if the file is not valid Python.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return ast.parse(source, os.devnull)  # Python reads source lines for error messages from this file (by default `<unknown>`)
