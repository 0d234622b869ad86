"""Find the kinematic loops of a mode, and compute poses in which these loops are closed."""

from __future__ import annotations

from collections.abc import Collection, Iterator

from msgspec.structs import replace

from thingc.base.diagnostics import Code, Note, Report
from thingc.base.joints.kinds import stays
from thingc.base.memo import Memo
from thingc.base.numeric import isfinite, pi, radians, sum_of
from thingc.base.pose import MATE, NO_POSE, Pose
from thingc.base.suggestions import Hint, did_you_mean
from thingc.model.assembly.kinematics import coordinates, joints_of, on_loops
from thingc.model.assembly.types import Assembly, LinkedMode
from thingc.model.resolve.types import NamedPose
from thingc.model.robot.kinematics import placed_bodies
from thingc.model.robot.loop_cuts import closing
from thingc.model.robot.loop_solver import Loops, Solution, SolverState
from thingc.model.robot.tree import bodies_from, cut_closures, in_link, placing, root_pose
from thingc.model.robot.types import Body, Closure, Keyframe, Unclosed, residual_words

MET = 1e-12
"""Tolerance [m, rad] for a pose in the document whose loops are already closed. The joint positions of such a pose are not changed."""

STILL = 1e-9
"""Smallest movement of a joint during loop closure that is not treated as 0 [rad or m]."""

FAR = radians(30.0)
"""Largest movement of a joint during loop closure for which a pose is exported as a keyframe [rad; scaled for translations]. The start pose
of a mode is always exported.
"""

STARTS = 8
"""Number of additional start states from which the solver tries to close the loops of a mode before it reports an error."""


def closures_of(
    assembly: Assembly, mode: LinkedMode, bodies: tuple[Body, ...], tree_mates: Collection[int], report: Report, memo: Memo,
) -> tuple[Closure, ...] | None:
    """Return the loop closures of a mode: first its holds, then the joints that are not in its kinematic tree.

    If a closure is invalid, report an error and return None.

    `memo` caches results.
    """
    sound = _check_cuts(assembly, mode, tree_mates, report)
    cut = tuple(cut_closures(assembly, bodies, tree_mates))
    holds: list[Closure] = []
    start_poses = _start_body_poses(assembly, mode, bodies, memo) if any(hold.pose is None for hold in mode.holds) else ()
    placed = in_link(assembly)
    body_of = {body.link: index for index, body in enumerate(bodies)}
    for hold in mode.holds:
        choice = hold.mount
        link = assembly.link_of[choice.occurrence]
        if body_of[link] == 0 and stays(mode.base):
            report.add(
                Code.HOLD, f"mode `{mode.name}` cannot hold `{choice.path}`, a mount of the root link "
                f"`{assembly.links[link].name}`", hold.origin, path=choice.path,
                help="list a mount of another link under `hold`, or remove the mount",
                notes=[Note(message=f"`{assembly.links[link].name}` is defined here", span=assembly.links[link].origin[0])],
            )
            sound = False
            continue
        X_LM = placed[choice.occurrence] @ choice.pose
        target = start_poses[body_of[link]] @ X_LM if hold.pose is None else hold.pose if choice.of_component else hold.pose @ MATE
        holds.append(Closure(
            path=choice.path, hold=True, turns=hold.turns, parent=None, child=body_of[link], X_PA=target, X_CB=X_LM, joints=(), twists=(),
            origin=hold.origin,
        ))
    return (*holds, *cut) if sound else None


def _check_cuts(assembly: Assembly, mode: LinkedMode, tree_mates: Collection[int], report: Report) -> bool:
    """Return whether a loop is cut at every joint in the setting `cut` of the mode.

    A joint that is not on a loop, or whose loop is cut at another joint, is reported.
    """
    joints = {mate.name: number for number, mate in enumerate(assembly.mates) if mate.name is not None and mate.joints}
    rejected = [cut for cut in mode.cut if joints.get(cut.joint) in tree_mates]
    for cut in rejected:
        closed = closing(assembly, tree_mates, joints[cut.joint])
        fixed = next((mate for mate in closed if not mate.joints), None)
        notes: list[Note] = []
        help: Hint
        if fixed is not None:
            reason = f"whose loop is already cut at the fixed joint `{fixed.loop}`"
            help = "remove the joint from `cut`"
            notes = [Note(message=f"`{fixed.loop}` is defined here", span=fixed.origin[0])]
        elif closed:
            other = next(other for other in mode.cut if other.joint == closed[0].name)
            reason, help = f"whose loop is already cut at `{other.joint}`", "remove one of the two joints from `cut`"
            notes = [Note(message=f"`{other.joint}` is cut here", span=other.origin[0])]
        else:
            on_loops = [name for name, number in joints.items() if number not in tree_mates or closing(assembly, tree_mates, number)]
            reason = "which is not in a loop"
            help = did_you_mean(cut.joint, on_loops, what="joints in loops") if on_loops else "remove `cut`"
        report.add(Code.CUT, f"mode `{mode.name}` cuts joint `{cut.joint}`, {reason}", cut.origin, path=cut.joint, help=help, notes=notes)
    return not rejected


def _start_body_poses(assembly: Assembly, mode: LinkedMode, bodies: tuple[Body, ...], memo: Memo) -> tuple[Pose, ...]:
    """Close the loops of joints in the start pose of the mode (by default all joints at 0), and return the poses of all bodies."""
    return placed_bodies(bodies, closed_coordinates(assembly, assembly.start_pose(mode), memo), bodies[0].X_PL)


def closed_coordinates(assembly: Assembly, pose: NamedPose, memo: Memo) -> dict[str, float]:
    """Close the kinematic loops of an assembly as far as possible, beginning with a pose.

    Return the positions [rad or m] of all joints by path. `memo` caches results.
    """
    q, loops = coordinates(joints_of(assembly), pose.values), _doc_loops(assembly, memo)
    if loops is None:
        return q
    return memo(("closed", None, pose.name), close_pose, loops, SolverState(q=q, base=NO_POSE), frozenset(pose.values), False).state.q


def _doc_loops(assembly: Assembly, memo: Memo) -> Loops | None:
    """Return the kinematic loops of the assembly. Each loop is cut at the joint that does not place a component.

    The result is the same for every mode.
    """
    tree_mates = placing(assembly)
    if not any(mate.loop is not None for mate in assembly.mates):
        return None
    bodies = bodies_from(assembly, assembly.link_of[assembly.base], tree_mates, NO_POSE, memo)
    return memo(("loops", None), Loops, bodies, tuple(cut_closures(assembly, bodies, tree_mates)), joints_of(assembly), NO_POSE)


def keyframes_of(
    assembly: Assembly, mode: LinkedMode, bodies: tuple[Body, ...], closures: tuple[Closure, ...], report: Report, memo: Memo,
) -> tuple[tuple[Keyframe, ...], tuple[Unclosed, ...]] | None:
    """Close the kinematic loops in each pose of a mode.

    For each pose whose loops close, return a keyframe with the positions of all joints. Also return the poses whose loops do not close.

    To close the loops, the solver first moves a free base, then the joints that the pose does not contain. The joints in the pose move only
    if this is not sufficient. If the loops do not close in the start pose that the document specifies, or in any pose, report an error and
    return None. `memo` caches results.
    """
    joints = joints_of(assembly)
    by_name = {pose.name: pose for pose in assembly.poses}
    poses = [by_name[name] for name in mode.poses if name in by_name]
    root_at = {name: root_pose(assembly, replace(mode, at=at)) for name, at in mode.at_in.items()}
    if not closures:
        return tuple(Keyframe(name=p.name, q=coordinates(joints, p.values), origin=p.origin, base=root_at.get(p.name)) for p in poses), ()
    has_holds = any(closure.hold for closure in closures)
    of_mode = mode.name if has_holds else None
    loops = memo(("loops", of_mode), Loops, bodies, closures, joints, bodies[0].X_PL) if has_holds else _doc_loops(assembly, memo)
    if loops is None:
        raise ValueError("a tree without holds has closures only where the documents have loops")
    base_moves = has_holds and mode.base == "free"
    following = on_loops(len(assembly.occurrences), assembly.mates)
    keyframes: list[Keyframe] = []
    unclosed: list[Unclosed] = []
    failed: list[Solution] = []
    for pose in poses:
        start = SolverState(q=coordinates(joints, pose.values), base=loops.base)
        solution = memo(("closed", of_mode, pose.name), close_pose, loops, start, frozenset(pose.values), base_moves)
        moved = _movements(loops, start, solution, following - pose.values.keys()) if solution.closed else {}
        if not solution.closed:
            failed.append(solution)
        is_far = (pose.name != mode.pose or not pose.stated) and any(abs(moved.get(c.path, 0.0)) > FAR * c.unit for c in loops.coordinates)
        if solution.closed and not is_far:
            base = solution.state.base if base_moves else root_at.get(pose.name)
            keyframes.append(Keyframe(
                name=pose.name, q=solution.state.q, origin=pose.origin, base=base, moved=moved if pose.stated else {},
                residual=solution.residual,
            ))
        elif pose.stated:
            closure, residual = _worst(loops, solution)
            unclosed.append(Unclosed(name=pose.name, path=closure.path, residual=residual, origin=pose.origin, moved=moved))
    start_failure = next((pose for pose in unclosed if pose.name == mode.pose), None)
    best = None if len(failed) < len(poses) else memo(("failed", of_mode), closest_failure, loops, tuple(failed), base_moves)
    if start_failure is None and best is None:
        return tuple(keyframes), tuple(unclosed)
    _report(mode, loops, start_failure, best, keyframes, report)
    return None


def closest_failure(loops: Loops, failed: tuple[Solution, ...], base_moves: bool) -> Solution | None:
    """Search for any state in which the loops are closed.

    If there is no such state, return the solution with the smallest error. If the loops can be closed, return None.
    """
    best = failed[0] if failed else None
    for solution in (*failed[1:], *_try_solutions(loops, base_moves)):
        if solution.closed:
            return None
        if best is None or _measure(loops, solution) < _measure(loops, best):
            best = solution
    return best


def _report(
    mode: LinkedMode, loops: Loops, start: Unclosed | None, best: Solution | None, keyframes: list[Keyframe], report: Report,
) -> None:
    """Report loops that do not close.

    `best` is the solution with the smallest error if the loops cannot be closed at all. `start` is the result for the start pose of the
    mode, if its loops do not close.
    """
    place = ""
    if best is None:
        if start is None:
            return
        closure, residual = next(c for c in loops.closures if c.path == start.path), start.residual
        help = (
            f"start from the pose `{keyframes[0].name}`, in which the loops close" if keyframes
            else "start from a pose that is closer to a closed loop"
        )
        place = f" from pose `{start.name}`"
    else:
        closure, residual = _worst(loops, best)
        help = (
            "move the mount under `hold`, or widen the limits of the joints" if closure.hold
            else "change the lengths in the loop, or the limits of its joints"
        )
    far = residual_words(residual)
    if closure.hold:
        message = f"the held mount `{closure.path}` moves in mode `{mode.name}`{place} (smallest error: {far})"
    else:
        message = f"the loop through joint `{closure.path}` does not close{place} (smallest error: {far})"
    report.add(Code.UNCLOSED, message, closure.origin, path=closure.path, help=help)


def _movements(loops: Loops, start: SolverState, solution: Solution, following: Collection[str]) -> dict[str, float]:
    """Return the movement [rad or m] of each independent joint during loop closure, by joint path.

    Joints in `following`, which are on loops but not in the pose, are omitted.
    """
    moved = {c.path: solution.state.q[c.path] - start.q[c.path] for c in loops.coordinates if c.path not in following}
    return {path: movement for path, movement in moved.items() if abs(movement) > STILL}


def close_pose(loops: Loops, start: SolverState, named: Collection[str], base_moves: bool) -> Solution:
    """Close the kinematic loops of a robot, beginning with the state of a pose.

    If the loops do not close, return the solution with the smallest error.

    The joints that the pose does not contain (not in `named`) move first. If this is not sufficient, all joints move, and the result is the
    closed state that is nearest to the pose.
    """
    initial = Solution(state=start, residuals=loops.residuals(start))
    within_limits = all(c.lower - STILL <= start.q[c.path] <= c.upper + STILL for c in loops.coordinates)
    if within_limits and all(p <= MET and w <= MET for p, w in initial.residuals):
        return initial
    unnamed = frozenset(c.path for c in loops.coordinates if c.path not in named)
    stages: list[frozenset[str] | None] = [frozenset()] if base_moves else []
    stages += [unnamed, None] if unnamed and len(unnamed) < len(loops.coordinates) else [None]
    best = initial
    for movable in stages:
        solution = loops.close(start, movable, base_moves=base_moves)
        if solution.closed and (movable is not None or not named):
            return solution
        if solution.closed:
            second = solution if best is initial else loops.close(best.state, None, base_moves=base_moves)
            closed = [solution, *([second] if second.closed and second is not solution else [])]
            nearest = [loops.nearest(start, candidate, named, base_moves=base_moves) for candidate in closed]
            return min(nearest, key=lambda candidate: loops.distance(start, candidate.state, named))
        best = min(best, solution, key=lambda candidate: _measure(loops, candidate))
    return best


def _try_solutions(loops: Loops, base_moves: bool) -> Iterator[Solution]:
    """Yield the solutions for several start states.

    In the start states, all joints are at 0, all joints are in the middle of their ranges, or the positions are samples between the limits.

    The samples are multiples of the golden ratio modulo 1, and are the same in every run.
    """
    for number in range(STARTS):
        q = coordinates(loops.joints.values(), {})
        for place, c in enumerate(loops.coordinates):
            low = c.lower if isfinite(c.lower) else -pi * c.unit
            high = c.upper if isfinite(c.upper) else pi * c.unit
            part = 0.5 if number == 1 else (number * 0.6180339887498949 * (place + 1)) % 1.0
            if number > 0:
                q[c.path] = low + part * (high - low)
        q = coordinates(loops.joints.values(), {c.path: q[c.path] for c in loops.coordinates})
        yield loops.close(SolverState(q=q, base=loops.base), None, base_moves=base_moves)


def _measure(loops: Loops, solution: Solution) -> float:
    """Combine the closure errors of all loops into one number, by which solutions are compared."""
    return sum_of(p * p + (loops.length * w) ** 2 for p, w in solution.residuals)


def _worst(loops: Loops, solution: Solution) -> tuple[Closure, tuple[float, float]]:
    pairs = zip(loops.closures, solution.residuals, strict=True)
    return max(pairs, key=lambda pair: pair[1][0] ** 2 + (loops.length * pair[1][1]) ** 2)
