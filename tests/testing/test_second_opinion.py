"""Distances, certificates and collisions of the arm agree with coal, which reads the same meshes."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator, Mapping
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from conformance.harness import thingc_here
from thingc.base.primitives import Primitive
from thingc.driver import pipeline
from thingc.driver.environment import Environment, Options
from thingc.driver.testing.collisions import Collisions, collisions_of
from thingc.geometry.store.meshes import arrays
from thingc.model.robot.kinematics import occurrence_poses
from thingc.model.robot.types import Robot

coal = pytest.importorskip("coal", reason="there is no package of coal for Windows")

SEE = 0.02
"""Distance [m] up to which gaps are compared."""
JOINTS = ("yaw", "shoulder", "elbow", "wrist")
LOW, HIGH = np.radians([-150.0, -170.0, -130.0, -90.0]), np.radians([150.0, -120.0, -90.0, 90.0])
TEST = "{no_collision: {mode: bench, joints: {elbow: [-130 deg, -60 deg]}, pose: folded, certify: true}}"
"""The elbow turns until the pen is in the plate."""


class Parts:
    """The parts of a robot, as bounding volume hierarchies of coal."""

    def __init__(self, robot: Robot, environment: Environment, collisions: Collisions) -> None:
        self.robot, self.collisions = robot, collisions
        self.names = [part.path for part in robot.assembly.occurrences]
        self.meshes: dict[str, Any] = {}
        for part in robot.assembly.occurrences:
            for surface in part.solids:
                assert not isinstance(surface.solid, Primitive) and part.path not in self.meshes
                points, triangles = arrays(environment.store.read(surface.solid.sha256))
                corners = points @ np.array(surface.pose.rotation).T + np.array(surface.pose.translation)
                self.meshes[part.path] = hierarchy(corners, triangles.tolist())
        self.poses: dict[str, Any] = {}

    def move(self, q: Mapping[str, float]) -> None:
        for name, pose in zip(self.names, occurrence_poses(self.robot, q), strict=True):
            self.poses[name] = coal.Transform3s(np.array(pose.rotation), np.array(pose.translation))

    def gap(self, one: str, other: str) -> float:
        """Return the distance [m] of two parts, 0 if their surfaces intersect."""
        if self.touch(one, other):
            return 0.0
        return float(coal.distance(*self._placed(one), *self._placed(other), coal.DistanceRequest(), coal.DistanceResult()))

    def touch(self, one: str, other: str) -> bool:
        return bool(coal.collide(*self._placed(one), *self._placed(other), coal.CollisionRequest(), coal.CollisionResult()))

    def _placed(self, part: str) -> tuple[Any, Any]:
        return self.meshes[part], self.poses[part]


def hierarchy(points: Any, triangles: list[list[int]]) -> Any:
    vertices, faces, built = coal.StdVec_Vec3s(), coal.StdVec_Triangle(), coal.BVHModelOBBRSS()
    vertices.extend(points)
    faces.extend(coal.Triangle(*corners) for corners in triangles)
    built.beginModel(len(triangles), len(points))
    built.addSubModel(vertices, faces)
    built.endModel()
    return built


@pytest.fixture(scope="module")
def document(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("second")
    for name in ("assemblies", "parts"):
        shutil.copytree(root / name, folder / name)
    shutil.copy(root / "thingc.toml", folder)
    document = folder / "assemblies" / "arm.yaml"
    text, _, _ = document.read_text().partition("\ntests:")
    document.write_text(f"{text}\ntests: {{turn: {TEST}}}\n")
    return document


@pytest.fixture(scope="module")
def parts(document: Path, shared_store: str) -> Iterator[Parts]:
    with Environment(str(document), Options(store=shared_store)) as environment:
        compilation = pipeline.compile(environment)
        yield Parts(compilation.robots[0], environment, collisions_of(pipeline.request_of(environment, compilation)))


def test_distances_agree(parts: Parts) -> None:
    """At random positions of all joints, the same pairs are near, and their distances are equal."""
    source, met, apart = np.random.default_rng(8), 0, 0
    compared = [(parts.names[one], parts.names[other]) for one, other in parts.collisions.pairs]
    assert len(compared) > 80
    for _ in range(4):
        q = dict(zip(JOINTS, source.uniform(LOW, HIGH).tolist(), strict=True))
        parts.move(q)
        near = parts.collisions.near_pairs(occurrence_poses(parts.robot, q), parts.robot.keyframes[0], SEE, SEE, {})
        found = {(parts.names[pair.one], parts.names[pair.other]): pair.gap for pair in near}
        for pair in compared:
            gap = parts.gap(*pair)
            assert found.get(pair, SEE) == pytest.approx(min(gap, SEE), abs=1e-9), (pair, q)
            met, apart = met + (gap == 0.0), apart + (0.0 < gap < SEE)
    assert met > 0 and apart > 8, (met, apart)


def test_certificates_agree(document: Path, parts: Parts, shared_store: str) -> None:
    """Pairs that were proved to be clear do not touch at any of many positions. The other pairs of the certificate touch."""
    ran = thingc_here("test", document, "--format", "json", cwd=document.parent, store=shared_store)
    certificate = json.loads(ran.out)["tests"][0]["measured"]["certificate"]
    clear, touching = ({*certificate[kind]} for kind in ("proved", "touches"))
    met: set[str] = set()
    for elbow in np.radians(np.linspace(-130.0, -60.0, 18)).tolist():
        parts.move({"yaw": 0.0, "shoulder": np.radians(-150.0), "elbow": elbow, "wrist": 0.0})
        for one, other in combinations(parts.names, 2):
            name = f"{one} and {other}".replace("/", ".")
            if name in clear | touching and one in parts.meshes and other in parts.meshes:
                met |= {name} if parts.touch(one, other) else set()
    assert len(clear) > 80 and touching and met == touching
