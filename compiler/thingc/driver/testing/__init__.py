"""Running the tests that a document states of its robot: `thingc test`."""

from __future__ import annotations

from thingc.driver.testing.outcome import Outcome
from thingc.driver.testing.results import Result
from thingc.driver.testing.running import Selection, run

__all__ = ["Outcome", "Result", "Selection", "run"]
