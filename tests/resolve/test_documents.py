"""Several documents: TOML and YAML, deep nesting, cycles, and random input that must never raise."""

from __future__ import annotations

import random
import re
from pathlib import Path
from typing import Any

import pytest
from hypothesis import example, given, settings, strategies as st

from resolve.resolving import run
from resolve.test_joints_and_modes import FILES
from resolve.test_wrong_documents import CASES
from thingc.base.frozen_struct import FrozenStruct
from thingc.model.resolve.link_definition import LinkShape
from thingc.model.resolve.types import AssemblyDefinition

YAML = """
thingc: assembly/1
name: arm
description: the same twice
parameters:
  reach: {value: 100 mm, min: 60 mm}
  legs: 2
materials: {petg: {density: 1270 kg/m^3, color: lavender}}
defaults: {component: {material: petg}, joint: {dynamics: {damping: 0.02 N*m*s/rad}}}
components:
  plate: {part: "arm:Plate"}
  brace: {part: "arm:Brace", params: {length: =reach / 2, holes: 3, open: true}}
  leg: {part: "arm:Plate", repeat: {count: =legs}, attach: {top: plate.hip_$i}}
  eye: {frame: true, at: {in: plate.top, xyz: [0, 1 mm, =reach]}}
joints:
  yaw: {type: revolute, parent: plate.axle, child: brace.hub, limit: {lower: -90 deg, upper: 90 deg}, turn: 90 deg}
mounts: {tip: brace.end}
poses: {home: {yaw: 30 deg}}
modes: {bench: {root: plate, pose: home}, drawing: {root: tip, base: held}}
simulation: {timestep: 2 ms}
raw: {mjcf: {joint: {yaw: {group: 3}}}}
"""
TOML = """
thingc = "assembly/1"
name = "arm"
description = "the same twice"
[parameters]
reach = {value = "100 mm", min = "60 mm"}
legs = 2
[materials.petg]
density = "1270 kg/m^3"
color = "lavender"
[defaults]
component.material = "petg"
joint.dynamics.damping = "0.02 N*m*s/rad"
[components.plate]
part = "arm:Plate"
[components.brace]
part = "arm:Brace"
params = {length = "=reach / 2", holes = 3, open = true}
[components.leg]
part = "arm:Plate"
repeat.count = "=legs"
attach = {top = "plate.hip_$i"}
[components.eye]
frame = true
at = {in = "plate.top", xyz = [0, "1 mm", "=reach"]}
[joints.yaw]
type = "revolute"
parent = "plate.axle"
child = "brace.hub"
limit = {lower = "-90 deg", upper = "90 deg"}
turn = "90 deg"
[mounts]
tip = "brace.end"
[poses.home]
yaw = "30 deg"
[modes]
bench = {root = "plate", pose = "home"}
drawing = {root = "tip", base = "held"}
[simulation]
timestep = "2 ms"
[raw.mjcf.joint.yaw]
group = 3
"""


def plain(value: Any) -> Any:
    """Return a model without its source locations."""
    if isinstance(value, (FrozenStruct, LinkShape)):
        skipped = ("origins", "spans", "keys", "document")
        names = value.__struct_fields__ if isinstance(value, FrozenStruct) else value.__slots__
        kept = (name for name in names if name not in skipped and not name.endswith("origin"))
        return {name: plain(getattr(value, name)) for name in kept}
    if isinstance(value, dict):
        return {key: plain(one) for key, one in value.items()}
    if isinstance(value, tuple):
        return [plain(one) for one in value]
    return value


def test_toml_and_yaml_give_equal_models(tmp_path: Path) -> None:
    yaml, toml = run(tmp_path, {"arm.yaml": YAML}).good, run(tmp_path, {"arm.toml": TOML}).good
    assert plain(yaml) == plain(toml)
    assert len(yaml.components) == 5 and yaml.modes[1].root.text == "brace.end"


def test_repeated_runs_give_equal_models(tmp_path: Path) -> None:
    assert run(tmp_path, FILES).good == run(tmp_path, FILES).good


def chain(length: int) -> dict[str, str]:
    files = {}
    for k in range(length):
        inner = f"assembly: d{k + 1}.yaml" if k < length - 1 else 'part: "arm:Plate"'
        files[f"d{k}.yaml"] = f"""
            thingc: assembly/1
            name: d{k}
            components:
              a: {{{inner}}}
              b: {{part: "arm:Plate", attach: {{x: a.x}}}}
              c: {{part: "arm:Plate"}}
            joints: {{j: {{type: continuous, parent: a.x, child: c.y}}}}
            mounts: {{x: b.x}}
            poses: {{p: {{"*": 1 deg}}}}
            """
    return files


def test_hundred_nested_documents_are_allowed(tmp_path: Path) -> None:
    outcome = run(tmp_path, chain(100))
    assert len(outcome.good.poses[0].values) == 100
    assert max(outcome.good.poses[0].values, key=len).count("/") == 99


def test_deeper_nesting_is_an_error(tmp_path: Path) -> None:
    outcome = run(tmp_path, chain(140))
    assert [line.split(" ", 1)[0] for line in outcome.said] == ["TC108"]


def test_document_cycle_is_reported(tmp_path: Path) -> None:
    outcome = run(tmp_path, {
        f"{name}.yaml": f"""
            thingc: assembly/1
            name: {name}
            components:
              a: {{part: "arm:Plate"}}
              n: {{assembly: {other}.yaml, attach: {{origin: a.x}}}}
            mounts: {{deep: n.n.n.a.x}}
            poses: {{p: {{n: p, "n.*": 3 deg, n.n.j: 2 deg}}}}
            """
        for name, other in (("one", "two"), ("two", "three"), ("three", "one"))
    })
    assert [line.split(" ", 1)[0] for line in outcome.said if line[0] != "+"] == ["TC116"]


SCALARS = [
    "3 mm", "0", "-1", "true", "=1 / 0", "=nothing", "=[", "~", "plate", "a.b.c.d", "hand.tip", "*", "x_$i",
    "{}", "[]", "1e400", "30 deg",
    "=reach", "[1, 2, 3]", "\"\"", "open", "origin", "{a: b}", "hand", "plate.origin", "=i",
]


@settings(max_examples=60)
@given(st.integers(0, 10**9))
@example(106889)  # a list for a pattern of joints
@example(12693)  # a joint of no type with a mimic of no kind
def test_mutated_documents_never_raise(tmp_path_factory: pytest.TempPathFactory, seed: int) -> None:
    """Values are replaced by others, and keys are removed and renamed: the result is a report, never an exception."""
    chance = random.Random(seed)
    files = dict(FILES if chance.random() < 0.5 else {"arm.yaml": YAML})
    if chance.random() < 0.3:
        files = dict(chance.choice(list(CASES.values()))[0])
    for name, text in files.items():
        for _ in range(chance.randint(0, 4)):
            words = list(re.finditer(r"(?<=: )[^:{}\[\],\n]+", text))
            if not words:
                break
            word = chance.choice(words)
            text = text[: word.start()] + chance.choice([*SCALARS, chance.choice(words).group()]) + text[word.end():]
        if chance.random() < 0.3:
            lines = text.split("\n")
            del lines[chance.randrange(len(lines))]
            text = "\n".join(lines)
        files[name] = text
    options = {chance.choice(["reach", "stop", "nothing"]): chance.choice(SCALARS)} if chance.random() < 0.3 else {}
    outcome = run(tmp_path_factory.mktemp("fuzz"), files, options)
    assert outcome.model is None or isinstance(outcome.model, AssemblyDefinition)
    assert outcome.said or outcome.model is not None
