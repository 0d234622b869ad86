"""`thingc new`: the new robot is valid, builds, passes its tests and stands still in MuJoCo; names, and errors."""

from __future__ import annotations

import json
import os
import re
import runpy
import shutil
import tomllib
from pathlib import Path

import mujoco
import numpy
import pytest
from ruamel.yaml import YAML

import thingc
from thingc.targets.registry import TARGETS
from thingc.tools.cli.main import COMMANDS, main
from thingc.tools.cli.new import robot_name
from thingc.tools.templates import TEMPLATES, files_of

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def here(tmp_path: Path, shared_store: str, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("THINGC_STORE", shared_store)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.slow
def test_new_robot_is_valid_and_passes_its_tests(
    begun: Path, shared_store: str, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setenv("THINGC_STORE", shared_store)
    monkeypatch.chdir(begun.parent)
    documents = sorted(path.name for path in begun.parent.glob("*.yaml"))
    assert main(["check", "--strict", *documents]) == 0
    assert main(["fmt", "--check", "."]) == 0
    assert main(["test", "--strict", "rover.yaml"]) == 0
    out, err = capfd.readouterr()
    assert err == "" and [line for line in out.splitlines() if line.endswith(": ok")] == [f"{name}: ok" for name in documents]
    assert " 0 failed" in out
    assert main(["schema", "--no-model"]) == 0  # the editor's files are those that `thingc schema` writes
    assert ", 0 removed" not in capfd.readouterr().out and not (begun.parent / "my_robot.yaml").exists()


@pytest.mark.slow
def test_modes_of_a_new_robot_have_different_roots(begun: Path) -> None:
    told = json.loads((begun.parent / "build/rover/modes.json").read_text())
    assert len(told) >= 2 and len({json.dumps(mode["root"]) for mode in told.values()}) == len(told)
    things = re.findall(r"^class \w+\(Thing\)", "".join(path.read_text() for path in (begun.parent / "parts").glob("*.py")), re.MULTILINE)
    assert len(things) >= 2
    for mode in told:
        model = mujoco.MjModel.from_xml_path(str(begun.parent / f"build/rover/mjcf/scene_{mode}.xml"))
        data = mujoco.MjData(model)
        assert model.nu > 0 and model.nkey > 0
        mujoco.mj_resetDataKeyframe(model, data, 0)
        start = data.qpos.copy()
        while data.time < 1.0:
            mujoco.mj_step(model, data)
            assert numpy.abs(data.qvel).max() < 3.0, (mode, data.time)
        assert numpy.abs(data.qvel).max() < 0.01 and numpy.abs(data.qpos - start).max() < 0.05, mode


@pytest.mark.slow
@pytest.mark.parametrize("begun", ["legged"], indirect=True)
def test_legged_robot_walks(begun: Path, capsys: pytest.CaptureFixture[str]) -> None:
    runpy.run_path(str(begun.parent / "walk.py"), run_name="__main__")
    ahead, aside, head = map(int, re.findall(r"(-?\d+) cm", capsys.readouterr().out))
    assert ahead > 40 and aside < ahead / 2 and head > 7


def test_walk_script_without_a_build_reports_the_command(tmp_path: Path) -> None:
    (tmp_path / "walk.py").write_text((ROOT / "compiler/thingc/tools/templates/legged/walk.py").read_text())
    with pytest.raises(SystemExit, match="build the robot first: thingc build my_robot.yaml"):
        runpy.run_path(str(tmp_path / "walk.py"), run_name="__main__")


@pytest.mark.slow
@pytest.mark.parametrize("begun", ["legged"], indirect=True)
def test_added_elements_build(begun: Path, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shutil.copytree(begun.parent, here / "rover", ignore=shutil.ignore_patterns("build"))
    os.chdir(here / "rover")
    for words in (
        ["part", "Hat", "--on", "lid.top"], ["joint", "nod", "--parent", "lid.top", "--child", "hat.bottom"], ["assembly", "tail"],
        ["mode", "hung", "--root", "left.sole", "--base", "free"], ["test", "light", "--kind", "mass"],
    ):
        assert main(["add", *words, "--to", "rover.yaml"]) == 0
    assert main(["build", "--strict", "rover.yaml", "--emit", "mjcf"]) == 0
    assert main(["fmt", "--check", "."]) == 0
    out, err = capsys.readouterr()
    assert "warning" not in out + err and "error" not in out + err


@pytest.mark.parametrize("template", TEMPLATES)
def test_other_written_files(template: str, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["new", "rover", "--template", template]) == 0
    said = capsys.readouterr().out
    folder = here / "rover"
    assert said.startswith(f"rover: {TEMPLATES[template]}\n\n  cd rover\n  thingc check rover.yaml ")
    readme = (folder / "README.md").read_text()
    for text in (said, readme):
        commands = re.findall(r"^ *thingc (\w+) rover\.yaml ", text, re.MULTILINE)
        assert commands[:2] == ["check", "view"] and {"build", "test", "watch"} <= set(commands) <= set(COMMANDS)
    steps = re.findall(r"^  python (.+?)   ", said, re.MULTILINE)
    assert len(steps) == 1 and (steps == ["walk.py"]) == (template == "legged")
    if template != "legged":  # the scene of the first mode
        first = next(iter(YAML(typ="safe").load((folder / "rover.yaml").read_text())["modes"]))
        assert steps == [f"-m mujoco.viewer --mjcf=build/rover/mjcf/scene_{first}.xml"]
    for target in re.findall(r"\]\(([^)]+)\)", readme):
        assert target.startswith("https://") or (folder / target).exists()
    assert sorted(os.listdir(folder / ".vscode")) == ["extensions.json"] and not (folder / ".thingc").exists()
    assert tomllib.loads((folder / "thingc.toml").read_text()) == {"thingc": "workspace/1"}
    assert "build/" in (folder / ".gitignore").read_text().split()
    assert not any(b"my_robot" in path.read_bytes() for path in folder.rglob("*") if path.is_file())
    assert not any("my_robot" in path.name or path.name.startswith("dot_") for path in folder.rglob("*"))
    assert sorted(os.listdir(here)) == ["rover"]


def test_gate_of_a_new_workspace_equals_the_documentation() -> None:
    job = YAML(typ="safe").load(files_of("arm", "rover")[".github/workflows/robots.yaml"])["jobs"]["robots"]
    action = next(step for step in job["steps"] if step.get("uses", "").startswith("thingc/"))
    assert action["uses"] == f"thingc/thingc@v{thingc.__version__}" and action["uses"] in (ROOT / "docs/gate.md").read_text()
    inputs = YAML(typ="safe").load((ROOT / "action.yml").read_text())["inputs"]
    assert set(action["with"]) <= set(inputs)
    assert set(action["with"]["options"].removeprefix("--emit ").split(",")) <= set(TARGETS)
    assert {"run": "thingc test rover.yaml"}.items() <= job["steps"][-1].items()


@pytest.mark.parametrize(("place", "name"), [
    ("rover", "rover"), ("my-rover", "my_rover"), ("my rover", "my_rover"), ("a/b/rover.v2/", "rover_v2"), ("class", "class"),
    ("numpy", "numpy"), ("../Rover_3", "Rover_3"), ("x-", "x"),
    ("über", "uber"), ("a/Größe 2", "Grosse_2"), ("rover.d", "rover_d"),
])
def test_robot_name_is_the_last_word_of_its_folder(place: str, name: str) -> None:
    assert robot_name(place) == name


@pytest.mark.parametrize("name", ["class", "numpy", "arm"])
def test_python_keywords_and_module_names_are_valid_names(name: str, here: Path) -> None:
    assert main(["new", name]) == 0
    assert main(["check", "--strict", f"{name}/{name}.yaml"]) == 0


@pytest.mark.parametrize(("words", "said"), [
    (["3d"], "then letters, digits and `_`)\n  help: write, for example, `thingc new robot_3d`"),
    (["機械"], "`機械` is not a valid name"),
    (["--", "-x"], "`-x` would be parsed as an option\n  help: choose a name that starts with a letter"),
    (["a/rover.YAML"], "expected a folder, found the document name `rover.YAML`\n  help: write `thingc new a/rover`"),
    ([".."], "cannot create a folder `..`"),
    (["/"], "cannot create a folder `/`"),
    (["a/b\nc"], "is not a valid name"),
    (["World"],
     "`World` is a reserved name in the files of a robot\n  help: write, for example, `thingc new World_robot`"),
    (["scene"], "`scene` is a reserved name"),
    (["true"], "`true` is a reserved name in the files of a robot\n  help: write, for example, `thingc new true_robot`"),
    (["Null"], "`Null` is a reserved name"),
    (["."], "error[TC805]: the folder `.` is not empty: `full`\n  help: choose another name, or move the content of the folder"),
    ([""], "cannot create a folder ``"),
    (["Leg", "--template", "legged"], "invalid robot name: `Leg` is the name of another document of the template `legged`"),
    (["x", "--template", "leged"], "expected `arm`, `legged`, `gripper` or `empty`, found `leged` (did you mean `legged`?)"),
    (["x", "--template", "rocket"], "expected `arm`, `legged`, `gripper` or `empty`, found `rocket`\n"),
    (["full"], "error[TC805]: the folder `full` is not empty: `file`\n  help: choose another name, or move the content of the folder"),
    (["full/file"], "error[TC805]: the file `full/file` already exists"),
    (["full/file/rover"], "error[TC805]: cannot create `full/file/rover`: file exists (`full/file`)"),
    ([], "the command requires NAME"),
])
def test_errors_write_nothing(
    words: list[str], said: str, here: Path, capsys: pytest.CaptureFixture[str],
) -> None:
    (here / "full").mkdir()
    (here / "full/file").write_text("mine")
    assert main(["new", *words]) == 2
    assert said in capsys.readouterr().err
    assert sorted(path.relative_to(here).as_posix() for path in here.rglob("*")) == ["full", "full/file"]


@pytest.mark.parametrize("place", ["my-rover", "."])
def test_empty_folder_with_git_is_used(
    place: str, here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:
    (here / "my-rover/.git").mkdir(parents=True)
    (here / "my-rover/.git/HEAD").write_text("mine")
    monkeypatch.chdir(here / "my-rover" if place == "." else here)
    before = (here / "my-rover").stat().st_ino
    assert main(["new", place, "--template", "empty"]) == 0
    said = capsys.readouterr().out.splitlines()
    assert said[0] == f"{'my_rover' if place == '.' else 'my-rover'}: {TEMPLATES['empty']}"
    assert ("  cd my-rover" in said) == (place != ".") and any(line.startswith("  thingc check my_rover.yaml ") for line in said)
    assert (here / "my-rover").stat().st_ino == before and (here / "my-rover/.git/HEAD").read_text() == "mine"
    assert {".git", ".gitignore", "my_rover.yaml", "parts", "thingc.toml"} <= set(os.listdir(here / "my-rover"))
    assert not any("thingc-" in name for name in (*os.listdir(here), *os.listdir(here / "my-rover")))
    assert main(["check", "--strict", str(here / "my-rover/my_rover.yaml")]) == 0


@pytest.mark.parametrize("instant", ["thingc.driver.output._write_files", "os.rename"])
def test_interrupt_leaves_no_files(
    instant: str, here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(instant, interrupt)
    assert main(["new", "rover", "--template", "empty"]) == 130
    assert os.listdir(here) == []


def test_interrupt_while_files_are_moved_restores_the_folder(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (here / "rover/.git").mkdir(parents=True)
    rename, moved = os.rename, []

    def interrupt(old: str, new: str) -> None:
        rename(old, new)
        moved.append(new)
        if len(moved) == 3:
            raise KeyboardInterrupt

    monkeypatch.setattr("os.rename", interrupt)
    assert main(["new", "rover", "--template", "empty"]) == 130
    assert len(moved) == 3 and os.listdir(here) == ["rover"] and os.listdir(here / "rover") == [".git"]


def test_kill_while_files_are_moved_can_be_continued(
    here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["new", "whole/rover", "--template", "empty"]) == 0
    (here / "rover/.git").mkdir(parents=True)
    rename = os.rename

    def killed(old: str, new: str) -> None:
        rename(old, new)
        if new.endswith("README.md"):
            os._exit(137)

    child = os.fork()
    if not child:
        monkeypatch.setattr("os.rename", killed)
        main(["new", "rover", "--template", "empty"])
        os._exit(0)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 137
    left = {name for name in os.listdir(here / "rover") if "thingc-" not in name}
    assert "README.md" in left and "rover.yaml" not in left

    (here / "rover/.gitignore").write_text("mine\n")
    assert main(["new", "rover", "--template", "empty"]) == 2
    assert "the folder `rover` is not empty: `.gitignore`\n" in capsys.readouterr().err
    shutil.copy(here / "whole/rover/.gitignore", here / "rover")
    assert main(["new", "rover", "--template", "empty"]) == 0
    (here / "rover/.git").rmdir()
    whole, made = (
        {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
        for folder in (here / "whole/rover", here / "rover")
    )
    assert made == whole
