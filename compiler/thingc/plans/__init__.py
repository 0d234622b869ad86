"""Plans: what compilations make of settings, worked out again for other numbers without a compilation. `Builds` gives whole builds so."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from thingc.plans.builds import Build, Builds
    from thingc.plans.reading import SettingsReader

_EXPORTS = {"Build": "builds", "Builds": "builds", "SettingsReader": "reading"}

__all__ = ["Build", "Builds", "SettingsReader"]


def __getattr__(name: str) -> Any:
    """The exported object, from its module; `AttributeError` for any other name."""
    if name in _EXPORTS:
        from importlib import import_module

        return getattr(import_module(f"thingc.plans.{_EXPORTS[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
