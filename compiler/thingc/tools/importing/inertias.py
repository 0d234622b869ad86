"""Check that the inertias of an imported robot are physically possible, and repair invalid inertias.

Links that are rigidly connected form one body, and the total inertia of the body is checked. Invalid inertias are errors unless a repair
method is given. This method is applied to the links of an invalid body. The method `nearest` computes the nearest physically possible
inertia for the same mass. The method `shapes` computes the inertia from the shapes of the link.

The method `nearest` raises the eigenvalues of the pseudo-inertia about the centre of mass to a lower bound. The pseudo-inertia is `diag(S,
m)` with the second moments of mass `S = tr(I)/2 1 - I`. The result is the nearest in the Frobenius norm (Wensing, Kim and Slotine, "Linear
Matrix Inequalities for Physically-Consistent Inertial Parameter Identification", 2018, equation 17).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

from msgspec.structs import replace

from thingc.base.diagnostics import Code, Note, Report
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.inertia import LEAST_MASS, LEAST_MOMENT, ZERO, MassProperties, physical_fault, principal_axes, principal_moments, total
from thingc.base.pose import NO_POSE, Matrix, Pose, multiply, transpose
from thingc.base.primitives import Primitive
from thingc.tools.importing.import_request import Repair
from thingc.tools.importing.source_model import SourceLink, SourceRobot, SourceShape, Weight
from thingc.tools.importing.tree import by_parent

Matter = Callable[[SourceShape], MassProperties | None]
"""Function that computes the mass properties of the mesh of a shape at density 1, in the frame of the mesh.

The function returns None if the mesh is not closed or cannot be read.
"""
LEAST = 1e-6
"""Mass [kg] that a repair gives to massless links. The same number is used as the square [m^2] of the minimum radius of gyration, 1 mm."""


class RepairedLink(FrozenStruct):
    """A link whose mass properties were repaired, with the new mass properties and the repair method."""

    link: SourceLink
    new: MassProperties
    how: Repair


def repair_inertias(
    robot: SourceRobot, roots: Sequence[str], method: Repair | None, report: Report, matter: Matter,
) -> tuple[SourceRobot, tuple[RepairedLink, ...]]:
    """Repair the invalid inertias of an imported robot. Return the robot and the links that were repaired.

    The function checks the bodies in the mode `source` and in one mode for each link in `roots`. If `method` is None, or if this method
    cannot repair an inertia, the function reports an error. The function `matter` computes the mass properties of a shape's mesh.
    """
    between = _intermediate_links(robot)
    bodies, repaired_links = _bodies(robot), dict[str, RepairedLink]()
    head = {link.name: body for body, members in bodies.items() for link, _ in members}
    fixed_bodies = {None if robot.base == "free" else robot.root, *(head[name] for name in roots)}
    for body, members in bodies.items():
        if body in between:
            continue
        find_fault = _find_fault if fixed_bodies == {body} else _fault
        fault = find_fault(members)
        if fault is None:
            continue
        worst = [link for link, _ in members if link.weight is not None and physical_fault(link.weight.properties.inertia) is not None]
        worst = worst or [members[0][0]]
        changed = [one for link in worst if (one := _repair(link, method, matter)) is not None]
        new = {one.link.name: _repaired_link(one) for one in changed}
        if method is not None and find_fault([(new.get(link.name, link), pose) for link, pose in members]) is None:
            repaired_links.update((one.link.name, one) for one in changed)
        else:
            kind = "fixed" if fixed_bodies == {body} else "moving"
            _refuse(f"the inertia of the {kind} link `{body}` is invalid: {fault}", worst, [link for link, _ in members], method, report)
    links = tuple(_repaired_link(repaired_links[link.name]) if link.name in repaired_links else link for link in robot.links)
    return replace(robot, links=links), tuple(repaired_links.values())


def _bodies(robot: SourceRobot) -> Mapping[str, list[tuple[SourceLink, Pose]]]:
    """Group the links into rigid bodies.

    Return the links of each body and their poses in the frame of the first link, keyed by the name of the first link.
    """
    links, below = {link.name: link for link in robot.links}, by_parent(robot.attachments)
    bodies: dict[str, list[tuple[SourceLink, Pose]]] = {robot.root: [(links[robot.root], NO_POSE)]}
    waiting = [(robot.root, robot.root, NO_POSE)]
    while waiting:
        body, name, pose = waiting.pop()
        for attachment in below.get(name, ()):
            first, place = (attachment.child, NO_POSE) if attachment.joints else (body, pose @ attachment.pose)
            bodies.setdefault(first, []).append((links[attachment.child], place))
            waiting.append((first, attachment.child, place))
    return bodies


def _intermediate_links(robot: SourceRobot) -> set[str]:
    """Return the names of the massless intermediate links, which only connect two joints."""
    links, below = {link.name: link for link in robot.links}, by_parent(robot.attachments)
    return {
        one.child for one in robot.attachments
        if one.joints and links[one.child].is_bare and [bool(other.joints) for other in below.get(one.child, ())] == [True]
    }


def _fault(members: Sequence[tuple[SourceLink, Pose]]) -> str | None:
    """Return the reason why simulators reject the inertia of a moving body, or None if the inertia is valid."""
    body = _whole(members)
    if body.mass <= LEAST_MASS:
        return "the mass is 0"
    moments = principal_moments(body.inertia)
    if moments[0] <= 0.0 and max(map(abs, moments)) == 0.0:
        return "all moments of inertia are 0"
    fault = physical_fault(body.inertia)
    if fault is None and moments[0] < LEAST_MOMENT:
        return f"the smallest moment ({moments[0]:.3g} kg m^2) is below the minimum of simulators ({LEAST_MOMENT:g} kg m^2)"
    return fault


def _find_fault(members: Sequence[tuple[SourceLink, Pose]]) -> str | None:
    """Return the reason why the inertia of a fixed body is invalid, or None if the inertia is valid or not specified."""
    inertias = [link.weight.properties.inertia for link, _ in members if link.weight is not None]
    if all(one == ZERO or physical_fault(one) is None for one in inertias):
        return None
    return physical_fault(_whole(members).inertia)


def _whole(members: Sequence[tuple[SourceLink, Pose]]) -> MassProperties:
    return total([link.weight.properties.seen_from(pose) for link, pose in members if link.weight is not None])


def _refuse(message: str, worst: Sequence[SourceLink], members: Sequence[SourceLink], method: Repair | None, report: Report) -> None:
    first = worst[0]
    where = first.where if first.weight is None else first.weight.where
    help = {
        None: "correct the inertia, or use `--repair inertia=nearest` or `--repair inertia=shapes`",
        "shapes": "use `--repair inertia=nearest` for links without closed shapes",
        "nearest": "write the mass and the inertia of the links into the file",
    }[method]
    notes = [
        Note(
            message=f"`{link.name}` is fixed to the link{' and also has an invalid inertia' if link in worst else ''}",
            span=link.where,
        )
        for link in members if link is not first and link.weight is not None
    ][:5]
    report.add(Code.SOURCE_INERTIA, message, where, help=help, notes=notes)


def _repaired_link(repaired: RepairedLink) -> SourceLink:
    where = repaired.link.where if repaired.link.weight is None else repaired.link.weight.where
    return replace(repaired.link, weight=Weight(properties=repaired.new, where=where))


def _repair(link: SourceLink, method: Repair | None, matter: Matter) -> RepairedLink | None:
    """Repair the inertia of a link. Return None if the method cannot repair the inertia."""
    old = MassProperties(mass=0.0) if link.weight is None else link.weight.properties
    if method is None:
        return None
    if method == "shapes":
        solid = _solid(link.shapes, matter)
        return None if solid is None or old.mass <= 0.0 else RepairedLink(link=link, new=solid.with_mass(old.mass), how=method)
    mass = old.mass if old.mass > LEAST_MASS else LEAST
    return RepairedLink(link=link, new=replace(old, mass=mass, inertia=nearest(old.inertia, mass)), how=method)


def nearest(inertia: Matrix, mass: float) -> Matrix:
    """Return the physically possible inertia [kg m^2] about the centre of mass that is nearest to `inertia`. `mass` is in kilograms.

    The radii of gyration are at least 1 mm, and the moments are large enough for simulators.
    """
    moments, axes = principal_axes(inertia)
    half = (moments[0] + moments[1] + moments[2]) / 2.0
    second = [max(half - moment, mass * LEAST, LEAST_MOMENT) for moment in moments]
    trace = math.fsum(second)
    a, b, c = (trace - one for one in second)
    return multiply(multiply(axes, ((a, 0.0, 0.0), (0.0, b, 0.0), (0.0, 0.0, c))), transpose(axes))


def _solid(shapes: Sequence[SourceShape], matter: Matter) -> MassProperties | None:
    """Compute the mass properties of shapes at density 1. Return None if the volume of a shape is unknown.

    If there are collision shapes, the visual shapes are ignored.
    """
    chosen = [shape for shape in shapes if shape.use == "collision"] or list(shapes)
    bodies = [one for shape in chosen if (one := _volume(shape, matter)) is not None]
    return total(bodies) if bodies and len(bodies) == len(chosen) else None


def _volume(shape: SourceShape, matter: Matter) -> MassProperties | None:
    """Compute the mass properties of a shape at density 1, in the frame of the link.

    Return None for a mesh that is not closed or cannot be read.
    """
    if shape.kind != "mesh":
        return Primitive(shape=shape.kind, size=shape.size, pose=shape.pose).matter
    mesh_matter = matter(shape)
    return None if mesh_matter is None else mesh_matter.seen_from(shape.pose)


_MIRRORED = (("left", "right"), ("Left", "Right"), ("LEFT", "RIGHT"))
_ALIKE = 0.01


def warn_of_mirror_pairs(robot: SourceRobot, report: Report) -> None:
    """Warn about each pair of left and right links, matched by name, whose masses or moments of inertia differ by more than 1 %."""
    links = {link.name: link for link in robot.links}
    for link in robot.links:
        for left, right in _MIRRORED:
            other = links.get(link.name.replace(left, right)) if left in link.name else None
            if other is None or link.weight is None or other.weight is None:
                continue
            ours, theirs = link.weight.properties, other.weight.properties
            quantity = "masses" if _differ([ours.mass], [theirs.mass]) else "moments of inertia" if _differ(
                principal_moments(ours.inertia), principal_moments(theirs.inertia),
            ) else None
            if quantity is not None:
                report.warn(
                    Code.SOURCE_DOUBT, f"`{link.name}` and `{other.name}` have different {quantity}", other.weight.where,
                    notes=[Note(message=f"`{link.name}` is defined here", span=link.weight.where)],
                    help="correct one of the links, if the links are mirror images",
                )


def _differ(ours: Sequence[float], theirs: Sequence[float]) -> bool:
    scale = max(map(abs, [*ours, *theirs]))
    return any(abs(a - b) > _ALIKE * scale for a, b in zip(ours, theirs, strict=True))
