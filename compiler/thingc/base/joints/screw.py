"""`screw`: a turn about the parent mount's z that also slides along it, by its `lead` in every turn. q is the turn."""

from __future__ import annotations

from thingc.base.joints.kind import JointKind
from thingc.base.joints.twist import Twist, Z

KIND = JointKind(name="screw", twists=(Twist(angular=Z),), limits="optional", leads=True)
