"""Measure the speed of the formulations as the wall time per step. Each value is the shortest of many short, interleaved runs."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from component_bodies import body_name, component_model
from formulations import FOOT, Study, Vector

ROOTED_FUSED, WELD_FUSED = "rooted, fused (thingc)", "weld, fused"
ROUNDS = 800


@dataclass(frozen=True)
class Timed:
    """A MuJoCo model, and the simulation state at which the measurement begins."""

    name: str
    model: mujoco.MjModel
    data: mujoco.MjData


def component_rooted(study: Study) -> mujoco.MjModel:
    """Return the model of the mode `front_foot` with one body per component."""
    mode = study.modes["front_foot"]
    return mujoco.MjModel.from_xml_string(component_model(mode.robot, mode.mjcf()), mode.assets())


def component_welded(study: Study) -> mujoco.MjModel:
    """Return the model of the mode `crawl` with one body per component and with the weld, as in the prototype."""
    mode = study.modes["crawl"]
    xml = component_model(mode.robot, mode.mjcf())
    foot = body_name(study.assembly, FOOT)
    assert foot == FOOT, "the weld's pose is that of the link's frame"
    return mujoco.MjModel.from_xml_string(study.weld_xml(xml, foot), mode.assets())


def ways(study: Study, q: Vector, contacts: bool) -> list[Timed]:
    """Return the models to measure, rooted and welded, each with one body per link and with one body per component. The drives hold the
    posture `q`, and the options are those of the document.
    """
    found = []
    for name, model in (
        (ROOTED_FUSED, study.rooted_model()),
        ("rooted, one body per component", component_rooted(study)),
        (WELD_FUSED, study.welded_model()),
        ("weld, one body per component (prototype)", component_welded(study)),
    ):
        if not contacts:
            model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
        found.append(Timed(name, model, posed(study, model, q)))
    return found


def posed(study: Study, model: mujoco.MjModel, q: Vector) -> mujoco.MjData:
    """Return a simulation state of the model in posture `q`. The drives are commanded to hold this posture, and the foot is at its held
    pose.
    """
    data = mujoco.MjData(model)
    for joint, value in zip(study.joints, q, strict=True):
        data.joint(joint).qpos[0] = value
        data.actuator(joint).ctrl[0] = value
    if model.nv > len(study.joints):
        data.qpos[:7] = study.body_pose(q)
    mujoco.mj_forward(model, data)
    return data


def seconds_per_step(runs: Sequence[Timed], count: int = 100) -> list[float]:
    """Return the wall time [s] of one simulation step for each model. The steps are executed in a loop inside MuJoCo. The models alternate,
    so that other load on the machine affects all models.
    """
    best = [np.inf] * len(runs)
    for _ in range(ROUNDS):
        for k, run in enumerate(runs):
            start = time.perf_counter()
            mujoco.mj_step(run.model, run.data, nstep=count)
            best[k] = min(best[k], (time.perf_counter() - start) / count)
    return best
