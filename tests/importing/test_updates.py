"""Repeated imports: changes in the source are merged, edits of the user are preserved, and conflicts are reported."""

from __future__ import annotations

import json
import random
import re
from pathlib import Path

import pytest

from thingc.base.diagnostics import Report
from thingc.tools.cli.main import main
from thingc.tools.importing.importing import import_robot
from thingc.tools.importing.three_way_merge import Merge, MergeConflict, read_text

URDF = """<robot name="lamp">
  <link name="foot"><inertial><mass value="2"/><inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial></link>
  <link name="upper-arm">
    <inertial><mass value="0.5"/><inertia ixx="0.001" ixy="0" ixz="0" iyy="0.001" iyz="0" izz="0.001"/></inertial>
    <visual><geometry><mesh filename="arm.stl"/></geometry></visual>
    <visual><geometry><box size="0.1 0.1 0.1"/></geometry></visual>
  </link>
  <link name="tip"/>
  <joint name="lift" type="revolute">
    <parent link="foot"/><child link="upper-arm"/><origin xyz="0 0 0.1"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="2" velocity="6"/>
  </joint>
  <joint name="end" type="fixed"><parent link="upper-arm"/><child link="tip"/><origin xyz="0 0 0.3"/></joint>
</robot>
"""
MESH = "solid s\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex {} 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid s\n"
Said = pytest.CaptureFixture[str]


@pytest.fixture
def lamp(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Said) -> Path:
    """Return the document of a first import; the source is next to its folder."""
    monkeypatch.chdir(tmp_path)
    Path("lamp.urdf").write_text(URDF)
    Path("arm.stl").write_text(MESH.format(1))
    assert main(["import", "lamp.urdf", "--root", "tip"]) == 0
    capsys.readouterr()
    return tmp_path / "lamp" / "lamp.yaml"


def edit(path: Path, *pairs: tuple[str, str]) -> str:
    text = path.read_text()
    for old, new in pairs:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    path.write_text(text)
    return text


@pytest.mark.parametrize(("before", "after", "said"), [
    ("-1.5707963267948966 1.5707963267948966", "-1.5707963267948966 1.5", "upper: 90 deg -> 1.5 rad"),
    ("-1.5707963267948966 1.5", "-1.5707963267948966 1.5707963267948966", "upper: 1.5 rad -> 90 deg"),
    ("-0.3 0.7", "-0.7853981633974483 0.7", "lower: -0.3 rad -> -45 deg"),
])
def test_single_limit_bound_is_updated(lamp: Path, capsys: Said, before: str, after: str, said: str) -> None:
    """The unit of the other bound does not matter."""
    for numbers in (before, after):
        lower, upper = numbers.split()
        Path("lamp.urdf").write_text(URDF.replace('lower="-1" upper="1"', f'lower="{lower}" upper="{upper}"'))
        capsys.readouterr()
        assert main(["import", "lamp.urdf", "--update"]) == 0
    assert f"merged: 1 change of the source\n  joints.lift.limit.{said}\n" in capsys.readouterr().out


def test_import_does_not_overwrite_another_robot(lamp: Path, capsys: Said) -> None:
    before = lamp.read_text()
    Path("desk.urdf").write_text(URDF.replace('name="lamp"', 'name="desk"'))
    assert main(["import", "desk.urdf", "-o", "lamp"]) == 2
    said = capsys.readouterr().err
    told = "error[TC805]: `lamp` contains the import of `lamp.urdf` with the robot `lamp`\n  help: choose another folder"
    assert told in said
    Path("scene.urdf").write_text(URDF)
    assert main(["import", "scene.urdf"]) == 2 and told in capsys.readouterr().err, "of the same name"
    assert lamp.read_text() == before
    Path("desk.urdf").replace("lamp.urdf")
    assert main(["import", "lamp.urdf", "-o", "lamp"]) == 0  # the file has been called otherwise inside
    assert "name: lamp -> desk" in capsys.readouterr().out


def test_source_changes_and_user_edits_are_merged(lamp: Path, capsys: Said) -> None:
    mine = edit(
        lamp, ("    mass: 2 kg\n", "    mass: 2.5 kg  # weighed\n"), ("velocity: 6 rad/s}", "velocity: 6 rad/s}  # data sheet"),
        ("  source: {root: foot", "  flying: {root: upper_arm, base: free}\n  source: {root: foot"),
    )
    other = '<link name="shade"><inertial><mass value="0.1"/></inertial></link>'
    glue = '<joint name="glue" type="fixed"><parent link="tip"/><child link="shade"/></joint>'
    edit(
        Path("lamp.urdf"), ('lower="-1"', 'lower="-0.5"'), ('<mass value="0.5"/>', '<mass value="0.6"/>'),
        ('<link name="tip"/>', f'<link name="tip"/>{other}'), ("</robot>", f"{glue}</robot>"),
    )
    assert main(["import", "lamp.urdf", "--update"]) == 0
    text = lamp.read_text()
    for line in ("    mass: 2.5 kg  # weighed", "velocity: 6 rad/s}  # data sheet", "  flying: {root: upper_arm,", "    mass: 600 g"):
        assert line in text
    assert "    limit: {lower: -0.5 rad, upper: 1 rad," in text and "  upper_arm:  # 'upper-arm' in the source\n" in text
    # the tip has something on it now: it is a component, and so is what is on it
    assert "  shade:\n    frame: true\n    mass: 100 g\n    at: {in: tip.origin}\n" in text
    assert "\nmounts:" not in text and "  tip: {root: tip, base: held}\n" in text, "--root is as it was"
    told = capsys.readouterr().out
    assert "merged: " in told and "  components.upper_arm.mass: 500 g -> 600 g\n" in told and "  joints.lift.limit.lower: " in told
    assert "preserved edits: 2\n  components.foot.mass\n  modes.flying\n" in told
    assert set(mine.splitlines()) - set(text.splitlines()) < set(mine.splitlines())
    assert main(["check", str(lamp)]) == 0
    assert main(["import", "lamp.urdf", "--update"]) == 0 and "no changes in the source" in capsys.readouterr().out
    assert lamp.read_text() == text


def test_conflicts_show_both_values(lamp: Path, capsys: Said) -> None:
    edit(lamp, ("mass: 2 kg", "mass: 2.5 kg"), (", velocity: 6 rad/s", ""))
    edit(Path("lamp.urdf"), ('<mass value="2"/>', '<mass value="3"/>'), ('velocity="6"', 'velocity="7"'), ("-1", "-0.5"))
    assert main(["import", "lamp.urdf", "--update", "--check"]) == 1
    assert "mass: 2.5 kg" in lamp.read_text() and "lower: -1" in lamp.read_text()
    first = capsys.readouterr().err
    assert main(["import", "lamp.urdf", "--update"]) == 1
    said = capsys.readouterr().err
    assert "error[TC957]: `components.foot.mass` is 2.5 kg in the document and 3 kg in the source" in said
    assert "--> lamp/lamp.yaml:8:11\n" in said and said == first
    assert "`joints.lift.limit.velocity` is missing in the document and 7 rad/s in the source" in said
    text = lamp.read_text()
    assert "mass: 2.5 kg" in text and "lower: -0.5 rad" in text
    assert main(["import", "lamp.urdf", "--update"]) == 0, "a conflict is said once: it is what the person has written since"


def test_unedited_document_is_rewritten(lamp: Path, capsys: Said) -> None:
    Path("lamp.urdf").write_text(URDF.replace("upper-arm", "boom"))
    Path("arm.stl").write_text(MESH.format(2))
    assert main(["import", "lamp.urdf"]) == 0
    assert "  boom:\n" in lamp.read_text() and "upper_arm" not in lamp.read_text() and "tip: {root" not in lamp.read_text()
    assert (lamp.parent / "meshes" / "arm.stl").read_text() == MESH.format(2)
    fresh = lamp.parent.parent / "fresh"
    assert main(["import", "lamp.urdf", "-o", str(fresh)]) == 0
    assert len({frozenset((path.name, path.read_bytes()) for path in folder.rglob("*.*")) for folder in (lamp.parent, fresh)}) == 1
    capsys.readouterr()
    edit(lamp, ("mass: 2 kg", "mass: 2.5 kg"))
    assert main(["import", "lamp.urdf"]) == 2
    said = capsys.readouterr().err
    kept = "imported files were modified after the import (`lamp/lamp.yaml`)\n  help: merge with `--update`"
    assert kept in said


def test_meshes_are_merged_by_file(lamp: Path, capsys: Said) -> None:
    mesh = lamp.parent / "meshes" / "arm.stl"
    mesh.write_text(MESH.format(5))
    assert main(["import", "lamp.urdf", "--update"]) == 0
    assert "preserved edits: 1\n  meshes/arm.stl\n" in capsys.readouterr().out and mesh.read_text() == MESH.format(5)
    Path("arm.stl").write_text(MESH.format(2))
    assert main(["import", "lamp.urdf", "--update"]) == 1
    said = capsys.readouterr()
    assert "`meshes/arm.stl` has changed in the folder and in the source" in said.err
    assert "no changes in the source" not in said.out
    mesh.write_text(MESH.format(2))
    edit(Path("lamp.urdf"), ('<visual><geometry><mesh filename="arm.stl"/></geometry></visual>', ""))
    assert main(["import", "lamp.urdf", "--update"]) == 0
    assert not mesh.exists() and "mesh:" not in lamp.read_text()


def test_invalid_merge_result_is_not_written(lamp: Path, capsys: Said) -> None:
    """The user has renamed a link to which the source adds a joint."""
    text = edit(lamp, ("  foot:\n", "  base:\n"), ("parent: foot.lift", "parent: base.lift"), ("root: foot,", "root: base,"))
    link = '<link name="b"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>'
    more = f'{link}<joint name="turn" type="continuous"><parent link="foot"/><child link="b"/><origin xyz="0 0 0.5"/></joint>'
    edit(Path("lamp.urdf"), ("</robot>", f"{more}</robot>"))
    assert main(["import", "lamp.urdf", "--update"]) == 1
    said = capsys.readouterr().err
    assert lamp.read_text() == text
    assert "error[TC957]: `components.foot` is missing in the document" in said and "error[TC302]" in said


def test_names_are_stable_across_updates(lamp: Path) -> None:
    """A new link named `upper_arm` gets another name, because that name is already used."""
    edit(Path("lamp.urdf"), ('<link name="foot">', '<link name="upper_arm"/><link name="foot">'), ("</robot>", '''
      <joint name="more" type="fixed"><parent link="tip"/><child link="upper_arm"/></joint></robot>'''))
    assert main(["import", "lamp.urdf", "--update"]) == 0
    names = json.loads((lamp.parent / "import.json").read_text())["names"]
    assert names["links"]["upper-arm"] == "upper_arm" and names["frames"]["upper_arm"] == "upper_arm_2"


@pytest.mark.parametrize("record", ["{", "[]", '{"document": {"file": "../x"}}', None])
def test_update_requires_the_import_record(lamp: Path, capsys: Said, record: str | None) -> None:
    (lamp.parent / "import.json").unlink()
    if record is not None:
        (lamp.parent / "import.json").write_text(record)
    assert main(["import", "lamp.urdf", "--update"]) == 2
    assert "--update: the folder does not contain a valid `import.json`" in capsys.readouterr().err
    assert main(["import", "lamp.urdf", "--root", "tip"]) == (0 if record is None else 2)


@pytest.mark.parametrize(("base", "new", "ours", "whole"), [
    ("a: {x: 1, y: 2}", "a: {y: 2, z: 3}", "a: {x: 1, y: 5}  # mine", "a: {y: 5, z: 3}  # mine"),
    ("a:\n  x: 1\nb: 2", "a:\n  x: 1\n  # 2\n  y:\n    z: 1\nb: 2",
     "a:\n    x: 1 # 1\nb: 2", "a:\n    x: 1 # 1\n    # 2\n    y:\n      z: 1\nb: 2"),
    ("a:\n  x: 1\n\nb:\n  x: 1\n\nc: 1", "a:\n  x: 1\n\nc: 1", "a:\n  x: 1\n  y: 2\n\nb:\n  x: 1\n\nc: 1", "a:\n  x: 1\n  y: 2\n\nc: 1"),
    ("a:\n  - {x: 1}\n  - {x: 2}", "a:\n  - {x: 1}\n  - {x: 3}", "a:\n  - {x: 4}\n  - {x: 2}  # two", "a:\n  - {x: 4}\n  - {x: 3}  # two"),
    ("a: [0, 1, 0]\nb: [1, 0]", "a: [0, 1, 0]\nb: [0, 1]", "a: [0, 0, 1]\nb: [1, 0]", "a: [0, 0, 1]\nb: [0, 1]"),
    ("a:\n  - 1", "a:\n  - 1\n  - 2", "a:\n  - 1  # one\nb: 1", "a:\n  - 1\n  - 2\nb: 1"),
    ("a:\n  - {x: 1}\nb: 1", "a:\n  - {x: 1}\nb: 2", "b: 1", "b: 2"),
    ("a: 1\nb: 2", "a: {x: 1}\nb: 2", "a: 1  # one\nb: 3", "a: {x: 1}  # one\nb: 3"),
    ("b: 2", "a: 1\nb: 2", "b: 3", "a: 1\nb: 3"),
    ("b: 2", "b: 2\nc: 1", "b: 3\r\nd: 1", "b: 3\r\nc: 1\r\nd: 1"),
    ("a: {b: {c: 1}, d: 1}", "a: {b: {c: 2}}", "a: {b: {c: 1, e: [1, 2]}, d: 1}", "a: {b: {c: 2, e: [1, 2]}}"),
    ("a: {x: 1}", "a:\n  x: 1\n  y:\n    - 1", "a: {x: 1}\nb: 1", "a: {x: 1, y: [1]}\nb: 1"),
    ("a:\n  x: 1", "a:\n  x: 1\n  y:\n    - {z: 1}", "a:\n  x: 2", "a:\n  x: 2\n  y:\n    - {z: 1}\n"),
    ("a: {x: [1]}", "a:\n  x:\n    - 1\n    - 2", "a: {x: [1]}\nb: 1", "a: {x: [1, 2]}\nb: 1"),
    ("a: {x: [1]}", "a: {x: [1,2]}", "a: {x: [1]}\nb: 1", "a: {x: [1,2]}\nb: 1"),
])
def test_yaml_texts_are_merged(base: str, new: str, ours: str, whole: str) -> None:
    texts = [read_text("/d.yaml", text, Report()) for text in (base, new, ours)]
    assert Merge(*texts).merge().text == whole


def test_random_number_edits_are_merged() -> None:
    """Numbers of an imported document are changed at random on both sides; each number must have its latest value."""
    imported = import_robot(str(Path(__file__).parent / "robots" / "constructs.urdf"), Report())
    assert imported is not None
    base = imported.files["constructs.yaml"].decode()
    chance, numbers = random.Random(4), list(re.finditer(r"(?<=[ {])[\d.]+(?= (?:mm|g|kg\*m\^2|rad|N)\b)", base))
    for _ in range(20):
        theirs, mine = (set(chance.sample(range(len(numbers)), 8)) for _ in range(2))
        new, ours, whole = (changed(base, numbers, picked) for picked in (
            dict.fromkeys(theirs, "11"), dict.fromkeys(mine, "777777"), dict.fromkeys(theirs, "11") | dict.fromkeys(mine, "777777"),
        ))
        texts = [read_text("/d.yaml", text, Report()) for text in (base, new, ours)]
        one = Merge(*texts).merge()
        assert one.text == whole or one.conflicts, "a vector is one value: the person's, where both have changed it"
        assert one.text.count("777777") == ours.count("777777") and len(one.conflicts) + len(one.taken) <= len(theirs)


def changed(text: str, numbers: list[re.Match[str]], picked: dict[int, str]) -> str:
    for at in sorted(picked, reverse=True):
        text = text[: numbers[at].start()] + picked[at] + text[numbers[at].end() :]
    return text


def test_vector_is_merged_as_one_value() -> None:
    """Merging the components of two axes would give a wrong axis."""
    texts = [read_text("/d.yaml", text, Report()) for text in ("axis: [0, 1, 0]", "axis: [1, 0, 0]", "axis: [0, 0, 1]")]
    one = Merge(*texts).merge()
    assert one.text == "axis: [0, 0, 1]" and [values for _, *values in one.conflicts] == [["[0, 0, 1]", "[1, 0, 0]"]]


def test_anchors_are_not_merged() -> None:
    texts = [read_text("/d.yaml", text, Report()) for text in ("a: 1\nb: 1", "a: 2\nb: 1", "a: &one 1\nb: *one\nc: 1")]
    with pytest.raises(MergeConflict, match="`b` uses an anchor, or YAML syntax that thingc cannot edit"):
        Merge(*texts).merge()
