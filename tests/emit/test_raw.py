"""`raw` attributes of URDF, SDF and USD in a document that includes another document."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from emit.read_usd import Model
from thingc.tools.cli.main import main

MASS = "mass: 1 kg, inertia: {ixx: 1 kg*mm^2, iyy: 1 kg*mm^2, izz: 1 kg*mm^2}"

HAND = f"""\
thingc: assembly/1
name: hand
components:
  palm: {{frame: true, {MASS}}}
  tip: {{frame: true, {MASS}}}
joints:
  knuckle:
    type: revolute
    parent: palm.origin
    child: tip.origin
    limit: {{lower: -1 rad, upper: 1 rad}}
    drive: {{kind: motor, effort: 3 N*m}}
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


def build_robot(folder: Path, raw: str, *words: str) -> int:
    (folder / "thingc.toml").write_text('thingc = "workspace/1"\n')
    (folder / "hand.yaml").write_text(HAND)
    (folder / "robot.yaml").write_text(ROBOT.replace("RAW", raw))
    return main(["build", str(folder / "robot.yaml"), "-o", str(folder / "build"), "--store", str(folder / "store"), *words])


def element(path: Path, kind: str, name: str) -> ElementTree.Element:
    return next(one for one in ElementTree.parse(path).iter(kind) if one.get("name") == name)


def test_urdf_attributes_are_written_in_every_mode(tmp_path: Path) -> None:
    """Raw attributes of URDF appear in every mode and in the ROS package. References to the joint elsewhere in the file are unchanged."""
    assert build_robot(tmp_path, "  urdf: {link: {base: {marker: {colour: red}}}}", "--emit", "urdf,ros") == 0
    for mode in "mn":
        for folder in ("urdf", "ros/robot_description/urdf"):
            path = tmp_path / "build" / "robot" / folder / f"robot_{mode}.urdf"
            joint, marker = element(path, "joint", "left_knuckle"), element(path, "link", "base").find("marker")
            limit, safety = joint.find("limit"), joint.find("safety_controller")
            assert limit is not None and safety is not None and marker is not None
            assert (limit.get("effort"), limit.get("lower")) == ("7", "-1")
            named = [one for one in ElementTree.parse(path).iter("joint") if one.get("name") == "left_knuckle"]
            assert len(named) > 1 and [one.find("limit") is None for one in named].count(False) == 1, "those that name it stay as they were"
            assert (safety.attrib, marker.attrib) == ({"k_velocity": "10"}, {"colour": "red"})


def test_sdf_values_are_written_as_elements(tmp_path: Path) -> None:
    raw = "  sdf: {link: {left.tip: {gravity: false}}, joint: {left/knuckle: {axis: {dynamics: {damping: 0.5}}}}}"
    assert build_robot(tmp_path, raw, "--emit", "sdf") == 0
    for mode in "mn":
        path = tmp_path / "build" / "robot" / "sdf" / f"robot_{mode}" / "model.sdf"
        assert element(path, "link", "left_tip").findtext("gravity") == "false"
        axis = element(path, "joint", "left_knuckle").find("axis")
        assert axis is not None and axis.findtext("dynamics/damping") == "0.5" and axis.find("limit/lower") is not None


@pytest.mark.parametrize(("raw", "said", "help"), [
    ("urdf: {joint: {left.knuckel: {limit: {effort: 7}}}}",
     "TC701: `raw.urdf` refers to the unknown joint `left/knuckel`", "did you mean `left_knuckle`?"),
    ("urdf: {robot: {base: {version: 1}}}",
     "TC701: unknown kind of element `robot` in `raw.urdf`", "known kinds of elements: `joint`, `link`"),
    ("urdf: {link: {base: 1}}", "TC701: `raw.urdf.link.base` must be the path of a value", "write `link: {NAME: {KEY: VALUE}}`"),
    ("sdf: {joint: {wrist_0: {axis: {dynamics: {damping: 1}}}}}",
     "TC701: `raw.sdf` refers to the unknown joint `wrist_0`", "did you mean `wrist`?"),
    ("sdf: {joint: {left.knuckle: {axis: 1}}}", "TC701: `axis` contains elements instead of a value", "use one of `xyz`, `limit`"),
    ("sdf: {joint: {left.knuckle: {axis: {limit: {lower: {x: 1}}}}}}", "TC701: `lower` contains a value and has no `x`", "write the value"),
    ("urdf: {joint: {left.knuckle: {limit: 3}}}",
     "TC701: `limit` is an element, not an attribute", "use one of the attributes: `lower`, `upper`, `effort`, `velocity`"),
    ("urdf: {joint: {left.knuckle: {limit: {'a=\"b': 1}}}}",
     "TC701: `a=\"b` is not a valid name in XML", "use letters, digits, `_`, `-` and `.`, starting with a letter"),
    ("sdf: {joint: {left.knuckle: {'<x>': 1}}}",
     "TC701: `<x>` is not a valid name in XML", "use letters, digits, `_`, `-` and `.`, starting with a letter"),
    ('urdf: {joint: {left.knuckle: {limit: {effort: "7\\x01"}}}}', "TC701: the character `\\x01` is not allowed in XML",
     "remove the character"),
    ("urdf: {joint: {left.knuckle: {origin: {xyz: 0 0 1}}}}",
     "TC707: `raw` cannot set `origin` of a joint", "change mounts, `attach:` or `at:`"),
    ("sdf: {joint: {left.knuckle: {axis: {xyz: 0 0 1}}}}",
     "TC707: `raw` cannot set `xyz` of a joint",
     "change the mounts of the joint, or its `axis:`"),
])
def test_invalid_raw_keys_are_reported_at_the_key(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], raw: str, said: str, help: str,
) -> None:
    """An unknown element, an invalid name or an attribute that thingc controls is one error at its key, with a help line, and no file is
    written."""
    assert build_robot(tmp_path, f"  {raw}", "--emit", "urdf,ros,sdf") == 1
    printed = capsys.readouterr()
    text = printed.out + printed.err
    assert len(re.findall(r"^error", text, re.MULTILINE)) == 1
    code, _, words = said.partition(": ")
    assert f"error[{code}]: {words}\n" in text and "robot.yaml:12:" in text
    assert f"  help: {help}" in text
    assert not (tmp_path / "build").exists()


def test_namespace_prefixes_are_declared(tmp_path: Path) -> None:
    """Prefixes such as `drake:` and `gz:` are declared, so an XML parser resolves them."""
    raw = '  urdf: {joint: {left.knuckle: {"drake:ball": {"drake:x": 1}}}}\n  sdf: {link: {base: {"gz:buoyant": 1, "drake:y": 2}}}'
    assert build_robot(tmp_path, raw, "--emit", "urdf,sdf") == 0
    drake, gz = "{http://drake.mit.edu}", "{http://gazebosim.org/schema}"
    folder = tmp_path / "build" / "robot"
    ball = element(folder / "urdf" / "robot_m.urdf", "joint", "left_knuckle").find(f"{drake}ball")
    assert ball is not None and ball.attrib == {f"{drake}x": "1"}
    link = element(folder / "sdf" / "robot_m" / "model.sdf", "link", "base")
    assert (link.findtext(f"{gz}buoyant"), link.findtext(f"{drake}y")) == ("1", "2")


def as_list(value: Any) -> Any:
    """Convert a USD array to a list."""
    return list(value) if hasattr(value, "__len__") and not isinstance(value, str) else value


def test_usd_attributes_have_types(tmp_path: Path) -> None:
    """usd-core reads each raw attribute with its type. An attribute that the file already has keeps its type and position."""
    raw = """\
  usd:
    joint:
      left.knuckle:
        {apiSchemas: [PhysxJointAPI, "PhysxLimitAPI:angular"], "physxJoint:maxJointVelocity": 10.0, "float physxJoint:armature": 1,
         "physics:lowerLimit": -30, "physics:breakForce": 1.5e+3}
      wrist: {"physics:collisionEnabled": true}
    link: {left/tip: {"mine:ints": [1, 2], "mine:reals": [1, 2.5], "mine:name": "a \\"b\\"\\r", "float3 mine:vector": [1, 2, 3]}}
    scene: {"token physxScene:solverType": TGS, "int mine:n": 3,
            "double mine:d": 1.7976931348623157e+308, "float mine:f": -3.4028234663852886e+38, "physics:gravityDirection": [0, 1, 0]}"""
    assert build_robot(tmp_path, raw, "--emit", "usd") == 0
    for mode in "mn":
        text = (tmp_path / "build" / "robot" / "usd" / f"robot_{mode}.usda").read_text()
        model = Model(text)
        assert model.faults() == []

        def of(path: str, *names: str, model: Model = model) -> list[tuple[str, object]]:
            found = [model.at(path).GetAttribute(name) for name in names]
            return [(str(one.GetTypeName()), as_list(one.Get())) for one in found]

        knuckle = "joints/left_knuckle"
        assert {"PhysxJointAPI", "PhysxLimitAPI:angular"} <= set(model.at(knuckle).GetPrimTypeInfo().GetAppliedAPISchemas())
        assert of(knuckle, "physxJoint:maxJointVelocity", "physxJoint:armature", "physics:lowerLimit", "physics:breakForce") == [
            ("float", 10.0), ("float", 1.0), ("float", -30.0), ("float", 1500.0),
        ]
        assert of("joints/wrist", "physics:collisionEnabled") == [("bool", True)]
        assert of("left_tip", "mine:ints", "mine:reals", "mine:name", "mine:vector") == [
            ("int[]", [1, 2]), ("float[]", [1.0, 2.5]), ("string", 'a "b"\r'), ("float3", [1.0, 2.0, 3.0]),
        ]
        assert of("scene", "physxScene:solverType", "mine:n", "mine:d", "mine:f", "physics:gravityDirection") == [
            ("token", "TGS"), ("int", 3), ("double", np.finfo(np.float64).max), ("float", float(np.finfo(np.float32).min)),
            ("vector3f", [0.0, 1.0, 0.0]),
        ]
        assert text.count("physics:lowerLimit = -30") == 1 and text.count("physics:lowerLimit") == text.count("physics:upperLimit")
