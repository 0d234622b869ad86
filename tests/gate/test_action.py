"""The GitHub Action and the pre-commit hooks. The steps and hooks run as their runners run them."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
import yaml
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from conformance.harness import thingc_here
from gate.repository import commit, fork, git

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]
BIN = Path(sys.executable).parent


def steps() -> list[dict[str, Any]]:
    """The steps of the action that run commands."""
    action = yaml.safe_load((ROOT / "action.yml").read_text())
    return [step for step in action["runs"]["steps"] if "run" in step and step["name"] != "Install thingc"]


@dataclass
class Job:
    """Runs the `run` steps of `action.yml` like GitHub's runner: it evaluates expressions, starts a shell for each step, and reads
    outputs from files. The folder `programs` comes first in PATH."""

    folder: Path
    temp: Path
    store: str
    programs: Path = BIN
    github: dict[str, str] = field(default_factory=dict)
    inputs: dict[str, str] = field(default_factory=dict)
    outputs: dict[str, dict[str, str]] = field(default_factory=dict)
    printed: dict[str, str] = field(default_factory=dict)
    failed: list[str] = field(default_factory=list)

    def run(self) -> Job:
        action = yaml.safe_load((ROOT / "action.yml").read_text())
        self.inputs = {name: given["default"] for name, given in action["inputs"].items()} | self.inputs
        for step in steps():
            if self.wanted(step):
                self.step(step)
        return self

    def wanted(self, step: dict[str, Any]) -> bool:
        condition = step.get("if", "${{ true }}")
        return bool(self.value(condition)) and ("cancelled()" in condition or not self.failed)

    def value(self, expression: str) -> Any:
        """Evaluate a `${{ }}` expression. Only the kinds of expressions that the action uses are supported."""
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
            "PATH": f"{self.programs}:{BIN}:{os.environ['PATH']}", "HOME": str(self.temp), "GITHUB_OUTPUT": str(output),
            "GITHUB_ACTION_PATH": str(ROOT), "RUNNER_TEMP": str(self.temp), "GITHUB_WORKSPACE": str(self.folder),
            "THINGC_STORE": self.store,
            **{name: self.filled(value) for name, value in step.get("env", {}).items() if name != "THINGC_STORE"},
        }
        done = subprocess.run(
            ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", step["run"]], env=environment,
            cwd=self.folder / self.filled(step["working-directory"]), capture_output=True, text=True, errors="surrogateescape",
        )
        self.printed[step["name"]] = done.stdout + done.stderr
        if done.returncode:
            self.failed.append(step["name"])
        self.outputs[step.get("id", step["name"])] = outputs(output.read_text(errors="replace"))


def outputs(text: str) -> dict[str, str]:
    """Parse the output file of a step: lines `name=value`, or `name<<mark` followed by lines up to the mark."""
    found: dict[str, str] = {}
    lines = iter(text.split("\n")[:-1])
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
    """A repository of the arm with one commit on `main` and a branch."""
    return fork(tmp_path / "repository")


@pytest.fixture
def job(repository: Path, tmp_path: Path, shared_store: str) -> Job:
    return pull_request(repository, tmp_path, shared_store)


def pull_request(repository: Path, folder: Path, store: str) -> Job:
    """Return the job for the branch of a repository."""
    temp = folder / "temp"
    temp.mkdir()
    return Job(folder=repository, temp=temp, store=store, github={
        "event.pull_request.base.sha": git(repository, "rev-parse", "main").strip(),
        "event_name": "pull_request", "repository": "us/robots", "event.pull_request.head.repo.full_name": "us/robots",
    })


@pytest.fixture(scope="module")
def changed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A repository whose branch changes the arm. Tests that use it do not change it."""
    folder = fork(tmp_path_factory.mktemp("changed") / "repository")
    edit(folder, "assemblies/arm.yaml", "lower: -150 deg", "lower: -140 deg")
    return folder


def edit(folder: Path, name: str, old: str, new: str) -> None:
    path = folder / name
    text = path.read_text()
    assert text.count(old) >= 1
    path.write_text(text.replace(old, new, 1))
    commit(folder, f"edit {name}")


def test_valid_change_is_checked_and_built(job: Job) -> None:
    edit(job.folder, "assemblies/arm.yaml", "lower: -150 deg", "lower: -140 deg")
    job.inputs = {"options": "--emit mjcf"}
    job.run()
    assert not job.failed, job.printed
    assert job.outputs["touched"]["documents"] == "assemblies/arm.yaml"
    assert job.outputs["touched"]["code"] == "yes"
    assert job.outputs["build"]["built"] == "assemblies/arm.yaml"
    assert (job.temp / "thingc-build" / "assemblies" / "arm" / "mjcf" / "arm_bench.xml").exists()
    assert "::error" not in job.printed["Check"]


def test_error_is_annotated_at_its_line(job: Job) -> None:
    edit(job.folder, "assemblies/arm.yaml", "attach: {back: plate.servo_seat}", "attach: {back: plate.servo_seet}")
    line = next(n for n, text in enumerate((job.folder / "assemblies/arm.yaml").read_text().splitlines(), 1) if "seet" in text)
    job.run()
    assert job.failed == ["Check"]
    assert re.search(rf"^::error file=assemblies/arm\.yaml,line={line},.*TC303", job.printed["Check"], re.MULTILINE)
    assert "Build" not in job.printed, "what is wrong is not built"


@pytest.mark.parametrize("head", ["us/robots", "stranger/robots"])
def test_changed_robot_file_is_annotated_at_its_line(job: Job, head: str) -> None:
    job.github["event.pull_request.head.repo.full_name"] = head
    (job.folder / "robot.urdf").write_text('<robot name="r">\n<link name="a">\n<inertial><mass value="-1"/></inertial></link></robot>')
    (job.folder / "package.xml").write_text("<package/>")
    commit(job.folder, "add a robot")
    job.run()
    assert job.failed == ["Check"]
    assert re.search(r"^::error file=robot\.urdf,line=3,.*TC952", job.printed["Check"], re.MULTILINE)
    assert job.printed["Check"].count("::error") == 1


def test_part_code_from_fork_does_not_run(job: Job, tmp_path: Path) -> None:
    assert thingc_here("lock", cwd=job.folder, store=job.store).code == 0
    commit(job.folder, "lock")
    job.github["event.pull_request.base.sha"] = git(job.folder, "rev-parse", "HEAD").strip()
    job.github["event.pull_request.head.repo.full_name"] = "stranger/robots"
    marker = tmp_path / "was-run"
    part = job.folder / "parts" / "arm.py"
    part.write_text(f"open({str(marker)!r}, 'w')\n" + part.read_text())
    commit(job.folder, "evil")
    job.run()
    assert job.outputs["touched"]["code"] == "no"
    assert not marker.exists()
    assert "Build" not in job.printed


@pytest.fixture
def without_documents(tmp_path: Path) -> Job:
    """A job whose `thingc` is a script that finds no document."""
    programs = tmp_path / "bin"
    programs.mkdir()
    (programs / "thingc").write_text("#!/bin/sh\n")
    (programs / "thingc").chmod(0o755)
    return Job(folder=tmp_path, temp=tmp_path, store="", programs=programs)


@pytest.mark.parametrize(("event", "head", "trust", "code"), [
    ("push", None, "auto", "yes"),
    ("pull_request", "us/robots", "auto", "yes"),
    ("pull_request_target", "us/robots", "auto", "yes"),
    ("pull_request", "stranger/robots", "auto", "no"),
    ("pull_request_target", "stranger/robots", "auto", "no"),
    ("pull_request", None, "auto", "no"),  # the fork was deleted
    ("pull_request", "upstream/robots", "auto", "no"),  # this is the fork, and the change comes from upstream
    ("workflow_run", None, "auto", "no"),
    ("issue_comment", None, "auto", "no"),
    ("merge_group", None, "auto", "no"),
    ("", None, "auto", "no"),
    ("workflow_run", None, "yes", "yes"),
    ("push", None, "no", "no"),
])
def test_part_code_runs_only_for_authors_with_push_access(
    without_documents: Job, event: str, head: str | None, trust: str, code: str,
) -> None:
    job = without_documents
    job.github = {"event_name": event, "repository": "us/robots"}
    if head is not None:
        job.github["event.pull_request.head.repo.full_name"] = head
    job.inputs = {"folder": ".", "since": "", "trust": trust}
    job.step(steps()[0])
    assert not job.failed, job.printed
    assert job.outputs["touched"]["code"] == code


@pytest.mark.parametrize("trust", ["true", "false", "No", "", "::error::x"])
def test_unknown_trust_fails(without_documents: Job, trust: str) -> None:
    job = without_documents
    job.github = {"event_name": "push", "repository": "us/robots"}
    job.inputs = {"folder": ".", "since": "", "trust": trust}
    job.step(steps()[0])
    assert job.failed and "expected auto, yes or no" in job.printed["Find affected documents"]
    assert "code" not in job.outputs["touched"] and commands(job.printed["Find affected documents"]) == []


def test_unrelated_change_builds_nothing(job: Job) -> None:
    (job.folder / "README.md").write_text("# Robots\n")
    commit(job.folder, "readme")
    job.run()
    assert not job.failed, job.printed
    assert job.outputs["touched"]["documents"] == ""
    assert job.outputs["build"]["built"] == ""
    assert job.printed["Check"] == "the change affects no document\n"


def test_all_documents_are_checked_without_a_base(job: Job) -> None:
    job.github = {"event_name": "push", "repository": "us/robots"}
    job.inputs = {"build": "false"}
    job.run()
    assert not job.failed, job.printed
    assert job.outputs["touched"]["documents"].splitlines() == [
        "assemblies/arm.yaml", "assemblies/end_effector.yaml", "assemblies/materials.yaml"
    ]
    assert "Build" not in job.printed


def test_layout_check_is_optional(job: Job) -> None:
    edit(job.folder, "assemblies/arm.yaml", "name: arm\n", "name:    arm   \n")
    job.run()
    assert job.failed == ["Format"], job.printed
    assert "thingc fmt" in job.printed["Format"]


def commands(text: str) -> list[str]:
    """Return the commands that GitHub's runner finds in the output of a step: `::name ...::` at the beginning of a line, after spaces,
    and `##[name]` anywhere (actions/runner, `ActionCommand.TryParseV2` and `TryParse`). Commands between `stop-commands` and its
    token are ignored."""
    found: list[str] = []
    token = None
    for line in re.split("\r\n|\n|\r", text):
        match = re.match(r"\s*::([\w-]+)[^:]*::(.*)", line) or re.search(r"##\[([\w-]+)[^\]]*\](.*)", line)
        if token is not None:
            token = None if line.strip() == f"::{token}::" else token
        elif match and match.group(1) == "stop-commands":
            token = match.group(2)
        elif match:
            found.append(line)
    assert token is None, "commands were stopped for good"
    return found


def test_command_parser() -> None:
    assert commands("a\n::error file=x::b\n  ::warning::c\nx ##[debug]d\n") == ["::error file=x::b", "  ::warning::c", "x ##[debug]d"]
    assert commands("::stop-commands::k\n::error::b\n::x::\n::k::\n::notice::c") == ["::notice::c"]


ODD = (
    "--help.yaml", "::error::x.yaml", "##[error]x.yaml", "$(touch stolen).yaml", "a b'\".yaml", "-o.yaml", "--store=x.yaml",
    "`touch stolen`.yaml", ";touch stolen;.yaml",
    "a*.yaml", "?.yaml", "~.yaml",
    "!x.yaml", "%0A.yaml", "&.yaml", "$IFS.yaml", "\\n.yaml", "#.yaml",
    "é.yaml", "{a,b}.yaml", "<x>|y.yaml",
)
"""Valid names of documents that a shell, a program or the runner could misinterpret."""
BUILT = ODD[:3]
"""The names for which the test also runs a build, which takes a second."""
HIDDEN = (
    b"a\nb.yaml", b"assemblies\n.yaml", b"\n::error::forged.yaml", b"x\r::error::forged.yaml", b"\x1b[31m.yaml", b"caf\xe9.yaml",
    "\u202e.yaml".encode(), b"tab\t.yaml",
)
"""Names that no document can have."""


def robots(job: Job, names: Sequence[str]) -> None:
    """Commit a small robot for each name."""
    for number, name in enumerate(names):
        path = job.folder / "assemblies" / name
        path.write_text(f"thingc: assembly/1\nname: robot_{number}\ncomponents:\n  base: {{frame: true, mass: 1 g}}\n")
    commit(job.folder, "odd names")
    job.inputs = {"folder": "assemblies", "options": "--emit bom"}


def test_unusual_document_names(job: Job) -> None:
    robots(job, ODD)
    job.inputs["build"] = "false"
    job.run()
    assert not job.failed, job.printed
    assert not list(job.folder.rglob("stolen")) and not list(job.temp.rglob("stolen"))
    assert sorted(job.outputs["touched"]["documents"].split("\n")) == sorted(ODD)
    Path(job.outputs["touched"]["roots"]).write_text("".join(f"{name}\0" for name in BUILT))
    job.step(next(step for step in steps() if step["name"] == "Build"))
    assert not job.failed and not list(job.temp.rglob("stolen"))
    assert job.outputs["build"]["built"].split("\n") == list(BUILT)
    assert len(list((job.temp / "thingc-build").rglob("bom.csv"))) == len(BUILT)
    assert [line for text in job.printed.values() for line in commands(text)] == []


def test_unreadable_names_are_rejected_one_by_one(job: Job) -> None:
    robots(job, ["good.yaml", *(os.fsdecode(name) for name in HIDDEN)])
    job.run()
    assert job.failed == ["Check"], job.printed
    said = commands(job.printed["Check"])
    assert len(said) == len(HIDDEN), "\n".join(said)
    assert all(re.match(r"::error title=TC121::the file name ", line) and "forged" not in line.partition(" has ")[2] for line in said)
    assert job.outputs["touched"]["documents"].split("\n").count("good.yaml") == 1
    assert not any("forged" in line.partition("::error::")[0] for line in job.outputs["touched"]["documents"].split("\n"))
    # were the check passed over, the build would refuse them all the same
    Path(job.outputs["touched"]["roots"]).write_bytes(b"".join(name + b"\0" for name in (b"good.yaml", *HIDDEN[1:4])))
    job.step(next(step for step in steps() if step["name"] == "Build"))
    assert job.failed == ["Check", "Build"] and job.outputs["build"]["built"] == "good.yaml"


def test_documents_cannot_send_commands_to_the_runner(job: Job) -> None:
    """The diff of a document with a wrong layout is printed unchanged, between `stop-commands` and its token."""
    hostile = (
        "thingc:   assembly/1\nname: x\n# ##[error]forged\ndescription: |\n ::stop-commands::x\n ::error::forged\n"
        "components: {a: {frame: true}}\n"
    )
    (job.folder / "assemblies" / "##[warning]x.yaml").write_text(hostile)
    commit(job.folder, "hostile")
    job.inputs = {"folder": "assemblies"}
    job.run()
    assert job.failed == ["Check", "Format"] or job.failed == ["Format"], job.printed
    assert "forged" in job.printed["Format"] and commands(job.printed["Format"]) == []
    assert all(line.startswith("::error file=") for line in commands(job.printed["Check"]))


@pytest.mark.parametrize("ref", [
    "$(touch stolen)", "`touch stolen`", "; touch stolen", "--output=stolen", "-", "main\nHEAD", "\x1b[31m", ":/arm", "main..branch",
    "caf\udce9", "\"", "--help",
])
def test_unusual_refs(changed: Path, tmp_path: Path, shared_store: str, ref: str) -> None:
    """GitHub sets the base of a pull request, but `since` is an input. It must be a revision, or else the action reports an error."""
    job = pull_request(changed, tmp_path, shared_store)
    job.inputs = {"since": ref, "build": "false", "fmt": "false"}
    job.run()
    assert not list(job.folder.rglob("stolen")) and not list(job.temp.rglob("stolen"))
    assert job.failed == (["Find affected documents"] if ref != ":/arm" else []), job.printed
    assert commands(job.printed["Find affected documents"]) == []
    assert "Traceback" not in job.printed["Find affected documents"]


# --- pre-commit ------------------------------------------------------------------------------------------------------


def hook(folder: Path, identifier: str, store: str) -> subprocess.CompletedProcess[str]:
    """Run a hook of this repository on the staged files with pre-commit. The hook uses the installed thingc."""
    hooks = {one["id"]: one for one in yaml.safe_load((ROOT / ".pre-commit-hooks.yaml").read_text())}
    settings = {"repos": [{"repo": "local", "hooks": [{**hooks[identifier], "language": "system"}]}]}
    (folder / ".pre-commit-config.yaml").write_text(yaml.safe_dump(settings))
    git(folder, "add", "-A")
    return subprocess.run(
        [BIN / "pre-commit", "run", identifier], cwd=folder, capture_output=True, text=True,
        env={**os.environ, "PATH": f"{BIN}:{os.environ['PATH']}", "THINGC_STORE": store, "PRE_COMMIT_HOME": str(folder.parent / "pc")},
    )


def test_hooks_are_well_formed() -> None:
    done = subprocess.run([BIN / "pre-commit", "validate-manifest", ROOT / ".pre-commit-hooks.yaml"], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout


def test_action_is_well_formed() -> None:
    done = subprocess.run(
        [BIN / "check-jsonschema", "--builtin-schema", "vendor.github-actions", ROOT / "action.yml"], capture_output=True, text=True,
    )
    assert done.returncode == 0, done.stdout


def test_actions_and_dependencies_are_pinned() -> None:
    """Nobody can change the commands of the action by moving a tag or by publishing a release."""
    action = yaml.safe_load((ROOT / "action.yml").read_text())
    used = [step["uses"] for step in action["runs"]["steps"] if "uses" in step]
    assert len(used) == 3 and all(re.fullmatch(r"actions/[\w-]+@[0-9a-f]{40}", one) for one in used)
    pins = [Requirement(line) for line in (ROOT / "gate/constraints.txt").read_text().splitlines() if not line.startswith("#")]
    for line in tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["dependencies"]:
        wanted = Requirement(line)
        found = [pin for pin in pins if canonicalize_name(pin.name) == canonicalize_name(wanted.name)]
        assert found, f"{wanted.name} is not pinned: run `make constraints`"
        for pin in found:
            (version,) = pin.specifier
            assert version.operator == "==" and wanted.specifier.contains(version.version), f"{pin} is not {wanted}: run `make constraints`"


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
    assert thingc_here("lock", cwd=repository, store=shared_store).code == 0
    git(repository, "add", "-A")
    assert hook(repository, "thingc-lock", shared_store).returncode == 0
    part = repository / "parts" / "arm.py"
    part.write_text(part.read_text().replace("servo_seat", "servo_place"))
    done = hook(repository, "thingc-lock", shared_store)
    assert done.returncode == 1
    assert "thingc lock" in done.stdout
    done = hook(repository, "thingc-check-no-code", shared_store)
    assert done.returncode == 1
