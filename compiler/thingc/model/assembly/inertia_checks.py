"""Check that every moving link has a mass above 0, a physically possible inertia, and values that MuJoCo accepts."""

from __future__ import annotations

from collections.abc import Collection

from thingc.base.diagnostics import Code, Note
from thingc.base.inertia import LEAST_MASS, LEAST_MOMENT, ZERO, moments_fault, physical_fault, principal_moments
from thingc.base.joints.kinds import stays
from thingc.base.safe_text import quote_names
from thingc.base.source import Span
from thingc.model.assembly.links import rigid_groups
from thingc.model.assembly.mass import stated_inertia
from thingc.model.assembly.report import LinkReport
from thingc.model.assembly.types import Connected, Occurrence
from thingc.model.resolve.plausibility import SMALLEST, density_doubt, longest_side, mass_words, measures, unit_meant

_ROOM = 1e-9
"""Relative tolerance for rounding errors."""


def check_stated(robot: Connected, findings: LinkReport) -> list[int]:
    """Report inertias in documents that no rigid body can have. Return the indices of the occurrences with such an inertia.

    Such an inertia is accepted if the inertia of the whole link is physical. Such links are common in URDF files with `fixed` joints. A
    zero inertia is always an error.
    """
    faulty = []
    for index, one in enumerate(robot.occurrences):
        stated = one.overrides.inertia
        if stated is None or stated.computed:
            continue
        inertia = stated_inertia(stated.value)
        fault = physical_fault(inertia)
        if fault is None or inertia != ZERO and physical_fault(robot.links[robot.link_of[index]].properties.inertia) is None:
            continue
        faulty.append(index)
        help = "specify `inertia` relative to the centre of mass, in the axes of the component"
        if inertia == ZERO:
            help = "remove `inertia` to use the computed inertia"
        findings.error(
            Code.NOT_PHYSICAL, f"the inertia of `{one.component.name}` is not physical: {fault}",
            one.component.full_origin(stated.origin, one.origin), path=one.path, help=help,
        )
    return faulty


def check_links(robot: Connected, faulty: Collection[int], findings: LinkReport) -> None:
    """Report each link that can move in a mode but does not have a valid mass and inertia.

    The root of a mode with a `fixed` or `held` base does not move. All other links move. A massless intermediate link (`between` two
    joints) needs a mass only in modes in which it is the root. A link without inertia can be fixed to a heavier link. A link is skipped if
    one of its occurrences is in `faulty`, because its error has been reported. Links of a definition that is used several times are
    reported once.
    """
    reported: set[Span] = set()
    modes, link_of = robot.modes, robot.link_of
    groups = rigid_groups(len(robot.links), link_of, robot.mates)
    still = [groups[link_of[mode.root.occurrence]] if stays(mode.base) else () for mode in modes]
    skip = {link_of[occurrence] for occurrence in faulty}
    for link in robot.links:
        if link.index in skip or not reported.isdisjoint(link.origin[:1]):
            continue
        heaviest = max((robot.links[one] for one in groups[link.index]), key=lambda one: one.properties.mass)
        if heaviest is not link and link.properties.inertia == ZERO:
            continue
        moving = (mode for mode, held in zip(modes, still) if link.index not in held)
        mode = next((one.name for one in moving if link.index not in robot.between or link_of[one.root.occurrence] == link.index), None)
        if mode is None:
            continue
        mass, moments = link.properties.mass, principal_moments(link.properties.inertia)
        fault = moments_fault(*moments) if mass > 0.0 else None
        light = _light(mass, moments[0])
        if light is None and fault is None:
            continue
        reported.update(link.origin[:1])
        members = [robot.occurrences[k] for k in link.members]
        named = f"component{'' if len(members) == 1 else 's'} {quote_names([member.path for member in members], 6)}"
        notes = [Note(message=f"the link contains {named} and moves in mode `{mode}`")]
        if fault is not None:
            code, message = Code.NOT_PHYSICAL, f"the inertia of the moving link `{link.name}` is not physical: {fault}"
            lumps = [one.path.rpartition("/")[0] for one in members if (inertia := one.overrides.inertia) is not None and inertia.computed]
            owner = f"the lump `{lumps[0]}`" if lumps else "the link"
            help = f"add a mass to a component with geometry, or add `inertia:` to a component of {owner}"
        elif mass > 0.0:
            main = max(members, key=lambda one: one.properties.mass)
            code, message, help = Code.TOO_LIGHT, f"the moving link `{link.name}` is too light for MuJoCo: {light}", _cause(main)
            notes = [_size_note(main), *notes]
        else:
            code, message = Code.MASSLESS, f"the moving link `{link.name}` has no mass"
            help = "add `mass:` to a component of the link, or use `attach` instead of a joint"
            notes.append(Note(message="a massless link must be between two joints, and must not be the root of the mode"))
        findings.error(code, message, link.origin, path=link.name, help=help, notes=notes)


def _light(mass: float, least: float) -> str | None:
    """Return the reason why MuJoCo would reject the mass or the smallest principal moment [kg m^2] of a moving link.

    Return None if MuJoCo accepts the values.
    """
    if mass <= LEAST_MASS:
        return f"expected a mass above {mass_words(LEAST_MASS)}, found {mass_words(mass)}"
    if least < LEAST_MOMENT * (1.0 + _ROOM):
        return f"expected moments of inertia of at least {LEAST_MOMENT:g} kg m^2, found {least:.3g}"
    return None


def _size_note(one: Occurrence) -> Note:
    """Return a note with the size and mass of an occurrence: `arm` (`foot.stl`) measures 0.06 x 0.06 x 0.06 mm and weighs 2.7e-07 g."""
    size = f" measures {measures(one.box)} and" if one.box is not None else ""
    return Note(message=f"`{one.path}` (`{one.definition.label}`){size} weighs {mass_words(one.properties.mass)}")


def _cause(one: Occurrence) -> str:
    """Return the likely reason why a link is too light: the unit or density of its heaviest component, otherwise a general hint."""
    record = one.record
    if record is not None and record.box is not None:
        if longest_side(record.box) < SMALLEST:
            return unit_meant(one.component.definition, record.box)
        if density_doubt(one.properties.mass / record.volume) is not None:
            return f"check the density or the mass of `{one.path}`"
    return "check the units of the sizes, `mass` and `inertia` of the link, or use `attach` instead of a joint"
