"""Make STEP files reproducible: sort their styles and remove noise from their numbers.

The CAD kernel writes one group of styles per instance. The order of the groups depends on memory addresses. Therefore, the order of the
groups and the numbers of their entities can differ between two runs. This module sorts all entities after the first style by content, and
renumbers them. The entities before the first style, which describe the geometry, are not changed.

If a boolean operation merges two edges, the kernel keeps the edge with the lower memory address. Therefore, a coordinate can be 0 in one
run and 2e-31 in another run.
"""

from __future__ import annotations

import hashlib
import re

_ENTITY = re.compile(rb"#(\d+)\s*=\s*((?:'(?:[^']|'')*'|[^';])*);", re.DOTALL)
_REFERENCE = re.compile(rb"'(?:[^']|'')*'|#(\d+)")
_NOISE = re.compile(rb"E-(?:1[5-9]|[2-9]\d|\d{3})\b")
_STYLES = b"MECHANICAL_DESIGN_GEOMETRIC_PRESENTATION_REPRESENTATION"
_LIST = re.compile(rb"\(((?:#\d+,?\s*)+)\)")


def without_noise(data: bytes) -> bytes:
    """Replace every number below 1e-14 in a STEP file by 0. The numbers are coordinates [mm] or components of directions."""
    texts = data.split(b"'")
    for index in range(0, len(texts), 2):  # every second piece is a quoted string; a quote in a string is doubled
        *before, last = _NOISE.split(texts[index])
        if before:
            texts[index] = b"".join(number.rstrip(b".0123456789").removesuffix(b"-") + b"0." for number in before) + last
    return b"'".join(texts)


def sort_styles(data: bytes) -> bytes:
    """Return a STEP file with its styles in canonical order. If the file has no styles, return it unchanged."""
    begin = data.find(_STYLES)
    end = data.rfind(b"ENDSEC;")
    if begin < 0 or end < begin:
        return data
    begin = data.rfind(b"\n#", 0, begin) + 1
    entities = {int(number): re.sub(rb"\s*\n\s*", b"", body) for number, body in _ENTITY.findall(data, begin, end)}
    first = min(entities)
    before = data[:begin]
    if any(int(number) >= first for number in _numbers(before)):
        raise ArithmeticError("the geometry of the STEP file refers to its styles")
    order = _Order(entities)
    return before + order.text(first) + data[end:]


def _numbers(text: bytes) -> list[bytes]:
    return [match for match in _REFERENCE.findall(text) if match]


class _Order:
    def __init__(self, entities: dict[int, bytes]) -> None:
        self.entities = entities
        self.keys: dict[int, bytes] = {}
        for number in sorted(entities):
            self.key(number)
        self.entities = {number: self._sort_items(body) for number, body in entities.items()}

    def key(self, number: int) -> bytes:
        """Return a digest of an entity and of all entities to which it refers. The digest does not depend on the numbers of the
        entities.
        """
        if number not in self.keys:
            self.keys[number] = b""  # STEP files do not have cycles; this line would end the recursion for a cycle
            body = self.entities[number]
            if body.startswith(_STYLES):
                body = _LIST.sub(lambda match: b"".join(sorted(self._by_key(match[1]))), body, count=1)
            self.keys[number] = hashlib.sha256(_REFERENCE.sub(self._key_of, body)).hexdigest().encode()
        return self.keys[number]

    def _key_of(self, match: re.Match[bytes]) -> bytes:
        if match[1] is None or int(match[1]) not in self.entities:
            return match[0]
        return self.key(int(match[1]))

    def _by_key(self, references: bytes) -> list[bytes]:
        return [self.key(int(one)) if int(one) in self.entities else b"#" + one for one in _numbers(references)]

    def _sort_items(self, body: bytes) -> bytes:
        """Return the text of a group of styles, with its items sorted by content."""
        if not body.startswith(_STYLES):
            return body

        def rearrange(match: re.Match[bytes]) -> bytes:
            numbers = [int(one) for one in _numbers(match[1])]
            numbers.sort(key=lambda one: self.keys.get(one, b"#%d" % one))
            return b"(" + b",".join(b"#%d" % one for one in numbers) + b")"

        return _LIST.sub(rearrange, body, count=1)

    def text(self, first: int) -> bytes:
        """Return the text of all entities. The numbers of the entities begin at `first`. The entities are listed depth first, beginning
        with the entities to which no other entity refers.
        """
        named = {int(one) for body in self.entities.values() for one in _numbers(body)}
        roots = sorted((number for number in self.entities if number not in named), key=lambda number: self.keys[number])
        numbers: dict[int, int] = {}
        to_visit = list(reversed(roots))
        while to_visit:
            number = to_visit.pop()
            if number in numbers or number not in self.entities:
                continue
            numbers[number] = first + len(numbers)
            to_visit.extend(reversed([int(one) for one in _numbers(self.entities[number])]))

        def renumber(match: re.Match[bytes]) -> bytes:
            if match[1] is None or int(match[1]) not in numbers:
                return match[0]
            return b"#%d" % numbers[int(match[1])]

        return b"".join(b"#%d = %s;\n" % (new, _REFERENCE.sub(renumber, self.entities[old])) for old, new in numbers.items())
