"""The base class of all document models, and a function that creates the validation error of a rule between fields."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict
from pydantic_core import PydanticCustomError

from thingc.base.suggestions import Hint


class Model(BaseModel):
    """A mapping in a document. Unknown keys are errors, and values are immutable.

    The docstrings under the fields are the hover text of an editor: `spec.schema` reads them when it exports the
    schemas. (pydantic's own `use_attribute_docstrings` reads the source at every import, which costs 40 ms.)
    """

    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)


def rule(message: str, help: Hint = "", key: str | None = None) -> PydanticCustomError:
    """Create a validation error for a mapping that violates a rule between its fields. `key` is the key that causes the error."""
    return PydanticCustomError("rule", "{message}", {"message": message, "help": help, "path": (key,) if key is not None else ()})
