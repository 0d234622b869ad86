"""Collisions of boxes at known positions, of random primitives against MuJoCo's distances, and of the arm."""

from __future__ import annotations

import re
import shlex
import shutil
import time
from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cli.drawn_positions import record_positions
from testing.rig import HEAD, SLIDERS, Workspace
from thingc.base.diagnostics import shown_path
from thingc.base.pose import Pose
from thingc.base.primitives import Primitive, PrimitiveShape
from thingc.geometry.store.local import Store
from thingc.model.assembly.types import Surface
from thingc.model.solids.shapes import solid_of
from thingc.tools.cli.main import main


@pytest.mark.parametrize(("pose", "gap", "passes"), [
    ("close", 0.4, True), ("touching", 0.0, True), ("overlapping", 0.0, False),
])
def test_two_boxes_on_a_rail(rig: Workspace, pose: str, gap: float, passes: bool) -> None:
    """They are 20 mm wide, `two` to the right of `one`. The mean depth of an overlap of 3 mm is 2V/A = 2*3*20*20 / (2*400 + 4*60)."""
    answer = rig.test(SLIDERS, f"  free: {{no_collision: {{pose: {pose}}}}}\n")
    found = answer["by_name"]["free"]
    assert found["passed"] is passes and found["measured"]["gap"] == pytest.approx(gap / 1000, abs=1e-6)
    if not passes:
        depth = 2 * 3 * 400 / (2 * 400 + 4 * 60)
        assert found["measured"]["overlap"] == pytest.approx(depth / 1000, rel=1e-4)
        message = answer["diagnostics"][0]["message"]
        assert f"`left` and `right` overlap by {depth:.4g} mm on average (1200 mm^3)" in message


def test_overlap_within_mesh_tolerance_is_ignored(rig: Workspace) -> None:
    """The tolerance of the workspace is 0.1 mm: two surfaces may deviate by 0.2 mm together."""
    for two, passes in (("19.85 mm", True), ("19.7 mm", False)):
        text = SLIDERS.replace("touching: {two: 20 mm}", f"touching: {{two: {two}}}")
        assert rig.test(text, "  free: {no_collision: {pose: touching}}\n")["by_name"]["free"]["passed"] is passes


def test_insufficient_clearance_is_reported_with_the_gap(rig: Workspace) -> None:
    answer = rig.test(SLIDERS, "  free: {no_collision: {pose: [apart, close], clearance: 1 mm}}\n")
    assert [result["passed"] for result in answer["tests"]] == [True, False]
    said = answer["diagnostics"][0]
    assert said["code"] == "TC655" and said["line"] == (rig.folder / "rig.yaml").read_text().count("\n")
    message = "test `free` (mode `bench`, pose `close`): the gap between `left` and `right` (0.4 mm) is below the minimum (1 mm)"
    assert said["message"] == message
    intended, _, command = said["help"].partition("; ")
    assert intended == 'if this is intended, add `allow: [{pair: [left, right], reason: "..."}]`'
    assert command == f"to draw this position, run `thingc render {shown_path(str(rig.folder / 'rig.yaml'))} --mode bench --pose close`"


def test_command_in_the_help_draws_the_worst_position(rig: Workspace, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    tests = "  sweep: {no_collision: {pose: close, joints: {one: [-100 mm, 100 mm]}, samples: 101}}\n"
    answer = rig.test(SLIDERS, tests)
    command = re.search("run `thingc (.*)`$", answer["diagnostics"][0]["help"])
    assert command is not None and answer["diagnostics"][0]["message"].endswith(" at one = 20 mm")
    drawn = record_positions(monkeypatch)
    assert main([*shlex.split(command[1]), "-o", str(tmp_path / "touches.png")]) == 0
    assert drawn == [pytest.approx([0.02, 0.0204])]


def test_box_inside_a_box_is_found(rig: Workspace) -> None:
    """Their surfaces do not intersect."""
    text = SLIDERS.replace("right: {part: rig_parts:Block}", "right: {part: rig_parts:Block, params: {x: 90 mm, y: 90 mm, z: 90 mm}}")
    answer = rig.test(text, "  free: {no_collision: {joints: {one: [0, 0.001 mm]}, samples: 1, pose: close}}\n")
    assert not answer["by_name"]["free"]["passed"]


def test_sweep_finds_the_worst_position(rig: Workspace) -> None:
    """`one` moves from -100 to 100 mm in steps of 2 mm past `two`, which is at 50 mm."""
    answer = rig.test(SLIDERS, "  sweep: {no_collision: {joints: {one: [-100 mm, 100 mm]}, samples: 101}}\n"
                               "  part_of_it: {no_collision: {joints: {one: [-100 mm, 29 mm]}, samples: 130}}\n")
    assert answer["diagnostics"][0]["message"].endswith(" at one = 50 mm")
    assert answer["by_name"]["sweep"]["measured"]["positions"] == 101
    free = answer["by_name"]["part_of_it"]
    assert free["passed"] and free["measured"]["gap"] == pytest.approx(0.001, abs=1e-6)


def test_allowed_pairs(rig: Workspace) -> None:
    tests = (
        "  meant: {no_collision: {pose: overlapping, allow: [{pair: [left, right], reason: they are glued}]}}\n"
        "  never: {no_collision: {pose: apart, allow: [{pair: [left, '*ight'], reason: they might}]}}\n"
    )
    answer = rig.test(SLIDERS, tests)
    assert answer["code"] == 0 and all(result["passed"] for result in answer["tests"])
    assert [(d["code"], d["severity"]) for d in answer["diagnostics"]] == [("TC659", "warning")]
    assert answer["diagnostics"][0]["notes"][0]["message"] == "reason for the allowance: they might"
    assert rig.test(SLIDERS + 'allow: {TC610: "they lie in the floor"}\n', tests, "--strict")["code"] == 1


NEIGHBOURS = HEAD + """\
components:
  base: {part: rig_parts:Block}
  rigid: {part: rig_parts:Block, at: {in: base.origin, xyz: 0 RIGID 0 mm}}
  slider: {part: rig_parts:Block}
joints:
  slide: {type: prismatic, parent: base.right, child: slider.left, limit: {lower: 0, upper: 200 mm}}
poses: {near: {slide: SLIDE mm}}
modes: {bench: {root: base, pose: near}}
"""
"""20 mm cubes: `rigid` is next to `base` on the same link, `slider` is next to it across a joint."""


def neighbours(rigid: int, slide: int) -> str:
    return NEIGHBOURS.replace("RIGID", str(rigid)).replace("SLIDE", str(slide))


@pytest.mark.parametrize(("rigid", "slide", "pair"), [
    (20, 20, None), (15, 20, "`base` and `rigid`"), (20, 15, "`base` and `slider`"),
])
def test_adjacent_parts_may_touch_but_not_overlap(rig: Workspace, rigid: int, slide: int, pair: str | None) -> None:
    """The mean depth of an overlap of 5 mm is 2V/A = 2*5*400 / (2*400 + 4*100)."""
    answer = rig.test(neighbours(rigid, slide), "  free: {no_collision: {clearance: 3 mm}}\n")
    found = answer["by_name"]["free"]
    assert found["passed"] is (pair is None) and found["measured"]["pairs"] == 3 and "skipped" not in found["measured"]
    if pair is not None:
        assert found["measured"]["overlap"] == pytest.approx(4e-3 / 1.2, rel=1e-4)
        assert f"{pair} overlap by 3.333 mm on average (2000 mm^3)" in answer["diagnostics"][0]["message"]
        assert "allow: {TC520" in answer["diagnostics"][0]["help"]


@pytest.mark.parametrize(("written", "rigid", "pair"), [
    ("rigid: {", 15, "base and rigid"), ("base: {", 15, "base and rigid"), ("slide: {", 20, "base and slider"),
])
def test_declared_overlap_is_listed_with_its_reason(rig: Workspace, written: str, rigid: int, pair: str) -> None:
    """The overlap is declared on either component, or on the joint between them."""
    text = neighbours(rigid, 15 if pair.endswith("slider") else 20).replace(written, written + "allow: {TC520: a press fit}, ", 1)
    found = rig.test(text, "  free: {no_collision: {}}\n")["by_name"]["free"]
    assert found["passed"] and found["measured"]["skipped"] == {"allowed: a press fit": [pair]}


def test_declared_overlap_does_not_skip_other_pairs(rig: Workspace) -> None:
    text = neighbours(15, 15).replace("slide: {", "slide: {allow: {TC520: a press fit}, ", 1)
    answer = rig.test(text, "  free: {no_collision: {}}\n  rest: {no_collision: {allow: [{pair: [base, rigid], reason: glued}]}}\n")
    assert [result["passed"] for result in answer["tests"]] == [False, True]
    assert "`base` and `rigid` overlap" in answer["diagnostics"][0]["message"] and answer["diagnostics"][0]["notes"] == []


def test_sweep_compares_adjacent_parts_at_every_position(rig: Workspace) -> None:
    """The worst position is where both coincide."""
    answer = rig.test(neighbours(20, 20), "  free: {no_collision: {joints: {slide: all}, samples: 21}}\n")
    message = answer["diagnostics"][0]["message"]
    assert "`base` and `slider` overlap" in message and message.endswith("(8000 mm^3) at slide = 0 mm")


SIZES: dict[PrimitiveShape, int] = {"box": 3, "sphere": 1, "capsule": 2, "cylinder": 2, "ellipsoid": 3}
"""Bounded shapes and the number of their size parameters."""


def test_distances_of_random_primitives_match_mujoco(tmp_path: Path) -> None:
    """20 pairs with random poses: `mj_geomDistance` is exact for separate convex shapes. Some of our shapes have facets."""
    source = np.random.default_rng(11)
    store = Store(str(tmp_path))
    apart = together = 0
    for _ in range(20):
        shapes = [str(shape) for shape in source.choice(list(SIZES), 2)]
        sizes = [source.uniform(0.005, 0.03, SIZES[shape]) for shape in shapes]
        places, turns = source.uniform(-0.05, 0.05, (2, 3)), Rotation.random(2, rng=source)
        geoms = "".join(
            f'<body pos="{" ".join(map(str, p))}" quat="{" ".join(map(str, t.as_quat(scalar_first=True)))}">'
            f'<geom type="{shape}" size="{" ".join(map(str, s))}" mass="1"/></body>'
            for shape, p, t, s in zip(shapes, places, turns, sizes, strict=True)
        )
        model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{geoms}</worldbody></mujoco>")
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        expected = mujoco.mj_geomDistance(model, data, 0, 1, 1.0, None)
        solids, boxes = [], []
        for shape, p, t, s in zip(shapes, places, turns, sizes, strict=True):
            pose = Pose(rotation=tuple(map(tuple, t.as_matrix().tolist())), translation=tuple(p.tolist()))
            surface = Surface(solid=Primitive(shape=shape, size=tuple(s.tolist())), material=None, color=None)
            solid = solid_of(store, [surface])
            assert solid is not None
            solids.append(solid.at(pose))
            boxes.append(solid.box(pose))
        off = 1e-6 + 1e-3 * sum(max(s) for shape, s in zip(shapes, sizes, strict=True) if shape in ("cylinder", "ellipsoid"))
        gap = solids[0].gap(solids[1], 0.02)
        assert gap == pytest.approx(min(max(expected, 0.0), 0.02), abs=off)
        between = np.maximum(boxes[1][0] - boxes[0][1], boxes[0][0] - boxes[1][1])
        assert min(float(np.linalg.norm(np.maximum(between, 0.0))), 0.02) <= gap + 1e-9
        apart += 0 < expected < 0.02
        together += expected < 0
        assert (solids[0].overlap(solids[1])[0] > 0) == (expected < 0) or abs(expected) < 5e-5
    assert apart > 5 and together > 2


def test_fifty_positions_of_the_arm_take_seconds(root: Path, rig: Workspace) -> None:
    shutil.copytree(root / "assemblies", rig.folder / "assemblies")
    shutil.copytree(root / "parts", rig.folder / "parts", dirs_exist_ok=True)
    document = rig.folder / "assemblies" / "arm.yaml"
    text = document.read_text().partition("\ntests:")[0]
    document.write_text(f"{text}\ntests:\n  sweep: {{no_collision: {{joints: {{'*': all}}, samples: 50}}}}\n")
    started = time.process_time()  # of this process alone, whatever else the machine does
    code, out, _ = rig.run(str(document))
    assert time.process_time() - started < 8
    assert code == 1 and "TC655" in out and "50 positions" in out
