"""Write the YAML document of an imported robot.

The elements of the document are in the order of the kinematic tree, and the text has the canonical layout. A link becomes a component of
the same name: a `link` if it has shapes, else a `frame`. A fixed link without mass, shapes and children becomes a mount of its parent.
Other documents can attach components to this mount, because the document exports the mount. A joint connects two mounts that have the name
of the joint, or the origins of two components. As in the source, the two frames coincide at q = 0, and the joint has the same `axis`. The
axis of a planar joint is the z axis of the parent's mount. The mount on the child of a planar or ball joint is rotated by `MATE`, because
mated mounts face each other.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from thingc.base.diagnostics import Report
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.pose import MATE, NO_POSE, Pose, Vector, along, shifted
from thingc.base.source import Path, Span
from thingc.documents.format.formatting import format_document
from thingc.tools.importing.document_names import DocumentNaming
from thingc.tools.importing.modes import drive_words, dynamics_words, mode_lines, sensor_lines, tendon_lines, transmission_lines
from thingc.tools.importing.quantities import TURNS, angle, length, lengths, mass, pose_words, quantity, shape_words, was
from thingc.tools.importing.raw import name_lines, quoted, raw_lines
from thingc.tools.importing.source_model import Attachment, SourceJoint, SourceLink, SourceRobot, SourceShape
from thingc.tools.importing.source_places import places_of
from thingc.tools.importing.update_import import PreviousImport

_ALIGNED = 1e-12
ROUNDED = 1e-15
"""Products of inertia below this fraction of the largest moment of inertia are rounding errors."""
FACING = ("planar", "ball", "free")
"""Kinds of joints that do not have a single axis, and whose mounts face each other."""
FRICTION = ("slide", "torsion", "roll")
SAY_THEIR_UNIT = (".dae", ".glb")
UNITS: dict[tuple[float, ...], str] = {(1.0, 1.0, 1.0): "m", (0.01, 0.01, 0.01): "cm", (0.001, 0.001, 0.001): "mm"}
"""Maps scale factors of a mesh to the corresponding unit."""


class WrittenDocument(FrozenStruct):
    """A document that was generated for an imported robot.

    `names` maps the kind and the source name of each element to the name in the document.
    `places` maps key paths of the document to elements of the source.
    """

    name: str
    text: str
    names: Mapping[str, Mapping[str, str]]
    places: Mapping[Path, Span]


class DocumentWriter(DocumentNaming):
    """Writes the document of an imported robot. The document has the mode `source` and one mode for each link in `roots`.

    With `keep`, links that are fixed to another link are separate bodies in simulators.
    The first line of the document contains the name of the source, `origin`. `repaired` maps the names of repaired links to the repair
    method. `meshes` maps mesh URIs to files. Other meshes are omitted. Elements keep their names from an `earlier` import.
    """

    def __init__(
        self, robot: SourceRobot, roots: Sequence[str], origin: str, repaired: Mapping[str, str], meshes: Mapping[str, str],
        earlier: PreviousImport | None, *, keep: bool,
    ) -> None:
        super().__init__(robot, meshes, earlier)
        self.roots, self.origin, self.repaired, self.keep = roots, origin, repaired, keep

    def written(self) -> WrittenDocument:
        """Return the generated document in canonical layout."""
        text = "\n".join((
            f"# From {self.origin}. Losses are listed in import.json.", "thingc: assembly/1", f"name: {self.name}", "",
            *self._components(), "", *self._joints(), *tendon_lines(self), *transmission_lines(self),
            *self._shown(), *mode_lines(self, self.roots), *sensor_lines(self), *name_lines(self), *raw_lines(self), "",
        ))
        report = Report()
        formatted = format_document(f"{self.name}.yaml", text.encode(), report)
        assert formatted is not None, report.diagnostics
        names = {"links": self.links, "frames": self.frames, "joints": self.joints, **self.others()}
        return WrittenDocument(name=self.name, text=formatted.decode(), names=names, places=places_of(self))

    def _components(self) -> Iterator[str]:
        yield "components:"
        for name in self.links:
            link, above = self.link_of[name], self.above.get(name)
            yield f"  {self.links[name]}:{was(self.links[name], name)}"
            shapes = [*self._shapes(link)]
            yield "    link: true" if shapes else "    frame: true"
            if name not in self.points:
                yield from self._weight(link, shapes=bool(shapes))
            if shapes:
                yield "    shapes:"
                yield from shapes
            if above is not None and not above.joints:
                yield f"    at: {{in: {self.links[above.parent]}.origin{pose_words(above.pose, above.rpy, before=', ')}}}"
                yield from ["    keep: true"] if self.keep else []
            mounts = [*self._mounts(name)]
            if mounts:
                yield "    mounts:"
                yield from (f"      {word}: {{{pose}}}{comment}" for word, pose, comment in mounts)
            if name in self.points:  # without an inertia, thingc would distribute the mass of a link over its shapes
                yield f"  {self.points[name]}:  # the mass of the link, which has no inertia in the source"
                yield "    frame: true"
                yield from self._weight(link)
                yield f"    at: {{in: {self.links[name]}.origin}}"

    def _weight(self, link: SourceLink, *, shapes: bool = False) -> Iterator[str]:
        """Yield the lines of the mass properties of a link.

        For a link with shapes, the lines always include `com`, because the default of `com` is the centre of the shapes.
        """
        if link.weight is None:
            return
        of = link.weight.properties
        mended = link.name in self.repaired
        if mended:
            yield f"    # repaired ({self.repaired[link.name]}): the original values are in import.json"
        yield f"    mass: {mass(of.mass)}"
        if shapes or any(of.centre):
            yield f"    com: {lengths(of.centre)}"
        i = of.inertia
        if any(map(any, i)):
            products = {"ixy": i[0][1], "ixz": i[0][2], "iyz": i[1][2]}
            moments = {"ixx": i[0][0], "iyy": i[1][1], "izz": i[2][2]}
            least = ROUNDED * max(map(abs, moments.values()))
            moments |= {key: value for key, value in products.items() if abs(value) > least}
            said = {key: quantity(value, "kg*m^2") for key, value in moments.items()}
            yield from _mapping("inertia", {"value": f"{{{_entries(said)}}}", "source": "repaired"} if mended else said)

    def _shapes(self, link: SourceLink) -> Iterator[str]:
        """Yield the lines of the key `shapes` of a link. A visual shape and an equal collision shape become one item."""
        for shape, touch in self.items(link):
            said = [self._geometry(shape), *([f"at: {{{pose}}}"] if (pose := pose_words(shape.pose, shape.rpy)) else [])]
            said += [] if shape.use == "visual" and touch is not None else [f"for: {shape.use}"]
            if shape.color is not None:
                said.append('color: "#{:02x}{:02x}{:02x}"'.format(*(round(255.0 * min(max(one, 0.0), 1.0)) for one in shape.color[:3])))
            if touch is not None and touch.friction:
                words = (f"{key}: {quantity(one, '')}" for key, one in zip(FRICTION, touch.friction, strict=False))
                said.append(f"friction: {{{', '.join(words)}}}")
            name = self.title(touch or shape)
            said += [] if name is None else [f"name: {quoted(name)}"]
            yield f"      - {{{', '.join(said)}}}"

    def _geometry(self, shape: SourceShape) -> str:
        if shape.kind != "mesh":
            return shape_words(shape.kind, shape.size)
        path = self.meshes[shape.mesh or ""]
        unit = None if path.endswith(SAY_THEIR_UNIT) else UNITS.get(shape.size)
        if unit is None:
            factors = "" if shape.size == (1.0, 1.0, 1.0) else f", scale: [{', '.join(quantity(one, '') for one in shape.size)}]"
            return f"mesh: {path}{'' if path.endswith(SAY_THEIR_UNIT) else ', unit: m'}{factors}"
        return f"mesh: {path}, unit: {unit}"

    def _mounts(self, name: str) -> Iterator[tuple[str, str, str]]:
        """Yield the name, the pose and the comment of each mount of a link.

        The mounts belong to joints, to links that become mounts, and to sites, loops and adhesions. A camera, or a shape around which a
        tendon wraps, gets a mount unless a mount with the same pose exists.
        """
        above = self.above.get(name)
        for joint in above.joints if above is not None else ():
            if child := _child_mount(joint):
                yield self.mounts[joint.name], child, ""
        for one in self.below.get(name, ()):
            if one.child in self.frames:
                yield self.frames[one.child], pose_words(one.pose, one.rpy), was(self.frames[one.child], one.child)
            for joint in one.joints:
                if parent := _parent_mount(one, joint):
                    yield self.mounts[joint.name], parent, ""
        for site in self.link_of[name].sites:
            yield self.sites[site.name], pose_words(site.pose), was(self.sites[site.name], site.name)
        for loop in self.robot.loops:
            for (link, pose), flip in zip(loop.ends, (NO_POSE, MATE), strict=True):
                if link == name:
                    yield self.ends[self.loops[loop.name]], pose_words(pose @ flip), ""
        for magnet in self.robot.adhesions:
            if magnet.link == name:
                yield self.magnets[magnet.name], "", was(self.magnets[magnet.name], magnet.name)
        around = {step.around.name: step.around for tendon in self.robot.tendons for step in tendon.steps if step.around is not None}
        for shape in around.values():
            if shape.link == name and self.centres[shape.name] not in self.shown:
                yield self.centres[shape.name], pose_words(shape.pose), ""
        for camera in self.robot.sensors:
            if camera.link == name and self.cameras[camera.name] not in self.shown:
                yield self.cameras[camera.name], pose_words(camera.pose), ""

    def _joints(self) -> Iterator[str]:
        moving = [(one, joint) for one in self.order for joint in one.joints]
        if moving or self.loops:
            yield "joints:"
        for one, joint in moving:
            mount = self.mounts[joint.name]
            yield f"  {self.joints[joint.name]}:{was(self.joints[joint.name], joint.name)}"
            yield f"    type: {joint.kind}"
            yield f"    parent: {self.links[one.parent]}.{mount if _parent_mount(one, joint) else 'origin'}"
            yield f"    child: {self.links[one.child]}.{mount if _child_mount(joint) else 'origin'}"
            if joint.kind not in FACING:
                yield f"    axis: [{', '.join(quantity(value, '') for value in _clean(joint.axis))}]"
            if joint.lead:
                yield f"    lead: {length(joint.lead)}"
            yield from self._motion(joint)
        for loop in self.robot.loops:
            (parent, _), (child, _) = loop.ends
            word = self.loops[loop.name]
            yield f"  {word}:{was(word, loop.name)}"
            yield f"    type: {loop.kind}"
            yield f"    parent: {self.links[parent]}.{self.ends[word]}"
            yield f"    child: {self.links[child]}.{self.ends[word]}"
            yield "    loop: true"
        if moving or self.loops:
            yield ""

    def _motion(self, joint: SourceJoint) -> Iterator[str]:
        turns, of = joint.kind in TURNS, joint.ends
        force, speed = ("N*m", "rad/s") if turns else ("N", "m/s")
        place = angle if turns else length
        driven = joint.drive is not None and joint.name not in self.geared
        limit: dict[str, str | None] = {
            **({} if of.lower is None or of.upper is None else {"lower": place(of.lower), "upper": place(of.upper)}),
            "cone": angle(of.upper) if joint.kind == "ball" and of.upper is not None else None,
            "effort": None if not of.effort or driven else quantity(of.effort, force),
            "velocity": None if of.velocity in (None, joint.drive and joint.drive.velocity) else quantity(of.velocity, speed),
        }
        if joint.start:
            yield f"    offset: {place(-joint.start)}"
        if of.made_up:
            yield "    allow: {TC517: the joint has no limits in the source}"
        yield from _mapping("limit", {key: value for key, value in limit.items() if value is not None})
        yield from _mapping("dynamics", dynamics_words(joint, turns))
        if joint.follows is not None:
            leader = next(other for one in self.order for other in one.joints if other.name == joint.follows.joint)
            mine, other = ("rad" if one in TURNS else "m" for one in (joint.kind, leader.kind))
            follows = {"joint": self.joints[leader.name]}
            if joint.follows.polynomial:
                coefficients = list(joint.follows.polynomial)
                while not coefficients[-1]:
                    coefficients.pop()
                words = (quantity(value, _unit(mine, other, power)) for power, value in enumerate(coefficients))
                follows["polynomial"] = f"[{', '.join(words)}]"
            else:
                follows["multiplier"] = f"{quantity(joint.follows.multiplier, '')} {_unit(mine, other, 1)}".rstrip()
            offset = joint.follows.offset if not joint.follows.polynomial else 0.0
            yield from _mapping("mimic", follows | ({"offset": place(offset)} if offset else {}))
        if joint.drive is not None and driven:
            yield from _mapping("drive", drive_words(joint.drive, turns))

    def _shown(self) -> Iterator[str]:
        """Yield the lines of the section `mounts`, which lists the mounts that the document exports."""
        if self.frames or self.sites:
            yield "mounts:"
            yield from (f"  {word}: {self.links[self.above[name].parent]}.{word}" for name, word in self.frames.items())
            for link in self.robot.links:
                yield from (f"  {self.sites[site.name]}: {self.links[link.name]}.{self.sites[site.name]}" for site in link.sites)
            yield ""


def _unit(mine: str, other: str, power: int) -> str:
    """Return the unit of a coefficient of the polynomial that couples two joints.

    The result is the unit of the coupled joint, divided by a power of the unit of the other joint.
    """
    if mine == other:
        return {0: mine, 1: ""}.get(power, f"{mine}^-{power - 1}")
    return {0: mine, 1: f"{mine}/{other}"}.get(power, f"{mine}/{other}^{power}")


def _mapping(key: str, values: Mapping[str, str]) -> Iterator[str]:
    if values:
        yield f"    {key}: {{{_entries(values)}}}"


def _entries(values: Mapping[str, str]) -> str:
    return ", ".join(f"{name}: {value}" for name, value in values.items())


def _parent_mount(one: Attachment, joint: SourceJoint) -> str:
    """Format the pose of the mount on the parent link to which a joint is attached."""
    onto = _onto(joint)
    return pose_words(one.pose @ shifted(*joint.anchor) @ onto, one.rpy if onto == NO_POSE else None)


def _child_mount(joint: SourceJoint) -> str:
    """Format the pose of the mount on the child link to which a joint is attached."""
    return pose_words(shifted(*joint.anchor) @ _onto(joint) @ (MATE if joint.kind in FACING else NO_POSE))


def _onto(joint: SourceJoint) -> Pose:
    """Return the rotation that maps the z axis to the axis of a planar joint. For other joints, return the identity."""
    axis = _clean(joint.axis)
    return NO_POSE if joint.kind != "planar" or axis == (0.0, 0.0, 1.0) else along(axis, (0.0, 0.0, 0.0))


def _clean(axis: Vector) -> Vector:
    """Round a unit vector that is almost parallel to a coordinate axis, so that the result is exactly parallel."""
    x, y, z = (0.0 if abs(one) < _ALIGNED else one for one in axis)
    if sum(map(bool, (x, y, z))) == 1:
        x, y, z = (math.copysign(1.0, one) if one else 0.0 for one in (x, y, z))
    return (x, y, z)
