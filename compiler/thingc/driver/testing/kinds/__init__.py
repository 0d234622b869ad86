"""The measurements of document tests. Each module measures one kind of test, which `documents/checks/` defines."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from thingc.driver.testing.outcomes import TestMeasurement


def measurement_of(kind: str) -> TestMeasurement[Any]:
    """Import the module that measures the given kind of document test, such as `reach`, and return its measurement."""
    found: TestMeasurement[Any] = import_module(f"{__name__}.{kind}").MEASUREMENT
    return found
