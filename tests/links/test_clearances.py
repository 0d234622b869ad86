"""Document tests of links made of shapes, compared with MuJoCo's distances on the emitted model. No CAD kernel is loaded."""

from __future__ import annotations

import contextlib
import io
import json
from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh
from manifold3d import Manifold

from thingc.driver import pipeline
from thingc.driver.environment import Environment, Options
from thingc.driver.testing.collisions import collisions_of
from thingc.geometry.service import GeometryService
from thingc.geometry.worker_calls import WorkerCalls
from thingc.model.robot.kinematics import occurrence_poses
from thingc.model.solids.shapes import Solid
from thingc.tools.cli.main import main

SHAPES = {
    "ground": "{plane: [4 m, 0 m]}",
    "block": "{box: 60 40 30 mm, at: {rpy: 10 20 30 deg}}",
    "ball": "{sphere: {radius: 25 mm}, at: {xyz: 5 0 0 mm}}",
    "rod": "{capsule: {radius: 10 mm, length: 70 mm}, at: {rpy: 80 0 15 deg}}",
    "drum": "{cylinder: {radius: 25 mm, length: 40 mm}, at: {xyz: 0 4 0 mm, rpy: 30 0 0 deg}}",
    "egg": "{ellipsoid: 30 20 15 mm, at: {rpy: 0 40 20 deg}}",
    "gem": "{mesh: gem.stl, at: {xyz: 0 0 3 mm, rpy: 15 0 0 deg}}",
    "both": "{sphere: {radius: 12 mm}, at: {xyz: 30 0 0 mm}}, {box: 10 30 50 mm, at: {xyz: -20 0 0 mm}}",
}
ROUND = {"drum": 0.025, "egg": 0.03}
"""Radius [m] of shapes whose distances are computed from facets."""

LOOK = 0.05
"""Search distance for gaps [m]. All pairs of triangles that are nearer are found."""

SOURCE = np.random.default_rng(3)
PLACES = {name: SOURCE.uniform(-70, 70, 3) + [0, 0, 120] for name in SHAPES if name != "ground"}
POSES = [dict.fromkeys(PLACES, 0.0), *({name: float(SOURCE.uniform(-80, 80)) for name in PLACES} for _ in range(5))]


def document() -> str:
    """Every shape on its own slide, all on one carrier, so no joint connects two shapes, or a shape and the ground."""
    links = "".join(f"  {name}: {{link: true, mass: 100 g, shapes: [{shapes}]}}\n" for name, shapes in SHAPES.items())
    mounts = ", ".join(f"{name}: {{xyz: [{x} mm, {y} mm, {z} mm], rpy: 40 70 0 deg}}" for name, (x, y, z) in PLACES.items())
    joints = "".join(
        f"  {name}: {{type: prismatic, parent: carrier.{name}, child: {name}.origin, limit: {{lower: -1 m, upper: 1 m}}}}\n"
        for name in PLACES
    )
    poses = "".join(
        f"  p{number}: {{{', '.join(f'{name}: {q} mm' for name, q in pose.items())}}}\n" for number, pose in enumerate(POSES)
    )
    return (
        f"thingc: assembly/1\nname: shelf\ncomponents:\n{links}"
        f"  carrier: {{frame: true, mass: 1 kg, inertia: {{ixx: 1 g*m^2, iyy: 1 g*m^2, izz: 1 g*m^2}}, mounts: {{{mounts}}}}}\n"
        "joints:\n  carrier: {type: prismatic, parent: ground.origin, child: carrier.origin, axis: [0, 0, 1],\n"
        "    limit: {lower: 0, upper: 1 m}}\n"
        f"{joints}poses:\n{poses}modes:\n  bench: {{root: ground}}\n"
        "tests:\n  free: {no_collision: {pose: all, clearance: 10 mm}}\n"
        "  high: {ground_clearance: {pose: all, at_least: 1 m}}\n"
    )


@pytest.fixture
def no_kernel(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(GeometryService, "warm", lambda self: pytest.fail("the kernel was begun"))
    monkeypatch.setattr(WorkerCalls, "pool", lambda self: pytest.fail("a worker was asked"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("shelf")
    folder.joinpath("thingc.toml").write_text('thingc = "workspace/1"\n')
    folder.joinpath("shelf.yaml").write_text(document())
    trimesh.convex.convex_hull(SOURCE.uniform(-25, 25, (40, 3))).export(folder / "gem.stl")
    return folder


@pytest.fixture
def model(folder: Path, no_kernel: None) -> mujoco.MjModel:
    """The emitted model."""
    assert run("build", str(folder / "shelf.yaml"), "-o", str(folder / "out"), "--emit", "mjcf", "--store", str(folder / "store"))[0] == 0
    return mujoco.MjModel.from_xml_path(str(folder / "out" / "shelf" / "mjcf" / "shelf_bench.xml"))


def run(*words: str) -> tuple[int, str]:
    """Exit code and standard output of a command."""
    with contextlib.redirect_stdout(io.StringIO()) as out:
        code = main(list(words))
    return code, out.getvalue()


def distances(model: mujoco.MjModel, q: dict[str, float]) -> dict[tuple[str, str], float]:
    """Smallest distance [m] of each pair of bodies, by names, with joints at `q` [mm]."""
    data = mujoco.MjData(model)
    for name, value in q.items():
        data.joint(name).qpos[0] = value / 1000
    mujoco.mj_forward(model, data)
    bodies = [model.body(model.geom_bodyid[geom]).name for geom in range(model.ngeom)]
    found: dict[tuple[str, str], float] = {}
    for a in range(model.ngeom):
        for b in range(a + 1, model.ngeom):
            if bodies[a] != bodies[b] and model.geom_contype[a] and model.geom_contype[b]:
                pair = min(bodies[a], bodies[b]), max(bodies[a], bodies[b])
                found[pair] = min(found.get(pair, np.inf), mujoco.mj_geomDistance(model, data, a, b, 10.0, None))
    return found


def test_gaps_match_mujoco_distances(folder: Path, model: mujoco.MjModel) -> None:
    with Environment(str(folder / "shelf.yaml"), Options(store=str(folder / "store"))) as environment:
        compilation = pipeline.compile(environment)
        (robot,) = compilation.robots
        collisions = collisions_of(pipeline.request_of(environment, compilation))
        names = [occurrence.path for occurrence in robot.assembly.occurrences]
        met = apart = 0
        for frame, q in zip(robot.keyframes, POSES, strict=True):
            near = collisions.near_pairs(occurrence_poses(robot, frame.q, frame.base), frame, LOOK, LOOK, {})
            found = {tuple(sorted((names[one.one], names[one.other]))): one for one in near}
            expected = {pair: distance for pair, distance in distances(model, q).items() if distance < LOOK - 1e-4}
            assert set(expected) <= set(found)
            for pair, distance in expected.items():
                off = 3e-6 + 1e-3 * sum(ROUND.get(name, 0.0) for name in pair)
                assert found[pair].gap == pytest.approx(max(distance, 0.0), abs=off), pair
                assert (found[pair].volume > 0.0) == (distance < 0.0) or abs(distance) < 1e-4, pair
                met, apart = met + (distance < 0.0), apart + (distance > 0.0)
        assert met > 10 and apart > 30


def test_document_tests_measure_clearances(folder: Path, model: mujoco.MjModel) -> None:
    """The ground is the plane z = 0, so heights above it are exact for every shape."""
    code, out = run("test", str(folder / "shelf.yaml"), "--format", "json", "--store", str(folder / "store"))
    results = json.loads(out)["tests"]
    assert code == 1 and len(results) == 2 * len(POSES)
    for q, free, high in zip(POSES, results[: len(POSES)], results[len(POSES) :], strict=True):
        expected = distances(model, q)
        heights = {other if one == "ground" else one: height for (one, other), height in expected.items() if "ground" in (one, other)}
        lowest = min(heights, key=lambda name: heights[name])
        assert high["measured"] == {"clearance": pytest.approx(heights[lowest], abs=3e-6), "part": lowest}
        assert free["passed"] is (min(expected.values()) > 0.01)


def test_distances_above_the_limit_are_the_limit() -> None:
    """Rounding must not make a larger distance look like a measured distance below the limit."""
    core, rng = Manifold.cube((0.001, 0.001, 0.001)), np.random.default_rng(5)
    for _ in range(50):
        one, other = (Solid(core, ((core, radius),)) for radius in rng.uniform(0.0, 0.01, 2))
        radii, within, distance = one.cores[0][1] + other.cores[0][1], rng.uniform(1e-4, 0.01), rng.uniform(1e-5, 0.02)
        far = Solid(core, ((core.translate((0.001 + radii + distance, 0.0, 0.0)), other.cores[0][1]),))
        assert one.gap(far, within) == (within if distance > within else pytest.approx(distance, abs=1e-12))


def test_neighbouring_links_are_skipped(tmp_path: Path, no_kernel: None) -> None:
    """Shapes of links are approximate, so pairs that a joint connects are not checked, and the result lists them as skipped."""
    tmp_path.joinpath("thingc.toml").write_text('thingc = "workspace/1"\n')
    tmp_path.joinpath("pair.yaml").write_text(
        "thingc: assembly/1\nname: pair\ncomponents:\n  one: {link: true, mass: 1 kg, shapes: [{sphere: {radius: 20 mm}}]}\n"
        "  other: {link: true, mass: 1 kg, shapes: [{box: 20 20 20 mm}]}\njoints:\n"
        "  hinge: {type: continuous, parent: one.origin, child: other.origin}\nmodes: {bench: {root: one}}\n"
        "tests: {free: {no_collision: {}}}\n"
    )
    code, out = run("test", str(tmp_path / "pair.yaml"), "--format", "json", "--store", str(tmp_path / "store"))
    (result,) = json.loads(out)["tests"]
    assert code == 0 and result["measured"]["pairs"] == 0
    assert result["measured"]["skipped"] == {"shapes of links are approximate": ["one and other"]}
