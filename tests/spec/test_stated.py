"""Values of an assembly at paths that can be set or chosen."""

from __future__ import annotations

from pathlib import Path

from thingc.base.diagnostics import Report
from thingc.base.units import LENGTH, MASS, NUMBER, Quantity
from thingc.documents.expressions.terms import Expression
from thingc.documents.load.documents import Documents, load
from thingc.documents.spec.assembly import AssemblySpec
from thingc.documents.spec.settable_values import current_choices, current_value
from thingc.documents.spec.validation import validate
from thingc.documents.workspace import Workspace

ROBOT = """
thingc: assembly/1
name: robot
defaults: {component: {material: PLA}}
parameters: {reach: 120 mm}
components:
  plate: {part: "arm:Plate", mass: 82 g, at: {in: world.origin, xyz: 0 0 10 mm}}
  leg: {assembly: leg.yaml, material: PETG}
joints:
  hip: {limit: {upper: =reach / 2}, dynamics: {damping: 0.5}}
"""
LEG = """
thingc: assembly/1
name: leg
components:
  foot: {part: "feet:Wide", mass: =weight}
  shin: {part: "feet:Shin", at: {xyz: 0 0 1 m}}
joints:
  knee: {limit: {upper: 30 mm}, label: a text}
"""


def documents(folder: Path) -> Documents:
    (folder / "robot.yaml").write_text(ROBOT)
    (folder / "leg.yaml").write_text(LEG)
    workspace = Workspace.find(str(folder / "robot.yaml"), Report())
    assert workspace is not None
    found = load(str(folder / "robot.yaml"), workspace, Report())
    assert found is not None
    return found


def test_values_are_found_in_nested_documents(tmp_path: Path) -> None:
    found = documents(tmp_path)
    assert current_value(found, "components.plate.mass") == Quantity(0.082, MASS)
    assert current_value(found, "joints.hip.dynamics.damping") == Quantity(0.5, NUMBER)
    assert current_value(found, "components.leg.joints.knee.limit.upper") == Quantity(0.03, LENGTH)
    assert current_value(found, "components.leg.joints.knee.label") == "a text"
    assert current_value(found, "components.leg.components.shin.at.xyz") == "0 0 1 m"  # no value by itself
    own = current_value(found, "joints.hip.limit.upper")
    assert isinstance(own, Expression) and own.text == "=reach / 2"


def test_missing_values_are_none(tmp_path: Path) -> None:
    found = documents(tmp_path)
    for path in ("joints.hip.limit.lower", "joints.hip.limit", "components.plate.joints.knee.limit.upper", "joints.elbow.limit.upper"):
        assert current_value(found, path) is None
    assert current_value(found, "components.leg.components.foot.mass") is None  # its parameters are not those of the root


def test_choices_include_only_own_components(tmp_path: Path) -> None:
    spec = validate(documents(tmp_path), Report())["robot.yaml"]
    assert isinstance(spec, AssemblySpec)
    assert current_choices(spec) == {
        "defaults.component.material": "PLA", "components.plate.part": "arm:Plate",
        "components.leg.assembly": "leg.yaml", "components.leg.material": "PETG",
    }
