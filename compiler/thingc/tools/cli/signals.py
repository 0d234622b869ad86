"""Handle Ctrl-C and SIGTERM. A command that is interrupted cleans up and exits with the code `INTERRUPTED`."""

from __future__ import annotations

import os
import signal
import sys
from contextlib import contextmanager

TYPE_CHECKING = False
"""Replaces `typing.TYPE_CHECKING`, because importing `typing` would take time during which Ctrl-C prints a traceback."""

if TYPE_CHECKING:
    from collections.abc import Iterator
    from sys import UnraisableHookArgs
    from types import FrameType
    from typing import NoReturn

INTERRUPTED = 130
"""Exit code after an interrupt (128 + SIGINT)."""

ALARM = getattr(signal, "SIGALRM", None)
"""The signal of timers. Windows has no such signal: an interrupt during an import is not repeated there, and users press Ctrl-C again."""

SOON = 0.001
"""Delay [s] after which a lost interrupt is repeated."""

IMPORTING = "<frozen importlib._bootstrap>"
"""File name of stack frames in Python's import system."""


def install_handlers(*, ignored: bool = False) -> None:
    """Install a signal handler that raises `KeyboardInterrupt` on SIGINT and SIGTERM.

    If a signal arrives during an import, the exception is delayed. If the parent process ignores a signal, this process ignores it, too,
    unless `ignored` is true. Shells ignore SIGINT in background jobs.
    """
    sys.unraisablehook = _repeat_interrupt
    if ALARM is not None:
        signal.signal(ALARM, _interrupt)
    for number in (signal.SIGINT, signal.SIGTERM):
        if ignored or signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _interrupt)


def leave_at_once() -> None:
    """Install a signal handler that exits immediately on SIGINT and SIGTERM. Use this function in processes that require no cleanup."""
    for number in (signal.SIGINT, signal.SIGTERM, ALARM):
        if number is not None:
            signal.signal(number, lambda *_: os._exit(INTERRUPTED))


@contextmanager
def delay_signals() -> Iterator[None]:
    """A context manager that delays Ctrl-C and SIGTERM until the exit of the context, for example to write several files completely."""
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
    """Return whether Ctrl-C or SIGTERM has interrupted this process.

    C or Rust code may have converted the `KeyboardInterrupt` to another exception.
    """
    return _come


_held = _late = _come = False


def _interrupt(number: int, frame: FrameType | None) -> None:
    """Raise `KeyboardInterrupt` after a signal. During an import, delay the exception, because C and Rust modules can suppress it."""
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


def _repeat_interrupt(dropped: UnraisableHookArgs) -> None:
    """The `sys.unraisablehook` of this process, which repeats interrupts that Python ignores, for example in callbacks of weak references.
    """
    if issubclass(dropped.exc_type, KeyboardInterrupt):
        _come_again()
    else:
        sys.__unraisablehook__(dropped)


def _come_again() -> None:
    if ALARM is not None:
        signal.setitimer(signal.ITIMER_REAL, SOON)
