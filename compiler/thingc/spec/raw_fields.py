"""The type of attributes that go past the compiler: `raw`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Union

from pydantic_core import PydanticCustomError

from thingc.spec.fields import Checked, fault, found, raise_all, within
from thingc.spec.patterns import raw_schema


def _raw(value: Any) -> Any:
    """An attribute for a target: a scalar, or a mapping of such."""
    wrong: list[PydanticCustomError] = []
    kept = _sound_raw(value, (), wrong)
    raise_all(wrong)
    return kept


def _sound_raw(value: Any, path: tuple[str, ...], wrong: list[PydanticCustomError]) -> Any:
    if isinstance(value, dict):
        return {key: _sound_raw(item, (*path, key), wrong) for key, item in value.items()}
    if not isinstance(value, (str, int, float)):
        error = fault("type", f"expected text, a number, true or false, or a mapping, found {found(value)}")
        wrong.append(within(error, path) if path else error)
    return value


_RAW_SCHEMA = {"description": "Attributes by path.", "examples": [{"joint": {"yaw": {"solreflimit": "0.01 1"}}}], **raw_schema(6)}

if TYPE_CHECKING:
    RawField = Union[str, int, float, bool, dict[str, Any]]
else:
    RawField = Annotated[Any, Checked(_raw, "text, a number, true or false, or a mapping", _RAW_SCHEMA)]
