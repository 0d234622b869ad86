"""Find the data files of a part in the folder of its module or in the workspace, and record that the part reads them."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path

from thingc.geometry.things.construction import running_file

_record: Callable[[str], None] | None = None
_roots: tuple[str, ...] = ()


def install(record: Callable[[str], None] | None, roots: Sequence[str] = ()) -> None:
    """Set the folders `roots` that `asset` searches. After this call, `asset` calls `record` with every absolute path that it tries,
    whether the file exists or not.

    The geometry worker calls this function before it loads part modules. `install(None)` restores the initial settings.
    """
    global _record, _roots
    _record = record
    _roots = tuple(os.path.realpath(root) for root in roots)


def asset(path: str, beside: str | None = None) -> Path:
    """Return the path of the data file `path`. Examples are `import_step(asset("motor.step"))` and `asset("curve.json").read_text()`.

    The file is first searched in the folder of the file `beside` (pass `__file__`). By default, this is the folder of the module that
    defines the part. If the file is not there, it is searched in the workspace, or in the working folder if no build is running. The part
    is rebuilt when the data file changes. Raises `ValueError` if the path is absolute or outside of these folders, and `FileNotFoundError`
    if the file does not exist.
    """
    if os.path.isabs(path):
        raise ValueError(f"asset() expects a path relative to the part's module or to the workspace, found `{path}`")
    module = beside if beside is not None else running_file()
    folders = [os.path.dirname(os.path.realpath(module))] if module else []
    folders += _roots or ([] if beside is not None else [os.path.realpath(os.getcwd())])
    allowed = False
    for folder in dict.fromkeys(folders):
        named = os.path.normpath(os.path.join(folder, path))
        candidate = os.path.realpath(os.path.join(folder, path))
        if not any(os.path.commonpath([candidate, other]) == other for other in folders):
            continue
        allowed = True
        if _record is not None:
            for looked_at in dict.fromkeys((named, candidate)):  # the target of a link may change as well
                _record(looked_at)
        if os.path.isfile(candidate):
            return Path(candidate)
    if not allowed:
        raise ValueError(f"asset() expects a path inside the part's folder or the workspace, found `{path}`")
    raise FileNotFoundError(f"there is no data file `{path}` next to the part's module or in the workspace")
