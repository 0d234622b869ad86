"""Parameters: expressions in any order, values set by a parent and on the command line, canonical values and texts."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from hypothesis import given, settings, strategies as st

from resolve.resolving import Outcome, run
from thingc.base.diagnostics import Code, Report
from thingc.base.units import LENGTH, Quantity
from thingc.documents.load.documents import load
from thingc.documents.spec.validation import validate
from thingc.documents.workspace import Workspace
from thingc.model.resolve.parameters import AssemblyParameters
from thingc.model.resolve.types import AssemblyDefinition

DOCUMENT = """
thingc: assembly/1
name: arm
parameters:
  third: =half * 2 / 3
  reach: {value: 100 mm, min: 60 mm, max: 200 mm}
  half: =reach / 2
  tilt: 30 deg
  legs: 6
  open: false
  label: plain
components:
  plate: {part: "arm:Plate"}
"""


def values(outcome: Outcome) -> dict[str, object]:
    assert outcome.model is not None
    return dict(outcome.model.parameters)


def test_values_are_si_and_expressions_need_no_order(tmp_path: Path) -> None:
    outcome = run(tmp_path, DOCUMENT)
    assert outcome.good.text == "arm"
    found = values(outcome)
    assert list(found) == sorted(found)
    assert found == {
        "half": 0.05, "label": "plain", "legs": 6, "open": False, "reach": 0.1, "third": 0.05 * 2 / 3,
        "tilt": pytest.approx(math.pi / 6),
    }
    assert type(found["legs"]) is int


def test_command_line_values_are_parsed_as_in_documents(tmp_path: Path) -> None:
    options = {"reach": "120 mm", "open": "true", "label": "5 apples", "legs": "8", "tilt": "=2 * 20 deg"}
    outcome = run(tmp_path, DOCUMENT, options)
    assert outcome.said == []
    found = values(outcome)
    assert found["reach"] == 0.12 and found["half"] == 0.06 and found["third"] == 0.06 * 2 / 3
    assert found["open"] is True and found["label"] == "5 apples" and found["legs"] == 8
    assert found["tilt"] == pytest.approx(math.radians(40), rel=1e-15)
    assert outcome.good.text == (
        "arm(half=0.06, label='5 apples', legs=8, open=True, reach=0.12, third=0.04, tilt=0.6981317007977318)"
    )
    assert outcome.good.label == "arm(half=60 mm, label='5 apples', legs=8, open=true, reach=120 mm, third=40 mm, tilt=40 deg)"


def test_command_line_expressions_may_use_parameters(tmp_path: Path) -> None:
    assert values(run(tmp_path, DOCUMENT, {"half": "=reach / 4", "reach": "80 mm"}))["half"] == 0.02


@pytest.mark.parametrize(("option", "text", "said"), [
    ("reech", "1 mm", "TC803 (-p reech) `arm` has no parameter `reech` | did you mean `reach`?"),
    ("reach", "1 mm", "TC803 (-p reach) parameter `reach` must be at least 60 mm, found `1 mm`"),
    ("reach", "0", "TC803 (-p reach) parameter `reach` must be at least 60 mm, found `0`"),  # 0 has every unit
    ("reach", "=half * 5", "TC803 (-p reach) parameters depend on each other in a cycle: `reach` -> `half` -> `reach`"
     " | give one of these parameters a value that does not depend on the others"),
    ("reach", "=tilt", "TC803 (-p reach) parameter `reach` of `arm` must be a length (such as 120 mm), found an angle (`30 deg`)"),
    ("reach", "=reech", "TC803 (-p reach) unknown name `reech` in `=reech` | did you mean `reach`?"),
    ("reach", "120", "TC803 (-p reach) parameter `reach` of `arm` must be a length (such as 120 mm), found a number (`120`)"
     " | write `120 mm`"),
    ("reach", "30 deg", "TC803 (-p reach) parameter `reach` of `arm` must be a length (such as 120 mm), found an angle (`30 deg`)"),
    ("reach", "120 mmm", "TC803 (-p reach) parameter `reach`: unknown unit `mmm`; did you mean `mm`?"),
    ("reach", "true", "TC803 (-p reach) parameter `reach` of `arm` must be a length (such as 120 mm), found a boolean (`true`)"),
    ("open", "5 mm", "TC803 (-p open) parameter `open` of `arm` must be `true` or `false`, found a length (`5 mm`)"),
])
def test_invalid_option_is_named(tmp_path: Path, option: str, text: str, said: str) -> None:
    outcome = run(tmp_path, DOCUMENT, {option: text})
    # Notes (where the parameter is declared) are told apart in `wrong_documents.txt`.
    assert [line for line in outcome.said if line[0] != "+"] == [said]
    assert outcome.report.diagnostics[0].span is None
    assert values(outcome)["reach"] == 0.1


NESTED = {
    "arm.yaml": """
        thingc: assembly/1
        name: arm
        parameters: {d: 20 mm, far: =d * 2}
        components:
          plate: {part: "arm:Plate"}
          one: {assembly: hand.yaml, parameters: {pen: =d}, attach: {tip: plate.a}}
          two: {assembly: hand.yaml, parameters: {pen: 2 cm}, attach: {tip: plate.b}}
          three: {assembly: hand.yaml, attach: {tip: plate.c}}
          four: {assembly: hand.yaml, parameters: {pen: =far - 25 mm}, attach: {tip: plate.d}}
        """,
    "hand.yaml": """
        thingc: assembly/1
        name: end_effector
        parameters: {pen: 15 mm, wall: =pen / 5}
        components:
          cap: {part: "arm:Brace", params: {length: =pen + wall}}
        mounts: {tip: cap.tip}
        """,
}


def test_equal_nested_definitions_are_one_object(tmp_path: Path) -> None:
    outcome = run(tmp_path, NESTED)
    assert outcome.said == []
    one, two, three, four = (outcome.component(name).definition for name in ("one", "two", "three", "four"))
    assert isinstance(one, AssemblyDefinition) and one is two and three is four and one is not three
    assert one.text == "end_effector(pen=0.02, wall=0.004)"
    assert isinstance(three, AssemblyDefinition) and three.text == "end_effector"
    assert three.parameters == (("pen", 0.015), ("wall", 0.003))
    cap = one.components[0].definition
    assert cap is not None and cap.text == "arm:Brace(length=0.024)"


def test_option_reaches_nested_documents(tmp_path: Path) -> None:
    outcome = run(tmp_path, NESTED, {"d": "10 mm"})
    four = outcome.component("four").definition
    assert four is None or isinstance(four, AssemblyDefinition)
    assert four is not None and dict(four.parameters)["pen"] == pytest.approx(-0.005)


def test_long_chain_of_parameters_does_not_recurse(tmp_path: Path) -> None:
    lines = "".join(f"  p{k}: =p{k + 1} + 1 mm\n" for k in range(3000)) + "  p3000: 0 mm\n"
    text = f"thingc: assembly/1\nname: arm\nparameters:\n{lines}components:\n  plate: {{part: \"arm:Plate\"}}\n"
    assert values(run(tmp_path, text))["p0"] == pytest.approx(3.0, rel=1e-12)


@settings(max_examples=15)
@given(st.permutations(range(8)), st.lists(st.integers(1, 9), min_size=8, max_size=8))
def test_parameter_order_does_not_matter(
    tmp_path_factory: pytest.TempPathFactory, order: list[int], factors: list[int],
) -> None:
    expected = {f"p{k}": sum(factors[: k + 1]) for k in range(8)}
    lines = "".join(f"  p{k}: {factors[k]}\n" if k == 0 else f"  p{k}: =p{k - 1} + {factors[k]}\n" for k in order)
    text = f"thingc: assembly/1\nname: arm\nparameters:\n{lines}components:\n  plate: {{part: \"arm:Plate\"}}\n"
    assert values(run(tmp_path_factory.mktemp("order"), text)) == expected


def test_parameters_can_be_queried_by_other_code(tmp_path: Path) -> None:
    """Values are validated as for `-p`; no diagnostics of the document itself are reported."""
    path = tmp_path / "arm.yaml"
    path.write_text(DOCUMENT + "  unknown: 1\n")
    workspace = Workspace.find(str(path), Report())
    assert workspace is not None
    documents = load(str(path), workspace, Report())
    assert documents is not None
    parameters = AssemblyParameters(documents, validate(documents, Report()), workspace)
    said: list[tuple[str, Code, str]] = []

    def complain(name: str, code: Code, message: str, **_: object) -> None:
        said.append((name, code, message))

    assert parameters.name == "arm" and parameters.values["half"] == Quantity(0.05, LENGTH)
    assert parameters.check_value("reach", Quantity(0.06, LENGTH), complain) == Quantity(0.06, LENGTH) and not said
    assert parameters.check_value("reach", Quantity(0.05, LENGTH), complain) is None
    assert parameters.check_value("open", "wide", complain) is None
    assert parameters.check_value("reech", Quantity(0.06, LENGTH), complain) is None
    assert said == [
        ("reach", Code.OUT_OF_RANGE, "parameter `reach` must be at least 60 mm, found `50 mm`"),
        ("open", Code.VALUE_KIND, "parameter `open` of `arm` must be `true` or `false`, found a string (`wide`)"),
        ("reech", Code.UNKNOWN_PARAMETER, "`arm` has no parameter `reech`"),
    ]
