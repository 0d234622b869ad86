"""The results of document tests, and a report of the results in the JUnit format."""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree import ElementTree

from thingc.base.diagnostic_output import as_text
from thingc.base.diagnostics import Diagnostic
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.safe_text import escape_control
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
        return ", ".join(word for word in (self.mode, self.pose) if word is not None)


def as_junit(name: str, results: Sequence[Result], others: Sequence[Diagnostic]) -> str:
    """Create a JUnit report in XML format.

    The report contains one suite with the name of the robot, and a test case for each combination of test, mode and pose. The text of a
    failed test case is the diagnostic that the command line prints. `others` contains errors that do not belong to a test, such as errors
    that prevented the tests from running. The errors in `others` are combined into a single error of the suite.
    """
    root = ElementTree.Element("testsuites")
    suite = ElementTree.SubElement(root, "testsuite", {
        "name": name, "tests": str(len(results) + bool(others)), "failures": str(sum(1 for r in results if not r.passed)),
        "errors": str(int(bool(others))), "skipped": "0", "time": f"{sum(r.seconds for r in results):.3f}",
    })
    if others:
        case = ElementTree.SubElement(suite, "testcase", {"name": "document", "classname": name, "time": "0.000"})
        _add_diagnostics(ElementTree.SubElement(case, "error"), others)
    for result in results:
        words = f"{result.name} [{result.where}]" if result.where else result.name
        case = ElementTree.SubElement(suite, "testcase", {
            "name": words, "classname": f"{name}.{result.kind}", "time": f"{result.seconds:.3f}",
        })
        if result.diagnostic is not None:
            _add_diagnostics(ElementTree.SubElement(case, "failure"), [result.diagnostic])
        ElementTree.SubElement(case, "system-out").text = escape_control(result.outcome.said)
    ElementTree.indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ElementTree.tostring(root, encoding="unicode")}\n'


def _add_diagnostics(element: ElementTree.Element, diagnostics: Sequence[Diagnostic]) -> None:
    element.set("message", escape_control(diagnostics[0].message))
    element.set("type", diagnostics[0].code.code)
    element.text = as_text(diagnostics)
