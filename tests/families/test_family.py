"""Results, spaces and folders of a family."""

from __future__ import annotations

import copy
import json
import random
import re
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import gymnasium
import numpy as np
import pytest

import thingc
from thingc.batch import FamilyError
from thingc.batch.families import SearchSpace
from thingc.batch.mujoco_arrays.equality import different_fields
from thingc.driver import pipeline
from thingc.driver.output import OutputError
from thingc.driver.pipeline import UnknownChoice
from thingc.tools.cli.main import main

NAMES = {"length": 0.35, "load": 0.5, "joints.lift.limit.upper": 1.4}


def test_results_equal_those_of_a_compilation(everything: thingc.RobotFamily) -> None:
    source = random.Random(1)
    many = [{name: value * source.uniform(0.95, 1.05) for name, value in NAMES.items()} for _ in range(20)]
    found = everything.evaluate(many)
    cache = everything._evaluation_of(everything.mode).cache_for(everything._read(many[0])[1])  # other tests share this family
    assert len(cache.plans) == 1
    for settings, one in zip(many, found, strict=True):
        _, read = everything._read(settings)
        measured, *_ = everything._evaluation_of(everything.mode)._compile(read)
        assert one.results == measured and one.sound and one.kept and one["mass"] == one.results["mass"]
    mass = 2.0 + 0.3 * 0.35 + 0.5 + 0.3 + 0.2 + 0.3 + 0.1 + 0.4 + 0.25
    assert everything.evaluate({"length": "350 mm"})["mass"] == pytest.approx(mass)


def test_rules_reach_and_errors_of_a_document_of_variants(many: thingc.RobotFamily) -> None:
    light, heavy, short, wrong = many.evaluate([
        {"length": 0.3, "load": 0.2}, {"length": 0.3, "load": 0.9}, {"length": 0.205, "load": 0.2}, {"length": "2 m", "load": 0.2},
    ])
    assert light.kept and light.results["reach"] > 0.2  # type: ignore[operator]
    assert (heavy.broken, short.broken) == ("mass <= 4.45 kg", "length >= 210 mm") and heavy.sound and not heavy.kept
    assert wrong.problems[0].message == "parameter `length` must be at most 900 mm, found `2000 mm`"
    assert not wrong.sound and wrong.results == {}
    assert many.modes == ("standing",) and len(list(many.variants)) == 8
    assert all(one.sound for one in many.evaluate(many.variants))


def test_refused_settings_are_not_compiled_again(workspace: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """This holds for all methods and repeated calls, and for new settings with a cause that is already known."""
    compilations: list[None] = []
    recompile = pipeline.recompile
    refused = [{"load": 21.0 + k} for k in range(4)] + [{"joints.lift.dynamics.damping": -1.0 - k} for k in range(4)]
    with thingc.family(workspace / "everything.yaml", verify=0) as family:
        first = family.evaluate(refused)
        monkeypatch.setattr(pipeline, "recompile", lambda *given: compilations.append(None) or recompile(*given))
        again, models = family.evaluate(refused), list(family.models(refused))
        new = family.evaluate({"load": 25.0})
        assert not compilations and new.problems[0].message == "parameter `load` must be at most 20 kg, found `25 kg`"
        family.evaluate({"load": 0.001})
        assert len(compilations) == 1
    messages = {one.problems[0].message for one in first}
    assert len(messages) == len(refused) and all(not one.sound for one in first)
    assert [one.problems for one in first] == [one.problems for one in again] == [one.problems for one in models]


FOLLOWING = """\
thingc: assembly/1
name: crane
parameters:
  arm: {value: 300 mm, min: 100 mm, max: 900 mm}
  rope: {value: =2 * arm, min: 0 mm, max: 2 m}
  braced: false
  load: 1 kg
components:
  base: {frame: true, mass: 2 kg}
  hook: {frame: true, mass: =load, com: [=rope, 0, 0], inertia: {ixx: 0.1 kg*m^2, iyy: 0.1 kg*m^2, izz: 0.1 kg*m^2}}
joints:
  turn: {type: revolute, parent: base.origin, child: hook.origin, limit: {lower: -1 rad, upper: =rope * 1 rad/m}}
modes: {standing: {root: base}}
"""


@pytest.mark.parametrize(("settings", "numbers", "broken"), [
    ({}, {}, None),
    ({"arm": 0.2}, {"arm": 0.2, "rope": 0.4, "joints.turn.limit.upper": 0.4}, None),
    ({"arm": "=100 mm * 4"}, {"arm": 0.4, "rope": 0.8, "joints.turn.limit.upper": 0.8}, "rope < 700 mm"),
    ({"arm": 0.5, "rope": "=arm + 100 mm"}, {"arm": 0.5, "rope": 0.6}, None),
    ({"load": "=load_of"}, {}, None),
    ({"load": "=arm * 1 kg/m"}, {"load": 0.3}, "load >= 500 g"),
    ({"br*": True, "load": "1 kg"}, {"braced": 1.0, "load": 1.0}, None),
    ({"joints.turn.limit.upper": "=2 * rope / 1 m * 1 rad", "arm": "=0.1 m"},
     {"joints.turn.limit.upper": 0.4, "arm": 0.1, "rope": 0.2}, None),
])
def test_rules_and_numbers_use_evaluated_parameters(
    tmp_path: Path, settings: dict[str, object], numbers: dict[str, float], broken: str | None,
) -> None:
    """Expressions, flags, and parameters that depend on a setting. The expected values are written in the test."""
    (tmp_path / "crane.yaml").write_text(FOLLOWING)
    (tmp_path / "cranes.yaml").write_text(
        "thingc: variants/1\nassembly: crane.yaml\nname: cranes\nparameters: {arm: [200 mm, 300 mm], braced: [true, false],\n"
        "  joints.turn.limit.upper: [1 rad, 2 rad]}\nkeep: [rope < 700 mm, load >= 500 g]\n"
    )
    with thingc.family(tmp_path / "cranes.yaml") as cranes:
        found = cranes.evaluate(settings)
        assert found.broken == broken and [one.message for one in found.problems] == (
            ["unknown name `load_of` in `=load_of`"] if settings.get("load") == "=load_of" else []
        )
        assert cranes.numbers(settings) == pytest.approx(numbers, abs=1e-12)
    with thingc.family(tmp_path / "crane.yaml") as crane:
        of_parameters = {name: number for name, number in numbers.items() if "." not in name or name in settings}
        assert crane.numbers(settings) == pytest.approx(of_parameters, abs=1e-12)


def test_missing_result_has_a_reason(everything: thingc.RobotFamily) -> None:
    with pytest.raises(KeyError, match="there is no result `mas`: did you mean `mass`"):
        everything.evaluate({})["mas"]
    rejected = r"result `mass` does not exist for the rejected settings .*: parameter `load` must be at most 20 kg"
    with pytest.raises(KeyError, match=rejected):
        everything.evaluate({"load": 30.0})["mass"]


def test_family_can_be_pickled(workspace: Path) -> None:
    with thingc.family(workspace / "many.yaml", verify=1) as family, ProcessPoolExecutor(1, get_context("spawn")) as pool:
        found = pool.submit(thingc.RobotFamily.evaluate, family, NAMES).result()
        assert found.results == family.evaluate(NAMES).results and found["mass"]
        with copy.deepcopy(family) as other:
            assert other.modes == family.modes and not different_fields(other.model(NAMES), family.model(NAMES))


def test_invalid_requests_are_reported_immediately(workspace: Path, many: thingc.RobotFamily, tmp_path: Path) -> None:
    for wrong in ("x", -1, 2.5, True, float("nan")):
        with pytest.raises(FamilyError, match=f"expected `verify` to be None, 0 .*, 1 .* or N .*, found `{wrong}`"):
            thingc.family(workspace / "many.yaml", verify=wrong)  # type: ignore[arg-type]
    with pytest.raises(FamilyError, match="expected `jobs` to be a whole number of at least 0, found -2"):
        thingc.family(workspace / "many.yaml", jobs=-2)
    with pytest.raises(UnknownChoice, match="has no mode `standin`: did you mean `standing`"):
        thingc.family(workspace / "many.yaml", mode="standin")
    for targets, word in ((5, 5), ([5], 5), (None, None), ([["mjcf"]], re.escape("['mjcf']"))):
        with pytest.raises(UnknownChoice, match=f"there is no target `{word}`: "):
            many.write({"length": 0.3}, tmp_path / "wrong", emit=targets)  # type: ignore[arg-type]


def test_tests_run_only_on_request(everything: thingc.RobotFamily) -> None:
    good, bad = everything.evaluate([{"load": 0.5}, {"load": "3 kg"}], tests=True)
    assert [(one.name, one.passed) for one in (*good.tests, *bad.tests)] == [("light", True), ("light", False)]
    assert good.kept and bad.sound and not bad.kept


def test_document_with_errors_is_refused(tmp_path: Path) -> None:
    (tmp_path / "thingc.toml").write_text('thingc = "workspace/1"\n')
    (tmp_path / "robot.yaml").write_text("thingc: assembly/1\nname: robot\ncomponents: {a: {fram: true}}\n")
    with pytest.raises(thingc.CompileError, match="fram"):
        thingc.family(tmp_path / "robot.yaml")
    with pytest.raises(thingc.CompileError, match="fram"):
        thingc.compile(str(tmp_path / "robot.yaml"), parameters={"load": 0.5})


def test_compile_accepts_the_settings_of_a_family(everything: thingc.RobotFamily) -> None:
    document = everything._session.environment.document
    numbers = thingc.compile(
        document, modes=["standing"], parameters={"load": np.float64(0.7), "heavy": True},
        choices={"joints.lift.limit.upper": 2, "joints.l*.dynamics.stiffness": 3.0, "components.crank.mass": "0.4 kg"},
    )
    texts = thingc.compile(
        document, modes=["standing"], parameters={"load": "700 g", "heavy": "true"},
        choices={"joints.lift.limit.upper": "2 rad", "joints.lift.dynamics.stiffness": "3 N*m/rad", "components.crank.mass": "400 g"},
    )
    assert numbers.modes["standing"].mjcf() == texts.modes["standing"].mjcf()
    for given, words in (
        ({"parameters": {"load": 30}}, "parameter `load` must be at most 20 kg, found `30 kg`"),
        ({"parameters": {"load": True}}, "must be a mass (such as 120 g), found a boolean (`true`)"),
        ({"parameters": {"load": None}}, "expected a number with a unit, found `None`"),
        ({"parameters": {"lod": 3}}, "has no parameter `lod`"),
        ({"choices": {"joints.x*.offset": 3}}, "the document has no element `joints.x*.offset`"),
    ):
        with pytest.raises(thingc.CompileError, match=re.escape(words)):
            thingc.compile(document, **given)  # type: ignore[arg-type]


def test_spaces_of_variants_and_parameters(many: thingc.RobotFamily, everything: thingc.RobotFamily) -> None:
    space = many.space
    assert isinstance(space, SearchSpace) and space.names == ("length", "load", "joints.lift.limit.upper")
    assert (space["length"].low, space["length"].high, space["length"].unit, space["length"].value) == (0.2, 0.5, "m", 0.3)
    drawn = space.gymnasium()
    assert isinstance(drawn, gymnasium.spaces.Dict)
    drawn.seed(1)
    assert many.evaluate(space.settings(drawn.sample())).sound
    assert many.evaluate(space.at([low for low, _ in space.bounds()])).sound
    own = everything.space
    assert own.names == ("load", "length", "stiff", "teeth", "heavy")
    assert own["heavy"].choices == (False, True) and own["stiff"].high is None and not own["stiff"].bounded
    assert [dimension.unit for dimension in own] == ["kg", "m", "N*m/rad", "", ""]
    with pytest.raises(KeyError, match="unknown setting `lenth`: did you mean `length`"):
        own["lenth"]
    for wrong in (5, {"length": "long"}, {"length": None}, {"heavy": 2}):
        with pytest.raises(ValueError, match=re.escape(f"expected a sample of the space `gymnasium()`, found `{wrong}`")):
            own.settings(wrong)
    for vector in (None, "abc", [None] * 3):
        with pytest.raises(ValueError, match=re.escape(f"expected 3 numbers (length, load, joints.lift.limit.upper), found `{vector}`")):
            space.at(vector)
    with pytest.raises(ValueError, match=r"expected 3 numbers \(length, load, joints.lift.limit.upper\), found 1"):
        space.at([0.3])


def test_optuna_suggests_settings(many: thingc.RobotFamily) -> None:
    import optuna

    optuna.logging.set_verbosity(optuna.logging.ERROR)
    study = optuna.create_study(sampler=optuna.samplers.RandomSampler(seed=1))
    study.optimize(lambda trial: many.evaluate(many.space.suggest(trial))["mass"] or 0.0, n_trials=5)
    assert set(study.best_params) == set(many.space.names) and 0.2 <= study.best_params["length"] <= 0.5


def test_written_files_equal_a_single_build(workspace: Path, many: thingc.RobotFamily, tmp_path: Path) -> None:
    variant = next(iter(many.variants))
    assert many.write(variant, tmp_path / "written" / "everything") == ()
    assert many._plan is not None
    command = [sys.executable, "-m", *many._plan.command(variant), "-o", str(tmp_path / "alone")]
    done = subprocess.run(command, cwd=workspace, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    own, alone = (
        {path.relative_to(tmp_path / folder).as_posix(): path.read_bytes() for path in (tmp_path / folder).rglob("*") if path.is_file()}
        for folder in ("written", "alone")
    )
    told = (json.loads(files["everything/manifest.json"]) for files in (own, alone))
    assert next(told) == next(told)
    assert own.keys() == alone.keys() and [name for name in own if own[name] != alone[name]] == []
    said = many.write({"length": 5.0}, tmp_path / "wrong")
    assert said[0].code.code == "TC803" and not (tmp_path / "wrong").exists()
    assert many.write(variant, tmp_path / "zipped" / "everything", emit="mjz") == ()
    zipped = {path.name for path in (tmp_path / "zipped").rglob("*") if path.is_file()}
    assert zipped == {"manifest.json", "joint_order.json", *(f"everything_{mode}.mjz" for mode in many.modes)}
    with pytest.raises(UnknownChoice, match="there is no target `mjzz`") as fault:
        many.write(variant, tmp_path / "wrong", emit=["mjzz"])
    assert fault.value.diagnostic.help == "did you mean `mjz`?"
    for place in ("/", "a\0b"):
        with pytest.raises(OutputError, match="cannot be a build folder"):
            many.write(variant, place)


def test_manifest_contains_settings_as_given(tmp_path: Path) -> None:
    """The units of the settings differ from those of the document, also in a build by a plan. `manifest.json` contains the settings as
    given. A later number replaces an earlier one."""
    (tmp_path / "crane.yaml").write_text(FOLLOWING)
    with thingc.family(tmp_path / "crane.yaml") as crane:
        for count in range(20):
            words = {"arm": f"{30 + count}.0 cm", "joints.turn.limit.lower": f"-{40 + count} deg", "components.base.mass": "1 g"}
            assert crane.write({**words, "components.*.mass": "3000.0 g", "load": 2.5}, tmp_path / "crane", emit="mjcf") == ()
        (cache,) = crane._builds_of(("mjcf",)).caches.values()
        assert cache.plans
    settings = {**words, "components.base.mass": "3000.0 g", "components.hook.mass": "3000.0 g", "load": "2.5 kg"}
    options = [word for name, text in settings.items() for word in ("--set" if "." in name else "-p", f"{name}={text}")]
    assert main(["build", str(tmp_path / "crane.yaml"), *options, "--emit", "mjcf", "-o", str(tmp_path / "alone")]) == 0
    own, other = ({path.name: path.read_bytes() for path in (tmp_path / folder).rglob("*.*")} for folder in ("crane", "alone/crane"))
    assert other == own and b'"arm": "49.0 cm"' in own["manifest.json"]


ADOPTED = """\
thingc: assembly/1
name: crane      # lifts
parameters:
  length: {value: 300 mm, max: 900 mm}    # of the boom
  slope: 30 deg
components:
  base: {frame: true, mass: 2 kg, mounts: {top: {xyz: 0 0 100 mm}}}
  boom: {frame: true, mass: =3 kg/m * length, inertia: {ixx: 0.1 kg*m^2, iyy: 0.1 kg*m^2, izz: 0.1 kg*m^2}}     # a tube
  cap: {assembly: cap.yaml, at: {in: boom.origin}}
joints:
  lift: {type: revolute, parent: base.top, child: boom.origin, limit: {lower: 0 deg, upper: 80 deg}}
modes: {standing: {root: base}}
"""


def test_number_can_replace_a_mass_with_a_source(tmp_path: Path) -> None:
    (tmp_path / "r.yaml").write_text(
        "thingc: assembly/1\nname: r\ncomponents: {a: {frame: true, mass: {value: 1 g, source: estimated}}}\nmodes: {m: {root: a}}\n"
    )
    with thingc.family(tmp_path / "r.yaml") as family:
        assert [family.evaluate({"components.a.mass": mass}).results["mass"] for mass in (0.5, "2 g")] == [0.5, 0.002]


def test_adopted_settings_are_written_to_the_document(tmp_path: Path) -> None:
    (tmp_path / "thingc.toml").write_text('thingc = "workspace/1"\n')
    (tmp_path / "crane.yaml").write_text(ADOPTED)
    (tmp_path / "cap.yaml").write_text("thingc: assembly/1\nname: cap\ncomponents: {knob: {frame: true, mass: 10 g}}\n")
    (tmp_path / "cranes.yaml").write_text(
        "thingc: variants/1\nassembly: crane.yaml\nname: cranes\nparameters: {length: [40 cm, 50 cm]}\nchoices: {}\n"
    )
    document = tmp_path / "crane.yaml"
    settings = {"length": 0.4125, "slope": 0.6108652381980153, "joints.*.limit.upper": "75 deg", "components.base.mass": 2.5}
    with thingc.family(document) as family:
        mass = family.evaluate(settings)["mass"]
        assert family.adopt(settings) == ()
        expected = ADOPTED.replace("300 mm", "412.5 mm").replace("30 deg", "35 deg").replace("2 kg", "2.5 kg").replace("80 deg", "75 deg")
        assert document.read_text() == expected
        assert family.adopt({}) == () and document.read_text() == expected
        for wrong, words in (
            ({"length": 2.0}, "parameter `length` must be at most 900 mm, found `2000 mm`"),
            ({"components.boom.mass": 3.0, "nothing": 1.0}, "nothing"),
            (
                {"components.cap.components.knob.mass": 0.02},
                "is defined in the nested document `cap.yaml`",
            ),
            ({"joints.*.limt.upper": 1.0}, "`joints.lift` has no key `limt`"),
        ):
            said = family.adopt(wrong)
            assert words in said[0].message and document.read_text() == expected, (wrong, [one.message for one in said])
    with thingc.family(document) as family:
        assert family.evaluate({})["mass"] == mass and family.space["length"].value == 0.4125
    with thingc.family(tmp_path / "cranes.yaml") as cranes:
        assert cranes.adopt(list(cranes.variants)[1]) == ()
    assert document.read_text() == expected.replace("412.5 mm", "50 cm")


def test_parameter_of_a_nested_document_is_in_si_units(tmp_path: Path) -> None:
    """The parameter has no value in the outer document. The document of variants or the nested document contains its unit."""
    for name, text in {
        "thingc.toml": 'thingc = "workspace/1"\n',
        "leg.yaml": "thingc: assembly/1\nname: leg\nparameters: {length: {value: 200 mm, max: 400 mm}}\n"
                    "components: {shin: {frame: true, mass: =1 kg/m * length}}\nmounts: {hip: shin.origin}\n",
        "walker.yaml": "thingc: assembly/1\nname: walker\ncomponents: {body: {frame: true, mass: 2 kg}, leg: {assembly: leg.yaml, "
                       "attach: {hip: body.origin}}}\nmodes: {walking: {root: body}}\n",
        "walkers.yaml": "thingc: variants/1\nassembly: walker.yaml\nname: walkers\n"
                        "sample: {method: sobol, count: 4, seed: 1, ranges: {components.leg.parameters.length: [100 mm, 300 mm]}}\n",
    }.items():
        (tmp_path / name).write_text(text)
    for document in ("walker.yaml", "walkers.yaml"):
        with thingc.family(tmp_path / document) as walkers:
            for length in (0.3, "300 mm", np.float64(0.3)):
                assert walkers.evaluate({"components.leg.parameters.length": length})["mass"] == pytest.approx(2.3, abs=1e-12)
            (problem,) = walkers.evaluate({"components.leg.parameters.length": 0.5}).problems
            assert "must be at most 400 mm, found `500 mm`" in problem.message


BODY = "mass: 1 kg, inertia: {ixx: 0.01 kg*m^2, iyy: 0.01 kg*m^2, izz: 0.01 kg*m^2}"
FINGER = f"""\
thingc: assembly/1
name: finger
components: {{base: {{frame: true, {BODY}}}, tip: {{frame: true, {BODY}}}}}
joints: {{bend: {{type: revolute, parent: base.origin, child: tip.origin, limit: {{lower: -1 rad, upper: 1 rad}}}}}}
mounts: {{knuckle: base.origin}}
"""
HAND = f"""\
thingc: assembly/1
name: hand
components:
  palm: {{frame: true, {BODY}}}
  thumb: {{assembly: finger.yaml}}
  index: {{assembly: finger.yaml, repeat: {{count: 2, as: k}}}}
joints:
  swing: {{type: revolute, parent: palm.origin, child: thumb.knuckle, limit: {{lower: -1 rad, upper: 1 rad}}}}
  spread:
    repeat: {{count: 2, as: k}}
    type: revolute
    parent: palm.origin
    child: index_$k.knuckle
    limit: {{lower: -1 rad, upper: 1 rad}}
modes: {{free: {{root: palm, base: free}}}}
"""


@pytest.mark.parametrize(("pattern", "joints"), [
    ("joints.*.dynamics.damping", {"swing", "spread_0", "spread_1", "thumb/bend", "index_0/bend", "index_1/bend"}),
    ("joints.s*.dynamics.damping", {"swing", "spread_0", "spread_1"}),
    ("joints.b*.dynamics.damping", {"thumb/bend", "index_0/bend", "index_1/bend"}),
    ("components.*.joints.bend.dynamics.damping", {"thumb/bend", "index_0/bend", "index_1/bend"}),
    ("components.t*.joints.*.dynamics.damping", {"thumb/bend"}),
])
def test_stars_include_nested_documents(tmp_path: Path, shared_store: str, pattern: str, joints: set[str]) -> None:
    (tmp_path / "finger.yaml").write_text(FINGER)
    (tmp_path / "hand.yaml").write_text(HAND)
    with thingc.family(tmp_path / "hand.yaml", store=shared_store) as hand:
        for value in (0.25, 0.5, 0.75):
            model = hand.model({pattern: value})
            found = {model.joint(k).name: model.dof_damping[model.jnt_dofadr[k]] for k in range(1, model.njnt)}
            assert found == {name: value if name in joints else 0.0 for name in found} and joints <= found.keys()
