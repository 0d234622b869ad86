"""A sandbox for part code that is not trusted.

Part code may only change files in its own folder. A change in another folder, such as the store, could affect other parts or persist. In
addition, expressions of an imported robot may read only certain folders, and must not start programs or open connections.

An audit hook of Python refuses a forbidden action first, so that the error has a line number. However, the hook only detects actions of
Python code. If the system supports Landlock (Linux since 5.13), Landlock also refuses these actions. Landlock covers all libraries that the
code loads, and all programs that it starts. Part code cannot remove the restrictions of Landlock.
"""

from __future__ import annotations

import contextlib
import errno
import os
import struct
import sys
from collections.abc import Sequence
from typing import Any

from thingc.geometry.worker import audit
from thingc.geometry.worker.process_tree import prctl, syscall

PROCESSES = 256
"""Maximum number of processes of one part that are alive at the same time."""

DEVICES = "/dev"


class ForbiddenWrite(PermissionError):
    """Raised if part code tries to change a file outside of its own folder, or to read a forbidden file. The attribute `filename` is the
    path of the file.

    The exception is a `PermissionError`. Libraries catch this exception if they do not need the file.
    """

    def __init__(self, path: str, reason: str = "files may be written only to the temporary folder of this process") -> None:
        super().__init__(errno.EACCES, reason, path)


# --- what Python does -------------------------------------------------------------------------------------------------

_CHANGING: dict[str, tuple[tuple[int, int], ...]] = {
    "os.chmod": ((0, 2),), "os.chown": ((0, 3),), "os.link": ((0, 2), (1, 3)), "os.mkdir": ((0, 2),), "os.remove": ((0, 1),),
    "os.removexattr": ((0, -1),), "os.rename": ((0, 2), (1, 3)), "os.rmdir": ((0, 1),), "os.setxattr": ((0, -1),),
    "os.symlink": ((1, 2),), "os.truncate": ((0, -1),), "os.utime": ((0, 3),),
}
"""The positions of arguments of audit events that are changed files.

Each position is paired with the position of the argument that is the open folder to which the path is relative (-1: none).

The audit hook cannot check a path relative to an open folder. Landlock checks these calls.
"""

_FOLLOWING = frozenset({"os.chmod", "os.chown", "os.removexattr", "os.setxattr", "os.truncate", "os.utime"})
"""Audit events of functions that change the target of a symbolic link. Other functions change the link itself."""

_STARTING = ("os.exec", "os.fork", "os.forkpty", "os.posix_spawn", "os.system", "subprocess.Popen", "socket.__new__", "ctypes.dlopen")

OUTSIDE = "the file is outside the robot's folder and all known packages"
"""The reason in an error message about a file that the code must not read."""

_allowed: tuple[str, ...] = ()
_readable: tuple[str, ...] | None = None


def begin(folder: str, readable: Sequence[str] | None = None) -> None:
    """Start to raise `ForbiddenWrite` for all changes of files outside of `folder`.

    If `readable` is given, also refuse reads outside of these folders, new programs and network connections.
    """
    global _allowed, _readable
    audit.listen(("open", *_CHANGING, *(_STARTING if readable is not None else ())), _handle_event)
    _allowed = (os.path.join(os.path.realpath(folder), ""), *([os.path.join(DEVICES, "")] if readable is None else ()))
    _readable = None if readable is None else (*_allowed, *(os.path.join(os.path.realpath(one), "") for one in readable))


def end() -> None:
    """Remove all restrictions that `begin` has set."""
    global _allowed
    _allowed = ()


def _handle_event(event: str, arguments: tuple[Any, ...]) -> None:
    if not _allowed:
        return
    if event == "open":
        path, mode, flags = arguments
        if audit.writes(mode, flags):
            _check(path, itself=True)
        elif _readable is not None and not isinstance(path, int):
            real = os.path.realpath(os.fsdecode(path))
            if not real.startswith(_readable):
                raise ForbiddenWrite(real, OUTSIDE)
        return
    if event in _STARTING:
        raise ForbiddenWrite(event, "programs and network connections are not allowed")
    for place, relative in _CHANGING[event]:
        if relative < 0 or arguments[relative] in (-1, None):
            _check(arguments[place], follow=event in _FOLLOWING)


def _check(path: Any, *, follow: bool = True, itself: bool = False) -> None:
    """Raise `ForbiddenWrite` if a path is outside of the folder.

    If `itself` is True, the path of the folder itself is allowed. If a folder is opened for writing, a file is created in it, as
    `tempfile.TemporaryFile` does. The folder itself cannot be opened for writing.
    """
    if isinstance(path, int) or path is None:
        return
    named = os.path.abspath(os.fsdecode(path))
    real = os.path.realpath(named) if follow else os.path.join(os.path.realpath(os.path.dirname(named)), os.path.basename(named))
    if not real.startswith(_allowed) and not (itself and os.path.join(real, "") == _allowed[0]):
        raise ForbiddenWrite(real)


# --- operations that the system refuses ------------------------------------------------------------------------------------------
# https://docs.kernel.org/userspace-api/landlock.html

_CREATE_RULESET, _ADD_RULE, _RESTRICT_SELF = 444, 445, 446
_VERSION, _PATH_BENEATH = 1, 1
_NO_NEW_PRIVILEGES = 38
_EXECUTE, _READ, _WRITE_FILE, _REMOVE_FILE, _MAKE_FILE = 1 << 0, 1 << 2 | 1 << 3, 1 << 1, 1 << 5, 1 << 8
_REMOVE_OR_MAKE = sum(1 << bit for bit in range(4, 13))
_REFER, _TRUNCATE = 1 << 13, 1 << 14
_SIGNALS = 1 << 1


def confine(folder: str, readable: Sequence[str] | None = None) -> bool:
    """Permanently prevent this process from changing files outside of `folder` and from signalling processes that it has not started.

    If `readable` is given, also prevent reading files outside of these folders, running programs and opening sockets. In addition, the
    number of processes that this process can start is limited. Return False if the system does not support these restrictions.
    """
    _bound_processes()
    return sys.platform == "linux" and _landlock(folder, readable)


def _landlock(folder: str, readable: Sequence[str] | None) -> bool:
    import ctypes

    version = syscall(_CREATE_RULESET, None, ctypes.c_size_t(0), _VERSION)
    if version < 1:
        return False
    handled = _WRITE_FILE | _REMOVE_OR_MAKE | (_REFER if version >= 2 else 0) | (_TRUNCATE if version >= 3 else 0)
    handled |= 0 if readable is None else _EXECUTE | _READ
    attributes = struct.pack("=QQQ", handled, 0, _SIGNALS if version >= 6 else 0)
    rules = syscall(_CREATE_RULESET, attributes, ctypes.c_size_t(len(attributes)), 0)
    if rules < 0:
        return False
    try:
        devices = (DEVICES, handled & (_WRITE_FILE | _TRUNCATE | _REMOVE_FILE | _MAKE_FILE))
        for path, rights in ((folder, handled & ~_EXECUTE), *([devices] if readable is None else [(one, _READ) for one in readable])):
            beneath = os.open(path, os.O_PATH | os.O_CLOEXEC)
            try:
                if syscall(_ADD_RULE, rules, _PATH_BENEATH, struct.pack("=Qi", rights, beneath), 0) != 0:
                    return False
            finally:
                os.close(beneath)
        return prctl(_NO_NEW_PRIVILEGES, 1) and syscall(_RESTRICT_SELF, rules, 0) == 0 and (readable is None or _refuse_calls())
    finally:
        os.close(rules)


_SECCOMP = {"x86_64": (317, 0xC000003E, 41, 90, 91, 268, 425, 452), "aarch64": (277, 0xC00000B7, 198, 52, 53, 425, 452)}
"""For each machine type, the numbers of some system calls: the number of `seccomp`, the id of the machine type, and the numbers of the
calls to refuse.

The refused calls are `socket`, `chmod`, `fchmod`, `fchmodat`, `io_uring_setup` and `fchmodat2`, if the machine type supports these calls.
The calls are refused because Landlock does not restrict Unix sockets, UDP, and permissions of files outside of the folder.
"""


def _refuse_calls() -> bool:
    """Make the operating system refuse the calls in `_SECCOMP`, and all calls of other machine types, in this process (`man 2 seccomp`)."""
    import ctypes

    seccomp, machine, *refused = _SECCOMP.get(os.uname().machine, (-1, 0))
    count, load, equal, beyond, answer = len(refused), 0x20, 0x15, 0x35, 0x06
    steps = [(load, 0, 0, 4), (equal, 0, count + 3, machine), (load, 0, 0, 0), (beyond, count + 1, 0, 1 << 30)]  # x32 has larger numbers
    steps += [*((equal, count - k, 0, one) for k, one in enumerate(refused)), (answer, 0, 0, 0x7FFF0000), (answer, 0, 0, 0x5000D)]  # EACCES
    program = ctypes.create_string_buffer(b"".join(struct.pack("=HBBI", *step) for step in steps))
    return syscall(seccomp, 1, 0, struct.pack("@HP", len(steps), ctypes.addressof(program))) == 0


def _bound_processes() -> None:
    """Set the limit on the number of processes in the operating system. A part may start processes faster than the worker can check their
    number.

    The limit applies to all processes of the user, and does not apply to root. Therefore, the checks of the worker are still needed
    (`worker`).
    """
    import resource

    with contextlib.suppress(OSError, ValueError, IndexError), open("/proc/loadavg", "rb") as stream:
        running = int(stream.read().split()[3].partition(b"/")[2])
        _, hard = resource.getrlimit(resource.RLIMIT_NPROC)
        limit = running + 2 * PROCESSES
        if hard == resource.RLIM_INFINITY or limit < hard:
            resource.setrlimit(resource.RLIMIT_NPROC, (limit, limit))
