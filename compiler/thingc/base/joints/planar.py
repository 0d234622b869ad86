"""`planar`: slides along the parent mount's x and y, and a turn about z where they have led."""

from __future__ import annotations

from thingc.base.joints.kind import JointKind
from thingc.base.joints.twist import Twist, X, Y, Z

KIND = JointKind(name="planar", twists=(Twist(linear=X), Twist(linear=Y), Twist(angular=Z)), limits="optional")
