"""The model fields of `family.mjx` are equal to those that MuJoCo compiles."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import jax
import mujoco
import numpy as np
import pytest
from mujoco import mjx
from mujoco.mjx._src import math

import thingc
from families.crane import BEAM, BEAMS, CRANE, LEVER
from families.documents import WORKSPACE
from thingc.batch.families import mjx_family
from thingc.batch.families.mjx_constants import principal_axes
from thingc.batch.results import FamilyError

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks" / "variants"))

from mjx_fields import leaves, one_of

pytestmark = pytest.mark.usefixtures("in_double_precision")
NAMES = ["length", "load", "radius", "skew", "stiff", "rubbing"]
LOW, HIGH = [0.2, 0.1, 0.01, -0.002, 10.0, 0.0], [0.5, 0.9, 0.03, 0.002, 50.0, 0.1]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("mjx")
    (place / "parts").mkdir()
    documents = {"crane.yaml": CRANE, "lever.yaml": LEVER, "beam.yaml": BEAM, "parts/beams.py": BEAMS}
    for name, text in {**WORKSPACE, **documents}.items():
        (place / name).write_text(text)
    return place


BALLS = """\
thingc: assembly/1
name: balls
parameters: {load: {value: 500 g, min: 10 g}}
components:
  base: {link: true, mass: 2 kg, shapes: [{sphere: {radius: 50 mm}}]}
  arm: {link: true, mass: =load, shapes: [{sphere: {radius: 50 mm}, at: {xyz: 200 0 0 mm}}]}
  tip: {link: true, mass: 1 kg, shapes: [{sphere: {radius: 50 mm}, at: {xyz: 100 0 200 mm}}]}
joints:
  lift: {type: continuous, parent: base.origin, child: arm.origin, axis: [0, 1, 0]}
  bend: {type: continuous, parent: arm.origin, child: tip.origin, axis: [0, 1, 0]}
modes: {standing: {root: base, base: free}}
simulation: {cone: elliptic, timestep: 2 ms}
raw: {mjcf: {default: {collision: {geom: {condim: 1}}}}}
"""


@pytest.fixture(scope="module")
def crane(folder: Path) -> Iterator[thingc.RobotFamily]:
    with thingc.family(folder / "crane.yaml", verify=0) as family:
        yield family


def compared(
    family: thingc.RobotFamily, mode: str, names: list[str], rows: np.ndarray, tolerance: float, *, dtype: str = "float64",
) -> None:
    robots = family.mjx(names, mode=mode, dtype=dtype)
    model, axes, ok = robots.batch(rows)
    assert not ok[0] and ok[1:].all()
    assert axes.body_mass == axes.stat.meaninertia == 0 and axes.jnt_range is None and "jnt_range" not in robots.varied
    settings = [dict(zip(names, row)) for row in rows.tolist()]
    for place, expected in enumerate(family.models(settings, mode=mode)):
        if place == 0:
            assert not expected
            continue
        own = one_of(model, robots.varied, place)
        found, wanted = leaves(own), leaves(mjx.put_model(expected))
        wanted["dof_hasfrictionloss"] |= found["dof_hasfrictionloss"]
        assert found.keys() == wanted.keys()
        for name, value in wanted.items():
            scale = np.abs(value).max(initial=0.0) or 1.0
            np.testing.assert_allclose(found[name], value, rtol=0.0, atol=tolerance * scale, err_msg=f"{name} of {rows[place]}")
            assert found[name].dtype == value.dtype


def spread(values: list[float], count: int) -> np.ndarray:
    """Return rows near `values`. The first row is refused."""
    rows = np.array(values) * np.random.default_rng(3).uniform(0.8, 1.2, (count, len(values)))
    rows[0, 0] = 0.05
    return rows


def test_fields_of_a_free_robot_equal_those_of_mujoco(crane: thingc.RobotFamily, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mjx_family, "BLOCK", 3)  # of the seven rows, the last one is a block of its own
    rows = np.random.default_rng(3).uniform(LOW, HIGH, (7, len(NAMES)))
    rows[0, 0] = 0.05
    compared(crane, "adrift", NAMES, rows, 1e-13)


def test_parts_are_built_for_a_batch(folder: Path) -> None:
    names = ["length", "thickness", "load"]
    rows = np.array([[0.01, 0.03, 0.5], [0.2, 0.03, 0.5], [0.23, 0.0311, 0.6], [0.21, 0.028, 0.5]])
    with thingc.family(folder / "beam.yaml", verify=0) as family:
        compared(family, "standing", names, rows, 1e-13)
        with pytest.raises(FamilyError, match="a pure function cannot build the parts that depend on length: use `batch`"):
            family.mjx(["length"]).model([0.3])
        with pytest.raises(FamilyError, match="MJX cannot vary the mesh of the geom `beam.*` with length: use a primitive"):
            family.mjx(["length"], at={"components.beam.collision": "hull"})


@pytest.fixture(scope="module")
def lever(folder: Path) -> Iterator[thingc.RobotFamily]:
    with thingc.family(folder / "lever.yaml", verify=0) as family:
        yield family


def test_single_precision(lever: thingc.RobotFamily) -> None:
    jax.config.update("jax_enable_x64", False)
    compared(lever, "standing", ["length", "load", "stiff", "damping"], spread([0.3, 0.5, 50.0, 0.2], 4), 1e-6, dtype="float32")


def test_children_of_a_held_base_move_with_it(lever: thingc.RobotFamily) -> None:
    robots = lever.mjx(["stiff"], mode="carried")
    expected = lever.model({}, mode="carried", visual=False)
    state = mujoco.MjData(expected)
    state.mocap_pos[:], state.mocap_quat[:], state.qpos[:] = [0.1, 0.2, 0.3], [0.6, 0.8, 0.0, 0.0], [0.4]
    mujoco.mj_kinematics(expected, state)
    model, data = robots.put(robots.base, state)
    np.testing.assert_allclose(jax.jit(mjx.kinematics)(model, data).xpos, state.xpos, atol=1e-15)
    model, data = robots.put(model, data.replace(mocap_pos=data.mocap_pos + 1.0))
    np.testing.assert_allclose(model.body_pos[1], [1.1, 1.2, 1.3], atol=1e-15)
    np.testing.assert_allclose(data.mocap_pos[0], [1.1, 1.2, 1.3], atol=1e-15)


@pytest.mark.parametrize(
    ("document", "names", "mode", "changes", "message"),
    [
        ("everything.yaml", ["load"], "standing", {},
         "MJX does not support a feature of mode `standing`: .*mjTRN_BODY.* with `compat=\"mjx\"`"),
        ("strung.yaml", ["lever"], None, {},
         "MJX cannot vary a constant with lever: MJX converts `wrap_prm` to a constant: set the values with `at`"),
        ("crane.yaml", ["stiff"], "standing", {"drive: {kind: position, kp: =stiff}": "drive: {kind: position, kp: =stiff, effort: 5 N*m}"},
         "MJX and MuJoCo apply the damping of `lift` differently with `implicitfast`"),
        ("crane.yaml", ["rubbing", "load"], "standing", {"damping: 0.1 N*m*s/rad, friction": "friction"},
         "MJX cannot vary rubbing: nearby values change the structure of the model: write another start value"),
        ("crane.yaml", ["load"], "standing", {"integrator: implicitfast": "cone: elliptic", "[[base, hook]]": "[[base, arm]]"},
         "MJX does not support a feature of mode `standing`: .*mjGEOM_BOX.* collisions not implemented"),
        ("tool.yaml", ["components.finger.mass"], None,
         {"type: revolute": "type: fixed", ", limit: {lower: 0 deg, upper: 45 deg}}}": "}}"},
         "MJX does not support mode `default`, in which nothing moves: choose another mode, or use `models`"),
        ("crane.yaml", ["radius"], "standing", {"axis: [0, 0, 1]": "axis: [0, =radius / (1 m), 1]"},
         "MJX cannot vary a constant with radius: MuJoCo uses `joint.axis` at compile time: set the values with `at`, or use `models`"),
    ],
)
def test_what_mjx_cannot_do_is_explained(
    folder: Path, tmp_path: Path, document: str, names: list[str], mode: str | None, changes: dict[str, str], message: str,
) -> None:
    for name, text in {**WORKSPACE, "crane.yaml": f"{CRANE}simulation: {{integrator: implicitfast}}\n"}.items():
        for old, new in changes.items():
            text = text.replace(old, new)
        (tmp_path / name).write_text(text)
    with thingc.family(tmp_path / document, verify=0) as family, pytest.raises(FamilyError, match=message):
        family.mjx(names, mode=mode)


def test_contacts_without_friction_require_pyramidal_cones(tmp_path: Path) -> None:
    (tmp_path / "balls.yaml").write_text(BALLS)
    for compat in (None, "mjx"):
        with thingc.family(tmp_path / "balls.yaml", verify=0, compat=compat) as family:
            with pytest.raises(FamilyError, match="condim=1 with ConeType.ELLIPTIC not implemented") as caught:
                family.mjx(["load"])
            assert caught.value.help == "use `at={\"simulation.cone\": \"pyramidal\"}`"
            assert family.mjx(["load"], at={"simulation.cone": "pyramidal"}).varied


def test_precisions_and_shapes_are_checked(crane: thingc.RobotFamily) -> None:
    with pytest.raises(FamilyError, match="MJX uses 64-bit numbers if they are enabled in JAX: omit `dtype`"):
        crane.mjx(["stiff"], dtype="float32")
    with pytest.raises(FamilyError, match=r"expected an array of shape \(k, 1\) for stiff, found \(1,\)"):
        crane.mjx(["stiff"]).batch([40.0])
    with pytest.raises(FamilyError, match="expected at least one item in `names`: for a single robot, use `mjx.put_model"):
        crane.mjx([])
    jax.config.update("jax_enable_x64", False)
    with pytest.raises(FamilyError, match="64-bit numbers are disabled in JAX: call `jax.config.update"):
        crane.mjx(["stiff"])


def test_derivatives_of_principal_axes() -> None:
    source = np.random.default_rng(5)
    matrices, changes = (half @ half.transpose(0, 2, 1) for half in source.normal(size=(2, 4, 3, 3)))
    matrices[0], changes[0] = np.diag([2.0, 1.0, 2.0]), np.diag([1.0, 3.0, 1.0])  # equal moments stay equal

    def rebuilt(matrix: jax.Array) -> jax.Array:
        moments, quaternion = principal_axes(matrix)
        axes = math.quat_to_mat(quaternion)
        return axes @ jax.numpy.diag(moments) @ axes.T

    found = jax.jit(jax.vmap(lambda matrix, change: jax.jvp(rebuilt, (matrix,), (change,))))(matrices, changes)
    np.testing.assert_allclose(found[0], matrices, atol=1e-14)
    np.testing.assert_allclose(found[1], changes, atol=1e-13)
