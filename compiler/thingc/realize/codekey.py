"""Which code a part depends on, found by reading: the key of `module:Class`.

From the class outward: every top-level statement of a content-tracked module that binds a name it uses, or changes one,
and so on through imports, however they are written. Statements that do something when a module is loaded count for
everything in it, and for everything in the modules that import it. Where reading cannot be sure (`exec`, `globals()`, a name
bound twice, a module used as an object) the whole file counts. Where the code may look at docstrings or at lines, the whole text of
every file that is loaded for it counts. Packages of the environment are not followed.
"""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Callable
from dataclasses import dataclass, field

from thingc.realize.code_facts import (
    DYNAMIC_MODULES,
    HARMLESS_SUBMODULES,
    TELLING_MODULES,
    FileFacts,
    Import,
    Unit,
    as_json,
    facts_key,
    from_json,
)
from thingc.realize.modules import Finder, Module
from thingc.realize.store import Store, StoreUnusable

MAX_UNTRUSTED = 1_000_000
"""Bytes of source that are read of a workspace that is not trusted: the syntax tree takes a hundred times as much memory."""


_HARMLESS = [[name] for name in sorted(HARMLESS_SUBMODULES)]


@dataclass(frozen=True, slots=True, kw_only=True)
class SourceFile:
    """A module's source as read: its facts, which units bind a name, and which change one."""

    module: Module
    sha256: str
    facts: FileFacts
    binders: dict[str, list[int]]
    changers: dict[str, list[int]]
    imports: list[Import]

    def label(self, index: int) -> str:
        """A unit in words for people: `class arm:RotorBrace`."""
        unit = self.facts.units[index]
        if unit.names:
            return f"{unit.kind} {self.module.name}:{', '.join(unit.names)}"
        return f"statement of {self.module.name}"


class Sources:
    """Reads the source files of content-tracked modules, each once; their facts are kept in the store by content.

    `within` is for workspaces that are not trusted: only files of part folders for which it holds are read, and at most
    `MAX_UNTRUSTED` bytes of them. What is not read has no source, so that the key of what uses it is another.
    """

    def __init__(self, finder: Finder, store: Store | None = None, within: Callable[[str], bool] | None = None) -> None:
        self.finder = finder
        self.store = store
        self._within = within
        self._left = MAX_UNTRUSTED
        self._read: dict[str, SourceFile | None] = {}

    def source(self, name: str) -> SourceFile | None:
        """The source of the content-tracked module `name`, or None when it has none or is of another kind."""
        if name not in self._read:
            self._read[name] = self._load(self.finder.find(name))
        return self._read[name]

    def _load(self, module: Module) -> SourceFile | None:
        if module.kind != "content" or module.file is None:
            return None
        doubtful = self._within is not None and module.workspace
        if doubtful and self._within is not None and not self._within(module.file):
            return None
        try:
            with open(module.file, "rb") as stream:
                source = stream.read(self._left + 1 if doubtful else -1)
        except OSError:
            return None
        if doubtful:
            self._left -= len(source)
            if self._left < 0:
                self._left = 0
                return None
        sha256 = hashlib.sha256(source).hexdigest()
        kept = self.store.get_json("facts", facts_key(sha256)) if self.store is not None else None
        if kept is not None:
            facts = from_json(kept)
        else:
            from thingc.realize.code_reader import read_facts

            facts = read_facts(source)
            if self.store is not None:
                with contextlib.suppress(StoreUnusable):  # kept for speed only
                    self.store.put_json("facts", facts_key(sha256), as_json(facts))
        binders: dict[str, list[int]] = {}
        changers: dict[str, list[int]] = {}
        for index, unit in enumerate(facts.units):
            for name in unit.names:
                binders.setdefault(name, []).append(index)
            for name in unit.changes:
                changers.setdefault(name, []).append(index)
        at_load = [found for unit in facts.units if unit.kind not in ("class", "function") for found in unit.imports]
        return SourceFile(
            module=module, sha256=sha256, facts=facts, binders=binders, changers=changers, imports=at_load
        )


@dataclass(slots=True, kw_only=True)
class Code:
    """What a part's code is made of.

    `ingredients` are labelled digests (`class arm:RotorBrace`), `documented` the same with docstrings; `installed` the
    top-level names of installed packages it uses, `loaded` their modules; `modules` the files of the content-tracked
    modules that are loaded for it (None: a folder without `__init__.py`), `hashes` the SHA-256 of each file as read;
    `place` is `(file, line)` of the class.
    """

    ingredients: dict[str, str] = field(default_factory=dict)
    documented: dict[str, str] = field(default_factory=dict)
    installed: set[str] = field(default_factory=set)
    loaded: set[str] = field(default_factory=set)
    modules: dict[str, str | None] = field(default_factory=dict)
    hashes: dict[str, str] = field(default_factory=dict)
    place: tuple[str, int] | None = None


def code_of(reference: str, sources: Sources) -> Code:
    """The code that `module:Class` depends on. The module must be found and content-tracked."""
    walk = _Walk(sources)
    module, _, name = reference.partition(":")
    walk.execute(module)
    walk.use(module, name.split("."))
    walk.code.place = walk.place(module, name.partition(".")[0])
    if walk.telling:
        for own, sha256 in walk.code.hashes.items():
            walk.code.ingredients[f"text of {own}"] = walk.code.documented[f"text of {own}"] = sha256
    return walk.code


def defined_in(module: str, sources: Sources) -> tuple[tuple[str, ...], bool]:
    """The public classes and functions that `module` defines or imports by name, and whether there may be more
    (stars of installed packages, code that cannot be read statically)."""
    source = sources.source(module)
    if source is None:
        return (), True
    names: set[str] = set()
    more = source.facts.broken or "__getattr__" in source.binders
    for unit in source.facts.units:
        more = more or unit.unsure
        for found in unit.imports:
            if found.name == "*":
                target = _absolute(source.module, found)
                inner, open_ended = defined_in(target, sources) if target and target != module else ((), True)
                names.update(inner)
                more = more or open_ended
        if unit.kind in ("class", "function"):
            names.update(unit.names)
    return tuple(sorted(name for name in names if not name.startswith("_"))), more


def binds(module: str, name: str, sources: Sources) -> bool:
    """Whether `name` is bound at the top level of `module`, by itself or through stars of content-tracked modules."""
    return _Walk(sources).provides(module, name)


def _absolute(module: Module, found: Import) -> str | None:
    """The absolute name of the module an import names, None where a relative one leads out of its package."""
    if found.level == 0:
        return found.module
    package = module.name if module.folders else module.name.rpartition(".")[0]
    for _ in range(found.level - 1):
        package = package.rpartition(".")[0]
    if not package:
        return None
    return f"{package}.{found.module}" if found.module else package


class _Walk:
    def __init__(self, sources: Sources) -> None:
        self.sources = sources
        self.code = Code()
        self.executed: set[str] = set()
        self.reached: set[tuple[str, int]] = set()
        self.used: set[tuple[str, str]] = set()
        self.chains: set[tuple[str, ...]] = set()
        self.whole_files: set[str] = set()
        self.telling = False

    # --- loading -------------------------------------------------------------------------------------------------

    def execute(self, name: str) -> None:
        """Module `name` gets loaded: its packages too, what its statements do, and whatever it imports at the top."""
        if name in self.executed or not name:
            return
        self.executed.add(name)
        parent = name.rpartition(".")[0]
        if parent:
            self.execute(parent)
        module = self.sources.finder.find(name)
        top = name.partition(".")[0]
        if module.kind == "installed":
            self.code.installed.add(top)
            self.code.loaded.add(name)
            return
        if module.kind == "absent":
            if self.sources.finder.find(top).kind != "installed":
                self.code.ingredients[f"module {name}"] = self.code.documented[f"module {name}"] = "absent"
            return
        self.code.modules[name] = module.file
        source = self.sources.source(name)
        if source is None:
            return
        self.code.hashes[name] = source.sha256
        if source.facts.broken:
            self.whole(name)
            return
        acting = [
            index
            for index, unit in enumerate(source.facts.units)
            if unit.effect or any(changed not in source.binders for changed in unit.changes) and not unit.late
        ]
        for index in acting:
            self.reach(name, index)
        if acting:
            self._add(name, "order of statements", _order(source))
        for found in source.imports:
            self.loaded_by(source, found)

    def loaded_by(self, source: SourceFile, found: Import) -> None:
        """The modules that one import loads."""
        target = _absolute(source.module, found)
        if target is None:
            return
        self.execute(target)
        if found.name not in (None, "*") and not self.provides(target, str(found.name)):
            inner = f"{target}.{found.name}"
            if self.sources.finder.find(target).kind == "content" and self.sources.finder.find(inner).kind == "content":
                self.execute(inner)

    # --- names ---------------------------------------------------------------------------------------------------

    def provides(self, module: str, name: str, seen: frozenset[str] = frozenset()) -> bool:
        """Whether the content-tracked `module` binds `name`, by itself or by a star."""
        source = self.sources.source(module)
        if source is None or module in seen:
            return False
        return name in source.binders or bool(self._stars(source, name, seen | {module}))

    def _stars(self, source: SourceFile, name: str, seen: frozenset[str] = frozenset()) -> list[tuple[str, Import]]:
        found: list[tuple[str, Import]] = []
        for imported in (i for unit in source.facts.units for i in unit.imports if i.name == "*"):
            target = _absolute(source.module, imported)
            inner = self.sources.source(target) if target else None
            if target is None or inner is None:
                continue
            exported = inner.facts.exported
            public = name in exported if exported is not None else not name.startswith("_")
            if public and self.provides(target, name, seen):
                found.append((target, imported))
        return found

    def use(self, module: str, chain: list[str]) -> None:
        """Whatever `chain[0].chain[1]...` means in the content-tracked `module` is used."""
        name, rest = chain[0], chain[1:]
        source = self.sources.source(module)
        if source is None or (module, *chain) in self.chains:
            return
        self.chains.add((module, *chain))
        indices = source.binders.get(name, [])
        imported = any(found.alias == name for index in indices for found in source.facts.units[index].imports)
        first = (module, name) not in self.used
        self.used.add((module, name))
        if first:
            changers = source.changers.get(name, [])
            if _several_meanings(source, indices) or any(source.facts.units[index].late for index in changers):
                self.whole(module)
            for index in (*indices, *changers):
                self.reach(module, index)
            if changers:
                self._add(module, "order of statements", _order(source))
        if imported:
            for index in indices:
                for found in source.facts.units[index].imports:
                    if found.alias == name:
                        self.follow(source, found, rest)
        stars = self._stars(source, name) if first or not indices else []
        for target, _ in stars:
            self.use(target, chain)

    def follow(self, source: SourceFile, found: Import, rest: list[str]) -> None:
        """What an imported name leads to is used, with the attributes `rest`."""
        target = _absolute(source.module, found)
        if target is None:
            return
        self.execute(target)
        if found.name is None:
            self.use_module(target if found.whole_path else found.alias, rest)
            return
        if self.sources.finder.find(target).kind != "content":
            return
        if self.provides(target, found.name):
            self.use(target, [found.name, *rest])
        elif self.sources.finder.find(f"{target}.{found.name}").kind == "content":
            self.execute(f"{target}.{found.name}")
            self.use_module(f"{target}.{found.name}", rest)
        else:
            self._add(target, f"`{found.name}`", "absent")
            self.whole(target)

    def use_module(self, name: str, rest: list[str]) -> None:
        """The module `name` is used: the attribute `rest[0]` of it, or, as an object, all of it."""
        module = self.sources.finder.find(name)
        if module.kind != "content":
            return
        if rest and self.provides(name, rest[0]):
            self.use(name, rest)
        elif rest and self.sources.finder.find(f"{name}.{rest[0]}").kind == "content":
            self.execute(f"{name}.{rest[0]}")
            self.use_module(f"{name}.{rest[0]}", rest[1:])
        else:
            self.whole(name)

    def reach(self, module: str, index: int) -> None:
        """One unit is used: its code, and everything it uses in turn."""
        if (module, index) in self.reached:
            return
        self.reached.add((module, index))
        source = self.sources.source(module)
        if source is None:
            return
        unit = source.facts.units[index]
        if unit.kind != "import":
            self._add(module, source.label(index), unit.digest, unit.documented)
        elif unit.names:
            self._add(module, source.label(index), unit.digest)
        met = self._met_modules(source, unit)
        if unit.unsure or any(path[0] in DYNAMIC_MODULES and path[1:2] not in _HARMLESS for path in met):
            self.whole(module)
        self.telling = self.telling or unit.telling or any(path[0] in TELLING_MODULES for path in met)
        own = {found.alias: found for found in unit.imports if found.alias not in unit.names}
        for found in own.values():
            self.loaded_by(source, found)
            if found.name == "*":
                self.whole(_absolute(source.module, found) or module)
        for chain in unit.uses:
            names = chain.split(".")
            if names[0] in own:
                self.follow(source, own[names[0]], names[1:])
            else:
                self.use(module, names)

    def _met_modules(self, source: SourceFile, unit: Unit) -> list[list[str]]:
        """The imported modules that a unit uses, with the attributes that it names: `["importlib", "import_module"]`."""
        roots = {chain.partition(".")[0] for chain in unit.uses}
        binding = [source.facts.units[index] for root in sorted(roots) for index in source.binders.get(root, [])]
        aliases = {
            found.alias: found
            for other in (unit, *binding)
            for found in other.imports
        }
        paths: list[list[str]] = []
        for chain in unit.uses:
            names = chain.split(".")
            found = aliases.get(names[0])
            if found is None or found.level:
                continue
            path = [*found.module.split("."), *([found.name] if found.name else []), *names[1:]]
            paths.append(names if found.name is None and not found.whole_path else path)
        return paths

    def whole(self, module: str) -> None:
        """Everything in a file counts, in its order."""
        if module in self.whole_files:
            return
        self.whole_files.add(module)
        source = self.sources.source(module)
        if source is None:
            return
        self.execute(module)
        self._add(module, f"whole file {module}", source.facts.digest)
        for index, unit in enumerate(source.facts.units):
            self.reach(module, index)
            for found in unit.imports:
                if unit.kind == "import":
                    self.loaded_by(source, found)

    def _add(self, module: str, label: str, digest: str, documented: str | None = None) -> None:
        if label.startswith(("order", "`")):
            label = f"{label} of {module}"
        for table, value in ((self.code.ingredients, digest), (self.code.documented, documented or digest)):
            held = table.get(label)
            # two statements of one label: both count, in the order met
            table[label] = value if held is None or held == value else hashlib.sha256((held + value).encode()).hexdigest()

    def place(self, module: str, name: str, depth: int = 0) -> tuple[str, int] | None:
        """Where a name is defined, through imports."""
        source = self.sources.source(module)
        if source is None or depth > 20:
            return None
        for index in reversed(source.binders.get(name, [])):
            unit = source.facts.units[index]
            for found in unit.imports:
                target = _absolute(source.module, found)
                if found.alias == name and found.name and target:
                    return self.place(target, found.name, depth + 1)
            if source.module.file is not None:
                return source.module.file, unit.line
        for target, _ in self._stars(source, name):
            return self.place(target, name, depth + 1)
        return None


def _several_meanings(source: SourceFile, indices: list[int]) -> bool:
    """Whether the statements `indices` bind one name to different things (`import a.b` and `import a.c` both bind `a`)."""
    if len(indices) < 2:
        return False
    units = [source.facts.units[index] for index in indices]
    if any(unit.kind != "import" for unit in units):
        return True
    meant = {
        (found.level, found.module, found.name) if found.whole_path and found.module != found.alias else (0, found.alias, None)
        for unit in units
        for found in unit.imports
    }
    return len(meant) > 1


def _order(source: SourceFile) -> str:
    names = "\n".join(source.label(index) for index in range(len(source.facts.units)))
    return hashlib.sha256(names.encode()).hexdigest()
