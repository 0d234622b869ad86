"""`thingc fmt` on random documents: a second YAML reader reads the same content, comments stay at their keys, and formatting is
idempotent."""

from __future__ import annotations

import re
from collections import Counter
from typing import Any

import pytest
from hypothesis import HealthCheck, assume, given, settings
from ruamel.yaml import YAML

from layout.written import documents
from thingc.base.diagnostic_output import as_text
from thingc.base.diagnostics import Report
from thingc.documents.format.formatting import format_document

pytestmark = pytest.mark.slow

COMMENT = re.compile(r"# ?c\d+\.")


def formatted(data: bytes) -> bytes | None:
    """Return the canonical bytes, or None if the document is malformed. A layout that changes the meaning fails the test."""
    report = Report()
    found = format_document("/robot.yaml", data, report)
    assert all(d.code.code != "TC899" for d in report.diagnostics), as_text(report.diagnostics)
    return found


def read(data: bytes) -> Any:
    """Return the content that ruamel.yaml reads, without spaces between numbers and units."""
    def plain(value: Any) -> Any:
        if isinstance(value, dict):
            return {str(key): plain(item) for key, item in value.items()}
        if isinstance(value, list):
            return [plain(item) for item in value]
        return re.sub(r"(?<=\d) ?(?=(mm|deg)$)", "", value) if isinstance(value, str) else value

    return plain(YAML(typ="safe", pure=True).load(data.decode("utf-8-sig")))


def first_word(line: str) -> str:
    return re.sub(r"[-\s]", "", line).partition(":")[0].partition(",")[0]


def owners(data: bytes) -> dict[str, str]:
    """Return the key (or start of the line) of each comment that follows a value, or that is directly above a key in its column."""
    lines = data.decode("utf-8-sig").replace("\r", "").split("\n")
    found = {}
    for at, line in enumerate(lines):
        comment = COMMENT.search(line)
        if comment is None:
            continue
        if line[: comment.start()].strip():
            if line.count("{") == line.count("}") and not line.startswith(" " * 12):
                found[comment.group()] = first_word(line[: comment.start()])
            continue
        column = len(line) - len(line.lstrip())
        below = next((other for other in lines[at + 1 :] if other.strip() and not other.lstrip().startswith("#")), "")
        between = lines[at + 1 : lines.index(below, at + 1)] if below else [" "]
        adjacent = below and all(len(other) - len(other.lstrip()) == column and other.strip() for other in between)
        if adjacent and len(below) - len(below.lstrip()) == column and "{" not in below and column != 12:
            found[comment.group()] = first_word(below)
    return found


@settings(max_examples=20, suppress_health_check=list(HealthCheck))
@given(documents())
def test_formatting_keeps_content_and_comments_and_makes_whitespace_canonical(text: str) -> None:
    data = text.encode()
    once = formatted(data)
    assume(once is not None)
    assert once is not None
    assert formatted(once) == once
    assert read(once) == read(data)
    assert Counter(COMMENT.findall(once.decode())) == Counter(COMMENT.findall(text))
    before, after = owners(data), owners(once)
    moved = {comment: (key, after[comment]) for comment, key in before.items() if comment in after and after[comment] != key}
    assert not moved, once.decode()
    if b"|" in once or b">" in once:
        return
    lines = once.decode().replace("\r\n", "\n").split("\n")
    assert lines[-1] == "" and lines[-2:-1] != [""]
    assert not any(line != line.rstrip() for line in lines)
    assert not any(one == other == "" for one, other in zip(lines, lines[1:], strict=False) if "over" not in text)
