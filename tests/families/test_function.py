"""`family.function` computes the numbers of `evaluate`. Its derivatives are compared with differences."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import thingc
from families.documents import INERTIA
from thingc.batch.families import FamilyFunction, NotDifferentiable
from thingc.batch.families.evaluation import Evaluation
from thingc.batch.plans import derivatives
from thingc.batch.plans.part_exchange import Exchange
from thingc.batch.results import FamilyError
from thingc.driver.pipeline import UnknownChoice
from thingc.geometry.worker.kernel.slicing import JOINED
from variants.robots import workspace as parts_workspace

KINKED = f"""\
thingc: assembly/1
name: kinked
parameters:
  left: {{value: 200 mm, min: 100 mm, max: 300 mm}}
  right: {{value: 200 mm, min: 100 mm, max: 300 mm}}
  style: {{value: false}}
components:
  base: {{frame: true, mass: 1 kg, {INERTIA}, mounts: {{l: {{xyz: [=-left, 0, 0]}}, r: {{xyz: [=right, 0, 0]}}}}}}
  bar:
    link: true
    mass: 0.4 kg
    shapes: [{{box: ["=max(left; right)", 20 mm, 20 mm]}}]
    at: {{in: base.r}}
mounts: {{hand: base.r}}
modes: {{standing: {{root: base, base: fixed}}}}
""".replace(";", ",")


SPECIAL = f"""\
thingc: assembly/1
name: special
parameters:
  twist: {{value: 0 deg, min: -30 deg, max: 30 deg}}
  load: {{value: 1 kg, min: 100 g, max: 2 kg}}
  count: {{value: 2, min: 0.5, max: 4}}
  z: {{value: 0.37, min: -2, max: 2}}
components:
  post: {{frame: true, mass: 2 kg, {INERTIA}}}
  beam: {{frame: true, mass: =load * count, com: [100 mm, 0, 0], {INERTIA}, mounts: {{tip: {{xyz: [300 mm, 0, 0]}}}}}}
  knob: {{frame: true, mass: "=1 kg * (3 + abs(z) * z)", at: {{in: post.origin}}}}
joints:
  tilt:
    type: revolute
    parent: post.origin
    child: beam.origin
    axis: [0, 1, 0]
    turn: =twist
    limit: {{lower: -90 deg, upper: 90 deg}}
modes: {{standing: {{root: post, base: fixed}}}}
"""


GEARED = f"""\
thingc: assembly/1
name: geared
parameters: {{gear: {{value: 2, min: 0.5, max: 5}}, unused: {{value: 3}}}}
components:
  post: {{frame: true, mass: 2 kg, {INERTIA}}}
  beam: {{frame: true, mass: =100 g * gear, {INERTIA}}}
joints: {{tilt: {{type: continuous, parent: post.origin, child: beam.origin}}}}
transmissions:
  one: {{actuator: {{kind: motor, effort: 0.4 N*m, velocity: 300 rad/s, armature: 2e-5 kg*m^2}}, joint: tilt, ratio: =gear}}
modes: {{standing: {{root: post, base: fixed}}}}
"""


def opened(folder: Path, document: str) -> Iterator[thingc.RobotFamily]:
    """Yield the family of a document in a separate workspace."""
    (folder / "thingc.toml").write_text('thingc = "workspace/1"\n')
    (folder / "robot.yaml").write_text(document)
    with thingc.family(folder / "robot.yaml") as family:
        yield family


@pytest.fixture(scope="module")
def special(tmp_path_factory: pytest.TempPathFactory) -> Iterator[thingc.RobotFamily]:
    yield from opened(tmp_path_factory.mktemp("special"), SPECIAL)


@pytest.fixture(scope="module")
def kinked(tmp_path_factory: pytest.TempPathFactory) -> Iterator[thingc.RobotFamily]:
    yield from opened(tmp_path_factory.mktemp("kinked"), KINKED)


def differences(function: FamilyFunction, x: np.ndarray, step: float = 1e-3) -> np.ndarray:
    """Compute derivatives by differences with an error of the fourth power of the step."""
    columns = []
    for place in range(len(x)):
        h = np.zeros(len(x))
        h[place] = step * abs(x[place])
        f = [np.asarray(function.value(x + k * h)) for k in (-2, -1, 1, 2)]
        columns.append((f[0] - 8 * f[1] + 8 * f[2] - f[3]) / (12 * h[place]))
    return np.array(columns).T


def test_values_equal_those_of_evaluate(everything: thingc.RobotFamily) -> None:
    function = everything.function(["load", "length", "joints.lift.limit.effort"], ["mass", "centre", "inertia", "length"])
    assert function.units == ("kg", "m", "N*m") and function.start.tolist() == [0.5, 0.3, 8.0]
    assert function.bounds[:2].tolist() == [[0.01, 20.0], [0.1, 0.9]] and np.isinf(function.bounds[2]).all()
    assert function.outputs[:2] == ("mass", "centre.x") and "length.neck" in function.outputs
    rows = np.random.default_rng(3).uniform([0.005, 0.08, 4.0], [21.0, 0.5, 9.0], (40, 3))
    rows[17] = [np.nan, 0.3, 8.0]
    rows[18] = [np.inf, 0.3, 8.0]
    found = function.value(rows)
    assert found.shape == (40, len(function.outputs)) and 25 < found.ok.sum() < 38
    for row, values, ok, problems in zip(rows, found, found.ok, found.problems, strict=True):
        alone = everything.evaluate(dict(zip(function.names, row.tolist(), strict=True)))
        assert alone.sound == ok and [one.code for one in problems] == [one.code for one in alone.problems]
        assert values.tolist() == [alone.results[name] for name in function.outputs] if ok else np.isnan(values).all()
        single = function.value(row)
        assert single.ok is bool(ok) and single.tobytes() == values.tobytes() and single.problems == (problems,)


def test_many_settings_are_computed_over_columns(workspace: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    compiled: list[object] = []
    measured = Evaluation._compile
    monkeypatch.setattr(Evaluation, "_compile", lambda self, read: compiled.append(read) or measured(self, read))
    with thingc.family(workspace / "everything.yaml", verify=0) as family:
        settings = [{"load": load, "length": length} for load in np.linspace(0.2, 2.0, 20) for length in np.linspace(0.2, 0.5, 10)]
        calls: list[int] = []
        together = Evaluation._together
        monkeypatch.setattr(Evaluation, "_together", lambda *given: calls.append(len(made := together(*given))) or made)
        many = family.evaluate(settings)
        assert sum(calls) >= 190 and len(calls) < 5 and len(compiled) < 12
        alone = [family.evaluate(one) for one in settings]
        assert [one.results for one in many] == [one.results for one in alone]


def test_infinite_numbers_are_refused_by_a_plan(everything: thingc.RobotFamily) -> None:
    """The number has no upper bound, so no comparison of the compiler excludes infinity."""
    numbers = [*np.linspace(20.0, 30.0, 20).tolist(), np.inf]
    many = [{"stiff": number} for number in numbers]
    assert everything.function(["stiff"], ["mass"]).value(np.array(numbers)[:, None]).ok.tolist() == [True] * 20 + [False]
    assert [evaluated.sound for evaluated in everything.evaluate(many)] == [True] * 20 + [False]
    assert [bool(model) for model in everything.models(many, share=True)] == [True] * 20 + [False]


@pytest.mark.parametrize("mode", ["standing", "footed"])
def test_shared_loads_are_planned(workspace: Path, monkeypatch: pytest.MonkeyPatch, mode: str) -> None:
    """Two drives on a joint, a tendon and feet share loads by least squares. The plan computes the same bits."""
    compiled: list[object] = []
    through_passes = Evaluation._compile
    monkeypatch.setattr(Evaluation, "_compile", lambda self, read: compiled.append(read) or through_passes(self, read))
    with thingc.family(workspace / "strung.yaml", verify=0, mode=mode) as family:
        rows = [{"thickness": 0.018 + 0.0003 * k, "axle": 0.06 + 0.001 * k, "components.foot.mass": 0.1 + 0.01 * k} for k in range(24)]
        many = [family.evaluate(one) for one in rows]
        assert len(compiled) < 16
        evaluation = family._evaluation_of(family.mode)
        for one, found in zip(rows, many, strict=True):
            assert evaluation._compile(family._reader.read(one))[0] == found.results
        assert len({one["torque_margin"] for one in many}) == len(rows) and None not in {one["torque_margin"] for one in many}


@pytest.mark.parametrize("mode", ["standing", "footed"])
def test_derivatives_equal_differences(strung: thingc.RobotFamily, mode: str) -> None:
    names = ["thickness", "axle", "reach", "components.foot.mass"]
    function = strung.function(names, ["mass", "centre", "inertia", "box", "site:stand", "site:thigh.drum"], mode=mode)
    x = np.array([0.021, 0.075, 0.063, 0.12])
    found = function.jacobian(x)
    assert found.error is not None and not found.error.any()
    np.testing.assert_allclose(found, differences(function, x), rtol=1e-8, atol=1e-10)
    assert found[function.outputs.index("mass"), 3] == 1.0 and not np.array_equal(found[-3:, 1], [0.0, 0.0, 0.0])


PLATED = """\
thingc: assembly/1
name: plated
parameters: {side: {value: 40 mm, min: 10 mm, max: 100 mm}, load: 0.2 kg, high: 50 mm}
materials: {light: {density: 500 kg/m^3}}
components:
  plate: {part: plates:Square, params: {side: =side}, collision: box}
  weight: {frame: true, mass: =load, at: {in: plate.top, xyz: [=side / 2, 0, =high]}}
modes: {standing: {root: plate, base: fixed}}
"""


def test_numbers_without_part_have_exact_derivatives(tmp_path: Path, shared_store: str) -> None:
    with thingc.family(parts_workspace(tmp_path, plated=PLATED) / "plated.yaml", store=shared_store) as family:
        function = family.function(["side", "load", "high"], ["mass", "centre.x", "centre.z"])
        found = function.jacobian(function.start)
        assert found.error is not None and found.error[:, 1:].tolist() == [[0.0, 0.0]] * 3 and found.error[0, 0] > 0.0
        plate, load, side, high = 500 * 0.04**2 * 0.01, 0.2, 0.04, 0.05
        mass, slope = plate + load, 2 * 500 * side * 0.01
        exact = [
            [slope, 1.0, 0.0],
            [load / (2 * mass) - load * side / 2 * slope / mass**2, plate * side / 2 / mass**2, 0.0],
            [-load * (high + 0.005) * slope / mass**2, plate * (high + 0.005) / mass**2, load / mass],
        ]
        assert found[:, 1:] == pytest.approx(np.array(exact)[:, 1:], rel=1e-9, abs=1e-15)
        assert np.all(np.abs(found - exact)[:, 0] <= found.error[:, 0] + 1e-9 * np.abs(exact)[:, 0])


def test_derivatives_by_the_size_of_a_printed_part(tmp_path: Path, shared_store: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The layers of a plate have a closed form: walls and lids, lines of infill between them, and their joins along the walls."""
    together: list[int] = []
    records_of = Exchange._records_of
    monkeypatch.setattr(Exchange, "_records_of", lambda self, many: together.append(len(many)) or records_of(self, many))
    process = "process: {kind: fdm, layer: 0.2 mm, line_width: 0.45 mm, walls: 3, top: 4, bottom: 4, infill: 20 %}"
    document = PLATED.replace("kg/m^3}}", f"kg/m^3, {process}}}}}").replace("0.2 kg, high: 50 mm", "5 g, high: 5 mm")
    with thingc.family(parts_workspace(tmp_path, plated=document) / "plated.yaml", store=shared_store) as family:
        function = family.function(["side"], ["mass", "centre.x"])
        side = 0.04  # the default of the part
        found = function.jacobian([side])
        assert max(together) >= 4, "the parts are built at the same time"
        together.clear()
        assert all(one.sound for one in family.evaluate([{"side": 0.03 + 0.001 * k} for k in range(6)])) and max(together) >= 3
        together.clear()
        assert all(one.sound for one in family.evaluate([{"side": 0.05}, {"side": 0.051}])) and together[0] == 2, "the first part as well"
        spacing = 0.45 - 0.2 * (1.0 - np.pi / 4.0)
        rounding, bridge = (0.45 - spacing) / 2.0, np.pi / 4.0 * 0.4**2 / (0.45 * 0.2)
        wall = rounding + 3.0 * spacing
        edge = np.polynomial.Polynomial([1e3 * side, 1e3])  # of the change of the side [m]
        filled, inner = edge - 2.0 * (wall - 0.25 * spacing), edge - 2.0 * (wall + 0.25 * spacing)
        lids = 50 * ((edge - 2.0 * rounding) ** 2 - (edge - 2.0 * wall) ** 2) + (7.0 + bridge) * filled**2
        plate = 500e-9 * 0.2 * (lids + 42 * (0.2 * inner**2 + JOINED * spacing * 4.0 * inner))
        mass, slope = plate(0.0) + 0.005, plate.deriv()(0.0)
        exact = np.array([slope, 0.0025 / mass - 0.0025 * side * slope / mass**2])
        assert function.value([side])[0] == pytest.approx(mass, rel=1e-9)
        assert found.error is not None and np.all(np.abs(found[:, 0] - exact) <= found.error[:, 0])
        assert np.all(found.error[:, 0] <= 1e-5 * np.abs(exact))


@pytest.mark.parametrize("mode", ["standing", "footed"])
def test_only_results_of_searches_are_estimated(strung: thingc.RobotFamily, mode: str) -> None:
    function = strung.function(["thickness", "axle", "components.foot.mass"], ["torque_margin", "mass", "centre"], mode=mode)
    x = np.array([0.021, 0.075, 0.12])
    found = function.jacobian(x)
    assert found.error is not None and not found.error[1:].any() and np.all((found.error[0] > 0.0) == (np.asarray(found)[0] != 0.0))
    expected = differences(function, x)
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-9)
    assert np.all(found.error[0] < 1e-3 * np.abs(expected[0]).max())


def test_one_coordinate_of_a_site_is_a_result(everything: thingc.RobotFamily) -> None:
    whole = everything.function("length", "site:hook").value([0.4])
    one = everything.function("length", ["site:hook.z", "mass", "site:hook.x"])
    assert one.outputs == ("site:hook.z", "mass", "site:hook.x") and one.value([0.4])[::2].tolist() == [whole[2], whole[0]]


def test_other_settings_are_fixed(everything: thingc.RobotFamily) -> None:
    function = everything.function("length", "mass", at={"load": "2 kg", "heavy": True})
    assert function.value([0.4]).tolist() == [everything.evaluate({"load": 2.0, "length": 0.4, "heavy": True})["mass"]]
    assert function.jacobian([0.4]).tolist() == [[0.3]]


def test_an_estimate_covers_its_error(strung: thingc.RobotFamily, monkeypatch: pytest.MonkeyPatch) -> None:
    names, outputs = ["thickness", "axle", "components.foot.mass"], ["mass", "centre", "inertia", "box"]
    function = strung.function(names, outputs)
    for x in ([0.021, 0.075, 0.12], [0.005, 0.02, 0.3]):  # the second one is at a limit
        exact = function.jacobian(x)
        with monkeypatch.context() as patch:
            patch.setattr(FamilyFunction, "_derivatives_at", lambda self, read: None)
            estimated = function.jacobian(x)
        assert estimated.error is not None and (estimated.error > 0.0)[np.asarray(exact) != 0.0].all()
        assert (np.abs(np.asarray(estimated) - exact) <= estimated.error).all()
        np.testing.assert_allclose(estimated, exact, rtol=1e-4, atol=1e-10)


def test_kink_has_no_derivative(kinked: thingc.RobotFamily) -> None:
    function = kinked.function(["left", "right"], ["inertia.yy", "site:hand", "mass"])
    assert function.jacobian([0.15, 0.25])[0, 0] == 0.0 and function.jacobian([0.25, 0.15])[0, 0] > 0.0
    with pytest.raises(NotDifferentiable) as caught:
        function.jacobian([0.2, 0.2])
    assert str(caught.value) == (
        "`inertia.yy` is not differentiable at left = 0.2 m, right = 0.2 m: an intermediate value is the maximum of equal values: "
        "choose other settings, or remove `inertia.yy`"
    )
    assert kinked.function(["left", "right"], ["site:hand"]).jacobian([0.2, 0.2]).tolist() == [[0.0, 1.0], [0.0, 0.0], [0.0, 0.0]]


def test_bound_has_a_derivative(kinked: thingc.RobotFamily) -> None:
    function = kinked.function(["left", "right"], ["inertia.zz", "centre.x"])
    for x in ([0.3, 0.1], [0.1, 0.3]):
        inside = [0.299999, 0.100001] if x[0] == 0.3 else [0.100001, 0.299999]
        np.testing.assert_allclose(function.jacobian(x), function.jacobian(inside), rtol=1e-4)


@pytest.mark.parametrize("load", [1.0, 0.1])
def test_derivatives_at_special_numbers(special: thingc.RobotFamily, load: float) -> None:
    """The compiler treats a rotation by 0 in a special way. A limit has only one side."""
    function = special.function(["twist", "load", "count"], ["mass", "centre", "inertia"])
    x = np.array([0.0, load, 2.0])
    found = function.jacobian(x)
    for place in range(3):
        step = np.zeros(3)
        step[place] = 1e-4
        if place == 1:  # to the inside
            f = [np.asarray(function.value(x + k * step)) for k in (0, 1, 2)]
            expected = (-3.0 * f[0] + 4.0 * f[1] - f[2]) / 2e-4
        else:
            expected = (np.asarray(function.value(x + step)) - np.asarray(function.value(x - step))) / 2e-4
        np.testing.assert_allclose(found[:, place], expected, rtol=1e-4, atol=1e-6)
    assert found.error is not None and found.error.max() < 1e-4 and (load == 0.1 or found.error[:, 1].max() == 0.0)
    assert abs(found[function.outputs.index("centre.z"), 0]) > 0.003
    assert (found.error[:, 0] > 0.0).any() and not found.error[:, 2].any()


def test_whole_numbers_are_traced(tmp_path: Path) -> None:
    (family,) = opened(tmp_path, GEARED)
    function = family.function(["gear", "unused"], ["mass"])
    for x in ([2.0, 3.0], [1.3, 3.0], [2.0, 4.0]):
        found = function.jacobian(x)
        np.testing.assert_allclose(found, [[0.1, 0.0]], rtol=1e-14)
        assert found.error is not None and not found.error.any()
    assert [family.model({"gear": gear}).dof_armature[0] for gear in (2.0, 3.0, 1.3)] == pytest.approx([8e-5, 18e-5, 3.38e-5], rel=1e-12)
    assert family._models_of(None, True).cache_for(family._reader.read({"gear": 2.0})).reasons == {}


def test_an_estimate_covers_a_jump_of_the_second_derivative(special: thingc.RobotFamily, monkeypatch: pytest.MonkeyPatch) -> None:
    function = special.function(["z"], ["mass"])
    monkeypatch.setattr(FamilyFunction, "_derivatives_at", lambda self, read: None)
    for z in (0.0, 0.0005, 0.003):
        found = function.jacobian([z])
        assert found.error is not None and abs(found[0, 0] - 2.0 * abs(z)) <= found.error[0, 0]


def test_nearby_kink_or_jump_is_an_error(special: thingc.RobotFamily, monkeypatch: pytest.MonkeyPatch) -> None:
    function = special.function(["twist"], ["centre.z"])
    value = FamilyFunction.value

    def kinked(self: FamilyFunction, x: Any) -> Any:
        made = value(self, x)
        made += 0.01 * np.abs(np.asarray(x))
        made.ok, made.problems = True, ((),)
        return made

    def jumping(self: FamilyFunction, x: Any) -> Any:
        made = value(self, x)
        made += 0.01 * (np.asarray(x) > 0.0)
        made.ok, made.problems = True, ((),)
        return made

    for changed in (kinked, jumping):
        with monkeypatch.context() as patch:
            patch.setattr(FamilyFunction, "value", changed)
            with pytest.raises(NotDifferentiable, match="with respect to `twist` at twist = 0 rad"):
                function.jacobian([0.0])


def test_plans_are_reused(special: thingc.RobotFamily, monkeypatch: pytest.MonkeyPatch) -> None:
    function = special.function(["twist", "load"], ["mass"])
    function.jacobian([0.0, 0.1])
    made: list[object] = []
    plan = Evaluation.plan
    monkeypatch.setattr(Evaluation, "plan", lambda self, *given, **named: made.append(given) or plan(self, *given, **named))
    function.jacobian([0.0, 0.1])
    assert not made


def test_a_function_can_be_pickled(everything: thingc.RobotFamily) -> None:
    function = everything.function("load", "mass", at={"length": "350 mm"})
    again = pickle.loads(pickle.dumps(function))
    assert again.value([0.7]).tolist() == function.value([0.7]).tolist() and again.names == ("load",)


@pytest.mark.parametrize("duplicate", [copy.copy, copy.deepcopy, lambda values: values.copy(), *(
    (lambda values, protocol=protocol: pickle.loads(pickle.dumps(values, protocol))) for protocol in (2, 5)
)])
def test_copied_results_keep_their_attributes(everything: thingc.RobotFamily, duplicate: Callable[[Any], Any]) -> None:
    function = everything.function(["load", "length"], ["mass", "centre"])
    for x in ([0.7, 0.3], [[0.7, 0.3], [50.0, 0.3]]):
        values, again = function.value(x), duplicate(function.value(x))
        assert np.array_equal(again, values, equal_nan=True) and type(again) is type(values) and again.problems == values.problems
        assert np.array_equal(again.ok, values.ok) and again.ok is not None and (again + 1.0).ok is None is again[..., :1].ok
        if again.ok is not True:
            again.ok[:] = False
            assert values.ok.tolist() == [True, False] and [len(found) for found in values.problems] == [0, 1]
    slopes = function.jacobian([0.7, 0.3])
    again = duplicate(slopes)
    assert again.error.tolist() == slopes.error.tolist() and again.error.shape == again.shape == (4, 2) and again.T.error is None


def test_variants_fix_settings_and_parameters_have_bounds(many: thingc.RobotFamily) -> None:
    function = many.function(["length", "load"], ["mass"])
    assert function.bounds.tolist() == [[0.1, 0.9], [0.01, 20.0]] and function.start.tolist() == [0.3, 0.5]


def test_wrong_plan_is_discarded(workspace: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with thingc.family(workspace / "everything.yaml") as family:
        function = family.function("load", "mass")
        function.value([[0.3 + 0.01 * place] for place in range(20)])
        compute = Evaluation.compute
        monkeypatch.setattr(Evaluation, "compute", lambda *given: ({**compute(*given)[0], "mass": 7.0}, compute(*given)[1]))
        rows = [[0.5 + 0.01 * place] for place in range(64)]
        exact = [family.evaluate({"load": load})["mass"] for (load,) in rows]
        assert function.value(rows)[:, 0].tolist() == exact
        (cache,) = [one for one in function._evaluation.caches.values() if one.failure]
        assert cache.failure is not None and cache.failure.startswith("a plan gave different results for {'load': 0.") and not cache.plans


BAD: list[tuple[dict[str, Any], str]] = [
    ({"names": ["lod"]}, "the document has no number `lod`: did you mean `load`?"),
    ({"names": ["heavy"]}, "expected a number as the value of `heavy`, found `false`: remove `heavy`, or set the value separately"),
    (
        {"names": ["joints.*.offset"]},
        "expected the name of one number, found `joints.*.offset`: write each name separately, without patterns",
    ),
    ({"names": ["joints.lift.velocty"]}, "the document has no number at `joints.lift.velocty`: correct the path, or add a value"),
    ({"names": ["load"], "at": [1]}, "expected `at` to be a mapping from names to values, found `[1]`"),
    ({"names": ["load"], "at": {"lo*": 1.0}}, "`load` is given twice: keep only one of the values"),
    ({"names": ["load", "load"]}, "`load` is given twice: keep only one of the values"),
    ({"names": ["load"], "at": {"load": 1.0}}, "`load` is given twice: keep only one of the values"),
    ({"names": ["load"], "outputs": ["mas"]}, "there is no result `mas`: did you mean `mass`?"),
    ({"names": ["load"], "outputs": ["mjcf"]}, "there is no result `mjcf`: for the numbers of MuJoCo models, use `family.mjx`"),
    ({"names": ["load"], "outputs": ["site:hok"]}, "there are no results at load = 0.5 kg: there is no mount `hok`: did you mean `hook`?"),
    ({"names": ["load"], "at": {"length": "3 kg"}}, "there are no results at load = 0.5 kg: "),
]


@pytest.mark.parametrize(("given", "message"), BAD)
def test_a_wrong_request_is_explained(everything: thingc.RobotFamily, given: dict[str, Any], message: str) -> None:
    with pytest.raises(FamilyError) as caught:
        everything.function(**given)
    assert str(caught.value).startswith(message)


def test_a_wrong_array_and_refused_settings_are_explained(everything: thingc.RobotFamily) -> None:
    function = everything.function(["load", "length"])
    for x, message in [
        ([0.5], r"expected an array of shape (2,) or (k, 2) for load, length, found (1,)"),
        ([10**400, 0.3], f"expected 2 numbers (load, length), found `[{10**400}, 0.3]`"),
        ("much", "expected 2 numbers (load, length), found `'much'`"),
        ([[[0.5, 0.3]]], r"expected an array of shape (2,) or (k, 2) for load, length, found (1, 1, 2)"),
    ]:
        for call in (function.value, function.jacobian):
            with pytest.raises(FamilyError) as caught:
                call(x)
            assert str(caught.value) == message
    with pytest.raises(FamilyError, match="call `jacobian` for each row"):
        function.jacobian([[0.5, 0.3]])
    with pytest.raises(FamilyError, match="there are no results at load = 30 kg, length = 0.3 m: parameter `load` must be at most 20 kg"):
        function.jacobian([30.0, 0.3])
    with pytest.raises(UnknownChoice):
        everything.function("load", mode="walking")
    assert derivatives.LONGEST > 0 and function.value(np.empty((0, 2))).shape == (0, 4)


def test_arrays_computed_from_values_have_no_flags(everything: thingc.RobotFamily) -> None:
    function = everything.function(["load"], ["mass"])
    values, jacobian = function.value([[0.5], [0.6]]), function.jacobian([0.5])
    assert values.ok is not None and (values * 2.0).ok is None and values[:1].problems == ()
    assert jacobian.error is not None and (-jacobian).error is None
