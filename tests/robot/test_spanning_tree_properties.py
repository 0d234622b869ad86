"""Random trees of joints with random roots: the same robot in every mode.

Poses are compared with chains of matrices built from the description of the tree. The oracle for dynamics uses only bodies, axes,
anchors and link inertias of a `Robot`: Jacobians in numpy, relative to the held link."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.linalg import expm

from graph.builder import (
    Array,
    Component,
    Joint,
    PartRecord,
    as_matrix,
    assembly,
    attach,
    box,
    component,
    coordinates_of,
    inv,
    joint,
    laid,
    linked,
    mass_properties,
    mated,
    mode,
    poses,
    ref,
    rx,
    ry,
    rz,
    t,
    whole,
)
from thingc.base.diagnostics import Code, Report
from thingc.base.joints.kinds import KINDS
from thingc.base.pose import NO_POSE
from thingc.model.assembly.types import Assembly
from thingc.model.robot.kinematic_tree import root
from thingc.model.robot.kinematics import occurrence_poses
from thingc.model.robot.types import Robot

COUNTS = {name: len(kind.twists) for name, kind in KINDS.items() if kind.moves and not kind.at_once}
"""Moving kinds whose coordinates act one after another, and their number of coordinates."""
WITHOUT_LEAD = tuple(name for name in COUNTS if not KINDS[name].leads)
"""Kinds without a lead. MuJoCo has no screw, so its trees exclude them."""
STILL = ("fixed", "attach", "at")


@dataclass
class Twig:
    """Placement of occurrence `child` on occurrence `parent`."""

    parent: int
    child: int
    kind: str
    turn: float
    gap: float
    offset: float


@dataclass
class Tree:
    """A random robot: its model, and the same robot as matrices."""

    count: int
    twigs: list[Twig]
    mounts: dict[tuple[int, str], Array]
    order: list[int]
    assembly: Assembly
    q: dict[str, float]

    def world(self, start: int) -> list[Array]:
        """Poses of all occurrences in the frame of `start`, chained over the twigs."""
        at: dict[int, Array] = {start: np.eye(4)}
        while len(at) < self.count:
            for twig in self.twigs:
                step = self.step(twig)
                if twig.parent in at and twig.child not in at:
                    at[twig.child] = at[twig.parent] @ step
                elif twig.child in at and twig.parent not in at:
                    at[twig.parent] = at[twig.child] @ inv(step)
        return [at[k] for k in range(self.count)]

    def step(self, twig: Twig) -> Array:
        parent, child = self.mounts[twig.parent, "a"], self.mounts[twig.child, "b"]
        if twig.kind == "at":
            return parent @ t(twig.gap, twig.turn, twig.offset) @ rz(twig.turn)
        kind = "fixed" if twig.kind == "attach" else twig.kind
        q = [self.q[path] for path in paths_of(twig)] if kind in COUNTS else [0.0]
        return mated(parent, child, turn=twig.turn, gap=twig.gap, kind=kind, q=q, offset=twig.offset if kind in COUNTS else 0.0)


def frame(rng: np.random.Generator) -> Array:
    roll, pitch, yaw = rng.uniform(-3, 3, 3)
    return t(*rng.uniform(-0.1, 0.1, 3)) @ rz(yaw) @ ry(pitch) @ rx(roll)


def paths_of(twig: Twig) -> list[str]:
    """Paths of the coordinates of a moving twig."""
    count = COUNTS.get(twig.kind, 0)
    return [f"j{twig.child}"] if count == 1 else [f"j{twig.child}_{k}" for k in range(count)]


def build(seed: int, count: int, moving: Sequence[str] = tuple(COUNTS)) -> Tree:
    rng = np.random.default_rng(seed)
    mounts = {(k, side): frame(rng) for k in range(count) for side in "ab"}
    twigs = [Twig(int(rng.integers(0, k)), k, str(rng.choice([*moving, *STILL])), *rng.uniform(-1, 1, 3)) for k in range(1, count)]
    order = [int(k) for k in rng.permutation(count)]
    records: list[PartRecord] = []
    components: list[Component] = []
    joints: list[Joint] = []
    by_child = {twig.child: twig for twig in twigs}
    for k in order:
        size, centre = rng.uniform(0.02, 0.2, 3), rng.uniform(-0.05, 0.05, 3)
        records.append(box(f"p:B{k}", tuple(size), centre=tuple(centre), mounts={"a": mounts[k, "a"], "b": mounts[k, "b"]}))  # type: ignore[arg-type]
        placement = None
        twig = by_child.get(k)
        if twig is not None and twig.kind == "attach":
            placement = attach(f"c{k}.b", f"c{twig.parent}.a", turn=twig.turn, gap=twig.gap)
        elif twig is not None and twig.kind == "at":
            placement = laid(f"c{twig.parent}.a", t(twig.gap, twig.turn, twig.offset) @ rz(twig.turn))  # type: ignore[assignment]
        elif twig is not None:
            joints.extend(
                coordinates_of(
                    f"j{k}",
                    f"c{twig.parent}.a",
                    f"c{k}.b",
                    twig.kind,
                    turn=twig.turn,
                    gap=twig.gap,
                    offset=twig.offset,
                    lower=-5,
                    upper=5,
                )
            )
        components.append(component(f"c{k}", f"p:B{k}", placement))
    modes = []
    for k in range(count):
        modes.append(mode(f"part_{k}", whole(f"c{k}"), "free", at=frame(rng)))
        modes.append(mode(f"mount_{k}", ref(f"c{k}.{'ab'[k % 2]}"), "fixed", at=frame(rng)))
    q = {path: float(rng.uniform(-2, 2)) for twig in twigs for path in paths_of(twig)}
    tree = linked(assembly("tree", components, joints, modes=modes), *records, but={Code.FAR})  # whatever sizes and offsets are drawn
    return Tree(count, twigs, mounts, order, tree, q)


def robots(found: Assembly) -> dict[str, Robot]:
    report = Report()
    made = [root(found, m, report) for m in found.modes]
    assert report.diagnostics == []
    return {robot.mode.name: robot for robot in made if robot is not None}


def world_of(tree: Tree, mode_name: str) -> list[Array]:
    """World poses of all occurrences in a mode, by chains of matrices."""
    kind, _, number = mode_name.partition("_")
    k = int(number)
    linked_mode = next(m for m in tree.assembly.modes if m.name == mode_name)
    start = as_matrix(linked_mode.at)
    if kind == "mount":
        start = mated(start, tree.mounts[k, "ab"[k % 2]])
    return [start @ pose for pose in tree.world(k)]


trees = st.builds(build, st.integers(0, 2**32 - 1), st.integers(2, 7))


@settings(max_examples=15)
@given(trees)
def test_poses_match_matrices_in_every_mode(tree: Tree) -> None:
    plain = poses(tree.assembly, tree.q)
    from_base = tree.world(0)
    for position, k in enumerate(tree.order):
        assert as_matrix(plain[position]) == pytest.approx(from_base[k], abs=1e-9)
    for name, robot in robots(tree.assembly).items():
        expected = world_of(tree, name)
        placed = occurrence_poses(robot, tree.q)
        for position, k in enumerate(tree.order):
            assert as_matrix(placed[position]) == pytest.approx(expected[k], abs=1e-9)


@settings(max_examples=15)
@given(trees)
def test_relative_poses_do_not_depend_on_the_root(tree: Tree) -> None:
    found = [[as_matrix(p) for p in occurrence_poses(robot, tree.q)] for robot in robots(tree.assembly).values()]
    first = [inv(found[0][0]) @ p for p in found[0]]
    for world in found[1:]:
        for one, other in zip(first, world):
            assert inv(world[0]) @ other == pytest.approx(one, abs=1e-9)


@settings(max_examples=15)
@given(trees)
def test_total_inertia_does_not_depend_on_the_root(tree: Tree) -> None:
    own = {o.index: o.properties for o in tree.assembly.occurrences}
    world = tree.world(tree.order[0])
    points, weights, spins = [], [], []
    for position, k in enumerate(tree.order):
        points.append((world[k] @ [*own[position].centre, 1])[:3])
        weights.append(own[position].mass)
        spins.append(world[k][:3, :3] @ np.array(own[position].inertia) @ world[k][:3, :3].T)
    mass = sum(weights)
    centre = np.array(weights) @ np.array(points) / mass
    inertia = sum(
        spin + m * ((p - centre) @ (p - centre) * np.eye(3) - np.outer(p - centre, p - centre))
        for spin, m, p in zip(spins, weights, points)
    )
    for robot in robots(tree.assembly).values():
        got = mass_properties(robot, tree.q)
        first = as_matrix(occurrence_poses(robot, tree.q, NO_POSE)[0])
        back = inv(first)
        assert got.mass == pytest.approx(mass, rel=1e-12)
        assert (back @ [*got.centre, 1])[:3] == pytest.approx(centre, abs=1e-12)
        assert back[:3, :3] @ np.array(got.inertia) @ back[:3, :3].T == pytest.approx(inertia, abs=1e-12, rel=1e-12)


# --- dynamics ------------------------------------------------------------------------------------------------------


def skew(v: Array) -> Array:
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def rotation_about(axis: Array, angle: float) -> Array:
    """Rotation matrix by Rodrigues' formula."""
    k = skew(axis)
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def held(robot: Robot, q: dict[str, float], held_link: int, down: Array) -> tuple[list[str], Array, Array]:
    """Joint names (sorted), mass matrix and gravity torque with `held_link` at rest; `down` is gravity in that link's frame.

    J_b is the twist Jacobian of each body (angular, and linear at the root's origin, one column per joint), relative to that of the held
    link: M = sum (J_b - J_L)^T I_b (J_b - J_L), and the torque is - sum m_b g . d c_b / d q."""
    names = sorted(joint.path for body in robot.bodies for joint in body.joints)
    column = {name: k for k, name in enumerate(names)}
    frames: list[Array] = []
    jacobians: list[Array] = []
    for body in robot.bodies:
        X = np.eye(4) if body.parent is None else frames[body.parent] @ as_matrix(body.X_PL)
        jacobian = np.zeros((6, len(names))) if body.parent is None else jacobians[body.parent].copy()
        for core in body.joints:
            angular, linear, anchor = (np.array(part) for part in (core.twist.angular, core.twist.linear, core.twist.anchor))
            hat = np.zeros((4, 4))
            hat[:3, :3], hat[:3, 3] = skew(angular), linear - np.cross(angular, anchor)
            spatial = X @ hat @ inv(X)
            jacobian[:, column[core.path]] = [spatial[2, 1], spatial[0, 2], spatial[1, 0], *spatial[:3, 3]]
            X = X @ expm(hat * q[core.path])
        frames.append(X)
        jacobians.append(jacobian)
    reference = next(k for k, body in enumerate(robot.bodies) if body.link == held_link)
    g = frames[reference][:3, :3] @ down
    matrix, torque = np.zeros((len(names), len(names))), np.zeros(len(names))
    for body, X, jacobian in zip(robot.bodies, frames, jacobians):
        own = robot.assembly.links[body.link].properties
        relative = jacobian - jacobians[reference]
        centre = (X @ [*own.centre, 1])[:3]
        spin = X[:3, :3] @ np.array(own.inertia) @ X[:3, :3].T
        angular = relative[:3]
        linear = relative[3:] - skew(centre) @ angular
        matrix += own.mass * linear.T @ linear + angular.T @ spin @ angular
        torque -= own.mass * linear.T @ g
    return names, matrix, torque


@settings(max_examples=8)
@given(trees, st.integers(0, 6))
def test_dynamics_with_a_held_link_do_not_depend_on_root(tree: Tree, which: int) -> None:
    if not tree.q:
        return
    link = which % len(tree.assembly.links)
    made = robots(tree.assembly)
    down = np.array([1.3, -2.1, -9.1])
    rooted_there = next(robot for robot in made.values() if robot.bodies[0].link == link)
    names, matrix, torque = held(rooted_there, tree.q, link, down)
    assert np.linalg.eigvalsh(matrix)[0] > 0
    for robot in made.values():
        other_names, other, other_torque = held(robot, tree.q, link, down)
        assert other_names == names
        assert np.abs(other - matrix).max() <= 1e-9 * np.abs(matrix).max()
        assert np.abs(other_torque - torque).max() <= 1e-9 * max(np.abs(torque).max(), 1e-3)


def test_holding_different_links_changes_the_dynamics() -> None:
    """The oracle distinguishes the two links: a light and a heavy box on a hinge."""
    turn = {"a": t(0.1, 0, 0), "b": t(-0.1, 0, 0) @ rx(np.pi)}
    found = linked(
        assembly(
            "pair",
            [component("light", "p:Light"), component("heavy", "p:Heavy")],
            [joint("j", "light.a", "heavy.b")],
            modes=[mode("m", whole("light")), mode("n", whole("heavy"))],
        ),
        box("p:Light", (0.1, 0.1, 0.1), mounts=turn),
        box("p:Heavy", (0.2, 0.2, 0.2), mounts=turn),
    )
    one, other = robots(found).values()
    down, q = np.array([0.0, -9.81, 0.0]), {"j": 0.3}
    _, held_light, sag_light = held(one, q, 0, down)
    _, held_heavy, sag_heavy = held(other, q, 1, down)
    # a pendulum by hand: I + m l^2 about z, l = 0.1
    assert held_light[0, 0] == pytest.approx(8 * (0.2**2 + 0.2**2) / 12 + 8 * 0.1**2)
    assert held_heavy[0, 0] == pytest.approx(1 * (0.1**2 + 0.1**2) / 12 + 1 * 0.1**2)
    assert abs(sag_light[0]) > 7 * abs(sag_heavy[0])
    assert held(one, q, 1, down)[1] == pytest.approx(held_heavy)
