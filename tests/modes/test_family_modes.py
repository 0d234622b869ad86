"""`family.modes(settings)`: the modes of a variant in memory, by a plan and by a full compilation."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import mujoco
import numpy as np
import pytest

import thingc
from thingc.driver.pipeline import UnknownChoice
from thingc.modes import Modes, WrongData

BOOM = """
thingc: assembly/1
name: boom
parameters: {length: {value: 300 mm, min: 100 mm, max: 900 mm}}
components:
  base: {frame: true, mass: 1 kg, inertia: {ixx: 0.01 kg*m^2, iyy: 0.01 kg*m^2, izz: 0.01 kg*m^2}}
  arm:
    frame: true
    mass: 1 kg
    inertia: {ixx: 0.01 kg*m^2, iyy: 0.01 kg*m^2, izz: 0.01 kg*m^2}
    mounts: {end: {xyz: [=length, 0, 0]}}
  hand: {frame: true, mass: 1 kg, inertia: {ixx: 0.01 kg*m^2, iyy: 0.01 kg*m^2, izz: 0.01 kg*m^2}}
joints:
  lift: {type: revolute, parent: base.origin, child: arm.origin, limit: {lower: -90 deg, upper: 90 deg}}
  wrist: {type: revolute, parent: arm.end, child: hand.origin, limit: {lower: -90 deg, upper: 90 deg}}
modes: {free: {root: base, base: free}, held: {root: hand, base: held}, bridge: {root: hand, base: held, hold: {base: here}}}
"""


@pytest.fixture
def family(tmp_path: Path, shared_store: str) -> Iterator[thingc.RobotFamily]:
    (tmp_path / "boom.yaml").write_text(BOOM)
    with thingc.family(tmp_path / "boom.yaml", store=shared_store, verify=1) as family:
        yield family


def test_modes_of_variants_match_mujoco_and_compilation(family: thingc.RobotFamily, tmp_path: Path, shared_store: str) -> None:
    """Links of every variant are at MuJoCo's poses, first by full passes and then by a plan."""
    rng = np.random.default_rng(1)
    lengths = [0.3, *rng.uniform(0.2, 0.8, 5)]
    for length in lengths:
        modes = family.modes({"length": length})
        assert isinstance(modes, Modes) and tuple(modes) == family.modes == ("free", "held", "bridge")
        one, other = (mujoco.MjData(family.model({"length": length}, mode=name)) for name in ("free", "bridge"))
        one.qpos[-2:] = rng.uniform(-1, 1, 2)
        mujoco.mj_forward(one.model, one)
        for link, X in modes["free"].poses(modes.read("free", one)).items():
            assert X[:3, 3] == pytest.approx(one.body(link).xpos, abs=1e-12)
        modes.switch(("free", one), ("bridge", other))
        mujoco.mj_forward(other.model, other)
        assert np.abs(other.efc_pos).max() < 1e-12
    described = thingc.compile(str(tmp_path / "boom.yaml"), parameters={"length": lengths[-1]}, store=shared_store).modes["free"].files
    assert (Modes.parse(described["modes.json"])["held"].links[1].X_root_link == modes["held"].links[1].X_root_link).all()
    with pytest.raises(WrongData, match="another variant"):
        family.modes({"length": 0.4}).read("free", one)


def test_selected_modes_and_rejected_settings(family: thingc.RobotFamily) -> None:
    assert tuple(family.modes({}, "held", "free")) == ("free", "held")
    refused = family.modes({"length": 5.0})
    assert not refused and "at most 900 mm" in refused.problems[0].message
    with pytest.raises(UnknownChoice, match="no mode `helt`"):
        family.modes({}, "helt")
