"""`continuous`: a turn about the parent mount's z without end. It has no position limits."""

from __future__ import annotations

from thingc.base.joints.kind import JointKind
from thingc.base.joints.twist import Twist, Z

KIND = JointKind(name="continuous", twists=(Twist(angular=Z),), limits="none")
