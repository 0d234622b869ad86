"""Create the joint edges of the mate graph. The drives of joints determine missing values for effort, velocity and armature."""

from __future__ import annotations

from msgspec.structs import replace

from thingc.base.diagnostics import Code, Note, noted
from thingc.base.joints.twist import Twist
from thingc.base.source import Origin
from thingc.base.suggestions import did_you_mean
from thingc.geometry.record import ActuatorRecord
from thingc.model.assembly.instance_tree import Instance, Tree
from thingc.model.assembly.report import LinkReport, written_at
from thingc.model.assembly.types import ActuatorModel, JointEdge
from thingc.model.resolve.coordinates import CoordinateName
from thingc.model.resolve.types import Drive, Joint

_INLINE = {"hinge": "`drive: {kind: position, kp: 20 N*m/rad}`", "slide": "`drive: {kind: position, kp: 200 N/m}`"}
"""Example of an inline drive in a document, by type of motion."""


def stated_edge(instance: Instance, joint: Joint, twist: Twist) -> JointEdge:
    """Create the joint edge of a joint from the values that the document specifies. Values of the drive of the joint are not included."""
    mimic = None if joint.mimic is None else replace(joint.mimic, joint=_named(instance, joint.mimic.joint))
    return JointEdge(
        name=_named(instance, joint.name), kind=joint.kind, twist=twist, limit=joint.limit, dynamics=joint.dynamics, offset=joint.offset,
        mimic=mimic, actuator=None, origin=joint.origin + instance.origin,
    )


def _named(instance: Instance, name: CoordinateName) -> CoordinateName:
    """Convert the name of a coordinate in the document of `instance` to its name in the top document."""
    return CoordinateName(f"{instance.path.replace('/', '.')}.{name}") if instance.path else name


def joint_edge(tree: Tree, instance: Instance, joint: Joint, twist: Twist, findings: LinkReport) -> JointEdge:
    """Create the joint edge of a joint, including the values of its drive.

    If the document does not specify the effort limit, velocity limit or armature of the joint, the value of the drive is used.
    """
    origin = joint.origin + instance.origin
    path = instance.within(joint.path)
    limit, dynamics = joint.limit, joint.dynamics
    actuator: ActuatorModel | None = None
    drive = _filled(tree, instance, joint, twist, joint.drive, findings) if joint.drive is not None else None
    if drive is not None:
        place = (drive.origin or joint.origin) + instance.origin
        if limit.effort is not None and drive.effort is not None and limit.effort > drive.effort:
            span = joint.spans.get("limit.effort")
            unit = "N*m" if twist.turns else "N"
            findings.warn(
                Code.EFFORT, f"joint `{joint.name}` has an effort limit of {limit.effort:.6g} {unit}, "
                f"but its actuator provides at most {drive.effort:.6g} {unit}", ((span,) + origin[1:]) if span is not None else origin,
                path=path, help="lower `limit.effort`, or use a stronger actuator", notes=noted("the actuator is set here", drive.origin),
            )
        limit = replace(
            limit, effort=limit.effort if limit.effort is not None else drive.effort,
            velocity=limit.velocity if limit.velocity is not None else drive.velocity,
        )
        if dynamics.armature is None:
            dynamics = replace(dynamics, armature=drive.armature)
        if drive.kind == "position" and drive.kp is None:
            findings.error(
                Code.NO_GAIN, f"joint `{joint.name}` has a position drive, but its actuator has no gain `kp`", place, path=path,
                help=f"set `kp` in the part's `Actuator`, or write the drive inline: {_INLINE[twist.core]}",
                notes=_drive_notes(tree, instance, drive),
            )
        if joint.drive is not None and joint.drive.component is not None and joint.drive.kind == "velocity" and drive.kv is None:
            findings.error(
                Code.NO_GAIN, f"joint `{joint.name}` has a velocity drive, but its actuator has no gain `kv`", place, path=path,
                help=f"add `kv` next to `component`, for example `kv: 0.1 {'N*m*s/rad' if twist.turns else 'N*s/m'}`",
                notes=_drive_notes(tree, instance, drive),
            )
        actuator = ActuatorModel(
            kind=drive.kind or "position", kp=drive.kp, kv=drive.kv, effort=limit.effort, velocity=limit.velocity, origin=place,
            axis=drive.axis,
        )
    return replace(stated_edge(instance, joint, twist), limit=limit, dynamics=dynamics, actuator=actuator)


def _filled(tree: Tree, instance: Instance, joint: Joint, twist: Twist, drive: Drive, findings: LinkReport) -> Drive | None:
    """Fill in missing values of the drive of a joint from the actuator of a Thing. Values that the document specifies take precedence.

    Return None if the drive is invalid or the properties of the part are not known exactly.
    """
    if drive.component is None:
        return drive
    named = tree.component(instance, drive.component)
    if named is None:
        return None
    part = named.part
    actuator = part.record.actuator if part is not None and part.record is not None else None
    if actuator is None:
        _no_actuator(instance, joint, twist, drive.component.text, named, drive.component.origin + instance.origin, findings)
        return None
    if part is not None and part.record is not None and not part.record.exact:
        return None
    return _over(drive, actuator)


def _drive_notes(tree: Tree, instance: Instance, drive: Drive) -> tuple[Note, ...]:
    """Return a note with the location of the Thing that drives a joint, or no notes for an inline drive."""
    named = tree.component(instance, drive.component) if drive.component is not None else None
    if named is None or named.part is None or named.part.record is None:
        return ()
    return written_at(f"`{named.part.definition.label}`", named.part.record.code)


def _over(drive: Drive, actuator: ActuatorRecord) -> Drive:
    def first(said: float | None, else_: float | None) -> float | None:
        return said if said is not None else else_

    kind = drive.kind or actuator.kind
    return replace(
        drive, kind=kind, kp=first(drive.kp, actuator.kp) if kind in ("position", actuator.kind) else None, kv=first(drive.kv, actuator.kv),
        effort=first(drive.effort, actuator.stall_torque), velocity=first(drive.velocity, actuator.no_load_speed),
        armature=first(drive.armature, actuator.armature),
    )


def _no_actuator(instance: Instance, joint: Joint, twist: Twist, text: str, named: Instance, origin: Origin, findings: LinkReport) -> None:
    able = [
        name for name, child in instance.children.items()
        if child.part is not None and child.part.record is not None and child.part.record.actuator is not None
    ]
    notes: tuple[Note, ...] = ()
    if named.assembly is not None:
        what = f" (`{named.assembly.label}`), which is an assembly"
        able.extend(
            f"{text}.{name}" for name, child in named.children.items()
            if child.part is not None and child.part.record is not None and child.part.record.actuator is not None
        )
    elif named.part is not None and named.part.record is not None:
        what = f" (`{named.part.definition.label}`), which has no actuator"
        notes = written_at(f"`{named.part.definition.label}`", named.part.record.code)
    else:
        what = ", which is a frame"
    findings.error(
        Code.NO_ACTUATOR, f"joint `{joint.name}` is driven by `{text}`{what}", origin, path=instance.within(joint.path), help=(
            did_you_mean(text, able, what="components with an actuator") if able
            else f"add `actuator = Actuator(...)` to its class, or write the drive inline: {_INLINE[twist.core]}"
        ), notes=notes,
    )
