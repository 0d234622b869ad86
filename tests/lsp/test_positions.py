"""Conversion between positions of thingc and of the protocol, and edits that turn one text into another."""

from __future__ import annotations

from pathlib import Path

from hypothesis import given, settings, strategies as st

from thingc.documents.load.text import Source
from thingc.tools.lsp.code_actions import edits
from thingc.tools.lsp.positions import TextLines, path_of

TEXTS = st.text(st.sampled_from("ab\n\r\t \u00e9\u2028\U0001f916\U0001d11e"), max_size=40)


@given(TEXTS, st.data())
def test_positions_use_utf_16(text: str, data: st.DataObject) -> None:
    """Characters of the protocol are UTF-16 code units. The conversion round-trips."""
    start = data.draw(st.integers(0, len(text)))
    end = data.draw(st.integers(start, len(text)))
    span = Source("x", text).span(start, end)
    lines = TextLines(text)
    found = lines.range(span)
    begin = text[: start - (span.column - 1)]
    within = text[len(begin):start]
    if text[max(0, start - 1):start + 1] != "\r\n":  # nobody stands between them
        assert found["start"] == {"line": span.line - 1, "character": len(within.encode("utf-16-le")) // 2}
        place = lines.place(found["start"])
        assert (place.line, place.column) == (span.line, span.column) and lines.index(place) == start


@given(TEXTS, st.integers(-3, 60), st.integers(-3, 2**31))
def test_out_of_range_positions_are_clamped(text: str, line: int, character: int) -> None:
    lines = TextLines(text)
    assert 0 <= lines.index(lines.place({"line": line, "character": character})) <= len(text)


@settings(max_examples=30)
@given(TEXTS, TEXTS)
def test_edits_transform_one_text_into_another(before: str, after: str) -> None:
    lines = TextLines(before)
    made = before
    for edit in reversed(edits(lines, after)):
        start, end = (lines.index(lines.place(edit["range"][side])) for side in ("start", "end"))
        made = made[:start] + edit["newText"] + made[end:]
    assert made == after


def test_uris_are_converted_to_paths() -> None:
    for path in ("/a/b c.yaml", "/\u00e9/\U0001f916#?%.yaml"):
        assert path_of(Path(path).as_uri()) == path
    assert path_of("file:///a/%62.yaml") == "/a/b.yaml"
    assert [path_of(one) for one in ("untitled:x", "file://host/x", "http://x/y", "file:///a%00", "file://[x", "")] == [None] * 6
