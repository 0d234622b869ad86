"""The modules that measure document tests.

Each module measures one type of test, which a module with the same name in `documents/checks/` defines.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

from thingc.driver.testing.outcomes import TestMeasurement


def measurement_of(kind: str) -> TestMeasurement[Any]:
    """Import the module that measures a type of document test, such as `reach`, and return its `TestMeasurement`."""
    measurement: TestMeasurement[Any] = import_module(f"{__name__}.{kind}").MEASUREMENT
    return measurement
