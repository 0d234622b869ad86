"""Cases of tests, and what running them comes to."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from xml.etree import ElementTree

from thingc.base.diagnostic_output import as_text
from thingc.base.diagnostics import Diagnostic
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.safe_text import escape_control
from thingc.driver.testing.outcome import Outcome
from thingc.model.assembly.types import LinkedTest
from thingc.model.resolve.types import Reference
from thingc.model.robot.types import Keyframe, Robot
from thingc.targets.request import EmitRequest


class TestCase(FrozenStruct):
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


class Result(FrozenStruct):
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


def as_junit(name: str, results: Sequence[Result], others: Sequence[Diagnostic]) -> str:
    """One suite, called like the robot, with a case for each test, mode and pose.

    The text of a failure is its diagnostic as the command line shows it. `others` are the errors that are the failure
    of no test, such as those that have kept the tests from running: together they are one error of the suite.
    """
    root = ElementTree.Element("testsuites")
    suite = ElementTree.SubElement(root, "testsuite", {
        "name": name, "tests": str(len(results) + bool(others)), "failures": str(sum(1 for r in results if not r.passed)),
        "errors": str(int(bool(others))), "skipped": "0", "time": f"{sum(r.seconds for r in results):.3f}",
    })
    if others:
        case = ElementTree.SubElement(suite, "testcase", {"name": "document", "classname": name, "time": "0.000"})
        _said(ElementTree.SubElement(case, "error"), others)
    for result in results:
        words = f"{result.name} [{result.where}]" if result.where else result.name
        case = ElementTree.SubElement(suite, "testcase", {
            "name": words, "classname": f"{name}.{result.kind}", "time": f"{result.seconds:.3f}",
        })
        if result.diagnostic is not None:
            _said(ElementTree.SubElement(case, "failure"), [result.diagnostic])
        ElementTree.SubElement(case, "system-out").text = escape_control(result.outcome.said)
    ElementTree.indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ElementTree.tostring(root, encoding="unicode")}\n'


def _said(element: ElementTree.Element, diagnostics: Sequence[Diagnostic]) -> None:
    element.set("message", escape_control(diagnostics[0].message))
    element.set("type", diagnostics[0].code.code)
    element.text = as_text(diagnostics)
