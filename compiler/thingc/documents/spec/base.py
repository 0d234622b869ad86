"""The base class of all document models, and a function that creates validation errors for rules that involve several fields."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict
from pydantic_core import PydanticCustomError

from thingc.base.suggestions import Hint


class Model(BaseModel):
    """The base class of the pydantic models of mappings in documents. Unknown keys are errors, and instances are immutable.

    The docstrings below the fields are the hover text in editors: `tools/schemas/general_schema.py` copies them into the JSON Schemas. The
    option `use_attribute_docstrings` of pydantic is not used, because it reads the source at every import, which takes 40 ms.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)


def rule(message: str, help: Hint = "", key: str | None = None) -> PydanticCustomError:
    """Create the validation error for a mapping whose fields violate a common rule. `key` is the key that causes the error."""
    return PydanticCustomError("rule", "{message}", {"message": message, "help": help, "path": (key,) if key is not None else ()})
