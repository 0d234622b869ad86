"""Find installed Python packages by name without importing them."""

from __future__ import annotations

import contextlib
import importlib.machinery
import os
import re
import sys
from collections.abc import Iterable
from functools import cache

from thingc.base.filesystem import listing, without_suffix, working_folder

_METADATA = re.compile(r"(?P<name>[^-]+)-(?P<version>.+)\.(dist-info|egg-info)$")


@cache
def import_path() -> tuple[str, ...]:
    """Return `sys.path` without the current working directory and the folder of the running script.

    Files in these two folders therefore cannot hide an installed package.
    """
    entries = list(sys.path)
    if entries and not getattr(sys.flags, "safe_path", False):
        working = working_folder() or os.sep
        script = os.path.dirname(os.path.join(working, getattr(sys.modules.get("__main__"), "__file__", None) or "."))
        if entries[0] in ("", working, script, os.path.realpath(script)):
            entries = entries[1:]
    return tuple(entry for entry in entries if entry)


_PYTHONS_OWN = (importlib.machinery.PathFinder, importlib.machinery.BuiltinImporter, importlib.machinery.FrozenImporter)


def specification_of(name: str) -> importlib.machinery.ModuleSpec | None:
    """Return the import specification of an installed top-level module, or None if the module is not installed.

    Packages that are installed in editable mode are also found.
    """
    specification = importlib.machinery.PathFinder.find_spec(name, list(import_path()))
    if specification is None or specification.origin is None and specification.submodule_search_locations:
        for finder in sys.meta_path:
            if not getattr(finder, "of_parts", False) and finder not in _PYTHONS_OWN:
                with contextlib.suppress(Exception):
                    if (found := finder.find_spec(name, None)) is not None:
                        return found
    return specification


def package_folder(name: str) -> str | None:
    """Return the folder of an installed top-level package that has an `__init__.py`. Return None if the package is not installed."""
    specification = specification_of(name)
    folders = list(specification.submodule_search_locations or ()) if specification is not None and specification.origin else []
    return folders[0] if folders else None


def dotted_name(file: str) -> str:
    """Return the dotted module name of a Python file in a package, such as `thingc_stock.materials`.

    The name does not depend on the folder in which the package is installed.
    """
    folder, name = os.path.split(without_suffix(file))
    names = [name]
    while os.path.isfile(os.path.join(folder, "__init__.py")):
        folder, name = os.path.split(folder)
        names.insert(0, name)
    return ".".join(names)


def distribution_versions(folders: Iterable[str]) -> dict[str, str]:
    """Return the versions of the distributions in folders, by normalised name, such as `cadquery_ocp`. The first version counts.

    The versions are read from the names of the metadata folders (see "Recording installed projects" in the PyPA specifications). The module
    `importlib.metadata` is not used, because importing it is slow.
    """
    versions: dict[str, str] = {}
    for folder in folders:
        for name in listing(folder or "."):
            if (match := _METADATA.match(name)) is not None:
                versions.setdefault(re.sub(r"[-.]+", "_", match["name"]).lower(), match["version"])
    return versions
