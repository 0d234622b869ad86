"""Load part modules in the worker from the part folders of the workspace. The current working folder is not searched."""

from __future__ import annotations

import importlib.abc
import importlib.machinery
import importlib.util
import sys
import types
from collections.abc import Collection, Mapping, Sequence
from typing import Any

from thingc.geometry.key.modules import Finder
from thingc.geometry.worker import executed_functions
from thingc.geometry.worker.impure_inputs import builtins_for

_compiled: dict[tuple[str, str], types.CodeType] = {}
"""A cache of code objects. The key is the path of the file and the SHA-256 of its source. The server compiles each file once, and its
children inherit the code objects.
"""


def compile_ahead(file: str, sha256: str | None) -> bool:
    """Compile a source file with the content hash `sha256` without running it. If `sha256` is None, the hash is not checked.

    Return False if the file was already compiled.

    Errors are ignored, because the later import reports them.
    """
    import hashlib

    if (file, sha256) in _compiled:
        return False
    try:
        with open(file, "rb") as stream:
            source = stream.read()
        digest = hashlib.sha256(source).hexdigest()
        if sha256 in (digest, None) and (file, digest) not in _compiled:
            _compiled[file, digest] = executed_functions.compile_marked(source, file, digest)
            builtins_for(_compiled[file, digest])  # the next import uses this cached result
            return True
    except (OSError, SyntaxError, ValueError, RecursionError, MemoryError):
        pass
    return False


class PartImporter(importlib.abc.MetaPathFinder):
    """Finds the modules of part folders in the same way as the client's `Finder`. Therefore, a name refers to the same file in both
    processes.

    `loaded` collects the files of the modules that were found, by name. `hashes` contains the SHA-256 of the files that the client read. A
    folder without `__init__.py` only counts as a package if the client found it in part code (`plain`). For example, a library that tries
    `import dask` must not find the user's folder of that name.
    """

    of_parts = True

    def __init__(self, parts: Sequence[str], packages: Sequence[str], hashes: Mapping[str, str], plain: Collection[str] = ()) -> None:
        self.finder = Finder(parts, packages)
        self.plain = frozenset(plain)
        self.hashes = dict(hashes)
        self.loaded: dict[str, str] = {}

    def find_spec(self, fullname: str, path: Sequence[str] | None, target: Any = None) -> importlib.machinery.ModuleSpec | None:
        """Return the spec of a content-tracked module. Return None if Python must find the module."""
        module = self.finder.find(fullname)
        if module.kind != "content":
            return None
        if module.file is None:
            if fullname not in self.plain:
                return None
            specification = importlib.machinery.ModuleSpec(fullname, None, is_package=True)
            specification.submodule_search_locations = list(module.folders)
            return specification
        self.loaded[fullname] = module.file
        loader = _PartLoader(fullname, module.file, self.hashes.get(module.file))
        return importlib.util.spec_from_file_location(
            fullname, module.file, loader=loader, submodule_search_locations=list(module.folders) or None
        )

    def install(self) -> None:
        """Insert this finder before Python's own finders. The finder does not find protected names (see `modules`)."""
        sys.meta_path.insert(0, self)

    def remove(self) -> None:
        """Remove this finder and the modules that it loaded. The next request may find other files."""
        sys.meta_path.remove(self)
        for name in self.loaded:
            sys.modules.pop(name, None)


class _PartLoader(importlib.machinery.SourceFileLoader):
    """Compiles modules from source, without writing `__pycache__` to the user's folders. If the server has already compiled a module, its
    code object is used.
    """

    def __init__(self, name: str, file: str, sha256: str | None) -> None:
        super().__init__(name, file)
        self.sha256 = sha256

    def exec_module(self, module: types.ModuleType) -> None:
        """Run the code of the module with the builtins that it requires."""
        code = self.get_code(module.__name__)
        special_builtins = builtins_for(code) if code is not None else None
        if special_builtins is not None:
            module.__dict__["__builtins__"] = special_builtins
        super().exec_module(module)

    def get_code(self, fullname: str) -> types.CodeType | None:
        """Return the code object of a module."""
        compiled = _compiled.get((self.path, self.sha256)) if self.sha256 is not None else None
        if compiled is not None:
            return compiled
        return self.source_to_code(self.get_data(self.path), self.path)
