"""Types of values in documents: quantities, expressions, vectors, names, references, colours.

Each type is an `Annotated` type that pydantic validates with a single function, instead of with pydantic's unions and regular expressions.
An invalid value therefore causes exactly one error, whose message is written by thingc. The errors are `PydanticCustomError`s. The module
`spec.validation` converts the type of an error to a diagnostic code. The context of an error contains `message` and `help`. If only a part
of a scalar is invalid, `offset` and `end` are the range of its characters. If the error is inside the value, `path` is the path to the
error. `others` is a list of further errors.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Annotated, Any, Union

from pydantic_core import PydanticCustomError, core_schema

from thingc.base import units
from thingc.base.bom_values import COST, LINK
from thingc.base.one_line_repr import format_count
from thingc.base.suggestions import Hint, Suggestion, near_hint
from thingc.base.units import Dimension, Quantity, UnitError, check_dimension, parse_quantity, scan_number, shorten, suggested_units
from thingc.base.vector_text import parse_vector
from thingc.documents.expressions.parsing import expression_hint, parse_expression
from thingc.documents.expressions.terms import Expression, ExpressionError
from thingc.documents.spec.patterns import ANY_VALUE, EXPRESSION, quantity_pattern, vector_pattern

if TYPE_CHECKING:
    from pydantic import GetCoreSchemaHandler

Value = Union[Quantity, Expression]
Vector = tuple[Value, Value, Value]


class FieldValidator:
    """An annotation of a field of a document model: its validator, its description in messages, and its JSON Schema."""

    def __init__(self, validate: Callable[[Any], Any], description: str, schema: Mapping[str, Any]) -> None:
        self.validate = validate
        self.description = description
        self.schema = dict(schema)

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        metadata = {"pydantic_js_functions": [lambda schema, handler: dict(self.schema)]}
        return core_schema.no_info_plain_validator_function(self.validate, metadata=metadata)


def text_field(
    is_valid: Callable[[str], object], expected: str, example: str, schema: Mapping[str, Any], *, description: str = "",
) -> FieldValidator:
    """Return a validator for strings for which `is_valid` returns a true value. The string is not changed.

    `expected` and `example` describe the string in messages. `description` is the description of the field, by default `expected`.
    """

    def validate(value: Any) -> str:
        if isinstance(value, str) and is_valid(value):
            return value
        raise fault("type", f"expected {expected}, found {describe(value)}", help=f"write, for example, `{example}`")

    return FieldValidator(validate, description or expected, {"type": "string", **schema})


def fault(kind: str, message: Hint, *, help: Hint | None = None, offset: int | None = None, end: int | None = None) -> PydanticCustomError:
    """Create a pydantic validation error from a message and a help text.

    The docstring of this module describes the context of the error.
    """
    context: dict[str, Any] = {"message": message}
    if help:
        context["help"] = help
    if offset is not None:
        context["offset"] = offset
        context["end"] = offset + 1 if end is None else end
    return PydanticCustomError(kind, "{message}", context)


def describe(value: object) -> str:
    """Describe an invalid value for a message: "the string `x`", "the number `3`", "a list of 2 items", "a mapping"."""
    if isinstance(value, str):
        return f"the string `{shorten(value)}`" if value else "an empty string"
    if isinstance(value, bool):
        return f"`{'true' if value else 'false'}`"
    if isinstance(value, (int, float)):
        return f"the number `{shorten(repr(value))}`"
    if isinstance(value, (list, tuple)):
        return f"a list of {format_count(len(value), 'item')}" if value else "an empty list"
    if isinstance(value, Mapping):
        keys = ", ".join(f"`{shorten(str(key), 20)}`" for key in list(value)[:3])
        return f"a mapping with {keys}" if keys else "an empty mapping"
    return "nothing"


def read_expression(text: str, *, dotted: bool = False) -> Expression:
    """Parse an expression such as `=reach / 2`, or with `dotted`, one whose names can contain dots.

    Syntax errors are raised as pydantic validation errors.
    """
    try:
        return parse_expression(text, dotted=dotted)
    except ExpressionError as error:
        kind = "unit" if error.kind == "unit" else "expression"
        raise fault(kind, error.message, help=error.help, offset=error.offset, end=error.end) from None


def is_expression(value: object) -> bool:
    """Return whether a scalar is an expression, that is, a string that begins with `=`."""
    return isinstance(value, str) and value.lstrip().startswith("=")


def _unit_fault(error: UnitError) -> PydanticCustomError:
    return fault(error.kind, error.message, help=error.help, offset=error.offset, end=error.end)


def _unitless_quantity(value: int | float) -> Quantity:
    """Convert a number without a unit to a quantity. Raises an error for integers that overflow a double."""
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise fault("quantity", "a number must be finite and within the range of a double")
    return Quantity(number + 0.0)


def read_value(value: Any, dimensions: tuple[Dimension, ...], description: str, example: str) -> Value:
    """Parse a string or a number of a document to a quantity with one of the given physical dimensions, or to an expression.

    Raises an error such as `expected a length (such as `120 mm`), found ...` for any other value.
    """
    if isinstance(value, Quantity):
        return check_dimension(value, dimensions, f"{value.value}")
    if is_expression(value):
        return read_expression(value)
    try:
        if isinstance(value, str):
            return check_dimension(_quantity_in(value, dimensions, description, example), dimensions, value)
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            return check_dimension(_unitless_quantity(value), dimensions, repr(value))
    except UnitError as error:
        raise _unit_fault(error) from None
    raise fault("type", f"expected {description} (such as `{example}`), found {describe(value)}")


def _quantity_in(text: str, dimensions: tuple[Dimension, ...], description: str, example: str) -> Quantity:
    """Parse a quantity such as `120 mm`.

    Raises UnitError. If the string does not begin with a number, the message contains `description` and `example`.
    """
    start = len(text) - len(text.lstrip())
    if scan_number(text, start) is None:
        raise UnitError(f"expected {description} (such as `{example}`), found {describe(text)}", help=expression_hint(text))
    try:
        return parse_quantity(text, dimensions)
    except UnitError as error:
        comma = re.fullmatch(r"\s*([-+]?\d+),(\d.*)", text)
        if comma is not None:
            raise UnitError("use a decimal point, not a comma", help=decimal_point(text.strip(), comma.group(1), comma.group(2))) from None
        if error.help is None and re.search(r"[*/(]", text):
            error.help = expression_hint(text)
        raise


def decimal_point(text: str, integer: str, fraction: str) -> Suggestion:
    """Return a hint to write `text` with a decimal point in place of its comma. `integer` and `fraction` are the digits around the comma.

    The hint contains a fix only if the comma cannot be a thousands separator, as in 1,500.
    """
    point = f"{integer}.{fraction}"
    decimals = re.match(r"\d*", fraction)
    sure = decimals is not None and len(decimals.group()) != 3 and shorten(point) == point
    return Suggestion(f"write `{shorten(point)}`", (text, point) if sure else None)


def quantity(*dimensions: Dimension, doc: str = "") -> FieldValidator:
    """Return a validator for quantities with one of the given physical dimensions. The validated value is a `Quantity` or an `Expression`.

    The number 0 is valid without a unit. All other numbers without a unit are rejected, unless NUMBER is one of the physical dimensions.
    `doc` replaces the default description ("an angle or a length") in messages and in the JSON Schema.
    """
    description = doc or " or ".join(dimension.words for dimension in dimensions)
    examples = [dimension.example for dimension in dimensions]
    schema = _schema(description, examples, dimensions)
    return FieldValidator(lambda value: read_value(value, dimensions, description, examples[0]), description, schema)


def _schema(description: str, examples: list[str], dimensions: tuple[Dimension, ...]) -> dict[str, Any]:
    numbers = units.NUMBER in dimensions
    text: dict[str, Any] = {"type": "string", "pattern": quantity_pattern(*dimensions)}
    number: dict[str, Any] = {"type": "number"} if numbers else {"const": 0}
    return {
        "description": f"{description[0].upper()}{description[1:]}, such as `{examples[0]}`, or an expression such as `=reach / 2`.",
        "examples": [2 if numbers else examples[0], *examples[1:], "=reach / 2"],
        "anyOf": [text, number],
    }


LengthField = Annotated[Value, quantity(units.LENGTH)]
AngleField = Annotated[Value, quantity(units.ANGLE)]
MassField = Annotated[Value, quantity(units.MASS)]
DensityField = Annotated[Value, quantity(units.DENSITY)]
TimeField = Annotated[Value, quantity(units.TIME)]
VelocityField = Annotated[Value, quantity(units.VELOCITY)]
RatioField = Annotated[Value, quantity(units.NUMBER, doc="a number or a percentage")]
EffortField = Annotated[Value, quantity(units.TORQUE, units.FORCE)]
SpeedField = Annotated[Value, quantity(units.ANGULAR_VELOCITY, units.VELOCITY)]
CommandField = Annotated[Value, quantity(units.ANGLE, units.LENGTH, units.ANGULAR_VELOCITY, units.VELOCITY, units.TORQUE, units.FORCE)]
DampingField = Annotated[Value, quantity(units.ANGULAR_DAMPING, units.LINEAR_DAMPING)]
FrictionField = Annotated[Value, quantity(units.TORQUE, units.FORCE)]
ArmatureField = Annotated[Value, quantity(units.INERTIA, units.MASS)]
StiffnessField = Annotated[Value, quantity(units.ANGULAR_STIFFNESS, units.LINEAR_STIFFNESS)]
ForceField = Annotated[Value, quantity(units.FORCE)]
MultiplierField = Annotated[Value, quantity(units.NUMBER, units.LENGTH_PER_ANGLE, units.ANGLE_PER_LENGTH)]
InertiaField = Annotated[Value, quantity(units.INERTIA)]


def any_value(value: Any) -> Value | bool | str:
    """Validate the value of a parameter: a quantity, an expression, a boolean, or a string that does not begin with a number."""
    if isinstance(value, bool | Quantity):
        return value
    if is_expression(value):
        return read_expression(value)
    if isinstance(value, str):
        if scan_number(value.lstrip()) is None:
            return value
        try:
            return parse_quantity(value)
        except UnitError as error:
            raise _unit_fault(error) from None
    if isinstance(value, (int, float)):
        return _unitless_quantity(value)
    raise fault("type", f"expected a quantity, an expression, a boolean or a string, found {describe(value)}")


def _joint_value(value: Any) -> Value | str:
    """Validate the value of a joint coordinate. In a pose, the name of a pose of a nested document is also valid."""
    if isinstance(value, str) and _NAME.fullmatch(value.strip()):
        return value.strip()
    return read_value(value, (units.ANGLE, units.LENGTH), "an angle or a length", "30 deg")


def _vector(dimension: Dimension) -> FieldValidator:
    """Return the validator of a vector with three values of one physical dimension: `[10 mm, 0, =h]` or `0 120 30 mm`.

    The validated value is a tuple of three values.
    """
    description = f"three values, each {dimension.words}"
    number, _, unit = dimension.example.partition(" ")
    short = f"0 0 -{number} {unit}" if dimension == units.ACCELERATION else f"0 {number} 30 {unit}"
    listed = f"[{dimension.example}, 0, 0]"

    def validate(value: Any) -> Vector:
        if isinstance(value, str) and not is_expression(value):
            try:
                x, y, z = (check_dimension(part, (dimension,), value) for part in parse_vector(value, (dimension,)))
            except UnitError as error:
                if error.kind == "unit" and error.offset is None:
                    example = f"{' '.join(value.split())} {suggested_units(dimension, value)[0]}"
                    error = UnitError(error.message, kind="unit", help=f"write, for example, `{example}`")
                raise _unit_fault(error) from None
            return x, y, z
        if not isinstance(value, (list, tuple)):
            raise fault("type", f"expected {description}, found {describe(value)}", help=f"write, for example, `{short}` or `{listed}`")
        if len(value) != 3:
            raise fault("vector", f"expected {description}, found {describe(value)}", help=f"write, for example, `{listed}`")
        items: list[Value] = []
        wrong: list[PydanticCustomError] = []
        for index, item in enumerate(value):
            try:
                items.append(read_value(item, (dimension,), dimension.words, dimension.example))
            except PydanticCustomError as error:
                wrong.append(within(error, (index,)))
        raise_all(wrong)
        return items[0], items[1], items[2]

    item = _schema(dimension.words, [dimension.example], (dimension,))
    return FieldValidator(validate, description, {
        "description": f"Three values, each {dimension.words}: `{short}` or `{listed}`.",
        "examples": [short, [dimension.example, 0, 0]],
        "anyOf": [
            {"type": "string", "pattern": vector_pattern(dimension)},
            {"type": "array", "items": {"anyOf": item["anyOf"]}, "minItems": 3, "maxItems": 3},
        ],
    })


def within(error: PydanticCustomError, path: tuple[str | int, ...]) -> PydanticCustomError:
    """Return a copy of a validation error to which the path of the invalid item inside the validated value is added.

    `spec.validation` uses this path to find the location of the error.
    """
    context = dict(error.context or {})
    context["path"] = path
    return PydanticCustomError(error.type, "{message}", context)


def raise_all(errors: list[PydanticCustomError]) -> None:
    """Raise the first error of the list, with the other errors as `others` in its context. Do nothing if the list is empty."""
    if errors:
        first, *others = errors
        raise PydanticCustomError(first.type, "{message}", {**(first.context or {}), "others": others})


_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*", re.ASCII)


def name_of(value: Any) -> str:
    """Validate a name in a document, such as the name of a component. Raises an error if the name is invalid."""
    if not isinstance(value, str):
        raise fault("type", f"expected a name, found {describe(value)}")
    if _NAME.fullmatch(value):
        return value
    from unicodedata import normalize

    plain = re.sub("[\u0300-\u036f]+", "", normalize("NFD", value.strip()))  # letters without their accents
    cleaned = re.sub(r"\W+", "_", plain, flags=re.ASCII).strip("_")
    help = f"write, for example, `{cleaned}`" if _NAME.fullmatch(cleaned) else "use letters, digits and `_` after a letter"
    raise fault("name", f"`{shorten(value)}` is not a valid name", help=help)


def _validate_omitted(value: Any) -> tuple[str, ...]:
    """Validate levels of detail that are omitted, such as `-fasteners`, and return their names. `none` is an empty list."""
    levels = value if isinstance(value, list) else [] if value == "none" else [value]
    for text in levels:
        if not isinstance(text, str) or not text.startswith("-"):
            help = "write, for example, `-fasteners`"
            if isinstance(text, str) and _NAME.fullmatch(text):
                help = f"write `-{text}` to omit this level of detail"
            raise fault("type", f"expected a minus sign and a level of detail, found {describe(text)}", help=help)
    return tuple(name_of(text[1:]) for text in levels)


def _index(value: Any) -> str:
    """Validate the index of a joint coordinate, which must be an integer of at least 0."""
    if isinstance(value, str) and value.isdecimal() and value.isascii() and len(value) < 3:
        return value
    raise fault("name", f"expected the index of a coordinate such as `0`, found {describe(value)}")


_REFERENCE_WORD = re.compile(r"(?:[A-Za-z*?\[]|\$\{?[A-Za-z])(?:[A-Za-z0-9_*?\[\]!-]|\$\{?[A-Za-z][A-Za-z0-9_]*\}?)*", re.ASCII)


def _reference(value: Any) -> str:
    """Validate a reference to an element, which consists of names separated by dots.

    A reference can contain the index `$i` of a repeat. If patterns are allowed, `*`, `?` and `[...]` are also valid.
    """
    if not isinstance(value, str):
        raise fault("type", f"expected a reference such as `plate.servo_seat`, found {describe(value)}")
    offset = 0
    for word in value.split("."):
        if not _REFERENCE_WORD.fullmatch(word):
            wrong = "" if word == value else f" (invalid name `{shorten(word)}`)" if word else " (missing name next to a `.`)"
            message = f"`{shorten(value)}` is not a valid reference{wrong}"
            help = f"separate names with dots: `{shorten(value.replace('/', '.'))}`" if "/" in word else None
            if re.fullmatch(r"\w+ +\w+", word):
                help = f"write `{'.'.join(word.split())}`"
            raise fault("reference", message, help=help, offset=offset, end=offset + max(1, len(word)))
        offset += len(word) + 1
    return value


_HEX = re.compile(r"#(?:[0-9a-fA-F]{3}|[0-9a-fA-F]{6})", re.ASCII)


def _color(value: Any) -> str:
    """Validate a CSS colour name, `#rgb` or `#rrggbb`, and convert it to `#rrggbb`."""
    import webcolors  # lazy import: many documents have no colours

    if not isinstance(value, str):
        raise fault("type", f"expected a colour, found {describe(value)}", help='write a CSS colour name or `"#rrggbb"`')
    if _HEX.fullmatch(value):
        digits = value[1:].lower()
        return "#" + (digits if len(digits) == 6 else "".join(digit * 2 for digit in digits))
    if value.startswith("#"):
        raise fault("color", f"`{shorten(value)}` is not a colour", help='write `"#rrggbb"` with hexadecimal digits')
    try:
        return str(webcolors.name_to_hex(value))
    except ValueError:
        help = near_hint(value, webcolors.names()) or 'write a CSS colour name or `"#rrggbb"`'
        raise fault("color", f"unknown colour `{shorten(value)}`", help=help) from None


def _count(value: Any) -> int | Expression:
    """Validate a count, which must be an integer of at least 0 or an expression."""
    if is_expression(value):
        return read_expression(value)
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise fault("type", f"expected a whole number, found {describe(value)}")
    if value != math.floor(value):
        raise fault("quantity", f"expected a whole number, found {describe(value)}")
    if value < 0:
        raise fault("quantity", f"expected a whole number of at least 0, found {describe(value)}")
    if value > 1_000_000_000:
        raise fault("quantity", f"expected a whole number of at most 1000000000, found {describe(value)}")
    return int(value)


def _number(value: Any) -> Value:
    return read_value(value, (units.NUMBER,), "a number", "0.4")


def _cost(value: Any) -> str:
    """Validate a cost: an amount with a currency, such as `12.50 EUR`. The string is returned unchanged."""
    if isinstance(value, str) and COST.fullmatch(value):
        return value
    amount = value if isinstance(value, (int, float)) and not isinstance(value, bool) else "12.50"
    raise fault(
        "quantity" if isinstance(value, str) else "type", f"expected an amount and a currency, found {describe(value)}",
        help=f"write, for example, `{amount} EUR`",
    )


_ANY_SCHEMA = {
    "description": "A quantity with its unit, a number, an expression such as `=reach / 2`, a boolean or a string.",
    "examples": ["120 mm", 6, "=reach / 2", True],
    "type": ["string", "number", "boolean"], "pattern": ANY_VALUE,
}
_INDEX_SCHEMA = {"type": "string", "pattern": "^[0-9]$"}
_NAME_SCHEMA = {"type": "string", "pattern": "^[A-Za-z][A-Za-z0-9_]*$", "examples": ["shoulder"]}
_LEVEL_SCHEMA = {"type": "string", "pattern": "^-[A-Za-z][A-Za-z0-9_]*$"}
_OMITTED_SCHEMA = {
    "description": "Levels of detail, each with a minus sign, or `none`.",
    "examples": ["-fasteners", ["-fasteners", "-electronics"], "none"],
    "anyOf": [_LEVEL_SCHEMA, {"const": "none"}, {"type": "array", "items": _LEVEL_SCHEMA}],
}
REFERENCE_PATTERN = rf"^{_REFERENCE_WORD.pattern}(\.{_REFERENCE_WORD.pattern})*$"
"""Regular expression of a reference for the JSON Schemas."""
_REFERENCE_SCHEMA = {
    "type": "string", "pattern": REFERENCE_PATTERN,
    "description": "Dotted names; the last may be a mount; `$i` inside a repeat.",
    "examples": ["plate.servo_seat", "hand.cap.pen", "body.hip_$i"],
}
_COLOR_SCHEMA = {"type": "string", "description": "A CSS colour name or `#rrggbb`.", "examples": ["lavender", "#8899aa"]}
_COUNT_SCHEMA = {
    "description": "A whole number, or an expression.", "examples": [6, "=legs"],
    "anyOf": [{"type": "integer", "minimum": 0, "maximum": 1_000_000_000}, {"type": "string", "pattern": rf"^\s*{EXPRESSION}$"}],
}
_NUMBER_SCHEMA = {
    "description": "A number, or an expression.", "examples": [0.4, "=grip"], 
    "anyOf": [{"type": "number"}, {"type": "string", "pattern": quantity_pattern(units.NUMBER)}],
}
_COST_SCHEMA = {
    "type": "string", "pattern": r"^\d+(\.\d+)? [A-Z]{3}$", "description": "An amount and a currency.", "examples": ["12.50 EUR"],
}
_LINK_SCHEMA = {"pattern": "^https?://", "description": "A web address.", "examples": ["https://www.example.com/xm430"]}
_JOINT_SCHEMA = {
    "description": "An angle (`30 deg`) or a length (`20 mm`), an expression, or the name of a nested document's pose.",
    "examples": ["30 deg", "20 mm", "=open / 2", "folded"],
    "anyOf": [{"type": "string", "pattern": quantity_pattern(units.ANGLE, units.LENGTH, word="[A-Za-z][A-Za-z0-9_]*")}, {"const": 0}],
}

AnyQuantityField = Annotated[Union[Value, bool, str], FieldValidator(any_value, "a quantity, a boolean or a string", _ANY_SCHEMA)]
JointValueField = Annotated[Union[Value, str], FieldValidator(_joint_value, "an angle or a length", _JOINT_SCHEMA)]
Vector3Length = Annotated[Vector, _vector(units.LENGTH)]
Vector3Angle = Annotated[Vector, _vector(units.ANGLE)]
Vector3Acceleration = Annotated[Vector, _vector(units.ACCELERATION)]
Name = Annotated[str, FieldValidator(name_of, "a name", _NAME_SCHEMA)]
OmittedField = Annotated[tuple[str, ...], FieldValidator(_validate_omitted, "levels of detail", _OMITTED_SCHEMA)]
Index = Annotated[str, FieldValidator(_index, "the index of a coordinate", _INDEX_SCHEMA)]
ReferenceField = Annotated[str, FieldValidator(_reference, "a reference", _REFERENCE_SCHEMA)]
ColorField = Annotated[str, FieldValidator(_color, "a colour", _COLOR_SCHEMA)]
CostField = Annotated[str, FieldValidator(_cost, "an amount and a currency", _COST_SCHEMA)]
LinkField = Annotated[str, text_field(LINK.fullmatch, "a web address", "https://www.example.com/xm430", _LINK_SCHEMA)]
CountField = Annotated[Union[int, Expression], FieldValidator(_count, "a whole number", _COUNT_SCHEMA)]
NumberField = Annotated[Value, FieldValidator(_number, "a number", _NUMBER_SCHEMA)]
