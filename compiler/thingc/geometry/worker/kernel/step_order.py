"""Puts the styles of a STEP file in an order of their own, and takes the noise out of its numbers.

The kernel writes one group of styles per instance in the order of their addresses in memory, so that two runs differ in the
order of the groups and in the numbers of their entities, and in nothing else. Everything from the first style on is sorted
by content and numbered anew; the geometry before it stays as it is.

Where a boolean makes one edge of two, the kernel keeps the one with the lower address: a coordinate may be 0 in one run and 2e-31 in
the next.
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
    """The same STEP file with 0 for every number below 1e-14 [mm, or the part of a direction]."""
    texts = data.split(b"'")
    for index in range(0, len(texts), 2):  # what is quoted stands between: a quote within it is two
        *before, rest = _NOISE.split(texts[index])
        if before:
            texts[index] = b"".join(number.rstrip(b".0123456789").removesuffix(b"-") + b"0." for number in before) + rest
    return b"'".join(texts)


def settled(data: bytes) -> bytes:
    """The same STEP file with its styles in canonical order; as it is where it has none."""
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
        self.entities = {number: self._sorted(body) for number, body in entities.items()}

    def key(self, number: int) -> bytes:
        """What an entity is, whatever its number: a digest over everything it leads to."""
        if number not in self.keys:
            self.keys[number] = b""  # STEP has no cycles; should there be one, it ends here
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

    def _sorted(self, body: bytes) -> bytes:
        """The items of a group of styles in the order of what they are."""
        if not body.startswith(_STYLES):
            return body

        def arranged(match: re.Match[bytes]) -> bytes:
            numbers = [int(one) for one in _numbers(match[1])]
            numbers.sort(key=lambda one: self.keys.get(one, b"#%d" % one))
            return b"(" + b",".join(b"#%d" % one for one in numbers) + b")"

        return _LIST.sub(arranged, body, count=1)

    def text(self, first: int) -> bytes:
        """All entities, each after the one that names it first, numbered from `first`."""
        named = {int(one) for body in self.entities.values() for one in _numbers(body)}
        roots = sorted((number for number in self.entities if number not in named), key=lambda number: self.keys[number])
        numbers: dict[int, int] = {}
        waiting = list(reversed(roots))
        while waiting:
            number = waiting.pop()
            if number in numbers or number not in self.entities:
                continue
            numbers[number] = first + len(numbers)
            waiting.extend(reversed([int(one) for one in _numbers(self.entities[number])]))

        def renumbered(match: re.Match[bytes]) -> bytes:
            if match[1] is None or int(match[1]) not in numbers:
                return match[0]
            return b"#%d" % numbers[int(match[1])]

        return b"".join(
            b"#%d = %s;\n" % (new, _REFERENCE.sub(renumbered, self.entities[old])) for old, new in numbers.items()
        )
