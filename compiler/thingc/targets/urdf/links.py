"""Write a robot in one mode as a URDF tree.

The URDF frame of a link is located at the joint that leads to the link. The link's own frame, as in MJCF and `modes.json`, is the same in
every mode. If a link's own frame differs from its URDF frame, the own frame is written as an additional massless link `<link>_frame`.
Exported mounts, `frame` components and roots of modes also become massless links. All these frames have the axes of the link, so that no
frame of an inertia or a joint is rotated.
"""

from __future__ import annotations

from thingc.base.diagnostics import Report
from thingc.base.inertia import ZERO, MassProperties, named_moments, physical_fault, within_triangle
from thingc.base.numeric import minimum, sum_of
from thingc.base.pose import IDENTITY, NO_POSE, Pose, make_translation, rpy_of
from thingc.base.source import Origin
from thingc.model.assembly.types import JointEdge, Link
from thingc.model.robot.tree import BASE
from thingc.model.robot.types import Body, Robot, TreeJoint
from thingc.targets.capabilities import drive_cell, is_written, shape_cell, written_as
from thingc.targets.geometry import Geometry, Shape, channels, material_name, materials, name_with_index, named_shapes
from thingc.targets.name_mangling import LINK, MangledNames, frames, safe
from thingc.targets.urdf.capabilities import CAPABILITIES
from thingc.targets.urdf.chain import Move, mimics_of, moves, own_frame
from thingc.targets.urdf.transmissions import coupled_transmissions, differentials, simple_transmission, urdf_transmission
from thingc.targets.xml_writer import Element, XmlValue

WORLD = "world"
"""Name of the root link for a base that does not float."""

UNBOUNDED = 1e9
"""Limit that is written for a joint without a limit, because URDF requires a limit. The unit of the limit is rad, m, N m, N, rad/s or
m/s.
"""

SMALL_MASS = MassProperties(mass=1e-9, centre=(0.0, 0.0, 0.0), inertia=((1e-12, 0.0, 0.0), (0.0, 1e-12, 0.0), (0.0, 0.0, 1e-12)))
"""Mass properties that are written for a moving link without mass, because MuJoCo rejects a mass of zero."""

MASSLESS = MassProperties(mass=0.0)
"""Mass properties that are written for a fixed link without mass. The properties are written because PyBullet assigns 1 kg to a link
without `<inertial>`, unless the name of the link is `world`.
"""

MESHES = "meshes"
"""The folder that contains the meshes, beside the URDF files."""


def model(robot: Robot, geometry: Geometry, report: Report, meshes: str = MESHES) -> Element:
    """Create the `<robot>` element of a mode. `meshes` is the URI of the mesh folder. If two names are equal, an error is reported."""
    return _Builder(robot, geometry, report, meshes).build()


def mujoco_extension(robot: Robot) -> Element:
    """Return a `<mujoco>` element with the options that MuJoCo reads from a URDF file.

    Without these options, MuJoCo drops fixed links and visual shapes.
    """
    section = Element(tag="mujoco", attributes={}, origin=robot.mode.origin)
    section.add("compiler", {"fusestatic": "false", "discardvisual": "false", "strippath": "false", "meshdir": ""})
    section.add("option", {"gravity": robot.gravity}, robot.mode.origin)
    return section


class _Builder:
    def __init__(self, robot: Robot, geometry: Geometry, report: Report, meshes: str) -> None:
        self.robot = robot
        self.meshes = meshes
        self.geometry = geometry
        self.assembly = robot.assembly
        self.links = MangledNames("link name", "URDF", report)
        self.joints = MangledNames("joint name", "URDF", report)
        self.root = Element(tag="robot", attributes={"name": robot.assembly.name}, origin=robot.mode.origin)
        self.followers: list[Element] = []
        self.frames: list[Element] = []
        self.transmissions: list[Element] = []
        self.coupled = [row for rows in differentials(robot).values() for row in rows]
        self.mimics = mimics_of(robot)
        self.followed = {leader.path for leader, _, _ in self.mimics.values()}

    def build(self) -> Element:
        """Build the `<robot>` element.

        The element contains the materials, the links and joints in the order of the tree, the mimic joints, the frames, and the
        transmissions. The frames come last, because some readers, such as ikpy, only use the first child of a link.
        """
        for name, (color, origin) in materials(self.geometry.shapes).items():
            self.root.add("material", {"name": name}, origin).add("color", {"rgba": channels(color)})
        leading_joints = [self.robot.moves if body.parent is None else body.joints for body in self.robot.bodies]
        own_frames = [own_frame(joints) for joints in leading_joints]
        links = [self.assembly.links[body.link] for body in self.robot.bodies]
        names = [self.links.take(link.name, link.origin) for link in links]
        if self.robot.base != "free":
            self.root.add("link", {"name": self.links.take(WORLD, self.robot.mode.origin)}, self.robot.mode.origin)
        else:
            self.root.add("gazebo").add_text("static", "false")
        sites = frames(self.robot)
        for index, (body, link, name) in enumerate(zip(self.robot.bodies, links, names, strict=True)):
            parent = (WORLD if self.robot.base != "free" else None) if body.parent is None else names[body.parent]
            X_PL = body.X_PL if body.parent is None else own_frames[body.parent].inverse() @ body.X_PL
            if parent is not None:
                self._connect(parent, name, tuple(moves(leading_joints[index], X_PL, self.mimics)), X_PL, body)
            X_CL = own_frames[index].inverse()
            self._link(name, link, X_CL, SMALL_MASS if body.joints else MASSLESS)
            if own_frames[index] != NO_POSE:
                self._frame(name, f"{link.name}_frame", X_CL, link.origin, f"the frame of link `{link.name}`")
            for site in sites.get(index, ()):
                self._frame(name, site.path, X_CL @ site.pose, site.origin)
        self.transmissions += map(urdf_transmission, coupled_transmissions(self.robot))
        self.root.children += self.followers + self.frames + self.transmissions
        return self.root

    def _connect(self, parent: str, child: str, chain: tuple[Move, ...], X_PL: Pose, body: Body) -> None:
        """Add the URDF joints between two links, and the intermediate links. If the body does not move, a fixed joint is added."""
        if not chain:
            mate = None if body.mate is None else self.assembly.mates[body.mate]
            path, origin = (BASE, self.robot.mode.origin) if mate is None else (mate.name or child, mate.origin)
            self.root.children.append(self._joint(path, "fixed", parent, child, X_PL, origin))
            return
        for index, move in enumerate(chain):
            last = index == len(chain) - 1
            end = child if last else self.links.take(f"{move.path}{LINK}", move.joint.origin, f"the child link of joint `{move.path}`")
            if not last:
                _add_inertial(self.root.add("link", {"name": end}, move.joint.origin), SMALL_MASS)
            self._moving(move, parent, end)
            parent = end

    def _moving(self, move: Move, parent: str, child: str) -> None:
        """Add a movable joint to the URDF file."""
        joint = move.joint
        if move.type == "floating":
            self.root.children.append(self._joint(move.path, "floating", parent, child, move.origin, joint.origin))
            return
        limits = self._limits(move)
        endless = move.type == "turn" and limits == (-UNBOUNDED, UNBOUNDED)
        alone = not (move.mimic or joint.twist.pitch or joint.path in self.followed)
        kind = "prismatic" if move.type == "slide" else "continuous" if endless and alone else "revolute"
        description = f"the slide of `{joint.path}`" if move.thread is not None else None
        element = self._joint(move.path, kind, parent, child, move.origin, joint.origin, description)
        element.add("axis", {"xyz": move.axis})
        bounds = {} if kind == "continuous" else {"lower": limits[0], "upper": limits[1]}
        element.add("limit", {**bounds, **self._effort_and_velocity(move)})
        if move.thread is None:
            dynamics = {"damping": joint.dynamics.damping, "friction": joint.dynamics.friction}
            if friction := {name: value for name, value in dynamics.items() if value}:
                element.add("dynamics", friction)
        if move.mimic is not None:
            leader, multiplier, offset = move.mimic
            origin = joint.mimic.origin if joint.mimic is not None else joint.origin
            element.add("mimic", {"joint": safe(leader.path), "multiplier": multiplier, "offset": offset}, origin)
        (self.root.children if move.mimic is None else self.followers).append(element)
        drive = joint.actuator if move.thread is None and joint.path in self.robot.present else None
        if drive is not None and is_written(CAPABILITIES["drives"][drive_cell(joint, drive)]):
            self.transmissions.append(urdf_transmission(simple_transmission(element.get("name"), drive)))

    def _limits(self, move: Move) -> tuple[float, float]:
        """Return the lower and upper limit [rad or m] of a URDF joint. A mimic joint without limits gets them from its leader."""
        limit, ratio, offset = move.joint.limit, 1.0 if move.thread is None else move.thread, 0.0
        if not limit.bounded and move.mimic is not None:
            leader, ratio, offset = move.mimic
            limit = leader.limit
        values = [None if end is None else end * ratio + offset for end in (limit.lower, limit.upper)]
        lower, upper = values if ratio > 0.0 else values[::-1]
        return (-UNBOUNDED if lower is None else lower), (UNBOUNDED if upper is None else upper)

    def _effort_and_velocity(self, move: Move) -> dict[str, XmlValue]:
        """Return the attributes with the effort and velocity limits of a URDF joint.

        The slide of a screw has no effort, and its velocity follows from the rotation, which has the drive.
        """
        joint = move.joint
        if joint.kind.at_once and joint.mate >= 0:
            effort, velocity = self._ball_effort_and_velocity(joint)
        else:
            effort, velocity = self._effort(joint), joint.limit.velocity
        if move.thread is not None:
            effort, velocity = 0.0, None if velocity is None else velocity * abs(move.thread)
        return {"effort": effort, "velocity": UNBOUNDED if velocity is None else velocity}

    def _effort(self, joint: TreeJoint | JointEdge) -> float:
        if joint.limit.effort is not None:
            return joint.limit.effort
        if joint.actuator is not None and joint.path in self.robot.present:
            return UNBOUNDED
        rows = [(row, abs(row.moves[joint.path])) for row in self.coupled if joint.path in row.moves]
        efforts = [share * (UNBOUNDED if row.limit.effort is None else row.limit.effort) for row, share in rows]
        return minimum(UNBOUNDED, sum_of(efforts))

    def _ball_effort_and_velocity(self, joint: TreeJoint) -> tuple[float, float | None]:
        """Return the effort and velocity limits of one of the three rotations of a ball joint, at q = 0.

        The effort limit is the largest total torque of the drives about the axis of the rotation. The total must be computed because each
        drive has its own axis. The velocity limit is that of the slowest drive.
        """
        joints = self.assembly.mates[joint.mate].joints
        axis = next(index for index, coordinate in enumerate(joints) if coordinate.path == joint.path)
        driven = [(joint, joint.actuator.axis) for joint in joints if joint.actuator is not None and joint.actuator.axis is not None]
        drives = [(coordinate, abs(drive_axis[axis])) for coordinate, drive_axis in driven]
        efforts = [share * self._effort(coordinate) for coordinate, share in drives]
        speeds = [coordinate.limit.velocity / share for coordinate, share in drives if share and coordinate.limit.velocity is not None]
        return minimum(UNBOUNDED, sum_of(efforts)), minimum(speeds, default=None)

    def _joint(self, path: str, kind: str, parent: str, child: str, origin: Pose, source: Origin, label: str | None = None) -> Element:
        element = Element(tag="joint", attributes={"name": self.joints.take(path, source, label), "type": kind}, origin=source)
        _origin(element, origin)
        element.add("parent", {"link": parent})
        element.add("child", {"link": child})
        return element

    def _frame(self, link: str, path: str, pose: Pose, origin: Origin, label: str | None = None) -> None:
        """Add a massless link to the URDF file for a frame of the robot."""
        if self.links.free(path, origin, label):
            frame = Element(tag="link", attributes={"name": safe(path)}, origin=origin)
            _add_inertial(frame, MASSLESS)
            joint = self._joint(f"{path}_joint", "fixed", link, safe(path), pose, origin, f"the joint that fixes {label or f'`{path}`'}")
            self.frames += frame, joint

    def _link(self, name: str, link: Link, X_CL: Pose, without_mass: MassProperties) -> None:
        """Add a link with its inertia and shapes, expressed in the URDF frame of the link.

        `without_mass` contains the mass properties that are written for a link without mass.
        """
        element = self.root.add("link", {"name": name}, link.origin)
        _add_inertial(element, link.properties.seen_from(X_CL) if link.properties.mass > 0.0 else without_mass)
        for member, pose in zip(link.members, link.poses, strict=True):
            shapes, part_pose = self.geometry.shapes[member], X_CL @ pose
            for name, shape in named_shapes(shapes.visual, shapes.path):
                for index, part in enumerate(parts(shape)):
                    visual = element.add("visual", {"name": name_with_index(name, index)}, shapes.origin)
                    self._shape(visual, part, part_pose)
                    material = material_name(shape.material, shape.color)
                    if material is not None:
                        visual.add("material", {"name": material})
            for name, shape in named_shapes(shapes.collision, f"{shapes.path}:collision"):
                for index, part in enumerate(parts(shape)):
                    self._shape(element.add("collision", {"name": name_with_index(name, index)}, shapes.origin), part, part_pose)

    def _shape(self, element: Element, shape: Shape, pose: Pose) -> None:
        """Add the pose and the geometry of a shape to a visual or collision element. `pose` is the pose of the shape's part."""
        _origin(element, pose @ shape.pose)
        geometry = element.add("geometry")
        match shape.kind:
            case "mesh":
                geometry.add("mesh", {"filename": f"{self.meshes}/{shape.mesh}.obj"})
            case "box":
                geometry.add("box", {"size": tuple(2.0 * half for half in shape.size)})
            case "sphere":
                geometry.add("sphere", {"radius": shape.size[0]})
            case _:
                geometry.add("cylinder", {"radius": shape.size[0], "length": 2.0 * shape.size[1]})


def parts(shape: Shape) -> tuple[Shape, ...]:
    """Split a shape into shapes that URDF 1.0 supports, such as a capsule into a cylinder and two spheres."""
    form = written_as(CAPABILITIES["shapes"][shape_cell(shape.kind)])
    match form:
        case "itself":
            return (shape,)
        case "cylinder and balls":
            radius, half = shape.size
            balls = (Shape(kind="sphere", size=(radius,), pose=shape.pose @ make_translation(0.0, 0.0, end)) for end in (-half, half))
            return (Shape(kind="cylinder", size=shape.size, pose=shape.pose), *balls)
        case None:
            return ()


def _origin(element: Element, pose: Pose) -> None:
    """Add an `<origin>` element for a pose. The element is omitted if the pose is the identity."""
    attributes = {"xyz": pose.translation} if any(pose.translation) else {}
    if pose.rotation != IDENTITY:
        attributes["rpy"] = rpy_of(pose.rotation)
    if attributes:
        element.add("origin", attributes)


def _add_inertial(link: Element, properties: MassProperties) -> None:
    """Add an `<inertial>` element to a link: mass [kg], centre of mass [m], and inertia about it [kg m^2] along the axes of the link."""
    inertial = link.add("inertial")
    _origin(inertial, make_translation(*properties.centre))
    inertial.add("mass", {"value": properties.mass})
    inertial.add("inertia", named_moments(ZERO if physical_fault(properties.inertia) is not None else within_triangle(properties.inertia)))
