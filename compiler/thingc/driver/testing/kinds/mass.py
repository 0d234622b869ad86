"""Run `mass` tests; see `thingc.documents.checks.mass` for their specification."""

from __future__ import annotations

from thingc.base.diagnostics import Code
from thingc.base.numeric import sum_of
from thingc.base.units import MASS
from thingc.documents.checks.mass import MassCheck
from thingc.driver.testing.kinds import CheckRunner
from thingc.driver.testing.results import Outcome, TestCase, check_bounds


def measure(case: TestCase, check: MassCheck) -> Outcome:
    """Measure the sum of the masses [kg]."""
    occurrences = case.robot.assembly.occurrences
    value = sum_of(occurrences[index].properties.mass for index in case.components(check.of))
    return check_bounds("mass", "the mass", value, check.minimum, check.maximum, MASS, Code.TEST_MASS)


RUNNER = CheckRunner(measure=measure)
