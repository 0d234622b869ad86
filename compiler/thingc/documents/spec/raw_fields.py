"""The type of attributes that go past the compiler: `raw`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Union

from pydantic_core import PydanticCustomError

from thingc.documents.spec.fields import FieldValidator, fault, found, raise_all, within
from thingc.documents.spec.name_types import RefersTo
from thingc.documents.spec.patterns import raw_schema

_WORDS = "text, a number, true or false, a list of such, or a mapping"


def _raw(value: Any) -> Any:
    """An attribute for a target: a scalar, a list of scalars, or a mapping of such."""
    wrong: list[PydanticCustomError] = []
    kept = _sound_raw(value, (), wrong)
    raise_all(wrong)
    return kept


def _sound_raw(value: Any, path: tuple[str | int, ...], wrong: list[PydanticCustomError]) -> Any:
    if isinstance(value, dict):
        return {key: _sound_raw(item, (*path, key), wrong) for key, item in value.items()}
    scalars = value if isinstance(value, list) else [value]
    if isinstance(value, list) and any(isinstance(one, dict) for one in value):  # elements that are added
        return [_sound_raw(one, (*path, number), wrong) for number, one in enumerate(value)]
    if not all(one is None or isinstance(one, (str, int, float)) for one in scalars):  # that a null is no value is said of every key
        error = fault("type", f"expected {_WORDS}, found {found(value)}")
        wrong.append(within(error, path) if path else error)
    return value


_RAW_SCHEMA = {"description": "Attributes by path.", "examples": [{"joint": {"yaw": {"solreflimit": "0.01 1"}}}], **raw_schema(6)}

if TYPE_CHECKING:
    RawField = Union[str, int, float, bool, list[Any], dict[str, Any]]
else:
    RawField = Annotated[Any, FieldValidator(_raw, _WORDS, _RAW_SCHEMA), RefersTo("raw")]
