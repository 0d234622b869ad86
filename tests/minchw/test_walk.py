"""`examples/walk.py` on the floor and under a ceiling, with held and free bases: bounds for all reported values, and the
results in docs/studies/walking.md."""

from __future__ import annotations

import importlib
import re
import sys
from math import degrees, radians
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from conformance.harness import ROOT

from .conftest import sole

pytestmark = pytest.mark.slow

STEPS = {"floor": 1, "ceiling": 3}
"""The number of steps. Under the ceiling, as many as on the page, because an inclined landing affects the next landing. `make walk` also
walks on the wall."""
WAYS = ("rooted", "free")


@pytest.fixture(scope="module")
def walking() -> ModuleType:
    """The example, imported as a module."""
    folder = str(ROOT / "examples")
    sys.path.insert(0, folder)
    try:
        return importlib.import_module("walk")
    finally:
        sys.path.remove(folder)


@pytest.fixture(scope="module")
def walked(walking: ModuleType, minchw: Path) -> dict[tuple[str, str], object]:
    return {(place, way): seen for place, steps in STEPS.items() for (_, way), seen in walking.walk(minchw, steps, places=[place]).items()}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("place", STEPS)
def test_steps(walking: ModuleType, walked: dict, place: str, way: str) -> None:
    seen = walked[place, way]
    assert seen.steps == STEPS[place]
    assert seen.progress == pytest.approx(STEPS[place] * walking.STRIDE, abs=5e-4)
    assert seen.slips["standing"] < (1e-9 if way == "rooted" else 2e-4)
    assert seen.slips["landing"] < 1e-4
    assert seen.tilt < 2e-3
    assert seen.touches == set()
    assert 10.0 < seen.pull < (240.0 if place == "ceiling" else 200.0)  # of 300 N
    assert 0.0 < seen.shear < 0.5
    assert all(0.0 <= part < 0.6 for part in seen.torque.values())
    assert max(seen.torque, key=seen.torque.__getitem__).endswith(("ankle", "knee"))
    assert seen.speed < 0.9
    assert seen.tracking < radians(0.5)
    assert seen.removed < 1e-4 and seen.removed_angular < 1e-4
    assert (seen.removed > 0.0) == (way == "rooted")  # nothing to remove without a switch


def test_moment_at_the_foot_comes_from_the_weight(walking: ModuleType, walked: dict, minchw: Path) -> None:
    """The pull at the holding foot comes from the weight at its distance, with bounds on both sides. The weight presses the foot to the
    floor, and pulls it off a ceiling. The impact of the landing of the other foot is added."""
    climb = importlib.import_module("inchworm_physics").Climb(minchw, "")
    model = climb.held["rear"].model
    foot = float(model.body("front/foot").mass[0]) * 9.81
    rest = float(model.body_mass.sum()) * 9.81 - 2 * foot
    moment = foot * (walking.SHORT + walking.STRIDE) + rest * (walking.SHORT + walking.STRIDE) / 2
    for way in WAYS:
        assert 1.0 < walked["floor", way].pull / (moment / 0.025 - (2 * foot + rest)) < 1.3
        assert 1.0 < walked["ceiling", way].pull / (moment / 0.025 + (2 * foot + rest)) < 1.15


def test_plan_agrees_with_planar_kinematics(walking: ModuleType, minchw: Path) -> None:
    gait, physics = importlib.import_module("inchworm_gait"), importlib.import_module("inchworm_physics")
    climb = physics.Climb(minchw, "")
    plan = gait.swings(climb.models, 1, walking.SHORT, walking.STRIDE, walking.LIFT, walking.SINK)
    assert [(swing.holds, swing.moves) for swing in plan] == [("rear", "front"), ("front", "rear")]
    joints = 0
    for swing, begin, end in zip(plan, (0.31, 0.40), (0.40, 0.31), strict=True):
        instants = list(swing.instants(0.05))
        lifted = []
        for now in instants:
            q = {name: degrees(value) for name, value in zip(gait.JOINTS, now.q, strict=True)}
            joints = max(joints, *(abs(value) for value in now.q))
            (xf, zf, upf), (xr, zr, upr) = sole("front", q), sole("rear", q)
            # Both soles level in the world: the body pitches by the same angle, seen from either end.
            assert upf == pytest.approx(-upr, abs=1e-4)
            pitch = radians(-upf)
            turned = np.array([[np.cos(pitch), -np.sin(pitch)], [np.sin(pitch), np.cos(pitch)]]) @ [xf - xr, zf - zr]
            assert -1e-4 < turned[0] / 1000 - 0.31 < 0.0901
            lifted.append(turned[1] * (1.0 if swing.moves == "front" else -1.0))
        assert max(lifted) == pytest.approx(1000 * walking.LIFT, rel=0.02)
        assert lifted[-1] == pytest.approx(-1000 * walking.SINK, abs=0.01)
        assert min(lifted) == pytest.approx(-1000 * walking.SINK, abs=1e-3)
        last = {name: degrees(value) for name, value in zip(gait.JOINTS, instants[-1].q, strict=True)}
        assert sole("front", last)[0] - sole("rear", last)[0] == pytest.approx(1000 * end, abs=1e-3)
        first = {name: degrees(value) for name, value in zip(gait.JOINTS, swing.begin.q, strict=True)}
        assert sole("front", first)[0] - sole("rear", first)[0] == pytest.approx(1000 * begin, abs=1e-3)
        assert instants[-1].magnets == {swing.holds: 0.0, swing.moves: 300.0} and instants[-1].share == 1.0
    assert joints < radians(115)


def test_early_magnet_pull_causes_a_harder_landing(walking: ModuleType, walked: dict, minchw: Path) -> None:
    """In the same walk with feet placed at the height of the steel, the second landing of a foot, with an inclined root, is far harder."""
    gait, physics = importlib.import_module("inchworm_gait"), importlib.import_module("inchworm_physics")
    climb = physics.Climb(minchw, "_ceiling")
    seen = climb.rooted(gait.swings(climb.models, 2, walking.SHORT, walking.STRIDE, walking.LIFT, 0.0)[:3])
    assert seen.pulled == walked["ceiling", "rooted"].pulled == "press"
    assert seen.pull > walked["ceiling", "rooted"].pull + 80.0
    shown = table(DOCS, "report of feet put down at the steel")["smallest pull margin [N]"]
    assert float(shown[0]) == pytest.approx(walking.PULL - seen.pull, abs=0.5)


DOCS = ROOT / "docs" / "studies" / "walking.md"


def table(page: Path, marker: str) -> dict[str, list[str]]:
    """Return the rows of a report on a page, by name. The heading has the name ""."""
    shown = re.search(rf"<!-- {marker} -->\n```text\n(.*?)\n```", page.read_text(), re.DOTALL)
    assert shown is not None
    return {line[:38].strip(): re.findall(r".{16}", line[38:]) for line in shown[1].split("\n")}


def test_docs_show_the_output(walking: ModuleType, walked: dict, tmp_path: Path) -> None:
    """The columns of the ceiling. Numbers may differ as between processors. Words are equal, except the name of the ankle."""
    page = tmp_path / "walking.md"
    page.write_text(DOCS.read_text())
    walking.write(page, "report", walking.report({key: seen for key, seen in walked.items() if key[0] == "ceiling"}))
    shown, printed = table(DOCS, "report"), table(page, "report")
    assert list(shown) == list(printed) and len(shown[""]) == 3 * len(WAYS)
    for name, cells in shown.items():
        for one, other in zip(cells[-2:], printed[name], strict=True):
            if re.match(r" +[\d.]+", one):
                assert float(one.split()[0]) == pytest.approx(float(other.split()[0]), rel=0.02, abs=0.011), name
            elif name == "at":  # of two ankles that are asked for as much, either
                assert one.endswith("/ankle") and other.endswith("/ankle")
            else:
                assert one == other, name
