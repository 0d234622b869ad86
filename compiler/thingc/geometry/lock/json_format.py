"""Convert part schemas and records to and from the JSON values of `parts.lock.json`.

A lock file may come from an untrusted source, so every value is checked before it is used.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import Any, TypeVar, get_args

from msgspec.structs import asdict

from thingc.base.inertia import physical_fault
from thingc.base.numeric import hypot, sum_of
from thingc.base.pose import Pose, Vector
from thingc.geometry.print_slices import Moments, SliceFailure, SliceResult, Slicing
from thingc.geometry.record import (
    WHOLE,
    ActuatorRecord,
    DeclaredValue,
    DriveType,
    ImpureInputs,
    MountExpectation,
    MountRecord,
    ParameterKind,
    ParameterSchema,
    PartRecord,
    PartSchema,
    PartWarning,
    Value,
)

UNITS = {"length": "m", "angle": "rad", "mass": "kg", "ratio": "1", "number": "1"}
"""The units that are written to the lock file for human readers. All values are in SI units."""

KINDS: frozenset[ParameterKind] = frozenset(get_args(ParameterKind))
SOURCES = frozenset({"measured", "vendor", "estimated", "stated"})
_ORTHOGONAL = 1e-6
_NOTHING = 1e-20
"""Smallest plausible inertia at density 1 [m^5]. The value is far below the inertia of any part with a mass."""
_ENTRIES = 9
_MOMENTS = 10
_LAID = ("solid", "joins", "sparse")
_POSE = 12


class BadLock(Exception):
    """Raised for an invalid value in the lock file. `path` is the location of the value, such as `things.arm:Pen.parameters.length`. The
    message is the reason.
    """

    def __init__(self, path: str, message: str) -> None:
        super().__init__(message)
        self.path = path


# --- writing -----------------------------------------------------------------------------------------------------------


def schema_values(schema: PartSchema) -> dict[str, Any]:
    """Convert a part schema to JSON values. This function is the inverse of `read_schema`.

    The line of the class in the part file is omitted, because every edit above the class changes it.
    """
    return {
        "kind": schema.kind, "doc": schema.doc, "material": schema.material, "actuator": schema.actuator,
        "parameters": {parameter.name: _parameter_values(parameter) for parameter in schema.parameters},
    }


def _parameter_values(parameter: ParameterSchema) -> dict[str, Any]:
    values: dict[str, Any] = {"kind": parameter.kind}
    if parameter.kind in UNITS and UNITS[parameter.kind] != "1":
        values["unit"] = UNITS[parameter.kind]
    if not parameter.required:
        values["default"] = parameter.default
    for key, value in (("minimum", parameter.minimum), ("maximum", parameter.maximum)):
        if value is not None:
            values[key] = value
    if parameter.choices:
        values["choices"] = list(parameter.choices)
    if parameter.doc:
        values["doc"] = parameter.doc
    return values


def record_values(record: PartRecord) -> dict[str, Any]:
    """Convert a part record to JSON values. This function is the inverse of `read_record`.

    The JSON contains only the values that checks of assemblies need. Meshes and locations in source files are omitted.
    """
    values: dict[str, Any] = {
        "material": record.material, "color": record.color, "volume": _rounded(record.volume), "area": _rounded(record.area),
        "centre": [_rounded(entry) for entry in record.centre],
        "inertia": [_rounded(entry) for row in record.inertia for entry in row],
        "box": None if record.box is None else [_rounded(entry) for corner in record.box for entry in corner],
        "mounts": {name: _mount_values(mount) for name, mount in record.mounts.items()},
    }
    optional: dict[str, Any] = {
        "references": list(record.references),
        "expectations": [[one.mount, one.text, one.label, one.child_mount] for one in record.expectations],
        "actuator": None if record.actuator is None else _actuator_values(record.actuator),
        **{key: _stated_values(getattr(record, key)) for key in ("mass", "com", "matrix", "density")},
        "up": None if record.up is None else list(record.up),
        "slices": [_sliced_values(*one) for one in sorted(record.slices.items(), key=repr)],
        "bom": dict(sorted(record.bom.items())), "warnings": [warning.message for warning in record.warnings if warning.asked is None],
        "asks": [[warning.asked.value, warning.message] for warning in record.warnings if warning.asked is not None],
        "apart": [_rounded(volume) for volume in record.apart], "own_image": record.own_image,
    }
    return {**values, **{key: value for key, value in optional.items() if value}}


def _rounded(value: float) -> float:
    """Round a number to twelve significant digits, so that locks from two builds of the CAD kernel are equal."""
    return 0.0 if abs(value) < _NOTHING else float(f"{value:.12g}")


def _sliced_values(slicing: Slicing, sliced: SliceResult | SliceFailure) -> dict[str, Any]:
    how = {key: list(value) if isinstance(value, tuple) else value for key, value in asdict(slicing).items()}
    if isinstance(sliced, SliceFailure):
        return {**how, "unsliced": sliced.reason}
    return {**how, **{key: [_rounded(entry) for entry in getattr(sliced, key).numbers] for key in _LAID}}


def _mount_values(mount: MountRecord) -> dict[str, Any]:
    rotation = [entry for row in mount.pose.rotation for entry in row]
    values: dict[str, Any] = {"pose": [_rounded(entry) for entry in (*rotation, *mount.pose.translation)]}
    if mount.interface is not None:
        values["interface"] = mount.interface
    if mount.tolerance is not None:
        values["tolerance"] = mount.tolerance
    return values


_NUMBERS = ("stall_torque", "no_load_speed", "gear_ratio", "rotor_inertia", "kp", "kv")


def _actuator_values(actuator: ActuatorRecord) -> dict[str, Any]:
    numbers = {key: getattr(actuator, key) for key in _NUMBERS}
    return {
        "kind": actuator.kind, **{key: value for key, value in numbers.items() if value is not None},
        "sources": dict(sorted(actuator.sources.items())),
    }


def _stated_values(stated: DeclaredValue[Any] | None) -> Any:
    if stated is None:
        return None
    value: Any = stated.value
    if isinstance(value, tuple):
        value = [entry for row in value for entry in row] if isinstance(value[0], tuple) else list(value)
    return {"value": value, "source": stated.source}


# --- reading -----------------------------------------------------------------------------------------------------------


def read_schema(reference: str, value: Any, path: str) -> PartSchema:
    """Parse the schema of the part `module:Class`, without the location of the class.

    Raises `BadLock` if the lock file contains an invalid value.
    """
    table = mapping(value, path)
    return PartSchema(
        reference=reference, kind=_one_of({"thing", "shape", "function"}, table, "kind", path), doc=_text_at(table, "doc", path) or "",
        parameters=tuple(
            _parameter(name, one, f"{path}.parameters.{name}")
            for name, one in mapping(table.get("parameters", {}), f"{path}.parameters").items()
        ),
        material=_text_at(table, "material", path), actuator=_flag(table, "actuator", path), file="", line=0,
    )


def _parameter(name: str, value: Any, path: str) -> ParameterSchema:
    table = mapping(value, path)
    kind = _one_of(KINDS, table, "kind", path)
    required = "default" not in table
    default = None if required else _value(table["default"], f"{path}.default")
    choices = tuple(_value(one, f"{path}.choices") for one in sequence(table.get("choices", []), f"{path}.choices"))
    if default is not None and not _of_kind(kind, default, choices):
        raise BadLock(f"{path}.default", f"expected a {'whole number' if kind in WHOLE else kind}")
    if kind == "choice" and not choices:
        raise BadLock(f"{path}.choices", "expected at least one choice")
    if isinstance(default, int) and kind in UNITS:
        default = float(default)
    return ParameterSchema(
        name=name, kind=kind, required=required, default=default, minimum=_maybe(table, "minimum", path),
        maximum=_maybe(table, "maximum", path), choices=choices, doc=_text_at(table, "doc", path) or "",
    )


def _of_kind(kind: str, value: Value, choices: tuple[Value, ...]) -> bool:
    if kind == "choice":
        return value in choices
    if kind == "flag":
        return isinstance(value, bool)
    if kind == "text":
        return isinstance(value, str)
    if kind in WHOLE:
        return isinstance(value, int) and not isinstance(value, bool)
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def read_record(text: str, value: Any, path: str, code: tuple[str, int] | None) -> PartRecord:
    """Parse the part record of the definition `text`, without meshes.

    `code` is the file and the line of the part's class. Raises `BadLock` if the lock file contains an invalid value.
    """
    table = mapping(value, path)
    box = None if table.get("box") is None else numbers(table["box"], 6, f"{path}.box")
    inertia = numbers(table.get("inertia"), _ENTRIES, f"{path}.inertia")
    return PartRecord(
        text=text, material=_text_at(table, "material", path), color=_text_at(table, "color", path),
        volume=_least(table, "volume", path), area=_least(table, "area", path),
        centre=numbers(table.get("centre"), 3, f"{path}.centre"),  # type: ignore[arg-type]
        inertia=(inertia[:3], inertia[3:6], inertia[6:]),  # type: ignore[arg-type]
        box=None if box is None else (box[:3], box[3:]),  # type: ignore[arg-type]
        mounts={
            name: _mount(one, f"{path}.mounts.{name}") for name, one in mapping(table.get("mounts", {}), f"{path}.mounts").items()
        },
        references=tuple(_texts(table.get("references", []), f"{path}.references")),
        expectations=tuple(_expectation(one, f"{path}.expectations") for one in sequence(
            table.get("expectations", []), f"{path}.expectations")),
        actuator=None if table.get("actuator") is None else _actuator(table["actuator"], f"{path}.actuator"),
        mass=_stated(table, "mass", 1, path), com=_stated(table, "com", 3, path), matrix=_stated(table, "matrix", _ENTRIES, path),
        density=_stated(table, "density", 1, path), bom=_text_table(table.get("bom", {}), f"{path}.bom"),
        warnings=(
            *(PartWarning(message=one) for one in _texts(table.get("warnings", []), f"{path}.warnings")),
            *(_question(one, f"{path}.asks") for one in sequence(table.get("asks", []), f"{path}.asks")),
        ),
        fits={}, meshes={}, pieces=(), convex={}, brep=None, code=code,
        apart=tuple(number(one, f"{path}.apart") for one in sequence(table.get("apart", []), f"{path}.apart")),
        own_image="own_image" in table and _flag(table, "own_image", path),
        up=None if table.get("up") is None else _direction(table["up"], f"{path}.up"),
        slices=dict(_sliced(one, f"{path}.slices") for one in sequence(table.get("slices", []), f"{path}.slices")),
    )


def _sliced(value: Any, path: str) -> tuple[Slicing, SliceResult | SliceFailure]:
    table = mapping(value, path)
    slicing = Slicing(
        up=_direction(table.get("up"), f"{path}.up"), walls=_whole(table, "walls", path), top=_whole(table, "top", path),
        bottom=_whole(table, "bottom", path),
        **{key: _least(table, key, path) for key in ("layer", "line_width", "overlap", "bridge_flow")},
    )
    reason = _text_at(table, "unsliced", path)
    if reason is not None:
        return slicing, SliceFailure(reason=reason)
    solid, joins, sparse = (_matter(table.get(key), f"{path}.{key}") for key in _LAID)
    if not solid.volume > 0.0:
        raise BadLock(f"{path}.solid", "expected a volume above 0")
    return slicing, SliceResult(solid=solid, joins=joins, sparse=sparse)


def _matter(value: Any, path: str) -> Moments:
    """Parse the volume, the first moments and the second moments of a solid (ten numbers).

    Raises `BadLock` unless the moments are physically possible.
    """
    moments = Moments.of(numbers(value, _MOMENTS, path))
    of = moments.properties
    if moments.volume < 0.0 or moments.volume > 0.0 and physical_fault(of.inertia) is not None:
        raise BadLock(path, "expected the integrals of 1, x, y, z, xx, yy, zz, xy, xz, yz over a solid")
    return moments


def _direction(value: Any, path: str) -> Vector:
    x, y, z = numbers(value, 3, path)
    if abs(hypot(x, y, z) - 1.0) > _ORTHOGONAL:
        raise BadLock(path, "expected a direction: three numbers of length 1")
    return x, y, z


def _whole(table: Mapping[str, Any], key: str, path: str) -> int:
    value = _least(table, key, path)
    if value != int(value):
        raise BadLock(f"{path}.{key}", "expected a whole number")
    return int(value)


def _mount(value: Any, path: str) -> MountRecord:
    table = mapping(value, path)
    entries = numbers(table.get("pose"), _POSE, f"{path}.pose")
    rows = (entries[:3], entries[3:6], entries[6:9])
    for i, row in enumerate(rows):
        for j, other in enumerate(rows):
            if abs(sum_of(a * b for a, b in zip(row, other, strict=True)) - (i == j)) > _ORTHOGONAL:
                raise BadLock(f"{path}.pose", "expected a rotation (nine numbers, the rows of a rotation matrix) and a position")
    return MountRecord(
        pose=Pose(rotation=rows, translation=entries[9:]),  # type: ignore[arg-type]
        interface=_text_at(table, "interface", path), tolerance=_maybe(table, "tolerance", path),
    )


def _expectation(value: Any, path: str) -> MountExpectation:
    texts = list(_texts(value, path))
    if len(texts) != 4:
        raise BadLock(path, "expected a mount, a definition, its display name, and its mount")
    mount, text, label, child_mount = texts
    return MountExpectation(mount=mount, text=text, label=label, child_mount=child_mount)


def _question(value: Any, path: str) -> PartWarning:
    texts = list(_texts(value, path))
    if len(texts) != 2 or texts[0] not in list(ImpureInputs):
        raise BadLock(path, "expected the kind of a warning and its message")
    return PartWarning(message=texts[1], asked=ImpureInputs(texts[0]))


def _actuator(value: Any, path: str) -> ActuatorRecord:
    table = mapping(value, path)
    quantities = {key: _maybe(table, key, path) for key in _NUMBERS}
    gear_ratio = quantities.pop("gear_ratio")
    return ActuatorRecord(
        kind=_one_of(get_args(DriveType), table, "kind", path), gear_ratio=1.0 if gear_ratio is None else gear_ratio,
        sources=_text_table(table.get("sources", {}), f"{path}.sources"), **quantities,
    )


def _stated(table: Mapping[str, Any], key: str, count: int, path: str) -> DeclaredValue[Any] | None:
    if table.get(key) is None:
        return None
    path = f"{path}.{key}"
    inner = mapping(table[key], path)
    source = _one_of(SOURCES, inner, "source", path)
    if count == 1:
        return DeclaredValue(value=number(inner.get("value"), f"{path}.value"), source=source)
    entries: Any = numbers(inner.get("value"), count, f"{path}.value")
    return DeclaredValue(value=entries if count == 3 else (entries[:3], entries[3:6], entries[6:]), source=source)


# --- small readers -----------------------------------------------------------------------------------------------------


_T = TypeVar("_T")
_Word = TypeVar("_Word", bound=str)


def _of_type(kind: type[_T], value: Any, path: str, words: str) -> _T:
    if not isinstance(value, kind):
        raise BadLock(path, f"expected {words}")
    return value


def mapping(value: Any, path: str) -> Mapping[str, Any]:
    """Return a JSON value as a mapping. Raises `BadLock` if the value is not a JSON object."""
    return _of_type(dict, value, path, "a mapping")


def sequence(value: Any, path: str) -> list[Any]:
    """Return a JSON value as a list. Raises `BadLock` if the value is not a JSON array."""
    return _of_type(list, value, path, "a list")


def text_at(table: Mapping[str, Any], key: str, path: str) -> str:
    """Return the string under the key `key` in a JSON object. Raises `BadLock` if the key is missing or its value is not a string."""
    return _of_type(str, table.get(key), f"{path}.{key}", "a string")


def number(value: Any, path: str) -> float:
    """Return a JSON value as a float. Raises `BadLock` unless the value is a finite number."""
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        try:
            as_float = float(value)
        except OverflowError:
            as_float = math.inf
        if math.isfinite(as_float):
            return as_float
    raise BadLock(path, "expected a finite number")


def numbers(value: Any, count: int, path: str) -> tuple[float, ...]:
    """Return a JSON value as a tuple of `count` floats. Raises `BadLock` unless the value is a list of `count` finite numbers."""
    entries = sequence(value, path)
    if len(entries) != count:
        raise BadLock(path, f"expected {count} numbers")
    return tuple(number(one, path) for one in entries)


def _value(value: Any, path: str) -> Value:
    if isinstance(value, (bool, str)):
        return value
    return value if isinstance(value, int) and abs(value) < 2**53 else number(value, path)


def _maybe(table: Mapping[str, Any], key: str, path: str) -> float | None:
    return None if table.get(key) is None else number(table[key], f"{path}.{key}")


def _least(table: Mapping[str, Any], key: str, path: str) -> float:
    value = number(table.get(key), f"{path}.{key}")
    if value < 0.0:
        raise BadLock(f"{path}.{key}", "expected a number of at least 0")
    return value


def _text_at(table: Mapping[str, Any], key: str, path: str) -> str | None:
    return None if table.get(key) is None else text_at(table, key, path)


def _flag(table: Mapping[str, Any], key: str, path: str) -> bool:
    return _of_type(bool, table.get(key), f"{path}.{key}", "true or false")


def _one_of(known: Collection[_Word], table: Mapping[str, Any], key: str, path: str) -> _Word:
    word = next((one for one in known if one == table.get(key)), None)
    if word is None:
        raise BadLock(f"{path}.{key}", f"expected one of {', '.join(sorted(known))}")
    return word


def _texts(value: Any, path: str) -> list[str]:
    texts = sequence(value, path)
    if not all(isinstance(one, str) for one in texts):
        raise BadLock(path, "expected a list of strings")
    return texts


def _text_table(value: Any, path: str) -> dict[str, str]:
    words = mapping(value, path)
    if not all(isinstance(one, str) for one in words.values()):
        raise BadLock(path, "expected a mapping from names to strings")
    return dict(words)


