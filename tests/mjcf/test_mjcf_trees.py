"""Random trees of joints, through `link`, `root` and the emitter into MuJoCo: the robot does not depend on its root.

The trees and their chains of matrices are those of the tests of spanning trees; here MuJoCo is compared with them."""

from __future__ import annotations

import tempfile

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from graph.builder import as_matrix, mass_properties
from robot.test_spanning_tree_properties import WITHOUT_LEAD, Tree, build, robots, world_of
from thingc.base.diagnostics import Report
from thingc.geometry.store.local import Store
from thingc.model.robot.tree import in_link
from thingc.targets.mjcf.emit import emit
from thingc.targets.request import EmitRequest

trees = st.builds(build, st.integers(0, 2**32 - 1), st.integers(2, 6), st.just(WITHOUT_LEAD))
"""Screws are excluded; the tests of screws cover MuJoCo's approximation of them."""


def models(tree: Tree) -> dict[str, mujoco.MjModel]:
    """The model of every mode, each accepted by MuJoCo."""
    chosen = robots(tree.assembly)
    with tempfile.TemporaryDirectory() as folder:
        request = EmitRequest(
            assembly=tree.assembly,
            robots=tuple(chosen.values()),
            store=Store(folder),
            report=Report(),
            geometry=None,
            workspace=None,  # type: ignore[arg-type]
        )
        files = emit(request).files
    assert request.report.diagnostics == []
    return {name: mujoco.MjModel.from_xml_string(files[f"mjcf/tree_{name}.xml"].decode()) for name in chosen}  # type: ignore[union-attr]


def at(model: mujoco.MjModel, q: dict[str, float]) -> mujoco.MjData:
    data = mujoco.MjData(model)
    for path, value in q.items():
        data.joint(path).qpos = value
    mujoco.mj_forward(model, data)
    return data


def pose_of(data: mujoco.MjData, link: str) -> np.ndarray:
    found = np.eye(4)
    found[:3, :3], found[:3, 3] = data.body(link).xmat.reshape(3, 3), data.body(link).xpos
    return found


@settings(max_examples=8)
@given(trees)
def test_poses_of_random_trees_match_matrices(tree: Tree) -> None:
    inside = in_link(tree.assembly)
    for name, model in models(tree).items():
        data = at(model, tree.q)
        expected = world_of(tree, name)
        for position, k in enumerate(tree.order):
            link = tree.assembly.links[tree.assembly.link_of[position]].name
            assert pose_of(data, link) @ as_matrix(inside[position]) == pytest.approx(expected[k], abs=1e-9)


@settings(max_examples=8)
@given(trees)
def test_roots_of_all_modes_are_sites(tree: Tree) -> None:
    """Every root of every mode is a site in every file, at the pose given by the matrices."""
    for name, model in models(tree).items():
        data = at(model, tree.q)
        expected = world_of(tree, name)
        for k in range(tree.count):
            for site, local in ((f"c{k}/origin", np.eye(4)), (f"c{k}/{'ab'[k % 2]}", tree.mounts[k, "ab"[k % 2]])):
                assert data.site(site).xpos == pytest.approx((expected[k] @ local)[:3, 3], abs=1e-9)
                assert data.site(site).xmat.reshape(3, 3) == pytest.approx((expected[k] @ local)[:3, :3], abs=1e-9)


@settings(max_examples=8)
@given(trees)
def test_total_mass_properties_match_mujoco(tree: Tree) -> None:
    """Mass, centre and inertia of the robot at q equal the free base's block of MuJoCo's mass matrix."""
    chosen = robots(tree.assembly)
    for name, model in models(tree).items():
        if not name.startswith("part_"):
            continue
        data = at(model, tree.q)
        matrix = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, matrix)
        ours = mass_properties(chosen[name], tree.q)
        assert matrix[:3, :3] == pytest.approx(ours.mass * np.eye(3), rel=1e-9, abs=1e-12)
        assert float(model.body_mass.sum()) == pytest.approx(ours.mass, rel=1e-9)
        root = pose_of(data, model.body(1).name)
        assert data.subtree_com[0] == pytest.approx((root @ [*ours.centre, 1.0])[:3], abs=1e-9)
        c = np.array(ours.centre)
        about_root = np.array(ours.inertia) + ours.mass * (c @ c * np.eye(3) - np.outer(c, c))
        # MuJoCo's free joint turns about the body's own axes.
        assert matrix[3:6, 3:6] == pytest.approx(about_root, rel=1e-9, abs=1e-9 * np.abs(about_root).max())


@settings(max_examples=8)
@given(trees)
def test_dynamics_do_not_depend_on_the_root(tree: Tree) -> None:
    """Mass matrix and gravity torque of the mode fixed at L equal those of every free mode with L constrained to stand still."""
    made = models(tree)
    bolted = made["mount_0"]
    held = bolted.body(1).name
    reference = at(bolted, tree.q)
    expected = np.zeros((bolted.nv, bolted.nv))
    mujoco.mj_fullM(bolted, reference, expected)
    names = [bolted.joint(i).name for i in range(bolted.njnt)]
    for name, model in made.items():
        if not name.startswith("part_"):
            continue
        data = at(model, tree.q)
        # Put the free base where L stands as it does when it is bolted.
        moved = pose_of(reference, held) @ np.linalg.inv(pose_of(data, held)) @ pose_of(data, model.body(1).name)
        data.qpos[:3] = moved[:3, 3]
        mujoco.mju_mat2Quat(data.qpos[3:7], moved[:3, :3].ravel())
        mujoco.mj_forward(model, data)
        full = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, full)
        jacobian = np.zeros((6, model.nv))
        mujoco.mj_jacBody(model, data, jacobian[:3], jacobian[3:], model.body(held).id)
        own = [model.joint(n).dofadr[0] for n in names]
        still = np.zeros((model.nv, len(names)))
        for column, dof in enumerate(own):
            still[dof, column] = 1.0
        still[:6] = -np.linalg.solve(jacobian[:, :6], jacobian @ still)
        scale = max(1e-12, np.abs(expected).max(initial=0.0))
        assert still.T @ full @ still == pytest.approx(expected, rel=1e-9, abs=1e-9 * scale)
        torque = still.T @ data.qfrc_bias
        size = max(1e-12, np.abs(reference.qfrc_bias).max(initial=0.0))
        assert torque == pytest.approx(reference.qfrc_bias, rel=1e-9, abs=1e-9 * max(size, 9.81 * model.body_mass.sum()))
