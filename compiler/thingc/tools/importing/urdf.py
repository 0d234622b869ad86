"""Read URDF (https://wiki.ros.org/urdf/XML): the links and joints of one tree, in SI units.

A separate process expands xacro files to URDF. The source locations of generated elements are in the xacro files.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Iterable, Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import cast

from msgspec.structs import replace

from thingc.base.diagnostics import Code, Report
from thingc.base.inertia import MassProperties
from thingc.base.one_line_repr import format_count
from thingc.base.pose import NO_POSE
from thingc.base.source import line_of
from thingc.base.suggestions import did_you_mean
from thingc.geometry.worker.sandbox import OUTSIDE
from thingc.targets.urdf.links import UNBOUNDED
from thingc.tools.importing import source_model
from thingc.tools.importing.tree import check_mimics, root_of
from thingc.tools.importing.urdf_blocks import TAGS, Blocks
from thingc.tools.importing.xml_source import MOST_BYTES, Losses, SourceElement, read_xml
from thingc.tools.importing.xml_values import Values

KINDS = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
Color = tuple[float, float, float, float]
WORLD = "world"
"""Names of root links that represent the world."""

ATTRIBUTES: dict[str, set[str]] = {
    "robot": {"name", "version"}, "link": {"name"}, "joint": {"name", "type"}, "inertial": set(), "origin": {"xyz", "rpy", "quat_xyzw"},
    "mass": {"value"}, "inertia": {"ixx", "ixy", "ixz", "iyy", "iyz", "izz"}, "parent": {"link"}, "child": {"link"}, "axis": {"xyz"},
    "limit": {"lower", "upper", "effort", "velocity"}, "dynamics": {"damping", "friction"}, "mimic": {"joint", "multiplier", "offset"},
    "visual": {"name"}, "collision": {"name"}, "geometry": set(), "box": {"size"}, "sphere": {"radius"}, "cylinder": {"radius", "length"},
    "capsule": {"radius", "length"}, "mesh": {"filename", "scale"}, "material": {"name"}, "color": {"rgba"},
}
"""Supported XML attributes by element tag."""
INSIDE: dict[str, set[str]] = {
    "robot": {"link", "joint", "material"}, "link": {"inertial", "visual", "collision"}, "inertial": {"origin", "mass", "inertia"},
    "joint": {"origin", "parent", "child", "axis", "limit", "dynamics", "mimic"}, "visual": {"origin", "geometry", "material"},
    "collision": {"origin", "geometry"}, "geometry": {"box", "sphere", "cylinder", "capsule", "mesh"}, "material": {"color"},
}
"""Supported child elements by element tag."""


def read_urdf(path: str, data: bytes, report: Report, *, files: Sequence[str] = ()) -> source_model.SourceRobot | None:
    """Read the robot in a URDF file. `data` is the content of the file at the absolute path `path`.

    If the file has errors, report the errors and return None. `files` are the xacro files from which the URDF was generated.
    """
    root = read_xml(path, data, report, tags=["robot"], files=files)
    if root is None:
        return None
    macro = next((element for element in _walk(root) if element.tag.startswith("xacro:")), None)
    if macro is not None:
        message = f"`<{macro.tag}>` is a xacro element"
        report.add(Code.SOURCE_XML, message, macro.where, help="rename the file to `.xacro` to expand it")
        return None
    return _Urdf(root, report).robot()


def _walk(element: SourceElement) -> Iterable[SourceElement]:
    yield element
    for child in element.children:
        yield from _walk(child)


class _Urdf:
    def __init__(self, root: SourceElement, report: Report) -> None:
        self.root, self.report, self.values = root, report, Values(report)
        self.losses, self.unlimited = Losses(), list[SourceElement]()
        self.moving = {  # invalid types are reported elsewhere
            element.attributes.get("name", "") for element in root.all("joint")
            if element.attributes.get("type") not in ("fixed", "floating", "planar")
        }
        inside = (found for link in root.all("link") for visual in link.all("visual") for found in visual.all("material"))
        self.materials: dict[str, SourceElement] = {}
        for material in (*root.all("material"), *inside):  # like urdfdom, use the first definition of a name
            if material.children and (name := material.attributes.get("name", "")):
                self.materials.setdefault(name, material)
        self.colors = {name: self._rgba(material) for name, material in self.materials.items()}
        self.blocks = Blocks(root, self.values, self.losses)

    def robot(self) -> source_model.SourceRobot | None:
        """Convert the URDF to the source model. If the URDF has errors, report the errors and return None."""
        name = self.root.attributes.get("name", "").strip()
        if not name:
            name = os.path.splitext(os.path.basename(self.root.where.file))[0]
            self.losses.note("`name` of `<robot>`", f"missing (the name of the file is used: `{name}`)", self.root.where)
        links = tuple(link for element in self.root.all("link") if (link := self._link(element)) is not None)
        attachments = tuple(attachment for element in self.root.all("joint") if (attachment := self._attachment(element)) is not None)
        unknown = "both values are treated as unknown"
        for limit in self.unlimited:
            self.losses.note("`effort` and `velocity` of a joint, both 0", unknown, limit.where)
        for limit in self.unlimited[:1]:
            message = f"`effort` and `velocity` are both 0 in {format_count(len(self.unlimited), 'joint')}"
            help = 'write the limits of the motor, for example effort="10" velocity="5"'
            self.report.warn(Code.SOURCE_DOUBT, message, limit.place("effort"), help=help)
        check_mimics(attachments, self.moving, self.report)
        self.losses.unread(self.root, ATTRIBUTES, INSIDE, {}, [one.where for one in self.root.children if one.tag in TAGS])
        if self.report.failed:  # these errors would cause errors about the tree
            return None
        root = root_of(links, attachments, self.root.where, self.report)
        if root is None:
            return None
        links, sensors = self._add_sensor_frames(links, attachments)
        transmissions = tuple(self._transmissions(attachments))  # also records losses
        return self._remove_world_link(source_model.SourceRobot(
            name=name, where=self.root.place("name"), root=root, links=links, attachments=attachments, losses=self.losses.all(),
            mesh_folder=self.blocks.meshes, sensors=sensors, transmissions=transmissions, base="free" if self.blocks.free else "fixed",
        ))

    def _add_sensor_frames(
        self, links: tuple[source_model.SourceLink, ...], attachments: tuple[source_model.Attachment, ...],
    ) -> tuple[tuple[source_model.SourceLink, ...], tuple[source_model.SourceSensor, ...]]:
        """Add the frames of the sensors to the links. Return the changed links and the sensors.

        A sensor on an empty link, which serves only as a frame, is moved to the link to which this frame is fixed.
        """
        named, attachment_of = {link.name: link for link in links}, {one.child: one for one in attachments}
        carrying, sensors = {one.parent for one in attachments}, list[source_model.SourceSensor]()
        for sensor in self.blocks.sensors.values():
            link = sensor.link or ""
            over = attachment_of.get(link)
            if not {link, link if over is None else over.parent} <= named.keys():
                continue  # reported elsewhere
            is_frame = named[link].weight is None and not named[link].shapes and link not in carrying
            if over is not None and not over.joints and not over.floating and is_frame:
                if sensor.kind == "imu" and sensor.pose == NO_POSE:
                    sensors.append(replace(sensor, link=None, site=link))
                    continue
                link = over.parent
                sensor = replace(sensor, link=link, pose=over.pose @ sensor.pose)
            if sensor.kind == "imu":
                site = source_model.SourceSite(name=sensor.name, pose=sensor.pose, where=sensor.where)
                named[link] = replace(named[link], sites=(*named[link].sites, site))
                sensor = replace(sensor, link=None, pose=NO_POSE, site=sensor.name)
            sensors.append(sensor)
        return tuple(named[link.name] for link in links), tuple(sensors)

    def _transmissions(self, attachments: tuple[source_model.Attachment, ...]) -> Iterable[source_model.SourceTransmission]:
        """Yield the transmissions between actuators and independent joints. Other transmissions are recorded as losses."""
        joints = {joint.name: joint for attachment in attachments for joint in attachment.joints if joint.follows is None}
        for transmission in self.blocks.transmissions.values():
            names = transmission.joints
            if joints.keys() >= set(names) and (len(names) > 1 or joints[names[0]].drive is not None):
                yield transmission
            else:
                reason = "a joint of the transmission is not driven independently"
                self.losses.note(f"the reductions of transmission `{transmission.name}`", reason, transmission.where)

    def _link(self, element: SourceElement) -> source_model.SourceLink | None:
        name = self.values.word(element, "name")
        inertial = self.values.one(element, "inertial")
        shapes = tuple(
            shape for use in element.children if use.tag in ("visual", "collision") and (shape := self._shape(use, name or "")) is not None
        )
        slide = self.blocks.friction.get(name or "")
        if slide is not None:
            shapes = tuple(replace(shape, friction=(slide,)) if shape.use == "collision" else shape for shape in shapes)
        weight = None if inertial is None else self._weight(inertial)
        return None if name is None else source_model.SourceLink(name=name, where=element.place("name"), weight=weight, shapes=shapes)

    def _weight(self, inertial: SourceElement) -> source_model.Weight | None:
        """Read the mass properties of a link. Return None if the link is massless."""
        pose, _ = self.values.origin(inertial)
        mass_element, moments = self.values.one(inertial, "mass"), self.values.one(inertial, "inertia")
        if mass_element is None:
            self.values.fault(inertial, None, "`<inertial>` has no `<mass>`", 'write <mass value="..."/>')
            return None
        mass = self.values.from_zero(mass_element, "value")
        properties = MassProperties(mass=mass or 0.0, centre=pose.translation)
        if moments is not None:
            properties = self.values.inertia(moments, mass or 0.0, pose)
        if mass is None:
            return None
        if mass == 0.0:
            if any(map(any, properties.inertia)):
                self.losses.note("the inertia of a link", "the link has no mass", inertial.where)
            return None
        return source_model.Weight(properties=properties, where=inertial.where)

    def _shape(self, element: SourceElement, link: str) -> source_model.SourceShape | None:
        (pose, rpy), geometry = self.values.origin(element), self.values.one(element, "geometry")
        forms = [] if geometry is None else [form for form in geometry.children if form.tag in INSIDE["geometry"]]
        if geometry is None or not geometry.children:
            help = 'write <geometry><box size="..."/></geometry>'
            self.values.fault(geometry or element, None, f"`<{element.tag}>` has no geometry", help)
        if not forms:
            return None
        shape = self.values.shape(element, forms[0], "filename", pose, self.losses)
        if shape is None:
            return None
        materials = [*element.all("material")]
        for other in materials[1:]:
            self.losses.note("a second `<material>` of a `<visual>`", "the first `<material>` is used", other.where)
        color = self._color(materials[0]) if materials else None
        return replace(shape, rpy=rpy, color=color, name=self.values.own_name(element, link, "(:collision)?"))

    def _color(self, material: SourceElement) -> Color | None:
        """Return the RGBA colour of a material. If several materials have the same name, the first definition is used."""
        name = material.attributes.get("name", "")
        if not name:
            return self._rgba(material)
        if name not in self.colors:
            self.colors[name] = None
            self.losses.note(f"material `{name}`", "the file does not define the material", material.where)
            help = did_you_mean(name, self.materials, what="materials")
            self.report.warn(Code.SOURCE_DOUBT, f"material `{name}` is not defined", material.place("name"), help=help)
        first = self.materials.get(name, material)
        if [color.attributes for color in material.all("color")] not in ([], [color.attributes for color in first.all("color")]):
            reason = f"line {first.where.line} defines another material of that name first"
            self.losses.note(f"the colour of material `{name}`", reason, material.where)
        return self.colors[name]

    def _rgba(self, material: SourceElement) -> Color | None:
        color = self.values.one(material, "color")
        rgba = None if color is None else self.values.numbers(color, "rgba", 4)
        return None if rgba is None else (rgba[0], rgba[1], rgba[2], rgba[3])

    def _attachment(self, element: SourceElement) -> source_model.Attachment | None:
        name, kind = self.values.word(element, "name"), self.values.word(element, "type")
        ends = {side: end for side in ("parent", "child") if (end := self._end(element, side)) is not None}
        pose, rpy = self.values.origin(element)
        if kind is not None and kind not in KINDS:
            self.values.fault(element, "type", f"unknown joint type `{kind}`", did_you_mean(kind, KINDS, what="kinds"))
            return None
        joint = None if name is None or kind is None else self._joint(element, name, kind)
        if name is None or kind is None or len(ends) < 2:
            return None
        return source_model.Attachment(
            name=name, parent=ends["parent"], child=ends["child"], pose=pose, rpy=rpy, where=element.where,
            joints=() if joint is None else (joint,), floating=kind == "floating",
            ends={side: next(element.all(side)).place("link") for side in ends},
        )

    def _end(self, element: SourceElement, side: str) -> str | None:
        end = self.values.one(element, side)
        if end is None:
            self.values.fault(element, None, f"`<joint>` has no `<{side}>`", f'write <{side} link="..."/>')
            return None
        return self.values.word(end, "link")

    def _joint(self, element: SourceElement, name: str, kind: str) -> source_model.SourceJoint | None:
        """Read a URDF joint. Return None for a fixed joint."""
        if kind == "fixed":
            return None
        if kind == "floating":
            return source_model.SourceJoint(name=name, kind="free", axis=(0.0, 0.0, 1.0), where=element.where)
        moving = cast("source_model.Kind", kind)
        axis = self.values.one(element, "axis")
        direction = (1.0, 0.0, 0.0) if axis is None else self.values.direction(axis, "xyz", (1.0, 0.0, 0.0))
        mimic = self.values.one(element, "mimic")
        follows = None if mimic is None else self._mimic(mimic, name)
        ends = self._ends(element, moving, follows is not None)
        if moving == "revolute" and ends.lower is None and follows is None:
            moving = "continuous"
        dynamics = self.values.one(element, "dynamics")
        damping = friction = 0.0
        if dynamics is not None:
            damping, friction = (self.values.from_zero(dynamics, key, 0.0) or 0.0 for key in ("damping", "friction"))
        coupled = any(name in transmission.joints and len(transmission.joints) > 1 for transmission in self.blocks.transmissions.values())
        controlled = name in self.blocks.driven and not coupled if self.blocks.driven is not None else (ends.effort or 0.0) > 0.0
        if ends.effort == 0.0 == ends.velocity and follows is None:  # exporters write zeros for unknown limits
            ends = replace(ends, effort=None, velocity=None)
            self.unlimited.append(next(element.all("limit")))
        motor = source_model.SourceDrive(name=name, kind="motor", where=element.where, effort=ends.effort)
        return source_model.SourceJoint(
            name=name, kind=moving, axis=direction, where=element.where, ends=ends, damping=damping, friction=friction, follows=follows,
            drive=motor if controlled and follows is None else None,
        )

    def _mimic(self, mimic: SourceElement, name: str) -> source_model.SourceMimic | None:
        """Read the `<mimic>` element of a joint, which couples the joint to another joint.

        Return None if the other joint is fixed, as Pinocchio and MoveIt do.
        """
        joint = self.values.word(mimic, "joint")
        multiplier, offset = self.values.number(mimic, "multiplier", 1.0), self.values.number(mimic, "offset", 0.0)
        if joint is None or multiplier is None or offset is None:
            return None
        if joint not in self.moving:
            self.losses.note(f"the mimic of `{joint}` by joint `{name}`", "the other joint does not move", mimic.where)
            message = f"joint `{name}` mimics `{joint}`, not a moving joint"
            help = did_you_mean(joint, sorted(self.moving - {name}), what="joints")
            self.report.warn(Code.SOURCE_DOUBT, message, mimic.place("joint"), help=help)
            return None
        return source_model.SourceMimic(joint=joint, coefficients=(offset, multiplier), where=mimic.place("joint"))

    def _ends(self, element: SourceElement, kind: source_model.Kind, follows: bool) -> source_model.SourceLimits:
        limit = self.values.one(element, "limit")
        if limit is None:
            if kind in ("revolute", "prismatic") and not follows:
                help = 'write <limit lower="..." upper="..." effort="..." velocity="..."/>'
                self.values.fault(element, None, f"a `{kind}` joint requires `<limit>`", help)
            return source_model.SourceLimits()
        effort, velocity = (self.values.from_zero(limit, key) if key in limit.attributes else None for key in ("effort", "velocity"))
        velocity = None if velocity is not None and velocity >= UNBOUNDED else velocity  # written for joints without a limit
        lower, upper = self.values.number(limit, "lower", 0.0), self.values.number(limit, "upper", 0.0)
        if kind not in ("revolute", "prismatic"):
            if lower != upper:
                self.losses.note("`lower` and `upper` of a joint", f"a `{kind}` joint has no limits", limit.where)
            return source_model.SourceLimits(effort=effort, velocity=velocity)
        if lower is None or upper is None:
            return source_model.SourceLimits()
        if lower > upper:
            self.values.fault(
                limit, "lower", f"`lower` ({lower:g}) is above `upper` ({upper:g})", "swap the two limits, or correct one of them",
            )
        if lower == upper:
            if kind == "prismatic" and not follows:
                help = "use the type `fixed`, or correct the limits of the joint"
                self.values.fault(limit, None, f"`lower` and `upper` of a joint are both {lower:g}", help)
            elif not follows:
                what = f"`lower` and `upper` of a joint, both {lower:g}"
                self.losses.note(what, "read as a joint without limits, as in simulators", limit.where)
            return source_model.SourceLimits(effort=effort, velocity=velocity)
        return source_model.SourceLimits(lower=lower, upper=upper, effort=effort, velocity=velocity)

    def _remove_world_link(self, robot: source_model.SourceRobot) -> source_model.SourceRobot:
        """Remove an empty root link with only one child. The child must be floating, or a fixed child of a root link called `world`."""
        first = [attachment for attachment in robot.attachments if attachment.parent == robot.root]
        world = next(link for link in robot.links if link.name == robot.root)
        is_empty = world.weight is None and not world.shapes and len(first) == 1 and (first[0].floating or not first[0].joints)
        if not is_empty or robot.root != WORLD and not first[0].floating:
            return robot
        return replace(
            robot, root=first[0].child, base="free" if first[0].floating else "fixed", pose=first[0].pose,
            links=tuple(link for link in robot.links if link is not world),
            attachments=tuple(attachment for attachment in robot.attachments if attachment is not first[0]),
        )


SECONDS = 60
"""Maximum CPU time of xacro [s]. The maximum elapsed time is five times longer."""
PATIENCE = 30.0
"""Additional time [s] after which the process that enforces the time limits is ended."""
_ARGUMENTS = tuple(map(re.compile, (r"<xacro:arg\s[^>]*?\bname\s*=\s*[\"']([^\"']+)", r"\$\(arg\s+([^\s)]+)", r"\barg\([\"']([^\"']+)")))
"""Regular expressions for declarations and uses of arguments in a xacro file."""


def expand_xacro(path: str, arguments: Mapping[str, str], packages: Mapping[str, str], report: Report) -> tuple[bytes, list[str]] | None:
    """Expand the xacro file at an absolute path. Return the URDF text and the paths of the xacro files that were read.

    If xacro fails, report an error and return None. Each element of the URDF has an attribute with its source location.
    """
    if find_spec("xacro") is None or not hasattr(os, "fork"):
        needed, install = ("an optional package", "pip install 'thingc[import]'; or ") if hasattr(os, "fork") else ("Linux or macOS", "")
        help = f"{install}run `xacro {path} > robot.urdf`, and import robot.urdf"
        report.add(Code.COMMAND_LINE, f"xacro files require {needed}", None, help=help)
        return None
    limits = {"seconds": SECONDS, "timeout": 5.0 * SECONDS}
    request = json.dumps({"path": path, "packages": dict(packages), "arguments": dict(arguments), **limits})
    command = [sys.executable, "-P", "-m", "thingc.tools.importing.xacro_worker"]
    try:
        process = subprocess.run(command, input=f"{request}\n", capture_output=True, text=True, timeout=5.0 * SECONDS + PATIENCE)
        answer = json.loads(process.stdout)
    except (subprocess.TimeoutExpired, ValueError):
        answer = {"failed": "crashed", "message": "the process ended"}
    fault = answer.get("fault")
    if "failed" in answer:
        reason = answer["message"] or f"xacro took longer than {5 * SECONDS} s"
        fault = f"xacro failed ({reason}); the limits are {SECONDS} s and 2 GB"
    elif answer.get("left"):
        fault = "the expressions start processes that do not end"
    text = "" if fault is not None else _with_package_uris(answer["text"], answer["packages"])
    if fault is None and len(text) > MOST_BYTES:
        fault = f"the URDF text has more than {MOST_BYTES:,} bytes"
    if fault is not None:
        where = line_of(answer.get("file", path), answer.get("line", 1))
        help = "to allow reading a folder, use `--package NAME=DIR`" if OUTSIDE in fault else "to set `$(arg NAME)`, use `--arg NAME=VALUE`"
        report.add(Code.SOURCE_XML, f"xacro cannot expand this file: {fault}", where, help=help)
        return None
    return (text.encode(), answer["files"]) if _uses_all_arguments(arguments, answer["files"], report) else None


def _uses_all_arguments(arguments: Mapping[str, str], files: Sequence[str], report: Report) -> bool:
    """Return whether the xacro files use all arguments of the command line. Report unused arguments, because xacro ignores them.

    YAML files that xacro loads are not searched.
    """
    texts = [Path(file).read_text(encoding="utf-8", errors="replace") for file in files]
    if any("load_yaml" in text for text in texts):
        return True
    known = {name for text in texts for pattern in _ARGUMENTS for name in pattern.findall(text)}
    for name in [name for name in arguments if name not in known]:
        help = did_you_mean(name, sorted(known), what="arguments") or "remove the option"
        report.add(Code.COMMAND_LINE, f"--arg: the file has no argument `{name}`", None, help=help)
    return known >= arguments.keys()


def _with_package_uris(text: str, folders: Mapping[str, str]) -> str:
    """Replace absolute paths that `$(find NAME)` has inserted into the URDF by URIs `package://NAME`."""
    for name, folder in sorted(folders.items(), key=lambda item: -len(item[1])):
        for prefix in ("file://", ""):
            text = text.replace(f'"{prefix}{folder}/', f'"package://{name}/')
    return text
