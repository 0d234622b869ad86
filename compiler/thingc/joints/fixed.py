"""`fixed`: two mounts mated for good. What it connects is one link."""

from __future__ import annotations

from thingc.joints.kind import JointKind
from thingc.pose import NO_POSE, Pose


def motion(q: float) -> Pose:
    """The identity, whatever is asked: there is no coordinate."""
    return NO_POSE


KIND = JointKind(name="fixed", coordinate=None, limits="none", core=None, motion=motion)
