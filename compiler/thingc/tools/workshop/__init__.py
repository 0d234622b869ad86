"""Targets for the workshop, which are registered in the entry points of `thingc`, in the same way as targets of other packages.

This module is imported by every build, so other modules are imported when a target is written.
"""

from __future__ import annotations

from thingc.tools.lazy_emitter import lazy_emitter

WRITES = ("3mf/*.3mf", "book/*.html", "book/*.pdf", "drawing/*.pdf", "drawing/*.svg", "dxf/*.dxf")
UNASKED = False
RENDERED = {"book"}
"""Targets that contain pictures. The command line prepares rendering for these targets before MuJoCo is imported."""

emit_3mf = lazy_emitter("thingc.tools.workshop.plates")
emit_book = lazy_emitter("thingc.tools.workshop.book")
emit_drawing = lazy_emitter("thingc.tools.workshop.drawing")
emit_dxf = lazy_emitter("thingc.tools.workshop.dxf")
