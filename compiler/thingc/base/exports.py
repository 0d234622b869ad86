"""Import the modules of a package lazily, when one of the public names of the package is used for the first time (PEP 562)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any


def getattr_of(package: str, modules: Mapping[str, str]) -> Callable[[str], Any]:
    """Return a function to use as the module-level `__getattr__` of a package.

    This `__getattr__` imports a module when one of the names of the module is first used.

    `modules` maps each public name to the module of the package that defines the name. The value `xml:number` means that the object is
    called `number` in the module `xml`. Names that are not in `modules` raise `AttributeError`.
    """

    def get(name: str) -> Any:
        if name not in modules:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        module, _, original_name = modules[name].partition(":")
        return getattr(import_module(f"{package}.{module}"), original_name or name)

    return get
