"""The features of robots that each target supports, as one table for each target.

Each table determines what the emitter writes, which export losses it reports, and the column of the target in `docs/formats.md`.

The keys of the tables are the literals below. mypy reports an unknown feature, and a test reports a missing feature. If a feature can be
written in several ways, its table cell contains a keyword of the target (`by`). The emitter selects the way with a `match` statement on
this keyword (`written_as`). mypy reports an unknown keyword or a missing case. The export losses of a build depend on the robot. The
function `losses` checks which features the robot uses, in the same way for all targets.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Generic, Literal, TypedDict, TypeVar, get_args, get_type_hints

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.inertia import ZERO, physical_fault
from thingc.base.joints.kinds import KINDS, JointKind
from thingc.base.pose import NO_POSE, Vector
from thingc.base.primitives import Primitive, PrimitiveShape
from thingc.base.sensor_kinds import SensorType
from thingc.base.source import Origin
from thingc.geometry.record import DriveType
from thingc.model.assembly.types import ActuatorModel, Assembly, JointEdge, LinkedSensor, LinkedTendon
from thingc.model.robot.types import ClosureKind, Robot, TreeJoint
from thingc.targets.artifact import Loss

GRAVITY: Vector = (0.0, 0.0, -9.81)
"""Gravity [m/s^2] that readers assume if a format does not specify gravity."""


By = TypeVar("By")
Joint = TypeVar("Joint")
Drive = TypeVar("Drive")
Loop = TypeVar("Loop")
Shape = TypeVar("Shape")
Sensor = TypeVar("Sensor")


class Supported(FrozenStruct, Generic[By], kw_only=False):
    """A table cell for a feature that the format fully supports.

    `by` is the keyword by which the emitter selects how the feature is written, or None if there is only one way. `how` is the name of the
    feature in the format, if the format uses another name.
    """

    by: By
    how: str = ""


class Lossy(FrozenStruct, Generic[By], kw_only=False):
    """A table cell for a feature that the format supports only partly.

    The feature is written as the keyword `by` specifies, and a `Loss` with the treatment `how` is reported. `words` begins with a comma or
    colon and is appended to the description of the loss.
    """

    by: By
    how: Literal["approximated", "carried as custom data", "omitted"]
    words: str = ""


class Omitted(FrozenStruct, kw_only=False):
    """A table cell for a feature that the format does not support, so that nothing is written.

    `words` is appended to the description of the `Loss`.
    """

    words: str = ""

    @property
    def how(self) -> Literal["omitted"]:
        """The treatment of the feature in the reported export loss, which is `omitted`."""
        return "omitted"


class Companion(FrozenStruct, kw_only=False):
    """A table cell for a feature that belongs in another file and not in files of this format.

    The feature is not written, but no export loss is reported.
    """


Written = Supported[By] | Lossy[By]
Cell = Written[By] | Omitted | Companion
Plain = Cell[None]

FULL = Supported(None)
OMITTED = Omitted()
COMPANION = Companion()


def written_as(cell: Cell[By]) -> By | None:
    """Return the keyword of a table cell, by which the emitter selects how to write the feature.

    Return None if the cell has no keyword, or if the feature is not written.
    """
    return cell.by if isinstance(cell, (Supported, Lossy)) else None


def is_written(cell: Cell[Any]) -> bool:
    """Return whether the emitter writes a feature with this table cell, fully or partly."""
    return isinstance(cell, (Supported, Lossy))


JointCell = Literal["single", "several", "universal", "screw", "ball", "free"]
"""The types of motion of joints (see `joint_cell`). The same cells apply to a planar or ball base and to a joint that cuts a loop."""

JointFeature = Literal[
    "cone", "velocity", "damping", "friction", "armature", "stiffness", "mimic", "polynomial", "tendon", "differential", "backlash",
    "delay", "effects",
]
"""The properties of joints and their drives."""

DriveCell = Literal[DriveType, "universal", "ball"]
"""The kinds of drives. Each drive of a `ball` has its own axis. A `universal` joint has two drives."""

LoopCell = Literal["hold", ClosureKind]
"""The loops, by the motion that remains free at the cut. `hold` applies to mounts that are held at their positions in the world."""

BaseFeature = Literal["held", "free", "start", "planar", "ball"]
"""The moving bases. `start` is the initial pose of a free base."""

ModeFeature = Literal["gravity", "poses", "exclude", "pairs", "groups", "timestep", "simulation"]
"""The properties of modes. `simulation` covers all simulation settings except `timestep`."""

LinkFeature = Literal["frames", "colours", "friction", "rolling", "adhesion", "weightless", "weightless_base", "point", "line"]
"""The properties of links.

`rolling` is for rolling friction. `weightless` is for a massless link that a joint moves, and `weightless_base` is for a massless base.
`point` and `line` are for masses at a point or on a line, because no solid can have such an inertia.
"""

ShapeCell = Literal[PrimitiveShape, "hull", "mesh"]
"""The collision shapes. `mesh` is for a non-convex mesh that is not replaced by its convex hull. The same cells also apply to visual
primitives.
"""

SensorFeature = Literal["noise", "cutoff"]
"""The properties of sensors."""


class Capabilities(TypedDict, Generic[Joint, Drive, Loop, Shape, Sensor]):
    """All features that a format may or may not support.

    The type parameters are the keywords with which the emitter writes joints, drives, loops, shapes and sensors. A type parameter is
    `Never` if the emitter does not write the feature.
    """

    joints: Mapping[JointCell, Written[Joint]]
    of_joints: Mapping[JointFeature, Plain]
    drives: Mapping[DriveCell, Cell[Drive]]
    loops: Mapping[LoopCell, Cell[Loop]]
    bases: Mapping[BaseFeature, Plain]
    modes: Mapping[ModeFeature, Plain]
    links: Mapping[LinkFeature, Plain]
    shapes: Mapping[ShapeCell, Cell[Shape]]
    sensors: Mapping[SensorType, Cell[Sensor]]
    of_sensors: Mapping[SensorFeature, Plain]


def all_of(group: str, cell: Cell[By]) -> dict[Any, Cell[By]]:
    """Create the table of a group of features, such as `loops`, in which all features have the same support."""
    return dict.fromkeys(get_args(get_args(get_type_hints(Capabilities)[group])[0]), cell)


AnyCapabilities = Capabilities[Any, Any, Any, Any, Any]
"""Type of the capabilities of an arbitrary target."""


MOVING_BASES = {"held": "the motion of the held base", "free": "the free base"}
"""Descriptions of the export losses of moving bases. For any other base, the motion of the base is the loss."""


def losses(target: str, table: AnyCapabilities, assembly: Assembly, robots: Sequence[Robot], *, cut: bool = False) -> tuple[Loss, ...]:
    """Compare the features of a robot in the given modes with the capabilities of a target. Return the export losses without duplicates.

    `cut` is True if the target also writes joints that cut loops as joints.
    """
    finder = _LossFinder(target, table, cut)
    groups: list[Iterator[Loss]] = [finder.of_assembly(assembly)]
    for robot in robots:
        groups += [finder.of_joints(robot), finder.of_mode(robot)]
    return tuple(dict.fromkeys(loss for group in groups for loss in group))


class _LossFinder:
    """Finds the features of a robot that the target with the given `capabilities` does not fully support.

    Each method yields export losses. If a loss is common to all modes, its `mode` is None. `cut` is True if the target also writes joints
    that cut loops as joints.
    """

    def __init__(self, target: str, capabilities: AnyCapabilities, cut: bool) -> None:
        self.target = target
        self.capabilities = capabilities
        self.cut = cut

    def __call__(self, cell: Cell[Any], mode: str | None, path: str, what: str, origin: Origin) -> Iterator[Loss]:
        if isinstance(cell, (Lossy, Omitted)):
            yield Loss(self.target, mode, path, what + cell.words, cell.how, origin)

    def of_joints(self, robot: Robot) -> Iterator[Loss]:
        """Yield the export losses for the joints of a mode that the target writes as joints."""
        mates = robot.assembly.mates
        groups: list[tuple[str, Sequence[TreeJoint | JointEdge]]] = [
            (mates[body.joints[0].mate].name or body.joints[0].path, body.joints) for body in robot.bodies if body.joints
        ]
        groups += [(closure.path, closure.joints) for closure in robot.closures if closure.joints and self.cut]
        joint_paths = {joint.path for _, joints in groups for joint in joints}
        for path, joints in groups:
            what = "the thread" if joints[0].twist.pitch else "the motion"
            yield from self(self.capabilities["joints"][joint_cell(joints[0].kind)], None, path, what, joints[0].origin)
            for index, joint in enumerate(joints):
                if index == 0 or not joint.kind.at_once:
                    yield from self.of_coordinate(joint, path if joint.kind.at_once else joint.path)
                yield from self.of_drive(joint)
                mimic, cells = joint.mimic, self.capabilities["of_joints"]
                if mimic is None:
                    continue
                what = f"the mimic of `{mimic.joint.path}`"
                if mimic.joint.path not in joint_paths:
                    yield from self(OMITTED, robot.mode.name, joint.path, f"{what} at a cut loop", mimic.origin)
                    continue
                yield from self(cells["mimic"], None, joint.path, what, mimic.origin)
                if mimic.higher:
                    yield from self(cells["polynomial"], None, joint.path, f"the polynomial in {what}", mimic.origin)

    def of_drive(self, joint: TreeJoint | JointEdge) -> Iterator[Loss]:
        """Yield the export loss for the drive of a joint coordinate, or for a drive of a ball joint about its own axis."""
        drive = joint.actuator
        if drive is not None:
            yield from self(self.capabilities["drives"][drive_cell(joint, drive)], None, joint.path, _describe_drive(drive), drive.origin)
            if drive.backlash:
                what = f"the backlash of {drive.backlash:.6g} {'rad' if joint.twist.turns else 'm'}"
                yield from self(self.capabilities["of_joints"]["backlash"], None, joint.path, what, drive.origin)
            yield from self.of_effects(joint.path, drive)

    def of_effects(self, path: str, drive: ActuatorModel) -> Iterator[Loss]:
        """Yield the export losses for the delay, the torque-speed line, the deadband and the noise of a drive."""
        cells = self.capabilities["of_joints"]
        if drive.delay:
            yield from self(cells["delay"], None, path, f"the delay of {drive.delay:.6g} s", drive.origin)
        for what, value in (("torque-speed line", drive.stall), ("deadband", drive.deadband), ("noise", drive.noise)):
            if value:
                yield from self(cells["effects"], None, path, f"the {what}", drive.origin)

    def of_tendon(self, tendon: LinkedTendon) -> Iterator[Loss]:
        """Yield the export losses for a tendon, or for one of the drives of a differential."""
        cells, drive = self.capabilities["of_joints"], tendon.actuator
        if drive is None or drive.transmission is None:
            yield from self(cells["tendon"], None, tendon.path, "the tendon and its dynamics", tendon.origin)
            if drive is not None and not isinstance(cells["tendon"], Omitted):
                yield from self.of_effects(tendon.path, drive)
            return
        yield from self(cells["differential"], None, tendon.path, f"the drive of the differential `{drive.transmission}`", tendon.origin)
        if not isinstance(cells["differential"], Omitted):
            yield from self(self.capabilities["drives"][drive.kind], None, tendon.path, _describe_drive(drive), drive.origin)
            yield from self.of_effects(tendon.path, drive)
            if tendon.dynamics.armature:
                unit = "kg m^2" if tendon.turns else "kg"
                what = f"the armature of {tendon.dynamics.armature:.6g} {unit}"
                yield from self(cells["armature"], None, tendon.path, what, tendon.origin)

    def of_coordinate(self, joint: TreeJoint | JointEdge, path: str) -> Iterator[Loss]:
        """Yield the export losses for a joint coordinate that moves. A ball joint counts as one coordinate."""
        cells, dynamics = self.capabilities["of_joints"], joint.dynamics
        q, push, inertia = ("rad", "N m", "kg m^2") if joint.twist.turns else ("m", "N", "kg")
        for cell, value, what, unit in (
            (cells["damping"], dynamics.damping, "damping", f"{push} s/{q}"),
            (cells["friction"], dynamics.friction, "dry friction", push),
            (cells["armature"], dynamics.armature, "armature", inertia),
            (cells["stiffness"], dynamics.stiffness, "stiffness", f"{push}/{q}"),
            (cells["cone"], joint.limit.cone, "cone", "rad"),
            (cells["velocity"], joint.limit.velocity, "velocity limit", f"{q}/s"),
        ):
            if value:
                yield from self(cell, None, path, f"the {what} of {value:.6g} {unit}", joint.origin)

    def of_mode(self, robot: Robot) -> Iterator[Loss]:
        """Yield the export losses for the base, the links, the loops and the settings of one mode."""
        mode, modes, base, bases = robot.mode, self.capabilities["modes"], robot.base, self.capabilities["bases"]
        for closure in robot.closures:
            cell = self.capabilities["loops"]["hold" if closure.hold else closure.kind]
            what = "the hold of the mount" if closure.hold else "the loop through the joint"
            yield from self(cell, mode.name, closure.path, what, closure.origin)
        for body in robot.bodies:
            link = robot.assembly.links[body.link]
            if not link.properties.mass:
                cell, what = self.capabilities["links"]["weightless" if body.joints else "weightless_base"], "the zero mass"
            elif link.properties.inertia == ZERO:
                cell, what = self.capabilities["links"]["point"], "the zero inertia of a point mass"
            elif physical_fault(link.properties.inertia) is not None:
                cell, what = self.capabilities["links"]["line"], "the inertia of point masses in a line"
            else:
                continue
            yield from self(cell, mode.name, link.name, what, link.origin)
        settings = (
            (modes["gravity"], "the gravity", robot.gravity != GRAVITY),
            (FULL if base == "fixed" else bases[base], MOVING_BASES.get(base, "the motion of the base"), base != "fixed"),
            (bases["start"], "the start pose", base == "free" and robot.bodies[0].X_PL != NO_POSE),
            *self.simulation_settings(mode.simulation),
            (modes["exclude"], "excluded contacts of links without a common joint", bool(mode.exclude)),
            (modes["pairs"], "the contact pairs", bool(mode.pairs)),
            (modes["groups"], "the contact groups", bool(mode.groups)),
        )
        for cell, what, used in settings:
            if used:
                yield from self(cell, mode.name, mode.name, what, mode.origin)

    def simulation_settings(self, simulation: Mapping[str, object]) -> tuple[tuple[Plain, str, bool], ...]:
        """Return the simulation settings in `simulation` as a tuple.

        Each item contains the capability for the setting, a description of the setting, and whether the document uses it.
        """
        modes = self.capabilities["modes"]
        return (
            (modes["timestep"], "the time step", "timestep" in simulation),
            (modes["simulation"], "the `simulation` settings", bool(simulation.keys() - {"timestep"})),
        )

    def of_sensor(self, sensor: LinkedSensor) -> Iterator[Loss]:
        """Yield an export loss for a sensor that is not written, or the export losses for the noise and the cutoff of a written sensor.

        The `cutoff` of a rangefinder is its range and not a limit of its readings.
        """
        cell, cells = self.capabilities["sensors"][sensor.kind], self.capabilities["of_sensors"]
        yield from self(cell, None, sensor.path, "the sensor", sensor.origin)
        if is_written(cell):
            if sensor.noise:
                yield from self(cells["noise"], None, sensor.path, "the noise", sensor.origin)
            if sensor.cutoff and sensor.kind != "rangefinder":
                yield from self(cells["cutoff"], None, sensor.path, "the cutoff", sensor.origin)

    def of_assembly(self, assembly: Assembly) -> Iterator[Loss]:
        """Yield the export losses that are common to all modes."""
        links = self.capabilities["links"]
        for magnet in assembly.adhesions:
            origin = assembly.occurrences[magnet.occurrence].origin
            yield from self(links["adhesion"], None, magnet.path, f"the adhesion of {magnet.force:.6g} N", origin)
        for tendon in assembly.tendons:
            yield from self.of_tendon(tendon)
        for sensor in assembly.sensors:
            yield from self.of_sensor(sensor)
        for pose in (pose for pose in assembly.poses if pose.stated):
            yield from self(self.capabilities["modes"]["poses"], None, pose.name, "the pose", pose.origin)
        in_modes = (assembly.in_mode(mode.name) for mode in assembly.modes)
        occurrences = {id(one): one for variant in (assembly, *in_modes) for one in variant.occurrences}.values()
        materials = [item.material for item in assembly.occurrences]
        with_shapes = (item for item in occurrences if item.listed or item.contacts)
        materials += [surface.material for item in with_shapes for surface in item.touching]
        for material in {id(item): item for item in materials if item is not None}.values():
            if (material.slide, material.torsion) != (None, None):
                yield from self(links["friction"], None, material.name, "the friction", material.origin)
            if material.roll is not None:
                yield from self(links["rolling"], None, material.name, "the rolling friction", material.origin)
        for cell, what, used in self.simulation_settings(assembly.definition.simulation):
            if used:
                origin = assembly.definition.step_origin or assembly.definition.origin
                yield from self(cell, None, assembly.name, what, origin)
        for occurrence in occurrences:
            for piece in occurrence.drawn:
                if isinstance(piece.solid, Primitive):
                    cell, what = self.capabilities["shapes"][piece.solid.shape], f"the visual {piece.solid.shape}"
                    yield from self(cell, None, occurrence.path, what, occurrence.origin)
            of_mesh: ShapeCell = "mesh" if occurrence.overrides.collision == "mesh" else "hull"
            for piece in occurrence.touching:
                shape = piece.solid.shape if isinstance(piece.solid, Primitive) else of_mesh
                what = "the convex collision mesh" if shape == "hull" else f"the collision {shape}"
                yield from self(self.capabilities["shapes"][shape], None, occurrence.path, what, occurrence.origin)


def _describe_drive(drive: ActuatorModel) -> str:
    """Describe a drive by its kind, its axis and its gains."""
    gains = [f", {name} {value:.6g}" for name, value in (("kp", drive.kp), ("kv", drive.kv)) if value is not None]
    about = f" about {', '.join(f'{component:.6g}' for component in drive.axis)}" if drive.axis is not None else ""
    return f"the drive: {drive.kind}{about}{''.join(gains)}"


def drive_cell(joint: TreeJoint | JointEdge, drive: ActuatorModel) -> DriveCell:
    """Return the name of the table cell for the drive of a joint, such as `position` or `ball`."""
    return joint.kind.name if joint.kind.name in ("ball", "universal") else drive.kind


def joint_cell(kind: JointKind) -> JointCell:
    """Return the name of the table cell for a joint, from its coordinates and its motion. Raises `ValueError` if the joint is fixed."""
    if not kind.moves:
        raise ValueError("a fixed joint does not move")
    if kind.at_once:
        return "free" if kind.free else "ball"
    if kind.leads:
        return "screw"
    if kind.twists == KINDS["universal"].twists:
        return "universal"
    return "several" if len(kind.twists) > 1 else "single"


def shape_cell(kind: Literal["mesh"] | PrimitiveShape) -> Literal["hull"] | PrimitiveShape:
    """Return the name of the table cell for a collision shape. Meshes count as convex."""
    return "hull" if kind == "mesh" else kind
