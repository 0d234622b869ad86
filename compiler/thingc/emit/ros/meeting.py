"""Which links meet as the joints move: MuJoCo looks for contacts in the mode's own URDF, at configurations drawn once for all.

A link's meshes collide as their convex hulls. Links that their hulls keep apart are apart; where a mesh is not convex, two that are said to
meet may not.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from thingc.emit.geometry import MeshAsset
from thingc.emit.mjcf.known import mujoco_version
from thingc.emit.urdf.model import UNBOUNDED
from thingc.emit.xml import Element, write
from thingc.frozen import dataclass
from thingc.realize.store.local import Store

SAMPLES = 10_000
SEED = 0

MEETING = "links-meeting"
"""The kind of document in the store."""

MEMORY = 1 << 28
"""Of MuJoCo's arena [bytes]: more contacts at once than any robot has that is not folded into itself."""

Pair = tuple[str, str]


@dataclass(frozen=True, slots=True, kw_only=True)
class Meetings:
    """In how many of `samples` configurations each pair of links meets (a pair that never does is left out), and which meet in each of the
    configurations that were asked for, by name. Names within a pair are sorted."""

    samples: int
    counts: dict[Pair, int]
    at: dict[str, frozenset[Pair]]


def meetings(
    tree: Element, meshes: str, assets: Sequence[MeshAsset], starts: Mapping[str, Mapping[str, float]], store: Store,
) -> Meetings:
    """Of a mode's URDF, `meshes` being the URI of the folder of its `assets`; `starts` are further configurations, q by joint. Remembered
    in the store by what it depends on. Raises `ValueError` where MuJoCo does not take the links' shapes."""
    bare, needed = _collisions_only(tree, meshes)
    used = {mesh.file: mesh for mesh in assets if mesh.file in needed}
    text = write(bare, "What collides.").text
    said = [mujoco_version(), SAMPLES, SEED, text, {file: mesh.mesh.sha256 for file, mesh in used.items()}, starts]
    key = hashlib.sha256(json.dumps(said, sort_keys=True).encode()).hexdigest()
    known = store.get_json(MEETING, key)
    if known is None:
        found = _Sampler(text, {file: store.read(mesh.mesh.sha256) for file, mesh in used.items()}, bare)
        counts = found.counts()
        at = {name: found.at(q) for name, q in starts.items()}
        known = {
            "samples": found.samples, "counts": [[*pair, count] for pair, count in sorted(counts.items())],
            "at": {name: sorted(pairs) for name, pairs in at.items()},
        }
        store.put_json(MEETING, key, known)
    return Meetings(
        samples=known["samples"], counts={(one, other): count for one, other, count in known["counts"]},
        at={name: frozenset((one, other) for one, other in pairs) for name, pairs in known["at"].items()},
    )


def _collisions_only(tree: Element, meshes: str) -> tuple[Element, set[str]]:
    """The links with what they collide with alone, weighing anything, and the joints; and the files of meshes that they name."""
    bare = Element(tag="robot", attributes=tree.attributes)
    compiler = {"fusestatic": "false", "strippath": "false", "meshdir": "", "boundmass": "1", "boundinertia": "1", "balanceinertia": "true"}
    bare.add("mujoco").add("compiler", compiler)
    files: set[str] = set()
    for element in tree.children:
        if element.tag == "joint":
            bare.children.append(Element(tag="joint", attributes=element.attributes, children=[
                child for child in element.children if child.tag in ("origin", "parent", "child", "axis", "limit", "mimic")
            ]))
        elif element.tag == "link":
            link = bare.add("link", element.attributes)
            for collision in element.children:
                if collision.tag == "collision":
                    link.children.append(_renamed(collision, f"{meshes}/", files))
    return bare, files


def _renamed(collision: Element, prefix: str, files: set[str]) -> Element:
    """A shape whose mesh, if it is one, is named by its file alone."""
    shape = Element(tag="collision")
    for child in collision.children:
        mesh = child.find("mesh") if child.tag == "geometry" else None
        if mesh is None:
            shape.children.append(child)
            continue
        file = mesh.attributes["filename"].removeprefix(prefix)
        files.add(file)
        shape.add("geometry").add("mesh", {"filename": file})
    return shape


class _Sampler:
    """MuJoCo, and the joints' coordinates in its state."""

    def __init__(self, text: str, assets: Mapping[str, bytes], tree: Element) -> None:
        import mujoco

        spec = mujoco.MjSpec.from_string(text, assets=dict(assets))
        for mesh in spec.meshes:
            mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX
        spec.memory = MEMORY
        self.model: Any = spec.compile()
        self.data: Any = mujoco.MjData(self.model)
        self.links = [self.model.body(int(body)).name for body in self.model.geom_bodyid]
        self.joints = [element for element in tree.children if element.tag == "joint" and element.attributes["type"] != "fixed"]
        self.samples = SAMPLES if self.joints else 1

    def counts(self) -> dict[Pair, int]:
        """In how many configurations pairs of links meet: joints by themselves are drawn between their limits, others follow them."""
        import numpy as np

        free = [joint for joint in self.joints if joint.find("mimic") is None]
        drawn = np.random.Generator(np.random.PCG64(SEED)).random((self.samples, len(free)))
        ends = np.array([self._ends(joint) for joint in free]).reshape(-1, 2)
        counts: dict[Pair, int] = {}
        for q in ends[:, 0] + drawn * (ends[:, 1] - ends[:, 0]):
            for pair in self.at(dict(zip((joint.attributes["name"] for joint in free), map(float, q), strict=True))):
                counts[pair] = counts.get(pair, 0) + 1
        return counts

    def at(self, q: Mapping[str, float]) -> set[Pair]:
        """The pairs of links that meet at `q`, by joint; what follows is put where it belongs."""
        import mujoco

        for name, value in self._all(q):
            self.data.qpos[self.model.joint(name).qposadr[0]] = value
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_collision(self.model, self.data)
        return {_ordered(self.links[one], self.links[other]) for one, other in self.data.contact.geom}

    def _all(self, q: Mapping[str, float]) -> Iterator[tuple[str, float]]:
        for joint in self.joints:
            name, mimic = joint.attributes["name"], joint.find("mimic")
            if mimic is None:
                yield name, q.get(name, 0.0)
            else:
                said = mimic.attributes
                yield name, float(said["multiplier"]) * q.get(said["joint"], 0.0) + float(said["offset"])

    def _ends(self, joint: Element) -> tuple[float, float]:
        """Between which values [rad or m] a joint is drawn: where it has no limit a whole turn, or as far as the robot is large."""
        limit = joint.find("limit")
        assert limit is not None
        lower, upper = (float(limit.attributes.get(name, sign * UNBOUNDED)) for name, sign in (("lower", -1.0), ("upper", 1.0)))
        span = 2.0 * math.pi if joint.attributes["type"] != "prismatic" else 2.0 * float(self.model.stat.extent)
        if lower <= -UNBOUNDED and upper >= UNBOUNDED:
            return -span / 2.0, span / 2.0
        if lower <= -UNBOUNDED:
            return upper - span, upper
        return (lower, lower + span) if upper >= UNBOUNDED else (lower, upper)


def _ordered(one: str, other: str) -> Pair:
    return (one, other) if one < other else (other, one)
