"""The input of the emitters of all targets."""

from __future__ import annotations

from typing import Any

from msgspec import field
from msgspec.structs import replace

from thingc.base.diagnostics import Report
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.memo import Memo
from thingc.base.progress import Progress
from thingc.documents.workspace import Workspace
from thingc.geometry.service import GeometryService
from thingc.geometry.store.local import Store
from thingc.model.assembly.types import Assembly
from thingc.model.robot.types import Robot


class EmitRequest(FrozenStruct, eq=False):
    """The input of an emitter: the assembly, the robots, and the options of a build.

    `assembly` is the robot before a root is selected. `robots` contains one robot for each chosen mode, in the order of the document.
    `store` contains the meshes, `geometry` writes STEP files, and `report` collects diagnostics. `verify` controls how many models MuJoCo
    compiles: one out of every `verify` models that differ only in numbers (1: all, 0: none). `compat` names additional programs that will
    read the MuJoCo models. `folder` is the absolute path of the build folder (None if unknown). `progress` shows the progress of long
    computations. `repeated` is True if a process handles many similar requests. If `repeated` is True, the results of a single request are
    not cached.
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
    progress: Progress | None = None
    repeated: bool = False
    memo: Memo = field(default_factory=Memo)
    """A cache of results for all modes. In a session, the cache is used for all requests."""
    made: dict[str, Any] = {}
    """Results of targets that other targets also use, by name."""

    def in_target(self, target: str) -> EmitRequest:
        """Return the request with the collision shapes that the document selects for a target. A ROS package contains a URDF file."""
        assembly = self.assembly.in_target("urdf" if target == "ros" else target)
        if assembly is self.assembly:
            return self
        robots = tuple(replace(robot, assembly=assembly.in_mode(robot.mode.name)) for robot in self.robots)
        request: EmitRequest = self.made.setdefault(f"request for {target}", replace(self, assembly=assembly, robots=robots, made={}))
        return request
