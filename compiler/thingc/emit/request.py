"""What every emitter is asked with."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from thingc.diagnostics import Report
from thingc.graph.types import Assembly
from thingc.robot.types import Robot

if TYPE_CHECKING:
    from thingc.realize.service import GeometryService
    from thingc.realize.store import Store
    from thingc.workspace import Workspace


@dataclass(frozen=True, slots=True, kw_only=True)
class EmitRequest:
    """The robot, once without a root (`assembly`) and once per chosen mode (`robots`, document order), and the doors
    an emitter may need: the store for meshes, the geometry service for a STEP file, the report for diagnostics."""

    assembly: Assembly
    robots: tuple[Robot, ...]
    store: Store
    geometry: GeometryService
    workspace: Workspace
    report: Report
