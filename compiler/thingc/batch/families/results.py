"""The results of a family for given settings."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from thingc.base.diagnostics import Diagnostic, Severity
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.one_line_repr import OneLineRepr
from thingc.base.suggestions import did_you_mean
from thingc.batch.results import UnknownVariant
from thingc.driver.testing.results import Result as TestResult


class Evaluated(OneLineRepr, FrozenStruct):
    """The results for one set of settings.

    `results` are as in the table of a batch, in SI units: `mass`, `centre.x`, `reach`, `length.elbow`, `torque_margin`. For refused
    settings, `results` is empty. `problems` are all diagnostics, including warnings. `broken` is the violated rule of the variants
    document, if any. `tests` are the results of the tests in the assembly document, if requested.
    """

    settings: Mapping[str, Any]
    results: Mapping[str, float | None]
    problems: tuple[Diagnostic, ...] = ()
    broken: str | None = None
    tests: tuple[TestResult, ...] = ()

    @property
    def sound(self) -> bool:
        """Whether the settings are valid, so that the results have no errors."""
        return not any(one.severity is Severity.ERROR for one in self.problems)

    @property
    def kept(self) -> bool:
        """Whether there are no errors, all rules are satisfied, and all requested tests have passed."""
        return self.sound and self.broken is None and all(one.passed for one in self.tests)

    def __getitem__(self, name: str) -> float | None:
        """Return a result by name. If the result does not exist, raises `UnknownVariant`, a `KeyError`, with the reason."""
        if name in self.results:
            return self.results[name]
        refused = next((one.message for one in self.problems if one.severity is Severity.ERROR), None)
        if refused is not None and not self.results:
            raise UnknownVariant(f"there is no `{name}`: the settings {dict(self.settings)} are rejected: {refused}")
        raise UnknownVariant(f"there is no result `{name}`", did_you_mean(str(name), self.results, what="results"))


class NoModel(OneLineRepr, FrozenStruct):
    """The result for settings without a model. This object is false in a boolean context. `problems` are all diagnostics."""

    settings: Mapping[str, Any]
    problems: tuple[Diagnostic, ...]

    def __bool__(self) -> bool:
        return False

    @property
    def reason(self) -> str:
        """The messages of the errors because of which the settings have no model."""
        return "; ".join(dict.fromkeys(one.message for one in self.problems if one.severity is Severity.ERROR))

    def __repr__(self) -> str:
        return f"NoModel({dict(self.settings)}: {self.reason})"


class Explanation(OneLineRepr, FrozenStruct):
    """An explanation of how the models of a mode depend on a number.

    `way` is `arrays` (the number is written into arrays of a compiled model, `fields`), `text` (the number is written into the XML of a
    model, which MuJoCo recompiles), `parts` (as `text`, with other parts) or `passes` (all passes run). `why` is the reason why no faster
    way is possible.
    """

    name: str
    mode: str
    way: str
    fields: tuple[str, ...] = ()
    why: str = ""

    def __str__(self) -> str:
        how = {
            "arrays": f"is written into {', '.join(self.fields) or 'nothing'} of one compiled model",
            "text": "is written into the text of one model, which MuJoCo compiles again",
            "parts": "is written into the text of one model with other parts, which MuJoCo compiles again",
            "passes": "is compiled again",
        }[self.way]
        return f"{self.name} {how}{': ' + self.why if self.why else ''} (mode {self.mode})"
