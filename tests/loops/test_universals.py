"""Loops cut at a universal joint: closed in MuJoCo by a point and a tendon, and compared with the same loop cut elsewhere."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from loops.robots import BALL, Array, Built, at_key, compiled, equality_residual
from thingc.tools.cli.info import as_text

ROBOT = f"""\
thingc: assembly/1
name: wobbler
components:
  ground: {{frame: true, mass: 1 kg, {BALL}, mounts: {{a: {{}}, d: {{xyz: 200 0 20 mm, rpy: 70 10 0 deg}}}}}}
  crank: {{frame: true, mass: 0.1 kg, {BALL}, com: [20 mm, 5 mm, 0], mounts: {{high: {{xyz: 50 0 10 mm, rpy: 20 90 0 deg}}}}}}
  coupler: {{frame: true, mass: 0.2 kg, {BALL}, com: [0, 10 mm, 90 mm], mounts: {{high: {{xyz: 0 0 190 mm}}}}}}
  rocker: {{frame: true, mass: 0.15 kg, {BALL}, com: [60 mm, 0, 0], mounts: {{high: {{xyz: 120 0 0 mm}}}}}}
joints:
  drive: {{type: continuous, parent: ground.a, child: crank.origin}}
  cross: {{type: universal, parent: crank.high, child: coupler.origin, offset: [10 deg, -20 deg]}}
  pivot: {{type: continuous, parent: ground.d, child: rocker.origin}}
  tip: {{type: ball, parent: coupler.high, child: rocker.high, loop: true}}
poses:
  one: {{drive: 30 deg}}
  two: {{drive: 200 deg}}
modes:
  bench: {{root: ground}}
  cut: {{root: ground, cut: [cross]}}
  turned: {{root: rocker, base: held, cut: [cross]}}
  hinge: {{root: ground, cut: [pivot]}}
"""


@pytest.fixture(scope="module")
def wobbler(tmp_path_factory: pytest.TempPathFactory) -> Built:
    found = compiled(tmp_path_factory.mktemp("wobbler"), ROBOT)
    assert found.said == []
    return found


def effective_dynamics(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[float, float]:
    """Effective inertia [kg m^2] and gravity torque [N m] at the drive, for the one degree of freedom that the equalities leave."""
    rows = data.efc_J.reshape(-1, model.nv)[data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY]
    free = np.linalg.svd(rows)[2][np.linalg.matrix_rank(rows, 1e-9) :]
    assert len(free) == 1, "one degree of freedom is left"
    motion = free[0] / free[0][model.joint("drive").dofadr[0]]
    mass: Array = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    return float(motion @ mass @ motion), float(motion @ -data.qfrc_bias)


@pytest.mark.parametrize("mode", ["cut", "turned"])
def test_cut_universal_has_the_dynamics_of_other_cuts(wobbler: Built, mode: str) -> None:
    assert [(closure.path, closure.kind) for closure in wobbler.robot(mode).closures] == [("cross", "universal")]
    assert [loss for loss in wobbler.losses(mode) if loss.path == "cross"] == []
    model, other = wobbler.model(mode), wobbler.model("hinge")
    for name in ("one", "two"):
        data = at_key(model, name)
        assert (data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY).sum() == 4
        assert equality_residual(data) < 1e-9
        if mode == "cut":  # gravity is along z of the root
            assert effective_dynamics(model, data) == pytest.approx(effective_dynamics(other, at_key(other, name)), rel=1e-8)


def test_universal_axes_stay_perpendicular(wobbler: Built) -> None:
    """Simulated for a second of falling. In the other mode, two hinges guarantee this."""
    model = wobbler.model("cut")
    model.dof_damping[:] = 1e-3
    data = at_key(model, "one")
    sites = [data.site(f"cross:{side}{mark}") for mark in ("", "_1") for side in ("parent", "child")]
    begun = data.joint("drive").qpos[0]
    worst = 0.0
    for _ in range(500):
        mujoco.mj_step(model, data)
        centre, _, x, y = (site.xpos for site in sites)
        one, other = x - centre, y - sites[1].xpos
        worst = max(worst, abs(float(one @ other)) / float(np.linalg.norm(one) * np.linalg.norm(other)))
        assert np.linalg.norm(centre - sites[1].xpos) < 5e-5
    assert worst < np.radians(0.05) and abs(data.joint("drive").qpos[0] - begun) > 0.5


def test_info_explains_the_selected_cut(wobbler: Built) -> None:
    assert wobbler.compilation.assembly is not None
    told = as_text(wobbler.compilation.assembly, (wobbler.robot("bench"),))
    assert "    through cross, which is not a hinge or ball joint, which are preferred for cuts" in told
