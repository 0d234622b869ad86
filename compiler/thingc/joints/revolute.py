"""`revolute`: a turn about the parent mount's z, between two limits."""

from __future__ import annotations

from thingc.joints.kind import JointKind
from thingc.pose import turned_z
from thingc.units import ANGLE

KIND = JointKind(name="revolute", coordinate=ANGLE, limits="required", core="hinge", motion=turned_z)
