"""Frames of mounts in words, as far as parts are known."""

from __future__ import annotations

from collections.abc import Sequence

from thingc.base.pose import Pose, Vector, transpose
from thingc.geometry.record import PartDefinition, PartRecord
from thingc.model.resolve.types import AssemblyDefinition
from thingc.tools.lsp.analysis import Analysis

Steps = tuple[str, ...]


def frame_words(analysis: Analysis, reference: str) -> str:
    """The frame of a mount `component.mount` in the component's own: `(12, 0, 30) mm, z along +y`; of one inside a nested assembly in
    that of the part that has it, which is named. Empty where it is not known."""
    model = analysis.known.model
    steps = reference.split(".")
    place = None if model is None else _found(analysis.known, model, steps, ())
    if place is None:
        return ""
    pose, owner = place
    return in_words(pose) + (f" of `{'.'.join(owner)}`" if len(owner) > 1 else "")


def in_words(pose: Pose) -> str:
    """A frame in a line: its origin, and where its z points."""
    return f"{length_words(pose.translation)}, z along {direction_words(transpose(pose.rotation)[2])}"


def length_words(vector: Vector) -> str:
    """A place [m] in millimetres: `(12, 0, 30) mm`."""
    return f"({', '.join(_short(1000.0 * value) for value in vector)}) mm"


def _found(analysis: Analysis, model: AssemblyDefinition, steps: Sequence[str], above: tuple[str, ...]) -> tuple[Pose, Steps] | None:
    """The frame of a mount, and the component whose frame that is in."""
    component = next((one for one in model.components if one.name == steps[0]), None)
    rest = steps[1:]
    if component is None or not rest:
        return None
    owner = (*above, component.name)
    definition = component.definition
    if rest[0] in component.mounts and len(rest) == 1:
        return component.mounts[rest[0]].pose, owner
    if isinstance(definition, AssemblyDefinition):
        shown = definition.mounts.get(rest[0]) if len(rest) == 1 else None
        return _found(analysis, definition, shown.text.split(".") if shown is not None else rest, owner)
    record = analysis.records.get(definition.text) if isinstance(definition, PartDefinition) else None
    if len(rest) > 1 or not isinstance(record, PartRecord) or not record.exact or rest[0] not in record.mounts:
        return None
    return record.mounts[rest[0]].pose, owner


def direction_words(direction: Vector) -> str:
    """Where a unit vector points: `+x`, `-z`, `(0.6, 0, 0.8)`."""
    for axis, value in zip("xyz", direction, strict=True):
        if abs(value) > 1.0 - 1e-9:
            return f"{'+' if value > 0 else '-'}{axis}"
    return f"({', '.join(_short(value) for value in direction)})"


def _short(value: float) -> str:
    return f"{value:z.4g}"
