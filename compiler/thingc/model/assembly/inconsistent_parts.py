"""Detect parts whose code is not deterministic: build each part twice, compare the two records, and report the differences."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from thingc.base.diagnostics import Code, Note, Report
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.source import line_of
from thingc.geometry.record import DeclaredValue, PartDefinition, PartFailure, PartRecord
from thingc.model.assembly.types import Assembly

OTHER_SEED = 1
"""The hash seed of Python for the second build of each part. The seed is not random, so that a part that depends on the seed is detected in
every run.
"""

_HELP = "sort sets, seed random generators, and use parameters instead of the clock, the environment and other processes"

Show = Callable[[Any, int], str]
"""Function that formats a value with the given number of significant digits."""


class RecordDifference(FrozenStruct, kw_only=False):
    """A difference between two geometry records of the same part.

    The fields are the property (`volume`) and a description (`its volume is 1.2 cm^3 and 1.3 cm^3`).
    """

    name: str
    words: str


def _number(unit: str, scale: float = 1.0) -> Show:
    return lambda value, digits: f"{scale * value:.{digits}g} {unit}"


def _lengths(value: Any, digits: int) -> str:
    return f"[{', '.join(f'{1e3 * x:.{digits}g}' for x in value)}] mm"


def _corners(value: Any, digits: int) -> str:
    return " to ".join(_lengths(corner, digits) for corner in value)


def _text(value: Any, digits: int) -> str:
    return f"`{value}`"


class _Field(FrozenStruct, kw_only=False):
    """The display name of a field of a geometry record, and a function that formats its values.

    If `show` is None, messages about the field do not contain values.
    """

    name: str
    show: Show | None = None

    def difference(self, first: Any, second: Any) -> RecordDifference | None:
        """Return a description of the difference between two values.

        A different order of items is also a difference. Return None if the values are equal.
        """
        if isinstance(first, DeclaredValue) and isinstance(second, DeclaredValue) and first.source == second.source:
            first, second = first.value, second.value
        if isinstance(first, Mapping):
            return self._of_names(first, second)
        if first == second:
            return None
        if self.show is None or isinstance(first, DeclaredValue) or isinstance(second, DeclaredValue):
            return RecordDifference(self.name, f"the {self.name}")
        for digits in (4, 8, 12, 17):
            one, other = ("nothing" if value is None else self.show(value, digits) for value in (first, second))
            if one != other:
                break
        return RecordDifference(self.name, f"the {self.name} ({one} and {other})")

    def _of_names(self, first: Mapping[str, Any], second: Mapping[str, Any]) -> RecordDifference | None:
        names = [name for name in dict.fromkeys((*first, *second)) if first.get(name) != second.get(name)]
        if names:
            return RecordDifference(self.name, f"the {self.name} ({_join_names(names)})")
        if list(first) != list(second):
            return RecordDifference(self.name, f"the order of the {self.name} ({_join_names(first)} and {_join_names(second)})")
        return None


def _join_names(names: Iterable[str]) -> str:
    return ", ".join(f"`{name}`" for name in names)


FIELDS: Mapping[str, _Field] = {
    "material": _Field("material", _text), "color": _Field("colour", _text),
    "volume": _Field("volume", _number("cm^3", 1e6)), "area": _Field("surface area", _number("cm^2", 1e4)),
    "centre": _Field("centre of volume", _lengths), "inertia": _Field("inertia"), "box": _Field("bounding box", _corners),
    "mass": _Field("stated mass", _number("kg")), "com": _Field("stated centre of mass", _lengths),
    "matrix": _Field("stated inertia"), "density": _Field("stated density", _number("kg/m^3")),
    "mounts": _Field("mounts"), "expectations": _Field("expected parts of mounts"),
    "references": _Field("list of expected parts"), "actuator": _Field("actuator"),
    "bom": _Field("bill of materials entries"),
    "up": _Field("print orientation"), "apart": _Field("number or volume of solids"),
    "meshes": _Field("meshes"), "pieces": _Field("collision geometry"), "fits": _Field("smallest enclosing shapes"),
}
"""The fields of a geometry record that are compared. The most informative field comes first."""

LEFT_OUT = frozenset({"text", "code", "own_image", "warnings", "convex", "slices", "exact", "brep"})
"""Fields that are not compared, because they do not affect the part or are computed from its meshes.

The B-rep is not compared, because it contains numerical noise of the CAD kernel (see `build_part.DECIMALS`).
"""


def differences(first: PartRecord, second: PartRecord) -> list[RecordDifference]:
    """Compare two geometry records of the same part exactly. Return all differences, with the most informative difference first."""
    compared = (field.difference(getattr(first, name), getattr(second, name)) for name, field in FIELDS.items())
    return [difference for difference in compared if difference is not None]


def definitions_of(assembly: Assembly) -> tuple[PartDefinition, ...]:
    """Return the distinct parts of an assembly, in the order of their first occurrence."""
    parts = (one.component.definition for one in assembly.occurrences)
    return tuple({part.text: part for part in parts if isinstance(part, PartDefinition)}.values())


def compare(assembly: Assembly, again: Mapping[str, PartRecord | PartFailure], report: Report) -> None:
    """Compare the geometry records of all parts of an assembly with the records of a second build.

    Each difference is reported at the first component that uses the part.
    """
    waiting = dict(again)
    for occurrence in assembly.occurrences:
        second = waiting.pop(occurrence.definition.text, None)
        if occurrence.record is None or second is None:
            continue
        of = f"`{occurrence.definition.label}`"
        notes = list(occurrence.written)
        if isinstance(second, PartFailure):
            message = f"the second build of {of} failed: {second.message}"
            if second.file is not None:
                notes = [Note(message="location in the part file", span=line_of(second.file, second.line or 1))]
        else:
            differing = differences(occurrence.record, second)
            if not differing:
                continue
            message = f"two builds of {of} differ in {differing[0].words}"
            if len(differing) > 1:
                notes.append(Note(message=f"also different: {', '.join(other.name for other in differing[1:])}"))
        report.add(Code.NOT_TWICE, message, occurrence.origin, path=occurrence.path, notes=notes, help=_HELP)
