"""The results of document tests."""

from __future__ import annotations

from thingc.base.diagnostics import Diagnostic
from thingc.base.frozen_struct import FrozenStruct
from thingc.driver.testing.outcomes import Outcome


class Result(FrozenStruct):
    """The result of a single run of a test, with the duration of the run [s]. A failed run also has a diagnostic."""

    name: str
    kind: str
    mode: str | None
    pose: str | None
    outcome: Outcome
    seconds: float
    diagnostic: Diagnostic | None = None

    @property
    def passed(self) -> bool:
        """Whether the test passed."""
        return self.outcome.failure is None

    @property
    def where(self) -> str:
        """The mode and the pose in which the test ran, such as `bench, home`.

        The result is an empty string for a test that does not depend on the mode and the pose.
        """
        return ", ".join(name for name in (self.mode, self.pose) if name is not None)
