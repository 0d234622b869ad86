"""Resolve the tendons of a document: sums of coordinates, or paths through mounts, with springs, limits and drives."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Literal

from msgspec.structs import replace

from thingc.base.diagnostics import Code
from thingc.base.source import Path
from thingc.base.units import ANGLE, LENGTH, NUMBER, Dimension, Quantity
from thingc.documents.spec.tendons import AroundSpec, PulleySpec, TendonSpec
from thingc.model.resolve import references
from thingc.model.resolve.coordinates import CoordinateName, Limit
from thingc.model.resolve.document_scope import DocumentScope
from thingc.model.resolve.joints import DRIVE_VALUES, drive_values, dynamics
from thingc.model.resolve.references import suggest
from thingc.model.resolve.scope import DefaultLayers, Scope
from thingc.model.resolve.types import Drive, Joint, PathStep, Tendon


def tendons(table: DocumentScope, scope: Scope) -> Iterator[Tendon]:
    """Yield the resolved tendons of a document, in the order of the document. Invalid tendons are reported and omitted."""
    for name, spec in table.spec.tendons.items():
        path: Path = ("tendons", name)
        if spec.path is not None:
            steps = tuple(_steps(table, scope, name, spec.path, (*path, "path")))
            width = scope.number(spec.width, (*path, "width"), LENGTH, f"`width` of tendon `{name}`", above=0.0)
            tendon = _tendon(scope, name, spec, path, LENGTH, ())
            if len(steps) == len(spec.path) and _sound(scope, name, steps, (*path, "path")):
                yield replace(tendon, path=steps, width=width)
        elif (terms := _terms(table, scope, name, spec, path)) is not None:
            yield _tendon(scope, name, spec, path, *terms)


def _steps(
    table: DocumentScope, scope: Scope, name: str, written: Sequence[str | AroundSpec | PulleySpec], path: Path,
) -> Iterator[PathStep]:
    """Yield the valid steps of the path of a tendon. Invalid steps are reported."""
    for number, one in enumerate(written):
        place: Path = (*path, number)
        if isinstance(one, str):
            mount = references.shown_mount(table, scope, one, place)
            if mount is not None:
                yield PathStep(mount=mount, origin=scope.origin(place))
        elif isinstance(one, PulleySpec):
            divisor = scope.number(one.pulley, (*place, "pulley"), NUMBER, f"a pulley of tendon `{name}`", above=0.0)
            if divisor is not None:
                yield PathStep(divisor=divisor, origin=scope.origin(place))
        else:
            shape: Literal["sphere", "cylinder"] = "sphere" if one.sphere is not None else "cylinder"
            centre = references.shown_mount(table, scope, one.around, (*place, "around"))
            radius = scope.number(getattr(one, shape), (*place, shape), LENGTH, f"a radius of tendon `{name}`", above=0.0)
            side = None if one.side is None else references.shown_mount(table, scope, one.side, (*place, "side"))
            if centre is not None and radius is not None and (side is not None or one.side is None):
                yield PathStep(mount=centre, shape=shape, radius=radius, side=side, origin=scope.origin(place))


def _sound(scope: Scope, name: str, steps: Sequence[PathStep], path: Path) -> bool:
    """Return whether the path of a tendon is valid.

    Each section between pulleys must start and end at mounts, and contain at most one shape between two mounts.
    """
    kinds = ["pulley" if step.mount is None else "shape" if step.shape is not None else "mount" for step in steps]
    for number, (kind, before, after) in enumerate(zip(kinds, ["pulley", *kinds], [*kinds[1:], "pulley"], strict=False)):
        if kind == "shape" and not before == after == "mount":
            fault = f"tendon `{name}` wraps around a shape that is not between two mounts"
            help = "add mounts to the path directly before and after the shape"
        elif kind == "mount" and before == after == "pulley":
            fault = f"a section of tendon `{name}` has only one mount"
            help = "add a second mount to the section"
        elif kind == "pulley" and (number == 0 or after == "pulley"):
            fault, help = f"a pulley of tendon `{name}` has no path before or after it", "remove the pulley"
        else:
            continue
        scope.error(Code.TENDON_PATH, fault, (*path, number), help=help)
        return False
    return True


def _terms(
    table: DocumentScope, scope: Scope, name: str, spec: TendonSpec, path: Path,
) -> tuple[Dimension, tuple[tuple[CoordinateName, float], ...]] | None:
    """Return the factors of a tendon by coordinate, and the physical dimension of its length, which the first factor determines."""
    moves: list[tuple[CoordinateName, float]] = []
    length: Dimension | None = None
    for text, raw in (spec.joints or {}).items():
        place: Path = (*path, "joints", text)
        joint = moving_joint(table, scope, text, place, f"tendon `{name}` cannot depend on", key=True)
        if joint is None:
            return None
        factor, length = factor_of(scope, raw, place, joint, length, f"the coefficient of `{text}` in tendon `{name}`")
        if factor is None:
            return None
        moves.append((CoordinateName(text), factor))
    return length or LENGTH, tuple(moves)


def moving_joint(table: DocumentScope, scope: Scope, text: str, place: Path, cannot: str, *, key: bool = False) -> Joint | None:
    """Return the coordinate `text` of a joint of the document, on which a tendon or a transmission can act.

    If the joint does not exist or has no single coordinate, report an error, which begins with `cannot`, and return None.
    """
    balls = (one for one in table.joints.values() if one is not None and one.kind.at_once and text in (one.name.joint, one.name))
    joint = next(balls, None) or table.joints.get(CoordinateName(text))
    if joint is None:
        if CoordinateName(text) not in table.joints and not any(f"{text}_".startswith(prefix) for prefix in table.unbuilt_joints):
            scope.error(
                Code.UNKNOWN_JOINT, f"this document has no joint `{text}`", place, key=key, help=suggest(text, table.joints, what="joints"),
            )
        return None
    if joint.twist is None or joint.kind.at_once:
        scope.error(
            Code.JOINT_FIELD, f"{cannot} joint `{text}`, which is {joint.kind.words}", place, key=key,
            notes=joint.definition_note(text), help="use a revolute, continuous or prismatic joint",
        )
        return None
    return joint


def factor_of(
    scope: Scope, raw: Any, place: Path, joint: Joint, length: Dimension | None, what: str,
) -> tuple[float | None, Dimension | None]:
    """Evaluate the factor by which the motion of a joint changes the length of a tendon or the position of an actuator.

    `length` is the physical dimension of this length or position, or None if it is not known yet. Return the factor and this dimension. If
    the factor is invalid, report an error and return None as the factor.
    """
    own = ANGLE if joint.twist is None else joint.twist.coordinate
    fitting = (length / own,) if length is not None else (ANGLE / own, LENGTH / own)
    factor, value = scope.number(raw, place, fitting, what, notes=joint.definition_note(joint.name)), scope.value(raw, place)
    if factor is not None and isinstance(value, Quantity):
        turns, slides = value.fits(ANGLE / own), value.fits(LENGTH / own)
        if length is None and turns != slides:  # a plain 0 has any unit
            length = ANGLE if turns else LENGTH
    return factor, length


def _tendon(
    scope: Scope, name: str, spec: TendonSpec, path: Path, coordinate: Dimension, moves: tuple[tuple[CoordinateName, float], ...],
) -> Tendon:
    owner, layers = f"tendon `{name}`", DefaultLayers(((spec, path),))
    least = 0.0 if spec.path is not None else None  # the length of a path is not negative
    lower, upper = (
        scope.number(*layers.sub("limit").pick(key), coordinate, f"`limit.{key}` of {owner}", least=least) for key in ("lower", "upper")
    )
    if lower is not None and upper is not None and not lower < upper:
        message = f"expected lower < upper in the limits of tendon `{name}`"
        scope.error(Code.LIMIT, message, (*path, "limit", "lower"), help="swap the limits")
        lower = upper = None
    drive = None
    if spec.drive is not None:
        for key in ("axis", "armature", "component"):
            if getattr(spec.drive, key) is not None:
                scope.error(
                    Code.DRIVE, f"the drive of tendon `{name}` cannot have `{key}`", (*path, "drive", key), key=True,
                    help="set `armature` under `dynamics` of the tendon" if key == "armature" else f"remove `{key}`",
                )
        keys = [key for key in DRIVE_VALUES if key != "armature"]
        given = drive_values(scope, owner, coordinate, "drive", spec.drive, (*path, "drive"), keys)
        drive = Drive(component=None, kind=spec.drive.kind, origin=scope.origin((*path, "drive")), **given)
    return Tendon(
        name=name, moves=moves, turns=coordinate == ANGLE, limit=Limit(lower=lower, upper=upper), drive=drive,
        origin=scope.origin(path, key=True), dynamics=dynamics(scope, owner, coordinate, layers.sub("dynamics"), least=least),
    )
