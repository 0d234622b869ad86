"""Small physical changes of a robot, and the invariants of its links that prove that a change is physical."""

from __future__ import annotations

import copy
import itertools
import random

import numpy as np

from same.disguises import BALL, HINGE, SLIDE, Array, Axis, Graph, moved, pose

SIZE = 1e-4
"""The size of a change: m, rad, or a fraction of a mass or inertia."""
KINDS = ("mass", "inertia", "centre", "position", "angle", "coupling")


def changed(graph: Graph, draw: random.Random, kind: str) -> Graph | None:
    """Return a robot with one physical change of this kind, or None if this robot has no such change."""
    before = invariants(graph)
    for _ in range(30):
        new = copy.deepcopy(graph)
        massive = [body for body in new.bodies.values() if body.mass > 0.0]
        joined = [edge for edge in new.edges if edge.axes]
        coupled = [axis for axis in new.axes() if axis.follows is not None]
        direction = np.array([draw.gauss(0, 1) for _ in range(3)])
        direction /= np.linalg.norm(direction)
        match kind:
            case "mass" if massive:
                draw.choice(massive).mass *= 1.0 + SIZE
            case "inertia" if massive:
                body = draw.choice(massive)
                body.inertia = body.inertia * (1.0 + SIZE)
            case "centre" if massive:
                body = draw.choice(massive)
                body.centre = body.centre + SIZE * direction
            case "position" if joined:
                edge = draw.choice(joined)
                edge.pose = pose(np.eye(3), SIZE * direction) @ edge.pose
            case "angle" if joined:
                edge = draw.choice(joined)
                away = edge.pose[:3, 3].copy()
                x, y, z = SIZE * direction
                turn = np.eye(3) + np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
                edge.pose[:3, :3] = np.linalg.qr(turn @ edge.pose[:3, :3])[0] @ np.diag(_signs(turn @ edge.pose[:3, :3]))
                edge.pose[:3, 3] = away
            case "coupling" if coupled:
                axis = draw.choice(coupled)
                assert axis.follows is not None
                axis.follows[1][1] += SIZE
                return new
            case _:
                return None
        after = invariants(new)
        if max((abs(a - b) for a, b in zip(before, after, strict=True)), default=0.0) > SIZE / 2.0:
            return new
    return None


def _signs(rows: Array) -> Array:
    return np.sign(np.diag(np.linalg.qr(rows)[1]))


def invariants(graph: Graph) -> list[float]:
    """Return numbers that do not depend on roots, names, frames, zeros or signs, scaled so that 1e-4 is a change of 1e-4."""
    found: list[float] = []
    for body in graph.bodies.values():
        moments = np.linalg.eigvalsh(body.inertia)
        found += [float(np.log(body.mass)) if body.mass > 0.0 else 0.0, *map(float, np.log(np.maximum(moments, 1e-300)))]
        lines = list(_lines(graph, body.name))
        for one, other in itertools.permutations(lines, 2):
            found += _between(one, other)
        for line in lines if body.mass > 0.0 else ():
            if line.kind == HINGE:
                found.append(_distance(line, body.centre))
                found += [_along(line, other) - float((body.centre - line.anchor) @ line.axis) for other in lines if _crosses(line, other)]
    for edge in graph.edges:
        found += [abs(float(a.axis @ b.axis)) for a, b in itertools.pairwise(edge.axes)]
    return found


def _lines(graph: Graph, name: str) -> list[Axis]:
    """Return the axes that are fixed in a body, in its frame."""
    found = []
    for edge in graph.edges:
        if edge.child == name and edge.axes:
            found.append(edge.axes[-1])
        if edge.parent == name and edge.axes:
            first = edge.axes[0]
            found.append(Axis(first.name, first.kind, edge.pose[:3, :3] @ first.axis, moved(edge.pose, first.anchor)))
    return [line for line in found if line.kind != BALL]


def _between(one: Axis, other: Axis) -> list[float]:
    across = np.cross(one.axis, other.axis)
    sine = float(np.linalg.norm(across))
    values = [float(np.arctan2(sine, abs(one.axis @ other.axis)))]
    if SLIDE in (one.kind, other.kind):
        return values
    away = other.anchor - one.anchor
    return [*values, abs(float(away @ across)) / sine if sine > 0.1 else _distance(one, other.anchor)]


def _crosses(one: Axis, other: Axis) -> bool:
    return other.kind == HINGE and float(np.linalg.norm(np.cross(one.axis, other.axis))) > 0.1


def _along(line: Axis, other: Axis) -> float:
    """Return the position on a line that is nearest to another line, from the anchor."""
    across = other.axis - (other.axis @ line.axis) * line.axis
    away = other.anchor - line.anchor
    return float((away - (away @ across) / (across @ across) * other.axis) @ line.axis)


def _distance(line: Axis, point: Array) -> float:
    return float(np.linalg.norm(np.cross(point - line.anchor, line.axis)))
