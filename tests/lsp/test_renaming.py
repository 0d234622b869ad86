"""A rename changes every occurrence of a name, or is refused. The robot stays the same except for the name, and renaming back restores
the bytes."""

from __future__ import annotations

import random
import re
from collections import Counter
from pathlib import Path

import pytest
from msgspec.structs import replace

from lsp.walkers import WALKER, write
from thingc.base.diagnostics import Report
from thingc.batch import plan
from thingc.documents.names.part_names import Name
from thingc.documents.names.rename import RenameRefused, rename_edits
from thingc.documents.names.workspace_index import WorkspaceIndex, index_workspace
from thingc.documents.workspace import Workspace
from thingc.driver.environment import Environment, Options
from thingc.driver.pipeline import compile
from thingc.tools.cli.main import main
from thingc.tools.diff.comparison import compare
from thingc.tools.diff.snapshot import Snapshot
from thingc.tools.diff.take_snapshot import take_snapshot

ROOT = Path(__file__).parents[2]
REFUSED = {
    "mode bench": "`bench` cannot be renamed to `x_bench`: the text at walker.yaml:{ben*} would change its meaning",
    "pose stretch": "`stretch` cannot be renamed to `x_stretch`: the text at walker.yaml:{str*} would change its meaning",
    "mount hip_0": "`hip_0` cannot be renamed to `x_hip_0`: the text at walker.yaml:{hip_$n} would change its meaning",
    "mount hip_1": "`hip_1` cannot be renamed to `x_hip_1`: the text at walker.yaml:{hip_$n} would change its meaning",
    "index i": "the index has its default name `i`: first add `as: i` under `repeat`",
}
"""Names of the walker that cannot be renamed, and why; braces contain text whose first line number is inserted."""


def seen(folder: Path) -> WorkspaceIndex:
    workspace = Workspace.find(str(folder / "thingc.toml"), Report())
    assert workspace is not None
    return index_workspace(workspace, {})


@pytest.fixture(scope="module")
def walker(tmp_path_factory: pytest.TempPathFactory) -> WorkspaceIndex:
    return seen(write(tmp_path_factory.mktemp("walker")))


def named(sight: WorkspaceIndex, what: str, text: str) -> Name:
    (name,) = (one for one in sight.index.by_name if (one.kind, one.text) == (what, text))
    return name


def drawn(folder: Path, store: str) -> Snapshot:
    with Environment(str(folder / "walker.yaml"), Options(store=store)) as environment:
        compilation = compile(environment)
    assert not compilation.report.diagnostics, compilation.report.diagnostics
    return take_snapshot(compilation)


def test_walker_uses_every_kind_of_name(walker: WorkspaceIndex) -> None:
    """This ensures that a new kind of name is covered by the tests below."""
    from typing import get_args

    from thingc.documents.spec.name_types import Declared, DeclaresName, ReferenceKind, RefersTo

    said = {mention.names for written in walker.documents.values() for mention in written.occurrences}
    of_others = {RefersTo("part"), RefersTo("parameter of a part")}  # in the arm
    of_others |= {RefersTo("mode of a nested assembly"), RefersTo("pose of this nested assembly")}  # in a scene and a lump, below
    assert said == {*map(DeclaresName, get_args(Declared)), *map(RefersTo, get_args(ReferenceKind))} - of_others


def exchanged(sight: WorkspaceIndex, old: str, new: str) -> tuple[WorkspaceIndex, dict[str, str]]:
    """Rename all names that begin with `old` to begin with `new`, one by one; return the result and the messages of refused renames."""
    refused = {}
    for one in [name for name in sight.index.by_name if name.text.startswith(old) and not name.kind.startswith(("document", "part"))]:
        name = next((
            name for name in sight.index.by_name
            if (name.kind, name.text) == (one.kind, one.text) and plain(name.owner) == plain(one.owner) and name.file == one.file
        ), None)
        if name is None:  # the sensor that is called like its joint
            assert (one.kind, one.text) in (("sensor", "wag"), ("sensor", "x_wag"))
            continue
        try:
            sight = rename_edits(sight, name, new + name.text.removeprefix(old)).after
        except RenameRefused as fault:
            refused[f"{name.kind} {name.text}"] = str(fault)
    return sight, refused


def plain(text: object) -> str:
    return str(text).replace("x_", "")


def test_every_name_of_the_walker_can_be_renamed_and_back(walker: WorkspaceIndex, tmp_path: Path, shared_store: str) -> None:
    """The robot is the same except for names, its variants can be planned, and no diagnostic is added."""
    after, refused = exchanged(walker, "", "x_")
    lines = WALKER.splitlines()

    def line(found: re.Match[str]) -> str:
        return str(next(number for number, text in enumerate(lines, 1) if found[1] in text))

    assert {name: plain(text) for name, text in refused.items()} == {
        name: plain(re.sub(r"\{(.+?)\}", line, text)) for name, text in REFUSED.items()
    }
    old, new = write(tmp_path / "old"), write(tmp_path / "new")
    for path in after.documents:
        (new / Path(path).name).write_text(after.read(path) or "")
    changes = [one for one in compare(drawn(old, shared_store), drawn(new, shared_store)).changes if one.change != "renamed"]
    before = Counter(plain((one.what, one.path, one.field, one.old)) for one in changes if one.old is not None)
    assert before == Counter(plain((one.what, one.new_path or one.path, one.field, one.new)) for one in changes if one.new is not None)
    assert not [one for one in changes if one.old is None and one.new is None]
    assert len(plan(str(new / "study.yaml")).axes) == len(plan(str(old / "study.yaml")).axes) == 3
    again, refused = exchanged(after, "x_", "")
    assert refused == {}
    assert {path: again.read(path) for path in again.documents} == {path: walker.read(path) for path in walker.documents}


def test_rename_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    from thingc.tools.cli.main import main

    write(tmp_path)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "leg.yaml").write_bytes(b"\xef\xbb\xbf" + (tmp_path / "leg.yaml").read_bytes().replace(b"\n", b"\r\n"))
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    assert main(["rename", "leg.yaml", "mounts.socket", "cup", "--diff"]) == 0
    assert "+mounts: {cup: thigh.up, sole: shin.foot}" in capsys.readouterr().out
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before
    assert main(["rename", "leg.yaml", "mounts.socket", "cup"]) == 0
    assert capsys.readouterr().out == "leg.yaml: socket -> cup (1)\nwalker.yaml: socket -> cup (1)\n"
    assert (tmp_path / "leg.yaml").read_bytes() == before[tmp_path / "leg.yaml"].replace(b"socket", b"cup")
    assert main(["rename", "leg.yaml", "mounts.cup", "socket"]) == 0
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before
    capsys.readouterr()
    for words, said in {
        ("joints.kne", "x"): "`leg.yaml` has no `joints.kne`\n  help: did you mean `knee`?",
        ("joints.knee.limit", "x"): "`joints.knee.limit` cannot be renamed",
        ("joints.knee", "origin"): "a joint cannot have the reserved name `origin`",
    }.items():
        assert main(["rename", "leg.yaml", *words]) == 2
        assert said in capsys.readouterr().out
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_names_of_both_robots_can_be_renamed_and_back() -> None:
    """A sample of the names. `rename_edits` refuses a rename that changes the meaning of any reference."""
    sight = seen(ROOT)
    assert [name for name in sight.index.by_name if sight.index.find_declaration(name) is None and name.kind != "document"] == []
    names = [name for name in sight.index.by_name if name.kind in ("component", "joint", "parameter", "pose", "mode", "export", "test")]
    for name in random.Random(15).sample(names, 6):
        done = rename_edits(sight, name, f"x_{name.text}")
        again = rename_edits(done.after, replace(name, text=f"x_{name.text}"), name.text)
        assert done.texts and again.texts == {path: sight.read(path) for path in done.texts}


def test_differential_whose_drives_are_used_is_not_renamed(tmp_path: Path) -> None:
    """`wrist_0` in a mode would no longer be a drive."""
    motor = "{kind: motor}"
    body = "frame: true, mass: 1 kg, inertia: {ixx: 1 kg*m^2, iyy: 1 kg*m^2, izz: 1 kg*m^2}"
    (tmp_path / "thingc.toml").write_text('thingc = "workspace/1"\n')
    text = f"""\
thingc: assembly/1
name: two
components: {{a: {{{body}}}, b: {{{body}}}, c: {{{body}}}}}
joints:
  pitch: {{type: continuous, parent: a.origin, child: b.origin}}
  roll: {{type: continuous, parent: b.origin, child: c.origin}}
transmissions: {{wrist: {{differential: {{actuators: [{motor}, {motor}], joints: [pitch, roll], matrix: [[1, 1], [1, -1]]}}}}}}
modes: {{all: {{root: a, actuators: [wrist_0]}}}}
"""
    (tmp_path / "two.yaml").write_text(text)
    sight = seen(tmp_path)
    with pytest.raises(RenameRefused, match=r"`two.yaml:8` uses a drive of the transmission `wrist`"):
        rename_edits(sight, named(sight, "transmission", "wrist"), "both")
    (tmp_path / "two.yaml").write_text(text.replace(", actuators: [wrist_0]", ""))
    sight = seen(tmp_path)
    edits = rename_edits(sight, named(sight, "transmission", "wrist"), "both")
    assert [text.replace("wrist:", "both:").replace(", actuators: [wrist_0]", "")] == list(edits.texts.values())


@pytest.mark.parametrize(("element", "use"), [("modes.bench", "mode: bench"), ("poses.folded", "as: lump, pose: folded")])
def test_rename_of_a_mode_or_pose_updates_scenes(element: str, use: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("arm.yaml").write_text("""\
thingc: assembly/1
name: arm
components: {foot: {frame: true, mass: 1 kg}}
poses: {folded: {}}
modes: {bench: {root: foot}, loose: {root: foot, base: free}}
""")
    scene = f"""\
thingc: assembly/1
name: desk
components:
  room: {{frame: true}}
  left: {{assembly: arm.yaml, {use}, at: {{in: room.origin}}}}
  right: {{assembly: arm.yaml, mode: loose, at: {{in: room.origin}}}}
modes: {{bench: {{root: room}}}}
"""
    Path("desk.yaml").write_text(scene)
    assert main(["rename", "arm.yaml", element, "renamed"]) == 0
    assert Path("desk.yaml").read_text() == scene.replace(use, use.rpartition(" ")[0] + " renamed")
