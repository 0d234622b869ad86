"""Where a camera stands so that given points just fill its picture."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from thingc.base.frozen_struct import FrozenStruct

Array = NDArray[np.float64]

NEAR = 0.3
"""Where a camera begins to see, as a part of the way to the nearest point."""


class Camera(FrozenStruct, eq=False):
    """A pinhole at `position` (3,) [m]; `axes` (3, 3) are its right, up and backward directions by rows; `tangent` is that of
    half its vertical angle of view, `aspect` width by height; nothing nearer than `near` [m] is seen."""

    position: Array
    axes: Array
    tangent: float
    aspect: float
    near: float

    def project(self, points: Array) -> Array:
        """Where points (n, 3) [m] are in the picture (n, 2): x to the right and y up, both from -1 to 1 within it."""
        x, y, back = self.axes @ (points - self.position).T
        return np.stack([x / (-back * self.tangent * self.aspect), y / (-back * self.tangent)], axis=1)


def directions(azimuth: float, elevation: float, upright: Array) -> Array:
    """Right, up and backward directions (3, 3) by rows of a camera that looks along `azimuth` and `elevation` [rad].

    `upright` (3, 3) has by rows the direction of azimuth 0, that of a quarter turn, and up. As in MuJoCo's viewer a negative
    elevation looks down, and the horizon is level.
    """
    c, s = math.cos(elevation), math.sin(elevation)
    forward = np.array([c * math.cos(azimuth), c * math.sin(azimuth), s]) @ upright
    up = np.array([-s * math.cos(azimuth), -s * math.sin(azimuth), c]) @ upright
    return np.array([np.cross(forward, up), up, -forward])


def upright(gravity: Array) -> Array:
    """The directions (3, 3) that azimuths are measured in, by rows, from gravity (3,) in the world, whose floor is z = 0.

    On a floor they are x, y and z. Where z = 0 is a wall, azimuth 0 looks straight at it; without gravity z is up.
    """
    size = float(np.linalg.norm(gravity))
    up = -gravity / size if size > 0.0 else np.array([0.0, 0.0, 1.0])
    first = np.array([1.0, 0.0, 0.0]) if abs(up[2]) > 0.5 else np.array([0.0, 0.0, -1.0])
    first = first - (first @ up) * up
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(up, first), up])


def fitted(points: Array, axes: Array, angle: float, aspect: float, margin: float) -> Camera:
    """The nearest camera with these axes and this vertical angle of view [rad] that sees all points (n, 3), with `margin` (a part
    of the half picture) left free; in one direction they touch both margins, in the other they are centred.

    With (x, y, z) of a point along the axes and (X, Y, Z) of the camera, the point is right of the left edge where
    x - X >= -t (Z - z) and left of the right one where x - X <= t (Z - z). So t Z + X >= max(x + t z) = A and
    t Z - X >= max(t z - x) = B, and the smallest Z is (A + B) / 2t; up and down likewise.
    """
    tangent = math.tan(angle / 2.0) * (1.0 - margin)
    x, y, z = axes @ points.T
    centre, distance = [], []
    for along, t in ((x, tangent * aspect), (y, tangent)):
        A, B = float(np.max(along + t * z)), float(np.max(t * z - along))
        centre.append((A - B) / 2.0)
        distance.append((A + B) / (2.0 * t))
    position = np.array([*centre, max(distance)])
    near = NEAR * float(position[2] - np.max(z))
    return Camera(position=position @ axes, axes=axes, tangent=math.tan(angle / 2.0), aspect=aspect, near=near)
