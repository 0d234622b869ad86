"""Documents with one typing mistake in a key or a name."""

from __future__ import annotations

import random
import re
from collections.abc import Iterator
from dataclasses import dataclass

WORD = re.compile(r"[A-Za-z][A-Za-z_]{2,}")
PROSE = re.compile(r"(?:^|\s)#\s|\bdoc:|^description:|^  (?=Magnetic|coil)")
"""Matches the start of comments and descriptions."""


@dataclass(frozen=True)
class Mutant:
    """`text` is the document in which `word`, at offset `at`, is replaced by `slip`; `kind` is the kind of typing mistake."""

    kind: str
    at: int
    word: str
    slip: str
    text: str


def slips(text: str, count: int, seed: int) -> Iterator[Mutant]:
    """Yield `count` documents in which one letter of one word (outside comments and prose) is omitted, doubled, or swapped with the
    next."""
    chance = random.Random(seed)
    places = [
        (line.start() + found.start(), found.group())
        for line in re.finditer(r"[^\n]+", text) for found in WORD.finditer(PROSE.split(line.group())[0])
    ]
    for _ in range(count):
        at, word = chance.choice(places)
        kind = chance.choice(("delete", "insert", "swap"))
        letter = chance.randrange(len(word) - 1)
        if kind == "delete":
            slip = word[:letter] + word[letter + 1 :]
        elif kind == "insert":
            slip = word[: letter + 1] + word[letter:]
        else:
            slip = word[:letter] + word[letter + 1] + word[letter] + word[letter + 2 :]
        if slip != word:
            yield Mutant(kind, at, word, slip, text[:at] + slip + text[at + len(word) :])
