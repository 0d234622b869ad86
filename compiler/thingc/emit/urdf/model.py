"""One mode's robot as an URDF tree.

A link's frame lies on the joint that leads to it. The frame that MJCF and `modes.json` have of it, the same in every mode, is the massless
link `<link>_frame` wherever it lies elsewhere; exported mounts, `frame` components and roots of modes are massless links, too. Axes are the
link's own, so that no frame of an inertia or a joint is turned.
"""

from __future__ import annotations

from thingc.diagnostics import Report
from thingc.emit.geometry import Geometry, Shape, channels, material_name
from thingc.emit.urdf.chain import Move, moves, own_frame
from thingc.emit.urdf.names import Names, safe
from thingc.emit.xml import Element, number, numbers
from thingc.graph.types import Link
from thingc.inertia import ZERO, MassProperties, physical_fault, within_triangle
from thingc.pose import IDENTITY, NO_POSE, Pose, rpy_of, shifted
from thingc.robot.tree import BASE
from thingc.robot.types import Body, Robot, Site
from thingc.source import Origin

WORLD = "world"
"""The root link of a base that does not float."""

UNBOUNDED = 1e9
"""A limit [rad, m, N m, N, rad/s or m/s] where the document has none: URDF demands one."""

BETWEEN = MassProperties(mass=1e-9, centre=(0.0, 0.0, 0.0), inertia=((1e-12, 0.0, 0.0), (0.0, 1e-12, 0.0), (0.0, 0.0, 1e-12)))
"""What a link weighs that moves and has no mass of its own: MuJoCo refuses one of none."""

MESHES = "meshes"
"""The folder of meshes beside the files."""


def model(robot: Robot, geometry: Geometry, report: Report) -> Element:
    """The whole `<robot>` element of a mode. Names that URDF cannot tell apart are reported."""
    return _Builder(robot, geometry, report).build()


class _Builder:
    def __init__(self, robot: Robot, geometry: Geometry, report: Report) -> None:
        self.robot = robot
        self.geometry = geometry
        self.assembly = robot.assembly
        self.links = Names("the links and frames", report)
        self.joints = Names("the joints", report)
        self.root = Element(tag="robot", attributes={"name": robot.assembly.name}, origin=robot.mode.origin)
        self.moving: list[tuple[str, str | None, Element]] = []
        self.in_tree = frozenset(joint.path for body in robot.bodies for joint in body.joints)

    def build(self) -> Element:
        """Materials, the links from the root on, then joints, those that follow another behind it."""
        self._extension()
        self._materials()
        lead = {index: self.robot.moves if body.parent is None else body.joints for index, body in enumerate(self.robot.bodies)}
        own = [own_frame(lead[index]) for index in range(len(self.robot.bodies))]
        names = [self.links.take(self._link_of(body).name, self._link_of(body).origin) for body in self.robot.bodies]
        if self.robot.base != "free":
            self.root.add("link", {"name": self.links.take(WORLD, self.robot.mode.origin)}, self.robot.mode.origin)
        sites = self._sites()
        for index, body in enumerate(self.robot.bodies):
            parent = (WORLD if self.robot.base != "free" else None) if body.parent is None else names[body.parent]
            X_PL = body.X_PL if body.parent is None else own[body.parent].inverse() @ body.X_PL
            if parent is not None:
                self._lead(parent, names[index], tuple(moves(lead[index], X_PL)), X_PL, (BASE, self.robot.mode.origin))
            self._link(names[index], body, own[index].inverse())
            link = self._link_of(body)
            if own[index] != NO_POSE:
                self._frame(names[index], f"{link.name}_frame", own[index].inverse(), link.origin)
            for site in sites.get(index, ()):
                self._frame(names[index], site.path, own[index].inverse() @ site.pose, site.origin)
        self._in_order()
        return self.root

    def _sites(self) -> dict[int, list[Site]]:
        """The frames on each body, besides its own; of several paths of one name that are the same frame the first."""
        sites: dict[int, list[Site]] = {}
        known = {(safe(self._link_of(body).name), index, NO_POSE) for index, body in enumerate(self.robot.bodies)}
        for site in self.robot.sites:
            frame = (safe(site.path), site.body, site.pose)
            if frame not in known:
                known.add(frame)
                sites.setdefault(site.body, []).append(site)
        return sites

    def _extension(self) -> None:
        """What MuJoCo must be told to read the file whole: by itself it drops links that do not move and what is only drawn."""
        compiler = {"fusestatic": "false", "discardvisual": "false", "strippath": "false", "meshdir": ""}
        section = self.root.add("mujoco")
        section.add("compiler", compiler)
        section.add("option", {"gravity": numbers(self.robot.gravity)}, self.robot.mode.origin)

    def _materials(self) -> None:
        seen: set[str] = set()
        for one in self.geometry.shapes:
            name = material_name(one.material, one.color)
            if name is not None and name not in seen and one.visual is not None:
                seen.add(name)
                origin = one.material.origin if one.material is not None else one.origin
                self.root.add("material", {"name": name}, origin).add("color", {"rgba": numbers(channels(one.color or ""))})

    def _lead(self, parent: str, child: str, chain: tuple[Move, ...], X_PL: Pose, fixed: tuple[str, Origin]) -> None:
        """The joints from a link to the next, and the links between them."""
        if not chain:
            element = self._joint(fixed[0], "fixed", parent, child, X_PL, fixed[1])
            self.root.children.append(element)
            return
        for number_, move in enumerate(chain):
            last = number_ == len(chain) - 1
            end = child if last else self.links.take(move.path, move.joint.origin)
            if not last:
                _weigh(self.root.add("link", {"name": end}, move.joint.origin), BETWEEN)
            self._moving(move, parent, end)
            parent = end

    def _moving(self, move: Move, parent: str, child: str) -> None:
        joint = move.joint
        bounded = (joint.limit.lower, joint.limit.upper) != (None, None)
        kind = "prismatic" if move.type == "slide" else "revolute" if bounded else "continuous"
        element = self._joint(move.path, kind, parent, child, move.origin, joint.origin)
        element.add("axis", {"xyz": numbers(move.axis)})
        element.add("limit", self._limit(move, kind))
        leader: str | None = None
        if move.follows is not None:
            leader = safe(move.follows[0])
            element.add("mimic", {"joint": leader, "multiplier": number(move.follows[1]), "offset": "0"})
        else:
            dynamics = (("damping", joint.dynamics.damping), ("friction", joint.dynamics.friction))
            if any(value for _, value in dynamics):
                element.add("dynamics", {name: number(value) for name, value in dynamics if value})
            if joint.mimic is not None and joint.mimic.joint.path in self.in_tree:
                leader = safe(joint.mimic.joint.path)
                values = {"multiplier": number(joint.mimic.multiplier), "offset": number(joint.mimic.offset)}
                element.add("mimic", {"joint": leader, **values}, joint.mimic.origin)
        self.moving.append((element.attributes["name"], leader, element))

    def _limit(self, move: Move, kind: str) -> dict[str, str]:
        """Where a joint ends, and how strong and fast it may be: of a screw's slide what follows from the turn, which alone is driven."""
        limit, (_, thread) = move.joint.limit, move.follows or ("", 1.0)
        ends = tuple(None if end is None else end * thread for end in (limit.lower, limit.upper))
        lower, upper = ends if thread > 0.0 else ends[::-1]
        attributes = {
            "lower": number(-UNBOUNDED if lower is None else lower), "upper": number(UNBOUNDED if upper is None else upper),
        } if kind != "continuous" else {}
        driven = move.joint.actuator is not None and move.joint.path in self.robot.present
        effort = 0.0 if move.follows is not None else limit.effort if limit.effort is not None else UNBOUNDED if driven else 0.0
        velocity = UNBOUNDED if limit.velocity is None else limit.velocity * abs(thread)
        return {**attributes, "effort": number(effort), "velocity": number(velocity)}

    def _in_order(self) -> None:
        """Append the joints that move, each behind the one that it follows."""
        waiting, done = self.moving, set[str]()
        while waiting:
            ready = [one for one in waiting if one[1] is None or one[1] in done]
            self.root.children.extend(element for _, _, element in ready)
            done.update(name for name, _, _ in ready)
            waiting = [one for one in waiting if one[0] not in done]

    def _joint(self, path: str, kind: str, parent: str, child: str, origin: Pose, made_by: Origin) -> Element:
        element = Element(tag="joint", attributes={"name": self.joints.take(path, made_by), "type": kind}, origin=made_by)
        _origin(element, origin)
        element.add("parent", {"link": parent})
        element.add("child", {"link": child})
        return element

    def _frame(self, link: str, path: str, pose: Pose, origin: Origin) -> None:
        """A massless link for a frame."""
        if self.links.free(path, origin):
            self.root.add("link", {"name": safe(path)}, origin)
            self.root.children.append(self._joint(f"{path}_joint", "fixed", link, safe(path), pose, origin))

    def _link(self, name: str, body: Body, X_CL: Pose) -> None:
        """A link with all that it holds, in its frame as URDF has it."""
        link = self._link_of(body)
        element = self.root.add("link", {"name": name}, link.origin)
        if link.properties.mass > 0.0:
            _weigh(element, link.properties.seen_from(X_CL))
        elif body.joints:
            _weigh(element, BETWEEN)
        for member, pose in zip(link.members, link.poses, strict=True):
            shapes, at = self.geometry.shapes[member], X_CL @ pose
            if shapes.visual is not None:
                visual = element.add("visual", {"name": shapes.path}, shapes.origin)
                self._shape(visual, shapes.visual, at)
                material = material_name(shapes.material, shapes.color)
                if material is not None:
                    visual.add("material", {"name": material})
            for index, shape in enumerate(shapes.collision):
                for number_, part in enumerate(without_capsules(shape)):
                    suffix = "".join(f"_{k}" for k in (index, number_) if k)
                    self._shape(element.add("collision", {"name": f"{shapes.path}:collision{suffix}"}, shapes.origin), part, at)

    def _shape(self, element: Element, shape: Shape, pose: Pose) -> None:
        _origin(element, pose @ shape.pose)
        geometry = element.add("geometry")
        match shape.kind:
            case "mesh":
                geometry.add("mesh", {"filename": f"{MESHES}/{shape.mesh}.obj"})
            case "box":
                geometry.add("box", {"size": numbers(2.0 * half for half in shape.size)})
            case "sphere":
                geometry.add("sphere", {"radius": number(shape.size[0])})
            case _:
                geometry.add("cylinder", {"radius": number(shape.size[0]), "length": number(2.0 * shape.size[1])})

    def _link_of(self, body: Body) -> Link:
        return self.assembly.links[body.link]


def without_capsules(shape: Shape) -> tuple[Shape, ...]:
    """URDF 1.0 has none: a cylinder between two balls is the same."""
    if shape.kind != "capsule":
        return (shape,)
    radius, half = shape.size
    balls = (Shape(kind="sphere", size=(radius,), pose=shape.pose @ shifted(0.0, 0.0, end)) for end in (-half, half))
    return (Shape(kind="cylinder", size=shape.size, pose=shape.pose), *balls)


def _origin(element: Element, pose: Pose) -> None:
    """Where something is, if it says anything."""
    attributes = {"xyz": numbers(pose.translation)} if any(pose.translation) else {}
    if pose.rotation != IDENTITY:
        attributes["rpy"] = numbers(rpy_of(pose.rotation))
    if attributes:
        element.add("origin", attributes)


def _weigh(link: Element, properties: MassProperties) -> None:
    """Mass [kg], centre [m] and inertia [kg m^2] about it, in the axes of the link."""
    inertial = link.add("inertial")
    _origin(inertial, shifted(*properties.centre))
    inertial.add("mass", {"value": number(properties.mass)})
    i = ZERO if physical_fault(properties.inertia) is not None else within_triangle(properties.inertia)
    moments = {"ixx": i[0][0], "ixy": i[0][1], "ixz": i[0][2], "iyy": i[1][1], "iyz": i[1][2], "izz": i[2][2]}
    inertial.add("inertia", {name: number(value) for name, value in moments.items()})
