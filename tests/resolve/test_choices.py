"""Choices (`--set components.foot.part=feet:Wide`): the values that they replace, and which robots become distinct because of them."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path

import pytest

import thingc
from conformance.harness import thingc_here
from thingc.base.diagnostics import Code
from thingc.documents.spec.settable_values import ChoicePath, parse
from thingc.driver import pipeline
from thingc.driver.environment import Environment, Options
from thingc.driver.pipeline import Compilation
from variants.robots import PENDULUM, workspace

FAMILY = """
    thingc: assembly/1
    name: family
    materials:
      light: {density: 500 kg/m^3}
      heavy: {density: 5000 kg/m^3}
    defaults: {component: {material: light}}
    components:
      plate: {part: plates:Square, material: light}
      left: {assembly: mast.yaml, attach: {foot: plate.top}}
      right: {assembly: mast.yaml, at: {in: plate.origin, xyz: 90 0 0 mm}}
      row:
        repeat: {count: 3}
        part: plates:Round
        at: {in: plate.origin, xyz: [=i * 50 mm + 100 mm, 100 mm, 0]}
"""
CUBE, DISC = 0.04**2 * 0.01, 3.141592653589793 * 0.02**2 * 0.01


def compiled(folder: Path, store: str, choices: dict[str, str]) -> Compilation:
    workspace(folder, family=FAMILY)
    with Environment(str(folder / "family.yaml"), Options(store=store, choices=choices)) as environment:
        return pipeline.compile(environment)


def parts(compilation: Compilation) -> dict[str, str]:
    assert compilation.assembly is not None, compilation.report.diagnostics
    return {one.path: one.definition.text for one in compilation.assembly.occurrences}


def masses(compilation: Compilation) -> dict[str, float]:
    assert compilation.assembly is not None, compilation.report.diagnostics
    return {one.path: one.properties.mass for one in compilation.assembly.occurrences}


@pytest.mark.parametrize(("path", "meant"), [
    ("components.foot.part", ChoicePath(components=("foot",), key="part")),
    ("components.leg.components.foot.material", ChoicePath(components=("leg", "foot"), key="material")),
    ("components.leg.defaults.component.material", ChoicePath(components=("leg",), key="defaults.component.material")),
    ("defaults.component.material", ChoicePath(components=(), key="defaults.component.material")),
    ("components.components.part", ChoicePath(components=("components",), key="part")),
    ("components.foot", None), ("part", None), ("components.foot.mass", None), ("components..part", None), ("", None),
    ("components.foot.params.length", None), ("components.a b.part", None), ("components.foot.part.x", None),
])
def test_choice_paths_are_parsed(path: str, meant: ChoicePath | None) -> None:
    assert parse(path) == meant


def test_choice_in_one_nested_assembly_does_not_affect_others(tmp_path: Path, shared_store: str) -> None:
    found = compiled(tmp_path, shared_store, {"components.left.components.upper.part": "plates:Square"})
    assert found.report.diagnostics == []
    assert parts(found)["left/upper"] == "plates:Square" and parts(found)["right/upper"] == "plates:Round"
    assert found.assembly is not None
    texts = {one.text for one in found.assembly.hag.definitions if one.kind == "assembly"}
    assert texts == {
        "family(components.left.components.upper.part='plates:Square')", "mast(components.upper.part='plates:Square')", "mast",
    }


def test_equal_choices_make_equal_definitions(tmp_path: Path, shared_store: str) -> None:
    found = compiled(tmp_path, shared_store, {f"components.{side}.components.upper.part": "plates:Square" for side in ("left", "right")})
    assert found.assembly is not None
    nested = [one.text for one in found.assembly.hag.definitions if one.text.startswith("mast")]
    assert nested == ["mast(components.upper.part='plates:Square')"]


def test_choice_equal_to_the_document_has_no_effect(tmp_path: Path, shared_store: str) -> None:
    plain = compiled(tmp_path, shared_store, {})
    chosen = compiled(tmp_path, shared_store, {
        "components.plate.part": "plates:Square", "components.left.assembly": "./mast.yaml", "defaults.component.material": "light",
    })
    assert plain.assembly is not None and chosen.assembly is not None
    assert chosen.assembly.definition.text == "family" and chosen.assembly.definition.parameters == plain.assembly.definition.parameters


def test_replaced_assembly_uses_its_own_documents(tmp_path: Path, shared_store: str) -> None:
    found = compiled(tmp_path, shared_store, {"components.right.assembly": "tall_mast.yaml"})
    assert "right/middle" in parts(found) and "left/middle" not in parts(found)
    assert found.documents is not None and "tall_mast.yaml" in found.documents.by_path


def test_materials_of_one_and_of_all_repeated_components(tmp_path: Path, shared_store: str) -> None:
    chosen = {"components.row_1.material": "heavy", "components.right.components.lower.material": "heavy"}
    found = masses(compiled(tmp_path, shared_store, chosen))
    assert found["row_0"] == pytest.approx(500 * DISC, rel=1e-9) and found["row_1"] == pytest.approx(5000 * DISC, rel=1e-9)
    assert found["right/lower"] == pytest.approx(5000 * CUBE, rel=1e-9) and found["left/lower"] == pytest.approx(500 * CUBE, rel=1e-9)
    found = masses(compiled(tmp_path, shared_store, {"components.row.material": "heavy"}))
    assert [found[f"row_{k}"] for k in range(3)] == pytest.approx([5000 * DISC] * 3, rel=1e-9)
    found = masses(compiled(tmp_path, shared_store, {"defaults.component.material": "heavy"}))
    assert found["row_2"] == pytest.approx(5000 * DISC, rel=1e-9) and found["plate"] == pytest.approx(500 * CUBE, rel=1e-9)
    assert found["left/upper"] == pytest.approx(500 * DISC, rel=1e-9)  # defaults are of one document


def test_all_invalid_choices_are_reported_at_once(tmp_path: Path, shared_store: str) -> None:
    found = compiled(tmp_path, shared_store, {
        "components.plat.part": "plates:Round", "components.plate.part": "plates:Rond", "components.left.material": "heavy",
        "components.left.components.uper.part": "plates:Round", "components.right.assembly": "family.yaml",
        "components.row.material": "havy", "components.row.assembly": "mast.yaml", "plate": "x",
    })
    said = [(one.path, one.code) for one in found.report.sorted_diagnostics()]
    assert {code for _, code in said} == {Code.CHOICE_OPTION}
    assert {path for path, _ in said} == {
        "--set components.plat.part", "--set components.plate.part", "--set components.left.material", "--set plate",
        "--set components.left.components.uper.part", "--set components.right.assembly", "--set components.row.material",
        "--set components.row.assembly",
    }


def test_missing_part_gets_a_hint_and_refused_part_does_not(tmp_path: Path, shared_store: str) -> None:
    choices = {"components.plate.part": "plates:Squar", "components.left.components.upper.part": "os:path"}
    found = compiled(tmp_path, shared_store, choices).report.sorted_diagnostics()
    assert {one.path: one.help for one in found} == {
        "--set components.plate.part": "did you mean `plates:Square`?", "--set components.left.components.upper.part": None,
    }


def test_missing_assembly_gets_a_hint(tmp_path: Path, shared_store: str) -> None:
    (said,) = compiled(tmp_path, shared_store, {"components.left.assembly": "mask.yaml"}).report.diagnostics
    assert (said.code, said.help) == (Code.CHOICE_OPTION, "did you mean `mast.yaml`?")


def test_commands_and_python_api_accept_choices(tmp_path: Path, shared_store: str) -> None:
    here = workspace(tmp_path, family=FAMILY)
    words = ("--set", "components.row.material=heavy")
    run = partial(thingc_here, cwd=here, store=shared_store)
    assert run("build", "family.yaml", *words, "--emit", "bom").code == 0
    manifest = json.loads((here / "build/family/manifest.json").read_text())
    assert manifest["choice"]["choices"] == {"components.row.material": "heavy"}
    assert run("build", "family.yaml", "--emit", "bom").err.count("nothing changed") == 0  # another build
    info = run("info", "family.yaml", *words, "--format", "json").answer
    same = thingc.compile(str(here / "family.yaml"), choices={"components.row.material": "heavy"}, store=shared_store)
    assert info["mass"] == same.properties.mass == pytest.approx(500 * (5 * CUBE - 2 * CUBE + 2 * DISC) + 3 * 5000 * DISC, rel=1e-9)


# --- values by their path -------------------------------------------------------------------------------------------------


def pendulum(folder: Path, store: str, choices: dict[str, str]) -> Compilation:
    workspace(folder)
    with Environment(str(folder / "pendulum.yaml"), Options(store=store, choices=choices)) as environment:
        return pipeline.compile(environment)


TOP = "    mounts: {top:"
BY_PATH = [
    ("joints.swing.limit.upper", "60 deg", "upper: 90 deg}\n        drive", "upper: 60 deg}\n        drive"),
    ("joints.swing.dynamics.damping", "0.25 N*m*s/rad", "drive: {kind", "dynamics: {damping: 0.25 N*m*s/rad}\n        drive: {kind"),
    ("components.rod.mass", "=bob / 2", "mass: 100 g", "mass: =bob / 2"),
    ("components.rod.com", "0 0 3 mm", 'com: ["=length / 2", 0, 0]', "com: 0 0 3 mm"),
    ("defaults.joint.dynamics.friction", "0.1 N*m", TOP, "    defaults: {joint: {dynamics: {friction: 0.1 N*m}}}\n" + TOP),
    ("raw.mjcf.joint.swing.margin", "0.5", TOP, "    raw: {mjcf: {joint: {swing: {margin: 0.5}}}}\n" + TOP),
    ("poses.tilted.swing", "-30 deg", "{swing: =tilt}", "{swing: -30 deg}"),
    ("simulation.timestep", "1 ms", TOP, "    simulation: {timestep: 1 ms}\n" + TOP),
]


def models(folder: Path, store: str, document: str, choices: dict[str, str]) -> dict[str, object]:
    """Return the MJCF models of a pendulum document."""
    workspace(folder, pendulum=document)
    with Environment(str(folder / "pendulum.yaml"), Options(store=store, choices=choices)) as environment:
        compilation = pipeline.compile(environment)
        files = pipeline.emit(environment, compilation, ["mjcf"], verify=False)["mjcf"].files
        assert compilation.report.diagnostics == []
        return {path: content for path, content in files.items() if path.endswith(".xml")}


def test_value_by_path_equals_an_edit_of_the_document(tmp_path: Path, shared_store: str) -> None:
    """The models are byte-identical to those of an edited document."""
    plain = models(tmp_path, shared_store, PENDULUM, {})
    for path, text, written, instead in BY_PATH:
        assert PENDULUM.count(written) == 1
        found = models(tmp_path, shared_store, PENDULUM, {path: text})
        assert found == models(tmp_path, shared_store, PENDULUM.replace(written, instead), {}), path
        assert found != plain, path


def test_value_in_one_nested_assembly_does_not_affect_others(tmp_path: Path, shared_store: str) -> None:
    found = compiled(tmp_path, shared_store, {"components.left.components.upper.mass": "7 g", "components.row.mass": "2 g"})
    assert found.report.diagnostics == []
    weights = masses(found)
    assert weights["left/upper"] == 0.007 and weights["right/upper"] == pytest.approx(500 * DISC, rel=1e-9)
    assert [weights[f"row_{k}"] for k in range(3)] == [0.002] * 3


def test_wrong_nested_path_suggests_the_complete_path(tmp_path: Path, shared_store: str) -> None:
    found = compiled(tmp_path, shared_store, {"components.left.components.uper.mass": "7 g", "components.row_1.mass": "2 g"})
    assert [(one.code, one.path, one.message, one.help) for one in found.report.sorted_diagnostics()] == [
        (Code.CHOICE_OPTION, "--set components.row_1.mass", "`components` has no key `row_1`", "did you mean `components.row.mass`?"),
        (Code.CHOICE_OPTION, "--set components.left.components.uper.mass", "`components.left.components` has no key `uper`",
         "did you mean `components.left.components.upper.mass`?"),
    ]


def test_later_errors_in_a_value_refer_to_the_option(tmp_path: Path, shared_store: str) -> None:
    (said,) = pendulum(tmp_path, shared_store, {"joints.swing.limit.upper": "40000 deg"}).report.diagnostics
    assert (said.code, said.span, said.path) == (Code.LIMIT_TURNS, None, "--set joints.swing.limit.upper=40000 deg")
    (said,) = pendulum(tmp_path, shared_store, {"poses.tilted.swing": "100 deg"}).report.diagnostics
    assert (said.code, said.span, said.path) == (Code.CHOICE_OPTION, None, "--set poses.tilted.swing=100 deg")
    assert pendulum(tmp_path, shared_store, {"joints.swing.limit.upper": "1.5 rad"}).report.diagnostics == []  # no word on units


def test_choices_are_not_checked_in_an_invalid_document(tmp_path: Path, shared_store: str) -> None:
    workspace(tmp_path, pendulum=PENDULUM.replace("mass: 2 kg", "mass: 2 m"))
    with Environment(str(tmp_path / "pendulum.yaml"), Options(store=shared_store, choices={"joints.swin.gap": "1 mm"})) as environment:
        compilation = pipeline.compile(environment)
    assert [one.code for one in compilation.report.diagnostics] == [Code.WRONG_DIMENSION]
