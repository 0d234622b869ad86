"""Inspect a part in the geometry worker: its parameters, its instance for given parameters, and the data of this instance.

All values are in author units: lengths in mm, angles in degrees, masses in kg. The worker gets geometry from the methods `result()`,
`collision()`, `visual()` and `envelope()` of a Thing. These methods return a build123d Shape, several Shapes, or None.
"""

from __future__ import annotations

import ast
import functools
import inspect
import linecache
import math
import re
import types
import typing
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias, Union, cast

from build123d.build_enums import Select
from build123d.topology import Compound, Shape

from thingc.base.bom_values import COST, LINK, PICTURE_SUFFIXES, QUANTITY
from thingc.geometry.things.actuator import Actuator, check_sourced
from thingc.geometry.things.construction import create_thing, family_signature, make
from thingc.geometry.things.mounts import MountPoint
from thingc.geometry.things.parameters import Parameter, SignatureError, Value
from thingc.geometry.things.signature import Signature, annotation_of, signature_of
from thingc.geometry.things.thing import Geometry, Thing

PartLike: TypeAlias = "type[Thing] | type[Shape[Any]] | Callable[..., Shape[Any]]"
_TEXT = re.compile(".*", re.DOTALL), "a string"
_BOM_FORMS: dict[str, tuple[re.Pattern[str], str]] = {
    "number": _TEXT, "name": _TEXT, "supplier": _TEXT, "cost": (COST, "an amount and a currency, such as `12.50 EUR`"),
    "make": (re.compile("buy|print|machine"), "`buy`, `print` or `machine`"), "link": (LINK, "a web address"),
    "picture": (re.compile(f".+({'|'.join(map(re.escape, PICTURE_SUFFIXES))})", re.IGNORECASE), f"a file {' '.join(PICTURE_SUFFIXES)}"),
}
"""The keys of the attribute `bom` of a Thing, and the forms of their values."""
Vector: TypeAlias = tuple[float, float, float]
Matrix: TypeAlias = tuple[Vector, Vector, Vector]


@dataclass(frozen=True, slots=True, kw_only=True)
class ExpectedPart:
    """The part for which a mount was designed: a Thing of the class `family` with the given `parameters`. The part is mated at its mount
    `child_mount`. `parameters` contains all parameters in the units of part code.

    Parameters that `family` sets itself and that `adjust` changed are omitted, because documents cannot express such changes.
    """

    mount: str
    family: type[Thing]
    parameters: dict[str, Value]
    child_mount: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Statement:
    """A value that a Thing declares: a number, a vector or a 3 x 3 matrix, and its source (`measured | vendor | estimated | stated`)."""

    value: float | Vector | Matrix
    source: str = "stated"


def is_part(candidate: object) -> Literal["thing", "shape", "function"] | None:
    """Return the kind of a part: `thing`, `shape` or `function`. Return None if the object is not a part. The candidate object is not
    called.

    Parts are Thing subclasses, build123d Shape classes, and Python functions that return a shape. If a function has a return annotation,
    the annotation must name a shape class. If a function has no return annotation, `build` checks its return value. Abstract classes and
    `Thing` itself are not parts.
    """
    if isinstance(candidate, type):
        if inspect.isabstract(candidate) or candidate is Thing:
            return None
        return "thing" if issubclass(candidate, Thing) else "shape" if issubclass(candidate, Shape) else None
    if not isinstance(candidate, types.FunctionType):
        return None
    declared = inspect.signature(candidate).return_annotation
    if declared is inspect.Signature.empty:
        return "function"
    try:
        declared = annotation_of(candidate, declared)
    except SignatureError:
        return None
    alternatives = typing.get_args(declared) if typing.get_origin(declared) in (Union, types.UnionType) else (declared,)
    classes = [typing.get_origin(alternative) or alternative for alternative in alternatives]
    return "function" if all(isinstance(one, type) and issubclass(one, Shape) for one in classes) else None


def lacking_result(part: PartLike) -> tuple[str, tuple[str, int] | None] | None:
    """Return the reason why a Thing class has no geometry, or None for a class with geometry.

    The reason consists of a message, which is appended to the name of the class, and of the file and line of the faulty code. Possible
    reasons are that the class has no `result()` of its own, or that its `result()` has no `return`. To define a part without geometry on
    purpose, `result()` must contain `return None`. The function also returns None if `part` is not a Thing class.
    """
    if not isinstance(part, type) or not issubclass(part, Thing):
        return None
    if part.result is Thing.result:
        return "has no `result()`, which must return its geometry", code_location(part)
    function = inspect.unwrap(part.result)
    tree = syntax_of(function)
    ends = (ast.Return, ast.Raise, ast.Yield, ast.YieldFrom, ast.Lambda)
    if tree is None or any(isinstance(node, ends) for node in ast.walk(tree)):
        return None
    return "has a `result()` without a `return` statement", code_location(function)


def syntax_of(function: Callable[..., Any]) -> ast.FunctionDef | ast.AsyncFunctionDef | None:
    """Return the syntax tree of a function from its source file. Return None if the source file does not exist.

    Each file is parsed once, whereas `inspect` would parse the file for each of its functions and classes.
    """
    code = getattr(inspect.unwrap(function), "__code__", None)
    if not isinstance(code, types.CodeType):
        return None
    linecache.checkcache(code.co_filename)
    return _functions_in("".join(linecache.getlines(code.co_filename))).get(code.co_firstlineno)


@functools.lru_cache(maxsize=8)
def _functions_in(text: str) -> Mapping[int, ast.FunctionDef | ast.AsyncFunctionDef]:
    """Return the functions in source code by line number. The line is that of the `def`, or of the first decorator."""
    try:
        tree = ast.parse(text)
    except (SyntaxError, ValueError, RecursionError):
        return {}
    nodes: list[ast.AST] = [tree]
    for node in nodes:
        nodes += [child for child in ast.iter_child_nodes(node) if not isinstance(child, ast.expr)]
    functions = [node for node in nodes if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef))]
    return {min([one.lineno, *(decorator.lineno for decorator in one.decorator_list)]): one for one in functions}


def code_location(code: Any) -> tuple[str, int] | None:
    """Return the file and the line where a class or function is defined, or None if its source code does not exist."""
    try:
        return inspect.getsourcefile(code) or "", inspect.getsourcelines(code)[1]
    except (OSError, TypeError):
        return None


def parameters_of(part: PartLike) -> tuple[Parameter, ...]:
    """Return the parameters in the order of the signature. Their defaults are canonical values in author units.

    For a shape class or a function, arguments that cannot be parameters are omitted. Arguments that are omitted always have their default.
    Raises `SignatureError`, a `TypeError`, if an argument of a Thing or an argument without default cannot be a parameter.
    """
    return _signature(part).parameters


def build(part: PartLike, parameters: Mapping[str, object]) -> Thing:
    """Create the Thing of a part with the given parameters, which are in the units of part code.

    For a shape class or a function, the method `result` of the Thing returns the shape. Raises `ParameterError` for an invalid parameter,
    before any geometry is created. Raises `TypeError` if a function does not return a shape. Exceptions of the part's own code are not
    caught.
    """
    if isinstance(part, type) and issubclass(part, Thing):
        return make(part, family_signature(part).bind((), parameters), {})
    values = _signature(part).bind((), parameters)
    maker = cast("Callable[..., object]", part)
    shape = maker(**values)
    if not isinstance(shape, Shape):
        raise TypeError(f"`{part.__name__}` must return a build123d shape, but returned {shape!r}")
    bought = {"make": "buy"} if shape.__class__.__module__.split(".")[0] == "bd_warehouse" else {}
    return create_thing(_ShapePart, values, _family=part.__name__, _shape=shape, bom=bought)


def mounts_of(thing: Thing) -> dict[str, MountPoint]:
    """Return the mounts of a Thing by exported name, in the order of assignment. The mount `origin` is omitted. The attributes `location`
    and `tolerance` of a mount are in mm.
    """
    return dict(thing._construction.mounts)


def references_of(thing: Thing) -> tuple[str, ...]:
    """Return the names of the reference geometry that a Thing provides in addition to mounts.

    Public attributes come first, followed by methods and properties of the Thing's classes.
    """
    if isinstance(thing, _ShapePart):
        return ()
    names = [
        name for name, value in vars(thing).items()
        if not name.startswith("_") and name not in ("bom", "print", "actuator") and not _only_mounts(value)
    ]
    for family in reversed(type(thing).__mro__):
        if issubclass(family, Thing) and family is not Thing:
            names.extend(
                name for name, value in vars(family).items()
                if not name.startswith("_") and not hasattr(Thing, name) and (callable(value) or hasattr(value, "__get__"))
            )
    return tuple(dict.fromkeys(names))


def expectations_of(thing: Thing) -> tuple[ExpectedPart, ...]:
    """Return the parts for which the Thing's mounts were designed. The parts are in the order of the mounts and of the calls of `align`."""
    return tuple(
        ExpectedPart(mount=name, family=type(other), parameters=dict(other._construction.parameters), child_mount=child)
        for name, mount in thing._construction.mounts.items()
        for other, child in mount.expected
    )


def statement_of(thing: Thing, method: Literal["mass", "centre", "matrix_of_inertia", "density"]) -> Statement | None:
    """Return the value that a Thing declares: its mass [kg], its centre [mm], its inertia matrix [kg m^2] about the centre along the axes
    of the Thing, or its density [kg/m^3]. Return None if the Thing does not declare the value.

    The method may return a value, or a tuple of a value and its source. Raises `ValueError` for an unknown source, and for a value that is
    not finite or has the wrong shape. The mass and the density must be positive, and the inertia must be symmetric.
    """
    what = f"{method}() of `{type(thing).__name__}`"
    value: Any = getattr(thing, method)()
    source = "stated"
    if value is None:
        return None
    if isinstance(value, tuple) and len(value) == 2:
        value, source = check_sourced(what, value)
    return Statement(value=_CHECKS[method](what, value), source=source)


def shapes_of(geometry: Geometry) -> tuple[Shape[Any], ...]:
    """Convert the geometry that a method such as `result()` returned to a tuple of shapes. Raises `TypeError` if the geometry contains
    other objects.
    """
    if geometry is None:
        return ()
    is_single = isinstance(geometry, (Shape, str)) or not isinstance(geometry, Iterable)
    shapes: tuple[Any, ...] = (geometry,) if is_single else tuple(geometry)
    for item in shapes:
        if not isinstance(item, Shape):
            raise TypeError(f"expected a build123d shape, found {item!r}")
    return shapes


def is_one_solid(geometry: Geometry) -> bool:
    """Return whether the return value of `result()` should be one solid. The answer is True for a single shape, but not for a list or a
    `Compound` of several shapes.

    The result of a boolean operation is also a Compound. However, it stores the operation and therefore counts as one solid.
    """
    if not isinstance(geometry, Shape):
        return False
    if type(geometry) is not Compound:
        return True
    if geometry.children:
        return False
    try:
        geometry.faces(Select.LAST)
    except ValueError:  # not the result of a recorded operation
        return False
    return True


def material_of(thing: Thing) -> str | None:
    """Return the name of the default material of a Thing, or None."""
    return thing._construction.material


def color_of(thing: Thing) -> str | None:
    """Return the default colour of a Thing, as written by its author: a CSS name or `#rrggbb`. Return None if there is no default
    colour.
    """
    return thing._construction.color


def bom_of(thing: Thing) -> dict[str, str | dict[str, str]]:
    """Return the entries of the part for the bill of materials. Raises `TypeError` if `bom` is not a mapping, or has an invalid entry."""
    what, bom = f"`bom` of `{type(thing).__name__}`", thing.bom
    if not isinstance(bom, Mapping):
        raise TypeError(f"{what} must be a mapping, found {bom!r}")

    def check(key: str, value: object, form: re.Pattern[str], expected: str) -> str:
        if not isinstance(value, str) or not form.fullmatch(value):
            raise TypeError(f"{what} has an invalid {key}: expected {expected}, found {value!r}")
        return value

    values: dict[str, str | dict[str, str]] = {}
    for key, value in bom.items():
        if key not in _BOM_FORMS:
            raise TypeError(f"{what} has the unknown key `{key}`; use {', '.join(f'`{known}`' for known in sorted(_BOM_FORMS))}")
        prices = value if key == "cost" and isinstance(value, Mapping) else {}
        values[key] = {
            check("quantity", str(least), QUANTITY, "a positive whole number"): check(key, price, *_BOM_FORMS[key])
            for least, price in prices.items()
        } or check(key, value, *_BOM_FORMS[key])
    return values


def up_of(thing: Thing) -> Vector | None:
    """Return the part's preferred direction away from the print bed, a unit vector, or None.

    Raises `TypeError` or `ValueError` if the attribute `print` is invalid.
    """
    settings = thing.print
    if not settings:
        return None
    what = f"`print` of `{type(thing).__name__}`"
    if not isinstance(settings, Mapping) or set(settings) != {"up"}:
        raise TypeError(f"{what} must be a mapping such as {{\"up\": (0, 0, 1)}}, found {settings!r}")
    up = _vector(what, settings["up"])
    length = math.hypot(*up)
    if not length > 0.0:
        raise ValueError(f"`up` in {what} must not be zero, found {settings['up']!r}")
    return up[0] / length + 0.0, up[1] / length + 0.0, up[2] / length + 0.0


def actuator_of(part: Thing | PartLike) -> Actuator | None:
    """Return the actuator that a Thing or its class declares, or None. Raises `TypeError` if the attribute `actuator` is not an
    Actuator.
    """
    actuator: object = getattr(part, "actuator", None) if isinstance(part, (Thing, type(Thing))) else None
    if actuator is None or isinstance(actuator, Actuator):
        return actuator
    raise TypeError(f"`actuator` must be an Actuator, found {actuator!r}")


class _ShapePart(Thing):
    """A Thing that `build` creates from a plain build123d shape."""

    _family: str
    _shape: Shape[Any]

    def result(self) -> Shape[Any]:
        """Return the shape from which the part was created."""
        return self._shape

    def __repr__(self) -> str:
        return super().__repr__().replace(type(self).__name__, self._family, 1)


def _signature(part: Any) -> Signature:
    if isinstance(part, type) and issubclass(part, Thing):
        return family_signature(part)
    if isinstance(part, type):
        init: Callable[..., None] = part.__init__  # type: ignore[misc]
        docs = (*(base.__doc__ for base in reversed(part.__mro__)), init.__doc__)
        return signature_of(init, part.__name__, method=True, strict=False, docs=docs)
    return signature_of(part, part.__name__, method=False, strict=False, docs=(part.__doc__,))


def _only_mounts(value: object) -> bool:
    """Return whether the value of an attribute consists only of mounts."""
    if isinstance(value, dict):
        value = list(value.values())
    if type(value) in (list, tuple):
        return bool(value) and all(_only_mounts(item) for item in value)  # type: ignore[attr-defined]
    return isinstance(value, MountPoint)


def _finite(what: str, value: Any) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise ValueError(f"{what} must return a number, found {value!r}") from None
    if not math.isfinite(number):
        raise ValueError(f"{what} must be finite, found {value!r}")
    return number


def _positive(what: str, value: Any) -> float:
    number = _finite(what, value)
    if number <= 0:
        raise ValueError(f"{what} must be positive, found {value!r}")
    return number


def _vector(what: str, value: Any) -> Vector:
    try:
        x, y, z = value
    except (TypeError, ValueError):
        raise ValueError(f"{what} must return three numbers, found {value!r}") from None
    return _finite(what, x), _finite(what, y), _finite(what, z)


def _symmetric(what: str, value: Any) -> Matrix:
    try:
        a, b, c = value
    except (TypeError, ValueError):
        raise ValueError(f"{what} must return 3 x 3 numbers, found {value!r}") from None
    matrix = _vector(what, a), _vector(what, b), _vector(what, c)
    size = max(abs(number) for row in matrix for number in row)
    if any(abs(matrix[i][j] - matrix[j][i]) > 1e-9 * size for i in range(3) for j in range(i)):
        raise ValueError(f"{what} must be symmetric, found {value!r}")
    return matrix


_CHECKS: Mapping[str, Callable[[str, Any], float | Vector | Matrix]] = {
    "mass": _positive, "centre": _vector, "matrix_of_inertia": _symmetric, "density": _positive,
}
"""Functions that check the values that a Thing declares, by the name of the method."""
