"""`ball`: any turn about the parent mount's origin. q is a rotation vector: the axis, times the angle."""

from __future__ import annotations

from thingc.base.joints.kind import JointKind
from thingc.base.joints.twist import Twist, X, Y, Z

KIND = JointKind(name="ball", twists=(Twist(angular=X), Twist(angular=Y), Twist(angular=Z)), limits="cone", at_once=True)
