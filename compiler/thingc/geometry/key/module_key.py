"""Find the code that a part depends on: its module and all modules that it imports, directly or indirectly. The search only reads source
files.

All import statements are found, including imports inside functions. The result includes modules in part folders and in packages that are
tracked by content, and the packages that contain these modules. Comments, layout and docstrings do not change the key. If some code may
read docstrings, the text of every file becomes part of the key. A module that is imported in another way is detected when the part runs.
Such a module then counts as a file that the part read.
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
"""Version of the format of `ModuleFacts`.

Increase this number when the meaning of the facts changes, because facts are cached by the content of files.
"""

MAX_UNTRUSTED = 1_000_000
"""Maximum number of bytes of source read from an untrusted workspace. The limit is small because a syntax tree needs a hundred times as
much memory as the source text.
"""

MAX_STEPS = 20
"""Maximum number of modules that are searched for the definition of a name, to add its location to a message."""


class ModuleFacts(FrozenStruct):
    """Facts about a source file, made by `source_reader` and cached as JSON.

    `syntax` is the digest of the file's syntax tree without positions and docstrings. `documented` is the digest with docstrings.
    `outline` is the digest of the file without the parts of functions that have no effect until the function is called. `bodies` contains
    the digests of these parts, one digest for each function. `imports` contains the imported modules and names (`pkg.leg`, `pkg.leg:foot`,
    `.shapes:*`). `names` contains the names that the file binds at top level: kind (`class | function | import | value`), line, and the
    origin of an imported name. `telling` is True if the code may read docstrings or line numbers. `looking` is True if the code may inspect
    functions without calling them. `more` is True if the code may define names that the analysis of the syntax tree does not find. `broken`
    is True if the file is not valid Python. The digests are then computed from its bytes.
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

    `path` is relative to the workspace. The path is part of the key because code may search for files in its own folder. For a file outside
    of the workspace, `path` is only the file name, which is the same on every machine.
    """

    module: Module
    sha256: str
    facts: ModuleFacts
    path: str

    @property
    def label(self) -> str:
        """The label of the module among the inputs of a build key, such as `module arm`."""
        return f"module {self.module.name}"


@dataclass(frozen=True, slots=True, kw_only=True)
class CodeIngredients:
    """The code of a part, with all files and paths that determine which code it is.

    `ingredients` contains the digest and the path of each module, by a label such as `module arm`. `documented` has the same keys, but its
    digests include docstrings. `installed` contains the imported modules of installed packages. `files` contains the source files with
    their SHA-256. `plain` contains the packages without `__init__.py`. `hiding` contains the modules that hide other modules of the same
    name. `place` is the file and the line of the class, as a tuple. `sources` contains the module sources by file path. `sources` is empty
    if some code may inspect itself, because then code that does not run can also affect the part.
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
    """Reads the source file of each content-tracked module once. The store caches the facts by the content of the file.

    `root` is the folder of the workspace. Pass `within` for an untrusted workspace. In this case, only files of part folders for which
    `within` returns True are read, with at most `MAX_UNTRUSTED` bytes in total. A file that is not read has no source, so its content is
    not part of any key.
    """

    def __init__(self, finder: Finder, root: str, store: Store | None = None, within: Callable[[str], bool] | None = None) -> None:
        self.finder = finder
        self.root = os.path.join(root, "")
        self.store = store
        self._within = within
        self._left = MAX_UNTRUSTED
        self._read: dict[str, ModuleSource | None] = {}

    def source(self, name: str) -> ModuleSource | None:
        """Return the source of the content-tracked module `name`.

        Return None if the module has no source file or is not content-tracked.
        """
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
    """Return the code that the part `module:Class` depends on. The module must exist and be content-tracked."""
    module, _, name = reference.partition(":")
    reached = [sources.finder.find(one) for one in reached_from(module, sources)]
    tracked = [source for one in reached if (source := sources.source(one.name)) is not None]
    reads_texts = any(source.facts.telling for source in tracked)
    inspects_functions = reads_texts or any(source.facts.looking for source in tracked)
    return CodeIngredients(
        ingredients={one.label: f"{one.sha256 if reads_texts else one.facts.syntax} {one.path}" for one in tracked},
        documented={one.label: f"{one.sha256 if reads_texts else one.facts.documented} {one.path}" for one in tracked},
        installed={one.name for one in reached if one.kind == "installed"},
        files={one.module.file: one.sha256 for one in tracked if one.module.file is not None},
        plain={one.name for one in reached if one.kind == "content" and one.file is None},
        hiding=tuple(one for one in reached if one.hides),
        place=_definition_line(module, name.partition(".")[0], sources),
        sources={} if inspects_functions else {one.module.file: one for one in tracked if one.module.file is not None},
    )


def reached_from(module: str, sources: ModuleSources) -> list[str]:
    """Return the sorted names of a module, of all modules that it imports directly or indirectly, and of the packages that contain them.

    Imported modules that do not exist are included.
    """
    reached: set[str] = set()
    to_visit = [module]
    while to_visit:
        name = to_visit.pop()
        if not name or name in reached:
            continue
        reached.add(name)
        to_visit.append(name.rpartition(".")[0])
        source = sources.source(name)
        if source is None:
            continue
        for origin in source.facts.imports:
            target, inner = _absolute(source, origin)
            to_visit.append(target)
            if target and inner not in ("", "*") and sources.finder.find(f"{target}.{inner}").kind == "content":
                to_visit.append(f"{target}.{inner}")
    return sorted(reached)


def may_have(module: str, name: str, sources: ModuleSources) -> bool:
    """Return whether `module` may define `name` or get it through star imports. Return True if this cannot be determined."""
    return any(source is None or source.facts.more or name in source.facts.names for source in _namespaces(module, sources))


def defined_in(module: str, sources: ModuleSources) -> tuple[str, ...]:
    """Return the sorted names of public classes and functions that `module` defines or gets through star imports."""
    return tuple(sorted({
        name for source in _namespaces(module, sources) if source is not None for name, (kind, _, _) in source.facts.names.items()
        if kind in ("class", "function") and name[0] != "_"
    }))


def _namespaces(module: str, sources: ModuleSources) -> list[ModuleSource | None]:
    """Return the sources of a module and of all modules that it imports with `import *`, directly or indirectly.

    The source of an unreadable module is None.
    """
    names = [module]
    namespaces: list[ModuleSource | None] = []
    for name in names:
        source = sources.source(name)
        namespaces.append(source)
        if source is not None:
            stars = [origin for origin in source.facts.imports if origin.endswith(":*")]
            names += [target for origin in stars if (target := _absolute(source, origin)[0]) not in names]
    return namespaces


def _definition_line(module: str, name: str, sources: ModuleSources) -> tuple[str, int] | None:
    """Follow imports to the definition of the name `name`, and return its file and line. Return None if the definition is not found."""
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
    """Return the absolute name of an imported module, and the imported name ("" for the module itself).

    The module is "" for a relative import beyond the top-level package.
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
