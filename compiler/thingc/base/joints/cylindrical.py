"""`cylindrical`: a turn about the parent mount's z, and a slide along it, each by itself."""

from __future__ import annotations

from thingc.base.joints.kind import JointKind
from thingc.base.joints.twist import Twist, Z

KIND = JointKind(name="cylindrical", twists=(Twist(angular=Z), Twist(linear=Z)), limits="optional")
