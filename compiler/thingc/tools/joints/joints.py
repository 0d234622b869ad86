"""Propose joints for a document, and write accepted joints into the document."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence

from thingc.base.diagnostics import Code, Diagnostic, Report, Severity, UserError
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.pose import Pose, along
from thingc.base.source import Document, MappingNode, node_at
from thingc.base.suggestions import did_you_mean
from thingc.documents.format.value_edits import CannotSetValue, Keys, Written, remove_value, set_values
from thingc.driver import pipeline
from thingc.driver.edit_document import EditResult, write_texts
from thingc.driver.environment import Environment, Options
from thingc.geometry.features import CentreLine, Features
from thingc.geometry.record import AssemblyFailed
from thingc.model.assembly.types import Assembly, Occurrence
from thingc.tools.importing.quantities import length, pose_entries
from thingc.tools.joints.contacts import CLEARANCE, Contact, contact, place_features
from thingc.tools.joints.proposals import ComponentBody, JointProposal, JointSearch, Pair, round_axes


class JointProposals(FrozenStruct):
    """The joints that the geometry of a document suggests. `document` is None if the document has errors, which `found` contains.

    `frames` maps the components of the document to the poses of their frames, and `base` is the component that the document does not place.
    """

    found: tuple[Diagnostic, ...]
    document: Document | None = None
    proposals: tuple[JointProposal, ...] = ()
    frames: Mapping[str, Pose] = {}
    base: str = ""
    search: JointSearch | None = None


def propose_joints(path: str, options: Options, *, strict: bool = False) -> JointProposals:
    """Compile a document, and propose joints between its components. A nested document counts as one rigid component."""
    with Environment(path, options) as environment:
        compilation = pipeline.compile(environment)
        found = tuple(compilation.report.apply_strict(strict=strict).sorted_diagnostics())
        assembly = compilation.assembly
        if assembly is None or compilation.documents is None or any(one.severity is Severity.ERROR for one in found):
            return JointProposals(found=found)
        breps = {one.record.brep for one in assembly.occurrences if one.record is not None and one.record.brep is not None}
        try:
            features = environment.geometry.features(breps)
        except AssemblyFailed as fault:
            report = Report()
            report.add(Code.INTERNAL, f"the CAD kernel cannot read a part: {fault.reason}", assembly.definition.origin, detail=fault.detail)
            return JointProposals(found=(*found, *report.diagnostics))
    bodies, contacts, moved = _bodies_and_contacts(assembly, features)
    rigid, joined = _connected_pairs(assembly)
    search = JointSearch(bodies, contacts, [*rigid, *moved], joined)
    return JointProposals(
        found=found, document=compilation.documents.root, proposals=tuple(search.proposals()), frames=_frames(assembly),
        base=_component(assembly.occurrences[_bases(assembly, "")[0]]), search=search,
    )


def _component(occurrence: Occurrence) -> str:
    return occurrence.path.partition("/")[0]


def _bodies_and_contacts(
    assembly: Assembly, features: Mapping[str, Features],
) -> tuple[list[ComponentBody], dict[Pair, Contact], list[Pair]]:
    """Return the components of the document, and the contacts between the parts of different components.

    The last result contains the pairs of components that touch at a part which a joint of a nested document moves.
    """
    moves = {
        one.index for one in assembly.occurrences
        if one.path != (name := _component(one)) and assembly.link_of[one.index] != assembly.link_of[_bases(assembly, f"{name}/")[0]]
    }
    moved: list[Pair] = []
    parts = [
        (one, place_features(features[one.record.brep], assembly.rest[one.index]), assembly.rest[one.index].around(one.box))
        for one in assembly.occurrences if one.record is not None and one.record.brep is not None and one.box is not None
    ]
    members: dict[str, list[tuple[Occurrence, Features]]] = {_component(one): [] for one in assembly.occurrences}
    for one, own, _ in parts:
        members[_component(one)].append((one, own))
    contacts: dict[Pair, Contact] = {}
    for number, (one, own, (low, high)) in enumerate(parts):
        for other, its, (lower, upper) in parts[number + 1 :]:
            pair = (_component(one), _component(other))
            near = all(low[k] <= upper[k] + CLEARANCE and lower[k] <= high[k] + CLEARANCE for k in range(3))
            if pair[0] != pair[1] and near:
                new, known = contact(own, its), contacts.get(pair, Contact())
                contacts[pair] = Contact(shafts=known.shafts + new.shafts, faces=known.faces + new.faces, holes=known.holes + new.holes)
                moved += [pair] if new != Contact() and not moves.isdisjoint((one.index, other.index)) else []
    return [_body(name, of, assembly) for name, of in members.items()], contacts, moved


def _body(name: str, parts: Sequence[tuple[Occurrence, Features]], assembly: Assembly) -> ComponentBody:
    axes: tuple[CentreLine, ...] = ()
    if len(parts) == 1:
        one, features = parts[0]
        lines = [each.line for each in features.cylinders if not each.hollow and each.sweep > 6.0]
        axes = round_axes(one.properties.inertia, one.properties.centre, lines, assembly.rest[one.index])
    words = (parts[0][0].definition.text,) if len(parts) == 1 else ()
    return ComponentBody(name=name, words=words, mass=sum(one.properties.mass for one, _ in parts), round_about=axes)


def _connected_pairs(assembly: Assembly) -> tuple[list[Pair], list[Pair]]:
    """Return the pairs of components that mounts attach rigidly, and the pairs that joints connect."""
    rigid: list[Pair] = []
    joined: list[Pair] = []
    for mate in assembly.mates:
        first, second = sorted((mate.parent, mate.child))
        pair = (_component(assembly.occurrences[first]), _component(assembly.occurrences[second]))
        if pair[0] != pair[1]:
            if mate.joints:
                joined.append(pair)
            elif mate.child_mount != "origin":
                rigid.append(pair)
    return rigid, joined


def _bases(assembly: Assembly, prefix: str) -> list[int]:
    """Return the occurrences below a path that no other occurrence below this path places."""
    inside = {one.index for one in assembly.occurrences if one.path.startswith(prefix)}
    placed_inside = {mate.child for mate in assembly.mates if mate.loop is None and {mate.parent, mate.child} <= inside}
    return sorted(inside - placed_inside)


def _frames(assembly: Assembly) -> dict[str, Pose]:
    """Return the poses of the frames of the components. The frame of a nested document is the frame of its base."""
    frames: dict[str, Pose] = {}
    for one in assembly.occurrences:
        name = _component(one)
        if name not in frames:
            frames[name] = assembly.rest[one.index if one.path == name else _bases(assembly, f"{name}/")[0]]
    return frames


def write_joints(
    proposed: JointProposals, names: Collection[str], options: Options, *, strict: bool = False, dry: bool = False,
) -> EditResult:
    """Write proposed joints into the document: those in `names`, or all unambiguous joints if `names` is empty."""
    assert proposed.document is not None and proposed.search is not None, "the document has errors"
    known = [one.name for one in proposed.proposals]
    wrong = [
        UserError(f"there is no proposed joint `{name}`", did_you_mean(name, known, what="proposals")).diagnostic
        for name in names if name not in known
    ]
    accepted = [one for one in proposed.proposals if (one.name in names if names else one.doubt is None)]
    if wrong or not accepted:
        return EditResult(found=tuple(wrong))
    document, groups = proposed.document, proposed.search.groups(accepted)
    rigid = [one.name for one in accepted if any(one.parent in group and one.child in group for group in groups)]
    if rigid:
        message = f"the parts of the proposed joint `{rigid[0]}` are rigidly connected by other contacts"
        help = "accept other proposals too, or write the joint into the document by hand"
        return EditResult(found=(UserError(message, help).diagnostic,))
    try:
        values, removed, changes = _edits(proposed, accepted, groups)
        _refuse_copies(document, values)
        changed = document
        for keys in removed:
            if node_at(changed.tree, keys) is not None:
                changed = remove_value(changed, keys)
        changed = set_values(changed, values)
    except CannotSetValue as fault:
        return EditResult(found=(UserError(str(fault), "edit the document by hand").diagnostic,))
    return write_texts(document, {document.path: (document, changed.text)}, tuple(changes), options, strict=strict, dry=dry)


def _refuse_copies(document: Document, values: Mapping[Keys, Written]) -> None:
    """Raise `CannotSetValue` for a component that is not in the text of the document, because `repeat` creates it."""
    for keys in values:
        if keys[0] == "components" and not isinstance(node_at(document.tree, keys[:2]), MappingNode):
            raise CannotSetValue(document, keys[:2], "is a copy of a repeated component")


def _edits(
    proposed: JointProposals, accepted: Sequence[JointProposal], groups: Sequence[Sequence[str]],
) -> tuple[dict[Keys, Written], list[Keys], list[tuple[str, str | None, str]]]:
    """Return the new values, the keys to remove, and descriptions of the changes.

    Starting at the base, each joint places one component of a new group of rigidly connected components, and this component places the
    other components of the group. A joint between groups that are already placed closes a loop.
    """
    of = {name: number for number, group in enumerate(groups) for name in group}
    values: dict[Keys, Written] = {}
    removed: list[Keys] = []
    changes: list[tuple[str, str | None, str]] = []
    mounts: dict[str, dict[str, Written]] = {}
    for one, parent, child, closes in _outwards(accepted, of, of[proposed.base]):
        frame = along(one.line.axis, one.line.point)
        for name in (parent, child):
            mounts.setdefault(name, {})[one.name] = _pose_values(proposed.frames[name].inverse() @ frame)
        joint: dict[str, Written] = {
            "type": "continuous" if one.kind == "revolute" else "prismatic", "parent": f"{parent}.{one.name}",
            "child": f"{child}.{one.name}", "axis": ["0", "0", "1"],
        }
        if one.kind == "prismatic":
            joint["limit"] = {"lower": length(-one.travel), "upper": length(one.travel)}
        if closes:
            joint["loop"] = "true"
        else:
            for name in groups[of[child]]:
                removed += [("components", name, "at"), ("components", name, "attach")]
                if name != child:
                    pose = proposed.frames[child].inverse() @ proposed.frames[name]
                    values["components", name, "at"] = {"in": f"{child}.origin", **_pose_values(pose)}
        values["joints", one.name] = joint
        changes.append((f"joints.{one.name}", None, f"{one.kind}, {parent} -> {child}"))
    for name, added in mounts.items():
        place = ("components", name, "mounts")
        exist = proposed.document is not None and node_at(proposed.document.tree, place) is not None
        values |= {(*place, mount): pose for mount, pose in added.items()} if exist else {place: added}
    return values, removed, changes


def _outwards(accepted: Sequence[JointProposal], of: Mapping[str, int], base: int) -> Iterator[tuple[JointProposal, str, str, bool]]:
    """Yield each joint with its parent, its child, and whether it closes a loop, starting at the group `base`."""
    reached, waiting = {base}, list(accepted)
    while waiting:
        one = next((one for one in waiting if of[one.parent] in reached or of[one.child] in reached), None)
        if one is None:  # the groups are placed in the base, so the joint can start at either side
            one = waiting[0]
            reached.add(of[one.parent])
        waiting.remove(one)
        parent, child = (one.parent, one.child) if of[one.parent] in reached else (one.child, one.parent)
        yield one, parent, child, of[child] in reached
        reached.add(of[child])


def _pose_values(pose: Pose) -> dict[str, Written]:
    """Return the keys of a pose in a document."""
    return {key: text.strip("[]").split(", ") if text.startswith("[") else text for key, text in pose_entries(pose).items()}
