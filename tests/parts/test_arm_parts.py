"""Each printed part of the arm: valid solids over the whole range of its parameters, and errors."""

from __future__ import annotations

from math import pi

import pytest
from build123d import Vector

import arm
from thingc import ParameterError
from thingc.geometry.things.inspection import expectations_of, mounts_of

SWEEP = [
    (arm.BasePlate, {}), (arm.BasePlate, {"size": 90, "thickness": 3, "wall": 3}),
    (arm.BasePlate, {"size": 300, "thickness": 15, "wall": 10}),
    (arm.YawPitchBracket, {}), (arm.YawPitchBracket, {"thickness": 4.5, "wall": 3}),
    (arm.YawPitchBracket, {"thickness": 12, "wall": 10}),
    (arm.RotorBrace, {}), (arm.RotorBrace, {"length": 60, "thickness": 2.4}), (arm.RotorBrace, {"length": 60, "thickness": 5}),
    (arm.RotorBrace, {"length": 200, "thickness": 2.4}), (arm.RotorBrace, {"length": 200, "thickness": 5}),
    (arm.OmegaCap, {}), (arm.OmegaCap, {"pen_diameter": 6, "thickness": 2, "width": 8}),
    (arm.OmegaCap, {"pen_diameter": 30, "thickness": 6, "width": 30}),
    (arm.Hand, {}), (arm.Hand, {"pen_diameter": 6, "clearance": 19, "thickness": 2.4, "front": 4}),
    (arm.Hand, {"pen_diameter": 30, "clearance": 60, "thickness": 6, "front": 10}), (arm.Hand, {"pen_diameter": 30}),
    (arm.PenDummy, {}), (arm.PenDummy, {"length": 40, "diameter": 30}), (arm.PenDummy, {"length": 250, "diameter": 6}),
]


@pytest.mark.parametrize(("family", "parameters"), SWEEP)
def test_parts_are_closed_solids_for_all_parameters(family, parameters, meshes, pieces):
    thing = family(**parameters)
    solid = thing.result()
    assert solid.is_valid and len(solid.solids()) == 1 and solid.volume > 0
    mesh = meshes(thing)  # a closed, oriented mesh, or manifold3d refuses it
    assert mesh.volume() == pytest.approx(solid.volume, rel=0.01)
    assert len(mesh.decompose()) == 1
    own = pieces(thing)
    assert all(piece.volume() == pytest.approx(piece.hull().volume(), rel=1e-3) for piece in own), "a piece is not convex"
    union = own[0]
    for piece in own[1:]:
        union = union + piece
    assert (mesh - union).volume() <= 1e-4 * mesh.volume(), "the collision pieces do not hold the part"


def test_brace_has_its_length():
    for length in (60, 87.5, 200):
        brace = arm.RotorBrace(length=length)
        rotor, seat = brace.rotor_seat.location, brace.servo_seat.location
        # Axis to axis: the next servo's axis is 35.25 mm beyond its bottom (drawing X-430), on which the brace ends.
        assert tuple(rotor.position) == pytest.approx((0, 0, 19), abs=1e-9)
        assert tuple(seat.position) == pytest.approx((0, length - 35.25, 0), abs=1e-9)
        assert tuple(rotor.z_axis.direction) == pytest.approx((0, 0, -1), abs=1e-9)
        assert tuple(seat.z_axis.direction) == pytest.approx((0, 1, 0), abs=1e-9)


def test_pen_of_any_diameter_touches_the_hand():
    for diameter in (6, 15, 30):
        cap = arm.OmegaCap(pen_diameter=diameter)
        assert tuple(cap.pen.location.position) == pytest.approx((0, 0, diameter / 2 + 0.05), abs=1e-9)
        solid, middle = cap.result(), Vector(0, 0, diameter / 2 + 0.05)
        for side in (Vector(1, 0, 0), Vector(-1, 0, 0), Vector(0, 0, 1)):
            assert not solid.is_inside(middle + side * (diameter / 2 + 0.05))
            assert solid.is_inside(middle + side * (diameter / 2 + 0.15))
            assert solid.is_inside(middle + side * (diameter / 2 + 3.0))
            assert not solid.is_inside(middle + Vector(0, 0, 1) * (diameter / 2 + 3.15))


def test_pen_has_the_volume_of_its_formula():
    pen = arm.PenDummy(length=100, diameter=15)
    whole = pi * 7.5**2 * 100 + pi * 7.5**2 * 10 / 3
    assert 0.97 * whole < pen.result().volume < whole
    assert tuple(pen.tip.location.position) == pytest.approx((0, 0, 60))
    assert tuple(pen.result().bounding_box().max)[2] == pytest.approx(60, abs=1e-6)
    assert tuple(pen.tip.location.z_axis.direction) == pytest.approx((0, 0, 1))
    assert pen.groundplane.area == pytest.approx(pi * 7.5**2)


def test_invalid_parameters_are_errors():
    with pytest.raises(ParameterError, match="`length` of `RotorBrace` must be at least 60 mm, found 59 mm"):
        arm.RotorBrace(length=59)
    with pytest.raises(ParameterError, match="`pen_diameter` of `Hand` must be at most 30 mm, found 31 mm"):
        arm.Hand(pen_diameter=31)


@pytest.mark.parametrize(
    ("thing", "expected"),
    [
        (arm.BasePlate, {("servo_seat", "XM430", "back")}),
        (arm.YawPitchBracket, {("yaw_seat", "XM430", "rotor"), ("shoulder_seat", "XM430", "bottom")}),
        (arm.RotorBrace, {("rotor_seat", "XM430", "rotor"), ("servo_seat", "XM430", "bottom")}),
        (arm.Hand, {("rotor_seat", "XM430", "rotor"), ("cap_seat", "OmegaCap", "seat")}),
    ],
)
def test_parts_state_their_expected_neighbours(thing, expected):
    found = expectations_of(thing())
    assert {(one.mount, one.family.__name__, one.child_mount) for one in found} == expected
    assert all(one.parameters == {"idler": True} for one in found if one.family.__name__ == "XM430")


def test_hand_expects_the_cap_for_its_pen():
    (cap,) = (one for one in expectations_of(arm.Hand(pen_diameter=9)) if one.mount == "cap_seat")
    assert cap.parameters == {"pen_diameter": 9.0, "thickness": 3.0, "width": 12.0}


def test_mounts_are_named():
    assert set(mounts_of(arm.BasePlate())) == {"bottom", "servo_seat"} | {f"table_{k}" for k in range(4)} | {
        f"servo_screw_{k}" for k in range(8)
    }
    assert set(mounts_of(arm.OmegaCap())) == {"seat", "pen", "screw_0", "screw_1"}
    assert {"yaw_seat", "shoulder_seat", "board"} <= set(mounts_of(arm.YawPitchBracket()))
