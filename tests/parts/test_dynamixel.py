"""The servos, compared with numbers of the ROBOTIS e-Manual and its drawings, which are repeated here. Sources:
emanual.robotis.com/docs/en/dxl/x/xm430-w350 and .../xm540-w270 ("Specifications", "Control Table"), drawings X-430 (XM430.N101.I101)
and X-540 (XM,H,D-540.N101.I101). Frame: x left, y top, z out of the horn, on the output axis."""

from __future__ import annotations

from math import cos, pi, radians, sin

import pytest
from build123d import Vector

from thingc import ParameterError
from thingc_stock.dynamixel import XM430, XM540, XSeries

SIZES = {XM430: (28.5, 46.5, 34.0), XM540: (33.5, 58.5, 44.0)}
OUTER = {  # axis to the top face; horn and idler: diameter, thickness; circle and thread of their 8 holes
    XM430: (11.25, 19.5, 2.0, 2.0, 16.0, 2.0),
    XM540: (13.75, 26.0, 2.6, 2.5, 22.0, 2.5),
}
HOLES = {  # name: position of the mouth, direction out of the material; all M2.5, 3 mm deep (XM540: 4 mm)
    XM430: {
        "left_top_front": ((14.25, -4, 6), (1, 0, 0)), "left_top_rear": ((14.25, -4, -6), (1, 0, 0)),
        "left_bottom_front": ((14.25, -28, 6), (1, 0, 0)), "left_bottom_rear": ((14.25, -28, -6), (1, 0, 0)),
        "right_top_front": ((-14.25, -4, 6), (-1, 0, 0)), "right_top_rear": ((-14.25, -4, -6), (-1, 0, 0)),
        "right_bottom_front": ((-14.25, -28, 6), (-1, 0, 0)), "right_bottom_rear": ((-14.25, -28, -6), (-1, 0, 0)),
        "front_left": ((11, -8, 17), (0, 0, 1)), "front_right": ((-11, -8, 17), (0, 0, 1)),
        "top_left": ((8, 11.25, 6), (0, 1, 0)), "top_right": ((-8, 11.25, 6), (0, 1, 0)),
        "bottom_left_front": ((8, -35.25, 6), (0, -1, 0)), "bottom_left_rear": ((8, -35.25, -6), (0, -1, 0)),
        "bottom_right_front": ((-8, -35.25, 6), (0, -1, 0)), "bottom_right_rear": ((-8, -35.25, -6), (0, -1, 0)),
    },
    XM540: {
        "left_top_front": ((16.75, -6, 8), (1, 0, 0)), "left_top_rear": ((16.75, -6, -8), (1, 0, 0)),
        "left_bottom_front": ((16.75, -38, 8), (1, 0, 0)), "left_bottom_rear": ((16.75, -38, -8), (1, 0, 0)),
        "right_top_front": ((-16.75, -6, 8), (-1, 0, 0)), "right_top_rear": ((-16.75, -6, -8), (-1, 0, 0)),
        "right_bottom_front": ((-16.75, -38, 8), (-1, 0, 0)), "right_bottom_rear": ((-16.75, -38, -8), (-1, 0, 0)),
        "front_left": ((13.5, -10.5, 22), (0, 0, 1)), "front_right": ((-13.5, -10.5, 22), (0, 0, 1)),
        "top_left": ((10, 13.75, 8), (0, 1, 0)), "top_right": ((-10, 13.75, 8), (0, 1, 0)),
        "bottom_left_front": ((10, -44.75, 8), (0, -1, 0)), "bottom_left_rear": ((10, -44.75, -8), (0, -1, 0)),
        "bottom_right_front": ((-10, -44.75, 8), (0, -1, 0)), "bottom_right_rear": ((-10, -44.75, -8), (0, -1, 0)),
    },
}
DEPTH = {XM430: 3.0, XM540: 4.0}
MODELS = pytest.mark.parametrize("model", [XM430, XM540])


@pytest.fixture(scope="module")
def solids():
    """The solid of each model."""
    return {model: model().result() for model in (XM430, XM540)}


def circle_holes(model):
    """Return the position and direction of the 8 holes of horn and idler, from +x towards +y, with their depth."""
    depth = SIZES[model][2]
    _, _, horn, idler, circle, _ = OUTER[model]
    for k in range(8):
        x, y = circle / 2 * cos(radians(45 * k)), circle / 2 * sin(radians(45 * k))
        yield "horn", k, (x, y, depth / 2 + horn), (0, 0, 1), horn
        yield "idler", k, (x, y, -depth / 2 - idler), (0, 0, -1), idler


def assert_hole(solid, mouth, out, depth, diameter):
    """Check that the solid has a blind hole: empty on its axis and just inside its wall, material just outside and below."""
    mouth, out = Vector(mouth), Vector(out)
    across = out.cross(Vector(0.3, 0.5, 0.7)).normalized()
    other = out.cross(across)
    for side in (across, other, across * -1, other * -1):
        middle = mouth - out * (depth / 2)
        assert not solid.is_inside(middle + side * (diameter / 2 - 0.05))
        assert solid.is_inside(middle + side * (diameter / 2 + 0.05))
    assert not solid.is_inside(mouth - out * (depth - 0.05))
    assert solid.is_inside(mouth - out * (depth + 0.05))
    assert not solid.is_inside(mouth + out * 0.05)


@MODELS
def test_solid_is_closed_and_has_the_published_size(model, solids):
    solid = solids[model]
    width, height, depth = SIZES[model]
    top, rim, horn, idler, _, _ = OUTER[model]
    tip = {XM430: 2.5, XM540: 3.0}[model]
    box = solid.bounding_box()
    assert solid.is_valid and len(solid.solids()) == 1
    assert tuple(box.min) == pytest.approx((-width / 2, top - height, -depth / 2 - idler), abs=1e-6)
    assert tuple(box.max) == pytest.approx((width / 2, top, depth / 2 + horn + tip), abs=1e-6)
    middle = depth / 2 + horn / 2
    assert solid.is_inside(Vector(0, rim / 2 - 0.05, middle)) and not solid.is_inside(Vector(0, rim / 2 + 0.05, middle))
    middle = -depth / 2 - idler / 2
    assert solid.is_inside(Vector(0, rim / 2 - 0.05, middle)) and not solid.is_inside(Vector(0, rim / 2 + 0.05, middle))


@MODELS
def test_mounts_are_on_faces_and_point_outwards(model):
    servo = model()
    width, height, depth = SIZES[model]
    top, _, horn, idler, _, _ = OUTER[model]
    middle = top - height / 2
    expected = {
        "left": ((width / 2, middle, 0), (1, 0, 0)), "right": ((-width / 2, middle, 0), (-1, 0, 0)),
        "top": ((0, top, 0), (0, 1, 0)), "bottom": ((0, top - height, 0), (0, -1, 0)),
        "front": ((0, middle, depth / 2), (0, 0, 1)), "back": ((0, middle, -depth / 2), (0, 0, -1)),
        "horn": ((0, 0, depth / 2 + horn), (0, 0, 1)), "rotor": ((0, 0, depth / 2 + horn), (0, 0, 1)),
        "idler": ((0, 0, -depth / 2 - idler), (0, 0, -1)),
    }
    for name, (position, out) in expected.items():
        location = getattr(servo, name).location
        assert tuple(location.position) == pytest.approx(position, abs=1e-9), name
        assert tuple(location.z_axis.direction) == pytest.approx(out, abs=1e-9), name
    assert servo.rotor.interface == f"x{'430' if model is XM430 else '540'}-horn"
    assert tuple(model(idler=False).idler.location.position) == pytest.approx((0, 0, -depth / 2))


@MODELS
def test_holes_of_the_case_match_the_drawing(model, solids):
    servo, depth = model(), DEPTH[model]
    for name, (mouth, out) in HOLES[model].items():
        assert_hole(solids[model], mouth, out, depth, 2.5)
        screw = getattr(servo, f"screw_{name}")(5.0)
        bearing, tip = screw.drive.location, screw.tip.location
        assert screw.p.size == "M2.5" and screw.p.length == 5.0 + depth
        assert tuple(bearing.z_axis.direction) == pytest.approx(out, abs=1e-9), name
        assert tuple(screw.seat.location.position) == pytest.approx(tuple(Vector(mouth) + Vector(out) * 5), abs=1e-9), name
        assert tuple(tip.position) == pytest.approx(tuple(Vector(mouth) - Vector(out) * depth), abs=1e-9), name
    listed = [*servo.screws_left, *servo.screws_right, *servo.screws_front, *servo.screws_top, *servo.screws_bottom]
    mouths = {tuple(round(c, 6) for c in hole(0.0).seat.location.position) for hole in listed}
    assert mouths == {tuple(map(float, mouth)) for mouth, _ in HOLES[model].values()}


@MODELS
def test_bolt_circles_of_horn_and_idler(model, solids):
    servo = model()
    thread = OUTER[model][5]
    for where, k, mouth, out, depth in circle_holes(model):
        assert_hole(solids[model], mouth, out, depth, thread)
        screw = getattr(servo, f"screws_{where}")[k](3.0)
        assert screw.p.size == f"M{thread:g}" and screw.p.length == 3.0 + depth
        assert tuple(screw.seat.location.position) == pytest.approx(tuple(Vector(mouth) + Vector(out) * 3), abs=1e-9)
        assert tuple(screw.drive.location.z_axis.direction) == pytest.approx(out, abs=1e-9)
    assert len(servo.screws_horn) == len(servo.screws_idler) == 8
    assert model(idler=False).screws_idler == []


@MODELS
def test_mass_and_actuator_equal_vendor_data(model):
    mass, torque, speed, gear = {XM430: (0.082, 4.1, 46, 353.5), XM540: (0.165, 10.6, 30, 272.5)}[model]
    actuator = model.actuator
    assert model().mass() == (mass, "vendor")
    assert (actuator.kind, actuator.stall_torque, actuator.gear_ratio) == ("position", torque, gear)
    assert actuator.no_load_speed == pytest.approx(speed * 2 * pi / 60, rel=1e-12)
    assert {actuator.sources[name] for name in ("stall_torque", "no_load_speed", "gear_ratio")} == {"vendor"}
    assert {actuator.sources[name] for name in ("rotor_inertia", "kp", "kv")} == {"estimated"}
    # Full duty (885 counts) at gain 800/128 is 141.6 steps of error, 12.4453125 deg: there the torque is that of the stall.
    assert actuator.kp * radians(12.4453125) == pytest.approx(torque, rel=1e-12)
    assert actuator.kv * actuator.no_load_speed == pytest.approx(torque, rel=1e-12)
    assert model.bom["make"] == "buy" and model.bom["number"] in model.__doc__


def test_armatures():
    # Fitted to the XM430-W350: 0.045 kg m^2 (MuJoCo Menagerie, robotis_op3). The XM540: similar rotors scale with the fifth
    # power of a length: 3.6011e-7 kg m^2 x (33.5 / 28.5)^5 = 8.0793e-7 kg m^2, times 272.5^2.
    assert XM430.actuator.armature == pytest.approx(0.045, rel=1e-12)
    assert XM540.actuator.armature == pytest.approx(0.0600, abs=2e-4)


@MODELS
def test_adjust_adds_play_on_each_side(model):
    width, height, depth = SIZES[model]
    top = OUTER[model][0]
    servo, roomy = model(), model().adjust(width__add=0.2, height__add=0.4, depth__add=0.6, boss_diameter__add=1)
    hull = roomy.case_hull().bounding_box()
    assert type(roomy) is model and model() is servo
    assert tuple(hull.min) == pytest.approx((-width / 2 - 0.1, top - height - 0.2, -depth / 2 - 0.3), abs=1e-6)
    assert tuple(hull.max) == pytest.approx((width / 2 + 0.1, top + 0.2, depth / 2 + 0.3), abs=1e-6)
    assert tuple(roomy.result().bounding_box().max)[:2] == pytest.approx((width / 2 + 0.1, top + 0.2), abs=1e-6)
    assert tuple(roomy.left.location.position)[0] == pytest.approx(width / 2 + 0.1)
    assert tuple(servo.left.location.position)[0] == pytest.approx(width / 2)
    assert tuple(roomy.rotor.location.position) == pytest.approx((0, 0, depth / 2 + OUTER[model][2] + 0.3))
    for name, (mouth, out) in HOLES[model].items():  # each hole moves with its face and stays in line with the servo's
        mouth_there = getattr(roomy, f"screw_{name}")(0.0).seat.location.position
        play = abs(Vector(out).dot(Vector(0.1, 0.2, 0.3)))
        assert tuple(mouth_there) == pytest.approx(tuple(Vector(mouth) + Vector(out) * play), abs=1e-9), name
    assert roomy.boss_hull(1.0).volume == pytest.approx(pi / 4 * (servo.p.boss_diameter + 1) ** 2)


def test_horn_without_room_for_holes_is_an_error():
    with pytest.raises(AssertionError, match="the holes of the horn are on a circle of 16 mm, which must lie between the boss"):
        XM430().adjust(horn_diameter=15)
    with pytest.raises(ParameterError, match="`width` of `XM430` must be at least 0.1 mm, found -1 mm"):
        XM430().adjust(width=-1)


@MODELS
def test_collision_pieces_are_convex_and_contain_the_servo(model, solids, pieces):
    own = pieces(model())
    assert all(piece.volume() == pytest.approx(piece.hull().volume(), rel=1e-4) for piece in own)
    union = own[0] + own[1] + own[2]
    assert union.volume() >= solids[model].volume
    assert union.volume() == pytest.approx(solids[model].volume, rel=0.04)


def test_idler_is_inside_its_hull():
    servo = XM430()
    rim = servo.idler_hull(2.0)
    box = rim.bounding_box()
    assert rim.volume == pytest.approx(pi / 4 * 19.5**2 * 2.0)
    assert [tuple(box.min)[2], tuple(box.max)[2]] == pytest.approx([-19, -17], abs=1e-6)


def test_base_class_is_not_a_part():
    from thingc.geometry.things.inspection import is_part

    assert is_part(XSeries) is None
    assert is_part(XM430) == is_part(XM540) == "thing"
