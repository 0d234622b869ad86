"""Variants with different geometry: one text with other meshes gives the compiled model, and in a merged model each variant moves as in
its own model."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

import thingc
from thingc.batch import apply
from thingc.batch.families.mjspec_recompile import ModelTemplate, RecompiledSpec
from thingc.batch.mujoco_arrays.equality import different_fields
from thingc.driver.output import OutputError
from thingc.geometry.store.local import StoreUnusable

LEVERS = """\
thingc: assembly/1
name: levers
materials: {petg: {density: 1270 kg/m^3}}
parameters: {length: {value: 80 mm, min: 20 mm, max: 500 mm}}
defaults: {component: {collision: mesh}}
components:
  plate: {part: boxes:Plate}
  lever: {part: boxes:Lever, params: {length: =length}}
joints:
  hinge:
    {type: revolute, parent: plate.top, child: lever.hub, limit: {lower: -90 deg, upper: 90 deg}, dynamics: {damping: 1e-5 N*m*s/rad}}
modes: {still: {root: plate, at: {rpy: 90 0 0 deg}}, dropped: {root: plate, base: free, at: {xyz: 0 0 200 mm, rpy: 90 0 0 deg}}}
"""


def moved(model: mujoco.MjModel) -> Any:
    data = mujoco.MjData(model)
    data.qpos[:] = 0.3
    found = []
    for _ in range(50):
        mujoco.mj_step(model, data)
        found.append(data.qpos.copy())
    return np.array(found)


@pytest.fixture(scope="module")
def levers(tmp_path_factory: pytest.TempPathFactory, root: Path) -> Path:
    folder = tmp_path_factory.mktemp("levers")
    (folder / "thingc.toml").write_text('thingc = "workspace/1"\nparts = ["parts"]\n')
    shutil.copytree(root / "tests" / "cases" / "parts", folder / "parts")
    (folder / "levers.yaml").write_text(LEVERS)
    return folder / "levers.yaml"


@pytest.mark.slow
def test_variants_move_as_in_their_own_models(levers: Path, shared_store: str, monkeypatch: pytest.MonkeyPatch) -> None:
    many: list[dict[str, Any]] = [
        {"length": 0.08}, {"length": "95 mm"}, {"length": 0.08, "joints.hinge.dynamics.damping": 2e-5}, {"length": 0.095}, {"length": 9.0},
    ]
    with thingc.family(levers, store=shared_store) as family:
        explained = str(family.explain("length"))
        whole, apart = family.batched(many), family.batched(many, union=False)
        own = [model for model in family.models(many) if isinstance(model, mujoco.MjModel)]
        lengths = [{"length": length, "joints.hinge.dynamics.damping": 1e-5 * k} for k in (1, 2, 3) for length in (0.095, 0.11, 0.1)]
        read = [family._read(one) for one in lengths]
        exchanged, models = family.models(lengths, share=True), family._models_of(None, False)
        for (_, one), model in zip(read, exchanged, strict=True):
            assert isinstance(model, mujoco.MjModel) and different_fields(model, models._compile(one)) == []
        found = models.cache_for(read[0][1]).find(read[0][1])
        assert found is not None and found[0].exchange is not None
        assert all(found[0].outputs(one.values) is not None for _, one in read)
        assert isinstance(found[0].template, ModelTemplate) and models._specs[found[0].template] is not None  # for which no text is read
        with monkeypatch.context() as wrong:
            wrong.setattr(RecompiledSpec, "model", lambda *_: own[0])
            models._specs.clear()
            models._cached.clear()
            for (_, one), model in zip(read, family.models(lengths), strict=True):
                assert isinstance(model, mujoco.MjModel) and different_fields(model, models._compile(one)) == []
            assert set(models._specs.values()) == {None}
        evaluation = family._evaluation_of(family.mode)
        assert [one.results for one in family.evaluate(lengths)] == [evaluation._compile(one)[0] for _, one in read]
        results = evaluation.cache_for(read[0][1]).find(read[0][1])
        assert results is not None and results[0].exchange is not None
    assert explained == (
        "length changes the text and the parts of one model, which MuJoCo compiles again: "
        "the part `boxes:Lever` depends on the number (mode still)"
    )
    assert list(whole.refused) == list(apart.refused) == [4]
    assert [group.indices for group in apart.groups] == [(0, 2), (1, 3)]
    (group,) = whole.groups
    assert group.indices == (0, 1, 2, 3) and group.model.nmesh == 3 and all(model.nmesh == 2 for model in own)
    first, second, third, fourth = group.fields["geom_dataid"].tolist()
    assert first == third != second == fourth and group.fields["dof_damping"][:, 0].tolist() == [1e-5, 1e-5, 2e-5, 1e-5]
    for place, model in enumerate(own):
        apply(group.model, group.fields, place)
        assert np.array_equal(moved(group.model), moved(model))
        assert np.array_equal(group.model.geom_rbound, model.geom_rbound) and np.array_equal(group.model.body_mass, model.body_mass)
    assert len({moved(model)[-1, 0] for model in own}) == 3


@pytest.mark.slow
def test_variants_fall_on_a_floor_as_in_their_scenes(levers: Path, shared_store: str) -> None:
    def fallen(model: mujoco.MjModel, steps: int = 400) -> Any:
        data = mujoco.MjData(model)
        mujoco.mj_step(model, data, steps)
        assert data.ncon > 0 and data.qpos[2] > 0.0
        return data.qpos

    many = [{"length": 0.095}, {"length": 0.095, "joints.hinge.dynamics.damping": 2e-5}, {"length": 0.08}]
    with thingc.family(levers, store=shared_store, mode="dropped") as family:
        own = [model for model in family.models(many, floor=True) if isinstance(model, mujoco.MjModel)]
        (group,) = family.batched(many, floor=True).groups
        with pytest.raises(KeyError):
            next(family.models(many)).geom("floor")
    built = thingc.compile(str(levers), store=shared_store, modes=["dropped"], parameters={"length": "95 mm"}).modes["dropped"]
    files = {path.removeprefix("mjcf/"): data for path, data in built.files.items() if path.startswith("mjcf/")}
    scene = mujoco.MjModel.from_xml_string(files["scene_dropped.xml"].decode(), files)
    expected = fallen(scene)
    assert np.array_equal(fallen(own[0]), expected) and not np.array_equal(fallen(own[1]), expected)
    for place, model in enumerate(own):
        apply(group.model, group.fields, place)
        np.testing.assert_allclose(fallen(group.model), fallen(model), rtol=0, atol=1e-9)
        assert (group.model.mesh_graphadr >= 0).all()


@pytest.mark.slow
def test_deleted_store_is_reported(levers: Path, tmp_path: Path) -> None:
    with thingc.family(levers, store=str(tmp_path / "store")) as family:
        assert family.write({}, tmp_path / "first") == ()
        shutil.rmtree(tmp_path / "store")
        with pytest.raises(OutputError, match="no longer contains the meshes of parts") as fault:
            family.write({}, tmp_path / "second")
        assert fault.value.diagnostic.help == "create the family again" and not (tmp_path / "second").exists()
        for asked in (lambda: family.model({}), lambda: list(family.models([{}])), lambda: family.batched([{}])):
            with pytest.raises(StoreUnusable, match="the meshes of parts are missing; create the family again"):
                asked()
    with thingc.family(levers, store=str(tmp_path / "store")) as anew:
        assert anew.write({}, tmp_path / "second") == ()
