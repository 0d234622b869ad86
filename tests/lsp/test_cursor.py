"""The path and role at the cursor, in valid and in broken documents."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
import tomlkit

from thingc.base.diagnostics import Report
from thingc.base.source import MappingNode, ScalarNode, Span, walk
from thingc.documents.load.documents import read_tree
from thingc.documents.load.text import Source
from thingc.tools.lsp.cursor import Cursor, cursor_at

ROOT = Path(__file__).resolve().parents[2]

EVERYTHING = """\
# a document with every way to write a key and a value
thingc: assembly/1
name: "all"     # of them
description: >
  Text of several
  lines: not keys.
parameters: {reach: {value: 100 mm, doc: 'it''s far'}, "far": "=max(3 mm, reach / 40)",
  wide: 3 mm}
materials:
- a.yaml
-   b.yaml
tests:
  - name: &first one
    of: [a, {b: c, d: [e, "f, g"]}, h]
    url: http://a:80/#x
  -
    name: two
links: {
  one: two,   # a comment, with {brackets
  three: four.five
}
empty:
last: {}
"""

TOML = """\
# a table for everything
thingc = "assembly/1"
parameters.reach = {value = "100 mm", "max" = 'far'}

[components.plate]   # where it begins
part = "arm:BasePlate"
params = {size = {x = 3, y = [1, "two", {z = true}]}}

[[tests]]
name = "one"
points = [
  "a",  # the first
  "b",
]
[[tests]]
name = '''
two'''
"""


def cells(text: str, path: str) -> Iterator[tuple[str, tuple[str | int, ...], int, int]]:
    """Yield keys and scalars of a valid document from the parser: role, path, first character and end offset."""
    report = Report()
    tree = read_tree(path, text.encode(), report)
    assert tree is not None and not report.diagnostics
    starts = Source(path, text).starts

    def ends(span: Span) -> tuple[int, int]:
        return starts[span.line - 1] + span.column - 1, starts[span.end_line - 1] + span.end_column - 1

    for at, node in walk(tree):
        if isinstance(node, MappingNode):
            for span in node.keys.values():
                yield "key", at, *ends(span)
        elif isinstance(node, ScalarNode) and node.span.line == node.span.end_line and node.text:
            yield "value", at, *ends(node.span)


def agrees(cursor: Cursor | None, role: str, path: tuple[str | int, ...]) -> bool:
    return cursor is not None and cursor.path == path and (cursor.role == role or cursor.either)


def as_toml(text: str) -> str:
    tree = read_tree("a.yaml", text.encode(), Report())
    assert tree is not None
    return tomlkit.dumps(tree.plain())  # type: ignore[arg-type]


def read(path: str) -> str:
    return (ROOT / path).read_text()


@pytest.mark.parametrize(("text", "name", "step"), [
    (EVERYTHING, "a.yaml", 1),
    (EVERYTHING.replace("\n", "\r\n"), "a.yaml", 3),
    (TOML, "a.toml", 1),
    (read("assemblies/end_effector.yaml"), "a.yaml", 5),
    (as_toml(read("assemblies/end_effector.yaml")), "a.toml", 7),
    (read("assemblies/arm.yaml"), "a.yaml", 53),
    (read("assemblies/minchw/minchw.yaml"), "a.yaml", 97),
    (as_toml(read("assemblies/minchw/minchw.yaml")), "a.toml", 97),
], ids=["everything", "crlf", "toml", "hand", "hand_toml", "arm", "minchw", "minchw_toml"])
def test_cursor_path_matches_the_parser(text: str, name: str, step: int) -> None:
    """The path must also be correct if the rest of the line or of the document is missing."""
    toml = name.endswith(".toml")
    places = [(role, path, start, end, at) for role, path, start, end in cells(text, name) for at in range(start, end + 1)]
    assert places
    for role, path, start, end, at in places[::step]:
        whole = cursor_at(text, at, toml=toml)
        shown = f"{text[max(0, at - 40) : at]}│{text[at : at + 20]}"
        assert agrees(whole, role, path), shown
        assert whole is not None and (whole.start, whole.end) in {(start, end), (start + 1, end - 1)}, shown
        if at > start:
            line_end = min(found for mark in "\r\n" if (found := f"{text}\r\n".find(mark, at)) >= 0)
            assert agrees(cursor_at(text[:at] + text[line_end:], at, toml=toml), role, path), f"the line cut off: {shown}"
            cut = cursor_at(text[:at], at, toml=toml)
            assert agrees(cut, role, path), f"the document cut off: {shown}"
            assert cut is not None and cut.typed.strip("'\"") == whole.typed.strip("'\""), shown


YAML_CASES = {
    "an empty line in a component": ("components:\n  plate:\n    part: a:B\n    │\njoints:\n", "key", ("components", "plate"), ""),
    "an empty line among components": ("components:\n  plate:\n    part: a:B\n  │\njoints:\n", "key", ("components",), ""),
    "an empty line at the left": ("components:\n  plate:\n    part: a:B\n│\n", "key", (), ""),
    "the first line of a component": ("components:\n  plate:\n    │\njoints:\n", "key", ("components", "plate"), ""),
    "a first word": ("components:\n  plate:\n    pa│\njoints: {}\n", "key", ("components", "plate"), "pa"),
    "a word among keys": ("components:\n  plate:\n    part: a:B\n    att│\n    mass: 3 g\n", "key", ("components", "plate"), "att"),
    "behind the colon": ("name:│\nthingc: x\n", "value", ("name",), ""),
    "behind colon and space": ("components:\n  plate:\n    part: │\n    mass: 3 g\n", "value", ("components", "plate", "part"), ""),
    "a word as a value": ("joints:\n  yaw:\n    type: rev│\n", "value", ("joints", "yaw", "type"), "rev"),
    "behind a dot": ("joints:\n  yaw:\n    parent: servo.│\n    child: x.y\n", "value", ("joints", "yaw", "parent"), "servo."),
    "behind a number": ("a:\n  b: 30 │\n", "value", ("a", "b"), "30 "),
    "an open brace": ("components:\n  plate: {│\n  other: {part: a:B}\n", "key", ("components", "plate"), ""),
    "an open brace in an open brace": ("poses: {home: {ya│\nmodes:\n  a: b\n", "key", ("poses", "home"), "ya"),
    "a value in an open brace": ("components:\n  plate: {part: │\n  other: {part: a:B}\n", "value", ("components", "plate", "part"), ""),
    "the next key in braces": ("plate: {part: a:B, │}\n", "key", ("plate",), ""),
    "the next line in braces": ("plate: {part: a:B,\n  │\n  mass: 3 g}\n", "key", ("plate",), ""),
    "an open list": ("materials: [│\ncomponents: {}\n", "value", ("materials", 0), ""),
    "the next item": ("materials: [a, b, │]\n", "value", ("materials", 2), ""),
    "a dash": ("materials:\n  - a.yaml\n  - │\nname: x\n", "key", ("materials", 1), ""),
    "a quote that is open": ('parameters:\n  a: "=max(re│\n  b: "=3"\n', "value", ("parameters", "a"), "=max(re"),
    "a quote that is open in braces": ('parameters: {a: "=max(re│\nb: "=3"\n', "value", ("parameters", "a"), "=max(re"),
    "an expression": ("a: {b: =rea│ / 2}\n", "value", ("a", "b"), "=rea"),
    "a comment": ("a: 1  # com│ment\n", "", (), ""),
    "a text of lines": ("a: |\n  te│xt\nb: 1\n", "", (), ""),
}
TOML_CASES = {
    "a table's empty line": ('[components.plate]\npart = "a:B"\n│\n[joints]\n', "key", ("components", "plate"), ""),
    "a table's header": ("[components]\n[joints.ya│\ntype = 'x'\n", "key", ("joints",), "ya"),
    "a header without its end": ("[components.│\n", "key", ("components",), ""),
    "a dotted key": ("[joints.yaw]\nlimit.lo│\n", "key", ("joints", "yaw", "limit"), "lo"),
    "behind the equals sign": ("[joints.yaw]\ntype = │\n", "value", ("joints", "yaw", "type"), ""),
    "a string that is open": ('[joints.yaw]\nparent = "servo.│\nchild = "a.b"\n', "value", ("joints", "yaw", "parent"), "servo."),
    "an inline table": ('[joints.yaw]\nlimit = {lower = "1 deg", │\ndrive = "x"\n', "key", ("joints", "yaw", "limit"), ""),
    "a list over lines": ('materials = [\n  "a",\n  │\n', "value", ("materials", 1), ""),
}


@pytest.mark.parametrize("name", [*YAML_CASES, *TOML_CASES])
def test_cursor_in_broken_text(name: str) -> None:
    toml = name in TOML_CASES
    marked, role, path, typed = (TOML_CASES if toml else YAML_CASES)[name]
    text = marked.replace("│", "")
    cursor = cursor_at(text, marked.index("│"), toml=toml)
    if not role:
        assert cursor is None
        return
    assert cursor is not None
    assert (cursor.role, cursor.path, cursor.typed) == (role, path, typed)
    assert text[cursor.start : cursor.end].startswith(typed) and "\n" not in text[cursor.start : cursor.end]


def test_sibling_keys_exclude_the_key_at_the_cursor() -> None:
    text = "components:\n  plate:\n    part: a:B\n    pa\n    mass: 3 g\n"
    cursor = cursor_at(text, text.index("pa\n") + 2, toml=False)
    assert cursor is not None
    assert cursor.keys["components", "plate"] == ("part", "mass")
    assert cursor.scalars["components", "plate", "part"] == "a:B"
    assert not cursor.separated
    own = cursor_at(text, text.index("mass") + 2, toml=False)
    assert own is not None and own.separated and own.keys["components", "plate"] == ("part",)


def test_pathological_text_is_handled() -> None:
    for text in ("[" * 5000, "{a: " * 5000, "- " * 3000, '"' * 5001, "a: {\n" * 500, "[[a." * 999, "a = [\n" * 500, "\x00: :\t- {:}"):
        for toml in (False, True):
            for at in (0, len(text) // 2, len(text)):
                cursor_at(text, at, toml=toml)
