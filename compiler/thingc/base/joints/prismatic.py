"""`prismatic`: a slide along the parent mount's z, between two limits."""

from __future__ import annotations

from thingc.base.joints.kind import JointKind
from thingc.base.joints.twist import Twist, Z

KIND = JointKind(name="prismatic", twists=(Twist(linear=Z),), limits="required")
