"""Compute with the mass, centre of mass and inertia of rigid bodies, in pure Python with double precision."""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import lru_cache

from msgspec.structs import replace

from thingc.base import numeric
from thingc.base.one_line_repr import OneLineStruct
from thingc.base.pose import Matrix, Pose, Vector, multiply, transpose

ZERO: Matrix = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


class MassProperties(OneLineStruct, array_like=True):
    """The mass properties of a rigid body: mass [kg], centre of mass [m], and inertia [kg m^2] about the centre, in the axes of a frame."""

    mass: float
    centre: Vector = (0.0, 0.0, 0.0)
    inertia: Matrix = ZERO

    def seen_from(self, pose: Pose) -> MassProperties:
        """Return these mass properties in the axes of frame A, given the pose `X_AB` of the frame B in which they are expressed now."""
        r = pose.rotation
        turned = multiply(multiply(r, self.inertia), transpose(r))
        return MassProperties(mass=self.mass, centre=pose.apply(self.centre), inertia=symmetric(turned))

    def about(self, point: Vector) -> Matrix:
        """Return the inertia [kg m^2] about another point [m] of the same frame, computed with the parallel-axis theorem."""
        x, y, z = (self.centre[k] - point[k] for k in range(3))
        m, i = self.mass, self.inertia
        return (
            (i[0][0] + m * (y * y + z * z), i[0][1] - m * x * y, i[0][2] - m * x * z),
            (i[1][0] - m * x * y, i[1][1] + m * (x * x + z * z), i[1][2] - m * y * z),
            (i[2][0] - m * x * z, i[2][1] - m * y * z, i[2][2] + m * (x * x + y * y)),
        )

    def with_mass(self, mass: float) -> MassProperties:
        """Return the mass properties of a body with the same shape and another mass [kg].

        The inertia is scaled by the ratio of the masses. If the mass was 0, the inertia becomes 0.
        """
        scale = mass / self.mass if self.mass > 0.0 else 0.0
        a, b, c = ((x * scale, y * scale, z * scale) for x, y, z in self.inertia)
        return replace(self, mass=mass, inertia=(a, b, c))


def total(bodies: Iterable[MassProperties]) -> MassProperties:
    """Return the combined mass properties of several rigid bodies whose properties are all expressed in the same frame."""
    parts = list(bodies)
    mass = numeric.fsum(body.mass for body in parts)
    if mass > 0.0:
        cx, cy, cz = (numeric.fsum(body.mass * body.centre[k] for body in parts) / mass for k in range(3))
    else:
        cx, cy, cz = 0.0, 0.0, 0.0
    centre = (cx, cy, cz)
    moved = [body.about(centre) for body in parts]

    def entry(i: int, j: int) -> float:
        return numeric.fsum(inertia[i][j] for inertia in moved)

    xy, xz, yz = entry(0, 1), entry(0, 2), entry(1, 2)
    inertia = ((entry(0, 0), xy, xz), (xy, entry(1, 1), yz), (xz, yz, entry(2, 2)))
    return MassProperties(mass=mass, centre=centre, inertia=inertia)


def symmetric(a: Matrix) -> Matrix:
    """Return the symmetric part `(a + a^T) / 2` of a matrix, so that rounding errors do not make an inertia matrix asymmetric."""
    xy, xz, yz = (a[0][1] + a[1][0]) / 2.0, (a[0][2] + a[2][0]) / 2.0, (a[1][2] + a[2][1]) / 2.0
    return ((a[0][0], xy, xz), (xy, a[1][1], yz), (xz, yz, a[2][2]))


@lru_cache(maxsize=1024)
def principal_moments(a: Matrix) -> Vector:
    """Return the three eigenvalues of a symmetric 3 x 3 matrix in ascending order."""
    return _principal_moments(*a[0], *a[1], *a[2])


def principal_axes(a: Matrix) -> tuple[Vector, Matrix]:
    """Return the eigenvalues of a symmetric 3 x 3 matrix, and the rotation matrix R whose columns are the eigenvectors.

    The matrix is `a = R diag(values) R^T`. Each eigenvector is as close as possible to the coordinate axis with the same index, so R is the
    identity for a diagonal matrix.

    The method is cyclic Jacobi rotations (Golub and Van Loan, "Matrix Computations", section 8.5). The result is accurate to rounding even
    for equal moments, for which the closed formula loses digits. `math.hypot` is used although its last digit can differ between Python
    versions for round arguments. Here the arguments are quotients of sums, which are rarely round. With `numeric.hypot`, evaluating the
    variants of a family would take twice as long.
    """
    return _principal_axes(*a[0], *a[1], *a[2])


@numeric.one_operation
def _principal_moments(*entries: float) -> Vector:
    x, y, z = sorted(_principal_axes(*entries)[0])
    return (x, y, z)


@numeric.one_operation
def _principal_axes(
    xx: float, xy: float, xz: float, yx: float, yy: float, yz: float, zx: float, zy: float, zz: float,
) -> tuple[Vector, Matrix]:
    m = [list(row) for row in symmetric(((xx, xy, xz), (yx, yy, yz), (zx, zy, zz)))]
    v = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    for _ in range(32):
        off = abs(m[0][1]) + abs(m[0][2]) + abs(m[1][2])
        if off <= 1e-300 or off <= 1e-18 * (abs(m[0][0]) + abs(m[1][1]) + abs(m[2][2])):
            break
        for p, q in ((0, 1), (0, 2), (1, 2)):
            if m[p][q] == 0.0:
                continue
            theta = (m[q][q] - m[p][p]) / (2.0 * m[p][q])
            t = math.copysign(1.0, theta) / (abs(theta) + math.hypot(theta, 1.0))
            c = 1.0 / math.hypot(t, 1.0)
            s = t * c
            for row in (*m, *v):
                x, y = row[p], row[q]
                row[p], row[q] = c * x - s * y, s * x + c * y
            (a0, a1, a2), (b0, b1, b2) = m[p], m[q]
            m[p] = [c * a0 - s * b0, c * a1 - s * b1, c * a2 - s * b2]
            m[q] = [s * a0 + c * b0, s * a1 + c * b1, s * a2 + c * b2]
    rows = ((v[0][0], v[0][1], v[0][2]), (v[1][0], v[1][1], v[1][2]), (v[2][0], v[2][1], v[2][2]))
    return (m[0][0], m[1][1], m[2][2]), rows


LEAST_MOMENT = 1e-14
"""Smallest principal moment [kg m^2] that MuJoCo accepts for a body (mjEPS, in the reader of `fullinertia`)."""
HEAVIEST = 1e12
"""Largest accepted mass [kg]. Products and sums of larger masses may overflow."""
LARGEST_MOMENT, DENSEST = 1e24, 1e12
"""Largest accepted moments and products of inertia [kg m^2], and largest accepted density [kg/m^3]."""
LEAST_MASS = 1e-15
"""Smallest mass [kg] of a moving body: MuJoCo rejects masses up to this value (mjMINVAL)."""


def physical_fault(a: Matrix) -> str | None:
    """Return a message that explains why a rigid body cannot have the inertia matrix `a`, or None if the inertia is physical.

    The inertia must be positive definite, and no principal moment may exceed the sum of the other two moments (with a relative tolerance of
    1e-9).
    """
    return moments_fault(*principal_moments(a))


def moments_fault(low: float, middle: float, high: float) -> str | None:
    """Return a message that explains why a rigid body cannot have these principal moments [kg m^2], or None if they are physical.

    The principal moments are given in ascending order.
    """
    if low <= 0.0:
        return f"the principal moments ({low:.6g}, {middle:.6g}, {high:.6g} kg m^2) are not all positive"
    if high > (low + middle) * (1.0 + 1e-9):
        return f"the largest principal moment ({high:.6g} kg m^2) exceeds the sum of the other two ({low:.6g} + {middle:.6g})"
    return None


def named_moments(a: Matrix) -> dict[str, float]:
    """Return the six different entries of an inertia matrix by their names in URDF and SDF, such as `ixx`."""
    return {"ixx": a[0][0], "ixy": a[0][1], "ixz": a[0][2], "iyy": a[1][1], "iyz": a[1][2], "izz": a[2][2]}


def within_triangle(a: Matrix) -> Matrix:
    """Return an inertia matrix that satisfies the triangle inequality of principal moments exactly, as MuJoCo requires.

    MuJoCo requires A + B >= C for the principal moments. For a flat plate A + B equals C, and a rounding error can make the sum smaller
    than C. The moments of flat bodies are therefore increased by a relative 1e-12.
    """
    low, middle, high = principal_moments(a)
    short = high - low - middle
    if short < -1e-12 * high:
        return a
    lift = numeric.maximum(short, 0.0) + 1e-12 * high
    return ((a[0][0] + lift, a[0][1], a[0][2]), (a[1][0], a[1][1] + lift, a[1][2]), (a[2][0], a[2][1], a[2][2] + lift))
