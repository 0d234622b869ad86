"""`fixed`: two mounts mated for good. What it connects is one link."""

from __future__ import annotations

from thingc.base.joints.kind import JointKind

KIND = JointKind(name="fixed", twists=(), limits="none")
