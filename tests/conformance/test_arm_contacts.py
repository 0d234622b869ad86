"""Contacts in the arm that MuJoCo reports, compared with meshes of the exact surfaces (manifold3d). In the poses of the documents, no
contact is false. In all poses, MuJoCo detects parts that overlap."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path

import manifold3d
import mujoco
import numpy as np
import pytest
import trimesh

from conformance import simulation as sim

MODES = ("bench", "drawing", "adrift")
TOUCH = 1e-9
"""The smallest volume [m^3] of an overlap of two parts, 1 mm^3. The meshes are accurate to 0.1 mm."""

Solids = dict[str, manifold3d.Manifold]


@pytest.fixture(scope="module")
def models(arm: Path) -> dict[str, mujoco.MjModel]:
    return {mode: mujoco.MjModel.from_xml_path(str(arm / "mjcf" / f"scene_{mode}.xml")) for mode in MODES}


@pytest.fixture(scope="module")
def solids(arm: Path, models: dict[str, mujoco.MjModel]) -> Solids:
    """Return the mesh of every part by path, in the frame of the part [m], from the file for display, with all holes."""
    by_name, found = {}, {}
    model = models["bench"]
    for part in sim.parts(model, sim.at(model, {})):
        name = model.mesh(int(model.geom(part).dataid[0])).name
        if name not in by_name:
            read = trimesh.load(arm / "mjcf" / "assets" / f"{name}.obj", process=False, force="mesh")
            mesh = manifold3d.Mesh(np.asarray(read.vertices, np.float32), np.asarray(read.faces, np.uint32))
            mesh.merge()
            by_name[name] = manifold3d.Manifold(mesh)
            assert by_name[name].status() == manifold3d.Error.NoError and by_name[name].volume() > 0.0, name
        found[part] = by_name[name]
    return found


def reported(model: mujoco.MjModel, data: mujoco.MjData) -> set[frozenset[str]]:
    """Return the pairs of parts between which MuJoCo reports a contact, without the floor."""
    found = set()
    for contact in data.contact:
        names = [model.geom(int(geom)).name.partition(":")[0] for geom in contact.geom]
        if "floor" not in names:
            found.add(frozenset(names))
    return found


def shared(model: mujoco.MjModel, data: mujoco.MjData, solids: Solids, pair: frozenset[str]) -> float:
    """Return the volume [m^3] of the overlap of two parts in a state."""
    placed = sim.parts(model, data)
    one, other = (solids[part].transform(placed[part][:3]) for part in sorted(pair))
    return float((one ^ other).volume())


def linked(model: mujoco.MjModel) -> dict[str, str]:
    return {part: model.body(int(model.geom(part).bodyid[0])).name for part in sim.parts(model, sim.at(model, {}))}


def inside(model: mujoco.MjModel, data: mujoco.MjData, solids: Solids) -> set[frozenset[str]]:
    """Return the pairs of parts that overlap although no joint connects their links and contacts are not excluded."""
    link = linked(model)
    excluded = {
        frozenset((model.body(int(s) >> 16).name, model.body(int(s) & 0xFFFF).name)) for s in model.exclude_signature
    }
    placed = sim.parts(model, data)
    there = {part: solid.transform(placed[part][:3]) for part, solid in solids.items() if "screw" not in part}
    found = set()
    for one, other in combinations(there, 2):
        links = frozenset((link[one], link[other]))
        if len(links) == 2 and links not in excluded and (there[one] ^ there[other]).volume() > TOUCH:
            found.add(frozenset((one, other)))
    return found


@pytest.mark.parametrize("mode", MODES)
def test_no_contact_in_document_poses_is_false(models: dict[str, mujoco.MjModel], solids: Solids, mode: str) -> None:
    model = models[mode]
    assert model.nkey == 4
    for key in range(model.nkey):
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, key)
        mujoco.mj_forward(model, data)
        for pair in reported(model, data):
            assert shared(model, data, solids, pair) > TOUCH, (model.key(key).name, pair)
        assert inside(model, data, solids) <= reported(model, data)


def test_self_collision_is_detected_by_both(models: dict[str, mujoco.MjModel], solids: Solids) -> None:
    """The arm is folded down onto its own base, within the limits of all joints."""
    q = {"yaw": np.radians(53), "shoulder": np.radians(-8), "elbow": np.radians(113), "wrist": np.radians(39)}
    for model in models.values():
        data = sim.at(model, q)
        pairs = reported(model, data)
        assert frozenset(("hand/pen", "plate")) in pairs & inside(model, data, solids)
        for pair in pairs:
            assert shared(model, data, solids, pair) > TOUCH, pair


def test_mujoco_reports_every_overlap(models: dict[str, mujoco.MjModel], solids: Solids) -> None:
    """In poses in which the arm is bent down, where overlaps are frequent. The contacts are equal in all modes."""
    source = np.random.default_rng(5)
    model = models["bench"]
    collisions = 0
    for _ in range(40):
        q = {name: source.uniform(*model.joint(name).range) for name in sim.joints(model)}
        q |= {"shoulder": np.radians(source.uniform(-45, 10)), "elbow": np.radians(source.uniform(95, 130))}
        data = sim.at(model, q)
        found = inside(model, data, solids)
        collisions += bool(found)
        link = linked(model)
        seen = {frozenset(link[part] for part in pair) for pair in reported(model, data)}
        assert {frozenset(link[part] for part in pair) for pair in found} <= seen, q
        for mode in ("drawing", "adrift"):
            assert reported(models[mode], sim.at(models[mode], q)) == reported(model, data), (mode, q)
    assert 8 < collisions < 32
