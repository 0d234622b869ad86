"""What every emitter is asked with."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from msgspec import field

from thingc.base.diagnostics import Report
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.memo import Memo
from thingc.model.assembly.types import Assembly
from thingc.model.robot.types import Robot

if TYPE_CHECKING:
    from thingc.documents.workspace import Workspace
    from thingc.geometry.service import GeometryService
    from thingc.geometry.store.local import Store


class EmitRequest(FrozenStruct, eq=False):
    """The robot, once without a root (`assembly`) and once per chosen mode (`robots`, document order), and the doors
    an emitter may need: the store for meshes, the geometry service for a STEP file, the report for diagnostics. `verify`: what
    another program shall read is given to that program first, of so many models that differ in nothing but numbers one (1: all, 0: none).
    `compat`: who besides MuJoCo shall read its models, by name. `folder`: the absolute path of the folder that the build will lie in
    (None: nobody knows). `repeated`: this is one of many requests of a session, and what is learned of its models alone is not worth
    keeping."""

    assembly: Assembly
    robots: tuple[Robot, ...]
    store: Store
    geometry: GeometryService
    workspace: Workspace
    report: Report
    verify: int = 1
    compat: tuple[str, ...] = ()
    folder: str | None = None
    repeated: bool = False
    memo: Memo = field(default_factory=Memo)
    """What is worked out once for all modes, and in a session for all requests."""
    made: dict[str, Any] = {}
    """What one target has made that others use, by a name of its own."""
