"""Definition of a kind of document test, shared by the modules of kinds and the passes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Generic, TypeVar

from pydantic import ConfigDict

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.one_line_repr import OneLineRepr
from thingc.documents.spec.base import Model, rule

BOUNDED = ConfigDict(json_schema_extra={"anyOf": [{"required": ["min"]}, {"required": ["max"]}]})
"""Configuration of models that require `min`, `max` or both, for the schema."""


def require_bounds(low: object, high: object, kind: str, example: str) -> None:
    """Raise an error if neither `min` nor `max` is given."""
    if low is None and high is None:
        raise rule(f"a `{kind}` test needs `min`, `max` or both; none is here", f"write for example `{example}`")


Written = TypeVar("Written", bound=Model)
Stated = TypeVar("Stated", bound=OneLineRepr)


class CheckKind(FrozenStruct, Generic[Written, Stated]):
    """One kind of test.

    `model` is what is written under the key `name`. With a field `mode` the test is run in modes, with a field `pose` in poses of these,
    else once. `read(written, reader)` gives what is stated, in SI and with names worked out (None, where something of it was wrong: the
    reader has reported it); `reader` is a `model.resolve.tests.Reader`. References are found in what is stated by their type, and linked.

    `link(test, stated, joints by path, findings)` reports what is only known of the linked assembly. (The types of these arguments belong
    to later passes, which this module must not import: every kind's functions name them.) The module of the same name in
    `driver/testing/kinds/` measures what is stated.

    `position` is the place among the kinds in the documentation; `summary` one sentence for a schema and a table; `examples` values
    of the key; `stub` what a new test of this kind says, which is right in any robot, `$mount` and `$base` standing for mounts of it;
    `page` what the documentation says, with a table of keys for each model of the file. `lengths`: names of measured and expected values
    that are lengths [m], which `thingc diff` prints with a unit. `of_limits`: what is read depends on the limits of joints.
    """

    name: str
    position: int
    summary: str
    examples: Sequence[Mapping[str, Any]]
    stub: Mapping[str, Any]
    page: str
    model: type[Written]
    read: Callable[[Written, Any], Stated | None]
    link: Callable[[Any, Stated, Mapping[str, Any], Any], None] | None = None
    lengths: Sequence[str] = ()
    of_limits: bool = False

    def takes(self, key: str) -> bool:
        """Return whether tests of this kind accept `mode`, or `pose`."""
        return key in self.model.model_fields
