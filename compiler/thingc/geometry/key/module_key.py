"""The code that a part depends on: its module and all modules that this one imports, found by reading source files.

Import statements are followed wherever they are, also in functions. They are followed into part folders and packages that are tracked by
content; the packages that contain a module are included. Comments, layout and docstrings do not count, unless some code may read
docstrings: then the text of every file counts. A module that is imported in another way is detected when the part runs, and counts as a
file that the part read.
"""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass, field

from thingc.base.frozen_struct import FrozenStruct
from thingc.geometry.key.modules import Finder, Module
from thingc.geometry.store.local import Store

VERSION = 4
"""Version of `ModuleFacts`. Raise it when their meaning changes, since they are cached by the content of a file."""

MAX_UNTRUSTED = 1_000_000
"""Maximum number of bytes of source read from an untrusted workspace. A syntax tree needs a hundred times as much memory."""

MAX_STEPS = 20
"""Maximum number of modules through which a name is followed to its definition, for messages."""


class ModuleFacts(FrozenStruct):
    """Facts about a source file, made by `source_reader` and cached as JSON.

    `syntax` is the digest of its syntax tree without positions and docstrings, `documented` with docstrings, `outline` without the parts of
    functions that only matter when they are called; `bodies` are the digests of these parts, one for each function. `imports` are the
    modules and names that it imports (`pkg.leg`, `pkg.leg:foot`, `.shapes:*`). `names` are the names that it binds at top level: kind
    (`class | function | import | value`), line, and the origin of an imported name. `telling`: it may read docstrings or line numbers.
    `looking`: it may inspect functions without calling them. `more`: it may have names that reading does not find. `broken`: it is not
    valid Python; its digests are computed from its bytes.
    """

    syntax: str
    documented: str
    outline: str
    bodies: list[str]
    imports: list[str]
    names: dict[str, tuple[str, int, str]]
    telling: bool
    looking: bool
    more: bool
    broken: bool


class ModuleSource(FrozenStruct, kw_only=False):
    """A module's source code and the path of its file.

    `path` is relative to the workspace, because code looks for files beside itself. For a file outside of the workspace, it is only the
    file name, which is the same on every machine.
    """

    module: Module
    sha256: str
    facts: ModuleFacts
    path: str

    @property
    def label(self) -> str:
        """The label of the module in the ingredients of a key."""
        return f"module {self.module.name}"


@dataclass(frozen=True, slots=True, kw_only=True)
class CodeIngredients:
    """The code of a part and everything that determines it.

    `ingredients` are digests and paths by module (`module arm`), `documented` the same with docstrings. `installed` are the modules of
    installed packages that it imports. `files` are the files that it is loaded from, with their SHA-256. `plain` are its packages without
    `__init__.py`. `hiding` are its modules that hide others of the same name. `place` is `(file, line)` of the class. `sources` are the
    modules by file; it is empty if some code may inspect itself, because then all code counts, whichever parts run.
    """

    ingredients: dict[str, str] = field(default_factory=dict)
    documented: dict[str, str] = field(default_factory=dict)
    installed: set[str] = field(default_factory=set)
    files: dict[str, str] = field(default_factory=dict)
    plain: set[str] = field(default_factory=set)
    hiding: tuple[Module, ...] = ()
    place: tuple[str, int] | None = None
    sources: dict[str, ModuleSource] = field(default_factory=dict, compare=False)


class ModuleSources:
    """Reads the source files of content-tracked modules, each once. Their facts are cached in the store by content.

    `root` is the folder of the workspace. Pass `within` for an untrusted workspace: only files of part folders for which it returns True
    are read, and at most `MAX_UNTRUSTED` bytes in all. A file that is not read has no source, so keys that depend on it differ.
    """

    def __init__(self, finder: Finder, root: str, store: Store | None = None, within: Callable[[str], bool] | None = None) -> None:
        self.finder = finder
        self.root = os.path.join(root, "")
        self.store = store
        self._within = within
        self._left = MAX_UNTRUSTED
        self._read: dict[str, ModuleSource | None] = {}

    def source(self, name: str) -> ModuleSource | None:
        """Return the source of the content-tracked module `name`, or None if it has no source or is of another kind."""
        if name not in self._read:
            module = self.finder.find(name)
            data = self._bytes(module)
            self._read[name] = None if data is None else self._source(module, data)
        return self._read[name]

    def _bytes(self, module: Module) -> bytes | None:
        if module.kind != "content" or module.file is None:
            return None
        within = self._within if module.workspace else None
        if within is not None and not within(module.file):
            return None
        try:
            with open(module.file, "rb") as stream:
                data = stream.read(-1 if within is None else self._left + 1)
        except OSError:
            return None
        if within is None:
            return data
        self._left -= len(data)  # at least -1
        return data if self._left >= 0 else None

    def _source(self, module: Module, data: bytes) -> ModuleSource:
        sha256 = hashlib.sha256(data).hexdigest()
        key = f"{VERSION} {sys.version_info[0]}.{sys.version_info[1]} {sha256}"  # syntax trees differ between versions of Python
        facts = self.store.get_json("facts", key) if self.store is not None else None
        if facts is None:
            from thingc.geometry.key.source_reader import read_source

            facts = read_source(data)
            if self.store is not None:
                self.store.note_json("facts", key, facts)
        file = module.file or ""
        inside = module.workspace and file.startswith(self.root)
        path = file[len(self.root) :].replace(os.sep, "/") if inside else os.path.basename(file)
        return ModuleSource(module, sha256, ModuleFacts(**facts), path)


def code_of(reference: str, sources: ModuleSources) -> CodeIngredients:
    """Return the code that `module:Class` depends on. The module must exist and be content-tracked."""
    module, _, name = reference.partition(":")
    reached = [sources.finder.find(one) for one in reached_from(module, sources)]
    tracked = [source for one in reached if (source := sources.source(one.name)) is not None]
    texts = any(source.facts.telling for source in tracked)
    whole = texts or any(source.facts.looking for source in tracked)
    return CodeIngredients(
        ingredients={one.label: f"{one.sha256 if texts else one.facts.syntax} {one.path}" for one in tracked},
        documented={one.label: f"{one.sha256 if texts else one.facts.documented} {one.path}" for one in tracked},
        installed={one.name for one in reached if one.kind == "installed"},
        files={one.module.file: one.sha256 for one in tracked if one.module.file is not None},
        plain={one.name for one in reached if one.kind == "content" and one.file is None},
        hiding=tuple(one for one in reached if one.hides),
        place=_definition_line(module, name.partition(".")[0], sources),
        sources={} if whole else {one.module.file: one for one in tracked if one.module.file is not None},
    )


def reached_from(module: str, sources: ModuleSources) -> list[str]:
    """Return the names of `module`, of all modules imported directly or indirectly, and of the packages around them, sorted.

    Modules that do not exist are included.
    """
    reached: set[str] = set()
    waiting = [module]
    while waiting:
        name = waiting.pop()
        if not name or name in reached:
            continue
        reached.add(name)
        waiting.append(name.rpartition(".")[0])
        source = sources.source(name)
        if source is None:
            continue
        for origin in source.facts.imports:
            target, inner = _absolute(source, origin)
            waiting.append(target)
            if target and inner not in ("", "*") and sources.finder.find(f"{target}.{inner}").kind == "content":
                waiting.append(f"{target}.{inner}")
    return sorted(reached)


def may_have(module: str, name: str, sources: ModuleSources) -> bool:
    """Return whether `module` may have a `name`, by itself or through star imports. True if reading cannot decide."""
    return any(source is None or source.facts.more or name in source.facts.names for source in _namespaces(module, sources))


def defined_in(module: str, sources: ModuleSources) -> tuple[str, ...]:
    """Return the public classes and functions that `module` defines or gets through star imports, sorted."""
    return tuple(sorted({
        name for source in _namespaces(module, sources) if source is not None for name, (kind, _, _) in source.facts.names.items()
        if kind in ("class", "function") and name[0] != "_"
    }))


def _namespaces(module: str, sources: ModuleSources) -> list[ModuleSource | None]:
    """Return the module and all modules that it star-imports, directly or indirectly; None in place of a module that cannot be read."""
    met = [module]
    namespaces: list[ModuleSource | None] = []
    for name in met:
        source = sources.source(name)
        namespaces.append(source)
        if source is not None:
            stars = [origin for origin in source.facts.imports if origin.endswith(":*")]
            met += [target for origin in stars if (target := _absolute(source, origin)[0]) not in met]
    return namespaces


def _definition_line(module: str, name: str, sources: ModuleSources) -> tuple[str, int] | None:
    """Return `(file, line)` of the definition of a name, followed through imports, or None."""
    for _ in range(MAX_STEPS):
        source = next((one for one in _namespaces(module, sources) if one is not None and name in one.facts.names), None)
        if source is None or source.module.file is None:
            return None
        _, line, origin = source.facts.names[name]
        if ":" not in origin:
            return source.module.file, line
        module, name = _absolute(source, origin)
    return None


def _absolute(source: ModuleSource, origin: str) -> tuple[str, str]:
    """Return the module that an import in `source` names, and the name taken from it ("" for the module itself).

    The module is "" if a relative import leads out of its package.
    """
    written, _, inner = origin.partition(":")
    target = written.lstrip(".")
    dots = len(written) - len(target)
    if dots:
        steps = source.module.name.split(".")
        above = dots - 1 if source.module.folders else dots  # a dot in `__init__.py` means the package itself
        package = ".".join(steps[: max(len(steps) - above, 0)])
        target = f"{package}.{target}" if package and target else package
    return target, inner
