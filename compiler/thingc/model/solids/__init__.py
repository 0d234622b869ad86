"""The true shapes of parts, as meshes without gaps, and what lies in what."""

from __future__ import annotations

from thingc.model.solids.overlaps import Overlaps, check_overlaps, contact_places, reason_to_skip

__all__ = ["Overlaps", "check_overlaps", "contact_places", "reason_to_skip"]
