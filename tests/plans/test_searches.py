"""Loops are closed by one operation of a tape, so a plan also applies to settings for which the search takes other steps."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import thingc
from families.documents import EVERYTHING, TOOL
from families.test_models import NUMBERS, settings
from thingc.batch.families import NoModel
from thingc.batch.mujoco_arrays.equality import different_fields
from thingc.batch.plans.columns import column_function
from thingc.batch.plans.program import program_of
from thingc.batch.plans.searches import SearchMemo
from thingc.batch.plans.tape import Tape
from thingc.model.robot import loop_solver

LINKAGE = {
    "components.crank.mounts.pin.xyz.0": 0.1, "components.coupler.mounts.pin.xyz.0": 0.4, "components.rocker.mounts.pin.xyz.0": 0.1,
    "poses.low.turn": 0.1,
}


@pytest.fixture
def everything(tmp_path: Path) -> Path:
    (tmp_path / "thingc.toml").write_text("thingc = 'workspace/1'\n")
    (tmp_path / "tool.yaml").write_text(TOOL)
    document = tmp_path / "everything.yaml"
    document.write_text(EVERYTHING)
    return document


@pytest.mark.parametrize("mode", ["standing", "hanging", "stuck"])
def test_plan_applies_to_other_sizes_of_a_linkage(everything: Path, mode: str) -> None:
    many = settings(4, 3, LINKAGE)
    with thingc.family(everything, verify=0) as family, thingc.family(everything) as other:
        for one in many:
            model, whole = family.model(one, mode=mode), other._models_of(mode, True)._compile(other._reader.read(one))
            assert not isinstance(model, NoModel) and not isinstance(whole, tuple)
            assert different_fields(model, whole) == []
        cache = family._models_of(mode, True).cache_for(family._reader.read(many[0]))
        assert not cache.reasons and sum(cache.find(family._reader.read(one)) is not None for one in many) >= 3
        assert len(cache.plans) <= 2
        results = family.evaluate(many)
        assert results == [other._evaluation_of(other.mode)._evaluate_by_passes(one, other._reader.read(one), False) for one in many]


def test_numbers_that_do_not_affect_a_loop_do_not_search_again(everything: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    names = {name: NUMBERS[name] for name in ("load", "joints.lift.limit.velocity", "joints.gear.dynamics.armature", "stiff")}
    first, second, *others = settings(6, 4, names)
    with thingc.family(everything, verify=0) as family:
        assert all(family.models([first, second], mode="stuck"))
        searched: list[Any] = []
        monkeypatch.setattr(loop_solver.Loops, "close", lambda *arguments, **named: searched.append(arguments))
        assert all(family.models(others, mode="stuck")) and not searched


def test_plan_does_not_apply_if_a_loop_does_not_close(everything: Path) -> None:
    """The rods are too short for the distance of the pins. The plan does not apply, and a compilation reports the error."""
    with thingc.family(everything, verify=0) as family:
        many = settings(3, 5, LINKAGE)
        assert all(family.models(many, mode="standing"))
        one = {**many[0], "components.coupler.mounts.pin.xyz.0": 0.1}
        refused = family.model(one, mode="standing")
        assert isinstance(refused, NoModel) and [problem.code.code for problem in refused.problems] == ["TC604"]


def search(length: Any) -> tuple[float, tuple[float, str]]:
    """Halve a number until it is small. The number of steps is part of the result."""
    value, steps = length, 0
    while value > 1.0:
        value, steps = value / 2.0, steps + 1
    return value, (float(steps), "odd" if value < 0.6 else "even")


def test_tape_rejects_results_of_another_structure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("thingc.batch.plans.searches.SEARCHES", (search.__name__,))
    tape = Tape()
    memo = SearchMemo(tape)
    value, (steps, word) = memo("a", search, tape.variable(3.0))
    assert (value.value, steps.value, word) == (0.75, 2.0, "even") and len(tape.operations) == 1
    program = program_of(tape, [value, steps])
    run = program.run
    assert run(7.0) == (0.875, 3.0)
    with pytest.raises(ValueError, match="a different result"):
        run(4.5)  # 0.5625
    columns, ok = column_function(program)(np.array([[7.0], [4.5], [3.0]]))
    assert ok.tolist() == [True, False, True] and columns[[0, 2]].tolist() == [[0.875, 3.0], [0.75, 2.0]]
    assert program_of(tape, []).run(3.5) == ()
    with pytest.raises(ValueError, match="a different result"):
        program_of(tape, []).run(4.5)


def test_search_without_traced_numbers_is_not_recorded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("thingc.batch.plans.searches.SEARCHES", (search.__name__,))
    tape = Tape()
    memo = SearchMemo(tape)
    assert memo("a", search, 3.0) == (0.75, (2.0, "even")) and not tape.lines and not tape.operations
