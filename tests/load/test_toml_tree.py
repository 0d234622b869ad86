"""TOML trees: the oracle for values is tomllib; source positions are checked against the text."""

from __future__ import annotations

import math
import tomllib
from typing import Any

import pytest
import tomlkit
from hypothesis import given, settings, strategies as st

from thingc.base.diagnostics import Code, Report
from thingc.base.source import MappingNode, ScalarNode, SequenceNode, span_at, walk
from thingc.documents.load.text import Source, decode
from thingc.documents.load.toml_tree import read_toml

ARM = '''thingc = "assembly/1"      # kind
name = "ärm"

[parameters]
reach = {value = "100 mm", min = "60 mm"}
"pen diameter" = '15 mm'

[components.plate]
part = "arm:BasePlate"
at.in = "bracket.board"
at.xyz = ["10 mm", 0, 4.5]

[components.yaw_servo]
attach = {back = "plate.servo_seat"}

[[steps]]
a = 1
  [steps.inner]
  b = true

[[steps]]
a = 2
list = [
  1, # one
  {x = [2, 3]},
]

[a.b.c]
text = """
two
lines"""
hex = 0xff
big = 1_000
exp = 1e-3
'''


def read(text: str) -> tuple[MappingNode | None, Report]:
    report = Report()
    return read_toml(Source("/x.toml", text), report), report


def test_values_match_tomllib() -> None:
    node, report = read(ARM)
    assert not report.diagnostics
    assert node is not None
    assert node.plain() == tomllib.loads(ARM)


@pytest.mark.parametrize(("path", "key", "written"), [
    (("thingc",), False, '"assembly/1"'), (("thingc",), True, "thingc"), (("name",), False, '"ärm"'),
    (("parameters",), True, "parameters"), (("parameters", "reach", "min"), False, '"60 mm"'), (("parameters", "reach", "min"),
     True, "min"),
    (("parameters", "pen diameter"), True, '"pen diameter"'), (("parameters", "pen diameter"), False, "'15 mm'"),
    (("components", "plate"), True, "plate"), (("components", "plate", "at", "in"), True, "in"),
    (("components", "plate", "at", "in"), False, '"bracket.board"'), (("components", "plate", "at", "xyz", 2), False, "4.5"),
    (("components", "yaw_servo", "attach"), False, '{back = "plate.servo_seat"}'), (("steps", 0, "inner", "b"), False, "true"),
    (("steps", 1, "a"), False, "2"), (("steps", 1, "list", 0), False, "1"), (("steps", 1, "list", 1, "x", 1), False, "3"),
    (("a", "b", "c", "hex"), False, "0xff"), (("a", "b", "c"), True, "c"), (("a",), True, "a"),
])
def test_source_positions(path: tuple[str | int, ...], key: bool, written: str) -> None:
    node, _ = read(ARM)
    assert node is not None
    span = span_at(node, path, key=key)
    line = ARM.split("\n")[span.line - 1]
    assert span.line == span.end_line
    assert line[span.column - 1 : span.end_column - 1] == written


def test_tables_span_their_statements() -> None:
    node, _ = read(ARM)
    assert node is not None
    components = span_at(node, ("components",))
    assert (components.line, components.end_line) == (8, 14)
    second = span_at(node, ("steps", 1))
    assert (second.line, second.column, second.end_line) == (21, 1, 26)
    text = span_at(node, ("a", "b", "c", "text"))
    assert (text.line, text.end_line) == (29, 31)


def test_line_endings_and_bom_do_not_change_positions() -> None:
    report = Report()
    source = decode("/x.toml", b"\xef\xbb\xbf" + ARM.replace("\n", "\r\n").encode(), report)
    assert source is not None
    windows = read_toml(source, report)
    unix, _ = read(ARM)
    assert windows is not None
    assert unix is not None
    assert not report.diagnostics
    assert windows.plain() == unix.plain()
    assert [(p, n.span) for p, n in walk(windows)] == [(p, n.span) for p, n in walk(unix)]


_keys = st.one_of(st.from_regex(r"[A-Za-z0-9_-]{1,6}", fullmatch=True),
    st.text(st.characters(min_codepoint=32, max_codepoint=0x3FF, exclude_characters="\x7f", exclude_categories=["Cc", "Cs"]),
        max_size=5))
_leaves = st.one_of(
    st.booleans(), st.integers(-10**9, 10**9), st.floats(-1e9, 1e9),
    st.text(st.characters(max_codepoint=0x2FF, exclude_characters="\r", exclude_categories=["Cs", "Cc"]), max_size=10),
)
_values = st.recursive(_leaves, lambda inner: st.one_of(st.lists(inner, max_size=3), st.dictionaries(_keys, inner, max_size=3)),
    max_leaves=12)


@settings(max_examples=38)
@given(st.dictionaries(_keys, _values, max_size=4))
def test_tomlkit_output_is_read_back(value: dict[str, Any]) -> None:
    text = tomlkit.dumps(value)
    node, report = read(text)
    assert not report.diagnostics, text
    assert node is not None
    assert node.plain() == tomllib.loads(text) == value
    lines = text.split("\n")
    for _, inner in walk(node):
        if isinstance(inner, ScalarNode) and inner.span.line == inner.span.end_line:
            written = lines[inner.span.line - 1][inner.span.column - 1 : inner.span.end_column - 1]
            assert tomllib.loads(f"x = {written}")["x"] == inner.value
        if isinstance(inner, MappingNode):
            for key, span in inner.keys.items():
                written = lines[span.line - 1][span.column - 1 : span.end_column - 1]
                assert next(iter(tomllib.loads(f"{written} = 0"))) == key


@pytest.mark.parametrize(("text", "code", "message", "help", "place"), [
    ("a = 1\na = 2\n", Code.DUPLICATE_KEY, "duplicate key `a`", "remove or rename one of the two keys", (2, 1, 2, 2)),
    ("[a]\nb = 1\n[a]\nc = 2\n", Code.DUPLICATE_KEY, "duplicate key `a`", "remove or rename one of the two keys",
     (3, 2, 3, 3)),
    ("x = {a = 1, a = 2}\n", Code.DUPLICATE_KEY, "duplicate key `a`", "remove or rename one of the two keys", (1, 13, 1, 14)),
    ("a.b = 1\na.b = 2\n", Code.DUPLICATE_KEY, "duplicate key `b`", "remove or rename one of the two keys", (2, 3, 2, 4)),
    ("a = 1\n[a.b]\n", Code.DUPLICATE_KEY, "duplicate key `a`", "remove or rename one of the two keys", (2, 2, 2, 3)),
    ("d = 2026-11-20\n", Code.DATE, "expected a string or a number, found the date or time `2026-11-20`",
     'put the value in quotes: `"2026-11-20"`', (1, 5, 1, 15)),
    ("d = 12:30:00\n", Code.DATE, "expected a string or a number, found the date or time `12:30:00`",
     'put the value in quotes: `"12:30:00"`', (1, 5, 1, 13)),
    ("d = inf\n", Code.NOT_FINITE, "expected a finite number, found `inf`", None, (1, 5, 1, 8)),
    ("d = [1, nan]\n", Code.NOT_FINITE, "expected a finite number, found `nan`", None, (1, 9, 1, 12)),
    ("d = 1e999\n", Code.NOT_FINITE, "expected a finite number, found `1e999`", None, (1, 5, 1, 10)),
    ("length = 120 mm\n", Code.SYNTAX, "`120 mm` is not a TOML value", 'put strings and quantities in quotes: `length = "120 mm"`',
     (1, 10, 1, 16)),
    ("a = {b = -90 deg, c = 1}\n", Code.SYNTAX, "`-90 deg` is not a TOML value", 'put strings and quantities in quotes: `b = "-90 deg"`',
     (1, 10, 1, 17)),
    ("a = [0, 4 mm]\n", Code.SYNTAX, "`4 mm` is not a TOML value", 'put strings and quantities in quotes: `"4 mm"`', (1, 9, 1, 13)),
    ("[a\n", Code.SYNTAX, "the `[` of a table is not closed", "add `]`", (1, 3, 1, 3)),
    ("part = arm:Plate # x\n", Code.SYNTAX, "`arm:Plate` is not a TOML value",
     'put strings and quantities in quotes: `part = "arm:Plate"`', (1, 8, 1, 17)),
    ("name: arm\n", Code.SYNTAX, "expected `=` after the key", "write `key = value`", (1, 5, 1, 6)),
    ("a = \n", Code.SYNTAX, "expected a value", "put strings and quantities in quotes", (1, 5, 1, 5)),
    ("a = \"x\nb = 1\n", Code.SYNTAX, "the string is not closed", 'add the closing `"`', (1, 7, 1, 7)),
    ("a = [1, 2\nb = 1\n", Code.SYNTAX, "a list is not closed", "add `]`, or `,` between the items", (2, 1, 2, 2)),
    ("a = {b = 1\nc = 2}\n", Code.SYNTAX, "an inline table is not closed",
     "add `}` on the same line, or `,` between the entries", (1, 11, 1, 11)),
    ("a = 1 b = 2\n", Code.SYNTAX, "expected the end of the line", "write one `key = value` per line", (1, 7, 1, 8)),
])
def test_toml_errors_are_reported(text: str, code: Code, message: str, help: str | None, place: tuple[int, int, int, int]) -> None:
    _, report = read(text)
    assert len(report.diagnostics) == 1, [d.message for d in report.diagnostics]
    found = report.diagnostics[0]
    assert found.span is not None
    where = (found.span.line, found.span.column, found.span.end_line, found.span.end_column)
    assert (found.code, found.message, found.help, where) == (code, message, help, place)


def test_nesting_depth_is_limited() -> None:
    for text in ("a = " + "[" * 101 + "]" * 101, "a = " + "[" * 100_000, ".".join(["a"] * 120) + " = 1", "a = " + "{a=" * 5000):
        node, report = read(text + "\n")
        assert node is None
        assert [d.code for d in report.diagnostics] == [Code.TOO_LARGE]
    node, report = read("a = " + "[" * 98 + "]" * 98 + "\n")
    assert node is not None
    assert not report.diagnostics
    assert isinstance(node.entries["a"], SequenceNode)


def test_number_of_errors_is_limited() -> None:
    _, report = read("".join(f"a{n} = 2026-11-20\n" for n in range(500)))
    assert [d.code for d in report.diagnostics] == [Code.DATE] * 200
    _, report = read("a = 1\n" * 500)
    assert [d.code for d in report.diagnostics] == [Code.DUPLICATE_KEY] * 200


@given(st.text(max_size=60))
def test_any_text_gives_a_tree_or_an_error(text: str) -> None:
    _same_verdict(text)


@settings(max_examples=38)
@given(st.integers(0, len(ARM) - 1), st.integers(0, 6), st.text(max_size=4))
def test_any_mutation_gives_a_tree_or_an_error(at: int, cut: int, put: str) -> None:
    _same_verdict(ARM[:at] + put + ARM[at + cut :])


def _same_verdict(text: str) -> None:
    report = Report()
    source = decode("/x.toml", text.encode("utf-8", "surrogatepass"), report)
    if source is None:
        assert report.failed
        return
    node = read_toml(source, report)
    try:
        value = tomllib.loads(source.text)
    except ValueError:
        assert node is None
        assert report.failed
        return
    assert node is not None, [d.message for d in report.diagnostics]
    if not report.diagnostics:
        assert node.plain() == value
        assert all(not isinstance(n, ScalarNode) or not isinstance(n.value, float) or math.isfinite(n.value) for _,
            n in walk(node))
