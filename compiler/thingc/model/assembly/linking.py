"""The pass `link`, which builds the `Assembly` from the resolved model and the part records.

The result does not depend on the root of a mode.
"""

from __future__ import annotations

from collections.abc import Collection, Container, Iterator, Mapping, Sequence

from msgspec.structs import asdict, replace

from thingc.base.diagnostics import Code, Report
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.memo import Memo
from thingc.base.pose import NO_POSE, Pose
from thingc.documents.checks import kinds
from thingc.geometry.record import PartFailure, PartRecord
from thingc.model.assembly.inertia_checks import check_links, check_stated
from thingc.model.assembly.instance_tree import Instance, Tree
from thingc.model.assembly.interfaces import check_declared, check_expectations, check_interfaces, check_screws
from thingc.model.assembly.kinematics import forward_kinematics, neighbourhood, on_loops
from thingc.model.assembly.links import connected_components, links_between, links_of
from thingc.model.assembly.mates import check_loops, mates_of, stated_joints
from thingc.model.assembly.modes import add_start_pose, added_of, adhesions_of, check_poses, exported_of, modes_of, raw_of
from thingc.model.assembly.names import names_of
from thingc.model.assembly.part_instances import PartInstances
from thingc.model.assembly.plausibility import check_plausible
from thingc.model.assembly.report import LinkReport
from thingc.model.assembly.shape_links import Meshes
from thingc.model.assembly.tendons import sensors_of, set_rest_length, tendons_of
from thingc.model.assembly.types import Assembly, Connected, JointEdge, LinkedTendon, LinkedTest, Mate, MountAt, Occurrence
from thingc.model.resolve.types import AssemblyDefinition, Reference

ABSENT = {"decompose": "convex decomposition", "part": "method `collision()`", "hull": "convex hull", "mesh": "mesh"}
"""The geometry that a collision shape requires, by the value of the key `collision`."""


def check_contacts(occurrences: Sequence[Occurrence], findings: LinkReport) -> None:
    """Report each part that does not have the geometry that its setting `collision` requires.

    Parts whose geometry is unknown, for example because they were read from a lock file, are skipped.
    """
    for one in (occurrence.choose(path) for occurrence in occurrences for path in occurrence.overrides.choices):
        choice = one.overrides.collision
        if one.record is None or not one.record.meshes or choice in ("none", "shapes") or one.touching:
            continue
        findings.error(
            Code.COLLISION_MISSING, f"`{one.path}` (`{one.definition.label}`) has no {ABSENT.get(choice, f'enclosing {choice}')} for "
            f"`collision: {choice}`", one.origin, path=one.path, help="write `collision: hull`, or `collision: none` to disable contacts",
        )


def link(
    model: AssemblyDefinition, records: Mapping[str, PartRecord | PartFailure], report: Report, memo: Memo | None = None,
    meshes: Meshes | None = None, *, unmodelled: bool = False,
) -> Assembly | None:
    """Build the linked assembly from the resolved model and the geometry records of its parts.

    Errors are added to `report`. For an invalid model, return None.

    `records` contains the geometry record of every part in `model`, keyed by the text of the part's definition. With `unmodelled`, parts
    have not been built: only errors of documents are reported, and the result is None. `meshes` contains the records of mesh files of
    links. Elements that depend on invalid elements are skipped without a further message. The time is linear in the number of occurrences.
    `memo` caches intermediate results.
    """
    memo = memo or Memo()
    findings = LinkReport(report)
    instances = PartInstances(records, meshes or {}, findings, memo)
    tree = Tree(model, instances, findings)
    instances.report_failures()
    instances.report_materials()
    mates, placed_by_at = mates_of(tree, memo)
    robot = _connect(tree, mates, memo)
    names = names_of(tree, robot)
    joints = tuple(joint for mate in mates for joint in mate.joints)
    driven = (tendon for tendon in robot.tendons if tendon.actuator is not None)
    tests = tuple(_tests(tree, (*joints, *driven)))
    _check(robot, placed_by_at, findings)
    has_loops = any(joint.loop for _, definition in tree.assemblies for joint in definition.joints)
    known = not findings.incomplete or not (findings.earlier or findings.failed or has_loops)
    check_poses(tree, stated_joints(tree, joints), on_loops(len(robot.occurrences), mates), unset=known)
    base, at = tree.top.index, _rest(tree, mates, memo)
    count, placing = len(robot.occurrences), sum(1 for mate in mates if mate.loop is None)
    if base is None or findings.incomplete or len(at) != count or placing != count - 1:
        if not instances.unknown and not unmodelled:
            _say_apart(tree, at)
        return None
    modes, poses = add_start_pose(robot.modes, model.poses, joints, names.poses.values() if names is not None else ())
    tendons = tuple(set_rest_length(tendon, robot.occurrences, at, findings) for tendon in robot.tendons)
    robot = replace(robot, modes=modes, tendons=tendons)
    if findings.failed:
        return None
    assembly = Assembly(
        **asdict(robot), name=model.name, definition=model, base=base, rest=tuple(at[index] for index in range(count)), poses=poses,
        raw=tuple(raw_of(tree)), added=added_of(tree), tests=tests, names=names,
    )
    check_plausible(tree, assembly)
    return assembly


def _connect(tree: Tree, mates: tuple[Mate, ...], memo: Memo) -> Connected:
    """Return the linked robot with its occurrences, links, modes, sensors, tendons and magnets."""
    exported = tuple(exported_of(tree))
    occurrences = tuple(
        memo.same(("occurrence", instance.path), _occurrence(index, instance, tree)) for index, instance in enumerate(tree.occurrences)
    )
    link_of = connected_components(len(occurrences), mates)
    links = tuple(links_of(tree, occurrences, mates, memo))
    check_loops(mates, link_of, links, tree.findings)
    modes, adhesions = modes_of(tree, occurrences, link_of), adhesions_of(tree)
    return Connected(
        occurrences=occurrences, mates=mates, links=links, link_of=link_of, exported=exported, modes=modes, adhesions=adhesions,
        sensors=tuple(sensors_of(tree, link_of)), tendons=tuple(tendons_of(tree, link_of)),
        between=links_between(links, link_of, occurrences, mates, modes, adhesions),
    )


def _check(robot: Connected, placed_by_at: Collection[int], findings: LinkReport) -> None:
    """Report errors in the parts and links of a robot."""
    check_contacts(robot.occurrences, findings)
    faulty = check_stated(robot, findings)
    if not findings.incomplete:
        # Check only complete assemblies, because an omitted component might have the mass or be on the mount.
        faulty += [occurrence.index for occurrence in robot.occurrences if not occurrence.sound]
        check_links(robot, faulty, findings)
        check_expectations(robot, placed_by_at, findings)
        check_interfaces(robot, placed_by_at, findings)
        check_screws(robot, findings)
        check_declared(robot, findings)


def _say_apart(tree: Tree, at: Container[int]) -> None:
    """Report each component that is not connected to the base and is not placed by `at`, unless a previous error is the reason."""
    if tree.findings.failed or tree.findings.earlier:
        return
    model, alone = tree.model, next((one for k, one in enumerate(tree.occurrences) if k not in at), tree.top)
    tree.findings.error(
        Code.INCOMPLETE, f"`{alone.path or model.name}` is not connected to the base of `{model.name}`",
        alone.origin or model.origin, path=alone.path or None, help="place every component except the base with `attach`, `at` or a joint",
    )


def _rest(tree: Tree, mates: Sequence[Mate], memo: Memo) -> dict[int, Pose]:
    """Return the poses of the occurrences that are connected to the base at q = 0, in the frame of the base."""
    base, count = tree.top.index, len(tree.occurrences)
    lie = tuple((m.parent, m.child, m.X_PJ, m.X_JC, m.loop, tuple((j.twist, j.offset) for j in m.joints)) for m in mates)

    def poses(*_: object) -> dict[int, Pose]:
        return forward_kinematics(mates, neighbourhood(count, mates), base, NO_POSE, {}) if base is not None else {}

    return memo("rest", poses, lie, base, count)


def _occurrence(index: int, instance: Instance, tree: Tree) -> Occurrence:
    part = instance.part
    if part is None:
        raise ValueError(f"{instance.path} is not an occurrence")
    added = tree.added.get(index)
    occurrence = Occurrence(
        **{**asdict(part), "mounts": {**part.mounts, **added} if added else part.mounts},
        path=instance.path, index=index, overrides=part.component.overrides, origin=instance.origin,
        unit=instance.unit, detail=instance.detail,
    )
    return occurrence.in_nested_mode(instance.mode) if "/" in instance.path else occurrence


def _tests(tree: Tree, joints: Sequence[JointEdge | LinkedTendon]) -> Iterator[LinkedTest]:
    """Yield the tests of the top document whose mounts and components are valid. All other tests are reported."""
    by_path = {joint.path: joint for joint in joints}
    for test in tree.model.tests:
        found = {
            reference: tree.members(tree.top, reference) if reference.mount is None else tree.find(tree.top, reference)
            for reference in _references(test.check)
        }
        link = kinds()[test.kind].link
        if link is not None:
            link(test, test.check, by_path, tree.findings)
        if None not in found.values():
            mounts = {one: mount for one, mount in found.items() if isinstance(mount, MountAt)}
            components = {one: members for one, members in found.items() if isinstance(members, tuple)}
            yield LinkedTest(test=test, mounts=mounts, components=components)


def _references(specification: object) -> Iterator[Reference]:
    """Yield all references in the specification of a test."""
    if isinstance(specification, Reference):
        yield specification
    elif isinstance(specification, tuple):
        for item in specification:
            yield from _references(item)
    elif isinstance(specification, FrozenStruct):
        for name in specification.__struct_fields__:
            yield from _references(getattr(specification, name))
