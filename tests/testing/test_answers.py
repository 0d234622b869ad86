"""`thingc test`: output formats, selection of tests, and errors for invalid tests."""

from __future__ import annotations

import json
import re
from pathlib import Path
from xml.etree import ElementTree

import pytest
from junitparser import Failure, JUnitXml

from testing.rig import Workspace, two_links

MIXED = (
    "  weight: {mass: {max: =2 * 30 g}}\n"
    "  holds_one: {torque_margin: {drive: '*', min: 1, pose: level}}\n"
    "  holds_two: {torque_margin: {drive: elbow, min: 1000}}\n"
)


def test_text_output_has_a_line_per_test_and_failures(rig: Workspace) -> None:
    document = rig.write(two_links(), MIXED)
    code, out, _ = rig.run(str(document))
    lines = out.splitlines()
    assert code == 1 and lines[-1] == "3 tests: 1 passed, 2 failed"
    assert [line.split()[:2] for line in lines[:3]] == [["FAILED", "weight"], ["passed", "holds_one"], ["FAILED", "holds_two"]]
    assert all(re.search(r"  \d+\.\d\d s$", line) for line in lines[:3])
    at = document.read_text().splitlines().index("  weight: {mass: {max: =2 * 30 g}}") + 1
    assert f"rig.yaml:{at}:24" in out and "the mass (64 g) exceeds the maximum (60 g)" in out


def test_only_and_mode_select_tests(rig: Workspace) -> None:
    document = str(rig.write(two_links() + "  hung: {root: ground.far_hinge, base: held}\n", MIXED))
    for words, names in ((["--only", "weight"], {"weight"}), (["--only", "holds_*"], {"holds_one", "holds_two"}),
                         (["--mode", "hung"], {"weight"}), (["--mode", "bench"], {"weight", "holds_one", "holds_two"})):
        answer = json.loads(rig.run(document, "--format", "json", *words)[1])
        assert {result["name"] for result in answer["tests"]} == names
    code, out, _ = rig.run(document, "--mode", "hung", "--only", "holds_*")
    assert code == 0 and out.endswith("rig.yaml: no tests in the selected modes\n")
    code, out, _ = rig.run(document, "--only", "wieght")
    assert code == 2 and "has no test `wieght`" in out and "did you mean `weight`?" in out
    assert rig.run(document, "--mode", "bnch")[0] == 2


def test_bounds_can_use_parameters(rig: Workspace) -> None:
    text = two_links().replace("components:", "parameters: {budget: 70 g}\ncomponents:", 1)
    document = str(rig.write(text, "  weight: {mass: {max: =budget}}\n"))
    assert rig.run(document)[0] == 0
    assert rig.run(document, "-p", "budget=60 g")[0] == 1


def test_json_output(rig: Workspace) -> None:
    answer = rig.test(two_links(), MIXED)
    assert set(answer) - {"code", "by_name"} == {"diagnostics", "tests"}
    for result in answer["tests"]:
        assert set(result) == {"name", "kind", "mode", "pose", "passed", "measured", "expected", "said", "seconds"}
    two = answer["by_name"]["holds_two"]
    assert two["mode"] == "bench" and two["pose"] == "level" and two["expected"] == {"min": 1000} and two["kind"] == "torque_margin"
    assert answer["by_name"]["weight"]["expected"] == {"max": pytest.approx(0.06)} and answer["by_name"]["weight"]["mode"] is None


def test_junit_output_is_read_by_junitparser(rig: Workspace, tmp_path: Path) -> None:
    document = rig.write(two_links(), MIXED)
    code, out, err = rig.run(str(document), "--format", "junit")
    assert code == 1 and err == ""
    file = tmp_path / "report.xml"
    file.write_text(out)
    (suite,) = list(JUnitXml.fromfile(str(file)))
    assert (suite.name, suite.tests, suite.failures, suite.errors) == ("rig", 3, 2, 0)
    cases = list(suite)
    assert [case.name for case in cases] == ["weight", "holds_one [bench, level]", "holds_two [bench, level]"]
    assert [[type(result) for result in case.result] for case in cases] == [[Failure], [], [Failure]]
    failure = cases[0].result[0]
    assert failure.type == "TC651" and "exceeds the maximum (60 g)" in failure.message and "max: =2 * 30 g" in failure.text
    assert all(case.time is not None and case.time >= 0 for case in cases)


def test_junit_reports_document_errors(rig: Workspace) -> None:
    document = rig.write(two_links(), "  weight: {mass: {max: 60 mm}}\n")
    code, out, _ = rig.run(str(document), "--format", "junit")
    suite = ElementTree.fromstring(out)[0]
    assert code == 1 and suite.get("errors") == "1" and suite.find("testcase/error") is not None


def test_document_without_tests_is_reported(rig: Workspace) -> None:
    code, out, _ = rig.run(str(rig.write(two_links())))
    assert code == 0 and out.endswith("rig.yaml: no tests\n")


def test_tests_of_nested_documents_are_not_run(rig: Workspace) -> None:
    inner = rig.write(two_links(), "  light: {mass: {max: 1 g}}\n", name="inner.yaml")
    outer = rig.write(
        "thingc: assembly/1\nname: outer\ncomponents:\n  pair: {assembly: inner.yaml}\n", "  weight: {mass: {of: pair.lower, max: 30 g}}\n",
        name="outer.yaml",
    )
    assert rig.run(str(outer))[0] == 0 and rig.run(str(inner))[0] == 1


def test_modes_and_poses_are_selected_by_patterns(rig: Workspace) -> None:
    text = two_links().replace("poses:\n", "poses:\n  a_one: {}\n  a_two: {}\n")
    text += "  hung: {root: ground.far_hinge, base: held, poses: [a_two]}\n"
    answer = rig.test(text, "  some: {centre: {mode: all, pose: 'a_*', within: {x: [-1 m, 1 m]}}}\n"
                            "  every: {centre: {mode: hung, pose: all, within: {x: [-1 m, 1 m]}}}\n"
                            "  start: {centre: {mode: hung, within: {x: [-1 m, 1 m]}}}\n")
    ran = [(result["name"], result["mode"], result["pose"]) for result in answer["tests"]]
    assert ran == [("some", mode, pose) for mode in ("bench", "hung") for pose in ("a_one", "a_two")] + [
        ("every", "hung", "a_two"), ("start", "hung", None),
    ]


def test_results_are_deterministic(rig: Workspace) -> None:
    tests = MIXED + "  far: {reach: {of: tip, from: base, min: 1 mm}}\n  there: {point: {mount: tip, at: 60 0 -70 mm, within: 1 um}}\n"
    first, second = (rig.test(two_links(), tests) for _ in range(2))
    for one, other in zip(first["tests"], second["tests"], strict=True):
        assert {**one, "seconds": 0} == {**other, "seconds": 0}
