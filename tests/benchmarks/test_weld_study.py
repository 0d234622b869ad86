"""The weld study compares equivalent models: one robot in three formulations, and one model with a body for each component."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest

FOLDER = Path(__file__).resolve().parents[2] / "benchmarks" / "weld_vs_root"


@pytest.fixture(scope="module")
def bench(shared_store: str):
    """The modules of the study, and the study of MInchW."""
    sys.path.insert(0, str(FOLDER))
    try:
        import formulations
        import standing
        import stepping
        import swinging

        yield formulations, standing, stepping, swinging, formulations.Study(shared_store)
    finally:
        sys.path.remove(str(FOLDER))


def test_model_with_component_bodies_is_the_same_robot(bench) -> None:
    formulations, _, stepping, _, study = bench
    fused, unfused, welded = study.rooted_model(), stepping.component_rooted(study), stepping.component_welded(study)
    assert unfused.nbody - 1 == welded.nbody - 1 == len(study.assembly.occurrences) > fused.nbody
    assert unfused.ngeom == fused.ngeom and unfused.nv == fused.nv == len(study.joints) and welded.nv == fused.nv + 6
    for model in (unfused, welded):
        assert model.body_subtreemass[0] == pytest.approx(fused.body_subtreemass[0], rel=1e-14)
    generator = np.random.default_rng(3)
    for q in (*study.postures.values(), *generator.uniform(-1.0, 1.0, (5, len(study.joints)))):
        want = stepping.posed(study, fused, q)
        for model in (unfused, welded):
            have = stepping.posed(study, model, q)
            for site in range(fused.nsite):
                name = fused.site(site).name
                assert np.abs(have.site(name).xpos - want.site(name).xpos).max() < 1e-14, name
                assert np.abs(have.site(name).xmat - want.site(name).xmat).max() < 1e-14, name
            for geom in range(fused.ngeom):
                name = fused.geom(geom).name
                assert np.abs(have.geom(name).xpos - want.geom(name).xpos).max() < 1e-9, name


def by_joint(study, model: mujoco.MjModel, values: np.ndarray) -> np.ndarray:
    return np.array([values[model.joint(joint).dofadr[0]] for joint in study.joints])


@pytest.mark.parametrize("gravity", ["wall"])
def test_rooted_model_rests_from_the_first_step_and_welds_do_not(bench, gravity: str) -> None:
    """The torques are those of the model with one body per component, which other code creates."""
    formulations, standing, stepping, _, study = bench
    models = {name: study.formulation(name) for name in formulations.FORMULATIONS}
    other = stepping.component_rooted(study)
    other.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_ACTUATION
    other.opt.gravity = study.gravity[gravity]
    for q in study.postures.values():
        data = stepping.posed(study, other, q)
        data.qacc[:] = 0.0
        mujoco.mj_inverse(other, data)
        torque = by_joint(study, other, data.qfrc_inverse)
        assert np.abs(torque - study.holding(q, gravity)).max() < 1e-13
        for integrator in formulations.INTEGRATORS:
            for timestep in (0.0005, 0.005):
                settings = formulations.Settings(timestep, integrator)
                for friction in (True, False):
                    run = standing.stand(models["rooted"], q, torque, settings, gravity, friction, horizon=0.1)
                    # MuJoCo solves dry friction, which is a constraint, to its tolerance of 1e-8 only.
                    assert run.speeds.max() < (1e-8 if friction else 1e-12)
                    assert run.steps == 0 and run.drift == 0.0 and run.turn == 0.0
                    exact = standing.stand(
                        models["rooted"], q, study.holding(q, gravity), settings, gravity, friction, horizon=0.1
                    )
                    assert exact.speeds.max() < 1e-13
                    soft = standing.stand(models["weld, default"], q, torque, settings, gravity, friction, horizon=0.1)
                    assert soft.nearly != 0 and soft.speeds.max() > 0.01 and soft.drift > 0.01
                    stiff = standing.stand(models["weld, stiff"], q, torque, settings, gravity, friction, horizon=0.1)
                    assert stiff.steps != 0 and 0.0 < stiff.drift < soft.drift / 100.0


def test_inverse_dynamics_of_welds_needs_projection(bench) -> None:
    formulations, standing, _, _, study = bench
    for name in ("weld, default", "weld, stiff"):
        formulation = study.formulation(name)
        for q in study.postures.values():
            data = formulation.stand(q)
            assert data.ne == 6 and np.abs(data.efc_pos[:6]).max() < 1e-14
            (sole, ankle, _), rotation = formulation.places(data)
            assert np.abs(sole).max() < 1e-14 and np.abs(ankle - study.exact.body("front/foot").pos).max() < 1e-14
            assert np.abs(rotation - np.eye(3)).max() < 1e-14
            result = standing.inverse(formulation, q, "floor")
            weight = formulation.model.body_subtreemass[0] * 9.81
            assert result.base == pytest.approx(weight, rel=1e-6)
            assert result.error > 0.5 * result.exact and result.projected < 1e-12


def test_swing_converges_only_in_the_rooted_model(bench) -> None:
    formulations, _, _, swinging, study = bench
    rooted, soft = study.formulation("rooted"), study.formulation("weld, default")
    errors = {}
    for timestep in (0.01, 0.005, 0.0025):
        path = swinging.plan(study, timestep, "floor")
        assert np.abs(path.v[[0, -1]]).max() == 0.0
        for integrator in ("implicitfast", "RK4"):
            settings = formulations.Settings(timestep, integrator)
            errors[integrator, timestep] = swinging.swing(rooted, path, settings, "floor", feedback=True).tip
            assert swinging.swing(soft, path, settings, "floor", feedback=True).tip > 10.0
    assert errors["implicitfast", 0.01] / errors["implicitfast", 0.0025] == pytest.approx(4.0, rel=0.1)  # first order
    assert errors["RK4", 0.01] / errors["RK4", 0.0025] == pytest.approx(16.0, rel=0.1)  # torques held: second order


def test_angle_of_a_rotation(bench) -> None:
    _, standing, _, _, _ = bench
    for degrees in (1e-9, 0.3, 29.0, 31.0, 120.0, 179.9):
        matrix, quaternion = np.zeros(9), np.zeros(4)
        mujoco.mju_axisAngle2Quat(quaternion, np.array([0.6, 0.0, 0.8]), np.radians(degrees))
        mujoco.mju_quat2Mat(matrix, quaternion)
        assert standing.angle(matrix.reshape(3, 3)) == pytest.approx(degrees, rel=1e-6)


def test_page_equals_the_output() -> None:
    """The page contains the words of the template around the numbers, and the figure exists."""
    template = (FOLDER / "page.md").read_text()
    pieces = re.split(r"\$[a-z_]+", template)
    page = FOLDER.parents[1] / "docs" / "studies" / "weld_vs_root.md"
    assert re.fullmatch("(?s:.+?)".join(re.escape(piece) for piece in pieces), page.read_text())
    assert (page.parents[1] / "pictures" / "weld_vs_root.png").read_bytes().startswith(b"\x89PNG")
