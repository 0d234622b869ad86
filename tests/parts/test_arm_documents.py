"""The documents in `assemblies/`, compiled, and compared with the chain of matrices in `conftest.py`."""

from __future__ import annotations

from itertools import combinations
from math import radians

import numpy as np
import pytest

import thingc
from thingc.base.diagnostic_output import as_text
from thingc.driver import pipeline
from thingc.driver.environment import Environment, Options

from .conftest import POSES, ROOT, matrix, put_together

ARM = str(ROOT / "assemblies" / "arm.yaml")
JOINTS = ("yaw", "shoulder", "elbow", "wrist")


def compiled(document, store, **parameters):
    """Return the compilation, which must have no diagnostics."""
    with Environment(document, Options(store=store, jobs=2, parameters=parameters)) as environment:
        compilation = pipeline.compile(environment)
    # A short arm that draws has its plate in the floor of the scene: that is said, and no more.
    said = [found for found in compilation.report.diagnostics if found.code.code != "TC610"]
    assert not said, as_text(compilation.report.sorted_diagnostics())
    assert compilation.assembly is not None
    return compilation


@pytest.fixture(scope="module")
def arm(shared_store):
    """The arm of the document."""
    return compiled(ARM, shared_store)


@pytest.fixture(scope="module")
def models(shared_store):
    """The compiled MuJoCo model of each mode."""
    return {name: mode.model() for name, mode in thingc.compile(ARM, store=shared_store).modes.items()}


def rest(compilation):
    """Return the pose of every occurrence at q = 0 in the frame of the plate [mm]."""
    assembly = compilation.assembly
    poses = {}
    for occurrence in assembly.occurrences:
        pose = np.array(assembly.rest[occurrence.index].rows())
        pose[:3, 3] *= 1000
        poses[occurrence.path] = pose
    return poses


@pytest.mark.parametrize(("reach", "pen"), [(100, 15), (60, 6), (200, 30)])
def test_part_poses_equal_those_of_the_chain(shared_store, reach, pen):
    found = rest(compiled(ARM, shared_store, reach=f"{reach} mm", pen_diameter=f"{pen} mm"))
    expected = put_together((0, 0, 0, 0), reach, pen)
    assert set(found) == set(expected) | {"bus_board"}
    for path, part in expected.items():
        assert np.allclose(found[path], part.pose, atol=1e-9), path


def test_board_is_behind_the_bracket(arm):
    from arm import YawPitchBracket

    board = rest(arm)["bus_board"]
    bracket = put_together((0, 0, 0, 0))["bracket"].pose
    lifted = np.eye(4)
    lifted[2, 3] = 4
    assert np.allclose(board, bracket @ matrix(YawPitchBracket().board.location) @ lifted, atol=1e-9)
    assert board[0, 3] < -14.25 - 4  # outside the cradle's rear wall


def test_poses_equal_those_of_the_collision_test(arm):
    poses = {pose.name: tuple(pose.values.get(joint, 0.0) for joint in JOINTS) for pose in arm.assembly.poses}
    assert poses == {name: pytest.approx([radians(angle) for angle in q]) for name, q in POSES.items()}


def test_links_masses_and_sources(arm):
    assembly = arm.assembly
    assert [link.name for link in assembly.links] == ["base_link", "bracket", "humerus", "forearm", "hand_link"]
    mass = {occurrence.path: (occurrence.properties.mass, occurrence.mass_source) for occurrence in assembly.occurrences}
    for servo in ("yaw_servo", "shoulder_servo", "elbow_servo", "wrist_servo"):
        assert mass[servo] == (0.082, "vendor")
    assert mass["bus_board"] == (0.012, "measured")
    assert {mass[path][1] for path in ("plate", "bracket", "humerus", "hand/fixture", "hand/cap")} == {"estimated"}
    assert {mass[path][1] for path in ("hand/pen", "hand/cap_screw_0", "plate_screw_3")} == {"derived"}
    # Printed parts weigh what a slicer says of parts of this size: between 15 % infill alone and full, and where all of a
    # thin part is solid, up to a layer's rounding of its outline more.
    for path, part in put_together((0, 0, 0, 0)).items():
        if mass[path][1] == "estimated":
            full = part.thing.result().volume * 1e-9 * 1270
            assert 0.3 * full < mass[path][0] <= full * 1.02, path
    assert 0.4 < assembly.properties.mass < 0.55


def test_bench_mode_has_a_vertical_yaw_axis(models):
    import mujoco

    model = models["bench"]
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
    mujoco.mj_forward(model, data)
    assert data.joint("yaw").xaxis == pytest.approx([0, 0, 1], abs=1e-12)
    assert data.joint("yaw").xanchor[:2] == pytest.approx([0, 0], abs=1e-12)
    arm = put_together(POSES["home"])
    tip = arm["hand/pen"].pose @ np.array([0, 0, 60, 1])
    assert data.site("tip").xpos * 1000 == pytest.approx(tip[:3], abs=1e-6)
    assert data.site("tip").xpos[2] > 0.010


def test_drives_equal_those_of_the_servos(models):
    model = models["bench"]
    for joint in JOINTS:
        actuator = model.actuator(joint)
        assert actuator.gainprm[0] == pytest.approx(18.875596, rel=1e-6)
        assert actuator.biasprm[1:3] == pytest.approx([-18.875596, -0.85113296], rel=1e-6)
        assert actuator.forcerange == pytest.approx([-4.1, 4.1])
        assert model.joint(joint).armature[0] == pytest.approx(0.045, rel=1e-12)


def test_contacts_are_confirmed_by_exact_meshes(models, meshes):
    """In every pose and mode, two parts with a contact in MuJoCo also touch according to their exact meshes, with a tolerance of 0.05 mm
    for the tessellation."""
    import mujoco

    for mode, model in models.items():
        data = mujoco.MjData(model)
        for pose, q in POSES.items():
            mujoco.mj_resetDataKeyframe(model, data, model.key(pose).id)
            mujoco.mj_forward(model, data)
            parts = put_together(q)
            reported = {
                tuple(sorted(model.geom(geom).name.partition(":")[0] for geom in (contact.geom1, contact.geom2)))
                for contact in data.contact
            }
            for one, other in reported:
                a, b = (meshes(parts[path].thing).transform(parts[path].pose[:3]) for path in (one, other))
                assert a.min_gap(b, 1.0) < 0.05, (mode, pose, one, other)
            touching = {
                tuple(sorted((one, other)))
                for one, other in combinations(("plate", "humerus", "forearm", "hand/fixture", "hand/pen"), 2)
                if (meshes(parts[one].thing).transform(parts[one].pose[:3])
                    ^ meshes(parts[other].thing).transform(parts[other].pose[:3])).volume() > 1e-3
            }
            assert touching <= reported


def test_arm_holds_its_home_pose(models):
    """The drives are strong enough for the arm: from home, it stays within 3 degrees for a second."""
    import mujoco

    model = models["bench"]
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
    for _ in range(500):
        mujoco.mj_step(model, data)
    assert np.degrees(np.abs(data.qpos - [radians(angle) for angle in POSES["home"]])).max() < 3
    assert np.abs(data.qvel).max() < 0.05
    assert all(warning.number == 0 for warning in data.warning)


def test_end_effector_can_be_compiled_alone(shared_store):
    compilation = compiled(str(ROOT / "assemblies" / "end_effector.yaml"), shared_store, pen_diameter="9 mm")
    assert [o.path for o in compilation.assembly.occurrences] == ["fixture", "cap", "cap_screw_0", "cap_screw_1", "pen"]
    assert [mount.path for mount in compilation.assembly.exported] == ["seat", "tip"]
