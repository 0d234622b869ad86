"""Merge massless links into the next body, so that one MuJoCo body can have several joints.

MuJoCo does not accept a moving body without mass. However, a body may have any number of joints. Therefore, a massless link between two
joints is not written as a body, and its joint is added to the next body.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from msgspec.structs import replace

from thingc.model.robot.types import Body, Robot, Site
from thingc.targets.artifact import Loss


def model_bodies(robot: Robot) -> Mapping[int, Body]:
    """Return the bodies of the MJCF model, by the index of the body in the robot. The parent of each returned body is also a body of the
    model.

    If a link is omitted, the joints that lead to it are added to the next body, before the joints of this body. The axes of the added
    joints are expressed in the frame of the next body when its own joints are at 0.
    """
    merged: dict[int, Body] = {}
    for index, body in enumerate(robot.bodies):
        if body.parent is not None and joins(robot, body.parent):
            above, back = merged[body.parent], body.X_PL.inverse()
            before = (replace(joint, twist=joint.twist.seen_from(back)) for joint in above.joints)
            body = replace(body, parent=above.parent, X_PL=above.X_PL @ body.X_PL, joints=(*before, *body.joints))
        merged[index] = body
    return {index: body for index, body in merged.items() if not joins(robot, index)}


def joins(robot: Robot, index: int) -> bool:
    """Return whether a body of the robot is omitted in the MJCF model, because it only connects two joints."""
    body = robot.bodies[index]
    return body.parent is not None and body.link in robot.assembly.between


def sites(robot: Robot) -> Mapping[str, Site]:
    """Return the frames of the robot by path. Each frame is attached to a body that the MJCF model contains."""
    return {site.path: site for site in robot.sites if not joins(robot, site.body)}


def losses(robot: Robot) -> Iterator[Loss]:
    """Yield an export loss for each frame that is between two joints of the same body. Frames of links that are omitted in the model are
    not reported.
    """
    paths = {occurrence.path for occurrence in robot.assembly.occurrences}
    for site in robot.sites:
        if joins(robot, site.body) and site.path not in paths:
            what = "the frame: MuJoCo does not support sites between two joints of a body"
            yield Loss("mjcf", robot.mode.name, site.path, what, "omitted", site.origin)
