"""Export the public names of a package whose modules are imported lazily (PEP 562)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any


def exported(package: str, modules: Mapping[str, str]) -> Callable[[str], Any]:
    """Return a module-level `__getattr__` for a package, which imports a module when one of its names is first used.

    `modules` maps public names to modules of the package. `xml:number` means that the object has the name `number` in the module `xml`.
    Other names raise `AttributeError`.
    """

    def get(name: str) -> Any:
        if name not in modules:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        module, _, own = modules[name].partition(":")
        return getattr(import_module(f"{package}.{module}"), own or name)

    return get
