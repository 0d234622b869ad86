"""Write loops and holds as equality constraints of the MJCF model. A held mount is welded to an anchor, or connected to the anchor at one
point. A joint that closes a loop, and is therefore outside of the tree, becomes an equality constraint.

An anchor is a mocap body, whose pose is part of `MjData`. Therefore, a change of mode can move the anchor without changing the model, and
`mj_resetDataKeyframe` resets it.

MuJoCo has no equality constraint for a hinge. Therefore, a hinge is written as two `connect` constraints at different points of its axis.
MuJoCo also has no equality constraint for a universal joint. A universal joint is written as a `connect` at the intersection of its axes,
and a tendon. The tendon connects a point on one axis to a point on the other axis. The constant length of the tendon keeps the axes at
right angles. Both ends of every constraint are written explicitly, so that no constraint depends on poses at qpos0.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import Literal

from thingc.base.numeric import degrees, dist, round_significant, sqrt
from thingc.base.pose import NO_POSE, Pose, make_translation
from thingc.model.robot.types import Closure, Robot, residual_words
from thingc.targets.artifact import Loss
from thingc.targets.capabilities import written_as
from thingc.targets.geometry import name_with_index
from thingc.targets.mjcf.capabilities import CAPABILITIES
from thingc.targets.mjcf.drives import time_step
from thingc.targets.mjcf.elements import pose_attributes
from thingc.targets.xml_writer import Element, XmlValue

STIFFNESS = "0.999 0.9999 0.001"
"""The value of `solimp` for equality constraints that close loops and holds. With MuJoCo's default of 0.9, a held foot would sag by a
fraction of a millimetre.
"""



def equalities(robot: Robot, section: Element, links: list[str]) -> None:
    """Add the equality constraints that close the loops and holds of a mode. The constraints are as stiff as the time step allows.

    A mount that is held with its orientation, or a rigid loop, is written as a `weld`. A point or a ball is written as a `connect`, and a
    hinge is written as two `connect` constraints. A universal joint is written as a `connect` and a tendon.
    """
    # The shortest time constant of an equality constraint (`solref`) is twice the time step.
    stiff: dict[str, XmlValue] = {"solref": (2.0 * time_step(robot), 1.0), "solimp": STIFFNESS}
    for closure in robot.closures:
        parent = anchor_name(closure) if closure.parent is None else links[closure.parent]
        name, form = equality_name(closure), equality(closure)
        match form:
            case "weld":
                X_PL = NO_POSE if closure.hold else closure.X_PA @ closure.X_CB.inverse()
                relpose = (*X_PL.translation, *X_PL.quaternion())
                ends = {"body1": parent, "body2": links[closure.child]}
                section.add("weld", {"name": name, **ends, "relpose": relpose, **stiff}, closure.origin)
            case "connect" | "two connects":
                for index, (first, other) in enumerate(_points(robot, closure)):
                    section.add(
                        "connect", {"name": name_with_index(name, index), "site1": first[0], "site2": other[0], **stiff}, closure.origin,
                    )
            case "connect and tendon":
                (first, other), second = _points(robot, closure)
                section.add("connect", {"name": name, "site1": first[0], "site2": other[0], **stiff}, closure.origin)
                offset = sqrt(2.0) * _lever(robot, closure) - _distance_at_zero(robot, closure, second)
                polynomial = (offset, 0.0, 0.0, 0.0, 0.0)
                section.add("tendon", {"name": f"{name}_1", "tendon1": name, "polycoef": polynomial, **stiff}, closure.origin)
            case None:
                pass  # the loop stays open (see `losses`)


def tendons(robot: Robot, section: Element) -> None:
    """Add a tendon for each universal joint, from a point on one axis to a point on the other axis."""
    for closure in robot.closures:
        if equality(closure) == "connect and tendon":
            spatial = section.add("spatial", {"name": equality_name(closure), "group": "3"}, closure.origin)
            for site, _ in _points(robot, closure)[1]:
                spatial.add("site", {"site": site}, closure.origin)


def equality(closure: Closure) -> Literal["weld", "connect", "two connects", "connect and tendon"] | None:
    """Return the type of equality constraint that closes a loop or a hold. Return None if the loop or hold is not closed in the model."""
    form = written_as(CAPABILITIES["loops"]["hold" if closure.hold else closure.kind])
    if form == "weld or connect":
        return "connect" if closure.turns else "weld"
    return form


def equality_name(closure: Closure) -> str:
    """Return the name of an equality constraint: its custom name, or a name such as `rear_foot/sole:hold` or `rod:loop`."""
    return closure.name or f"{closure.path}:{'hold' if closure.hold else 'loop'}"


def anchor_name(closure: Closure) -> str:
    """Return the name of the body that holds a mount, such as `leg_2/sole:held`.

    If the mount can rotate, the site of the body has the same name.
    """
    return f"{closure.path}:held"


def anchors(robot: Robot) -> dict[str, Pose]:
    """Return the poses of all anchors in the world, by name.

    The anchor of a mount that can rotate is at the origin of the mount. Any other anchor is at the frame of the held link.
    """
    return {
        anchor_name(closure): Pose(translation=closure.X_PA.translation) if closure.turns else closure.X_PA @ closure.X_CB.inverse()
        for closure in robot.closures if closure.hold
    }


def sites(robot: Robot, world: Element, bodies: Mapping[int, Element]) -> None:
    """Add the anchors of held mounts to the model. Also add the sites at which the two sides of a ball, hinge or universal joint are
    connected.
    """
    poses = anchors(robot)
    for closure in robot.closures:
        form = equality(closure)
        if closure.hold:
            name = anchor_name(closure)
            anchor = world.add("body", {"name": name, "mocap": "true", **pose_attributes(poses[name])}, closure.origin)
            if form == "connect":
                anchor.add("site", {"name": name, "group": "3"}, closure.origin)
        elif form not in ("weld", None) and closure.parent is not None:
            for first, second in _points(robot, closure):
                for body, (name, pose) in ((closure.parent, first), (closure.child, second)):
                    bodies[body].add("site", {"name": name, **pose_attributes(pose)}, closure.origin)


def _points(robot: Robot, closure: Closure) -> list[tuple[tuple[str, Pose], tuple[str, Pose]]]:
    """Return the pairs of sites that are connected to close a joint or to hold a mount. Each pair consists of a site on the parent link,
    or on the anchor, and a site on the child link.

    The first pair is at the origin of the joint. A hinge and a universal joint have a second pair. For a hinge, the second pair is at
    another point of the axis. For a universal joint, each site of the second pair is on one of the axes.
    """
    if closure.hold:
        return [((anchor_name(closure), NO_POSE), (closure.path, closure.X_CB))]
    lever = _lever(robot, closure)
    second_points = make_translation(0.0, 0.0, lever), make_translation(0.0, 0.0, lever)
    if closure.kind in ("hinge", "universal") and any(closure.twists[0].angular[:2]):
        (x, y, z), (u, v, w) = (closure.twists[k].angular for k in (0, -1))
        second_points = make_translation(lever * x, lever * y, lever * z), make_translation(lever * u, lever * v, lever * w)
    return [
        ((f"{closure.path}:parent{suffix}", closure.X_PA @ on_parent), (f"{closure.path}:child{suffix}", closure.X_CB @ on_child))
        for suffix, (on_parent, on_child) in (("", (NO_POSE, NO_POSE)), ("_1", second_points))[: 1 if closure.kind == "ball" else 2]
    ]


def _distance_at_zero(robot: Robot, closure: Closure, points: tuple[tuple[str, Pose], tuple[str, Pose]]) -> float:
    """Return the distance [m] at q = 0 between a point of the parent and a point of the child.

    MuJoCo uses this distance as the reference length of the tendon.
    """
    assert closure.parent is not None
    X_WL: list[Pose] = []
    for body in robot.bodies:
        X_WL.append(NO_POSE if body.parent is None else X_WL[body.parent] @ body.X_PL)
    (_, on_parent), (_, on_child) = points
    return dist((X_WL[closure.parent] @ on_parent).translation, (X_WL[closure.child] @ on_child).translation)


def _lever(robot: Robot, closure: Closure) -> float:
    """Return the distance [m] between the two points of an axis at which a constraint acts.

    The result is the distance from the joint to the centre of mass of the child, rounded to one digit, and at least 1e-3 m. With this
    distance, translation and rotation have similar weights in the constraint.
    """
    centre = robot.assembly.links[robot.bodies[closure.child].link].properties.centre
    far = dist(centre, closure.X_CB.translation)
    return round_significant(far, 1) if far > 1e-3 else 1e-3


def losses(robot: Robot) -> Iterator[Loss]:
    """Yield the export losses for loops: poses that were changed or omitted because of loops, and properties of cut joints."""
    mode = robot.mode.name
    turns = {joint.path for mate in robot.assembly.mates for joint in mate.joints if joint.twist.turns}
    for frame in robot.keyframes:
        if frame.moved:
            what = f"the values: the loops close with {_describe_movement(frame.moved, turns)}"
            yield Loss("mjcf", mode, frame.name, what, "approximated", frame.origin)
    for pose in robot.unclosed:
        if pose.moved:
            what = f"the keyframe: the loops close only with {_describe_movement(pose.moved, turns)}"
        else:
            what = f"the keyframe: `{pose.path}` does not close (at best {residual_words(pose.residual)} apart)"
        yield Loss("mjcf", mode, pose.name, what, "omitted", pose.origin)
    for closure in robot.closures:
        if not closure.joints or equality(closure) is None:
            continue
        joint = closure.joints[0]
        omitted = [
            text for text, used in (
                ("the limits", joint.limit.bounded),
                ("the effort and velocity limits", joint.limit.effort is not None or joint.limit.velocity is not None),
                ("the dynamics", joint.dynamics.acts),
                ("the drive", any(pose.path in robot.present for pose in closure.joints)),
                ("the mimic", joint.mimic is not None),
            ) if used
        ]
        if omitted:
            yield Loss("mjcf", mode, closure.path, f"{', '.join(omitted)}: the loop is cut at the joint", "omitted", closure.origin)


def _describe_movement(moved: Mapping[str, float], turns: Collection[str]) -> str:
    """Describe how far joints moved, such as `` `knee` and 2 more changed by at most 12 deg``.

    The text names the joint that moved most. For this comparison, a radian counts as a metre.
    """
    path = max(moved, key=lambda joint: abs(moved[joint]))
    others = f" and {len(moved) - 1} more" if len(moved) > 1 else ""
    distance = abs(moved[path])
    return f"`{path}`{others} changed by at most " + (f"{degrees(distance):.3g} deg" if path in turns else f"{1000.0 * distance:.3g} mm")
