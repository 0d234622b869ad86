"""Cases of tests, and what running them comes to."""

from __future__ import annotations

from collections.abc import Collection

from thingc.base.diagnostics import Diagnostic
from thingc.base.frozen import dataclass
from thingc.driver.testing.outcome import Outcome
from thingc.model.assembly.types import LinkedTest
from thingc.model.resolve.types import Reference
from thingc.model.robot.types import Keyframe, Robot
from thingc.targets.request import EmitRequest


@dataclass(frozen=True, slots=True, kw_only=True)
class TestCase:
    """A test to be run once: `robot` in a mode, with keyframes for the poses that the test looks at in this case (`frames`), of which
    `missing` could not be closed. A test that is of no mode has the first mode's robot and no frames."""

    linked: LinkedTest
    robot: Robot
    request: EmitRequest
    frames: tuple[Keyframe, ...] = ()
    missing: int = 0

    def components(self, references: Collection[Reference]) -> list[int]:
        """The occurrences that components named hold, in order; all where none is named."""
        if not references:
            return list(range(len(self.robot.assembly.occurrences)))
        return sorted({index for reference in references for index in self.linked.components[reference]})


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """A case that was run, the time that it took [s], and what was said of it where it failed."""

    name: str
    kind: str
    mode: str | None
    pose: str | None
    outcome: Outcome
    seconds: float
    diagnostic: Diagnostic | None = None

    @property
    def passed(self) -> bool:
        """Whether the test holds."""
        return self.outcome.failure is None

    @property
    def where(self) -> str:
        """`bench, home`: the mode and the pose, as far as there are any."""
        return ", ".join(word for word in (self.mode, self.pose) if word is not None)
