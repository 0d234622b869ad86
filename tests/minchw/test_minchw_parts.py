"""Each part of MInchW: valid solids over the range of its parameters, positions of holes, and errors."""

from __future__ import annotations

from math import hypot, pi

import numpy as np
import pytest

from thingc import ParameterError
from thingc.geometry.things.inspection import expectations_of, mounts_of
from thingc_stock.cells import Cell18650, CellTray
from thingc_stock.dynamixel import XM540
from thingc_stock.magnets import MU_0, HoldingMagnet

from minchw.body import Chassis, Cover  # isort: skip
from minchw.leg import Foot, HipBracket, ThighBrace  # isort: skip

from .conftest import ANKLE_TO_SOLE, AXIS, FRONT_YAW, REAR_YAW, YAW_TO_KNEE, matrix

SWEEP = [  # both ends of the ranges; tests of the robot build the parts in between
    (Chassis, {"length": 90, "wall": 2.5}), (Chassis, {"length": 220, "wall": 6}),
    (Cover, {"length": 90, "wall": 2.5}), (Cover, {"length": 220, "wall": 6}),
    (HipBracket, {"thickness": 4.5}), (HipBracket, {"thickness": 8}),
    (ThighBrace, {"length": 62, "thickness": 2.4}), (ThighBrace, {"length": 140, "thickness": 6}),
    (Foot, {"thickness": 4.5, "rim": 1.6}), (Foot, {"thickness": 12, "rim": 6}),
    (CellTray, {"cells": 2, "wall": 1, "contact": 2}), (CellTray, {"cells": 4, "wall": 3, "contact": 5}),
    (Cell18650, {"diameter": 17, "length": 64}),
    (HoldingMagnet, {"diameter": 40, "height": 15, "pole": 2}),
    (HoldingMagnet, {"diameter": 80, "height": 50, "pole": 10}),
]


def meshed(solid, tolerance=0.05):
    import manifold3d

    vertices, triangles = solid.tessellate(tolerance, 0.2)
    mesh = manifold3d.Mesh(np.array([tuple(v) for v in vertices], dtype=np.float32), np.array(triangles, dtype=np.uint32))
    mesh.merge()
    found = manifold3d.Manifold(mesh)
    assert found.status() == manifold3d.Error.NoError
    return found


@pytest.mark.parametrize(("family", "parameters"), SWEEP)
def test_parts_are_closed_solids_for_all_parameters(family, parameters):
    thing = family(**parameters)
    solid = thing.result()
    assert solid.is_valid and len(solid.solids()) == 1 and solid.volume > 0
    mesh = meshed(solid)
    assert mesh.volume() == pytest.approx(solid.volume, rel=0.01)
    assert len(mesh.decompose()) == 1
    pieces = [meshed(piece) for piece in thing.collision() or []]
    if not pieces:
        assert family is CellTray  # it is inside a case and never touched
        return
    union = pieces[0]
    for piece in pieces:
        assert piece.volume() == pytest.approx(piece.hull().volume(), rel=1e-3), "a piece is not convex"
        union = union + piece
    assert (mesh - union).volume() <= 2e-4 * mesh.volume(), "the collision pieces do not hold the part"


@pytest.mark.parametrize("wall", [2.5, 6])
def test_holes_match_the_screws(wall):
    """There is no material on the axis of each screw through the whole wall, and there is material beside the hole."""
    length = 110
    chassis, cover, hip, foot = Chassis(length, wall), Cover(length, wall), HipBracket(wall + 2), Foot(wall + 2)
    brace = ThighBrace()
    end = wall + 2
    screws = [
        *((chassis, hole(end), end, 2.5) for servo in (chassis.front_servo, chassis.rear_servo) for hole in servo.screws_bottom),
        *((chassis, chassis.tray.fixing(k, wall), wall, 2.5) for k in (0, 1)),
        *((cover, cover.tray.fixing(k, wall), wall, 2.5) for k in (0, 1)),
        *((cover, screw, wall, 2.5) for screw in chassis_screws(cover, wall)),
        *((hip, hole(end), end, 2.5) for hole in hip.knee_servo.screws_bottom),
        *((hip, hole(end), end, 2.0) for hole in (*hip.yaw_servo.screws_horn[::2], *hip.yaw_servo.screws_idler[::2])),
        *((foot, hole(end), end, 2.5) for hole in foot.ankle_servo.screws_bottom),
        *((foot, hole(end), end, 3.0) for hole in foot.magnet.screws_back),
        *((brace, hole(4), 4, 2.5) for servo in (brace.knee_servo, brace.ankle_servo) for hole in servo.screws_horn[::2]),
    ]
    for thing, screw, depth, diameter in screws:
        tip = matrix(screw.seat.location)
        along, across = tip[:3, 2], tip[:3, 0]
        solid = thing.result()
        # From 0.2 mm below the face that is screwed on, to the other face: the seat looks into the material.
        for z in np.linspace(0.2, depth - 0.2, 4):
            spot = tip[:3, 3] + along * z
            assert not solid.is_inside(tuple(spot)), (thing, screw, z)
        beside = tip[:3, 3] + along * (depth - 0.6) + across * (diameter / 2 + 1.0)
        assert solid.is_inside(tuple(beside)), (thing, screw)


def chassis_screws(cover, wall):
    return cover.case.cover_screws(wall)


def test_braces_of_a_thigh_can_be_screwed_together():
    """Half a turn about y moves the tapped hole of one brace to the hole for the screw of the other brace."""
    brace = ThighBrace(length=80)
    solid = brace.result()
    seat = matrix(brace.screw[0].location)
    x, y, z = seat[:3, 3]
    assert y == pytest.approx(hypot(16.75, 13.75) + 0.5 + (4.68 + 4) / 2) and z == pytest.approx(6) and x == pytest.approx(4.68)
    mesh = meshed(solid)
    other = mesh.transform(np.array([[-1.0, 0, 0, 0], [0, 1, 0, 0], [0, 0, -1, 0]]))
    assert (mesh ^ other).volume() < 1e-3
    for depth in np.linspace(-5.8, 5.8, 9):  # through the web of one into the web of the other
        assert not solid.is_inside((x, y, depth)) if depth > 0 else not solid.is_inside((-x, y, -depth))
    assert solid.is_inside((x, y + 1.6, 3)) and solid.is_inside((-x, y + 1.2, 3))


def test_frames_and_distances_match_the_drawings():
    chassis, hip, foot, brace = Chassis(), HipBracket(), Foot(), ThighBrace(length=80)
    front, rear = (matrix(servo.origin.location) for servo in (chassis.front_servo, chassis.rear_servo))
    assert front[:3, 3] == pytest.approx([FRONT_YAW, 0, AXIS], abs=1e-9)
    assert rear[:3, 3] == pytest.approx([-REAR_YAW, 0, AXIS], abs=1e-9)
    for servo, out in ((front, 1), (rear, -1)):
        assert servo[:3, 2] == pytest.approx([0, 0, 1], abs=1e-12)
        assert servo[:3, 1] == pytest.approx([out, 0, 0], abs=1e-12)
    knee = matrix(hip.knee_servo.origin.location)
    assert knee[:3, 3] == pytest.approx([YAW_TO_KNEE, 0, 0], abs=1e-9)
    assert knee[:3, 2] == pytest.approx([0, 1, 0], abs=1e-12) and knee[:3, 1] == pytest.approx([1, 0, 0], abs=1e-12)
    ankle = matrix(brace.ankle_servo.origin.location)
    assert ankle[:3, 3] == pytest.approx([0, 80, 0], abs=1e-9)
    sole = matrix(foot.magnet.sole.location)
    assert sole[:3, 3] == pytest.approx([0, 0, -ANKLE_TO_SOLE], abs=1e-9)
    assert sole[:3, 2] == pytest.approx([0, 0, -1], abs=1e-12)


def test_parts_state_their_expected_neighbours():
    expected = {
        Chassis: {
            ("tray_seat", "CellTray", "base"), ("front_seat", "XM430", "bottom"), ("rear_seat", "XM430", "bottom"),
        },
        Cover: {("seat", "Chassis", "rim"), ("tray_seat", "CellTray", "base")},
        HipBracket: {("yaw_seat", "XM430", "rotor"), ("knee_seat", "XM540", "bottom")},
        ThighBrace: {("knee_seat", "XM540", "rotor"), ("ankle_seat", "XM540", "rotor")},
        Foot: {("servo_seat", "XM540", "bottom"), ("magnet_seat", "HoldingMagnet", "back")},
        CellTray: {(f"bay_{k}", "Cell18650", "side") for k in range(3)},
    }
    for family, mounts in expected.items():
        assert {(one.mount, one.family.__name__, one.child_mount) for one in expectations_of(family())} == mounts
    (case,) = (one for one in expectations_of(Cover(120, 4)) if one.mount == "seat")
    assert case.parameters == {"length": 120.0, "wall": 4.0}
    assert {"belly", "rim", "front_seat", "rear_seat", "board", "imu"} <= set(mounts_of(Chassis()))
    assert "lens" in mounts_of(Cover())


def test_invalid_parameters_are_errors():
    with pytest.raises(AssertionError, match="a case of 85 mm is too short for the cells: make it 5.00 mm longer"):
        Chassis(length=85)
    with pytest.raises(AssertionError, match="a thigh of 50 mm leaves no room for its web .*: make it 3.02 mm longer"):
        ThighBrace(length=50)
    with pytest.raises(ParameterError, match="`wall` of `Cover` must be at most 6 mm, found 7 mm"):
        Cover(wall=7)
    with pytest.raises(AssertionError, match="poles of 10 mm leave no room for a coil in a pot of 40 mm"):
        HoldingMagnet(diameter=40, pole=10)


def test_cell_has_the_size_and_mass_of_its_specification():
    cell = Cell18650()
    box = cell.result().bounding_box()
    assert tuple(box.size) == pytest.approx((18.4, 18.4, 65.0), abs=1e-6)
    assert cell.mass() == (0.047, "vendor")
    assert 0.97 * pi * 9.2**2 * 65 < cell.result().volume < pi * 9.2**2 * 65


def test_cells_are_side_by_side_and_in_series():
    tray = CellTray()
    places = [matrix(cell.origin.location) for cell in tray.cell]
    assert [place[2, 3] for place in places] == pytest.approx([1.5 + 9.2] * 3)
    assert np.diff([place[1, 3] for place in places]) == pytest.approx([19.2, 19.2])
    assert [place[0, 2] for place in places] == pytest.approx([1, -1, 1])
    mesh = meshed(tray.result())
    for cell in tray.cell:
        assert (meshed(cell.result()) ^ mesh).volume() < 1.0


def test_magnet_can_have_its_nominal_force():
    """The poles are far from saturation at 300 N, and the required flux density is common."""
    magnet = HoldingMagnet()
    assert magnet.pull() > 2 * 300
    assert magnet.pull(1.0) == pytest.approx(1.0 / MU_0 * pi * min(13.5**2, 25**2 - 21.5**2) * 1e-6)
    # Pot and core fill the cylinder but for a half-millimetre ring and two M3 threads, 6 mm deep.
    cylinder = pi * 25**2 * 20
    missing = pi * (21.5**2 - 13.5**2) * 0.5 + 2 * pi * 1.5**2 * 6 + pi * (25**2 - 24.5**2) * 1
    assert magnet.result().volume == pytest.approx(cylinder - missing, rel=1e-3)
    assert tuple(magnet.sole.location.z_axis.direction) == pytest.approx((0, 0, -1))
    screws = [matrix(hole(5).seat.location)[:3, 3] for hole in magnet.screws_back]
    assert screws == [pytest.approx([20, 0, 25]), pytest.approx([-20, 0, 25])]


def test_idlers_have_a_gap_of_a_tenth_of_a_millimetre():
    """Horn and idler of an XM540 differ by this distance (2.6 and 2.5 mm), and both braces of a thigh are equal parts."""
    servo, brace = XM540(), ThighBrace()
    assert brace.knee_seat.location.position.Z + servo.idler_z == pytest.approx(0.1)
