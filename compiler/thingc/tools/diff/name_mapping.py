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
        self._paths: dict[What, dict[str, str]] = {what: {} for what in (*_ORDER, "mate")}
        self._paths["component"] = {"": "", **{path: counterpart.new for path, counterpart in self.components.items()}}
        self._back = {counterpart.new: path for path, counterpart in self.components.items()}
        self.pairs: list[Pair] = []
        self.gone: list[SnapshotElement] = []
        self.come: list[SnapshotElement] = []
        for what in (*_OWNED, *_ORDER):
            self._pair(what)

    # --- names and values --------------------------------------------------------------------------------------------

    def path(self, what: What, path: str) -> str | None:
        """Convert the path of an element in the old robot to its path in the new robot. Return None if the element was removed."""
        return self._paths[what].get(path)

    def old_component(self, path: str) -> str | None:
        """Convert the path of a component in the new robot to its path in the old robot. Return None if the component was added."""
        return self._back.get(path)

    def now(self, value: Value) -> Value:
        """Replace names of elements in a value by the names in the new robot. Names of removed elements do not change."""
        if isinstance(value, tuple):
            return tuple(self.now(one) for one in value)
        if not isinstance(value, Named):
            return value
        mount = value.mount
        if mount is not None and (there := self._paths["mount"].get(f"{value.path}/{mount}")) is not None:
            mount = there.rpartition("/")[2]
        return Named(what=value.what, path=self._paths[value.what].get(value.path, value.path), mount=mount)

    def same(self, old: Value, new: Value) -> bool:
        """Return whether a value of the old robot, with names translated, equals a value of the new robot.

        The order of names in a list is ignored.
        """
        now = self.now(old)
        if _names(now) and _names(new):
            return sorted(map(repr, now)) == sorted(map(repr, new))  # type: ignore[arg-type]
        return equal(now, new)

    # --- pairs -------------------------------------------------------------------------------------------------------

    def _pair(self, what: What) -> None:
        olds = {thing.path: thing for thing in self.old.things.values() if thing.what == what}
        news = {thing.path: thing for thing in self.new.things.values() if thing.what == what}
        for path, thing in list(olds.items()):
            there = self._expected_path(thing)
            if there is not None and there in news:
                counterpart = self.components.get(path) if what == "component" else None
                self._take(thing, news.pop(there), counterpart.reason if counterpart else "", counterpart.perhaps if counterpart else False)
                del olds[path]
        if what not in _OWNED:
            self._match_renamed(what, olds, news)
        self.gone += olds.values()
        self.come += news.values()

    def _expected_path(self, thing: SnapshotElement) -> str | None:
        """Return the expected path in the new robot of an element of the old robot, or None if the component of the element was removed."""
        if thing.what in _OWNED:
            return self._paths["component"].get(thing.path)
        if not thing.of:
            return thing.path
        there = self._paths["component"].get(thing.of)
        return None if there is None else there + thing.path.removeprefix(thing.of)

    def _take(self, old: SnapshotElement, new: SnapshotElement, reason: str, perhaps: bool = False) -> None:
        self.pairs.append(Pair(old=old, new=new, reason=reason if old.path != new.path else "", perhaps=perhaps))
        self._paths[old.what].setdefault(old.path, new.path)

    def _match_renamed(self, what: What, olds: dict[str, SnapshotElement], news: dict[str, SnapshotElement]) -> None:
        """Match a removed element with an added element if both have equal content. Also match joints that connect the same components."""
        tests = [(self._says_the_same, "equal definition", False)]
        if what == "joint":
            tests.insert(0, (self._connects_the_same, "same connections", False))
        if what not in ("parameter", "mount"):
            tests.append((self._says_nearly_the_same, "similar definition", True))
        for alike, reason, perhaps in tests:
            after = {path: [there for there, new in news.items() if alike(old, new)] for path, old in olds.items()}
            before = {there: [path for path, candidates in after.items() if there in candidates] for there in news}
            for path, candidates in after.items():
                candidates = [there for there in candidates if there in news]
                if not candidates:
                    continue
                rivals = [one for one in before[candidates[0]] if one in olds]
                if len(candidates) == len(rivals) and (len(candidates) == 1 or not perhaps):
                    # elements with equal content are matched in document order
                    there = candidates[rivals.index(path)] if path in rivals else candidates[0]
                    self._take(olds[path], news[there], reason, perhaps or len(candidates) > 1)
            for pair in self.pairs:
                if pair.old.what == what:
                    olds.pop(pair.old.path, None)
                    news.pop(pair.new.path, None)

    def _in_one_document(self, old: SnapshotElement, new: SnapshotElement) -> bool:
        return self._paths["component"].get(old.of) == new.of

    def _says_the_same(self, old: SnapshotElement, new: SnapshotElement) -> bool:
        return self._in_one_document(old, new) and bool(new.facts) and self._count_equal(old, new) == len([*self.facts(old, new)])

    def _says_nearly_the_same(self, old: SnapshotElement, new: SnapshotElement) -> bool:
        return self._in_one_document(old, new) and 2 * self._count_equal(old, new) > len([*self.facts(old, new)])

    def _connects_the_same(self, old: SnapshotElement, new: SnapshotElement) -> bool:
        return "parent" in old.facts and "parent" in new.facts and all(
            self.same(old.facts[key].value, new.facts[key].value) for key in ("parent", "child")
        )

    def _count_equal(self, old: SnapshotElement, new: SnapshotElement) -> int:
        """Return the number of properties that have the same value in the old and the new element."""
        return sum(1 for _, before, after in self.facts(old, new) if self.same(before, after))

    def facts(self, old: SnapshotElement, new: SnapshotElement) -> Iterator[tuple[str, Value, Value]]:
        """Yield the key, the old value and the new value of each property of a matched element. Keys use the names of the new robot."""
        before = {self._key(old.what, key): fact.value for key, fact in old.facts.items()}
        for key in {**before, **dict.fromkeys(new.facts)}:
            after = new.facts[key].value if key in new.facts else None
            yield key, before.get(key), after

    def _key(self, what: What, key: str) -> str:
        if what == "pose":
            return self._paths["joint"].get(key, key)
        head, dot, rest = key.partition(".")
        if what == "mode" and head in ("hold", "adhesion") and dot:
            path, _, mount = rest.rpartition(".")
            now = self.now(Named(what="component", path=path.replace(".", "/"), mount=mount))
            return f"{head}.{now.text}" if isinstance(now, Named) else key
        return key

    def old_fact(self, thing: SnapshotElement, key: str) -> str:
        """Convert the key of a property in the new robot to the key of the same property in the old robot."""
        return next((one for one in thing.facts if self._key(thing.what, one) == key), key)


def _names(value: Value) -> bool:
    return isinstance(value, tuple) and bool(value) and all(isinstance(one, Named) for one in value)


def equal(old: Value, new: Value, scale: float = 0.0) -> bool:
    """Return whether two values are equal up to rounding errors.

    For a tuple of numbers, the tolerance is relative to the largest number.
    """
    if isinstance(old, tuple) and isinstance(new, tuple):
        scale = max(scale, *(largest(one) for one in (old, new)))
        return len(old) == len(new) and all(equal(one, other, scale) for one, other in zip(old, new, strict=True))
    if not _is_number(old) or not _is_number(new):
        return old == new and type(old) is type(new)
    return math.isclose(old, new, rel_tol=RELATIVE, abs_tol=RELATIVE * scale or NOTHING)


def largest(value: Value) -> float:
    """Return the largest absolute value of the numbers in a nested tuple. Return 0 if the tuple contains no number."""
    if isinstance(value, tuple):
        return max((largest(one) for one in value), default=0.0)
    return abs(value) if _is_number(value) else 0.0


def _is_number(value: object) -> TypeGuard[int | float]:
    return isinstance(value, (int, float)) and not isinstance(value, bool)
