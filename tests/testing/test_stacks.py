"""Tolerance stacks of two bars, against manual sums and against random robots with deviating mounts."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testing.rig import PARALLELOGRAM, Workspace, two_links

TOLERANCE, TILT, BACKLASH = 1e-4, math.radians(0.1), math.radians(0.4)
PROCESS = "process: {kind: machined, tolerance: 0.1 mm, tilt: 0.1 deg}"
GEARED = """\
transmissions:
  gear: {actuator: {kind: motor, effort: 1 N*m}, joint: shoulder, ratio: 9, backlash: 0.4 deg}
"""
AXES = "".join(
    f"  a{k}: {{stack: {{of: tip, from: base, along: {along}, worst: 1 m}}}}\n" for k, along in enumerate(np.eye(3).tolist())
)
"""A test of the deviation along each axis of the base."""


def bars(at: str = "0") -> str:
    """Return the two bars with tolerances, and a gearbox with backlash at the shoulder."""
    text = two_links(at=at).replace("density: 1000 kg/m^3", f"density: 1000 kg/m^3, {PROCESS}")
    drive = ",\n    drive: {kind: position, kp: 5 N*m/rad, effort: 1 N*m}"
    assert drive in text
    return text.replace(drive, "", 1) + GEARED


def test_contributions_of_stretched_bars(rig: Workspace) -> None:
    """Along z, each mount shifts the tip by its tolerance, and rotates it by its tilt about y times the distance from the tip."""
    answer = rig.test(bars(), "  up: {stack: {of: tip, from: base, along: [0, -2, 0], worst: 1 mm, within: 0.4 mm, yield: 99 %}}\n"
                              "  out: {stack: {of: tip, from: base, along: [1, 0, 0], rss: 0.1 mm}}\n", others=("yield",))
    up, out = answer["by_name"]["up"], answer["by_name"]["out"]
    arms = (0.16, 0.06, 0.06, 0.0)
    deviations = [*(TOLERANCE for _ in arms), *(TILT * arm for arm in arms), BACKLASH / 2 * 0.16]
    rss = math.sqrt(sum(one**2 for one in deviations))
    assert up["measured"]["worst"] == pytest.approx(sum(deviations), rel=1e-9)
    assert up["measured"]["rss"] == pytest.approx(rss, rel=1e-9)
    assert up["measured"]["yield"] == pytest.approx(math.erf(3 * 4e-4 / rss / math.sqrt(2)), rel=1e-9)
    assert not up["passed"]
    assert out["measured"]["rss"] == pytest.approx(2 * TOLERANCE, rel=1e-9) and not out["passed"]  # four mounts; tilts do not matter
    first, second = answer["diagnostics"]
    assert first["code"] == second["code"] == "TC666"
    assert f"the largest deviation ({1000 * sum(deviations):.4g} mm) exceeds the maximum (1 mm)" in first["message"]
    assert f"the share of robots within tolerance ({100 * up['measured']['yield']:.4g} %) is below the minimum (99 %)" in first["message"]
    share = 100 * (TOLERANCE**2 + (TILT * 0.16) ** 2) / rss**2
    notes = [note["message"] for note in first["notes"]]
    assert notes[0].startswith(f"{100 * (BACKLASH / 2 * 0.16) ** 2 / rss**2:.3g} % due to the backlash of `shoulder`")
    assert notes[1].startswith(f"{share:.3g} % due to `upper.near`") and len(notes) == 5
    assert "the RSS deviation (0.2 mm) exceeds the maximum (0.1 mm)" in second["message"]


def test_linearization_matches_random_robots(rig: Workspace) -> None:
    """100 000 samples of a bent arm, with nonlinear kinematics of deviating mounts: three standard deviations equal the RSS within 2 %."""
    answer = rig.test(bars("70 deg"), AXES)
    found = [answer["by_name"][f"a{k}"]["measured"]["rss"] for k in range(3)]
    rng, count = np.random.default_rng(5), 100_000

    def mount(xyz: tuple[float, float, float], rpy: tuple[float, float, float]) -> tuple[np.ndarray, Rotation]:
        place = np.array(xyz) + rng.normal(scale=TOLERANCE / 3, size=(count, 3))
        return place, Rotation.from_rotvec(rng.normal(scale=TILT / 3, size=(count, 3))) * Rotation.from_euler("XYZ", rpy, degrees=True)

    def times(*poses: tuple[np.ndarray, Rotation]) -> tuple[np.ndarray, Rotation]:
        place, rotation = np.zeros((count, 3)), Rotation.identity()
        for step, turn in poses:
            place, rotation = place + rotation.apply(step), rotation * turn
        return place, rotation

    def inverse(pose: tuple[np.ndarray, Rotation]) -> tuple[np.ndarray, Rotation]:
        return -pose[1].inv().apply(pose[0]), pose[1].inv()

    def turned(angles: np.ndarray) -> tuple[np.ndarray, Rotation]:
        return np.zeros(3), Rotation.from_rotvec(np.outer(angles, (0.0, 0.0, 1.0)))

    mate = np.zeros(3), Rotation.from_matrix([[0, -1, 0], [-1, 0, 0], [0, 0, -1]])
    near, far, tip = ((90, 0, 90), (-90, 0, 0), (0, 90, 0))
    backlash = rng.normal(scale=BACKLASH / 6, size=count)
    place, _ = times(
        turned(backlash), mate, inverse(mount((0, 0, 0), near)), mount((0.1, 0, 0), far),
        turned(np.full(count, math.radians(70))), mate, inverse(mount((0, 0, 0), near)), mount((0.06, 0, 0), tip),
    )
    np.testing.assert_allclose(3 * place.std(axis=0), found, rtol=0.02)
    assert min(found) > 1e-4 and max(found) > 1.5 * min(found)


def test_clearance_of_a_boss_in_a_bore(rig: Workspace) -> None:
    """A pin of 6 mm in a bore of 6.2 mm can shift by 0.1 mm across the axis y of the hinge, and not along it."""
    text = two_links().replace("hinge: {rpy: -90 0 0 deg}", "hinge: {rpy: -90 0 0 deg, interface: {boss: {diameter: 6 mm}}}")
    bore = "mounts: {bore: {rpy: 90 0 90 deg, interface: {bore: {diameter: 6.2 mm}}}}, allow: {TC425: no hole}"
    text = text.replace("upper: {part: rig_parts:Bar}", f"upper: {{part: rig_parts:Bar, {bore}}}").replace("upper.near", "upper.bore")
    answer = rig.test(text, AXES)
    found = [answer["by_name"][f"a{k}"]["measured"]["worst"] for k in range(3)]
    np.testing.assert_allclose(found, (1e-4, 1e-4, 0.0), atol=1e-12)


def test_tolerance_of_a_mount_replaces_that_of_the_process(rig: Workspace) -> None:
    """A shift of one mount is a shift of the tip, in addition to all other deviations."""
    test = "  out: {stack: {of: tip, from: base, along: [1, 0, 0], worst: 1 m}}\n"
    looser = "upper: {part: rig_parts:Bar, mounts: {bore: {rpy: 90 0 90 deg, tolerance: 0.3 mm}}}"

    def rss_of(text: str, bar: str) -> float:
        assert "upper: {part: rig_parts:Bar}" in text
        answer = rig.test(text.replace("upper: {part: rig_parts:Bar}", bar).replace("upper.near", "upper.bore"), test)
        return float(answer["by_name"]["out"]["measured"]["rss"])

    plain = rss_of(bars(), looser.replace(", tolerance: 0.3 mm", ""))
    assert rss_of(bars(), looser) ** 2 - plain**2 == pytest.approx(9e-8 - TOLERANCE**2, rel=1e-9)
    assert rss_of(two_links(), looser) == pytest.approx(3e-4, rel=1e-9)
    assert "1 contributor; 100 % due to `upper.bore`: 0.3 mm" in rig.run(str(rig.folder / "rig.yaml"))[1]
    wrong = looser.replace("0.3 mm", "-1 mm")
    text = two_links().replace("upper: {part: rig_parts:Bar}", wrong)
    code, *shown = rig.run(str(rig.write(text, test)))
    assert code == 1 and "`tolerance`" in "".join(shown)


def test_stack_without_tolerances_fails(rig: Workspace) -> None:
    answer = rig.test(two_links(), "  none: {stack: {of: tip, from: base, along: [0, 0, 1], worst: 1 um}}\n"
                                   "  same: {stack: {of: tip, from: tip, along: [0, 0, 1], rss: 1 um}}\n")
    assert ["no part, joint or fit between the mounts has a tolerance" in one["message"] for one in answer["diagnostics"]] == [True, True]


def test_loops_and_invalid_bounds_are_rejected(rig: Workspace) -> None:
    loop = PARALLELOGRAM.replace("DRIVE", "").replace("density: 1000 kg/m^3", f"density: 1000 kg/m^3, {PROCESS}")
    answer = rig.test(loop, "  loop: {stack: {of: middle, from: ground.hinge, along: [0, 0, 1], rss: 1 mm}}\n")
    assert "is in a closed loop" in answer["diagnostics"][0]["message"]
    for keys, words in (
        ("along: [0, 0, 0], rss: 1 mm", "`along` must not be zero"),
        ("along: [0, 0, 1]", "a `stack` test requires `worst`, `rss`, or `within` and `yield`"),
        ("along: [0, 0, 1], within: 1 mm", "must be used together"), ("along: [0, 0, 1], within: 1 mm, yield: 120 %", "yield"),
        ("along: [0, 0, 1], within: 1 mm, yield: 100 %", "use `worst`"),
    ):
        code, *shown = rig.run(str(rig.write(bars(), f"  wrong: {{stack: {{of: tip, from: base, {keys}}}}}\n")))
        assert code == 1 and words in "".join(shown)
