"""The measurements of document tests, with one module for each kind in `documents/checks/`."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from thingc.driver.testing.outcomes import TestMeasurement


def measurement_of(kind: str) -> TestMeasurement[Any]:
    """Import and return the measurement of a kind of test."""
    found: TestMeasurement[Any] = import_module(f"{__name__}.{kind}").MEASUREMENT
    return found
