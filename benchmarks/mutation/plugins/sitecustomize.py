"""Record which statements of the compiler a Python process executes.

Python imports this module at startup if its folder is in PYTHONPATH, so child processes are recorded, too. TRACED_ROOMS are folders of the
package TRACED_FOLDER; TRACED_LINES is the folder for the result: one JSON file per process. There is no trace function, which would slow
down all other modules as well: when a module in one of the rooms is compiled, a mark is put before each of its statements.
"""

import ast
import atexit
import json
import os
from contextlib import suppress
from importlib.machinery import SourceFileLoader

FOLDER, LINES = os.environ.get("TRACED_FOLDER"), os.environ.get("TRACED_LINES")
ROOMS = tuple(f"{FOLDER}/{room}/" for room in os.environ.get("TRACED_ROOMS", "").split(os.pathsep))
MARKS: dict = {}
"""Per file, 1 for each line at which an executed statement starts."""
compiled = SourceFileLoader.source_to_code


def marks(file, number):
    """Return the marks of a file; called by the instrumented file when it is imported."""
    return MARKS.setdefault(file, bytearray(number))


def marked(body):
    """Return statements with a mark before each; docstrings and imports from `__future__` stay first."""
    for k, statement in enumerate(body):
        text = k == 0 and isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant)
        if not text and not (isinstance(statement, ast.ImportFrom) and statement.module == "__future__"):
            yield from ast.parse(f"__marks__[{statement.lineno}] = 1").body
        yield statement


def source_to_code(loader, data, path, **options):
    if not isinstance(data, bytes) or not str(path).startswith(ROOMS):
        return compiled(loader, data, path, **options)
    tree = ast.parse(data)
    for node in [*ast.walk(tree)]:
        for name in ("body", "orelse", "finalbody"):
            if isinstance(body := getattr(node, name, None), list) and body:
                setattr(node, name, [*marked(body)])
    begin = next((k for k, one in enumerate(tree.body) if isinstance(one, ast.Assign)), len(tree.body))
    asked = f"__marks__ = __import__('sitecustomize').marks({os.path.relpath(path, FOLDER)!r}, {data.count(10) + 2})"
    tree.body[begin:begin] = ast.parse(asked).body
    return compiled(loader, ast.fix_missing_locations(tree), path, **options)


def found():
    """Return the lines at which executed statements start, by file."""
    return {file: [line for line, mark in enumerate(lines) if mark] for file, lines in MARKS.items()}


def write():
    with suppress(Exception), open(os.path.join(LINES, f"{os.getpid()}.json"), "w") as out:
        json.dump(found(), out)


if FOLDER and LINES:
    SourceFileLoader.source_to_code = source_to_code
    atexit.register(write)
