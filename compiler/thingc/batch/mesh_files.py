"""Read the mesh files of the variants of a batch.

Each mesh file is read once, and the result is shared by all variants that use the file.
"""

from __future__ import annotations

import contextlib
import threading
from collections import OrderedDict
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from thingc.batch.build_records import File

if TYPE_CHECKING:
    import mujoco

MESH_BYTES = 256 * 2**20
"""Maximum total size [bytes] of cached mesh files."""


class MeshFiles:
    """A cache for the contents of mesh files. All files with the same identity are read once.

    If the cache contains more than `most` bytes, the least recently used files are removed. The most recent virtual file system of MuJoCo
    is also cached. This class is thread-safe. A pickled copy of the cache is empty.
    """

    def __init__(self) -> None:
        self._size = 0
        self._kept: OrderedDict[File, bytes] = OrderedDict()
        self._lock = threading.Lock()
        self._last: tuple[Mapping[str, File], mujoco.MjVfs] | None = None

    def __reduce__(self) -> tuple[Any, ...]:
        """Support pickling, which workers of environments and process pools require."""
        return MeshFiles, ()

    def of(self, files: Mapping[str, tuple[File, str]]) -> dict[str, bytes]:
        """Return a mapping from file names of meshes to their contents.

        `files` maps file names to the identity and the path of each file.
        """
        with self._lock:
            return self._read(files)

    def _read(self, files: Mapping[str, tuple[File, str]]) -> dict[str, bytes]:
        contents: dict[str, bytes] = {}
        for name, (file, path) in files.items():
            data = self._kept.get(file)
            if data is None:
                with open(path, "rb") as stream:
                    data = self._kept[file] = stream.read()
                self._size += len(data)
            self._kept.move_to_end(file)
            contents[name] = data
        while self._size > MESH_BYTES and len(self._kept) > len(contents):
            self._size -= len(self._kept.popitem(last=False)[1])
        return contents

    @contextlib.contextmanager
    def mounted(self, wanted: Mapping[str, tuple[File, str]]) -> Iterator[mujoco.MjVfs]:
        """Yield a virtual file system of MuJoCo that contains the given mesh files. Only one thread at a time can use this file system."""
        import mujoco

        own = {name: file for name, (file, _) in wanted.items()}  # by identity: each variant has links to the same files in its own folder
        with self._lock:
            if self._last is None or self._last[0] != own:
                files = mujoco.MjVfs()
                for name, data in self._read(wanted).items():
                    files[name] = data
                self._last = own, files
            yield self._last[1]
