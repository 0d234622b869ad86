"""Hostile repositories, archives and batches that try to write or run something outside their folder."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path

import pytest

from thingc.base.filesystem import BadPath, check_tree, hash_name, write_tree
from thingc.geometry.store.local import BlobMissing, Store
from thingc.tools.affected.dependents import NotARepository, changed_since
from thingc.tools.cli.main import main
from thingc.tools.diff.revisions import Repository, Revision

ROBOT = "thingc: assembly/1\nname: robot\ncomponents: {a: {frame: true}}\n"


def git(folder: Path, *words: str, given: bytes = b"") -> str:
    return subprocess.run(
        ["git", "-c", "user.name=a", "-c", "user.email=a@b.c", *words], cwd=folder, check=True, capture_output=True, input=given,
    ).stdout.decode().strip()


@pytest.fixture
def repository(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "repository"
    folder.mkdir()
    (folder / "robot.yaml").write_text(ROBOT)
    git(folder, "init", "-q", "-b", "main")
    git(folder, "add", "-A")
    git(folder, "commit", "-qm", "a robot")
    monkeypatch.chdir(folder)
    return folder


def commit_of(folder: Path, entries: list[tuple[str, str, bytes | str]]) -> str:
    """Return a commit with files, links and trees (by hash) that `git add` would not create."""
    lines = [
        f"{mode} {'tree' if mode == '040000' else 'blob'} "
        f"{data if isinstance(data, str) else git(folder, 'hash-object', '-w', '--stdin', given=data)}\t{name}\0"
        for mode, name, data in entries
    ]
    tree = git(folder, "mktree", "-z", given="".join(lines).encode())
    return git(folder, "commit-tree", tree, "-p", "main", "-m", "made by hand")


@pytest.mark.parametrize("how", ["lock", "document", "parts", "file"])
def test_path_that_is_both_link_and_folder_is_refused(repository: Path, capsys: pytest.CaptureFixture[str], how: str) -> None:
    """The old revision tries to write through the link into a folder outside the temporary one."""
    outside = repository.parent / "outside"
    outside.mkdir()
    (outside / "y.yaml").write_text("mine")
    stolen = git(repository, "hash-object", "-w", "--stdin", given=b"stolen")
    inner = git(repository, "mktree", given=f"100644 blob {stolen}\ty.yaml\n".encode())
    name = "parts" if how == "parts" else "x.yaml"
    lock = json.dumps({"things": {"a:B": {"reads": {name: "", f"{name}/y.yaml": ""}}}})
    robot = ROBOT + (f"description: {name} {name}/y.yaml\n" if how == "document" else "description: other\n")
    commit = commit_of(repository, [
        ("100644", "parts.lock.json", (lock if how == "lock" else "{}").encode()), ("100644", "robot.yaml", robot.encode()),
        ("100644" if how == "file" else "120000", name, os.fsencode(outside)), ("040000", name, inner),
    ])
    for words in ([f"main...{commit}"], [commit], [f"main..{commit}", "--", "robot.yaml"]):
        assert main(["diff", "--no-code", *words]) == 2
        assert f"to a folder: '{name}' is both a file and a folder" in capsys.readouterr().err
    assert (outside / "y.yaml").read_text() == "mine" and os.listdir(outside) == ["y.yaml"]


def test_files_are_not_written_through_links(tmp_path: Path) -> None:
    """This includes links of an earlier call, and hard links."""
    root, outside = tmp_path / "root", tmp_path / "outside"
    root.mkdir()
    outside.mkdir()
    write_tree(str(root), {"deep/a.txt": b"a"}, {"link": "../outside", "b.txt": "../outside/b.txt"})
    assert (root / "deep" / "a.txt").read_bytes() == b"a" and os.readlink(root / "link") == "../outside"
    for path in ("link/c.txt", "link/deep/c.txt", "b.txt", "deep/a.txt"):
        with pytest.raises(FileExistsError):
            write_tree(str(root), {path: b"stolen"}, {})
    (root / "deep" / "a.txt").unlink()
    os.link(outside.parent / "root" / "b.txt", root / "hard", follow_symlinks=False)
    with pytest.raises(FileExistsError):
        write_tree(str(root), {"hard": b"stolen"}, {})
    assert os.listdir(outside) == []


@pytest.mark.parametrize("paths", [
    ["../a"], ["a/../../b"], ["/a"], ["a//b"], ["a/."], [""], ["a\0b"], ["a", "a"], ["a", "a/b"], ["a/b/c", "a/b"],
])
def test_invalid_tree_paths_are_refused(paths: list[str]) -> None:
    with pytest.raises(BadPath):
        check_tree(paths)


def test_valid_tree_paths_are_accepted() -> None:
    check_tree(["a", "a.b/c", "a..b/..c", "A/b", "caf\udce9/\n", "a\\b"])


@pytest.mark.parametrize("name", ["../../x", "", "a" * 63, "A" * 64, "a" * 64 + "\n", "/" + "a" * 63, "\uff11" * 64])
def test_store_does_not_accept_a_path_as_a_hash(tmp_path: Path, name: str) -> None:
    """The store deletes a blob of the wrong size, so it must not delete any other file."""
    store = Store(str(tmp_path / "store"))
    store.put(b"x")
    victim = tmp_path / "x"
    victim.write_text("mine")
    ways = {name, os.path.relpath(victim, os.path.join(store.root, "blobs", ".."))}
    for way in ways:
        assert not store.has(way) and not store.has(way, 1)
        with pytest.raises(BlobMissing):
            store.read(way)
        with pytest.raises(BadPath, match="expected a hash of 64 hex digits, found"):
            hash_name(way)
    assert victim.read_text() == "mine" and hash_name("a" * 64) == "a" * 64


RUNS = {
    "fsmonitor": lambda evil: {"core.fsmonitor": evil},
    "hooks": lambda evil: {"core.hooksPath": os.path.dirname(evil)},
    "clean": lambda evil: {"filter.own.clean": evil, "filter.own.required": "true"},
    "smudge": lambda evil: {"filter.own.smudge": evil},
    "process": lambda evil: {"filter.own.process": evil},
    "equals": lambda evil: {"filter.a=b.smudge": evil, "filter.a=b.clean": evil},
    "textconv": lambda evil: {"diff.own.textconv": evil, "diff.own.command": evil, "diff.external": evil},
    "pager": lambda evil: {"core.pager": evil, "pager.diff": evil, "core.editor": evil, "core.askPass": evil, "alias.diff": f"!{evil}"},
    "promisor": lambda evil: {
        "extensions.partialClone": "origin", "remote.origin.promisor": "true", "remote.origin.url": "ssh://host/x",
        "core.sshCommand": evil, "remote.origin.uploadpack": evil, "core.repositoryFormatVersion": "1",
    },
    "promisor here": lambda evil: {
        "extensions.partialClone": "origin", "remote.origin.promisor": "true", "remote.origin.url": os.path.dirname(evil),
        "remote.origin.uploadpack": evil, "core.repositoryFormatVersion": "1",
    },
}


@pytest.mark.parametrize("way", RUNS)
def test_configured_commands_of_a_repository_are_not_run(
    repository: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], way: str,
) -> None:
    mark, evil = tmp_path / "mark", tmp_path / "hooks" / "post-index-change"
    evil.parent.mkdir()
    evil.write_text(f"#!/bin/sh\necho ran >> {mark}\nexec cat\n")
    evil.chmod(0o755)
    (repository / ".gitattributes").write_text(f"*.yaml filter={'a=b' if way == 'equals' else 'own'} diff=own\n")
    git(repository, "add", "-A")
    git(repository, "commit", "-qm", "attributes")
    (repository / "robot.yaml").write_text(ROBOT + "description: other\n")
    git(repository, "commit", "-qam", "other")
    (repository / "new.yaml").write_text(ROBOT)
    os.utime(repository / "robot.yaml", (1, 1))  # git has to look at what is in it
    for name, value in RUNS[way](str(evil)).items():
        git(repository, "config", name, value)
    if way.startswith("promisor"):
        blob = git(repository, "rev-parse", "main~1:robot.yaml")
        (repository / ".git" / "objects" / blob[:2] / blob[2:]).unlink()
    codes = [main(["touched", "--since", "main~1"])]
    for sides in (["main~1"], ["main~1..main"], ["main~1...main", "--", "robot.yaml"]):
        codes.append(main(["diff", "--no-code", *sides]))
    capsys.readouterr()
    assert not mark.exists()
    assert codes == [2 if way.startswith("promisor") else 0] * 4
    if way in ("smudge", "clean", "fsmonitor"):  # the same commands of git do run it
        subprocess.run(["git", "cat-file", "--filters", "main:robot.yaml"], cwd=repository, check=False, capture_output=True)
        subprocess.run(["git", "diff", "main~1", "--name-only"], cwd=repository, check=False, capture_output=True)
        assert mark.exists()


def test_filters_run_only_in_trusted_repositories(repository: Path) -> None:
    """`git lfs install --local` creates such a filter."""
    (repository / ".gitattributes").write_text("*.yaml filter=own\n")
    git(repository, "config", "filter.own.smudge", "tr a-z A-Z")
    commit = git(repository, "rev-parse", "HEAD")
    for trusted, text in ((True, ROBOT.upper()), (False, ROBOT)):
        with Revision(Repository.of(str(repository), trusted=trusted), "main", commit) as revision:
            revision.lay_out(["robot.yaml"])
            assert Path(revision.file("robot.yaml")).read_text() == text


def test_changes_inside_a_submodule_are_not_examined(repository: Path, tmp_path: Path) -> None:
    mark = tmp_path / "mark"
    git(repository, "-c", "protocol.file.allow=always", "submodule", "--quiet", "add", str(repository), "parts")
    git(repository, "commit", "-qm", "with itself")
    git(repository / "parts", "config", "filter.own.clean", f"touch {mark}; cat")
    (repository / "parts" / ".gitattributes").write_text("* filter=own\n")
    (repository / "parts" / "robot.yaml").write_text(ROBOT.replace("a:", "b:"))
    assert changed_since("HEAD", str(repository)) == [] and not mark.exists()
    with pytest.raises(NotARepository):
        changed_since("nothing", str(repository))


@pytest.mark.parametrize("target", [b"", b"a\0b"])
def test_invalid_link_target_is_omitted(repository: Path, capsys: pytest.CaptureFixture[str], target: bytes) -> None:
    robot = ROBOT + "description: x.yaml\n"
    commit = commit_of(repository, [("100644", "robot.yaml", robot.encode()), ("120000", "x.yaml", target)])
    code = main(["diff", "--no-code", f"main...{commit}"])
    assert code in (0, 1) and "TC899" not in capsys.readouterr().err
