"""`thingc add`: additions are valid in YAML and TOML, the rest of the text is unchanged, and nothing invalid is written."""

from __future__ import annotations

import difflib
import tomllib
from pathlib import Path
from typing import Any, get_args

import pytest
from ruamel.yaml import YAML

from thingc.base.joints.kinds import JointType
from thingc.documents.checks import kinds
from thingc.driver import pipeline
from thingc.tools.cli.main import main

YAML_TEXT = """\
thingc: assembly/1
name: rover                         # its name

components:
  # what it stands on
  base:
    frame: true
    mass: 1 kg
    inertia: {ixx: 1e-3 kg*m^2, iyy: 1e-3 kg*m^2, izz: 1e-3 kg*m^2}
    mounts: {top: {xyz: 0 0 10 mm}}
  arm:
    frame: true
    mass: 100 g
    inertia: {ixx: 1e-4 kg*m^2, iyy: 1e-4 kg*m^2, izz: 1e-4 kg*m^2}
    at: {in: base.top}              # goes with the joint
    mounts: {seat: {}, end: {xyz: 0 0 10 mm}}
  hand: {frame: true, mass: 10 g, inertia: {ixx: 1e-5 kg*m^2, iyy: 1e-5 kg*m^2, izz: 1e-5 kg*m^2}, mounts: {seat: {}}}

joints:
  # the only one
  wrist:
    type: revolute
    parent: arm.end
    child: hand.seat
    limit: {lower: -1 rad, upper: 1 rad}
    drive: {kind: position, kp: 1 N*m/rad, effort: 1 N*m}
"""
TOML_TEXT = """\
thingc = "assembly/1"
name = "rover"  # its name

# what it stands on
[components.base]
frame = true
mass = "1 kg"
inertia = {ixx = "1e-3 kg*m^2", iyy = "1e-3 kg*m^2", izz = "1e-3 kg*m^2"}
mounts = {top = {xyz = "0 0 10 mm"}}

[components.arm]
frame = true
mass = "100 g"
inertia = {ixx = "1e-4 kg*m^2", iyy = "1e-4 kg*m^2", izz = "1e-4 kg*m^2"}
at = {in = "base.top"}
mounts = {seat = {}, end = {xyz = "0 0 10 mm"}}

[components.hand]
frame = true
mass = "10 g"
inertia = {ixx = "1e-5 kg*m^2", iyy = "1e-5 kg*m^2", izz = "1e-5 kg*m^2"}
mounts = {seat = {}}

# the only one
[joints.wrist]
type = "revolute"
parent = "arm.end"
child = "hand.seat"
limit = {lower = "-1 rad", upper = "1 rad"}
drive = {kind = "position", kp = "1 N*m/rad", effort = "1 N*m"}
"""


@pytest.fixture(params=["yaml", "toml"])
def document(request: pytest.FixtureRequest, tmp_path: Path, shared_store: str, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("THINGC_STORE", shared_store)
    monkeypatch.setenv("NO_COLOR", "1")
    monkeypatch.chdir(tmp_path)
    path = tmp_path / f"rover.{request.param}"
    path.write_text(YAML_TEXT if request.param == "yaml" else TOML_TEXT)
    (tmp_path / "thingc.toml").write_text('thingc = "workspace/1"\n')
    return path


def read(path: Path) -> Any:
    return tomllib.loads(path.read_text()) if path.suffix == ".toml" else YAML(typ="safe").load(path.read_text())


def added(document: Path, *words: str) -> tuple[list[str], list[str]]:
    """Return the added and the removed lines of a document, after checking that it is valid and formatted."""
    before = document.read_text().splitlines()
    assert main(["add", *words, "--to", document.name]) == 0
    assert main(["check", "--strict", document.name]) == 0
    assert main(["fmt", "--check", "."]) == 0
    lines = [line for line in difflib.ndiff(before, document.read_text().splitlines()) if line[0] in "+-"]
    return [line[2:] for line in lines if line[0] == "+"], [line[2:] for line in lines if line[0] == "-"]


@pytest.mark.parametrize("kind", get_args(JointType))
def test_joint_replaces_the_placement_of_its_child(document: Path, kind: str) -> None:
    came, went = added(document, "joint", "turn", "--type", kind, "--parent", "base.top", "--child", "arm.seat")
    assert [line.strip().partition(" ")[0] for line in went] == ["at" if document.suffix == ".toml" else "at:"]
    joint = read(document)["joints"]["turn"]
    assert (joint["type"], joint["parent"], joint["child"]) == (kind, "base.top", "arm.seat")
    assert ("limit" in joint) == (kind in ("revolute", "prismatic")) and ("lead" in joint) == (kind == "screw")
    if document.suffix == ".yaml":
        assert came[:4] == ["  turn:", f"    type: {kind}", "    parent: base.top", "    child: arm.seat"]


def test_loop_joint_removes_nothing(document: Path) -> None:
    added(document, "joint", "turn", "--parent", "base.top", "--child", "arm.seat")
    _, went = added(document, "joint", "close", "--type", "ball", "--parent", "base.origin", "--child", "hand.seat", "--loop")
    assert went == [] and read(document)["joints"]["close"]["loop"] is True


@pytest.mark.parametrize("kind", [kind for kind in kinds() if kind != "drive_margin"])
def test_every_kind_of_test_can_be_added(document: Path, kind: str) -> None:
    came, went = added(document, "test", "first", "--kind", kind)
    assert went == [] and list(read(document)["tests"]["first"]) == [kind]
    if document.suffix == ".yaml":
        assert came[:2] == ["", "tests:"] and len(came) == 3 and came[2].startswith(f"  first: {{{kind}: {{")


def test_motion_test_requires_a_motion(document: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert main(["add", "test", "first", "--kind", "drive_margin", "--to", document.name]) == 2
    assert "a `drive_margin` test requires a motion of the document" in capfd.readouterr().out


def test_modes_are_added_in_section_order(document: Path, capfd: pytest.CaptureFixture[str]) -> None:
    added(document, "test", "light", "--kind", "mass")
    for number, base in enumerate(("fixed", "held", "free")):
        came, went = added(document, "mode", f"m{number}")
        assert went == [] and read(document)["modes"][f"m{number}"] == {"root": "base", "base": base}
    assert list(read(document))[-2:] == ["modes", "tests"]
    added(document, "mode", "hand", "--root", "hand.seat", "--base", "planar", "--gravity", "ceiling")
    assert list(read(document)["modes"]) == ["m0", "m1", "m2", "hand"]


def test_mode_that_stands_on_a_mount(document: Path) -> None:
    added(document, "mode", "first", "--root", "base", "--base", "free")
    for name, words, value in (
        ("still", ["hand.seat"], {"root": "hand.seat", "base": "held"}),
        ("bolted", ["hand.seat"], {"root": "hand.seat", "base": "fixed"}),
        ("wall", ["arm.seat", "--gravity", "wall"], {"root": "arm.seat", "base": "held", "gravity": "wall"}),
        ("loose", ["base.top", "--base", "free"], {"root": "base", "base": "free", "standing_on": ["base.top"]}),
        ("two", ["base.top", "--standing-on", "base.origin", "--root", "arm"],
         {"root": "arm", "base": "free", "standing_on": ["base.top", "base.origin"]}),
    ):
        assert main(["add", "mode", name, "--to", document.name, "--standing-on", *words]) == 0
        assert read(document)["modes"][name] == value
    assert main(["fmt", "--check", "."]) == 0


def test_mode_inherits_or_sets_its_pose(document: Path) -> None:
    head, tail = ("poses:\n  up: {wrist: 0.5 rad}\n  down: {}\n\n", "modes:\n  first: {root: hand, pose: up}\n  second: {extends: first}\n")
    if document.suffix == ".toml":
        head, tail = ('[poses]\nup = {wrist = "0.5 rad"}\ndown = {}\n\n', '[modes]\nfirst = {root = "hand", pose = "up"}\n'
                      'second = {extends = "first", base = "held"}\n')
    else:
        tail = tail.replace("first}", "first, base: held}")
    document.write_text(document.read_text() + "\n" + head + tail)
    came, went = added(document, "mode", "third")
    added(document, "mode", "fourth", "--pose", "down", "--base", "fixed")
    assert went == [] and len(came) == 1
    modes = read(document)["modes"]
    assert modes["third"] == {"root": "hand", "base": "free", "pose": "up"} and modes["fourth"]["pose"] == "down"


def test_new_assembly_has_the_format_of_the_document(document: Path) -> None:
    added(document, "assembly", "leg")
    added(document, "assembly", "arm_2", "--on", "base.top")
    nested = document.with_name(f"leg{document.suffix}")
    assert read(nested)["name"] == "leg" and main(["check", "--strict", nested.name]) == 0
    components = read(document)["components"]
    assert components["leg"] == {"assembly": nested.name, "at": {"in": "base.origin", "xyz": "0 0 30 mm"}}
    assert components["arm_2"] == {"assembly": f"arm_2{document.suffix}", "attach": {"base": "base.top"}}


LEG = """\
thingc: assembly/1
name: leg

parameters:
  length: {value: 80 mm, min: 40 mm}

components:
  foot: {frame: true, mass: 20 g, mounts: {hip: {xyz: [0, 0, =length]}, sole: {}}}

mounts:
  hip: foot.hip
"""


def test_existing_assembly_is_placed_and_unchanged(document: Path, capsys: pytest.CaptureFixture[str]) -> None:
    nested = document.parent / "legs/leg.yaml"
    nested.parent.mkdir()
    nested.write_text(LEG)
    for words, value in (
        (["--on", "base.top"], {"assembly": "legs/leg.yaml", "attach": {"hip": "base.top"}}),
        (["--on", "arm.end", "--by", "foot.sole", "--name", "left"], {"assembly": "legs/leg.yaml", "attach": {"foot.sole": "arm.end"}}),
        (["--at", "arm.seat", "--name", "right", "--param", "length=90 mm"],
         {"assembly": "legs/leg.yaml", "parameters": {"length": "90 mm"}, "at": {"in": "arm.seat"}}),
    ):
        came, went = added(document, "assembly", "legs/leg.yaml", *words)
        assert came and went == [] and list(read(document)["components"].values())[-1] == value
    assert nested.read_text() == LEG
    assert capsys.readouterr().out.count("components.") == 3
    for words, said in (
        ("legs/leg.yaml --on base.top", "already has a component `leg`\n  help: choose another name with --name"),
        ("legs/leg.yaml --name x --param lenght=1mm", "did you mean `length`?"),
        ("legs/leg.yaml --name x --on base.top --by hipp", "exports no mount `hipp`"),
    ):
        before = document.read_bytes()
        assert main(["add", "assembly", *words.split(), "--to", document.name]) in (1, 2)
        assert said in capsys.readouterr().out and document.read_bytes() == before, words
    nested.write_text(LEG + "  tip: foot.sole\n")
    assert main(["add", "assembly", "legs/leg.yaml", "--to", document.name, "--on", "base.top", "--name", "x"]) == 2
    assert (
        "`legs/leg.yaml` has several mounts\n  help: specify one of the mounts with --by (known mounts: `hip`, `tip`)"
        in capsys.readouterr().out
    )
    assert main(["add", "assembly", "legs/leg.yaml"]) == 2
    assert (
        "`legs/leg.yaml` exists already\n  help: choose another name, or add the existing assembly to a document: --to robot.yaml"
        in capsys.readouterr().out
    )


@pytest.mark.slow
def test_part_adds_a_class_and_a_component(document: Path, capsys: pytest.CaptureFixture[str]) -> None:
    came, went = added(document, "part", "FrontBracket")
    assert went == [] and "class FrontBracket(Thing):" in (document.parent / "parts/front_bracket.py").read_text()
    assert read(document)["components"]["front_bracket"] == {
        "part": "front_bracket:FrontBracket", "mass": {"value": "20 g", "source": "estimated"},
        "at": {"in": "base.origin", "xyz": "0 0 30 mm"},
    }
    materials = 'materials = ["thingc_stock.materials"]\n' if document.suffix == ".toml" else "materials: [thingc_stock.materials]\n"
    text = document.read_text()
    head = text.index("\n\n") + 2
    document.write_text(text[:head] + materials + "\n" + text[head:])
    (document.parent / "parts/shelf.py").write_text('"""Mine."""\nfrom build123d import *\nfrom thingc import Thing\n\nX = 1  # stays\n')
    added(document, "part", "shelf:board", "--on", "arm.end")
    assert read(document)["components"]["board"] == {"part": "shelf:Board", "attach": {"bottom": "arm.end"}}
    shelf = (document.parent / "parts/shelf.py").read_text()
    imports = "from build123d import *\nfrom thingc import Thing\nfrom thingc import Length, MountPoint\n"
    assert shelf.startswith(f'"""Mine."""\n{imports}\nX = 1  # stays\n')
    assert 'super().__init__(material="pla")' in shelf and shelf.count("import") == 3
    added(document, "joint", "lift", "--type", "prismatic", "--parent", "arm.end", "--child", "board.bottom")
    assert read(document)["components"]["board"] == {"part": "shelf:Board"}

    # what is there is put into the document, and no code is written
    (document.parent / "parts/peg.py").write_text(
        "from build123d import Box\nfrom thingc import Length, Thing\n\n\nclass Peg(Thing):\n    def __init__(self, width: Length):\n"
        "        super().__init__()\n        self.width = width\n\n    def result(self):\n        return Box(self.width, 5, 5)\n"
    )
    modules = {path: path.read_bytes() for path in document.parent.glob("parts/*.py")}
    for words, value in (
        (["shelf:Board", "--name", "lid", "--on", "base.top"], {"part": "shelf:Board", "attach": {"bottom": "base.top"}}),
        (["shelf:Board", "--name", "roof", "--on", "lid.top", "--by", "top"], {"part": "shelf:Board", "attach": {"top": "lid.top"}}),
        (["FrontBracket", "--name", "loose", "--at", "lid.top"],
         {"part": "front_bracket:FrontBracket", "material": "pla", "at": {"in": "lid.top"}}),
    ):
        _, went = added(document, "part", *words)
        assert went == [] and read(document)["components"][words[2]] == value
    assert {path: path.read_bytes() for path in document.parent.glob("parts/*.py")} == modules
    for words, said in (
        ("shelf:Board --on lid.top --by side --name x", "has no mount `side`"),
        ("shelf:Board --param lenght=10mm --name x", "did you mean `length`?"),
        ("shelf:Board", "already has a component `board`\n  help: choose another name with --name"),
        ("shelf:Bord", "there is no part `shelf:Bord`\n  help: did you mean `shelf:Board`? Add --new to create a class"),
        ("shelv:Board", "there is no part `shelv:Board`\n  help: did you mean `shelf:Board`?"),
        ("peg:Peg --on lid.top", "the mounts of `peg:Peg` depend on its parameters\n  help: specify a mount with --by"),
        ("thingc_stock.wheels:Rim --on lid.top",
         "`thingc_stock.wheels:Rim` has several mounts\n  help: specify one of the mounts with --by (known mounts: "),
    ):
        before = document.read_bytes()
        assert main(["add", "part", *words.split(), "--to", document.name]) in (1, 2)
        out, err = capsys.readouterr()
        assert said in out + err and document.read_bytes() == before, words
    assert main(["add", "part", "shelf:Bord", "--new", "--to", document.name]) == 0
    assert read(document)["components"]["bord"]["part"] == "shelf:Bord"


def test_refused_addition_leaves_no_folder(document: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = sorted(document.parent.iterdir())
    assert main(["add", "part", "Bracket", "--to", document.name, "--on", "base.topp"]) == 1
    assert "did you mean `top`?" in capsys.readouterr().out and sorted(document.parent.iterdir()) == before


def test_part_without_a_document(document: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["add", "part", "Bracket"]) == 0
    assert capsys.readouterr().out == "parts/bracket.py\n"
    assert main(["add", "assembly", "leg"]) == 0
    assert capsys.readouterr().out == "leg.yaml\n"
    assert document.read_text() in (YAML_TEXT, TOML_TEXT)


@pytest.mark.parametrize(("words", "said"), [
    ("mode x", "a mode requires a document\n  help: write, for example, `thingc add mode x --to robot.yaml`"),
    ("mode x --to D --kind mass", "--kind applies to a test, not to a mode"),
    ("part X --on base.top", "--on requires --to\n  help: add --to with the document"),
    ("part X --to D --by bottom", "--by requires --on\n  help: add --on with the mount"),
    ("part X --to D --on base.top --at base.top", "--on cannot be combined with --at\n  help: use only one of the two options"),
    ("mode x --to D --name y", "--name applies to a part or an assembly, not to a mode"),
    (
        "part old:Old",
        "the part `old:Old` already exists\n  help: use --to to add the part to a document",
    ),
    ("part thingc_stock.servo:SG90 --to D", "there is no module `thingc_stock.servo`\n"),
    ("part thingc_stock.servos:SG9 --to D", "help: did you mean `thingc_stock.servos:SG90`?"),
    ("part parts/old.py:Old --to D", "help: did you mean `old:Old`?"),
    ("part numpy:Old --to D", "the module `numpy` is not in a part folder or in an allowed package"),
    ("part old:Old --to D", "error[TC405]"),
    ("mood x --to D", "expected `part`, `assembly`, `mode`, `joint` or `test`, found `mood` (did you mean `mode`?)"),
    ("test x --to D", f"a test requires --kind\n  help: known kinds: {', '.join(f'`{kind}`' for kind in sorted(kinds()))}"),
    ("test x --to D --kind mas", "there is no test kind `mas`\n  help: did you mean `mass`?"),
    ("joint x --to D", "a joint requires --parent and --child\n  help: write, for example, `--parent base.top"),
    ("joint Wrist --to D --parent base.top --child arm.seat", "already has a joint `wrist`\n  help: choose another name"),
    ("joint x --to D --type hinge --parent a.b --child c.d", "expected `fixed`, `revolute`"),
    ("joint x --to D --parent base.top --child arm.seet", "error[TC303]"),
    ("joint x --to D --parent arm.end --child base.origin", "error[TC321]"),
    ("mode x --to D --root nothing", "error[TC302]"),
    ("mode y --to D --root nothing", " was not changed (the diagnostics refer to the new"),
    ("mode x --to D --standing-on arm.seat --root base",
     "--root cannot be combined with a single mount in --standing-on (`arm.seat`)"),
    ("mode x --to D --standing-on arm.sole", "error[TC303]"),
    ("part X --standing-on arm.seat", "--standing-on applies to a mode, not to a part"),
    ("mode x-y --to D", "`x-y` is not a valid name (expected a letter, then letters, digits and `_`)\n  help: write, for example, `x_y`"),
    ("mode x --to D --pose nowhere", "`nowhere`"),
    ("assembly root --to D", "error[TC"),
    ("assembly rover --to D", "` contains itself: rover."),
    ("part class --to D", "`class` is a keyword of Python\n  help: specify a module: `thingc add part class_parts:Class`"),
    ("part numpy", "`numpy` is an installed Python module\n  help: specify a module: `thingc add part numpy_parts:Numpy`"),
    ("part parts:None", "`None` cannot be used as a class name"),
    ("part parts:Box", "`Box` cannot be used as a class name"),
    ("part Hand --to D", "already has a component `hand`"),
    ("part old:Old --new", "`parts/old.py` already has a `Old`"),
    ("part broken:New", "`parts/broken.py` cannot be read as Python: "),
    ("part New --to D --on base.bottom", "error[TC303]"),
    ("mode x --to missing.yaml", "error[TC802]"),
    ("mode true --to D", "`true` is not a valid name (YAML reads another value)"),
    ("part away:New --to D", "the symbolic link `parts/away.py` leads out of the workspace\n  help: use another module"),
])
def test_invalid_additions_are_reported_and_write_nothing(
    words: str, said: str, document: Path, capsys: pytest.CaptureFixture[str],
) -> None:
    parts = document.parent / "parts"
    parts.mkdir()
    (parts / "old.py").write_text("class Old:\n    pass\n")
    (parts / "broken.py").write_text("class\n")
    (parts / "away.py").symlink_to(document.parent.parent / "elsewhere.py")
    (document.parent / "rover.yaml").touch()
    before = {path: path.read_bytes() for path in document.parent.rglob("*") if path.is_file()}
    assert main(["add", *words.replace(" D", f" {document.name}").split()]) in (1, 2)
    out, err = capsys.readouterr()
    assert said in out + err
    after = {path: path.read_bytes() for path in document.parent.rglob("*") if path.is_file() and "__pycache__" not in path.parts}
    assert after == before


def test_invalid_document_is_not_changed(document: Path, capsys: pytest.CaptureFixture[str]) -> None:
    document.write_text(document.read_text().replace("1 kg", "1 mm"))
    assert main(["add", "mode", "x", "--to", document.name, "--format", "json"]) == 1
    assert "TC207" in capsys.readouterr().out and "modes" not in read(document)
    capsys.readouterr()
    document.write_text(YAML_TEXT + "\nmodes:\n  a: {extends: b}\n  b: {extends: a}\n" if document.suffix == ".yaml"
                        else TOML_TEXT + '\n[modes]\na = {extends = "b"}\nb = {extends = "a"}\n')
    before = document.read_text()
    assert main(["add", "mode", "x", "--to", document.name]) == 1
    assert "modes extend each other in a cycle" in capsys.readouterr().out and document.read_text() == before


def test_document_is_compiled_once(document: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    compiled, true = [], pipeline.compile
    monkeypatch.setattr(pipeline, "compile", lambda *given, **more: (compiled.append(given), true(*given, **more))[1])
    assert main(["add", "mode", "x", "--to", document.name]) == 0
    assert len(compiled) == 1
