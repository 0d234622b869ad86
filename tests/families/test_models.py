"""Models that are created without a compilation equal the compiled ones bit by bit. For all other settings, the documents are compiled."""

from __future__ import annotations

import math
import random
import textwrap
from collections.abc import Mapping
from itertools import chain
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

import thingc
from families.documents import EVERYTHING, WORKSPACE
from thingc.batch import apply
from thingc.batch.families import Explanation, NoModel
from thingc.batch.mujoco_arrays.equality import different_fields
from thingc.driver.pipeline import UnknownChoice

NUMBERS: dict[str, float] = {
    "load": 0.5, "length": 0.3, "stiff": 50.0, "components.crank.mass": 0.3, "components.base.inertia.ixy": 0.001,
    "joints.lift.limit.upper": 1.5, "joints.lift.limit.velocity": 5.0, "joints.gear.mimic.offset": 0.1,
    "joints.gear.dynamics.armature": 0.001, "joints.turn.drive.kv": 2.0, "joints.neck.limit.cone": 0.7, "poses.low.lift": -0.35,
    "defaults.joint.dynamics.damping": 0.1, "teeth": 3.1,
    "components.tool.joints.close.dynamics.damping": 0.05, "components.tool.components.finger.mass": 0.05,
    "modes.stuck.contacts.adhesion.hook": 20.0, "joints.flip.drive.effort": 2.0,
}
"""Settings near the values in the document."""


UNSTATED = "components.tool.joints.close.dynamics.damping"
"""Settings of values that the document does not contain. A number is in SI units, and a string contains its unit."""


def settings(count: int, seed: int, names: Mapping[str, float] = NUMBERS) -> list[dict[str, Any]]:
    source = random.Random(seed)
    drawn = [{name: value * source.uniform(0.95, 1.05) for name, value in names.items()} for _ in range(count)]
    return [{name: f"{value!r} N*m*s/rad" if name == UNSTATED else value for name, value in one.items()} for one in drawn]


def compiled(family: thingc.RobotFamily, one: Mapping[str, Any], mode: str) -> mujoco.MjModel:
    """Compile the model with all compiler passes, without a family."""
    return thingc.compile(
        str(family._session.environment.document), modes=[mode],
        parameters={name: f"{value!r} {UNITS[name]}" for name, value in one.items() if "." not in name},
        choices={name: value if isinstance(value, str) else f"{value!r} {UNITS[name]}" for name, value in one.items() if "." in name},
    ).modes[mode].model()


STRUNG: dict[str, tuple[float, str]] = {
    "lever": (0.012, "m/rad"), "tendons.cable.joints.knee": (-0.008, "m/rad"), "tendons.band.joints.pitch": (-0.5, ""),
    "tendons.cable.limit.upper": (0.025, "m"), "tendons.cable.dynamics.rest": (0.005, "m"),
    "tendons.cable.dynamics.stiffness": (200.0, "N/m"), "tendons.cable.dynamics.damping": (3.0, "N*s/m"),
    "tendons.cable.drive.kp": (900.0, "N/m"), "tendons.band.dynamics.friction": (0.1, "N*m"),
    "joints.roll.dynamics.rest": (0.09, "rad"), "joints.roll.dynamics.stiffness": (3.0, "N*m/rad"),
    "joints.pitch.dynamics.armature": (0.003, "kg*m^2"), "joints.knee.offset": (0.07, "rad"), "components.thigh.mass": (0.8, "kg"),
    "components.shank.mass": (0.4, "kg"), "poses.bent.knee": (-0.52, "rad"), "reach": (0.06, "m"),
    "tendons.rope.dynamics.stiffness": (40.0, "N/m"), "tendons.rope.drive.kp": (60.0, "N/m"),
}
"""Settings of `strung.yaml` near its values, with units."""

UNITS = {
    "load": "kg", "length": "m", "stiff": "N*m/rad", "components.crank.mass": "kg", "components.base.inertia.ixy": "kg*m^2",
    "joints.lift.limit.upper": "rad", "joints.lift.limit.velocity": "rad/s", "joints.gear.mimic.offset": "rad",
    "joints.gear.dynamics.armature": "kg*m^2", "joints.turn.drive.kv": "N*m*s/rad", "joints.neck.limit.cone": "rad",
    "poses.low.lift": "rad", "defaults.joint.dynamics.damping": "N*m*s/rad", "teeth": "",
    "drum": "m", "axle": "m",
    "components.tool.components.finger.mass": "kg", "modes.stuck.contacts.adhesion.hook": "N", "joints.flip.drive.effort": "N*m",
    **{name: unit for name, (_, unit) in STRUNG.items()},
}


@pytest.mark.parametrize("mode", ["standing", "hanging", "loose", "stuck"])
def test_models_equal_compiled_models(everything: thingc.RobotFamily, mode: str) -> None:
    """In the last mode, the position of the held mount in a pose requires a search."""
    many = settings(4, 1)
    for one, model in zip(many, everything.models(many, mode=mode, share=True, visual=True), strict=True):
        assert isinstance(model, mujoco.MjModel)
        assert different_fields(model, compiled(everything, one, mode)) == []
    cache = everything._models_of(mode, True).cache_for(everything._reader.read(many[0]))
    assert cache.failure is None and cache.reasons == {} and len(cache.plans) == 1
    assert cache.find(everything._reader.read(many[-1])) is not None


@pytest.mark.parametrize("name", [None, *STRUNG])
def test_tendons_and_springs_are_written_into_arrays(strung: thingc.RobotFamily, name: str | None) -> None:
    """All settings are changed together, and one at a time, because MuJoCo may compute one field from several settings."""
    source, mode = random.Random(8), "footed" if name is None else "standing"
    names = STRUNG if name is None else {name: STRUNG[name]}
    many = [{name: value * source.uniform(0.95, 1.05) for name, (value, _) in names.items()} for _ in range(2)]
    for one, model in zip(many, strung.models(many, mode=mode, share=True, visual=True), strict=True):
        whole = compiled(strung, one, mode)
        assert isinstance(model, mujoco.MjModel) and different_fields(model, whole) == []
    plan = strung._models_of(mode, True).cache_for(strung._reader.read(many[-1])).find(strung._reader.read(many[-1]))
    assert plan is not None and type(plan[0].template).__name__ == "Arrays"


@pytest.mark.parametrize(("path", "way", "old", "new"), [
    ("modes.loose.gravity.2", "arrays", "gravity: 0 0 -1.6 m/s^2", "gravity: [0, 0, {} m/s^2]"),
    ("modes.loose.at.xyz.2", "text", "at: {xyz: 0 0 500 mm}", "at: {xyz: [0 mm, 0 mm, '{} m']}"),
    ("components.arm.com.1", "arrays", "com: [=length / 2, 0, 1 mm]", "com: [=length / 2, '{} m', 1 mm]"),
    ("components.flap.shapes.0.friction.slide", "arrays", "friction: {slide: 0.5}", "friction: {slide: {}}"),
    ("components.flap.shapes.0.at.xyz.0", "text", "at: {xyz: 10 20 30 mm}", "at: {xyz: ['{} m', 20 mm, 30 mm]}"),
])
def test_elements_of_vectors_and_lists_are_numbers(tmp_path: Path, path: str, way: str, old: str, new: str) -> None:
    """The result equals that of a document that contains the values."""
    shape = "{link: true, shapes: [{sphere: {radius: 5 mm}, at: {xyz: 10 20 30 mm}, friction: {slide: 0.5}}], mass: 0.1 kg"
    text = EVERYTHING.replace("flap: {frame: true, mass: 0.1 kg", f"flap: {shape}")
    for name, own in {**WORKSPACE, "everything.yaml": text}.items():
        (tmp_path / name).write_text(own)
    many = [0.25 + 0.01 * k for k in range(4)]
    with thingc.family(tmp_path / "everything.yaml", mode="loose", verify=0) as family:
        models = [family.model({path: value}) for value in many]
        assert family.explain(path).way == way
    for value, model in zip(many, models, strict=True):
        (tmp_path / "everything.yaml").write_text(text.replace(old, new.replace("{}", repr(value))))
        whole = thingc.compile(tmp_path / "everything.yaml", modes=["loose"]).modes["loose"].model()
        assert isinstance(model, mujoco.MjModel) and different_fields(model, whole) == []


@pytest.mark.parametrize("name", ["drum", "axle"])
def test_shapes_around_which_tendons_wrap(strung: thingc.RobotFamily, name: str) -> None:
    """The settings include those at which a tendon begins or ceases to touch a shape."""
    value = {"drum": 0.025, "axle": 0.07}[name]
    many = [{name: value * share} for share in (1.0, 1.03, 0.21, 2.0, 1.1, 0.97)]
    for visual in (True, False):
        met = set()
        for one, model in zip(many, strung.models(many, mode="standing", share=True, visual=visual), strict=True):
            assert isinstance(model, mujoco.MjModel), model
            whole = compiled(strung, one, "standing")
            lengths = [lengths_of(one) for one in (model, whole)]
            assert lengths[0] == lengths[1] and (not visual or different_fields(model, whole) == [])
            met.add(tuple(lengths[0]))
        assert len(met) == len(many)


def lengths_of(model: mujoco.MjModel) -> list[float]:
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    return [*data.ten_length.tolist(), *model.tendon_lengthspring.ravel().tolist(), *data.ctrl.tolist()]


def test_number_at_an_unset_path_is_in_si_units(workspace: Path) -> None:
    with thingc.family(workspace / "everything.yaml", verify=0) as family:
        many = [{UNSTATED: 0.05 + 0.01 * k, "joints.l*.dynamics.stiffness": 3.0 + k} for k in range(4)]
        for one, model in zip(many, family.models(many, share=True, visual=True), strict=True):
            assert isinstance(model, mujoco.MjModel), model
            said = {UNSTATED: f"{one[UNSTATED]!r} N*m*s/rad", "joints.lift.dynamics.stiffness": f"{3.0 + many.index(one)!r} N*m/rad"}
            assert different_fields(model, compiled(family, said, "standing")) == []
        assert family.explain(UNSTATED).way == "arrays"
        (refused,) = family.models([{"joints.lift.dynamics.damping": -1.0}])
        assert isinstance(refused, NoModel) and "`dynamics.damping` of joint `lift` must be at least 0" in refused.problems[0].message


def test_shared_models_are_reused_and_others_are_copies(everything: thingc.RobotFamily) -> None:
    many = settings(3, 2)
    list(everything.models(many, mode="standing", visual=True))  # the first come by every pass
    lent = list(everything.models(many, mode="standing", share=True, visual=True))
    own = list(everything.models(many, mode="standing", visual=True))
    assert len({id(model) for model in lent}) == 1 and len({id(model) for model in own}) == 3
    assert different_fields(lent[0], own[-1]) == [] and "body_mass" in different_fields(own[0], own[1])


@pytest.mark.parametrize("one", [{"load": 0.51}, {"heavy": True}])
def test_changes_of_a_model_do_not_affect_others(workspace: Path, one: dict[str, Any]) -> None:
    """This holds for models whose arrays are changed by settings, and for cached compiled models."""
    with thingc.family(workspace / "everything.yaml", verify=1) as family:
        honest = family.model(one, visual=False)
        for lent in chain((next(family.models([one], share=True)) for _ in range(5)), family.models([one] * 5, share=True)):
            assert isinstance(lent, mujoco.MjModel)
            lent.opt.timestep, lent.opt.gravity[:], lent.body_mass[:], lent.dof_damping[:], lent.body_pos[:] = 0.5, 7.0, 77.0, 7.0, 7.0
        assert all(cache.failure is None for cache in family._models_of(None, False).caches.values())  # no plan is to blame
        assert different_fields(family.model(one, visual=False), honest) == []
        assert [different_fields(model, honest) for model in family.models([one, one])] == [[], []]
        (group,) = family.batched([one]).groups
        assert different_fields(group.model, honest) == []
        explained = family.explain("load")
        assert isinstance(explained, Explanation) and explained.way == "arrays"


def test_compiled_models_are_cached(everything: thingc.RobotFamily) -> None:
    first, again = (next(everything.models([{"heavy": True}], share=True, visual=True)) for _ in range(2))
    own = everything.model({"heavy": True})
    assert first is again and own is not first and different_fields(own, first) == []


def test_errors_name_the_setting_and_others_continue(everything: thingc.RobotFamily) -> None:
    good = settings(1, 3)[0]
    wrong = [
        ({"load": 30.0}, "TC803", "parameter `load` must be at most 20 kg, found `30 kg`"),
        ({"joints.lift.limit.upper": "5 kg"}, "TC809", "expected an angle or a length (such as 30 deg or 120 mm), found a mass (`5 kg`)"),
        ({"joints.lift.limit.uper": 1.0}, "TC809", "`joints.lift.limit` has no key `uper`"),
        ({"joints.x*.dynamics.damping": 1.0}, "TC809", "the document has no element `joints.x*.dynamics.damping`"),
        ({**good, "load": 30.0}, "TC803", "must be at most 20 kg"),
        ({**good, "load": math.nan}, "TC803", "parameter `load`: expected a number with a unit, found `nan kg`"),
        ({"load": -(10**400)}, "TC803", "parameter `load`: expected a number with a unit, found `-inf kg`"),
        ({"load": np.True_}, "TC803", "parameter `load` of `everything` must be a mass (such as 120 g), found a boolean (`true`)"),
        ({"load": np.array([0.1, 0.2])}, "TC803", "parameter `load`: expected a number with a unit, found `array([0.1, 0.2])`"),
        ({"load": "\ud800"}, "TC803", "parameter `load`: half of a surrogate pair (U+D800) is not allowed in a document"),
        ({"joints.lift.limit.upper": "\x071 rad"}, "TC809",
         "`joints.lift.limit.upper`: a control character (U+0007) is not allowed in a document"),
        ({5: 1.0}, "TC809", "the document has no element `5`"),
        ({"modes.loose.gravity.3": 1.0}, "TC809", "the list `modes.loose.gravity` has no item `3`"),
        ({"components.arm.com.x": 1.0}, "TC809", "the list `components.arm.com` has no item `x`"),
        ({"modes.loose.gravity.2": "fast"}, "TC809", "expected an acceleration (such as `9.81 m/s^2`), found the string `fast`"),
        ({"components.arm.com.1": "5 kg"}, "TC809", "expected a length (such as 120 mm), found a mass (`5 kg`)"),
        ({**good, "joints.lift.limit.upper": -3.0}, "TC324", "in the limits of joint `lift`"),
    ]
    found = list(everything.models([one for case in wrong for one in (good, case[0])], share=True, visual=True))
    assert all(isinstance(model, mujoco.MjModel) for model in found[::2])
    for (given, code, words), refused in zip(wrong, found[1::2], strict=True):
        assert isinstance(refused, NoModel) and not refused and refused.settings == given
        assert words in repr(refused) and "\n" not in repr(refused)
        assert refused.problems[0].code.code.startswith(code) and words in refused.problems[0].message, refused.problems[0].message
    assert repr(everything.model({"joints.*.dynamics.stiffness": "5"})).count("an angular stiffness needs a unit, found `5`") == 1
    for number in (5, "load", None, [("load", 0.5)]):
        words = f"settings must be a mapping from names to values, found {type(number).__name__} `{number}`"
        (refused,) = everything.models([number])  # type: ignore[list-item]
        assert isinstance(refused, NoModel) and refused.problems[0].message == words
        if not isinstance(number, list):  # which is many settings, of which one is a pair
            assert everything.evaluate(number).problems[0].message == words  # type: ignore[call-overload]
            assert everything.batched(number).refused[0].problems[0].message == words  # type: ignore[arg-type]
    for mode in ("stading", 5):
        with pytest.raises(UnknownChoice, match=f"has no mode `{mode}`"):
            everything.model({}, mode=mode)  # type: ignore[arg-type]


def test_strings_and_numbers_are_equivalent(everything: thingc.RobotFamily) -> None:
    first, second = (everything.model(one) for one in ({"load": "612 g", "length": "31 cm"}, {"load": 0.612, "length": np.float64(0.31)}))
    assert different_fields(first, second) == []


def test_pattern_matches_several_names(everything: thingc.RobotFamily) -> None:
    model = everything.model({"joints.*.dynamics.damping": 0.3}, mode="standing")
    assert set(model.dof_damping) == {0.3}  # that of the tool, in its own document, too
    damped = everything.model({"components.*.joints.*.dynamics.damping": 0.3}, mode="standing").dof_damping
    usual = everything.model({}, mode="standing").dof_damping
    assert [(was, now) for was, now in zip(usual, damped, strict=True) if was != now] == [(0.0, 0.3)]  # that of the tool alone


def test_patterns_of_parameters_and_their_errors(everything: thingc.RobotFamily) -> None:
    assert everything.numbers({"l*": 0.4}) == {"load": 0.4, "length": 0.4}
    for name, hint in {
        "x*": "known parameters: `", "joints.x*.limit.upper": "known names: `", "jonts.*.limit.upper": "did you mean `joints`?",
        "x*.*": "known names: `",
    }.items():
        (problem,) = everything.evaluate({name: 0.3}).problems
        assert problem.message == f"the document has no element `{name}`" and problem.help and problem.help.startswith(hint)
    (problem,) = everything.evaluate({"joints.x*.limit.upper": 0.3}).problems
    assert problem.help and "`lift`" in problem.help


def test_single_setting_equals_a_list_of_one(everything: thingc.RobotFamily) -> None:
    assert [bool(model) for model in everything.models({"load": 0.5})] == [True]
    assert [group.indices for group in everything.batched({"load": 0.5}).groups] == [(0,)]


@pytest.mark.parametrize(("name", "way", "words"), [
    ("load", "arrays", "changes body_inertia, body_ipos, body_iquat, body_mass of one compiled model (mode standing)"),
    ("joints.lift.limit.upper", "arrays", "changes actuator_ctrlrange, jnt_range of one compiled model (mode standing)"),
    ("joints.gear.dynamics.rest", "arrays", "changes qpos_spring of one compiled model (mode standing)"),
    ("simulation.timestep", "text", "MuJoCo uses `connect.solref` at compile time (mode standing)"),
    # by its inertia the arm of the second point of a hinge that closes a loop is chosen
    ("components.rocker.mass", "arrays", "changes body_inertia, body_ipos, body_iquat, body_mass, site_pos of one compiled model"),
    ("heavy", "passes", "heavy is compiled again: the setting is not a number in the document (mode standing)"),
])
def test_explanations(everything: thingc.RobotFamily, name: str, way: str, words: str) -> None:
    explained = everything.explain(name)
    assert isinstance(explained, Explanation) and explained.way == way and words in str(explained)


@pytest.mark.parametrize(("name", "value", "words"), [
    ("laod", None, "`everything` has no parameter `laod`"),
    ("joints.lft.limit.upper", None, "`joints` has no key `lft`"),
    ("joints.lift", None, "expected the path of a value, found the mapping `joints.lift`"),
    ("load", 30.0, "parameter `load` must be at most 20 kg, found `30 kg`"),
])
def test_invalid_settings_have_no_explanation(everything: thingc.RobotFamily, name: str, value: float | None, words: str) -> None:
    refused = everything.explain(name, value)
    assert isinstance(refused, NoModel) and refused.problems[0].message == words


def test_numbers_that_change_a_decision_are_compiled(everything: thingc.RobotFamily) -> None:
    """The compiler treats joints without damping in a special way, so a plan of other numbers does not apply to them."""
    names = {"load": 0.5, "teeth": 3.1, "defaults.joint.dynamics.damping": 0.1}
    special = [{**names, "teeth": 3.0}, {**names, "defaults.joint.dynamics.damping": 0.0}]  # a plan applies to whole numbers
    many = [*settings(3, 4, names), *special, *settings(2, 5, names)]
    found = list(everything.models(many, mode="standing", visual=True))
    for one, model in zip(many, found, strict=True):
        assert isinstance(model, mujoco.MjModel) and different_fields(model, compiled(everything, one, "standing")) == []
    cache = everything._models_of("standing", True).cache_for(everything._reader.read(many[0]))
    assert cache.find(everything._reader.read(many[0])) is not None and cache.misses == 3


TWINS = """\
thingc: assembly/1
name: twins
parameters: {same: {value: 1 kg, max: 1 kg}, most: {value: 1 kg, max: 1 kg}}
components:
  base: {frame: true, mass: =most}
  a: {frame: true, mass: 1 kg, com: 1 2 3 mm, inertia: {ixx: 0.001 kg*m^2, iyy: 0.002 kg*m^2, izz: 0.002 kg*m^2}}
  b: {frame: true, mass: 1 kg, com: 1 2 3 mm, inertia: {ixx: 0.001 kg*m^2, iyy: 0.002 kg*m^2, izz: 0.002 kg*m^2}}
  c: {frame: true, mass: =same, com: 1 2 3 mm, inertia: {ixx: 0.001 kg*m^2, iyy: 0.002 kg*m^2, izz: 0.002 kg*m^2}}
defaults: {joint: {limit: {lower: -1 rad, upper: 1 rad}}}
joints:
  left: {type: revolute, parent: base.origin, child: a.origin}
  right: {type: revolute, parent: base.origin, child: b.origin, drive: {kind: position, kp: 5 N*m/rad, effort: 5 N*m}}
  back: {type: revolute, parent: base.origin, child: c.origin}
modes: {standing: {root: base, base: fixed}}
"""


@pytest.mark.parametrize("more", [{}, {"components.b.mass": "1.0 kg"}, {"components.b.mass": 1.0}, {"components.b.mass": "=most"}])
def test_equal_numbers_are_distinguished(tmp_path: Path, more: dict[str, Any]) -> None:
    """A plan is created at a bound of a mass. Other masses have the same value."""
    (tmp_path / "twins.yaml").write_text(TWINS)
    many = [{"components.a.mass": mass, "most": 1.0, "joints.right.drive.kp": 0.0, **more} for mass in (1.5, 1.0, 1.0, 1.7, 1.8, 1.9, 1.0)]
    with thingc.family(tmp_path / "twins.yaml", verify=0) as twins:
        models = [model.body_mass.tolist() for model in twins.models(many)]
        results = [one["mass"] for one in twins.evaluate(many)]
        (cache,) = twins._models_of(None, False).caches.values()
    assert models == [[0.0, 1.0, one["components.a.mass"], 1.0, 1.0] for one in many]
    assert results == pytest.approx([3.0 + one["components.a.mass"] for one in many], abs=1e-12)
    assert cache.plans and cache.failure is None


def with_constant_mass(plan: Any) -> None:
    """Make a plan wrong by replacing the mass of a body by a constant."""
    numbers = plan.template._numbers
    numbers.constants[0], numbers.inertials[0, 0] = 1.25, len(plan.program.outputs)


def test_wrong_plan_is_found_and_discarded(workspace: Any) -> None:
    with thingc.family(workspace / "everything.yaml", verify=2) as family:
        many = settings(5, 5, {"load": 0.5})
        list(family.models(many, visual=True))
        (cache,) = family._models_of(None, True).caches.values()
        with_constant_mass(cache.plans[0])
        models = list(family.models(many, visual=True))
        assert cache.plans == [] and "a plan gave a different `" in str(cache.failure)
        for one, model in zip(many, models, strict=True):  # one in two is looked at: the first of these, and then nothing follows the plan
            assert different_fields(model, compiled(family, one, "standing")) == []


def test_each_plan_is_checked(workspace: Path) -> None:
    with thingc.family(workspace / "everything.yaml") as family:
        list(family.models(settings(8, 5, {"load": 0.5})))
        many = settings(3, 5, {"components.crank.mass": 0.3})
        list(family.models(many[:2]))
        _, cache = family._models_of(None, False).caches.values()
        with_constant_mass(cache.plans[0])
        (model,) = family.models(many[2:])  # the second that this plan gives
        assert cache.plans == [] and "a plan gave a different `" in str(cache.failure)
        assert different_fields(model, compiled(family, many[2], "standing")) == []


def test_many_settings_share_few_models(everything: thingc.RobotFamily) -> None:
    many = [*settings(5, 6, {"load": 0.5, "poses.low.lift": -0.35}), {"load": 30.0}, {"heavy": True, "load": 0.7}]
    many.append({"components.weight.mass": "0.7 kg", "joints.lift.limit.effort": "7 N*m"})
    batches = everything.batched(many, mode="standing")
    assert list(batches.refused) == [5] and "must be at most 20 kg" in batches.refused[5].problems[0].message
    assert [group.indices for group in batches.groups] == [(0, 1, 2, 3, 4, 6, 7)]
    (group,) = batches.groups
    assert {"body_mass", "body_ipos", "key_qpos", "actuator_forcerange", "stat.meanmass"} <= set(group.fields)
    assert "jnt_range" not in group.fields and group.fields["body_mass"].shape == (7, group.model.nbody)
    own = [model for model in everything.models(many, mode="standing") if isinstance(model, mujoco.MjModel)]
    for place, model in enumerate(own):
        apply(group.model, group.fields, place)
        assert different_fields(group.model, model) == []


def test_other_differences_create_groups(everything: thingc.RobotFamily) -> None:
    batches = everything.batched([{"load": 0.4}, {"simulation.integrator": "euler"}, {"load": 0.6}], mode="standing")
    assert [group.indices for group in batches.groups] == [(0, 2), (1,)] and batches.refused == {}
    assert batches.groups[1].fields == {} and batches.groups[1].model.opt.integrator == mujoco.mjtIntegrator.mjINT_EULER


MIRRORED = {
    "legs.yaml": """
        thingc: assembly/1
        name: legs
        parameters: {off: 5 mm}
        components:
          torso: {frame: true, mass: 1 kg, inertia: {ixx: 1e-3 kg*m^2, iyy: 1e-3 kg*m^2, izz: 1e-3 kg*m^2}, mounts: {a: {xyz: 0 40 5 mm}}}
          leg: {assembly: leg.yaml, mirror: y, parameters: {off: =off}, attach: {mount: top, to: torso.a, turn: 155 deg}}
        modes: {still: {root: torso}}
    """,
    "leg.yaml": """
        thingc: assembly/1
        name: leg
        parameters: {off: 1 mm}
        components:
          hip: {frame: true, mounts: {top: {xyz: [=off, =2*off, 3 mm], rpy: 10 -80 20 deg}}, mass: 1 kg, com: [=off, =off, 0 mm],
            inertia: {ixx: 1e-3 kg*m^2, iyy: 1e-3 kg*m^2, izz: 1e-3 kg*m^2}}
          foot: {frame: true, mass: 1 kg, inertia: {ixx: 1e-3 kg*m^2, iyy: 1e-3 kg*m^2, izz: 1e-3 kg*m^2}}
        joints: {slide: {type: prismatic, parent: hip.top, child: foot.origin, gap: =off, limit: {lower: 0 mm, upper: 90 mm}}}
        mounts: {top: hip.top}
    """,
}


def test_numbers_in_a_mirrored_assembly(tmp_path: Path) -> None:
    for name, text in MIRRORED.items():
        (tmp_path / name).write_text(textwrap.dedent(text))
    with thingc.family(tmp_path / "legs.yaml", verify=0) as family:
        found = family.model({"off": 0.0125})
        assert family.explain("off").way == "arrays", family.explain("off")
    compiled = thingc.compile(tmp_path / "legs.yaml", parameters={"off": "12.5 mm"}).modes["still"].model()
    assert isinstance(found, mujoco.MjModel) and different_fields(compiled, found) == []
