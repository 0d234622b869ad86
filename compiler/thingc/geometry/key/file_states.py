"""How a file is, in a word that a part's answer can be kept by:

    file:<sha256>     its content
    folder:<sha256>   the names in a folder that was listed
    folder            a folder that was only looked at
    absent            nothing there
"""

from __future__ import annotations

import hashlib
import os

from thingc.base.filesystem import opened


def state_of(path: str, *, listed: bool = False) -> str:
    """What lies at `path` now, in the words above; `listed` makes a folder count by its names."""
    try:
        with opened(path) as stream:
            return "file:" + hashlib.file_digest(stream, "sha256").hexdigest()
    except IsADirectoryError:
        pass
    except OSError:
        if not os.path.isdir(path):
            return "absent"
    if not listed:
        return "folder"
    try:
        names = "\n".join(sorted(os.listdir(path)))
    except OSError:
        return "absent"
    return "folder:" + hashlib.sha256(names.encode("utf-8", "surrogateescape")).hexdigest()
