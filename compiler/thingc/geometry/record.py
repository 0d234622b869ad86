"""What the geometry service answers with: plain frozen data, SI units, readable without the CAD kernel.

A `PartSchema` says what a part can be asked for, a `PartDefinition` is one request, a `PartRecord` is everything the
later passes ever learn of its geometry.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from enum import Enum
from typing import Generic, Literal, TypeVar

from msgspec.structs import replace

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.one_line_repr import OneLineRepr
from thingc.base.pose import Matrix, Pose, Vector
from thingc.base.primitives import Primitive
from thingc.base.units import ANGLE, LENGTH, MASS, NUMBER, Dimension, Quantity
from thingc.geometry.print_slices import SliceFailure, SliceResult, Slicing

Value = float | int | bool | str
"""A canonical parameter value: SI floats for dimensioned ones, ints for whole numbers, text and flags as they are."""

WHOLE = frozenset({"count", "integer"})
"""Kinds of parameters that are whole numbers: of things, or any."""

DIMENSIONS: Mapping[str, Dimension] = {
    "length": LENGTH, "angle": ANGLE, "mass": MASS, "ratio": NUMBER, "number": NUMBER, **dict.fromkeys(WHOLE, NUMBER),
}
"""Of the kinds of parameters that are numbers."""

SchemaKind = Literal["thing", "shape", "function"]
"""What a part is made by."""

ParameterKind = Literal["length", "angle", "mass", "ratio", "number", "count", "integer", "flag", "text", "choice"]
"""What a part takes: floats in SI, whole numbers (of things, or any), a bool, a text, or one of several texts."""


def written(kind: str, value: Value, digits: int = 12) -> str:
    """A canonical value of a parameter of that kind as a document would have it, to so many digits: `100 mm`, `30 deg`, `82 g`,
    `15 %`, `true`, `M3`."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return value
    if kind == "ratio":
        return f"{value * 100.0:.{digits}g} %"
    return Quantity(value, DIMENSIONS.get(kind, NUMBER)).shown(digits)


class ParameterSchema(OneLineRepr, FrozenStruct, array_like=True):
    """One argument of a part's `__init__`.

    One of the kind `choice` takes one of `choices`. `default` is None where `required`.
    """

    name: str
    kind: ParameterKind
    required: bool
    default: Value | None
    minimum: float | int | None = None
    maximum: float | int | None = None
    choices: tuple[Value, ...] = ()
    doc: str = ""

    def shown(self, value: Value) -> str:
        """A value of this parameter as a document would have it."""
        return written(self.kind, value)


class PartSchema(OneLineRepr, FrozenStruct):
    """What `module:Class` takes. `file`, `line` are where it is written."""

    reference: str
    kind: SchemaKind
    doc: str
    parameters: tuple[ParameterSchema, ...]
    material: str | None
    actuator: bool
    file: str
    line: int

    @property
    def default(self) -> PartDefinition | None:
        """The definition with every parameter at its default; None where one has none."""
        values: list[tuple[str, Value]] = []
        for parameter in self.parameters:
            if parameter.default is None:
                return None
            values.append((parameter.name, parameter.default))
        return PartDefinition(
            reference=self.reference, kind="code", parameters=tuple(sorted(values)), text=self.reference, label=self.reference,
        )

    @property
    def defaults(self) -> dict[str, Value]:
        """The defaults of those parameters that have one."""
        return {parameter.name: parameter.default for parameter in self.parameters if parameter.default is not None}

    def definition(self, values: Mapping[str, Value]) -> PartDefinition:
        """The definition with canonical values of all parameters."""
        kinds = {parameter.name: parameter.kind for parameter in self.parameters}
        given = tuple(sorted(values.items()))
        words = {name: written(kinds[name], value, LABEL_DIGITS) for name, value in given}
        return PartDefinition(
            reference=self.reference, kind="code", parameters=given, text=definition_text(self.reference, values, self.defaults),
            words=tuple(words.values()), label=definition_label(self.reference, values, self.defaults, words),
        )


FILE_UNIT = "mm"
"""What the numbers of a mesh file are in unless the document says otherwise."""


class PartDefinition(OneLineRepr, FrozenStruct):
    """A part class with its complete canonical parameters: equal definitions are one node of the HAG.

    `reference` is `module:Class`, or for a part of a file its path in the workspace (`kind` says which: `code | file`). `parameters`
    holds every parameter, sorted by name (of a file its `faces`, and its `unit` where that is not `FILE_UNIT`); `text` prints only
    those that differ from their default, exactly (`arm:RotorBrace(length=0.1)`): programs know it by that. `label` is the same for
    people (`arm:RotorBrace(length=100 mm)`), which two definitions that hardly differ may share, and `words` the values of all
    parameters for them. A mirror image is a definition of its own (`arm:RotorBrace(length=0.1, mirror=y)`): `mirror` is the axis of the
    part's frame that it is mirrored along, `plain` the definition that it mirrors.
    """

    reference: str
    kind: Literal["code", "file"]
    parameters: tuple[tuple[str, Value], ...]
    text: str
    label: str
    words: tuple[str, ...] = ()
    mirror: str | None = None
    plain: PartDefinition | None = None

    def mirrored(self, axis: str) -> PartDefinition:
        """The definition of the mirror image at the plane normal to `axis` (`x | y | z`) of the part's frame."""
        label = f"{self.label}, mirror={axis}" if self.kind == "file" else with_mirror(self.label, axis)
        return replace(self, text=with_mirror(self.text, axis), label=label, mirror=axis, plain=self)

    @property
    def stem(self) -> str:
        """The file stem: `arm.RotorBrace`, and 8 hex of the SHA-256 of `text` when any parameter differs; `-mirror_y` follows that of
        the definition which is mirrored."""
        if self.plain is not None:
            return f"{self.plain.stem}-mirror_{self.mirror}"
        base = self.reference.replace(":", ".").replace("/", ".")
        if self.text == self.reference:
            return base
        return f"{base}-{hashlib.sha256(self.text.encode()).hexdigest()[:8]}"


LABEL_DIGITS = 6
"""Digits of a number in a label."""


def definition_text(reference: str, parameters: Mapping[str, Value], defaults: Mapping[str, Value]) -> str:
    """`arm:RotorBrace(length=0.1)`: the parameters that differ from their defaults, sorted, SI, `repr`."""
    return _printed(reference, {name: repr(parameters[name]) for name in _differing(parameters, defaults)})


def definition_label(reference: str, parameters: Mapping[str, Value], defaults: Mapping[str, Value], words: Mapping[str, str]) -> str:
    """`arm:RotorBrace(length=100 mm)`: the same for people. `words` are the values as documents have them; a text is quoted."""
    return _printed(reference, {
        name: repr(value) if isinstance(value := parameters[name], str) else words[name] for name in _differing(parameters, defaults)
    })


def _differing(parameters: Mapping[str, Value], defaults: Mapping[str, Value]) -> list[str]:
    return [name for name in sorted(parameters) if name not in defaults or parameters[name] != defaults[name]]


def with_mirror(printed: str, axis: str) -> str:
    """The text or label of a definition with its mirror among what is given to it. Values that are texts are quoted, so that this is
    no parameter's."""
    return f"{printed[:-1]}, mirror={axis})" if printed.endswith(")") else f"{printed}(mirror={axis})"


def _printed(reference: str, arguments: Mapping[str, str]) -> str:
    """The reference, and in brackets what is given to it, if anything is."""
    return f"{reference}({', '.join(f'{name}={value}' for name, value in arguments.items())})" if arguments else reference


class MountRecord(OneLineRepr, FrozenStruct):
    """A mount of a part: its frame in the part's frame, z out of the material."""

    pose: Pose
    interface: str | None = None
    tolerance: float | None = None


class MountExpectation(OneLineRepr, FrozenStruct, array_like=True):
    """`mount` was cut for the part `text` (a definition text; `label` for people) sitting on it with its mount `child_mount`."""

    mount: str
    text: str
    label: str
    child_mount: str


Declared = TypeVar("Declared", float, Vector, Matrix)


class DeclaredValue(OneLineRepr, FrozenStruct, Generic[Declared]):
    """A number (or three, or a matrix) that a Thing states, and its source (`measured | vendor | estimated | stated`)."""

    value: Declared
    source: str = "stated"


DriveType = Literal["position", "velocity", "motor"]
"""What a drive is told: where to go, how fast, or how hard to push."""


class ActuatorRecord(OneLineRepr, FrozenStruct):
    """A Thing's actuator in SI; `sources` says where a number came from, by field name."""

    kind: DriveType
    stall_torque: float | None = None
    no_load_speed: float | None = None
    gear_ratio: float = 1.0
    rotor_inertia: float | None = None
    kp: float | None = None
    kv: float | None = None
    sources: dict[str, str] = {}

    @property
    def armature(self) -> float | None:
        """Rotor inertia seen at the output [kg m^2]: rotor inertia times gear ratio squared."""
        return None if self.rotor_inertia is None else self.rotor_inertia * self.gear_ratio * self.gear_ratio


class Mesh(OneLineRepr, FrozenStruct, array_like=True, tag=True):
    """A mesh file in the store by content. `closed` and `flat` say whether simulators can take it as a solid."""

    sha256: str
    size: int
    vertices: int
    faces: int
    closed: bool
    flat: bool


class ImpureInputs(str, Enum):
    """What a part may ask besides its inputs. Such an answer is not in its key, so it stays as it was when the part was made. `left` are
    processes that it has started and not waited for."""

    ENVIRONMENT = "environment"
    CLOCK = "clock"
    CHANCE = "chance"
    PROCESS = "process"
    NETWORK = "network"
    LEFT = "left"


class PartWarning(OneLineRepr, FrozenStruct, array_like=True):
    """Something the part's author should know, and the line of the part file where there is one. `asked` is what the part asked
    there, None for a remark of its own."""

    message: str
    file: str | None = None
    line: int | None = None
    asked: ImpureInputs | None = None


class PartRecord(OneLineRepr, FrozenStruct):
    """Everything the passes know of a part. All lengths in metres, in the part's own frame.

    `volume` [m^3], `area` [m^2], `centre` [m] and `inertia` [m^5, at density 1, about the centre] are exact integrals
    over the B-rep; all zero for a Thing without geometry (`box` None). `meshes`: `visual`, `hull` and `mesh` (OBJ, metres), `print`
    (binary STL, millimetres), absent without geometry; `simulation` (OBJ, metres) where the definition bounds the triangles of what
    simulators draw and touch; `fits` the smallest primitives that enclose the part, by shape; `pieces` the solids of the Thing's own
    `collision()`, primitives where they are exactly that, else OBJ files; `convex` the OBJ files of the convex decomposition where it
    was asked for.
    `up` is how the Thing wants to lie on a printer (a unit vector); `slices` what it holds when printed, as far as that was asked for.
    `apart` are the volumes [m^3] of the bodies of a part that should be one solid, the largest first; empty where they hang
    together, or are meant to be several. `own_image` is True of a mirror image that is the same as what it mirrors: solid, and place
    and z of each mount. `brep` is the B-rep in the store. `code` is `(file, line)` of the class. A record that is
    not `exact` stands in for one that nobody may model now: only the names of its mounts, its material and that it has an actuator
    hold, no number does.
    """

    text: str
    material: str | None
    color: str | None
    volume: float
    area: float
    centre: Vector
    inertia: Matrix
    box: tuple[Vector, Vector] | None
    mounts: dict[str, MountRecord]
    references: tuple[str, ...]
    expectations: tuple[MountExpectation, ...]
    actuator: ActuatorRecord | None
    mass: DeclaredValue[float] | None
    com: DeclaredValue[Vector] | None
    matrix: DeclaredValue[Matrix] | None
    density: DeclaredValue[float] | None
    bom: dict[str, str]
    warnings: tuple[PartWarning, ...]
    fits: dict[str, Primitive]
    meshes: dict[str, Mesh]
    pieces: tuple[Mesh | Primitive, ...]
    convex: tuple[Mesh, ...]
    brep: str | None
    code: tuple[str, int] | None
    apart: tuple[float, ...] = ()
    own_image: bool = False
    up: Vector | None = None
    slices: dict[Slicing, SliceResult | SliceFailure] = {}
    exact: bool = True

    @property
    def simulated(self) -> Mesh | None:
        """The mesh that simulators touch, whole or in convex pieces; None without geometry."""
        return self.meshes.get("simulation") or self.meshes.get("mesh")


FailureKind = Literal[
    "refused", "missing", "raised", "trespassed", "hung", "crashed", "swarmed", "starved", "empty", "invalid", "unbounded",
    "resultless", "stale", "unlocked", "absent",
]
"""How it goes wrong that a part is described or modelled; `absent`: nobody was there to do it."""


class PartFailure(OneLineRepr, FrozenStruct):
    """Why a part could not be described or modelled.

    `message` is the exception's words; `file`, `line` the place in the part file; `candidates`, for
    a part that is `missing`, modules, references or files that may have been meant; `detail` the traceback, for `--debug` only.
    """

    subject: str
    kind: FailureKind
    message: str
    file: str | None = None
    line: int | None = None
    candidates: tuple[str, ...] = ()
    detail: str | None = None


NO_PARTS = frozenset({"invalid", "missing", "resultless"})
"""Kinds of failures of classes that are no parts: news only where somebody asks for such a class by name."""


class Placed(OneLineRepr, FrozenStruct):
    """One instance in a STEP assembly: its name, B-rep, pose and colour (`#rrggbb`); groups nest by `/` in the name."""

    path: str
    definition: str
    brep: str
    pose: Pose
    color: str | None


class StoredFile(OneLineRepr, FrozenStruct):
    """A file in the store by content: what `assemble` answers with."""

    sha256: str
    size: int


class AssemblyFailed(Exception):
    """The kernel could not write the STEP file of the assembly `name`: `reason` in words, `detail` the traceback."""

    def __init__(self, name: str, reason: str, detail: str = "") -> None:
        super().__init__(f"the STEP file of {name} could not be written: {reason}")
        self.name = name
        self.reason = reason
        self.detail = detail
