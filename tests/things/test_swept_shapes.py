"""Swept shapes of moving neighbours, compared with the kinematics of the compiler and with distances from moved shapes."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from math import cos, pi, radians, sin
from typing import Any

import numpy as np
import pytest
from build123d import Box, Cylinder, Location, Plane, Pos, Rot, Shape, Solid, Vertex
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from graph.builder import assembly, box, component, coordinates_of, linked, mode, ref
from thingc import MountPoint
from thingc.base.diagnostics import Report
from thingc.base.pose import Pose
from thingc.geometry.things.sweep import _paths
from thingc.model.robot.kinematic_tree import root
from thingc.model.robot.kinematics import occurrence_poses
from thingc.model.robot.types import Robot

Array = NDArray[np.float64]
PARENT, CHILD = Location((8, -3, 5), (20, -35, 60)), Location((-4, 6, 2), (130, 15, -70))
"""Mounts of two parts [mm, deg], in the frames of the parts."""
LIMITS = {"revolute": 3.0, "prismatic": 0.02}
TOLERANCE = 0.2


def rows(location: Location) -> list[list[float]]:
    """A location of build123d [mm] as the rows of a matrix (4 x 4) [m]."""
    at = location.wrapped.Transformation()
    return [[at.Value(row, column) / (1e3 if column == 4 else 1.0) for column in range(1, 5)] for row in range(1, 4)] + [[0, 0, 0, 1]]


def in_mm(location: Location) -> Array:
    """A location of build123d as a matrix (4 x 4) [mm]."""
    matrix = np.array(rows(location))
    matrix[:3, 3] *= 1e3
    return matrix


def matrix(pose: Pose) -> Array:
    return np.vstack([np.column_stack([pose.rotation, np.array(pose.translation) * 1e3]), [0, 0, 0, 1]])


@cache
def robot_with(kind: str) -> Robot:
    """A robot of two parts with a joint `j` between their mounts."""
    turns = coordinates_of("j", "a.out", "b.in", kind, lower=-LIMITS[kind], upper=LIMITS[kind])
    records = [box("p:A", (0.01, 0.01, 0.01), mounts={"out": rows(PARENT)}), box("p:B", (0.01, 0.01, 0.01), mounts={"in": rows(CHILD)})]
    model = assembly("r", [component("a", "p:A"), component("b", "p:B")], turns, modes=[mode("m", ref("a.origin"))])
    whole = linked(model, *records)
    robot = root(whole, whole.modes[0], Report())
    assert robot is not None
    return robot


def relative(kind: str, q: float) -> Array:
    """The pose of the child in the frame of the parent (4 x 4) [mm], computed by the compiler for the joint position `q` [rad or m]."""
    parent, child = (matrix(one) for one in occurrence_poses(robot_with(kind), {"j": q}))
    return np.asarray(np.linalg.inv(parent) @ child)


def located(shape: Shape[Any], at: Array) -> Shape[Any]:
    """A copy of a shape at a pose (4 x 4) [mm]."""
    return shape.moved(Location(Plane(tuple(at[:3, 3]), x_dir=tuple(at[:3, 0]), z_dir=tuple(at[:3, 2]))))


def outside_box(points: Array) -> Array:
    """Distances [mm] of points from `BOX`, in the frame of the neighbour's mount."""
    return np.linalg.norm(np.maximum(np.abs(points - [6, 1, 3]) - [5, 2, 4], 0.0), axis=1)


def outside_cylinder(points: Array) -> Array:
    """Distances [mm] of points from `CYLINDER`, in the frame of the neighbour's mount."""
    across = np.maximum(np.hypot(points[:, 0] - 9.0, points[:, 1] + 4.0) - 2.0, 0.0)
    return np.hypot(across, np.maximum(np.abs(points[:, 2]) - 4.5, 0.0))


BOX, CYLINDER = Pos(6, 1, 3) * Box(10, 4, 8), Pos(9, -4, 0) * Cylinder(2, 9)
OBLIQUE = Rot(35, 50, 0) * Pos(6, 0, 3) * Box(4, 6, 8) - Pos(4, 2, 1) * Box(4, 4, 4)


@pytest.mark.parametrize("side", ["parent", "child"])
@pytest.mark.parametrize(("kind", "ends"), [("revolute", (15.0, 95.0)), ("prismatic", (2.0, 9.0))])
@pytest.mark.parametrize(("shape", "outside"), [(BOX, outside_box), (CYLINDER, outside_cylinder), (OBLIQUE, None)])
def test_sweep_contains_the_moving_neighbour_and_little_more(
    side: str, kind: str, ends: tuple[float, float], shape: Shape[Any], outside: Callable[[Array], Array] | None,
) -> None:
    """At random positions of the joint, points of the neighbour are inside of the sweep. Each corner of the sweep is near the neighbour at
    some position of the joint, if the neighbour is a prism along the axis. The sweep is about the own mount, which is the mount of the
    parent or of the child, with the same range."""
    si = radians if kind == "revolute" else (lambda mm: mm / 1e3)
    own, other = (PARENT, CHILD) if side == "parent" else (CHILD, PARENT)

    def seen(q: float) -> Array:
        """The pose of the neighbour's mount in the own frame."""
        at = relative(kind, si(q))
        return np.asarray((at if side == "parent" else np.linalg.inv(at)) @ in_mm(other))

    limits = {"turn" if kind == "revolute" else "slide": ends}
    result = MountPoint(own).sweep(located(shape, seen(0.0)), tolerance=TOLERANCE, **limits)  # type: ignore[arg-type]
    assert isinstance(result, Solid) and result.is_valid
    random = np.random.default_rng(0)
    surface = np.array([tuple(corner) for corner in shape.tessellate(0.01, 0.3)[0]])
    for q in [*ends, *random.uniform(*ends, 6)]:
        for point in random.permutation(surface)[:6]:
            x, y, z = (seen(q) @ [*point, 1.0])[:3]
            assert result.is_inside((x, y, z), 1e-6) or result.distance_to(Vertex(x, y, z)) < TOLERANCE / 2.0
    if outside is not None:
        corners = np.array([[*corner, 1.0] for corner in result.vertices()])
        gaps = [outside((corners @ np.linalg.inv(seen(q)).T)[:, :3]) for q in np.linspace(*ends, 400)]
        assert np.min(gaps, axis=0).max() < TOLERANCE


def test_sweep_of_a_full_turn_has_a_core() -> None:
    """A box between 4 and 6 mm from the axis moves in a ring. Its far corners are hypot(6, 1) from the axis, and the near side 4 mm."""
    ring = MountPoint(Location()).sweep(Pos(5, 0, 0) * Box(2, 2, 3), turn=(-180, 180), tolerance=0.02)
    assert ring.volume == pytest.approx(3 * pi * (37 - 16), rel=2e-2)
    assert not ring.is_inside((3.9, 0, 0)) and ring.is_inside((-5, 0, 1.4)) and not ring.is_inside((-5, 0, 1.6))


def test_sweep_of_a_small_turn_has_no_hole() -> None:
    plate = MountPoint(Location()).sweep(Box(20, 20, 3), turn=(-1, 1))
    assert plate.is_inside((0, 0, 0)) and 1200.0 < plate.volume < 1.05 * 1200.0


def test_hulls_contain_a_turning_edge() -> None:
    """At any angle, each point of an edge is in one of the hulls, which extend beyond the edge at some angle by at most the error."""
    edge, error, angles = np.array([[8.0, -3.0], [11.0, 4.0]]), 0.1, np.linspace(10, 60, 301)
    paths = list(_paths([edge], (10.0, 60.0), error))
    turned = [np.array([[cos(q), sin(q)], [-sin(q), cos(q)]]) for q in map(radians, angles)]
    points = np.concatenate([np.linspace(*edge, 40) @ turn for turn in turned])
    assert np.min([(points @ hull[:, :2].T + hull[:, 2]).max(axis=1) for hull in map(_half_planes, paths)], axis=0).max() < 1e-9
    (low, high), corners = edge, np.concatenate(paths)
    gaps = []
    for turn in turned:
        local = corners @ turn.T - low
        along = np.clip(local @ (high - low) / ((high - low) @ (high - low)), 0.0, 1.0)
        gaps.append(np.linalg.norm(local - along[:, None] * (high - low), axis=1))
    assert np.min(gaps, axis=0).max() < error


def _half_planes(points: Array) -> Array:
    """The rows n, d of the half planes n x + d <= 0 whose intersection is the convex hull of points `(n, 2)`."""
    return np.asarray(ConvexHull(points).equations)


@pytest.mark.parametrize(("shapes", "ranges", "message"), [
    (BOX, {}, "increasing range `turn` or `slide`"), (BOX, {"turn": (0, 9), "slide": (0, 9)}, "increasing range `turn` or `slide`"),
    (BOX, {"turn": (90, -90)}, "requires an increasing range"), (BOX.faces()[0], {"turn": (0, 9)}, "requires shapes with solids"),
])
def test_wrong_arguments_are_refused(shapes: Shape[Any], ranges: dict[str, tuple[float, float]], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        MountPoint(Location()).sweep(shapes, **ranges)  # type: ignore[arg-type]
