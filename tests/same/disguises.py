"""A robot as a graph of bodies, its disguises, and small physical changes. None of it uses the code that `thingc same` uses.

A `Graph` is read from a compiled MuJoCo model and written as MJCF or URDF. A disguise has another root, other names, other body frames,
other joint zeros and signs, and some bodies are split into two bodies that are fixed to each other.
"""

from __future__ import annotations

import copy
import math
import random
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field

import mujoco
import numpy as np

Array = np.ndarray
HINGE, SLIDE, BALL = "hinge", "slide", "ball"


@dataclass
class Axis:
    """A joint coordinate: its axis and anchor in the frame of the child body, its range, and the polynomial of the joint it follows."""

    name: str
    kind: str
    axis: Array
    anchor: Array
    range: tuple[float, float] | None = None
    follows: tuple[str, list[float]] | None = None


@dataclass
class Body:
    """A rigid body with mass, centre and inertia about the centre, in its own frame. `fixed` is the body that it is a part of."""

    name: str
    mass: float
    centre: Array
    inertia: Array
    fixed: tuple[str, Array] | None = None


@dataclass
class Edge:
    """The joint between two bodies: the pose of the child is `pose @ exp(axis_0 q_0) @ exp(axis_1 q_1) ...`."""

    parent: str
    child: str
    pose: Array
    axes: list[Axis]


@dataclass
class Graph:
    """Bodies, edges of a tree, and pairs of points that equality constraints connect."""

    bodies: dict[str, Body]
    edges: list[Edge]
    connects: list[tuple[str, Array, str, Array]] = field(default_factory=list)

    def axes(self) -> Iterator[Axis]:
        """Yield all joint coordinates."""
        return (axis for edge in self.edges for axis in edge.axes)


# --- reading -----------------------------------------------------------------------------------------------------------------------


def read(model: mujoco.MjModel) -> Graph:
    """Read the bodies and joints of a model. A free joint of the root body is ignored, and so are smaller robots that float beside it."""
    names = [model.body(n).name for n in range(model.nbody)]
    graph = Graph({}, [])
    sizes = Counter(model.body_rootid[1:].tolist())
    floating = {int(model.jnt_bodyid[j]) for j in range(model.njnt) if model.jnt_type[j] == 0}
    beside = {top for top in floating if sizes[top] < max(sizes.values())}
    for n in (one for one in range(1, model.nbody) if model.body_rootid[one] not in beside):
        turn = matrix(model.body_iquat[n])
        inertia = turn @ np.diag(model.body_inertia[n]) @ turn.T
        graph.bodies[names[n]] = Body(names[n], float(model.body_mass[n]), model.body_ipos[n].copy(), inertia)
        if (parent := int(model.body_parentid[n])) > 0:
            axes = [axis_of(model, j) for j in range(model.njnt) if model.jnt_bodyid[j] == n]
            graph.edges.append(Edge(names[parent], names[n], pose(matrix(model.body_quat[n]), model.body_pos[n]), axes))
        elif any(model.jnt_bodyid[j] == n and model.jnt_type[j] != 0 for j in range(model.njnt)):
            raise ValueError("the root moves relative to the world")
    if len(sizes.keys() - beside) != 1:
        raise ValueError("several bodies in the world")
    known = {axis.name: axis for axis in graph.axes()}
    for n in range(model.neq):
        one, other = int(model.eq_obj1id[n]), int(model.eq_obj2id[n])
        if model.eq_type[n] == 2:
            known[model.joint(one).name].follows = (model.joint(other).name, [float(c) for c in model.eq_data[n][:5]])
        elif model.eq_type[n] == 0 and model.eq_objtype[n] == mujoco.mjtObj.mjOBJ_SITE:
            ends = [(names[int(model.site_bodyid[s])], model.site_pos[s].copy()) for s in (one, other)]
            graph.connects.append((*ends[0], *ends[1]))
        else:
            raise ValueError("an equality that this study does not write")
    return graph


def axis_of(model: mujoco.MjModel, j: int) -> Axis:
    """Read one joint."""
    limited = (float(model.jnt_range[j][0]), float(model.jnt_range[j][1])) if model.jnt_limited[j] else None
    kind = {1: BALL, 2: SLIDE, 3: HINGE}[int(model.jnt_type[j])]
    return Axis(model.joint(j).name, kind, model.jnt_axis[j].copy(), model.jnt_pos[j].copy(), limited)


# --- geometry ----------------------------------------------------------------------------------------------------------------------


def matrix(quaternion: Array) -> Array:
    """Return the rotation matrix of a quaternion."""
    rows = np.zeros(9)
    mujoco.mju_quat2Mat(rows, np.asarray(quaternion, dtype=float) / np.linalg.norm(quaternion))
    return rows.reshape(3, 3)


def quaternion(rotation: Array) -> Array:
    """Return the quaternion of a rotation matrix."""
    result = np.zeros(4)
    mujoco.mju_mat2Quat(result, np.ascontiguousarray(rotation).ravel())
    return result


def pose(rotation: Array, position: Array) -> Array:
    """Return a pose as a 4 x 4 matrix."""
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = rotation, position
    return X


def moved(X: Array, point: Array) -> Array:
    """Return a point in the outer frame of a pose."""
    return X[:3, :3] @ point + X[:3, 3]


def motion(axis: Axis, q: float) -> Array:
    """Return the pose of a motion along or about an axis."""
    if axis.kind == SLIDE:
        return pose(np.eye(3), q * axis.axis)
    half = np.array([math.cos(q / 2.0), *(math.sin(q / 2.0) * axis.axis)])
    R = matrix(half)
    return pose(R, axis.anchor - R @ axis.anchor)


def random_pose(draw: random.Random, size: float) -> Array:
    """Return a random pose."""
    return pose(matrix(np.array([draw.gauss(0, 1) for _ in range(4)])), np.array([draw.uniform(-size, size) for _ in range(3)]))


# --- disguises ---------------------------------------------------------------------------------------------------------------------


@dataclass
class Disguise:
    """A disguised robot, and the true map: names of bodies and joints, and `q_B = sign q_A + zero` for each joint."""

    graph: Graph
    root: str
    bodies: dict[str, str]
    joints: dict[str, tuple[str, int, float]]


def disguised(graph: Graph, draw: random.Random) -> Disguise:
    """Return a random disguise of a robot."""
    new = copy.deepcopy(graph)
    truth = {axis.name: (1, 0.0) for axis in new.axes()}
    for edge in new.edges:
        for n, axis in enumerate(edge.axes):
            if axis.kind != BALL and draw.random() < 0.7:
                truth[axis.name] = move_zero(new, edge, n, draw)
    for name in list(new.bodies):
        move_frame(new, name, random_pose(draw, 0.3))
    for axis in new.axes():
        if axis.kind == HINGE:
            axis.anchor = axis.anchor + draw.uniform(-0.3, 0.3) * axis.axis
    root = rerooted(new, draw)
    for name in list(new.bodies):
        if new.bodies[name].mass > 0.0 and draw.random() < 0.3:
            split(new, name, draw)
    return renamed(new, root, truth, draw)


def move_zero(graph: Graph, edge: Edge, n: int, draw: random.Random) -> tuple[int, float]:
    """Change the sign and the zero of a joint coordinate, with its range and all couplings. Return both."""
    axis = edge.axes[n]
    sign = draw.choice((1, -1))
    zero = draw.uniform(-2.0, 2.0) if axis.kind == HINGE else draw.uniform(-0.1, 0.1)
    # exp(t q) = exp(sign t (q' - zero)): the constant part moves to the left, before all motions of this edge
    constant = motion(axis, -sign * zero)
    axis.axis = sign * axis.axis
    for one in edge.axes[:n]:
        back = np.linalg.inv(constant)
        one.axis, one.anchor = back[:3, :3] @ one.axis, moved(back, one.anchor)
    edge.pose = edge.pose @ constant
    if axis.range is not None:
        low, high = sorted(sign * end + zero for end in axis.range)
        axis.range = (low, high)
    for other in graph.axes():
        if other.follows is not None and other.follows[0] == axis.name:
            other.follows = (axis.name, composed(other.follows[1], sign, zero))
    if axis.follows is not None:
        leader, polynomial = axis.follows
        axis.follows = (leader, [sign * c + (zero if k == 0 else 0.0) for k, c in enumerate(polynomial)])
    return sign, zero


def composed(polynomial: list[float], sign: int, zero: float) -> list[float]:
    """Return the polynomial p(sign (x - zero)) of x."""
    line = np.polynomial.Polynomial([-sign * zero, sign])
    found = np.polynomial.Polynomial(polynomial)(line)
    return [*map(float, found.coef), *[0.0] * (5 - len(found.coef))]


def move_frame(graph: Graph, name: str, G: Array) -> None:
    """Move the frame of a body: `G` is the pose of the new frame in the old frame."""
    back = np.linalg.inv(G)
    body = graph.bodies[name]
    body.centre, body.inertia = moved(back, body.centre), back[:3, :3] @ body.inertia @ back[:3, :3].T
    for edge in graph.edges:
        if edge.parent == name:
            edge.pose = back @ edge.pose
        if edge.child == name:
            edge.pose = edge.pose @ G
            for axis in edge.axes:
                axis.axis, axis.anchor = back[:3, :3] @ axis.axis, moved(back, axis.anchor)
    graph.connects = [
        (a, moved(back, p) if a == name else p, b, moved(back, q) if b == name else q) for a, p, b, q in graph.connects
    ]


def rerooted(graph: Graph, draw: random.Random) -> str:
    """Reverse edges so that a random body is the root. MuJoCo requires inertias of all bodies but the root."""
    children = {edge.child for edge in graph.edges}
    root = next(name for name in graph.bodies if name not in children)
    balls = any(axis.kind == BALL for axis in graph.axes())
    if balls or any(np.linalg.eigvalsh(body.inertia)[0] < 1e-14 for body in graph.bodies.values()):
        return root
    root = draw.choice(list(graph.bodies))
    met, edges, waiting = {root}, [], [root]
    while waiting:
        here = waiting.pop()
        for edge in graph.edges:
            if here in (edge.parent, edge.child) and (there := edge.child if edge.parent == here else edge.parent) not in met:
                met.add(there)
                waiting.append(there)
                edges.append(edge if edge.parent == here else reversed_edge(edge))
    graph.edges = edges
    return root


def reversed_edge(edge: Edge) -> Edge:
    """Exchange parent and child: `inv(X0 exp(t_0 q_0) exp(t_1 q_1)) = inv(X0) exp(-X0 t_1 q_1) exp(-X0 t_0 q_0)`, each in the frame X0."""
    X = edge.pose
    axes = [
        Axis(axis.name, axis.kind, -(X[:3, :3] @ axis.axis), moved(X, axis.anchor), axis.range, axis.follows) for axis in edge.axes[::-1]
    ]
    return Edge(edge.child, edge.parent, np.linalg.inv(X), axes)


def split(graph: Graph, name: str, draw: random.Random) -> None:
    """Split a body into two bodies that are fixed to each other, with the same total mass, centre and inertia."""
    body = graph.bodies[name]
    share = draw.uniform(0.3, 0.7)
    size = math.sqrt(np.trace(body.inertia) / body.mass)
    away = 0.02 * size * np.array([draw.gauss(0, 1) for _ in range(3)])
    one, other = away * (1.0 - share), -away * share
    rest = body.inertia - body.mass * (share * steiner(one) + (1.0 - share) * steiner(other))
    low, middle, high = np.linalg.eigvalsh(rest)
    if low <= 0.0 or high > 0.999 * (low + middle):
        one, other, rest = 0.0 * one, 0.0 * other, body.inertia
    X = random_pose(draw, 0.1)
    back = np.linalg.inv(X)
    part = Body(
        name + "_part", body.mass * (1.0 - share), moved(back, body.centre + other), back[:3, :3] @ rest @ back[:3, :3].T * (1.0 - share),
        fixed=(name, X),
    )
    graph.bodies[name] = Body(name, body.mass * share, body.centre + one, rest * share)
    graph.bodies[part.name] = part
    for edge in graph.edges:  # some of the next joints are on the second part
        if edge.parent == name and draw.random() < 0.5:
            edge.parent, edge.pose = part.name, back @ edge.pose


def steiner(away: Array) -> Array:
    """Return the inertia of a unit mass at a point."""
    return float(away @ away) * np.eye(3) - np.outer(away, away)


def renamed(graph: Graph, root: str, truth: dict[str, tuple[int, float]], draw: random.Random) -> Disguise:
    """Give all bodies and joints random names, and shuffle their order."""
    words = draw.sample(range(1000, 9999), len(graph.bodies) + len(truth))
    bodies = {name: f"b{words.pop()}" for name in graph.bodies}
    joints = {name: f"j{words.pop()}" for name in truth}
    for body in graph.bodies.values():
        body.name = bodies[body.name]
        if body.fixed is not None:
            body.fixed = (bodies[body.fixed[0]], body.fixed[1])
    for edge in graph.edges:
        edge.parent, edge.child = bodies[edge.parent], bodies[edge.child]
        for axis in edge.axes:
            axis.name = joints[axis.name]
            if axis.follows is not None:
                axis.follows = (joints[axis.follows[0]], axis.follows[1])
    draw.shuffle(graph.edges)
    graph.connects = [(bodies[a], p, bodies[b], q) for a, p, b, q in graph.connects]
    graph.bodies = {body.name: body for body in graph.bodies.values()}
    return Disguise(graph, bodies[root], bodies, {name: (joints[name], *truth[name]) for name in truth})


# --- writing -----------------------------------------------------------------------------------------------------------------------


def words(*values: Array | float) -> str:
    """Return numbers with all their digits."""
    return " ".join(repr(float(x)) for value in values for x in np.ravel(value))


def moments(inertia: Array) -> list[float]:
    """Return the entries of an inertia in the order of MJCF and URDF."""
    return [float(inertia[i, j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]


def mjcf(graph: Graph, root: str, *, free: bool) -> str:
    """Write a robot as MJCF, with the names of bodies and joints."""
    lines = ['<mujoco><compiler angle="radian"/><worldbody>']

    def body(name: str, X: Array, axes: list[Axis]) -> None:
        own = graph.bodies[name]
        lines.append(f'<body name="{name}" pos="{words(X[:3, 3])}" quat="{words(quaternion(X[:3, :3]))}">')
        if name == root and free and own.mass > 0.0:
            lines.append("<freejoint/>")
        if own.mass > 0.0:
            full = words(*moments(own.inertia))
            lines.append(f'<inertial pos="{words(own.centre)}" mass="{words(own.mass)}" fullinertia="{full}"/>')
        for axis in axes:
            limits = "" if axis.range is None else f' range="{words(*axis.range)}" limited="true"'
            along = "" if axis.kind == BALL else f' axis="{words(axis.axis)}"'
            lines.append(f'<joint name="{axis.name}" type="{axis.kind}" pos="{words(axis.anchor)}"{along}{limits}/>')
        for n, (a, p, b, q) in enumerate(graph.connects):
            for end, at, point in (("a", a, p), ("b", b, q)):
                if at == name:
                    lines.append(f'<site name="c{n}{end}" pos="{words(point)}"/>')
        for part in graph.bodies.values():
            if part.fixed is not None and part.fixed[0] == name:
                body(part.name, part.fixed[1], [])
        for edge in graph.edges:
            if edge.parent == name:
                body(edge.child, edge.pose, edge.axes)
        lines.append("</body>")

    body(root, np.eye(4), [])
    lines.append("</worldbody><equality>")
    for axis in graph.axes():
        if axis.follows is not None:
            lines.append(f'<joint joint1="{axis.name}" joint2="{axis.follows[0]}" polycoef="{words(*axis.follows[1])}"/>')
    lines += [f'<connect site1="c{n}a" site2="c{n}b"/>' for n in range(len(graph.connects))]
    return "\n".join([*lines, "</equality></mujoco>", ""])


def urdf(graph: Graph, root: str) -> str | None:
    """Write a robot as URDF, or return None if URDF cannot express it. Frames of links move onto the axes of their joints."""
    if graph.connects or any(len(edge.axes) > 1 for edge in graph.edges) or any(axis.kind == BALL for axis in graph.axes()):
        return None
    if any(axis.follows is not None and any(axis.follows[1][2:]) for axis in graph.axes()):
        return None
    graph = copy.deepcopy(graph)
    lines = [f'<robot name="disguise"><link name="{root}"/>' if graph.bodies[root].mass == 0.0 else '<robot name="disguise">']
    for edge in graph.edges:
        if edge.axes and edge.axes[0].kind == HINGE:
            anchor = edge.axes[0].anchor
            shift = pose(np.eye(3), anchor)
            for part in graph.bodies.values():
                if part.fixed is not None and part.fixed[0] == edge.child:
                    part.fixed = (edge.child, np.linalg.inv(shift) @ part.fixed[1])
            move_frame(graph, edge.child, shift)
    for body in graph.bodies.values():
        if body.mass > 0.0:
            keys = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
            values = " ".join(f'{key}="{words(value)}"' for key, value in zip(keys, moments(body.inertia), strict=True))
            lines.append(f'<link name="{body.name}"><inertial><origin xyz="{words(body.centre)}"/>')
            lines.append(f'<mass value="{words(body.mass)}"/><inertia {values}/></inertial></link>')
        elif body.name != root:
            lines.append(f'<link name="{body.name}"/>')
        if body.fixed is not None:
            lines.append(f'<joint name="f_{body.name}" type="fixed"><parent link="{body.fixed[0]}"/><child link="{body.name}"/>')
            lines.append(f"{origin(body.fixed[1])}</joint>")
    for edge in graph.edges:
        axis = edge.axes[0] if edge.axes else Axis(f"f_{edge.child}", "fixed", np.array([1.0, 0.0, 0.0]), np.zeros(3))
        kind = {HINGE: "continuous" if axis.range is None else "revolute", SLIDE: "prismatic"}.get(axis.kind, "fixed")
        low, high = axis.range or (-1000.0, 1000.0)
        limit = "" if kind in ("continuous", "fixed") else f'<limit lower="{words(low)}" upper="{words(high)}" effort="10" velocity="10"/>'
        mimic = ""
        if axis.follows is not None:
            leader, (offset, multiplier, *_) = axis.follows
            mimic = f'<mimic joint="{leader}" multiplier="{words(multiplier)}" offset="{words(offset)}"/>'
        lines.append(f'<joint name="{axis.name}" type="{kind}"><parent link="{edge.parent}"/><child link="{edge.child}"/>')
        lines.append(f'{origin(edge.pose)}<axis xyz="{words(axis.axis)}"/>{limit}{mimic}</joint>')
    return "\n".join([*lines, "</robot>", ""])


def origin(X: Array) -> str:
    """Write a pose as an `<origin>` of URDF."""
    R = X[:3, :3]
    pitch = math.atan2(-R[2, 0], math.hypot(R[0, 0], R[1, 0]))
    rpy = (math.atan2(R[2, 1], R[2, 2]), pitch, math.atan2(R[1, 0], R[0, 0]))
    return f'<origin xyz="{words(X[:3, 3])}" rpy="{words(*rpy)}"/>'
