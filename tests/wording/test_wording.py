"""Docs, messages and docstrings are plain English: no more phrases that the rules of `wording.py` object to than `allowed.toml` has."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from wording.wording import Text, findings, texts

ALLOWED = Path(__file__).with_name("allowed.toml")


def test_phrases_that_the_rules_object_to_become_fewer() -> None:
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
def test_the_rules(words: str, number: int) -> None:
    found = list(findings(Text("model docstrings", "x.py:1", words)))
    assert len(found) == number, found


def test_a_long_sentence_is_found_in_docs_alone() -> None:
    words = "word " * 31 + "end."
    assert [one.rule for one in findings(Text("docs/x.md", "docs/x.md:1", words))] == ["a sentence of more than 30 words"]
    assert not list(findings(Text("model messages", "x.py:1", words)))
