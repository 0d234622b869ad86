"""The files for releases agree with the package: workflows, the image, the conda recipe and the notebook."""

from __future__ import annotations

import json
import re
import runpy
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest
import yaml
from packaging.requirements import Requirement

from thingc.tools.cli.main import COMMANDS

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yaml"))
VERSIONS = re.findall(r"Python :: (3\.\d+)$", "\n".join(PROJECT["classifiers"]), re.MULTILINE)


def jobs(name: str) -> dict[str, Any]:
    found: dict[str, Any] = yaml.safe_load((ROOT / ".github" / "workflows" / name).read_text())["jobs"]
    return found


@pytest.mark.slow
def test_workflows_are_well_formed() -> None:
    command = [str(Path(sys.executable).parent / "check-jsonschema"), "--builtin-schema", "vendor.github-workflows", *map(str, WORKFLOWS)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert len(WORKFLOWS) == 2 and done.returncode == 0, done.stdout


def test_actions_are_pinned_to_commits() -> None:
    used = re.findall(r"uses: *(\S+)(.*)", "".join(path.read_text() for path in WORKFLOWS))
    assert len(used) > 5
    for action, comment in used:
        assert re.fullmatch(r"[\w.-]+/[\w.-]+@[0-9a-f]{40}", action) and re.fullmatch(r"  # v\d+\.\d+\.\d+", comment), action
    ours = (ROOT / "action.yml").read_text()
    pins = dict(action.split("@") for action, _ in used)
    for action, commit in re.findall(r"uses: (\S+)@(\S+)", ours):
        assert pins.get(action, commit) == commit


def test_only_the_publishing_job_can_request_a_token() -> None:
    for path in WORKFLOWS:
        assert yaml.safe_load(path.read_text())["permissions"] == {"contents": "read"}
        for name, job in jobs(path.name).items():
            expected = {"pypi": {"id-token": "write"}, "github": {"contents": "write"}}.get(name)
            assert job.get("permissions") == expected and (name != "pypi" or job["environment"]["name"] == "pypi")


def test_tested_python_versions_are_declared() -> None:
    makefile = (ROOT / "Makefile").read_text()
    assert jobs("tests.yaml")["tests"]["strategy"]["matrix"]["python"] == VERSIONS
    assert re.search(r"^PYTHONS \?= (.*)$", makefile, re.MULTILINE)[1].split() == VERSIONS  # type: ignore[index]
    assert PROJECT["requires-python"] == f">={VERSIONS[0]}"


def test_make_commands_exist() -> None:
    text = "".join(path.read_text() for path in (*WORKFLOWS, ROOT / "docs" / "install.md", ROOT / "packaging" / "Dockerfile"))
    targets = set(re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    used = set(re.findall(r"(?:run: |^|`|#   )make ([\w-]+)", text, re.MULTILINE))
    assert {"test", "release"} <= used <= targets


def notes(tag: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, str(ROOT / "packaging" / "release_notes.py"), tag], capture_output=True, text=True)


def test_release_needs_a_version_and_notes() -> None:
    section = runpy.run_path(str(ROOT / "packaging" / "release_notes.py"))["section"]
    text = "# Changelog\n\n## Unreleased\n\n- new\n\n## 0.2.0 (2026-12-01)\n\n- one\n- two\n\n## 0.1.0\n\n- old\n\n## 0.0.1\n"
    assert section(text, "0.2.0") == "- one\n- two" and section(text, "0.1.0") == "- old"
    assert section(text, "0.0.1") is None and section(text, "0.2") is None and section(text, "0.1x0") is None
    wrong = notes("v9.9.9")
    assert wrong.returncode == 1 and PROJECT["version"] in wrong.stderr
    right = notes(f"v{PROJECT['version']}")
    assert (right.returncode == 0) == (f"## {PROJECT['version']}" in (ROOT / "CHANGELOG.md").read_text()), right.stderr


def test_conda_recipe_has_the_same_dependencies() -> None:
    """Some packages have another name on conda-forge."""
    recipe = yaml.safe_load((ROOT / "packaging" / "conda" / "recipe.yaml").read_text())
    names = {"mujoco-python": "mujoco", "fast-simplification": "fast_simplification", "tree_sitter": "tree-sitter"}
    found = {}
    for line in recipe["requirements"]["run"]:
        name, _, versions = line.partition(" ")
        found[names.get(name, name)] = versions
    assert found.pop("python") == ">=${{ python_min }}" and f">={recipe['context']['python_min']}" == PROJECT["requires-python"]
    expected = {Requirement(line).name: Requirement(line).specifier for line in PROJECT["dependencies"]}
    assert {name: Requirement(f"x{versions}").specifier for name, versions in found.items()} == expected
    assert recipe["context"]["version"] == PROJECT["version"]
    assert recipe["about"]["license"] == PROJECT["license"] and recipe["about"]["summary"] == PROJECT["description"]
    (point,) = recipe["build"]["python"]["entry_points"]
    assert dict([point.split(" = ")]) == PROJECT["scripts"]


def test_image_copies_existing_files_and_starts_thingc() -> None:
    steps = runpy.run_path(str(ROOT / "packaging" / "image_steps.py"))["steps"]
    found = list(steps((ROOT / "packaging" / "Dockerfile").read_text()))
    assert found[0][0] == "FROM" and found[-1] == ("ENTRYPOINT", '["thingc"]')
    sources = [word for instruction, words in found if instruction == "COPY" for word in words.split()[:-1]]
    assert sources == ["gate", "dist/thingc-*.whl"] and (ROOT / "gate" / "constraints.txt").exists()
    assert any("--constraint /opt/thingc/gate/constraints.txt" in words for instruction, words in found if instruction == "RUN")


def test_notebook_has_no_outputs_and_valid_commands() -> None:
    notebook = json.loads((ROOT / "examples" / "thingc.ipynb").read_text())
    cells = ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert not any(cell.get("outputs") or cell.get("execution_count") for cell in notebook["cells"])
    used = [command for cell in cells for command in re.findall(r"^!thingc (\w+)", cell, re.MULTILINE)]
    assert used == ["new", "build"] and set(used) <= set(COMMANDS)
    for cell in cells:
        compile(re.sub(r"^[!%].*$", "pass", cell, flags=re.MULTILINE), "cell", "exec")
