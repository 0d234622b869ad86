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
    from thingc.api import Compiled as Compiled
    from thingc.api import CompiledMode as CompiledMode
    from thingc.api import CompileError as CompileError
    from thingc.api import compile as compile
    from thingc.families.family import RobotFamily as RobotFamily
    from thingc.families.family import family as family
    from thingc.things.actuator import Actuator as Actuator
    from thingc.things.assets import asset as asset
    from thingc.things.mounts import MountPoint as MountPoint
    from thingc.things.parameters import Angle as Angle
    from thingc.things.parameters import Count as Count
    from thingc.things.parameters import Length as Length
    from thingc.things.parameters import Mass as Mass
    from thingc.things.parameters import ParameterError as ParameterError
    from thingc.things.parameters import Range as Range
    from thingc.things.parameters import Ratio as Ratio
    from thingc.things.resolver import TransformResolver as TransformResolver
    from thingc.things.thing import Thing as Thing

_EXPORTS = {
    "Actuator": "thingc.things.actuator",
    "Angle": "thingc.things.parameters",
    "CompileError": "thingc.api",
    "Compiled": "thingc.api",
    "CompiledMode": "thingc.api",
    "Count": "thingc.things.parameters",
    "Length": "thingc.things.parameters",
    "Mass": "thingc.things.parameters",
    "MountPoint": "thingc.things.mounts",
    "ParameterError": "thingc.things.parameters",
    "Range": "thingc.things.parameters",
    "Ratio": "thingc.things.parameters",
    "RobotFamily": "thingc.families.family",
    "Thing": "thingc.things.thing",
    "TransformResolver": "thingc.things.resolver",
    "asset": "thingc.things.assets",
    "compile": "thingc.api",
    "family": "thingc.families.family",
}
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
