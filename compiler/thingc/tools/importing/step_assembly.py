"""The content of a STEP file of an assembly, in SI units."""

from __future__ import annotations

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.pose import Pose
from thingc.geometry.features import Features


class StepPart(FrozenStruct):
    """A part of a STEP assembly. `sha256` is the digest of its own STEP file in the store.

    `colors` contains the colours of the part (`#rrggbb`), the colour of the largest area first. `density` is in [kg/m^3].
    """

    name: str
    sha256: str
    colors: tuple[str, ...]
    material: str | None
    density: float | None
    features: Features


class StepChild(FrozenStruct):
    """A part or a nested assembly in an assembly: its name, its pose in the assembly, and its index in `parts` or `assemblies`."""

    name: str
    pose: Pose
    part: int | None = None
    assembly: int | None = None


class StepGroup(FrozenStruct):
    """An assembly, and its parts and nested assemblies."""

    name: str
    children: tuple[StepChild, ...]


class StepAssembly(FrozenStruct):
    """The content of a STEP file. `root` is the index of the outermost assembly. `left_out` lists shapes without solids by name.

    `merged` maps the names of parts to the names of equal parts that replace them.
    """

    parts: tuple[StepPart, ...]
    assemblies: tuple[StepGroup, ...]
    root: int
    left_out: tuple[str, ...] = ()
    merged: dict[str, str] = {}
