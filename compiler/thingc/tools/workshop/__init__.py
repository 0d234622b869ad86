"""Targets for the workshop, which are registered in the entry points of `thingc`, in the same way as targets of other packages.

This module is imported by every build, so other modules are imported when a target is written.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from thingc.targets import Artifacts, EmitRequest

WRITES = ("3mf/*.3mf", "book/*.html", "drawing/*.svg", "dxf/*.dxf")
UNASKED = False
RENDERED = {"book"}
"""Targets that contain pictures. The command line prepares rendering for these targets before MuJoCo is imported."""


def emit_3mf(request: EmitRequest) -> Artifacts:
    """Write the print plates."""
    from thingc.tools.workshop.plates import emit

    return emit(request)


def emit_book(request: EmitRequest) -> Artifacts:
    """Write the assembly instructions."""
    from thingc.tools.workshop.book import emit

    return emit(request)


def emit_drawing(request: EmitRequest) -> Artifacts:
    """Write drawings of the parts that are made."""
    from thingc.tools.workshop.drawing import emit

    return emit(request)


def emit_dxf(request: EmitRequest) -> Artifacts:
    """Write the outlines of flat parts."""
    from thingc.tools.workshop.dxf import emit

    return emit(request)
