"""Create the joint edges of the mate graph. The drives of joints determine missing values for effort, velocity and armature."""

from __future__ import annotations

from collections.abc import Iterator

from msgspec.structs import replace

from thingc.base.diagnostics import Code, make_notes
from thingc.base.joints.twist import Twist, dimensions_of
from thingc.base.numeric import sum_of
from thingc.base.suggestions import did_you_mean
from thingc.base.units import ANGLE, LENGTH, Quantity
from thingc.geometry.record import ActuatorRecord
from thingc.model.assembly.instance_tree import Instance, Tree
from thingc.model.assembly.report import LinkReport
from thingc.model.assembly.types import ActuatorModel, JointEdge
from thingc.model.resolve.coordinates import Coordinate, CoordinateName, DriveValues, Limit
from thingc.model.resolve.types import Drive, Joint, Reference

_INLINE = {True: "`drive: {kind: position, kp: 20 N*m/rad}`", False: "`drive: {kind: position, kp: 200 N/m}`"}
"""Example of an inline drive in a document, for an angle and for a length."""


def stated_edge(instance: Instance, joint: Joint, twist: Twist) -> JointEdge:
    """Create the joint edge of a joint from the values that the document specifies. Values of the drive of the joint are not included."""
    mimic = None if joint.mimic is None else replace(joint.mimic, joint=_top_name(instance, joint.mimic.joint))
    fields = instance.fields_of(joint, Coordinate) | {"name": _top_name(instance, joint.name), "mimic": mimic}
    return JointEdge(**fields, twist=twist, actuator=None)


def _top_name(instance: Instance, name: CoordinateName) -> CoordinateName:
    """Convert the name of a coordinate in the document of `instance` to its name in the top document."""
    return CoordinateName(f"{instance.name}.{name}") if instance.path else name


def joint_edge(tree: Tree, instance: Instance, joint: Joint, twist: Twist) -> JointEdge:
    """Create the joint edge of a joint, including the values of its drive.

    If the document does not specify the effort limit, velocity limit or armature of the joint, the value of the drive is used.
    """
    origin = joint.origin + instance.origin
    path = instance.within(joint.path)
    limit, dynamics = joint.limit, joint.dynamics
    actuator: ActuatorModel | None = None
    drive = None
    if joint.drive is not None:
        stated = replace(joint.drive, origin=joint.drive.origin or joint.origin)
        drive = fill_drive(tree, instance, f"joint `{joint.name}`", joint.path, stated, turns=twist.turns)
    if drive is not None:
        if limit.effort is not None and drive.effort is not None and limit.effort > drive.effort:
            unit = "N*m" if twist.turns else "N"
            tree.findings.warn(
                Code.EFFORT, f"the effort limit of joint `{joint.name}` ({limit.effort:.6g} {unit}) exceeds the effort of its actuator "
                f"({drive.effort:.6g} {unit})", joint.origin_of("limit.effort", origin), path=path, allow=False,
                help="lower `limit.effort`, or use a stronger actuator", notes=make_notes("the actuator is set here", drive.origin),
            )
        limit = replace(limit, effort=first(limit.effort, drive.effort), velocity=first(limit.velocity, drive.velocity))
        if dynamics.armature is None:
            dynamics = replace(dynamics, armature=drive.armature)
        actuator = actuator_of(instance, f"joint `{joint.name}`", drive, limit, tree.findings, turns=twist.turns)
        actuator = replace(actuator, effort=limit.effort, velocity=limit.velocity)
    return replace(stated_edge(instance, joint, twist), limit=limit, dynamics=dynamics, actuator=actuator)


def actuator_of(instance: Instance, owner: str, drive: Drive, limit: Limit, findings: LinkReport, *, turns: bool) -> ActuatorModel:
    """Return the model of a drive whose values are complete.

    `limit` contains the limits of the coordinate. A torque-speed line without a speed is an error, and so are a deadband or
    noise as large as the range of the command.
    """
    gear, speed, of = drive.gear, first(drive.velocity, limit.velocity), dimensions_of(ANGLE if turns else LENGTH)
    if drive.stall is not None and not speed:
        findings.error(
            Code.DRIVE, f"`stall` of the drive of {owner} requires `velocity`", (drive.spans["stall"], *instance.origin),
            help="set `velocity` to the no-load speed",
        )
    effort = first(limit.effort, drive.effort)
    if drive.stall is not None and effort is not None and effort > drive.stall:
        compared = f"({Quantity(effort, of['effort'])}) exceeds its `stall` ({Quantity(drive.stall, of['effort'])})"
        place, help = (drive.spans["stall"], *instance.origin), "lower `effort`, or increase `stall`"
        findings.warn(Code.EFFORT, f"the effort of the drive of {owner} {compared}", place, help=help, allow=False)
    key, reach = ("effort", effort) if drive.kind == "motor" else ("velocity", first(limit.velocity, speed))
    if drive.kind == "position":
        key, reach = "rest", None if limit.lower is None or limit.upper is None else limit.upper - limit.lower
    for name, value in (("deadband", drive.deadband), ("noise", drive.noise)):
        if value is not None and reach is not None and value >= reach:
            compared = f"must be below the command range ({Quantity(reach, of[key])}), found {Quantity(value, of[key])}"
            place = drive.spans[name], *instance.origin
            findings.error(Code.DRIVE, f"the `{name}` of the drive of {owner} {compared}", place, help=f"use a smaller `{name}`")
    stall = (drive.stall, speed) if drive.stall is not None and speed else None
    model = ActuatorModel(**instance.fields_of(drive, DriveValues), kind=drive.kind or "position", stall=stall)
    return model if gear is None else replace(model, transmission=instance.within(gear.name), ratio=gear.ratio, backlash=gear.backlash)


def fill_drive(tree: Tree, instance: Instance, owner: str, path: str, drive: Drive, *, turns: bool) -> Drive | None:
    """Fill in missing values of a drive from the actuator of a Thing, and convert all values to the joint side of a transmission.

    Values that the document specifies take precedence. `owner` is the driven element for messages, such as "joint `knee`", with its `path`
    in its document. `turns` specifies whether its coordinate is an angle. Return None if the drive is invalid or the properties of the part
    are not known exactly.
    """
    if drive.component is not None:
        turns = turns if drive.gear is None else drive.gear.turns
        named = tree.component(instance, drive.component)
        if named is None:
            return None
        part = named.part
        if part is None or part.record is None or part.record.actuator is None:
            _no_actuator(tree, instance, owner, path, drive.component, named, turns=turns)
            return None
        if not part.exact:
            return None
        complete = _fill_missing(drive, part.record.actuator)
        gain = "kp" if complete.kind == "position" and complete.kp is None else "kv"
        if gain == "kp" or drive.kind == "velocity" and complete.kv is None:
            help = f"set `kp` in the part's `Actuator`, or write the drive inline: {_INLINE[turns]}"
            if gain == "kv":
                help = f"add `kv` next to `component`, for example `kv: 0.1 {'N*m*s/rad' if turns else 'N*s/m'}`"
            tree.findings.error(
                Code.NO_GAIN, f"the {complete.kind} drive of {owner} has no gain `{gain}`",
                drive.origin + instance.origin, path=instance.within(path), help=help, notes=part.written,
            )
        drive = complete
    return _at_joint(drive)


def _at_joint(drive: Drive) -> Drive:
    """Convert the values of an actuator to the joint side of its transmission, whose ratio is r and whose efficiency is e.

    The joint moves 1 / r times as fast. The efficiency acts on the forward drive: the torque at the joint is r e times the torque of the
    actuator. Gains are torques of the actuator per motion of the actuator, which is r times the motion of the joint. Inertias at the
    actuator accelerate r times as much as the joint, and act on the joint with r times their torque, without losses.
    """
    gear = drive.gear
    if gear is None:
        return drive
    ratio, inertias = abs(gear.ratio), [one for one in (drive.armature, gear.inertia) if one is not None]
    push = ratio * gear.efficiency
    command = push if drive.kind == "motor" else 1.0 / ratio

    def times(value: float | None, factor: float) -> float | None:
        return None if value is None else value * factor

    return replace(
        drive, kp=times(drive.kp, push * ratio), kv=times(drive.kv, push * ratio), effort=times(drive.effort, push),
        velocity=times(drive.velocity, 1.0 / ratio), armature=sum_of(inertias) * ratio * ratio if inertias else None,
        stall=times(drive.stall, push), deadband=times(drive.deadband, command), noise=times(drive.noise, command),
    )


def first(value: float | None, default: float | None) -> float | None:
    """Return the first of two values that is not None."""
    return value if value is not None else default


def _fill_missing(drive: Drive, actuator: ActuatorRecord) -> Drive:
    kind = drive.kind or actuator.kind
    return replace(
        drive, kind=kind, kp=first(drive.kp, actuator.kp) if kind in ("position", actuator.kind) else None, kv=first(drive.kv, actuator.kv),
        effort=first(drive.effort, actuator.stall_torque), velocity=first(drive.velocity, actuator.no_load_speed),
        armature=first(drive.armature, actuator.armature),
    )


def _no_actuator(tree: Tree, instance: Instance, owner: str, path: str, reference: Reference, named: Instance, *, turns: bool) -> None:
    """Report a drive whose component `named` has no actuator."""
    text, able = reference.text, list(_with_actuator(instance))
    if named.assembly is not None:
        what = f" (`{named.assembly.label}`) is an assembly"
        able.extend(f"{text}.{name}" for name in _with_actuator(named))
    elif named.part is not None and named.part.record is not None:
        what = f" (`{named.part.definition.label}`) has no actuator"
    else:
        what = " is a frame"
    tree.findings.error(
        Code.NO_ACTUATOR, f"`{text}`{what} and cannot drive {owner}", reference.origin + instance.origin, path=instance.within(path), help=(
            did_you_mean(text, able, what="components with an actuator") if able
            else f"add `actuator = Actuator(...)` to its class, or write the drive inline: {_INLINE[turns]}"
        ), notes=named.part.written if named.part is not None else (),
    )


def _with_actuator(instance: Instance) -> Iterator[str]:
    """Yield the names of the components of an assembly that have an actuator."""
    for name, child in instance.children.items():
        if child.part is not None and child.part.record is not None and child.part.record.actuator is not None:
            yield name
