"""Untrusted text is escaped in every output format."""

from __future__ import annotations

import json
import re
import sys
import unicodedata
from collections import defaultdict
from pathlib import Path
from xml.etree import ElementTree

import pytest
from hypothesis import given, strategies as st

from reporting.reports import repository, span
from reporting.test_github import parsed
from reporting.test_sarif import checked
from thingc.base.diagnostic_output import as_json, as_text
from thingc.base.diagnostics import Code, Diagnostic, Note, Severity
from thingc.base.safe_text import LONGEST, LONGEST_QUOTE, abbreviate, escape_control, json_text
from thingc.tools.reporting.ci_formats import as_github, as_junit, as_sarif

NEVER = {
    "a byte of a file name": "\udce9", "an escape sequence": "\x1b[31m", "NUL": "\0", "bell": "\a", "DEL": "\x7f",
    "CSI": "\x9b31m", "next line": "\x85", "backspace": "\b",
    "a line end": "\n", "a carriage return": "\r", "a line separator": "\u2028", "a paragraph separator": "\u2029",
    "an override": "\u202e", "an isolate": "\u2067", "a mark of direction": "\u200f", "an Arabic mark": "\u061c",
    "a space of no width": "\u200b", "a joiner": "\u200d", "a byte order mark": "\ufeff", "half a character": "\ud800",
    "a tag": "\U000e0041", "a filler": "\u3164", "a selector": "\ufe0f",
}
"""Characters that terminals interpret or that are invisible."""


@pytest.mark.parametrize("text", NEVER.values(), ids=NEVER)
def test_control_and_invisible_characters_are_escaped(text: str) -> None:
    """They are escaped as in a Python literal, so that they can be distinguished and searched for."""
    assert escape_control(f"q{text}:X") == f"q{text.encode('unicode_escape').decode()}:X"


def test_escaping_follows_the_unicode_category() -> None:
    """Control, format, surrogate, separator and unassigned characters are always escaped."""
    by_category = defaultdict(list)
    for character in map(chr, range(sys.maxunicode + 1)):
        by_category[unicodedata.category(character)].append(character)
    for category in ("Cc", "Cf", "Cs", "Zl", "Zp", "Cn"):
        text = "".join(by_category.pop(category))
        for start in range(0, len(text), 1000):
            group = text[start : start + 1000]
            shown = escape_control(group, limit=1000)
            escaped = re.findall(r"\\[a-zA-Z0-9]+", shown)
            assert len(escaped) == len(group) and "".join(escaped) == shown, hex(ord(group[0]))
    for category, characters in by_category.items():
        text = " あ漢אב" if category == "Lo" else "".join(characters)
        if category[0] in "LNPS":
            assert escape_control(text, limit=len(text)) == text


@given(st.text(alphabet=st.one_of(st.characters(), st.characters(categories=["Cs"]), st.sampled_from("".join(NEVER.values())))))
def test_escaped_text_is_one_printable_line(text: str) -> None:
    assert escape_control(text).isprintable()
    assert escape_control(escape_control(text)) == escape_control(text)


@given(st.text(alphabet=st.one_of(st.characters(exclude_categories=["Cs"]), st.sampled_from("\x1b\u202e\x7f\u2028\ufeff"))))
def test_json_preserves_every_character(text: str) -> None:
    written = json_text(json.dumps({"a": [text, {text: 1}]}, indent=2, ensure_ascii=False))
    assert json.loads(written) == {"a": [text, {text: 1}]}
    assert all(line.isprintable() for line in written.split("\n"))


def test_lone_surrogate_is_preserved_in_json() -> None:
    assert json_text(json.dumps("\ud800x", ensure_ascii=False)) == '"\\ud800x"'


@pytest.mark.parametrize("name", ["x" * 10**6, "`" * 10**6, "\u202e" * 10**6])
def test_very_long_names_are_shortened(name: str) -> None:
    message = abbreviate(f"unknown key `{name}` in `components`")
    assert len(message) < LONGEST + 100 and message.startswith("unknown key `" + name[:50]) and message.endswith("in `components`")
    assert re.search(r"\(10000\d\d characters\)", message)
    assert len(Diagnostic(code=Code.SYNTAX, severity=Severity.ERROR, message=f"`{name}`", help=f"`{name}`").message) < LONGEST + 100


def test_short_messages_are_not_shortened() -> None:
    message = f"`{'x' * LONGEST_QUOTE}` and `{'y' * LONGEST_QUOTE}`"
    assert abbreviate(message) == message
    assert "xx... (161 characters) ...xx" in abbreviate(f"found `{'x' * (LONGEST_QUOTE + 1)}`")


HOSTILE = "q" + "".join(NEVER.values()) + "X"


def hostile(folder: Path) -> Diagnostic:
    """Return a diagnostic in which every text is hostile, at a location in a file with a hostile name."""
    document = repository(folder) / "work" / "\x1b[31m\u202e.yaml"
    document.write_text(f"name: a\n  \u202e\x1bpart: {'x'}\u200b # {'y'}\n")
    return Diagnostic(
        code=Code.PART_INVALID, severity=Severity.ERROR, message=f"`{HOSTILE}` is nothing", span=span(document, 2, 5, 9), path=HOSTILE,
        help=f"write `{HOSTILE}`", notes=(Note(message=f"`{HOSTILE}`", span=span(document, 1, 1, 2)), Note(message=HOSTILE)),
        detail=HOSTILE,
    )


def test_caret_column_accounts_for_escapes(tmp_path: Path) -> None:
    lines = as_text([hostile(tmp_path)]).split("\n")
    frame = next(k for k, line in enumerate(lines) if line.startswith("  2 | "))
    assert lines[frame] == "  2 |   \\u202e\\x1bpart: x\\u200b # y"
    begin, end = lines[frame + 1].index("^"), lines[frame + 1].rindex("^") + 1
    assert lines[frame][begin:end] == "part"


def test_caret_is_as_wide_as_the_escaped_text(tmp_path: Path) -> None:
    document = repository(tmp_path) / "work" / "wide.yaml"
    document.write_text("a: \u202e\x1b[31m b\n")
    said = as_text([Diagnostic(code=Code.SYNTAX, severity=Severity.ERROR, message="x", span=span(document, 1, 4, 6))])
    assert "\n  1 | a: \\u202e\\x1b[31m b\n    |    ^^^^^^^^^^\n" in said


@pytest.mark.parametrize("debug", [False, True])
def test_all_formats_escape_hidden_characters(tmp_path: Path, debug: bool) -> None:
    found = [hostile(tmp_path)]
    forms = {
        "text": as_text(found, debug=debug), "github": as_github(found, base=str(tmp_path)),
        "sarif": as_sarif(found, base=str(tmp_path), version="1"), "junit": as_junit("robot", [], found),
    }
    for form, text in forms.items():
        assert all(line.isprintable() for line in text.split("\n")), form
        assert "\u200b" not in text and "\\u200b" in text, form
    assert "\\x1b[31m" in parsed(forms["github"].rstrip("\n"))[2] and forms["github"].count("\n") == 1
    assert "\\x1b[31m" in checked(forms["sarif"])["results"][0]["message"]["text"]
    assert ElementTree.fromstring(forms["junit"]).find(".//error") is not None


def test_json_contains_the_exact_text(tmp_path: Path) -> None:
    found = hostile(tmp_path)
    (entry,) = json.loads(json_text(json.dumps(as_json([found]), ensure_ascii=False)))
    assert (entry["message"], entry["path"], entry["help"]) == (found.message, found.path, found.help)
    assert entry["file"].endswith("\x1b[31m\u202e.yaml")


def test_tab_is_preserved_in_a_code_frame(tmp_path: Path) -> None:
    document = repository(tmp_path) / "work" / "tab.toml"
    document.write_text("\t\u202ea = 1\n")
    said = as_text([Diagnostic(code=Code.SYNTAX, severity=Severity.ERROR, message="a\tb", span=span(document, 1, 3, 4))])
    assert said.startswith("error[TC103]: a\\tb\n") and "\n  1 | \t\\u202ea = 1\n    | \t      ^\n" in said
