"""Somebody's Python, read and not run."""

from __future__ import annotations

import ast
import os
import warnings


def parse_python(source: str | bytes) -> ast.Module:
    """The syntax tree of a file. Raises what `ast.parse` raises of what is no Python: `SyntaxError`, `ValueError`, `RecursionError` and
    `MemoryError`. What Python merely warns of (from 3.12 on of `"\\d"`, which it prints) is not for whoever reads the file, but runs it."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return ast.parse(source, os.devnull)  # the file in which it looks for a faulty line: by default `<unknown>` of this folder
