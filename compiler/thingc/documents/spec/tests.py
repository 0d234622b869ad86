"""The `tests:` block of an `assembly/1` document: requirements for the robot, by name.

The modules of `documents/checks/` define the types of tests.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pydantic import ConfigDict, Field, create_model

from thingc.documents.checks import kinds
from thingc.documents.spec.base import Model, rule


class _OneKind(Model):
    """A mapping with one key, which is the type of the test."""

    model_config = ConfigDict(json_schema_extra={"minProperties": 1, "maxProperties": 1})

    @property
    def kind(self) -> str:
        """The type of the test, such as `mass`, which is the only key of the mapping."""
        return next(kind for kind in kinds() if getattr(self, kind) is not None)

    @property
    def stated(self) -> Any:
        """The specification of the test, which is the value of the only key of the mapping."""
        return getattr(self, self.kind)

    def _check_rules(self) -> None:
        written = [kind for kind in kinds() if getattr(self, kind) is not None]
        if not written:
            raise rule("a test requires a kind", "write, for example, `{mass: {max: 2.2 kg}}`")
        if len(written) > 1:
            named = " and ".join(f"`{kind}`" for kind in written)
            raise rule(f"a test must have exactly one kind, found {named}", "write two tests with different names")


if TYPE_CHECKING:
    TestSpec = _OneKind
else:
    TestSpec = create_model(
        "TestSpec", __base__=_OneKind, __module__=__name__, __doc__="One named test: exactly one of these keys, the kind of the test.",
        **{name: (kind.model | None, Field(default=None, examples=list(kind.examples))) for name, kind in kinds().items()},
    )
