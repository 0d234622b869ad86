"""Adhesion holds a block on a wall and under a ceiling: written scenes, simulated by MuJoCo for ten seconds.

The minimum sliding distance with a weak magnet follows from Coulomb friction, which bears at most the coefficient times the pull. The
block may slide further, because a sliding body rises in MuJoCo and a magnet without contact does not pull."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from mjcf.handmade import Made, Piece, Segment, box_part, cylinder_part, material, matrix, raw
from thingc.base.diagnostic_output import as_json
from thingc.geometry.store.local import Store
from thingc.model.resolve.types import Overrides
from thingc.targets.mjcf.adhesion_contacts import CLASS
from thingc.targets.mjcf.emit import emit

G, SLIDE, CREEP = 9.81, 0.5, 5e-5
WALL, CEILING = (-G, 0.0, 0.0), (0.0, 0.0, G)


@pytest.fixture
def store(tmp_path: object) -> Store:
    return Store(f"{tmp_path}/store")


def block(store: Store, force: float, gravity: tuple[float, float, float], shape: str = "box", **said: object) -> Made:
    """A block of 0.4 or 0.5 kg that stands exactly on z = 0, with an active magnet of `force` [N]."""
    part = box_part(store, (-0.05, -0.04, -0.025), (0.05, 0.04, 0.025)) if shape == "box" else cylinder_part(store, 0.05, 0.05)
    piece = Piece("block", part, material=material(slide=SLIDE), overrides=Overrides(collision=shape))  # type: ignore[arg-type]
    return Made(
        segments=[Segment("block", [piece], pose=matrix((0, 0, 0.025)))], adhesions=(("block/sole", "block", force),),
        control={"block/sole": force}, gravity=gravity, keyframes=(("here", {"turn": 0.0}),), **said,  # type: ignore[arg-type]
    )


def scene(store: Store, made: Made) -> mujoco.MjModel:
    """The scene of the mode, which has a free base, with the floor written by thingc."""
    request = made.request(store, ("bench", "free"))
    files = emit(request).files
    assert as_json(request.report.sorted_diagnostics()) == []
    beside = {
        path.rpartition("/")[2]: content if isinstance(content, bytes) else store.read(content.sha256) for path, content in files.items()
    }
    return mujoco.MjModel.from_xml_string(beside["scene_bench.xml"].decode(), beside)


def max_drift(model: mujoco.MjModel, seconds: float) -> float:
    """Largest distance [m] of the block from its start."""
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    begin, worst = data.qpos[:3].copy(), 0.0
    for _ in range(round(seconds / model.opt.timestep)):
        mujoco.mj_step(model, data)
        worst = max(worst, float(np.linalg.norm(data.qpos[:3] - begin)))
    return worst


def with_default_contacts(model: mujoco.MjModel) -> mujoco.MjModel:
    """The same model with MuJoCo's default contacts."""
    model.geom_solref[:], model.geom_solimp[:] = (0.02, 1.0), (0.9, 0.95, 0.001, 0.5, 2.0)
    model.opt.cone, model.opt.impratio = mujoco.mjtCone.mjCONE_PYRAMIDAL, 1.0
    return model


@pytest.mark.parametrize("shape", ["box", "cylinder", "hull"])
@pytest.mark.parametrize("gravity", [WALL, CEILING], ids=["wall", "ceiling"])
def test_magnet_holds_its_block(store: Store, shape: str, gravity: tuple[float, float, float]) -> None:
    """The block neither slides nor sinks at common time steps. With MuJoCo's default contacts it creeps."""
    if shape == "hull":
        made = block(store, 100.0, gravity)
        made.segments[0].pieces[0].overrides = Overrides(collision="hull")
    else:
        made = block(store, 100.0, gravity, shape)
    model = scene(store, made)
    for step in (0.001, 0.002):
        model.opt.timestep = step
        assert max_drift(model, 10.0) < CREEP, step
    assert max_drift(with_default_contacts(model), 10.0) > CREEP


def test_weak_magnet_lets_the_block_slide(store: Store) -> None:
    """If mu F < m g, the block slides down the wall; a force just above this limit holds it. Under a ceiling it falls if F < m g."""
    mass = 0.4
    for share in (0.5, 0.9):
        assert max_drift(scene(store, block(store, share * mass * G / SLIDE, WALL)), 0.5) > 0.99 * (1.0 - share) * G * 0.5**2 / 2, share
    assert max_drift(scene(store, block(store, 1.1 * mass * G / SLIDE, WALL)), 10.0) < CREEP
    assert max_drift(scene(store, block(store, 0.9 * mass * G, CEILING)), 1.0) > 0.05


def test_magnet_without_material_has_stiff_contacts(store: Store) -> None:
    """Without a friction in the document, MuJoCo uses its default, the larger of the two; the contact stays stiff."""
    made = block(store, 100.0, WALL)
    made.segments[0].pieces[0].material = None
    assert max_drift(scene(store, made), 10.0) < CREEP


def test_only_adhering_geoms_have_stiff_contacts(store: Store) -> None:
    """Links without an active magnet, and robots without adhesion, keep MuJoCo's default contacts."""
    made = block(store, 100.0, WALL)
    made.segments.append(Segment("arm", [Piece("arm", cylinder_part(store, 0.01, 0.1), matrix((0, 0, 0.1)))], parent=0, joint="turn"))
    model = scene(store, made)
    assert model.geom("block:collision").solref[0] == 0.004
    assert model.geom("arm:collision").solref[0] == 0.02
    made.control = {}  # a mode in which the magnet is off
    model = scene(store, made)
    assert model.geom("block:collision").solref[0] == 0.02
    assert (model.opt.cone, model.opt.impratio) == (mujoco.mjtCone.mjCONE_PYRAMIDAL, 1.0)


def test_document_settings_override_adhesion_defaults(store: Store) -> None:
    """`simulation` and raw attributes override the cone, `impratio`, and the contact parameters of all geoms, of adhering geoms and of
    one geom."""
    plain = scene(store, block(store, 100.0, WALL))
    assert (plain.opt.cone, plain.opt.impratio) == (mujoco.mjtCone.mjCONE_ELLIPTIC, 100.0)
    pyramids = scene(store, block(store, 100.0, WALL, simulation={"cone": "pyramidal"}))
    assert (pyramids.opt.cone, pyramids.opt.impratio) == (mujoco.mjtCone.mjCONE_PYRAMIDAL, 1.0)  # 100 throws feet off with pyramids
    assert scene(store, block(store, 100.0, WALL, raw=(raw(5, "option cone", "pyramidal"),))).opt.impratio == 1.0
    assert scene(store, block(store, 100.0, WALL, simulation={"impratio": 10.0})).opt.impratio == 10.0
    for path in ("default collision geom solref", "default arm geom solref", f"default {CLASS} geom solref", "geom block.collision solref"):
        said = raw(5, path.replace("block.collision", "block:collision"), "0.03 1")
        geom = scene(store, block(store, 100.0, WALL, raw=(said,))).geom("block:collision")
        assert geom.solref[0] == 0.03, path
        assert geom.solimp[0] == 0.99
