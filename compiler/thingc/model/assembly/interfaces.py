"""Check what is attached to mounts: the interfaces of mounts that meet, screws with the holes that they reach, and expected parts."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence

from thingc.base.diagnostics import Code, Note, Report, make_notes
from thingc.base.interfaces import SAME, SAME_PLACE, Bolts, MountPair, Shank, compare, mm, nominal
from thingc.base.numeric import hypot, minimum
from thingc.base.pose import NO_POSE, Pose
from thingc.base.source import Origin
from thingc.documents.load.paths import MESH_SUFFIXES
from thingc.geometry.declared_interfaces import contradictions
from thingc.geometry.features import Features
from thingc.geometry.record import MountExpectation
from thingc.model.assembly.report import LinkReport
from thingc.model.assembly.types import Connected, Occurrence

ENGAGED = 0.8
"""Smallest engaged length of a thread relative to its diameter: the height of a nut (ISO 4032)."""
_NUMBER = re.compile(r"\d+\.\d+(?:e[+-]?\d+)?|\d+e[+-]?\d+")
_HELP = "use mounts that fit together, or correct the `interface` of a mount"


def check_interfaces(robot: Connected, placed_by_at: Collection[int], findings: LinkReport) -> None:
    """Report each mate whose mounts do not fit together.

    `placed_by_at` contains the indices of mates from `at`, which do not connect mounts. A mate that `repeat` or a nested document creates
    several times is reported once.
    """
    reported: set[tuple[Origin, str]] = set()
    for number, mate in enumerate(robot.mates):
        parent, child = robot.occurrences[mate.parent], robot.occurrences[mate.child]
        if number in placed_by_at or not (parent.exact and child.exact):
            continue
        parent_mount, child_mount = parent.mounts[mate.parent_mount], child.mounts[mate.child_mount]
        if not parent_mount.features or not child_mount.features:
            continue
        pose = parent_mount.pose.inverse() @ mate.X_PJ @ mate.X_JC @ child_mount.pose
        twists = [joint.twist for joint in mate.joints]
        turns, slides = (any(any(getattr(twist, part)) for twist in twists) for part in ("angular", "linear"))
        mismatches = compare(parent_mount.features, child_mount.features, MountPair(pose=pose, turns=turns, slides=slides))
        parent_name, child_name = mount_name(parent, mate.parent_mount), mount_name(child, mate.child_mount)
        key = _copy_key(mate.origin, parent, child)
        if mismatches and key not in reported:
            reported.add(key)
            details = "; ".join(
                f"{a} on `{parent_name}`, {b} on `{child_name}`" + (f" ({reason})" if reason else "") for a, b, reason in mismatches
            )
            findings.error(
                Code.INTERFACE, f"mount `{child_name}` does not fit `{parent_name}`: {details}", mate.origin, path=child.path, help=_HELP,
                notes=(*_declaration_note(parent, mate.parent_mount), *_declaration_note(child, mate.child_mount)),
            )


def check_screws(robot: Connected, findings: LinkReport) -> None:
    """Warn of each screw that does not fit the threaded hole that it reaches.

    A screw is a component with a `Shank` at the mount that is attached. The threaded hole belongs to the part below the head, or to a part
    that is rigidly mated with this part.
    """
    rigid: dict[int, dict[int, Pose]] = {index: {index: NO_POSE} for index in range(len(robot.occurrences))}
    fixed = [mate for mate in robot.mates if not mate.joints]
    for mate in fixed:
        pose = mate.X_PJ @ mate.X_JC
        rigid[mate.parent][mate.child], rigid[mate.child][mate.parent] = pose, pose.inverse()
    reported: set[tuple[Origin, str]] = set()
    for mate in fixed:
        ends = ((mate.child, mate.child_mount), (mate.parent, mate.parent_mount))
        for (index, mount), (neighbour, head) in (ends, ends[::-1]):
            screw = robot.occurrences[index]
            for shank in (feature for feature in screw.mounts[mount].features if isinstance(feature, Shank)):
                seat = (rigid[neighbour][index] @ screw.mounts[mount].pose).inverse()
                parts = [(robot.occurrences[part], pose) for part, pose in rigid[neighbour].items() if part != index]
                holes = sorted(hole for part, pose in parts for hole in _threaded_holes(part, seat @ pose))
                fault = _screw_fault(shank, *holes[0]) if holes else None
                if fault is not None and _copy_key(mate.origin, screw) not in reported:
                    reported.add(_copy_key(mate.origin, screw))
                    subject = f"screw `{screw.name}` on `{mount_name(robot.occurrences[neighbour], head)}`"
                    help = "use a screw of another size, or correct the `depth` of the hole"
                    findings.warn(Code.SCREW, f"{subject} {fault}", mate.origin, path=screw.path, help=help)


def _threaded_holes(part: Occurrence, pose: Pose) -> Iterator[tuple[float, float, str, str]]:
    """Yield the distance, the depth, the thread and the mount of each threaded hole that faces a screw.

    `pose` is the pose of the part in the frame of the screw's head, with z along the shank.
    """
    for name, mount in part.mounts.items() if part.exact else ():
        for feature in mount.features:
            if isinstance(feature, Bolts) and feature.depth is not None and (hole_pose := pose @ mount.pose).rotation[2][2] < -1.0 + 1e-9:
                for x, y in feature.points:
                    u, v, w = hole_pose.apply((x, y, 0.0))
                    if hypot(u, v) <= SAME_PLACE and w >= -SAME:
                        yield w, feature.depth, feature.thread, mount_name(part, name)


def _screw_fault(shank: Shank, distance: float, depth: float, thread: str, mount: str) -> str | None:
    """Describe how a screw does not fit the threaded hole that it reaches, or return None."""
    engaged, needed = shank.length - distance, minimum(depth, ENGAGED * (nominal(shank.thread) or 0.0))
    if shank.thread.casefold() != thread.casefold():
        return f"has the thread {shank.thread}, expected {thread} at `{mount}`"
    if engaged > depth + SAME:
        return f"({mm(shank.length)}) is too long for the hole at `{mount}` (at most {mm(distance + depth)})"
    if engaged <= 0.0:
        return f"({mm(shank.length)}) is too short to reach `{mount}` ({mm(distance)})"
    return f"engages only {mm(engaged)} of the thread at `{mount}` (at least {mm(needed)} required)" if engaged < needed - SAME else None


def check_declared(robot: Connected, findings: LinkReport) -> None:
    """Warn of each feature that a part class declares and that the geometry does not have. Each part is reported once."""
    reported: set[str] = set()
    for part in robot.occurrences:
        mounts = part.record.mounts if part.record is not None and part.definition.text not in reported else {}
        for name, declaration in [(name, declaration) for name, mount in mounts.items() for declaration in mount.contradictions]:
            message = f"mount `{name}` of `{part.definition.label}` does not match its interface {declaration}"
            help = "correct the `interface` of the mount, or the geometry of the part"
            if findings.warn(Code.INTERFACE_GEOMETRY, message, part.origin, path=part.path, notes=_declaration_note(part, name), help=help):
                reported.add(part.definition.text)


def check_added_interfaces(assembly: Connected, measure: Callable[[Collection[str]], Mapping[str, Features]], report: Report) -> None:
    """Warn of each feature of a mount in a document that the geometry of the part does not have.

    `measure` returns the features of B-reps by their digests. Meshes have no cylinders, and are not measured.
    """
    added = {
        mount.origin[:1]: (part, name, mount, part.record.brep) for part in reversed(assembly.occurrences)
        for name, mount in part.component.mounts.items() if mount.features and part.record is not None and part.record.brep is not None
        and not part.definition.reference.lower().endswith((*MESH_SUFFIXES, ".3mf", ".off", ".gltf"))
    }
    measured = measure({brep for *_, brep in added.values()}) if added else {}
    for part, name, mount, brep in reversed(added.values()):
        for declaration in contradictions(mount.features, mount.pose, measured[brep]):
            report.warn(
                Code.INTERFACE_GEOMETRY, f"mount `{mount_name(part, name)}` does not match its interface {declaration}", mount.origin,
                path=part.path, help="correct the `interface` or the pose of the mount", allow=True,
            )


def mount_name(occurrence: Occurrence, mount: str) -> str:
    """Return the name of a mount as in the top document, such as `hand.cap.pen`."""
    return mount.replace("/", ".") if "/" in mount else f"{occurrence.name}.{mount}"


def _copy_key(origin: Origin, *occurrences: Occurrence) -> tuple[Origin, str]:
    """Return a key that is equal for the copies of a mate that `repeat` or a nested document creates."""
    return origin[:1], re.sub(r"\d+", "#", " ".join(occurrence.component.name for occurrence in occurrences))


def _declaration_note(occurrence: Occurrence, mount: str) -> tuple[Note, ...]:
    """Return a note with the location at which the interface of a mount is declared."""
    added = occurrence.component.mounts.get(mount)
    if added is not None:
        return make_notes(f"`{mount_name(occurrence, mount)}` is defined here", added.origin)
    return occurrence.written


def check_expectations(robot: Connected, placed_by_at: Collection[int], findings: LinkReport) -> None:
    """Warn of each mount at which a component other than the expected one is attached.

    `placed_by_at` contains the indices of mates from `at`, which do not connect mounts. An empty mount is accepted if the top document
    exports the mount, because a parent assembly may use it.
    """
    occurrences = robot.occurrences
    open_mounts = {(mount.occurrence, mount.mount) for mount in robot.exported if "/" not in mount.path}
    mates_at: dict[tuple[int, str], list[tuple[int, str]]] = {}
    for number, mate in enumerate(robot.mates):
        if number not in placed_by_at:
            mates_at.setdefault((mate.parent, mate.parent_mount), []).append((mate.child, mate.child_mount))
            mates_at.setdefault((mate.child, mate.child_mount), []).append((mate.parent, mate.parent_mount))
    for owner in occurrences:
        expected = owner.record.expectations if owner.record is not None else ()
        for expectation in expected:
            attached = [(occurrences[index], mount) for index, mount in mates_at.get((owner.index, expectation.mount), ())]
            if any(_is_expected(part, expectation, owner) and mount == expectation.child_mount for part, mount in attached):
                continue
            if not attached and (owner.index, expectation.mount) in open_mounts:
                continue
            alternatives = [e for e in expected if e.mount == expectation.mount]
            others = [(o, m) for o, m in attached if not any(_is_expected(o, e, owner) and m == e.child_mount for e in alternatives)]
            _warn_unexpected(owner, expectation, others, findings)


def _is_expected(part: Occurrence, expected: MountExpectation, owner: Occurrence) -> bool:
    """Return whether `part` is the part that the class of `owner` expects at the mount.

    On a mirrored part, the mirror image of the expected part is required. For a symmetric part, the mirror image is the part itself.
    """
    original = part.definition.plain if owner.definition.mirror is not None else None
    texts = (part.definition.text,) if original is None else (part.definition.text, original.text)
    return part.record is not None and _round_definition(expected.text) in map(_round_definition, texts)


def _round_definition(definition: str) -> str:
    """Round the numbers in the text of a definition to 12 digits, because the conversion to millimetres can change the last digits."""
    return _NUMBER.sub(lambda number: f"{float(number[0]):.12g}", definition)


def _warn_unexpected(
    owner: Occurrence, expectation: MountExpectation, found: Sequence[tuple[Occurrence, str]], findings: LinkReport,
) -> None:
    name, expected = owner.component.name, expectation.label
    part, mount = next(((o, m) for o, m in found if _is_expected(o, expectation, owner)), found[0] if found else (None, ""))
    label = part.definition.label if part is not None else ""
    if part is not None and label == expected:  # the labels are equal, because they do not show the digits that differ
        expected, label = expectation.text, part.definition.text
    text = f"expected `{expected}` on mount `{name}.{expectation.mount}`"
    help = f"attach the mount `{expectation.child_mount}` of `{expected}` to `{name}.{expectation.mount}`"
    if part is None:
        findings.warn(Code.EXPECTATION, f"{text}, found nothing", owner.origin, path=owner.path, help=help)
        return
    if _is_expected(part, expectation, owner):
        message = f"expected mount `{expectation.child_mount}` of `{part.component.name}` on `{name}.{expectation.mount}`, found `{mount}`"
    else:
        message = f"{text}, found `{part.component.name}` (`{label}`)"
    notes = make_notes(f"`{name}` is defined here", owner.origin)
    findings.warn(Code.EXPECTATION, message, part.origin, path=part.path, help=help, notes=notes)
