"""The results of a robot for one set of settings, and the reasons why settings have no model."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from thingc.base.diagnostics import Diagnostic, Severity
from thingc.base.one_line_repr import OneLineStruct
from thingc.batch.results import UnknownVariant, require_known
from thingc.driver.testing.outcomes import Result as TestResult


class Evaluated(OneLineStruct):
    """The results of a robot for one set of settings.

    `results` maps names of results, such as `mass`, `centre.x`, `reach`, `length.elbow` or `torque_margin`, to values in SI units, as in
    the table of a batch. `results` is empty for refused settings. `problems` contains all diagnostics, including warnings. `broken` is the
    rule of the variants document that the results violate, or None. `tests` contains the results of document tests, if these tests were
    requested.
    """

    settings: Mapping[str, Any]
    results: Mapping[str, float | None]
    problems: tuple[Diagnostic, ...] = ()
    broken: str | None = None
    tests: tuple[TestResult, ...] = ()

    @property
    def sound(self) -> bool:
        """True if the settings are valid, which means that there are no errors."""
        return not any(problem.severity is Severity.ERROR for problem in self.problems)

    @property
    def kept(self) -> bool:
        """True if there are no errors, all rules are satisfied, and all requested tests have passed."""
        return self.sound and self.broken is None and all(test.passed for test in self.tests)

    def __getitem__(self, name: str) -> float | None:
        """Return the result with this name in SI units.

        If the result does not exist, raises `UnknownVariant` (a `KeyError`) with the reason in the message.
        """
        errors = () if self.results else [problem.message for problem in self.problems if problem.severity is Severity.ERROR]
        if errors:
            raise UnknownVariant(f"result `{name}` does not exist for the rejected settings {dict(self.settings)}: {errors[0]}")
        require_known(name, self.results, f"there is no result `{name}`", what="results")
        return self.results[name]


class NoModel(OneLineStruct):
    """The result for settings that have no MuJoCo model.

    A `NoModel` object is false in a boolean context. `problems` contains all diagnostics for the settings.
    """

    settings: Mapping[str, Any]
    problems: tuple[Diagnostic, ...]

    def __bool__(self) -> bool:
        return False

    @property
    def reason(self) -> str:
        """The error messages that explain why the settings do not have a model, as one string."""
        return "; ".join(dict.fromkeys(problem.message for problem in self.problems if problem.severity is Severity.ERROR))

    def __repr__(self) -> str:
        return f"NoModel({dict(self.settings)}: {self.reason})"


class Explanation(OneLineStruct):
    """Explains how the MuJoCo models of a mode depend on one number in the document.

    `way` is the method by which a model for another value of the number is computed. For the method `arrays`, the number is written into
    the arrays of a compiled model that `fields` lists. For the method `text`, the number is written into the XML of the model, which MuJoCo
    recompiles. The method `parts` works like `text`, but also replaces parts. For the method `passes`, all compiler passes run. `why` is
    the reason why no faster method can be used.
    """

    name: str
    mode: str
    way: str
    fields: tuple[str, ...] = ()
    why: str = ""

    def __str__(self) -> str:
        description = {
            "arrays": f"changes {', '.join(self.fields) or 'nothing'} of one compiled model",
            "text": "changes the text of one model, which MuJoCo compiles again",
            "parts": "changes the text and the parts of one model, which MuJoCo compiles again",
            "passes": "is compiled again",
        }[self.way]
        return f"{self.name} {description}{': ' + self.why if self.why else ''} (mode {self.mode})"
