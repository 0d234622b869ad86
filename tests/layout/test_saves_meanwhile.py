"""Saves by an editor while a command runs: none is lost, at any time. Also tests the guarantees of `replace_files` for several files."""

from __future__ import annotations

import fcntl
import multiprocessing
import os
import stat
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from thingc.base import replacement
from thingc.base.replacement import ReplacementRefused, provisional, replace_files
from thingc.tools.cli.main import main

ROBOT = """\
thingc: assembly/1
name: robot
parameters: {reach: {value: 10 mm}}
components:
  a:   {link: true, mass: 1 kg, shapes: [{box: [=reach, 10 mm, 10 mm]}]}
  b: {assembly: other.yaml, at: {in: a.origin}}
mounts: {hook: b.tip}
modes: {m: {root: a, base: fixed}}
"""
OTHER = """\
thingc: assembly/1
name: other
components: {a: {link: true, mass: 1 kg, shapes: [{box: 10 10 10 mm}]}}
mounts: {tip: a.origin}
"""
PART = "from thingc import Thing\n\n\nclass Foo(Thing):\n    def result(self):\n        return None\n"
URDF = """\
<robot name="arm"><link name="base"/><link name="end"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="turn" type="revolute"><parent link="base"/>
<child link="end"/>
<axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>
"""
EDIT = b"# an edit\n"
COMMANDS = {
    "fmt": ["fmt", "robot.yaml"],
    "set": ["set", "robot.yaml", "reach=12 mm"],
    "rename": ["rename", "robot.yaml", "components.a", "first"],
    "rename in two": ["rename", "other.yaml", "mounts.tip", "end"],
    "add": ["add", "mode", "n", "--to", "robot.yaml", "--root", "a", "--base", "free"],
    "add a file": ["add", "assembly", "third", "--to", "robot.yaml", "--at", "a.origin"],
    "add to a file": ["add", "part", "odd:Bar", "--new"],
    "fix": ["check", "--fix", "wrong.yaml"],
    "import": ["import", "arm.urdf", "--update"],
}
SAVED = {
    "rename in two": ("robot.yaml", "other.yaml"), "add to a file": ("parts/odd.py",), "fix": ("wrong.yaml",),
    "import": ("arm/arm.yaml",),
}

_save: Callable[[str], None] | None = None


def _on_open(event: str, arguments: tuple[Any, ...]) -> None:
    if event == "open" and _save is not None and isinstance(arguments[0], str):
        _save(arguments[0])


sys.addaudithook(_on_open)  # cannot be taken away again


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, shared_store: str) -> Path:
    monkeypatch.setenv("THINGC_STORE", shared_store)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "parts").mkdir()
    for name, text in (
        ("robot.yaml", ROBOT), ("other.yaml", OTHER), ("parts/odd.py", PART), ("arm.urdf", URDF),
        ("wrong.yaml", ROBOT.replace("mass", "masss")), ("thingc.toml", 'thingc = "workspace/1"\n'),
    ):
        (tmp_path / name).write_text(text)
    assert main(["import", "arm.urdf"]) == 0
    (tmp_path / "arm.urdf").write_text(URDF.replace('upper="1"', 'upper="2"'))
    return tmp_path


def files(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("name", COMMANDS)
def test_concurrent_save_is_not_lost(folder: Path, capsys: pytest.CaptureFixture[str], name: str) -> None:
    """The file is saved before each time that the command opens the document, by a rename as editors do. The command's own last check is
    one of these."""
    global _save
    before, refused, done = files(folder), 0, 0
    for victim in SAVED.get(name, ("robot.yaml",)):
        path, number, saved = str(folder / victim), 0, True
        while saved:
            for old in files(folder).keys() - before.keys():
                (folder / old).unlink()
            for file, data in before.items():
                (folder / file).write_bytes(data)
            left, saved = number, False

            def save(opened: str, path: str = path) -> None:
                nonlocal left, saved
                if os.path.realpath(opened) == path and not saved:
                    if left == 0:
                        saved = True
                        Path(f"{path}~").write_bytes(Path(path).read_bytes() + EDIT)
                        os.replace(f"{path}~", path)
                    left -= 1

            _save = save
            try:
                code = main(COMMANDS[name])
            finally:
                _save = None
            text = "".join(capsys.readouterr())
            now = files(folder)
            assert EDIT.strip() in now[victim] or not saved, f"save {number} was lost: {text}"
            if f"`{victim}` changed while this command ran" in text:
                refused += 1
                assert code == 2 and now == {**before, victim: before[victim] + EDIT}, "nothing is half-written"
            else:
                done += 1
                assert code in (0, 1) and now[victim] != before[victim] + EDIT, text
            number += 1
    assert refused and done


def test_undone_addition_keeps_the_save_of_an_editor(folder: Path) -> None:
    part, new = str(folder / "parts" / "odd.py"), str(folder / "deep" / "new" / "file.py")
    changes = {part: (PART.encode(), b"more"), new: (None, b"new")}
    with provisional(changes):
        assert Path(new).read_bytes() == b"new"
    assert Path(part).read_text() == PART and not (folder / "deep").exists()
    with provisional(changes):
        Path(part).write_bytes(b"saved")
    assert Path(part).read_bytes() == b"saved" and not (folder / "deep").exists()
    with pytest.raises(ReplacementRefused, match="odd.py` changed while this command ran"), provisional(changes):
        raise AssertionError("what was saved must not be replaced")
    with provisional({new: (None, b"new")}) as keep:
        Path(new).write_bytes(b"saved")
        with pytest.raises(ReplacementRefused):
            keep({part: (b"saved", b"lost")})
    assert Path(part).read_bytes() == b"saved" and Path(new).read_bytes() == b"saved"


def test_files_are_replaced_all_or_none(tmp_path: Path) -> None:
    one, two, gone, deep = (tmp_path / name for name in ("one", "two", "gone", "deep"))
    for path in (one, two, gone):
        path.write_bytes(b"old")
    deep.mkdir()
    good = {str(one): (b"old", b"new"), str(two): (b"old", b"new"), str(gone): (b"old", None)}
    for bad in ({str(deep): (b"old", b"new")}, {str(tmp_path / "no" / "file"): (None, b"new")}, {str(two): (b"other", b"new")}):
        with pytest.raises(ReplacementRefused):
            replace_files({**good, **bad})
        assert {path.name: path.read_bytes() for path in (one, two, gone)} == {"one": b"old", "two": b"old", "gone": b"old"}
    replace_files(good)
    assert (one.read_bytes(), two.read_bytes(), gone.exists()) == (b"new", b"new", False)
    assert sorted(os.listdir(tmp_path)) == ["deep", "one", "two"]


def test_links_modes_and_pipes_are_respected(tmp_path: Path) -> None:
    file, link, dangling, pipe = (tmp_path / name for name in ("file", "link", "dangling", "pipe"))
    file.write_bytes(b"old")
    file.chmod(0o640)
    link.symlink_to("file")
    dangling.symlink_to("../outside")
    os.mkfifo(pipe)
    replace_files({str(link): (b"old", b"new")})
    assert link.is_symlink() and file.read_bytes() == b"new" and stat.S_IMODE(file.stat().st_mode) == 0o640
    for path in (dangling, pipe):
        with pytest.raises(ReplacementRefused):
            replace_files({str(path): (None, b"new")})
    assert not (tmp_path.parent / "outside").exists() and stat.S_ISFIFO(pipe.stat().st_mode)


def count_up(path: str, times: int) -> None:
    done = 0
    while done < times:
        before = Path(path).read_bytes()
        try:
            replace_files({path: (before, str(int(before) + 1).encode())})
            done += 1
        except ReplacementRefused:
            pass


def test_concurrent_commands_wait_for_each_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = str(tmp_path / "number")
    Path(path).write_bytes(b"0")
    processes = [multiprocessing.get_context("fork").Process(target=count_up, args=(path, 100)) for _ in range(3)]
    for one in processes:
        one.start()
    for one in processes:
        one.join(60)
    assert Path(path).read_bytes() == b"300"
    monkeypatch.setattr(replacement, "ATTEMPTS", 5)
    descriptor = os.open(tmp_path, os.O_RDONLY)
    fcntl.flock(descriptor, fcntl.LOCK_EX)  # as `flock . thingc set ...` does
    replace_files({path: (b"300", b"301")})
    os.close(descriptor)
    assert Path(path).read_bytes() == b"301"
