"""`modes.json`: what switching between modes at run time needs to know of every mode's tree.

Enough for the forward kinematics of any mode at any q, without MuJoCo. With L the child link of a joint, P its parent in
that mode's tree, `X_PL(0) = inv(X_root_link[P]) @ X_root_link[L]` and J the joint's frame,

    X_PL(q) = X_PJ @ motion(q) @ inv(X_PJ) @ X_PL(0)

where `motion(q)` turns by q about `axis` (`hinge`) or slides by q along it (`slide`); both are given in J, whose axes are
those of the child link at q = 0. q is the document's coordinate, without `offset`.
"""

from __future__ import annotations

from thingc.emit import jsontext
from thingc.emit.artifact import Artifacts
from thingc.emit.jsontext import Fragment, fragment
from thingc.emit.request import EmitRequest
from thingc.inertia import MassProperties
from thingc.joints import Twist
from thingc.memo import Memo
from thingc.pose import NO_POSE, Pose, shifted
from thingc.resolve.model import Mimic
from thingc.robot.types import Robot

LISTED = 3
"""How deep a link or a joint stands in the file: in a list of a mode of the whole."""

FREE = (7, 6)
"""The same for a free base: position and quaternion; linear and angular velocity."""


def emit(request: EmitRequest) -> Artifacts:
    """`modes.json` of the chosen modes, in document order. It goes with the MJCF files, whose addresses it states."""
    described = {robot.mode.name: describe(robot, request.memo) for robot in request.robots}
    return Artifacts(files={"modes.json": jsontext.encode(described)})


def describe(robot: Robot, memo: Memo | None = None) -> dict[str, object]:
    """One mode as plain data for `jsontext`, lengths in metres and angles in radians.

    - `root` the path of the site on which the mode stands, `base` `fixed | held | free`, `gravity` [m/s^2] in the world,
      `X_world_root` where the mode puts its root link, 4 x 4, by rows;
    - `links` in the order of the bodies of the model, the root link first; `X_root_link` the pose of the link's frame in
      the root link's frame at q = 0; `mass` [kg], `centre` [m] and `inertia` [kg m^2, about the centre] in the link's frame;
    - `joints` in the order of the model: `parent` and `child` are links as this mode's tree has them; `reversed` says that
      the document has them the other way round (the axis has been turned for it, so q means the same); `qpos` and `dof` are
      the addresses in `MjData.qpos` and `.qvel`, behind a free base's 7 and 6;
    - `holds` further mounts held to the world, by their paths: `link` that carries the mount, what the hold `carries` (`force`: the
      mount's origin stays, and it may turn; else `force and torque`), `X_LM` the mount in the link, `X_WM` where it is held;
    - `poses` q by joint path, the mode's own pose first; only where there are such, `bases`, `X_world_root` of the poses in which
      a free base stands elsewhere, and `standing_on`, the mounts that the mode says it stands on;
    - only where there are loops `cuts`, the joints that close them (no joints of this model): `X_PA` and `X_CB` are the frames
      that meet, A on the parent moving by q about or along its z; and `residuals`, how far [m, rad] the worst loop is from
      closed in each pose.
    """
    names = [robot.assembly.links[body.link].name for body in robot.bodies]
    at_zero: list[Pose] = []
    memo, mode = memo or Memo(), robot.mode.name
    links: list[Fragment] = []
    joints: list[Fragment] = []
    order: list[str] = []
    qpos, dof = FREE if robot.base == "free" else (0, 0)
    for name, body in zip(names, robot.bodies, strict=True):
        pose = NO_POSE if body.parent is None else at_zero[body.parent] @ body.X_PL
        at_zero.append(pose)
        own = robot.assembly.links[body.link].properties
        links.append(memo(("modes.json", mode, "link", name), _link, name, pose, own))
        for joint in body.joints:
            joints.append(memo(
                ("modes.json", mode, "joint", joint.path), _joint, joint.path, joint.twist, names[body.parent or 0], name, body.X_PL,
                joint.offset, joint.reversed, joint.dynamics.armature, joint.mimic, qpos, dof,
            ))
            order.append(joint.path)
            qpos, dof = qpos + 1, dof + 1
    order += [joint.path for closure in robot.closures for joint in closure.joints]
    placed = ((frame.name, frame.base) for frame in robot.keyframes)
    bases = {name: base.rows() for name, base in placed if base is not None and base != robot.bodies[0].X_PL}
    return {
        "root": robot.mode.root.path,
        "base": robot.base,
        "gravity": robot.gravity,
        "X_world_root": robot.bodies[0].X_PL.rows(),
        "links": links,
        "joints": joints,
        "holds": {
            closure.path: {
                "link": names[closure.child], "carries": "force" if closure.kind == "ball" else "force and torque",
                "X_LM": closure.X_CB.rows(), "X_WM": closure.X_PA.rows(),
            }
            for closure in robot.closures
            if closure.hold
        },
        "poses": {frame.name: {name: frame.q[name] for name in order} for frame in robot.keyframes},
        **({"bases": bases} if bases else {}),
        **({"standing_on": [foot.mount.path for foot in robot.mode.feet]} if robot.mode.feet else {}),
        **(_loops(robot, names) if robot.closures else {}),
    }


def _link(name: str, pose: Pose, own: MassProperties) -> Fragment:
    return fragment({
        "name": name, "X_root_link": pose.rows(), "mass": own.mass, "centre": own.centre, "inertia": own.inertia,
    }, LISTED)


def _joint(
    path: str, twist: Twist, parent: str, child: str, X_PL: Pose, offset: float, reversed_: bool, armature: float | None,
    mimic: Mimic | None, qpos: int, dof: int,
) -> Fragment:
    return fragment({
        "name": path,
        "kind": twist.core,
        "parent": parent,
        "child": child,
        "X_PJ": (X_PL @ shifted(*twist.anchor)).rows(),
        "axis": twist.axis,
        "offset": offset,
        "reversed": reversed_,
        "armature": armature or 0.0,
        "mimic": _mimic(mimic),
        "qpos": qpos,
        "dof": dof,
    }, LISTED)


def _loops(robot: Robot, names: list[str]) -> dict[str, object]:
    return {
        "cuts": [
            {
                "name": closure.path,
                "kind": closure.kind,
                "parent": names[closure.parent],
                "child": names[closure.child],
                "X_PA": closure.X_PA.rows(),
                "X_CB": closure.X_CB.rows(),
            }
            for closure in robot.closures
            if closure.parent is not None
        ],
        "residuals": {frame.name: frame.residual for frame in robot.keyframes},
    }


def _mimic(mimic: Mimic | None) -> dict[str, object] | None:
    return None if mimic is None else {"joint": mimic.joint, "multiplier": mimic.multiplier, "offset": mimic.offset}
