"""Create emitters that import their module when a target is written, for packages that every build imports."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from thingc.targets.registry import Emitter


def lazy_emitter(module: str) -> Emitter:
    """Return the function `emit` of a module, which is imported at the first call."""

    def emit(request: Any) -> Any:
        return import_module(module).emit(request)

    return emit
