"""One step of `examples/walk.py` on the floor, up a wall and under a ceiling, rooted and free, with bounds on all that it reports."""

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

PLACES = ("floor", "wall", "ceiling")
WAYS = ("rooted", "free")


@pytest.fixture(scope="module")
def walking() -> ModuleType:
    """The example, imported as running it does."""
    folder = str(ROOT / "examples")
    sys.path.insert(0, folder)
    try:
        return importlib.import_module("walk")
    finally:
        sys.path.remove(folder)


@pytest.fixture(scope="module")
def walked(walking: ModuleType, minchw: Path) -> dict[tuple[str, str], object]:
    return walking.walk(minchw, steps=1, places=PLACES)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("place", PLACES)
def test_a_step(walking: ModuleType, walked: dict, place: str, way: str) -> None:
    seen = walked[place, way]
    assert seen.steps == 1
    assert seen.progress == pytest.approx(walking.STRIDE, abs=5e-4)
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


def test_the_floor_asks_most_of_the_servos(walked: dict) -> None:
    """Level, the body hangs out from the foot; upright, it hangs below or stands above it. Under a ceiling, it hangs from the
    foot as well."""
    for way in WAYS:
        assert max(walked["floor", way].torque.values()) > 3.0 * max(walked["wall", way].torque.values())
        assert walked["ceiling", way].pull > walked["floor", way].pull > walked["wall", way].pull


def test_the_moment_at_the_foot_is_that_of_the_weight(walking: ModuleType, walked: dict, minchw: Path) -> None:
    """The pull that the holding foot bears comes from the weight at its distance: a hand-made bound on both sides. The weight
    presses the foot onto the floor and pulls it off a ceiling, where the jolt of a magnet that lands comes on top."""
    climb = importlib.import_module("inchworm_physics").Climb(minchw, "")
    model = climb.held["rear"].model
    foot = float(model.body("front/foot").mass[0]) * 9.81
    rest = float(model.body_mass.sum()) * 9.81 - 2 * foot
    moment = foot * (walking.SHORT + walking.STRIDE) + rest * (walking.SHORT + walking.STRIDE) / 2
    for way in WAYS:
        assert walked["floor", way].pull == pytest.approx(moment / 0.025 - (2 * foot + rest), rel=0.15)
        assert 1.0 < walked["ceiling", way].pull / (moment / 0.025 + (2 * foot + rest)) < 1.25


def test_the_plan_reaches_what_planar_kinematics_by_hand_say(walking: ModuleType, minchw: Path) -> None:
    gait, physics = importlib.import_module("inchworm_gait"), importlib.import_module("inchworm_physics")
    climb = physics.Climb(minchw, "")
    plan = gait.swings(climb.models, 1, walking.SHORT, walking.STRIDE, walking.LIFT)
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
        assert min(lifted) > -0.01
        last = {name: degrees(value) for name, value in zip(gait.JOINTS, instants[-1].q, strict=True)}
        assert sole("front", last)[0] - sole("rear", last)[0] == pytest.approx(1000 * end, abs=1e-3)
        first = {name: degrees(value) for name, value in zip(gait.JOINTS, swing.begin.q, strict=True)}
        assert sole("front", first)[0] - sole("rear", first)[0] == pytest.approx(1000 * begin, abs=1e-3)
        assert instants[-1].magnets == {swing.holds: 0.0, swing.moves: 300.0} and instants[-1].share == 1.0
    assert joints < radians(115)


def test_the_docs_show_such_a_report(walking: ModuleType, walked: dict) -> None:
    """The same rows and columns; the numbers there are those of three steps, and the same bounds hold for them."""
    shown = re.search(r"<!-- report -->\n```text\n(.*?)\n```", (ROOT / "docs" / "walking.md").read_text(), re.DOTALL)
    assert shown is not None
    rows = {kind: [(line[:38].strip(), line[38:].split()) for line in text.split("\n")] for kind, text in (
        ("shown", shown[1]), ("printed", walking.report({key: seen for key, seen in walked.items() if key[0] in walking.SHOWN}))
    )}
    assert [name for name, _ in rows["shown"]] == [name for name, _ in rows["printed"]]
    assert rows["shown"][0] == rows["printed"][0]
    there = dict(rows["shown"][1:])
    assert there["steps"] == ["3"] * 4
    assert all(abs(float(cell) - 3000 * walking.STRIDE) < 1.0 for cell in there["way forward [mm]"])
    assert all(float(cell) > 100.0 for cell in there["least pull margin [N]"])
