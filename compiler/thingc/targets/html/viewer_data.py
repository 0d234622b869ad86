"""Collect the data for the web page of a robot. The page computes all poses of links from this data. All values are JSON values in SI
units.

The `bodies` of a mode are ordered with parents before children. For coordinates q, the pose of a link is X_W,link(q) = X_W,parent @ X @
exp(twist_0 q_0) @ exp(twist_1 q_1) ... For a ball joint, the factors are replaced by `exp(twist_0 q_0 + ...)`. A loop of the mode (`loops`)
is closed if `X_W,parent @ X_PA @ exp(...) == X_W,child @ X_CB`, with the coordinates of the loop. A pose consists of 12 numbers, the first
three rows of its matrix. A twist has the form `[angular, linear, anchor]`.
"""

from __future__ import annotations

import math
import os
import re
from base64 import b64encode
from collections.abc import Sequence

from thingc.base.inertia import MassProperties, principal_axes
from thingc.base.joints.twist import Twist
from thingc.base.pose import NO_POSE, Pose
from thingc.base.source import Origin, Span
from thingc.documents.workspace import Workspace
from thingc.geometry.record import Mesh, PartDefinition
from thingc.model.assembly.kinematics import coordinates, joints_of
from thingc.model.assembly.types import Assembly, JointEdge, LinkedMount, Mate, Occurrence, Surface
from thingc.model.resolve.types import NamedMotion
from thingc.model.robot.kinematics import placed_bodies
from thingc.model.robot.tree import in_link
from thingc.model.robot.types import Body, Closure, Keyframe, Robot
from thingc.model.statics.efforts import static_efforts
from thingc.targets.bom.emit import is_listed, make_of, with_pieces
from thingc.targets.html.mesh_packing import PackedMeshes

VERSION = 1
"""Version of the format of the data. The page rejects any other version."""

TIMES = 1000
"""Largest number of steps between the times of a motion."""

SLACK = 1e-6
"""An unbalanced gravity load of the joints up to this value, relative to the total load, counts as a rounding error."""

Data = dict[str, object]


def describe(assembly: Assembly, robots: Sequence[Robot], workspace: Workspace, packed: PackedMeshes) -> Data:
    """Collect all data for the web page of a robot. The data refers to meshes by their numbers in `packed`."""
    poses_in_link = in_link(assembly)
    locations = _SourceLocations(workspace)
    definitions = {item.definition.text: item for item in assembly.occurrences}
    numbers = {text: number for number, text in enumerate(definitions)}
    return {
        "version": VERSION,
        "name": assembly.name,
        "mass": assembly.properties.mass,
        "definitions": [_definition(item, locations) for item in definitions.values()],
        "links": [{"name": link.name, **_mass(link.properties)} for link in assembly.links],
        "occurrences": [
            _occurrence(item, numbers[item.definition.text], assembly.link_of[item.index], poses_in_link[item.index], packed, locations)
            for item in assembly.occurrences
        ],
        "mounts": [{"path": item.path, "occurrence": item.occurrence, "mount": item.mount} for item in assembly.exported],
        "joints": [_joint_data(joint, mate, assembly, locations) for mate in assembly.mates for joint in mate.joints],
        "tendons": len(assembly.tendons),
        "magnets": [{"path": item.path, "occurrence": item.occurrence, "mount": item.mount} for item in assembly.adhesions],
        "bom": [
            {
                "number": row.number, "name": row.name, "definition": row.definition, "quantity": row.quantity, "make": row.make,
                "material": row.material, "mass": row.mass, "source": row.mass_source, "supplier": row.supplier, "cost": row.cost,
                "total": row.total, "link": row.link, "picture": row.picture, "image": image_url(workspace, row.picture),
                "pieces": [item.index for item in pieces],
            }
            for row, pieces in with_pieces(assembly)
        ],
        "modes": [{**_mode(robot, locations), **_collision(robot, assembly, packed)} for robot in robots],
        **({"motions": [_motion(motion, assembly) for motion in motions]} if (motions := assembly.definition.motions) else {}),
    }


def image_url(workspace: Workspace, path: str | None) -> str | None:
    """Return a picture of the workspace as a `data:` URL, so that a page contains it. Return None if it cannot be read."""
    if path is None:
        return None
    kind = {"jpg": "jpeg", "svg": "svg+xml"}.get(suffix := path.rpartition(".")[2].lower(), suffix)
    try:
        with open(os.path.join(workspace.root, path), "rb") as stream:
            return f"data:image/{kind};base64,{b64encode(stream.read()).decode()}"
    except OSError:
        return None


def source_location(span: Span | None, workspace: Workspace | None) -> Data:
    """Return `file` (the path in the workspace) and `line` of a source location. Both are null if the location is not in a file."""
    if span is None or span.option is not None or workspace is None:
        return {"file": None, "line": None}
    return {"file": workspace.relative(span.file), "line": span.line}


class _SourceLocations:
    """Looks up source locations in files of the workspace. Absolute paths are omitted, because they differ between machines."""

    def __init__(self, workspace: Workspace) -> None:
        self._workspace = workspace
        self._texts: dict[str, str] = {}

    def location(self, origin: Origin) -> Data:
        """Return `file` and `line` of the first location in an origin. Return null if the origin is empty."""
        return source_location(next(iter(origin), None), self._workspace)

    def code(self, path: str, reference: str) -> Data:
        """Return `file` and `line` of the class or function of a part. Return null if the file is outside of the workspace.

        The line is searched in the current file. The part record may contain an older line, because an edit that only moves lines does not
        rebuild the part.
        """
        if not self._workspace.contains(path):
            return {"file": None, "line": None}
        if path not in self._texts:
            try:
                with open(path, encoding="utf-8", errors="replace") as stream:
                    self._texts[path] = stream.read()
            except OSError:
                self._texts[path] = ""
        text = self._texts[path]
        name = re.escape(reference.rpartition(":")[2].rpartition(".")[2])
        head = re.search(rf"^[ \t]*(?:class|def)[ \t]+{name}\b", text, re.MULTILINE)
        line = text.count("\n", 0, head.start()) + 1 if head is not None else None
        return {"file": self._workspace.relative(path), "line": line}


def _definition(occurrence: Occurrence, places: _SourceLocations) -> Data:
    """Return the data of a part definition for the page. All its occurrences share this data."""
    definition, source, record = occurrence.definition, occurrence.component.definition, occurrence.record
    location: Data = {"file": definition.reference if definition.kind == "file" else None, "line": None}
    if record is not None and record.code is not None and os.path.isabs(record.code[0]):
        location = places.code(record.code[0], definition.reference)
    parameters = [*zip((name for name, _ in source.parameters), source.words, strict=False)] if isinstance(source, PartDefinition) else []
    return {
        "text": definition.text, "label": definition.label, "kind": definition.kind,
        "mirrors": definition.plain.label if definition.plain is not None else None, "parameters": parameters, **location,
    }


def _occurrence(occurrence: Occurrence, definition: int, link: int, pose: Pose, packed: PackedMeshes, places: _SourceLocations) -> Data:
    return {
        "path": occurrence.path, "definition": definition, "link": link, "pose": _rows(pose), "mass": occurrence.properties.mass,
        "centre": occurrence.properties.centre, "source": occurrence.mass_source, "estimate": occurrence.estimate,
        "material": occurrence.material.name if occurrence.material is not None else None, "color": occurrence.color,
        "make": make_of(occurrence) if is_listed(occurrence) else None,
        "visual": [{**_shape(surface, packed), "color": surface.color} for surface in occurrence.drawn],
        "collides": occurrence.overrides.collision,
        "collision": [_shape(surface, packed) for surface in occurrence.touching],
        "mounts": [
            {"name": name, "pose": _rows(mount.pose), "interface": mount.interface}
            for name, mount in occurrence.mounts.items() if name != "origin"
        ],
        **places.location(occurrence.origin),
    }


def _shape(surface: Surface, packed: PackedMeshes) -> Data:
    solid = surface.solid
    if isinstance(solid, Mesh):
        return {"shape": "mesh", "mesh": packed.number(solid), "pose": None if surface.pose == NO_POSE else _rows(surface.pose)}
    return {"shape": solid.shape, "size": solid.size, "pose": _rows(solid.pose)}


def _mass(properties: MassProperties) -> Data:
    """Return the mass [kg], the centre of mass [m], the principal moments of inertia [kg m^2], and `axes`, whose columns are the principal
    axes.
    """
    moments, axes = principal_axes(properties.inertia)
    return {"mass": properties.mass, "centre": properties.centre, "moments": moments, "axes": [x for row in axes for x in row]}


def _motion(motion: NamedMotion, assembly: Assembly) -> Data:
    """Return the data of a motion for the page: q of all joints at its times, or at about `TIMES` of them."""
    last = len(motion.times) - 1
    rows = [*range(0, last, -(-last // TIMES)), last]
    states = [coordinates(joints_of(assembly), {path: values[row] for path, values in motion.values.items()}) for row in rows]
    return {
        "name": motion.name, "times": [motion.times[row] for row in rows], "smooth": motion.smooth,
        "q": {path: [state[path] for state in states] for path in states[0]},
    }


def _joint_data(joint: JointEdge, mate: Mate, assembly: Assembly, places: _SourceLocations) -> Data:
    """Return the data of a joint coordinate for the page. The data of a coordinate are the same in all modes.

    `parent` and `child` are the indices of links in the document.
    """
    drive = joint.actuator
    return {
        "path": joint.path, "joint": mate.name, "kind": joint.kind.name, "turns": joint.twist.turns,
        "axis": "xyz"[max(range(3), key=lambda k: abs(joint.twist.axis[k]))],
        "parent": assembly.link_of[mate.parent], "child": assembly.link_of[mate.child],
        "lower": joint.limit.lower, "upper": joint.limit.upper, "cone": joint.limit.cone, "offset": joint.offset,
        "effort": joint.limit.effort, "velocity": joint.limit.velocity,
        "stiffness": joint.dynamics.stiffness, "rest": joint.dynamics.rest,
        "mimic": None if joint.mimic is None else {
            "joint": joint.mimic.joint.path, "multiplier": joint.mimic.multiplier, "offset": joint.mimic.offset,
            "higher": joint.mimic.higher,
        },
        "drive": None if drive is None else drive.kind, "drive_axis": None if drive is None else drive.axis,
        **places.location(joint.origin),
    }


def _mount(mount: LinkedMount) -> Data:
    return {"path": mount.path, "occurrence": mount.occurrence, "mount": None if mount.of_component else mount.mount}


def _mode(robot: Robot, places: _SourceLocations) -> Data:
    mode = robot.mode
    return {
        "name": mode.name, "root": _mount(mode.root),
        "base": robot.base, "at": _rows(mode.at), "gravity": robot.gravity,
        "bodies": [_body(body) for body in robot.bodies],
        "loops": [_loop(closure) for closure in robot.closures],
        "feet": [_mount(foot.mount) for foot in mode.feet],
        "adhesion": {path: force for path, force in robot.adhesion.items() if force > 0.0},
        "driven": robot.present,
        "start": robot.start.name or None,
        "poses": [_pose(robot, frame) for frame in robot.keyframes],
        "unclosed": [pose.name for pose in robot.unclosed],
        **places.location(mode.origin),
    }


def _collision(robot: Robot, assembly: Assembly, packed: PackedMeshes) -> Data:
    """Return the collision shapes that a mode replaces, by the index of their occurrence, as `collision`."""
    replaced = [(one, other) for one, other in zip(robot.assembly.occurrences, assembly.occurrences) if one.touching != other.touching]
    return {"collision": {one.index: [_shape(surface, packed) for surface in one.touching] for one, _ in replaced}} if replaced else {}


def _body(body: Body) -> Data:
    return {
        "link": body.link, "parent": body.parent, "X": _rows(body.X_PL), "at_once": body.at_once,
        "joints": _moves(body.joints, body.twists),
    }


def _loop(closure: Closure) -> Data:
    return {
        "path": closure.path, "hold": closure.hold, "parent": closure.parent, "child": closure.child, "turns": closure.turns,
        "at_once": closure.at_once, "X_PA": _rows(closure.X_PA), "X_CB": _rows(closure.X_CB),
        "joints": _moves(closure.joints, closure.twists),
    }


def _pose(robot: Robot, frame: Keyframe) -> Data:
    """Return the data of a pose of a mode for the web page.

    The data contains q by path, and the pose of the base if it differs. `margins` contains the torque margin of each drive. `falls` is True
    if the robot falls in this pose, regardless of its drives. `unheld` is the joint that the drives cannot hold: an empty string for the
    base, and null if the drives hold all joints.
    """
    q = coordinates(joints_of(robot.assembly), frame.q)
    base = frame.base or robot.bodies[0].X_PL
    efforts = static_efforts(robot, q, placed_bodies(robot.bodies, q, base)) if robot.base != "free" or robot.carried else None
    falls = efforts is not None and efforts.fall is not None
    margins = efforts.margins if efforts is not None and not falls else {}
    return {
        "name": frame.name, "q": q, "base": _rows(frame.base) if frame.base is not None else None,
        "margins": {path: margin for path, margin in margins.items() if math.isfinite(margin)},
        "falls": falls, "unheld": efforts.where if efforts is not None and efforts.unheld > SLACK else None,
    }


def _moves(joints: Sequence[JointEdge], twists: Sequence[Twist]) -> list[Data]:
    return [{"path": joint.path, "twist": [twist.angular, twist.linear, twist.anchor]} for joint, twist in zip(joints, twists, strict=True)]


def _rows(pose: Pose) -> list[float]:
    return [x for row in pose.rows()[:3] for x in row]
