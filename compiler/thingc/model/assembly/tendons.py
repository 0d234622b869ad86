"""Resolve the references of tendons to mounts and joints in the linked assembly."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from msgspec.structs import replace

from thingc.base.diagnostics import Code
from thingc.base.pose import Pose
from thingc.model.assembly.drives import actuator_of, fill_drive
from thingc.model.assembly.instance_tree import Instance, Tree
from thingc.model.assembly.modes import mount_of
from thingc.model.assembly.report import LinkReport
from thingc.model.assembly.tendon_paths import course
from thingc.model.assembly.types import LinkedMount, LinkedTendon, Occurrence, TendonStep
from thingc.model.resolve.types import PathStep, TendonLength, Wrap


def tendons_of(tree: Tree, link_of: Sequence[int]) -> tuple[LinkedTendon, ...]:
    """Return the tendons of all documents. References to mounts and joints are resolved. Invalid tendons are reported and omitted."""
    tendons: list[LinkedTendon] = []
    for instance, definition in tree.assemblies:
        for one in definition.tendons:
            steps = [_step(tree, instance, step) for step in one.path]
            whole = tuple(step for step in steps if step is not None)
            if len(whole) < len(steps) or not all(_is_side_on_link(step, link_of, tree.findings) for step in whole):
                continue
            limit, dynamics, gear = one.limit, one.dynamics, None if one.drive is None else one.drive.gear
            owner = f"tendon `{one.name}`" if gear is None else f"transmission `{gear.name}`"
            drive = None if one.drive is None else fill_drive(tree, instance, owner, one.name, one.drive, turns=one.turns)
            if drive is not None and gear is not None:
                limit = replace(limit, effort=drive.effort, velocity=drive.velocity)
                dynamics = replace(dynamics, armature=drive.armature)
            fields = instance.fields_of(one, TendonLength) | {"limit": limit, "dynamics": dynamics}
            tendons.append(LinkedTendon(
                **fields, path=instance.within(one.name), moves={instance.within(name.path): factor for name, factor in one.moves},
                steps=whole,
                actuator=None if drive is None else actuator_of(instance, owner, drive, limit, tree.findings, turns=one.turns),
            ))
    return tuple(tendons)


def _step(tree: Tree, instance: Instance, step: PathStep) -> TendonStep | None:
    """Resolve a step of the path of a tendon in the document of `instance`.

    If a reference of the step is invalid, report an error and return None.
    """
    named = {one: mount_of(tree, instance, one) for one in (step.mount, step.side) if one is not None}
    if None in named.values():
        return None
    return TendonStep(
        **instance.fields_of(step, Wrap), mount=None if step.mount is None else named[step.mount],
        side=None if step.side is None else named[step.side],
    )


def _is_side_on_link(step: TendonStep, link_of: Sequence[int], findings: LinkReport) -> bool:
    """Return whether the mount `side` of a shape around which a tendon wraps is on the same link as the shape.

    An error is reported if the links differ.
    """
    if step.mount is None or step.side is None or link_of[step.mount.occurrence] == link_of[step.side.occurrence]:
        return True
    findings.error(
        Code.TENDON_PATH, f"`{step.side.path}` is not on the link of `{step.mount.path}`, around which the tendon wraps", step.origin,
        help="set `side` to a mount on the same link", path=step.side.path,
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

    def pose(mount: LinkedMount) -> Pose:
        return rest[mount.occurrence] @ occurrences[mount.occurrence].mounts[mount.mount].pose

    at = {mount.path: pose(mount) for mount in tendon.mounts}
    for step in tendon.steps:
        if step.mount is not None and step.side is not None and step.radius is not None:
            x, y, z = at[step.mount.path].inverse().apply(at[step.side.path].translation)
            if x * x + y * y + (z * z if step.shape == "sphere" else 0.0) <= step.radius**2:
                findings.error(
                    Code.TENDON_PATH, f"`{step.side.path}` is inside the {step.shape} around which the tendon wraps", step.origin,
                    help="set `side` to a mount outside the shape; the tendon passes the shape on this side", path=step.side.path,
                )
                return tendon
    if tendon.dynamics.stiffness is None or tendon.dynamics.rest is not None:
        return tendon
    return replace(tendon, dynamics=replace(tendon.dynamics, rest=course(tendon.steps, at).length))
