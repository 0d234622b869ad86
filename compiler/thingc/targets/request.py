"""The input of every emitter."""

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
    """The input of an emitter.

    It has the robot, without a root (`assembly`) and once per chosen mode (`robots`, in document order), and the services that an emitter
    may need: `store` has the meshes, `geometry` makes STEP files, `report` receives diagnostics. `verify`: MuJoCo compiles every
    `verify`-th of the models that only differ in numbers (1: all, 0: none). `compat`: names of other programs that will read MuJoCo models.
    `folder`: the absolute path of the build folder (None: unknown). `repeated`: this is one of many requests of a session, so results for
    its models alone are not worth caching.
    """

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
    """Results computed once for all modes, and in a session for all requests."""
    made: dict[str, Any] = {}
    """Results of targets that other targets use, by name."""
