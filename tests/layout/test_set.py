"""`thingc set` and `batch --adopt`: written values, unchanged surrounding text, and no invalid result."""

from __future__ import annotations

import difflib
import io
import json
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML

from thingc.base.diagnostics import Report
from thingc.base.source import Document, MappingNode
from thingc.documents.format.value_edits import CannotSetValue, remove_value, set_values
from thingc.documents.load.documents import read_tree
from thingc.tools.cli.main import main

YAML_TEXT = """\
# top
name: x   # name
parameters:
  reach: 100 mm      # the reach
  wide: {value: 3 mm, min: 1 mm}

components:
  # first
  plate: {part: arm:Plate,
          params: {a: 1 mm}}   # on two lines
  motor:
    part: "m:M"
    params:
      l: 3 mm
      # the end of params

# joints
joints:
  a: {type: revolute, limit: {lower: 0 deg, upper: 1 deg}}  # c
  b:
    type: revolute
    limit:
    pins: [{at: 1 mm}]
modes: {}
note: |
  two
  lines
"""

TOML_TEXT = """\
# top
name = "x"   # name

[parameters]
reach = "100 mm"      # the reach
wide = {value = "3 mm", min = "1 mm"}

[components.motor]  # m
part = "m:M"
params.l = "3 mm"

[joints]
a = {type = "revolute", limit = {lower = "0 deg"}}
"""


def document(text: str, name: str) -> Document:
    path = f"/somewhere/{name}"
    tree = read_tree(path, text.encode(), Report())
    assert isinstance(tree, MappingNode)
    return Document(path=path, relative=name, kind="assembly", tree=tree, sha256="", text=text)


def read(text: str, name: str) -> Any:
    return tomllib.loads(text) if name.endswith("toml") else json.loads(json.dumps(YAML(typ="safe", pure=True).load(io.StringIO(text))))


def changed(before: str, after: str) -> list[str]:
    lines = difflib.unified_diff(before.splitlines(), after.splitlines(), n=0, lineterm="")
    return [line for line in lines if not line.startswith(("---", "+++", "@@"))]


@pytest.mark.parametrize(("name", "values", "lines"), [
    ("a.yaml", {"parameters.reach": "120 mm"}, ["-  reach: 100 mm      # the reach", "+  reach: 120 mm      # the reach"]),
    ("a.yaml", {"parameters.wide.value": "=min(reach, 2 mm)"}, [
        "-  wide: {value: 3 mm, min: 1 mm}", "+  wide: {value: '=min(reach, 2 mm)', min: 1 mm}"]),
    ("a.yaml", {"components.plate.params.b": "yes"}, [
        "-          params: {a: 1 mm}}   # on two lines", "+          params: {a: 1 mm, b: yes}}   # on two lines"]),
    ("a.yaml", {"components.motor.params.k": "a: #b"}, ["+      k: 'a: #b'"]),
    ("a.yaml", {"components.motor.part": "m:N"}, ['-    part: "m:M"', "+    part: m:N"]),
    ("a.yaml", {"joints.a.limit.effort": "3 N*m", "joints.a.dynamics.damping": "0.5"}, [
        "-  a: {type: revolute, limit: {lower: 0 deg, upper: 1 deg}}  # c",
        "+  a: {type: revolute, limit: {lower: 0 deg, upper: 1 deg, effort: 3 N*m}, dynamics: {damping: 0.5}}  # c"]),
    ("a.yaml", {"joints.b.limit.upper": "3 deg", "joints.b.gap": "1.50"}, ["-    limit:", "+    limit: {upper: 3 deg}", "+    gap: 1.50"]),
    ("a.yaml", {"modes.m.root": "plate", "poses.p.a": "0"}, ["-modes: {}", "+modes: {m: {root: plate}}", "+poses: {p: {a: 0}}"]),
    ("a.toml", {"parameters.reach": "120 mm"}, ['-reach = "100 mm"      # the reach', '+reach = "120 mm"      # the reach']),
    ("a.toml", {"parameters.wide.max": "1.50"}, [
        '-wide = {value = "3 mm", min = "1 mm"}', '+wide = {value = "3 mm", min = "1 mm", max = 1.50}']),
    ("a.toml", {"components.motor.params.k": "true", "components.motor.mirror": "y"}, ["+params.k = true", '+mirror = "y"']),
])
def test_only_the_set_values_change(name: str, values: Mapping[str, str], lines: list[str]) -> None:
    text = TOML_TEXT if name.endswith("toml") else YAML_TEXT
    for line_end in ("\n", "\r\n"):
        before = text.replace("\n", line_end)
        after = set_values(document(before, name), {tuple(path.split(".")): value for path, value in values.items()}).text
        assert changed(before, after) == lines
        assert after.count("\n") == after.count(line_end)
        said = read(after, name)
        for path, value in values.items():
            found: Any = said
            for key in path.split("."):
                found = found[key]
            assert found in (value, {"true": True, "0": 0, "0.5": 0.5, "1.50": 1.5}.get(value))


@pytest.mark.parametrize(("name", "path", "value", "lines"), [
    ("a.yaml", "joints.c", {"type": "screw", "limit": {"lower": "-1 deg"}, "pins": ["a, b", "2"]}, [
        "+  c:", "+    type: screw", "+    limit: {lower: -1 deg}", "+    pins: ['a, b', 2]"]),
    ("a.yaml", "parameters.c", {"value": "1 mm"}, ["+  c: {value: 1 mm}"]),
    ("a.yaml", "modes.c", {"root": "a.b"}, ["-modes: {}", "+modes: {c: {root: a.b}}"]),
    ("a.yaml", "tests.c", {"mass": {"max": "1 kg"}}, ["+", "+tests:", "+  c: {mass: {max: 1 kg}}"]),
    ("a.toml", "joints.c", {"type": "screw", "pins": ["a", "2"]}, ['+c = {type = "screw", pins = ["a", 2]}']),
    ("a.toml", "components.c", {"part": "m:C", "at": {"in": "plate.a"}}, [
        "+[components.c]", '+part = "m:C"', '+at = {in = "plate.a"}', "+"]),
    ("a.toml", "tests.c", {"mass": {"max": "1 kg"}}, ["+", "+[tests]", '+c = {mass = {max = "1 kg"}}']),
])
def test_new_mapping_has_the_style_of_its_siblings(name: str, path: str, value: Any, lines: list[str]) -> None:
    before = TOML_TEXT if name.endswith("toml") else YAML_TEXT
    assert changed(before, set_values(document(before, name), {tuple(path.split(".")): value}).text) == lines


@pytest.mark.parametrize(("name", "path", "lines"), [
    ("a.yaml", "components.plate.part", ["-  plate: {part: arm:Plate,", "-          params: {a: 1 mm}}   # on two lines",
                                         "+  plate: {params: {a: 1 mm}}   # on two lines"]),
    ("a.yaml", "joints.a.limit", ["-  a: {type: revolute, limit: {lower: 0 deg, upper: 1 deg}}  # c", "+  a: {type: revolute}  # c"]),
    ("a.yaml", "components.motor.part", ['-    part: "m:M"']),
    ("a.yaml", "joints.b.pins", ["-    pins: [{at: 1 mm}]"]),
    ("a.yaml", "note", ["-note: |", "-  two", "-  lines"]),
    ("a.toml", "parameters.wide.min", ['-wide = {value = "3 mm", min = "1 mm"}', '+wide = {value = "3 mm" }']),
    ("a.toml", "components.motor.part", ['-part = "m:M"']),
])
def test_only_the_removed_key_disappears(name: str, path: str, lines: list[str]) -> None:
    text = TOML_TEXT if name.endswith("toml") else YAML_TEXT
    for line_end in ("\n", "\r\n"):
        before = text.replace("\n", line_end)
        after = remove_value(document(before, name), tuple(path.split("."))).text
        assert changed(before, after) == lines and after.count("\n") == after.count(line_end)


def test_aliased_key_cannot_be_removed() -> None:
    with pytest.raises(CannotSetValue, match="`a.x` cannot be removed .repeated by an alias"):
        remove_value(document("a: &it {x: 1, z: 2}\nb: *it\n", "a.yaml"), ("a", "x"))


@pytest.mark.parametrize(("text", "path"), [
    ("a: &it {x: 1}\nb: *it\n", "a.x"), ("a: &it {x: 1}\nb: *it\n", "b.x"), ("a: &it {x: 1}\nb: *it\n", "b.y"),
    ("a:\n  x: 1\n", "a"), ("a: [1, 2]\nb: &q 3\nc: *q\n", "b"),
])
def test_values_that_cannot_be_set_alone(text: str, path: str) -> None:
    with pytest.raises(CannotSetValue):
        set_values(document(text, "a.yaml"), {tuple(path.split(".")): "7"})


DOCUMENT = """\
thingc: assembly/1
name: arm
parameters:
  reach: {value: 100 mm, min: 60 mm, max: 200 mm}    # axis to axis
  load: 1 kg
components:
  base: {frame: true, mounts: {top: {xyz: [0, 0, =reach]}}}
  beam: {frame: true, mass: =load, inertia: {ixx: 1e-3 kg*m^2, iyy: 1e-3 kg*m^2, izz: 1e-3 kg*m^2}}   # heavy
  tool: {assembly: tool.yaml, at: {in: beam.origin}}
joints:
  lift: {type: revolute, parent: base.top, child: beam.origin, limit: {lower: -90 deg, upper: 90 deg}}
"""
TOOL = "thingc: assembly/1\nname: tool\ncomponents:\n  tip: {frame: true, mass: 10 g, mounts: {end: {xyz: 0 0 10 mm}}}\n"


@pytest.fixture
def here(tmp_path: Path, shared_store: str, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("THINGC_STORE", shared_store)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "arm.yaml").write_text(DOCUMENT)
    (tmp_path / "tool.yaml").write_text(TOOL)
    return tmp_path


def test_written_values_are_reported(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["set", "arm.yaml", "reach=120 mm", "load=2 kg", "joints.lift.limit.upper=80 deg"]
    words += ["joints.lift.dynamics.damping=0.1 N*m*s/rad"]
    assert main([*words, "--diff"]) == 0
    shown = capsys.readouterr().out
    assert "+  load: 2 kg\n" in shown and (here / "arm.yaml").read_text() == DOCUMENT
    assert main(words) == 0
    assert capsys.readouterr().out == (
        "parameters.reach.value: 100 mm -> 120 mm\nparameters.load: 1 kg -> 2 kg\njoints.lift.limit.upper: 90 deg -> 80 deg\n"
        "joints.lift.dynamics.damping: 0.1 N*m*s/rad\n"
    )
    lines = [line for line in shown.splitlines() if line.startswith(("+", "-")) and not line.startswith(("+++", "---"))]
    assert changed(DOCUMENT, (here / "arm.yaml").read_text()) == lines
    before = (here / "arm.yaml").read_text()
    for options, written in ((["--diff"], False), ([], True)):
        assert main(["set", "arm.yaml", "load=3 kg", "--format", "json", *options]) == 0
        assert json.loads(capsys.readouterr().out)["set"] == [{"path": "parameters.load", "before": "2 kg", "after": "3 kg"}]
        assert ((here / "arm.yaml").read_text() != before) is written


def test_flow_mapping_is_reported_as_written(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["set", "arm.yaml", "components.base.mounts.top={xyz: 0 0 20 mm}"]) == 0
    assert capsys.readouterr().out == "components.base.mounts.top: {xyz: [0, 0, =reach]} -> {xyz: 0 0 20 mm}\n"


def test_mapping_and_list_are_set_as_a_whole(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["joints.lift.dynamics={damping: 0.1 N*m*s/rad, friction: '0.2 N*m'}", "joints.lift.limit={lower: -1 rad, upper: 90 deg}"]
    assert main(["set", "arm.yaml", *words, "components.base.mounts.top.xyz=[0, 0, =reach / 2]"]) == 0
    assert changed(DOCUMENT, (here / "arm.yaml").read_text()) == [
        "-  base: {frame: true, mounts: {top: {xyz: [0, 0, =reach]}}}", "+  base: {frame: true, mounts: {top: {xyz: [0, 0, =reach / 2]}}}",
        "-  lift: {type: revolute, parent: base.top, child: beam.origin, limit: {lower: -90 deg, upper: 90 deg}}",
        "+  lift: {type: revolute, parent: base.top, child: beam.origin, limit: {lower: -1 rad, upper: 90 deg}, "
        "dynamics: {damping: 0.1 N*m*s/rad, friction: 0.2 N*m}}",
    ]
    (here / "arm.toml").write_text(
        'thingc = "assembly/1"\nname = "arm"\n[components.base]\nframe = true\n[modes]\nm = {root = "base", base = "fixed"}\n'
    )
    assert main(["set", "arm.toml", "modes.m.at={xyz: [0, 0, 200 mm]}"]) == 0
    assert tomllib.loads((here / "arm.toml").read_text())["modes"]["m"]["at"] == {"xyz": [0, 0, "200 mm"]}


def test_vector_component_is_set_by_its_index(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "tool.yaml").write_text(TOOL + "modes: {m: {root: tip, gravity: '0 0 -1.6 m/s^2'}}\n")
    words = ["components.tip.mounts.end.xyz.2=12 mm", "components.tip.mounts.end.xyz.0=-1 mm", "modes.m.gravity.1=1 m/s^2"]
    assert main(["set", "tool.yaml", *words]) == 0
    assert "components.tip.mounts.end.xyz.2: 10 mm -> 12 mm\n" in capsys.readouterr().out
    written = (here / "tool.yaml").read_text()
    assert "xyz: [-1 mm, 0 mm, 12 mm]" in written and "gravity: [0 m/s^2, 1 m/s^2, -1.6 m/s^2]" in written
    assert main(["set", "arm.yaml", "components.base.mounts.top.xyz.0=5 mm"]) == 0
    assert "xyz: [5 mm, 0, =reach]" in (here / "arm.yaml").read_text()
    (here / "arm.toml").write_text(
        'thingc = "assembly/1"\nname = "arm"\n[components.base]\nlink = true\nmass = "1 kg"\ncom = "1 2 3 mm"  # here\n'
        '[[components.base.shapes]]\nbox = ["1 mm", "2 mm", "3 mm"]\n[modes.m]\nroot = "base"\n'
    )
    assert main(["set", "arm.toml", "components.base.com.1=0 mm", "components.base.shapes.0.box.2=9 mm"]) == 0
    base = tomllib.loads((here / "arm.toml").read_text())["components"]["base"]
    assert base["com"] == ["1 mm", "0 mm", "3 mm"] and base["shapes"] == [{"box": ["1 mm", "2 mm", "9 mm"]}]


@pytest.mark.parametrize(("words", "said"), [
    (["joints.lift.limit={lower: 1 deg, uper: 2 deg}"], ["unknown key `uper` in `joints.lift.limit`", "did you mean `upper`?"]),
    (["joints.lift.limit={lower: 1 deg"], ["`joints.lift.limit` cannot be read: the `{` is not closed with `}`"]),
    (["joints.lift.limit=[1 deg, 2 deg]"], ["expected a mapping", "found a list of 2 items"]),
    (["joints.lift.limit=1 deg"], ["found the mapping `joints.lift.limit`", "or the whole mapping: `joints.lift.limit={...}`"]),
    (["rech=1 mm", "load=3 mm", "joints.lift.limits.upper=1 deg"], [
        "has no parameter `rech`", "found a length (`3 mm`)", "has no key `limits`"]),
    (["reach=300 mm"], ["at most 200 mm"]), (["reach=0.15"], ["help: write `0.15 m`"]), (["reach=150"], ["help: write `150 mm`"]),
    (["joints.lift.limit.upper=-2 rad"], ["found `-90 deg` and `-2 rad`", "{lower: -90 deg, upper: -2 rad}"]),
    (["components.tool.components.tip.mass=1 kg"], ["`thingc set tool.yaml 'components.tip.mass=...'`"]),
    (["load=1", "kg"], ["found `kg`\n  help: quote a value that contains spaces: 'load=1 kg'"]),
    (["joints.lift.at={xyz:", "0", "0}", "load=1 kg"], ["contains spaces: 'joints.lift.at={xyz: 0 0}'\n"]),
    (["load"], ["expected PATH=VALUE, found `load`"]), (["load=1 kg", "load=2 kg"], ["`load` is set twice"]),
])
def test_invalid_values_are_not_written(here: Path, capsys: pytest.CaptureFixture[str], words: list[str], said: list[str]) -> None:
    assert main(["set", "arm.yaml", *words]) != 0
    printed = capsys.readouterr().out
    assert [text for text in said if text not in printed] == [], printed
    assert (here / "arm.yaml").read_text() == DOCUMENT


def test_invalid_document_is_fixed_by_a_valid_value(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "arm.yaml").write_text(DOCUMENT.replace("load: 1 kg", "load: 1 kgg"))
    assert main(["set", "arm.yaml", "joints.lift.limit.upper=1 rad"]) == 1
    assert "kgg" in capsys.readouterr().out
    assert main(["set", "arm.yaml", "load=1 kg"]) == 0
    assert (here / "arm.yaml").read_text() == DOCUMENT


def test_variant_is_adopted(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "sweep.yaml").write_text(
        "thingc: variants/1\nassembly: arm.yaml\nname: sweep\nparameters:\n"
        "  reach: [100 mm, 120 mm]\n  joints.lift.limit.upper: [45 deg, 90 deg]\n  joints.lift.offset: 3 deg\n"
    )
    assert main(["batch", "sweep.yaml", "--dry-run", "--format", "json"]) == 0
    variants = json.loads(capsys.readouterr().out)["first"]
    assert main(["batch", "sweep.yaml", "--adopt", variants[2]["id"]]) == 0
    assert capsys.readouterr().out == (
        "parameters.reach.value: 100 mm -> 120 mm\njoints.lift.limit.upper: 90 deg -> 45 deg\njoints.lift.offset: 3 deg\n"
    )
    assert main(["batch", "sweep.yaml", "--dry-run", "--format", "json"]) == 0
    now = json.loads(capsys.readouterr().out)["first"]
    assert (now[2]["parameters"], now[2]["choices"]) == ({}, {})
    assert main(["batch", "sweep.yaml", "--adopt", now[2]["id"]]) == 0
    assert capsys.readouterr().out == f"arm.yaml already has the settings of {now[2]['id']}\n"
    assert main(["batch", "sweep.yaml", "--adopt", "nothing"]) == 2
    assert "has no variant `nothing`" in capsys.readouterr().err
    assert main(["batch", "sweep.yaml", "--adopt", now[1]["id"], "--resume"]) == 2


def test_adopted_id_refers_to_the_table_of_the_batch(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """An id describes the difference from the assembly, so after a variant has been adopted the same id belongs to another variant."""
    (here / "sweep.yaml").write_text(
        "thingc: variants/1\nassembly: arm.yaml\nname: sweep\nkeep: [mass < 3.5 kg]\nparameters:\n"
        "  load: [2 kg, 4 kg]\n  joints.lift.limit.upper: [45 deg, 90 deg]\n"
    )
    assert main(["batch", "sweep.yaml", "--pictures", "none", "--jobs", "1", "--verify", "none"]) == 0
    journal = (here / "build/sweep/journal.jsonl").read_text().splitlines()
    ids = {line["name"]: line["id"] for line in map(json.loads, journal)}
    assert main(["batch", "sweep.yaml", "--adopt", ids["sweep_2"]]) == 0
    capsys.readouterr()
    for _ in range(2):  # of 4 kg, what differs from 2 kg and 45 deg; and then once more
        assert main(["batch", "sweep.yaml", "--adopt", ids["sweep_1"]]) == 0
        text = (here / "arm.yaml").read_text()
        assert "load: 2 kg" in text and "upper: 90 deg" in text
    out, err = capsys.readouterr()
    assert (out, err) == (
        "parameters.load: 4 kg -> 2 kg\njoints.lift.limit.upper: 45 deg -> 90 deg\n"
        f"arm.yaml already has the settings of {_now(capsys, 1)}\n", ""
    )
    assert main(["batch", "sweep.yaml", "--adopt", "sweep_3"]) == 0
    assert capsys.readouterr().err == "sweep_3 violates the rule `mass < 3.5 kg`\n"
    (here / "arm.yaml").write_text((here / "arm.yaml").read_text().replace("value: 100 mm", "value: 110 mm"))
    before = (here / "arm.yaml").read_text()
    assert main(["batch", "sweep.yaml", "--adopt", ids["sweep_1"]]) == 2
    assert (
        f"error[TC923]: the variant `{ids['sweep_1']}` in `build/sweep` does not match `sweep.yaml`\n"
        "  help: build the batch again, and use an identifier from the new table\n"
    ) in capsys.readouterr().err
    assert (here / "arm.yaml").read_text() == before


def _now(capsys: pytest.CaptureFixture[str], index: int) -> str:
    """Return the current id of a variant."""
    assert main(["batch", "sweep.yaml", "--dry-run", "--format", "json"]) == 0
    return str(json.loads(capsys.readouterr().out)["first"][index]["id"])
