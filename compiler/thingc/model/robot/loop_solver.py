"""Close loops by Newton's method: find joint coordinates for which all closures of a tree of bodies are satisfied.

The residual of a closure is a position p [m] and a rotation vector w [rad] in world axes. A is the frame on the parent, moved by the joint
that was cut, and B is the frame on the child:

    p = p_B - p_A,    w = R_A log(inv(R_A) R_B)

Steps are computed by the method of Levenberg and Marquardt (Marquardt, "An algorithm for least-squares estimation of nonlinear parameters",
1963). If the closures are underdetermined, the shortest step is computed. If they are overdetermined or unsolvable, the least-squares step
is computed. If a step would move a coordinate beyond a limit, the coordinate is set to the limit and the step is repeated with the other
coordinates. The module is pure Python, because importing numpy would slow down `check` and there are only a few equations.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence

from msgspec.structs import replace

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.grouping import group_by
from thingc.base.joints.twist import Twist, pose_after, velocities
from thingc.base.numeric import dist, hypot, inf, maximum, minimum, sum_of
from thingc.base.pose import IDENTITY, NO_POSE, Matrix, Pose, Vector, multiply, rotate, transpose, turn_of, turned_about
from thingc.model.assembly.kinematics import balls, bent, coordinates, in_cones, leaders
from thingc.model.assembly.types import JointEdge
from thingc.model.robot.kinematics import body_pose, in_world, with_ancestors
from thingc.model.robot.least_squares import solve
from thingc.model.robot.types import Body, Closure

CLOSED, ALIGNED = 1e-7, 1e-6
"""Largest position error [m] and rotation error [rad] of a loop that counts as closed.

Newton's method usually reaches errors of 1e-15. In a planar linkage, however, the document's numbers are often rounded to 6 or 9 digits,
and errors perpendicular to the plane cannot be corrected.
"""

FREE = 100.0
"""In `nearest`, coordinates without given values can move farther by this factor than other coordinates, at the same cost."""

SAMPLES = 50
"""Number of positions of a leader that are sampled in each direction, to check the limits of a joint that mimics the leader by a
polynomial.
"""

PROJECTION, NEAR, GAIN = 1e-10, 1e-9, 1e-4
"""Constants of `nearest`: damping, size of a step that counts as converged [rad], and smallest relative decrease of the squared distance.
"""

STEPS = 120
"""Maximum number of steps of the solver."""

REACH = 0.5
"""Longest step of a rotation [rad]. For translations and for the base, the limit is proportional. The linear model is inaccurate for longer
steps.
"""

TRUST = 0.25
"""If the error decreases by less than this fraction of the decrease that the linear model predicts, the step was too long. Longer steps may
oscillate across a valley.
"""

ROUNDING = 1e-13
"""If the error decreases by less than this relative value, the step counts as a step without progress.

A step without progress is repeated with more damping, which turns the step towards the steepest descent. Such a step can move two joints to
their limits although in the solution only one joint is at its limit.
"""


class SolverState(FrozenStruct):
    """The state of the loop solver: the positions q [rad or m] of all joints, keyed by path, and the pose of the root link in the world."""

    q: dict[str, float]
    base: Pose


class Solution(FrozenStruct):
    """The result of the loop solver: the final state, and the position error |p| [m] and rotation error |w| [rad] of every loop closure."""

    state: SolverState
    residuals: tuple[tuple[float, float], ...]

    @property
    def closed(self) -> bool:
        """Whether all loops are closed within the tolerances."""
        return all(p <= CLOSED and w <= ALIGNED for p, w in self.residuals)

    @property
    def residual(self) -> tuple[float, float]:
        """The largest position error |p| [m] and the largest rotation error |w| [rad] of all loops."""
        return maximum((p for p, _ in self.residuals), default=0.0), maximum((w for _, w in self.residuals), default=0.0)


class LoopCoordinate(FrozenStruct):
    """An independent coordinate of the solver, which moves one joint and all joints that mimic it.

    The limits [rad or m] of the coordinate are the range in which all these joints are within their limits. `moves` contains pairs of a
    joint path and dq / dcoordinate. Polynomials are linearized at leaders = 0. `unit` is the length [m] that corresponds to a rotation of
    1 rad. For a rotation, `unit` is 1.
    """

    path: str
    moves: tuple[tuple[str, float], ...]
    lower: float
    upper: float
    unit: float


class Loops:
    """The loop closures of a kinematic tree, with methods that close the loops numerically.

    `joints` contains the coordinates of all joints of the robot.
    """

    def __init__(self, bodies: Sequence[Body], closures: Sequence[Closure], joints: Sequence[JointEdge], base: Pose) -> None:
        self.bodies = bodies
        self.closures = closures
        self.joints = {joint.path: joint for joint in joints}
        self.base = base
        self._balls = tuple(balls(joints))
        self._ends = [(tuple(with_ancestors(bodies, c.parent)), tuple(with_ancestors(bodies, c.child))) for c in closures]
        self._needed = sorted({body for pair in self._ends for chain in pair for body in chain})
        self.length = self._extent()
        self.coordinates = tuple(_coordinates(self.joints, self.length))
        self._moves = {path: (c.path, share) for c in self.coordinates for path, share in c.moves}
        self._bent = bent(joints)

    def follows(self, q: Mapping[str, float]) -> Mapping[str, tuple[str, float]]:
        """For each joint, return the independent coordinate that moves the joint, and the ratio of their speeds.

        For a joint that mimics another joint, this is the coordinate of its leader. `q` maps the paths of all joints to positions [rad or
        m].
        """
        if not self._bent:
            return self._moves
        return {path: (leader, share) for path, (leader, share, _) in leaders(self.joints.values(), q).items()}

    @property
    def outside(self) -> frozenset[str]:
        """The paths of the joints whose motion does not change the errors of the loops."""
        joint_lists = (*(self.bodies[body].joints for body in self._needed), *(closure.joints for closure in self.closures))
        loop_joints = [joint.path for joints in joint_lists for joint in joints]
        loop_leaders = {self._moves[path][0] for path in loop_joints if path in self._moves}
        return frozenset(path for path, (leader, _) in self._moves.items() if leader not in loop_leaders)

    def alone(self, q: Mapping[str, float]) -> Loops:
        """Return a copy of the loops without the joints whose motion does not influence the closure of loops.

        The limits of these joints are removed. If one of these joints is outside its limits at `q`, return the loops unchanged.
        """
        outside = self.outside
        if not all(c.lower <= q[c.path] <= c.upper for c in self.coordinates if c.path in outside):
            return self
        bodies = [body if k in self._needed else replace(body, X_PL=NO_POSE, joints=()) for k, body in enumerate(self.bodies)]
        free = {path: replace(joint, limit=replace(joint.limit, lower=None, upper=None)) for path, joint in self.joints.items()}
        return Loops(bodies, self.closures, [free[path] if path in outside else joint for path, joint in self.joints.items()], self.base)

    def _extent(self) -> float:
        """Return the size [m] of the robot, which scales translations in the solver.

        The size is the largest distance at q = 0 of any body on a loop from the mean position of these bodies.

        The size does not depend on the root. A translation by this size counts as much as a rotation of 1 rad.
        """
        link_poses = self._link_poses(SolverState(q=dict.fromkeys(self.joints, 0.0), base=NO_POSE))
        points = [link_poses[body].translation for body in self._needed]
        points += [link_poses[c.child].apply(c.X_CB.translation) for c in self.closures]
        if not points:
            return 1.0
        mean = [sum_of(place[k] for place in points) / len(points) for k in range(3)]
        radius = maximum(dist(place, mean) for place in points)
        return radius if radius > 0.0 else 1.0

    def _link_poses(self, state: SolverState) -> dict[int, Pose]:
        poses: dict[int, Pose] = {}
        for index in self._needed:
            body = self.bodies[index]
            poses[index] = state.base if body.parent is None else body_pose(body, poses[body.parent], state.q)
        return poses

    def _frames(self, closure: Closure, link_poses: Mapping[int, Pose], q: Mapping[str, float]) -> tuple[Pose, Pose]:
        """Compute the two frames of a loop closure in the world: A on the parent body, and B on the child body.

        A is moved by the joints at which the loop was cut.
        """
        A = closure.X_PA if closure.parent is None else link_poses[closure.parent] @ closure.X_PA
        if closure.at_once:
            A = A @ pose_after(closure.twists, tuple(q[joint.path] for joint in closure.joints), at_once=True)
        else:
            for joint, twist in zip(closure.joints, closure.twists, strict=True):
                A = A @ twist.exponential(q[joint.path])
        return A, link_poses[closure.child] @ closure.X_CB

    def residuals(self, state: SolverState) -> tuple[tuple[float, float], ...]:
        """Compute the position error |p| [m] and the rotation error |w| [rad] of every loop closure."""
        return tuple((hypot(*p), hypot(*w)) for p, w in self._errors(state))

    def are_closed(self, state: SolverState) -> bool:
        """Return whether all loops are closed in this state, within the tolerances for position and rotation."""
        return Solution(state=state, residuals=self.residuals(state)).closed

    def _errors(self, state: SolverState) -> list[tuple[Vector, Vector]]:
        """Return the position error p [m] and the rotation error w [rad] of every closure, in world axes.

        For a loop that is cut at a ball joint, w is omitted.
        """
        link_poses = self._link_poses(state)
        errors = [_error(*self._frames(closure, link_poses, state.q)) for closure in self.closures]
        return [(p, (0.0, 0.0, 0.0) if closure.turns else w) for closure, (p, w) in zip(self.closures, errors, strict=True)]

    def linearize(self, state: SolverState, *, base_moves: bool = False) -> tuple[list[float], list[list[float]]]:
        """Return the residuals of all closures in one list, and the derivatives of the residuals by `coordinates`.

        For each closure, the list contains p [m] and then w [rad]. The coordinates are in rad or m. With `base_moves`, the result also
        contains the derivatives by three translations of the base (in units of the robot's size) and by three rotations.

        The derivatives are exact if the loops are closed. For open loops, the common rotation of p and w is neglected, which changes
        neither |p| nor |w|.
        """
        sizes = [1.0, 1.0, 1.0, self.length, self.length, self.length] * len(self.closures)
        error = [value / size for value, size in zip(self._stack_errors(state), sizes, strict=True)]
        columns = self._columns(state, self.coordinates, base_moves)
        units = [c.unit for c in self.coordinates] + [1.0] * (len(columns) - len(self.coordinates))
        return error, [
            [value / (size * unit) for value, size in zip(column, sizes, strict=True)]
            for unit, column in zip(units, columns, strict=True)
        ]

    def close(self, start: SolverState, movable: Collection[str] | None, *, base_moves: bool) -> Solution:
        """Close the loops by Newton steps, beginning with the state `start`.

        Return the closed state, or the state with the smallest error that was reached.

        `movable` contains the paths of joints that can move (None: all joints). With `base_moves`, the root link can also move.
        """
        chosen = [c for c in self.coordinates if movable is None or c.path in movable]
        to_limits = [(minimum(maximum(start.q[c.path], c.lower), c.upper) - start.q[c.path]) / c.unit for c in chosen]
        state = self._move(start, chosen, to_limits, False)
        error = self._stack_errors(state)
        cost = _square(error)
        damping = 1e-6
        for _ in range(STEPS):
            if cost <= 1e-32 or not (chosen or base_moves):
                break
            columns = self._columns(state, chosen, base_moves)
            accepted = None
            while accepted is None and damping < 1e6:
                step = self._step(state, chosen, columns, error, damping)
                new_state = None if step is None else self._move(state, chosen, step, base_moves)
                if step is not None and new_state is not None:
                    new_error = self._stack_errors(new_state)
                    decrease, predicted = cost - _square(new_error), cost - _square(_linear(error, columns, step))
                    if decrease > ROUNDING * cost and decrease >= TRUST * predicted:
                        accepted = new_state, new_error
                damping = maximum(damping * 0.1, 1e-14) if accepted is not None else damping * 10.0
            if accepted is None:
                break
            state, error = accepted
            cost = _square(error)
        return Solution(state=state, residuals=self.residuals(state))

    def nearest(self, start: SolverState, closed: Solution, given_paths: Collection[str], *, base_moves: bool) -> Solution:
        """Find the state with closed loops that is nearest to `start`, beginning with the solution `closed`.

        The squared distance is a sum over the coordinates whose paths are in `given_paths`. Rotations are measured in rad, and translations
        in units of the robot's size. The method uses Gauss-Newton steps for a constrained least-squares problem, and tries shorter steps
        if the steps do not converge.
        """
        known = self.distance(start, closed.state, given_paths)
        weighted = [c if c.path in given_paths else replace(c, unit=FREE * c.unit) for c in self.coordinates]
        for share in (1.0, 0.3, 0.1):
            state = closed.state
            for _ in range(STEPS):
                columns = self._columns(state, weighted, base_moves)
                to_start = [(start.q[c.path] - state.q[c.path]) / c.unit if c.path in given_paths else 0.0 for c in weighted]
                to_start += [0.0] * (len(columns) - len(to_start))
                step = self._step(state, weighted, columns, self._stack_errors(state), PROJECTION, to_start)
                if step is None or maximum(map(abs, step)) < NEAR:
                    break
                state = self._move(state, weighted, [share * value for value in step], base_moves)
            else:
                continue
            candidate = self.close(state, None, base_moves=base_moves)
            distance = self.distance(start, candidate.state, given_paths)
            if candidate.closed and distance < (1.0 + GAIN) * known:
                return candidate if distance < (1.0 - GAIN) * known else closed
        return closed

    def distance(self, start: SolverState, state: SolverState, given_paths: Collection[str]) -> float:
        """Return the squared distance between a state and the start state, which the method `nearest` minimizes."""
        return sum_of(((start.q[c.path] - state.q[c.path]) / c.unit) ** 2 for c in self.coordinates if c.path in given_paths)

    def _stack_errors(self, state: SolverState) -> list[float]:
        """Return the position and rotation errors of all loop closures in one list [m].

        Rotation errors are multiplied by the size of the robot.
        """
        stacked: list[float] = []
        for p, w in self._errors(state):
            stacked.extend(p)
            stacked.extend(self.length * component for component in w)
        return stacked

    def _columns(self, state: SolverState, chosen: Sequence[LoopCoordinate], base_moves: bool) -> list[list[float]]:
        """Return the derivatives of the loop errors with respect to each joint coordinate, and then with respect to the motion of the base.

        The base has three translations (in units of the robot's size), and three rotations about the origin of the root link.
        """
        link_poses = self._link_poses(state)
        by_path: dict[str, list[float]] = {}
        zero = [0.0] * (6 * len(self.closures))
        for row, (closure, (parents, children)) in enumerate(zip(self.closures, self._ends, strict=True)):
            A, B = self._frames(closure, link_poses, state.q)
            for chain, end, sign in ((children, B, 1.0), (parents, A, -1.0)):
                other_chain = parents if sign > 0.0 else children
                for index in chain:
                    if index in other_chain:  # coordinates that move both ends do not change the residual
                        continue
                    for joint, twist in in_world(self.bodies[index], link_poses[index], state.q):
                        derivative = by_path.setdefault(joint.path, list(zero))
                        self._add(derivative, row, twist.velocity(end.translation), sign)
            values = tuple(state.q[cut.path] for cut in closure.joints)
            for number, twist in velocities(closure.twists, values, A, at_once=closure.at_once):
                derivative = by_path.setdefault(closure.joints[number].path, list(zero))
                self._add(derivative, row, twist.velocity(A.translation), -1.0)
        columns: list[list[float]] = []
        follows = self.follows(state.q)
        for coordinate in chosen:
            column = list(zero)
            for path, share in ((path, follows[path][1]) for path, _ in coordinate.moves):
                for k, value in enumerate(by_path.get(path, ())):
                    column[k] += share * coordinate.unit * value
            columns.append(column)
        if base_moves:
            origin = state.base.translation
            for twist in (*(Twist(linear=axis) for axis in IDENTITY), *(Twist(angular=axis, anchor=origin) for axis in IDENTITY)):
                column = list(zero)
                for row, closure in enumerate(self.closures):
                    if closure.parent is None:
                        point = self._frames(closure, link_poses, state.q)[1].translation
                        self._add(column, row, twist.velocity(point), 1.0 if twist.turns else self.length)
                columns.append(column)
        return columns

    def _add(self, column: list[float], closure: int, velocity: tuple[Vector, Vector], factor: float) -> None:
        linear, angular = velocity
        turned = 0.0 if self.closures[closure].turns else factor * self.length
        for k in range(3):
            column[6 * closure + k] += factor * linear[k]
            column[6 * closure + 3 + k] += turned * angular[k]

    def _step(
        self, state: SolverState, chosen: Sequence[LoopCoordinate], columns: Sequence[Sequence[float]], error: Sequence[float],
        damping: float, preferred: Sequence[float] | None = None,
    ) -> list[float] | None:
        """Return a damped least-squares step in the units of the coordinates.

        If the step is not unique, return the step nearest to `preferred`, or the shortest step if `preferred` is None. Return None if the
        equations are numerically singular.
        """
        preferred = [0.0] * len(columns) if preferred is None else preferred
        step = [0.0] * len(columns)
        free = [k for k, column in enumerate(columns) if any(column) or preferred[k]]
        remaining = list(error)
        while free:
            chosen_columns, preferred_free = [columns[k] for k in free], [preferred[k] for k in free]
            correction = solve(chosen_columns, _linear(remaining, chosen_columns, preferred_free), damping)
            if correction is None:
                return None
            changes = [value_preferred + change for value_preferred, change in zip(preferred_free, correction, strict=True)]
            beyond: dict[int, float] = {}
            for k, value in zip(free, changes, strict=True):
                if k < len(chosen):
                    coordinate = chosen[k]
                    q = state.q[coordinate.path]
                    low, high = (coordinate.lower - q) / coordinate.unit, (coordinate.upper - q) / coordinate.unit
                    if value < low or value > high:
                        beyond[k] = low if value < low else high
            if not beyond:
                for k, value in zip(free, changes, strict=True):
                    step[k] = value
                break
            for k, value in beyond.items():
                step[k] = value
                remaining = [e + value * c for e, c in zip(remaining, columns[k], strict=True)]
            free = [k for k in free if k not in beyond]
        longest = maximum((abs(value) for value in step), default=0.0)
        return step if longest <= REACH else [value * REACH / longest for value in step]

    def _move(self, state: SolverState, chosen: Sequence[LoopCoordinate], step: Sequence[float], base_moves: bool) -> SolverState:
        q = dict(state.q)
        for coordinate, value in zip(chosen, step):
            target = minimum(maximum(q[coordinate.path] + value * coordinate.unit, coordinate.lower), coordinate.upper)
            delta = target - q[coordinate.path]
            for path, share in coordinate.moves:
                q[path] = target if path == coordinate.path else q[path] + share * delta
        if self._bent:
            q = coordinates(self.joints.values(), {c.path: q[c.path] for c in self.coordinates})
        q |= in_cones(self._balls, q)
        base = state.base
        if base_moves:
            sx, sy, sz, rx, ry, rz = step[len(chosen):]
            t = base.translation
            place = (t[0] + self.length * sx, t[1] + self.length * sy, t[2] + self.length * sz)
            base = Pose(rotation=orthonormal(multiply(_turn((rx, ry, rz)), base.rotation)), translation=place)
        return SolverState(q=q, base=base)


def _coordinates(joints: Mapping[str, JointEdge], length: float) -> Iterator[LoopCoordinate]:
    """Yield an independent coordinate for every joint that does not mimic another joint, in the order of `joints`.

    The limits of a coordinate also respect the limits of the joints that mimic its joint.
    """
    followers = group_by(leaders(joints.values()).items(), lambda item: item[1][0])
    for path in (path for path in joints if path in followers):
        lower, upper = -inf, inf
        for follower, (_, multiplier, offset) in followers[path]:
            limit = joints[follower].limit
            low = -(inf if limit.cone is None else limit.cone) if limit.lower is None else limit.lower
            high = (inf if limit.cone is None else limit.cone) if limit.upper is None else limit.upper
            if bent(_chain(joints, follower)):
                low, high = _reach(joints, path, follower, low, high)
                multiplier, offset = 1.0, 0.0
            if multiplier == 0.0:
                continue
            ends = sorted(((low - offset) / multiplier, (high - offset) / multiplier))
            lower, upper = maximum(lower, ends[0]), minimum(upper, ends[1])
        moves = tuple((follower, multiplier) for follower, (_, multiplier, _) in followers[path])
        unit = 1.0 if joints[path].twist.turns else length
        yield LoopCoordinate(path=path, moves=moves, lower=lower, upper=maximum(lower, upper), unit=unit)


def _chain(joints: Mapping[str, JointEdge], path: str) -> Iterator[JointEdge]:
    """Yield the joint at `path`, and the chain of joints that it mimics, directly or indirectly."""
    joint: JointEdge | None = joints[path]
    while joint is not None:
        yield joint
        joint = None if joint.mimic is None else joints.get(joint.mimic.joint.path)


def _reach(joints: Mapping[str, JointEdge], leader: str, follower: str, low: float, high: float) -> tuple[float, float]:
    """Return the range [rad or m] of a leader, around 0, in which the joint that mimics the leader is between `low` and `high`.

    The range is also within the limits of the leader. The range is infinite if the leader has no limits, or if the other joint is out of
    range already when the leader is at 0.
    """
    limit = joints[leader].limit
    if limit.lower is None or limit.upper is None:
        return -inf, inf

    def within(x: float) -> bool:
        return low <= coordinates(joints.values(), {leader: x})[follower] <= high

    start = minimum(maximum(0.0, limit.lower), limit.upper)
    ends: list[float] = []
    for end in (limit.lower, limit.upper):
        last_valid = start
        for number in range(1, SAMPLES + 1):
            position = start + (end - start) * number / SAMPLES
            if not within(position):
                for _ in range(50):
                    middle = 0.5 * (last_valid + position)
                    last_valid, position = (middle, position) if within(middle) else (last_valid, middle)
                break
            last_valid = position
        ends.append(last_valid)
    return (ends[0], ends[1]) if within(start) else (-inf, inf)


def _error(A: Pose, B: Pose) -> tuple[Vector, Vector]:
    """Return the position error p = p_B - p_A [m] and the rotation error w = R_A log(inv(R_A) R_B) [rad] of two frames in the world."""
    p, o = B.translation, A.translation
    w = rotation_vector(multiply(transpose(A.rotation), B.rotation))
    return (p[0] - o[0], p[1] - o[1], p[2] - o[2]), rotate(A.rotation, w)


def rotation_vector(r: Matrix) -> Vector:
    """Convert a rotation matrix to its rotation vector: the axis times the angle [rad] from 0 to pi.

    The result is also accurate near 0 and pi.
    """
    return turn_of(Pose(rotation=r).quaternion())


def _turn(v: Vector) -> Matrix:
    """Convert a rotation vector [rad] to a rotation matrix, by the exponential map."""
    angle = hypot(*v)
    if angle == 0.0:
        return IDENTITY
    x, y, z = v
    return turned_about((x / angle, y / angle, z / angle), angle)


def orthonormal(r: Matrix) -> Matrix:
    """Correct the rounding errors of a product of many rotations: return the nearest rotation matrix, computed from its unit quaternion."""
    w, x, y, z = Pose(rotation=r).quaternion()
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    )


def _linear(error: Sequence[float], columns: Sequence[Sequence[float]], step: Sequence[float]) -> list[float]:
    """Return the residuals after a step, as predicted by the linear model."""
    predicted = list(error)
    for value, column in zip(step, columns, strict=True):
        if value != 0.0:
            predicted = [e + value * c for e, c in zip(predicted, column, strict=True)]
    return predicted


def _square(values: Sequence[float]) -> float:
    return sum_of(value * value for value in values)
