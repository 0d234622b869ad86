"""The definition of a type of document test, such as `mass` or `reach`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from pydantic import ConfigDict

from thingc.base.diagnostics import DiagnosticCode
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.one_line_repr import OneLineRepr
from thingc.documents.spec.base import Model, rule

if TYPE_CHECKING:
    from thingc.model.assembly.report import LinkReport
    from thingc.model.assembly.types import JointEdge
    from thingc.model.resolve.tests import Reader
    from thingc.model.resolve.types import Test

BOUNDED = ConfigDict(json_schema_extra={"anyOf": [{"required": ["min"]}, {"required": ["max"]}]})
"""Model configuration for the schema: models with this configuration require `min`, `max` or both."""


def require_bounds(low: object, high: object, kind: str, example: str) -> None:
    """Raise a validation error if a document test specifies neither `min` nor `max`."""
    if low is None and high is None:
        raise rule(f"a `{kind}` test needs `min`, `max` or both", f"write for example `{example}`")


Written = TypeVar("Written", bound=Model)
Stated = TypeVar("Stated", bound=OneLineRepr)


class CheckKind(FrozenStruct, Generic[Written, Stated]):
    """A kind of document test. The class `TestMeasurement` in `driver/testing/outcomes.py` measures tests of this kind.

    `model` is the model of the value under the key `name`. If the model has a field `mode`, the test runs once for each mode; if it has a
    field `pose`, once for each pose; otherwise once. `read(written, reader)` returns the specification of the test, in SI units and with
    names resolved. If the value is invalid, the reader reports the error and `read` returns None. The pass `link` finds the references in
    the specification by their type, and resolves them.

    `codes` contains the diagnostic codes of failed tests. `link(test, stated, joints by path, findings)` reports errors that depend on the
    linked assembly.

    `position` is the position of the kind in the documentation; `summary` is one sentence for a schema and a table; `examples` are values
    of the key; `stub` is the content of a new test of this kind, with the placeholders `$mount` and `$base` for mounts; the test is valid
    in any robot. `lengths` are the names of the values that are lengths [m]: `thingc diff` prints these values with a unit. `of_limits` is
    True if the specification depends on joint limits.
    """

    name: str
    position: int
    summary: str
    examples: Sequence[Mapping[str, Any]]
    stub: Mapping[str, str | Sequence[str] | Mapping[str, Sequence[str]]]
    model: type[Written]
    codes: type[DiagnosticCode]
    read: Callable[[Written, Reader], Stated | None]
    link: Callable[[Test, Stated, Mapping[str, JointEdge], LinkReport], None] | None = None
    lengths: Sequence[str] = ()
    of_limits: bool = False

    def takes(self, key: str) -> bool:
        """Return whether document tests of this type accept the key `mode` or `pose`."""
        return key in self.model.model_fields
