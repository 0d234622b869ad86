"""What a family says of settings."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from thingc.base.diagnostics import Diagnostic, Severity
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.one_line_repr import OneLineRepr
from thingc.base.suggestions import did_you_mean
from thingc.batch.results import UnknownVariant

if TYPE_CHECKING:
    from thingc.driver.testing.results import Result as TestResult


class Evaluated(OneLineRepr, FrozenStruct):
    """What is worked out of one variant. `results` as in the table of a batch, SI: `mass`, `centre.x`, `reach`, `length.elbow`,
    `torque_margin`; empty where the settings are refused. `problems` are all diagnostics, warnings too. `broken` is the rule of the
    document of variants that is not kept (None: all are). `tests` are those of the assembly's document, where they were asked for."""

    settings: Mapping[str, Any]
    results: Mapping[str, float | None]
    problems: tuple[Diagnostic, ...] = ()
    broken: str | None = None
    tests: tuple[TestResult, ...] = ()

    @property
    def sound(self) -> bool:
        """Whether nothing is wrong with it: no error."""
        return not any(one.severity is Severity.ERROR for one in self.problems)

    @property
    def kept(self) -> bool:
        """Whether it is sound, keeps every rule, and passes every test that was asked for."""
        return self.sound and self.broken is None and all(one.passed for one in self.tests)

    def __getitem__(self, name: str) -> float | None:
        """A result by its name. Raises `UnknownVariant`, a `KeyError`, for one that it has not, with the reason where it has none."""
        if name in self.results:
            return self.results[name]
        refused = next((one.message for one in self.problems if one.severity is Severity.ERROR), None)
        if refused is not None and not self.results:
            raise UnknownVariant(f"there is no `{name}`: the settings {dict(self.settings)} are refused: {refused}")
        raise UnknownVariant(f"there is no result `{name}`: {did_you_mean(str(name), self.results, what='results')}")


class NoModel(OneLineRepr, FrozenStruct):
    """Settings of which there is no model, and why: `problems` are all diagnostics. It is false where a model is true."""

    settings: Mapping[str, Any]
    problems: tuple[Diagnostic, ...]

    def __bool__(self) -> bool:
        return False

    @property
    def reason(self) -> str:
        """The messages of the errors."""
        return "; ".join(dict.fromkeys(one.message for one in self.problems if one.severity is Severity.ERROR))

    def __repr__(self) -> str:
        return f"NoModel({dict(self.settings)}: {self.reason})"


class Explanation(OneLineRepr, FrozenStruct):
    """How a number goes into the models of a mode: `way` is `arrays` (into the arrays of one compiled model, `fields`), `text` (into the
    text of one model, which MuJoCo compiles anew), `parts` (the same, with the meshes and numbers of other parts) or `passes` (everything
    is compiled anew); `why` says in words why it is not the quicker one."""

    name: str
    mode: str
    way: str
    fields: tuple[str, ...] = ()
    why: str = ""

    def __str__(self) -> str:
        how = {
            "arrays": f"is written into {', '.join(self.fields) or 'nothing'} of one compiled model",
            "text": "is written into the text of one model, which MuJoCo compiles anew",
            "parts": "is written into the text of one model with other parts, which MuJoCo compiles anew",
            "passes": "is compiled anew",
        }[self.way]
        return f"{self.name} {how}{': ' + self.why if self.why else ''} (mode {self.mode})"
