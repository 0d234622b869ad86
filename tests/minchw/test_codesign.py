"""`examples/codesign.py`: the effort of a walk compared with MuJoCo, reasons for failed walks, interrupted searches, and the results in
docs/studies/codesign.md."""

from __future__ import annotations

import importlib
import re
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

import mujoco
import numpy as np
import pytest
from optuna.storages import InMemoryStorage, JournalStorage
from optuna.storages.journal import JournalFileBackend

import thingc
from conformance.harness import ROOT

pytestmark = pytest.mark.slow

PAGE = ROOT / "docs" / "studies" / "codesign.md"


@pytest.fixture(scope="module")
def codesign() -> ModuleType:
    """The example, imported as a module."""
    folder = str(ROOT / "examples")
    sys.path.insert(0, folder)
    try:
        return importlib.import_module("codesign")
    finally:
        sys.path.remove(folder)


@pytest.fixture(scope="module")
def robots(codesign: ModuleType, minchw: Path, shared_store: str) -> Iterator[thingc.RobotFamily]:
    """MInchW as published. Its parts are in the store."""
    with thingc.family(codesign.DOCUMENT, store=shared_store) as robots:
        yield robots


def test_effort_of_a_walk_equals_that_of_mujoco(codesign: ModuleType, robots: thingc.RobotFamily) -> None:
    walking = importlib.import_module("codesign_walk")
    by_hand = codesign.BY_HAND
    outcome, *_ = walking.evaluate(robots, [by_hand, walking.Design(leg=0.064, body=0.0947, stride=0.05, knee=1.5, pace=1.4)], 2)
    walk = walking.prepare(robots, by_hand)
    model, data = walk.model, mujoco.MjData(walk.model)
    mujoco.mj_setState(model, data, walk.start, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    drives = [model.actuator(name).id for name in walking.JOINTS]
    dofs = [int(model.joint(name).dofadr[0]) for name in walking.JOINTS]
    no_load = {"yaw": 4.1 / 0.8511329599, "knee": 10.6 / 3.3740847886, "ankle": 10.6 / 3.3740847886}  # rad/s
    slope = np.array([(4.1 if name.endswith("yaw") else 10.6) / no_load[name.partition("/")[2]] for name in walking.JOINTS])
    work = heat = 0.0
    soles = []
    for step, control in enumerate(walk.control):
        data.ctrl[:] = control
        speed = np.array(data.qvel[dofs])
        if step == walk.ends[0]:
            soles.append((data.site("front/sole").xpos + data.site("rear/sole").xpos)[0] / 2)
        mujoco.mj_step(model, data)
        if step >= walk.ends[0]:
            force = data.actuator_force[drives]
            work += float(np.abs(force * speed).sum()) * model.opt.timestep
            heat += float((force**2 / slope).sum()) * model.opt.timestep
    mujoco.mj_kinematics(model, data)
    soles.append((data.site("front/sole").xpos + data.site("rear/sole").xpos)[0] / 2)
    assert (outcome.work, outcome.heat) == pytest.approx((work, heat), rel=1e-6)
    assert outcome.distance == pytest.approx(soles[1] - soles[0], abs=1e-5) == pytest.approx(2 * by_hand.stride, abs=1e-3)
    assert outcome.seconds == pytest.approx(2 * 4.7) and outcome.value == outcome.distance / (outcome.work + outcome.heat)
    assert work > 9.81 * outcome.mass * outcome.distance  # it climbs
    shown = {row[:38].strip(): row[38:58].strip() for row in PAGE.read_text().partition("<!-- report -->\n")[2].split("```")[1].split("\n")}
    own = codesign.report({"make walk": codesign.Tried(design=by_hand, outcome=outcome)})
    assert {row[:38].strip(): row[38:].strip() for row in own.split("\n")}.items() <= {**shown, "": "make walk"}.items()


def test_failed_walk_has_a_reason(codesign: ModuleType, robots: thingc.RobotFamily) -> None:
    walking = importlib.import_module("codesign_walk")

    def design(**other: float) -> Any:
        return walking.Design(**{"leg": 0.064, "body": 0.0947, "stride": 0.09, "knee": 1.5, "pace": 1.0, **other})

    found = walking.evaluate(robots, [design(stride=0.3), design(knee=1.75, stride=0.05), design(pace=2.5), design(leg=0.3), design()], 1)
    assert [one.failed.partition(":")[0] for one in found] == [
        "the legs do not reach", "a joint is at its limit", "the supporting foot slips or detaches", "the document refuses it", "",
    ]
    assert [one.value > 0.0 for one in found] == [False] * 4 + [True]


def test_interrupted_search_has_the_same_result(
    codesign: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A formula replaces the walks. The search is stopped before a round, during a round, and while it requests walks."""
    outcome = importlib.import_module("codesign_walk").Outcome
    left = [10**9]

    def evaluate(robots: Any, designs: Sequence[Any], threads: int) -> list[Any]:
        made = []
        for one in designs:
            left[0] -= 1
            if left[0] < 0:
                raise KeyboardInterrupt
            failed = "too far" if one.stride > 0.2 else ""
            made.append(outcome(failed=failed, distance=one.stride, work=1.0 + (one.leg - 0.1) ** 2, heat=abs(one.pace - 1.0) + one.body))
        return made

    monkeypatch.setattr(codesign, "evaluate", evaluate)
    monkeypatch.setattr(codesign, "AT_RANDOM", 16)
    monkeypatch.setattr(codesign, "TOGETHER", 8)

    kept = {name: InMemoryStorage() for name in ("whole", "asked", "told")}

    def search(name: str) -> Any:
        storage = kept.get(name) or JournalStorage(JournalFileBackend(str(tmp_path / name)))
        return codesign.search(None, storage, "walks", 30, 3, None, 1)

    whole = search("whole")
    assert len(whole) == 30 and len({one.design for one in whole}) == 30
    assert codesign.best_of(whole[16:]).outcome.value > codesign.best_of(whole[:16]).outcome.value  # it learns
    ask, told = codesign._trial, codesign.optuna.Study.tell
    for stop in (5, 13):
        left[0] = stop
        with pytest.raises(KeyboardInterrupt):
            search("stopped")
    left[0] = 10**9

    def stopping(function: Any, count: int) -> Any:
        counted = iter(range(count))

        def stopped(*given: Any) -> Any:
            if next(counted, None) is None:
                raise KeyboardInterrupt
            return function(*given)

        return stopped

    for count in (3, 21):
        monkeypatch.setattr(codesign, "_trial", stopping(ask, count))
        with pytest.raises(KeyboardInterrupt):
            search("asked")
    monkeypatch.setattr(codesign, "_trial", ask)
    for count in (3, 12):
        monkeypatch.setattr(codesign.optuna.Study, "tell", stopping(told, count))
        with pytest.raises(KeyboardInterrupt):
            search("told")
    monkeypatch.setattr(codesign.optuna.Study, "tell", told)
    assert search("stopped") == search("asked") == search("told") == search("whole") == whole


def test_page_shows_the_output() -> None:
    text = PAGE.read_text()
    tried = re.findall(r"^ +(\d+) (.+)$", text.partition("<!-- report of what was tried -->\n")[2].split("```")[1], re.MULTILINE)
    total, to_the_end = int(tried[0][0]), int(re.search(r"walks, (\d+) of them", tried[0][1])[1])  # type: ignore[index]
    assert total == 1000 and to_the_end + sum(int(count) for count, _ in tried[1:]) == total
    assert (ROOT / "docs" / "pictures" / "codesign.png").is_file()
