"""thingc: a compiler for robots. One document, many kinematic roots, consistent models and manufacturing files.

What part authors import is here: `from thingc import Thing, MountPoint, Length`. Each name is loaded when it is first used,
so that `import thingc` costs nothing and never loads the CAD kernel.
"""

from __future__ import annotations

__version__ = "0.1.0"

TYPE_CHECKING = False
"""That of `typing`, which takes longer to import than Python to start."""

if TYPE_CHECKING:
    from thingc import modes as modes
    from thingc.base.interfaces import Bolts as Bolts, Bore as Bore, Boss as Boss, Connector as Connector, Shank as Shank
    from thingc.batch.families.family import RobotFamily as RobotFamily, family as family
    from thingc.driver.api import Compiled as Compiled, CompiledMode as CompiledMode, CompileError as CompileError, compile as compile
    from thingc.driver.environment import Options as Options
    from thingc.geometry.things.actuator import Actuator as Actuator
    from thingc.geometry.things.assets import asset as asset
    from thingc.geometry.things.mounts import MATE as MATE, MountPoint as MountPoint
    from thingc.geometry.things.parameters import (
        Angle as Angle,
        Count as Count,
        Length as Length,
        Mass as Mass,
        ParameterError as ParameterError,
        Range as Range,
        Ratio as Ratio,
    )
    from thingc.geometry.things.resolver import TransformResolver as TransformResolver
    from thingc.geometry.things.thing import Thing as Thing

_EXPORTS = {name: f"thingc.{module}" for module, names in {
    "base.interfaces": ("Bolts", "Bore", "Boss", "Connector", "Shank"),
    "batch.families.family": ("RobotFamily", "family"), "driver.api": ("CompileError", "Compiled", "CompiledMode", "compile"),
    "driver.environment": ("Options",), "geometry.things.actuator": ("Actuator",), "geometry.things.assets": ("asset",),
    "geometry.things.mounts": ("MATE", "MountPoint"), "geometry.things.resolver": ("TransformResolver",),
    "geometry.things.parameters": ("Angle", "Count", "Length", "Mass", "ParameterError", "Range", "Ratio"),
    "geometry.things.thing": ("Thing",),
}.items() for name in names}
"""Exported name to the module that has it (PEP 562)."""

_MODULES = ("modes",)
"""Modules that are exported as they are."""

__all__ = [*_EXPORTS, *_MODULES]


def __getattr__(name: str) -> object:
    """The exported object, from its module; `AttributeError` for any other name."""
    from importlib import import_module

    if name in _MODULES:
        return import_module(f"thingc.{name}")
    module = _EXPORTS.get(name)
    if module is None:
        raise AttributeError(f"module `thingc` has no attribute `{name}`")
    exported = getattr(import_module(module), name)
    globals()[name] = exported
    return exported


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
