"""Definitions, references and renames over the protocol, in unsaved and broken documents."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from pygls.exceptions import JsonRpcException

from lsp.editor import Editor
from lsp.walkers import FILES, HEAD, LEG, WALKER, write

ROOT = Path(__file__).parents[2]
PART = '''\
from typing import Annotated

from thingc import Length, MountPoint, Thing


class Bracket(Thing):
    """A bracket.

    Args:
        width: across
    """

    def __init__(self, width: Length = 20):
        super().__init__(material="red")
        self.seat = MountPoint(plane(width))
        self.hole = [MountPoint(self.seat) for _ in range(2)]
        setattr(self, "rim", MountPoint(self.seat))


class Wide(Bracket):
    """A wide one."""

    def __init__(self):
        super().__init__(40)
        self.rest = self.seat
'''
USER = """\
thingc: assembly/1
name: user
materials: {red: {density: 1000 kg/m^3}}
components:
  one: {part: brackets:Bracket, params: {width: 12 mm}}
  two: {part: brackets:Wide, attach: {seat: one.hole_0}}
  three: {frame: true, mass: 1 g, attach: {origin: two.rim}}
mounts: {foot: one.seat}
"""


@pytest.fixture(scope="module")
def editor(shared_store: str) -> Iterator[Editor]:
    editor = Editor(shared_store, trusted=False)
    yield editor
    assert editor.leave() == 0


@pytest.fixture
def folder(tmp_path: Path, editor: Editor) -> Iterator[Path]:
    yield write(tmp_path)
    for uri in [uri for uri in editor.versions if uri.startswith(tmp_path.as_uri())]:
        editor.close(Path(uri.removeprefix("file://")))


@pytest.fixture
def user(folder: Path) -> Path:
    (folder / "thingc.toml").write_text('thingc = "workspace/1"\nparts = ["parts"]\n')
    (folder / "parts").mkdir()
    (folder / "parts/brackets.py").write_text(PART)
    (folder / "user.yaml").write_text(USER)
    return folder


def position(text: str, words: str) -> dict[str, int]:
    """Return the position of the `|` in words that occur once in a text."""
    plain = words.replace("|", "")
    assert text.count(plain) == 1, f"{plain!r} stands {text.count(plain)} times"
    before = text[: text.index(plain) + words.index("|")]
    return {"line": before.count("\n"), "character": len(before) - before.rfind("\n") - 1}


def ask(editor: Editor, method: str, path: Path, words: str = "", **more: Any) -> Any:
    text = more.pop("text", None) or path.read_text()
    asked = {"textDocument": {"uri": path.as_uri()}, **({"position": position(text, words)} if words else {}), **more}
    return editor.request(f"textDocument/{method}", asked)


def shown(answer: Any) -> list[str]:
    """Return locations as the file name and the text around the range, which is in brackets."""
    places = []
    for one in answer:
        path = Path(one.uri.removeprefix("file://"))
        line = path.read_text().splitlines()[one.range.start.line]
        start, end = one.range.start.character, one.range.end.character
        places.append(f"{path.name} {line[max(0, start - 8):start].lstrip()}[{line[start:end]}]{line[end:end + 8].rstrip()}")
    return places


def applied(answer: Any) -> dict[str, str]:
    """Return the texts of files with the edits of a response applied, by name."""
    texts = {}
    for change in answer.document_changes:
        path = Path(change.text_document.uri.removeprefix("file://"))
        lines = path.read_text().splitlines(keepends=True)
        for edit in sorted(change.edits, key=lambda one: (one.range.start.line, one.range.start.character), reverse=True):
            start, end = edit.range.start, edit.range.end
            assert start.line == end.line
            lines[start.line] = lines[start.line][: start.character] + edit.new_text + lines[start.line][end.character :]
        texts[path.name] = "".join(lines)
    return texts


DEFINED = {
    ("walker.yaml", "child: leg_$n.so|cket"): "leg.yaml ounts: {[socket]: thigh.",
    ("walker.yaml", "child: l|eg_$n"): "walker.yaml [leg]:",
    ("walker.yaml", "leg_$|n.socket"): "walker.yaml 2, as: [n]}",
    ("walker.yaml", "assembly: head|.toml"): "head.toml []thingc =",
    ("walker.yaml", "to: head.box.f|ace"): "head.toml [face] = { xyz",
    ("walker.yaml", '"=wi|dth / 2"'): "walker.yaml [width]: {value",
    ("walker.yaml", "material: 'bl|ue'"): "paints.yaml [blue]: {densi",
    ("walker.yaml", "leg_*: b|ent"): "leg.yaml poses: {[bent]: {knee:",
    ("walker.yaml", "extends: be|nch"): "walker.yaml [bench]: {root:",
    ("walker.yaml", "leg_0/kn|ee: {"): "leg.yaml [knee]: {type:",
    ("study.yaml", "leg.joints.kn|ee.limit"): "leg.yaml [knee]: {type:",
    ("study.yaml", "length.leg_0.k|nee"): "leg.yaml [knee]: {type:",
    ("head.toml", 'neck = "box.u|nder"'): "head.toml [under] = { rpy",
    ("user.yaml", "attach: {se|at"): "brackets.py self.[seat] = Mount",
    ("user.yaml", "one.ho|le_0"): "brackets.py self.[hole] = [Moun",
    ("user.yaml", "{wi|dth: 12"): "brackets.py _(self, [width]: Length",
    ("user.yaml", "brackets:W|ide"): "brackets.py class [Wide](Bracket",
    ("user.yaml", "two.ri|m"): "",
    ("parts/brackets.py", "self.ho|le = "): "user.yaml at: one.[hole]_0}}",
    ("parts/brackets.py", "class Bra|cket(T"): "user.yaml rackets:[Bracket], params",
}


def test_definitions_of_names(editor: Editor, user: Path) -> None:
    for name in ("walker.yaml", "study.yaml", "head.toml", "user.yaml"):
        editor.open(user / name)
    assert {(name, words): "; ".join(shown(ask(editor, "definition", user / name, words))) for name, words in DEFINED} == DEFINED


def test_references_and_highlights(editor: Editor, user: Path) -> None:
    editor.open(user / "leg.yaml")
    found = shown(ask(editor, "references", user / "leg.yaml", "kn|ee: {type", context={"includeDeclaration": False}))
    assert [one.partition(" ")[0] for one in found] == ["leg.yaml", *["study.yaml"] * 2, *["walker.yaml"] * 7]
    assert [re.sub(r".*\[(.*)\].*", r"\1", one) for one in found].count("*knee") == 1  # a pattern that it fits
    kinds = [one.kind for one in ask(editor, "documentHighlight", user / "leg.yaml", "{kn|ee: 40")]
    assert kinds == [3, 2]
    found = shown(ask(editor, "references", user / "user.yaml", "one.se|at", context={"includeDeclaration": True}))
    assert found == [
        "brackets.py self.[seat] = Mount", "brackets.py nt(self.[seat]) for _", "brackets.py nt(self.[seat]))", "brackets.py = self.[seat]",
        "user.yaml ttach: {[seat]: one.ho", "user.yaml ot: one.[seat]}",
    ]


def test_rename_edits_unsaved_documents_and_python(editor: Editor, user: Path) -> None:
    editor.open(user / "user.yaml")
    editor.type(user / "user.yaml", "# unsaved\n" + USER)
    text = "# unsaved\n" + USER
    (user / "user.yaml").write_text(text)  # what the places are read from, below; the server has it already
    there = ask(editor, "prepareRename", user / "user.yaml", "one.ho|le_0")
    assert (there.placeholder, there.range.start.line) == ("hole", 6)
    texts = applied(ask(editor, "rename", user / "user.yaml", "one.ho|le_0", newName="bore"))
    assert texts == {"user.yaml": text.replace("one.hole_0", "one.bore_0"), "brackets.py": PART.replace("hole", "bore")}
    texts = applied(ask(editor, "rename", user / "user.yaml", "{wi|dth: 12", newName="breadth"))
    assert texts == {"user.yaml": text.replace("width", "breadth"), "brackets.py": PART.replace("width", "breadth")}
    texts = applied(ask(editor, "rename", user / "walker.yaml", "  f|lag: {", newName="pennant"))
    assert texts == {"walker.yaml": WALKER.replace("flag", "pennant")}
    texts = applied(ask(editor, "rename", user / "head.toml", "[components.b|ox]", newName="case"))
    assert texts == {"head.toml": HEAD.replace("box", "case"), "walker.yaml": WALKER.replace("head.box", "head.case")}


REFUSED = {
    ("walker.yaml", "  bo|dy:\n", "leg_1"): "there is already a component `leg_1`",
    ("walker.yaml", "  bo|dy:\n", "Nose"): "there is already an exported mount `nose` with different case",
    ("walker.yaml", "  bo|dy:\n", "origin"): "a component cannot have the reserved name `origin`",
    ("walker.yaml", "  bo|dy:\n", "a b"): "`a b` is not a valid name: use letters, digits and `_` after a letter",
    ("walker.yaml", "  bo|dy:\n", "true"): "`true` is a reserved word of YAML: choose another name",
    ("walker.yaml", "  stan|ce: 20", "sin"): "a parameter cannot have the reserved name `sin`",
    ("walker.yaml", "  stan|ce: 20", "k"): "there is already an index `k`",
    ("walker.yaml", "as: |k}", "half"): "there is already a parameter `half`",
    ("walker.yaml", "  w|ag:\n", "leg_knee"):  # the pattern `*knee` would fit it
        "`wag` cannot be renamed to `leg_knee`: the text at walker.yaml:59 would change its meaning",
    ("walker.yaml", '"str|*"', "x"): "`stretch` matches a pattern and cannot be renamed here",
    ("walker.yaml", "assembly: hea|d.toml", "x"): "`thingc rename` does not rename files, such as `head.toml`",
    ("walker.yaml", "  wag: {t|ype: joint}", "x"): "there is no name at this position",
    ("user.yaml", "brackets:W|ide", "x"): "`thingc rename` does not rename classes, such as `Wide`",
    ("user.yaml", "two.ri|m", "x"): "the definition of the mount of a part `rim` was not found in the code of `brackets:Wide`",
    ("user.yaml", "one.se|at", "rest"): "`Bracket` already has a `rest`",
    ("user.yaml", "one.se|at", "for"): "a mount of a part cannot have the Python keyword `for` as its name",
    ("user.yaml", "materials: {re|d:", "blue"): "`parts/brackets.py` also uses the material `red`: rename the material by hand",
}


def test_invalid_renames_are_refused_with_a_message(editor: Editor, user: Path) -> None:
    for (name, words, new), expected in REFUSED.items():
        with pytest.raises(JsonRpcException) as refused:
            ask(editor, "rename", user / name, words, newName=new)
        assert str(refused.value) == expected, (words, new)


def test_rename_refuses_ambiguous_uses_in_other_parts(editor: Editor, user: Path) -> None:
    (user / "parts/others.py").write_text("from brackets import Bracket\n\n\ndef seat_of(bracket):\n    return bracket.seat\n")
    refused = "`seat` at parts/others.py:5 may refer to the mount of a part of `Bracket`: rename by hand"
    with pytest.raises(JsonRpcException, match=refused):
        ask(editor, "rename", user / "user.yaml", "one.se|at", newName="perch")
    (user / "parts/others.py").write_text("from brackets import Bracket\n\n\ndef perch_of(other):\n    return other.perch\n")
    refused = "`perch` at parts/others.py:5 would refer to the mount of a part of `Bracket`: choose another name"
    with pytest.raises(JsonRpcException, match=refused):
        ask(editor, "rename", user / "user.yaml", "one.se|at", newName="perch")
    (user / "parts/others.py").write_text("class Other:\n    def result(self):\n        return self.p.width, self.seat\n")  # its own
    assert sorted(applied(ask(editor, "rename", user / "user.yaml", "one.se|at", newName="perch"))) == ["brackets.py", "user.yaml"]
    assert sorted(applied(ask(editor, "rename", user / "user.yaml", "{wi|dth: 12", newName="breadth"))) == ["brackets.py", "user.yaml"]


def test_broken_text_uses_the_last_valid_state(editor: Editor, folder: Path) -> None:
    path = folder / "walker.yaml"
    editor.open(path)
    broken = WALKER.replace("  tail: {frame: true,", "\n  tail: {frame: [true,")
    editor.type(path, broken)
    (folder / "walker.yaml").write_text(broken)
    assert shown(ask(editor, "definition", path, "child: l|eg_$n")) == ["walker.yaml [leg]:"]
    assert shown(ask(editor, "definition", path, "leg_$|n.socket")) == ["walker.yaml 2, as: [n]}"]
    assert ask(editor, "definition", path, "ta|il: {frame: [") == []
    assert ask(editor, "semanticTokens/full", path).data
    assert "tail" not in [one.name for one in ask(editor, "documentSymbol", path)[4].children]
    with pytest.raises(JsonRpcException, match="`walker.yaml`, which contains `leg`, cannot be parsed: fix the file first"):
        ask(editor, "rename", path, "child: l|eg_$n", newName="limb")
    editor.open(folder / "leg.yaml")
    with pytest.raises(JsonRpcException, match="`walker.yaml`, which contains `socket`, cannot be parsed"):
        ask(editor, "rename", folder / "leg.yaml", "{so|cket", newName="cup")
    assert applied(ask(editor, "rename", folder / "leg.yaml", "  thi|gh:", newName="femur")) == {"leg.yaml": LEG.replace("thigh", "femur")}


FOLDS = {
    "walker.yaml": [("components:", "  flag"), ("  body:", "      mast"), ("  stand:", "    standing_on")],
    "head.toml": [("[components.box.mounts]", "under = {"), ("[joints.chew]", "upper =")],
}


def test_symbols_and_folding_ranges(editor: Editor, folder: Path) -> None:
    for name in ("walker.yaml", "head.toml"):
        text = FILES[name]
        path = folder / name
        editor.open(path)
        symbols = {one.name: one for one in ask(editor, "documentSymbol", path)}
        components = symbols["components"]
        assert [one.name for one in components.children] == {
            "walker.yaml": ["body", "leg", "toe", "head", "badge", "tail", "flag"], "head.toml": ["box", "jaw"],
        }[name]
        for one in (*symbols.values(), *components.children):
            lines = text.splitlines()
            at = one.selection_range
            assert lines[at.start.line][at.start.character:at.end.character].strip("\"'") == one.name
            assert (one.range.start.line, one.range.end.line) <= (at.start.line, one.range.end.line)
        folds = {(one.start_line + 1, one.end_line + 1) for one in ask(editor, "foldingRange", path)}
        for first, last in FOLDS[name]:
            assert tuple(text[: text.index(one)].count("\n") + 1 for one in (first, last)) in folds, (first, last)
    names = [one.name for one in editor.request("workspace/symbol", {"query": "kne"})]
    assert names == ["knee"]


def test_semantic_tokens_of_expressions(editor: Editor, folder: Path) -> None:
    path = folder / "walker.yaml"
    text = WALKER.replace('"=width / 2"', '"=min(width, 2e1 mm) / pi # é"').replace(" # é", "")
    editor.open(path, text)
    data = ask(editor, "semanticTokens/full", path).data
    line = column = 0
    words = []
    for at in range(0, len(data), 5):
        line, column = line + data[at], data[at + 1] + (column if data[at] == 0 else 0)
        words.append((line + 1, text.splitlines()[line][column : column + data[at + 2]], data[at + 3]))
    assert words[:5] == [(6, "min", 2), (6, "width", 0), (6, "2e1", 3), (6, "mm", 4), (6, "pi", 1)]
    assert (30, "i", 1) in words
