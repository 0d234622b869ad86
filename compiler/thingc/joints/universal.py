"""`universal`: a turn about the parent mount's x, then one about y as that has turned it."""

from __future__ import annotations

from thingc.joints.kind import JointKind
from thingc.joints.twist import Twist, X, Y

KIND = JointKind(name="universal", twists=(Twist(angular=X), Twist(angular=Y)), limits="optional")
