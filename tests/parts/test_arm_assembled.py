"""The arm, assembled with the chain of matrices in `conftest.py`: holes are aligned, parts do not overlap, and collision pieces have no
false contacts."""

from __future__ import annotations

from itertools import combinations
from math import cos, pi, radians, sin

import numpy as np
import pytest
from build123d import Vector

from .conftest import POSES, mount_frame, put_together

NEIGHBOURS = {("base", "bracket"), ("bracket", "humerus"), ("humerus", "forearm"), ("forearm", "hand")}
"""Links that a joint connects. Simulators exclude their contacts."""

# Holes of the XM430 (drawing X-430), in its frame: mouth and direction out of the material.
SIDES = [((sx * 14.25, y, z), (sx, 0, 0)) for sx in (1, -1) for y in (-4, -28) for z in (6, -6)]
LOWER_SIDES = [hole for hole in SIDES if hole[0][1] == -28]
CIRCLE = [(8 * cos(radians(45 * k)), 8 * sin(radians(45 * k))) for k in range(8)]
HORN = [((x, y, 19), (0, 0, 1)) for x, y in CIRCLE]
IDLER = [((x, y, -19), (0, 0, -1)) for x, y in CIRCLE]
BOTTOM_FRONT = [((x, -35.25, 6), (0, -1, 0)) for x in (8, -8)]
BOTTOM_REAR = [((x, -35.25, -6), (0, -1, 0)) for x in (8, -8)]

M2, M25 = 2.4 / 2, 2.9 / 2
"""Radii of clearance holes, ISO 273 medium."""

FASTENED = [  # fixture, servo, its holes, how far above the servo's face the hole is looked at, radius
    ("plate", "yaw_servo", SIDES, 2.5, M25),
    ("bracket", "yaw_servo", HORN, 1.0, M2),
    ("bracket", "shoulder_servo", LOWER_SIDES, 2.5, M25),
    ("humerus", "shoulder_servo", HORN, 1.5, M2),
    ("humerus_idler", "shoulder_servo", IDLER, 1.5, M2),
    ("humerus", "elbow_servo", BOTTOM_FRONT, 1.5, M25),
    ("humerus_idler", "elbow_servo", BOTTOM_REAR, 1.5, M25),
    ("forearm", "elbow_servo", HORN, 1.5, M2),
    ("forearm_idler", "elbow_servo", IDLER, 1.5, M2),
    ("forearm", "wrist_servo", BOTTOM_FRONT, 1.5, M25),
    ("forearm_idler", "wrist_servo", BOTTOM_REAR, 1.5, M25),
    ("hand/fixture", "wrist_servo", HORN, 1.5, M2),
]


@pytest.fixture(scope="module")
def straight():
    """The arm with joint angles at which the holes of horns are aligned with those of their fixtures."""
    return put_together((0.0, 0.0, 0.0, 0.0))


@pytest.mark.parametrize(("fixture", "servo", "holes", "above", "radius"), FASTENED)
def test_holes_of_fixtures_and_servos_are_aligned(straight, fixture, servo, holes, above, radius):
    solid = straight[fixture].thing.result()
    seen = np.linalg.inv(straight[fixture].pose) @ straight[servo].pose
    for mouth, out in holes:
        mouth, out = np.array(mouth, float), np.array(out, float)
        across = np.array([out[1], out[2], out[0]])
        for side in (across, np.cross(out, across), -across, -np.cross(out, across)):
            for r, filled in ((0.0, False), (radius - 0.05, False), (radius + 0.05, True)):
                point = seen @ np.append(mouth + above * out + r * side, 1.0)
                assert solid.is_inside(Vector(*point[:3])) is filled, (mouth, r)


def test_screws_of_the_cap_fit_holes_of_the_hand(straight):
    cap, hand = straight["hand/cap"], straight["hand/fixture"]
    for k in range(2):
        screw = straight[f"hand/cap_screw_{k}"]
        for part, along, radius in ((cap, -1.5, 3.4 / 2), (hand, -5.5, 2.5 / 2)):
            seen = np.linalg.inv(part.pose) @ screw.pose
            for angle in (0.0, 1.5, 3.0, 4.5):
                for r, filled in ((radius - 0.05, False), (radius + 0.05, True)):
                    point = seen @ np.array([r * cos(angle), r * sin(angle), along, 1.0])
                    assert part.thing.result().is_inside(Vector(*point[:3])) is filled


def test_servo_axes(straight):
    """The axis of every servo, from dimensions of the drawing: 35.25 mm above a bottom, 19 mm behind the face of a horn."""
    axis = {name: (straight[name].pose[:3, 3], straight[name].pose[:3, 2]) for name in straight if name.endswith("servo")}
    heights = 5 + 34 + 2 + 5 + 35.25  # plate, case, horn, platform, bottom to axis
    expected = {
        "yaw_servo": ((0, 0, 5 + 17), (0, 0, 1)), "shoulder_servo": ((0, 0, heights), (0, 1, 0)),
        "elbow_servo": ((100, 0, heights), (0, 1, 0)), "wrist_servo": ((200, 0, heights), (0, 1, 0)),
    }
    for name, (position, direction) in expected.items():
        assert axis[name][0] == pytest.approx(np.array(position), abs=1e-9), name
        assert axis[name][1] == pytest.approx(np.array(direction), abs=1e-9), name


@pytest.mark.parametrize(("pose", "reach", "pen"), [
    ("stretched", 100, 15), ("folded", 100, 15), ("folded", 75, 30), ("home", 200, 30),
])
def test_parts_do_not_overlap(pose, reach, pen, meshes):
    """Exact meshes of every pair of parts, in the poses of the document. Only the screws of the cap overlap the hand: their thread, as a
    cylinder with its pitch diameter (3 - 0.6495 x 0.5), in holes of 2.5 mm."""
    arm = put_together(POSES[pose], reach, pen)
    there = {name: meshes(part.thing).transform(part.pose[:3]) for name, part in arm.items()}
    thread = pi / 4 * ((3 - 0.649519 * 0.5) ** 2 - 2.5**2) * 5
    for one, other in combinations(arm, 2):
        shared = (there[one] ^ there[other]).volume() if boxes_meet(there[one], there[other]) else 0.0
        if one == "hand/fixture" and other.startswith("hand/cap_screw"):
            assert shared == pytest.approx(thread, rel=0.05)
        else:
            assert shared < 1e-3, f"{one} and {other} share {shared:.3f} mm^3"


def test_tip_at_home_is_above_the_plate_and_points_down():
    arm = put_together(POSES["home"])
    tip = arm["hand/pen"].pose @ mount_frame(arm["hand/pen"].thing, "tip")
    # Planar: shoulder 81.25 mm up; humerus 60 deg up, forearm 60 deg down; the pen 34.55 mm before the wrist, 30 deg down.
    wrist = 5 + 34 + 2 + 5 + 35.25
    height = wrist - 34.55 * sin(radians(30)) - 60 * cos(radians(30))
    out = 100 + 34.55 * cos(radians(30)) - 60 * sin(radians(30))
    assert tip[:3, 3] == pytest.approx(np.array([out * cos(radians(30)), out * sin(radians(30)), height]), abs=1e-9)
    assert tip[2, 3] > 5 and tip[2, 2] == pytest.approx(-cos(radians(30)), abs=1e-9)


def boxes_meet(one, other):
    (*least, x, y, z), (*others, u, v, w) = one.bounding_box(), other.bounding_box()
    return all(low <= high for low, high in zip((*least, *others), (u, v, w, x, y, z)))


def touching_links(q, pieces, reach=100.0, pen=15.0):
    """Return the pairs of links between which MuJoCo finds a contact, with one body per link and the convex collision pieces of the
    parts. Contacts of links that a joint connects are excluded."""
    import mujoco

    spec, bodies, known = mujoco.MjSpec(), {}, {}
    for name, part in put_together(q, reach, pen).items():
        if "screw" in name:
            continue
        if part.link not in bodies:
            bodies[part.link] = spec.worldbody.add_body(name=part.link)
            bodies[part.link].add_freejoint()
        for number, piece in enumerate(pieces(part.thing)):
            mesh = known.setdefault((part.thing, number), f"mesh_{len(known)}")
            if spec.mesh(mesh) is None:
                raw = piece.to_mesh()
                vertices = (raw.vert_properties[:, :3] / 1000).flatten()
                spec.add_mesh(name=mesh, uservert=vertices, userface=raw.tri_verts.flatten())
            quaternion = np.zeros(4)
            mujoco.mju_mat2Quat(quaternion, part.pose[:3, :3].flatten())
            bodies[part.link].add_geom(
                type=mujoco.mjtGeom.mjGEOM_MESH, meshname=mesh, pos=part.pose[:3, 3] / 1000, quat=quaternion,
            )
    for one, other in NEIGHBOURS:
        spec.add_exclude(bodyname1=one, bodyname2=other)
    model = spec.compile()
    assert model.nbody == 6 and model.ngeom > 30
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    owner = [model.body(body).name for body in model.geom_bodyid]
    return {(owner[contact.geom1], owner[contact.geom2]) for contact in data.contact}


@pytest.mark.parametrize("pose", POSES)
def test_no_contacts_in_document_poses(pose, pieces):
    """No parts overlap in these poses, so every contact would be false."""
    assert touching_links(POSES[pose], pieces) == set()


def test_contact_of_a_thick_pen_with_the_shoulder(pieces, meshes):
    q = (0.0, -150.0, 130.0, 80.0)
    assert ("bracket", "hand") in {tuple(sorted(pair)) for pair in touching_links(q, pieces, reach=75, pen=30)}
    arm = put_together(q, 75, 30)
    servo, pen = (meshes(arm[name].thing).transform(arm[name].pose[:3]) for name in ("shoulder_servo", "hand/pen"))
    assert (servo ^ pen).volume() > 1
