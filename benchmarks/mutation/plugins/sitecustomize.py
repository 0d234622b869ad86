"""Record which lines of the compiler a Python process executes.

Python imports this module at startup if its folder is in PYTHONPATH, so child processes are recorded, too. TRACED_FOLDER is the package to
trace, TRACED_LINES the folder for the result: one JSON file per process. A function is no longer traced after `ENOUGH` calls without a
new line, which keeps the slowdown small.
"""

import atexit
import json
import os
import sys
import threading
from collections import Counter
from contextlib import suppress

ENOUGH = 200
FOLDER, LINES = os.environ.get("TRACED_FOLDER"), os.environ.get("TRACED_LINES")
SEEN: dict = {}
"""Lines by file; None for a file outside the package."""
CALLS: Counter = Counter()


def trace(frame, event, argument):
    code = frame.f_code
    name = code.co_filename
    lines = SEEN.get(name, ())
    if lines == ():
        lines = SEEN[name] = set() if name.startswith(FOLDER) else None
    if lines is None:
        return None
    function = name, code.co_firstlineno
    CALLS[function] += 1
    if CALLS[function] > ENOUGH:
        return None

    def line(frame, event, argument):
        if frame.f_lineno not in lines:
            lines.add(frame.f_lineno)
            CALLS[function] = 0
        return line

    return line


def write():
    sys.settrace(None)
    with suppress(Exception), open(os.path.join(LINES, f"{os.getpid()}.json"), "w") as out:
        json.dump({os.path.relpath(name, FOLDER): sorted(lines) for name, lines in SEEN.items() if lines}, out)


if FOLDER and LINES:
    atexit.register(write)
    threading.settrace(trace)
    sys.settrace(trace)
