"""What workers see of the environment: nothing whose value is not either the same everywhere or in the key of every part."""

from __future__ import annotations

import os
from collections.abc import Mapping

PASSED = ("LD_LIBRARY_PATH", "DYLD_LIBRARY_PATH", "SYSTEMROOT")
"""Variables without which Python or the kernel may not start: they are passed, and their values are in every key."""

FIXED: Mapping[str, str] = {
    "PATH": os.defpath, "LC_ALL": "C.UTF-8", "PYTHONUTF8": "1", "TZ": "UTC",
    "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1",
    # freed memory is kept for what is asked for next: a child lives for a second, and fresh pages took a tenth of its time
    "GLIBC_TUNABLES": ":".join(f"glibc.malloc.{name}={number}" for name, number in (
        ("mmap_threshold", 1 << 25), ("top_pad", 1 << 24), ("trim_threshold", 1 << 30), ("tcache_count", 64),
    )),
}

TEMPORARY = ("TMPDIR", "TEMP", "TMP")
HOMES = ("HOME", "USERPROFILE")
"""Variables that name the scratch folder of each part (see `scratch`)."""


def passed() -> dict[str, str]:
    """The variables that are passed on, as they are here."""
    return {name: os.environ[name] for name in PASSED if name in os.environ}


def environment(seed: int = 0) -> dict[str, str]:
    """The environment of a worker, with the hash seed `seed`. Where temporary files go is for the worker alone: a part gets a folder
    of its own there."""
    variables = {name: os.environ[name] for name in TEMPORARY if name in os.environ}
    variables.update(passed())
    variables.update(FIXED)
    variables["PYTHONHASHSEED"] = str(seed)
    from thingc.geometry.key.modules import OWN_FOLDER, own_roots

    own = os.path.dirname(OWN_FOLDER)
    if not (os.path.realpath(own) + os.sep).startswith(own_roots()):
        variables["PYTHONPATH"] = own
    return variables
