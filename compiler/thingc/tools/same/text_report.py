"""Format the result of a comparison of two mechanisms as text."""

from __future__ import annotations

from collections.abc import Iterator

from thingc.base.joints.twist import dimensions_of
from thingc.base.numeric import degrees
from thingc.base.one_line_repr import format_count
from thingc.base.safe_text import some
from thingc.base.units import ANGLE, LENGTH, Quantity
from thingc.tools.same.comparison import TOLERANCE, MechanismComparison, MechanismDifference

SHOWN = 12
"""Maximum number of joints in a list of zeros."""
ROUNDING = 1e-6
"""Difference [%, mm or deg] below which values are shown as equal."""
PHYSICAL = {
    "centre": "centre of mass", "inertia": "inertia", "axis angle": "direction of the axis", "axis position": "position of the axis",
    "lead": "lead", "pose": "poses of links",
}


def as_text(result: MechanismComparison, sides: tuple[str, str]) -> Iterator[str]:
    """Yield the lines of a report: the verdict, zeros and signs, names, ambiguities, agreement of masses, differences and properties.

    Robots with equal names are called by the names of their sides, such as files.
    """
    one, other = sides if result.one == result.other else (result.one, result.other)
    yield summary(result) if result.same else f"{one} and {other} are different mechanisms"
    yield from (f"  {line}" for line in _differences(result.differences))
    if not result.links:
        return
    if not result.same and (zeros := zeros_of(result)):
        yield f"  {zeros}"
    pairs = [(one.one, one.other) for one in result.joints] + [(one.one, one.other) for one in result.links]
    names = [f"{one} = {other}" for one, other in pairs if one != other]
    if names:
        yield f"  names: {some(names, SHOWN)}"
    free = [one.other for one in result.joints if not one.determined]
    if free:
        yield f"  joint zeros that cannot be determined from axes or masses: {some(free, SHOWN)}"
    least = "" if result.complete else "at least "
    if result.assignments > 1:
        yield f"  ambiguous: {least}{result.assignments} assignments of links and joints are possible"
    elif result.maps > 1:
        yield f"  ambiguous: {least}{result.maps} combinations of joint zeros and signs are possible"
    mass, centre, inertia = (max(getattr(one, key) for one in result.links) for key in ("mass", "centre", "inertia"))
    yield (
        f"  agreement of {format_count(len(result.links), 'link')}: mass {_format_tolerance(100.0 * mass, '%')}, "
        f"centre of mass {_format_tolerance(1000.0 * centre, 'mm')}, inertia {_format_tolerance(100.0 * inertia, '%')}"
    )
    if result.residual is not None and result.joints:
        yield (
            f"  agreement of poses in random configurations: position {_format_tolerance(1000.0 * result.residual[0], 'mm')}, "
            f"rotation {_format_tolerance(degrees(result.residual[1]), 'deg')}"
        )
    kinds = {one.other: one.kind for one in result.joints}
    for found in (*result.limits, *result.properties):
        key = "lower" if found.what == "limits" else found.what
        ends = ((value,) if key == found.what else value for value in (found.old, found.new))
        old, new = (", ".join(_value(kinds[found.other], key, end, 6) for end in values) for values in ends)
        yield f"  {found.what} of {_format_names(found)}: {old} -> {new}"


def summary(result: MechanismComparison) -> str:
    """Return one line about two robots that are the same mechanism, or differ in masses, with the joint zeros and signs that differ."""
    zeros = zeros_of(result)
    return f"the same mechanism{'' if result.same else ' except for masses'}{'; ' + zeros if zeros else ''}"


def zeros_of(result: MechanismComparison) -> str:
    """Return the joint zeros and signs that differ, such as `zeros: shoulder_lift +90 deg`."""
    moved = [one for one in result.joints if abs(one.zero) > TOLERANCE]
    zeros = [f"{one.other} {'+' * (one.zero > 0.0)}{_value(one.kind, 'lower', one.zero, 4)}" for one in moved]
    signs = [one.other for one in result.joints if one.sign < 0]
    found = [f"zeros: {some(zeros, SHOWN)}"] if zeros else []
    return "; ".join([*found, *([f"reversed: {some(signs, SHOWN)}"] if signs else [])])


def _value(kind: str, key: str, value: float | None, digits: int) -> str:
    """Format a property of a joint with its unit. The keys are those of `dimensions_of`."""
    of = dimensions_of(LENGTH if kind == "translation" else ANGLE)
    return "none" if value is None else Quantity(value, of[key]).format(digits)


def _format_tolerance(value: float, unit: str) -> str:
    return "equal" if value < ROUNDING else f"within {float(f'{value:.2g}'):g} {unit}"


def _differences(differences: tuple[MechanismDifference, ...]) -> Iterator[str]:
    for one in differences:
        match one.what:
            case "arrangement":
                yield "arrangement: the links and joints of the two robots cannot be matched"
            case "links" | "joints":
                yield f"{one.what}: {one.old} -> {one.new}"
            case "mass":
                yield f"mass of {_format_names(one)}: {one.old:.6g} kg -> {one.new:.6g} kg ({_distance(one)})"
            case "coupling":
                yield f"coupling of {_format_names(one)}: {_coupling(one.old)} -> {_coupling(one.new)}"
            case _:
                yield f"{PHYSICAL[one.what]}{' of ' if one.one else ''}{_format_names(one)}: {_distance(one)}"


def _format_names(one: MechanismDifference) -> str:
    return one.one if one.one == one.other else f"{one.one} = {one.other}"


def _distance(one: MechanismDifference) -> str:
    assert one.by is not None
    if one.what in ("mass", "inertia"):
        return f"differs by {100.0 * one.by:.3g} %"
    return f"differs by {degrees(one.by):.3g} deg" if one.what == "axis angle" else f"differs by {1000.0 * one.by:.3g} mm"


def _coupling(coupling: tuple[str, *tuple[float, ...]] | None) -> str:
    return "none" if coupling is None else f"{coupling[0]} [{', '.join(f'{one:.6g}' for one in coupling[1:])}]"
