"""Hide the modules and functions that Windows does not have, except those that Python's own modules need on Linux. If this module is
imported when Python starts, no process of the environment has these features."""

import os
import signal
import sys

for name in ("fcntl", "grp", "pty", "pwd", "resource", "termios"):
    sys.modules[name] = None  # type: ignore[assignment]

for name in (
    "O_CLOEXEC", "O_DIRECTORY", "O_NOFOLLOW", "O_NONBLOCK", "O_PATH", "fchdir", "fork", "forkpty", "getpgid", "getpriority", "geteuid",
    "getuid", "killpg", "mkfifo", "nice", "pread", "pwrite", "setpriority", "setsid", "sysconf",
):
    delattr(os, name)

for name in ("ITIMER_PROF", "ITIMER_REAL", "SIGALRM", "SIGHUP", "SIGPROF", "SIGSTOP", "pause", "setitimer"):
    delattr(signal, name)

os.supports_fd.discard(os.chdir)
_open = os.open


def _without_folders(path, flags, mode=0o777, *, dir_fd=None):  # type: ignore[no-untyped-def]
    """Behave like `os.open` on Windows, which cannot open a folder."""
    if os.path.isdir(path):
        raise PermissionError(13, "Permission denied", path)
    return _open(path, flags, mode, dir_fd=dir_fd)


os.open = _without_folders
