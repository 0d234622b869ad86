"""The environment variables of workers. Each variable either has a fixed value, or its value is part of the cache key of every part."""

from __future__ import annotations

import os
from collections.abc import Mapping

PASSED = ("LD_LIBRARY_PATH", "DYLD_LIBRARY_PATH", "SYSTEMROOT")
"""Environment variables that Python or the CAD kernel may need to start. Workers inherit these variables, and their values are part of
every cache key.
"""

FIXED: Mapping[str, str] = {
    "PATH": os.defpath, "LC_ALL": "C.UTF-8", "PYTHONUTF8": "1", "TZ": "UTC",
    "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1",
    # reuse freed memory: a child runs for about a second and would spend a tenth of this time on new memory pages
    "GLIBC_TUNABLES": ":".join(f"glibc.malloc.{name}={number}" for name, number in (
        ("mmap_threshold", 1 << 25), ("top_pad", 1 << 24), ("trim_threshold", 1 << 30), ("tcache_count", 64),
    )),
}

TEMPORARY = ("TMPDIR", "TEMP", "TMP")
HOMES = ("HOME", "USERPROFILE")
"""Environment variables that are set to the scratch folder of each part (see `scratch`)."""


def passed_variables() -> dict[str, str]:
    """Return the environment variables in `PASSED` that are set in this process, with their values."""
    return {name: os.environ[name] for name in PASSED if name in os.environ}


def environment(seed: int = 0) -> dict[str, str]:
    """Return the environment of a worker, with the hash seed `seed`.

    In the worker process itself, the variables in `TEMPORARY` have this value. For each part, the variables are changed to the temporary
    folder of the part.
    """
    temporary = {name: os.environ[name] for name in TEMPORARY if name in os.environ}
    variables = {**temporary, **passed_variables(), **FIXED, "PYTHONHASHSEED": str(seed)}
    from thingc.geometry.key.modules import OWN_FOLDER, own_roots

    package_folder = os.path.dirname(OWN_FOLDER)
    if not (os.path.realpath(package_folder) + os.sep).startswith(own_roots()):
        variables["PYTHONPATH"] = package_folder
    return variables
