"""Create mutants of a document, each with one error. Kind and place of the errors are random and depend on a seed."""

from __future__ import annotations

import random
import re
from collections.abc import Iterator
from dataclasses import dataclass

from thingc.base.source import Document, MappingNode, Node, Path, ScalarNode, SequenceNode, Span, walk

KINDS = ("delete", "misspell key", "misspell value", "change unit", "swap", "retype")
UNITS = ("mm", "m", "deg", "rad", "kg", "g", "N", "N*m", "s", "Hz", "kg/m^3", "rpm", "%", "furlong")
RETYPED = ("3", "-7", "true", "[1, 2]", "{a: 1}", '"nonsense"', '""', "=1 / 0")
RETYPED_TOML = ("3", "-7", "true", "[1, 2]", "{a = 1}", '"nonsense"', '""', '"=1 / 0"')
_QUANTITY = re.compile(r"""["']?[-+]?[\d.]+(?:e[-+]?\d+)?(?: +[-+\d.e]+)* +([A-Za-z%][^\s\]},"']*)["']?\Z""")
FREE = frozenset({"description", "doc", "number", "supplier", "reason"})
"""Keys whose values are free text, in which an error cannot be detected."""


@dataclass(frozen=True)
class Mutant:
    """A copy of a document with one error. The field `text` is the text of the copy, and `path` is the path of the changed value. The error
    is on the lines `first` to `last`.

    `gone` is the name that the error removed, if any: a deleted or misspelled key, or a name in a value. Errors may be reported where this
    name is used.
    """

    kind: str
    path: Path
    what: str
    text: str
    first: int
    last: int
    gone: str | None


def mutants(document: Document, seed: int) -> Iterator[Mutant]:
    """Yield mutants of a document without end. The kinds of errors alternate."""
    chance = random.Random(f"{document.relative} {seed}")
    maker = _Maker(document, chance)
    while True:
        for kind in KINDS:
            found = maker.make(kind)
            if found is not None and found.text != document.text:
                yield found


class _Maker:
    def __init__(self, document: Document, chance: random.Random) -> None:
        self.text = document.text
        self.chance = chance
        self.toml = document.path.endswith(".toml")
        self.starts = [0, *(found.end() for found in re.finditer("\n", document.text))]
        self.entries: list[tuple[Path, Node, Span]] = []
        self.scalars: list[tuple[Path, ScalarNode]] = []
        for path, node in walk(document.tree):
            if path and isinstance(path[-1], str):
                self.entries.append((path, node, document.span(path, key=True)))
            if path and isinstance(node, ScalarNode) and path[-1] not in FREE:
                self.scalars.append((path, node))
        self.quantities = [(path, node) for path, node in self.scalars if _QUANTITY.match(self.written(node))]

    def written(self, node: Node) -> str:
        begin, end = self.indices(node.span)
        return self.text[begin:end]

    def indices(self, span: Span) -> tuple[int, int]:
        return self.starts[span.line - 1] + span.column - 1, self.starts[span.end_line - 1] + span.end_column - 1

    def make(self, kind: str) -> Mutant | None:
        """Return a mutant with an error of the given kind, or None if the kind does not apply to the document."""
        if kind == "delete":
            return self.deleted()
        if kind == "misspell key":
            path, _, key = self.chance.choice(self.entries)
            begin, end = self.indices(key)
            return self.replaced(kind, path, begin, end, self.misspelled(self.text[begin:end]), gone=self.text[begin:end].strip("\"'"))
        if kind == "change unit":
            if not self.quantities:
                return None
            path, node = self.chance.choice(self.quantities)
            begin, end = self.indices(node.span)
            found = _QUANTITY.match(self.text[begin:end])
            assert found is not None
            unit = self.chance.choice([unit for unit in UNITS if unit != found.group(1)])
            return self.replaced(kind, path, begin + found.start(1), begin + found.end(1), unit)
        path, node = self.chance.choice(self.scalars)
        begin, end = self.indices(node.span)
        before = self.text[begin:end]
        if kind == "misspell value":
            quoted = len(before) > 2 and before[0] == before[-1] and before[0] in "\"'"
            new = before[0] + self.misspelled(before[1:-1]) + before[-1] if quoted else self.misspelled(before)
        elif kind == "swap":
            new = self.written(self.chance.choice(self.scalars)[1])
        else:
            new = self.chance.choice(RETYPED_TOML if self.toml else RETYPED)
        word = before.strip("\"'")
        return self.replaced(kind, path, begin, end, new, gone=word if path[-1] in ("name",) or path[0] == "links" else None)

    def deleted(self) -> Mutant | None:
        """Delete a random entry. Delete whole lines if the lines contain nothing else."""
        path, node, key = self.chance.choice(self.entries)
        begin, end = self.indices(key)[0], self.indices(node.span)[1]
        name = self.text[slice(*self.indices(key))].strip("\"'")
        if self.toml and isinstance(node, (MappingNode, SequenceNode)) and self.text[begin - 1] in "[.":
            return None  # the header of a table
        rest = re.compile(r"[ \t]*(?:,[ \t]*|(?:#.*)?\n)?").match(self.text, end)
        assert rest is not None
        line = self.text.rfind("\n", 0, begin) + 1
        alone = not self.text[line:begin].strip() and rest.group().endswith("\n")
        return self.replaced("delete", path, line if alone else begin, rest.end(), "", gone=name)

    def replaced(self, kind: str, path: Path, begin: int, end: int, new: str, gone: str | None = None) -> Mutant:
        first = self.text.count("\n", 0, begin) + 1
        what = f"{' '.join(self.text[begin:end].split())[:50]} -> {new[:50]}" if new else " ".join(self.text[begin:end].split())[:50]
        return Mutant(kind, path, what, self.text[:begin] + new + self.text[end:], first, first + new.count("\n"), gone)

    def misspelled(self, word: str) -> str:
        """Return the word with a random typo: a letter is omitted, doubled, replaced or swapped with the next letter."""
        at = self.chance.randrange(len(word)) if word else 0
        ways = ["x", word[at] * 2, "", *([word[at + 1] + word[at]] if at + 1 < len(word) else [])] if word else ["x"]
        new = self.chance.choice(ways)
        return word[:at] + new + word[at + (2 if len(new) == 2 and new[0] != new[1] else 1):]
