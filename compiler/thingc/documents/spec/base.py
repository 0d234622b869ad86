"""The base class of all document models, and functions that create fields and the validation errors of rules for several fields."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pydantic import BaseModel, ConfigDict, Field
from pydantic_core import PydanticCustomError

from thingc.base.suggestions import Hint


class Model(BaseModel):
    """The base class of the pydantic models of mappings in documents. Unknown keys are errors, and instances are immutable.

    The docstrings below the fields are the hover text in editors: `tools/schemas/general_schema.py` copies them into the JSON Schemas. The
    option `use_attribute_docstrings` of pydantic is not used, because it reads the source at every import, which takes 40 ms.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)

    def model_post_init(self, context: Any) -> None:
        """Check the rules of the model after its fields have been validated."""
        self._check_rules()

    def _check_rules(self) -> None:
        """Raise a validation error if the fields violate a common rule. Models with such rules override this method."""


def optional(*examples: Any) -> Any:
    """Return the pydantic field of a key that may be omitted, with examples of its values for the JSON Schema."""
    return Field(default=None, examples=list(examples))


def rule(message: str, help: Hint = "", key: str | None = None) -> PydanticCustomError:
    """Create a validation error for a mapping whose fields violate a rule of its model. `key` is the key that causes the error."""
    return PydanticCustomError("rule", "{message}", {"message": message, "help": help, "path": (key,) if key is not None else ()})


def given_keys(spec: BaseModel, keys: Sequence[str]) -> list[str]:
    """Return the keys in `keys` that a mapping contains."""
    return [key for key in keys if getattr(spec, key) is not None]


def require_one(spec: BaseModel, keys: Sequence[str], description: str, help: Hint) -> None:
    """Raise a validation error unless a mapping contains exactly one of the keys. `description` is the mapping in messages: `a volume`."""
    found = given_keys(spec, keys)
    if len(found) != 1:
        expected, given = (", ".join(f"`{key}`" for key in keys), " and ".join(f"`{key}`" for key in found))
        raise rule(f"{description} must have exactly one of {expected}, found {given or 'none'}", help)


def require_either(spec: BaseModel, first: str, second: str, description: str, help: Hint) -> None:
    """Raise a validation error unless a mapping contains exactly one of two keys."""
    found = given_keys(spec, (first, second))
    if len(found) != 1:
        raise rule(f"{description} requires exactly one of `{first}` and `{second}`, found {'both' if found else 'none'}", help)


def require_with(spec: BaseModel, key: str, other: str, help: Hint) -> None:
    """Raise a validation error if a mapping contains `key` without the key `other`, which `key` requires."""
    if getattr(spec, key) not in (None, [], {}) and getattr(spec, other) is None:
        raise rule(f"`{key}` can only be used with `{other}`", help, key)
