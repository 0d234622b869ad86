"""Move zeros of joints and reverse joints in a document, and in the documents of the workspace that use it.

The coordinate of a joint changes by `q_new = sign * q_old + zero`, and the geometry stays the same. After each joint, the old and the new
robots are compared in their poses and in random configurations.
"""

from __future__ import annotations

import math
import os
import random
from collections.abc import Iterator, Mapping, Sequence
from fnmatch import fnmatchcase
from pathlib import Path

from msgspec.structs import replace

from thingc.base.diagnostics import Code, Diagnostic, Report, Severity, shown_path
from thingc.base.pose import Pose
from thingc.base.source import Document, entries_of, node_at, walk
from thingc.documents.format.value_edits import CannotSetValue, Keys, changes, set_values
from thingc.documents.load.discovery import documents_in
from thingc.documents.load.documents import load
from thingc.documents.spec.validation import KINDS
from thingc.documents.workspace import Workspace
from thingc.driver import pipeline
from thingc.driver.edit_document import EditResult, document_change, write_texts
from thingc.driver.environment import Environment, Options
from thingc.driver.pipeline import Compilation
from thingc.model.assembly.kinematics import joints_of
from thingc.model.assembly.types import JointEdge
from thingc.model.robot.kinematics import occurrence_poses
from thingc.model.robot.types import Robot
from thingc.tools.calibration.calibration import check_calibration, read_calibration
from thingc.tools.rezero.shift_edits import JointShift, ShiftEdits, ShiftRefused, calibration_edits, find_joint

ALIKE, CLOSED = 1e-9, 1e-6
"""Largest difference [m, or of an entry of a rotation matrix] between poses of the old and the new robot, without and with closed loops."""
CONFIGURATIONS = 3
"""Number of random configurations in which the old and the new robot are compared."""
State = tuple[Mapping[str, float], Pose | None]
"""Coordinates [rad or m] by joint, and the pose of the root in the world."""


def rezero(
    document: str, shifts: Sequence[JointShift], options: Options, *, calibrations: Sequence[str] = (), strict: bool = False,
    dry: bool = False,
) -> EditResult:
    """Move joints of a document file, unless this would cause errors or other poses. With `dry`, no file is written.

    `calibrations` are the paths of calibrations of this robot, which change as well. The result contains a warning for each other
    calibration of the workspace that contains one of the joints.
    """
    first = _compile(document, options)
    report = first.report
    read = () if first.assembly is None else [read_calibration(path, first.assembly, report) for path in dict.fromkeys(calibrations)]
    if first.documents is None or report.failed:
        return EditResult(found=tuple(report.sorted_diagnostics()))
    root, edits, calibrated = first.documents.root, dict[str, dict[Keys, str]](), [one for one in read if one is not None]
    try:
        old = {root.path: first}
        users = [*_documents_with(root, shifts)]
        old |= {user.path: _sound(user.path, options) for user in users if user.kind == "assembly"}
        given = {one.document.path for one in calibrated}
        unchanged = [_warn_unchanged(user) for user in users if user.kind == "calibration" and user.path not in given]
        originals = documents = {path: one.documents.root for path, one in old.items() if one.documents is not None}
        for shift in shifts:
            moved = {path: _moved_joints(documents[root.path], compilation, shift) for path, compilation in old.items()}
            new_edits = {path: _edits(documents[path], one, shift, moved[path], own=path == root.path) for path, one in old.items()}
            documents = {path: set_values(document, new_edits[path]) for path, document in documents.items()}
            edits = {path: edits.get(path, {}) | new_edits[path] for path in old}
            texts = {path: document_change(originals[path], one.text)[1] for path, one in documents.items()}
            new = {path: _sound(path, replace(options, texts=texts)) for path in old}
            for path in old:
                _compare(documents[path], old[path], new[path], shift, [joint.path for joint in moved[path]])
            old = new
        _check_variants(users, shifts, edits)
        for one in calibrated:
            originals |= {one.document.path: one.document}
            edits[one.document.path] = dict(calibration_edits(one.joints, shifts))
            documents |= {one.document.path: set_values(one.document, edits[one.document.path])}
            if (assembly := old[root.path].assembly) is not None:
                check_calibration(documents[one.document.path], assembly, report)
    except CannotSetValue as fault:
        return EditResult(found=(ShiftRefused(str(fault), "edit the document by hand", span=fault.span).diagnostic,))
    except ShiftRefused as refused:
        return EditResult(found=(refused.diagnostic,))
    if report.failed:
        return EditResult(found=tuple(report.sorted_diagnostics()))
    changes = [change for path, own in edits.items() for change in _result_rows(root, originals[path], own)]
    changed = {path: (originals[path], one.text) for path, one in documents.items() if edits[path]}
    result = write_texts(root, changed, tuple(changes), options, strict=strict, dry=dry)
    return replace(result, found=(*result.found, *unchanged))


def _warn_unchanged(calibration: Document) -> Diagnostic:
    message = f"the calibration `{calibration.relative}` of the same joints was not changed"
    help = f"use `--calibration {shown_path(calibration.path)}`, or edit the file by hand"
    span = calibration.span(("joints",), key=True)
    return Diagnostic(code=Code.COMMAND_LINE, severity=Severity.WARNING, message=message, help=help, span=span)


def _result_rows(root: Document, document: Document, edits: Mapping[Keys, str]) -> Iterator[tuple[str, str | None, str]]:
    place = "" if document.path == root.path else f"{document.relative}: "
    return ((place + path, before, after) for path, before, after in changes(document, edits) if before != after)


def _compile(document: str, options: Options) -> Compilation:
    with Environment(document, replace(options, lock=True)) as environment:
        return pipeline.compile(environment)


def _sound(document: str, options: Options) -> Compilation:
    """Compile a document. Raises `ShiftRefused` with its first error."""
    compilation = _compile(document, options)
    error = next((one for one in compilation.report.sorted_diagnostics() if one.severity is Severity.ERROR), None)
    if error is not None:
        message = f"error in `{shown_path(document)}`: {error.message}"
        raise ShiftRefused(message, error.help or "edit the document by hand", span=error.span)
    return compilation


def _documents_with(root: Document, shifts: Sequence[JointShift]) -> Iterator[Document]:
    """Yield the assemblies of the workspace that use the document `root`, the variants documents, and the calibrations that contain a joint
    of its name, also in a nested document. Raises `ShiftRefused` for a file that names the document but cannot be read.
    """
    workspace = Workspace.find(root.path, Report())
    if workspace is None:
        return
    for path in documents_in(workspace.root, workspace):
        report = Report()
        documents = load(path, workspace, report, kinds=KINDS)
        if documents is None:
            _check_unrelated(path, root, report)
        if documents is None or path == root.path:
            continue
        names = {name.rpartition(".")[2] for name in entries_of(node_at(documents.root.tree, ("joints",)))}  # also `left.knee`
        of_joints = any(shift.joint in names for shift in shifts)
        of_kind = {"variants": True, "calibration": of_joints}.get(documents.root.kind, False)
        if of_kind or any(one.path == root.path for one in documents.by_path.values()):
            yield documents.root


def _check_variants(users: Sequence[Document], shifts: Sequence[JointShift], edits: Mapping[str, Mapping[Keys, str]]) -> None:
    """Raise `ShiftRefused` for variants of the edited documents that set a coordinate of the joints, or a value that has changed."""
    names, changed = {os.path.basename(path) for path in edits}, tuple("." + ".".join(keys) for own in edits.values() for keys in own)
    for user in (one for one in users if one.kind == "variants" and any(name in one.text for name in names)):
        for keys, node in walk(user.tree):
            parts = str(keys[-1]).split(".") if keys else []
            named = [part for section in ("joints", "poses") if section in parts for part in parts[parts.index(section) + 1 :]]
            if f".{'.'.join(parts)}".endswith(changed) or any(fnmatchcase(shift.joint, part) for shift in shifts for part in named):
                raise ShiftRefused(f"`{user.relative}` may set values of the changed joints", "edit both documents by hand", span=node.span)


def _check_unrelated(path: str, root: Document, report: Report) -> None:
    """Raise `ShiftRefused` if a file that cannot be read contains the name of the document, which it may use."""
    error = report.sorted_diagnostics()[0]
    try:
        uses = os.path.basename(root.path).encode() in Path(path).read_bytes()
    except OSError:
        uses = False
    if uses:
        message = f"`{shown_path(path)}` may use `{root.relative}`: {error.message}"
        raise ShiftRefused(message, error.help or "fix the file first", span=error.span)


def _moved_joints(root: Document, compilation: Compilation, shift: JointShift) -> list[JointEdge]:
    """Return the joints of a robot that a joint of the document `root` defines."""
    assert compilation.assembly is not None
    place = root.span(("joints", shift.joint), key=True)
    return [joint for joint in joints_of(compilation.assembly) if joint.origin[:1] == (place,)]


def _edits(document: Document, compilation: Compilation, shift: JointShift, moved: Sequence[JointEdge], *, own: bool) -> dict[Keys, str]:
    """Return the edits of a document. If `own` is true, the document defines the joint. Raises `ShiftRefused`."""
    model, assembly = compilation.model, compilation.assembly
    assert model is not None and assembly is not None
    joint = find_joint(document, model, shift) if own else None
    if not moved:
        return {}
    independent = [one.name for one in joints_of(assembly) if one.mimic is None and not one.kind.at_once]
    return dict(ShiftEdits(document, model, shift, [str(one.name) for one in moved], moved[0].twist.coordinate, independent).edits(joint))


def _compare(document: Document, old: Compilation, new: Compilation, shift: JointShift, moved: Sequence[str]) -> None:
    """Raise `ShiftRefused` unless the old and the new robot are equal in all poses and in random configurations."""
    for one, other in zip(old.robots, new.robots, strict=True):
        for pose, before, after in _states(one, other, shift, moved):
            difference = math.inf if after is None else _largest_difference(occurrence_poses(one, *before), occurrence_poses(other, *after))
            if difference > (CLOSED if one.closures else ALIKE):
                message = f"the links would move by {difference:.3g} in {f'pose `{pose}` of ' if pose else ''}mode `{one.mode.name}`"
                raise ShiftRefused(message, f"set `{shift.joint}` in all poses first", span=document.span(("poses", pose) if pose else ()))


def _states(one: Robot, other: Robot, shift: JointShift, moved: Sequence[str]) -> Iterator[tuple[str, State, State | None]]:
    """Yield equal states of the old and the new robot: poses by name, the start, and random configurations."""
    frames = {frame.name: frame for frame in other.keyframes} | {one.start.name: other.start}
    for frame in (one.start, *one.keyframes):
        if frame != one.start or one.mode.stated:
            after = frames.get(frame.name)
            yield frame.name, (frame.q, frame.base), None if after is None else (after.q, after.base)
    draw = random.Random(0)
    for _ in range(CONFIGURATIONS):
        q = {joint.path: draw.uniform(-1.0, 1.0) for joint in joints_of(one.assembly) if joint.mimic is None}
        shifted = {path: shift.sign * value + float(shift.zero.value) if path in moved else value for path, value in q.items()}
        yield "", (q, None), (shifted, None)


def _largest_difference(one: Sequence[Pose], other: Sequence[Pose]) -> float:
    """Return the largest difference of a coordinate [m] or of an entry of a rotation matrix."""
    numbers = ([x for pose in poses for x in (*pose.translation, *sum(pose.rotation, ()))] for poses in (one, other))
    return float(max(abs(x - y) for x, y in zip(*numbers, strict=True)))
