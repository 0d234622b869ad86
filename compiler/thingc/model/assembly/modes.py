"""Resolve the references in modes, their contacts, poses, exported mounts and raw attributes of the top document."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence

from msgspec.structs import asdict, replace

from thingc.base.diagnostics import Code, make_notes
from thingc.base.numeric import hypot, isfinite
from thingc.base.source import Origin
from thingc.base.suggestions import did_you_mean
from thingc.model.assembly.instance_tree import Instance, Tree
from thingc.model.assembly.kinematics import balls, coordinates
from thingc.model.assembly.report import LinkReport
from thingc.model.assembly.types import Adhesion, ExportedMount, Foot, JointEdge, LinkedMode, LinkedMount, Occurrence
from thingc.model.resolve.coordinates import Limit
from thingc.model.resolve.raw_protected import NAMING
from thingc.model.resolve.types import ContactGroup, ContactPair, Hold, Mode, ModeSettings, NamedPose, RawAttribute, RawElement, Reference

SLIDE = 1.0
"""Default sliding friction of MuJoCo. For a contact of two surfaces, MuJoCo uses the larger friction.

The friction of a material takes precedence over the friction of the floor, because models contain a priority for it.
"""


def exported_of(tree: Tree) -> Iterator[ExportedMount]:
    """Yield the exported mounts of the top document and of all nested assemblies. An assembly precedes its nested assemblies."""
    for instance, definition in tree.assemblies:
        for name, reference in definition.mounts.items():
            mount = tree.find(instance, reference)
            if mount is not None:
                origin = reference.origin + instance.origin
                yield ExportedMount(**asdict(mount), path=instance.within(name), origin=origin)


def modes_of(tree: Tree, occurrences: Sequence[Occurrence], link_of: Sequence[int]) -> tuple[LinkedMode, ...]:
    """Return all modes with a valid root. References are resolved. Pairs in `exclude` whose components are on the same link are omitted."""
    linked = (_mode(tree, mode, occurrences, link_of) for mode in tree.model.modes)
    return tuple(mode for mode in linked if mode is not None)


def add_start_pose(
    modes: tuple[LinkedMode, ...], poses: tuple[NamedPose, ...], joints: Sequence[JointEdge], file_names: Collection[str],
) -> tuple[tuple[LinkedMode, ...], tuple[NamedPose, ...]]:
    """Return all modes and poses. If joints are not at 0 although no pose sets a joint, modes without a pose start in an additional pose.

    These joints mimic others with an offset. `file_names` contains names of poses in output files.
    """
    unposed = [mode for mode in modes if mode.pose is None]
    if not unposed or not any(coordinates(joints, {}).values()):
        return modes, poses
    start = NamedPose(
        name=unused_pose_name({*file_names, *(pose.name for pose in poses)}), values={}, origins={}, origin=unposed[0].origin, stated=False,
    )
    posed = (replace(mode, pose=start.name, poses=(start.name, *mode.poses)) if mode.pose is None else mode for mode in modes)
    return tuple(posed), (*poses, start)


def unused_pose_name(used: Collection[str]) -> str:
    """Return a name for a start pose that is not in `used`: `start`, `start_2` and so on."""
    return next(name for k in range(1, len(used) + 2) if (name := f"start_{k}" if k > 1 else "start") not in used)


def _mode(tree: Tree, mode: Mode, occurrences: Sequence[Occurrence], link_of: Sequence[int]) -> LinkedMode | None:
    root = mount_of(tree, tree.top, mode.root)
    pairs = dict.fromkeys(
        (min(a, b), max(a, b)) for first, second in mode.exclude
        for a in links_named(tree, first, link_of, tree.top) for b in links_named(tree, second, link_of, tree.top) if a != b
    )
    adhesion = {_path(reference): force for reference, force in mode.adhesion if tree.find(tree.top, reference) is not None}
    if root is None:
        tree.findings.incomplete = True
        return None
    return LinkedMode(
        **tree.top.fields_of(mode, ModeSettings), root=root, exclude=tuple(pairs), adhesion=adhesion,
        pairs=_pairs(tree, mode, [one.choose(("modes", mode.name)) for one in occurrences], link_of), groups=tuple(_groups(tree, mode)),
        holds=_holds(tree, mode), feet=tuple(_feet(tree, mode)),
    )


def _holds(tree: Tree, mode: Mode) -> tuple[Hold[LinkedMount], ...]:
    """Return the resolved holds of a mode.

    A mount that the mode holds twice, for example under its own name and under an exported name, is reported.
    """
    holds: dict[tuple[int, str], Hold[LinkedMount]] = {}
    for hold in mode.holds:
        choice = mount_of(tree, tree.top, hold.mount)
        if choice is None:
            continue
        linked = Hold(mount=choice, pose=hold.pose, origin=hold.origin, turns=hold.turns)
        earlier = holds.setdefault((choice.occurrence, choice.mount), linked)
        if earlier is not linked:
            tree.findings.error(
                Code.HOLD, f"`{choice.path}` is listed twice under `hold` of mode `{mode.name}`", hold.origin, path=choice.path,
                help="remove one of the two entries from `hold`", notes=make_notes("the other entry is here", earlier.origin),
            )
    return tuple(holds.values())


def _feet(tree: Tree, mode: Mode) -> Iterator[Foot]:
    """Yield the mounts on which the robot stands in a mode, without duplicates. A mount that the mode also holds is reported."""
    if mode.standing is None:
        return
    holds = {(choice.occurrence, choice.mount): hold for hold in mode.holds if (choice := mount_of(tree, tree.top, hold.mount)) is not None}
    seen: set[tuple[int, str]] = set()
    for reference in mode.standing.mounts:
        choice = mount_of(tree, tree.top, reference)
        if choice is None or (choice.occurrence, choice.mount) in seen:
            continue
        seen.add((choice.occurrence, choice.mount))
        hold = holds.get((choice.occurrence, choice.mount))
        if hold is not None:
            tree.findings.error(
                Code.STANDING, f"`{choice.path}` is in both `hold` and `standing_on` of mode `{mode.name}`", reference.origin,
                path=choice.path, help="remove the mount from `hold` or from `standing_on`",
                notes=make_notes("the mount is held here", hold.origin),
            )
            continue
        part = tree.occurrences[choice.occurrence].part
        stated = part.material.slide if part is not None and part.material is not None else None
        friction = mode.standing.friction if mode.standing.friction is not None else stated
        yield Foot(mount=choice, friction=SLIDE if friction is None else friction, origin=reference.origin)


def mount_of(tree: Tree, instance: Instance, reference: Reference) -> LinkedMount | None:
    """Resolve a reference in the document of `instance` to a mount. If the reference is invalid, report an error and return None."""
    mount = tree.find(instance, reference)
    if mount is None:
        return None
    return LinkedMount(**asdict(mount), path=instance.within(_path(reference)))


def _path(reference: Reference) -> str:
    return "/".join((*reference.path, reference.mount or "origin"))


def links_named(tree: Tree, reference: Reference, link_of: Sequence[int], instance: Instance) -> Collection[int]:
    """Return the indices of the links to which a reference in the document of `instance` refers.

    For a reference to a nested assembly, return all links of the assembly. For a reference to a mount, return only the link of the mount.
    """
    return dict.fromkeys(link_of[member] for member in tree.members(instance, reference) or ())


def adhesions_of(tree: Tree) -> tuple[Adhesion, ...]:
    """Return all magnets that the modes use, in the order of their first use.

    The force of a magnet is the largest force [N] that any mode specifies.
    """
    largest: dict[str, Adhesion] = {}
    for mode in tree.model.modes:
        for reference, force in mode.adhesion:
            mount = tree.find(tree.top, reference)
            path = _path(reference)
            if mount is not None and (path not in largest or force > largest[path].force):
                largest[path] = Adhesion(**asdict(mount), path=path, force=force)
    return tuple(largest.values())


def raw_of(tree: Tree) -> Iterator[RawAttribute]:
    """Yield the raw attributes of all documents.

    Names of elements are converted to paths in the robot: `yaw` of `hand` becomes `hand/yaw`.
    """
    for instance, definition in tree.assemblies:
        for raw in definition.raw:
            path = raw.path
            if len(path) > 2:  # keys of the path: element, name and attribute; `option` and similar elements have no name
                path = (path[0], instance.within(path[1].replace(".", "/")), *path[2:])
            yield replace(raw, path=path, origin=raw.origin + instance.origin)


def added_of(tree: Tree) -> tuple[RawElement, ...]:
    """Return the raw MuJoCo elements of all documents. Names and references are converted to paths in the robot."""

    def within(instance: Instance, element: RawElement) -> RawElement:
        attributes = {
            name: instance.within(value if name == "name" else value.replace(".", "/")) if name in NAMING else value
            for name, value in element.attributes.items()
        }
        children = tuple(within(instance, child) for child in element.children)
        return replace(element, attributes=attributes, children=children, origin=element.origin + instance.origin)

    return tuple(within(instance, element) for instance, definition in tree.assemblies for element in definition.added)


def check_poses(tree: Tree, joints: Sequence[JointEdge], loops: Collection[str], *, unset: bool) -> None:
    """Report every value in a named pose that is outside the limits of its joint.

    With `unset`, which requires that no joints were omitted, joints that are not in the pose are also checked in poses that modes use.
    Joints in `loops` are checked only if the pose contains the joint.
    """
    poses, modes, findings = tree.model.poses, tree.model.modes, tree.findings
    used_poses = {name for mode in modes for name in mode.poses}
    names = {pose.name for pose in poses}
    for mode in modes:
        for name in mode.poses:
            if name not in names and not findings.earlier:
                findings.error(
                    Code.UNKNOWN_POSE, f"mode `{mode.name}` uses the undefined pose `{name}`", mode.origin,
                    path=mode.name, help=did_you_mean(name, names, what="poses"),
                )
    by_path = {joint.path: joint for joint in joints}
    for pose in poses:
        for path in pose.values:
            if path not in by_path and not findings.earlier and not findings.incomplete:
                findings.error(
                    Code.UNKNOWN_JOINT, f"pose `{pose.name}` sets `{path}`, which is not a moving joint",
                    pose.origins.get(path, pose.origin), path=pose.name, help=did_you_mean(path, by_path, what="joints"),
                )
        for path, q in coordinates(joints, pose.values).items():
            if path in pose.values or (pose.name in used_poses and unset and path not in loops):
                _check_limit(pose, by_path[path], q, findings)
        for ball in balls(joints):
            _check_cone(pose, ball, findings)


def _check_cone(pose: NamedPose, ball: tuple[JointEdge, ...], findings: LinkReport) -> None:
    """Report an error if a ball joint is outside its cone limit in a pose.

    A joint that the pose does not contain is at 0, which is within every cone limit.
    """
    joint, cone = ball[0], ball[0].limit.cone
    angle = hypot(*(pose.values.get(joint_of_ball.path, 0.0) for joint_of_ball in ball))
    if cone is not None and not Limit(upper=cone).contains(angle):
        name = joint.name.joint
        findings.error(
            Code.POSE_LIMITS, f"the rotation of `{name}` in pose `{pose.name}` ({joint.twist.format(angle)}) exceeds its cone limit "
            f"({joint.twist.format(cone)})", pose.origins.get(joint.path, pose.origin), path=pose.name,
            help="write a smaller rotation, or widen the cone", notes=make_notes(f"`{name}` is defined here", joint.origin),
        )


def _check_limit(pose: NamedPose, joint: JointEdge, q: float, findings: LinkReport) -> None:
    if not isfinite(q):
        findings.error(
            Code.POSE_LIMITS, f"the value of `{joint.name}` in pose `{pose.name}` is not finite", pose.origin, path=pose.name,
            help="write a smaller value", notes=make_notes(f"`{joint.name}` mimics another joint here", joint.origin),
        )
        return
    if joint.limit.contains(q):
        return
    origin, help = pose.origin, f"set `{joint.name}` in the pose"
    if joint.path in pose.values:
        origin = pose.origins.get(joint.path, origin)
        help = "write a value within the limits, or widen the limits"
    elif joint.mimic is not None:
        origin = pose.origins.get(joint.mimic.joint.path, origin)
        help = f"change `{joint.mimic.joint}`, which `{joint.name}` mimics, or widen the limits"
    findings.error(
        Code.POSE_LIMITS, f"the value of `{joint.name}` in pose `{pose.name}` ({joint.twist.format(q)}) is outside its limits "
        f"({joint.limit.format(joint.twist)})", origin, path=pose.name, help=help,
        notes=make_notes(f"`{joint.name}` is defined here", joint.origin),
    )


def _pairs(tree: Tree, mode: Mode, occurrences: Sequence[Occurrence], link_of: Sequence[int]) -> tuple[ContactPair[int], ...]:
    """Return the pairs of occurrences that always collide in a mode. A nested assembly represents all of its occurrences.

    A pair of one link, a pair without collision shapes, and a pair that is listed twice are reported and omitted.
    """
    linked_pairs: dict[frozenset[int], ContactPair[int]] = {}
    twice: set[Origin] = set()
    for pair in mode.pairs:
        sides = [tree.members(tree.top, reference) or () for reference in (pair.one, pair.other)]
        separate = [(a, b) for a in sides[0] for b in sides[1] if link_of[a] != link_of[b]]
        for members, reference in zip(sides, (pair.one, pair.other), strict=True):
            if members and not any(occurrences[member].has_contacts for member in members):
                tree.findings.error(
                    Code.CONTACTS, f"component `{reference.text}` of the contact pair has no collision shapes", pair.origin,
                    help="set `collision` of the component, or remove the pair",
                )
        if all(sides) and not separate:
            tree.findings.error(
                Code.CONTACTS, f"`{pair.one.text}` and `{pair.other.text}` of the contact pair are rigidly connected", pair.origin,
                help="use two components of different links",
            )
        for a, b in separate:
            if not (occurrences[a].has_contacts and occurrences[b].has_contacts):
                continue
            linked = ContactPair(one=a, other=b, friction=pair.friction, margin=pair.margin, gap=pair.gap, origin=pair.origin)
            earlier = linked_pairs.setdefault(frozenset((a, b)), linked)
            if earlier is not linked and pair.origin not in twice:
                twice.add(pair.origin)
                names = " and ".join(f"`{occurrences[index].name}`" for index in (a, b))
                tree.findings.error(
                    Code.CONTACTS, f"the contact pair of {names} is listed twice", pair.origin, help="remove one of the two contact pairs",
                    notes=make_notes("the other entry is here", earlier.origin),
                )
    return tuple(linked_pairs.values())


def _groups(tree: Tree, mode: Mode) -> Iterator[ContactGroup[int]]:
    """Yield the contact groups of a mode with their occurrences. An occurrence in two groups is reported."""
    owners: dict[int, str] = {}
    for group in mode.groups:
        members = {member: reference for reference in group.members for member in tree.members(tree.top, reference) or ()}
        for member, reference in members.items():
            if (owner := owners.setdefault(member, group.name)) != group.name:
                name = tree.occurrences[member].name
                tree.findings.error(
                    Code.CONTACTS, f"`{name}` is in both contact groups `{owner}` and `{group.name}`", reference.origin,
                    help="remove the component from one of the two groups",
                )
        yield ContactGroup(name=group.name, members=tuple(members), collides=group.collides)
