"""One model for a batch: with the numbers of a variant written in place, it equals the model that MuJoCo compiles for the variant."""

from __future__ import annotations

import copy
import textwrap
from pathlib import Path

import mujoco
import mujoco.rollout
import numpy as np
import pytest

from thingc.batch import BatchResults, FamilyError, StructuresDiffer, apply, fields, load, run, shared_model, write
from thingc.driver.environment import Options
from variants.families import arrays
from variants.robots import workspace


@pytest.fixture(name="sliders")
def loaded_sliders(sliders: Path) -> BatchResults:
    return load(sliders)


@pytest.fixture(name="some")
def loaded_some(some: Path) -> BatchResults:
    return load(some)


def trajectory(model: mujoco.MjModel, steps: int = 300) -> np.ndarray:
    """Return qpos and qvel (steps, nq + nv) for an oscillating control."""
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    seen = np.empty((steps, model.nq + model.nv))
    for k in range(steps):
        data.ctrl[:] = 0.05 * np.sin(0.1 * k)
        mujoco.mj_step(model, data)
        seen[k] = np.concatenate([data.qpos, data.qvel])
    return seen


def test_model_in_place_moves_like_the_compiled_model(sliders: BatchResults) -> None:
    model, own = fields(sliders, scene=True)
    assert own and all(len(values) == len(sliders) == 8 for values in own.values())
    assert {"body_mass", "dof_damping", "body_ipos"} <= set(own) and "geom_type" not in own
    moved = set()
    for index in (5, 0, 7, 3, 1, 2, 6, 4):  # in no order: nothing stays behind
        apply(model, own, index)
        single = sliders[index].model(scene=True)
        assert arrays(model) == arrays(single)
        assert model.stat.meaninertia == single.stat.meaninertia
        seen = trajectory(model)
        assert seen.tobytes() == trajectory(single).tobytes()
        moved.add(seen.tobytes())
    assert len(moved) == 8


def test_frames_lengths_and_poses_differ_in_place(some: BatchResults) -> None:
    for mode in ("hanging", "flying"):
        model, own = fields(some, mode)
        assert {"body_pos", "body_mass"} <= set(own)
        for index, variant in enumerate(some):
            apply(model, own, index)
            assert trajectory(model, 100).tobytes() == trajectory(variant.model(mode), 100).tobytes()


def test_rollout_accepts_models_in_place(sliders: BatchResults) -> None:
    model, own = fields(sliders, scene=True)
    models = []
    for index in range(len(sliders)):
        models.append(copy.copy(model))
        apply(models[-1], own, index)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
    start = np.empty(mujoco.mj_stateSize(model, kind))
    mujoco.mj_getState(model, data, start, kind)
    control = 0.05 * np.sin(0.1 * np.arange(300))[None, :, None].repeat(len(models), axis=0)
    states, _ = mujoco.rollout.rollout(models, data, np.tile(start, (len(models), 1)), control)
    for index, variant in enumerate(sliders):
        np.testing.assert_array_equal(states[index][:, 1: 1 + model.nq + model.nv], trajectory(variant.model(scene=True)))


def test_written_fields_are_reproducible(sliders: BatchResults, tmp_path: Path) -> None:
    for name in ("a", "b"):
        assert write(sliders, tmp_path / f"{name}.npz", scene=True) == str(tmp_path / f"{name}.mjz")
    for kind in ("npz", "mjz"):
        assert (tmp_path / f"a.{kind}").read_bytes() == (tmp_path / f"b.{kind}").read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.mjz", "a.npz", "b.mjz", "b.npz"]
    stored = np.load(tmp_path / "a.npz")
    assert list(stored["id"]) == [variant.id for variant in sliders]
    model = mujoco.MjSpec.from_file(str(tmp_path / "a.mjz")).compile()
    own = {name: stored[name] for name in stored.files if name != "id"}
    for index in (6, 2):
        apply(model, own, index)
        assert trajectory(model).tobytes() == trajectory(sliders[index].model(scene=True)).tobytes()
    with pytest.raises(FamilyError, match=r"ends in `\.npz`"):
        write(sliders, tmp_path / "a.zip")


def test_other_geometry_or_another_tree_is_an_error(boards: Path, arms: Path) -> None:
    with pytest.raises(StructuresDiffer, match=r"kind `mesh` differ in `boards_0` and `boards_1`: `plates\.Square") as refused:
        fields(boards)
    assert refused.value.field == "nmesh"
    different = "kind `body` differ in `arms_0` and `arms_1`: `chain/tip` exists in only one of the two models"
    with pytest.raises(StructuresDiffer, match=different):
        fields(arms)


BRICKS = """
    from build123d import Box, Cylinder, Pos

    from thingc import Length, Thing


    class Brick(Thing):
        def __init__(self, side: Length = 40):
            super().__init__(material="light")
            self.body = Box(side, 30, 20)
            self.peg = Pos(side / 4, 0, 15) * Cylinder(side / 8, 10)

        def result(self):
            return [self.body, self.peg]

        def collision(self):
            return [self.body, self.peg]
"""
TOSSED = """
    thingc: assembly/1
    name: tossed
    parameters: {side: {value: 40 mm, min: 10 mm, max: 100 mm}}
    materials: {light: {density: 500 kg/m^3}}
    defaults: {component: {collision: part, visual: false}}
    components: {brick: {part: bricks:Brick, params: {side: =side}}}
    modes: {falling: {root: brick, base: free, at: {xyz: 0 0 20 mm, rpy: 30 20 10 deg}}}
"""
TOSSES = """
    thingc: variants/1
    assembly: tossed.yaml
    name: tosses
    parameters: {side: [30 mm, 45 mm, 60 mm]}
"""


def test_primitives_of_another_size_collide_in_place(tmp_path: Path, shared_store: str) -> None:
    """Without meshes, geometry consists of numbers: sizes, positions, and bounding boxes."""
    folder = workspace(tmp_path, tossed=TOSSED, tosses=TOSSES)
    (folder / "parts" / "bricks.py").write_text(textwrap.dedent(BRICKS))
    family = load(run(str(folder / "tosses.yaml"), options=Options(store=shared_store), jobs=1).folder)
    model, own = fields(family, scene=True)
    assert model.nmesh == 0
    assert {"geom_size", "geom_pos", "geom_aabb", "geom_rbound", "bvh_aabb", "body_mass"} <= set(own)
    ends = set()
    for index in (2, 0, 1):
        apply(model, own, index)
        side = (0.03, 0.045, 0.06)[index]
        assert model.geom("brick:collision").size == pytest.approx([side / 2, 0.015, 0.01], rel=1e-12)
        assert model.geom("brick:collision_1").size[:2] == pytest.approx([side / 8, 0.005], rel=1e-12)
        single = family[index].model(scene=True)
        assert arrays(model) == arrays(single)
        assert tumbled(model).tobytes() == (seen := tumbled(single)).tobytes()
        ends.add(seen.tobytes())
    assert len(ends) == 3


def tumbled(model: mujoco.MjModel) -> np.ndarray:
    """Return qpos (steps, nq) and the number of contacts (steps, 1) of objects that fall on the floor."""
    data = mujoco.MjData(model)
    seen = np.empty((400, model.nq + 1))
    for k in range(len(seen)):
        mujoco.mj_step(model, data)
        seen[k] = [*data.qpos, data.ncon]
    assert seen[:, -1].max() > 0
    return seen


MAY_DIFFER = {
    "actuator_acc0", "actuator_actrange", "actuator_armature", "actuator_biasprm", "actuator_cranklength", "actuator_ctrlrange",
    "actuator_damping", "actuator_dampingpoly", "actuator_dynprm", "actuator_forcerange", "actuator_gainprm", "actuator_gear",
    "actuator_length0", "actuator_lengthrange", "actuator_user", "body_gravcomp", "body_inertia", "body_invweight0", "body_ipos",
    "body_iquat", "body_margin", "body_mass", "body_pos", "body_quat", "body_sameframe", "body_subtreemass", "body_user", "bvh_aabb",
    "bvh_child", "bvh_depth", "bvh_nodeid", "cam_fovy", "cam_intrinsic", "cam_ipd", "cam_mat0", "cam_pos", "cam_pos0", "cam_poscom0",
    "cam_quat", "cam_sensorsize", "cam_user", "dof_M0", "dof_armature", "dof_damping", "dof_dampingpoly", "dof_frictionloss",
    "dof_invweight0", "dof_length", "dof_solimp", "dof_solref", "efm0_L", "eq_data", "eq_solimp", "eq_solref", "geom_aabb",
    "geom_adhesion", "geom_fluid", "geom_friction", "geom_gap", "geom_margin", "geom_pos", "geom_quat", "geom_rbound", "geom_rgba",
    "geom_sameframe", "geom_size", "geom_solimp", "geom_solmix", "geom_solref", "geom_surfacevel", "geom_user", "jnt_actfrcrange",
    "jnt_axis", "jnt_margin", "jnt_pos", "jnt_range", "jnt_solimp", "jnt_solref", "jnt_stiffness", "jnt_stiffnesspoly", "jnt_user",
    "key_act", "key_ctrl", "key_mpos", "key_mquat", "key_qpos", "key_qvel", "key_time", "light_ambient", "light_attenuation",
    "light_bulbradius", "light_cutoff", "light_diffuse", "light_dir", "light_dir0", "light_exponent", "light_intensity", "light_pos",
    "light_pos0", "light_poscom0", "light_range", "light_softness", "light_specular", "mat_emission", "mat_metallic", "mat_reflectance",
    "mat_rgba", "mat_roughness", "mat_shininess", "mat_specular", "mat_texrepeat", "numeric_data", "opt.ccd_tolerance", "opt.density",
    "opt.gravity", "opt.impratio", "opt.ls_tolerance", "opt.magnetic", "opt.noslip_tolerance", "opt.o_friction", "opt.o_margin",
    "opt.o_solimp", "opt.o_solref", "opt.sleep_tolerance", "opt.timestep", "opt.tolerance", "opt.viscosity", "opt.wind", "pair_adhesion",
    "pair_friction", "pair_gap", "pair_margin", "pair_solimp", "pair_solref", "pair_solreffriction", "qpos0", "qpos_spring",
    "sensor_cutoff", "sensor_noise", "sensor_user", "site_pos", "site_quat", "site_rgba", "site_sameframe", "site_size", "site_user",
    "stat.center", "stat.extent", "stat.meaninertia", "stat.meanmass", "stat.meansize", "tendon_actfrcrange", "tendon_armature",
    "tendon_damping", "tendon_dampingpoly", "tendon_frictionloss", "tendon_invweight0", "tendon_length0", "tendon_lengthspring",
    "tendon_margin", "tendon_range", "tendon_rgba", "tendon_solimp_fri", "tendon_solimp_lim", "tendon_solref_fri", "tendon_solref_lim",
    "tendon_stiffness", "tendon_stiffnesspoly", "tendon_user", "tendon_width", "wrap_prm",
}
"""The fields that can be changed in place in MuJoCo 3.17. Each of them was reviewed."""


def test_every_array_can_differ_or_is_rejected(sliders: BatchResults) -> None:
    """If any entry of any array changes, the array is either one of the fields, or its name is in the error."""
    model = sliders[0].model(scene=True)
    checked = {"may": 0, "may not": 0}
    for name in dir(model):
        if name.startswith("_") or not isinstance(getattr(model, name), np.ndarray) or not getattr(model, name).size:
            continue
        other = copy.copy(model)
        array = getattr(other, name)
        array.flat[array.size - 1] = array.flat[array.size - 1] + 1 if array.dtype != bool else not array.flat[array.size - 1]
        if name in shared_model.changeable_fields():
            shared_model._same_structure(model, other, sliders[0], sliders[1])
            checked["may"] += 1
            continue
        with pytest.raises(StructuresDiffer) as refused:
            shared_model._same_structure(model, other, sliders[0], sliders[1])
        assert refused.value.field == name or name.startswith(("mesh_", "name")), name
        checked["may not"] += 1
    assert checked["may"] > 60 and checked["may not"] > 90


def test_new_arrays_of_mujoco_are_not_changed_in_place() -> None:
    """For a new array of MuJoCo, somebody must first review whether the structure of the model depends on it."""
    fields = shared_model.changeable_fields()
    assert fields - MAY_DIFFER == set() and {"body_mass", "opt.gravity"} <= fields


def test_differing_variant_is_named(sliders: BatchResults) -> None:
    model = sliders[0].model()
    for field, words in (
        ("jnt_limited", r"`jnt_limited` differs in `sliders_0` and `sliders_1` \(joint `slide`: True and False\)"),
        ("geom_contype", r"`geom_contype` differs in .* \(geom `pole"),
        ("dof_jntid", r"`dof_jntid` differs in .* \(joint `slide`"),
    ):
        other = copy.copy(model)
        array = getattr(other, field)
        array[-1] = not array[-1]
        with pytest.raises(StructuresDiffer, match=words):
            shared_model._same_structure(model, other, sliders[0], sliders[1])
    other = copy.copy(model)
    other.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    with pytest.raises(StructuresDiffer, match="the option `integrator` differs"):
        shared_model._same_structure(model, other, sliders[0], sliders[1])


def test_fields_of_another_batch_are_rejected(sliders: BatchResults, some: BatchResults) -> None:
    model, own = fields(sliders)
    _, other = fields(some, "flying")
    before = arrays(model)
    for wrong, words in ((lambda: apply(model, own, 8), "index 8 is out of range for fields of 8 variants"),
                         (lambda: apply(model, own, -1), "index -1 is out of range"),
                         (lambda: apply(model, {**own, **other}, 1), "the field `.*` and the model belong to different batches"),
                         (lambda: apply(model, {**own, "body_colour": own["body_mass"]}, 1),
                           "`body_colour` and the model belong to different batches")):
        with pytest.raises(FamilyError, match=words):
            wrong()
        assert arrays(model) == before
    with pytest.raises(FamilyError, match="has no built variant"):
        fields(sliders.filter({"mass": (90.0, 99.0)}))
