"""YAML trees: the oracle for values and positions is ruamel.yaml (YAML 1.2)."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings, strategies as st
from ruamel.yaml import YAML
from ruamel.yaml.scalarbool import ScalarBoolean
from ruamel.yaml.scalarfloat import ScalarFloat
from ruamel.yaml.scalarint import ScalarInt

from thingc.base.diagnostics import Code, Report
from thingc.base.source import MappingNode, Node, ScalarNode, SequenceNode, walk
from thingc.documents.load.text import Source, decode
from thingc.documents.load.yaml_tree import read_yaml

ROOT = Path(__file__).resolve().parents[2]

CORPUS = {
    "scalars": """
        bools: [true, True, TRUE, false, False, FALSE]
        words: [yes, no, on, off, y, n, Yes, NO, nul, tRue]
        ints: [0, 7, -12, +3, 0o17, 0xFF, 007]
        floats: [1.5, -0.25, 1e-3, 1E3, 2.e2, .5, -.5e+1, 1e5]
        nulls: [null, Null, NULL, ~, ]
        texts: [1.2.3, 1-2, 12 mm, -x, +, 0o8, 0xG, 1e, e3, "1", 'true', "null", ".", 2026-11-20, 12:30:45, =reach / 2]
    """,
    "styles": """
        plain: some words here
        single: 'it''s quoted: yes'
        double: "tab\\t newline\\n unicode \\u00e9 \\"q\\""
        literal: |
          line one
            line two

          line four
        folded: >-
          folded text
          of two lines
        kept: |+
          kept

        multi
          line: 1
    """.replace("        multi\n          line: 1\n", ""),
    "nesting": """
        a:
          b:
            c: {d: [1, {e: 2}, [3, [4]]], f: g}
          list:
          - one
          - two: 2
            three: 3
          - - nested
            - list
        empty_map: {}
        empty_list: []
    """,
    "comments": """
        # head
        a: 1   # one

        # between
        b:     # opens
          # inside
          c: 2
          # last inside
        # outside
        d: 3
        # tail
    """,
    "references": """
        part: arm:BasePlate
        parts: {part: arm:BasePlate, other: "bd:steel", url: http://example.org/a}
        attach: {back: plate.servo_seat, hip: body.hip_$i}
        poses: {leg_*.knee: -90 deg, a/b: c}
        quantities: {a: 4.1 N*m, b: 15 %, c: 1270 kg/m^3, d: -150 deg, e: 0 0 4 mm}
    """,
    "question mark": "{url: http://example.org/a?b=c, wild: leg_?}\n",
    "anchors": """
        base: &base {x: 1, y: [2, 3]}
        same: *base
        list: [*base, &word text, *word]
        block: &block
          k: v
        again: *block
    """,
    "keys": """
        "quoted key": 1
        'single': 2
        with space: 3
        on: 4
        yes: 5
        é: 6
        a.b.c: 7
        ? explicit
        : 8
    """,
    "multiline": """
        text: words that go
          on in the next line
        "double": "words that
          go on"
        flow: {a: 1,
          b: [2,
              3],
        }
    """,
    "unicode": """
        name: "Ünïcødé 機械"
        日本: 値  # kommentär
        emoji: [🤖, a]
        after: 1
    """,
    "document markers": "---\na: 1\nb: [1, 2]\n...\n",
    "directive": "%YAML 1.2\n---\na: 1\n",
    "list": "- 1\n- a: 2\n- [3]\n",
    "scalar": "just text\n",
    "flow": "{a: 1, 'b': [x, y], c: {d: e}}\n",
}


def dedent(text: str) -> str:
    import textwrap

    return textwrap.dedent(text).lstrip("\n")


def texts() -> dict[str, str]:
    found = {name: dedent(text) for name, text in CORPUS.items()}
    for path in sorted((ROOT / "assemblies").rglob("*.yaml")):
        found[path.relative_to(ROOT).as_posix()] = path.read_text(encoding="utf-8")
    return found


def read(text: str) -> tuple[Node | None, Report]:
    report = Report()
    return read_yaml(Source("/x.yaml", text), report), report


def plain(value: Any) -> Any:
    """Return ruamel's values as plain Python objects."""
    if isinstance(value, dict):
        return {plain(key): plain(item) for key, item in value.items()}
    if isinstance(value, list):
        return [plain(item) for item in value]
    if isinstance(value, ScalarBoolean):
        return bool(value)
    if isinstance(value, ScalarInt):
        return int(value)
    if isinstance(value, ScalarFloat):
        return float(value)
    if isinstance(value, str):
        return str(value)
    if value is not None and not isinstance(value, (bool, int, float)):
        return str(value.isoformat()) if hasattr(value, "isoformat") else str(value)
    return value


def by_ruamel(text: str) -> Any:
    yaml = YAML(typ="rt")
    yaml.version = (1, 2)
    yaml.preserve_quotes = True
    return yaml.load(io.StringIO(text))


@pytest.mark.parametrize("name", texts())
def test_values_match_ruamel(name: str) -> None:
    text = texts()[name]
    node, report = read(text)
    assert not report.diagnostics
    assert node is not None
    theirs = plain(by_ruamel(text))
    if name == "scalars":  # the core schema has no dates; ruamel adds them
        theirs["texts"] = ["2026-11-20" if text == "2026-11-20" else text for text in theirs["texts"]]
    ours = node.plain()
    assert ours == theirs
    assert repr(ours) == repr(theirs)  # 1 is not 1.0 and not True


def places(value: Any, node: Node, path: str = "") -> list[tuple[str, tuple[int, int], tuple[int, int]]]:
    """Return (path, ruamel's position, our position) of every key and every value."""
    found = []
    if isinstance(value, dict) and isinstance(node, MappingNode):
        for key, item in value.items():
            line, column = value.lc.key(key)
            span = node.keys[key]
            found.append((f"{path}/{key} key", (line + 1, column + 1), (span.line, span.column)))
            inner = node.entries[key]
            if not (isinstance(inner, ScalarNode) and inner.value is None):
                line, column = value.lc.value(key)
                found.append((f"{path}/{key}", (line + 1, column + 1), (inner.span.line, inner.span.column)))
            found += places(item, inner, f"{path}/{key}")
    elif isinstance(value, list) and isinstance(node, SequenceNode):
        for index, item in enumerate(value):
            line, column = value.lc.item(index)
            inner = node.items[index]
            if not (isinstance(inner, ScalarNode) and inner.value is None):
                found.append((f"{path}/{index}", (line + 1, column + 1), (inner.span.line, inner.span.column)))
            found += places(item, inner, f"{path}/{index}")
    return found


@pytest.mark.parametrize("name", [name for name in texts() if name not in ("anchors", "scalar")])
def test_positions_match_ruamel(name: str) -> None:
    text = texts()[name]
    node, _ = read(text)
    assert node is not None
    found = places(by_ruamel(text), node)
    assert found
    assert [(path, theirs) for path, theirs, _ in found] == [(path, ours) for path, _, ours in found]


@pytest.mark.parametrize("name", texts())
def test_scalar_span_covers_its_text(name: str) -> None:
    text = texts()[name]
    lines = text.split("\n")
    node, _ = read(text)
    assert node is not None
    checked = 0
    for _, inner in walk(node):
        if isinstance(inner, ScalarNode) and inner.span.line == inner.span.end_line and inner.text:
            written = lines[inner.span.line - 1][inner.span.column - 1 : inner.span.end_column - 1]
            assert written == inner.text or written[0] in "'\"|>"
            checked += written == inner.text
        if isinstance(inner, MappingNode):
            for key, span in inner.keys.items():
                assert lines[span.line - 1][span.column - 1 : span.end_column - 1].strip("'\"") == key
    assert checked or name in ("scalar", "flow")


def test_block_collection_ends_at_its_last_value() -> None:
    node, _ = read("a:\n  b: 1\n  c:\n  - x\n  - y   # words\n\n# more\nd: 2\n")
    assert isinstance(node, MappingNode)
    outer = node.entries["a"].span
    assert (outer.line, outer.column, outer.end_line) == (2, 3, 5)
    inner = node.entries["a"].entries["c"].span  # type: ignore[union-attr]
    assert (inner.line, inner.column, inner.end_line) == (4, 3, 5)


def test_line_endings_and_bom_do_not_change_positions() -> None:
    text = texts()["nesting"]
    unix, _ = read(text)
    report = Report()
    source = decode("/x.yaml", b"\xef\xbb\xbf" + text.replace("\n", "\r\n").encode(), report)
    assert source is not None
    windows = read_yaml(source, report)
    assert not report.diagnostics
    assert windows == unix
    report = Report()
    old = decode("/x.yaml", text.replace("\n", "\r").encode(), report)
    assert old is not None
    assert read_yaml(old, report) == unix


def test_pure_python_parser_gives_the_same_trees(monkeypatch: pytest.MonkeyPatch) -> None:
    import yaml

    if not yaml.__with_libyaml__:
        pytest.skip("no libyaml here: the pure parser is what all other tests ran with")
    with_c = {name: read(text)[0] for name, text in texts().items()}
    monkeypatch.delattr(yaml, "CLoader")
    for name, text in texts().items():
        if name != "question mark":  # the pure parser takes no `?` in a flow mapping
            ours, other = read(text)[0], with_c[name]
            assert ours is not None
            assert other is not None
            assert ours.plain() == other.plain(), name
            assert [(path, n.span) for path, n in walk(ours)] == [(path, n.span) for path, n in walk(other)], name


_keys = st.from_regex(r"[A-Za-z][A-Za-z0-9_]{0,6}",
    fullmatch=True).filter(lambda key: key.lower() not in ("null", "true", "false"))
_leaves = st.one_of(
    st.booleans(), st.integers(-10**6, 10**6), st.floats(-1e6, 1e6).map(lambda x: round(x, 3)),
    st.text(st.characters(min_codepoint=32, max_codepoint=0x17F, exclude_characters="\x7f\x85\xa0\xad",
        exclude_categories=["Cc", "Cs"]), max_size=12),
    st.sampled_from(["=reach / 2", "120 mm", "yes", "on", "1e-3", "0o17", "", "~", "a: b", "# x", "- x", "*x", "arm:Plate"]),
)
# YAML 1.2 lets plain text in `{}` and `[]` begin with `:` or `?`; libyaml does not, and there it is a syntax error.
_leaves = _leaves.filter(lambda leaf: not (isinstance(leaf, str) and leaf[:1] in (":", "?")))
_values = st.recursive(
    _leaves, lambda inner: st.one_of(st.lists(inner, max_size=4), st.dictionaries(_keys, inner, max_size=4)), max_leaves=15,
)


@settings(max_examples=38)
@given(st.dictionaries(_keys, _values, min_size=1, max_size=4), st.booleans())
def test_ruamel_output_is_read_back(value: dict[str, Any], flow: bool) -> None:
    yaml = YAML(typ="safe", pure=True)
    yaml.default_flow_style = flow
    stream = io.StringIO()
    yaml.dump(value, stream)
    node, report = read(stream.getvalue())
    assert not report.diagnostics, stream.getvalue()
    assert node is not None
    assert node.plain() == value


def only(report: Report) -> tuple[Code, str, str | None, tuple[int, int, int, int] | None]:
    assert len(report.diagnostics) == 1, [(d.code, d.message) for d in report.diagnostics]
    d = report.diagnostics[0]
    place = None if d.span is None else (d.span.line, d.span.column, d.span.end_line, d.span.end_column)
    return d.code, d.message, d.help, place


@pytest.mark.parametrize(("text", "code", "message", "help", "place"), [
    ("a: 1\nb: 2\na: 3\n", Code.DUPLICATE_KEY, "duplicate key `a`", "remove or rename one of the two keys", (3, 1, 3, 2)),
    ("a: {x: 1, x: 2}\n", Code.DUPLICATE_KEY, "duplicate key `x`", "remove or rename one of the two keys", (1, 11, 1, 12)),
    ("1.5: x\n", Code.KEY_NOT_TEXT, "a key must be a string, found the number `1.5`", 'write `"1.5"`', (1, 1, 1, 4)),
    ("true: x\n", Code.KEY_NOT_TEXT, "a key must be a string, found the word `true`", 'write `"true"`', (1, 1, 1, 5)),
    ("a: {: x}\n", Code.SYNTAX, "a key is missing before the `:`", None, (1, 5, 1, 6)),
    ("a:\n  : x\n", Code.SYNTAX, "a key is missing before the `:`", None, (2, 3, 2, 4)),
    ("?\n: x\n", Code.KEY_NOT_TEXT, "a key is missing before the `:`", None, (1, 2, 1, 2)),
    ("? [a, b]\n: c\n", Code.KEY_NOT_TEXT, "a key must be a string, found a list", "put a string that starts with `{` or `[` in quotes",
     (1, 3, 1, 9)),
    ("a: !!int 3\n", Code.TAG, "tags such as `!!int` are not supported", "remove the tag", (1, 4, 1, 9)),
    ("a: !foo {b: c}\n", Code.TAG, "tags such as `!foo` are not supported", "remove the tag", (1, 4, 1, 8)),
    ("a: &x {b: 1}\nc:\n  <<: *x\n", Code.ALIAS, "the merge key `<<` is not supported",
     "copy the keys into this mapping, or use `defaults:`", (3, 3, 3, 5)),
    ("a: *b\n", Code.ALIAS, "the alias `*b` has no anchor", 'put a value that starts with `*` in quotes: `"*b..."`',
     (1, 4, 1, 6)),
    ("a: &bed 1\nc: *bad\n", Code.ALIAS, "the alias `*bad` has no anchor", "did you mean `bed`?", (2, 4, 2, 8)),
    ("a: &x [1, *x]\n", Code.ALIAS, "the alias `*x` is inside its own anchor", None, (1, 11, 1, 13)),
    ("poses:\n  *_knee : 3 deg\n", Code.ALIAS, "the alias `*_knee` has no anchor",
     'put a key that starts with `*` in quotes: `"*_knee"`', (2, 3, 2, 9)),
    ("a: .inf\n", Code.NOT_FINITE, "expected a finite number, found `.inf`", None, (1, 4, 1, 8)),
    ("a: -.INF\n", Code.NOT_FINITE, "expected a finite number, found `-.INF`", None, (1, 4, 1, 9)),
    ("a: .nan\n", Code.NOT_FINITE, "expected a finite number, found `.nan`", None, (1, 4, 1, 8)),
    ("a: 1e999\n", Code.NOT_FINITE, "expected a finite number, found `1e999`", None, (1, 4, 1, 9)),
    ("a: " + "9" * 5000 + "\n", Code.NOT_FINITE, "expected a finite number, found `" + "9" * 57 + "...`", None, (1, 4, 1, 5004)),
    ("a: 1\n---\nb: 2\n", Code.SEVERAL_DOCUMENTS, "expected one document per file, found a second document",
     "move the second document to a separate file", (2, 1, 2, 4)),
    ("%YAML 1.1\n---\na: 1\n", Code.SYNTAX, "expected YAML 1.2, found `%YAML 1.1`", "remove the `%YAML` line", (1, 1, 1, 6)),
    ("{length: =min(a, 80 mm)}\n", Code.EXPRESSION_COMMA,
     "unexpected comma in an expression without quotes", 'write `"=min(a, 80 mm)"`',
     (1, 10, 1, 24)),
    ("xyz: [0, =max(a, min(b, c), 1), 3 mm]\n", Code.EXPRESSION_COMMA,
     "unexpected comma in an expression without quotes",
     'write `"=max(a, min(b, c), 1)"`', (1, 10, 1, 31)),
])
def test_yaml_errors_are_reported(text: str, code: Code, message: str, help: str | None, place: tuple[int, int, int, int]) -> None:
    _, report = read(text)
    assert only(report) == (code, message, help, place)


def test_duplicate_key_shows_the_first_one() -> None:
    _, report = read("a: 1\nb: 2\na: 3\n")
    note = report.diagnostics[0].notes[0]
    assert note.message == "first defined here"
    assert note.span is not None
    assert (note.span.line, note.span.column) == (1, 1)


@pytest.mark.parametrize(("text", "value"), [
    ("a: 1\na: 2\nb: 3\n", {"a": 1, "b": 3}),
    ("a: !!str 3\n", {"a": 3}),
    ("1.5: x\nb: 2\n", {"b": 2}),
    ("{length: =min(a, 80 mm), depth: =max(a, 80 mm), b: 2}\n", {"length": "=min(a, 80 mm)", "depth": "=max(a, 80 mm)", "b": 2}),
    ("[0, =max(a, min(b, c), 1), 3 mm]\n", [0, "=max(a, min(b, c), 1)", "3 mm"]),
    ("{a: =min(b,\n  c)}\n", {"a": "=min(b, c)"}),
])
def test_recoverable_errors_keep_the_rest(text: str, value: Any) -> None:
    node, report = read(text)
    assert report.failed
    assert node is not None
    assert node.plain() == value


@pytest.mark.parametrize("text",
    ['{length: "=min(a, 80 mm)"}\n', "length: =min(a, 80 mm)\n", "{a: =(b), c: =min(d)}\n", "[=a, =b]\n"])
def test_valid_expressions_in_flow_collections(text: str) -> None:
    assert not read(text)[1].diagnostics


@pytest.mark.parametrize(("text", "message", "help", "place"), [
    ("a:\n\tb: 1\n", "expected spaces in the indentation, found a tab", "replace the tab with spaces", (2, 1, 2, 2)),
    ("a:\n  b: 1\n\tc: 2\n", "expected spaces in the indentation, found a tab", "replace the tab with spaces", (3, 1, 3, 2)),
    ("name:arm\nparts: x\n", "a space is missing after `name:`", "write `name: arm`", (1, 1, 1, 9)),
    ("limit:\n  lower:0\n  upper: 3\n", "a space is missing after `lower:`", "write `lower: 0`", (2, 3, 2, 10)),
    ("name: \"arm\nb: 2\n", "the quoted string is not closed", 'add `"` at the end of the string', (1, 7, 1, 8)),
    ("name: 'arm\nb: 2\n", "the quoted string is not closed", "add `'` at the end of the string", (1, 7, 1, 8)),
    ("a: {b: 1\nc: 2\n", "the `{` is not closed with `}`", "add `}`", (1, 4, 1, 5)),
    ("a: [1, 2\nc: 2\n", "the `[` is not closed with `]`", "add `]`", (1, 4, 1, 5)),
    ("a: [1, 2}\n", "the `[` is not closed with `]`", "add `]`", (1, 4, 1, 5)),
    ("a: {b: 1", "the `{` is not closed with `}`", "add `}`", (1, 4, 1, 5)),
    ("a: {b: \"x\" y}\n", "expected `,` or `}`, found `y`", "put a string that contains a comma, a colon or quotes in quotes",
     (1, 12, 1, 13)),
    ("a: {b {c: 1}}\n", "expected `,` or `}`, found `{`", "write a colon and a space after the key: `b: {`", (1, 7, 1, 8)),
    ("a: {b: 1, c [1]}\n", "expected `,` or `}`, found `[`", "write a colon and a space after the key: `c: [`", (1, 13, 1, 14)),
    ("a: {b: x {c: 1}}\n", "expected `,` or `}`, found `{`", "put a string that contains a comma, a colon or quotes in quotes",
     (1, 10, 1, 11)),
    (f"a: [{'x' * 300_000}, y z {{c: 1}}]\n", "expected `,` or `]`, found `{`",
     "put a string that contains a comma, a colon or quotes in quotes", (1, 300_011, 1, 300_012)),
    ("doc: axis: to axis\n", "the value contains a second `:`",
     "put the value in quotes, or start a nested mapping on a new line", (1, 10, 1, 11)),
    ("a: 1\nwords\nb: 2\n", "expected `key: value`, found `words`", "write a colon and a space after the key", (2, 1, 2, 6)),
    ("a: @x\n", "a value cannot start with `@`", "put the value in quotes", (1, 4, 1, 5)),
    ("a: `x`\n", "a value cannot start with ```", "put the value in quotes", (1, 4, 1, 5)),
    ("a: %x\n", "a value cannot start with `%`", "put the value in quotes", (1, 4, 1, 5)),
    ("poses: {?_knee: 3 deg}\n", "a name cannot start with `?`", "put the name in quotes", (1, 9, 1, 10)),
    ("poses: [?_knee]\n", "a name cannot start with `?`", "put the name in quotes", (1, 9, 1, 10)),
    ("poses: {*: 3 deg}\n", "a value cannot start with `*`", 'put a name that starts with `*` or `&` in quotes: `"*_knee"`',
     (1, 9, 1, 10)),
    ("a: 1\n  b: 2\n", "the value contains a second `:`",
     "put the value in quotes, or start a nested mapping on a new line", (2, 4, 2, 5)),
    ("a:\n    b: 1\n  c: 2\n", "the indentation does not match the mapping above",
     "start the line in column 5 or 1", (3, 3, 3, 4)),
    ("a:\n  b:\n      c: 1\n    d: 2\n", "the indentation does not match the mapping above",
     "start the line in column 7 or 3", (4, 5, 4, 6)),
    ("a: \"x\" y\n", "the indentation does not match the mapping above",
     "start all keys of a mapping in the same column, or put the whole string in quotes", (1, 8, 1, 9)),
    ("a: - 1\n", "a list item `-` is not allowed here", "start the list on the line after its key", (1, 4, 1, 5)),
    ("a:\n- 1\n  - 2\nb\n", None, None, None),
    ("a: \"\\q\"\n", "an unknown escape in double quotes", "write `\\\\` for a backslash, or use single quotes", (1, 5, 1, 6)),
    ("a: | text\n  b\n", "text after `|` or `>` must start on the next line", "write the text on the next line", (1, 6, 1, 10)),
])
def test_syntax_errors_have_helpful_messages(text: str, message: str | None, help: str | None, place: Any) -> None:
    node, report = read(text)
    assert node is None
    code, said, hint, where = only(report)
    assert code is Code.SYNTAX
    if message is not None:
        assert (said, hint, where) == (message, help, place)


def test_size_limits() -> None:
    _, report = read("a: " + "[" * 101 + "]" * 101 + "\n")
    assert only(report) == (Code.TOO_LARGE, "the document has more than 100 levels of nesting", None, (1, 103, 1, 104))
    node, report = read("[" * 100 + "]" * 100 + "\n")
    assert node is not None
    assert not report.diagnostics
    _, report = read("a: " + "[" * 200_000)
    assert only(report)[0] is Code.TOO_LARGE
    laughs = "a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n" + "".join(
        f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 10)}]\n" for n in range(1, 20)
    )
    node, report = read(laughs)
    assert node is None
    assert only(report)[:2] == (Code.TOO_LARGE, "aliases expand to more than 10000 values")
    many = "".join(f"a: {n}\n" for n in range(500))
    assert [d.code for d in read(many)[1].diagnostics] == [Code.DUPLICATE_KEY] * 201 + [Code.TOO_LARGE]
    deep = "a0: &a0 [x]\n" + "".join(f"a{n}: &a{n} [*a{n - 1}]\n" for n in range(1, 120))
    assert only(read(deep)[1])[:2] == (Code.TOO_LARGE, "the document has more than 100 levels of nesting")


@pytest.mark.parametrize(("data", "code", "message", "place"), [
    (b"a: \xff\n", Code.NOT_UTF8, "expected UTF-8, found the byte 0xff", (1, 4)),
    (b"a: 1\n\xc3\xa9: \xe9\n", Code.NOT_UTF8, "expected UTF-8, found the byte 0xe9", (2, 4)),
    ("a: 1".encode("utf-16"), Code.NOT_UTF8, "expected UTF-8, found UTF-16", (1, 1)),
    (b"a: 1\nb: \x07\n", Code.SYNTAX, "a control character (U+0007) is not allowed in a document", (2, 4)),
    ("a: x\u2028y\n".encode(), Code.SYNTAX, "a line separator (U+2028) is not allowed in a document", (1, 5)),
    ("a: \x85\n".encode(), Code.SYNTAX, "a next-line character (U+0085) is not allowed in a document", (1, 4)),
    (b"a: \x00\n", Code.SYNTAX, "a zero byte (U+0000) is not allowed in a document", (1, 4)),
    (b"#" * 10_000_001, Code.TOO_LARGE, "the file has more than 10000000 bytes", (1, 1)),
])
def test_invalid_bytes_are_reported(data: bytes, code: Code, message: str, place: tuple[int, int]) -> None:
    report = Report()
    assert decode("/x.yaml", data, report) is None
    found = only(report)
    assert found[:2] == (code, message)
    assert found[3] is not None
    assert found[3][:2] == place
