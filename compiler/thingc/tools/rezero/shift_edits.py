"""Compute the new values of a document for a joint whose zero moves, or whose direction reverses."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterator, Sequence
from fnmatch import fnmatchcase
from fractions import Fraction

from msgspec.structs import replace

from thingc.base.diagnostics import UserError, shown_path
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.source import Document, Path, ScalarNode, SequenceNode, Span, entries_of, node_at, text_of, walk
from thingc.base.suggestions import did_you_mean
from thingc.base.units import Dimension, UnitError
from thingc.documents.format.value_edits import Keys
from thingc.model.assembly.modes import unused_pose_name
from thingc.model.resolve.references import GLOB, INDEX
from thingc.model.resolve.types import AssemblyDefinition, Joint
from thingc.tools.calibration.calibration import CalibratedJoint
from thingc.tools.rezero.quantity_text import ExactQuantity, read_quantity

OF_ZERO = frozenset({"ctrl", "ctrlrange", "polycoef", "qpos", "range", "ref", "springref"})
OF_DIRECTION = OF_ZERO | {"forcerange", "gear"}
"""Raw attributes of MuJoCo elements that may depend on the zero or the direction of a joint."""
Edits = Iterator[tuple[Keys, str]]
ZERO = ExactQuantity()


class ShiftRefused(UserError):
    """Raised if the zero or the sign of a joint cannot be changed. `diagnostic` contains the reason and the location."""


class JointShift(FrozenStruct):
    """The change of the coordinate of a joint: `q_new = sign * q_old + zero`."""

    joint: str
    sign: int
    zero: ExactQuantity


def find_joint(document: Document, model: AssemblyDefinition, shift: JointShift) -> Joint:
    """Return the joint of a shift. Raises `ShiftRefused` if the document does not define a joint whose coordinate can change."""
    name, span = shift.joint, document.span(("joints", shift.joint), key=True)
    joint = next((one for one in model.joints if one.name == name), None)
    node = node_at(document.tree, ("joints", name))
    if joint is None or node is None:
        component, _, suffix = name.partition(".")
        inner = node_at(document.tree, ("components", component, "assembly"))
        if suffix and isinstance(inner, ScalarNode):
            message = f"joint `{suffix}` is defined in the nested document `{inner.text}`"
            path = shown_path(os.path.normpath(os.path.join(os.path.dirname(document.path), inner.text)))
            raise ShiftRefused(message, f"use `thingc rezero {path} {suffix}=...`", span=inner.span)
        if joint is None and node is None:
            help = did_you_mean(name, entries_of(node_at(document.tree, ("joints",))), what="joints")
            raise ShiftRefused(f"there is no joint `{name}`", help)
        raise ShiftRefused(f"joint `{name}` is repeated or has several coordinates", "edit the values of the joint by hand", span=span)
    if joint.twist is None:
        raise ShiftRefused(f"joint `{name}` does not move ({joint.kind.words})", "choose a joint that moves", span=span)
    unit = joint.twist.coordinate
    if shift.zero.value and shift.zero.dimension != unit:
        raise ShiftRefused(f"the zero of joint `{name}` must be {unit.words}", f"write, for example, `{name}={unit.example}`", span=span)
    return joint


class ShiftEdits:
    """The edits of a document for a joint that it defines, or that a nested document defines.

    `model` is the definition that the document specifies. `names` are the names of the joint in the document, `coordinate` is its physical
    dimension, and `independent` contains the names of all joints that poses can set. Raises `ShiftRefused`.
    """

    def __init__(
        self, document: Document, model: AssemblyDefinition, shift: JointShift, names: Sequence[str], coordinate: Dimension,
        independent: Collection[str],
    ) -> None:
        self.document, self.model, self.shift = document, model, shift
        self.names, self.coordinate, self.independent = names, coordinate, independent

    def edits(self, joint: Joint | None) -> Edits:
        """Yield the path and the text of each new value. `joint` is None if another document defines it. Raises `ShiftRefused`."""
        self._check_raw()
        if joint is not None:
            yield from self._motion(joint)
            if joint.mimic is not None:
                sign, zero = self.shift.sign, self.shift.zero.value
                yield from self._mimic(joint, lambda old: [sign * c + (0 if k else zero) for k, c in enumerate(old)])
            for other in self.model.joints:
                if other.mimic is not None and other.mimic.joint == joint.name:
                    yield from self._mimic(other, self._of_new_leader)
        yield from self._tendons()
        yield from self._ratios()
        if set(self.names) <= set(self.independent):
            self._check_files()
            yield from self._poses()
        yield from self._ranges()

    def _text(self, quantity: ExactQuantity) -> str:
        """Return the text of a coordinate of the joint."""
        return quantity.text(self.coordinate, self.shift.zero.unit)

    def _shift(self, old: ExactQuantity, zero: Fraction | None = None) -> ExactQuantity:
        """Return a new coordinate of the joint. `zero` replaces the zero of the shift."""
        sign, zero = self.shift.sign, self.shift.zero.value if zero is None else zero
        if not old.expression:
            return replace(old, value=sign * old.value + zero)
        added = f" {'+' if zero > 0 else '-'} {self._text(ExactQuantity(value=abs(zero)))}" if zero else ""
        return replace(old, expression=(old.expression if sign > 0 else f"-({old.expression})") + added)

    def _new(self, keys: Keys, old: ExactQuantity, zero: Fraction | None = None) -> Edits:
        """Yield a new coordinate of the joint if it differs from the old one."""
        if (new := self._shift(old, zero)) != old:
            yield keys, self._text(new)

    def _read(self, text: str, span: Span) -> ExactQuantity:
        try:
            return read_quantity(text)
        except UnitError as fault:
            raise ShiftRefused(f"`{text}` cannot be changed: {fault}", "edit the document by hand", span=span) from fault

    def _at(self, path: Path, default: ExactQuantity = ZERO) -> ExactQuantity:
        node = node_at(self.document.tree, path)
        return self._read(node.text, node.span) if isinstance(node, ScalarNode) else default

    def _number(self, path: Path, default: ExactQuantity = ZERO) -> ExactQuantity:
        """Return a number of the document. Raises `ShiftRefused` for an expression."""
        quantity = self._at(path, default)
        if quantity.expression:
            message = f"the expression `={quantity.expression}` depends on the coordinate of joint `{self.shift.joint}`"
            raise ShiftRefused(message, "replace the expression by a number, or edit the document by hand", span=self.document.span(path))
        return quantity

    def _motion(self, joint: Joint) -> Edits:
        """Yield the new offset, direction, limits, and rest position of the spring, which can be default values of the document."""
        path, shift = ("joints", self.shift.joint), self.shift
        limit, rest_position = joint.limit, joint.dynamics.rest
        used = {"offset": joint.offset, "limit.lower": limit.lower, "limit.upper": limit.upper, "dynamics.rest": rest_position}
        specified = {
            key: ZERO if value is None or key not in joint.written else self._read(joint.written[key], joint.spans[key])
            for key, value in used.items()
        }
        yield from self._new((*path, "offset"), specified["offset"], -shift.zero.value)
        if shift.sign < 0:
            yield (*path, "reverse"), "false" if joint.reverse else "true"
        ends = {key: specified[f"limit.{key}"] for key in ("lower", "upper") if getattr(limit, key) is not None}
        if len(ends) == 1 and shift.sign < 0:
            raise ShiftRefused(f"joint `{shift.joint}` has only one limit", "add the other limit first", span=joint.spans["limit"])
        for key, source in zip(ends, [*ends][:: shift.sign], strict=True):
            text = self._text(replace(self._shift(ends[source]), unit=ends[key].unit or ends[source].unit))
            if text != self._text(ends[key]):
                yield (*path, "limit", key), text
        if joint.dynamics.stiffness:
            yield from self._new((*path, "dynamics", "rest"), specified["dynamics.rest"])

    def _mimic(self, joint: Joint, change: Callable[[Sequence[Fraction]], Sequence[Fraction]]) -> Edits:
        """Yield the new coefficients by which a joint follows its leader."""
        path: Keys = ("joints", joint.name.joint, "mimic")
        mimic = node_at(self.document.tree, path)
        if joint.name.number is not None or mimic is None or joint.mimic is None:
            span = self.document.span(path[:2] if mimic is None else path, key=True)
            raise ShiftRefused(f"joint `{joint.name}` is repeated or has several coordinates", "edit `mimic` by hand", span=span)
        terms = entries_of(mimic).get("polynomial")
        keys = [(*path, "offset"), (*path, "multiplier")]
        if isinstance(terms, SequenceNode):
            keys = [(*path, "polynomial", str(k)) for k in range(len(terms.items))]
        old = [self._number(key, ExactQuantity(value=Fraction(key[-1] == "multiplier"))) for key in keys]
        own, leader = (one.twist.coordinate for name in (joint.name, joint.mimic.joint) for one in self.model.joints
                       if one.name == name and one.twist is not None)
        for k, value in enumerate(change([one.value for one in old])):
            if value != old[k].value:
                yield keys[k], replace(old[k], value=value).text(own / leader**k)

    def _of_new_leader(self, old: Sequence[Fraction]) -> Sequence[Fraction]:
        """Return the polynomial in the new coordinate of the leader: insert `q_old = sign * (q_new - zero)` by Horner's method."""
        new = [Fraction(0)] * len(old)
        for coefficient in reversed(old):
            new = [self.shift.sign * (a - self.shift.zero.value * b) for a, b in zip([Fraction(0), *new[:-1]], new, strict=True)]
            new[0] += coefficient
        return new

    def _tendons(self) -> Edits:
        """Yield the new coefficients, limits and rest lengths of the tendons over the joint."""
        for tendon, joints in self._tendons_over():
            path: Keys = ("tendons", tendon)
            added, length = Fraction(0), self.coordinate
            for name in joints:
                factor = self._number((*path, "joints", name))
                new = replace(factor, value=self.shift.sign * factor.value)
                added, length = added + new.value * self.shift.zero.value, factor.dimension * self.coordinate
                if new != factor:
                    yield (*path, "joints", name), new.text(factor.dimension)
            for keys, need in (("limit", "lower"), "lower"), (("limit", "upper"), "upper"), (("dynamics", "rest"), "stiffness"):
                if node_at(self.document.tree, (*path, keys[0], need)) is not None:
                    old = self._number((*path, *keys))
                    if added:
                        yield (*path, *keys), replace(old, value=old.value + added).text(length)

    def _ratios(self) -> Edits:
        """Yield the new ratios of transmissions of a reversed joint, so that the actuators turn in the same directions as before."""
        for name in entries_of(node_at(self.document.tree, ("transmissions",))) if self.shift.sign < 0 else ():
            path: Keys = ("transmissions", name)
            ratios: list[Keys] = [(*path, "ratio")] if self._drives((*path, "joint")) else []
            joints = node_at(self.document.tree, (*path, "differential", "joints"))
            numbers = range(len(joints.items) if isinstance(joints, SequenceNode) else 0)
            columns = [str(k) for k in numbers if self._drives((*path, "differential", "joints", k))]
            ratios += [(*path, "differential", "matrix", str(row), k) for k in columns for row in numbers]
            for keys in ratios:
                old = self._at(keys)
                new = replace(old, expression=f"-({old.expression})") if old.expression else replace(old, value=-old.value)
                yield keys, new.text(old.dimension)

    def _drives(self, path: Path) -> bool:
        """Return whether a transmission drives the joint. Raises `ShiftRefused` if copies of a repeated transmission may have one ratio."""
        text = text_of(node_at(self.document.tree, path))
        if "$" in text and any(fnmatchcase(name, INDEX.sub("*", text)) for name in self.names):
            raise ShiftRefused(f"the transmission of joint `{text}` is repeated", "write it without `$`", span=self.document.span(path))
        return text in self.names

    def _tendons_over(self) -> Iterator[tuple[str, list[str]]]:
        """Yield the names of tendons over the joint, each with the names of the joint in the tendon."""
        for tendon in entries_of(node_at(self.document.tree, ("tendons",))):
            over = entries_of(node_at(self.document.tree, ("tendons", tendon, "joints")))
            joints = [name for name in self.names if name in over]
            if joints:
                yield tendon, joints

    def _poses(self) -> Edits:
        """Yield the new positions in poses, and a pose for modes that start in the old zero position."""
        poses = entries_of(node_at(self.document.tree, ("poses",)))
        for pose, node in poses.items():
            nested = [key for key, value in entries_of(node).items() if text_of(value)[:1].isalpha()]  # poses of nested documents
            for name in self.names:
                key = self._key(name, [key for key in entries_of(node) if key not in nested])
                if key is None and any(fnmatchcase(name, f"{one}.*") for one in nested):
                    continue
                old = ZERO if key is None else self._at(("poses", pose, key))
                matching_joints = [one for one in self.independent if fnmatchcase(one, key or "")]
                matches_only_these = key is not None and set(matching_joints) <= set(self.names)  # the pattern matches no other joint
                yield from self._new(("poses", pose, key if matches_only_these and key else name), old)
        starts = [mode.name for mode in self.model.modes if mode.stated and mode.pose is None]
        if self.shift.zero.value and starts:
            pose = unused_pose_name(poses)
            yield from ((("poses", pose, name), self._text(self.shift.zero)) for name in self.names)
            yield from ((("modes", mode, "pose"), pose) for mode in starts)

    def _key(self, name: str, entries: Collection[str]) -> str | None:
        """Return the key that sets a joint: its name, or else the last pattern that matches it."""
        patterns = [key for key in entries if GLOB.search(key) and fnmatchcase(name, key)]
        return name if name in entries else patterns[-1] if patterns else None

    def _ranges(self) -> Edits:
        """Yield the new ranges of the joint in tests."""
        for test, checks in entries_of(node_at(self.document.tree, ("tests",))).items():
            ranges = entries_of(node_at(checks, ("no_collision", "joints")))
            for name in self.names:
                key = self._key(name, ranges)
                path: Keys = ("tests", test, "no_collision", "joints", key or "")
                if key is None or not isinstance(ranges[key], SequenceNode):
                    continue
                if key != name:
                    help, span = f"add a range of `{name}`", self.document.span(path, key=True)
                    raise ShiftRefused(f"the range of joint `{name}` is set by the pattern `{key}`", help, span=span)
                ends = [self._at((*path, k)) for k in "01"][:: self.shift.sign]
                yield from (((*path, k), self._text(self._shift(end))) for k, end in zip("01", ends, strict=True))

    def _check_files(self) -> None:
        """Raise `ShiftRefused` if a CSV file contains positions of the joint."""
        for motion, node in entries_of(node_at(self.document.tree, ("motions",))).items():
            if "file" in entries_of(node):
                message = f"the file of motion `{motion}` contains positions of joint `{self.shift.joint}`"
                raise ShiftRefused(message, "remove the motion, and record it again", span=self.document.span(("motions", motion, "file")))

    def _check_raw(self) -> None:
        """Raise `ShiftRefused` if raw attributes of MuJoCo depend on the coordinate."""
        raw, names = node_at(self.document.tree, ("raw",)), {*self.names, "key", *(tendon for tendon, _ in self._tendons_over())}
        for path, node in walk(raw) if raw is not None else ():
            words = {str(word).replace("/", ".") for word in path} | {text_of(one) for one in entries_of(node).values()}
            key = next((key for key in entries_of(node) if key in (OF_ZERO if self.shift.sign > 0 else OF_DIRECTION)), None)
            if key is not None and words & names:
                message = f"the raw attribute `{key}` may depend on the coordinate of joint `{self.shift.joint}`"
                raise ShiftRefused(message, "edit the document by hand", span=self.document.span(("raw", *path, key)))


def calibration_edits(calibrated: Sequence[CalibratedJoint], shifts: Sequence[JointShift]) -> Edits:
    """Yield the new offsets, rounded to whole ticks, and the new directions of encoders, so that they fit the new coordinates.

    The values of an encoder are `offset + sign * q_old * ticks`, and `q_old` is `shift.sign * (q_new - zero)`.
    """
    for shift in shifts:
        one = next((one for one in calibrated if one.joint.name == shift.joint), None)
        if one is None:
            continue
        sign = one.sign * shift.sign
        offset = one.offset - round(sign * float(shift.zero.value) * one.ticks)
        offset = offset if one.modulus is None else offset % one.modulus
        yield from (
            (("joints", shift.joint, key), str(new)) for key, old, new in (("offset", one.offset, offset), ("sign", one.sign, sign))
            if new != old
        )
