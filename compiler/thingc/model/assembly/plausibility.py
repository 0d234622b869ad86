"""Warn of suspicious values in documents. Each warning contains the value and its likely cause.

The command `check` runs these checks, because they need only numbers. The command `build` also checks the geometry of parts.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Sequence
from itertools import combinations

from thingc.base.diagnostics import Code, Note, make_notes
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.inertia import MassProperties, total
from thingc.base.joints.twist import Twist
from thingc.base.numeric import dist, hypot, maximum, minimum, pi, radians, sqrt, sum_of, tau
from thingc.base.pose import NO_POSE, Mirror, Pose, Vector, multiply, transpose
from thingc.base.source import Origin
from thingc.model.assembly.instance_tree import Instance, Tree
from thingc.model.assembly.plausibility_modes import check_modes, check_nested_simulation
from thingc.model.assembly.plausibility_prints import check_processes
from thingc.model.assembly.report import LinkReport
from thingc.model.assembly.types import Assembly, JointEdge, Link, LinkedMode, Mate, Occurrence
from thingc.model.resolve.plausibility import density_cure, density_doubt, length_words, mass_words, size_doubt, times_words, unit_meant
from thingc.model.resolve.types import AssemblyDefinition, At, Drive, Joint, StatedValue

CLOSE = 1e-6
"""Tolerance for comparing entries of rotation matrices, and for comparing positions [m]."""


def check_mirrored_pairs(assembly: Assembly, findings: LinkReport) -> None:
    """Warn of a part that must be turned by 90 or 180 deg to be the mirror image of the same part on the opposite side of the robot."""
    groups: dict[object, list[Mate]] = {}
    for mate in assembly.mates:
        definition = assembly.occurrences[mate.child].definition
        if mate.loop is None and mate.child_mount != "origin":
            groups.setdefault((mate.parent, mate.child_mount, (definition.plain or definition).text), []).append(mate)
    for mates in groups.values():
        for first, second in combinations(mates, 2):
            turn = _turn_between(assembly, first, second)
            part, opposite = (assembly.occurrences[index].path for index in (second.child, first.child))
            if turn and findings.warn(
                Code.MIRRORED_TURN, f"`{part}` is rotated by {abs(turn)} deg relative to the mirror image of `{opposite}`",
                second.origin, path=part, notes=make_notes(f"`{opposite}` is placed here", first.origin),
                help=f"add {turn} deg to the `turn` of `{part}`, or use `facing` or `mate_x` for the mounts",
            ):
                break


def _turn_between(assembly: Assembly, mate_a: Mate, mate_b: Mate) -> int:
    """Return the angle [deg] about the z axis of a mount by which the child of one mate must be turned.

    With this turn, the children of both mates are mirror images of each other at q = 0. Return 0 if there is no such angle, if the children
    are already mirror images, or if the mounts are not mirror images of each other.
    """
    axes = [axis for mate in (mate_a, mate_b) if (axis := assembly.occurrences[mate.child].definition.mirror) is not None]
    if len(axes) != 1 or dist(mate_a.X_PJ.translation, mate_b.X_PJ.translation) < CLOSE:
        return 0
    first, second = (multiply(transpose(assembly.rest[m.parent].rotation), assembly.rest[m.child].rotation) for m in (mate_a, mate_b))
    normal_a, normal_b = (transpose(mate.X_PJ.rotation)[2] for mate in (mate_a, mate_b))
    for plane in map(Mirror, "xyz"):
        if maximum(dist(plane.vector(mate_a.X_PJ.translation), mate_b.X_PJ.translation), dist(plane.vector(normal_a), normal_b)) > CLOSE:
            continue
        image = [tuple(sign * entry for entry in Mirror(axes[0]).vector(row)) for sign, row in zip(plane.signs, first)]
        for turn in (0, 90, 180, -90):
            turned = multiply(Twist(angular=normal_b).exponential(radians(turn)).rotation, second)
            if maximum(map(dist, turned, image)) < CLOSE:
                return turn
    return 0


TURNS = 2.0
"""Largest plausible limit of a hinge, in turns. Joints without limits have the type `continuous`."""
FAR = 10.0
"""Largest plausible offset and travel of a joint relative to the diagonal of the largest part, and largest plausible distance of a root
relative to the robot's reach.
"""
FEATHER, ELEPHANT = 1e-3, 1e4
"""Plausible range for the mass of a robot [kg]."""
DRAG = 0.5
"""Largest plausible dry friction of a joint, relative to the effort of its drive. Typical gears have a friction of about 0.1 of the effort.
"""
SLOW = 0.05
"""Smallest plausible top speed of a joint with damping, relative to the no-load speed of its drive."""
ROTOR = 1e3
"""Largest plausible armature of a joint, relative to the inertia of the robot, or for a slide to its mass."""
SPREAD, COMPACT = 3.0, 200.0
"""Plausible range for the radius of gyration: from the diagonal of the part divided by `COMPACT` to the diagonal times `SPREAD`."""
BURDEN = 10.0
"""Largest plausible mass of a component without a shape, relative to the mass of the rest of the robot."""
_PLAIN = re.compile(r"([-+]?[\d.]+(?:e[-+]?\d+)?) *([A-Za-z]+)", re.IGNORECASE)


def check_plausible(tree: Tree, assembly: Assembly) -> None:
    """Warn of implausible values in the documents of an assembly. Call this function only if the documents have no errors."""
    if tree.findings.earlier:
        return
    occurrences, mates, links, modes = assembly.occurrences, assembly.mates, assembly.links, assembly.modes
    edges, mass = {joint.path: joint for mate in mates for joint in mate.joints}, sum_of(link.properties.mass for link in links)
    rotors = any(edge.dynamics.armature for edge in edges.values())
    robot = total(link.properties.seen_from(assembly.rest[link.frame]) for link in (links if rotors else ()))
    for instance, definition in tree.assemblies:
        for joint in definition.joints:
            edge = edges.get(instance.within(joint.path))
            _check_limits(instance, joint, tree.findings)
            if edge is not None:
                _check_drive(instance, joint, edge, tree.findings)
                _check_armature(instance, joint, edge, robot, tree.findings)
    _check_materials(tree, occurrences)
    check_processes(tree, occurrences)
    _check_stated(occurrences, tree.findings)
    odd = _check_sizes(occurrences, tree.findings)
    if not odd and not tree.findings.has_reported(Code.DENSITY) and any(mate.joints for mate in mates) and not tree.model.lump:
        _check_mass(tree, mass)
    _check_actuators(tree, occurrences, mates, {mount.occurrence for mount in assembly.exported if "/" not in mount.path})
    _check_mounts(tree, mates)
    check_mirrored_pairs(assembly, tree.findings)
    if not tree.model.lump:
        check_nested_simulation(tree)
    check_modes(tree.model, modes, assembly.adhesions, mass, tree.findings)
    sizes = {part.index: dist(*part.box) for part in occurrences if part.box is not None}
    if sizes and all(part.exact for part in occurrences):
        largest = max(sizes, key=sizes.__getitem__)
        _check_offsets(tree, occurrences[largest], sizes[largest])
        reach = sum_of(maximum((sizes.get(member, 0.0) for member in link.members), default=0.0) for link in links)
        _check_roots(modes, reach, tree.findings)
        _check_bare_masses(occurrences, links, tree.findings)


# --- parts -------------------------------------------------------------------------------------------------------------


def _check_sizes(occurrences: Sequence[Occurrence], findings: LinkReport) -> bool:
    """Warn of each part with an implausible size, at its first component. Return whether any part has an implausible size."""
    warned: set[str] = set()
    for part in occurrences:
        if part.box is None or not part.exact or part.definition.text in warned:
            continue
        doubt = size_doubt(part.box)
        if doubt is not None and findings.warn(
            Code.SIZE, f"`{part.component.name}` (`{part.definition.label}`) {doubt}", part.origin, path=part.path, notes=part.written,
            help=unit_meant(part.component.definition, part.box),
        ):
            warned.add(part.definition.text)
    return bool(warned)


def _check_stated(occurrences: Sequence[Occurrence], findings: LinkReport) -> None:
    """Warn of specified centres of mass and inertias that do not match the shape of the part.

    Values that are computed from the shape are not checked.
    """
    warned: set[Origin] = set()
    for occurrence in occurrences:
        doubt = _stated_doubt(occurrence)
        if doubt is None:
            continue
        stated, message, help = doubt
        origin = occurrence.component.full_origin(stated.origin, occurrence.origin) if stated is not None else occurrence.origin
        notes = () if stated is not None else occurrence.written
        if origin not in warned and findings.warn(Code.STATED, message, origin, path=occurrence.path, help=help, notes=notes):
            warned.add(origin)


def _stated_doubt(occurrence: Occurrence) -> tuple[StatedValue | None, str, str] | None:
    """Compare the mass properties that a document or a Thing specifies with the shape of the part.

    If a value is implausible, return the value (None if the Thing specifies it), the message and the help text. Otherwise, return None.
    """
    mass = occurrence.properties.mass
    stated = occurrence.overrides.inertia
    if occurrence.box is None or not occurrence.exact or mass <= 0.0 or stated is not None and stated.computed:
        return None
    (low, high), centre, inertia = occurrence.box, occurrence.properties.centre, occurrence.properties.inertia
    size = dist(low, high)
    across = f"(size of the part: {length_words(size, 3)})"
    distance = hypot(*(maximum(lower - at, at - upper, 0.0) for lower, at, upper in zip(low, centre, high, strict=True)))
    if distance > size:
        message = f"the centre of mass of `{occurrence.component.name}` is {length_words(distance, 3)} outside its geometry {across}"
        help = "check the unit, such as `mm` or `m`, and the direction of the axes"
        return occurrence.overrides.com, message, help
    radius = sqrt(maximum(inertia[0][0] + inertia[1][1] + inertia[2][2], 0.0) / (2.0 * mass))
    if not size / COMPACT <= radius <= SPREAD * size:
        message = f"the inertia of `{occurrence.component.name}` has a radius of gyration of {length_words(radius, 3)} {across}"
        return stated, message, "check the unit: 1 kg*m^2 is 1e6 kg*mm^2, or 1e9 g*mm^2"
    return None


def _check_materials(tree: Tree, occurrences: Sequence[Occurrence]) -> None:
    """Warn of an implausible density of a material if no part computes its mass from this density.

    All other densities are checked together with the parts.
    """
    weighing = {
        part.material.density_origin for part in occurrences if part.material is not None and part.overrides.mass is None
        and part.record is not None and part.record.mass is None and part.record.density is None
    }
    for instance, definition in tree.assemblies:
        for material in definition.materials.values():
            doubt = density_doubt(material.density) if material.density is not None else None
            if doubt is not None and material.density_origin not in weighing:
                tree.findings.warn(
                    Code.DENSITY, f"the density of `{material.name}` {doubt.words}", material.density_origin + instance.origin,
                    path=instance.within(material.name),
                    notes=make_notes(f"no part of `{definition.name}` uses this material for its mass", definition.origin),
                    help=density_cure(doubt),
                )


def _check_mass(tree: Tree, mass: float) -> None:
    """Warn of an implausible mass of the whole robot. A robot whose mass is 0 is not checked."""
    if mass > 0.0 and not FEATHER <= mass <= ELEPHANT:
        tree.findings.warn(
            Code.ROBOT_MASS, f"the total mass of `{tree.model.name}` is implausible ({mass_words(mass)})", tree.model.origin, path="name",
            help="check the masses of the parts with `thingc info`",
        )


# --- joints ------------------------------------------------------------------------------------------------------------


def _check_limits(instance: Instance, joint: Joint, findings: LinkReport) -> None:
    """Warn of limits of a hinge that exceed several turns, and of limits with different units (rad and deg)."""
    twist = joint.twist
    if twist is None or not twist.turns:
        return
    ends = {key: value for key, value in (("lower", joint.limit.lower), ("upper", joint.limit.upper)) if value is not None}
    wide = [key for key, value in ends.items() if abs(value) > TURNS * 2.0 * pi and not twist.pitch]  # screws may turn many times
    for key in wide:
        text, number, unit = _written_value(joint, key)
        cure = f"write `{number} deg`" if unit == "rad" and abs(float(number)) <= 360.0 * TURNS else "remove a digit"
        found = f"`limit.{key}` of joint `{joint.name}` is {times_words(abs(ends[key]) / (2.0 * pi))} turns (`{text}`)"
        help = f"{cure}, or use `type: continuous` for a joint without limits"
        _warn_of_joint(Code.LIMIT_TURNS, found, instance, joint, f"limit.{key}", findings, help=help)
    if wide or len(ends) < 2 or not all(ends.values()):
        return
    (lower, _, low_unit), (upper, _, high_unit) = _written_value(joint, "lower"), _written_value(joint, "upper")
    by_option = any(key in joint.spans and joint.spans[key].option for key in ("limit.lower", "limit.upper"))  # may set only one limit
    if {low_unit, high_unit} == {"rad", "deg"} and not by_option:
        key, value = ("upper", upper) if high_unit == "rad" else ("lower", lower)
        found = f"the limits of joint `{joint.name}` have different units (`{lower}` and `{upper}`)"
        help = f"write `{twist.format(ends[key])}` instead of `{value}`"
        _warn_of_joint(Code.LIMIT_UNITS, found, instance, joint, f"limit.{key}", findings, help=help)


def _warn_of_joint(code: Code, found: str, instance: Instance, joint: Joint, key: str, findings: LinkReport, *, help: str) -> None:
    """Warn of a value of a joint, such as `limit.lower`, at the location of the value."""
    origin, path = joint.origin_of(key, joint.origin + instance.origin), instance.within(joint.path)
    findings.warn(code, found, origin, path=path, notes=_joint_note(joint, key), help=help)


def _written_value(joint: Joint, key: str) -> tuple[str, str, str]:
    """Return the text of a joint limit in the document, and the number and the unit in this text.

    If the text is not a number with a unit, the number and the unit are empty.
    """
    text = joint.written.get(f"limit.{key}", "").strip()
    match = _PLAIN.fullmatch(text)
    return (text, match[1], match[2]) if match is not None else (text, "", "")


def _joint_note(joint: Joint, key: str) -> tuple[Note, ...]:
    """Return a note with the location of the joint, or no notes if the reported value is on the same line as the joint."""
    if key not in joint.spans or joint.spans[key].line == joint.origin[0].line:
        return ()
    return make_notes(f"joint `{joint.name}` is defined here", joint.origin)


def _check_armature(instance: Instance, joint: Joint, edge: JointEdge, robot: MassProperties, findings: LinkReport) -> None:
    """Warn of an armature that is much larger than the inertia of the robot about its centre of mass, or for a slide than its mass."""
    armature, what, own, unit = edge.dynamics.armature or 0.0, "mass", robot.mass, "kg"
    if edge.turns:
        what, own, unit = "inertia", maximum(robot.inertia[k][k] for k in range(3)), "kg*m^2"
    if armature > ROTOR * own > 0.0:
        compared = f"({armature:.4g} {unit}) is {times_words(armature / own)} times the {what} of the robot ({own:.4g} {unit})"
        found, help = f"the armature of joint `{joint.name}` {compared}", "check the unit and the ratio of the transmission"
        _warn_of_joint(Code.STATED, found, instance, joint, "dynamics.armature", findings, help=help)


def _check_drive(instance: Instance, joint: Joint, edge: JointEdge, findings: LinkReport) -> None:
    """Warn of friction or damping that is so large that the drive of the joint can hardly move the joint."""
    if edge.actuator is None or not edge.actuator.effort:
        return
    effort, fastest = edge.actuator.effort, edge.actuator.velocity
    force, speed = ("N*m", "rad/s") if edge.twist.turns else ("N", "m/s")
    friction, damping = edge.dynamics.friction or 0.0, edge.dynamics.damping or 0.0
    if friction >= DRAG * effort:
        key = "dynamics.friction"
        comparison = "exceeds" if friction > effort else f"is {100.0 * friction / effort:.0f} % of"
        finding = f"the dry friction of joint `{joint.name}` ({friction:.4g} {force}) {comparison} its drive effort ({effort:.4g} {force})"
    elif fastest and damping and (effort - friction) / damping < SLOW * fastest:
        key = "dynamics.damping"
        slowest = (effort - friction) / damping
        finding = f"the damping of joint `{joint.name}` limits its speed to {slowest:.3g} {speed} (no-load speed: {fastest:.3g} {speed})"
    else:
        return
    _warn_of_joint(Code.STUCK, finding, instance, joint, key, findings, help=f"check the unit (`m{force}`, `{force}`)")


# --- actuators and mounts ----------------------------------------------------------------------------------------------


def _check_actuators(tree: Tree, occurrences: Sequence[Occurrence], mates: Sequence[Mate], exporting: Collection[int]) -> None:
    """Warn of parts with an unused actuator.

    Parts in `exporting` are skipped: the top document exports their mounts, so a parent assembly may use the actuator. Parts on a joint
    with an inline drive are also skipped.
    """
    driving: dict[int, tuple[str, Drive]] = {}
    inline: set[str] = set()
    for instance, definition in tree.assemblies:
        drives = {instance.within(joint.path): joint.drive for joint in definition.joints if joint.drive is not None}
        drives |= {instance.within(tendon.name): tendon.drive for tendon in definition.tendons if tendon.drive is not None}
        for path, drive in drives.items():
            named = tree.component(instance, drive.component) if drive.component is not None else None
            if named is not None and named.index is not None:
                user, first_drive = driving.setdefault(named.index, (path, drive))
                if user.rpartition("/")[0] != instance.path and (drive.gear or first_drive.gear):  # in one document, it is reported earlier
                    tree.findings.error(
                        Code.TRANSMISSION, f"actuator `{named.path}` drives both `{user}` and `{path}`",
                        drive.origin + instance.origin, path=path, help="remove the actuator from one of the two drives",
                        notes=make_notes(f"`{user}` is driven here", first_drive.origin),
                    )
            else:
                inline.add(path)
    for part in occurrences:
        if part.record is None or part.record.actuator is None or part.index in driving or part.index in exporting:
            continue
        name = part.component.name
        turning = [joint for mate in mates if part.index in (mate.parent, mate.child) for joint in mate.joints]
        if any(edge.path in inline for edge in turning):
            continue
        undriven = [edge for edge in turning if edge.actuator is None]
        help = f"add `drive: {name}` to the joint that the actuator moves"
        if undriven:
            help = f"add `drive: {name}` to joint `{undriven[0].path}`"
        notes: tuple[Note, ...] = ()
        for edge in (undriven or turning)[:1]:
            drive_text = "no" if undriven else "another"
            notes = make_notes(f"joint `{edge.path}` is attached to this part and has {drive_text} drive", edge.origin)
        tree.findings.warn(
            Code.IDLE_ACTUATOR, f"the actuator of `{name}` (`{part.definition.label}`) does not drive a joint", part.origin,
            path=part.path, help=help, notes=notes,
        )


def _check_mounts(tree: Tree, mates: Sequence[Mate]) -> None:
    """Warn of an exported mount that has the name of another mount of the same component, unless a mate uses the other mount."""
    used = {(end, mount) for mate in mates for end, mount in ((mate.parent, mate.parent_mount), (mate.child, mate.child_mount))}
    for instance, definition in tree.assemblies:
        for name, reference in definition.mounts.items():
            owner = tree.component(instance, reference)
            namesake = tree.find_mount(owner, name) if owner is not None else None
            mount = tree.find(instance, reference)
            if namesake is None or mount is None or (namesake.occurrence, namesake.mount) in used:
                continue
            if (namesake.occurrence, namesake.pose) == (mount.occurrence, mount.pose):
                continue
            alternative = ".".join((*reference.path, name))
            tree.findings.warn(
                Code.OTHER_MOUNT, f"the exported mount `{name}` of `{definition.name}` is `{reference.text}`, not `{alternative}`",
                reference.origin + instance.origin, path=instance.within(name), help=f"write `{name}: {alternative}`, or rename the mount",
            )


# --- places ------------------------------------------------------------------------------------------------------------


class _Offset(FrozenStruct):
    """A suspiciously long offset between components.

    The fields are the length [m], the location in the document, and texts for the warning. `text` precedes the length, and `advice` is what
    the user should check.
    """

    text: str
    length: float
    path: str
    origin: Origin
    notes: tuple[Note, ...] = ()
    advice: str = "unit (`mm`, `m`)"


def _check_offsets(tree: Tree, largest: Occurrence, size: float) -> None:
    """Warn of offsets and joint travels that are large in comparison with `size` [m], the diagonal of the largest part."""
    longest: dict[tuple[Origin, str], tuple[Instance, _Offset]] = {}  # items of a `repeat` have the same origin
    for instance, definition in tree.assemblies:
        for offset in _offsets(definition, FAR * size):
            key = (offset.origin + instance.origin, offset.text.partition("`")[0])
            if abs(offset.length) > (abs(longest[key][1].length) if key in longest else FAR * size):
                longest[key] = instance, offset
    for (origin, _), (instance, offset) in longest.items():
        tree.findings.warn(
            Code.FAR, f"{offset.text} ({length_words(offset.length)}) is {times_words(abs(offset.length) / size)} times the size of the "
            f"largest part (`{largest.path}`)", origin, path=instance.within(offset.path), notes=offset.notes,
            help=f"check the {offset.advice}",
        )


def _offsets(definition: AssemblyDefinition, bound: float) -> Iterator[_Offset]:
    """Yield the offsets between components and the joint travels of a document that are longer than `bound` [m]."""
    for component in definition.components:
        name, placement = component.name, component.placement
        if placement is not None:
            length = _length(placement.pose) if isinstance(placement, At) else abs(placement.gap)
            yield _Offset(text=f"the offset of `{name}`", length=length, path=name, origin=placement.origin)
        for mount, extra in component.mounts.items():
            yield _Offset(text=f"the offset of mount `{name}.{mount}`", length=_length(extra.pose), path=name, origin=extra.origin)
    for joint in definition.joints:
        yield from _travels(joint, bound)


def _travels(joint: Joint, bound: float) -> Iterator[_Offset]:
    """Yield the suspicious lengths of a joint: its offset at q = 0 and, for a translation, its travel.

    For a screw with a lead above `bound` [m], yield the lead instead of the travel.
    """
    per_unit, turns = (hypot(*joint.twist.linear), joint.twist.turns) if joint.twist is not None else (0.0, False)
    moved = maximum(abs(joint.gap), abs(joint.offset) * per_unit)
    yield _Offset(text=f"the offset of joint `{joint.name}`", length=moved, path=joint.name, origin=joint.origin)
    lead = tau * per_unit if turns else 0.0
    ends = {"lead": lead} if lead > bound else {
        key: value * per_unit for key, value in (("limit.lower", joint.limit.lower), ("limit.upper", joint.limit.upper))
        if value is not None
    }
    for key, length in ends.items():
        prefix, advice = "", "unit (`mm`, `m`)"
        if turns and key != "lead":
            prefix, advice = "the travel at ", f"unit (`deg`, `rev`) and the lead ({length_words(lead)})"
        yield _Offset(
            text=f"{prefix}`{key}` of joint `{joint.name}`", length=length, path=joint.name, origin=joint.origin_of(key, joint.origin),
            notes=_joint_note(joint, key), advice=advice,
        )


def _check_roots(modes: Sequence[LinkedMode], reach: float, findings: LinkReport) -> None:
    """Warn of modes whose root is far from the world origin in comparison with `reach` [m].

    `reach` is the sum of the diagonals of the largest part of each link.
    """
    for mode in modes:
        offset = _length(mode.at)
        if offset > FAR * reach:
            findings.warn(
                Code.FAR, f"the root of mode `{mode.name}` is {length_words(offset)} from the world origin (size of the robot: "
                f"{length_words(reach, 3)})", mode.origin, path=mode.name, help="check the unit (`mm`, `m`)",
            )


def _check_bare_masses(occurrences: Sequence[Occurrence], links: Sequence[Link], findings: LinkReport) -> None:
    """Warn of components with a mass but without a shape that are too heavy, or too far from the parts of their link.

    If an offset has already been reported, distances are not checked.
    """
    total = sum_of(link.properties.mass for link in links)
    for link in links:
        placed = [(occurrences[member], pose) for member, pose in zip(link.members, link.poses, strict=True)]
        boxes = [(part.box, pose) for part, pose in placed if part.box is not None]
        for occurrence, pose in placed:
            stated, mass = occurrence.overrides.mass, occurrence.properties.mass
            if occurrence.record is not None or occurrence.listed is not None or stated is None:
                continue
            others = total - mass
            if mass > BURDEN * others > 0.0:
                findings.warn(
                    Code.BARE_MASS, f"the mass of `{occurrence.component.name}` ({mass_words(mass)}) is {times_words(mass / others)} "
                    "times the mass of the other parts", occurrence.component.full_origin(stated.origin, occurrence.origin),
                    path=occurrence.path, help="check the unit (`g`, `kg`)",
                )
            elif boxes and not findings.has_reported(Code.FAR):
                # include the origin of the link, because a joint may be at the origin although the parts are far away
                link_origin = (((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)), NO_POSE)
                _check_place(occurrence, pose.apply(occurrence.properties.centre), [*boxes, link_origin], findings)


def _check_place(occurrence: Occurrence, centre: Vector, boxes: Sequence[tuple[tuple[Vector, Vector], Pose]], findings: LinkReport) -> None:
    """Warn of a component with a mass but without a shape if `centre` is far from the boxes of the other parts of its link."""
    corners = [corner for box, pose in boxes for corner in pose.around(box)]
    sides = [(minimum(extent), maximum(extent)) for extent in zip(*corners, strict=True)]
    distance = hypot(*(maximum(low - x, x - high, 0.0) for x, (low, high) in zip(centre, sides, strict=True)))
    size = maximum(high - low for low, high in sides)
    if distance > size:
        placement = occurrence.component.placement
        place = occurrence.component.full_origin(placement.origin, occurrence.origin) if isinstance(placement, At) else occurrence.origin
        findings.warn(
            Code.BARE_MASS, f"the centre of mass of `{occurrence.component.name}` is {length_words(distance, 3)} outside its link (size: "
            f"{length_words(size, 3)})", place, path=occurrence.path, help="check the unit (`mm`, `m`)",
        )


def _length(pose: Pose) -> float:
    return hypot(*pose.translation)
