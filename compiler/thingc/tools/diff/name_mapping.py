"""Match the named elements of the old and the new robot, translate old names to new names, and compare values."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TypeGuard

from thingc.base.frozen_struct import FrozenStruct
from thingc.tools.diff.matching import match
from thingc.tools.diff.snapshot import Named, Snapshot, SnapshotElement, Value, What

RELATIVE = 1e-9
"""Relative tolerance for comparing numbers, such as `0.1 m` and `100 mm`."""
NOTHING = 1e-12
"""Absolute tolerance for comparing lengths [m], angles [rad] and other numbers near 0."""

_ORDER: tuple[What, ...] = ("parameter", "material", "mount", "joint", "pose", "mode", "sensor", "test")
_OWNED: tuple[What, ...] = ("component", "mate")


class Pair(FrozenStruct):
    """An element that exists in both the old and the new robot.

    For a renamed element, `reason` explains the match. `perhaps` is true if the match is uncertain.
    """

    old: SnapshotElement
    new: SnapshotElement
    reason: str = ""
    perhaps: bool = False

    @property
    def new_path(self) -> str | None:
        """The path of the element in the new robot if it differs from the path in the old robot, else None."""
        return self.new.path if self.new.path != self.old.path else None


class NameMapping:
    """Maps the names of elements in the old robot to their names in the new robot.

    `pairs` are the elements that exist in both robots. `gone` are the elements that only the old robot has. `come` are the elements that
    only the new robot has.
    """

    def __init__(self, old: Snapshot, new: Snapshot) -> None:
        self.old, self.new = old, new
        self.components = match(old, new)
        self._paths: dict[What, dict[str, str]] = {kind: {} for kind in (*_ORDER, "mate")}
        self._paths["component"] = {"": "", **{path: counterpart.new for path, counterpart in self.components.items()}}
        self._back = {counterpart.new: path for path, counterpart in self.components.items()}
        self.pairs: list[Pair] = []
        self.gone: list[SnapshotElement] = []
        self.come: list[SnapshotElement] = []
        for kind in (*_OWNED, *_ORDER):
            self._match_kind(kind)

    # --- names and values --------------------------------------------------------------------------------------------

    def path(self, what: What, path: str) -> str | None:
        """Convert the path of an element in the old robot to its path in the new robot. Return None if the element was removed."""
        return self._paths[what].get(path)

    def old_component(self, path: str) -> str | None:
        """Convert the path of a component in the new robot to its path in the old robot. Return None if the component was added."""
        return self._back.get(path)

    def translate(self, value: Value) -> Value:
        """Replace names of elements in a value by the names in the new robot. Names of removed elements do not change."""
        if isinstance(value, tuple):
            return tuple(self.translate(one) for one in value)
        if not isinstance(value, Named):
            return value
        mount = value.mount
        if mount is not None and (new_mount := self._paths["mount"].get(f"{value.path}/{mount}")) is not None:
            mount = new_mount.rpartition("/")[2]
        return Named(what=value.what, path=self._paths[value.what].get(value.path, value.path), mount=mount)

    def same(self, old: Value, new: Value) -> bool:
        """Return whether a value of the old robot, with names translated, equals a value of the new robot.

        The order of names in a list is ignored.
        """
        translated = self.translate(old)
        if _names(translated) and _names(new):
            return sorted(map(repr, translated)) == sorted(map(repr, new))  # type: ignore[arg-type]
        return equal(translated, new)

    # --- pairs -------------------------------------------------------------------------------------------------------

    def _match_kind(self, kind: What) -> None:
        olds = {thing.path: thing for thing in self.old.things.values() if thing.what == kind}
        news = {thing.path: thing for thing in self.new.things.values() if thing.what == kind}
        for path, thing in list(olds.items()):
            new_path = self._expected_path(thing)
            if new_path is not None and new_path in news:
                counterpart = self.components.get(path) if kind == "component" else None
                reason, perhaps = (counterpart.reason, counterpart.perhaps) if counterpart else ("", False)
                self._add_pair(thing, news.pop(new_path), reason, perhaps)
                del olds[path]
        if kind not in _OWNED:
            self._match_renamed(kind, olds, news)
        self.gone += olds.values()
        self.come += news.values()

    def _expected_path(self, thing: SnapshotElement) -> str | None:
        """Return the expected path in the new robot of an element of the old robot, or None if the component of the element was removed."""
        if thing.what in _OWNED:
            return self._paths["component"].get(thing.path)
        if not thing.of:
            return thing.path
        owner = self._paths["component"].get(thing.of)
        return None if owner is None else owner + thing.path.removeprefix(thing.of)

    def _add_pair(self, old: SnapshotElement, new: SnapshotElement, reason: str, perhaps: bool = False) -> None:
        self.pairs.append(Pair(old=old, new=new, reason=reason if old.path != new.path else "", perhaps=perhaps))
        self._paths[old.what].setdefault(old.path, new.path)

    def _match_renamed(self, kind: What, olds: dict[str, SnapshotElement], news: dict[str, SnapshotElement]) -> None:
        """Match a removed element with an added element if both have equal content. Also match joints that connect the same components."""
        tests = [(self._has_equal_facts, "equal definition", False)]
        if kind == "joint":
            tests.insert(0, (self._has_equal_ends, "same connections", False))
        if kind not in ("parameter", "mount"):
            tests.append((self._has_similar_facts, "similar definition", True))
        for matches, reason, perhaps in tests:
            candidates_of = {path: [new_path for new_path, new in news.items() if matches(old, new)] for path, old in olds.items()}
            rivals_of = {new_path: [path for path, candidates in candidates_of.items() if new_path in candidates] for new_path in news}
            for path, candidates in candidates_of.items():
                candidates = [new_path for new_path in candidates if new_path in news]
                if not candidates:
                    continue
                rivals = [one for one in rivals_of[candidates[0]] if one in olds]
                if len(candidates) == len(rivals) and (len(candidates) == 1 or not perhaps):
                    # elements with equal content are matched in document order
                    new_path = candidates[rivals.index(path)] if path in rivals else candidates[0]
                    self._add_pair(olds[path], news[new_path], reason, perhaps or len(candidates) > 1)
            for pair in self.pairs:
                if pair.old.what == kind:
                    olds.pop(pair.old.path, None)
                    news.pop(pair.new.path, None)

    def _in_one_document(self, old: SnapshotElement, new: SnapshotElement) -> bool:
        return self._paths["component"].get(old.of) == new.of

    def _has_equal_facts(self, old: SnapshotElement, new: SnapshotElement) -> bool:
        return self._in_one_document(old, new) and bool(new.facts) and self._count_equal(old, new) == len([*self.facts(old, new)])

    def _has_similar_facts(self, old: SnapshotElement, new: SnapshotElement) -> bool:
        return self._in_one_document(old, new) and 2 * self._count_equal(old, new) > len([*self.facts(old, new)])

    def _has_equal_ends(self, old: SnapshotElement, new: SnapshotElement) -> bool:
        return "parent" in old.facts and "parent" in new.facts and all(
            self.same(old.facts[key].value, new.facts[key].value) for key in ("parent", "child")
        )

    def _count_equal(self, old: SnapshotElement, new: SnapshotElement) -> int:
        """Return the number of properties that have the same value in the old and the new element."""
        return sum(1 for _, before, after in self.facts(old, new) if self.same(before, after))

    def facts(self, old: SnapshotElement, new: SnapshotElement) -> Iterator[tuple[str, Value, Value]]:
        """Yield the key, the old value and the new value of each property of a matched element. Keys use the names of the new robot."""
        old_values = {self._key(old.what, key): fact.value for key, fact in old.facts.items()}
        for key in {**old_values, **dict.fromkeys(new.facts)}:
            yield key, old_values.get(key), new.facts[key].value if key in new.facts else None

    def _key(self, what: What, key: str) -> str:
        if what == "pose":
            return self._paths["joint"].get(key, key)
        head, dot, suffix = key.partition(".")
        if what == "mode" and head in ("hold", "adhesion") and dot:
            path, _, mount = suffix.rpartition(".")
            translated = self.translate(Named(what="component", path=path.replace(".", "/"), mount=mount))
            return f"{head}.{translated.text}" if isinstance(translated, Named) else key
        return key

    def old_fact(self, thing: SnapshotElement, key: str) -> str:
        """Convert the key of a property in the new robot to the key of the same property in the old robot."""
        return next((one for one in thing.facts if self._key(thing.what, one) == key), key)


def _names(value: Value) -> bool:
    return isinstance(value, tuple) and bool(value) and all(isinstance(one, Named) for one in value)


def equal(old: Value, new: Value, scale: float = 0.0, tolerance: float = RELATIVE) -> bool:
    """Return whether two values are equal up to rounding errors.

    The tolerance is relative to the larger number, or to the largest number of a tuple.
    """
    if isinstance(old, tuple) and isinstance(new, tuple):
        scale = max(scale, *(largest(one) for one in (old, new)))
        return len(old) == len(new) and all(equal(one, other, scale, tolerance) for one, other in zip(old, new, strict=True))
    if not _is_number(old) or not _is_number(new):
        return old == new and type(old) is type(new)
    return math.isclose(old, new, rel_tol=tolerance, abs_tol=tolerance * scale or NOTHING)


def largest(value: Value) -> float:
    """Return the largest absolute value of the numbers in a nested tuple. Return 0 if the tuple contains no number."""
    if isinstance(value, tuple):
        return max((largest(one) for one in value), default=0.0)
    return abs(value) if _is_number(value) else 0.0


def _is_number(value: object) -> TypeGuard[int | float]:
    return isinstance(value, (int, float)) and not isinstance(value, bool)
