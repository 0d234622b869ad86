"""Twelve roots of one robot: properties that must not depend on the root are equal for MInchW, as for the arm."""

from __future__ import annotations

import json
from itertools import combinations
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

import thingc
from conformance import roots, simulation as sim
from conformance.harness import ROOT, thingc_here

from .conftest import DOCUMENT

ROOTS = {"front_foot": "front/foot", "rear_foot": "rear/foot", "crawl": "body", "bridge": "front/foot"}
WHERE = {"": (0.0, 0.0, -9.81), "_wall": (-9.81, 0.0, 0.0), "_ceiling": (0.0, 0.0, 9.81)}
MODES = {f"{mode}{where}": root for mode, root in ROOTS.items() for where in WHERE}
"""The root link of each mode."""

LEGS = ("front", "rear")
JOINTS = [f"{leg}/{joint}" for leg in LEGS for joint in ("ankle", "knee", "yaw")]
LINKS = sorted(["body", *(f"{leg}/{link}" for leg in LEGS for link in ("hip", "thigh", "foot"))])
FRAMES = {"controller", "magnet_driver", "harness"}
"""Components with a pose and a mass that are not visible."""


@pytest.fixture(scope="module")
def every(minchw: Path) -> dict[str, mujoco.MjModel]:
    """The model of each mode without a floor."""
    return {mode: mujoco.MjModel.from_xml_path(str(minchw / "mjcf" / f"minchw_{mode}.xml")) for mode in MODES}


@pytest.fixture(scope="module")
def trees(minchw: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((minchw / "modes.json").read_text())
    return found


@pytest.fixture(scope="module")
def compiled(minchw: Path, shared_store: str) -> thingc.Compiled:
    """The robot, compiled by the Python API. Every part is in the store."""
    found = thingc.compile(str(ROOT / DOCUMENT), store=shared_store)
    assert found.modelled == ()
    return found


@pytest.fixture(scope="module")
def info(minchw: Path, shared_store: str) -> dict[str, Any]:
    ran = thingc_here("info", DOCUMENT, "--format", "json", store=shared_store, cwd=ROOT)
    assert ran.code == 0
    return ran.answer


def test_exactly_the_modes_have_models(minchw: Path, every: dict[str, mujoco.MjModel], trees: dict[str, Any]) -> None:
    assert {path.stem for path in (minchw / "mjcf").glob("minchw_*.xml")} == {f"minchw_{mode}" for mode in MODES}
    assert {mode for mode, tree in trees.items() if isinstance(tree, dict)} == set(MODES)
    for mode, model in every.items():
        assert roots.root_of(model) == MODES[mode]
        assert tuple(model.opt.gravity) == next(g for where, g in reversed(WHERE.items()) if mode.endswith(where))


def test_links_are_equal_in_all_modes(every: dict[str, mujoco.MjModel]) -> None:
    assert sim.links(every["crawl"]) == LINKS and sim.joints(every["crawl"]) == JOINTS
    assert roots.links(every) == []


def test_excluded_pairs_are_equal_in_all_modes(every: dict[str, mujoco.MjModel]) -> None:
    expected = {
        frozenset(pair) for leg in LEGS
        for pair in (("body", f"{leg}/hip"), (f"{leg}/hip", f"{leg}/thigh"), (f"{leg}/thigh", f"{leg}/foot"))
    }
    for model in every.values():
        assert roots.excluded(model) == expected
        assert model.nexclude == len(expected)


def test_poses_and_sums_agree_in_all_modes(every: dict[str, mujoco.MjModel]) -> None:
    """The relative poses of all parts and sites, and the total mass, centre and inertia."""
    source = np.random.default_rng(20)
    assert len(sim.parts(every["crawl"], sim.at(every["crawl"], {}))) == 26 + 12  # the components, and their screws
    for _ in range(20):
        q = roots.angles(every["crawl"], source)
        assert roots.poses(every, q, source) == []
        assert roots.whole(every, q, "body", source) == []


def test_mass_and_inertia_equal_those_of_info_and_api(
    every: dict[str, mujoco.MjModel], info: dict[str, Any], compiled: thingc.Compiled
) -> None:
    found = compiled.properties
    said = {"info": (info["mass"], info["centre"], info["inertia"]), "API": (found.mass, found.centre, found.inertia)}
    assert roots.said_of_all(every, "body", said) == []
    assert roots.said_of_links(every, info["occurrences"]) == []


def test_part_poses_at_rest_equal_those_of_the_api(every: dict[str, mujoco.MjModel], compiled: thingc.Compiled) -> None:
    assembly = compiled.assembly
    rest = {o.path: np.array(assembly.rest[o.index].rows()) for o in assembly.occurrences if o.path not in FRAMES}
    assert roots.at_rest(every, "body", rest) == []


def test_kinematics_of_modes_json(trees: dict[str, Any], every: dict[str, mujoco.MjModel]) -> None:
    """Exactly the joints from the held foot to the body are reversed."""
    source = np.random.default_rng(3)
    for mode, model in every.items():
        turned = {joint["name"] for joint in trees[mode]["joints"] if joint["reversed"]}
        assert turned == {joint for joint in JOINTS if joint.partition("/")[0] == MODES[mode].partition("/")[0]}
        assert roots.described(trees[mode], model, roots.angles(model, source)) == []


def test_dynamics_with_a_held_link_equal_those_of_its_mode(every: dict[str, mujoco.MjModel]) -> None:
    source = np.random.default_rng(9)
    for _ in range(3):
        assert roots.dynamics_of_modes(every, roots.angles(every["crawl"], source), source) == []


def test_dynamics_with_any_held_link_agree_in_all_modes(every: dict[str, mujoco.MjModel]) -> None:
    source = np.random.default_rng(10)
    for link in LINKS:
        q, gravity = roots.angles(every["crawl"], source), source.normal(size=3)
        assert roots.dynamics_held(every, q, link, gravity, source) == []


def test_modes_with_different_roots_have_different_dynamics(every: dict[str, mujoco.MjModel]) -> None:
    source = np.random.default_rng(11)
    q, gravity = roots.angles(every["crawl"], source), np.array([3.0, 5.0, -8.0])
    placed = sim.at(every["crawl"], q)
    found = {
        link: sim.held(every["crawl"], q, link, placed.body(link).xmat.reshape(3, 3).T @ gravity, np.eye(4))
        for link in ("front/foot", "rear/foot", "body")
    }
    for one, other in combinations(found, 2):
        assert all(roots.relative(a, b) > 1e-2 for a, b in zip(found[one], found[other], strict=True)), (one, other)
