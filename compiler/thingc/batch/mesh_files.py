"""Provide MuJoCo's compiler with the mesh files of models."""

from __future__ import annotations

import threading
from collections.abc import Callable, Hashable, Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import mujoco


class MeshFiles:
    """A virtual file system of MuJoCo that contains the mesh files of one model at a time.

    Files that consecutive models share are read once. Threads that share the object must hold `lock` until their model is compiled. A
    pickled copy is empty.
    """

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self._files: mujoco.MjVfs | None = None
        self._known: dict[str, Hashable] = {}

    def __reduce__(self) -> tuple[Any, ...]:
        """Support pickling, which workers of environments and process pools require."""
        return MeshFiles, ()

    def mount(self, wanted: Mapping[str, Hashable], read: Callable[[str], bytes]) -> mujoco.MjVfs:
        """Return the file system with exactly the given files.

        `wanted` maps file names to identities, which are equal for equal files. `read` returns the content of a file by its name.
        """
        import mujoco

        if self._files is None:
            self._files = mujoco.MjVfs()
        for name in [name for name, identity in self._known.items() if wanted.get(name) != identity]:
            del self._files[name], self._known[name]
        for name, identity in wanted.items():
            if name not in self._known:
                self._files[name] = read(name)
                self._known[name] = identity
        return self._files
