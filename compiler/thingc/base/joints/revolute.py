"""`revolute`: a turn about the parent mount's z, between two limits."""

from __future__ import annotations

from thingc.base.joints.kind import JointKind
from thingc.base.joints.twist import Twist, Z

KIND = JointKind(name="revolute", twists=(Twist(angular=Z),), limits="required")
