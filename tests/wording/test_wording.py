"""Docs, messages and docstrings are in plain English: the number of phrases found by the rules of `wording.py` is at most that in
`allowed.toml`."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from wording.wording import Text, findings, texts

ALLOWED = Path(__file__).with_name("allowed.toml")


def test_number_of_findings_does_not_grow() -> None:
    found: dict[str, list[str]] = {}
    for text in texts():
        for one in findings(text):
            found.setdefault(one.area, []).append(f"{one.place}: {one.words!r}: {one.rule}")
    allowed = tomllib.loads(ALLOWED.read_text())
    more = {area: lines for area, lines in found.items() if len(lines) > allowed.get(area, 0)}
    assert not more, "rewrite what you added:\n" + "\n".join(line for lines in more.values() for line in lines)
    fewer = {area: number for area, number in allowed.items() if len(found.get(area, ())) < number}
    assert not fewer, {area: f"lower the number in allowed.toml to {len(found.get(area, ()))}" for area in fewer}


@pytest.mark.parametrize(("words", "number"), [
    ("The lock is no file of yours. Of a part it is told what nobody knows.", 4),
    ("The name, None where there is none; it stands in the file, and the file says so.", 3),
    ("A torque of 3 N*m. There is no such joint, and the part is no longer used.", 0),
    ("Return the record, or None if the store does not contain it.", 0),
])
def test_rules(words: str, number: int) -> None:
    found = list(findings(Text("model docstrings", "x.py:1", words)))
    assert len(found) == number, found


def test_long_sentences_are_found_only_in_docs() -> None:
    words = "word " * 31 + "end."
    assert [one.rule for one in findings(Text("docs/x.md", "docs/x.md:1", words))] == ["a sentence of more than 30 words"]
    assert not list(findings(Text("model messages", "x.py:1", words)))
