"""The scenes of MInchW on walls and ceilings: feet with active magnets do not slip."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

SCENES = [f"{mode}_{where}" for where in ("wall", "ceiling") for mode in ("crawl", "front_foot", "rear_foot")]


def crept(model: mujoco.MjModel, seconds: float = 10.0) -> float:
    """Return the largest distance [m] of a sole with an active magnet from its start."""
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    soles = [model.site(f"{foot}/sole").id for foot in ("front", "rear") if data.actuator(f"{foot}/sole").ctrl[0] > 0.0]
    assert soles
    begin, worst = data.site_xpos[soles].copy(), 0.0
    for _ in range(round(seconds / model.opt.timestep)):
        mujoco.mj_step(model, data)
        worst = max(worst, float(np.linalg.norm(data.site_xpos[soles] - begin, axis=1).max()))
    return worst


@pytest.mark.parametrize("mode", SCENES)
def test_feet_with_active_magnets_do_not_slip(minchw: Path, mode: str) -> None:
    model = mujoco.MjModel.from_xml_path(str(minchw / "mjcf" / f"scene_{mode}.xml"))
    assert crept(model) < 5e-5


def test_default_contacts_of_mujoco_slip_on_the_wall(minchw: Path) -> None:
    model = mujoco.MjModel.from_xml_path(str(minchw / "mjcf" / "scene_crawl_wall.xml"))
    model.geom_solref[:], model.geom_solimp[:] = (0.02, 1.0), (0.9, 0.95, 0.001, 0.5, 2.0)
    model.opt.cone, model.opt.impratio = mujoco.mjtCone.mjCONE_PYRAMIDAL, 1.0
    assert crept(model) > 0.01
