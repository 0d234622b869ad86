"""Record which statements of the compiler a Python process executes.

Python imports this module at startup if its folder is in `PYTHONPATH`. Therefore, child processes are recorded, too. The environment
variable `TRACED_ROOMS` lists folders below the package folder `TRACED_FOLDER`. Each process writes a JSON file to the folder
`TRACED_LINES`. A trace function is not used, because it would also slow down all other modules. Instead, each module of these folders is
compiled with a mark before each statement.
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
"""A byte array for each file. The byte of a line is 1 if a statement that starts on this line has run."""
compiled = SourceFileLoader.source_to_code


def marks(file, number):
    """Return the marks of a file. A file with marks calls this function when it is imported."""
    return MARKS.setdefault(file, bytearray(number))


def marked(body):
    """Insert a mark before each statement. Docstrings and imports from `__future__` must remain first."""
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
    """Return the lines at which executed statements start, by source file."""
    return {file: [line for line, mark in enumerate(lines) if mark] for file, lines in MARKS.items()}


def write():
    with suppress(Exception), open(os.path.join(LINES, f"{os.getpid()}.json"), "w") as out:
        json.dump(found(), out)


if FOLDER and LINES:
    SourceFileLoader.source_to_code = source_to_code
    atexit.register(write)
