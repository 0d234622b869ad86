"""Create a model with one MJCF body per component, as in the earlier prototype. Rigidly connected components become child bodies without
joints.

The bodies are created by following the mates of the assembly from the root component. The links and the rooted tree of thingc are not used.
"""

from __future__ import annotations

from xml.etree import ElementTree

from thingc.base.inertia import ZERO, physical_fault
from thingc.base.joints.twist import pose_after
from thingc.base.pose import Pose, rotate
from thingc.model.assembly.types import Assembly, Mate
from thingc.model.robot.types import Robot

SECTIONS = ("keyframe", "worldbody")
"""Sections that are not copied from the original model, because they depend on the bodies or on the order of joints."""


def component_model(robot: Robot, mjcf: str) -> str:
    """Rewrite the MJCF text of a mode so that each component is a body. Joints, geoms, sites, drives and options keep their names and
    values.
    """
    assembly = robot.assembly
    fused = ElementTree.fromstring(mjcf)
    bodies = {body.get("name"): body for body in fused.iter("body")}
    world = ElementTree.Element("worldbody")
    made = _walk(robot, world)
    for link in assembly.links:
        source = bodies[link.name]
        for member, pose in zip(link.members, link.poses, strict=True):
            path = assembly.occurrences[member].path
            geoms = [g for g in source.findall("geom") if (g.get("name") or "").partition(":")[0] == path]
            if geoms:
                _frame(made[member], pose.inverse()).extend(geoms)
        entry, pose = link.members[0], link.poses[0]
        _frame(made[entry], pose.inverse()).extend(source.findall("site"))
    for element in made.values():
        element[:] = sorted(element, key=lambda child: child.tag == "body")
    top = ElementTree.Element("mujoco", {"model": f"{fused.get('model')}_components"})
    for section in fused:
        if section.tag == "worldbody":
            top.append(world)
        elif section.tag not in SECTIONS:
            top.append(_renamed(section, assembly))
    return ElementTree.tostring(top, encoding="unicode")


def body_name(assembly: Assembly, link: str) -> str:
    """Return the name of the body that represents a link: the path of the first component of the link."""
    found = next(candidate for candidate in assembly.links if candidate.name == link)
    return assembly.occurrences[found.members[0]].path


def _walk(robot: Robot, world: ElementTree.Element) -> dict[int, ElementTree.Element]:
    """Create a body for each occurrence, and return the bodies by the index of the occurrence."""
    assembly = robot.assembly
    root = robot.mode.root.occurrence
    link = assembly.links[assembly.link_of[root]]
    dynamic = {joint.path: joint for body in robot.bodies for joint in body.joints}
    made: dict[int, ElementTree.Element] = {}

    def add(parent: ElementTree.Element, index: int, pose: Pose) -> ElementTree.Element:
        occurrence = assembly.occurrences[index]
        body = made[index] = ElementTree.SubElement(parent, "body", {"name": occurrence.path, **_placed(pose)})
        mass = occurrence.properties
        if mass.mass > 0.0:
            inertia = mass.inertia
            attributes = {"pos": _text(mass.centre), "mass": repr(mass.mass)}
            if inertia == ZERO or physical_fault(inertia) is not None:
                attributes["diaginertia"] = "0 0 0"
            else:
                i = inertia
                attributes["fullinertia"] = _text((i[0][0], i[1][1], i[2][2], i[0][1], i[0][2], i[1][2]))
            ElementTree.SubElement(body, "inertial", attributes)
        return body

    start = add(world, root, robot.bodies[0].X_PL @ link.poses[link.members.index(root)])
    start.set("childclass", robot.assembly.name)
    if robot.base == "held":
        start.set("mocap", "true")
    if robot.base == "free":
        ElementTree.SubElement(start, "freejoint", {"name": "root"})
    waiting = [root]
    while waiting:
        here = waiting.pop(0)
        for mate in assembly.mates:
            if mate.loop is not None or here not in (mate.parent, mate.child):
                continue
            forward = here == mate.parent
            there = mate.child if forward else mate.parent
            if there in made:
                continue
            pose, axis, anchor = _crossed(mate, forward)
            body = add(made[here], there, pose)
            for joint in mate.joints:
                attributes = {"name": joint.path, "type": joint.twist.core, "axis": _text(axis), "pos": _text(anchor)}
                limit, values = joint.limit, dynamic[joint.path].dynamics
                if limit.lower is not None and limit.upper is not None:
                    attributes["range"] = _text((limit.lower, limit.upper))
                for name, value in (
                    ("stiffness", values.stiffness), ("damping", values.damping), ("frictionloss", values.friction),
                    ("armature", values.armature),
                ):
                    if value is not None:
                        attributes[name] = repr(value)
                ElementTree.SubElement(body, "joint", attributes)
            waiting.append(there)
    return made


def _crossed(mate: Mate, forward: bool) -> tuple[Pose, tuple[float, ...], tuple[float, ...]]:
    """Return the pose of the next occurrence at q = 0 across a mate, and the axis and the anchor of the joint in the frame of this
    occurrence.
    """
    pose = mate.X_PJ @ pose_after(tuple(joint.twist for joint in mate.joints), tuple(joint.offset for joint in mate.joints)) @ mate.X_JC
    joint = mate.X_JC.inverse() if forward else mate.X_PJ
    axis = rotate(joint.rotation, (0.0, 0.0, 1.0))
    return (pose, axis, joint.translation) if forward else (pose.inverse(), tuple(-x for x in axis), joint.translation)


def _renamed(section: ElementTree.Element, assembly: Assembly) -> ElementTree.Element:
    """Return a section in which names of links are replaced by paths of components. An excluded pair of links becomes all pairs of their
    components.
    """
    if section.tag != "contact":
        for element in section:
            if element.tag == "adhesion":
                magnet = next(a for a in assembly.adhesions if a.path == (element.get("name") or "").removesuffix(":adhesion"))
                element.set("body", assembly.occurrences[magnet.occurrence].path)
        return section
    links = {link.name: link for link in assembly.links}
    contact = ElementTree.Element("contact")
    for pair in section.findall("exclude"):
        first, second = links[pair.get("body1") or ""], links[pair.get("body2") or ""]
        for one in first.members:
            for other in second.members:
                names = {"body1": assembly.occurrences[one].path, "body2": assembly.occurrences[other].path}
                ElementTree.SubElement(contact, "exclude", names)
    return contact


def _frame(body: ElementTree.Element, pose: Pose) -> ElementTree.Element:
    return ElementTree.SubElement(body, "frame", _placed(pose))


def _placed(pose: Pose) -> dict[str, str]:
    return {"pos": _text(pose.translation), "quat": _text(pose.quaternion())}


def _text(values: tuple[float, ...]) -> str:
    return " ".join(repr(float(value)) for value in values)
