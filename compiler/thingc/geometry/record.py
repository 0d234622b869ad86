"""The results of the geometry service, in SI units. Reading these results does not require the CAD kernel.

A `PartSchema` describes the parameters of a part. A `PartDefinition` is a part with values for all parameters. A `PartRecord` contains
everything about its geometry that later passes use.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from enum import Enum
from typing import Generic, Literal, Self, TypeVar

from msgspec.structs import replace

from thingc.base.inertia import ZERO
from thingc.base.interfaces import MatingFeature
from thingc.base.one_line_repr import OneLineStruct
from thingc.base.pose import Matrix, Mirror, Pose, Vector
from thingc.base.primitives import Primitive
from thingc.base.units import ANGLE, LENGTH, MASS, NUMBER, Dimension, Quantity
from thingc.geometry.print_slices import SliceFailure, SliceResult, Slicing

Value = float | int | bool | str
"""A canonical parameter value: a float in SI units for a quantity, an int for a whole number, a string or a bool."""

Bom = dict[str, str | dict[str, str]]
"""Values for the bill of materials by key. `cost` is a price per piece, or prices by the smallest quantities for which they apply."""

WHOLE = frozenset({"count", "integer"})
"""Kinds of parameters that are whole numbers."""

DIMENSIONS: Mapping[str, Dimension] = {
    "length": LENGTH, "angle": ANGLE, "mass": MASS, "ratio": NUMBER, "number": NUMBER, **dict.fromkeys(WHOLE, NUMBER),
}
"""Physical dimensions of the numeric kinds of parameters."""

SchemaKind = Literal["thing", "shape", "function"]
"""How a part is defined: by a Thing, a shape class or a function."""

ParameterKind = Literal["length", "angle", "mass", "ratio", "number", "count", "integer", "flag", "text", "choice"]
"""Kinds of part parameters. Quantities are floats in SI units. `count` and `integer` are whole numbers. `choice` is one of several
strings.
"""


def format_value(kind: str, value: Value, digits: int = 12) -> str:
    """Format the value of a parameter as in a document, with at most `digits` significant digits.

    Examples are `100 mm`, `30 deg`, `82 g`, `15 %`, `true` and `M3`. The value is in SI units, and `kind` is the kind of the parameter.
    """
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return value
    if kind == "ratio":
        return f"{value * 100.0:.{digits}g} %"
    return Quantity(value, DIMENSIONS.get(kind, NUMBER)).format(digits)


class ParameterSchema(OneLineStruct, array_like=True):
    """The schema of one parameter of a part. Each parameter is an argument of the part's `__init__`.

    A parameter of the kind `choice` has `choices`. `default` is None if the parameter is `required`.
    """

    name: str
    kind: ParameterKind
    required: bool
    default: Value | None
    minimum: float | int | None = None
    maximum: float | int | None = None
    choices: tuple[Value, ...] = ()
    doc: str = ""

    def format_value(self, value: Value) -> str:
        """Format a value of this parameter as in a document."""
        return format_value(self.kind, value)


class PartSchema(OneLineStruct):
    """The parameters and properties of `module:Class`. `file` and `line` locate the definition of the class."""

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
        """The definition of the part with default values for all parameters, or None if a parameter has no default."""
        defaults = self.defaults
        if len(defaults) < len(self.parameters):
            return None
        parameters = tuple(sorted(defaults.items()))
        return PartDefinition(reference=self.reference, kind="code", parameters=parameters, text=self.reference, label=self.reference)

    @property
    def defaults(self) -> dict[str, Value]:
        """The default values of all parameters with a default."""
        return {parameter.name: parameter.default for parameter in self.parameters if parameter.default is not None}

    def definition(self, values: Mapping[str, Value]) -> PartDefinition:
        """Create a part definition from values for all parameters. The values are in SI units."""
        kinds, defaults = {parameter.name: parameter.kind for parameter in self.parameters}, self.defaults
        parameters = tuple(sorted(values.items()))
        display_values = {name: format_value(kinds[name], value, LABEL_DIGITS) for name, value in parameters}
        return PartDefinition(
            reference=self.reference, kind="code", parameters=parameters, text=definition_text(self.reference, values, defaults),
            words=tuple(display_values.values()), label=definition_label(self.reference, values, defaults, display_values),
        )


FILE_UNIT = "mm"
"""Default unit of the numbers in a mesh file."""


class PartDefinition(OneLineStruct):
    """A part class with values for all its parameters. Equal definitions become one node of the hierarchical assembly graph (HAG).

    `reference` is `module:Class`, or the path in the workspace for a part of `kind` `file`. `parameters` contains every parameter, sorted
    by name. For a file, `parameters` contains `faces`, and also `unit` if the unit is not `FILE_UNIT`. `text` identifies the definition and
    contains the exact values that differ from their defaults (`arm:RotorBrace(length=0.1)`). `label` is the display form
    (`arm:RotorBrace(length=100 mm)`). Two definitions with almost equal values may have the same label. `words` contains the display values
    of all parameters.

    A mirror image is a separate definition, such as `arm:RotorBrace(length=0.1, mirror=y)`. `mirror` is the axis of the part's frame
    along which the part is mirrored. `plain` is the definition of the original part.
    """

    reference: str
    kind: Literal["code", "file"]
    parameters: tuple[tuple[str, Value], ...]
    text: str
    label: str
    words: tuple[str, ...] = ()
    mirror: str | None = None
    plain: PartDefinition | None = None

    def mirror_image(self, axis: str) -> PartDefinition:
        """Return the definition of the mirror image at the plane normal to `axis` (`x | y | z`) of the part's frame."""
        label = f"{self.label}, mirror={axis}" if self.kind == "file" else with_mirror(self.label, axis)
        return replace(self, text=with_mirror(self.text, axis), label=label, mirror=axis, plain=self)

    @property
    def stem(self) -> str:
        """The stem of file names: `arm.RotorBrace`, with 8 hex digits of the SHA-256 of `text` if any parameter differs from its default.

        For a mirror image, the stem is the stem of the original definition with the suffix `-mirror_y`.
        """
        if self.plain is not None:
            return f"{self.plain.stem}-mirror_{self.mirror}"
        base = self.reference.replace(":", ".").replace("/", ".")
        if self.text == self.reference:
            return base
        return f"{base}-{hashlib.sha256(self.text.encode()).hexdigest()[:8]}"


LABEL_DIGITS = 6
"""Number of significant digits of a number in a label."""


def definition_text(reference: str, parameters: Mapping[str, Value], defaults: Mapping[str, Value]) -> str:
    """Format a part definition as its text, such as `arm:RotorBrace(length=0.1)`.

    The text contains the sorted parameters that differ from their defaults, as `repr` of their values in SI units.
    """
    return _format_call(reference, {name: repr(parameters[name]) for name in _differing(parameters, defaults)})


def definition_label(reference: str, parameters: Mapping[str, Value], defaults: Mapping[str, Value], words: Mapping[str, str]) -> str:
    """Format a part definition as its label, such as `arm:RotorBrace(length=100 mm)`. `words` contains the values as in documents. Strings
    in the text are quoted.
    """
    return _format_call(reference, {
        name: repr(value) if isinstance(value := parameters[name], str) else words[name] for name in _differing(parameters, defaults)
    })


def _differing(parameters: Mapping[str, Value], defaults: Mapping[str, Value]) -> list[str]:
    return [name for name in sorted(parameters) if name not in defaults or parameters[name] != defaults[name]]


def with_mirror(printed: str, axis: str) -> str:
    """Add the mirror axis to the text or label of a definition.

    The result is unambiguous, because parameter values that are strings are quoted.
    """
    return f"{printed[:-1]}, mirror={axis})" if printed.endswith(")") else f"{printed}(mirror={axis})"


def _format_call(reference: str, arguments: Mapping[str, str]) -> str:
    """Format a reference followed by its arguments in parentheses. Without arguments, the parentheses are omitted."""
    return f"{reference}({', '.join(f'{name}={value}' for name, value in arguments.items())})" if arguments else reference


class MountRecord(OneLineStruct):
    """A mount of a part: its frame in the part's frame, with z pointing out of the material.

    `interface` is the name of the interface, and `features` contains its mating features. `contradictions` describes how the geometry of
    the part differs from these features.
    """

    pose: Pose
    interface: str | None = None
    tolerance: float | None = None
    features: tuple[MatingFeature, ...] = ()
    contradictions: tuple[str, ...] = ()

    def mirror_image(self, axis: str) -> Self:
        """Return the mirror image of the mount. The mirror plane contains the origin of the part and is normal to `axis` (`x | y | z`)."""
        return replace(self, pose=Mirror(axis).mount(self.pose), features=tuple(feature.mirror_image() for feature in self.features))


class MountExpectation(OneLineStruct, array_like=True):
    """A part that is expected at a mount. The geometry at the mount `mount` was cut for a part with the definition text `text`. That part
    is mated at its mount `child_mount`.

    `label` is the display form of `text`.
    """

    mount: str
    text: str
    label: str
    child_mount: str


Declared = TypeVar("Declared", float, Vector, Matrix)


class DeclaredValue(OneLineStruct, Generic[Declared]):
    """A number, vector or matrix that a Thing declares, and its source (`measured | vendor | estimated | stated`)."""

    value: Declared
    source: Literal["measured", "vendor", "estimated", "stated"] = "stated"


DriveType = Literal["position", "velocity", "motor"]
"""The quantity that a drive controls: position, velocity or force."""


class ActuatorRecord(OneLineStruct):
    """The actuator of a Thing in SI units. `sources` contains the source of each number, by the name of its field."""

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
        """Rotor inertia at the output [kg m^2]: rotor inertia times the square of the gear ratio."""
        return None if self.rotor_inertia is None else self.rotor_inertia * self.gear_ratio * self.gear_ratio


class Mesh(OneLineStruct, array_like=True, tag=True):
    """A mesh file in the content-addressed store. Simulators can use the mesh as a solid if `closed` is True and `flat` is False."""

    sha256: str
    size: int
    vertices: int
    faces: int
    closed: bool
    flat: bool


class ImpureInputs(str, Enum):
    """Kinds of inputs that a part can use although they are not part of its cache key. A part is not rebuilt when these inputs change.

    `left` means that processes were still running after the part was built.
    """

    ENVIRONMENT = "environment"
    CLOCK = "clock"
    CHANCE = "chance"
    PROCESS = "process"
    NETWORK = "network"
    LEFT = "left"


class PartWarning(OneLineStruct, array_like=True):
    """A warning for the author of a part, with the line in the part file if known.

    `asked` is the kind of the impure input that the part used, or None for any other warning.
    """

    message: str
    file: str | None = None
    line: int | None = None
    asked: ImpureInputs | None = None


WantedPieces = Mapping[str, tuple[int, ...]]
"""The largest number of pieces of each convex decomposition that a part needs, keyed by definition text."""

NO_PIECES: WantedPieces = {}


class PartRecord(OneLineStruct):
    """All data about a part that the passes use. Lengths are in metres, in the part's own frame.

    `volume` [m^3], `area` [m^2], `centre` [m] and `inertia` [m^5, at density 1, about the centre] are exact integrals over the B-rep. For a
    Thing without geometry, these values are zero, and `box` is None.

    `meshes` is empty for a part without geometry. For a part with geometry, `meshes` contains `visual`, `hull` and `mesh` (OBJ, metres) and
    `print` (binary STL, millimetres). The mesh `slicing` contains the triangles of `print` in 64-bit floats, so that results of slicing are
    smooth functions of parameters. The mesh `simulation` (OBJ, metres) exists if the definition limits the triangles for simulators. `fits`
    contains the smallest primitives that enclose the part, by shape. `pieces` contains the solids of the Thing's own `collision()`: a
    primitive if the solid is exactly a primitive, otherwise an OBJ file. `convex` contains the OBJ files of the requested convex
    decompositions, by the largest number of pieces (0 for any number).

    `up` is the Thing's preferred direction away from the print bed (a unit vector). `slices` contains the requested results of slicing.
    `apart` contains the volumes [m^3] of the bodies of a part that should be one solid, the largest volume first. `apart` is empty if the
    bodies are connected, or if several bodies are intended. `own_image` is True for a mirror image that equals its original in the solid
    and in the place and z axis of each mount. `brep` is the digest of the B-rep in the store. `code` is the file and the line of the class,
    as a tuple.

    A record that is not `exact` is a placeholder for a part that must not be built in this run. In such a record, only the names of
    mounts, the material, and whether the part has an actuator are valid.
    """

    text: str
    material: str | None = None
    color: str | None = None
    volume: float = 0.0
    area: float = 0.0
    centre: Vector = (0.0, 0.0, 0.0)
    inertia: Matrix = ZERO
    box: tuple[Vector, Vector] | None = None
    mounts: dict[str, MountRecord] = {}
    references: tuple[str, ...] = ()
    expectations: tuple[MountExpectation, ...] = ()
    actuator: ActuatorRecord | None = None
    mass: DeclaredValue[float] | None = None
    com: DeclaredValue[Vector] | None = None
    matrix: DeclaredValue[Matrix] | None = None
    density: DeclaredValue[float] | None = None
    bom: Bom = {}
    warnings: tuple[PartWarning, ...] = ()
    fits: dict[str, Primitive] = {}
    meshes: dict[str, Mesh] = {}
    pieces: tuple[Mesh | Primitive, ...] = ()
    convex: dict[int, tuple[Mesh, ...]] = {}
    brep: str | None = None
    code: tuple[str, int] | None = None
    apart: tuple[float, ...] = ()
    own_image: bool = False
    up: Vector | None = None
    slices: dict[Slicing, SliceResult | SliceFailure] = {}
    exact: bool = True

    @property
    def simulated(self) -> Mesh | None:
        """The mesh that simulators use for collisions, as a whole or in convex pieces. The value is None for a part without geometry."""
        return self.meshes.get("simulation") or self.meshes.get("mesh")


FailureKind = Literal[
    "refused", "missing", "raised", "trespassed", "hung", "crashed", "swarmed", "starved", "empty", "invalid", "unbounded",
    "resultless", "stale", "unlocked", "absent",
]
"""Ways in which describing or building a part fails. `absent` means that the part is not in the store and there are no workers."""


class PartFailure(OneLineStruct):
    """The reason why a part could not be described or built.

    `message` is the message of the exception. `file` and `line` are the location of the error in the part file, with the `column` of a
    syntax error. For a `missing` part, `candidates` contains similar modules, references or files. `detail` is the traceback, which only
    `--debug` shows.
    """

    subject: str
    kind: FailureKind
    message: str
    file: str | None = None
    line: int | None = None
    candidates: tuple[str, ...] = ()
    detail: str | None = None
    column: int = 1


NO_PARTS = frozenset({"invalid", "missing", "resultless"})
"""Failure kinds of classes that are not parts. These failures are reported only if a document references the class."""


class Placed(OneLineStruct):
    """An instance of a part in a STEP assembly, with its name, B-rep, pose and colour (`#rrggbb`).

    `/` in the name separates nested groups.
    """

    path: str
    definition: str
    brep: str
    pose: Pose
    color: str | None


class StoredFile(OneLineStruct):
    """A file in the content-addressed store, such as the result of `assemble`."""

    sha256: str
    size: int


class AssemblyFailed(Exception):
    """Raised if the CAD kernel cannot write the STEP file of an assembly. `reason` is the message, and `detail` is the traceback."""

    def __init__(self, name: str, reason: str, detail: str = "") -> None:
        super().__init__(f"cannot write the STEP file of {name}: {reason}")
        self.name = name
        self.reason = reason
        self.detail = detail
