"""Measured numbers in the text of README and study pages match the output of a command.

A command writes its measurements into a block, or a whole page (`make walk`, `make bench-weld`, ...). A `Claim` finds the numbers of a
sentence and those that it quotes. Numbers that are not measured (chosen sizes, limits, part data) are listed with their source, so a new
number without a source is detected."""

from __future__ import annotations

import re
from dataclasses import dataclass

import pytest

from docs.pages import PAGES, ROOT, table, without_fences


@dataclass(frozen=True)
class Claim:
    """`prose` matches a sentence of a page, with the numbers as its groups; `source` matches the same numbers, in the same order, on the
    page `printed`, below its comment `<!-- block -->`, if any."""

    page: str
    prose: str
    printed: str
    source: str
    block: str = ""

    def __str__(self) -> str:
        return f"{self.page}: {self.prose[:40]}"


CLAIMS = (
    Claim(
        "docs/studies/walking.md", r"tilted by up to ([\d.]+) mrad", "docs/studies/walking.md",
        r"largest tilt of a landed sole \[mrad\] +([\d.]+) ", block="report of feet put down at the steel",
    ),
    Claim(
        "docs/studies/walking.md", r"a pull margin of ([\d.]+) N, compared to ([\d.]+) N for a foot with adhesion",
        "docs/studies/walking.md",
        r"smallest pull margin \[N\] +([\d.]+) +([\d.]+)\n", block="report of feet put down at the steel",
    ),
    Claim(
        "docs/studies/walking.md", r"With the offset, the pull margins are ([\d.]+) N and ([\d.]+) N", "docs/studies/walking.md",
        r"smallest pull margin \[N\](?: +[\d.]+){4} +([\d.]+) +([\d.]+)\n", block="report",
    ),
)

GIVEN = {
    "README.md": {},
    "docs/studies/speed.md": {
        "0.34 ms": "`make bench-variants` prints it", "300 variants": "`make bench-variants` prints it",
        "0.3 s": "a bound, benchmarks/viewer",
    },
    "docs/studies/walking.md": {
        "90 mm": "STRIDE of examples/walk.py", "0.1 mm": "SINK of examples/walk.py", "300 N": "data of the magnet",
        "1.5 s": "PRESS of examples/inchworm_tunnel.py", "0.15 s": "PRESS of examples/inchworm_gait.py",
        "20.4 N": "the weight of 2.08 kg", "25 mm": "POLE of examples/inchworm_physics.py", "4 mm": "STEEL of examples/inchworm_physics.py",
    },
}
"""Numbers that were chosen, are limits, or have no block to compare with, by page, and their source."""

MEASURED = r"(?<![\w.$-])(\d[\d ]*\d|\d+|\d[\d.]*(?:e-?\d+)?) ?(ms|mm|mrad|kg|MB|N|m|steps|variants|s)\b"
"""Matches a number with the unit of a measurement."""


def prose(page: str) -> str:
    """Return a page without its blocks and comments, on one line."""
    return re.sub(r"\s+", " ", re.sub(r"<!--.*?-->", "", without_fences(ROOT / page)))


def printed(claim: Claim) -> str:
    text = (ROOT / claim.printed).read_text()
    if not claim.block:
        return re.sub(r"\s+", " ", text)
    _, marker, rest = text.partition(f"<!-- {claim.block} -->\n")
    assert marker, f"{claim.printed} has no block <!-- {claim.block} -->"
    return rest.split("```")[1]


@pytest.mark.parametrize("claim", CLAIMS, ids=str)
def test_quoted_numbers_match_the_command_output(claim: Claim) -> None:
    said, measured = re.search(claim.prose, prose(claim.page)), re.search(claim.source, printed(claim))
    assert said is not None, f"{claim.page} does not say it so: {claim.prose}"
    assert measured is not None, f"{claim.printed} has no such figures: {claim.source}"
    assert said.groups() == measured.groups(), f"{claim.page} says {said.groups()}, {claim.printed} {measured.groups()}"


@pytest.mark.parametrize("page", sorted(GIVEN))
def test_every_number_has_a_source(page: str) -> None:
    text = prose(page)
    quoted = [match.span() for claim in CLAIMS if claim.page == page for match in [re.search(claim.prose, text)] if match is not None]
    found = [match for match in re.finditer(MEASURED, text) if not any(a <= match.start() and match.end() <= b for a, b in quoted)]
    unknown = [text[max(0, m.start() - 60) : m.end()] for m in found if m.group() not in GIVEN[page]]
    assert not unknown, f"{page}: no command prints these, and nothing gives them: {unknown}"


def test_readme_quotes_the_conformance_study() -> None:
    found: dict[tuple[str, str], list[list[str]]] = {}
    for reader, file_format, _, *row in table(ROOT / "docs/studies/conformance_table.md", "conformance"):
        found.setdefault((reader, file_format), []).append(row)
    quoted = table(ROOT / "README.md", "checkers")
    assert len(quoted) > 5
    for reader, file_format, *cells in quoted:
        rows = found[reader, file_format]
        refused = sum(int(number) for row in rows for number in re.findall(r"not supported: (\d+)", row[-1]))
        assert cells == [str(sum(int(row[0]) for row in rows)), str(refused), largest(rows, 1), largest(rows, 4)], reader


def largest(rows: list[list[str]], column: int) -> str:
    """Return the largest of some numbers as written; `-` if there are none."""
    return max((row[column] for row in rows if row[column] != "-"), key=float, default="-")


def test_readme_is_short() -> None:
    assert len((ROOT / "README.md").read_text().split()) <= 900


def test_pages_are_short() -> None:
    """A page has at most 3000 words, with its listings and tables, and without parts that a command writes."""
    pages = [page for page in PAGES if page.parent.name != "studies" and page.name != "diagnostics.md"]
    generated = re.compile(r"(?s)<!-- generated: .*?<!-- /generated -->")
    words = {page.name: len(generated.sub("", page.read_text()).split()) for page in pages}
    assert {name: count for name, count in words.items() if count > 3000} == {}
