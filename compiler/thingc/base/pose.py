"""Compute with rigid transformations in pure Python. `X_AB` is the pose of frame B in frame A, and `X_AC = X_AB @ X_BC`.

Vectors and matrices are tuples of floats, because importing numpy would slow down `thingc check`. Lengths are in metres, angles in radians.
"""

from __future__ import annotations

import math
from typing import Any

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.numeric import atan2, copysign, cos, hypot, maximum, one_operation, sin, sqrt, sum_of

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
Matrix = tuple[Vector, Vector, Vector]
"""A 3 x 3 matrix as a tuple of rows."""

IDENTITY: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def multiply(a: Matrix, b: Matrix) -> Matrix:
    """Return the product `a b` of two 3 x 3 matrices."""
    columns = transpose(b)
    return (
        (dot(a[0], columns[0]), dot(a[0], columns[1]), dot(a[0], columns[2])),
        (dot(a[1], columns[0]), dot(a[1], columns[1]), dot(a[1], columns[2])),
        (dot(a[2], columns[0]), dot(a[2], columns[1]), dot(a[2], columns[2])),
    )


def transpose(a: Matrix) -> Matrix:
    """Return the transpose of a 3 x 3 matrix."""
    return ((a[0][0], a[1][0], a[2][0]), (a[0][1], a[1][1], a[2][1]), (a[0][2], a[1][2], a[2][2]))


def dot(a: Vector, b: Vector) -> float:
    """Return the scalar product of two vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def add_scaled(a: Vector, b: Vector, factor: float) -> Vector:
    """Return the vector `a + factor b`."""
    return (a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2])


def scale_vector(v: Vector, factor: float) -> Vector:
    """Return the vector `factor v`. A component of zero never becomes -0.0."""
    return (factor * v[0] + 0.0, factor * v[1] + 0.0, factor * v[2] + 0.0)


def axis_name(direction: Vector) -> str | None:
    """Return the axis to which a unit vector is parallel, with its sign, such as `-z`. Return None for other directions."""
    parallel = (f"{'+' if value > 0.0 else '-'}{name}" for name, value in zip("xyz", direction, strict=True) if abs(value) > 1.0 - 1e-9)
    return next(parallel, None)


def cross(a: Vector, b: Vector) -> Vector:
    """Return the cross product `a x b`."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def rotate(a: Matrix, v: Vector) -> Vector:
    """Return the product `a v` of a 3 x 3 matrix and a vector."""
    return (dot(a[0], v), dot(a[1], v), dot(a[2], v))


class Pose(FrozenStruct):
    """The pose of a frame: a rotation (a proper orthogonal 3 x 3 matrix) and a translation [m]."""

    rotation: Matrix = IDENTITY
    translation: Vector = (0.0, 0.0, 0.0)

    def __matmul__(self, other: Pose) -> Pose:
        """Compose two poses. For `X_AB @ X_BC`, the result is `X_AC`."""
        return Pose(rotation=multiply(self.rotation, other.rotation), translation=self.apply(other.translation))

    def inverse(self) -> Pose:
        """Return the inverse of this pose. The inverse of `X_AB` is `X_BA`."""
        rotation = transpose(self.rotation)
        x, y, z = rotate(rotation, self.translation)
        return Pose(rotation=rotation, translation=(-x, -y, -z))

    def apply(self, point: Vector) -> Vector:
        """Transform the coordinates of a point [m] from frame B to frame A, where this pose is `X_AB`."""
        x, y, z = rotate(self.rotation, point)
        t = self.translation
        return (x + t[0], y + t[1], z + t[2])

    def around(self, box: tuple[Vector, Vector]) -> tuple[Vector, Vector]:
        """Return the axis-aligned bounding box in frame A of a box that is aligned with the axes of frame B.

        A box is a pair of its lowest and its highest corner [m]. The pose `self` is `X_AB`, the pose of B in A.
        """
        (ax, ay, az), (bx, by, bz) = box
        x, y, z = self.apply(((ax + bx) / 2.0, (ay + by) / 2.0, (az + bz) / 2.0))
        u, v, w = (
            abs(row[0]) * ((bx - ax) / 2.0) + abs(row[1]) * ((by - ay) / 2.0) + abs(row[2]) * ((bz - az) / 2.0) for row in self.rotation
        )
        return (x - u, y - v, z - w), (x + u, y + v, z + w)

    def rows(self) -> tuple[tuple[float, float, float, float], ...]:
        """Return this pose as a homogeneous 4 x 4 matrix, which is a tuple of rows."""
        r, t = self.rotation, self.translation
        return ((*r[0], t[0]), (*r[1], t[1]), (*r[2], t[2]), (0.0, 0.0, 0.0, 1.0))

    def quaternion(self) -> Quaternion:
        """Return the rotation of this pose as a unit quaternion (w, x, y, z). The first component that is not zero is positive.

        Source: Shepperd, "Quaternion from rotation matrix", 1978. The largest component is computed first, so the result is exact to
        rounding at every angle.
        """
        r = self.rotation
        squares = (
            1.0 + r[0][0] + r[1][1] + r[2][2],
            1.0 + r[0][0] - r[1][1] - r[2][2],
            1.0 - r[0][0] + r[1][1] - r[2][2],
            1.0 - r[0][0] - r[1][1] + r[2][2],
        )
        largest = max(range(4), key=lambda k: squares[k])
        double = sqrt(maximum(squares[largest], 0.0))
        half, scale = double / 2.0, 0.5 / double
        wx, wy, wz = r[2][1] - r[1][2], r[0][2] - r[2][0], r[1][0] - r[0][1]
        xy, xz, yz = r[0][1] + r[1][0], r[0][2] + r[2][0], r[1][2] + r[2][1]
        rows = (
            (half, wx * scale, wy * scale, wz * scale),
            (wx * scale, half, xy * scale, xz * scale),
            (wy * scale, xy * scale, half, yz * scale),
            (wz * scale, xz * scale, yz * scale, half),
        )
        q = rows[largest]
        norm = sqrt(sum_of(component * component for component in q))
        sign = next((copysign(1.0, c) for c in q if c != 0.0), 1.0)
        w, x, y, z = ((sign * component / norm) + 0.0 for component in q)
        return (w, x, y, z)


NO_POSE = Pose()


def turn_of(quaternion: Quaternion) -> Vector:
    """Convert a nonzero quaternion (w, x, y, z) to a rotation vector: the rotation axis times the angle [rad] from 0 to pi.

    The result is accurate for angles near 0 and near pi.
    """
    w, x, y, z = quaternion if quaternion[0] >= 0.0 else (-quaternion[0], -quaternion[1], -quaternion[2], -quaternion[3])
    size = sqrt(x * x + y * y + z * z)
    if size == 0.0:
        return (0.0, 0.0, 0.0)
    angle = 2.0 * atan2(size, w)
    return (x * angle / size, y * angle / size, z * angle / size)


def quaternion_of(turn: Vector) -> Quaternion:
    """Convert a rotation vector [rad] to a unit quaternion (w, x, y, z)."""
    angle = hypot(*turn)
    if angle == 0.0:
        return (1.0, 0.0, 0.0, 0.0)
    scale = sin(angle / 2.0) / angle
    return (cos(angle / 2.0), scale * turn[0], scale * turn[1], scale * turn[2])

MATE = Pose(rotation=((0.0, -1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, -1.0)))
"""Pose of a mount in the frame of the mount that it is mated to: the z axes are opposed, and x and y are swapped and negated. The pose is
its own inverse.

In build123d, the pose is `Location((0, 0, 0), (180, 0, 90))`. The rotation is stored as a matrix, because extrinsic angles of (180, 0, 90)
degrees describe another rotation.
"""


@one_operation
def quarter_exact(angle: float) -> tuple[float, float]:
    """Return the cosine and the sine of an angle [rad].

    The results are exact at multiples of 90 degrees, where `math.cos` returns values such as 6e-17.
    """
    quarters = angle / (math.pi / 2.0)
    nearest = round(quarters)
    if abs(quarters - nearest) < 1e-15 * max(1.0, abs(quarters)):
        return ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[nearest % 4]
    return math.cos(angle), math.sin(angle)


def turned_about(axis: Vector, angle: float) -> Matrix:
    """Return the matrix of a rotation by an angle [rad] about a unit vector through the origin.

    Rodrigues' formula is `R = c 1 + s [a]x + (1 - c) a a^T` for the axis a, with the cosine c and the sine s of the angle.
    """
    x, y, z = axis
    c, s = quarter_exact(angle)
    # 1 - cos without cancellation near 0
    d = 2.0 * sin(angle / 2.0) ** 2
    return (
        (c + d * x * x, d * x * y - s * z, d * x * z + s * y),
        (d * x * y + s * z, c + d * y * y, d * y * z - s * x),
        (d * x * z - s * y, d * y * z + s * x, c + d * z * z),
    )


def turned_x(angle: float) -> Pose:
    """Return the pose of a frame that is rotated by an angle [rad] about the x axis."""
    c, s = quarter_exact(angle)
    return Pose(rotation=((1.0, 0.0, 0.0), (0.0, c, -s), (0.0, s, c)))


def turned_y(angle: float) -> Pose:
    """Return the pose of a frame that is rotated by an angle [rad] about the y axis."""
    c, s = quarter_exact(angle)
    return Pose(rotation=((c, 0.0, s), (0.0, 1.0, 0.0), (-s, 0.0, c)))


def turned_z(angle: float) -> Pose:
    """Return the pose of a frame that is rotated by an angle [rad] about the z axis."""
    c, s = quarter_exact(angle)
    return Pose(rotation=((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0)))


def make_translation(x: float, y: float, z: float) -> Pose:
    """Return the pose of a frame that is translated by (x, y, z) [m] without rotation."""
    return Pose(translation=(x, y, z))


def make_pose(xyz: Vector, rpy: Vector) -> Pose:
    """Return the pose with the translation `xyz` [m] and the roll, pitch and yaw angles `rpy` [rad], as in an `<origin>` of URDF."""
    roll, pitch, yaw = rpy
    turned = turned_z(yaw) @ turned_y(pitch) @ turned_x(roll)
    return Pose(rotation=turned.rotation, translation=xyz)


def rotation_of(quaternion: Quaternion) -> Matrix:
    """Convert a nonzero quaternion (w, x, y, z) to a 3 x 3 rotation matrix.

    The quaternion need not be normalized. No square root is computed, so quarter turns about a coordinate axis are exact.
    """
    w, x, y, z = quaternion
    squared = w * w + x * x + y * y + z * z
    return (
        ((w * w + x * x - y * y - z * z) / squared, 2.0 * (x * y - w * z) / squared, 2.0 * (x * z + w * y) / squared),
        (2.0 * (x * y + w * z) / squared, (w * w - x * x + y * y - z * z) / squared, 2.0 * (y * z - w * x) / squared),
        (2.0 * (x * z - w * y) / squared, 2.0 * (y * z + w * x) / squared, (w * w - x * x - y * y + z * z) / squared),
    )


def along(z: Vector, origin: Vector) -> Pose:
    """Return the pose of a frame at the point `origin` [m] whose z axis is the unit vector `z`.

    If `z` is a coordinate axis, the x and y axes of the frame are also parallel to coordinate axes.
    """
    least = min(range(3), key=lambda k: abs(z[k]))
    y = cross(z, IDENTITY[least])
    size = sqrt(dot(y, y))
    y = (y[0] / size, y[1] / size, y[2] / size)
    return Pose(rotation=transpose((cross(y, z), y, z)), translation=origin)


def rpy_of(rotation: Matrix) -> Vector:
    """Convert a 3 x 3 rotation matrix to roll, pitch and yaw angles [rad], as in an `<origin>` of URDF.

    At a pitch of 90 degrees, yaw and roll rotate about the same axis. For this pitch, the function chooses a yaw and returns the remaining
    rotation as roll.
    """
    (xx, xy, xz), (yx, yy, yz), (zx, _, _) = rotation
    yaw = atan2(yx, xx)
    c, s = cos(yaw), sin(yaw)
    return (atan2(s * xz - c * yz, c * yy - s * xy), atan2(-zx, c * xx + s * yx), yaw)


class Mirror:
    """A reflection across the plane through the origin whose normal is the coordinate axis `axis` (`x`, `y` or `z`).

    Let S be the reflection in the frame of a component, and D the matrix that reverses the y axis of a mount. The mirror image of a mount
    with the pose X has the pose `S X D`. The origin and the x and z axes are mirrored, and the y axis is chosen so that the frame is
    right-handed.
    """

    def __init__(self, axis: str) -> None:
        x, y, z = (-1.0 if axis == name else 1.0 for name in "xyz")
        self.signs: Vector = (x, y, z)

    def vector(self, value: Any) -> Vector:
        """Return the mirror image of a point or a direction."""
        x, y, z = (entry * sign + 0.0 for entry, sign in zip(value, self.signs, strict=True))
        return (x, y, z)

    def matrix(self, value: Any) -> Matrix:
        """Return the mirror image `S I S` of an inertia matrix I."""
        a, b, c = (self.vector([entry * sign for entry in row]) for row, sign in zip(value, self.signs, strict=True))
        return (a, b, c)

    def mount(self, pose: Pose) -> Pose:
        """Return the pose of the mirror image of a mount.

        The origin and the x and z axes are mirrored; y is chosen for a right-handed frame.
        """
        x, y, z = (self.vector(column) for column in zip(*pose.rotation, strict=True))
        a, b, c = ((x[k], -y[k] + 0.0, z[k]) for k in range(3))
        return Pose(rotation=(a, b, c), translation=self.vector(pose.translation))

    def frame(self, pose: Pose) -> Pose:
        """Return the mirror image `S X S` of the pose X of a frame.

        Geometry in this frame must be mirrored along the same axis of the frame.
        """
        return Pose(rotation=self.matrix(pose.rotation), translation=self.vector(pose.translation))

    @property
    def origin(self) -> Pose:
        """The pose of the mirror image of a mount whose pose is the identity."""
        return self.mount(NO_POSE)
