"""Whether every link that moves can: mass above 0, and an inertia that some solid has."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from thingc.diagnostics import Code
from thingc.graph.findings import Findings
from thingc.graph.types import Link, LinkedMode, Occurrence
from thingc.inertia import physical_fault
from thingc.source import Span


def check_links(
    links: Sequence[Link], link_of: Sequence[int], occurrences: Sequence[Occurrence], modes: Sequence[LinkedMode],
    faulty: Collection[int], findings: Findings,
) -> None:
    """One error per link that moves in some mode and cannot.

    A link moves in a mode unless it is that mode's root and the base is `fixed` or `held`. Links with an occurrence
    of `faulty` (its mass is wrong, and that has been reported) are left out; of links that the same line of a document
    made (a definition used several times), the first is named.
    """
    said: set[Span] = set()
    still = [link_of[mode.root.occurrence] if mode.base in ("fixed", "held") else None for mode in modes]
    common = set(still)
    skip = {link_of[occurrence] for occurrence in faulty}
    for link in links:
        if link.index in skip or common == {link.index} or not modes or not said.isdisjoint(link.origin[:1]):
            continue
        mode = next(mode.name for mode, held in zip(modes, still) if held != link.index)
        fault = physical_fault(link.properties.inertia) if link.properties.mass > 0.0 else None
        if link.properties.mass > 0.0 and fault is None:
            continue
        said.update(link.origin[:1])
        named = _named([occurrences[k] for k in link.members])
        if fault is None:
            findings.error(
                Code.MASSLESS, f"link `{link.name}` moves in mode `{mode}` and has no mass ({named})", link.origin,
                path=link.name,
                help="give one of its components `mass:` (and `inertia:` where it has no geometry), or attach it to another link",
            )
        else:
            findings.error(
                Code.NOT_PHYSICAL,
                f"link `{link.name}` moves in mode `{mode}` and its inertia is not physical: {fault} ({named})",
                link.origin, path=link.name, help="give a component with geometry a mass, or state `inertia:` on one of them",
            )


def _named(members: Sequence[Occurrence]) -> str:
    """`components a, b and 3 more`."""
    shown = ", ".join(f"`{occurrence.path}`" for occurrence in members[:6])
    rest = f" and {len(members) - 6} more" if len(members) > 6 else ""
    return f"component{'' if len(members) == 1 else 's'} {shown}{rest}"
