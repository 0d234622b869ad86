"""`universal`: a turn about the parent mount's x, then one about y as that has turned it."""

from __future__ import annotations

from thingc.base.joints.kind import JointKind
from thingc.base.joints.twist import Twist, X, Y

KIND = JointKind(name="universal", twists=(Twist(angular=X), Twist(angular=Y)), limits="optional")
