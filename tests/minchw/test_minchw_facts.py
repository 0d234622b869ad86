"""Published facts about MInchW, compared with the robot in the documents. Source: the case study "Magnetic crawler robot" of "Code-based
Design for Consistent Prototyping, Manufacture and Physical Modeling of Multimodal Robots": two coil-regulated permanent magnets of
300 N, six Dynamixel X servos, six 18650 cells, 2.08 kg, 48.5 cm, 26 large components without fasteners and electronics, not perfectly
symmetric, middle section as root."""

from __future__ import annotations

import json
import re
from collections import Counter
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from conformance import simulation as sim
from conformance.harness import ROOT, thingc_here

from .conftest import DOCUMENT, MODES, meshes_in, pose_of


@pytest.fixture(scope="module")
def info(minchw: Path, shared_store: str) -> dict[str, Any]:
    """The output of `thingc info` after the build, so that nothing is built twice."""
    ran = thingc_here("info", DOCUMENT, "--format", "json", store=shared_store, cwd=ROOT)
    assert ran.code == 0, ran.out + ran.err
    return ran.answer


def families(info: dict[str, Any]) -> Counter[str]:
    """Return the number of uses of each family."""
    return Counter(o["definition"].partition("(")[0] for o in info["occurrences"])


def test_twenty_six_large_components(info: dict[str, Any]) -> None:
    found = families(info)
    small = {"thingc_stock.fasteners:Screw", "frame"}
    assert sum(count for family, count in found.items() if family not in small) == 26
    assert found["thingc_stock.dynamixel:XM430"] + found["thingc_stock.dynamixel:XM540"] == 6
    assert found["thingc_stock.magnets:HoldingMagnet"] == 2
    assert found["thingc_stock.cells:Cell18650"] == 6


def test_mass_is_2_08_kg(info: dict[str, Any], models: dict[str, mujoco.MjModel]) -> None:
    assert info["mass"] == pytest.approx(2.08, rel=0.01)
    assert sum(o["mass"] for o in info["occurrences"]) == pytest.approx(info["mass"], rel=1e-12)
    for model in models.values():
        assert float(model.body_mass.sum()) == pytest.approx(info["mass"], rel=1e-12)


def test_at_most_two_fifths_of_the_mass_are_measured_or_estimated(info: dict[str, Any], shared_store: str) -> None:
    shares: Counter[str] = Counter()
    for o in info["occurrences"]:
        shares[o["mass_source"]] += o["mass"] / info["mass"]
    assert set(shares) <= {"vendor", "derived", "estimated", "measured"}
    assert shares.get("measured", 0.0) + shares["estimated"] <= 0.40
    assert shares["estimated"] > 0
    text = thingc_here("info", DOCUMENT, store=shared_store, cwd=ROOT).out
    (line,) = (line for line in text.splitlines() if line.startswith("mass by source"))
    printed = {source: float(share) for source, share in re.findall(r"(\w+) [\d.]+ k?g \(([\d.]+) %\)", line)}
    assert printed == {source: pytest.approx(100 * share, abs=0.051) for source, share in shares.items()}


def test_masses_of_bought_parts_equal_data_sheets(info: dict[str, Any]) -> None:
    said = {"thingc_stock.dynamixel:XM430": 0.082, "thingc_stock.dynamixel:XM540": 0.165, "thingc_stock.cells:Cell18650": 0.047}
    for o in info["occurrences"]:
        if o["definition"] in said:
            assert (o["mass"], o["mass_source"]) == (said[o["definition"]], "vendor")


def test_stretched_length_is_48_5_cm(models: dict[str, mujoco.MjModel], vertices: dict[str, Any]) -> None:
    model = models["front_foot"]
    data = pose_of(model, "stretched")
    placed = sim.parts(model, data)
    body = np.linalg.inv(placed["body"])
    points = []
    for part, mesh in meshes_in(model).items():
        pose = body @ placed[part]
        points.append(vertices[mesh].vertices @ pose[:3, :3].T + pose[:3, 3])
    extent = np.ptp(np.vstack(points), axis=0) * 1000
    assert extent[0] == pytest.approx(485.0, abs=1.0)
    assert extent[1] < 80 and extent[2] < 120


def test_each_foot_pulls_300_n_in_every_mode(models: dict[str, mujoco.MjModel]) -> None:
    for mode, model in models.items():
        for foot in ("front", "rear"):
            magnet = model.actuator(f"{foot}/sole")
            assert magnet.trntype == mujoco.mjtTrn.mjTRN_BODY and model.body(int(magnet.trnid[0])).name == f"{foot}/foot"
            assert magnet.gainprm[0] == 1.0 and tuple(magnet.ctrlrange) == (0.0, 300.0), mode
        assert model.nu == 8
    held = {
        mode: tuple(model.key_ctrl[0][model.actuator(f"{foot}/sole").id] for foot in ("front", "rear"))
        for mode, model in models.items()
    }
    assert set(held) == set(MODES)
    for where in ("", "_wall", "_ceiling"):
        assert held[f"front_foot{where}"] == (300.0, 0.0)
        assert held[f"rear_foot{where}"] == (0.0, 300.0)
    assert held["crawl"] == (0.0, 0.0)
    assert held["crawl_wall"] == held["crawl_ceiling"] == (300.0, 300.0)


def test_robot_is_not_symmetric(info: dict[str, Any], models: dict[str, mujoco.MjModel]) -> None:
    """Neither the masses nor the shape are symmetric about the middle between the soles. The legs are mirror images of each other."""
    model = models["crawl"]
    data = pose_of(model, "stretched")
    front, rear = (data.site(f"{foot}/sole").xpos for foot in ("front", "rear"))
    whole = data.subtree_com[0]
    assert np.abs(whole - (front + rear) / 2)[0] > 1e-4
    assert abs(whole[1]) > 1e-5
    assert abs(front[0] + rear[0]) > 1e-3
    assert np.linalg.norm(front - data.body("front/hip").xpos) == pytest.approx(
        np.linalg.norm(rear - data.body("rear/hip").xpos), abs=1e-12
    )
    ixy, ixz, iyz = info["inertia"][0][1], info["inertia"][0][2], info["inertia"][1][2]
    assert max(abs(ixy), abs(ixz), abs(iyz)) > 1e-6


def graph(text: str) -> tuple[dict[str, str], list[tuple[str, str, str]]]:
    """Parse a DOT text: the label of each node, and (from, to, first line of the label) of every edge, by labels."""
    nodes = dict(re.findall(r'^  (n\d+) \[label="(.*?)" ', text, re.M))
    edges = re.findall(r'^  (n\d+) -> (n\d+) \[label="(.*?)(?:\\n.*?)?"', text, re.M)
    return nodes, [(nodes[a], nodes[b], label) for a, b, label in edges]


def test_assembly_graph_equals_the_published_one(minchw: Path) -> None:
    """A middle section, two legs as nested documents with one definition, and a single node for each shared definition."""
    nodes, edges = graph((minchw / "hag.dot").read_text())
    assert len(set(nodes.values())) == len(nodes)
    assert nodes["n0"] == "minchw"
    first = [(child, label) for parent, child, label in edges if parent == "minchw"]
    assert first[0] == ("minchw.body:Chassis", "body")
    assert {label for child, label in first if child == "leg"} == {"front", "rear"}
    used = Counter(child for _, child, _ in edges)
    assert used["thingc_stock.cells:Cell18650"] == 6
    leg = Counter(child for parent, child, _ in edges if parent == "leg")
    assert leg["thingc_stock.dynamixel:XM540"] == leg["minchw.leg:ThighBrace"] == 2
    assert leg["thingc_stock.magnets:HoldingMagnet"] == leg["minchw.leg:Foot"] == leg["minchw.leg:HipBracket"] == 1
    motion = re.findall(r"joint (\w+):", (minchw / "hag.dot").read_text())
    assert sorted(motion) == ["ankle", "knee", "yaw"]


def test_different_legs_are_two_definitions_with_shared_parts(shared_store: str) -> None:
    ran = thingc_here("hag", DOCUMENT, "--format", "dot", "-p", "rear_leg=80 mm", store=shared_store, cwd=ROOT)
    assert ran.code == 0, ran.err
    nodes, edges = graph(ran.out)
    legs = {child for parent, child, label in edges if parent == nodes["n0"] and label in ("front", "rear")}
    assert len(legs) == 2
    for part in ("thingc_stock.dynamixel:XM540", "minchw.leg:Foot", "thingc_stock.magnets:HoldingMagnet"):
        assert list(nodes.values()).count(part) == 1
        assert {parent for parent, child, _ in edges if child == part} == legs
    braces = [label for label in nodes.values() if label.startswith("minchw.leg:ThighBrace")]
    assert sorted(braces) == ["minchw.leg:ThighBrace", "minchw.leg:ThighBrace(length=80 mm)"]


def test_bill_of_materials_lists_bought_parts(minchw: Path) -> None:
    rows = json.loads((minchw / "bom.json").read_text())
    assert {row["definition"]: row["quantity"] for row in rows if row["make"] == "print"} == {
        "minchw.body:Chassis": 1, "minchw.body:Cover": 1, "minchw.leg:HipBracket": 2, "minchw.leg:ThighBrace": 4,
        "minchw.leg:Foot": 2,
    }
    bought = {row["definition"]: row["quantity"] for row in rows if row["make"] == "buy" and row["supplier"]}
    assert bought == {
        "thingc_stock.dynamixel:XM430": 2, "thingc_stock.dynamixel:XM540": 4, "thingc_stock.cells:Cell18650": 6,
    }
