"""Ctrl-C, and SIGTERM as `kill` and supervisors send it: what a command has begun is cleared away, and it ends with one exit code."""

from __future__ import annotations

import os
import signal
import sys
from contextlib import contextmanager

TYPE_CHECKING = False
"""That of `typing`: until `heed` is called an interrupt prints a traceback, so little is imported before."""

if TYPE_CHECKING:
    from collections.abc import Iterator
    from sys import UnraisableHookArgs
    from types import FrameType
    from typing import NoReturn

INTERRUPTED = 130
"""The exit code of who was interrupted (128 and the number of SIGINT)."""

SOON = 0.001
"""After how long [s] an interrupt that would be lost comes again."""

IMPORTING = "<frozen importlib._bootstrap>"
"""Where the code lies that imports modules."""


def heed(*, ignored: bool = False) -> None:
    """From here on both signals raise `KeyboardInterrupt`, those that come while modules are imported as soon as that is done; one that
    this process was begun to ignore only where it is `ignored` no more: a shell has its background jobs ignore SIGINT, and some of them
    end by nothing else."""
    sys.unraisablehook = _dropped
    signal.signal(signal.SIGALRM, _interrupt)
    for number in (signal.SIGINT, signal.SIGTERM):
        if ignored or signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _interrupt)


def leave_at_once() -> None:
    """From here on both signals end the process where it stands: one that has nothing to clear away, and waits where no exception gets
    through, as an event loop does for its threads."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGALRM):
        signal.signal(number, lambda *_: os._exit(INTERRUPTED))


def spare_the_child_of_glfw() -> None:
    """glfw, which MuJoCo imports, looks at its library in a Python process of its own, a tenth of that import, and Ctrl-C has that print a
    traceback. Where it is told its library it does not; this is the one that it brings with it on Linux, and would take."""
    from thingc.base.installed_packages import package_folder

    folder = package_folder("glfw") if sys.platform == "linux" else None
    if folder is None:
        return
    session = "wayland" if os.environ.get("XDG_SESSION_TYPE") == "wayland" else "x11"
    library = os.path.join(folder, os.environ.get("PYGLFW_LIBRARY_VARIANT", session).lower(), "libglfw.so")
    if os.path.exists(library):
        os.environ.setdefault("PYGLFW_LIBRARY", library)


@contextmanager
def held() -> Iterator[None]:
    """Meanwhile no interrupt gets through: files that belong together are written. It comes afterwards."""
    global _held, _late
    _held = True
    try:
        yield
    finally:
        _held = False
        if _late:
            _late = False
            _raise()


def has_come() -> bool:
    """Whether an interrupt has been raised: another exception after that may be what code in C or Rust has made of it."""
    return _come


_held = _late = _come = False


def _interrupt(number: int, frame: FrameType | None) -> None:
    """Raise it, but for a module that is being imported: what is written in C and Rust prints it there, makes an error of itself of it, or
    goes on without."""
    global _late
    if _held:
        _late = True
        return
    while frame is not None:
        if frame.f_code.co_filename == IMPORTING:
            _come_again()
            return
        frame = frame.f_back
    _raise()


def _raise() -> NoReturn:
    global _come
    _come = True
    raise KeyboardInterrupt


def _dropped(dropped: UnraisableHookArgs) -> None:
    """Python drops what is raised where a weak reference dies, and only prints it."""
    if issubclass(dropped.exc_type, KeyboardInterrupt):
        _come_again()
    else:
        sys.__unraisablehook__(dropped)


def _come_again() -> None:
    signal.setitimer(signal.ITIMER_REAL, SOON)
