"""The robot as files call it: what `names:` of the documents says goes before the paths of things.

Targets that other programs read by name (`Target.by_name`) are asked with this robot, and know of no other name. A `/` in a name is written
as one in a path is.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TypeVar

from thingc.emit.mjcf.adding import KINDS, OBJECTS
from thingc.emit.request import EmitRequest
from thingc.graph.types import (
    ActuatorModel,
    Assembly,
    FileNames,
    JointEdge,
    LinkedMode,
    LinkedMount,
    LinkedSensor,
    LinkedTendon,
    Mate,
    RootChoice,
)
from thingc.resolve.coordinates import CoordinateName, Mimic
from thingc.resolve.model import NamedPose, RawAttribute, RawElement
from thingc.robot.types import Closure, CoreJoint, Keyframe, Robot

Value = TypeVar("Value")

MADE = "called"
"""Where the request that has been made of another is kept."""

def called(request: EmitRequest) -> EmitRequest:
    """The request with the names of files in it; itself, where those are the paths."""
    names = request.assembly.names
    if names is None:
        return request
    known = request.made.get(MADE)
    if isinstance(known, EmitRequest):
        return known
    caller = _Caller(request.assembly, names)
    made = replace(request, assembly=caller.assembly, robots=tuple(map(caller.robot, request.robots)), made={})
    request.made[MADE] = made
    return made


class _Caller:
    """Lays the names over an assembly and its robots."""

    def __init__(self, assembly: Assembly, names: FileNames) -> None:
        self.names = names
        self.joints = dict(names.joints)
        """By path: whole joints, and their coordinates."""
        for mate in assembly.mates:
            whole = names.joints.get(mate.name or "")
            for joint in mate.joints if whole is not None else ():
                self.joints[joint.path] = f"{whole}{joint.path.removeprefix(mate.name or '')}"
        self.raw = {
            "joint": self.joints, "numeric": self.joints, "equality": names.mounts | self.joints,
            "body": names.components, "link": names.components, "site": names.mounts, "key": names.poses,
            "actuator": {path: self.joints.get(path, path) for path in self.joints} | names.actuators,
            "sensor": names.sensors, "camera": names.sensors,
        }
        self.assembly = self._assembly(assembly)
        self.modes = {mode.name: mode for mode in self.assembly.modes}

    # --- what is in both ---------------------------------------------------------------------------------------------

    def joint(self, path: str) -> str:
        return self.joints.get(path, path)

    def mount(self, path: str) -> str:
        """Also a component, which is a frame where its link is called after another one."""
        return self.names.mounts.get(path) or self.names.components.get(path, path)

    def pose(self, name: str) -> str:
        return self.names.poses.get(name, name)

    def of_joints(self, values: Mapping[str, Value]) -> dict[str, Value]:
        """By joint."""
        return {self.joint(path): value for path, value in values.items()}

    def mimic(self, mimic: Mimic | None) -> Mimic | None:
        return None if mimic is None else replace(mimic, joint=self.coordinate(mimic.joint))

    def coordinate(self, name: CoordinateName) -> CoordinateName:
        return name.in_files(self.joint(name.path))

    def drive(self, joint: JointEdge | CoreJoint) -> ActuatorModel | None:
        own = self.names.actuators.get(joint.path)
        return joint.actuator if joint.actuator is None or own is None else replace(joint.actuator, name=own)

    def edge(self, joint: JointEdge) -> JointEdge:
        return replace(joint, name=self.coordinate(joint.name), mimic=self.mimic(joint.mimic), actuator=self.drive(joint))

    def core(self, joint: CoreJoint) -> CoreJoint:
        return replace(joint, path=self.joint(joint.path), mimic=self.mimic(joint.mimic), actuator=self.drive(joint))

    # --- without a root ------------------------------------------------------------------------------------------------

    def _assembly(self, assembly: Assembly) -> Assembly:
        links = self.names.components
        return replace(
            assembly,
            links=tuple(replace(link, name=links.get(link.name, link.name)) for link in assembly.links),
            mates=tuple(map(self._mate, assembly.mates)),
            exported=tuple(replace(mount, path=self.mount(mount.path)) for mount in assembly.exported),
            poses=tuple(map(self._named_pose, assembly.poses)),
            modes=tuple(map(self._mode, assembly.modes)),
            adhesions=tuple(replace(one, path=self.mount(one.path)) for one in assembly.adhesions),
            raw=tuple(map(self._attribute, assembly.raw)),
            added=tuple(map(self._element, assembly.added)),
            tendons=tuple(map(self._tendon, assembly.tendons)),
            sensors=tuple(map(self._sensor, assembly.sensors)),
            names=None,
        )

    def _mate(self, mate: Mate) -> Mate:
        name, loop = (None if path is None else self.joint(path) for path in (mate.name, mate.loop))
        return replace(mate, name=name, loop=loop, joints=tuple(map(self.edge, mate.joints)))

    def _named_pose(self, pose: NamedPose) -> NamedPose:
        return replace(pose, name=self.pose(pose.name), values=self.of_joints(pose.values), origins=self.of_joints(pose.origins))

    def _root(self, root: RootChoice) -> RootChoice:
        return replace(root, path=self.mount(root.path))

    def _mode(self, mode: LinkedMode) -> LinkedMode:
        return replace(
            mode,
            root=self._root(mode.root),
            poses=tuple(map(self.pose, mode.poses)),
            pose=None if mode.pose is None else self.pose(mode.pose),
            actuators=None if mode.actuators is None else tuple(map(self.joint, mode.actuators)),
            adhesion={self.mount(path): force for path, force in mode.adhesion.items()},
            holds=tuple(replace(hold, mount=self._root(hold.mount)) for hold in mode.holds),
            cut=tuple(replace(cut, joint=self.joint(cut.joint)) for cut in mode.cut),
            feet=tuple(replace(foot, mount=self._root(foot.mount)) for foot in mode.feet),
            at_in={self.pose(name): at for name, at in mode.at_in.items()},
        )

    def _linked(self, mount: LinkedMount | None) -> LinkedMount | None:
        return None if mount is None else replace(mount, path=self.mount(mount.path))

    def _tendon(self, tendon: LinkedTendon) -> LinkedTendon:
        steps = (replace(step, mount=self._linked(step.mount), side=self._linked(step.side)) for step in tendon.steps)
        return replace(tendon, moves=self.of_joints(tendon.moves), steps=tuple(steps))

    def _sensor(self, sensor: LinkedSensor) -> LinkedSensor:
        names, begin = self.names.sensors, f"{sensor.path}:"
        return replace(
            sensor,
            path=names.get(sensor.path, sensor.path),
            at=self._linked(sensor.at),
            seen_from=self._linked(sensor.seen_from),
            joint=None if sensor.joint is None else self.joint(sensor.joint),
            parts={path.removeprefix(begin): name for path, name in names.items() if path.startswith(begin)},
        )

    # --- raw -------------------------------------------------------------------------------------------------------------

    def _attribute(self, attribute: RawAttribute) -> RawAttribute:
        path = attribute.path
        if len(path) < 3:
            return attribute
        named, name = self.raw.get(path[0], {}), path[1].replace(".", "/")
        thing, colon, part = name.partition(":")  # `knee:mimic` is the equality of a joint, `imu:gyro` a part of a sensor
        name = named.get(name) or (f"{named[thing]}:{part}" if colon and thing in named else path[1])
        return replace(attribute, path=(path[0], name, *path[2:]))

    def _element(self, element: RawElement) -> RawElement:
        attributes = {}
        for name, value in element.attributes.items():
            said = element.attributes.get(OBJECTS.get(name, ""))
            kind = {"xbody": "body"}.get(said, said) if said is not None else KINDS.get(name)
            path = CoordinateName(value.replace("/", ".")).path if kind == "joint" else value
            attributes[name] = self.raw.get(kind or "", {}).get(path, value)
        return replace(element, attributes=attributes, children=tuple(map(self._element, element.children)))

    # --- of a mode -------------------------------------------------------------------------------------------------------

    def robot(self, robot: Robot) -> Robot:
        """The same robot of a mode."""
        return replace(
            robot,
            mode=self.modes[robot.mode.name],
            assembly=self.assembly,
            bodies=tuple(replace(body, joints=tuple(map(self.core, body.joints))) for body in robot.bodies),
            sites=tuple(replace(site, path=self.mount(site.path)) for site in robot.sites),
            keyframes=tuple(map(self._keyframe, robot.keyframes)),
            present=tuple(map(self.joint, robot.present)),
            adhesion={self.mount(path): force for path, force in robot.adhesion.items()},
            closures=tuple(map(self._closure, robot.closures)),
            unclosed=tuple(
                replace(one, name=self.pose(one.name), path=self.joint(one.path), moved=self.of_joints(one.moved)) for one in robot.unclosed
            ),
        )

    def _keyframe(self, frame: Keyframe) -> Keyframe:
        return replace(frame, name=self.pose(frame.name), q=self.of_joints(frame.q), moved=self.of_joints(frame.moved))

    def _closure(self, closure: Closure) -> Closure:
        path = self.mount(closure.path) if closure.hold else self.joint(closure.path)
        return replace(closure, path=path, joints=tuple(map(self.edge, closure.joints)))
