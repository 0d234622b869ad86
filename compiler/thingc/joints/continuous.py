"""`continuous`: a turn about the parent mount's z without end. It has no position limits."""

from __future__ import annotations

from thingc.joints.kind import JointKind
from thingc.pose import turned_z
from thingc.units import ANGLE

KIND = JointKind(name="continuous", coordinate=ANGLE, limits="none", core="hinge", motion=turned_z)
