"""Write `stl/<definition>.stl`, a file to print each definition that is not bought. The unit is millimetres, and the z axis points away
from the print bed.
"""

from __future__ import annotations

from thingc.base.pose import Vector
from thingc.geometry.print_slices import UPRIGHT
from thingc.geometry.record import PartDefinition
from thingc.geometry.store.local import Store
from thingc.model.assembly.types import Occurrence
from thingc.targets.artifact import Artifacts, Content, Loss, StoredArtifact
from thingc.targets.bom.emit import make_of
from thingc.targets.geometry import report_same_file
from thingc.targets.request import EmitRequest


def emit(request: EmitRequest) -> Artifacts:
    """Write an STL file in print orientation for each definition with geometry. Definitions are omitted if all their occurrences are
    bought.

    If a mesh is not closed, the file is still written, because a slicer may be able to repair the mesh. An export loss is reported. If two
    definitions have the same file name (such as `a/b.step` and `a.b.step`), an error is reported at the second definition.
    """
    files: dict[str, Content] = {}
    losses: list[Loss] = []
    owners: dict[str, Occurrence] = {}
    for occurrence in request.assembly.occurrences:
        definition, record = occurrence.component.definition, occurrence.record
        if not isinstance(definition, PartDefinition) or record is None or make_of(occurrence) == "buy":
            continue
        mesh = record.meshes.get("print")
        if mesh is None:
            continue
        path = f"stl/{definition.stem}.stl"
        owner = owners.setdefault(path.casefold(), occurrence)
        up = direction_up(occurrence, request.store)
        if owner.definition != occurrence.definition:
            report_same_file(occurrence, owner, path, request.report)
            continue
        if owner is not occurrence:
            if up != direction_up(owner, request.store):
                what = f"`{occurrence.definition.label}` is printed in two orientations (`{path}` has the orientation of `{owner.path}`)"
                losses.append(Loss("stl", None, occurrence.path, what, "omitted", occurrence.origin))
            continue
        own = StoredArtifact(sha256=mesh.sha256, size=mesh.size)
        files[path] = own if up == UPRIGHT else turn_stl(request.store.read(mesh.sha256), up)
        if not mesh.closed:
            what = f"the surface of `{occurrence.definition.label}` is not closed"
            losses.append(Loss("stl", None, occurrence.path, what, "approximated", occurrence.origin))
    return Artifacts(files=dict(sorted(files.items())), losses=tuple(losses))


def direction_up(occurrence: Occurrence, store: Store) -> Vector:
    """Return the direction away from the print bed, a unit vector in the frame of a part with meshes.

    A direction in the document takes precedence over the direction of the Thing, which takes precedence over the default.
    """
    record, up = occurrence.record, occurrence.overrides.up
    if up == "auto" and record is not None:
        from thingc.geometry.print_support import automatic_direction

        up = automatic_direction(store, record.meshes["slicing"].sha256)
    return up if isinstance(up, tuple) else (record.up if record is not None else None) or UPRIGHT


def turn_stl(stl: bytes, up: Vector) -> bytes:
    """Rotate a binary STL file about the origin of the part, by the smallest angle after which `up` points along z."""
    if up == UPRIGHT:
        return stl
    import numpy as np

    x, y, z = up
    # Rodrigues' formula; the axis is up x z, or x if `up` is -z
    rotation = np.diag([1.0, -1.0, -1.0]) if z < -1.0 + 1e-12 else np.array([
        [1.0 - x * x / (1.0 + z), -x * y / (1.0 + z), -x], [-x * y / (1.0 + z), 1.0 - y * y / (1.0 + z), -y], [x, y, z],
    ])
    facets = np.frombuffer(stl, dtype=[("vectors", "<f4", (4, 3)), ("attribute", "<u2")], offset=84).copy()
    facets["vectors"] = facets["vectors"].astype(float) @ rotation.T + 0.0
    return stl[:84] + facets.tobytes()
