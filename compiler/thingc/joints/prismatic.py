"""`prismatic`: a slide along the parent mount's z, between two limits."""

from __future__ import annotations

from thingc.joints.kind import JointKind
from thingc.pose import Pose, shifted
from thingc.units import LENGTH


def motion(q: float) -> Pose:
    """A shift by `q` [m] along z."""
    return shifted(0.0, 0.0, q)


KIND = JointKind(name="prismatic", coordinate=LENGTH, limits="required", core="slide", motion=motion)
