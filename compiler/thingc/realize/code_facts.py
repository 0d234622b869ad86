"""What a source file of parts says, statement by statement: the facts that keys of parts are made from.

Every top-level statement becomes a `Unit`: the names it binds, the names it uses, what it changes, and a digest of its
syntax tree without positions, so that comments and layout change nothing. `code_reader` makes them.
"""

from __future__ import annotations

import sys
from typing import Any

from thingc.frozen import dataclass

VERSION = 2
"""Of the facts: a change of their meaning must raise it, since facts are kept by the content of a file."""

DYNAMIC_MODULES = frozenset({"importlib", "imp", "runpy", "pkgutil", "builtins"})
TELLING_MODULES = frozenset({"inspect", "linecache", "pydoc", "traceback"})
"""These tell docstrings, lines and source texts, which are otherwise no part of a key."""
HARMLESS_SUBMODULES = frozenset({"resources", "metadata", "abc"})
"""Of `importlib`: these import nothing of ours behind our back."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Import:
    """One name imported: `import module` (`name` None), `from module import name`, or a star (`name` "*").

    `alias` is the name bound (`import a.b` binds `a`: then `whole_path` is False and `a.b` merely gets loaded);
    `level` counts the dots of a relative import.
    """

    alias: str
    module: str
    level: int
    name: str | None
    whole_path: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class Unit:
    """A top-level statement (of an import statement, one name of it).

    `kind` is `class | function | value | import | statement`; `uses` are dotted names as far as written
    (`shapes.plate`); `changes` the module-level names it may change, `late` when it does so inside a function;
    `effect`: it does something when the module is loaded besides binding names; `unsure`: reading cannot tell what it uses;
    `telling`: it may look at docstrings or lines of code.
    `digest` leaves docstrings out, `documented` has them.
    """

    kind: str
    names: tuple[str, ...]
    line: int
    uses: tuple[str, ...]
    imports: tuple[Import, ...]
    changes: tuple[str, ...]
    late: bool
    effect: bool
    unsure: bool
    telling: bool
    digest: str
    documented: str


@dataclass(frozen=True, slots=True, kw_only=True)
class FileFacts:
    """A source file: its units in order, the digest of all of it, `__all__` where it is a plain list, and whether it
    could not be parsed (then it has no units and `digest` is of its bytes)."""

    units: tuple[Unit, ...]
    digest: str
    exported: tuple[str, ...] | None
    broken: bool


# --- facts as JSON, to be kept by the content of a file ---------------------------------------------------------------


def as_json(facts: FileFacts) -> Any:
    """Plain lists, the inverse of `from_json`."""
    return [
        [
            [
                unit.kind, list(unit.names), unit.line, list(unit.uses),
                [[i.alias, i.module, i.level, i.name, i.whole_path] for i in unit.imports],
                list(unit.changes), unit.late, unit.effect, unit.unsure, unit.telling, unit.digest,
                unit.documented,
            ]
            for unit in facts.units
        ],
        facts.digest,
        None if facts.exported is None else list(facts.exported),
        facts.broken,
    ]


def from_json(value: Any) -> FileFacts:
    """The facts that `as_json` wrote."""
    units, digest, exported, broken = value
    return FileFacts(
        units=tuple(
            Unit(
                kind=kind, names=tuple(names), line=line, uses=tuple(uses),
                imports=tuple(Import(alias=a, module=m, level=v, name=n, whole_path=w) for a, m, v, n, w in imports),
                changes=tuple(changes), late=late, effect=effect, unsure=unsure, telling=telling, digest=own, documented=documented,
            )
            for kind, names, line, uses, imports, changes, late, effect, unsure, telling, own, documented in units
        ),
        digest=digest,
        exported=None if exported is None else tuple(exported),
        broken=broken,
    )


def facts_key(sha256: str) -> str:
    """Under what the facts of a file with this content are kept: syntax trees differ between Python versions."""
    return f"{VERSION} {sys.version_info[0]}.{sys.version_info[1]} {sha256}"
