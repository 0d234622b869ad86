"""The `workspace/1` document: `thingc.toml`, or the `[tool.thingc]` table of a `pyproject.toml`."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from thingc.spec.base import Model
from thingc.spec.fields import AngleField, LengthField, TimeField


class SimulationMeshSpec(Model):
    """How finely curved surfaces are meshed for simulators."""

    linear: LengthField | None = None
    """Largest distance between mesh and surface; 0.1 mm unless written, or that of `mesh` where it is larger."""
    angular: AngleField | None = None
    """Largest angle between neighbouring facets; 30 deg unless written, or that of `mesh` where it is larger."""


class MeshSpec(Model):
    """How finely curved surfaces are meshed, to be printed and for checks of clearance."""

    linear: LengthField | None = None
    """Largest distance between mesh and surface; 0.1 mm unless written."""
    angular: AngleField | None = None
    """Largest angle between neighbouring facets; 10 deg unless written."""
    simulation: SimulationMeshSpec | None = Field(default=None, examples=[{"linear": "0.1 mm", "angular": "30 deg"}])
    """The same of what simulators draw and touch."""


class WorkspaceSpec(Model):
    """Where parts are looked for and how they are made."""

    thingc: Literal["workspace/1"]
    """Kind and version of this document."""
    parts: list[str] = Field(default=["parts"], examples=[["parts"]])
    """Folders whose modules may be named in `part:`."""
    packages: list[str] = Field(default=["thingc_stock", "bd_warehouse"], examples=[["thingc_stock", "bd_warehouse"]])
    """Installed packages that may be, too."""
    build: str = Field(default="build", examples=["build"])
    """The folder that builds go to."""
    emit: list[str] = Field(default=[], examples=[["mjcf", "step", "urdf"], ["all"]])
    """What `thingc build` writes unless `--emit` says so; unless written, all that is not only written where it is named."""
    mesh_uri: Literal["relative", "package", "absolute"] = Field(default="relative", examples=["package"])
    """How URDF files name their meshes: relative to the file, in the ROS package of the robot, or where the build lies on this machine."""
    part_timeout: TimeField | None = None
    """Longest time for one part; 120 s unless written."""
    mesh: MeshSpec | None = Field(default=None, examples=[{"linear": "0.1 mm", "angular": "10 deg"}])
