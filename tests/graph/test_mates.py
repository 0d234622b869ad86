"""Poses of linked occurrences, compared with written-out chains of matrices."""

from __future__ import annotations

import math

import numpy as np
import pytest
from msgspec.structs import replace

from graph.builder import (
    MATE,
    Reference,
    as_matrix,
    assembly,
    attach,
    bare,
    box,
    component,
    inv,
    joint,
    laid,
    linked,
    mated,
    mimic,
    mode,
    poses,
    rx,
    ry,
    rz,
    t,
    where,
    whole,
)
from thingc.base.joints.twist import Twist
from thingc.model.assembly.kinematics import coordinates, joints_of
from thingc.model.assembly.types import Assembly

SEAT = t(0.05, 0.01, 0.02) @ ry(0.7)
BACK = t(-0.03, 0.02, -0.02) @ rx(2.0) @ rz(0.4)


def at(found: Assembly, path: str, q: dict[str, float] | None = None) -> np.ndarray:
    index = next(o.index for o in found.occurrences if o.path == path)
    return as_matrix(poses(found, q or {})[index])


def test_attach_applies_turn_and_gap() -> None:
    model = assembly(
        "a",
        [
            component("plate", "p:Plate"),
            component("servo", "p:Servo", attach("servo.back", "plate.seat", turn=0.3, gap=0.002)),
        ],
    )
    found = linked(model, box("p:Plate", mounts={"seat": SEAT}), box("p:Servo", mounts={"back": BACK}))
    assert at(found, "servo") == pytest.approx(SEAT @ rz(0.3) @ t(0, 0, 0.002) @ MATE @ inv(BACK), abs=1e-14)
    assert found.rest == poses(found, {})
    assert (found.mates[0].parent_mount, found.mates[0].child_mount) == ("seat", "back")


def test_mated_faces_face_each_other() -> None:
    """Checked without the formula: z axes are opposite, origins coincide, and the child's x is along the parent's -y."""
    model = assembly("a", [component("plate", "p:Plate"), component("servo", "p:Servo", attach("servo.back", "plate.seat"))])
    found = linked(model, box("p:Plate", mounts={"seat": SEAT}), box("p:Servo", mounts={"back": BACK}))
    mine = at(found, "servo") @ BACK
    assert mine[:3, 3] == pytest.approx(SEAT[:3, 3])
    assert mine[:3, 2] == pytest.approx(-SEAT[:3, 2])
    assert mine[:3, 0] == pytest.approx(-SEAT[:3, 1])
    assert mine[:3, 1] == pytest.approx(-SEAT[:3, 0])


def test_at_places_without_the_mate_rotation() -> None:
    local = t(0.1, -0.2, 0.3) @ rz(0.5) @ ry(0.2) @ rx(0.1)
    model = assembly(
        "a",
        [
            component("plate", "p:Plate"),
            component("imu", None, laid("plate.seat", local), frame=True),
            component("led", None, laid("plate.origin", local), frame=True),
        ],
    )
    found = linked(model, box("p:Plate", mounts={"seat": SEAT}))
    assert at(found, "imu") == pytest.approx(SEAT @ local)
    assert at(found, "led") == pytest.approx(local)
    assert [o.definition.kind for o in found.occurrences] == ["part", "frame", "frame"]


@pytest.mark.parametrize("kind", ["revolute", "continuous", "prismatic"])
@pytest.mark.parametrize("q", [0.0, 0.4, -1.1])
def test_joint_motion_is_between_gap_and_mate(kind: str, q: float) -> None:
    model = assembly(
        "a",
        [component("plate", "p:Plate"), component("arm", "p:Arm")],
        [joint("j", "plate.seat", "arm.back", kind, turn=0.3, gap=0.002, offset=0.2, lower=-1.0, upper=1.0)],
    )
    found = linked(model, box("p:Plate", mounts={"seat": SEAT}), box("p:Arm", mounts={"back": BACK}))
    expected = mated(SEAT, BACK, turn=0.3, gap=0.002, kind=kind, q=q, offset=0.2)
    assert at(found, "arm", {"j": q}) == pytest.approx(expected, abs=1e-14)
    assert len(found.links) == 2


@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
def test_turn_and_gap_follow_the_joint_axis(kind: str) -> None:
    """A joint with an `axis` has no mate rotation: at q = 0, without `turn` and `gap`, both mounts coincide."""
    axis = (0.6, 0.0, 0.8)
    twist = Twist(angular=axis) if kind == "revolute" else Twist(linear=axis)
    one = replace(joint("j", "plate.seat", "arm.back", kind, turn=0.3, gap=0.002, lower=-1.0, upper=1.0), axis=axis, twist=twist)
    model = assembly("a", [component("plate", "p:Plate"), component("arm", "p:Arm")], [one])
    found = linked(model, box("p:Plate", mounts={"seat": SEAT}), box("p:Arm", mounts={"back": BACK}))
    tilted = ry(np.arctan2(0.6, 0.8))  # takes z to the axis
    moved = rz(0.3) @ t(0, 0, 0.002) @ (rz(0.4) if kind == "revolute" else t(0, 0, 0.4))
    assert at(found, "arm", {"j": 0.4}) == pytest.approx(SEAT @ tilted @ moved @ inv(tilted) @ inv(BACK), abs=1e-14)


def test_fixed_joint_merges_links() -> None:
    model = assembly(
        "a",
        [component("plate", "p:Plate"), component("arm", "p:Arm")],
        [joint("j", "plate.seat", "arm.back", "fixed", turn=0.3)],
    )
    found = linked(model, box("p:Plate", mounts={"seat": SEAT}), box("p:Arm", mounts={"back": BACK}))
    assert at(found, "arm") == pytest.approx(mated(SEAT, BACK, turn=0.3))
    assert len(found.links) == 1
    assert joints_of(found) == ()


def hand(joint_line: int = 50) -> object:
    """A nested assembly with a joint: `cap` is the base, and `finger` turns on it and has the exported mount `tip`."""
    return assembly(
        "hand",
        [component("cap", "p:Cap"), component("finger", "p:Finger")],
        [joint("knuckle", "cap.top", "finger.root", line=joint_line)],
        mounts={"tip": "finger.end", "grip": "cap.grip"},
    )


PLATE = box("p:Plate", mounts={"seat": SEAT, "side": BACK})
CAP = box("p:Cap", mounts={"top": SEAT, "grip": BACK})
FINGER = box("p:Finger", mounts={"root": BACK, "end": t(0.0, 0.0, 0.08) @ rx(0.2)})
INNER = mated(SEAT, BACK, kind="revolute")


@pytest.mark.parametrize("mine", ["hand.grip", "hand.cap.grip"])
def test_nested_assembly_attaches_by_exported_or_inner_mount(mine: str) -> None:
    found = linked(
        assembly("a", [component("plate", "p:Plate"), component("hand", hand(), attach(mine, "plate.seat"))]), PLATE, CAP, FINGER
    )
    assert [o.path for o in found.occurrences] == ["plate", "hand/cap", "hand/finger"]
    assert at(found, "hand/cap") == pytest.approx(mated(SEAT, BACK), abs=1e-14)
    assert at(found, "hand/finger", {"hand/knuckle": 0.7}) == pytest.approx(
        mated(SEAT, BACK) @ mated(SEAT, BACK, kind="revolute", q=0.7), abs=1e-14
    )


def test_attaching_beyond_a_joint_fixes_that_link() -> None:
    """If a nested assembly is attached by a mount beyond its joint, the link with that mount is fixed, and the base moves."""
    found = linked(
        assembly("a", [component("plate", "p:Plate"), component("hand", hand(), attach("hand.tip", "plate.seat"))]),
        PLATE,
        CAP,
        FINGER,
    )
    end = t(0.0, 0.0, 0.08) @ rx(0.2)
    for q in (0.0, 0.9):
        finger = mated(SEAT, end)
        assert at(found, "hand/finger", {"hand/knuckle": q}) == pytest.approx(finger, abs=1e-14)
        assert at(found, "hand/cap", {"hand/knuckle": q}) == pytest.approx(
            finger @ inv(mated(SEAT, BACK, kind="revolute", q=q)), abs=1e-14
        )
    assert [link.members for link in found.links] == [(0, 2), (1,)]


def test_joint_and_frames_on_nested_mounts() -> None:
    model = assembly(
        "a",
        [
            component("plate", "p:Plate"),
            component("hand", hand()),
            component("dot", None, laid("hand.finger.end", t(0, 0, 0.01)), frame=True),
            component("dot2", None, laid("hand.tip", t(0, 0, 0.01)), frame=True),
            component("dot3", None, laid("hand.origin", t(0, 0, 0.01)), frame=True),
        ],
        [joint("wrist", "plate.seat", "hand.grip")],
    )
    found = linked(model, PLATE, CAP, FINGER)
    q = {"wrist": 0.3, "hand/knuckle": -0.4}
    cap = mated(SEAT, BACK, kind="revolute", q=0.3)
    finger = cap @ mated(SEAT, BACK, kind="revolute", q=-0.4)
    assert at(found, "dot", q) == pytest.approx(finger @ t(0, 0, 0.08) @ rx(0.2) @ t(0, 0, 0.01), abs=1e-14)
    assert at(found, "dot2", q) == pytest.approx(at(found, "dot", q))
    assert at(found, "dot3", q) == pytest.approx(cap @ t(0, 0, 0.01), abs=1e-14)
    assert [j.path for j in joints_of(found)] == ["wrist", "hand/knuckle"]


def test_assembly_frame_is_the_frame_of_its_base() -> None:
    outer = assembly("outer", [component("deep", hand()), component("lid", "p:Plate", attach("lid.side", "deep.cap.top"))])
    local = t(0.3, 0, 0) @ rz(0.2)
    found = linked(
        assembly("a", [component("plate", "p:Plate"), component("o", outer, laid("plate.origin", local))]), PLATE, CAP, FINGER
    )
    assert at(found, "o/deep/cap") == pytest.approx(local)
    assert [o.path for o in found.occurrences] == ["plate", "o/deep/cap", "o/deep/finger", "o/lid"]
    assert [m.path for m in found.exported] == ["o/deep/tip", "o/deep/grip"]


def test_component_order_and_shared_mounts() -> None:
    """The base may be written last, and several components may be attached to one mount."""
    model = assembly(
        "a",
        [
            component("b", "p:Plate", attach("b.side", "base.seat")),
            component("c", "p:Plate", attach("c.seat", "base.seat")),
            component("base", "p:Plate"),
        ],
        modes=[mode("m", whole("base"))],
    )
    found = linked(model, PLATE)
    assert found.base == 2
    assert at(found, "base") == pytest.approx(np.eye(4))
    assert at(found, "b") == pytest.approx(mated(SEAT, BACK), abs=1e-14)
    assert at(found, "c") == pytest.approx(mated(SEAT, SEAT), abs=1e-14)


def test_added_mounts_are_usable() -> None:
    model = assembly(
        "a",
        [
            component("plate", "p:Plate", mounts={"shaft": t(0, 0, 0.5)}),
            component("hand", hand(), attach("hand.lug", "plate.shaft"), mounts={"lug": t(0.01, 0, 0) @ rx(1.0)}),
            component("imu", None, laid("plate.origin", np.eye(4)), frame=True, mounts={"lens": t(0, 0.1, 0)}),
            component("dot", None, laid("imu.lens", np.eye(4)), frame=True),
        ],
    )
    found = linked(model, PLATE, CAP, FINGER)
    assert at(found, "hand/cap") == pytest.approx(t(0, 0, 0.5) @ MATE @ inv(t(0.01, 0, 0) @ rx(1.0)), abs=1e-14)
    assert at(found, "dot") == pytest.approx(t(0, 0.1, 0))
    assert list(found.occurrences[0].mounts) == ["origin", "seat", "side", "shaft"]
    cap = found.occurrences[found.mates[0].child]
    assert as_matrix(cap.mounts[found.mates[0].child_mount].pose) == pytest.approx(t(0.01, 0, 0) @ rx(1.0))


def test_exported_mounts_can_be_exported_again() -> None:
    outer = assembly("outer", [component("h", hand())], mounts={"point": "h.tip"})
    model = assembly(
        "a", [component("o", outer), component("dot", None, laid("o.point", np.eye(4)), frame=True)], mounts={"far": "o.point"}
    )
    found = linked(model, CAP, FINGER)
    assert at(found, "dot", {"o/h/knuckle": 0.2}) == pytest.approx(
        mated(SEAT, BACK, kind="revolute", q=0.2) @ t(0, 0, 0.08) @ rx(0.2), abs=1e-14
    )
    assert [(m.path, m.occurrence, m.mount) for m in found.exported] == [
        ("far", 1, "end"),
        ("o/point", 1, "end"),
        ("o/h/tip", 1, "end"),
        ("o/h/grip", 0, "grip"),
    ]


def test_two_uses_of_a_definition_have_separate_joints() -> None:
    """The prototype shared the state of a joint between the uses of its definition."""
    leg = hand()
    model = assembly(
        "a",
        [
            component("plate", "p:Plate"),
            component("front", leg, attach("front.grip", "plate.seat")),
            component("rear", leg, attach("rear.grip", "plate.side")),
        ],
    )
    found = linked(model, PLATE, CAP, FINGER)
    assert [j.path for j in joints_of(found)] == ["front/knuckle", "rear/knuckle"]
    q = {"front/knuckle": 0.5, "rear/knuckle": -0.25}
    for name, seat in (("front", SEAT), ("rear", BACK)):
        expected = mated(seat, BACK) @ mated(SEAT, BACK, kind="revolute", q=q[f"{name}/knuckle"])
        assert at(found, f"{name}/finger", q) == pytest.approx(expected, abs=1e-14)
    only_front = poses(found, {"front/knuckle": 0.5})
    assert only_front[4] == found.rest[4]
    assert only_front[2] != found.rest[2]


def test_mimic_chains_are_resolved_by_path() -> None:
    inner = assembly(
        "hand",
        [component("cap", "p:Cap"), component("a", "p:Finger"), component("b", "p:Finger"), component("c", "p:Finger")],
        [
            joint("third", "cap.grip", "c.root", mimic=mimic("second", 2.0, 0.1), lower=None, upper=None),
            joint("first", "cap.top", "a.root"),
            joint("second", "cap.top", "b.root", mimic=mimic("first", -1.0), lower=None, upper=None),
        ],
    )
    found = linked(assembly("a", [component("hand", inner)]), CAP, FINGER)
    joints = joints_of(found)
    assert {j.path: j.mimic.joint for j in joints if j.mimic} == {"hand/third": "hand.second", "hand/second": "hand.first"}
    assert coordinates(joints, {"hand/first": 0.3}) == pytest.approx({"hand/third": -0.5, "hand/first": 0.3, "hand/second": -0.3})
    assert coordinates(joints, {"hand/second": 0.2}) == pytest.approx({"hand/third": 0.5, "hand/first": 0.0, "hand/second": 0.2})
    assert at(found, "hand/c", {"hand/first": 0.3}) == pytest.approx(mated(BACK, BACK, kind="revolute", q=-0.5), abs=1e-14)


def test_origins_include_the_chain_of_documents() -> None:
    deep = assembly(
        "hand",
        [component("cap", "p:Cap", line=5), component("finger", "p:Finger", line=6)],
        [joint("j", "cap.top", "finger.root", line=7)],
    )
    found = linked(assembly("a", [component("h", deep, line=30)]), CAP, FINGER)
    assert [s.line for s in found.occurrences[1].origin] == [6, 30]
    assert [s.line for s in joints_of(found)[0].origin] == [7, 30]
    assert found.occurrences[0].origin == where(5) + where(30)


def test_reference_without_mount_means_origin() -> None:
    placement = laid("plate.seat", np.eye(4))
    bare_reference = type(placement)(
        to=Reference(path=("plate",), mount=None, origin=where(1)), pose=placement.pose, origin=where(1)
    )
    found = linked(assembly("a", [component("plate", "p:Plate"), component("dot", None, bare_reference, frame=True)]), PLATE)
    assert at(found, "dot") == pytest.approx(np.eye(4))


def test_linking_is_linear_in_the_components(monkeypatch: pytest.MonkeyPatch) -> None:
    """The number of pose products is counted instead of the time."""
    from thingc.base.pose import Pose

    products = 0
    plain = Pose.__matmul__

    def counted(self: Pose, other: Pose) -> Pose:
        nonlocal products
        products += 1
        return plain(self, other)

    def build(count: int) -> int:
        nonlocal products
        chain = [component("c0", "p:Plate")]
        chain += [component(f"c{k}", "p:Plate", attach(f"c{k}.side", f"c{k - 1}.seat")) for k in range(1, count)]
        products = 0
        linked(assembly("a", chain), PLATE)
        return products

    monkeypatch.setattr(Pose, "__matmul__", counted)
    small, large = build(100), build(1000)
    assert large < 10.5 * small
    assert large < 12 * 1000


def test_long_chain_does_not_exceed_recursion_limit() -> None:
    chain = [component("c0", "p:Plate")] + [component(f"c{k}", "p:Plate") for k in range(1, 3000)]
    joints = [joint(f"j{k}", f"c{k - 1}.top", f"c{k}.bottom") for k in range(1, 3000)]
    record = box("p:Plate", mounts={"top": t(0, 0, 0.1), "bottom": rx(math.pi)})
    found = linked(assembly("a", chain, joints), record)
    # bottom mated to top: a shift of 0.1 along z each, and a turn about z
    assert found.rest[-1].translation == pytest.approx((0, 0, 299.9), abs=1e-6)


def test_thing_without_geometry_has_zero_mass() -> None:
    found = linked(
        assembly("a", [component("plate", "p:Plate"), component("mark", "p:Mark", attach("mark.origin", "plate.seat"))]),
        PLATE,
        bare("p:Mark"),
    )
    assert found.occurrences[1].properties.mass == 0.0
