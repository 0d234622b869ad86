"""The true shapes of parts, as meshes without gaps, and what lies in what."""

from __future__ import annotations

from thingc.solids.overlaps import check_overlaps

__all__ = ["check_overlaps"]
