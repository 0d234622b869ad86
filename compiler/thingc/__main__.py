"""The process of the command `thingc`, also as `python -m thingc`: how it heeds signals, prints, and leaves."""

from __future__ import annotations

import os

from thingc.tools.cli import signals


def entry() -> None:
    """The console script: leaves without the interpreter's slow farewell, after everything has been written."""
    try:
        signals.install_handlers()  # before anything else is imported, which takes the longest of some commands
        code = _run()
    except KeyboardInterrupt:  # while modules were imported, or after everything was done
        code = signals.INTERRUPTED
    os._exit(code)


def _run() -> int:
    import gc
    import io
    import sys

    gc.set_threshold(100_000, 20, 20)  # objects are needed until the end, and garbage collection takes a tenth of a check
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # a terminal may know fewer letters than documents hold
    from thingc.tools.cli.main import main

    os.environ.setdefault("MUJOCO_GL", "disable")  # MuJoCo loads no OpenGL library, which takes longer than the models of a small robot
    code = main()
    sys.stdout.flush()
    sys.stderr.flush()
    return code


if __name__ == "__main__":
    entry()
