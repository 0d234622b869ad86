"""Levels of detail: simulation models omit shapes, and other properties do not change."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest

import thingc
from collision.test_collision_shapes import built, model_of, workspace
from thingc.targets.artifact import Artifacts
from thingc.tools.cli.main import main

HAND = """\
thingc: assembly/1
name: hand
materials: {steel: {density: 7800 kg/m^3}}
components:
  palm: {link: true, material: steel, shapes: [{box: 60 40 20 mm}], mounts: {tip: {xyz: 30 0 0 mm}}}
  bolt: {link: true, material: steel, shapes: [{cylinder: {radius: 2 mm, length: 12 mm}}], at: {in: palm.tip}, detail: [fasteners]}
"""

ROBOT = """\
thingc: assembly/1
name: robot
materials: {steel: {density: 7800 kg/m^3}}
components:
  foot: {link: true, material: steel, shapes: [{box: 90 90 30 mm}], mounts: {top: {xyz: 0 0 15 mm}, side: {xyz: 45 0 0 mm}}}
  cover: {part: parts:Bracket, at: {in: foot.side}, detail: [cosmetic]}
  left: {assembly: hand.yaml, detail: [hands]}
  right: {assembly: hand.yaml, at: {in: left.palm.tip, xyz: 0 100 0 mm}, mirror: y}
joints: {turn: {type: continuous, parent: foot.top, child: left.palm.origin}}
modes: {bench: {root: foot}, adrift: {root: left.palm, base: free}}
"""
MJCF, URDF = "mjcf/robot_bench.xml", "urdf/robot_bench.urdf"
ALL = {"foot", "cover", "left/palm", "left/bolt", "right/palm", "right/bolt"}


def drawn(made: dict[str, Artifacts], file: str) -> set[str]:
    """Return the components with visual or collision shapes in an XML file."""
    text = made[file.partition("/")[0]].files[file]
    assert isinstance(text, bytes)
    names = {one.get("name", "") for tag in ("geom", "visual", "collision") for one in ET.fromstring(text).iter(tag)}
    return {name for name in ALL if any(one.split(":")[0] in (name, f"{name}_visual", f"{name}_collision") for one in names)}


@pytest.mark.parametrize(("detail", "omitted"), [
    ("sim: -fasteners", {"left/bolt", "right/bolt"}),
    ("sim: [-cosmetic, -hands]", {"cover", "left/palm", "left/bolt"}),
    ("sim: -cosmetic, mjcf: [-fasteners], urdf: none", {"left/bolt", "right/bolt"}),
])
def test_omitted_shapes_do_not_change_masses(tmp_path: Path, shared_store: str, detail: str, omitted: set[str]) -> None:
    workspace(tmp_path)
    tmp_path.joinpath("hand.yaml").write_text(HAND)
    _, full = built(tmp_path, ROBOT, shared_store, ("mjcf", "urdf", "stl"))
    _, less = built(tmp_path, f"{ROBOT}detail: {{{detail}}}\n", shared_store, ("mjcf", "urdf", "stl"))
    assert drawn(full, MJCF) == drawn(full, URDF) == ALL and drawn(less, MJCF) == ALL - omitted
    assert drawn(less, URDF) == (ALL if "urdf" in detail else ALL - omitted)
    assert full["stl"].files == less["stl"].files
    for mode in ("bench", "adrift"):
        a, b = model_of(full["mjcf"], f"robot_{mode}"), model_of(less["mjcf"], f"robot_{mode}")
        assert a.nbody == b.nbody and a.ngeom > b.ngeom
        for field in ("body_mass", "body_ipos", "body_inertia", "body_iquat", "site_pos"):
            np.testing.assert_allclose(getattr(a, field), getattr(b, field), rtol=1e-12, atol=1e-15, err_msg=field)


def test_modes_omit_levels_in_addition(tmp_path: Path, shared_store: str) -> None:
    workspace(tmp_path)
    tmp_path.joinpath("hand.yaml").write_text(HAND)
    _, full = built(tmp_path, ROBOT, shared_store, ("mjcf", "urdf", "stl"))
    _, less = built(tmp_path, f"{ROBOT}detail: {{urdf: -fasteners, modes: {{bench: -hands}}}}\n", shared_store, ("mjcf", "urdf", "stl"))
    hands = {"left/palm", "left/bolt"}
    assert drawn(less, MJCF) == ALL - hands and drawn(less, "mjcf/robot_adrift.xml") == ALL
    assert drawn(less, URDF) == ALL - hands - {"right/bolt"} and drawn(less, "urdf/robot_adrift.urdf") == ALL - {"left/bolt", "right/bolt"}
    assert full["stl"].files == less["stl"].files
    a, b = model_of(full["mjcf"], "robot_bench"), model_of(less["mjcf"], "robot_bench")
    for field in ("body_mass", "body_ipos", "body_inertia", "body_iquat", "site_pos"):
        np.testing.assert_allclose(getattr(a, field), getattr(b, field), rtol=1e-12, atol=1e-15, err_msg=field)


def test_single_build_can_omit_a_level(tmp_path: Path, shared_store: str, capsys: pytest.CaptureFixture[str]) -> None:
    workspace(tmp_path)
    tmp_path.joinpath("hand.yaml").write_text(HAND)
    document = tmp_path / "robot.yaml"
    document.write_text(ROBOT)
    command = ["build", str(document), "--emit", "sdf", "--store", shared_store, "--output", str(tmp_path / "out")]
    assert main([*command, "--set", "detail.sim=-hands"]) == 0
    names = {one.get("name") for one in ET.fromstring((tmp_path / "out/robot/sdf/robot_bench/model.sdf").read_text()).iter("visual")}
    assert names == {"foot_visual", "cover_visual", "right_palm_visual", "right_bolt_visual"}
    capsys.readouterr()
    document.write_text(f"{ROBOT}detail: {{sim: -fastener, usd: cosmetic, modes: {{benches: -hands}}}}\n")
    assert main(["check", str(document), "--store", shared_store]) == 1
    shown = capsys.readouterr()
    omit = "write `-cosmetic` to omit this level of detail"
    for words in ("no component has the level of detail `fastener`", "did you mean `fasteners`?", omit, "there is no mode `benches`"):
        assert words in shown.out + shown.err


def test_variants_omit_levels_or_none(tmp_path: Path) -> None:
    tmp_path.joinpath("hand.yaml").write_text(HAND)
    text = "thingc: variants/1\nname: hands\nassembly: hand.yaml\nparameters: {detail.sim: [-fasteners, none]}\n"
    tmp_path.joinpath("hands.yaml").write_text(text)
    with thingc.family(tmp_path / "hands.yaml", store=str(tmp_path / "store")) as family:
        models = {variant.choices.get("detail.sim"): family.model(variant) for variant in family.variants}
    assert {levels: model and model.ngeom for levels, model in models.items()} == {"-fasteners": 2, "none": 4}


def test_many_levels_of_nested_documents_are_read_once(tmp_path: Path, shared_store: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Each of 40 documents nests the next one twice, so the levels must be found without a visit of each of the 2^39 bolts."""
    workspace(tmp_path)
    head = "thingc: assembly/1\nname: d{k}\ncomponents:\n  base: {{frame: true}}\n"
    nested = "  a: {{assembly: d{n}.yaml, at: {{in: base.origin}}}}\n  b: {{assembly: d{n}.yaml, at: {{in: base.origin}}}}\n"
    for k in range(40):
        tail = nested.format(n=k + 1) if k < 39 else "  bolt: {frame: true, at: {in: base.origin}, detail: [fasteners]}\n"
        (tmp_path / f"d{k}.yaml").write_text(head.format(k=k) + tail + ("detail: {sim: -fastener}\n" if k == 0 else ""))
    assert main(["check", str(tmp_path / "d0.yaml"), "--store", shared_store]) == 1
    shown = capsys.readouterr()
    assert "did you mean `fasteners`?" in shown.out + shown.err
