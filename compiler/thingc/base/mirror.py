"""Mirroring at a plane through the origin of a frame, in plain Python (see `pose.py`).

With S the reflection at the plane in a component's frame, and D the one that turns y of a mount's own frame round, a mount at X of what is
mirrored is at `S X D` of the image: its origin, x and z are mirrored, and y follows, so that frames stay right-handed.
"""

from __future__ import annotations

from typing import Any

from thingc.base.pose import NO_POSE, Matrix, Pose, Vector


class Mirror:
    """The mirror at the plane through the origin that is normal to `axis` (`x | y | z`)."""

    def __init__(self, axis: str) -> None:
        x, y, z = (-1.0 if axis == name else 1.0 for name in "xyz")
        self.signs: Vector = (x, y, z)

    def vector(self, value: Any) -> Vector:
        """The image of a point, or of a direction."""
        x, y, z = (entry * sign + 0.0 for entry, sign in zip(value, self.signs, strict=True))
        return (x, y, z)

    def matrix(self, value: Any) -> Matrix:
        """The image `S I S` of a matrix of inertia."""
        a, b, c = (self.vector([entry * sign for entry in row]) for row, sign in zip(value, self.signs, strict=True))
        return (a, b, c)

    def mount(self, pose: Pose) -> Pose:
        """The image of a mount, right-handed again: its origin, x and z are mirrored, its y is `z x x`, the image of y reversed."""
        x, y, z = (self.vector(column) for column in zip(*pose.rotation, strict=True))
        a, b, c = ((x[k], -y[k] + 0.0, z[k]) for k in range(3))
        return Pose(rotation=(a, b, c), translation=self.vector(pose.translation))

    def frame(self, pose: Pose) -> Pose:
        """The image `S X S` of a frame in which what lies is mirrored along the same axis of its own."""
        return Pose(rotation=self.matrix(pose.rotation), translation=self.vector(pose.translation))

    @property
    def origin(self) -> Pose:
        """Where a mount that lies on the origin is in the image."""
        return self.mount(NO_POSE)
