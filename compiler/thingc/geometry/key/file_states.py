"""Describe the state of a file or folder as a short string. Cached results of parts depend on these states:

    file:<sha256>     its content
    folder:<sha256>   the names in a folder that was listed
    folder            a folder that was only checked for existence
    absent            no file or folder
"""

from __future__ import annotations

import hashlib
import os

from thingc.base.filesystem import open_file


def state_of(path: str, *, listed: bool = False) -> str:
    """Return the state of the file or folder `path`, in the form described in the docstring of the module.

    If `listed` is True, the state of a folder is the digest of the names in the folder.
    """
    try:
        with open_file(path) as stream:
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
