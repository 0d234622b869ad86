"""Convert part schemas and records to and from the JSON values of `parts.lock.json`.

A lock file may come from an untrusted source, so every value is checked before it is used.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Collection, Iterator, Mapping
from typing import Any, TypeVar, get_args

from msgspec import ValidationError, convert
from msgspec.json import decode, encode
from msgspec.structs import asdict

from thingc.base.inertia import physical_fault
from thingc.base.interfaces import MatingFeature
from thingc.base.numeric import hypot, sum_of
from thingc.base.pose import Matrix, Pose, Vector
from thingc.geometry.print_slices import Moments, SliceFailure, SliceResult, Slicing
from thingc.geometry.record import (
    DIMENSIONS,
    WHOLE,
    ActuatorRecord,
    Declared,
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
    SchemaKind,
    Value,
)

UNITS = {"length": "m", "angle": "rad", "mass": "kg"}
"""The units that are written to the lock file for human readers. All values are in SI units."""

CONTINUOUS = frozenset(DIMENSIONS) - WHOLE
"""Kinds of parameters that are floats."""

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
    return _present({
        "kind": parameter.kind, "unit": UNITS.get(parameter.kind), "default": parameter.default, "minimum": parameter.minimum,
        "maximum": parameter.maximum, "choices": list(parameter.choices) or None, "doc": parameter.doc or None,
    })


def _present(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values that are not None."""
    return {key: value for key, value in values.items() if value is not None}


def record_values(record: PartRecord) -> dict[str, Any]:
    """Convert a part record to JSON values. This function is the inverse of `read_record`.

    The JSON contains only the values that checks of assemblies need. Meshes and locations in source files are omitted.
    """
    values: dict[str, Any] = {
        "material": record.material, "color": record.color, "volume": _round(record.volume), "area": _round(record.area),
        "centre": [_round(entry) for entry in record.centre], "inertia": [_round(entry) for row in record.inertia for entry in row],
        "box": None if record.box is None else [_round(entry) for corner in record.box for entry in corner],
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
        "apart": [_round(volume) for volume in record.apart], "own_image": record.own_image,
    }
    return {**values, **{key: value for key, value in optional.items() if value}}


def _round(value: float) -> float:
    """Round a number to twelve significant digits, so that locks from two builds of the CAD kernel are equal."""
    return 0.0 if abs(value) < _NOTHING else float(f"{value:.12g}")


def _sliced_values(slicing: Slicing, sliced: SliceResult | SliceFailure) -> dict[str, Any]:
    how = {key: list(value) if isinstance(value, tuple) else value for key, value in asdict(slicing).items()}
    if isinstance(sliced, SliceFailure):
        return {**how, "unsliced": sliced.reason}
    return {**how, **{key: [_round(entry) for entry in getattr(sliced, key).numbers] for key in _LAID}}


def _mount_values(mount: MountRecord) -> dict[str, Any]:
    rotation = [entry for row in mount.pose.rotation for entry in row]
    pose = [_round(entry) for entry in (*rotation, *mount.pose.translation)]
    return _present({
        "pose": pose, "interface": mount.interface, "tolerance": mount.tolerance, "features": decode(encode(mount.features)) or None,
        "contradictions": list(mount.contradictions) or None,
    })


_NUMBERS = ("stall_torque", "no_load_speed", "gear_ratio", "rotor_inertia", "kp", "kv")


def _actuator_values(actuator: ActuatorRecord) -> dict[str, Any]:
    numbers = {key: getattr(actuator, key) for key in _NUMBERS}
    return {"kind": actuator.kind, **_present(numbers), "sources": dict(sorted(actuator.sources.items()))}


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
    table = LockValue(value, path)
    return PartSchema(
        reference=reference, kind=table.one_of("kind", get_args(SchemaKind)), doc=table["doc"].maybe(LockValue.text) or "",
        parameters=tuple(_parameter(name, one) for name, one in table.get("parameters", {}).entries()),
        material=table["material"].maybe(LockValue.text), actuator=table["actuator"].flag(), file="", line=0,
    )


def _parameter(name: str, table: LockValue) -> ParameterSchema:
    kind = table.one_of("kind", get_args(ParameterKind))
    required = "default" not in table.mapping()
    default = None if required else table["default"].parameter_value()
    choices = tuple(one.parameter_value() for one in table.get("choices", []).items())
    if default is not None and not _of_kind(kind, default, choices):
        raise table["default"].fault(f"expected a {'whole number' if kind in WHOLE else kind}")
    if kind == "choice" and not choices:
        raise table["choices"].fault("expected at least one choice")
    if isinstance(default, int) and kind in CONTINUOUS:
        default = float(default)
    return ParameterSchema(
        name=name, kind=kind, required=required, default=default, minimum=table["minimum"].maybe(LockValue.number),
        maximum=table["maximum"].maybe(LockValue.number), choices=choices, doc=table["doc"].maybe(LockValue.text) or "",
    )


def _of_kind(kind: str, value: Value, choices: tuple[Value, ...]) -> bool:
    if kind == "choice":
        return value in choices
    if isinstance(value, bool):
        return kind == "flag"
    if isinstance(value, str):
        return kind == "text"
    return kind not in ("flag", "text") and (kind not in WHOLE or isinstance(value, int))


def read_record(text: str, value: Any, path: str, code: tuple[str, int] | None) -> PartRecord:
    """Parse the part record of the definition `text`, without meshes.

    `code` is the file and the line of the part's class. Raises `BadLock` if the lock file contains an invalid value.
    """
    table = LockValue(value, path)
    return PartRecord(
        text=text, material=table["material"].maybe(LockValue.text), color=table["color"].maybe(LockValue.text),
        volume=table["volume"].least(), area=table["area"].least(), centre=table["centre"].vector(), inertia=table["inertia"].matrix(),
        box=table["box"].maybe(_box), mounts={name: _mount(one) for name, one in table.get("mounts", {}).entries()},
        references=tuple(table.get("references", []).texts()), expectations=tuple(map(_expectation, table.get("expectations", []).items())),
        actuator=table["actuator"].maybe(_actuator), mass=_read_declared(table["mass"], LockValue.number),
        com=_read_declared(table["com"], LockValue.vector), matrix=_read_declared(table["matrix"], LockValue.matrix),
        density=_read_declared(table["density"], LockValue.number), bom=table.get("bom", {}).text_table(),
        warnings=(*(PartWarning(message=one) for one in table.get("warnings", []).texts()), *map(_question, table.get("asks", []).items())),
        code=code, apart=tuple(one.number() for one in table.get("apart", []).items()), own_image=table.get("own_image", False).flag(),
        up=table["up"].maybe(_direction), slices=dict(map(_read_slicing, table.get("slices", []).items())),
    )


def _box(value: LockValue) -> tuple[Vector, Vector]:
    numbers = value.numbers(6)
    return numbers[:3], numbers[3:]  # type: ignore[return-value]


def _read_slicing(table: LockValue) -> tuple[Slicing, SliceResult | SliceFailure]:
    slicing = Slicing(
        up="auto" if (up := table["up"]).value == "auto" else _direction(up), walls=_whole(table["walls"]), top=_whole(table["top"]),
        bottom=_whole(table["bottom"]), **{key: table[key].least() for key in ("layer", "line_width", "overlap", "bridge_flow")},
    )
    reason = table["unsliced"].maybe(LockValue.text)
    if reason is not None:
        return slicing, SliceFailure(reason=reason)
    solid, joins, sparse = (_matter(table[key]) for key in _LAID)
    if not solid.volume > 0.0:
        raise table["solid"].fault("expected a volume above 0")
    return slicing, SliceResult(solid=solid, joins=joins, sparse=sparse)


def _matter(value: LockValue) -> Moments:
    """Parse the volume, the first moments and the second moments of a solid (ten numbers).

    Raises `BadLock` unless the moments are physically possible.
    """
    moments = Moments.of(value.numbers(_MOMENTS))
    of = moments.properties
    if moments.volume < 0.0 or moments.volume > 0.0 and physical_fault(of.inertia) is not None:
        raise value.fault("expected the integrals of 1, x, y, z, xx, yy, zz, xy, xz, yz over a solid")
    return moments


def _direction(value: LockValue) -> Vector:
    direction = value.vector()
    if abs(hypot(*direction) - 1.0) > _ORTHOGONAL:
        raise value.fault("expected a direction: three numbers of length 1")
    return direction


def _whole(value: LockValue) -> int:
    number = value.least()
    if number != int(number):
        raise value.fault("expected a whole number")
    return int(number)


def _mount(table: LockValue) -> MountRecord:
    numbers = table["pose"].numbers(_POSE)
    rows = numbers[:3], numbers[3:6], numbers[6:9]
    for i, row in enumerate(rows):
        for j, other in enumerate(rows):
            if abs(sum_of(a * b for a, b in zip(row, other, strict=True)) - (i == j)) > _ORTHOGONAL:
                raise table["pose"].fault("expected a rotation (nine numbers, the rows of a rotation matrix) and a position")
    try:
        features = convert(table["features"].value or (), tuple[MatingFeature, ...])
    except ValidationError as error:
        raise table["features"].fault(f"expected mating features: {error}") from None
    return MountRecord(
        pose=Pose(rotation=rows, translation=numbers[9:]),  # type: ignore[arg-type]
        interface=table["interface"].maybe(LockValue.text), tolerance=table["tolerance"].maybe(LockValue.number),
        features=features, contradictions=tuple(table.get("contradictions", []).texts()),
    )


def _expectation(value: LockValue) -> MountExpectation:
    texts = value.texts()
    if len(texts) != 4:
        raise value.fault("expected a mount, a definition, its display name, and its mount")
    mount, text, label, child_mount = texts
    return MountExpectation(mount=mount, text=text, label=label, child_mount=child_mount)


def _question(value: LockValue) -> PartWarning:
    texts = value.texts()
    if len(texts) != 2 or texts[0] not in list(ImpureInputs):
        raise value.fault("expected the kind of a warning and its message")
    return PartWarning(message=texts[1], asked=ImpureInputs(texts[0]))


def _actuator(table: LockValue) -> ActuatorRecord:
    numbers = {key: table[key].maybe(LockValue.number) for key in _NUMBERS}
    kind = table.one_of("kind", get_args(DriveType))
    return ActuatorRecord(kind=kind, sources=table.get("sources", {}).text_table(), **_present(numbers))


def _read_declared(table: LockValue, read: Callable[[LockValue], Declared]) -> DeclaredValue[Declared] | None:
    return table.maybe(lambda table: DeclaredValue(source=table.one_of("source", SOURCES), value=read(table["value"])))


# --- values ------------------------------------------------------------------------------------------------------------


_T = TypeVar("_T")
_Word = TypeVar("_Word", bound=str)


class LockValue:
    """A JSON value of the lock file, with its path for messages. All methods raise `BadLock` if the value has another form."""

    __slots__ = ("path", "value")

    def __init__(self, value: Any, path: str) -> None:
        self.value = value
        self.path = path

    def fault(self, words: str) -> BadLock:
        """Create the exception for an invalid value. `words` describe the value that was expected."""
        return BadLock(self.path, words)

    def __getitem__(self, key: str) -> LockValue:
        """Return the value under a key of a JSON object. A missing key has the value None."""
        return self.get(key, None)

    def get(self, key: str, default: Any) -> LockValue:
        """Return the value under a key of a JSON object, or a default value if the key is missing."""
        return LockValue(self.mapping().get(key, default), f"{self.path}.{key}".removeprefix("."))

    def maybe(self, read: Callable[[LockValue], _T]) -> _T | None:
        """Return `read(self)`, or None if the value is missing."""
        return None if self.value is None else read(self)

    def mapping(self) -> Mapping[str, Any]:
        """Return the JSON object."""
        return self._of_type(dict, "a mapping")

    def entries(self) -> Iterator[tuple[str, LockValue]]:
        """Yield the keys and the values of a JSON object."""
        yield from ((key, self[key]) for key in self.mapping())

    def items(self) -> list[LockValue]:
        """Return the items of a JSON array. They have the path of the array."""
        return [LockValue(one, self.path) for one in self._of_type(list, "a list")]

    def text(self) -> str:
        """Return the string."""
        return self._of_type(str, "a string")

    def texts(self) -> list[str]:
        """Return the items of an array of strings."""
        texts = [one.value for one in self.items()]
        if not all(isinstance(one, str) for one in texts):
            raise self.fault("expected a list of strings")
        return texts

    def text_table(self) -> dict[str, str]:
        """Return an object whose values are strings."""
        if not all(isinstance(one, str) for one in self.mapping().values()):
            raise self.fault("expected a mapping from names to strings")
        return dict(self.mapping())

    def flag(self) -> bool:
        """Return a boolean. Raises the error of this value for other types."""
        return self._of_type(bool, "true or false")

    def number(self) -> float:
        """Return the number, which must be finite, as a float."""
        if isinstance(self.value, (int, float)) and not isinstance(self.value, bool):
            with contextlib.suppress(OverflowError):
                if math.isfinite(number := float(self.value)):
                    return number
        raise self.fault("expected a finite number")

    def least(self) -> float:
        """Return the number, which must not be negative."""
        if (number := self.number()) < 0.0:
            raise self.fault("expected a number of at least 0")
        return number

    def numbers(self, count: int) -> tuple[float, ...]:
        """Return the items of an array of `count` numbers."""
        entries = self.items()
        if len(entries) != count:
            raise self.fault(f"expected {count} numbers")
        return tuple(one.number() for one in entries)

    def vector(self) -> Vector:
        """Return the three numbers of an array."""
        x, y, z = self.numbers(3)
        return x, y, z

    def matrix(self) -> Matrix:
        """Return the nine numbers of an array as rows."""
        numbers = self.numbers(_ENTRIES)
        return numbers[:3], numbers[3:6], numbers[6:]  # type: ignore[return-value]

    def parameter_value(self) -> Value:
        """Return the value of a parameter. Whole numbers that a float represents exactly remain whole numbers."""
        if isinstance(self.value, (bool, str)) or isinstance(self.value, int) and abs(self.value) < 2**53:
            return self.value
        return self.number()

    def one_of(self, key: str, known: Collection[_Word]) -> _Word:
        """Return the string under a key of an object, which must be one of several strings."""
        value = self[key]
        word = next((one for one in known if one == value.value), None)
        if word is None:
            raise value.fault(f"expected one of {', '.join(sorted(known))}")
        return word

    def _of_type(self, kind: type[_T], words: str) -> _T:
        if not isinstance(self.value, kind):
            raise self.fault(f"expected {words}")
        return self.value
