"""Names that a room exports, from modules that are imported when somebody asks for one of them (PEP 562)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any


def exported(package: str, modules: Mapping[str, str]) -> Callable[[str], Any]:
    """The `__getattr__` of a package. `modules` says which of its modules has a name (`xml:number`: it is `number` there); any other name
    is an `AttributeError`."""

    def get(name: str) -> Any:
        if name not in modules:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        module, _, own = modules[name].partition(":")
        return getattr(import_module(f"{package}.{module}"), own or name)

    return get
