"""Ctrl-C, and SIGTERM as `kill` and supervisors send it: what a command has begun is cleared away, and it ends with one exit code."""

from __future__ import annotations

import signal
import sys

TYPE_CHECKING = False
"""That of `typing`: until `heed` is called an interrupt prints a traceback, so little is imported before."""

if TYPE_CHECKING:
    from sys import UnraisableHookArgs
    from types import FrameType, TracebackType

INTERRUPTED = 130
"""The exit code of who was interrupted (128 and the number of SIGINT)."""

SOON = 0.001
"""After how long [s] an interrupt that Python has dropped comes again."""


def heed(*, ignored: bool = False) -> None:
    """From here on both signals raise `KeyboardInterrupt`; one that this process was begun to ignore only where it is `ignored` no more: a
    shell has its background jobs ignore SIGINT, and some of them end by nothing else."""
    sys.unraisablehook, sys.excepthook = _dropped, _uncaught
    signal.signal(signal.SIGALRM, _interrupt)
    for number in (signal.SIGINT, signal.SIGTERM):
        if ignored or signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _interrupt)


def came() -> bool:
    """Whether one has come. Code in C and Rust makes another exception of it: an ImportError, a SchemaError."""
    return _came


_came = False


def _interrupt(number: int, frame: FrameType | None) -> None:
    global _came
    _came = True
    raise KeyboardInterrupt


def _dropped(dropped: UnraisableHookArgs) -> None:
    """Python drops what is raised where a weak reference dies, as every import has one, and only prints it."""
    if issubclass(dropped.exc_type, KeyboardInterrupt):
        signal.setitimer(signal.ITIMER_REAL, SOON)
    else:
        sys.__unraisablehook__(dropped)


def _uncaught(kind: type[BaseException], fault: BaseException, traceback: TracebackType | None) -> None:
    """So does a module in C that runs some Python of its own."""
    if issubclass(kind, KeyboardInterrupt):
        signal.setitimer(signal.ITIMER_REAL, SOON)
    else:
        sys.__excepthook__(kind, fault, traceback)
