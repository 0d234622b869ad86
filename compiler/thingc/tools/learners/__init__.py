"""Targets for frameworks of reinforcement learning. Each target writes Python modules that configure a robot in one framework.

The targets are registered in the entry points of `thingc`, in the same way as targets of other packages. This module is imported
by every build, so other modules are imported when a target is written.
"""

from __future__ import annotations

from thingc.tools.lazy_emitter import lazy_emitter

WRITES = ("isaaclab/*.py", "mjlab/*.py", "playground/*.py")
UNASKED = False
REQUIRES = {"isaaclab": ("usd",), "mjlab": ("mjcf",), "playground": ("mjcf",)}

emit_isaaclab = lazy_emitter("thingc.tools.learners.isaaclab")
emit_mjlab = lazy_emitter("thingc.tools.learners.mjlab")
emit_playground = lazy_emitter("thingc.tools.learners.playground")
