"""The command line for scripts: only JSON on standard output, exit codes, imported modules, and equal results from Python."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from textwrap import dedent
from typing import Any

import pytest

import thingc as package
from conformance.conftest import ARM
from conformance.harness import COMMAND, ROOT, build, build_here, environment, replace, thingc, thingc_here, tree, write

HEAVY = (
    "numpy", "scipy", "networkx", "trimesh", "manifold3d", "mujoco", "OCP", "build123d", "coacd", "rich", "typer", "jsonschema",
)
LOADED = f"""
import json, sys
from thingc.tools.cli.main import main
code = main(json.loads(sys.argv[1]))
print(json.dumps([code, [name for name in {HEAVY!r} if name in sys.modules]]), file=sys.stderr)
"""


@pytest.fixture
def copy(arm: Path, tmp_path: Path) -> Path:
    """A copy of the workspace in another folder. Its parts are in the store."""
    for name in ("assemblies", "parts"):
        shutil.copytree(ROOT / name, tmp_path / "ws" / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "thingc.toml", tmp_path / "ws")
    return tmp_path / "ws"


def loaded(words: Sequence[str], store: str, cwd: Path, also: tuple[str, ...] = ()) -> tuple[str, list[str]]:
    """Return the standard error of a successful command, and the heavy modules that were imported at its end."""
    program = LOADED.replace(repr(HEAVY), repr(HEAVY + also))
    done = subprocess.run(
        [sys.executable, "-c", program, json.dumps(words)], cwd=cwd, env=environment(store), capture_output=True, text=True,
        check=True,
    )
    *said, last = done.stderr.splitlines()
    code, found = json.loads(last)
    assert code == 0, done.stderr
    return "\n".join(said), found


@pytest.mark.parametrize("words", [
    ("check", ARM), ("info", ARM), ("hag", ARM, "--format", "svg"),
    ("why", ARM, "hand/cap"), ("build", ARM, "--emit", "bom,hag,stl"), ("--help",), ("build", "--help"),
], ids=" ".join)
def test_no_heavy_modules_without_geometry(copy: Path, shared_store: str, words: tuple[str, ...]) -> None:
    """All compiler passes run, because no build of this folder is recorded. Records come from the store. This is required for `check`;
    other commands benefit."""
    assert loaded(words, shared_store, copy)[1] == []


def test_unchanged_build_imports_few_modules(arm: Path, shared_store: str) -> None:
    build(ARM, "-o", arm.parent, store=shared_store)
    said, found = loaded(["build", ARM, "-o", str(arm.parent)], shared_store, ROOT, ("pydantic", "yaml", "asyncio", "ctypes"))
    assert "is up to date" in said and found == []


def test_check_of_a_valid_document_has_no_diagnostics(arm: Path, shared_store: str) -> None:
    documents = (ARM, "assemblies/end_effector.yaml")
    ran = thingc("check", *documents, store=shared_store)
    assert (ran.code, ran.out) == (0, "".join(f"{document}: ok\n" for document in documents))
    assert thingc_here("check", *documents, "--format", "json", store=shared_store, cwd=ROOT).answer == {"diagnostics": []}


def test_build_in_json(arm: Path, shared_store: str, tmp_path: Path) -> None:
    answer = build_here(ARM, "-o", tmp_path, "--mode", "bench", "--emit", "mjcf", "--emit", "bom", store=shared_store, cwd=ROOT)
    assert list(answer) == ["diagnostics", "artifacts", "modelled", "reused"]
    paths = {(ROOT / path).resolve() for path in answer["artifacts"]}
    assert paths == {path for path in (tmp_path / "arm").rglob("*") if path.is_file()}
    assert answer["modelled"] == [] and len(answer["reused"]) == 9
    names = {path.relative_to(tmp_path / "arm").as_posix() for path in paths}
    assert {name for name in names if "assets" not in name} == {
        "manifest.json", "joint_order.json", "modes.json", "bom.csv", "bom.json", "mjcf/arm_bench.xml", "mjcf/scene_bench.xml",
    }
    choice = json.loads((tmp_path / "arm" / "manifest.json").read_text())["choice"]
    assert choice == {"modes": ["bench"], "emit": ["mjcf", "bom"], "parameters": {}, "choices": {}}
    answer = build_here(ARM, "-o", tmp_path, "--emit", "hag", "-p", "pen_diameter=9.7 mm", store=shared_store, cwd=ROOT)
    left = {path.name for path in (tmp_path / "arm").rglob("*")}
    assert left == {"manifest.json", "hag.dot", "hag.mmd", "hag.svg"}, "the rest is gone"
    assert json.loads((tmp_path / "arm" / "manifest.json").read_text())["choice"]["parameters"] == {"pen_diameter": "9.7 mm"}
    assert answer["modelled"] == ["arm:Hand(pen_diameter=0.0097)", "arm:OmegaCap(pen_diameter=0.0097)", "arm:PenDummy(diameter=0.0097)"]


def test_info_in_json(arm: Path, shared_store: str) -> None:
    info = thingc_here("info", ARM, "--format", "json", store=shared_store, cwd=ROOT).answer
    assert set(info) == {"diagnostics", "name", "mass", "centre", "inertia", "occurrences", "modes"}
    assert info["name"] == "arm" and len(info["centre"]) == 3 and [len(row) for row in info["inertia"]] == [3, 3, 3]
    assert all(set(o) == {"path", "definition", "mass", "mass_source", "link"} for o in info["occurrences"])
    assert {o["mass_source"] for o in info["occurrences"]} == {"measured", "vendor", "derived", "estimated"}
    board = next(o for o in info["occurrences"] if o["path"] == "bus_board")
    assert board == {"path": "bus_board", "definition": "frame", "mass": 0.012, "mass_source": "measured", "link": "bracket"}
    assert {mode: (found["root"], found["base"]) for mode, found in info["modes"].items()} == {
        "bench": ("plate/origin", "fixed"), "drawing": ("hand/tip", "held"), "adrift": ("bracket/origin", "free"),
    }
    for found in info["modes"].values():
        assert set(found) == {"root", "base", "X_world_root", "links", "joints", "loops"}
        assert sorted(found["links"]) == ["base_link", "bracket", "forearm", "hand_link", "humerus"]
        assert sorted(found["joints"]) == ["elbow", "shoulder", "wrist", "yaw"]
        assert found["loops"] == []
    assert info["modes"]["drawing"]["links"][0] == "hand_link"


def test_parts_in_json(arm: Path, shared_store: str) -> None:
    ran = thingc_here("parts", "arm", "--format", "json", store=shared_store, cwd=ROOT)
    assert ran.code == 0 and ran.answer["diagnostics"] == []
    parts = {part["reference"]: part for part in ran.answer["parts"]}
    names = ("BasePlate", "YawPitchBracket", "RotorBrace", "OmegaCap", "Hand", "PenDummy")
    assert set(parts) == {f"arm:{name}" for name in names}
    brace = parts["arm:RotorBrace"]
    length = next(p for p in brace["parameters"] if p["name"] == "length")
    assert (length["kind"], length["default"], length["minimum"], length["maximum"]) == ("length", 0.1, 0.06, 0.2), "SI"
    assert set(brace["mounts"]) == {"rotor_seat", "servo_seat"}
    assert brace["references"] == ["body", "legs", "next_servo", "turning_servo"]
    assert brace["material"] == "petg" and brace["actuator"] is False


WRONG = {
    "no document": (("build", "assemblies/amr.yaml"), 2),
    "no mode": (("build", ARM, "--mode", "bnech"), 2),
    "no target": (("build", ARM, "--emit", "urdff"), 2),
    "no parameter": (("build", ARM, "-p", "raech=120 mm"), 2),
    "a wrong unit": (("check", ARM, "-p", "reach=3 kg"), 2),
    "out of range": (("info", ARM, "-p", "reach=3 m"), 2),
    "no option": (("build", ARM, "--sturdy"), 2),
    "no command": (("biuld", ARM), 2),
    "a loss that is denied": (("build", ARM, "-o", "{tmp}", "--deny-loss"), 1),
}


@pytest.mark.parametrize("case", WRONG)
def test_exit_codes(arm: Path, shared_store: str, tmp_path: Path, case: str) -> None:
    words, code = WRONG[case]
    ran = thingc_here(*(word.replace("{tmp}", str(tmp_path)) for word in words), store=shared_store, cwd=ROOT)
    assert ran.code == code, ran.out + ran.err
    assert ran.err + ran.out and "Traceback" not in ran.err and list(tmp_path.iterdir()) == []


def test_all_errors_are_reported_at_once_without_output(copy: Path, shared_store: str) -> None:
    arm = copy / "assemblies" / "arm.yaml"
    wrong = {
        "drive: yaw_servo": "drive: yaw_srevo",
        "attach: {bottom: bracket.shoulder_seat}": "attach: {bottom: bracket.shoulder_set}",
        "{shoulder: -150 deg, elbow: 125 deg}": "{shoulder: -150 deg, elbow: 135 deg}",
        "material: petg_red": "material: petg_rde",
        "size: M2.5, length: 8 mm": "size: M2.5, length: 8 deg",
        "{root: bracket, base: free": "{root: brakcet, base: free",
    }
    for old, new in wrong.items():
        replace(arm if old in arm.read_text() else copy / "assemblies" / "end_effector.yaml", old, new)
    lines = {path: (copy / path).read_text().splitlines() for path in (ARM, "assemblies/end_effector.yaml")}
    for command, stream in (("check", "out"), ("build", "err")):
        ran = thingc_here(command, ARM, "--format", "json", store=shared_store, cwd=copy)
        assert ran.code == 1
        found = ran.answer["diagnostics"]
        marked = [lines[entry["file"]][entry["line"] - 1] for entry in found]
        assert all(any(new in line for line in marked) for new in wrong.values()) and len(found) == len(wrong)
        for entry in found:
            assert list(entry) == ["code", "severity", "message", "file", "line", "column", "path", "help", "notes", "fixes"]
            assert entry["severity"] == "error" and 1 <= entry["column"] <= len(lines[entry["file"]][entry["line"] - 1])
        text = thingc_here(command, ARM, store=shared_store, cwd=copy)
        assert text.code == 1 and all(entry["message"] in getattr(text, stream) for entry in found)
        assert "Traceback" not in text.err
    assert not (copy / "build").exists()


def test_strict_turns_warnings_into_errors(copy: Path, shared_store: str) -> None:
    """The effort limit is above that of the servo."""
    replace(copy / "assemblies" / "arm.yaml", "upper: 150 deg}", "upper: 150 deg, effort: 9 N*m}")
    ran = thingc_here("check", ARM, "--format", "json", store=shared_store, cwd=copy)
    assert ran.code == 0 and [entry["severity"] for entry in ran.answer["diagnostics"]] == ["warning"]
    assert "9" in ran.answer["diagnostics"][0]["message"] and "4.1" in ran.answer["diagnostics"][0]["message"]
    strict = thingc_here("build", ARM, "--strict", "--format", "json", store=shared_store, cwd=copy)
    assert strict.code == 1 and [entry["severity"] for entry in strict.answer["diagnostics"]] == ["error"]
    assert strict.answer["artifacts"] == [] and not (copy / "build").exists()


def test_folder_with_other_files_is_not_changed(copy: Path, shared_store: str) -> None:
    mine = copy / "out" / "arm"
    mine.mkdir(parents=True)
    (mine / "thesis.tex").write_text("everything")
    ran = thingc_here("build", ARM, "-o", "out", "--emit", "bom", "--format", "json", store=shared_store, cwd=copy)
    assert ran.code == 2 and "thesis.tex" in ran.answer["diagnostics"][0]["message"]
    assert tree(copy / "out") == {"arm/thesis.tex": b"everything"}


def test_current_outputs_stay_and_outdated_ones_are_removed(tmp_path: Path) -> None:
    """Targets that are built one after another give the same bytes as one build of all. After a change, only the requested targets
    remain."""
    point = """\
        thingc: assembly/1
        name: point
        components: {a: {frame: true, mass: 1 kg, inertia: {ixx: 1 g*m^2, iyy: 1 g*m^2, izz: 1 g*m^2}}}
    """
    write(tmp_path, {"thingc.toml": 'thingc = "workspace/1"\n', "point.yaml": point})
    build = partial(thingc_here, "build", "point.yaml", store=tmp_path / "store", cwd=tmp_path)
    for targets in ("urdf", "bom"):
        assert "removed" not in build("--emit", targets).err
    assert build("--emit", "bom,urdf", "-o", "both").code == 0
    both = tree(tmp_path / "both")
    assert tree(tmp_path / "build") == both and {"point/bom.csv", "point/urdf/point_default.urdf"} <= {*both}
    for words in (["--emit", "urdf"], ["--emit", "bom"], ["--emit", "bom,urdf"]):
        assert build(*words).err == f"build/point is up to date ({len(both)} files)\n"
    (tmp_path / "point.yaml").write_text(dedent(point).replace("mass: 1 kg", "mass: 2 kg"))
    assert build("--emit", "bom").err == (
        "removed 2 files of the previous build: `joint_order.json`, `urdf/point_default.urdf`\n"
        "Built build/point: 3 files; 0 parts modelled, 0 reused\n"
    )
    (tmp_path / "build" / "point" / "bom.csv").unlink()
    assert build("--emit", "urdf").code == 0
    left = {"point/manifest.json", "point/joint_order.json", "point/urdf/point_default.urdf"}
    assert {*tree(tmp_path / "build")} == left, "a damaged build is not current"


def test_raw_attribute_rejected_by_mujoco_has_its_line(copy: Path, shared_store: str) -> None:
    arm = copy / "assemblies" / "arm.yaml"
    replace(arm, "solreflimit: 0.01 1", "solreflimmit: 0.01 1")
    ran = thingc_here("build", ARM, "--format", "json", store=shared_store, cwd=copy)
    (said,) = ran.answer["diagnostics"]
    assert ran.code == 1 and "solreflimmit" in said["message"] and said["file"] == ARM
    assert arm.read_text().splitlines()[said["line"] - 1].startswith("raw:")
    assert not (copy / "build").exists()


def test_module_and_script_are_the_same_program(tmp_path: Path) -> None:
    script = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["scripts"]["thingc"]
    module, _, function = script.partition(":")
    program = f"import sys; sys.argv[0] = 'thingc'; from {module} import {function}; sys.exit({function}())"
    for words in (["build", "--help"], ["check", "nowhere.yaml"]):
        one, other = (
            subprocess.run([*command, *words], cwd=ROOT, env=environment(tmp_path), capture_output=True, text=True)
            for command in (COMMAND, (sys.executable, "-c", program))
        )
        assert (one.returncode, one.stdout, one.stderr) == (other.returncode, other.stdout, other.stderr)
        assert one.stdout


def test_python_api_gives_the_same_files(arm: Path, shared_store: str) -> None:
    compiled = package.compile(str(ROOT / ARM), store=shared_store)
    assert list(compiled.modes) == ["bench", "drawing", "adrift"] and compiled.diagnostics == () and compiled.modelled == ()
    for name, mode in compiled.modes.items():
        assert mode.mjcf().encode() == (arm / "mjcf" / f"arm_{name}.xml").read_bytes()
        assert mode.assets() == tree(arm / "mjcf" / "assets")
        assert mode.model().nbody == 6
    bench = package.compile(str(ROOT / ARM), store=shared_store, modes=["bench"], parameters={"reach": "80 mm"})
    assert list(bench.modes) == ["bench"] and bench.properties.mass < compiled.properties.mass


def test_python_raises_every_diagnostic(tmp_path: Path) -> None:
    (tmp_path / "bad.yaml").write_text("thingc: assembly/1\nname: bad\ncomponents:\n  a: {frame: yes}\ncolour: red\n")
    with pytest.raises(package.CompileError) as caught:
        package.compile(str(tmp_path / "bad.yaml"), store=str(tmp_path / "store"))
    found: tuple[Any, ...] = caught.value.diagnostics
    assert len(found) == 2 and all(d.span.file == str(tmp_path / "bad.yaml") for d in found)
    assert "`colour`" in str(caught.value)
