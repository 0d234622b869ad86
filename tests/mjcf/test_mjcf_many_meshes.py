"""Verification with many meshes: above a limit, MuJoCo reads them one by one, and the diagnostics stay the same."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy
import pytest
import trimesh

from thingc.targets.mjcf import verify
from thingc.targets.mjcf.accepted_models import changes_meshes
from thingc.targets.xml_writer import Element
from thingc.tools.cli.main import main

DOCUMENT = """thingc: assembly/1
name: heap
components:
  base:
    link: true
    mass: 1 kg
    shapes: [{mesh: meshes/egg.stl, unit: mm, scale: [1, -1, 1.2]}]
    mounts:
      hip: {xyz: 0 30 0 mm, rpy: 20 0 30 deg}
  arm:
    link: true
    mass: 1 kg
    shapes: [{mesh: meshes/egg.obj, unit: m}, {mesh: meshes/egg.stl, unit: m, scale: 0.001, for: visual}]
    mounts:
      wrist: {xyz: 10 -5 5 mm}
  hand:
    link: true
    mass: 1 kg
    shapes: [{mesh: meshes/egg.obj, unit: cm, scale: 60}]
joints:
  turn: {type: revolute, parent: base.hip, child: arm.origin, axis: [0, 0, 1], limit: {lower: -1 rad, upper: 1 rad}}
  grip: {type: revolute, parent: arm.wrist, child: hand.origin, axis: [0, 0, 1], limit: {lower: -1 rad, upper: 1 rad}}
modes:
  bench: {root: base, base: fixed, at: {xyz: 0 0 1 m}}
"""


@pytest.fixture
def heap(tmp_path: Path) -> Path:
    """A document with asymmetric dented eggs that overlap at the start."""
    egg = trimesh.creation.icosphere(3, 0.04)
    x, y, z = egg.vertices.T
    egg.vertices = egg.vertices * (1.0 + 0.2 * numpy.sin(90.0 * x + 40.0 * y) * numpy.cos(70.0 * z))[:, None] + (0.02, 0.01, 0.0)
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "egg.obj").write_text(egg.export(file_type="obj"))
    (tmp_path / "meshes" / "egg.stl").write_bytes(egg.apply_scale(1000.0).export(file_type="stl"))
    (tmp_path / "heap.yaml").write_text(DOCUMENT)
    return tmp_path / "heap.yaml"


class Said:
    """Diagnostics of a build with an empty store, and the sizes of the files in each compilation by MuJoCo."""

    def __init__(self, document: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
        self.given: list[list[int]] = []
        true = verify.in_memory

        def sized(data: dict[str, bytes]) -> Any:
            self.given.append(sorted(map(len, data.values())))
            return true(data)

        with tempfile.TemporaryDirectory() as folder, monkeypatch.context() as patched:
            patched.setattr(verify, "in_memory", sized)
            self.code = main(["build", str(document), "--emit", "mjcf", "--store", folder])
        self.text = capsys.readouterr().err


def test_diagnostics_ignore_the_mesh_count(heap: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """This includes penetration depths, for which MuJoCo computes the hulls again."""
    at_once = Said(heap, capsys, monkeypatch)
    assert len(at_once.given) == 1 and at_once.code == 0
    said = "warning[TC611]: the collision shapes of `base` and `hand` overlap by 10.2 mm at the start of mode `bench`"
    assert said in at_once.text
    monkeypatch.setattr(verify, "MAX_MESH_BYTES", 0)
    apart = Said(heap, capsys, monkeypatch)
    assert apart.text == at_once.text and apart.code == 0
    *each, boxes, hulls = apart.given
    assert [len(one) for one in each] == [1] * len(hulls)
    assert max(boxes) < 700 and not {*hulls} & {one for (one,) in each}, "and of what is only drawn a tetrahedron"


def test_distant_parts_are_checked_with_boxes(heap: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """Parts that are far apart are checked with bounding boxes, without their hulls."""
    heap.write_text(DOCUMENT.replace("wrist: {xyz: 10 -5 5 mm}", "wrist: {xyz: 10 200 5 mm}"))
    monkeypatch.setattr(verify, "MAX_MESH_BYTES", 0)
    apart = Said(heap, capsys, monkeypatch)
    assert apart.code == 0 and "TC611" not in apart.text and max(apart.given[-1]) < 700


def test_errors_do_not_depend_on_the_mesh_count(heap: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    heap.write_text(DOCUMENT + "raw: {mjcf: {joint: {turn: {solimplimit: 1 2 3 4 5 6 7}}}}\n")
    at_once = Said(heap, capsys, monkeypatch)
    assert at_once.code == 1 and "error[TC702]" in at_once.text and len(at_once.given) == 1
    monkeypatch.setattr(verify, "MAX_MESH_BYTES", 0)
    apart = Said(heap, capsys, monkeypatch)
    assert apart.text == at_once.text
    assert {*apart.given[-1][1:]} == {*at_once.given[0]}, "what touches is read as it is, once more"


def test_initial_state_check_is_repeatable(heap: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """Drives are checked with contacts disabled. A second check must see the contacts again."""
    seen: list[int] = []
    true = verify.initial_state_checks.check_state

    def twice(model: Any, robot: Any) -> Any:
        found = [true(model, robot) for _ in range(2)]
        seen.extend(len(one.overlaps) for one in found)
        return found[0]

    monkeypatch.setattr(verify.initial_state_checks, "check_state", twice)
    Said(heap, capsys, monkeypatch)
    first, *others = seen
    assert first > 0 and others == [first]


@pytest.mark.parametrize(("tag", "key", "about"), [
    ("mesh", "inertia", True), ("geom", "type", True), ("geom", "friction", False), ("body", "gravcomp", False),
])
def test_raw_attributes_that_affect_meshes_are_recognized(tag: str, key: str, about: bool) -> None:
    changed = Element(tag=tag, raw={key: None})  # type: ignore[dict-item]
    assert changes_meshes(Element(tag="mujoco", children=[Element(tag="worldbody", children=[changed])])) == about
