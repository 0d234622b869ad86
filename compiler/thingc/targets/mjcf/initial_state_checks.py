"""Check the initial state of a mode with MuJoCo. The check finds links that overlap, and drives that oscillate.

In these cases, a simulation fails at once, although the model compiles. The state is checked when MuJoCo compiles a model with its true
meshes, which happens in any case. If a state has no faults, this result is cached. The cache key is a digest of all inputs of the state
(see `key`).
"""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Iterator, Sequence
from typing import Any

from msgspec.structs import replace

from thingc.base.diagnostics import Code, Note, Report, first_notes
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.grouping import group_by
from thingc.base.safe_text import quote_names
from thingc.base.source import Origin
from thingc.base.units import LENGTH, Quantity
from thingc.model.robot.types import Robot, TreeJoint
from thingc.targets.mjcf.compat.pymjcf import SEPARATOR

MAX_OVERLAP = 0.5e-3
"""Largest overlap of two links [m] that is not reported. The limit is larger than 0 because links with a tight fit are in contact, and
because meshes are slightly inaccurate.
"""
LISTED = 3
"""Number of additional pairs that a message names."""

_IRRELEVANT = re.compile(r' (?:range|ctrlrange|rgba|gravity)="[^"]*"')


def key(text: str, robot: Robot) -> str:
    """Return a digest of everything that determines the result of `check_state` for a model with the XML text `text`.

    The digest covers the name of the start keyframe, and the text without the name of the model, colours, joint limits and gravity.
    Therefore, a robot on a wall has the same digest as on the floor.
    """
    model = _IRRELEVANT.sub("", text.partition("<mujoco ")[2].partition(">")[2])
    return hashlib.sha256(f"{robot.mode.pose}\n{model}".encode()).hexdigest()


def irrelevant_parts(text: str) -> tuple[str, ...]:
    """Return the parts of the XML text of a model that the function `key` omits, because they do not affect the initial state."""
    head, _, body = text.partition("<mujoco ")
    return (head, body.partition(">")[0], *_IRRELEVANT.findall(body))


class Penetration(FrozenStruct):
    """Two parts that overlap in the initial state by `depth` [m]. The parts are given by their paths."""

    one: str
    other: str
    depth: float


class Gains(FrozenStruct):
    """The gains of a drive, and the inertia that the drive moves, for one step of a simulation.

    `stiffness` [N m/rad or N/m] is the sum of kp and the spring stiffness. `kv` and `damping` are in [N m s/rad or N s/m], and the time
    step `dt` is in [s]. `inertia` [kg m^2 or kg] is the inertia that the drive moves if all joints can move freely.
    """

    stiffness: float
    kv: float
    damping: float
    inertia: float
    saturates: bool
    dt: float
    integrator: str

    @property
    def stiffest(self) -> float:
        """Return the largest stable stiffness. Above this value, each simulation step increases the error of the position.

        In each step, MuJoCo computes the new velocity first, and uses it for the new position: v' = a v - b q and q' = q + dt v'. The
        matrix of a step has the determinant a and the trace 1 + a - dt b. By the Jury criterion, it is stable while 2 + 2 a > dt b.
        Implicit integrators divide by I + dt d, with d = kv + damping. This gives a = I / (I + dt d), b = dt k / (I + dt d), and dt^2 k < 4
        I + 2 dt d. The integrator Euler is implicit in the damping c of joints and explicit in kv, which gives dt^2 k < 4 I + 2 dt c - 2 dt
        kv. Runge-Kutta of order 4 is stable for dt^2 k < 8 I, because its stability region ends at 2 sqrt(2) on the imaginary axis.
        """
        if self.integrator == "RK4":
            return 8.0 * self.inertia / self.dt**2
        if self.integrator == "Euler":
            return (4.0 * self.inertia + 2.0 * self.dt * (self.damping - self.kv)) / self.dt**2
        return (4.0 * self.inertia + 2.0 * self.dt * (self.damping + self.kv)) / self.dt**2

    @property
    def too_stiff(self) -> bool:
        """Return whether oscillations of the position grow from step to step."""
        return self.stiffness > 0.0 and self.stiffness > self.stiffest

    @property
    def too_damped(self) -> bool:
        """Return whether the damping reverses the velocity in one step, which can happen only with an explicit integrator.

        The force is computed from the velocity v at the beginning of the step: v' = (1 - dt kv / I) v has the opposite sign if dt kv > I.
        """
        return self.integrator in ("Euler", "RK4") and self.dt * self.kv > self.inertia

    @property
    def jumps(self) -> bool:
        """Return whether the force can jump between its limits F and -F in every step, although the integrator is implicit in kv.

        A force at its limit does not depend on the velocity, and MuJoCo omits it from the derivative. Let J = dt^2 F / I be the change of
        the position in one step at the limit. From rest at the position error J / 2, one step leads to the error -J / 2. If dt kv > I, the
        next step stops the motion, and the drive is at rest at -J / 2. The drive jumps again and again if the force at this error is at its
        limit. The condition is kp J / 2 > F, which is the same as dt^2 kp > 2 I.
        """
        return self.saturates and self.dt * self.kv > self.inertia and self.dt**2 * self.stiffness > 2.0 * self.inertia

    @property
    def max_kv(self) -> float:
        """Return the largest kv for which an explicit integrator is stable, if the other values do not change (see `stiffest`,
        `too_quick`).

        The result is zero or negative if no value of kv is stable.
        """
        limit = self.inertia / self.dt
        if self.integrator == "RK4":
            return 0.0 if self.too_stiff else limit
        return min(limit, (4.0 * self.inertia - self.dt**2 * self.stiffness) / (2.0 * self.dt) + self.damping)

    @property
    def stable(self) -> bool:
        """Return whether the drive is stable: its gains are not too large, and its force does not jump between its limits."""
        return not (self.too_stiff or self.too_damped or self.jumps)


class InitialState(FrozenStruct):
    """The faults of a mode in its initial state.

    `overlaps` contains the overlapping parts, deepest first. `gains` contains the gains of each drive that oscillates, by joint path.
    """

    robot: Robot
    overlaps: tuple[Penetration, ...]
    gains: dict[str, Gains]

    @property
    def in_order(self) -> bool:
        """Return whether no parts overlap and all drives are stable in the initial state."""
        return not self.overlaps and not self.gains


def check_state(model: Any, robot: Robot) -> InitialState:
    """Check the initial state of a scene that MuJoCo has compiled (an `mujoco.MjModel`).

    Contacts are checked in the start pose, and gains are checked in all keyframes. The check ends early if a simulation step needs more
    memory than MuJoCo has allocated.
    """
    import mujoco

    data = mujoco.MjData(model)
    frames = {frame.name: model.key(frame.name).id for frame in robot.keyframes}
    start = frames.get(robot.mode.pose or "", -1)
    overlaps: tuple[Penetration, ...] = ()
    worst: dict[str, Gains] = {}
    drives = {name: path for path, name in robot.assembly.drives.items()}
    options = model.opt.jacobian, model.opt.disableflags  # the caller may check the model again
    try:
        mujoco.mj_resetDataKeyframe(model, data, start)  # for the number -1, every joint is at 0
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_collision(model, data)
        overlaps = tuple(_find_overlaps(model, data, robot))
        model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
        for flag in ("CONTACT", "LIMIT", "FRICTIONLOSS"):
            model.opt.disableflags |= int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{flag}"))
        for number in dict.fromkeys((start, *frames.values())):
            mujoco.mj_resetDataKeyframe(model, data, number)
            mujoco.mj_fwdPosition(model, data)
            for name, gains in gains_of(model, data):
                path = drives.get(name) or _path(name)
                if not gains.stable and (path not in worst or gains.inertia < worst[path].inertia):
                    worst[path] = gains
    except mujoco.FatalError:
        pass
    finally:
        model.opt.jacobian, model.opt.disableflags = options
    return InitialState(robot=robot, overlaps=overlaps, gains=worst)


def _find_overlaps(model: Any, data: Any, robot: Robot) -> Iterator[Penetration]:
    """Yield the pairs of parts of different links that overlap, deepest overlap first."""
    owners = {part.name_in_files(surface): part.path for part in robot.assembly.occurrences for surface in part.touching}
    deepest: dict[tuple[str, str], float] = {}
    for contact in data.contact:
        bodies = [int(model.geom_bodyid[geom]) for geom in (contact.geom1, contact.geom2)]
        if contact.dist > -MAX_OVERLAP or 0 in bodies:
            continue
        names = (model.geom(int(geom)).name.replace(SEPARATOR, "/") for geom in (contact.geom1, contact.geom2))
        first, second = sorted(owners.get(name) or _path(name) for name in names)
        deepest[first, second] = max(deepest.get((first, second), 0.0), -float(contact.dist))
    for (first, second), depth in sorted(deepest.items(), key=lambda entry: (-entry[1], entry[0])):
        yield Penetration(one=first, other=second, depth=depth)


def gains_of(model: Any, data: Any) -> Iterator[tuple[str, Gains]]:
    """Yield the name and the gains of each joint drive. The gains are those at the positions of the last `mj_fwdPosition`. The equality
    constraints of `data` must be dense.

    A drive acts along g, its row in the Jacobian of the transmission. For a hinge, g selects the joint's own degree of freedom. For a ball
    joint, g is an axis in its three degrees of freedom. Without equality constraints, the inertia is 1 / (g M^-1 g'). With equality
    constraints (loops, mimic joints), parts move together. If T are the rows of the constraints and W = T M^-1, the inertia is 1 / (g (M^-1
    - W' (T W')^+ W) g'). The stability criteria need the square of the time step. If this square is 0 or infinite, nothing is yielded.
    """
    import mujoco
    import numpy as np

    of_joints = {int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT)}
    driven = [k for k in range(model.nu) if int(model.actuator_trntype[k]) in of_joints]
    if not driven or not 0.0 < model.opt.timestep * model.opt.timestep < math.inf:
        return
    # MuJoCo also allocates rows for constraints that it then omits because nothing in them can move.
    rows = np.asarray(data.efc_J, dtype=float)[: data.nefc * model.nv].reshape(-1, model.nv)
    constraints = np.ascontiguousarray(rows[np.asarray(data.efc_type) == mujoco.mjtConstraint.mjCNSTR_EQUALITY])
    solved = np.zeros_like(constraints)
    if len(constraints):
        mujoco.mj_solveM(model, data, solved, constraints)
        pseudo_inverse = np.linalg.pinv(constraints @ solved.T, rcond=1e-9)
    moments = np.zeros((model.nu, model.nv))
    mujoco.mju_sparse2dense(moments, data.actuator_moment, data.moment_rownnz, data.moment_rowadr, data.moment_colind)
    integrator = {mujoco.mjtIntegrator.mjINT_EULER: "Euler", mujoco.mjtIntegrator.mjINT_RK4: "RK4"}.get(model.opt.integrator, "implicit")
    for actuator in driven:
        joint = int(model.actuator_trnid[actuator][0])
        direction, acceleration = moments[actuator : actuator + 1], np.zeros((1, model.nv))
        mujoco.mj_solveM(model, data, acceleration, direction)
        inverse = free = float(acceleration[0] @ direction[0])
        if len(constraints):
            coupling = solved @ direction[0]
            inverse -= float(coupling @ pseudo_inverse @ coupling)
        if inverse <= 1e-9 * free:  # equality constraints couple the drive to a part that cannot move
            continue
        bias, gear = model.actuator_biasprm[actuator], float(direction[0] @ direction[0])
        yield model.actuator(actuator).name, Gains(
            stiffness=-float(bias[1]) + float(np.ravel(model.jnt_stiffness[joint])[0]) / gear, kv=-float(bias[2]),
            damping=float(np.ravel(model.dof_damping[model.jnt_dofadr[joint]])[0]) / gear, inertia=1.0 / inverse,
            saturates=bool(model.actuator_forcelimited[actuator]), dt=float(model.opt.timestep), integrator=integrator,
        )


def _path(name: str) -> str:
    """Return the path of a component from the beginning of an element's name. The separator of the path is `/`."""
    return name.partition(":")[0].replace(SEPARATOR, "/")


# --- messages ----------------------------------------------------------------------------------------------------------


def report_states(starts: Sequence[InitialState], report: Report) -> None:
    """Report a warning for overlapping parts in each mode, and a warning for each oscillating drive, in the mode with the least inertia.

    If the same parts overlap by the same depth in several modes, only one warning is reported. The same applies to drives with one source.
    """
    overlapping = (start for start in starts if start.overlaps and not report.allows(Code.START_CONTACT, start.robot.mode.origin))
    groups = group_by(overlapping, lambda start: tuple((one.one, one.other, round(one.depth, 5)) for one in start.overlaps))
    for group in groups.values():
        _report_overlaps(group[0], [start.robot.mode.name for start in group[1:]], report)
    worst: dict[str, tuple[Gains, TreeJoint, Robot]] = {}
    for start in starts:
        joints = {joint.path: joint for body in start.robot.bodies for joint in body.joints}
        for path, gains in start.gains.items():
            if path in joints and (path not in worst or gains.inertia < worst[path][0].inertia):  # elements added by `raw` are not checked
                worst[path] = gains, joints[path], start.robot
    drives: dict[object, list[str]] = {}
    for path, (_, joint, _) in worst.items():  # a drive in a repeat is written once for all of its joints
        if report.allows(Code.CHATTER, (*_drive_origin(joint), *joint.origin[:1])):
            continue
        drives.setdefault(_drive_origin(joint), []).append(path)
    for paths in drives.values():
        first = min(paths, key=lambda path: float(f"{worst[path][0].inertia:.3g}"))
        _report_gains(*worst[first], [path for path in paths if path != first], report)


def _drive_origin(joint: TreeJoint) -> Origin:
    return joint.actuator.origin if joint.actuator is not None else joint.origin


def _report_overlaps(start: InitialState, other_modes: Sequence[str], report: Report) -> None:
    robot, deepest = start.robot, start.overlaps[0]
    origins = {part.path: part.origin for part in robot.assembly.occurrences}
    notes = [Note(message=f"`{path}` is defined here", span=origins[path][0]) for path in (deepest.one, deepest.other) if origins.get(path)]
    notes += first_notes([
        Note(message=f"the collision shapes of `{pair.one}` and `{pair.other}` overlap by {Quantity(float(f'{pair.depth:.3g}'), LENGTH)}")
        for pair in start.overlaps[1:]
    ], LISTED, "more pair")
    if other_modes:
        modes = "mode" if len(other_modes) == 1 else "modes"
        notes.append(Note(message=f"the same problem occurs in {modes} " + ", ".join(f"`{name}`" for name in other_modes)))
    pair = ", ".join(path.replace("/", ".") for path in (deepest.one, deepest.other))
    depth = Quantity(float(f"{deepest.depth:.3g}"), LENGTH)
    report.warn(
        Code.START_CONTACT,
        f"the collision shapes of `{deepest.one}` and `{deepest.other}` overlap by {depth} at the start of mode `{robot.mode.name}`",
        robot.mode.origin, path=robot.mode.name, notes=notes,
        help=f"change the pose or the shapes, or write `contacts: {{exclude: [[{pair}]]}}`", allow=True,
    )


def _report_gains(gains: Gains, joint: TreeJoint, robot: Robot, other_drives: Sequence[str], report: Report) -> None:
    weight = "kg*m^2" if joint.twist.turns else "kg"
    name = joint.path.rpartition("/")[2]
    fault, remedy, needed = _explain_kv(gains, joint) if gains.too_damped and gains.max_kv > 0.0 else _explain_stiffness(gains, joint)
    origin = _drive_origin(joint)
    definitions = joint.origin[:1] if origin and joint.origin and joint.origin[0].line != origin[0].line else ()
    notes = [Note(message=f"joint `{name}` is defined here", span=span) for span in definitions]
    if other_drives:
        notes.append(Note(message=f"{quote_names(other_drives, LISTED)} have the same drive"))
    dt = f"{1e3 * gains.dt:g} ms"
    notes.append(Note(message=f"mode `{robot.mode.name}`: joint inertia {gains.inertia:.2g} {weight}, time step {dt}"))
    place = " under `dynamics` of the joint" if _has_transmission(joint) else ""
    help = f"{remedy}, set `armature: {_round_up((joint.dynamics.armature or 0.0) + needed)} {weight}`{place}, or use a smaller `timestep`"
    report.warn(Code.CHATTER, fault, origin, path=joint.path, notes=notes, help=help, allow=True)


def _has_transmission(joint: TreeJoint) -> bool:
    return joint.actuator is not None and joint.actuator.transmission is not None


def _reduce(key: str, value: float, limit: float, unit: str, joint: TreeJoint) -> str:
    """Return a proposal to reduce a value at the joint. The document contains the gains of an actuator with a transmission on its side."""
    if key != "stiffness" and _has_transmission(joint):
        return f"reduce `{key}` of the actuator to at most {_round_down(100.0 * limit / value)} % of its value"
    return f"reduce `{key}` to at most {_round_down(limit)} {unit}"


def _explain_kv(gains: Gains, joint: TreeJoint) -> tuple[str, str, float]:
    """Describe the fault of a velocity gain that is too large.

    Return a description of the fault, a remedy, and the additional armature [kg m^2 or kg] with which the fault would not occur.
    """
    rate = "N*m*s/rad" if joint.twist.turns else "N*s/m"
    effect = "makes the simulation of the joint unstable" if gains.too_stiff else "reverses the velocity of the joint in one step"
    remedy = _reduce("kv", gains.kv, gains.max_kv / 2.0, rate, joint)
    if replace(gains, integrator="implicitfast").stable:
        remedy += ", use `integrator: implicitfast`"
    needed = max(2.0 * gains.dt * gains.kv, gains.dt**2 * gains.stiffness / 2.0 + gains.dt * gains.kv) - gains.inertia
    return f"`kv` of joint `{joint.path.rpartition('/')[2]}` ({gains.kv:.6g} {rate}) {effect}", remedy, needed


def _explain_stiffness(gains: Gains, joint: TreeJoint) -> tuple[str, str, float]:
    """Describe the fault of a position gain that is too large. If the joint has no position gain, its spring is too stiff.

    Return a description of the fault, a remedy, and the additional armature with which the fault would not occur.
    """
    unit, dt, spring = "N*m/rad" if joint.twist.turns else "N/m", gains.dt, joint.dynamics.stiffness or 0.0
    kp = gains.stiffness - spring
    key, value, spring_part = ("kp", kp, spring) if kp > 0.0 else ("stiffness", spring, 0.0)
    effect = "makes the simulation of the joint unstable"
    effect = effect if gains.too_stiff else "makes the drive force oscillate"
    limit = min(gains.stiffest / 2.0, gains.inertia / dt**2 if gains.jumps else gains.stiffest) - spring_part
    remedy = _reduce(key, value, limit, unit, joint)
    if limit <= 0.0:
        remedy = "use `integrator: implicitfast`"
    needed = dt**2 * gains.stiffness / 2.0 - gains.stiffest * dt**2 / 4.0
    if gains.jumps:
        needed = max(needed, dt**2 * gains.stiffness - gains.inertia)
    return f"`{key}` of joint `{joint.path.rpartition('/')[2]}` ({value:.6g} {unit}) {effect}", remedy, needed


def _round_down(value: float) -> str:
    """Round a number down to two significant digits."""
    rounded = float(f"{value:.1e}")
    return f"{rounded if rounded <= value else float(f'{value * 0.95:.1e}'):g}"


def _round_up(value: float) -> str:
    rounded = float(f"{value:.1e}")
    return f"{rounded if rounded >= value else float(f'{value * 1.06:.1e}'):g}"
