"""Defects of the research prototype must not return: tests from documents to the numbers in MuJoCo."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh

from conformance import simulation as sim
from conformance.harness import build_here, thingc_here, write

PARTS = '''
    from build123d import Box, Cylinder, Location, Pos, Sphere

    from thingc import Length, MountPoint, Thing


    class Post(Thing):
        """A box with a mount on each of two sides."""

        def __init__(self):
            super().__init__(material="lead")
            self.body = Box(40, 40, 40)
            self.left = MountPoint(Location((-20, 0, 0), (0, -90, 0)))
            self.right = MountPoint(Location((20, 0, 0), (0, 90, 0)))

        def result(self):
            return self.body


    class Ball(Thing):
        """A sphere far from its own origin."""

        def __init__(self, radius: Length = 10, away: Length = 400):
            super().__init__(material="lead")
            self.body = Pos(away, -away / 2, 0) * Sphere(radius)

        def result(self):
            return self.body


    class Shank(Thing):
        """A thin rod whose end is its mount."""

        def __init__(self):
            super().__init__(material="lead")
            self.body = Pos(0, 0, 50) * Cylinder(3, 100)
            self.end = MountPoint(Location((0, 0, 0), (0, 180, 0)))
            self.tip = MountPoint(Location((0, 0, 100)))

        def result(self):
            return self.body


    class Marker(Thing):
        """Of no geometry."""

        def __init__(self):
            super().__init__()
            self.here = MountPoint(Location())

        def result(self):
            return None
'''
LEAD = 11000.0
MATERIALS = "materials: {lead: {density: 11000 kg/m^3, color: gray}}"

LEG = f"""
    thingc: assembly/1
    name: leg
    {MATERIALS}
    components:
      thigh: {{part: limbs:Shank}}
      shin: {{part: limbs:Shank}}
    joints:
      knee: {{type: revolute, parent: thigh.tip, child: shin.end, limit: {{lower: -90 deg, upper: 90 deg}}}}
    mounts: {{hip: thigh.end, foot: shin.tip}}
"""

WALKER = f"""
    thingc: assembly/1
    name: walker
    {MATERIALS}
    components:
      trunk: {{part: limbs:Post}}
      left: {{assembly: leg.yaml, attach: {{hip: trunk.left}}}}
      right: {{assembly: leg.yaml, attach: {{hip: trunk.right}}}}
    poses:
      step: {{left.knee: 30 deg, right.knee: -45 deg}}
    modes:
      stand: {{root: trunk}}
      walk: {{root: trunk, base: free, pose: step}}
"""

FAR = f"""
    thingc: assembly/1
    name: far
    {MATERIALS}
    components:
      post: {{part: limbs:Post}}
      ball: {{part: limbs:Ball}}
    joints:
      turn: {{type: continuous, parent: post.right, child: ball.origin}}
"""

EMPTY = """
    thingc: assembly/1
    name: empty
    components:
      post: {part: limbs:Marker, mass: 1 kg}
      arm: {part: limbs:Marker}
    joints:
      turn: {type: continuous, parent: post.here, child: arm.here}
    modes:
      bench: {root: post}
"""


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A workspace with the coarsest possible meshes."""
    return write(tmp_path_factory.mktemp("defects"), {
        "thingc.toml": 'thingc = "workspace/1"\nparts = ["parts"]\nmesh = {linear = "5 mm", angular = "60 deg"}\n',
        "parts/limbs.py": PARTS, "leg.yaml": LEG, "walker.yaml": WALKER, "far.yaml": FAR, "empty.yaml": EMPTY,
    })


@pytest.fixture(scope="module")
def far(workspace: Path, shared_store: str) -> Path:
    build_here("far.yaml", store=shared_store, cwd=workspace)
    return workspace / "build" / "far"


def test_no_inertia_is_a_placeholder(far: Path, workspace: Path, shared_store: str) -> None:
    """The inertia is that of the solid in full precision. If nothing has mass, there is an error, and no file with an invented number."""
    model = mujoco.MjModel.from_xml_path(str(far / "mjcf" / "far_default.xml"))
    mass = LEAD * 4 / 3 * np.pi * 0.01**3
    found = sim.inertia_of(model, "ball")
    assert found[0] == pytest.approx(mass, rel=1e-12)
    np.testing.assert_allclose(found[2], 2 / 5 * mass * 0.01**2 * np.eye(3), rtol=1e-9, atol=1e-9 * mass * 0.01**2)
    ran = thingc_here("build", "empty.yaml", "--format", "json", store=shared_store, cwd=workspace)
    assert ran.code == 1 and ran.answer["artifacts"] == [] and not (workspace / "build" / "empty").exists()
    (said,) = ran.answer["diagnostics"]
    assert said["severity"] == "error" and "`arm`" in said["message"] and "mass" in said["message"]
    assert (said["file"], said["line"]) == ("empty.yaml", 6)


def test_centre_of_mass_is_scaled_once(far: Path) -> None:
    """Millimetres are converted to metres once, and metres are not converted."""
    model = mujoco.MjModel.from_xml_path(str(far / "mjcf" / "far_default.xml"))
    np.testing.assert_allclose(sim.inertia_of(model, "ball")[1], [0.4, -0.2, 0], rtol=0, atol=1e-12)
    data = sim.at(model, {"turn": 0.0})
    drawn = sim.parts(model, data)["ball"]
    mesh = model.geom("ball").dataid[0]
    middle = drawn @ [*model.mesh_pos[mesh], 1]
    np.testing.assert_allclose(data.body("ball").xipos, middle[:3], atol=1e-3, err_msg="where it is drawn")


def test_inertia_does_not_come_from_the_mesh(far: Path) -> None:
    """The mesh of this ball is a coarse polyhedron of less volume. The numbers are those of the ball, not rounded."""
    mesh = trimesh.load(far / "stl" / "limbs.Ball.stl")
    assert mesh.is_watertight and 0.0 < mesh.volume < 0.9 * 4 / 3 * np.pi * 10**3
    tree = ElementTree.parse(far / "mjcf" / "far_default.xml")
    (inertial,) = (body.find("inertial") for body in tree.iter("body") if body.get("name") == "ball")
    assert inertial is not None
    mass = LEAD * 4 / 3 * np.pi * 0.01**3
    assert float(inertial.get("mass", "")) == pytest.approx(mass, rel=1e-14)
    numbers = [float(word) for word in inertial.get("fullinertia", "").split()]
    np.testing.assert_allclose(numbers[:3], 2 / 5 * mass * 0.01**2, rtol=1e-11)
    assert all(abs(number) < 1e-11 * numbers[0] for number in numbers[3:])
    assert any(len(word.strip("-0.").replace(".", "")) > 14 for word in inertial.get("fullinertia", "").split())


def test_two_uses_of_a_definition_have_separate_joints(workspace: Path, shared_store: str) -> None:
    """One document is used for two legs. Each knee has its own name, angle and keyframe, and does not move the other leg."""
    build_here("walker.yaml", store=shared_store, cwd=workspace)
    for mode in ("stand", "walk"):
        model = mujoco.MjModel.from_xml_path(str(workspace / "build" / "walker" / "mjcf" / f"walker_{mode}.xml"))
        assert sim.joints(model) == ["left/knee", "right/knee"]
        rest = sim.frames(model, sim.at(model, {}))
        bent = sim.frames(model, sim.at(model, {"left/knee": 0.6}))
        moved = {name for name in rest if np.abs(rest[name] - bent[name]).max() > 1e-9}
        assert moved == {"left/shin", "site left/foot"}
        # What the knee did is what the matrices say: a turn about the end of the thigh's axis.
        hinge = rest["left/thigh"] @ sim.pose(np.array([0, 0, 0.1]), np.eye(3))
        turn = sim.pose(np.zeros(3), sim.turned(np.array([np.cos(0.3), 0, 0, np.sin(0.3)])))
        np.testing.assert_allclose(bent["left/shin"], hinge @ turn @ np.linalg.inv(hinge) @ rest["left/shin"], rtol=0, atol=1e-12)
        step = model.key("step").qpos
        assert [step[model.joint(name).qposadr[0]] for name in sim.joints(model)] == pytest.approx(np.radians([30, -45]))
        assert model.body("left/shin").mass == model.body("right/shin").mass
        assert model.geom("left/shin").dataid == model.geom("right/shin").dataid, "and share their mesh"
