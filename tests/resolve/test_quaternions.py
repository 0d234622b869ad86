"""`quat` as an alternative to `rpy` in every pose of a document."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from resolve.resolving import run
from thingc.base.pose import Pose, make_pose, rotation_of
from thingc.base.primitives import Primitive
from thingc.model.resolve.link_definition import LinkDefinition
from thingc.model.resolve.types import At
from thingc.tools.diff.name_mapping import equal
from thingc.tools.diff.take_snapshot import _pose

DOCUMENT = """
    thingc: assembly/1
    name: turned
    parameters: {w: 0.4}
    components:
      base: {frame: true, mounts: {tip: {TURN}}}
      link:
        link: true
        mass: 1 kg
        inertia: {ixx: 1 kg*m^2, iyy: 1 kg*m^2, izz: 1 kg*m^2}
        shapes: [{box: 10 10 10 mm, at: {TURN}}]
        at: {in: base.tip, TURN}
    modes:
      first: {root: base, at: {TURN}, hold: {link.origin: {TURN}}}
      second: {extends: first}
      third: {extends: first, at: {OTHER}}
"""
QUAT = (0.4, -0.4, 0.2, 0.8)
"""w, x, y, z, normalized."""
EXPECTED = Rotation.from_quat((*QUAT[1:], QUAT[0])).as_matrix()


def poses(folder: Path, turn: str, other: str) -> tuple[list[Pose], Pose]:
    """Return every pose written as `turn`, and the one that replaces it in a mode."""
    outcome = run(folder, DOCUMENT.replace("TURN", turn).replace("OTHER", other))
    assert outcome.said == []
    link, first = outcome.component("link"), outcome.mode("first")
    assert isinstance(link.placement, At) and isinstance(link.definition, LinkDefinition)
    hold, solid = first.holds[0].pose, link.definition.shapes[0].solid
    assert hold is not None and isinstance(solid, Primitive)
    made = [outcome.component("base").mounts["tip"].pose, link.placement.pose, solid.pose, first.at, outcome.mode("second").at, hold]
    return made, outcome.mode("third").at


@pytest.mark.parametrize("written", [
    "[0.4, -0.4, 0.2, 0.8]", "[-0.4, 0.4, -0.2, -0.8]", "[=w, =-w, =w / 2, =2 * w]", "[0.4002, -0.4002, 0.2001, 0.8004]",
])
def test_quaternion_matches_scipy(tmp_path: Path, written: str) -> None:
    made, other = poses(tmp_path, f"quat: {written}", "rpy: 0 0 90 deg")
    for pose in made:
        assert np.array(pose.rotation) == pytest.approx(EXPECTED, abs=1e-15)
    assert other == make_pose((0, 0, 0), (0, 0, np.pi / 2))


def test_innermost_orientation_wins_in_either_form(tmp_path: Path) -> None:
    made, other = poses(tmp_path, "rpy: 0 0 90 deg", "quat: [0.4, -0.4, 0.2, 0.8]")
    assert {pose.rotation for pose in made} == {make_pose((0, 0, 0), (0, 0, np.pi / 2)).rotation}
    assert np.array(other.rotation) == pytest.approx(EXPECTED, abs=1e-15)


def test_quarter_turns_are_exact() -> None:
    assert rotation_of((0.7071, 0.7071, 0.0, 0.0)) == ((1, 0, 0), (0, 0, -1), (0, 1, 0))
    assert rotation_of((0.5, 0.5, 0.5, 0.5)) == ((0, 0, 1), (1, 0, 0), (0, 1, 0))


@pytest.mark.parametrize("rpy", [
    (10, 20, 30), (30, 90, 10), (0, 90, 0), (5, -90, 170), (180, 0, 0), (0, 0, 180), (0, 180, 0), (180, 0, 45),
])
def test_diff_ignores_the_notation_of_a_rotation(rpy: tuple[float, float, float]) -> None:
    pose = make_pose((0, 0, 0), tuple(np.radians(rpy).tolist()))
    x, y, z, w = Rotation.from_euler("xyz", rpy, degrees=True).as_quat()
    for sign in (1.0, -1.0):
        other = Pose(rotation=rotation_of((sign * w, sign * x, sign * y, sign * z)))
        assert equal(tuple(_pose(pose)), tuple(_pose(other)))
