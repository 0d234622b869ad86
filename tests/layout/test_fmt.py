"""`thingc fmt`: examples of the canonical layout, and the effect of the command on files."""

from __future__ import annotations

import io
import os
import shutil
import stat
import tomllib
from pathlib import Path
from typing import Any

import pytest
import tomlkit
from hypothesis import HealthCheck, assume, given, settings, strategies as st

from thingc.base.diagnostic_output import as_text
from thingc.base.diagnostics import Report
from thingc.documents.format import toml_layout
from thingc.documents.format.flow_style import LEADING_KEYS, canonical_order
from thingc.documents.format.formatting import format_document
from thingc.documents.spec.annotation_types import model_keys
from thingc.tools.cli.main import main

UNTIDY = b"""\
# yaml-language-server: $schema=x.json
# About this robot.

name:  arm     # not first
# Which language.
thingc: assembly/1


components:
    # the base
    plate:   {part: arm:BasePlate,process: {  infill: 30% }}   # heavier
    servo:   {part: s:XM430, attach: {back: plate.servo_seat}}


    bus_board :            # hub
          at: { xyz: 0 0 4mm,in: bracket.board }
          # it was weighed
          mass: {source: measured, value: 12g}
          frame: true
          # end of the board
    # end of the components
poses:
  zero: {}
  home: {yaw: 30deg, "a b": 'x' , b: [ 1,2 ]}
joints:
  yaw:
    unknown: 3
    parent: a.b
    type: revolute
    limit: {
      upper: 3 deg,
      lower: "=min(a, b)"
    }
materials: [ a.yaml,b.yaml, ]
"""

TIDY = b"""\
# yaml-language-server: $schema=x.json
# About this robot.

# Which language.
thingc: assembly/1
name: arm      # not first
materials: [a.yaml, b.yaml]

components:
  # the base
  plate:   {part: arm:BasePlate, process: {infill: 30 %}}      # heavier
  servo:   {part: s:XM430, attach: {back: plate.servo_seat}}

  bus_board:               # hub
    frame: true
    # it was weighed
    mass: {value: 12 g, source: measured}
    at: {in: bracket.board, xyz: 0 0 4 mm}
    # end of the board
  # end of the components

joints:
  yaw:
    unknown: 3
    type: revolute
    parent: a.b
    limit: {
      lower: "=min(a, b)",
      upper: 3 deg
    }

poses:
  zero: {}
  home: {yaw: 30 deg, "a b": 'x', b: [1, 2]}
"""


def formatted(text: bytes, name: str = "/robot.yaml") -> bytes:
    report = Report()
    found = format_document(name, text, report)
    assert found is not None, as_text(report.diagnostics)
    return found


def test_canonical_layout() -> None:
    assert formatted(UNTIDY) == TIDY
    assert formatted(TIDY) == TIDY


def test_line_endings_and_byte_order_mark() -> None:
    """The first line ending is used for all lines, and a byte order mark is removed."""
    assert formatted(b"\xef\xbb\xbf" + TIDY.replace(b"\n", b"\r\n")) == TIDY.replace(b"\n", b"\r\n")
    assert formatted(TIDY.replace(b"\n", b"\r\n", 1)) == TIDY.replace(b"\n", b"\r\n")
    assert formatted(TIDY.rstrip(b"\n") + b"\n\n \n") == TIDY == formatted(TIDY.rstrip(b"\n"))


@pytest.mark.parametrize(("written", "meant"), [
    ("mass: 120g", "mass: 120 g"), ("mass: 1.5e1kg", "mass: 1.5e1 kg"), ("mass:   12   g", "mass: 12 g"),
    ('mass: "120g"', 'mass: "120 g"'), ("com: [1mm, 0, -2.5mm]", "com: [1 mm, 0, -2.5 mm]"), ("com: 1 2 3mm", "com: 1 2 3 mm"),
    ("params: {length: 3mm}", "params: {length: 3 mm}"),
    # text, names and expressions are nobody's quantities
    ("bom: {number: 5mm}", "bom: {number: 5mm}"), ("mass: =2g", "mass: =2g"), ("material: 3mm", "material: 3mm"),
    ("mass: 12quux", "mass: 12quux"), ("visual: 3mm", "visual: 3mm"), ("bom: {cost: 12EUR}", "bom: {cost: 12EUR}"),
])
def test_space_before_unit_is_inserted_only_in_quantities(written: str, meant: str) -> None:
    text = "thingc: assembly/1\nname: a\ncomponents:\n  b:\n    part: a:B\n    {}\n"
    assert formatted(text.format(written).replace("{}", written).encode()).decode() == text.replace("{}", meant)


def test_alias_stays_after_its_anchor() -> None:
    text = b"thingc: assembly/1\nname: a\nposes: {a: &p {x: 1 deg}}\ncomponents:\n  b: {frame: true, params: *p}\n"
    assert formatted(text) == text
    apart = text.replace(b"*p", b"{}")
    assert formatted(apart).index(b"components") < formatted(apart).index(b"poses")


@pytest.mark.parametrize("text", [
    "thingc: assembly/1\n? name\n:  a\n", "thingc: assembly/1\nname:  a\ndescription: |+\n  a\n\n\n", "thingc: assembly/1\nname:  a\n...\n",
    "thingc: assembly/1\nname:  a\ndescription: |\n  a",
])
def test_unusual_yaml_is_not_changed(text: str) -> None:
    assert formatted(text.encode()) == text.encode()


def test_key_order_uses_only_keys_of_the_models() -> None:
    for model, keys in LEADING_KEYS.items():
        assert set(keys) <= set(model_keys(model)), model


TOML = b"""\
# a robot
thingc="assembly/1"   # first
name   = "arm"
"quoted" = 1
materials=[ "a.yaml",'b.yaml', ]

[joints.yaw]
parent = "a.b"
type   = "revolute"
limit={upper="30deg",lower= "-30 deg"}
# the base
[components . plate]   # flat
  part="arm:BasePlate"
  xs = [
    1,   # one
    2
  ]
  [components.plate.at]
  xyz = "0 0 4mm"
  in = "x.y"
# the end
"""
TIDY_TOML = b"""\
# a robot
thingc = "assembly/1"  # first
name   = "arm"
"quoted" = 1
materials = ["a.yaml", 'b.yaml']

# the base
[components . plate]   # flat
part = "arm:BasePlate"
xs = [
    1,   # one
    2
  ]

[components.plate.at]
in = "x.y"
xyz = "0 0 4 mm"

[joints.yaw]
type   = "revolute"
parent = "a.b"
limit = {lower = "-30 deg", upper = "30 deg"}
# the end
"""


def test_canonical_layout_of_toml() -> None:
    assert formatted(TOML, "/robot.toml") == TIDY_TOML
    assert formatted(TIDY_TOML, "/robot.toml") == TIDY_TOML


@st.composite
def tomls(draw: st.DrawFn) -> str:
    """Return a TOML document with sections, dotted keys, and a numbered comment in any possible place."""
    count = 0

    def note(chance: int = 3) -> str:
        nonlocal count
        if draw(st.integers(0, chance)):
            return ""
        count += 1
        return f"{draw(st.sampled_from(('', ' ', '     ')))}#c{count}."

    def value() -> str:
        return str(draw(st.sampled_from((
            '"12mm"', "'x # y'", "3", "-1.5", "true", "[1,2 , 3]", '{type="a",in = "b.c" , xyz="0 0 4mm"}', "[]", "{}",
            f'[\n  1,{note()}\n    "a"{note()}\n]', '"""two\n  lines"""',
        ))))

    def pairs(names: tuple[str, ...]) -> list[str]:
        lines = []
        for key in draw(st.lists(st.sampled_from(names), unique=True, max_size=5)):
            lines += [f"{note(2)}" for _ in range(draw(st.integers(0, 2)))]
            space = draw(st.sampled_from(("", " ", "   ")))
            lines.append(f"{draw(st.sampled_from(('', '  ')))}{key}{space}={space}{value()}{note()}")
        return lines

    lines = [note(), "", f'thingc = "assembly/1"{note()}', *pairs(("name", "raw", '"a b"', "defaults.x", "defaults.y", "zzz"))]
    sections = ("components.b", "components.a", "components.a.at", "joints.k", "modes.m", "poses", "joints.j.limit")
    for section in draw(st.lists(st.sampled_from(sections), unique=True, max_size=5)):
        lines += [note(2), f"[{section}]{note()}", *pairs(("part", "frame", "mass", "type", "parent", "xyz", "in", "value"))]
    return "\n".join([*lines, note(), ""])


@settings(max_examples=40, suppress_health_check=list(HealthCheck))
@given(tomls())
def test_formatted_toml_has_the_same_content(text: str) -> None:
    report = Report()
    once = format_document("/robot.toml", text.encode(), report)
    assert all(d.code.code != "TC899" for d in report.diagnostics), as_text(report.diagnostics)
    assume(once is not None)
    assert once is not None

    def plain(data: str) -> Any:
        return tomlkit.parse(data.replace("12mm", "12 mm").replace("4mm", "4 mm")).unwrap()

    assert plain(once.decode()) == plain(text)
    assert list(tomllib.loads(once.decode()).get("components", {})) == list(tomllib.loads(text).get("components", {}))
    assert sorted(_numbers(once)) == sorted(_numbers(text.encode()))
    assert format_document("/robot.toml", once, Report()) == once


def _numbers(text: bytes) -> list[int]:
    """Return the numbers of the comments."""
    return [int(piece.partition(b".")[0]) for piece in text.split(b"#c")[1:]]


# --- the command -----------------------------------------------------------------------------------------------------


def test_repository_documents_are_formatted(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(root)
    assert main(["fmt", "--check", "assemblies", "thingc.toml"]) == 0


def test_only_changed_files_are_written_with_their_mode(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    untidy, tidy, link = tmp_path / "untidy.yaml", tmp_path / "tidy.yaml", tmp_path / "link.yaml"
    untidy.write_bytes(b"name: a\nthingc: assembly/1\n")
    tidy.write_bytes(b"thingc: assembly/1\nname: a\n")
    shutil.copy(untidy, tmp_path / "real.yaml")
    link.symlink_to("real.yaml")
    untidy.chmod(0o640)
    os.utime(tidy, (1, 1))
    assert main(["fmt", "--check", "untidy.yaml", "tidy.yaml"]) == 1
    assert capsys.readouterr().out == "untidy.yaml: would be changed\n1 of 2 documents would be changed\n"
    assert main(["fmt", "--diff", "untidy.yaml"]) == 0
    assert capsys.readouterr().out.endswith("@@ -1,2 +1,2 @@\n+thingc: assembly/1\n name: a\n-thingc: assembly/1\n")
    assert untidy.read_bytes().startswith(b"name")
    assert main(["fmt", "untidy.yaml", "tidy.yaml", "link.yaml"]) == 0
    assert capsys.readouterr().out == "untidy.yaml: changed\nlink.yaml: changed\n2 of 3 documents changed\n"
    assert untidy.read_bytes() == tidy.read_bytes() == (tmp_path / "real.yaml").read_bytes()
    assert stat.S_IMODE(untidy.stat().st_mode) == 0o640 and tidy.stat().st_mtime == 1 and link.is_symlink()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["link.yaml", "real.yaml", "tidy.yaml", "untidy.yaml"]


def test_malformed_document_is_reported_and_unchanged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    broken = tmp_path / "broken.yaml"
    broken.write_bytes(b"name:   a\nthingc: assembly/1\ncomponents: {a: {frame: true}\n")
    before = broken.read_bytes()
    (tmp_path / "good.yaml").write_bytes(b"name: a\nthingc: assembly/1\n")
    assert main(["fmt", "broken.yaml", "good.yaml"]) == 1
    said = capsys.readouterr().out
    assert "TC103" in said and "broken.yaml:3:13" in said and "good.yaml: changed" in said
    assert broken.read_bytes() == before
    assert main(["fmt", "nowhere.yaml"]) == 2 and main(["fmt", "-", "good.yaml"]) == 2


def test_folders_and_touched_files_are_filtered(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "deep").mkdir()
    (tmp_path / "deep" / "a.yaml").write_bytes(b"thingc:  materials/1\nmaterials: {}\n")
    (tmp_path / "thingc.toml").write_bytes(b'thingc="workspace/1"\n')
    (tmp_path / "other.yaml").write_bytes(b"on:   push\n")
    (tmp_path / "part.py").write_bytes(b"x = 1\n")
    assert main(["fmt", "--check", "."]) == 1
    assert capsys.readouterr().out.splitlines()[-1] == "2 of 2 documents would be changed"
    assert main(["fmt", "--touched", "other.yaml", "part.py", "gone.yaml", "deep/a.yaml"]) == 0
    assert capsys.readouterr().out == "deep/a.yaml: changed\n1 of 1 document changed\n"


def test_standard_input_is_formatted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsysbinary: pytest.CaptureFixture[bytes],
) -> None:
    import subprocess
    import sys

    done = subprocess.run([sys.executable, "-m", "thingc", "fmt", "-"], input=UNTIDY, capture_output=True, check=True, cwd=tmp_path)
    assert done.stdout == TIDY
    for text, status, tidy, code in ((TOML, 0, TIDY_TOML, b""), (b"a: [", 1, b"", b"TC103")):
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(text)))
        assert main(["fmt", "-"]) == status
        printed = capsysbinary.readouterr()
        assert printed.out == tidy and code in printed.err


def test_modeline_names_the_schema_of_the_document(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "thingc.toml").write_bytes(b'thingc = "workspace/1"\n')
    (tmp_path / "a").mkdir()
    file = tmp_path / "a" / "robot.yaml"
    file.write_bytes(b"name: a\nthingc: assembly/1\n")
    line = b"# yaml-language-server: $schema=../.thingc/schema/a/robot.yaml.json\n"
    for _ in range(2):
        assert main(["fmt", "--modeline", "a"]) == 0
        assert file.read_bytes() == line + b"thingc: assembly/1\nname: a\n"
    file.write_bytes(file.read_bytes().replace(b"../.thingc", b"../../old"))
    assert main(["fmt", "a"]) == 0 and b"../../old" in file.read_bytes()
    assert main(["fmt", "--modeline", "a"]) == 0 and file.read_bytes().startswith(line)


def test_keys_are_ranked_once_per_table(monkeypatch: pytest.MonkeyPatch) -> None:
    """A document with a hundred components needs at most ten times the work of one with ten."""
    def ranked(count: int) -> int:
        components = "".join(f'\n[components.c{k}]\nframe = true\nmass = "1 g"\n' for k in range(count))
        text = f'thingc = "assembly/1"\nname = "a"\n{components}'
        asked: list[int] = []
        with monkeypatch.context() as patch:
            patch.setattr(toml_layout, "canonical_order", lambda names, shape: asked.append(len(names)) or canonical_order(names, shape))
            assert format_document("a.toml", text.encode(), Report()) == text.encode()
        return sum(asked)

    assert ranked(100) < 10 * ranked(10)
