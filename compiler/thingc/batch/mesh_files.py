"""Read mesh files, and provide MuJoCo's compiler with the mesh files of models."""

from __future__ import annotations

import threading
from collections.abc import Callable, Hashable, Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from thingc.batch.build_records import File
from thingc.batch.folder_layout import read_file

if TYPE_CHECKING:
    import mujoco

MESH_BYTES = 256 * 2**20
"""Total size [bytes] of cached mesh files above which the cache is cleared."""


class MountedFiles:
    """A virtual file system of MuJoCo that contains the mesh files of one model at a time."""

    def __init__(self) -> None:
        self._files: mujoco.MjVfs | None = None
        self._known: dict[str, Hashable] = {}

    def mount(self, identities: Mapping[str, Hashable], read: Callable[[str], bytes]) -> mujoco.MjVfs:
        """Return the file system with exactly the files in `identities`, which maps file names to values that are equal for equal files.

        `read` returns the content of a file by its name. Files that are already in the file system are not read.
        """
        import mujoco

        if self._files is None:
            self._files = mujoco.MjVfs()
        for name in [name for name, identity in self._known.items() if identities.get(name) != identity]:
            del self._files[name], self._known[name]
        for name, identity in identities.items():
            if name not in self._known:
                self._files[name] = read(name)
                self._known[name] = identity
        return self._files


class MeshFiles:
    """The mesh files of the variants of a batch. The contents of all files with the same identity share memory.

    This class is thread-safe. A pickled copy does not contain files.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._contents: dict[File, bytes] = {}
        self._mounted = MountedFiles()

    def __reduce__(self) -> tuple[Any, ...]:
        """Support pickling, which workers of environments and process pools require."""
        return MeshFiles, ()

    def of(self, files: Mapping[str, tuple[File, str]]) -> dict[str, bytes]:
        """Return a mapping from file names of meshes to their contents.

        `files` maps file names to the identity and the path of each file.
        """
        with self._lock:
            if sum(map(len, self._contents.values())) > MESH_BYTES:
                self._contents.clear()
            self._contents.update((file, read_file(path)) for file, path in files.values() if file not in self._contents)
            return {name: self._contents[file] for name, (file, _) in files.items()}

    @contextmanager
    def mount(self, files: Mapping[str, tuple[File, str]]) -> Iterator[mujoco.MjVfs]:
        """Yield a virtual file system of MuJoCo that contains the given mesh files. Only one thread at a time can use this file system."""
        identities = {name: file for name, (file, _) in files.items()}  # each variant has links to the same files
        with self._lock:
            yield self._mounted.mount(identities, lambda name: read_file(files[name][1]))
