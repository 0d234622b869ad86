"""Check `no_collision` tests with the key `certify` in all positions of their ranges, and describe the results."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from msgspec.structs import replace

from thingc.base.diagnostics import Code, Note
from thingc.base.one_line_repr import format_count
from thingc.base.units import LENGTH
from thingc.documents.checks.no_collision import CollisionCheck
from thingc.driver.testing.collisions import Collisions, NearPair, names_of
from thingc.driver.testing.outcomes import TestCase, format_si
from thingc.driver.testing.poses import joints_text
from thingc.driver.testing.references import mount_references
from thingc.model.solids.clearance import SolidPair

METHOD_TEXTS = {"proved": "proved", "followed": "followed through loops", "sampled": "sampled"}
"""Descriptions of the methods by which pairs are compared."""


class Certificate:
    """The pairs of components that move relative to each other in the ranges of a test, with the result of each pair.

    `missing` is the number of samples in which the loops of the robot do not close. If the test compares only parts at joints, `references`
    contains the notes about their mounts and joints, by pair.
    """

    def __init__(self, case: TestCase, check: CollisionCheck, collisions: Collisions) -> None:
        self._case, self._check, self._assembly = case, check, collisions.assembly
        only = mount_references(collisions.assembly) if check.certify == "references" else None
        self.pairs, self.missing = collisions.certify(case.robot, case.frames[0], check, only)
        self.references = {(pair.one, pair.other): only[pair.one, pair.other] for pair in self.pairs} if only is not None else None

    def _pairs_with(self, verdict: str) -> list[SolidPair]:
        return [pair for pair in self.pairs if pair.verdict == verdict]

    def _method(self, method: str) -> list[SolidPair]:
        return [pair for pair in self._pairs_with("clear") if pair.method == method]

    def touching(self, allowed: Mapping[tuple[int, int], int]) -> Iterator[NearPair]:
        """Yield the pairs of components that collide, at the worst position that was found."""
        for pair in self._pairs_with("touches"):
            yield NearPair(
                one=pair.one, other=pair.other, gap=pair.gap, depth=pair.depth, volume=pair.volume,
                allowance=allowed.get((pair.one, pair.other)), where=replace(self._case.frames[0], q=dict(pair.q)),
            )

    def warn(self, allowed: Mapping[tuple[int, int], int]) -> set[int]:
        """Report a warning about the undecided pairs that are not allowed to collide.

        `allowed` maps pairs to the index of their `allow` entry. Return the indices of the entries of undecided pairs.
        """
        undecided = self._pairs_with("undecided")
        used_allowances = {allowed[pair.one, pair.other] for pair in undecided if (pair.one, pair.other) in allowed}
        open_pairs = sorted((pair for pair in undecided if (pair.one, pair.other) not in allowed), key=lambda pair: pair.gap)
        if open_pairs:
            test = self._case.linked.test
            self._case.request.report.warn(
                Code.TEST_UNDECIDED, f"test `{test.name}`: the gap between {self._describe_pair(open_pairs[0])}", test.origin,
                path=f"tests.{test.name}", help="increase the gap, or set a finer `mesh` tolerance in thingc.toml",
                notes=[Note(message=f"the gap between {self._describe_pair(pair)}") for pair in open_pairs[1:]],
            )
        return used_allowances

    def _describe_pair(self, pair: SolidPair) -> str:
        position = joints_text(self._assembly, {r.joint: pair.q[r.joint] for r in self._check.ranges}) if pair.q else ""
        gap = f" ({format_si(pair.gap, LENGTH)} at {position})" if pair.q else ""
        return f"{names_of(self._assembly, pair.one, pair.other, '`')} is smaller than the mesh error{gap}"

    @property
    def summary(self) -> str:
        """A description of the results."""
        counts = [f"{format_count(len(pairs), 'pair')} {text}" for method, text in METHOD_TEXTS.items() if (pairs := self._method(method))]
        rest_texts = [
            f"{format_count(len(pairs), 'pair')} {text}"
            for verdict, text in (("contact", "in contact"), ("undecided", "undecided")) if (pairs := self._pairs_with(verdict))
        ]
        return ", ".join([f"clear over the ranges: {', '.join(counts)}"] * bool(counts) + rest_texts) or "no pair of parts moves"

    @property
    def measured(self) -> dict[str, list[str]]:
        """The names of the pairs by method, for pairs that are clear, and by result, for other pairs."""
        groups = {method: self._method(method) for method in METHOD_TEXTS}
        groups |= {verdict: self._pairs_with(verdict) for verdict in ("contact", "undecided", "touches")}
        return {name: [names_of(self._assembly, pair.one, pair.other) for pair in pairs] for name, pairs in groups.items()}
