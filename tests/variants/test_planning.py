"""Plans: the variants with their order and ids. Nothing is built."""

from __future__ import annotations

import hashlib
import json
import math
import re
import time
from itertools import product
from pathlib import Path

import numpy
import pytest
from hypothesis import given, settings, strategies as st

from thingc.base.diagnostics import Code
from thingc.base.units import ANGLE, FREQUENCY, INERTIA, LENGTH, MASS, NUMBER, TORQUE, Dimension, Quantity, parse_quantity
from thingc.batch import Plan, PlanError, folder_layout, job, plan
from thingc.batch.planning import points
from thingc.batch.values import evenly_spaced
from thingc.documents.expressions.value_text import text_of
from thingc.driver.environment import Options
from thingc.driver.up_to_date import state_of
from variants.robots import workspace


def planned(folder: Path, text: str, store: str) -> Plan:
    workspace(folder, family=text)
    return plan(str(folder / "family.yaml"), options=Options(store=store))


HEAD = "thingc: variants/1\nassembly: pendulum.yaml\nname: family\n"


def test_last_axis_of_a_grid_changes_fastest(tmp_path: Path, shared_store: str) -> None:
    found = planned(tmp_path, HEAD + "parameters:\n  length: [200 mm, 400 mm]\n  damped: [true, false]\n  label: [a, b, c]\n", shared_store)
    expected = list(product([0.2, 0.4], [True, False], ["a", "b", "c"]))
    assert [(v.values["length"], v.values["damped"], v.values["label"]) for v in found] == expected
    assert found.count == 12 and [v.index for v in found] == list(range(12))
    assert [v.name for v in found][:2] == ["family_00", "family_01"]
    assert all(v.values["double"] == 2 * v.values["length"] for v in found)  # worked out by the assembly's own expression


def test_values_of_a_range_have_few_digits(tmp_path: Path, shared_store: str) -> None:
    text = HEAD + "parameters:\n  length: {from: 150 mm, to: 850 mm, count: 8}\n  tilt: {from: 10 deg, to: 40 deg, count: 4}\n"
    found = planned(tmp_path, text, shared_store)
    assert sorted({v.values["length"] for v in found}) == [0.15, 0.25, 0.35, 0.45, 0.55, 0.65, 0.75, 0.85]
    assert sorted({v.values["tilt"] for v in found}) == [math.radians(x) for x in (10, 20, 30, 40)]


@given(st.integers(-500, 500), st.integers(1, 2000), st.integers(2, 12), st.sampled_from(["mm", "deg", "g", "kg", ""]))
def test_steps_are_parsed_like_quantities_in_documents(first: int, step: int, count: int, unit: str) -> None:
    texts = [f"{first + k * step} {unit}".strip() for k in range(count)]
    found = evenly_spaced(texts[0], texts[-1], count)
    assert found is not None and [one.value for one in found] == [parse_quantity(text).value for text in texts]


def test_id_is_the_digest_of_the_settings(tmp_path: Path, shared_store: str) -> None:
    text = HEAD + "parameters: {length: [120 mm], label: [x]}\nchoices: {defaults.component.material: heavy}\n"
    variant = next(iter(planned(tmp_path, text, shared_store)))
    written = json.dumps({
        "assembly": "pendulum.yaml", "choices": {"defaults.component.material": "heavy"}, "parameters": {"label": "x", "length": 0.12},
    }, separators=(",", ":"))
    assert variant.id == hashlib.sha256(written.encode()).hexdigest()[:12]


def test_variant_has_the_same_id_in_every_batch(tmp_path: Path, shared_store: str) -> None:
    """The id does not depend on the order, the unit and the batch. A setting equal to the value in the assembly does not count."""
    texts = [
        "name: a\nparameters: {length: [0.2 m], bob: [0.25 kg]}\n",
        "name: b\nparameters: {bob: [100 g, 250 g], length: [20 cm, 300 mm]}\n",
        "name: c\nlist: [{name: mine, parameters: {bob: 250 g, length: 200 mm, effort: 6 N*m, label: plain, damped: true}}]\n",
    ]
    ids = []
    for number, text in enumerate(texts):
        found = planned(tmp_path / str(number), "thingc: variants/1\nassembly: pendulum.yaml\n" + text, shared_store)
        ids.append({v.id for v in found if (v.values["length"], v.values["bob"]) == (0.2, 0.25)})
    assert len(ids[0]) == 1 and ids[0] == ids[1] == ids[2]


def test_value_in_place_of_an_expression_is_a_setting(tmp_path: Path, shared_store: str) -> None:
    """`double` is twice the length unless it is set. Setting it to its current value matters for other lengths."""
    found = list(planned(tmp_path, HEAD + "list: [{}, {parameters: {double: 600 mm}}]\n", shared_store))
    assert len({v.id for v in found}) == 2 and found[0].values == found[1].values


def test_equal_variants_are_merged(tmp_path: Path, shared_store: str) -> None:
    entries = "[{name: first, parameters: {length: 300 mm}}, {parameters: {length: 30 cm}}]"
    text = HEAD + f"parameters: {{length: [200 mm, 0.2 m, 300 mm]}}\nlist: {entries}\n"
    found = planned(tmp_path, text, shared_store)
    assert [(v.name, v.values["length"]) for v in found] == [("first", 0.3), ("family_1", 0.2)]
    assert (found.count, found.written) == (2, 4)
    assert [note.code for note in found.notes] == [Code.DUPLICATE_VARIANT] * 2  # in the axis and in the list


def test_document_without_axes_is_one_variant(tmp_path: Path, shared_store: str) -> None:
    found = planned(tmp_path, HEAD, shared_store)
    assert [(v.parameters, v.choices) for v in found] == [({}, {})] and found.count == 1


def test_plan_applies_rules_on_parameters(tmp_path: Path, shared_store: str) -> None:
    rules = '["double < 900 mm", "mass < 1 g", "length != 300 mm"]'
    text = HEAD + f"parameters: {{length: {{from: 200 mm, to: 600 mm, count: 5}}}}\nkeep: {rules}\n"
    found = {v.values["length"]: v.failed for v in planned(tmp_path, text, shared_store)}
    assert found == {0.2: None, 0.3: "length != 300 mm", 0.4: None, 0.5: "double < 900 mm", 0.6: "double < 900 mm"}


# --- values by their path --------------------------------------------------------------------------------------------

PATHS = HEAD + """
parameters:
  joints.swing.limit.upper: [90 deg, 60 deg]
  joints.swing.dynamics.damping: {from: 0, to: 0.4 N*m*s/rad, count: 3}
  components.weight.mass: [1 kg, 2 kg]
  raw.mjcf.joint.swing.margin: 0.5
list: [{name: plain}, {parameters: {bob: 900 g}}]
keep: ["joints.swing.limit.upper > 1.1 rad"]
"""


def test_paths_can_be_axes(tmp_path: Path, shared_store: str) -> None:
    found = list(planned(tmp_path, PATHS, shared_store))
    upper, damping, mass = "joints.swing.limit.upper", "joints.swing.dynamics.damping", "components.weight.mass"
    grid = [(v.values[upper], v.values[damping], v.values[mass]) for v in found[2:]]
    assert grid == list(product([math.radians(90), math.radians(60)], [0.0, 0.2, 0.4], [1.0, 2.0]))
    plain, heavy = found[:2]  # what is not set is what the document says; the mass of the weight is `=bob`
    assert (plain.values[upper], plain.values[mass], heavy.values[mass]) == (math.radians(90), 0.5, 0.9)
    assert damping not in plain.values  # the document says nothing there
    margin = {"raw.mjcf.joint.swing.margin": "0.5"}
    assert plain.choices == margin and found[2].parameters == {}
    assert found[2].choices == {damping: "0.0 kg*m^2/rad/s", mass: "1 kg", **margin}  # 90 deg is what the document says
    assert {v.failed for v in found if v.values[upper] < 1.1} == {"joints.swing.limit.upper > 1.1 rad"}
    assert {v.failed for v in found if v.values[upper] > 1.1} == {None}


def test_paths_can_be_sampled(tmp_path: Path, shared_store: str) -> None:
    ranges = "{joints.swing.limit.upper: [60 deg, 90 deg], raw.mjcf.joint.swing.group: [1, 4]}"
    found = list(planned(tmp_path, HEAD + f"sample: {{method: uniform, count: 50, seed: 3, ranges: {ranges}}}\n", shared_store))
    cube = numpy.random.default_rng(3).random((50, 2)).tolist()
    low, high = math.radians(60), math.radians(90)
    assert [v.values["joints.swing.limit.upper"] for v in found] == [low + u * (high - low) for u, _ in cube]
    assert [v.choices["raw.mjcf.joint.swing.group"] for v in found] == [str(1 + math.floor(4 * u)) for _, u in cube]


# --- drawing --------------------------------------------------------------------------------------------------------

DRAWN = HEAD + """
parameters: {{label: [a, b, c], effort: 3 N*m}}
choices: {{defaults.component.material: [light, heavy]}}
sample:
  method: {method}
  count: {count}
  seed: {seed}
  ranges: {{length: [200 mm, 600 mm], steps: [2, 5], bob: [100 g, 900 g]}}
"""


def drawn_by_scipy(method: str, count: int, seed: int) -> numpy.ndarray:
    """Return points of the unit cube, all at once, directly from scipy and numpy."""
    from scipy.stats import qmc

    if method == "sobol":
        return qmc.Sobol(5, scramble=True, rng=seed).random(count)
    if method == "lhs":
        return qmc.LatinHypercube(5, rng=seed).random(count)
    return numpy.random.default_rng(seed).random((count, 5))


@pytest.mark.filterwarnings("ignore:The balance properties")
@pytest.mark.parametrize(("method", "count", "seed"), [("sobol", 600, 7), ("lhs", 50, 3), ("uniform", 300, 11)])
def test_sampled_variants_equal_those_of_scipy(tmp_path: Path, shared_store: str, method: str, count: int, seed: int) -> None:
    found = list(planned(tmp_path, DRAWN.format(method=method, count=count, seed=seed), shared_store))
    cube = drawn_by_scipy(method, count, seed)
    assert len(found) == count
    for variant, u in zip(found, cube.tolist(), strict=True):
        assert variant.values["length"] == 0.2 + u[0] * (0.6 - 0.2)
        assert variant.values["steps"] == math.floor(2 + u[1] * 4)
        assert variant.values["bob"] == 0.1 + u[2] * (0.9 - 0.1)
        assert variant.values["label"] == "abc"[math.floor(u[3] * 3)]
        assert variant.values["effort"] == 3.0
        assert variant.choices.get("defaults.component.material") == ["light", "heavy"][math.floor(u[4] * 2)]
    assert {v.values["steps"] for v in found} == {2, 3, 4, 5}


@settings(max_examples=13)
@given(st.sampled_from(["sobol", "lhs", "uniform"]), st.integers(1, 6), st.integers(1, 700), st.integers(0, 2**31 - 1))
def test_points_are_reproducible_and_inside_the_cube(method: str, dimensions: int, count: int, seed: int) -> None:
    first, second = list(points(method, dimensions, count, seed)), list(points(method, dimensions, count, seed))
    assert first == second and len(first) == count
    assert all(len(point) == dimensions and all(0.0 <= u < 1.0 for u in point) for point in first)


def test_discrete_sample_has_every_combination_once(tmp_path: Path, shared_store: str) -> None:
    text = HEAD + "parameters: {label: [a, b], damped: [true, false]}\nsample: {method: uniform, count: 200, seed: 1}\n"
    found = planned(tmp_path, text, shared_store)
    assert sorted((v.values["label"], v.values["damped"]) for v in found) == sorted(product("ab", [True, False]))
    assert (found.count, found.written) == (4, 200)


# --- properties -----------------------------------------------------------------------------------------------------

LENGTHS = st.lists(st.integers(100, 900), min_size=1, max_size=5)
BOBS = st.lists(st.integers(1, 20000), min_size=1, max_size=5)
LISTED = st.lists(st.tuples(st.integers(100, 105), st.integers(1, 4)), max_size=4)


@settings(max_examples=20)
@given(LENGTHS, BOBS, LISTED)
def test_plans_are_stable_and_ids_are_unique(
    tmp_path_factory: pytest.TempPathFactory, lengths: list[int], bobs: list[int], listed: list[tuple[int, int]],
) -> None:
    folder = tmp_path_factory.mktemp("plan")
    entries = "".join(f"  - {{parameters: {{length: {a} mm, bob: {b} g}}}}\n" for a, b in listed)
    text = (
        HEAD + f"parameters:\n  length: [{', '.join(f'{a} mm' for a in lengths)}]\n  bob: [{', '.join(f'{b} g' for b in bobs)}]\n"
        + (f"list:\n{entries}" if entries else "")
    )
    found = planned(folder, text, str(folder / "store"))
    variants = list(found)
    expected = list(dict.fromkeys([*listed, *product(dict.fromkeys(lengths), dict.fromkeys(bobs))]))
    if len(dict.fromkeys(lengths)) == 1 and len(dict.fromkeys(bobs)) == 1 and listed:  # nothing but fixed values: no grid
        expected = list(dict.fromkeys(listed))
    assert [(v.values["length"], v.values["bob"]) for v in variants] == [
        (parse_quantity(f"{a} mm").value, parse_quantity(f"{b} g").value) for a, b in expected
    ]
    assert len({v.id for v in variants}) == len(variants) == found.count
    assert variants == list(found)


DIMENSIONS = st.sampled_from([NUMBER, LENGTH, MASS, ANGLE, TORQUE, INERTIA, FREQUENCY, Dimension(length=-1), Dimension(mass=1, time=-1)])


@given(st.floats(-1e6, 1e6).map(lambda x: x + 0.0), DIMENSIONS)
def test_texts_have_exactly_the_same_value(value: float, dimension: Dimension) -> None:
    from thingc.documents.expressions.evaluation import evaluate
    from thingc.documents.expressions.parsing import parse_expression

    text = text_of(Quantity(value, dimension))
    found = evaluate(parse_expression(text), {}) if text.startswith("=") else parse_quantity(text)
    assert isinstance(found, Quantity)
    assert found.value == value and found.dimension == dimension


@given(st.floats(-1e6, 1e6).map(lambda x: x + 0.0), st.sampled_from(["mm", "g", "in", "deg", "N*m/rad", "%", "rpm", "kHz"]))
def test_texts_in_a_unit_have_exactly_the_same_value(value: float, unit: str) -> None:
    found = Quantity(value, parse_quantity(f"1 {unit}").dimension)
    text = text_of(found, unit)
    assert parse_quantity(text) == found
    assert unit == "deg" or text.endswith(f" {unit}")  # a double in radians may have no double in degrees
    assert text_of(found, "V") == text_of(found, "h") == text_of(found)


@given(st.integers(-10**8, 10**8), st.integers(0, 6), st.sampled_from(["mm", "g", "in", "deg", "N*m/rad", "%", "rpm", "kHz"]))
def test_short_numbers_keep_their_digits(digits: int, decimals: int, unit: str) -> None:
    written = f"{digits / 10**decimals:.15g} {unit}"
    assert text_of(parse_quantity(written), unit) == written


def test_error_lists_every_location(tmp_path: Path, shared_store: str) -> None:
    with pytest.raises(PlanError) as fault:
        planned(tmp_path, HEAD + "parameters: {lenght: [1 mm], bob: [3 mm]}\nkeep: [mass < 3 mm]\n", shared_store)
    assert [(d.code, d.span.line if d.span else None) for d in fault.value.diagnostics] == [
        (Code.UNKNOWN_PARAMETER, 4), (Code.DIMENSION, 4), (Code.RULE, 5),
    ]


# --- the pages -------------------------------------------------------------------------------------------------------


def test_page_lists_results_and_columns(root: Path) -> None:
    import re

    from docs.pages import table
    from thingc.batch.rules import LENGTHS, RESULTS
    from thingc.batch.tables import HEAD, RUN, TAIL

    said = [name for row in table(root / "docs" / "variants.md", "results") for name in re.findall(r"`([\w.]+)`", row[0])]
    assert said == [*RESULTS, f"{LENGTHS}JOINT"]
    columns = [row[0] for row in table(root / "docs" / "outputs", "batch columns")]
    assert columns == [
        *(f"`{name}`" for name in HEAD), "`parameters.NAME`", "`components.PATH`", f"`{next(iter(RESULTS))}` ... `{list(RESULTS)[-1]}`",
        "`length.JOINT`", *(f"`{name}`" for name in (*TAIL, *RUN)),
    ]


def test_ambiguous_name_needs_a_prefix(root: Path, tmp_path: Path, shared_store: str) -> None:
    """The arm has a parameter `reach`, which is also the name of a result."""
    import shutil

    for folder in ("assemblies", "parts"):
        shutil.copytree(root / folder, tmp_path / folder)
    shutil.copy(root / "thingc.toml", tmp_path)
    text = "thingc: variants/1\nassembly: assemblies/arm.yaml\nname: arms\nparameters: {reach: [80 mm, 120 mm]}\n"
    text += "reach: {of: tip, from: base}\n"
    (tmp_path / "arms.yaml").write_text(text + "keep: [reach > 100 mm]\n")
    with pytest.raises(PlanError) as fault:
        plan(str(tmp_path / "arms.yaml"), options=Options(store=shared_store))
    (said,) = fault.value.diagnostics
    assert said.code is Code.RULE and said.help == "write `parameters.reach` or `results.reach`"
    (tmp_path / "arms.yaml").write_text(text + "keep: [parameters.reach > 100 mm, results.reach > 100 mm]\n")
    found = plan(str(tmp_path / "arms.yaml"), options=Options(store=shared_store))
    assert [v.failed for v in found] == ["parameters.reach > 100 mm", None]
    assert [rule.needs_results for rule in found.rules] == [False, True]


def test_huge_grid_is_rejected_before_it_is_computed(
    tmp_path: Path, shared_store: str, monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A value of an axis takes microseconds. Four axes with 6 700 values each, or three with 100 000, must not be computed to count
    them."""
    names = ["a", "b", "c"]
    (tmp_path / "r.yaml").write_text(
        "thingc: assembly/1\nname: r\nparameters: {a: 1 mm, b: 1 mm, c: 1 mm, d: 1}\n"
        "components: {base: {frame: true, mass: 1 g}}\nmodes: {m: {root: base, base: fixed}}\n"
    )
    axes = "".join(f"  {name}: {{from: 0 mm, to: 1000 mm, count: 100000}}\n" for name in names)
    (tmp_path / "v.yaml").write_text(f"thingc: variants/1\nname: v\nassembly: r.yaml\nparameters:\n{axes}  d: [1, 2]\n")
    start = time.process_time()
    with pytest.raises(PlanError) as raised:
        plan(str(tmp_path / "v.yaml"), options=Options(store=shared_store))
    assert time.process_time() - start < 1.0
    grid = "the number of variants (100000 x 100000 x 100000 x 2 = 2000000000000000)"
    assert f"{grid} exceeds the maximum (1000000)" in str(raised.value)
    (tmp_path / "v.yaml").write_text("thingc: variants/1\nname: v\nassembly: r.yaml\nparameters:\n"
                                     "  a: {from: 0 mm, to: 9 mm, count: 10}\n  b: {from: 0 mm, to: 9 mm, count: 10}\n")
    monkeypatch.setattr("thingc.batch.variants_document.MOST", 100)
    assert plan(str(tmp_path / "v.yaml"), options=Options(store=shared_store)).count == 100, "as many as may be"


def test_workers_need_only_files_of_the_workspace(tmp_path: Path, shared_store: str) -> None:
    """A document of an installed package is an input of the plan, but not a file in the workspace."""
    workspace(tmp_path, family=HEAD + "parameters: {length: [200 mm, 400 mm]}\n")
    document = tmp_path / "pendulum.yaml"
    text = document.read_text()
    assert "materials:\n" in text
    densities = "light: {density: 500 kg/m^3}, heavy: {density: 5000 kg/m^3}"
    (tmp_path / "own.yaml").write_text(f"thingc: materials/1\nmaterials: {{{densities}}}\n")
    listed = "materials: [own.yaml, thingc_stock.materials]\n"
    document.write_text(re.sub(r"materials:\n( +.*\n){2}", listed, text, count=1))
    found = plan(str(tmp_path / "family.yaml"), options=Options(store=shared_store))
    (tmp_path / "batch").mkdir()
    (tmp_path / "batch" / folder_layout.BATCH).write_text("{}")
    files = job.digest_files(found, str(tmp_path / "batch"))
    assert any("thingc_stock.materials" in name for name in found.inputs) and str(document) in files
    assert {path: state_of(path) for path in files} == files
