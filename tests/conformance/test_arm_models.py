"""The MuJoCo models of the arm, loaded from files: poses, masses and dynamics do not depend on the root."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from itertools import permutations
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

import thingc
from conformance import roots, simulation as sim
from conformance.conftest import ARM
from conformance.harness import ROOT, thingc_here
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.one_line_repr import LONGEST, OneLineRepr
from thingc.modes import Modes

MODES = {"bench": "base_link", "drawing": "hand_link", "adrift": "bracket"}
"""The root link of each mode."""

LIMITS = {"yaw": (-150, 150), "shoulder": (-170, 10), "elbow": (-130, 130), "wrist": (-90, 90)}
HOME = {"yaw": 30, "shoulder": -60, "elbow": 120, "wrist": -30}
POSES = {
    "home": HOME,
    "stretched": dict.fromkeys(HOME, 0),
    "folded": {"yaw": 0, "shoulder": -150, "elbow": 125, "wrist": 0},
    "writing": {"yaw": 0, "shoulder": -40, "elbow": 98.8, "wrist": -58.8},
}
"""The poses in assemblies/arm.yaml [deg]."""

FIRST = {"bench": "home", "drawing": "writing", "adrift": "home"}
"""The start pose of each mode: its own pose, or else the first pose of the document."""

Array = sim.Array


@pytest.fixture(scope="module")
def models(arm: Path) -> dict[str, mujoco.MjModel]:
    return {mode: mujoco.MjModel.from_xml_path(str(arm / "mjcf" / f"arm_{mode}.xml")) for mode in MODES}


READERS: dict[str, Callable[[Path, str], mujoco.MjModel]] = {
    "xml": lambda folder, mode: mujoco.MjModel.from_xml_path(str(folder / f"arm_{mode}.xml")),
    "scene": lambda folder, mode: mujoco.MjModel.from_xml_path(str(folder / f"scene_{mode}.xml")),
    "mjz": lambda folder, mode: mujoco.MjSpec.from_file(str(folder / f"arm_{mode}.mjz")).compile(),
}


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("file", READERS)
def test_files_load_and_step_without_warnings(arm: Path, tmp_path: Path, file: str, mode: str) -> None:
    with sim.no_warning(tmp_path):
        model = READERS[file](arm / "mjcf", mode)
        assert (model.nkey, model.njnt, model.nu) == (len(POSES), 4 + (mode == "adrift"), 4)
        data = mujoco.MjData(model)
        for key in range(model.nkey):
            mujoco.mj_resetDataKeyframe(model, data, key)
            for _ in range(100):
                mujoco.mj_step(model, data)
            assert np.isfinite(data.qpos).all() and np.isfinite(data.qvel).all()
            assert not data.warning.number.any()


@pytest.mark.parametrize("mode", MODES)
def test_scene_and_archive_contain_the_same_robot(arm: Path, mode: str) -> None:
    xml, scene, mjz = (READERS[file](arm / "mjcf", mode) for file in READERS)
    assert (scene.nbody, scene.nq, scene.ngeom) == (xml.nbody, xml.nq, xml.ngeom + 1)
    assert mjz.nbody == xml.nbody and mjz.ngeom == xml.ngeom
    for other in (scene, mjz):
        np.testing.assert_array_equal(other.body_mass, xml.body_mass)
        np.testing.assert_array_equal(other.body_inertia, xml.body_inertia)
        np.testing.assert_array_equal(other.key_qpos, xml.key_qpos)
        np.testing.assert_array_equal(other.jnt_pos, xml.jnt_pos)


@pytest.fixture(scope="module")
def info(arm: Path, shared_store: str) -> dict[str, Any]:
    ran = thingc_here("info", ARM, "--format", "json", store=shared_store, cwd=ROOT)
    assert ran.code == 0
    return ran.answer


@pytest.fixture(scope="module")
def compiled(arm: Path, shared_store: str) -> thingc.Compiled:
    return thingc.compile(str(ROOT / ARM), store=shared_store)


def test_mass_and_inertia_equal_those_of_info_and_api(
    models: dict[str, mujoco.MjModel], info: dict[str, Any], compiled: thingc.Compiled
) -> None:
    found = compiled.properties
    said = {"info": (info["mass"], info["centre"], info["inertia"]), "API": (found.mass, found.centre, found.inertia)}
    assert roots.said_of_all(models, "plate", said) == []
    assert roots.said_of_links(models, info["occurrences"]) == []
    assert found.mass == pytest.approx(sum(o["mass"] for o in info["occurrences"]), rel=1e-12)


def test_links_are_equal_in_all_modes(models: dict[str, mujoco.MjModel]) -> None:
    """The mass, centre, inertia and geometry in the frame of the link are equal bit by bit."""
    bench = models["bench"]
    assert sim.joints(bench) == sorted(HOME)
    assert sim.links(bench) == ["base_link", "bracket", "forearm", "hand_link", "humerus"]
    assert roots.links(models) == []


def test_part_poses_at_rest_equal_those_of_the_api(models: dict[str, mujoco.MjModel], compiled: thingc.Compiled) -> None:
    assembly = compiled.assembly
    rest = {o.path: np.array(assembly.rest[o.index].rows()) for o in assembly.occurrences if o.path != "bus_board"}
    assert roots.at_rest(models, "plate", rest) == []


def test_collision_primitives_become_geoms(
    models: dict[str, mujoco.MjModel], compiled: thingc.Compiled
) -> None:
    """The pieces come from the part files. Their volume, and their centre and inertia in the world, are equal to 1e-9."""
    from build123d import Solid

    import arm as arm_parts
    from thingc_stock.dynamixel import XM430

    names = {
        "plate": (arm_parts.BasePlate, (None, "box", "box")), "yaw_servo": (XM430, (None, "cylinder", "cylinder")),
        "shoulder_servo": (XM430, (None, "cylinder", "cylinder")), "bracket": (arm_parts.YawPitchBracket, ("box", "box", "box")),
        "humerus_idler": (arm_parts.RotorBrace, (None, "box", None)), "hand/cap": (arm_parts.OmegaCap, (None, "box")),
    }
    rest = {o.path: np.array(compiled.assembly.rest[o.index].rows()) for o in compiled.assembly.occurrences}
    model = models["bench"]
    data = sim.at(model, {})
    X_WP = sim.parts(model, data)["plate"] @ np.linalg.inv(rest["plate"])
    for path, (thing, kinds) in names.items():
        for number, (kind, piece) in enumerate(zip(kinds, thing().collision(), strict=True)):
            name = f"{path}:collision_{number}" if number else f"{path}:collision"
            geom, placed = model.geom(name), data.geom(name)
            if kind is None:
                assert geom.type[0] == mujoco.mjtGeom.mjGEOM_MESH, name
                continue
            assert isinstance(piece, Solid) and geom.type[0] == getattr(mujoco.mjtGeom, f"mjGEOM_{kind.upper()}"), name
            a, b, c = geom.size
            volume = 8 * a * b * c if kind == "box" else 2 * np.pi * a * a * b
            own = volume * np.diag(
                [(b * b + c * c) / 3, (a * a + c * c) / 3, (a * a + b * b) / 3] if kind == "box"
                else [a * a / 4 + b * b / 3, a * a / 4 + b * b / 3, a * a / 2]
            )
            X = X_WP @ rest[path]
            assert volume == pytest.approx(piece.volume * 1e-9, rel=1e-9)
            np.testing.assert_allclose(placed.xpos, (X @ [*(np.array(tuple(piece.center())) / 1000), 1.0])[:3], rtol=0, atol=1e-9)
            turned = placed.xmat.reshape(3, 3)
            found, expected = turned @ own @ turned.T, X[:3, :3] @ (np.array(piece.matrix_of_inertia) * 1e-15) @ X[:3, :3].T
            np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


def test_poses_agree_in_all_modes(models: dict[str, mujoco.MjModel]) -> None:
    """The relative poses of all parts and sites, for random positions of joints and bases."""
    source = np.random.default_rng(20)
    assert len(sim.frames(models["bench"], sim.at(models["bench"], {}))) > 25
    for _ in range(20):
        q = roots.angles(models["bench"], source)
        assert roots.poses(models, q, source) == []
        assert roots.whole(models, q, "hand/pen", source) == []


def test_kinematics_of_modes_json(arm: Path, models: dict[str, mujoco.MjModel]) -> None:
    trees = json.loads((arm / "modes.json").read_text())
    source = np.random.default_rng(3)
    for mode, model in models.items():
        assert roots.root_of(model) == MODES[mode]
        assert [j["name"] for j in trees[mode]["joints"] if j["reversed"]] == {
            "bench": [], "drawing": ["wrist", "elbow", "shoulder", "yaw"], "adrift": ["yaw"]}[mode]
        assert roots.described(trees[mode], model, roots.angles(model, source)) == []


def test_dynamics_with_a_held_link_equal_those_of_its_mode(models: dict[str, mujoco.MjModel]) -> None:
    source = np.random.default_rng(9)
    for _ in range(5):
        assert roots.dynamics_of_modes(models, roots.angles(models["bench"], source), source) == []


def test_dynamics_with_any_held_link_agree_in_all_modes(models: dict[str, mujoco.MjModel]) -> None:
    source = np.random.default_rng(10)
    for link in sim.links(models["bench"]):
        q, gravity = roots.angles(models["bench"], source), source.normal(size=3)
        assert roots.dynamics_held(models, q, link, gravity, source) == []


def test_modes_with_different_roots_have_different_dynamics(models: dict[str, mujoco.MjModel]) -> None:
    """Gravity is inclined, because gravity along the yaw axis causes no yaw torque in any mode."""
    q, gravity = {name: float(np.radians(angle)) for name, angle in HOME.items()}, np.array([3.0, 5.0, -8.0])
    placed = sim.at(models["bench"], q)
    for one, other in permutations(MODES, 2):
        (M, tau), (matrix, torque) = (
            sim.held(models[mode], q, MODES[mode], placed.body(MODES[mode]).xmat.reshape(3, 3).T @ gravity, np.eye(4))
            for mode in (one, other)
        )
        assert roots.relative(M, sim.own_dynamics(models[one], q, np.eye(4))[0]) < 1e-9
        assert roots.relative(M, matrix) > 1e-3 and roots.relative(tau, torque) > 1e-2, (one, other)


def test_bench_stands_upright(models: dict[str, mujoco.MjModel]) -> None:
    model = models["bench"]
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(data.joint("yaw").xaxis, [0, 0, 1], atol=1e-12)
    placed = sim.parts(model, data)
    np.testing.assert_allclose(placed["plate"], np.eye(4), atol=1e-12)
    assert data.site("tip").xpos[2] > vertices(model, "plate")[:, 2].min() + 0.005, "above the plate's upper face"
    assert np.hypot(*data.site("tip").xpos[:2]) > 0.05, "not inside the base"


def vertices(model: mujoco.MjModel, part: str) -> Array:
    """Return the vertices of the mesh of a part in the frame of the part."""
    mesh = model.geom(part).dataid[0]
    start, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    found: Array = model.mesh_vert[start : start + count] @ sim.turned(model.mesh_quat[mesh]).T + model.mesh_pos[mesh]
    return found


def test_drawing_holds_the_pen_upright_on_the_paper(models: dict[str, mujoco.MjModel]) -> None:
    """A mount at the root is mated to the world: the z axis of the tip points down, and its origin is that of the world."""
    model = models["drawing"]
    for key in range(model.nkey):
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, key)
        mujoco.mj_forward(model, data)
        mate = np.array([[0, -1, 0, 0], [-1, 0, 0, 0], [0, 0, -1, 0], [0, 0, 0, 1]])
        np.testing.assert_allclose(sim.frames(model, data)["site hand/tip"], mate, atol=1e-12)
    assert model.nmocap == 1 and model.body("hand_link").mocapid[0] == 0
    mujoco.mj_resetDataKeyframe(model, data, model.key("writing").id)
    mujoco.mj_forward(model, data)
    plate = sim.parts(model, data)["plate"]
    np.testing.assert_allclose(plate[2, :3], [0, 0, 1], atol=1e-9)
    assert abs(plate[2, 3]) < 1e-3, "the plate lies on the paper that the pen writes on"


def test_adrift_floats_at_the_pose_of_its_mode(models: dict[str, mujoco.MjModel]) -> None:
    model = models["adrift"]
    assert model.joint("root").type == mujoco.mjtJoint.mjJNT_FREE
    for key in range(model.nkey):
        np.testing.assert_allclose(model.key_qpos[key][:7], [0, 0, 0.3, 1, 0, 0, 0], atol=1e-15)
    data = sim.at(model, dict.fromkeys(HOME, 0.0))
    np.testing.assert_allclose(sim.parts(model, data)["bracket"][:3, 3], [0, 0, 0.3], atol=1e-12)


@pytest.mark.parametrize("mode", MODES)
def test_keyframes_equal_the_poses_of_the_document(models: dict[str, mujoco.MjModel], mode: str) -> None:
    model = models[mode]
    names = [model.key(i).name for i in range(model.nkey)]
    assert names == [FIRST[mode], *(name for name in POSES if name != FIRST[mode])]
    for name, q in POSES.items():
        for joint, angle in q.items():
            assert model.key(name).qpos[model.joint(joint).qposadr[0]] == pytest.approx(np.radians(angle), abs=1e-15)
            assert model.key(name).ctrl[model.actuator(joint).id] == pytest.approx(np.radians(angle), abs=1e-15)
    for joint, limits in LIMITS.items():
        np.testing.assert_allclose(model.joint(joint).range, np.radians(limits), rtol=1e-15)
    assert not model.qpos0[-4:].any()


def test_the_same_pairs_are_excluded_in_every_mode(models: dict[str, mujoco.MjModel]) -> None:
    expected = {
        frozenset(pair) for pair in (
            ("base_link", "bracket"), ("bracket", "humerus"), ("humerus", "forearm"), ("forearm", "hand_link"),
        )
    }
    for model in models.values():
        assert model.nexclude == 4 and roots.excluded(model) == expected


FAULTS: dict[str, tuple[str, float, set[str]]] = {
    "a body's place": ("body_pos", 1e-6, {"poses", "whole", "dynamics_held", "dynamics_of_modes"}),
    "a site's place": ("site_pos", 3e-9, {"poses"}),
    "a mass": ("body_mass", 1e-8, {"links", "whole", "dynamics_held", "dynamics_of_modes"}),
    "a centre of mass": ("body_ipos", 1e-5, {"links", "whole", "dynamics_held", "dynamics_of_modes"}),
    "an inertia": ("body_inertia", 1e-8, {"links", "whole", "dynamics_held", "dynamics_of_modes"}),
    "an armature": ("dof_armature", 1e-7, {"dynamics_held", "dynamics_of_modes"}),
    "an excluded pair": ("exclude_signature", -1, {"links"}),
}
"""A field of a model, the change of its last entry, and the comparisons that must detect it."""


@pytest.mark.parametrize("fault", FAULTS)
def test_comparisons_detect_faults(models: dict[str, mujoco.MjModel], fault: str) -> None:
    """One number of one mode changes slightly. Exactly the comparisons that depend on it must fail."""
    field, by, expected = FAULTS[fault]
    spoilt = {**models, "adrift": copy.copy(models["adrift"])}
    getattr(spoilt["adrift"], field).reshape(-1)[-1] += by
    q = roots.angles(models["bench"], np.random.default_rng(1))

    def source() -> np.random.Generator:
        return np.random.default_rng(2)

    found = {
        "links": roots.links(spoilt),
        "poses": roots.poses(spoilt, q, source()),
        "whole": roots.whole(spoilt, q, "plate", source()),
        "dynamics_of_modes": roots.dynamics_of_modes(spoilt, q, source()),
        "dynamics_held": roots.dynamics_held(spoilt, q, "base_link", np.array([1.0, 2.0, 3.0]), source()),
    }
    assert expected == {check for check, said in found.items() if said}


def test_objects_of_a_compiled_robot_print_as_one_line(compiled: thingc.Compiled) -> None:
    bench = compiled.modes["bench"]
    assert repr(compiled).startswith("Compiled('arm', assembly=Assembly('arm'), modes=[bench, drawing, adrift]")
    assert repr(bench).startswith("CompiledMode('bench', robot=Robot('arm')")
    assert repr(bench.robot).startswith("Robot('arm', mode=LinkedMode('bench'), assembly=Assembly('arm'), base='fixed'")

    state = Modes.parse(bench.files["modes.json"]).read("bench", mujoco.MjData(bench.model()))
    met: set[str] = set()
    waiting: list[Any] = [compiled, state, Modes.parse(bench.files["modes.json"])["bench"]]
    seen: set[int] = set()
    while waiting:
        value = waiting.pop()
        if id(value) in seen:
            continue
        seen.add(id(value))
        if isinstance(value, FrozenStruct) or is_dataclass(value):
            line = repr(value)
            assert "\n" not in line and len(line) <= (LONGEST if isinstance(value, OneLineRepr) else 300), line
            met.add(type(value).__name__)
            names = value.__struct_fields__ if isinstance(value, FrozenStruct) else [one.name for one in fields(value)]
            waiting += [getattr(value, name) for name in names]
        elif isinstance(value, Mapping):
            waiting += value.values()
        elif isinstance(value, (tuple, list)):
            waiting += value
    assert met >= {"Compiled", "CompiledMode", "Assembly", "Robot", "Occurrence", "PartRecord", "Link", "Mate", "RobotState", "Mode"}
    assert repr(compiled.assembly.links[0]).startswith("Link('base_link', index=0, frame=0, members=[10 int]")
