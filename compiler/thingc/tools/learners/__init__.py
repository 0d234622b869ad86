"""Targets for frameworks of reinforcement learning. Each target writes Python modules that configure a robot in one framework.

The targets are registered in the entry points of `thingc`, in the same way as targets of other packages. This module is imported
by every build, so other modules are imported when a target is written.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from thingc.targets import Artifacts, EmitRequest

WRITES = ("isaaclab/*.py", "mjlab/*.py", "playground/*.py")
UNASKED = False
REQUIRES = {"isaaclab": ("usd",), "mjlab": ("mjcf",), "playground": ("mjcf",)}


def emit_isaaclab(request: EmitRequest) -> Artifacts:
    """Write a module with an `ArticulationCfg` for each chosen mode."""
    from thingc.tools.learners.isaaclab import emit

    return emit(request)


def emit_mjlab(request: EmitRequest) -> Artifacts:
    """Write a module with an `EntityCfg` for each chosen mode."""
    from thingc.tools.learners.mjlab import emit

    return emit(request)


def emit_playground(request: EmitRequest) -> Artifacts:
    """Write a module with the paths and names of the MuJoCo model for each chosen mode."""
    from thingc.tools.learners.playground import emit

    return emit(request)
