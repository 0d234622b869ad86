"""Whether every part has the shape that its document wants it to collide as."""

from __future__ import annotations

from collections.abc import Sequence

from thingc.base.diagnostics import Code
from thingc.model.assembly.report import LinkReport
from thingc.model.assembly.types import Occurrence

ABSENT = {
    "decompose": "there is no convex decomposition of it", "part": "its Thing has no `collision()`", "hull": "it has no hull",
    "mesh": "it has no mesh",
}
"""Why there is no shape, by what `collision` chose."""


def check_contacts(occurrences: Sequence[Occurrence], findings: LinkReport) -> None:
    """An error for each part of which there is no shape such as its `collision` chooses. Of one whose geometry nobody knows here, as
    of one that comes from a lock, nothing is said."""
    for one in occurrences:
        choice = one.overrides.collision
        if one.record is None or not one.record.meshes or choice == "none" or one.touching:
            continue
        findings.error(
            Code.COLLISION_MISSING,
            f"`{one.path}` ({one.definition.label}) asks for `collision: {choice}`, but "
            + ABSENT.get(choice, f"no {choice} could be fitted to it"),
            one.origin, path=one.path, help="write `collision: hull`, or `none` if it shall touch nothing",
        )
