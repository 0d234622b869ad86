"""Raw attributes of URDF and SDF, on a document that nests another."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest

from thingc.cli.main import main

MASS = "mass: 1 kg, inertia: {ixx: 1 kg*mm^2, iyy: 1 kg*mm^2, izz: 1 kg*mm^2}"

HAND = f"""\
thingc: assembly/1
name: hand
components:
  palm: {{frame: true, {MASS}}}
  tip: {{frame: true, {MASS}}}
joints:
  knuckle: {{type: revolute, parent: palm.origin, child: tip.origin, limit: {{lower: -1 rad, upper: 1 rad}}}}
raw:
  urdf: {{joint: {{knuckle: {{safety_controller: {{k_velocity: 10}}, limit: {{effort: 7}}}}}}}}
"""

ROBOT = f"""\
thingc: assembly/1
name: robot
components:
  base: {{frame: true, {MASS}}}
  left: {{assembly: hand.yaml}}
joints:
  wrist: {{type: ball, parent: base.origin, child: left.palm.origin}}
modes:
  m: {{root: base, base: fixed}}
  n: {{root: left.tip, base: free}}
raw:
RAW
"""


def built(folder: Path, raw: str, *words: str) -> int:
    (folder / "thingc.toml").write_text('thingc = "workspace/1"\n')
    (folder / "hand.yaml").write_text(HAND)
    (folder / "robot.yaml").write_text(ROBOT.replace("RAW", raw))
    return main(["build", str(folder / "robot.yaml"), "-o", str(folder / "build"), "--store", str(folder / "store"), *words])


def element(path: Path, kind: str, name: str) -> ElementTree.Element:
    return next(one for one in ElementTree.parse(path).iter(kind) if one.get("name") == name)


def test_attributes_of_urdf_are_in_every_mode_and_in_the_package(tmp_path: Path) -> None:
    assert built(tmp_path, "  urdf: {link: {base: {marker: {colour: red}}}}", "--emit", "urdf,ros") == 0
    for mode in "mn":
        for folder in ("urdf", "ros/robot_description/urdf"):
            path = tmp_path / "build" / "robot" / folder / f"robot_{mode}.urdf"
            joint, marker = element(path, "joint", "left_knuckle"), element(path, "link", "base").find("marker")
            limit, safety = joint.find("limit"), joint.find("safety_controller")
            assert limit is not None and safety is not None and marker is not None
            assert (limit.get("effort"), limit.get("lower")) == ("7", "-1")
            assert (safety.attrib, marker.attrib) == ({"k_velocity": "10"}, {"colour": "red"})


def test_values_of_sdf_are_elements(tmp_path: Path) -> None:
    raw = "  sdf: {link: {left.tip: {gravity: false}}, joint: {left/knuckle: {axis: {dynamics: {damping: 0.5}}}}}"
    assert built(tmp_path, raw, "--emit", "sdf") == 0
    for mode in "mn":
        path = tmp_path / "build" / "robot" / "sdf" / f"robot_{mode}" / "model.sdf"
        assert element(path, "link", "left_tip").findtext("gravity") == "false"
        axis = element(path, "joint", "left_knuckle").find("axis")
        assert axis is not None and axis.findtext("dynamics/damping") == "0.5" and axis.find("limit/lower") is not None


@pytest.mark.parametrize(("raw", "said", "help"), [
    ("urdf: {joint: {left.knuckel: {limit: {effort: 7}}}}", "TC701: `urdf` has no joint `left/knuckel`", "did you mean `left_knuckle`?"),
    ("urdf: {robot: {base: {version: 1}}}",
     "TC701: raw attributes of `robot` are not known in `urdf`", "known kinds of elements: `joint`, `link`"),
    ("urdf: {link: {base: 1}}", "TC701: `raw.urdf.link.base` should name what is set", "write `link: {NAME: {KEY: VALUE}}`"),
    ("sdf: {joint: {wrist_0: {axis: {dynamics: {damping: 1}}}}}", "TC701: `sdf` has no joint `wrist_0`", "did you mean `wrist`?"),
    ("sdf: {joint: {left.knuckle: {axis: 1}}}", "TC701: `axis` holds other elements, and no value", "name one of `xyz`, `limit`"),
    ("sdf: {joint: {left.knuckle: {axis: {limit: {lower: {x: 1}}}}}}", "TC701: `lower` holds a value, and no `x`", "write its value"),
    ("urdf: {joint: {left.knuckle: {limit: 3}}}",
     "TC701: `limit` is an element, and no attribute", "name one of its own: `lower`, `upper`, `effort`, `velocity`"),
    ("urdf: {joint: {left.knuckle: {limit: {'a=\"b': 1}}}}",
     "TC701: `a=\"b` cannot be a name in XML", "write letters, digits, `_`, `-` and `.`, and a letter first"),
    ("sdf: {joint: {left.knuckle: {'<x>': 1}}}",
     "TC701: `<x>` cannot be a name in XML", "write letters, digits, `_`, `-` and `.`, and a letter first"),
    ('urdf: {joint: {left.knuckle: {limit: {effort: "7\\x01"}}}}', "TC701: XML has no character `\\x01`", "leave it out"),
    ("urdf: {joint: {left.knuckle: {origin: {xyz: 0 0 1}}}}",
     "TC707: `raw` cannot set `origin` of a joint: it would be another robot than in other formats", "write mounts, `attach:` or `at:`"),
    ("sdf: {joint: {left.knuckle: {axis: {xyz: 0 0 1}}}}",
     "TC707: `raw` cannot set `xyz` of a joint: it would be another robot than in other formats", "write the mounts of the joint"),
])
def test_what_has_no_place_is_said_at_its_key(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], raw: str, said: str, help: str,
) -> None:
    assert built(tmp_path, f"  {raw}", "--emit", "urdf,ros,sdf") == 1
    printed = capsys.readouterr()
    text = printed.out + printed.err
    assert len(re.findall(r"^error", text, re.MULTILINE)) == 1
    code, _, words = said.partition(": ")
    assert f"error[{code}]: {words}\n" in text and "robot.yaml:12:" in text
    assert f"  help: {help}" in text
    assert not (tmp_path / "build").exists()
