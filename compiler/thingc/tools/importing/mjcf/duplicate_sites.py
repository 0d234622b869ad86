"""Sites that say nothing of their own.

Models that thingc has written have a site wherever something sits, beside the one that the document shows there, for every root, and at the
ends of loops. Taken for mounts they would come back beside those that are written anyway, more of them in each round.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.pose import NO_POSE, Pose
from thingc.tools.importing.document_names import plain_name
from thingc.tools.importing.quantities import same_place

SITE = 6
SPHERE, CYLINDER, STEP = 4, 5, 3
"""Of a tendon: what it goes around, with a site beside it or without, and a site that it goes through."""
AT_SITE, AT_CRANK = 4, 2
OF_LOOP = re.compile(r":(parent|child|held)(_1)?")
"""How the sites end that loops and holds are closed by, which are written for each of these."""


class Doubles(FrozenStruct, kw_only=False):
    """Sites by number: those that are another one under a `second` name, with the one that they are; those that are the `frames` of their
    bodies; and those that are there for what is `closed`."""

    second: dict[int, int]
    frames: frozenset[int]
    closed: frozenset[int]


def doubles(model: Any, names: Mapping[int, str], bodies: Mapping[int, str], poses: Mapping[int, Pose]) -> Doubles:
    """Those of a model: `names` are its sites', `bodies` its bodies', `poses` the sites' in these."""
    second: dict[int, int] = {}
    kept: dict[int, list[int]] = {}
    used, joined = {*_used(model)}, {*_joined(model)}
    closed = frozenset(site for site in joined - used if OF_LOOP.search(names[site]))
    frames: set[int] = set()
    for site in (site for site in range(model.nsite) if site not in closed):
        body = int(model.site_bodyid[site])
        others, named = kept.setdefault(body, []), plain_name(bodies[body], "link")
        other = next((one for one in others if _is_second(names[site], names[one], named) and same_place(poses[one], poses[site])), None)
        of_body = names[site] in (bodies[body], named) or names[site] == f"{named}/origin" and not int(model.body_parentid[body])
        if other is not None:
            second[site] = other
        elif of_body and site not in used and same_place(poses[site], NO_POSE):
            frames.add(site)
        else:
            others.append(site)
    return Doubles(second, frozenset(frames), closed)


def _is_second(name: str, other: str, body: str) -> bool:
    """Whether a site of that name is where the one called `other` is because something of the robot sits there."""
    return "/" in name and ("/" not in other or name.startswith(f"{body}/")) or name.endswith(":volume")


def _used(model: Any) -> Iterator[int]:
    """Sites that sensors, tendons and actuators are at."""
    for kind, thing in (("objtype", "objid"), ("reftype", "refid")):
        at = zip(getattr(model, f"sensor_{kind}"), getattr(model, f"sensor_{thing}"), strict=True)
        yield from (int(number) for of, number in at if int(of) == SITE)
    for kind, number, side in zip(model.wrap_type, model.wrap_objid, model.wrap_prm, strict=True):
        if int(kind) == STEP:
            yield int(number)
        elif int(kind) in (SPHERE, CYLINDER):
            yield int(side)
    for kind, ends in zip(model.actuator_trntype, model.actuator_trnid, strict=True):
        if int(kind) in (AT_SITE, AT_CRANK):
            yield from map(int, ends)


def _joined(model: Any) -> Iterator[int]:
    """Sites that equalities join."""
    for kind, *ends in zip(model.eq_objtype, model.eq_obj1id, model.eq_obj2id, strict=True):
        if int(kind) == SITE:
            yield from map(int, ends)
