"""The holding force of a magnet with 300 N in MuJoCo: it is pulled off a plane by a growing force, and dragged along the plane. Expected
values: the plane lets go at the force of the magnet plus the weight, and a foot slides at the friction coefficient times this force.
Tested soles: a box and a cylinder, which are parts of this file; the foot of MInchW; and the whole robot on one foot."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import dataclass
from math import cos, radians, sin
from pathlib import Path

import mujoco
import numpy as np
import pytest

from conformance.harness import ROOT, build_here, write

from .conftest import pose_of

PULL, G = 300.0, 9.81
WITHIN = 0.03
RATE = 150.0
"""The rate at which a force grows [N/s]: 0.1 % of the expected value in a step of 2 ms."""

PARTS = """
    from build123d import Box, Cylinder, Pos

    from thingc import MountPoint, Thing
    from thingc import MATE


    class BoxSole(Thing):
        def __init__(self):
            super().__init__(color="#444444")
            self.sole = MountPoint(MATE)

        def result(self):
            return Pos(0, 0, 10) * Box(60, 40, 20)


    class CylinderSole(Thing):
        def __init__(self):
            super().__init__(color="#444444")
            self.sole = MountPoint(MATE)

        def result(self):
            return Pos(0, 0, 10) * Cylinder(25, 20)
"""

MATERIALS = """
    thingc: materials/1
    materials: {rubber: {density: 1100 kg/m^3, friction: {slide: 0.4}}}
"""
FOOT = """
    thingc: assembly/1
    name: KIND
    materials: [materials.yaml]
    components:
      magnet: {part: "soles:PART", material: rubber, collision: KIND, mass: {value: 500 g, source: measured}}
    modes:
      standing: {root: magnet.sole, base: free, contacts: {adhesion: {magnet.sole: 300 N}}}
"""
MINCHW_FOOT = """
    thingc: assembly/1
    name: minchw_foot
    materials: [minchw_materials.yaml]
    defaults: {component: {collision: part}}
    components:
      foot: {part: minchw.leg:Foot, params: {thickness: 5 mm}, material: petg_white, attach: {servo_seat: ankle_servo.bottom}}
      ankle_servo: {part: thingc_stock.dynamixel:XM540}
      magnet: {part: thingc_stock.magnets:HoldingMagnet, collision: cylinder, attach: {back: foot.magnet_seat}}
    modes:
      standing: {root: magnet.sole, base: free, contacts: {adhesion: {magnet.sole: 300 N}}}
"""
SLIDE = {"box": 0.4, "cylinder": 0.4, "minchw_foot": 0.5}
"""The friction of the contact, from the materials. The plane has a different value."""


@pytest.fixture(scope="module")
def feet(shared_store: str, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The MJCF file of each foot, built by the command line."""
    base = tmp_path_factory.mktemp("feet")
    shutil.copytree(ROOT / "parts" / "minchw", base / "parts" / "minchw", ignore=shutil.ignore_patterns("__pycache__"))
    write(base, {
        "parts/soles.py": PARTS,
        "materials.yaml": MATERIALS,
        "minchw_materials.yaml": (ROOT / "assemblies" / "minchw" / "materials.yaml").read_bytes(),
        "box.yaml": FOOT.replace("KIND", "box").replace("PART", "BoxSole"),
        "cylinder.yaml": FOOT.replace("KIND", "cylinder").replace("PART", "CylinderSole"),
        "minchw_foot.yaml": MINCHW_FOOT,
    })
    for kind in SLIDE:
        build_here(f"{kind}.yaml", "--emit", "mjcf", "-o", "build", store=shared_store, cwd=base)
    return {kind: base / "build" / kind / "mjcf" / f"{kind}_standing.xml" for kind in SLIDE}


def on_plane(path: Path, timestep: float, **plane: object) -> mujoco.MjModel:
    """Return a model on a plane with friction 0.9, which is used only if the priority of the plane is above 1."""
    spec = mujoco.MjSpec.from_file(str(path))
    spec.option.timestep = timestep
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC  # a pyramid bears less drag across its corners
    spec.option.impratio = 10.0
    spec.worldbody.add_geom(
        name="plane", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1], **{"friction": [0.9, 0.005, 0.0001], **plane}
    )
    return spec.compile()


@dataclass(slots=True)
class Bench:
    """A foot with an active magnet, pulled at the middle of its sole."""

    model: mujoco.MjModel
    data: mujoco.MjData
    sole: str

    def step(self, force: np.ndarray) -> None:
        """Simulate one step with a force [N] at the middle of the sole, which causes no tilting torque."""
        site = self.data.site(self.sole)
        body = int(self.model.site_bodyid[self.model.site(self.sole).id])
        self.data.qfrc_applied[:] = 0.0
        mujoco.mj_applyFT(self.model, self.data, force, np.zeros(3), site.xpos, body, self.data.qfrc_applied)
        mujoco.mj_step(self.model, self.data)

    def settle(self, time: float) -> None:
        for _ in range(round(time / self.model.opt.timestep)):
            mujoco.mj_step(self.model, self.data)

    def grow(self, direction: np.ndarray, gone: Callable[[], bool], start: float, most: float) -> float:
        """Increase the force [N] along `direction` from `start`. Return the force at which `gone` first holds."""
        force = start
        while not gone():
            force += RATE * self.model.opt.timestep
            assert force < most, "it holds whatever pulls"
            self.step(force * direction)
        return force

    def touches(self) -> bool:
        return self.data.ncon > 0


def standing(path: Path, timestep: float, magnet: float = PULL) -> Bench:
    """Return a state at rest on the plane with the given magnet force."""
    model = on_plane(path, timestep)
    bench = Bench(model, mujoco.MjData(model), "magnet/sole")
    assert model.nu == 1 and tuple(model.actuator_ctrlrange[0]) == (0.0, PULL)
    bench.data.ctrl[0] = magnet
    bench.settle(0.3)
    assert np.abs(bench.data.qvel).max() < 1e-4
    assert abs(bench.data.site("magnet/sole").xpos[2]) < 1e-4
    return bench


@pytest.mark.parametrize("timestep", [0.001, 0.002])
@pytest.mark.parametrize("kind", SLIDE)
def test_foot_detaches_at_300_n_plus_its_weight(feet: dict[str, Path], kind: str, timestep: float) -> None:
    bench = standing(feet[kind], timestep)
    weight = float(bench.model.body_mass.sum()) * G
    assert 4.0 < weight < 6.0
    found = bench.grow(np.array([0, 0, 1.0]), lambda: not bench.touches(), 200.0, 450.0)
    assert found == pytest.approx(PULL + weight, rel=WITHIN)
    for _ in range(round(0.1 / timestep)):
        bench.step(np.array([0, 0, found]))
    assert bench.data.site("magnet/sole").xpos[2] > 1e-3  # it is off for good, not bouncing


@pytest.mark.parametrize("magnet", [0.0, 120.0])
def test_coil_reduces_the_force(feet: dict[str, Path], magnet: float) -> None:
    bench = standing(feet["cylinder"], 0.002, magnet)
    weight = float(bench.model.body_mass.sum()) * G
    found = bench.grow(np.array([0, 0, 1.0]), lambda: not bench.touches(), 0.0, 450.0)
    assert found == pytest.approx(magnet + weight, rel=WITHIN, abs=0.5)


@pytest.mark.parametrize("timestep", [0.001, 0.002])
@pytest.mark.parametrize("kind", SLIDE)
@pytest.mark.parametrize("angle", [0.0, 50.0])
def test_foot_slides_at_friction_times_the_force(feet: dict[str, Path], kind: str, timestep: float, angle: float) -> None:
    bench = standing(feet[kind], timestep)
    weight = float(bench.model.body_mass.sum()) * G
    along = np.array([cos(radians(angle)), sin(radians(angle)), 0.0])
    expected = SLIDE[kind] * (PULL + weight)
    begin = np.array(bench.data.site("magnet/sole").xpos)
    found = bench.grow(along, lambda: float(np.linalg.norm(bench.data.qvel[:3])) > 0.02, 0.7 * expected, 450.0)
    assert found == pytest.approx(expected, rel=WITHIN)
    assert np.linalg.norm(bench.data.site("magnet/sole").xpos - begin) < 1e-3


@pytest.mark.parametrize("timestep", [0.001, 0.002])
def test_minchw_detaches_at_300_n_plus_the_load_of_the_foot(minchw: Path, timestep: float) -> None:
    """The whole robot stands on both feet in an arched pose with one active magnet. The force is the load of this foot plus 300 N."""
    path = minchw / "mjcf" / "minchw_crawl.xml"
    model = on_plane(path, timestep, priority=2, friction=[0.5, 0.005, 0.0001], solref=[0.004, 1.0], solimp=[0.99, 0.999, 0.0005, 0.5, 2.0])
    data = pose_of(model, "arched")
    data.joint("root").qpos[2] -= min(data.site(f"{leg}/sole").xpos[2] for leg in ("front", "rear"))
    for joint in ("front/knee", "front/ankle", "rear/knee", "rear/ankle"):
        data.actuator(joint).ctrl = radians(100)
    bench = Bench(model, data, "front/sole")
    bench.settle(1.0)
    rested = bears(model, data)
    assert sum(rested.values()) == pytest.approx(float(model.body_mass.sum()) * G, rel=1e-3)
    data.actuator("front/sole").ctrl = PULL
    bench.settle(0.5)
    assert bears(model, data)["front"] == pytest.approx(PULL + rested["front"], rel=0.01)
    found = bench.grow(np.array([0, 0, 1.0]), lambda: bears(model, data)["front"] <= 0.0, 200.0, 450.0)
    assert found == pytest.approx(PULL + rested["front"], rel=WITHIN)


def bears(model: mujoco.MjModel, data: mujoco.MjData) -> dict[str, float]:
    """Return the force [N] between the plane and each sole, including the force of the magnet."""
    found = {"front": 0.0, "rear": 0.0}
    for index, contact in enumerate(data.contact):
        names = {model.geom(int(geom)).name for geom in contact.geom}
        leg = next(leg for leg in found if {"plane", f"{leg}/magnet:collision"} == names)
        force = np.zeros(6)
        mujoco.mj_contactForce(model, data, index, force)
        found[leg] += force[0]
    return found


@pytest.mark.parametrize(("magnets", "stays"), [(PULL, True), (0.0, False)])
def test_minchw_hangs_from_a_ceiling(minchw: Path, magnets: float, stays: bool) -> None:
    path = minchw / "mjcf" / "minchw_crawl_ceiling.xml"
    model = on_plane(path, 0.002, priority=2, friction=[0.5, 0.005, 0.0001], solref=[0.004, 1.0], solimp=[0.99, 0.999, 0.0005, 0.5, 2.0])
    assert tuple(model.opt.gravity) == (0.0, 0.0, G)
    data = pose_of(model, "arched")
    data.joint("root").qpos[2] -= max(data.site(f"{leg}/sole").xpos[2] for leg in ("front", "rear")) + 2e-5
    for joint in ("front/knee", "front/ankle", "rear/knee", "rear/ankle"):
        data.actuator(joint).ctrl = radians(100)
    for leg in ("front", "rear"):
        data.actuator(f"{leg}/sole").ctrl = magnets
    bench = Bench(model, data, "front/sole")
    bench.settle(0.5)
    away = max(float(data.site(f"{leg}/sole").xpos[2]) for leg in ("front", "rear"))
    assert (away < 1e-4) if stays else (away > 0.5)
    if stays:
        assert sum(bears(model, data).values()) == pytest.approx(2 * PULL - float(model.body_mass.sum()) * G, rel=0.01)
