"""Selection of targets: the command line overrides the workspace, which overrides the defaults."""

from __future__ import annotations

import fnmatch
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from thingc.targets.registry import TARGETS, parse_targets, unknown
from thingc.tools.cli.main import main

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = {path.parent.name for path in (ROOT / "compiler" / "thingc" / "targets").glob("*/__init__.py")}
SHARED = {"render"}
"""Folders in `targets` that are not targets."""

ROBOT = """\
thingc: assembly/1
name: r
components:
  base: {frame: true, mass: 1 kg, inertia: {ixx: 1 kg*mm^2, iyy: 1 kg*mm^2, izz: 1 kg*mm^2}}
modes: {m: {root: base, base: fixed}}
"""


def matches_pattern(path: str, pattern: str) -> bool:
    """Whether a file or folder of the documented build folder matches a pattern, or contains files that match."""
    words = pattern.split("/")
    begin = words[: path.rstrip("/").count("/") + 1]
    return path.endswith("/") == (len(begin) < len(words)) and fnmatch.fnmatch(path.rstrip("/"), "/".join(begin))


@pytest.mark.parametrize("name", sorted(FOLDERS - SHARED))
def test_every_target_is_declared_and_tested(name: str) -> None:
    """Each folder in `targets` declares a target, lists its files and has a test that imports its emitter."""
    assert name in TARGETS, f"`TARGET` is missing in targets/{name}/__init__.py"
    target = TARGETS[name]
    for pattern in target.writes:
        where = f"the `files` of targets/{name}/__init__.py, which make the picture of the build folder"
        assert any(matches_pattern(path, pattern) for path in target.files), f"`{pattern}` is missing in {where}"
    tests = "\n".join(path.read_text() for path in (ROOT / "tests").rglob("*.py"))
    module, _, function = target.emitter.partition(":")
    package, _, stem = module.rpartition(".")
    direct, whole = rf"from {module} import [\w, ]*\b{function}\b", rf"from {package} import [\w, ]*\b{stem}\b"
    assert re.search(f"{direct}|{whole}", tests), f"no test imports `{function}` of {module}: add a test of the target `{name}`"


def test_target_positions_are_consecutive() -> None:
    assert [target.position for target in TARGETS.values()] == [*range(1, len(TARGETS) + 1)]


def test_listing_targets_imports_no_emitter() -> None:
    """Importing the registry loads no emitter and no heavy package."""
    script = "import sys, thingc.targets.registry as r; print(*r.TARGETS); print(*sys.modules)"
    output = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout
    names, modules = (set(line.split()) for line in output.splitlines())
    ours = {name for name in modules if name.startswith("thingc.")}
    packages = {f"thingc.targets{end}" for end in ("", ".registry", ".target", *(f".{folder}" for folder in FOLDERS))}
    assert names == FOLDERS - SHARED and {name for name in ours - packages if not name.startswith("thingc.base")} == set()
    assert not modules & {"numpy", "mujoco", "networkx", "trimesh", "pydantic"}


def test_selected_targets_are_in_build_order() -> None:
    """`chosen` returns targets in build order, expands `all`, and returns the default targets for an empty list."""
    assert parse_targets(["urdf,mjcf", "bom"]) == ("mjcf", "urdf", "bom")
    assert parse_targets(["all"]) == parse_targets(["bom", "all"]) and {*parse_targets(["all"])} >= {*TARGETS}
    assert {*parse_targets([])} == {name for name, target in TARGETS.items() if target.unasked}
    assert "mjcf" in parse_targets([]) and "urdf" not in parse_targets([])


def test_unknown_targets_are_reported_with_their_index() -> None:
    """Each unknown target is reported with the index of its argument and a suggestion."""
    wrong = unknown(["mjcf", "stl,mjfc", "al"])
    assert [(index, message) for index, message, _ in wrong] == [(1, "there is no target `mjfc`"), (2, "there is no target `al`")]
    assert ["`mjcf`" in str(wrong[0][2]), "`all`" in str(wrong[1][2])] == [True, True]


@pytest.mark.parametrize(("line", "words", "expected"), [
    ("", [], {"mjcf", "bom"}), ('emit = ["urdf"]', [], {"urdf"}), ('emit = ["urdf"]', ["--emit", "bom"], {"bom"}),
    ('emit = ["bom", "urdf"]', [], {"bom", "urdf"}), ('emit = ["all"]', [], {"mjcf", "urdf", "bom"}),
])
def test_command_line_overrides_workspace(
    tmp_path: Path, shared_store: str, capsys: pytest.CaptureFixture[str], line: str, words: list[str], expected: set[str],
) -> None:
    """`--emit` overrides `emit` in `thingc.toml`, and then a change of the workspace has no effect on the files."""
    (tmp_path / "thingc.toml").write_text(f'thingc = "workspace/1"\n{line}\n')
    (tmp_path / "r.yaml").write_text(ROBOT)
    command = ["build", str(tmp_path / "r.yaml"), "--store", shared_store, *words]
    assert main(command) == 0
    files = json.loads((tmp_path / "build" / "r" / "manifest.json").read_text())["files"]
    assert expected == {path.partition("/")[0].partition(".")[0] for path in files} & {"mjcf", "urdf", "bom"}
    assert main(command) == 0 and "is up to date" in capsys.readouterr().err
    (tmp_path / "thingc.toml").write_text('thingc = "workspace/1"\nemit = ["hag"]\n')
    assert main(command) == 0
    now = json.loads((tmp_path / "build" / "r" / "manifest.json").read_text())["files"]
    assert (now == files) == bool(words)


def test_help_lists_every_target(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["build", "--help"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert all(f"{name} ({target.says})" in said for name, target in TARGETS.items())


SCREW = """\
thingc: assembly/1
name: r
components:
  base: {frame: true, mass: 1 kg, inertia: {ixx: 1 kg*mm^2, iyy: 1 kg*mm^2, izz: 1 kg*mm^2}}
  nut: {frame: true, mass: 1 kg, inertia: {ixx: 1 kg*mm^2, iyy: 1 kg*mm^2, izz: 1 kg*mm^2}}
joints: {spindle: {type: screw, parent: base.origin, child: nut.origin, lead: 2 mm}}
modes: {m: {root: base, base: fixed}}
"""


def test_losses_depend_on_selected_targets(
    tmp_path: Path, shared_store: str, capsys: pytest.CaptureFixture[str],
) -> None:
    """`thingc why --losses` lists losses of the targets from `--emit`, the workspace or the defaults. Unknown targets are errors at
    their place."""
    (tmp_path / "r.yaml").write_text(SCREW)
    document = str(tmp_path / "r.yaml")

    def lost(*words: str) -> set[str]:
        assert main(["why", "--losses", document, "--store", shared_store, *words]) == 0
        return {line.split(": ")[1].split(" ")[0] for line in capsys.readouterr().out.splitlines()}

    assert "mjcf" in lost() and "urdf" not in lost() and lost("--emit", "urdf") == {"urdf"} and lost("--emit", "all") >= {"mjcf", "urdf"}
    (tmp_path / "thingc.toml").write_text('thingc = "workspace/1"\nemit = ["urdf"]\n')
    assert lost() == {"urdf"}
    assert main(["build", document, "--emit", "urdf,mjcf", "-o", str(tmp_path / "out"), "--store", shared_store]) == 0
    assert f"thingc why --losses {document} --emit=urdf,mjcf" in capsys.readouterr().err
    assert main(["why", "--losses", document, "--emit", "urfd", "--store", shared_store]) == 2
    assert "there is no target `urfd`" in capsys.readouterr().err
    (tmp_path / "thingc.toml").write_text('thingc = "workspace/1"\nemit = ["urfd"]\n')
    assert main(["why", "--losses", document, "--store", shared_store]) == 1
    assert "thingc.toml:2:9" in capsys.readouterr().err


def test_build_ends_with_loss_count_and_summary(
    tmp_path: Path, shared_store: str, capsys: pytest.CaptureFixture[str],
) -> None:
    """Losses are counted by target in one line before the summary. Custom data (the velocity limit in MJCF) is not a loss."""
    document = tmp_path / "r.yaml"
    arm = "  arm: {frame: true, mass: 1 kg, inertia: {ixx: 1 kg*mm^2, iyy: 1 kg*mm^2, izz: 1 kg*mm^2}}\n"
    limit = "{lower: -1 rad, upper: 1 rad, velocity: 1 rad/s}"
    joint = f"joints: {{j: {{type: revolute, parent: base.origin, child: arm.origin, limit: {limit}, dynamics: {{armature: 1 g*m^2}}}}}}\n"
    document.write_text(ROBOT.replace("modes:", arm + joint + "modes:"))

    def build(*words: str) -> list[str]:
        assert main(["build", str(document), "-o", str(tmp_path / "out"), "--store", shared_store, *words]) == 0
        return capsys.readouterr().err.splitlines()

    (last,) = build("--emit", "mjcf")
    assert last.startswith("Built ") and "out/r: " in last
    losses, last = build("--emit", "mjcf,urdf,sdf")
    assert losses == f"2 export losses (1 in urdf, 1 in sdf); to list: thingc why --losses {document} --emit=mjcf,urdf,sdf"
    assert last.startswith("Built ")
    (same,) = build("--emit", "mjcf")
    assert "is up to date" in same, "the losses of targets that were not asked for are not repeated"


def test_similar_losses_are_merged(tmp_path: Path, shared_store: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Losses that differ only in numbers, elements or modes are printed on one line."""
    mass = "mass: 1 kg, inertia: {ixx: 1 kg*mm^2, iyy: 1 kg*mm^2, izz: 1 kg*mm^2}"
    document = tmp_path / "r.yaml"
    dynamics = ("armature: 2 kg*mm^2", "armature: 2 kg*mm^2, stiffness: 1 N*m/rad", "stiffness: 2.5 N*m/rad")
    document.write_text("\n".join([
        "thingc: assembly/1", "name: r", "components:", *(f"  c{k}: {{frame: true, {mass}}}" for k in range(4)), "joints:",
        *(
            f"  j{k}: {{type: continuous, parent: c{k}.origin, child: c{k + 1}.origin, dynamics: {{{one}}}}}"
            for k, one in enumerate(dynamics)
        ),
        "modes:", "  m: {root: c0, base: held}", "  n: {root: c1, base: held}", "",
    ]))
    assert main(["why", "--losses", str(document), "--emit", "urdf", "--store", shared_store]) == 0
    assert [line.partition("r.yaml:")[2] for line in capsys.readouterr().out.splitlines()] == [
        "9: urdf: j0, j1: the armature of 2e-06 kg m^2 (omitted)",
        "10: urdf: j1, j2: the stiffness of ... N m/rad (omitted)",
        "13: urdf: modes m, n: the motion of the held base: the base is fixed in the file (approximated)",
    ]


@pytest.mark.parametrize(("words", "said"), [
    (["--emit", ""], "`--emit` requires a target"), (["--emit", ","], "`--emit` requires a target"),
    (["--emit", "urdf", "--compat", "mjx"], "`--compat` requires the target `mjcf`"),
])
def test_empty_or_unused_options_are_usage_errors(tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], said: str) -> None:
    """An empty `--emit`, or `--compat` without MuJoCo models, is a usage error, and no file is written."""
    (tmp_path / "r.yaml").write_text(SCREW)
    assert main(["build", str(tmp_path / "r.yaml"), "-o", str(tmp_path / "out"), *words]) == 2
    assert said in capsys.readouterr().err and not (tmp_path / "out").exists()
