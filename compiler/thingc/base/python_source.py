"""Parse Python source code without running it."""

from __future__ import annotations

import ast
import os
import warnings


def parse_python(source: str | bytes) -> ast.Module:
    r"""Parse the source code of a Python file, and return its syntax tree.

    Warnings of the parser are suppressed, such as the warning about `"\d"` since Python 3.12, because the code is not run. Raises the same
    errors as `ast.parse` for invalid source code: `SyntaxError`, `ValueError`, `RecursionError` or `MemoryError`.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return ast.parse(source, os.devnull)  # Python reads source lines for error messages from this file (by default `<unknown>`)
