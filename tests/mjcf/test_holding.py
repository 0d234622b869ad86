"""What adheres stays where it is on a wall and under a ceiling: the scenes as written, stepped by MuJoCo for ten seconds.

How far a block slides at least whose magnet is too weak is arithmetic: Coulomb's friction bears no more than the coefficient times the
pull. It may be further, for in MuJoCo what slides rises, and a magnet that does not touch does not pull.
"""

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
    """A block of 0.4 or 0.5 kg on z = 0, exactly, with a magnet of `force` [N] that is on."""
    part = box_part(store, (-0.05, -0.04, -0.025), (0.05, 0.04, 0.025)) if shape == "box" else cylinder_part(store, 0.05, 0.05)
    piece = Piece("block", part, material=material(slide=SLIDE), overrides=Overrides(collision=shape))  # type: ignore[arg-type]
    return Made(
        segments=[Segment("block", [piece], pose=matrix((0, 0, 0.025)))], adhesions=(("block/sole", "block", force),),
        control={"block/sole": force}, gravity=gravity, keyframes=(("here", {"turn": 0.0}),), **said,  # type: ignore[arg-type]
    )


def scene(store: Store, made: Made) -> mujoco.MjModel:
    """The scene of its mode, a free base, on the floor that is written with it."""
    request = made.request(store, ("bench", "free"))
    files = emit(request).files
    assert as_json(request.report.ordered()) == []
    beside = {
        path.rpartition("/")[2]: content if isinstance(content, bytes) else store.read(content.sha256) for path, content in files.items()
    }
    return mujoco.MjModel.from_xml_string(beside["scene_bench.xml"].decode(), beside)


def crept(model: mujoco.MjModel, seconds: float) -> float:
    """How far [m] the block is from where it began, at most."""
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    begin, worst = data.qpos[:3].copy(), 0.0
    for _ in range(round(seconds / model.opt.timestep)):
        mujoco.mj_step(model, data)
        worst = max(worst, float(np.linalg.norm(data.qpos[:3] - begin)))
    return worst


def soft(model: mujoco.MjModel) -> mujoco.MjModel:
    """The same with the contacts that MuJoCo has by itself."""
    model.geom_solref[:], model.geom_solimp[:] = (0.02, 1.0), (0.9, 0.95, 0.001, 0.5, 2.0)
    model.opt.cone, model.opt.impratio = mujoco.mjtCone.mjCONE_PYRAMIDAL, 1.0
    return model


@pytest.mark.parametrize("shape", ["box", "cylinder", "hull"])
@pytest.mark.parametrize("gravity", [WALL, CEILING], ids=["wall", "ceiling"])
def test_a_magnet_holds_its_block(store: Store, shape: str, gravity: tuple[float, float, float]) -> None:
    """It neither slides nor sinks, at time steps that robots have; MuJoCo's own contacts let it creep."""
    if shape == "hull":
        made = block(store, 100.0, gravity)
        made.segments[0].pieces[0].overrides = Overrides(collision="hull")
    else:
        made = block(store, 100.0, gravity, shape)
    model = scene(store, made)
    for step in (0.001, 0.002):
        model.opt.timestep = step
        assert crept(model, 10.0) < CREEP, step
    assert crept(soft(model), 10.0) > CREEP


def test_a_magnet_that_is_too_weak_lets_it_slide(store: Store) -> None:
    """With mu F below m g the block slides down the wall, and one just above holds it; under a ceiling it falls off with F below m g."""
    mass = 0.4
    for share in (0.5, 0.9):
        assert crept(scene(store, block(store, share * mass * G / SLIDE, WALL)), 0.5) > 0.99 * (1.0 - share) * G * 0.5**2 / 2, share
    assert crept(scene(store, block(store, 1.1 * mass * G / SLIDE, WALL)), 10.0) < CREEP
    assert crept(scene(store, block(store, 0.9 * mass * G, CEILING)), 1.0) > 0.05


def test_without_a_material_the_floor_does_not_soften_it(store: Store) -> None:
    """Friction without a stated one is MuJoCo's, larger of the two; the contact is as stiff all the same."""
    made = block(store, 100.0, WALL)
    made.segments[0].pieces[0].material = None
    assert crept(scene(store, made), 10.0) < CREEP


def test_only_what_adheres_is_written_so(store: Store) -> None:
    """A robot without adhesions has MuJoCo's contacts; of one with a magnet the other links have."""
    made = block(store, 100.0, WALL)
    made.segments.append(Segment("arm", [Piece("arm", cylinder_part(store, 0.01, 0.1), matrix((0, 0, 0.1)))], parent=0, joint="turn"))
    model = scene(store, made)
    assert model.geom("block:collision").solref[0] == 0.004
    assert model.geom("arm:collision").solref[0] == 0.02
    made.control = {}  # a mode in which the magnet is off
    model = scene(store, made)
    assert model.geom("block:collision").solref[0] == 0.02
    assert (model.opt.cone, model.opt.impratio) == (mujoco.mjtCone.mjCONE_PYRAMIDAL, 1.0)


def test_what_the_document_says_counts(store: Store) -> None:
    """`simulation` and raw attributes win: of the cone, of `impratio`, of all that collides, of what adheres, of one geom."""
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
