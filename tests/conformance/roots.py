"""Properties that do not depend on the root, checked in the models of all modes of a robot. Every function returns descriptions of the
differences, which is an empty list if the modes agree."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import mujoco
import numpy as np

from conformance import simulation as sim

Array = sim.Array
Models = Mapping[str, mujoco.MjModel]
"""The model of each mode."""

POSE = 1e-9
"""Largest difference [m], also between directions, of a pose in two modes."""

DYNAMICS = 1e-9
"""Largest difference of the mass matrix and the gravity torques with one link held, relative to their largest entry."""

WHOLE = 1e-12
"""Largest relative difference of the total mass, centre and inertia."""


def root_of(model: mujoco.MjModel) -> str:
    """Return the root link of a model."""
    (found,) = (name for name in sim.links(model) if int(model.body(name).parentid[0]) == 0)
    return found


def angles(model: mujoco.MjModel, source: np.random.Generator) -> dict[str, float]:
    """Return random positions of all joints within their limits [rad]."""
    return {name: float(source.uniform(*model.joint(name).range)) for name in sim.joints(model)}


def excluded(model: mujoco.MjModel) -> set[frozenset[str]]:
    """Return the pairs of links whose contacts are excluded, without anchors of holds."""
    pairs = (
        frozenset((model.body(int(signature) >> 16).name, model.body(int(signature) & 0xFFFF).name))
        for signature in model.exclude_signature
    )
    return {pair for pair in pairs if "world" not in pair}


def relative(one: Array, other: Array) -> float:
    """Return the largest difference divided by the largest entry."""
    return float(np.abs(one - other).max() / max(np.abs(one).max(), np.abs(other).max()))


def links(models: Models) -> list[str]:
    """Check that links, joints and excluded pairs are equal, and that the mass, centre, inertia and geometry of each link are equal bit
    by bit."""
    said: list[str] = []
    (first, one), *others = models.items()
    for mode, other in others:
        for names in (sim.links, sim.joints, excluded):
            if names(one) != names(other):
                said.append(f"{names.__name__} of {first} and {mode}: {names(one)}, {names(other)}")
        for name in sorted(set(sim.links(one)) & set(sim.links(other))):
            for field in ("mass", "ipos", "iquat", "inertia"):
                if not np.array_equal(getattr(one.body(name), field), getattr(other.body(name), field)):
                    said.append(f"{field} of {name} in {first} and {mode}")
        geoms = [{model.geom(i).name for i in range(model.ngeom)} for model in (one, other)]
        if geoms[0] != geoms[1]:
            said.append(f"geometry of {first} and {mode}: {sorted(geoms[0] ^ geoms[1])}")
        for name in sorted(geoms[0] & geoms[1]):
            for field in ("pos", "quat", "size"):
                if not np.array_equal(getattr(one.geom(name), field), getattr(other.geom(name), field)):
                    said.append(f"{field} of {name} in {first} and {mode}")
    return said


def pairwise(found: Mapping[str, Array], names: Sequence[str]) -> Array:
    """Return the pose of each frame in each other frame."""
    stack = np.array([found[name] for name in names])
    seen: Array = np.einsum("iab,jbc->ijac", np.linalg.inv(stack), stack)
    return seen


def poses(models: Models, q: Mapping[str, float], source: np.random.Generator) -> list[str]:
    """Check that for equal q, the relative poses of all parts and sites equal those in the first mode, for any pose of the base."""
    said: list[str] = []
    expected: Array | None = None
    names: list[str] = []
    for mode, model in models.items():
        found = sim.frames(model, sim.at(model, q, sim.random_pose(source)))
        if expected is None:
            names = sorted(found)
            expected = pairwise(found, names)
            continue
        if sorted(found) != names:
            said.append(f"{mode}: {sorted(set(found) ^ set(names))} not in all modes")
            continue
        away = np.abs(pairwise(found, names) - expected).max(axis=(2, 3))
        i, j = (int(k) for k in np.unravel_index(away.argmax(), away.shape))
        if not away[i, j] <= POSE:
            said.append(f"{mode}: {names[j]} seen from {names[i]} is {away[i, j]:.2e} off")
    return said


def whole(models: Models, q: Mapping[str, float], part: str, source: np.random.Generator) -> list[str]:
    """Check that the total mass, centre and inertia in the frame of a part equal those of the first mode."""
    said: list[str] = []
    seen: dict[str, tuple[float, Array, Array]] = {}
    for mode, model in models.items():
        data = sim.at(model, q, sim.random_pose(source))
        seen[mode] = sim.whole(model, data, sim.parts(model, data)[part])
    first = next(iter(seen.values()))
    for mode, one in seen.items():
        for what, found, expected in zip(("mass", "centre", "inertia"), one, first, strict=True):
            if not relative(np.atleast_1d(found), np.atleast_1d(expected)) <= WHOLE:
                said.append(f"{mode}: {what} of everything is {found}, not {expected}")
    return said


def said_of_all(models: Models, part: str, said: Mapping[str, tuple[float, Any, Any]]) -> list[str]:
    """Check that the total mass, centre and inertia at q = 0 in the frame of a part equal each of the given values."""
    wrong: list[str] = []
    for mode, model in models.items():
        data = sim.at(model, {})
        found = sim.whole(model, data, sim.parts(model, data)[part])
        for who, one in said.items():
            for what, seen, expected, within in zip(("mass", "centre", "inertia"), found, one, (1e-12, 1e-9, 1e-9), strict=True):
                if not relative(np.atleast_1d(seen), np.atleast_1d(expected)) <= within:
                    wrong.append(f"{mode}: {what} is {seen}; {who} says {expected}")
    return wrong


def said_of_links(models: Models, occurrences: Sequence[Mapping[str, Any]]) -> list[str]:
    """Check that the mass of each link is the sum of the masses of its occurrences."""
    wrong: list[str] = []
    for mode, model in models.items():
        for link in sim.links(model):
            mass, expected = sim.inertia_of(model, link)[0], sum(o["mass"] for o in occurrences if o["link"] == link)
            if not abs(mass - expected) <= 1e-12 * mass:
                wrong.append(f"{mode}: {link} weighs {mass}, not {expected}")
    return wrong


def at_rest(models: Models, part: str, rest: Mapping[str, Array]) -> list[str]:
    """Check that at q = 0, exactly the given parts are visible, with the given poses in the frame of a part."""
    said: list[str] = []
    for mode, model in models.items():
        found = sim.parts(model, sim.at(model, {}))
        if set(found) != set(rest):
            said.append(f"{mode}: {sorted(set(found) ^ set(rest))} drawn or said, not both")
        back = np.linalg.inv(found[part])
        said += [
            f"{mode}: {name}" for name in sorted(set(found) & set(rest)) if not np.abs(back @ found[name] - rest[name]).max() <= 1e-10
        ]
    return said


def described(tree: Mapping[str, Any], model: mujoco.MjModel, q: Mapping[str, float]) -> list[str]:
    """Check that the formula of `modes.json` for joints with one axis, X_PC(q) = X_PJ motion(q + offset) inv(X_CJ), gives the link poses
    of MuJoCo."""
    said: list[str] = []
    root = tree["links"][0]["name"]
    data = sim.at(model, q)
    expected = {root: np.eye(4)}
    for joint in tree["joints"]:
        (turn,) = joint["coordinates"]
        (inside,) = turn["in_model"]
        if [*data.joint(inside).qpos] != [*data.qpos[turn["qpos"]]] or [*model.joint(inside).dofadr] != turn["dof"]:
            said.append(f"{joint['name']} has other addresses")
        axis = np.array(turn["angular"])
        angle = q[turn["name"]] + turn["offset"]
        motion = sim.pose(np.zeros(3), sim.turned(np.array([np.cos(angle / 2), *(np.sin(angle / 2) * axis)])))
        moved = np.array(joint["X_PJ"]) @ motion @ np.linalg.inv(joint["X_CJ"])
        expected[joint["child"]] = expected[joint["parent"]] @ (np.linalg.inv(moved) if joint["reversed"] else moved)
    if root != root_of(model) or sorted(expected) != sim.links(model):
        said.append(f"other links: {sorted(expected)}, rooted at {root}")
        return said
    body = {name: sim.pose(data.body(name).xpos, data.body(name).xmat) for name in expected}
    back = np.linalg.inv(body[root])
    return [*said, *(name for name, X in expected.items() if not np.abs(back @ body[name] - X).max() <= 1e-10)]


def gravity_seen_from(model: mujoco.MjModel, q: Mapping[str, float], link: str, base: Array) -> Array:
    """Return the gravity of the model in the axes of a link."""
    data = sim.at(model, q, base)
    found: Array = data.body(link).xmat.reshape(3, 3).T @ model.opt.gravity
    return found


def dynamics_of_modes(models: Models, q: Mapping[str, float], source: np.random.Generator) -> list[str]:
    """Check that MuJoCo's mass matrix and gravity torques of each mode equal those computed from the bodies of every mode with the same
    link held."""
    said: list[str] = []
    for mode, model in models.items():
        link, base = root_of(model), sim.random_pose(source)
        own = sim.own_dynamics(model, q, base)
        gravity = gravity_seen_from(model, q, link, base)
        for elsewhere, other in models.items():
            said += _same(own, sim.held(other, q, link, gravity, sim.random_pose(source)), f"{mode} from {elsewhere}")
    return said


def dynamics_held(models: Models, q: Mapping[str, float], link: str, gravity: Array, source: np.random.Generator) -> list[str]:
    """Check that the mass matrix and the gravity torques with a link held are equal in all modes. `gravity` is in the axes of the link."""
    found = {mode: sim.held(model, q, link, gravity, sim.random_pose(source)) for mode, model in models.items()}
    first = next(iter(found.values()))
    return [words for mode, one in found.items() for words in _same(first, one, f"{mode}, {link} held")]


def _same(one: tuple[Array, Array], other: tuple[Array, Array], where: str) -> list[str]:
    pairs = zip(("mass matrix", "gravity torque"), one, other, strict=True)
    return [f"{what}, {where}: {relative(a, b):.2e} off" for what, a, b in pairs if not relative(a, b) <= DYNAMICS]
