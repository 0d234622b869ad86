"""`thingc check --fix`: which errors are fixed, which are not, and that a fix never makes a document worse."""

from __future__ import annotations

import json
import shutil
from collections import Counter
from pathlib import Path

import pytest

from layout.mutants import slips
from thingc.base.source import Edit, Span
from thingc.base.suggestions import closest_name
from thingc.documents.format.autofix import locate_edit
from thingc.tools.cli.main import main


@pytest.mark.parametrize(("written", "known", "found"), [
    ("plte", ["plate", "base"], "plate"), ("plaate", ["plate"], "plate"), ("palte", ["plate"], "plate"), ("Plate", ["plate"], "plate"),
    ("plote", ["plate"], "plate"), ("PLATE", ["plate"], "plate"), ("kp", ["kpp", "kv"], "kpp"),
    ("tip", ["top"], None), ("hip_1", ["hip_0"], None), ("hip_12", ["hip_1"], None), ("kx", ["kp", "kv"], None), ("k", ["kp"], None),
    ("plt", ["plate"], None), ("soe", ["sole", "shoe"], None), ("plate", ["plate", "plates"], None), ("plate", [], None),
    ("lpaet", ["plate"], None),
])
def test_closest_name_of_a_typo(written: str, known: list[str], found: str | None) -> None:
    assert closest_name(written, known) == found


@pytest.mark.parametrize(("written", "stretch", "place"), [
    ("b", "a.b.c", (12, 13)), ("mm", "120mm", (13, 15)), ("deg", "0 0 4deg", (15, 18)), ("a", "a.a", None), ("x", "abc", None),
    ("b", "bb.b_b", None), ("1,5 mm", "1,5 mm", (10, 16)),
])
def test_edit_is_located_in_the_text(written: str, stretch: str, place: tuple[int, int] | None) -> None:
    text = f"# a comment\n{stretch} b mm\n"
    start = text.index("\n") + 1
    span = Span(file="/a.yaml", line=2, column=1, end_line=2, end_column=1 + len(stretch))
    found = locate_edit(Edit(span=span, written=written, replacement=""), text)
    assert found == (None if place is None else (place[0] - 10 + start, place[1] - 10 + start))


ROBOT = """\
thingc: assembly/1
name: robot
parameters: {reach: 100 mm, half: =reach / 2}     # how far
components:
  plate: {frame: true, mounts: {top: {xyz: 0 0 4 mm}, side: {xyz: [4 mm, 0, 0]}}}
  lever: {frame: true, at: {in: plate.top, xyz: "0 0 10 mm"}, bom: {number: "47", make: buy}}
  finger: {frame: true, at: {in: plate.top, rpy: 0 30 0 deg}}
  pusher: {frame: true, mass: 12 g, com: 0 0 1 mm, collision: hull, inertia: {ixx: 2e-6 kg*m^2, iyy: 2e-6 kg*m^2, izz: 2e-6 kg*m^2}}
  slider: {frame: true, at: {in: lever.origin}}
joints:
  slide:
    type: prismatic
    parent: plate.side
    child: pusher.origin
    limit: {lower: 0, upper: "=min(reach, 80 mm)"}
    gap: 1.5 mm
poses: {out: {slide: 10 mm}, half: {slide: =half}}
modes: {bench: {root: plate, pose: out}}
"""


def fixed(folder: Path, text: str, *options: str) -> tuple[int, str]:
    """Return the exit code of `check --fix`, and the resulting document."""
    file = folder / "robot.yaml"
    file.write_bytes(text.encode())
    return main(["check", "--fix", *options, str(file)]), file.read_bytes().decode()


@pytest.fixture(autouse=True)
def here(tmp_path: Path, shared_store: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Use the temporary folder as working folder, and the store that all tests share."""
    monkeypatch.setenv("THINGC_STORE", shared_store)
    monkeypatch.chdir(tmp_path)


def test_valid_document_is_unchanged(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert fixed(tmp_path, ROBOT) == (0, ROBOT), capsys.readouterr().out


@pytest.mark.parametrize(("right", "wrong"), [
    ("collision: hull", "colision: hull"), ("collision: hull", "collision: hul"), ("type: prismatic", "type: Prismatic"),
    ("10 mm}, half", "10 MM}, half"), ("0 30 0 deg", "0 30 0 degree"), ("0 0 1 mm", "0 0 1 milimeter".replace("mili", "milli")),
    ("gap: 1.5 mm", "gap: 1,5 mm"), ("12 g", "12 gram"), ("{slide: 10 mm}", "{slied: 10 mm}"), ('"47"', "47"),
    ("half: =reach / 2", "half: =reahc / 2"), ("thingc: ", "tingc: "), ("assembly/1", "asembly/1"), ("components:", "componets:"),
    ("lever: {frame: true, at", "lever: {frame: true, att"), ("root: plate", "root: plaet"), ("plate.side", "palte.side"),
    ('"=min(reach, 80 mm)"', "=min(reach, 80 mm)"), ('"=min(reach, 80 mm)"', '"min(reach, 80 mm)"'), ("{slide: =half}", "{slide: =hlaf}"),
    ('=min(reach', '=mni(reach'),
])
def test_typo_is_fixed_exactly(tmp_path: Path, right: str, wrong: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert ROBOT.count(right) >= 1
    for ends in ("\n", "\r\n"):
        text = ROBOT.replace("\n", ends)
        slip = text.replace(right, wrong, 1)
        assert fixed(tmp_path, slip) == (0, text), capsys.readouterr().out
        said = capsys.readouterr().out
        assert "fixed `" in said and "1 place fixed, no diagnostics remain" in said


@pytest.mark.parametrize(("right", "wrong"), [
    ("gap: 1.5 mm", "gap: 1,500 mm"), ("gap: 1.5 mm", "gap: 1.5"), ("12 g", "12 G"), ("12 g", "12 dg"),
    ("pose: out", "pose: ot"), ("pusher: {", "puser: {"), ("plate.top, xyz", "plate.tip, xyz"), ("side: {", "sied: {"),
    ("slide:\n", "silde:\n"), ("10 mm}, half", "10}, half"),
])
def test_ambiguous_mistakes_are_not_fixed(tmp_path: Path, right: str, wrong: str) -> None:
    slip = ROBOT.replace(right, wrong, 1)
    assert slip != ROBOT
    assert fixed(tmp_path, slip) == (1, slip)


@pytest.mark.parametrize(("written", "mended"), [
    ("{adhesion: {plate.top: 300}}", "{adhesion: {plate.top: 300 N}}"), ("{adhesion: {plate.top: 0.5}}", "{adhesion: {plate.top: 0.5 N}}"),
])
def test_missing_unit_is_added_if_unambiguous(tmp_path: Path, written: str, mended: str) -> None:
    wrong = ROBOT.replace("pose: out}}", f"pose: out, contacts: {written}, gravity: [0, 0, -1.62]}}}}")
    right = ROBOT.replace("pose: out}}", f"pose: out, contacts: {mended}, gravity: [0, 0, -1.62 m/s^2]}}}}")
    assert fixed(tmp_path, wrong) == (0, right)


@pytest.mark.parametrize(("type", "limit", "mended"), [
    ("prismatic", "{lower: 0, upper: 9 mm}", "{kind: position, kp: 20 N/m, kv: 0.5 N*s/m}"),
    ("revolute", "{lower: 0, upper: 9 deg}", "{kind: position, kp: 20 N*m/rad, kv: 0.5 N*m*s/rad}"),
])
@pytest.mark.parametrize("defaults", [False, True])
def test_gains_get_the_unit_of_their_joint(tmp_path: Path, type: str, limit: str, mended: str, defaults: bool) -> None:
    def robot(drive: str) -> str:
        return (
            "thingc: assembly/1\nname: robot\n" + (f"defaults: {{joint: {{drive: {drive}}}}}\n" if defaults else "")
            + "components:\n  plate: {frame: true}\n"
            + "  arm: {frame: true, mass: 1 g, inertia: {ixx: 1e-7 kg*m^2, iyy: 1e-7 kg*m^2, izz: 1e-7 kg*m^2}}\n"
            + f"joints:\n  j: {{type: {type}, parent: plate.origin, child: arm.origin, limit: {limit}"
            + ("}\n" if defaults else f", drive: {drive}}}\n")
        )

    assert fixed(tmp_path, robot("{kind: position, kp: 20, kv: 0.5}")) == (0, robot(mended))


@pytest.mark.parametrize(("written", "mended"), [("1270", "1270 kg/m^3"), ("100", "100 kg/m^3"), ("1.27", None), ("99", None)])
def test_density_without_a_unit(tmp_path: Path, written: str, mended: str | None) -> None:
    """1.27 may be grams per cubic centimetre; 1270 in that unit is heavier than any material."""
    file = tmp_path / "materials.yaml"
    file.write_text(f"thingc: materials/1\nmaterials: {{petg: {{density: {written}}}}}\n")
    assert main(["check", "--fix", str(file)]) == (1 if mended is None else 0)
    assert f"density: {mended or written}}}" in file.read_text()


@pytest.mark.parametrize(("right", "wrong"), [
    ("limit: {lower: 0, upper:", "limit: {min: 0, max:"), ("type: prismatic", "type: slider"),
    ("collision: hull", "collision: convex_hull"),
    ("xyz: 0 0 4 mm", "pos: 0 0 4 mm"), ("make: buy", "make: bought"), ("at: {in: lever.origin}", "at: {frame: lever.origin}"),
    ("side: {xyz: [4 mm, 0, 0]}", "side: {xyz: 4 mm, 0, 0}"),
])
def test_terms_of_other_formats_are_fixed(tmp_path: Path, right: str, wrong: str) -> None:
    slip = ROBOT.replace(right, wrong, 1)
    assert slip != ROBOT
    assert fixed(tmp_path, slip) == (0, ROBOT)


@pytest.mark.parametrize(("written", "mended"), [
    ("long * 0.8", "=long * 0.8"), ("long", "=long"), ('"${long * 0.8}"', '"=long * 0.8"'), ('"{{ long }}"', '"=long"'),
    ("=long * 0.8 mm", None), ("short * 0.8", None),
])
def test_missing_equals_sign_of_an_expression_is_added(tmp_path: Path, written: str, mended: str | None) -> None:
    """The parameter that receives the value is known to be a length, and the available names are known."""
    (tmp_path / "leg.yaml").write_text(ROBOT)
    nest = "thingc: assembly/1\nname: nest\nparameters: {long: 100 mm}\ncomponents:\n  leg: {assembly: leg.yaml, parameters: {reach: X}}\n"
    assert fixed(tmp_path, nest.replace("X", written)) == (1 if mended is None else 0, nest.replace("X", mended or written))


def test_errors_hidden_by_others_are_fixed_in_the_same_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    slip = ROBOT.replace("components:", "componets:").replace("frame: true, mass", "frme: true, mass").replace("plate.side", "palte.side")
    slip = slip.replace("gap: 1.5 mm", "gap: 1.5")
    code, text = fixed(tmp_path, slip)
    said = capsys.readouterr().out
    assert code == 1 and text == ROBOT.replace("gap: 1.5 mm", "gap: 1.5")
    assert said.startswith(
        "robot.yaml:4: fixed `componets` -> `components`\n"
    ) and "robot.yaml:8: fixed `frme` -> `frame`\n" in said and "robot.yaml:13: fixed `palte` -> `plate`\n" in said
    assert "TC206" in said and said.endswith("1 error\n")


def test_change_without_improvement_is_not_made(tmp_path: Path) -> None:
    # `=reach_ / 2` is an expression, but of a name that nobody knows: the `=` alone mends nothing
    slip = ROBOT.replace("gap: 1.5 mm", "gap: nothing / 2")
    assert fixed(tmp_path, slip) == (1, slip)


def test_diff_and_json_output(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    slip = ROBOT.replace("collision: hull", "colision: hull")
    assert fixed(tmp_path, slip, "--diff") == (0, slip)
    said = capsys.readouterr().out
    assert "\n-  pusher: {frame: true, mass: 12 g, com: 0 0 1 mm, colision: hull, " in said and "\n+  pusher: " in said
    assert said.endswith("would fix 1 place, 0 diagnostics would remain\n")
    assert main(["check", "--format", "json", "robot.yaml"]) == 1
    (diagnostic,) = json.loads(capsys.readouterr().out)["diagnostics"]
    assert diagnostic["fixes"] == [{
        "file": "robot.yaml", "line": 8, "column": 52, "end_line": 8, "end_column": 60, "written": "colision", "replacement": "collision",
    }]
    assert fixed(tmp_path, slip, "--format", "json") == (0, ROBOT)
    answer = json.loads(capsys.readouterr().out)
    assert answer == {
        "diagnostics": [], "mended": [{"file": "robot.yaml", "line": 8, "written": "colision", "replacement": "collision"}],
    }


def test_fix_edits_nested_documents_inside_the_workspace_only(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "thingc.toml").write_text('thingc = "workspace/1"\n')
    (tmp_path / "in" / "hand.yaml").write_text("thingc: assembly/1\nname: hand\ncomponents: {palm: {fraem: true}}\n")
    (tmp_path / "in" / "robot.yaml").write_text(
        "thingc: assembly/1\nname: robot\nmaterials: [../far.yaml]\ncomponents: {hand: {assembly: hand.yaml}}\n"
    )
    far = "thingc: materials/1\nmaterials: {petg: {denstiy: 1 kg/m^3}}\n"
    (tmp_path / "far.yaml").write_text(far)
    assert main(["check", "--fix", "in/robot.yaml"]) == 1
    assert "{frame: true}" in (tmp_path / "in" / "hand.yaml").read_text()
    assert (tmp_path / "far.yaml").read_text() == far


def test_invalid_command_lines(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", "--diff", "robot.yaml"]) == 2 and main(["check", "--fix", "--no-code", "robot.yaml"]) == 2
    assert main(["check", "--fix", "nowhere.yaml"]) == 2
    assert capsys.readouterr().out.count("TC801") == 2


@pytest.mark.parametrize(("checked", "changed"), [
    ("arm.yaml", "arm.yaml"), ("arm.yaml", "end_effector.yaml"), ("arm.yaml", "materials.yaml"), ("minchw/leg.yaml", "minchw/leg.yaml"),
])
def test_typos_in_real_documents_are_restored_or_kept(
    root: Path, tmp_path: Path, checked: str, changed: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """No mutant becomes a third text. Of the mutants that thingc rejects, at least three quarters are restored exactly."""
    for name in ("assemblies", "parts"):
        shutil.copytree(root / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(root / "thingc.toml", tmp_path)
    documents = {path: path.read_bytes() for path in (tmp_path / "assemblies").rglob("*.yaml")}
    file = tmp_path / "assemblies" / changed
    good = documents[file].decode()
    count: Counter[str] = Counter()
    for mutant in slips(good, 8, seed=3):
        file.write_text(mutant.text)
        code = main(["check", "--fix", f"assemblies/{checked}"])
        said = capsys.readouterr().out
        assert "TC899" not in said
        others = {path for path, data in documents.items() if path != file and path.read_bytes() != data}
        now = file.read_text()
        assert now in (good, mutant.text) and not others, (mutant.word, mutant.slip, said)
        count["restored" if now == good else "still right" if code == 0 else "left"] += 1
    assert count["restored"] >= 0.75 * (count["restored"] + count["left"]), count
    assert count["restored"] >= 4, count
