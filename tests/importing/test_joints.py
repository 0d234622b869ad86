"""`thingc joints` finds the joints of generated robots, accepts no wrong joint automatically, and moves no part by writing them."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import pytest
from build123d import Box, Compound, Cylinder, Pos, Rot, export_step

import thingc
from thingc.base.pose import Pose

BENCHMARK = Path(__file__).resolve().parents[2] / "benchmarks" / "step"


def named(shape: Any, label: str) -> Any:
    one = shape.solid()
    one.label = label
    return one


def crane() -> Compound:
    """Return a tower with a bolted foot, a boom that turns about a separate pin, and a trolley that slides in the boom."""
    foot, tower, screws = Pos(0, 0, -3) * Box(40, 40, 6), Pos(0, 0, 20) * Box(10, 16, 40), []
    tower += Pos(0, 0, 2) * Box(40, 40, 4)
    for x, y in ((-15, -15), (-15, 15), (15, -15), (15, 15)):
        hole = Pos(x, y, 0) * Cylinder(1.6, 20)
        foot, tower = foot - hole, tower - hole
        screws.append(named(Pos(x, y, 0) * (Pos(0, 0, -1) * Cylinder(1.5, 10) + Pos(0, 0, 5.5) * Cylinder(3, 3)), "fixing"))
    pin = Pos(0, 0, 34) * Rot(90, 0, 0) * Cylinder(2, 40)
    tower -= pin
    boom = Pos(40, 0, 34) * Box(100, 40, 12) - Pos(0, 0, 34) * Box(30, 16, 12) - pin - Pos(65, 0, 34) * Box(60, 10, 6)
    trolley = Pos(80, 0, 34) * Box(40, 10, 6)
    return Compound(label="crane", children=[
        named(foot, "foot"), named(tower, "tower"), *screws, named(boom, "boom"), named(pin, "pivot"), named(trolley, "trolley"),
    ])


def rest(document: str, store: str) -> dict[str, Pose]:
    assembly = thingc.compile(document, store=store).assembly
    return {one.path: assembly.rest[one.index] for one in assembly.occurrences}


def test_joints_of_a_crane_are_proposed_and_written(run: Any, tmp_path: Path, shared_store: str) -> None:
    export_step(crane(), tmp_path / "crane.step")
    assert run("import", "crane.step")[0] == 0
    before = rest("crane/crane.yaml", shared_store)
    code, said = run("joints", "crane/crane.yaml", "--format", "json")
    found = {one["name"]: one for one in json.loads(said)["proposals"]}
    assert code == 0 and {name: (one["type"], one["doubt"]) for name, one in found.items()} == {
        "tower_to_boom": ("revolute", None), "boom_to_trolley": ("prismatic", None),
        "foot_to_tower": ("revolute", "a bolt circle also fits a rigid connection"),
    }
    assert found["tower_to_boom"]["axis"] == pytest.approx([0, 1, 0]) and found["boom_to_trolley"]["axis"] == pytest.approx([1, 0, 0])
    code, said = run("joints", "crane/crane.yaml", "--write")
    assert code == 0 and "joints.tower_to_boom" in said, said
    assert run("check", "crane/crane.yaml")[0] == 0
    after = rest("crane/crane.yaml", shared_store)
    for name, pose in before.items():
        assert after[name].translation == pytest.approx(pose.translation, abs=1e-9)
        assert sum(after[name].rotation, ()) == pytest.approx(sum(pose.rotation, ()), abs=1e-9)
    links = {frozenset(link.members) for link in thingc.compile("crane/crane.yaml", store=shared_store).assembly.links}
    paths = [*after]
    groups = {frozenset(paths[k] for k in link) for link in links}
    assert {"trolley"} in groups and any({"foot", "tower"} <= group for group in groups) and any("boom" in group for group in groups)
    assert len(groups) == 3
    code, said = run("joints", "crane/crane.yaml")
    assert code == 0 and said.startswith("foot_to_tower ") and said.count("\n") == 1


def test_doubtful_joint_is_written_only_by_name(run: Any, tmp_path: Path) -> None:
    plates = [Pos(0, 0, z) * Box(20, 20, 4) - Cylinder(1.6, 40) for z in (0, 4)]
    screw = Pos(0, 0, 2) * Cylinder(1.5, 8) + Pos(0, 0, 7.5) * Cylinder(3, 3)
    parts = [named(plates[0], "lower"), named(plates[1], "upper"), named(screw, "M3 screw")]
    export_step(Compound(label="rig", children=parts), tmp_path / "rig.step")
    assert run("import", "rig.step")[0] == 0
    code, said = run("joints", "rig/rig.yaml")
    assert code == 0 and "lower_to_upper" in said and "doubt: `M3_screw` may fasten the parts" in said
    text = (tmp_path / "rig/rig.yaml").read_text()
    assert run("joints", "rig/rig.yaml", "--write") == (0, "no unambiguous proposals\n")
    assert (tmp_path / "rig/rig.yaml").read_text() == text
    code, said = run("joints", "rig/rig.yaml", "lower_to_uper", "--write")
    assert code == 2 and "there is no proposed joint `lower_to_uper`" in said and "lower_to_upper" in said
    assert run("joints", "rig/rig.yaml", "lower_to_upper")[0] == 2
    assert run("joints", "rig/rig.yaml", "lower_to_upper", "--write")[0] == 0
    assert "type: continuous" in (tmp_path / "rig/rig.yaml").read_text() and run("check", "rig/rig.yaml")[0] == 0


@pytest.mark.slow
def test_joints_of_the_arm_are_recovered_from_step(run: Any, tmp_path: Path, root: Path, shared_store: str) -> None:
    """The STEP file of the arm has no joints. After the import, the proposed joints equal those of the document."""
    arm = str(root / "assemblies" / "arm.yaml")
    assert run("build", arm, "--emit", "step", "-o", "build")[0] == 0
    assert run("import", "build/arm/step/arm.step", "-o", "out")[0] == 0
    code, said = run("joints", "out/arm.yaml", "--write")
    assert code == 0 and said.count("joints.") == 4, said

    def links(document: str) -> set[frozenset[str]]:
        assembly = thingc.compile(document, store=shared_store).assembly
        solid = [one.record is not None and one.record.box is not None for one in assembly.occurrences]
        return {frozenset(assembly.occurrences[k].path for k in link.members if solid[k]) for link in assembly.links}

    assert links("out/arm.yaml") == links(arm)


@pytest.mark.slow
def test_joints_of_random_robots_are_recovered(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(BENCHMARK))
    for name in ("robots", "study"):  # of another benchmark
        monkeypatch.delitem(sys.modules, name, raising=False)
    from robots import CONNECTIONS, generate
    from study import Results

    results = Results(tmp_path)
    connections = set()
    for seed in (1, 2, 9):
        robot, joints = generate(seed)
        connections |= {joint.connection for joint in joints}
        export_step(robot, tmp_path / f"robot{seed}.step")
        results.add(tmp_path / f"robot{seed}.step", joints)
    sys.modules.pop("robots"), sys.modules.pop("study")
    assert connections == {*CONNECTIONS} - {"bolted"}, "which is no joint, and is in the second robot"
    assert results.table() == 0
