"""Write the tendons of documents as `fixed` and `spatial` tendons of MJCF, with their drives.

If a mode cuts a loop at a joint of a tendon, the tendon is omitted in this mode. If a mode does not select its actuators, it contains the
drives of all its tendons.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from msgspec.structs import replace

from thingc.base.numeric import maximum, minimum
from thingc.model.assembly.types import LinkedTendon
from thingc.model.robot.kinematics import body_poses, course_of, with_ancestors
from thingc.model.robot.types import Robot
from thingc.targets.artifact import Loss
from thingc.targets.mjcf import merged_joints
from thingc.targets.mjcf.drives import drive_attributes, joint_range, time_step
from thingc.targets.mjcf.elements import dynamics_attributes, pose_attributes
from thingc.targets.xml_writer import Element, XmlValue


def present(robot: Robot) -> tuple[LinkedTendon, ...]:
    """Return the tendons that a mode contains. All joints of such a tendon are in the tree of the mode, and all its mounts are on bodies of
    the mode.
    """
    joint_paths = {joint.path for body in robot.bodies for joint in body.joints}
    sites = merged_joints.sites(robot)
    return tuple(
        tendon for tendon in robot.assembly.tendons
        if joint_paths.issuperset(tendon.moves) and all(mount.path in sites for mount in tendon.mounts)
    )


def driven_tendons(robot: Robot) -> tuple[LinkedTendon, ...]:
    """Return the tendons of a mode that have a drive."""
    return tuple(tendon for tendon in present(robot) if tendon.actuator is not None and tendon.path in robot.pulled)


def tendons(robot: Robot, section: Element) -> None:
    """Add the tendons of the robot to the MJCF model.

    A tendon over joints becomes a `fixed` tendon, and a tendon along a path becomes a `spatial` tendon.
    """
    for tendon in present(robot):
        attributes: dict[str, XmlValue] = {"name": tendon.path}
        bounds = joint_range(tendon.limit)
        if bounds is not None:
            attributes["range"] = bounds
        attributes |= dynamics_attributes(tendon.dynamics)
        attributes.pop("springref", None)
        if tendon.dynamics.stiffness is not None:
            attributes["springlength"] = tendon.dynamics.rest or 0.0
        if tendon.width is not None:
            attributes["width"] = tendon.width / 2.0  # MuJoCo's width is a radius
        element = section.add("spatial" if tendon.steps else "fixed", attributes, tendon.origin)
        for path, factor in tendon.moves.items():
            element.add("joint", {"joint": path, "coef": factor}, tendon.origin)
        for place, step in enumerate(tendon.steps):
            if step.divisor is not None:
                element.add("pulley", {"divisor": step.divisor}, step.origin)
            elif step.shape is not None:
                side = {} if step.side is None else {"sidesite": step.side.path}
                element.add("geom", {"geom": _shape(tendon, place), **side}, step.origin)
            elif step.mount is not None:
                element.add("site", {"site": step.mount.path}, step.origin)


def _shape(tendon: LinkedTendon, place: int) -> str:
    return f"{tendon.path}:around_{place}"


def shapes(robot: Robot, bodies: Mapping[int, Element]) -> None:
    """Add the spheres and the cylinders around which tendons wrap.

    These geoms have no contacts and no mass. Wrapped spheres and cylinders are drawn like collision geoms.
    """
    sites = merged_joints.sites(robot)
    for tendon in present(robot):
        for place, step in enumerate(tendon.steps):
            if step.mount is not None and step.radius is not None and step.shape is not None:
                site = sites[step.mount.path]
                # for a tendon, MuJoCo treats a cylinder as infinite; its length is only visual
                size = (step.radius,) if step.shape == "sphere" else (step.radius, step.radius)
                attributes = {"name": _shape(tendon, place), "type": step.shape, "size": size, **pose_attributes(site.pose)}
                attributes |= {"contype": "0", "conaffinity": "0", "group": "3", "mass": "0"}
                bodies[site.body].add("geom", attributes, step.origin)


def drives(robot: Robot, section: Element) -> None:
    """Add an actuator for each tendon with a drive."""
    for tendon in driven_tendons(robot):
        if (drive := tendon.actuator) is not None:
            values = drive_attributes(_limit_positions(robot, tendon), drive, time_step(robot))
            section.add(drive.kind, {"name": drive.name or tendon.path, "tendon": tendon.path, **values}, drive.origin)


def _limit_positions(robot: Robot, tendon: LinkedTendon) -> LinkedTendon:
    """Return a drive of a differential with the positions that its actuator has within the limits of its joints.

    The positions limit only the control. Other tendons, and drives of joints without limits, are returned unchanged.
    """
    if tendon.transmission is None:
        return tendon
    limits = {joint.path: joint.limit for body in robot.bodies for joint in body.joints}
    lower = upper = 0.0
    for path, factor in tendon.moves.items():
        low, high = limits[path].lower, limits[path].upper
        if factor == 0.0:
            continue
        if low is None or high is None:
            return tendon
        lower, upper = lower + minimum(factor * low, factor * high), upper + maximum(factor * low, factor * high)
    return replace(tendon, limit=replace(tendon.limit, lower=lower, upper=upper))


def controls(robot: Robot, q: Mapping[str, float]) -> Iterator[float]:
    """Yield the control value of each tendon drive for joint positions `q` [rad or m].

    The control value is the tendon length for a position drive, and 0 for any other drive.
    """
    for tendon in driven_tendons(robot):
        position = tendon.actuator is not None and tendon.actuator.kind == "position"
        yield 0.0 if not position else course_of(robot, tendon, body_poses(robot, q)).length if tendon.steps else tendon.length(q)


def losses(robot: Robot) -> Iterator[Loss]:
    """Yield an export loss for each tendon that a mode omits, and for each armature of a tendon that MuJoCo simulates only partly."""
    written = present(robot)
    for tendon in robot.assembly.tendons:
        if tendon not in written:
            between = "MuJoCo does not support sites between two joints of a body"
            what = f"the tendon: {between if tendon.steps else 'a loop is cut at a joint of the tendon'}"
            yield Loss("mjcf", robot.mode.name, tendon.path, what, "omitted", tendon.origin)
        elif tendon.dynamics.armature and _branches(robot, tendon):
            what = "the armature: MuJoCo omits the inertia that couples joints on different branches of the tree"
            yield Loss("mjcf", robot.mode.name, tendon.path, what, "approximated", tendon.origin)


def _branches(robot: Robot, tendon: LinkedTendon) -> bool:
    """Return whether joints on two branches of the tree move a tendon."""
    bodies, sites = robot.bodies, merged_joints.sites(robot)
    ends = {number for number, body in enumerate(bodies) for joint in body.joints if tendon.moves.get(joint.path)}
    chains = [frozenset(with_ancestors(bodies, end)) for end in ends | {sites[mount.path].body for mount in tendon.mounts}]
    moved = [number for number in frozenset().union(*chains) - chains[0].intersection(*chains) if bodies[number].joints]
    # MuJoCo writes the child of a free joint as a branch of the world
    return not max(chains, key=len).issuperset(moved) or (len(moved) > 1 and any(bodies[number].free for number in moved))
