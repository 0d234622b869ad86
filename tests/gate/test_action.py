"""The gate as others use it: the steps of the action and the hooks, run as their runners run them."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
import yaml

from gate.repository import commit, fork, git

ROOT = Path(__file__).resolve().parents[2]
BIN = Path(sys.executable).parent


@dataclass
class Job:
    """Runs the `run` steps of `action.yml` as GitHub's runner does: expressions filled in, a shell for each, outputs by file."""

    folder: Path
    temp: Path
    store: str
    github: dict[str, str] = field(default_factory=dict)
    inputs: dict[str, str] = field(default_factory=dict)
    outputs: dict[str, dict[str, str]] = field(default_factory=dict)
    printed: dict[str, str] = field(default_factory=dict)
    failed: list[str] = field(default_factory=list)

    def run(self) -> Job:
        action = yaml.safe_load((ROOT / "action.yml").read_text())
        self.inputs = {name: given["default"] for name, given in action["inputs"].items()} | self.inputs
        for step in action["runs"]["steps"]:
            if "run" in step and step["name"] != "Install thingc" and self.wanted(step):
                self.step(step)
        return self

    def wanted(self, step: dict[str, Any]) -> bool:
        condition = step.get("if", "${{ true }}")
        return bool(self.value(condition)) and ("cancelled()" in condition or not self.failed)

    def value(self, expression: str) -> Any:
        """A `${{ }}` expression of the few kinds that the action uses."""
        text = re.fullmatch(r"\s*\$\{\{(.*)\}\}\s*", expression, re.DOTALL)
        assert text is not None, expression
        python = re.sub(r"(?:inputs|steps|github|runner)(?:\.[\w-]+)+", lambda name: repr(self.name(name.group())), text.group(1))
        python = python.replace("!cancelled()", "True").replace("||", " or ").replace("&&", " and ").replace("true", "True")
        python = re.sub(r"'True'", "'true'", python)
        return eval(python, {"__builtins__": {}})

    def name(self, dotted: str) -> str:
        where, _, rest = dotted.partition(".")
        if where == "inputs":
            return self.inputs[rest]
        if where == "steps":
            step, _, output = rest.split(".")
            return self.outputs.get(step, {}).get(output, "")
        return {"temp": str(self.temp), "os": "Linux"}[rest] if where == "runner" else self.github.get(rest, "")

    def filled(self, text: str) -> str:
        return re.sub(r"\$\{\{.*?\}\}", lambda found: str(self.value(found.group())), str(text))

    def step(self, step: dict[str, Any]) -> None:
        assert "${{" not in step["run"], "text of a pull request must not become a script: hand it on in `env`"
        output = self.temp / "output"
        output.write_text("")
        environment = {
            "PATH": f"{BIN}:{os.environ['PATH']}", "HOME": str(self.temp), "GITHUB_OUTPUT": str(output),
            "GITHUB_ACTION_PATH": str(ROOT), "RUNNER_TEMP": str(self.temp), "GITHUB_WORKSPACE": str(self.folder),
            "THINGC_STORE": self.store,
            **{name: self.filled(value) for name, value in step.get("env", {}).items() if name != "THINGC_STORE"},
        }
        done = subprocess.run(
            ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", step["run"]], env=environment,
            cwd=self.folder / self.filled(step["working-directory"]), capture_output=True, text=True,
        )
        self.printed[step["name"]] = done.stdout + done.stderr
        if done.returncode:
            self.failed.append(step["name"])
        self.outputs[step.get("id", step["name"])] = outputs(output.read_text())


def outputs(text: str) -> dict[str, str]:
    """The file of a step's outputs: `name=value`, and `name<<mark` with lines up to the mark."""
    found: dict[str, str] = {}
    lines = iter(text.splitlines())
    for line in lines:
        if "<<" in line.split("=")[0]:
            name, mark = line.split("<<")
            found[name] = "\n".join(iter(lambda: next(lines), mark))
        else:
            name, _, value = line.partition("=")
            found[name] = value
    return found


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    """The arm's documents and parts as a repository with one commit, `main`, and a branch off it."""
    return fork(tmp_path / "repository")


@pytest.fixture
def job(repository: Path, tmp_path: Path, shared_store: str) -> Job:
    temp = tmp_path / "temp"
    temp.mkdir()
    return Job(folder=repository, temp=temp, store=shared_store, github={
        "event.pull_request.base.sha": git(repository, "rev-parse", "main").strip(),
        "event.pull_request.head.repo.fork": "false",
    })


def edit(folder: Path, name: str, old: str, new: str) -> None:
    path = folder / name
    text = path.read_text()
    assert text.count(old) >= 1
    path.write_text(text.replace(old, new, 1))
    commit(folder, f"edit {name}")


def test_a_good_change_is_checked_and_built(job: Job) -> None:
    edit(job.folder, "assemblies/arm.yaml", "reach: {value: 100 mm", "reach: {value: 102 mm")
    job.run()
    assert not job.failed, job.printed
    assert job.outputs["touched"]["documents"] == "assemblies/arm.yaml"
    assert job.outputs["touched"]["code"] == "yes"
    assert job.outputs["build"]["built"] == "assemblies/arm.yaml"
    assert (job.temp / "thingc-build" / "assemblies" / "arm" / "mjcf" / "arm_bench.xml").exists()
    assert "::error" not in job.printed["Check"]


def test_a_wrong_change_is_annotated_at_its_line(job: Job) -> None:
    edit(job.folder, "assemblies/arm.yaml", "attach: {back: plate.servo_seat}", "attach: {back: plate.servo_seet}")
    line = next(n for n, text in enumerate((job.folder / "assemblies/arm.yaml").read_text().splitlines(), 1) if "seet" in text)
    job.run()
    assert job.failed == ["Check"]
    assert re.search(rf"^::error file=assemblies/arm\.yaml,line={line},.*TC303", job.printed["Check"], re.MULTILINE)
    assert "Build" not in job.printed, "what is wrong is not built"


def test_part_code_of_a_fork_is_not_run(job: Job, tmp_path: Path) -> None:
    subprocess.run([BIN / "thingc", "lock"], cwd=job.folder, env={**os.environ, "THINGC_STORE": job.store}, check=True)
    commit(job.folder, "lock")
    job.github["event.pull_request.base.sha"] = git(job.folder, "rev-parse", "HEAD").strip()
    job.github["event.pull_request.head.repo.fork"] = "true"
    marker = tmp_path / "was-run"
    part = job.folder / "parts" / "arm.py"
    part.write_text(f"open({str(marker)!r}, 'w')\n" + part.read_text())
    commit(job.folder, "evil")
    job.run()
    assert job.outputs["touched"]["code"] == "no"
    assert not marker.exists()
    assert "Build" not in job.printed


def test_a_change_of_something_else_builds_nothing(job: Job) -> None:
    (job.folder / "README.md").write_text("# Robots\n")
    commit(job.folder, "readme")
    job.run()
    assert not job.failed, job.printed
    assert job.outputs["touched"]["documents"] == ""
    assert job.outputs["build"]["built"] == ""
    assert job.printed["Check"] == "the change concerns no document\n"


def test_without_a_base_everything_is_checked(job: Job) -> None:
    job.github.clear()
    job.inputs = {"build": "false"}
    job.run()
    assert not job.failed, job.printed
    assert job.outputs["touched"]["documents"].splitlines() == [
        "assemblies/arm.yaml", "assemblies/end_effector.yaml", "assemblies/materials.yaml"
    ]
    assert "Build" not in job.printed


def test_layout_is_asked_for(job: Job) -> None:
    edit(job.folder, "assemblies/arm.yaml", "name: arm\n", "name:    arm   \n")
    job.run()
    assert job.failed == ["Format"], job.printed
    assert "thingc fmt" in job.printed["Format"]


def test_names_that_look_like_something_else(job: Job) -> None:
    for name in ("--help.yaml", "a b.yaml", "$(touch stolen).yaml"):
        shutil.copy(job.folder / "assemblies" / "end_effector.yaml", job.folder / "assemblies" / name)
    commit(job.folder, "odd names")
    job.inputs = {"fmt": "false", "folder": "assemblies", "options": "--emit hag"}
    job.run()
    assert not (job.folder / "assemblies" / "stolen").exists()
    assert sorted(job.outputs["touched"]["documents"].splitlines()) == ["$(touch stolen).yaml", "--help.yaml", "a b.yaml"]
    assert job.failed in ([], ["Build"]), job.printed  # three assemblies of one name go to one folder


# --- pre-commit ------------------------------------------------------------------------------------------------------


def hook(folder: Path, identifier: str, store: str) -> subprocess.CompletedProcess[str]:
    """Run a hook of this repository on the staged files with pre-commit; thingc is the one that is installed here."""
    hooks = {one["id"]: one for one in yaml.safe_load((ROOT / ".pre-commit-hooks.yaml").read_text())}
    settings = {"repos": [{"repo": "local", "hooks": [{**hooks[identifier], "language": "system"}]}]}
    (folder / ".pre-commit-config.yaml").write_text(yaml.safe_dump(settings))
    git(folder, "add", "-A")
    return subprocess.run(
        [BIN / "pre-commit", "run", identifier], cwd=folder, capture_output=True, text=True,
        env={**os.environ, "PATH": f"{BIN}:{os.environ['PATH']}", "THINGC_STORE": store, "PRE_COMMIT_HOME": str(folder.parent / "pc")},
    )


def test_the_hooks_are_well_formed() -> None:
    done = subprocess.run([BIN / "pre-commit", "validate-manifest", ROOT / ".pre-commit-hooks.yaml"], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout


def test_the_action_is_well_formed() -> None:
    done = subprocess.run(
        [BIN / "check-jsonschema", "--builtin-schema", "vendor.github-actions", ROOT / "action.yml"], capture_output=True, text=True,
    )
    assert done.returncode == 0, done.stdout


def test_hook_check(repository: Path, shared_store: str) -> None:
    # the document is not among the staged files: its part is
    part = repository / "parts" / "arm.py"
    part.write_text(part.read_text().replace("servo_seat", "servo_place"))
    done = hook(repository, "thingc-check", shared_store)
    assert done.returncode == 1
    assert "error[TC303]" in done.stdout
    assert "assemblies/arm.yaml" in done.stdout
    git(repository, "checkout", "--", ".")
    git(repository, "reset", "-q", "--hard")
    (repository / "notes.yaml").write_text("shopping: [milk]\n")
    done = hook(repository, "thingc-check", shared_store)
    assert done.returncode == 0, done.stdout


def test_hook_fmt(repository: Path, shared_store: str) -> None:
    path = repository / "assemblies" / "arm.yaml"
    good = path.read_text()
    path.write_text(good.replace("name: arm\n", "name:    arm   \n"))
    (repository / "notes.yaml").write_text("shopping:   [milk]\n")
    done = hook(repository, "thingc-fmt", shared_store)
    assert done.returncode == 1
    assert path.read_text() == good
    assert (repository / "notes.yaml").read_text() == "shopping:   [milk]\n"
    assert hook(repository, "thingc-fmt", shared_store).returncode == 0


def test_hooks_lock_and_no_code(repository: Path, shared_store: str) -> None:
    done = subprocess.run(
        [BIN / "thingc", "lock"], cwd=repository, env={**os.environ, "THINGC_STORE": shared_store}, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    git(repository, "add", "-A")
    assert hook(repository, "thingc-lock", shared_store).returncode == 0
    part = repository / "parts" / "arm.py"
    part.write_text(part.read_text().replace("servo_seat", "servo_place"))
    done = hook(repository, "thingc-lock", shared_store)
    assert done.returncode == 1
    assert "thingc lock" in done.stdout
    done = hook(repository, "thingc-check-no-code", shared_store)
    assert done.returncode == 1
