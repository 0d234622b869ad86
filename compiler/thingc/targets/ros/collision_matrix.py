"""Find the pairs of links that collide when the joints move.

MuJoCo searches for contacts at a fixed set of random configurations. The search uses the URDF of the mode. MuJoCo uses the convex hull of
each mesh for collisions. Therefore, collisions of non-convex meshes may be reported that do not exist. However, no collision in a sampled
configuration is missed.

Between samples, a collision of thin shapes can be missed. Pairs that collide in no sample are therefore compared in all configurations if
few joints move them, by the method of `thingc.model.solids.joint_boxes`.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import combinations, product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thingc.base.frozen_struct import FrozenStruct
from thingc.geometry.store.local import Store
from thingc.model.assembly.links import joined_links
from thingc.model.assembly.types import Assembly
from thingc.model.solids.joint_boxes import ComparedPair, Place, compare_in_boxes, sphere_bounds
from thingc.targets.geometry import MeshAsset
from thingc.targets.mjcf.accepted_models import mujoco_version
from thingc.targets.name_mangling import safe
from thingc.targets.urdf.links import UNBOUNDED
from thingc.targets.xml_writer import Element, write

SAMPLES = 10_000
SEED = 0

DOCUMENT_KIND = "collision-matrix"
"""Kind of the JSON documents in the store that contain collision matrices."""

PROVED = 2
"""Largest number of independent joints between two links for which all configurations are compared."""
RESOLUTION = 1e-5
"""Gap [m] below which two shapes count as colliding. It is greater than the errors of the distances that MuJoCo computes."""
MOST = 5_000
"""Largest number of configurations in which pairs are compared after sampling, which takes about half a second."""

MEMORY = 1 << 26
"""Size of the memory arena of MuJoCo [bytes]. This size suffices for the contacts of any robot whose links do not overlap heavily."""

Pair = tuple[str, str]


class CollisionMatrix(FrozenStruct):
    """A collision matrix: a table of the pairs of links that collide.

    The table contains, for each pair, the number of configurations out of `samples` in which the links collide. Pairs of links that never
    collide, or that a floating joint moves, are omitted. `at` contains the pairs that collide in each named configuration. `apart` contains
    the pairs that were compared in all configurations: True for a pair that never collides, and False for a pair that collides between the
    samples, or that a floating joint moves. The two names in a pair are sorted.
    """

    samples: int
    counts: dict[Pair, int]
    at: dict[str, frozenset[Pair]]
    apart: dict[Pair, bool]


def adjacent(assembly: Assembly) -> frozenset[Pair]:
    """Return the pairs of links that are connected by a joint. Joints that close loops are also taken into account."""
    return frozenset(pair_of(*(safe(assembly.links[link].name) for link in pair)) for pair in joined_links(assembly))


def pair_of(first: str, second: str) -> Pair:
    """Return the names of two links as a sorted pair."""
    return (first, second) if first < second else (second, first)


def collision_matrix(
    tree: Element, meshes: str, assets: Sequence[MeshAsset], starts: Mapping[str, Mapping[str, float]], neighbours: Collection[Pair],
    store: Store,
) -> CollisionMatrix:
    """Compute the collision matrix of a mode's URDF, or read it from the store.

    `meshes` is the URI of the folder that contains the mesh `assets`. `starts` contains additional configurations, each with the values
    of q by joint. `neighbours` contains the pairs of links that are ignored. Raises `ValueError` if MuJoCo does not accept the shapes of
    the links.
    """
    collision_tree, mesh_files = _collisions_only(tree, meshes)
    used = {mesh.file: mesh for mesh in assets if mesh.file in mesh_files}
    text = write(collision_tree, "What collides.").text
    digests, islands = {file: mesh.mesh.sha256 for file, mesh in used.items()}, _islands(tree)
    inputs = [mujoco_version(), SAMPLES, SEED, text, digests, starts, sorted(neighbours), islands]
    key = hashlib.sha256(json.dumps(inputs, sort_keys=True).encode()).hexdigest()
    result = store.get_json(DOCUMENT_KIND, key)
    if result is None:
        import mujoco

        try:
            sampler = _Sampler(text, {file: store.read(mesh.mesh.sha256) for file, mesh in used.items()}, collision_tree, neighbours)
            counts = {pair: count for pair, count in sampler.counts().items() if islands[pair[0]] == islands[pair[1]]}
            by_configuration = {name: sampler.at(q) for name, q in starts.items()}
        except mujoco.FatalError as fault:
            raise ValueError(str(fault)) from None
        result = {
            "samples": sampler.samples, "counts": [[*pair, count] for pair, count in sorted(counts.items())],
            "at": {name: sorted(pairs) for name, pairs in by_configuration.items()},
            "apart": [[*pair, apart] for pair, apart in sampler.compare_always({*counts, *neighbours}, islands)],
        }
        store.put_json(DOCUMENT_KIND, key, result)
    return CollisionMatrix(
        samples=result["samples"], counts={(first, second): count for first, second, count in result["counts"]},
        at={name: frozenset((first, second) for first, second in pairs) for name, pairs in result["at"].items()},
        apart={(first, second): apart for first, second, apart in result["apart"]},
    )


def _islands(tree: Element) -> dict[str, str]:
    """Return the root link of the part of a URDF that contains a link, if floating joints divide the URDF into parts, by link."""
    parents: dict[str, str] = {}
    for joint in tree.children:
        if joint.tag == "joint" and joint.get("type") != "floating":
            ends = {child.tag: child.get("link") for child in joint.children if child.tag in ("parent", "child")}
            parents[ends["child"]] = ends["parent"]
    roots: dict[str, str] = {}
    for name in (link.get("name") for link in tree.children if link.tag == "link"):
        roots[name] = name
        while roots[name] in parents:
            roots[name] = parents[roots[name]]
    return roots


def _collisions_only(tree: Element, meshes: str) -> tuple[Element, set[str]]:
    """Return a copy of a URDF that contains only the collision shapes, and the names of their mesh files.

    The masses and joint limits of this copy are arbitrary. Floating joints are fixed.
    """
    collision_tree = Element(tag="robot", attributes=tree.attributes)
    compiler = {"fusestatic": "false", "strippath": "false", "meshdir": "", "boundmass": "1", "boundinertia": "1", "balanceinertia": "true"}
    collision_tree.add("mujoco").add("compiler", compiler)
    files: set[str] = set()
    for element in tree.children:
        if element.tag == "joint":
            kind = {"type": "fixed"} if element.get("type") == "floating" else {}
            collision_tree.children.append(Element(tag="joint", attributes={**element.attributes, **kind}, children=[
                child for child in element.children if child.tag in ("origin", "parent", "child", "axis", "limit", "mimic")
            ]))
        elif element.tag == "link":
            link = collision_tree.add("link", element.attributes)
            for collision in element.children:
                if collision.tag == "collision":
                    link.children.append(_rename_meshes(collision, f"{meshes}/", files))
    return collision_tree, files


def _rename_meshes(collision: Element, prefix: str, files: set[str]) -> Element:
    """Return a copy of a collision element. If its shape is a mesh, the copy refers to the mesh by file name only."""
    shape = Element(tag="collision")
    for child in collision.children:
        mesh = child.find("mesh") if child.tag == "geometry" else None
        if mesh is None:
            shape.children.append(child)
            continue
        file = mesh.get("filename").removeprefix(prefix)
        files.add(file)
        shape.add("geometry").add("mesh", {"filename": file})
    return shape


class _Sampler(Place[ComparedPair]):
    """Searches for collisions in configurations of a MuJoCo model.

    `free` contains the independent joints. Each entry k of qpos is `multiplier[k] * q[leader[k]] + offset[k]`, where q contains the
    positions of the independent joints. Row k of `ranges` contains the limits of the independent joint k, or one turn if it has no limits
    (`unlimited`). `turns` contains whether it rotates. `hinges` contains which joints of the model rotate. `chain` contains the joints
    between the two bodies that are compared.
    """

    def __init__(self, text: str, assets: Mapping[str, bytes], tree: Element, neighbours: Collection[Pair]) -> None:
        import mujoco
        spec = mujoco.MjSpec.from_string(text, assets=dict(assets))
        for mesh in spec.meshes:
            mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX
        for first, second in neighbours:
            spec.add_exclude(bodyname1=first, bodyname2=second)
        spec.memory = MEMORY
        self.model: Any = spec.compile()
        self.data: Any = mujoco.MjData(self.model)
        moving = {first.get("name"): first for first in tree.children if first.tag == "joint" and first.get("type") != "fixed"}
        self.free = {name: joint for name, joint in moving.items() if joint.find("mimic") is None}
        columns = {name: column for column, name in enumerate(self.free)}
        self.leader, self.multiplier, self.offset = (np.zeros(self.model.nq, dtype=kind) for kind in (int, float, float))
        for name, joint in moving.items():
            mimic = joint.find("mimic")
            mimic_values = mimic.texts if mimic is not None else {"joint": name, "multiplier": "1", "offset": "0"}
            address = self.model.joint(name).qposadr[0]
            self.leader[address] = columns[mimic_values["joint"]]
            self.multiplier[address], self.offset[address] = float(mimic_values["multiplier"]), float(mimic_values["offset"])
        self.turns = np.array([joint.get("type") != "prismatic" for joint in self.free.values()], bool)
        self.hinges = self.model.jnt_type == int(mujoco.mjtJoint.mjJNT_HINGE)
        self.chain: list[int] = []
        self.q = {}
        self.samples = SAMPLES if self.free else 1
        self.ranges = np.array([self._sampled_range(joint) for joint in self.free.values()]).reshape(-1, 2)
        unlimited = [_limits(joint) != tuple(ends) for joint, ends in zip(self.free.values(), self.ranges, strict=True)]
        self.unlimited = np.array(unlimited, bool)

    def counts(self) -> dict[Pair, int]:
        """Return the number of configurations in which each pair of links collides. Independent joints are sampled between their limits."""
        samples = np.random.Generator(np.random.PCG64(SEED)).random((self.samples, len(self.free)))
        return self._count_collisions(self.ranges[:, 0] + samples * (self.ranges[:, 1] - self.ranges[:, 0]))

    def at(self, q: Mapping[str, float]) -> Collection[Pair]:
        """Return the pairs of links that collide in one configuration. `q` contains the values of the joints, by name."""
        return self._count_collisions(np.array([[q[name] for name in self.free]])).keys()

    def compare_always(self, skipped: Collection[Pair], islands: Mapping[str, str]) -> Iterator[tuple[Pair, bool]]:
        """Yield pairs of links and whether they are apart in all configurations, until `MOST` configurations have been compared.

        Pairs in `skipped`, and pairs that move in too many ways, are omitted. Links in different `islands` can collide.
        """
        configurations = iter(range(MOST))
        bodies = {self.model.body(body).name: body for body in set(self.model.geom_bodyid.tolist())}
        for first, second in combinations(sorted(bodies), 2):
            if (first, second) not in skipped:
                together = islands[first] == islands[second]
                apart = self._are_apart(bodies[first], bodies[second], configurations) if together else False
                if apart is not None:
                    yield (first, second), apart

    def _are_apart(self, first: int, second: int, configurations: Iterator[int]) -> bool | None:
        """Return whether two bodies are apart in all configurations.

        Return None if this is unknown because more than `PROVED` independent joints move the bodies, because the configurations are not
        periodic in a joint without limits, or because no more `configurations` may be compared.
        """
        model, (one, other) = self.model, (self._joints_above(body) for body in (first, second))
        self.chain = [*sorted(one - other, reverse=True), *sorted(other - one)]
        addresses = model.jnt_qposadr[self.chain]
        leader, multiplier = self.leader[addresses], self.multiplier[addresses]
        repeats = self.turns[leader] & self.hinges[self.chain] & (multiplier % 1.0 == 0.0)
        if len({*leader}) > PROVED or (self.unlimited[leader] & ~repeats).any():
            return None
        half = np.where(np.isin(np.arange(len(self.free)), leader), self.ranges[:, 1] - self.ranges[:, 0], 0.0) / 2.0
        geoms = product(*(np.flatnonzero(model.geom_bodyid == body).tolist() for body in (first, second)))
        pairs = [ComparedPair(a, b, clearance=RESOLUTION) for a, b in geoms]
        for _ in compare_in_boxes(self._place, self.ranges.mean(axis=1), half, pairs):
            if any(pair.found for pair in pairs):
                return False
            if next(configurations, None) is None:
                return None
        return all(pair.verdict == "clear" for pair in pairs) or None

    def _place(self, x: NDArray[np.float64], _: object) -> _Sampler:
        """Set the independent joints to `x` [rad or m]."""
        import mujoco
        self.data.qpos[:] = x[self.leader] * self.multiplier + self.offset
        mujoco.mj_kinematics(self.model, self.data)
        return self

    def bounds(self, pairs: Sequence[ComparedPair], half: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return lower bounds of the distances [m] of shapes, and the longest paths [m] of their points in a box."""
        geoms, hinges = np.array([(pair.one, pair.other) for pair in pairs]).T, self.hinges[:, None]
        twists = np.stack([self.data.xanchor, self.data.xaxis * hinges, self.data.xaxis * ~hinges], axis=1)
        steps, order = (half[self.leader] * np.abs(self.multiplier))[self.model.jnt_qposadr], np.array(self.chain, dtype=int)
        return sphere_bounds(twists, np.tile(order[:, None], len(pairs)), steps, self.data.geom_xpos[geoms], self.model.geom_rbound[geoms])

    def gap(self, pair: ComparedPair, within: float) -> float:
        """Return the distance [m] between two shapes, or `within` if the distance is greater."""
        import mujoco
        return float(mujoco.mj_geomDistance(self.model, self.data, pair.one, pair.other, within, None))

    def _joints_above(self, body: int) -> set[int]:
        """Return the joints between a body and the root."""
        joints: set[int] = set()
        while body:
            start = int(self.model.body_jntadr[body])
            joints.update(range(start, start + int(self.model.body_jntnum[body])))
            body = int(self.model.body_parentid[body])
        return joints

    def _count_collisions(self, q: NDArray[np.float64]) -> dict[Pair, int]:
        """Count the configurations in which each pair of links collides.

        `q` is an array `(n, independent joints)` with one configuration in each row.
        """
        import mujoco
        collisions: list[tuple[int, NDArray[np.int32]]] = []
        for number, position in enumerate(q[:, self.leader] * self.multiplier + self.offset if self.free else q):
            self.data.qpos[:] = position
            mujoco.mj_kinematics(self.model, self.data)
            mujoco.mj_collision(self.model, self.data)
            if self.data.ncon:
                collisions.append((number, np.sort(self.model.geom_bodyid[self.data.contact.geom], axis=1)))
        if not collisions:
            return {}
        numbers = np.repeat([number for number, _ in collisions], [len(bodies) for _, bodies in collisions])
        distinct = np.unique(np.column_stack([numbers, np.concatenate([bodies for _, bodies in collisions])]), axis=0)
        pairs, counts = np.unique(distinct[:, 1:], axis=0, return_counts=True)
        names = [pair_of(*(self.model.body(int(body)).name for body in pair)) for pair in pairs]
        return {pair: int(count) for pair, count in zip(names, counts, strict=True)}

    def _sampled_range(self, joint: Element) -> tuple[float, float]:
        """Return the range [rad or m] in which a joint is sampled.

        A rotating joint without limits is sampled over one full turn. A sliding joint without limits is sampled over the size of the
        robot in both directions.
        """
        lower, upper = _limits(joint)
        span = 2.0 * math.pi if joint.get("type") != "prismatic" else 2.0 * float(self.model.stat.extent)
        if lower <= -UNBOUNDED and upper >= UNBOUNDED:
            return -span / 2.0, span / 2.0
        if lower <= -UNBOUNDED:
            return upper - span, upper
        return (lower, lower + span) if upper >= UNBOUNDED else (lower, upper)


def _limits(joint: Element) -> tuple[float, float]:
    """Return the limits [rad or m] of a joint."""
    limit = joint.find("limit")
    assert limit is not None
    lower, upper = (float(limit.get(name, str(end))) for name, end in (("lower", -UNBOUNDED), ("upper", UNBOUNDED)))
    return lower, upper
