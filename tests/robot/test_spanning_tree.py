"""Two boxes and a hinge in several modes, and further properties of `Robot`, compared with written-out matrices."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from msgspec.structs import replace

from graph.builder import (
    FILE,
    MATE,
    ActuatorRecord,
    Drive,
    as_matrix,
    as_pose,
    assembly,
    attach,
    box,
    component,
    inv,
    joint,
    laid,
    link_names,
    linked,
    mass_properties,
    mimic,
    mode,
    notes,
    pose,
    ref,
    rx,
    ry,
    rz,
    said,
    t,
    where,
    whole,
)
from thingc.base.diagnostics import Code, Report
from thingc.base.memo import Memo
from thingc.base.pose import Vector
from thingc.geometry.record import Mesh
from thingc.model.assembly.kinematics import joints_of
from thingc.model.assembly.types import Assembly, Listed, Surface
from thingc.model.resolve.types import Standing
from thingc.model.robot.floor_height import stand
from thingc.model.robot.kinematic_tree import root
from thingc.model.robot.kinematics import body_poses, occurrence_poses
from thingc.model.robot.start_pose_checks import check_starts
from thingc.model.robot.types import Keyframe, Robot
from thingc.model.solids.clearance import Sweep

SEAT = t(0.04, 0.0, 0.02) @ ry(0.3)
HOLE = t(-0.05, 0.01, 0.0) @ rx(1.2)
SOLE = t(0.0, 0.0, -0.02) @ rx(math.pi)
BASE = box("p:Base", mounts={"seat": SEAT, "sole": SOLE})
ARM = box("p:Arm", (0.2, 0.03, 0.03), centre=(0.1, 0.0, 0.0), mounts={"hole": HOLE, "tip": t(0.2, 0, 0) @ ry(math.pi / 2)})
SEEN = dict.fromkeys(("visual", "hull"), Mesh(sha256="0" * 64, size=1, vertices=8, faces=12, closed=True, flat=False))
"""Placeholder meshes; a part without meshes is not considered visible."""
AT = t(0.3, -0.2, 0.1) @ rz(0.5) @ ry(-0.2) @ rx(0.1)


def robots(found: Assembly) -> dict[str, Robot]:
    report = Report()
    made = {m.name: root(found, m, report) for m in found.modes}
    assert report.diagnostics == []
    return {name: robot for name, robot in made.items() if robot is not None}


def hinge(kind: str = "revolute") -> Assembly:
    return linked(
        assembly(
            "two",
            [component("base", "p:Base"), component("arm", "p:Arm")],
            [joint("j", "base.seat", "arm.hole", kind, turn=0.7, gap=0.003, offset=0.25, lower=-1.0, upper=1.0, damping=0.1)],
            modes=[
                mode("bench", whole("base"), "fixed", at=AT),
                mode("by_tip", ref("arm.tip"), "held", at=AT),
                mode("adrift", whole("arm"), "free", at=AT),
                mode("standing", ref("base.sole"), at=AT),
            ],
        ),
        BASE,
        ARM,
    )


def arm_in_base(kind: str, q: float) -> np.ndarray:
    """X_base_arm by the formula."""
    moved = rz(q + 0.25) if kind != "prismatic" else t(0, 0, q + 0.25)
    return SEAT @ rz(0.7) @ t(0, 0, 0.003) @ moved @ MATE @ inv(HOLE)


@pytest.mark.parametrize("kind", ["revolute", "continuous", "prismatic"])
@pytest.mark.parametrize("q", [0.0, 0.6, -1.3])
def test_world_poses_match_matrices(kind: str, q: float) -> None:
    found = robots(hinge(kind))
    X_BA = arm_in_base(kind, q)
    expected = {
        "bench": (AT, AT @ X_BA),
        "by_tip": (AT @ MATE @ inv(t(0.2, 0, 0) @ ry(math.pi / 2)) @ inv(X_BA), AT @ MATE @ inv(t(0.2, 0, 0) @ ry(math.pi / 2))),
        "adrift": (AT @ inv(X_BA), AT),
        "standing": (AT @ MATE @ inv(SOLE), AT @ MATE @ inv(SOLE) @ X_BA),
    }
    for name, (base, arm) in expected.items():
        placed = occurrence_poses(found[name], {"j": q})
        assert as_matrix(placed[0]) == pytest.approx(base, abs=1e-13), name
        assert as_matrix(placed[1]) == pytest.approx(arm, abs=1e-13), name


@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
def test_axis_and_anchor_reproduce_the_motion(kind: str) -> None:
    """Axis and anchor in the child body's frame, applied with scipy's rotations, give the motion in both directions."""
    from scipy.spatial.transform import Rotation

    for name, robot in robots(hinge(kind)).items():
        body = robot.bodies[1]
        (core,) = body.joints
        backwards = name in ("by_tip", "adrift")
        assert core.reversed is backwards
        assert core.twist.core == ("hinge" if kind == "revolute" else "slide")
        assert (core.path, core.offset, core.dynamics.damping) == ("j", 0.25, 0.1)
        assert np.linalg.norm(core.twist.axis) == pytest.approx(1.0, abs=1e-15)
        for q in (0.8, -0.4):
            own = np.eye(4)
            if kind == "revolute":
                own[:3, :3] = Rotation.from_rotvec(np.array(core.twist.axis) * q).as_matrix()
                own[:3, 3] = np.array(core.twist.anchor) - own[:3, :3] @ np.array(core.twist.anchor)
            else:
                own[:3, 3] = np.array(core.twist.axis) * q
            expected = inv(arm_in_base(kind, q)) if backwards else arm_in_base(kind, q)
            assert as_matrix(body.X_PL) @ own == pytest.approx(expected, abs=1e-13)


def test_axis_is_on_the_mount_and_negated_backwards() -> None:
    found = robots(hinge())
    (forward,), (backward,) = (found[name].bodies[1].joints for name in ("bench", "adrift"))
    assert np.array(forward.twist.axis) == pytest.approx(-HOLE[:3, 2])  # the mate opposes the z axes
    assert np.array(forward.twist.anchor) == pytest.approx(HOLE[:3, 3])
    assert np.array(backward.twist.axis) == pytest.approx(-SEAT[:3, 2])
    assert np.array(backward.twist.anchor) == pytest.approx((SEAT @ [0, 0, 0.003, 1])[:3])


def test_axes_have_no_negative_zeros() -> None:
    model = assembly(
        "two",
        [component("base", "p:Base"), component("arm", "p:Arm")],
        [joint("j", "base.origin", "arm.origin")],
        modes=[mode("m", whole("arm"))],
    )
    (core,) = robots(linked(model, BASE, ARM))["m"].bodies[1].joints
    assert [math.copysign(1, x) for x in core.twist.axis] == [1, 1, -1]


@pytest.mark.parametrize(("lower", "upper", "outside"), [
    (0.1, 1.0, True), (-1.0, -0.1, True), (None, -0.1, True), (0.1, None, True), (0.0, 1.0, False), (-1.0, 0.0, False), (-1.0, 1.0, False),
])
def test_start_outside_limits_without_pose_is_reported(lower: float | None, upper: float | None, outside: bool) -> None:
    """A mode without a pose starts with joints at 0, which is reported if 0 is outside the limits."""
    model = assembly(
        "two", [component("base", "p:Base"), component("arm", "p:Arm")],
        [joint("j", "base.origin", "arm.origin", lower=lower, upper=upper)], modes=[mode("m", whole("arm"))],
    )
    report = Report()
    check_starts(tuple(robots(linked(model, BASE, ARM)).values()), None, report, Memo())
    assert [d.code for d in report.diagnostics] == ([Code.START_LIMITS] if outside else [])


@pytest.mark.parametrize(("upper", "outside"), [(0.6, False), (0.4, True)])
def test_start_of_a_mimic_outside_its_limits_is_reported(upper: float, outside: bool) -> None:
    """The joint `k` starts at 0.5 rad, because it mimics `j` with this offset. Its limits exclude 0."""
    model = assembly(
        "two", [component("base", "p:Base"), component("arm", "p:Arm"), component("hand", "p:Arm")],
        [joint("j", "base.seat", "arm.hole"), joint("k", "arm.tip", "hand.hole", lower=0.2, upper=upper, mimic=mimic("j", 2.0, 0.5))],
        modes=[mode("m", whole("base"))],
    )
    report = Report()
    check_starts(tuple(robots(linked(model, BASE, ARM)).values()), None, report, Memo())
    assert [(d.message, d.help) for d in report.diagnostics] == [(
        "mode `m` starts with `k` at 28.6479 deg, outside its limits (11.4592 deg to 22.9183 deg)",
        "add a `pose` with a value for `j` to the mode",
    )] * outside


def test_start_limits_are_reported_once_for_all_modes() -> None:
    """Five joints in a row cannot be at 0, in three modes of which the last has a pose: one warning for the first two modes."""
    arms = [f"arm{k}" for k in range(5)]
    joints = [
        joint(f"j{k}", parent, f"{arm}.hole", lower=math.radians(10.0 + k), upper=math.radians(90.0), line=20 + k)
        for k, (parent, arm) in enumerate(zip(["base.seat", *(f"{arm}.tip" for arm in arms)], arms, strict=False))
    ]
    model = assembly(
        "row", [component("base", "p:Base"), *(component(arm, "p:Arm") for arm in arms)], joints,
        poses=[pose("up", **{f"j{k}": 0.5 for k in range(5)})],
        modes=[
            mode("m", whole("base"), line=200), mode("n", whole("base"), at=AT, line=201),
            mode("posed", whole("base"), poses=("up",), pose="up", line=202),
        ],
    )
    report = Report()
    check_starts(tuple(robots(linked(model, BASE, ARM)).values()), None, report, Memo())
    [(code, message, _, line)] = said(report)
    assert (code, line) == ("START_LIMITS", 200)
    assert message == "mode `m` starts with `j0` at 0, outside its limits (10 deg to 90 deg)"
    more = [(f"also `{name}`", None, None) for name in ("j1", "j2", "j3")]
    assert notes(report) == [("`j0` is defined here", FILE, 20), *more, ("the same problem occurs in mode `n`", None, None)]


@pytest.mark.parametrize("number", [1, 3, 4])
def test_parts_below_the_feet_are_reported_once(number: int) -> None:
    """A hub 100 mm high between legs 40 mm high whose centres are 20 mm above its own: it is 50 mm lower than the feet. Of parts at the
    same height, the first is named."""
    sides = {f"side{k}": t(x, y, 0.02) for k, (x, y) in enumerate([(1, 1), (1, -1), (-1, 1), (-1, -1)])}
    hub = box("p:Hub", (0.2, 0.2, 0.1), meshes=SEEN, mounts=sides)
    leg = box("p:Leg", (0.02, 0.02, 0.04), meshes=SEEN, mounts={"tip": t(0, 0, 0.02)})
    feet = Standing(mounts=tuple(ref(f"leg{k}.tip") for k in range(number)), friction=None, origin=where(1))
    model = assembly(
        "stool", [component("hub", "p:Hub", line=10), *(component(f"leg{k}", "p:Leg") for k in range(4)), component("twin", "p:Hub")],
        [
            joint("as_low", "hub.origin", "twin.origin", "fixed"),
            *(joint(f"j{k}", f"hub.side{k}", f"leg{k}.origin", "fixed" if k >= number else "revolute") for k in range(4)),
        ],
        modes=[
            mode(name, whole("hub"), "free", at=t(0, 0, 1), standing=feet, line=line, gravity=gravity)
            for name, line, gravity in (("m", 200, (0, 0, -9.81)), ("n", 201, (0, 0, 9.81)), ("o", 202, (-9.81, 0, 0)))
        ],
    )
    report = Report()
    check_starts(tuple(robots(linked(model, hub, leg)).values()), None, report, Memo())
    [(code, message, _, line)] = said(report)
    assert (code, line) == ("OFF_FEET", 200)
    names = ", ".join(f"`leg{k}/tip`" for k in range(min(number, 3))) + (" and others" if number == 4 else "")
    assert message == f"mode `m` starts with `hub` at least 50 mm below the feet ({names})"
    assert notes(report) == [("`hub` is defined here", FILE, 10), ("the same problem occurs in modes `n`, `o`", None, None)]


@pytest.mark.parametrize(("z", "base", "others", "depth"), [
    (0.03, "free", 0, "20 mm"), (0.03, "free", 1, "20 mm"), (0.03, "free", 2, "20 mm"), (0.0494, "free", 0, "0.6 mm"),
    (0.0496, "free", 0, None), (0.03, "fixed", 0, None), (-0.07, "fixed", 0, "120 mm"), (0.03, "held", 0, None),
    (-0.07, "held", 0, "120 mm"),
])
def test_start_below_the_floor_is_reported_once(z: float, base: str, others: int, depth: str | None) -> None:
    """A part 100 mm high around its root, of which only the bounding box is known. A fixed root may reach into the ground."""
    block = box("p:Block", (0.2, 0.2, 0.1), meshes=SEEN)
    ways = (("m", (0, 0, -9.81)), ("n", (0, 0, 9.81)), ("o", (-9.81, 0, 0)))[: others + 1]
    modes = [mode(name, whole("b"), base, at=t(0, 0, z), line=200 + k, gravity=gravity) for k, (name, gravity) in enumerate(ways)]
    model, report = assembly("one", [component("b", "p:Block", line=10)], modes=modes), Report()
    check_starts(tuple(robots(linked(model, block)).values()), None, report, Memo())
    assert [(code, line, message) for code, message, _, line in said(report)] == [
        ("START_BELOW", 200, f"mode `m` starts with `b` at least {depth} below the floor (z = 0)")
        for _ in [depth] if depth
    ]
    if depth:
        more = ["", "the same problem occurs in mode `n`", "the same problem occurs in modes `n`, `o`"][others]
        assert notes(report) == [("`b` is defined here", FILE, 10), *((text, None, None) for text in [more] if text)]
        [help] = [one.help or "" for one in report.diagnostics]
        wanted = "check the sign of the height in `at` (-70 mm)" if z < 0 else "write, for example, `at: {xyz: 0 0 50 mm}`"
        assert help.startswith(wanted)


def test_floor_height_uses_meshes_at_their_poses() -> None:
    """A mesh that is rotated and translated in its link, in a mode that is rotated as well. Its lowest corner is computed with numpy."""
    corners = [(0.1, 0.0, 0.0), (0.0, 0.2, 0.0), (0.0, 0.0, 0.3), (-0.1, -0.05, -0.02)]
    inner, at = t(0.02, -0.3, 0.07) @ rx(0.8), t(0.4, 0.5, 0.9) @ ry(0.3) @ rz(0.2)
    placed = np.array([(inner @ [*corner, 1.0])[:3] for corner in corners])
    low, high = (tuple(map(float, ends)) for ends in (placed.min(axis=0), placed.max(axis=0)))
    mesh = Mesh(sha256="0" * 64, size=1, vertices=4, faces=4, closed=True, flat=False)
    touching = (Surface(solid=mesh, material=None, color=None, pose=as_pose(inner)),)
    model = assembly("one", [component("b", "p:Block")], modes=[mode("m", whole("b"), at=at)])
    found, report = linked(model, box("p:Block")), Report()
    [part] = found.occurrences
    part = replace(part, listed=Listed(drawn=(), touching=touching, solids=(), box=(low, high)))
    found = replace(found, occurrences=(part,), modes=(replace(found.modes[0], on_floor=True),))
    stood = stand(found, lambda mesh: corners, report).modes[0].at
    assert stood.translation == (0.4, 0.5, pytest.approx(-(at[:3, :3] @ placed.T)[2].min(), abs=1e-6))
    assert report.diagnostics == []


def test_world_poses_accept_another_base_pose() -> None:
    robot = robots(hinge())["adrift"]
    moved = t(1, 2, 3) @ rz(1.0)
    placed = body_poses(robot, {"j": 0.2}, as_pose(moved))
    assert as_matrix(placed[0]) == pytest.approx(moved)
    assert as_matrix(placed[1]) == pytest.approx(moved @ inv(arm_in_base("revolute", 0.2)), abs=1e-13)


def test_total_mass_is_equal_in_every_mode() -> None:
    found = hinge()
    for robot in robots(found).values():
        q = {"j": 0.9}
        got = mass_properties(robot, q)
        frame = as_matrix(occurrence_poses(robot, q, as_pose(np.eye(4)))[0])
        X_BA = arm_in_base("revolute", 0.9)
        m1, m2 = 1000 * 0.1 * 0.06 * 0.04, 1000 * 0.2 * 0.03 * 0.03
        centre = (m1 * np.zeros(3) + m2 * (X_BA @ [0.1, 0, 0, 1])[:3]) / (m1 + m2)
        assert got.mass == pytest.approx(m1 + m2, rel=1e-14)
        assert np.array(got.centre) == pytest.approx((frame @ [*centre, 1])[:3], abs=1e-13)


# --- a bigger one --------------------------------------------------------------------------------------------------

SERVO = ActuatorRecord(kind="position", stall_torque=4.1, kp=20.0)
HUB = box("p:Hub", mounts={f"m{k}": rz(k * math.pi / 3) @ t(0.1, 0, 0) @ ry(math.pi / 2) for k in range(6)}, actuator=SERVO)
ROD = box("p:Rod", (0.02, 0.02, 0.2), mounts={"low": t(0, 0, -0.1) @ rx(math.pi), "high": t(0, 0, 0.1)})


def leg() -> object:
    return assembly(
        "leg",
        [
            component("thigh", "p:Rod"),
            component("shin", "p:Rod"),
            component("eye", None, laid("shin.high", t(0, 0, 0.01)), frame=True),
        ],
        [joint("knee", "thigh.high", "shin.low", drive=Drive(component=None, kind="position", kp=5.0))],
        mounts={"sole": "shin.high", "hip": "thigh.low"},
    )


def spider() -> Assembly:
    one = leg()
    return linked(
        assembly(
            "spider",
            [
                component("leg_b", one),
                component("hub", "p:Hub"),
                component("leg_a", one),
                component("lid", "p:Rod", attach("lid.low", "hub.m5")),
            ],
            [
                joint("swing_a", "hub.m0", "leg_a.hip", drive=Drive(component=whole("hub"))),
                joint("swing_b", "hub.m1", "leg_b.hip", mimic=mimic("swing_a", -1.0)),
            ],
            mounts={"top": "lid.high"},
            poses=[pose("home", swing_a=0.4, leg_a__knee=0.2), pose("low", leg_b__knee=-0.5)],
            modes=[
                mode("stand", whole("hub"), poses=("low", "home")),
                mode(
                    "foot",
                    ref("leg_a.sole"),
                    "held",
                    poses=("home",),
                    actuators=("leg_b/knee", "swing_a"),
                    exclude=((whole("leg_a"), whole("leg_b")),),
                    adhesion=((ref("leg_a.sole"), 30.0),),
                ),
                mode("eye", whole("leg_b.eye"), "free"),
            ],
        ),
        HUB,
        ROD,
    )


def test_bodies_are_depth_first_in_document_order() -> None:
    found = spider()
    assert [link.name for link in found.links] == ["leg_b/thigh", "leg_b/shin", "hub", "leg_a/thigh", "leg_a/shin"]
    made = robots(found)
    assert link_names(made["stand"]) == ("hub", "leg_b/thigh", "leg_b/shin", "leg_a/thigh", "leg_a/shin")
    assert [b.parent for b in made["stand"].bodies] == [None, 0, 1, 0, 3]
    assert link_names(made["foot"]) == ("leg_a/shin", "leg_a/thigh", "hub", "leg_b/thigh", "leg_b/shin")
    assert [b.parent for b in made["foot"].bodies] == [None, 0, 1, 2, 3]
    assert tuple(joint.path for body in made["foot"].bodies for joint in body.joints) == ("leg_a/knee", "swing_a", "swing_b", "leg_b/knee")
    assert [joint.reversed for b in made["foot"].bodies[1:] for joint in b.joints] == [True, True, False, False]
    assert [joint.mimic.joint for b in made["foot"].bodies for joint in b.joints if joint.mimic] == ["swing_a"]


def test_sites_are_equal_in_every_mode() -> None:
    """Names and world poses of sites are equal; only their bodies differ."""
    found = spider()
    made = robots(found)
    names = [
        "top",
        "leg_b/sole",
        "leg_b/hip",
        "leg_a/sole",
        "leg_a/hip",
        "leg_b/eye",
        "leg_a/eye",
        "hub/origin",
        "leg_b/eye/origin",
    ]
    for robot in made.values():
        assert [site.path for site in robot.sites] == names
        q = {"swing_a": 0.3, "leg_a/knee": 0.5}
        bodies, parts = body_poses(robot, q), occurrence_poses(robot, q)
        by_path = {o.path: parts[o.index] for o in found.occurrences}
        world = {site.path: as_matrix(bodies[site.body] @ site.pose) for site in robot.sites}
        assert world["leg_a/sole"] == pytest.approx(as_matrix(by_path["leg_a/shin"]) @ t(0, 0, 0.1), abs=1e-13)
        assert world["leg_b/eye"] == pytest.approx(as_matrix(by_path["leg_b/shin"]) @ t(0, 0, 0.11), abs=1e-13)
        assert world["hub/origin"] == pytest.approx(as_matrix(by_path["hub"]), abs=1e-13)
        assert world["top"] == pytest.approx(as_matrix(by_path["lid"]) @ t(0, 0, 0.1), abs=1e-13)


def test_mount_root_faces_the_ground() -> None:
    robot = robots(spider())["foot"]
    site = next(s for s in robot.sites if s.path == "leg_a/sole")
    assert as_matrix(body_poses(robot, {})[site.body] @ site.pose) == pytest.approx(MATE, abs=1e-15)


def test_neighbours_are_excluded_in_every_mode() -> None:
    found = spider()
    neighbours = [("leg_b/thigh", "leg_b/shin"), ("leg_b/thigh", "hub"), ("leg_a/thigh", "leg_a/shin"), ("hub", "leg_a/thigh")]
    for name, robot in robots(found).items():
        names = link_names(robot)
        pairs = [(names[a], names[b]) for a, b in robot.excluded]
        own = (
            []
            if name != "foot"
            else [
                ("leg_b/thigh", "leg_a/thigh"),
                ("leg_b/shin", "leg_a/thigh"),
                ("leg_b/thigh", "leg_a/shin"),
                ("leg_b/shin", "leg_a/shin"),
            ]
        )
        assert set(pairs) == {*neighbours, *own}
        assert len(set(pairs)) == len(pairs)
        assert pairs[:4] == [
            ("hub", "leg_a/thigh"),
            ("leg_b/thigh", "hub"),
            ("leg_b/thigh", "leg_b/shin"),
            ("leg_a/thigh", "leg_a/shin"),
        ]


def test_keyframes_contain_all_joints_in_order() -> None:
    made = robots(spider())
    assert [k.name for k in made["stand"].keyframes] == ["low", "home"]
    home = made["foot"].keyframes[0]
    assert list(home.q.items()) == [("swing_a", 0.4), ("swing_b", -0.4), ("leg_b/knee", 0.0), ("leg_a/knee", 0.2)]
    assert made["eye"].keyframes == ()


def test_modes_select_actuators_and_adhesion() -> None:
    made = robots(spider())
    assert made["stand"].present == ("swing_a", "leg_b/knee", "leg_a/knee")
    assert made["foot"].present == ("swing_a", "leg_b/knee")
    assert (made["stand"].adhesion, made["foot"].adhesion) == ({"leg_a/sole": 0.0}, {"leg_a/sole": 30.0})
    assert [robot.base for robot in made.values()] == ["fixed", "held", "free"]
    assert made["eye"].gravity == (0.0, 0.0, -9.81)


def test_long_chain_does_not_exceed_recursion_limit() -> None:
    count = 2500
    chain = [component(f"c{k}", "p:Rod") for k in range(count)]
    joints = [joint(f"j{k}", f"c{k - 1}.high", f"c{k}.low") for k in range(1, count)]
    found = linked(assembly("a", chain, joints, modes=[mode("middle", whole(f"c{count // 2}"))]), ROD)
    robot = robots(found)["middle"]
    assert len(robot.bodies) == count
    ends = occurrence_poses(robot, {})
    assert np.linalg.norm(np.subtract(ends[0].translation, ends[-1].translation)) == pytest.approx(0.2 * (count - 1), rel=1e-9)
    for a, b in pairwise(ends[:5]):
        step: Vector = b.translation
        assert np.linalg.norm(np.subtract(step, a.translation)) == pytest.approx(0.2, rel=1e-9)
    place = Sweep(robot, Keyframe(name="zero", q={joint.path: 0.0 for joint in joints_of(found)}, origin=()), ()).place([])
    assert place is not None
    assert [place.at(end) for end in (0, count - 1)] == [ends[0], ends[-1]]


def test_unconnected_link_is_reported() -> None:
    found = replace(hinge(), mates=())
    report = Report()
    assert root(found, found.modes[0], report) is None
    assert [d.message for d in report.diagnostics] == ["link `arm` is not connected to the root of mode `bench`"]
