"""A variant of a batch. Processes that run variants on other machines import this module instead of `planning`, which imports pydantic."""

from __future__ import annotations

from collections.abc import Mapping

from thingc.base.one_line_repr import OneLineStruct
from thingc.geometry.record import Value

OUTSIDE = "outside:"
"""Prefix of the paths of input files outside the workspace."""


class Variant(OneLineStruct):
    """A planned variant of a robot. `index` is the position of the variant in the plan, and `id` identifies the settings of the variant.

    The id consists of 12 hexadecimal digits of the SHA-256 of the settings. `parameters` and `choices` contain the settings for `thingc
    build -p` and `--set`, in the units of the documents. Settings that equal the values in the assembly document are omitted. `values`
    contains all parameters of the assembly, and all values that are set by path [SI]. `failed` is the first rule that the parameters
    violate, or None.
    """

    index: int
    id: str
    name: str
    parameters: Mapping[str, str]
    choices: Mapping[str, str]
    values: Mapping[str, Value]
    failed: str | None = None
