"""What a change touches: which documents depend on the files that changed. No Python of theirs is run to find out."""

from __future__ import annotations

from thingc.gate.changes import NotARepository, changed_since
from thingc.gate.touched import Touched, touched

__all__ = ["NotARepository", "Touched", "changed_since", "touched"]
