"""List the parts of a robot that are made and not bought, for drawings and cutting files."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import TypeVar

from thingc.base.diagnostics import Code
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.grouping import group_by
from thingc.geometry.record import AssemblyFailed, PartDefinition
from thingc.model.assembly.types import Assembly, Occurrence
from thingc.targets import EmitRequest, Loss
from thingc.targets.bom.emit import make_of, plain_name

Result = TypeVar("Result")


class ManufacturedPart(FrozenStruct):
    """Equal parts of one material. `label` is their name in files, and `occurrences` contains the pieces in the order of the document."""

    label: str
    occurrences: Sequence[Occurrence]

    @property
    def first(self) -> Occurrence:
        """The first piece."""
        return self.occurrences[0]

    @property
    def quantity(self) -> int:
        """The number of pieces."""
        return len(self.occurrences)

    @property
    def material(self) -> str | None:
        """The name of the material, or None if the document does not specify it."""
        return self.first.material.name if self.first.material is not None else None

    def file_name(self, *words: str) -> str:
        """Return a file name without suffix: the label, `words`, the material, and the number of pieces if there are several."""
        return "_".join([self.label, *words, *filter(None, [self.material]), *([f"x{self.quantity}"] if self.quantity > 1 else [])])


def compute_parts(
    request: EmitRequest, target: str, compute: Callable[[set[str]], Mapping[str, Result]],
) -> tuple[list[tuple[ManufacturedPart, Result]], list[Loss]]:
    """Return the parts that are not bought with results of the CAD kernel for their B-reps.

    Parts without a B-rep are export losses. If all parts are bought, this is also an export loss. If the kernel fails, an error is
    reported, and there are no parts.
    """
    parts, losses = [], []
    for part in manufactured_parts(request.assembly):
        first = part.first
        if first.record is not None and first.record.brep is not None:
            parts.append((part, first.record.brep))
        else:
            what = f"`{first.definition.label}` is a mesh without exact surfaces"
            losses.append(Loss(target, None, first.path, what, "omitted", first.origin))
    if not parts and not losses:
        what = "all parts of the robot are bought or have no geometry"
        losses.append(Loss(target, None, request.assembly.name, what, "omitted", request.assembly.definition.origin))
    try:
        results = compute({brep for _, brep in parts})
    except AssemblyFailed as fault:
        origin = request.assembly.definition.origin
        request.report.add(Code.INTERNAL, f"the CAD kernel cannot read a part: {fault.reason}", origin, detail=fault.detail)
        return [], losses
    return [(part, results[brep]) for part, brep in parts], losses


def manufactured_parts(assembly: Assembly) -> list[ManufacturedPart]:
    """Return the parts with geometry that are not bought. Parts with equal names are named after their definitions and materials."""
    manufactured = [
        one for one in assembly.occurrences
        if isinstance(one.component.definition, PartDefinition) and one.record is not None and one.record.box and make_of(one) != "buy"
    ]
    groups = list(group_by(manufactured, lambda one: (one.definition, one.material and one.material.name)).values())
    labels = labels_of([group[0] for group in groups], lambda one: _simple(plain_name(one)))
    return [ManufacturedPart(label=label, occurrences=group) for label, group in zip(labels, groups, strict=True)]


def labels_of(parts: Sequence[Occurrence], name_of: Callable[[Occurrence], str] = plain_name) -> list[str]:
    """Return the names of parts. If parts of several definitions have the same name, ignoring case, return the stems of the definitions."""
    definitions = Counter(name for name, _ in {(name_of(one).casefold(), one.definition) for one in parts})
    stems = (one.component.definition.stem if isinstance(one.component.definition, PartDefinition) else "" for one in parts)
    return [name_of(one) if definitions[name_of(one).casefold()] == 1 else stem for one, stem in zip(parts, stems, strict=True)]


def _simple(name: str) -> str:
    """Replace characters that are not allowed in all file systems."""
    return re.sub(r"[^\w.-]+", "_", name).strip("._") or "part"
