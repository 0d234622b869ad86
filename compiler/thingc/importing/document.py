"""The document of a robot that was read: short, in the order of the tree, in canonical layout.

A link is a component of its name: a `link` with its shapes, or a `frame` where it has none. One that weighs nothing, shows nothing and
carries nothing is a mount of the component that it is fixed to, exported by its name, so that a document around this one can put something
there. A joint stands between two mounts of its name: the parent's z is its axis, and the child's is turned so that frame lies on frame
(`MATE`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from thingc.diagnostics import Report
from thingc.frozen import dataclass
from thingc.importing.model import Hanging, SourceJoint, SourceLink, SourceLoss, SourceRobot, SourceShape
from thingc.importing.naming import distinct, plain_name
from thingc.importing.quantities import angle, angles, ends, length, lengths, mass, quantity
from thingc.layout import format_document
from thingc.pose import IDENTITY, MATE, Matrix, Pose, Vector, along, rpy_of, shifted

TURNS = ("revolute", "continuous")
_ALIGNED = 1e-12
SAY_THEIR_UNIT = (".dae", ".glb", ".gltf")
UNITS: dict[tuple[float, ...], str] = {(1.0, 1.0, 1.0): "m", (0.01, 0.01, 0.01): "cm", (0.001, 0.001, 0.001): "mm"}
"""Scales of a mesh, whose numbers a source takes for metres, that are a unit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Draft:
    """A document: its name (and file `NAME.yaml`), text, what links, joints and frames of the source are called in it, and losses."""

    name: str
    text: str
    links: Mapping[str, str]
    frames: Mapping[str, str]
    joints: Mapping[str, str]
    losses: tuple[SourceLoss, ...]


def document_of(
    robot: SourceRobot, roots: Sequence[str], origin: str, repaired: Mapping[str, str], meshes: Mapping[str, str],
) -> Draft:
    """The document of a robot, with a mode `source` and one for each link of `roots`, which are links of it; `origin` says where it is
    from, in its first line, `repaired` how the weight of some links was changed, and `meshes` where the files are that shapes name: those
    that are not there are left out."""
    return _Document(robot, roots, origin, repaired, meshes).written()


class _Document:
    def __init__(
        self, robot: SourceRobot, roots: Sequence[str], origin: str, repaired: Mapping[str, str], meshes: Mapping[str, str],
    ) -> None:
        self.robot, self.roots, self.origin, self.repaired, self.meshes = robot, roots, origin, repaired, meshes
        self.name = plain_name(robot.name, "robot")
        self.link_of = {link.name: link for link in robot.links}
        self.below: dict[str, list[Hanging]] = {}
        for one in robot.hangings:
            self.below.setdefault(one.parent, []).append(one)
        self.order = tuple(self._order())
        self.above = {one.child: one for one in self.order}
        mounts = [one.child for one in self.order if self._is_mount(one)]
        names = distinct([robot.root, *(one.child for one in self.order)], "link")
        self.links = {name: word for name, word in names.items() if name not in mounts}
        self.frames = {name: names[name] for name in mounts}
        points = [
            link.name for link in robot.links
            if link.weight is not None and not any(map(any, link.weight.properties.inertia)) and any(map(self._is_shown, link.shapes))
        ]
        self.points = {
            name: distinct([f"{self.links[name]}_mass"], "link", taken=names.values())[f"{self.links[name]}_mass"] for name in points
        }
        moving = [joint.name for one in self.order for joint in one.joints]
        self.joints = distinct(moving, "joint")
        # Mounts of joints lie beside those that are shown, and may not be called like one of them.
        self.mounts = distinct(moving, "joint", taken=self.frames.values())

    def _order(self) -> Iterator[Hanging]:
        """The tree from the root on, each branch to its end, as the source has them."""
        waiting = [*reversed(self.below.get(self.robot.root, ()))]
        while waiting:
            one = waiting.pop()
            yield one
            waiting += reversed(self.below.get(one.child, ()))

    def _is_mount(self, one: Hanging) -> bool:
        link = self.link_of[one.child]
        return not (one.joints or link.weight or link.shapes or one.child in self.below)

    def written(self) -> Draft:
        """The text in canonical layout."""
        text = "\n".join((
            f"# From {self.origin}. What is not in it is listed in import.json.", "thingc: assembly/1", f"name: {self.name}", "",
            *self._components(), "", *self._joints(), *self._shown(), *self._modes(), "",
        ))
        report = Report()
        formatted = format_document(f"{self.name}.yaml", text.encode(), report)
        assert formatted is not None, report.diagnostics
        return Draft(
            name=self.name, text=formatted.decode(), links=self.links, frames=self.frames, joints=self.joints, losses=self.robot.losses,
        )

    def _components(self) -> Iterator[str]:
        yield "components:"
        for name in self.links:
            link, above = self.link_of[name], self.above.get(name)
            yield f"  {self.links[name]}:{_was(self.links[name], name)}"
            shapes = [*self._shapes(link)]
            yield "    link: true" if shapes else "    frame: true"
            if name not in self.points:
                yield from self._weight(link, shapes=bool(shapes))
            if shapes:
                yield "    shapes:"
                yield from shapes
            if above is not None and not above.joints:
                yield f"    at: {{in: {self.links[above.parent]}.origin{_pose(above.pose, above.rpy, before=', ')}}}"
            mounts = [*self._mounts(name)]
            if mounts:
                yield "    mounts:"
                yield from (f"      {word}: {{{pose}}}{comment}" for word, pose, comment in mounts)
            if name in self.points:  # a mass alone would be spread over the shapes
                yield f"  {self.points[name]}:  # the mass of the link, which has no inertia in the source"
                yield "    frame: true"
                yield from self._weight(link)
                yield f"    at: {{in: {self.links[name]}.origin}}"

    def _weight(self, link: SourceLink, *, shapes: bool = False) -> Iterator[str]:
        """What a link weighs; the centre of one with shapes is that of the shapes unless it is written."""
        if link.weight is None:
            return
        of = link.weight.properties
        if link.name in self.repaired:
            yield f"    # repaired ({self.repaired[link.name]}): what the source says is in import.json"
        yield f"    mass: {mass(of.mass)}"
        if shapes or any(of.centre):
            yield f"    com: {lengths(of.centre)}"
        i = of.inertia
        if any(map(any, i)):
            products = {"ixy": i[0][1], "ixz": i[0][2], "iyz": i[1][2]}
            moments = {"ixx": i[0][0], "iyy": i[1][1], "izz": i[2][2], **{key: value for key, value in products.items() if value}}
            yield from _mapping("inertia", {key: quantity(value, "kg*m^2") for key, value in moments.items()})

    def _shapes(self, link: SourceLink) -> Iterator[str]:
        """The items of a list; one that is drawn and touches alike stands there once."""
        shown = [shape for shape in link.shapes if self._is_shown(shape)]
        seen = {_form(shape): shape for shape in shown if shape.use == "visual"}
        touching = {_form(shape) for shape in shown if shape.use == "collision"}
        for shape in shown:
            form = _form(shape)
            if shape.use == "collision" and form in seen:
                continue
            said = [self._geometry(shape), *([f"at: {{{pose}}}"] if (pose := _pose(shape.pose, shape.rpy)) else [])]
            said += [] if shape.use == "visual" and form in touching else [f"for: {shape.use}"]
            if shape.color is not None:
                said.append('color: "#{:02x}{:02x}{:02x}"'.format(*(round(255.0 * min(max(one, 0.0), 1.0)) for one in shape.color[:3])))
            yield f"      - {{{', '.join(said)}}}"

    def _is_shown(self, shape: SourceShape) -> bool:
        return shape.mesh is None or shape.mesh in self.meshes

    def _geometry(self, shape: SourceShape) -> str:
        match shape.kind:
            case "box":
                return f"box: {lengths(shape.size)}"
            case "sphere":
                return f"sphere: {{radius: {length(shape.size[0])}}}"
            case "cylinder":
                return f"cylinder: {{radius: {length(shape.size[0])}, length: {length(shape.size[-1])}}}"
            case _:
                path = self.meshes[shape.mesh or ""]
                unit = None if path.endswith(SAY_THEIR_UNIT) else UNITS.get(shape.size)
                if unit is None:
                    factors = "" if shape.size == (1.0, 1.0, 1.0) else f", scale: [{', '.join(quantity(one, '') for one in shape.size)}]"
                    return f"mesh: {path}{'' if path.endswith(SAY_THEIR_UNIT) else ', unit: m'}{factors}"
                return f"mesh: {path}, unit: {unit}"

    def _mounts(self, name: str) -> Iterator[tuple[str, str, str]]:
        """Of a link, each with its place and a comment: the mount of the joint that it hangs on, those of joints behind it, and links
        that are mounts."""
        above = self.above.get(name)
        for joint in above.joints if above is not None else ():
            yield self.mounts[joint.name], _pose(shifted(*joint.anchor) @ Pose(rotation=_onto(joint.axis)) @ MATE), ""
        for one in self.below.get(name, ()):
            if one.child in self.frames:
                yield self.frames[one.child], _pose(one.pose, one.rpy), _was(self.frames[one.child], one.child)
            for joint in one.joints:
                onto = _onto(joint.axis)
                rpy = one.rpy if onto == IDENTITY else None
                yield self.mounts[joint.name], _pose(one.pose @ shifted(*joint.anchor) @ Pose(rotation=onto), rpy), ""

    def _joints(self) -> Iterator[str]:
        moving = [(one, joint) for one in self.order for joint in one.joints]
        if moving:
            yield "joints:"
        for one, joint in moving:
            mount = self.mounts[joint.name]
            yield f"  {self.joints[joint.name]}:{_was(self.joints[joint.name], joint.name)}"
            yield f"    type: {joint.kind}"
            yield f"    parent: {self.links[one.parent]}.{mount}"
            yield f"    child: {self.links[one.child]}.{mount}"
            yield from self._motion(joint)
        if moving:
            yield ""

    def _motion(self, joint: SourceJoint) -> Iterator[str]:
        turns, of = joint.kind in TURNS, joint.ends
        force, speed = ("N*m", "rad/s") if turns else ("N", "m/s")
        place = angle if turns else length
        lower, upper = (None, None) if of.lower is None or of.upper is None else ends(of.lower, of.upper) if turns else (
            length(of.lower), length(of.upper),
        )
        limit: dict[str, str | None] = {
            "lower": lower, "upper": upper,
            "effort": None if not of.effort or joint.driven else quantity(of.effort, force),
            "velocity": None if of.velocity is None else quantity(of.velocity, speed),
        }
        dynamics = {"damping": (joint.damping, "N*m*s/rad" if turns else "N*s/m"), "friction": (joint.friction, force)}
        yield from _mapping("limit", {key: value for key, value in limit.items() if value is not None})
        yield from _mapping("dynamics", {key: quantity(value, unit) for key, (value, unit) in dynamics.items() if value})
        if joint.follows is not None:
            leader = next(other for one in self.order for other in one.joints if other.name == joint.follows.joint)
            unit = {(True, False): " rad/m", (False, True): " m/rad"}.get((turns, leader.kind in TURNS), "")
            follows = {"joint": self.joints[leader.name], "multiplier": f"{quantity(joint.follows.multiplier, '')}{unit}"}
            yield from _mapping("mimic", follows | ({"offset": place(joint.follows.offset)} if joint.follows.offset else {}))
        if joint.driven:
            yield from _mapping("drive", {"kind": "motor", **({"effort": quantity(of.effort, force)} if of.effort else {})})

    def _shown(self) -> Iterator[str]:
        """Mounts that the document exports."""
        if self.frames:
            yield "mounts:"
            yield from (f"  {word}: {self.links[self.above[name].parent]}.{word}" for name, word in self.frames.items())
            yield ""

    def _poses(self) -> dict[str, str]:
        """A value within its limits for each joint that has 0 outside of them: the middle."""
        moving = [joint for one in self.order for joint in one.joints if joint.follows is None]
        outside = {
            joint: (joint.ends.lower + joint.ends.upper) / 2.0 for joint in moving
            if joint.ends.lower is not None and joint.ends.upper is not None and not joint.ends.lower <= 0.0 <= joint.ends.upper
        }
        return {self.joints[one.name]: (angle if one.kind in TURNS else length)(round(value, 6)) for one, value in outside.items()}

    def _modes(self) -> Iterator[str]:
        at, poses = _pose(self.robot.pose), self._poses()
        start = ", pose: start" if poses else ""
        if poses:
            yield "poses:"
            yield f"  start: {{{', '.join(f'{joint}: {value}' for joint, value in poses.items())}}}  # 0 is outside of their limits"
            yield ""
        yield "modes:"
        yield f"  source: {{root: {self.links[self.robot.root]}, base: {self.robot.base}{f', at: {{{at}}}' if at else ''}{start}}}"
        taken = ["source"]
        for name in self.roots:
            mode = distinct([name], "link", taken)[name]
            taken.append(mode)
            # A component is laid with its frame onto the world's; a mount would be mated to it, z against z.
            turned = "" if name in self.links else f", at: {{{_pose(MATE)}}}"
            yield f"  {mode}: {{root: {(self.links | self.frames)[name]}, base: held{turned}{start}}}"


def _was(word: str, name: str) -> str:
    """A comment where the source has another name."""
    return "" if word == name else f"  # {name!r} in the source"


def _mapping(key: str, values: Mapping[str, str]) -> Iterator[str]:
    if values:
        yield f"    {key}: {{{', '.join(f'{name}: {value}' for name, value in values.items())}}}"


def _form(shape: SourceShape) -> tuple[object, ...]:
    """What of a shape has to be the same, for it to be drawn and touched alike."""
    return shape.kind, shape.size, shape.pose, shape.mesh


def _pose(pose: Pose, rpy: Vector | None = None, *, before: str = "") -> str:
    """`xyz: 0 0 50 mm, rpy: -90 0 0 deg`, each where it says something; with `before` in front of it, if there is anything. `rpy` [rad] are
    the angles of the source, where it has them: those that are worked out are rounded where their digits end."""
    if rpy is None:
        roll, pitch, yaw = (round(angle, 14) if angle not in (math.pi, -math.pi) else angle for angle in rpy_of(pose.rotation))
        rpy = (roll, pitch, yaw)
    words = (("xyz", lengths(pose.translation)), ("rpy", angles(rpy)))
    said = [f"{key}: {value}" for key, value in words if value != "0 0 0"]
    return f"{before if said else ''}{', '.join(said)}"


def _onto(axis: Vector) -> Matrix:
    """A rotation that takes z to a unit vector; along one of the axes it has no digits that are not 0 or 1."""
    plain = tuple(0.0 if abs(one) < _ALIGNED else one for one in axis)
    if sum(map(bool, plain)) == 1:
        x, y, z = (math.copysign(1.0, one) if one else 0.0 for one in plain)
        axis = (x, y, z)
    return IDENTITY if axis == (0.0, 0.0, 1.0) else along(axis, (0.0, 0.0, 0.0)).rotation
