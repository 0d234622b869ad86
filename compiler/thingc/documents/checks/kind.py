"""The definition of a type of document test, such as `mass` or `reach`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from pydantic import ConfigDict

from thingc.base.diagnostics import Code
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.numeric import hypot
from thingc.base.one_line_repr import OneLineRepr
from thingc.base.pose import Vector
from thingc.base.units import NUMBER, Dimension
from thingc.documents.spec.base import Model, rule
from thingc.documents.spec.fields import Value

if TYPE_CHECKING:
    from thingc.model.assembly.report import LinkReport
    from thingc.model.assembly.types import JointEdge, LinkedTendon
    from thingc.model.resolve.tests import Reader
    from thingc.model.resolve.types import Test

BOUNDED = ConfigDict(json_schema_extra={"anyOf": [{"required": ["min"]}, {"required": ["max"]}]})
"""Configuration of a pydantic model whose JSON Schema requires `min`, `max` or both."""


def require_bounds(low: object, high: object, kind: str, example: str) -> None:
    """Raise a validation error if a document test specifies neither `min` nor `max`."""
    if low is None and high is None:
        raise rule(f"a `{kind}` test requires `min` or `max`", f"write, for example, `{example}`")


def read_direction(values: Sequence[Value], reader: Reader, key: str, example: str) -> Vector | None:
    """Return the unit vector with the direction of three numbers under the key `key` of a test.

    Return None if a number is invalid, or if all numbers are 0. `example` is a valid direction for the help text.
    """
    x, y, z = (reader.number(value, (key, index), NUMBER, f"a component of `{key}`") for index, value in enumerate(values))
    length = hypot(x, y, z)
    if length == 0.0:
        reader.error(Code.OUT_OF_RANGE, f"`{key}` must not be zero", key, help=f"write, for example, `{key}: {example}`")
    return (x / length, y / length, z / length) if length > 0.0 else None


TestModel = TypeVar("TestModel", bound=Model)
Specification = TypeVar("Specification", bound=OneLineRepr)


class CheckKind(FrozenStruct, Generic[TestModel, Specification]):
    """A type of document test, such as `mass`. The class `TestMeasurement` in `driver/testing/outcomes.py` defines the measurement.

    `name` is the key of the test in documents, and `model` is the pydantic model of its value. If the model has a field `mode`, the test
    runs once for each mode. If the model has a field `pose`, the test runs once for each pose. `read(value, reader)` converts the value to
    a specification in SI units with resolved names. If the value is invalid, the reader reports the error and `read` returns None. The pass
    `link` finds the references in the specification by their type, and resolves them. Then `link(test, specification, joints by path,
    findings)` reports errors that depend on the linked assembly.

    `position` determines the order of the tests in the documentation. `summary` is one sentence for the schema and the documentation, and
    `examples` contains example values. `stub` is the content of a new test of this type, with the placeholders `$mount` and `$base` for
    mounts, and `$motion` for a motion. The new test is valid for any robot with a motion. `lengths` contains the names of values that are
    lengths [m] and that `thingc diff` prints with a unit. `smooth` contains the values that change smoothly with the numbers of the
    document, with their physical dimensions: batches return these values as results, and families their derivatives. `of_limits` is True if
    the specification depends on joint limits.
    """

    name: str
    position: int
    summary: str
    examples: Sequence[Mapping[str, Any]]
    stub: Mapping[str, str | Sequence[str] | Mapping[str, Sequence[str]]]
    model: type[TestModel]
    read: Callable[[TestModel, Reader], Specification | None]
    link: Callable[[Test, Specification, Mapping[str, JointEdge | LinkedTendon], LinkReport], None] | None = None
    lengths: Sequence[str] = ()
    smooth: Mapping[str, Dimension] = {}
    of_limits: bool = False

    def takes(self, key: str) -> bool:
        """Return whether document tests of this type accept the key `key`, which is `mode` or `pose`."""
        return key in self.model.model_fields
