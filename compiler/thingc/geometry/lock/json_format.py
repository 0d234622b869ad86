"""The JSON format of the part schemas and records in `parts.lock.json`.

The structs in this module are the JSON values. A lock file may come from an untrusted source, so every value is checked before it is used.
Their types check most values, and their methods check the rest.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from types import UnionType
from typing import Annotated, Any, Literal, TypeVar, get_args, get_origin

from msgspec import Meta, Struct, ValidationError, convert, to_builtins
from msgspec.structs import asdict, fields, replace

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.inertia import physical_fault
from thingc.base.interfaces import MatingFeature
from thingc.base.numeric import hypot, sum_of
from thingc.base.pose import Matrix, Pose, Vector
from thingc.geometry import record as records
from thingc.geometry.print_slices import Moments, SliceFailure, SliceResult, Slicing

UNITS = {"length": "m", "angle": "rad", "mass": "kg"}
"""The units that are written to the lock file for human readers. All values are in SI units."""

CONTINUOUS = frozenset(records.DIMENSIONS) - records.WHOLE
"""Kinds of parameters that are floats."""

_ORTHOGONAL = 1e-6
_NOTHING = 1e-20
"""Smallest plausible inertia at density 1 [m^5]. The value is far below the inertia of any part with a mass."""

_T = TypeVar("_T")
_Amount = Annotated[float, Meta(ge=0.0)]
_Six = Annotated[tuple[float, ...], Meta(min_length=6, max_length=6)]
_Nine = Annotated[tuple[float, ...], Meta(min_length=9, max_length=9)]
_Ten = Annotated[tuple[float, ...], Meta(min_length=10, max_length=10)]
_Twelve = Annotated[tuple[float, ...], Meta(min_length=12, max_length=12)]
_Whole = Annotated[int, Meta(ge=-(2**53), le=2**53)]
"""A whole number that a float represents exactly."""
_Value = float | _Whole | bool | str


class BadLock(Exception):
    """Raised for an invalid value in the lock file. `path` is the location of the value, such as `things.arm:Pen.parameters.length`. The
    message is the reason.
    """

    def __init__(self, path: str, message: str) -> None:
        super().__init__(message)
        self.path = path


def read_value(value: Any, kind: type[_T], path: str) -> _T:
    """Convert a JSON value at `path` of the lock file to a struct. Raises `BadLock`, with the path of the first wrong entry, if the value
    does not have the form of the struct.
    """
    try:
        return convert(value, kind)
    except ValidationError as error:
        for name, entry, inner in _entries(value, kind):
            read_value(entry, inner, f"{path}.{name}".removeprefix("."))
        reason = str(error)
        if get_origin(kind) is Literal:
            reason = f"expected one of {', '.join(get_args(kind))}, found {json.dumps(value)[:100]}"
        raise BadLock(path, reason[0].lower() + reason[1:]) from None


def _entries(value: Any, kind: Any) -> Iterator[tuple[str, Any, Any]]:
    """Yield the names and the values of a JSON object, and the types of these values in a struct or a dict of the type `kind`."""
    for one in get_args(kind) if isinstance(kind, UnionType) else (kind,):
        if get_origin(one) is dict and isinstance(value, dict):
            yield from ((name, entry, get_args(one)[1]) for name, entry in value.items())
        elif isinstance(one, type) and issubclass(one, Struct) and isinstance(value, dict):
            yield from ((field.name, value[field.name], field.type) for field in fields(one) if field.name in value)


def _json_values(struct: FrozenStruct) -> dict[str, Any]:
    values: dict[str, Any] = json.loads(json.dumps(to_builtins(struct)))
    return values


# --- schemas -----------------------------------------------------------------------------------------------------------


class LockedParameter(FrozenStruct, omit_defaults=True):
    """A parameter of a part. `unit` is for human readers. A parameter without `default` is required."""

    kind: records.ParameterKind
    unit: str | None = None
    default: _Value | None = None
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[_Value, ...] = ()
    doc: str = ""

    def schema(self, name: str, path: str) -> records.ParameterSchema:
        """Return the parameter of the part schema. Raises `BadLock`, with this `path`, for an invalid default value."""
        default = self.default
        if self.kind == "choice" and not self.choices:
            raise BadLock(path, "expected at least one choice")
        if default is not None and not self._is_value(default):
            expected = "whole number" if self.kind in records.WHOLE else self.kind
            raise BadLock(f"{path}.default", f"expected a {expected}, found {default!r}")
        if isinstance(default, int) and self.kind in CONTINUOUS:
            default = float(default)
        return records.ParameterSchema(
            name=name, kind=self.kind, required=default is None, default=default, minimum=self.minimum, maximum=self.maximum,
            choices=self.choices, doc=self.doc,
        )

    def _is_value(self, value: _Value) -> bool:
        if self.kind == "choice":
            return value in self.choices
        if isinstance(value, (bool, str)):
            return self.kind == ("flag" if isinstance(value, bool) else "text")
        return self.kind in CONTINUOUS or self.kind in records.WHOLE and isinstance(value, int)


class LockedSchema(FrozenStruct):
    """The schema of a part, without the location of its class. The lock file does not contain the line of the class in the part file,
    because every edit above the class changes it.
    """

    kind: records.SchemaKind
    doc: str
    material: str | None
    actuator: bool
    parameters: dict[str, LockedParameter]

    def schema(self, reference: str, path: str) -> records.PartSchema:
        """Return the schema of the part `module:Class`, whose JSON is at `path`. Raises `BadLock` for an invalid default value."""
        return records.PartSchema(
            reference=reference, kind=self.kind, doc=self.doc, material=self.material, actuator=self.actuator, file="", line=0,
            parameters=tuple(one.schema(name, f"{path}.parameters.{name}") for name, one in self.parameters.items()),
        )


def schema_values(schema: records.PartSchema) -> dict[str, Any]:
    """Convert a part schema to JSON values, the form of `LockedSchema`."""
    parameters = {
        one.name: LockedParameter(
            kind=one.kind, unit=UNITS.get(one.kind), default=one.default, minimum=one.minimum, maximum=one.maximum, choices=one.choices,
            doc=one.doc,
        )
        for one in schema.parameters
    }
    return _json_values(LockedSchema(
        kind=schema.kind, doc=schema.doc, material=schema.material, actuator=schema.actuator, parameters=parameters,
    ))


# --- records -----------------------------------------------------------------------------------------------------------


class LockedMount(FrozenStruct, omit_defaults=True):
    """A mount of a part. `pose` contains the nine numbers of the rotation matrix, row by row, and the position."""

    pose: _Twelve
    interface: str | None = None
    tolerance: float | None = None
    features: tuple[MatingFeature, ...] = ()
    contradictions: tuple[str, ...] = ()

    def record(self, path: str) -> records.MountRecord:
        """Return the mount of the part record. Raises `BadLock`, with this `path`, if the nine numbers are not a rotation matrix."""
        rows = _rows(self.pose[:9])
        for i, row in enumerate(rows):
            for j, other in enumerate(rows):
                if abs(sum_of(a * b for a, b in zip(row, other, strict=True)) - (i == j)) > _ORTHOGONAL:
                    raise BadLock(f"{path}.pose", "expected a rotation (nine numbers, the rows of a rotation matrix) and a position")
        x, y, z = self.pose[9:]
        return records.MountRecord(**{**asdict(self), "pose": Pose(rotation=rows, translation=(x, y, z))})


class LockedActuator(records.ActuatorRecord, omit_defaults=True):
    """The actuator of a part. The lock file always contains the gear ratio and the sources."""

    gear_ratio: float
    sources: dict[str, str]


class LockedSlice(FrozenStruct):
    """The result of slicing a part: `unsliced`, the reason of a failure, or the numbers of the `Moments` of three bodies.

    The JSON object also contains the fields of `Slicing`.
    """

    unsliced: str | None = None
    solid: _Ten | None = None
    joins: _Ten | None = None
    sparse: _Ten | None = None

    def result(self, path: str) -> SliceResult | SliceFailure:
        """Return the result in the part record. Raises `BadLock`, with this `path`, for moments that are not physically possible."""
        if self.unsliced is not None:
            return SliceFailure(reason=self.unsliced)
        bodies = {key: Moments.of(getattr(self, key) or (0.0,) * 10) for key in SliceResult.__struct_fields__}
        for key, body in bodies.items():
            if body.volume < 0.0 or body.volume > 0.0 and physical_fault(body.properties.inertia) is not None:
                raise BadLock(f"{path}.{key}", "expected the integrals of 1, x, y, z, xx, yy, zz, xy, xz, yz over a solid")
        if not bodies["solid"].volume > 0.0:
            raise BadLock(f"{path}.solid", "expected a volume above 0")
        return SliceResult(**bodies)


class LockedRecord(FrozenStruct, omit_defaults=True):
    """The values of a part record that checks of assemblies need. Meshes and locations in source files are omitted.

    Matrices and boxes are lists of numbers. Each entry of `slices` has the fields of `Slicing` and of `LockedSlice`. `asks` contains the
    warnings about impure inputs, and `warnings` all others.
    """

    material: str | None
    color: str | None
    volume: _Amount
    area: _Amount
    centre: Vector
    inertia: _Nine
    box: _Six | None
    mounts: dict[str, LockedMount]
    references: tuple[str, ...] = ()
    expectations: tuple[records.MountExpectation, ...] = ()
    actuator: LockedActuator | None = None
    mass: records.DeclaredValue[float] | None = None
    com: records.DeclaredValue[Vector] | None = None
    matrix: records.DeclaredValue[_Nine] | None = None  # type: ignore[type-var]
    density: records.DeclaredValue[float] | None = None
    up: Vector | None = None
    slices: tuple[dict[str, Any], ...] = ()
    bom: records.Bom = {}
    warnings: tuple[str, ...] = ()
    asks: tuple[tuple[records.ImpureInputs, str], ...] = ()
    apart: tuple[float, ...] = ()
    own_image: bool = False


def record_values(record: records.PartRecord) -> dict[str, Any]:
    """Convert a part record to JSON values, the form of `LockedRecord`. This function is the inverse of `read_record`."""
    actuator = record.actuator
    return _json_values(LockedRecord(
        material=record.material, color=record.color, volume=_round(record.volume), area=_round(record.area),
        centre=_round_all(record.centre), inertia=_round_all(_flat(record.inertia)),
        box=None if record.box is None else _round_all(_flat(record.box)),
        mounts={name: _locked_mount(mount) for name, mount in record.mounts.items()},
        references=record.references, expectations=record.expectations,
        actuator=None if actuator is None else LockedActuator(**{**asdict(actuator), "sources": dict(sorted(actuator.sources.items()))}),
        mass=record.mass, com=record.com,
        matrix=None if record.matrix is None else replace(record.matrix, value=_flat(record.matrix.value)),  # type: ignore[arg-type]
        density=record.density,
        up=record.up, slices=tuple(_slice_values(*one) for one in sorted(record.slices.items(), key=repr)),
        bom=dict(sorted(record.bom.items())), warnings=tuple(one.message for one in record.warnings if one.asked is None),
        asks=tuple((one.asked, one.message) for one in record.warnings if one.asked is not None),
        apart=_round_all(record.apart), own_image=record.own_image,
    ))


def _locked_mount(mount: records.MountRecord) -> LockedMount:
    numbers = _round_all((*_flat(mount.pose.rotation), *mount.pose.translation))
    return LockedMount(**{**asdict(mount), "pose": numbers})


def _slice_values(slicing: Slicing, sliced: SliceResult | SliceFailure) -> dict[str, Any]:
    if isinstance(sliced, SliceFailure):
        return {**to_builtins(slicing), "unsliced": sliced.reason}
    return {**to_builtins(slicing), **{key: _round_all(body.numbers) for key, body in asdict(sliced).items()}}


def _flat(rows: Iterable[Vector]) -> tuple[float, ...]:
    return tuple(entry for row in rows for entry in row)


def _round_all(values: Iterable[float]) -> tuple[Any, ...]:
    return tuple(map(_round, values))


def _round(value: float) -> float:
    """Round a number to twelve significant digits, so that locks from two builds of the CAD kernel are equal."""
    return 0.0 if abs(value) < _NOTHING else float(f"{value:.12g}")


def read_record(text: str, value: Any, path: str, code: tuple[str, int] | None) -> records.PartRecord:
    """Parse the part record of the definition `text`, without meshes.

    `code` is the file and the line of the part's class. Raises `BadLock` if the lock file contains an invalid value.
    """
    locked = read_value(value, LockedRecord, path)
    _check_direction(locked.up, f"{path}.up")
    unchanged = {key: one for key, one in asdict(locked).items() if key != "asks"}
    return records.PartRecord(**{
        **unchanged, "text": text, "code": code, "inertia": _rows(locked.inertia),
        "box": locked.box and (locked.box[:3], locked.box[3:]),
        "mounts": {name: mount.record(f"{path}.mounts.{name}") for name, mount in locked.mounts.items()},
        "actuator": locked.actuator and records.ActuatorRecord(**asdict(locked.actuator)),
        "matrix": locked.matrix and replace(locked.matrix, value=_rows(locked.matrix.value)),
        "slices": dict(_read_slice(one, f"{path}.slices") for one in locked.slices),
        "warnings": (
            *(records.PartWarning(message=message) for message in locked.warnings),
            *(records.PartWarning(message=message, asked=asked) for asked, message in locked.asks),
        ),
    })


def _read_slice(value: dict[str, Any], path: str) -> tuple[Slicing, SliceResult | SliceFailure]:
    slicing = read_value(value, Slicing, path)
    _check_direction(None if slicing.up == "auto" else slicing.up, f"{path}.up")
    return slicing, read_value(value, LockedSlice, path).result(path)


def _check_direction(direction: Vector | None, path: str) -> None:
    if direction is not None and abs(hypot(*direction) - 1.0) > _ORTHOGONAL:
        raise BadLock(path, "expected a direction: three numbers of length 1")


def _rows(numbers: tuple[float, ...]) -> Matrix:
    return numbers[:3], numbers[3:6], numbers[6:]  # type: ignore[return-value]
