"""Resolve the section `names:` of a document, which renames elements in output files."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from thingc.base.diagnostics import Code
from thingc.base.export_names import TAKEN
from thingc.base.source import Path
from thingc.model.resolve.coordinates import CoordinateName
from thingc.model.resolve.document_scope import DocumentScope
from thingc.model.resolve.references import suggest
from thingc.model.resolve.scope import Scope
from thingc.model.resolve.types import NamedKind, NameInFiles


def names(table: DocumentScope, scope: Scope) -> Iterator[NameInFiles]:
    """Yield the names of elements in output files, in the order of the document.

    Duplicate names, and names of unknown elements, are reported and omitted.
    """
    spec = table.spec.names
    if spec is None:
        return
    joints = [name for name, joint in table.joints.items() if joint is None or joint.twist is not None]
    driven: list[str] = [name for name, joint in table.joints.items() if joint is None or joint.drive is not None]
    coupled = [one.name for one in table.coupled]
    driven += [*(name for name, tendon in table.spec.tendons.items() if tendon.drive is not None), *coupled]
    tied = [name.joint for name, joint in table.joints.items() if joint is None or joint.mimic is not None or joint.loop]
    sensors = table.spec.sensors
    of_kind: tuple[tuple[NamedKind, dict[str, str], Iterable[str], str, Code], ...] = (
        ("components", spec.components, table.nodes, "component", Code.UNKNOWN_COMPONENT),
        ("mounts", spec.mounts, table.exports, "exported mount", Code.UNKNOWN_MOUNT),
        ("joints", spec.joints, [*dict.fromkeys(name.joint for name in joints), *TAKEN["joints"]], "moving joint", Code.UNKNOWN_JOINT),
        ("tendons", spec.tendons, [*table.spec.tendons, *coupled], "tendon", Code.UNKNOWN_TENDON),
        ("actuators", spec.actuators, driven, "driven joint or tendon", Code.UNKNOWN_JOINT),
        ("equalities", spec.equalities, tied, "mimic or loop joint", Code.UNKNOWN_JOINT),
        ("sensors", spec.sensors, sensors, "sensor", Code.REFERENCE),
        ("poses", spec.poses, table.poses, "pose", Code.UNKNOWN_POSE),
    )
    unsure = table.unbuilt or table.unbuilt_joints
    for kind, given, sound, what, code in of_kind:
        sections = {"actuators": ("joints", "tendons", "transmissions"), "equalities": ("joints",)}.get(kind, (kind,))
        known = [*sound, *(name for section in sections for name in table.doubts.names(section))]
        owners: dict[str, str] = {}
        for own, name in given.items():
            place: Path = ("names", kind, own)
            if (own.partition(":")[0] if kind == "sensors" else own) not in known:
                if not unsure and not any(map(table.doubts.lacks, sections)):
                    help = suggest(own, known, what=what.replace("joint or", "joints or") + "s")
                    scope.error(code, f"this document has no {what} `{own}`", place, key=True, help=help)
            elif name in TAKEN.get(kind, ()):
                scope.error(
                    Code.RESERVED_NAME, f"`{own}` cannot have the reserved name `{name}` in output files", place,
                    help="choose another name",
                )
            elif (other := owners.setdefault(name, own)) != own:
                scope.error(
                    Code.SAME_NAME, f"`{other}` and `{own}` have the same name `{name}` in output files", place,
                    help="rename one of the two elements",
                    notes=scope.second_note(f"`{other}` is defined here", ("names", kind, other), place),
                )
            else:
                path = CoordinateName(own).path if kind == "actuators" else own
                yield NameInFiles(kind=kind, own=path, name=name, origin=scope.origin(place))
