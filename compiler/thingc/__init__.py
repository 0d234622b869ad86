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
    from thingc.base.interfaces import Bolts as Bolts
    from thingc.base.interfaces import Bore as Bore
    from thingc.base.interfaces import Boss as Boss
    from thingc.base.interfaces import Connector as Connector
    from thingc.base.interfaces import Shank as Shank
    from thingc.batch.families.family import RobotFamily as RobotFamily
    from thingc.batch.families.family import family as family
    from thingc.driver.api import Compiled as Compiled
    from thingc.driver.api import CompiledMode as CompiledMode
    from thingc.driver.api import CompileError as CompileError
    from thingc.driver.api import compile as compile
    from thingc.driver.environment import Options as Options
    from thingc.geometry.things.actuator import Actuator as Actuator
    from thingc.geometry.things.assets import asset as asset
    from thingc.geometry.things.mounts import MATE as MATE
    from thingc.geometry.things.mounts import MountPoint as MountPoint
    from thingc.geometry.things.parameters import Angle as Angle
    from thingc.geometry.things.parameters import Count as Count
    from thingc.geometry.things.parameters import Length as Length
    from thingc.geometry.things.parameters import Mass as Mass
    from thingc.geometry.things.parameters import ParameterError as ParameterError
    from thingc.geometry.things.parameters import Range as Range
    from thingc.geometry.things.parameters import Ratio as Ratio
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
