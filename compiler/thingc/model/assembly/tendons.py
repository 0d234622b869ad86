"""Resolve the references of sensors and tendons to mounts, joints and links in the linked assembly."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from msgspec.structs import replace

from thingc.base.diagnostics import Code
from thingc.base.pose import Pose
from thingc.base.sensor_kinds import Measurement
from thingc.model.assembly.drives import actuator_of, fill_drive
from thingc.model.assembly.instance_tree import Instance, Tree
from thingc.model.assembly.modes import links_named, mount_of
from thingc.model.assembly.report import LinkReport
from thingc.model.assembly.tendon_paths import course
from thingc.model.assembly.types import LinkedSensor, LinkedTendon, Occurrence, TendonStep
from thingc.model.resolve.types import PathStep, TendonLength, Wrap


def sensors_of(tree: Tree, link_of: Sequence[int]) -> Iterator[LinkedSensor]:
    """Yield the sensors of all documents. Sensors of a document precede sensors of its nested documents."""
    for instance, definition in tree.assemblies:
        for sensor in definition.sensors:
            at, seen_from = sensor.at, sensor.seen_from
            mounts = {reference: mount_of(tree, instance, reference) for reference in (at, seen_from) if reference is not None}
            touching = [link for component in sensor.touching for link in links_named(tree, component, link_of, instance)]
            if None in mounts.values() or len(touching) < len(sensor.touching):
                continue
            yield LinkedSensor(
                **instance.fields_of(sensor, Measurement), path=instance.within(sensor.name), touching=tuple(touching),
                at=None if at is None else mounts[at], seen_from=None if seen_from is None else mounts[seen_from],
                joint=instance.within(sensor.joint) if sensor.joint is not None else None,
                tendon=instance.within(sensor.tendon) if sensor.tendon is not None else None,
            )


def tendons_of(tree: Tree, link_of: Sequence[int]) -> Iterator[LinkedTendon]:
    """Yield the tendons of all documents. References to mounts and joints are resolved. Invalid tendons are reported and omitted."""
    for instance, definition in tree.assemblies:
        for tendon in definition.tendons:
            steps = [_step(tree, instance, step) for step in tendon.path]
            sound = tuple(step for step in steps if step is not None)
            if len(sound) < len(steps) or not all(_is_side_on_link(step, link_of, tree.findings) for step in sound):
                continue
            limit, dynamics, gear = tendon.limit, tendon.dynamics, None if tendon.drive is None else tendon.drive.gear
            owner = f"tendon `{tendon.name}`" if gear is None else f"transmission `{gear.name}`"
            drive = None if tendon.drive is None else fill_drive(tree, instance, owner, tendon.name, tendon.drive, turns=tendon.turns)
            if drive is not None and gear is not None:
                limit = replace(limit, effort=drive.effort, velocity=drive.velocity)
                dynamics = replace(dynamics, armature=drive.armature)
            fields = instance.fields_of(tendon, TendonLength) | {"limit": limit, "dynamics": dynamics}
            yield LinkedTendon(
                **fields, path=instance.within(tendon.name), moves={instance.within(name.path): factor for name, factor in tendon.moves},
                actuator=None if drive is None else actuator_of(instance, owner, drive, limit, tree.findings, turns=tendon.turns),
                steps=sound,
            )


def _step(tree: Tree, instance: Instance, step: PathStep) -> TendonStep | None:
    """Resolve a step of the path of a tendon in the document of `instance`.

    If a reference of the step is invalid, report an error and return None.
    """
    mount, side = (None if reference is None else mount_of(tree, instance, reference) for reference in (step.mount, step.side))
    if mount is None and step.mount is not None or side is None and step.side is not None:
        return None
    return TendonStep(**instance.fields_of(step, Wrap), mount=mount, side=side)


def _is_side_on_link(step: TendonStep, link_of: Sequence[int], findings: LinkReport) -> bool:
    """Return whether the mount `side` of a shape around which a tendon wraps is on the same link as the shape.

    An error is reported if the links differ.
    """
    if step.mount is None or step.side is None or link_of[step.mount.occurrence] == link_of[step.side.occurrence]:
        return True
    findings.error(
        Code.TENDON_PATH, f"the `side` mount `{step.side.path}` is not on the link of the shape at `{step.mount.path}`", step.origin,
        help="set `side` to a mount on the link of the shape", path=step.side.path,
    )
    return False


def set_rest_length(
    tendon: LinkedTendon, occurrences: Sequence[Occurrence], rest: Mapping[int, Pose], findings: LinkReport,
) -> LinkedTendon:
    """Return a copy of the tendon in which the rest length of its spring is set.

    By default, the rest length is the length at q = 0. `rest` contains the poses of all occurrences at q = 0.

    A mount of the path inside a shape around which the tendon wraps is reported.
    """
    if not tendon.steps:
        return tendon
    at = {mount.path: rest[mount.occurrence] @ mount.pose for mount in tendon.mounts}
    for step in tendon.steps:
        if step.mount is not None and step.side is not None and step.radius is not None:
            x, y, z = at[step.mount.path].inverse().apply(at[step.side.path].translation)
            if x * x + y * y + (z * z if step.shape == "sphere" else 0.0) <= step.radius**2:
                findings.error(
                    Code.TENDON_PATH, f"the `side` mount `{step.side.path}` is inside the {step.shape} of the tendon", step.origin,
                    help="set `side` to a mount outside the shape", path=step.side.path,
                )
                return tendon
    if tendon.dynamics.stiffness is None or tendon.dynamics.rest is not None:
        return tendon
    return replace(tendon, dynamics=replace(tendon.dynamics, rest=course(tendon.steps, at).length))
