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
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence

from thingc.base.diagnostics import Report
from thingc.base.joints.twist import SLIDE, TURN
from thingc.base.pose import MATE, NO_POSE, Pose, Vector, along, make_translation
from thingc.base.source import Path, Span
from thingc.base.units import ANGLE, LENGTH
from thingc.documents.format.formatting import format_document
from thingc.tools.importing.document_names import DocumentNaming
from thingc.tools.importing.modes import drive_words, dynamics_words, mode_sections, sensor_lines, tendon_lines, transmission_lines
from thingc.tools.importing.quantities import TURNS, angle, flow, length, lengths, mass, pose_words, quantity, shape_words, si_unit, was
from thingc.tools.importing.raw import name_lines, quote, raw_lines
from thingc.tools.importing.source_model import Attachment, SourceJoint, SourceLink, SourceRobot, SourceShape
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

    def text(self) -> str:
        """Return the text of the generated document in canonical layout."""
        sections = {
            "components": self._components(), "joints": self._joints(), "tendons": tendon_lines(self),
            "transmissions": transmission_lines(self), "mounts": self._mount_lines(), **mode_sections(self, self.roots),
            "sensors": sensor_lines(self), "names": name_lines(self), "raw": raw_lines(self),
        }
        head = f"# From {self.origin}. Losses are listed in import.json.\nthingc: assembly/1\nname: {self.name}\n"
        texts = ["\n".join((f"{key}:", *lines, "")) for key, section in sections.items() if (lines := [*section])]
        report = Report()
        formatted = format_document(f"{self.name}.yaml", "\n".join((head, *texts)).encode(), report)
        assert formatted is not None, report.diagnostics
        return formatted.decode()

    def _components(self) -> Iterator[str]:
        mounts = self._mounts()
        for name in self.links:
            link, above, path = self.link_of[name], self.above.get(name), ("components", self.links[name])
            yield self.entry(*path, link)
            shapes = [*self._shapes(link, path)]
            yield "    link: true" if shapes else "    frame: true"
            if name not in self.points:
                yield from self._weight(link, path, shapes=bool(shapes))
            if shapes:
                yield "    shapes:"
                yield from shapes
            if above is not None and not above.joints:
                self.places[(*path, "at")] = above.where
                yield f"    at: {{in: {self.links[above.parent]}.origin{pose_words(above.pose, above.rpy, before=', ')}}}"
                yield from ["    keep: true"] if self.keep else []
            if mounts[name]:
                yield "    mounts:"
                yield from (f"      {mount}: {{{pose}}}{comment}" for mount, pose, comment, _ in mounts[name])
                self.places |= {(*path, "mounts", mount): where for mount, _, _, where in mounts[name] if where is not None}
            if name in self.points:  # without an inertia, thingc would distribute the mass of a link over its shapes
                yield f"  {self.points[name]}:  # the mass of the link, which has no inertia in the source"
                yield "    frame: true"
                yield from self._weight(link, ("components", self.points[name]))
                yield f"    at: {{in: {self.links[name]}.origin}}"

    def _weight(self, link: SourceLink, path: Path, *, shapes: bool = False) -> Iterator[str]:
        """Yield the lines of the mass properties of a link, which are at a path of the document.

        For a link with shapes, the lines always include `com`, because the default of `com` is the centre of the shapes.
        """
        if link.weight is None:
            return
        of = link.weight.properties
        self.places.setdefault(path, link.weight.where)
        self.places |= {(*path, key): link.weight.where for key in ("mass", "com", "inertia")}
        is_repaired = link.name in self.repaired
        if is_repaired:
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
            items = {key: quantity(value, "kg*m^2") for key, value in moments.items()}
            yield from _mapping("inertia", {"value": flow(items), "source": "repaired"} if is_repaired else items)

    def _shapes(self, link: SourceLink, path: Path) -> Iterator[str]:
        """Yield the lines of the key `shapes` of a link. A visual shape and an equal collision shape become one item."""
        for number, (shape, touch) in enumerate(self.items(link)):
            self.places[(*path, "shapes", number)] = shape.where
            items = [self._geometry(shape), *([f"at: {{{pose}}}"] if (pose := pose_words(shape.pose, shape.rpy)) else [])]
            items += [] if shape.use == "visual" and touch is not None else [f"for: {shape.use}"]
            if shape.color is not None:
                items.append('color: "#{:02x}{:02x}{:02x}"'.format(*(round(255.0 * min(max(c, 0.0), 1.0)) for c in shape.color[:3])))
            if touch is not None and touch.friction:
                friction = {key: quantity(value, "") for key, value in zip(FRICTION, touch.friction, strict=False)}
                items.append(f"friction: {flow(friction)}")
            name = self.title(touch or shape)
            items += [] if name is None else [f"name: {quote(name)}"]
            yield f"      - {{{', '.join(items)}}}"

    def _geometry(self, shape: SourceShape) -> str:
        if shape.kind != "mesh":
            return shape_words(shape.kind, shape.size)
        path = self.meshes[shape.mesh or ""]
        unit = None if path.endswith(SAY_THEIR_UNIT) else UNITS.get(shape.size)
        if unit is None:
            factors = "" if shape.size == (1.0, 1.0, 1.0) else f", scale: [{', '.join(quantity(factor, '') for factor in shape.size)}]"
            return f"mesh: {path}{'' if path.endswith(SAY_THEIR_UNIT) else ', unit: m'}{factors}"
        return f"mesh: {path}, unit: {unit}"

    def _mounts(self) -> Mapping[str, list[tuple[str, str, str, Span | None]]]:
        """Return the name, the pose, the comment and the source location of each mount, by link.

        The mounts belong to joints, to links that become mounts, and to sites, loops and adhesions. A camera, or a shape around which a
        tendon wraps, gets a mount unless a mount with the same pose exists.
        """
        mounts: defaultdict[str, list[tuple[str, str, str, Span | None]]] = defaultdict(list)
        for name in self.links:
            above, on = self.above.get(name), mounts[name]
            for joint in above.joints if above is not None else ():
                if child := _child_mount(joint):
                    on.append((self.mounts[joint.name], child, "", joint.where))
            for one in self.below.get(name, ()):
                if one.child in self.frames:
                    on.append((self.frames[one.child], pose_words(one.pose, one.rpy), was(self.frames[one.child], one.child), one.where))
                for joint in one.joints:
                    if parent := _parent_mount(one, joint):
                        on.append((self.mounts[joint.name], parent, "", joint.where))
            for site in self.link_of[name].sites:
                on.append((self.sites[site.name], pose_words(site.pose), was(self.sites[site.name], site.name), site.where))
        for loop in self.robot.loops:
            for (link, pose), flip in zip(loop.ends, (NO_POSE, MATE), strict=True):
                mounts[link].append((self.ends[self.loops[loop.name]], pose_words(pose @ flip), "", loop.where))
        for magnet in self.robot.adhesions:
            mounts[magnet.link].append((self.magnets[magnet.name], "", was(self.magnets[magnet.name], magnet.name), magnet.where))
        around = {step.around.name: step.around for tendon in self.robot.tendons for step in tendon.steps if step.around is not None}
        for shape in around.values():
            if self.centres[shape.name] not in self.shown:
                mounts[shape.link].append((self.centres[shape.name], pose_words(shape.pose), "", None))
        for camera in self.robot.sensors:
            if camera.link is not None and self.cameras[camera.name] not in self.shown:
                mounts[camera.link].append((self.cameras[camera.name], pose_words(camera.pose), "", None))
        return mounts

    def _joints(self) -> Iterator[str]:
        attached = [(one, joint) for one in self.order for joint in one.joints]
        for one, joint in attached:
            mount = self.mounts[joint.name]
            yield self.entry("joints", self.joints[joint.name], joint)
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
            name_of_joint = self.loops[loop.name]
            yield self.entry("joints", name_of_joint, loop)
            yield f"    type: {loop.kind}"
            yield f"    parent: {self.links[parent]}.{self.ends[name_of_joint]}"
            yield f"    child: {self.links[child]}.{self.ends[name_of_joint]}"
            yield "    loop: true"

    def _motion(self, joint: SourceJoint) -> Iterator[str]:
        turns, of = joint.kind in TURNS, joint.ends
        units, place = (TURN, angle) if turns else (SLIDE, length)
        force, speed = (si_unit(units[key]) for key in ("effort", "velocity"))
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
            self.places["joints", self.joints[joint.name], "mimic"] = joint.follows.where
            own, other = (ANGLE if name in self.turning else LENGTH for name in (joint.name, joint.follows.joint))
            follows = {"joint": self.joints[joint.follows.joint]}
            coefficients = list(joint.follows.coefficients)
            if any(coefficients[2:]):
                while not coefficients[-1]:
                    coefficients.pop()
                words = (quantity(value, si_unit(own / other**power)) for power, value in enumerate(coefficients))
                follows["polynomial"] = f"[{', '.join(words)}]"
            else:
                follows["multiplier"] = f"{quantity(coefficients[1], '')} {si_unit(own / other)}".rstrip()
                follows |= {"offset": place(coefficients[0])} if coefficients[0] else {}
            yield from _mapping("mimic", follows)
        if joint.drive is not None:
            self.places["joints", self.joints[joint.name], "drive"] = joint.drive.where
        if joint.drive is not None and driven:
            yield from _mapping("drive", drive_words(joint.drive, turns))

    def _mount_lines(self) -> Iterator[str]:
        """Yield the lines of the section `mounts`, which lists the mounts that the document exports."""
        frames = [(self.above[name].parent, name_of_mount, self.link_of[name]) for name, name_of_mount in self.frames.items()]
        sites = [(link.name, self.sites[site.name], site) for link in self.robot.links for site in link.sites]
        for link, name_of_mount, thing in (*frames, *sites):
            self.places["mounts", name_of_mount] = thing.where
            yield f"  {name_of_mount}: {self.links[link]}.{name_of_mount}"


def _mapping(key: str, values: Mapping[str, str]) -> Iterator[str]:
    if values:
        yield f"    {key}: {flow(values)}"


def _parent_mount(one: Attachment, joint: SourceJoint) -> str:
    """Format the pose of the mount on the parent link to which a joint is attached."""
    onto = _onto(joint)
    return pose_words(one.pose @ make_translation(*joint.anchor) @ onto, one.rpy if onto == NO_POSE else None)


def _child_mount(joint: SourceJoint) -> str:
    """Format the pose of the mount on the child link to which a joint is attached."""
    return pose_words(make_translation(*joint.anchor) @ _onto(joint) @ (MATE if joint.kind in FACING else NO_POSE))


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
