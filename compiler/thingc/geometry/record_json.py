"""Part schemas, records and failures as plain JSON values, as the store and the worker's pipe carry them.

Files in the workspace are written relative to it (`root`), so that records can be shared between machines.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from typing import Any

from msgspec import convert, to_builtins
from msgspec.structs import replace

from thingc.base.pose import Matrix, Pose, Vector
from thingc.base.primitives import Primitive
from thingc.geometry.record import (
    ActuatorRecord,
    DeclaredValue,
    ImpureInputs,
    Mesh,
    MountExpectation,
    MountRecord,
    PartFailure,
    PartRecord,
    PartSchema,
    PartWarning,
)


def shortened(file: str | None, root: str) -> str | None:
    """A file relative to the workspace, with `/`; as it is outside of it."""
    if file is None:
        return None
    inside = os.path.join(root, "")
    return file[len(inside) :].replace(os.sep, "/") if file.startswith(inside) else file


def full(file: str | None, root: str) -> str | None:
    """The inverse of `shortened`."""
    return None if file is None else os.path.normpath(os.path.join(root, file))


# --- schemas ----------------------------------------------------------------------------------------------------------


def schema_to_json(schema: PartSchema, root: str) -> Any:
    """The inverse of `schema_from_json`."""
    return {**to_builtins(schema), "file": shortened(schema.file, root)}


def schema_from_json(value: Any, root: str) -> PartSchema:
    """A part schema."""
    return convert({**value, "file": full(value["file"], root) or ""}, PartSchema)


# --- failures ---------------------------------------------------------------------------------------------------------


def failure_to_json(failure: PartFailure, root: str) -> Any:
    """The inverse of `failure_from_json`."""
    return {**to_builtins(failure), "file": shortened(failure.file, root)}


def failure_from_json(value: Any, root: str) -> PartFailure:
    """A failure."""
    return convert({**value, "file": full(value["file"], root)}, PartFailure)


def with_left(answer: dict[str, Any], commands: Iterable[str]) -> dict[str, Any]:
    """What a worker has made of a part, with a word on each of the processes that the part has left behind: their command lines, empty
    for a copy of itself."""
    if "record" not in answer:
        return answer
    names = sorted({"a copy of itself" if not line else f"`{line if len(line) <= 60 else line[:57] + '...'}`" for line in commands})
    left = [[f"leaves {name} running, which was ended", None, None, ImpureInputs.LEFT.value] for name in names]
    return {**answer, "record": {**answer["record"], "warnings": [*answer["record"]["warnings"], *left]}}


# --- records ----------------------------------------------------------------------------------------------------------


def record_to_json(record: PartRecord, root: str) -> Any:
    """The inverse of `record_from_json`; without `convex` and `slices`, which are kept apart."""
    return {
        "text": record.text, "material": record.material, "color": record.color, "volume": record.volume,
        "area": record.area, "centre": list(record.centre), "inertia": record.inertia, "box": record.box,
        "mounts": {name: [_pose(m.pose), m.interface, m.tolerance] for name, m in record.mounts.items()},
        "mount_order": list(record.mounts),
        "references": list(record.references),
        "expectations": to_builtins(record.expectations),
        "actuator": None if record.actuator is None else _actuator(record.actuator),
        "mass": _stated(record.mass), "com": _stated(record.com), "matrix": _stated(record.matrix),
        "density": _stated(record.density), "bom": dict(sorted(record.bom.items())),
        "warnings": [to_builtins(replace(w, file=shortened(w.file, root))) for w in record.warnings],
        "fits": {name: _primitive(fit) for name, fit in sorted(record.fits.items())},
        "meshes": to_builtins(dict(sorted(record.meshes.items()))),
        "pieces": [_piece(piece) for piece in record.pieces],
        "brep": record.brep, "apart": list(record.apart),
        "up": record.up, "own_image": record.own_image,
        "code": None if record.code is None else [shortened(record.code[0], root), record.code[1]],
    }


def record_from_json(value: Any, root: str) -> PartRecord:
    """A part record, without convex pieces and slices."""
    box = value["box"]
    code = value["code"]
    return PartRecord(
        text=value["text"], material=value["material"], color=value["color"], volume=value["volume"], area=value["area"],
        centre=_vector(value["centre"]), inertia=_matrix(value["inertia"]),
        box=None if box is None else (_vector(box[0]), _vector(box[1])),
        mounts={
            name: MountRecord(pose=pose_from_json(pose), interface=interface, tolerance=tolerance)
            for name in value["mount_order"]
            for pose, interface, tolerance in (value["mounts"][name],)
        },
        references=tuple(value["references"]),
        expectations=tuple(convert(one, MountExpectation) for one in value["expectations"]),
        actuator=None if value["actuator"] is None else convert(value["actuator"], ActuatorRecord),
        mass=_read_stated(value["mass"]), com=_read_stated(value["com"]), matrix=_read_stated(value["matrix"]),
        density=_read_stated(value["density"]), bom=value["bom"],
        warnings=tuple(
            convert([message, full(file, root), *more], PartWarning) for message, file, *more in value["warnings"]
        ),
        fits={name: _read_primitive(fit) for name, fit in value["fits"].items()},
        meshes={name: convert(mesh, Mesh) for name, mesh in value["meshes"].items()},
        pieces=tuple(_read_piece(piece) for piece in value["pieces"]),
        convex=(),
        brep=value["brep"], apart=tuple(value["apart"]), own_image=value["own_image"],
        up=None if value["up"] is None else _vector(value["up"]),
        code=None if code is None else (full(code[0], root) or "", code[1]),
    )


def blobs_of(value: Any) -> list[tuple[str, int | None]]:
    """The blobs that a record's JSON needs: `(sha256, size)`, the size None where it is not known."""
    pieces = [piece["mesh"] for piece in value["pieces"] if "mesh" in piece]
    blobs: list[tuple[str, int | None]] = [(mesh[0], mesh[1]) for mesh in (*value["meshes"].values(), *pieces)]
    return blobs if value["brep"] is None else [*blobs, (value["brep"], None)]


def _piece(piece: Mesh | Primitive) -> Any:
    return {"mesh": to_builtins(piece)} if isinstance(piece, Mesh) else {"primitive": _primitive(piece)}


def _read_piece(value: Any) -> Mesh | Primitive:
    return convert(value["mesh"], Mesh) if "mesh" in value else _read_primitive(value["primitive"])


def _primitive(primitive: Primitive) -> Any:
    return [primitive.shape, list(primitive.size), _pose(primitive.pose)]


def _read_primitive(value: Any) -> Primitive:
    shape, size, pose = value
    return Primitive(shape=shape, size=tuple(size), pose=pose_from_json(pose))


def _pose(pose: Pose) -> Any:
    return [*pose.rotation[0], *pose.rotation[1], *pose.rotation[2], *pose.translation]


def pose_from_json(value: Any) -> Pose:
    """The rows of a rotation, then a translation: twelve numbers."""
    a, b, c, d, e, f, g, h, i, x, y, z = value
    return Pose(rotation=((a, b, c), (d, e, f), (g, h, i)), translation=(x, y, z))


def _vector(value: Any) -> Vector:
    x, y, z = value
    return (x, y, z)


def _matrix(value: Any) -> Matrix:
    a, b, c = value
    return (_vector(a), _vector(b), _vector(c))


def _stated(stated: DeclaredValue | None) -> Any:
    return None if stated is None else [stated.value, stated.source]


def _read_stated(value: Any) -> DeclaredValue | None:
    if value is None:
        return None
    held, source = value
    if isinstance(held, list):
        held = _matrix(held) if isinstance(held[0], list) else _vector(held)
    return DeclaredValue(value=held, source=source)


def _actuator(actuator: ActuatorRecord) -> Any:
    return {**to_builtins(actuator), "sources": dict(sorted(actuator.sources.items()))}
