"""Measure the mass of a robot or of its components, for document tests of the kind `mass`."""

from __future__ import annotations

from thingc.base.diagnostics import Code
from thingc.base.numeric import sum_of
from thingc.base.units import MASS
from thingc.documents.checks.mass import KIND, MassCheck
from thingc.driver.testing.outcomes import Outcome, TestCase, TestMeasurement, check_bounds


def measure(case: TestCase, check: MassCheck) -> Outcome:
    """Measure the total mass [kg] of the tested components."""
    occurrences = case.robot.assembly.occurrences
    value = sum_of(occurrences[index].properties.mass for index in case.components(check.of))
    return check_bounds("mass", "the mass", value, check.minimum, check.maximum, MASS, Code.TEST_MASS)


MEASUREMENT = TestMeasurement(kind=KIND, measure=measure)
